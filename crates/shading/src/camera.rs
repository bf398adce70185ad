//! Camera rays.

use std::f32::consts::{PI, TAU};

use glam::{Affine3A, Mat3A, Vec2, Vec3};
use heliostat_scene::{Camera, Projection};

use crate::placement::mix;
use crate::sampling::concentric_disk;

/// A camera made ready for one picture size.
#[derive(Clone, Debug)]
pub struct CameraRays {
    camera: Camera,
    /// Pixels.
    size: Vec2,
    world_from_camera: Affine3A,
}

/// One camera ray with its footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRay {
    /// World space.
    pub origin: Vec3,
    /// Unit length.
    pub direction: Vec3,
    /// Width of a pixel's cone at the origin (metres) and its growth per metre.
    pub cone: Cone,
}

/// The footprint of a pixel along a ray: an isotropic cone.
///
/// # References
/// Akenine-Möller et al., "Improved Shader and Texture Level of Detail Using Ray Cones", 2021.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cone {
    /// Metres.
    pub width: f32,
    /// Metres per metre.
    pub spread: f32,
}

impl Cone {
    /// The cone after a distance.
    pub fn advanced(self, distance: f32) -> Self {
        Self { width: self.width + self.spread * distance, spread: self.spread }
    }
}

impl CameraRays {
    /// For a picture of `width` × `height` pixels.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Self {
        Self {
            size: Vec2::new(width as f32, height as f32),
            world_from_camera: rigid(&camera.world_from_camera),
            camera: camera.clone(),
        }
    }

    /// The point all rays start from when the shutter opens, if there is one.
    pub fn common_origin(&self) -> Option<Vec3> {
        let orthographic = matches!(self.camera.projection, Projection::Orthographic { .. });
        (!orthographic && self.lens_radius() == 0.0).then(|| self.world_from_camera.translation.into())
    }

    fn lens_radius(&self) -> f32 {
        self.camera.lens.map_or(0.0, |lens| lens.radius)
    }

    /// Where the camera stands when the shutter opens, world space.
    pub fn position(&self) -> Vec3 {
        self.world_from_camera.translation.into()
    }

    /// The ray through a point of the picture (pixels, from the top left corner); `u_lens` picks a point on the lens;
    /// `time` lies in [0, 1] of the shutter interval.
    pub fn ray(&self, pixel: Vec2, u_lens: Vec2, time: f32) -> CameraRay {
        let ndc = (pixel - 0.5 * self.size) * Vec2::new(1.0, -1.0) / self.size.y;
        let (origin, direction, cone) = match self.camera.projection {
            Projection::Perspective { vertical_fov } => {
                let scale = 2.0 * (0.5 * vertical_fov).tan();
                let direction = (scale * ndc).extend(-1.0);
                (Vec3::ZERO, direction, Cone { width: 0.0, spread: scale / self.size.y })
            }
            Projection::Orthographic { height } => {
                let origin = (height * ndc).extend(0.0);
                (origin, Vec3::NEG_Z, Cone { width: height / self.size.y, spread: 0.0 })
            }
            Projection::Panoramic => {
                let (longitude, latitude) =
                    (TAU * (pixel.x / self.size.x - 0.5), PI * (0.5 - pixel.y / self.size.y));
                let (sin, cos) = longitude.sin_cos();
                let direction = Vec3::new(latitude.cos() * sin, latitude.sin(), -latitude.cos() * cos);
                (Vec3::ZERO, direction, Cone { width: 0.0, spread: PI / self.size.y })
            }
        };
        let (origin, direction) = self.through_lens(origin, direction, u_lens);
        let world_from_camera = match (self.camera.motion, time > 0.0) {
            (Some(end), true) => rigid(&mix(&self.camera.world_from_camera, &end, time)),
            _ => self.world_from_camera,
        };
        CameraRay {
            origin: world_from_camera.transform_point3(origin),
            direction: world_from_camera.transform_vector3(direction).normalize(),
            cone,
        }
    }

    /// Moves the origin over the lens and aims at the same point of the plane (or, for panoramas, sphere) in focus.
    fn through_lens(&self, origin: Vec3, direction: Vec3, u: Vec2) -> (Vec3, Vec3) {
        let Some(lens) = self.camera.lens.filter(|lens| lens.radius > 0.0) else {
            return (origin, direction);
        };
        let depth = if self.camera.projection == Projection::Panoramic { 1.0 } else { -direction.z };
        let focus = origin + direction * (lens.focus_distance / depth);
        let on_lens = lens.radius * concentric_disk(u);
        let origin = match self.camera.projection {
            // A panorama has no axis: the lens stands across each ray.
            Projection::Panoramic => {
                let (x, y) = direction.any_orthonormal_pair();
                origin + x * on_lens.x + y * on_lens.y
            }
            _ => origin + on_lens.extend(0.0),
        };
        (origin, focus - origin)
    }
}

/// The orientation and place of a transform: scale would distort directions.
fn rigid(place: &Affine3A) -> Affine3A {
    let back = Vec3::from(place.matrix3.z_axis).normalize_or(Vec3::Z);
    let right = Vec3::from(place.matrix3.y_axis).cross(back).try_normalize();
    let right = right.unwrap_or_else(|| back.any_orthonormal_vector());
    let axes = Mat3A::from_cols(right.into(), back.cross(right).into(), back.into());
    Affine3A { matrix3: axes, translation: place.translation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use heliostat_scene::Lens;

    fn camera(projection: Projection, lens: Option<Lens>) -> CameraRays {
        let mut camera =
            Camera::look_at("", Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 0.0), Vec3::Y, 1.0);
        camera.projection = projection;
        camera.lens = lens;
        CameraRays::new(&camera, 200, 100)
    }

    #[test]
    fn perspective_spans_the_vertical_field_of_view() {
        let rays = camera(Projection::Perspective { vertical_fov: 1.0 }, None);
        let top = rays.ray(Vec2::new(100.0, 0.0), Vec2::ZERO, 0.0).direction;
        let bottom = rays.ray(Vec2::new(100.0, 100.0), Vec2::ZERO, 0.0).direction;
        assert!((top.angle_between(bottom) - 1.0).abs() < 1e-5);
        assert!(top.y > 0.0, "row 0 is up");
        assert!(
            rays.ray(Vec2::new(200.0, 50.0), Vec2::ZERO, 0.0).direction.x > 0.0,
            "columns run to the right"
        );
        assert_eq!(rays.common_origin(), Some(Vec3::new(1.0, 2.0, 3.0)));
    }

    #[test]
    fn lens_rays_meet_in_the_plane_of_focus() {
        let lens = Lens { radius: 0.2, focus_distance: 2.0 };
        let rays = camera(Projection::Perspective { vertical_fov: 1.0 }, Some(lens));
        assert_eq!(rays.common_origin(), None);
        let at_focus = |u: Vec2| {
            let ray = rays.ray(Vec2::new(30.0, 80.0), u, 0.0);
            ray.origin + ray.direction * ((ray.origin.z - 1.0) / -ray.direction.z)
        };
        let spread = at_focus(Vec2::new(0.9, 0.1)).distance(at_focus(Vec2::new(0.2, 0.6)));
        assert!(spread < 1e-5, "{spread}");
    }

    #[test]
    fn orthographic_and_panoramic() {
        let rays = camera(Projection::Orthographic { height: 4.0 }, None);
        let ray = rays.ray(Vec2::new(100.0, 0.0), Vec2::ZERO, 0.0);
        assert!(
            ray.origin.distance(Vec3::new(1.0, 4.0, 3.0)) < 1e-5
                && ray.direction.distance(Vec3::NEG_Z) < 1e-6
        );
        let rays = camera(Projection::Panoramic, None);
        assert!(rays.ray(Vec2::new(100.0, 50.0), Vec2::ZERO, 0.0).direction.distance(Vec3::NEG_Z) < 1e-6);
        assert!(rays.ray(Vec2::new(150.0, 50.0), Vec2::ZERO, 0.0).direction.distance(Vec3::X) < 1e-6);
        assert!(rays.ray(Vec2::new(3.0, 0.0), Vec2::ZERO, 0.0).direction.distance(Vec3::Y) < 1e-6);
    }
}

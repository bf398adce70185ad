//! Camera rays, single ones and packets.

use std::f32::consts::{PI, TAU};

use fearless_simd::{Level, Simd};
use glam::{Affine3A, Mat3A, Vec2, Vec3};
use heliostat_scene::{Camera, Projection, StereoView};

use crate::basis::Basis;
use crate::lanes::{Floats, Packet, Real, Vector, Vectors, cos_sin_turns};
use crate::packet::on_lanes;
use crate::sampling::disk_lanes;
use crate::surface::LaneMode;

/// A camera made ready for one picture size.
#[derive(Clone, Debug)]
pub struct CameraRays {
    camera: Camera,
    /// Of one eye's picture, pixels.
    size: Vec2,
    world_from_camera: Affine3A,
    /// From heights of the picture to what the projection needs: tangents, metres, turns, sines.
    scale: f32,
    cone: Cone,
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

/// Where the rays of a packet go through the picture.
#[derive(Clone, Debug, Default)]
pub struct PicturePoints {
    /// Pixels, from the top left corner.
    pub pixel: [Floats; 2],
    /// Points of the unit square that pick a point on the lens.
    pub lens: [Floats; 2],
    /// In [0, 1] of the shutter interval.
    pub time: Floats,
}

/// From where a frame is seen as a whole, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewer {
    /// From a point.
    At(Vec3),
    /// From infinitely far away, in the direction of a unit vector.
    Towards(Vec3),
}

/// Camera rays, a lane each.
#[derive(Clone, Debug, Default)]
pub struct RayPacket {
    /// World space.
    pub origin: Vectors,
    /// Unit length.
    pub direction: Vectors,
}

/// A camera's place, per lane: origin and axes of unit length.
struct Place<F> {
    origin: Vector<F>,
    axes: [Vector<F>; 3],
}

impl CameraRays {
    /// For a picture of `width` × `height` pixels.
    pub fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let picture = Vec2::new(width as f32, height as f32);
        let size = match camera.stereo.map(|stereo| stereo.view) {
            Some(StereoView::SideBySide) => picture * Vec2::new(0.5, 1.0),
            Some(StereoView::OverUnder) => picture * Vec2::new(1.0, 0.5),
            _ => picture,
        };
        let (scale, cone) = match camera.projection {
            Projection::Perspective { vertical_fov } => {
                let scale = 2.0 * (0.5 * vertical_fov).tan();
                (scale, Cone { width: 0.0, spread: scale / size.y })
            }
            Projection::Orthographic { height } => (height, Cone { width: height / size.y, spread: 0.0 }),
            Projection::Panoramic => (1.0, Cone { width: 0.0, spread: PI / size.y }),
            // Half the picture's height is half the angle; the lanes' functions take turns.
            Projection::FisheyeEquidistant { fov } => (fov / TAU, Cone { width: 0.0, spread: fov / size.y }),
            Projection::FisheyeEquisolid { fov } => {
                let scale = 2.0 * (0.25 * fov).sin();
                (scale, Cone { width: 0.0, spread: 2.0 * scale / size.y })
            }
        };
        Self {
            size,
            world_from_camera: rigid(&camera.world_from_camera),
            camera: camera.clone(),
            scale,
            cone,
        }
    }

    /// The point all rays start from when the shutter opens, if there is one.
    pub fn common_origin(&self) -> Option<Vec3> {
        let spread = match (self.camera.projection, self.camera.stereo) {
            (Projection::Orthographic { .. }, _) => true,
            (_, None) => false,
            (Projection::Panoramic, Some(_)) => true,
            (_, Some(stereo)) => !matches!(stereo.view, StereoView::Left | StereoView::Right),
        };
        if spread || self.lens_radius() > 0.0 {
            return None;
        }
        Some(self.ray(Vec2::ZERO, Vec2::splat(0.5), 0.0).origin)
    }

    fn lens_radius(&self) -> f32 {
        self.camera.lens.map_or(0.0, |lens| lens.radius)
    }

    /// Columns and rows of one eye's picture.
    pub fn size(&self) -> Vec2 {
        self.size
    }

    /// Where the camera stands when the shutter opens, world space: between its eyes.
    pub fn position(&self) -> Vec3 {
        self.world_from_camera.translation.into()
    }

    /// From where shaders that do not ask for the ray see the scene: when the shutter opens, and between the eyes.
    pub fn viewer(&self) -> Viewer {
        match self.camera.projection {
            Projection::Orthographic { .. } => Viewer::Towards(self.world_from_camera.matrix3.z_axis.into()),
            _ => Viewer::At(self.position()),
        }
    }

    /// Where in the picture (pixels, from the top left corner) a point is seen, sharply and when the shutter opens; maybe
    /// outside of its edges. `None` if it lies behind the camera, or if the camera is not a single perspective one.
    pub fn project(&self, point: Vec3) -> Option<Vec2> {
        let Projection::Perspective { .. } = self.camera.projection else { return None };
        let way = point - self.position();
        let axis = |axis: glam::Vec3A| Vec3::from(axis).dot(way);
        let axes = self.world_from_camera.matrix3;
        let depth = -axis(axes.z_axis);
        if depth <= 0.0 || self.camera.stereo.is_some() {
            return None;
        }
        let heights = Vec2::new(axis(axes.x_axis), -axis(axes.y_axis)) / (depth * self.scale);
        Some(0.5 * self.size + heights * self.size.y)
    }

    /// The footprint of a pixel at the start of its ray; the same for all.
    pub fn cone(&self) -> Cone {
        self.cone
    }

    /// The ray through a point of the picture (pixels, from the top left corner); `u_lens` picks a point on the lens;
    /// `time` lies in [0, 1] of the shutter interval.
    pub fn ray(&self, pixel: Vec2, u_lens: Vec2, time: f32) -> CameraRay {
        let (origin, direction) = self.lanes::<f32>((), pixel.into(), u_lens.into(), time);
        CameraRay { origin: origin.into(), direction: direction.into(), cone: self.cone }
    }

    /// The rays through the first `count` points, of the same bits as [`Self::ray`] gives.
    pub fn rays(&self, mode: LaneMode, points: &PicturePoints, count: usize, out: &mut RayPacket) {
        on_lanes!(mode, count, |token, lane| ray_lanes::<_>(token, lane, self, points, out));
    }

    #[inline(always)]
    fn lanes<F: Real>(
        &self,
        token: F::Token,
        pixel: [F; 2],
        u_lens: [F; 2],
        time: F,
    ) -> (Vector<F>, Vector<F>) {
        let zero = F::constant(token, 0.0);
        let (pixel, eye) = self.eye(token, pixel);
        // From the picture's centre, in heights of the picture, y up.
        let x = (pixel[0] - 0.5 * self.size.x) * (1.0 / self.size.y);
        let y = (pixel[1] - 0.5 * self.size.y) * (-1.0 / self.size.y);
        let mut origin = Vector::grey(zero);
        let mut direction = Vector::new(zero, zero, F::constant(token, -1.0));
        // Along rays through the centre, in which direction the right eye lies.
        let mut aside = Vector::new(F::constant(token, 1.0), zero, zero);
        match self.camera.projection {
            Projection::Perspective { .. } => {
                direction = Vector::new(x * self.scale, y * self.scale, direction.z);
            }
            Projection::Orthographic { .. } => origin = Vector::new(x * self.scale, y * self.scale, zero),
            Projection::Panoramic => {
                let (cos, sin) = cos_sin_turns(pixel[0] * (1.0 / self.size.x) - 0.5);
                let (across, up) = cos_sin_turns((pixel[1] * (-1.0 / self.size.y) + 0.5) * 0.5);
                direction = Vector::new(across * sin, up, -(across * cos));
                aside = Vector::new(cos, zero, sin);
            }
            Projection::FisheyeEquidistant { .. } | Projection::FisheyeEquisolid { .. } => {
                direction = self.fisheye(x, y);
            }
        }
        if let (Some(stereo), Some(side)) = (self.camera.stereo, eye) {
            let offset = aside * (side * (0.5 * stereo.separation));
            direction = self.converged(direction, offset, stereo.convergence);
            origin = origin + offset;
        }
        let (origin, direction) = self.through_lens(origin, direction, u_lens);
        let place = self.place(token, time);
        let [right, up, back] = place.axes;
        let turned = right * direction.x + up * direction.y + back * direction.z;
        let moved = place.origin + right * origin.x + up * origin.y + back * origin.z;
        (moved, turned.normalized_or(-back))
    }

    /// The point of an eye's own picture, and which eye: −1 is the left one, 1 the right one.
    #[inline(always)]
    fn eye<F: Real>(&self, token: F::Token, [x, y]: [F; 2]) -> ([F; 2], Option<F>) {
        let (left, right) = (F::constant(token, -1.0), F::constant(token, 1.0));
        match self.camera.stereo.map(|stereo| stereo.view) {
            None => ([x, y], None),
            Some(StereoView::Left) => ([x, y], Some(left)),
            Some(StereoView::Right) => ([x, y], Some(right)),
            Some(StereoView::SideBySide) => {
                let second = x.ge(F::constant(token, self.size.x));
                ([(x - self.size.x).where_or(second, x), y], Some(right.where_or(second, left)))
            }
            Some(StereoView::OverUnder) => {
                let second = y.ge(F::constant(token, self.size.y));
                ([x, (y - self.size.y).where_or(second, y)], Some(right.where_or(second, left)))
            }
        }
    }

    /// The direction through a point of the picture, in heights of it from the centre.
    #[inline(always)]
    fn fisheye<F: Real>(&self, x: F, y: F) -> Vector<F> {
        let r = (x * x + y * y).sqrt();
        let (cos, sin) = match self.camera.projection {
            Projection::FisheyeEquisolid { .. } => {
                // The sine of half the angle is in proportion to the radius.
                let half = (r * self.scale).min(r.splat(1.0));
                let rest = (half * half).complement();
                (rest - half * half, half * rest.sqrt() * 2.0)
            }
            _ => cos_sin_turns((r * self.scale).min(r.splat(0.5))),
        };
        let across = (sin / r).only(r.gt(r.splat(0.0)));
        Vector::new(x * across, y * across, -cos)
    }

    /// A direction from an eye off the centre to the point that the centre sees at the distance of convergence.
    #[inline(always)]
    fn converged<F: Real>(&self, direction: Vector<F>, offset: Vector<F>, convergence: f32) -> Vector<F> {
        let depth = match self.camera.projection {
            Projection::Panoramic => return direction,
            Projection::FisheyeEquidistant { .. } | Projection::FisheyeEquisolid { .. } => {
                direction.x.splat(1.0)
            }
            _ => -direction.z,
        };
        // Infinity leaves the direction as it is.
        direction - offset * (depth * (1.0 / convergence))
    }

    /// Moves the origin over the lens and aims at the same point of the plane (or, for panoramas and fisheyes, sphere) in
    /// focus.
    #[inline(always)]
    fn through_lens<F: Real>(
        &self,
        origin: Vector<F>,
        direction: Vector<F>,
        u: [F; 2],
    ) -> (Vector<F>, Vector<F>) {
        let Some(lens) = self.camera.lens.filter(|lens| lens.radius > 0.0) else {
            return (origin, direction);
        };
        let zero = direction.x.splat(0.0);
        let [lens_x, lens_y] = disk_lanes(u);
        let (lens_x, lens_y) = (lens_x * lens.radius, lens_y * lens.radius);
        let (depth, on_lens) = match self.camera.projection {
            Projection::Perspective { .. } | Projection::Orthographic { .. } => {
                (-direction.z, Vector::new(lens_x, lens_y, zero))
            }
            // Without one axis, the lens stands across each ray.
            _ => {
                let basis = Basis::from_normal(direction.normalized_or(direction));
                (zero.splat(1.0), basis.to_world(Vector::new(lens_x, lens_y, zero)))
            }
        };
        let focus = direction * (depth.recip() * lens.focus_distance);
        (origin + on_lens, focus - on_lens)
    }

    /// Where the camera stands at a time.
    #[inline(always)]
    fn place<F: Real>(&self, token: F::Token, time: F) -> Place<F> {
        let constant = constant_place(token, &self.world_from_camera);
        let Some(end) = &self.camera.motion else { return constant };
        let open = constant_place(token, &self.camera.world_from_camera);
        let close = constant_place(token, end);
        // As for a place that does not move, per lane.
        let back = between(open.axes[2], close.axes[2], time).normalized_or(constant.axes[2]);
        let up = between(open.axes[1], close.axes[1], time);
        let right = up.cross(back).normalized_or(constant.axes[0]);
        let moves = time.gt(time.splat(0.0));
        Place {
            origin: between(open.origin, close.origin, time).where_or(moves, constant.origin),
            axes: [
                right.where_or(moves, constant.axes[0]),
                back.cross(right).where_or(moves, constant.axes[1]),
                back.where_or(moves, constant.axes[2]),
            ],
        }
    }
}

/// Between two vectors as [`mix`](crate::placement::mix) has it.
#[inline(always)]
fn between<F: Real>(open: Vector<F>, close: Vector<F>, time: F) -> Vector<F> {
    open * time.complement() + close * time
}

/// The entries of a transform in every lane.
#[inline(always)]
fn constant_place<F: Real>(token: F::Token, place: &Affine3A) -> Place<F> {
    let Mat3A { x_axis, y_axis, z_axis } = place.matrix3;
    Place {
        origin: Vector::constant(token, place.translation.into()),
        axes: [
            Vector::constant(token, x_axis.into()),
            Vector::constant(token, y_axis.into()),
            Vector::constant(token, z_axis.into()),
        ],
    }
}

#[inline(always)]
fn ray_lanes<F: Real>(
    token: F::Token,
    lane: usize,
    camera: &CameraRays,
    points: &PicturePoints,
    out: &mut RayPacket,
) {
    let [pixel_x, pixel_y] = &points.pixel;
    let [lens_u, lens_v] = &points.lens;
    let pixel = [gathered::<F>(token, pixel_x, lane), gathered(token, pixel_y, lane)];
    let u_lens = [gathered(token, lens_u, lane), gathered(token, lens_v, lane)];
    let time = gathered(token, &points.time, lane);
    let (origin, direction) = camera.lanes(token, pixel, u_lens, time);
    origin.store(&mut out.origin, lane);
    direction.store(&mut out.direction, lane);
}

/// Lanes that were written one by one.
#[inline(always)]
fn gathered<F: Real>(token: F::Token, from: &Floats, lane: usize) -> F {
    F::gather(token, lane, |lane| from.0[lane])
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
    use crate::lanes::WIDTH;
    use heliostat_kernel::Isa;
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
    fn points_are_seen_where_their_rays_pass() {
        let rays = camera(Projection::Perspective { vertical_fov: 1.0 }, None);
        for pixel in [Vec2::new(3.0, 97.5), Vec2::new(100.0, 50.0), Vec2::new(-20.0, 130.0)] {
            let ray = rays.ray(pixel, Vec2::ZERO, 0.0);
            let seen = rays.project(ray.origin + 7.0 * ray.direction).expect("before the camera");
            assert!((seen - pixel).length() < 1e-3, "{seen}, expected {pixel}");
            assert_eq!(rays.project(ray.origin - 7.0 * ray.direction), None);
        }
        let flat = camera(Projection::Orthographic { height: 1.0 }, None);
        assert_eq!(flat.project(Vec3::ZERO), None);
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

    #[test]
    fn fisheyes_have_their_angles() {
        let axis = Vec3::NEG_Z;
        for (projection, half) in [
            // At half the radius: half the angle, or half the sine of half the angle.
            (Projection::FisheyeEquidistant { fov: 2.0 }, 0.5),
            (Projection::FisheyeEquisolid { fov: 2.0 }, 2.0 * (0.5 * 0.5_f32.sin()).asin()),
        ] {
            let rays = camera(projection, None);
            let angle =
                |x: f32, y: f32| rays.ray(Vec2::new(x, y), Vec2::ZERO, 0.0).direction.angle_between(axis);
            assert!((angle(100.0, 0.0) - 1.0).abs() < 1e-5 && (angle(150.0, 50.0) - 1.0).abs() < 1e-5);
            assert!((angle(100.0, 25.0) - half).abs() < 1e-5, "{}", angle(100.0, 25.0));
            assert!(angle(100.0, 50.0) < 1e-3 && rays.common_origin().is_some());
            assert!(rays.ray(Vec2::new(100.0, 10.0), Vec2::ZERO, 0.0).direction.y > 0.0);
        }
        // Equal areas show equal solid angles, and the corner of a full sphere looks straight back.
        let rays = camera(Projection::FisheyeEquisolid { fov: TAU }, None);
        let ring = |r: f32| 1.0 + rays.ray(Vec2::new(100.0 + r, 50.0), Vec2::ZERO, 0.0).direction.z;
        assert!(
            (ring(20.0) / ring(10.0) - 4.0).abs() < 1e-3 && (ring(40.0) / ring(10.0) - 16.0).abs() < 1e-2
        );
        assert!(rays.ray(Vec2::ZERO, Vec2::ZERO, 0.0).direction.distance(Vec3::Z) < 1e-3);
    }

    #[test]
    fn eyes_see_the_same_at_the_distance_of_convergence() {
        let eyes = |projection, view| {
            let mut camera = Camera::look_at("", Vec3::ZERO, Vec3::NEG_Z, Vec3::Y, 1.0);
            camera.projection = projection;
            camera.stereo = Some(heliostat_scene::Stereo { separation: 0.5, convergence: 4.0, view });
            CameraRays::new(&camera, 200, 100)
        };
        let perspective = Projection::Perspective { vertical_fov: 1.0 };
        let [left, right] = [StereoView::Left, StereoView::Right].map(|view| eyes(perspective, view));
        let at = |rays: &CameraRays, x: f32, y: f32| rays.ray(Vec2::new(x, y), Vec2::ZERO, 0.0);
        let (a, b) = (at(&left, 30.0, 20.0), at(&right, 30.0, 20.0));
        assert!((a.origin - Vec3::new(-0.25, 0.0, 0.0)).length() < 1e-6);
        assert_eq!((left.common_origin(), right.common_origin()), (Some(a.origin), Some(b.origin)));
        let reach = |ray: CameraRay| ray.origin + ray.direction * (4.0 / -ray.direction.z);
        assert!(reach(a).distance(reach(b)) < 1e-5);
        // Side by side: each half is the picture of an eye, here of half the width.
        let both = eyes(perspective, StereoView::SideBySide);
        assert_eq!(both.common_origin(), None);
        assert!(at(&both, 50.0, 50.0).origin.x < 0.0 && at(&both, 150.0, 50.0).origin.x > 0.0);
        let seen = reach(at(&both, 50.0, 50.0)).distance(reach(at(&both, 150.0, 50.0)));
        assert!(seen < 1e-5, "{seen}");
        // A panorama's eyes lie beside each other whichever way one looks.
        let both = eyes(Projection::Panoramic, StereoView::OverUnder);
        for x in [10.0, 100.0, 170.0] {
            let (above, below) = (at(&both, x, 25.0), at(&both, x, 75.0));
            assert!(above.direction.distance(below.direction) < 1e-6);
            let way = below.origin - above.origin;
            assert!((way.length() - 0.5).abs() < 1e-6 && way.dot(above.direction).abs() < 1e-6);
            assert!(above.direction.cross(Vec3::Y).dot(way) > 0.0, "the right eye is on the right");
        }
    }

    #[test]
    fn packets_of_rays_have_the_bits_of_single_rays() {
        let lens = Some(Lens { radius: 0.1, focus_distance: 3.0 });
        let stereo = |view| heliostat_scene::Stereo { separation: 0.07, convergence: 2.0, view };
        for projection in [
            Projection::Perspective { vertical_fov: 1.0 },
            Projection::Orthographic { height: 3.0 },
            Projection::Panoramic,
            Projection::FisheyeEquidistant { fov: 3.0 },
            Projection::FisheyeEquisolid { fov: 6.0 },
        ] {
            for (lens, view) in [
                (None, None),
                (lens, None),
                (None, Some(StereoView::SideBySide)),
                (lens, Some(StereoView::Right)),
            ] {
                let mut camera = Camera::look_at("", Vec3::ONE, Vec3::ZERO, Vec3::Y, 1.0);
                let turned = Affine3A::from_rotation_y(0.3) * camera.world_from_camera;
                (camera.projection, camera.lens, camera.stereo) = (projection, lens, view.map(stereo));
                camera.motion = Some(turned);
                let rays = CameraRays::new(&camera, 64, 48);
                let mut points = PicturePoints::default();
                for lane in 0..WIDTH {
                    let [a, b, c, d] = crate::Sampler::along(lane as u32, 3).set(0);
                    let time = if lane % 3 == 0 { 0.0 } else { a * d };
                    (points.pixel[0].0[lane], points.pixel[1].0[lane]) = (a * 64.0, b * 48.0);
                    (points.lens[0].0[lane], points.lens[1].0[lane]) = (c, d);
                    points.time.0[lane] = time;
                }
                for level in Isa::available().into_iter().filter_map(Isa::level) {
                    let mut packet = RayPacket::default();
                    rays.rays(LaneMode::Packets(level), &points, WIDTH, &mut packet);
                    for lane in 0..WIDTH {
                        let pixel = Vec2::new(points.pixel[0].0[lane], points.pixel[1].0[lane]);
                        let u_lens = Vec2::new(points.lens[0].0[lane], points.lens[1].0[lane]);
                        let ray = rays.ray(pixel, u_lens, points.time.0[lane]);
                        assert_eq!(
                            (packet.origin.get(lane), packet.direction.get(lane)),
                            (ray.origin, ray.direction)
                        );
                    }
                }
            }
        }
    }
}

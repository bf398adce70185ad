//! Camera rays, single ones and packets.

mod shader;
#[cfg(test)]
mod tests;

use std::f32::consts::{PI, TAU};

use fearless_simd::{Level, Simd};
use glam::{Affine3A, Mat3A, Vec2, Vec3};
use heliostat_scene::{Camera, Projection, StereoView};

use crate::basis::Basis;
use crate::lanes::{Floats, Packet, Real, Vector, Vectors, cos_sin_turns};
use crate::packet::on_lanes;
use crate::sampling::disk_lanes;
use crate::shader::{ShaderProblem, ShaderRegistry};
use crate::surface::LaneMode;
pub use shader::{CameraInfo, CameraShader, PicturePlace, ShadedCamera};
pub(crate) use shader::{CameraProgram, camera_program};

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
    /// In place of the projection.
    shader: Option<ShadedCamera>,
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

impl PicturePoints {
    /// Sets a lane: the pixel, the point that picks one on the lens, and the time.
    pub fn set(&mut self, lane: usize, (pixel, lens, time): ([f32; 2], [f32; 2], f32)) {
        (self.pixel[0].0[lane], self.pixel[1].0[lane]) = (pixel[0], pixel[1]);
        (self.lens[0].0[lane], self.lens[1].0[lane]) = (lens[0], lens[1]);
        self.time.0[lane] = time;
    }
}

/// Camera rays, a lane each.
#[derive(Clone, Debug, Default)]
pub struct RayPacket {
    /// World space.
    pub origin: Vectors,
    /// Unit length.
    pub direction: Vectors,
}

/// Points of the picture as one eye sees it.
struct Film<F> {
    /// From the top left corner of the eye's picture.
    pixel: [F; 2],
    /// From the picture's centre, in heights of the picture, to the right and up.
    x: F,
    y: F,
    /// −1 is the left one, 1 the right one.
    eye: Option<F>,
}

/// A camera's place, per lane: origin and axes of unit length.
struct Place<F> {
    origin: Vector<F>,
    axes: [Vector<F>; 3],
}

impl CameraRays {
    /// For a picture of `width` × `height` pixels by a camera that may have a shader.
    ///
    /// # Errors
    /// [`ShaderProblem`] if there is no such shader or parameter, or a value is out of range or varies.
    pub fn with_shaders(
        camera: &Camera,
        (width, height): (u32, u32),
        shaders: &ShaderRegistry,
    ) -> Result<Self, ShaderProblem> {
        let mut rays = Self::new(camera, width, height);
        if let Some(wanted) = &camera.shader {
            rays.shader = Some(shaders.camera(wanted)?);
            rays.cone = rays.measured_cone();
        }
        Ok(rays)
    }

    /// For a picture of `width` × `height` pixels by the camera's projection, whatever its shader.
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
            shader: None,
        }
    }

    /// The footprint at the picture's centre, by the rays of neighbouring pixels.
    fn measured_cone(&self) -> Cone {
        let at = |offset: Vec2| self.ray(0.5 * self.size + offset, Vec2::splat(0.5), 0.0);
        let (centre, aside, below) = (at(Vec2::ZERO), at(Vec2::X), at(Vec2::Y));
        let apart = |of: fn(&CameraRay) -> Vec3| {
            of(&aside).distance(of(&centre)).max(of(&below).distance(of(&centre)))
        };
        let finite = |x: f32| if x.is_finite() { x } else { 0.0 };
        Cone { width: finite(apart(|ray| ray.origin)), spread: finite(apart(|ray| ray.direction)) }
    }

    /// The point all rays start from when the shutter opens, if there is one.
    pub fn common_origin(&self) -> Option<Vec3> {
        let spread = match (self.camera.projection, self.camera.stereo) {
            (Projection::Orthographic { .. }, _) => true,
            (_, None) => false,
            (Projection::Panoramic, Some(_)) => true,
            (_, Some(stereo)) => !matches!(stereo.view, StereoView::Left | StereoView::Right),
        };
        if spread || self.shader.is_some() || self.lens_radius() > 0.0 {
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
            Projection::Orthographic { .. } if self.shader.is_none() => {
                Viewer::Towards(self.world_from_camera.matrix3.z_axis.into())
            }
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
        if depth <= 0.0 || self.camera.stereo.is_some() || self.shader.is_some() {
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
        let (pixel, u_lens) = (pixel.to_array(), u_lens.to_array());
        if self.shader.is_some() {
            let (mut points, mut out) = (PicturePoints::default(), RayPacket::default());
            points.set(0, (pixel, u_lens, time));
            self.rays(LaneMode::Single, &points, 1, &mut out);
            return CameraRay { origin: out.origin.get(0), direction: out.direction.get(0), cone: self.cone };
        }
        let film = self.film::<f32>((), pixel);
        let (origin, direction) = self.placed((), &film, self.projected(&film), u_lens, time);
        CameraRay { origin: origin.into(), direction: direction.into(), cone: self.cone }
    }

    /// The rays through the first `count` points, of the same bits as [`Self::ray`] gives.
    pub fn rays(&self, mode: LaneMode, points: &PicturePoints, count: usize, out: &mut RayPacket) {
        if let Some(shader) = &self.shader {
            shader.run(mode, count, self, points, out);
        }
        on_lanes!(mode, count, |token, lane| ray_lanes::<_>(token, lane, self, points, out));
    }

    /// Where points of the picture (pixels) are on the film.
    #[inline(always)]
    fn film<F: Real>(&self, token: F::Token, pixel: [F; 2]) -> Film<F> {
        let (pixel, eye) = self.eye(token, pixel);
        let x = (pixel[0] - 0.5 * self.size.x) * (1.0 / self.size.y);
        let y = (pixel[1] - 0.5 * self.size.y) * (-1.0 / self.size.y);
        Film { pixel, x, y, eye }
    }

    /// Origins and directions of any length in camera space, and in which direction the right eye lies.
    #[inline(always)]
    fn projected<F: Real>(&self, film: &Film<F>) -> [Vector<F>; 3] {
        let Film { pixel, x, y, .. } = *film;
        let zero = x.splat(0.0);
        let ahead = Vector::new(zero, zero, x.splat(-1.0));
        let aside = Vector::new(x.splat(1.0), zero, zero);
        match self.camera.projection {
            Projection::Perspective { .. } => {
                [Vector::grey(zero), Vector::new(x * self.scale, y * self.scale, ahead.z), aside]
            }
            Projection::Orthographic { .. } => {
                [Vector::new(x * self.scale, y * self.scale, zero), ahead, aside]
            }
            Projection::Panoramic => {
                let (cos, sin) = cos_sin_turns(pixel[0] * (1.0 / self.size.x) - 0.5);
                let (across, up) = cos_sin_turns((pixel[1] * (-1.0 / self.size.y) + 0.5) * 0.5);
                let direction = Vector::new(across * sin, up, -(across * cos));
                [Vector::grey(zero), direction, Vector::new(cos, zero, sin)]
            }
            Projection::FisheyeEquidistant { .. } | Projection::FisheyeEquisolid { .. } => {
                [Vector::grey(zero), self.fisheye(x, y), aside]
            }
        }
    }

    /// Rays of camera space as an eye and the lens see them, in world space.
    #[inline(always)]
    fn placed<F: Real>(
        &self,
        token: F::Token,
        film: &Film<F>,
        [mut origin, mut direction, aside]: [Vector<F>; 3],
        u_lens: [F; 2],
        time: F,
    ) -> (Vector<F>, Vector<F>) {
        if let (Some(stereo), Some(side)) = (self.camera.stereo, film.eye) {
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

    /// Whether directions reach as far along the view axis everywhere.
    fn is_flat(&self) -> bool {
        let flat = matches!(
            self.camera.projection,
            Projection::Perspective { .. } | Projection::Orthographic { .. }
        );
        flat && self.shader.is_none()
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
        if matches!(self.camera.projection, Projection::Panoramic) && self.shader.is_none() {
            return direction;
        }
        let depth = if self.is_flat() { -direction.z } else { direction.x.splat(1.0) };
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
        let (depth, on_lens) = if self.is_flat() {
            (-direction.z, Vector::new(lens_x, lens_y, zero))
        } else {
            // Without one axis, the lens stands across each ray.
            let basis = Basis::from_normal(direction.normalized_or(direction));
            (zero.splat(1.0), basis.to_world(Vector::new(lens_x, lens_y, zero)))
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
    let film = camera.film(token, pixel);
    let ray = match &camera.shader {
        None => camera.projected(&film),
        Some(_) => {
            let zero = F::constant(token, 0.0);
            let (origin, direction) = (&out.origin, &out.direction);
            let aside = Vector::new(zero.splat(1.0), zero, zero);
            [Vector::load(token, origin, lane), Vector::load(token, direction, lane), aside]
        }
    };
    let (origin, direction) = camera.placed(token, &film, ray, u_lens, time);
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

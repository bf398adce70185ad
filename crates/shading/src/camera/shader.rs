//! Camera shaders: small programs that say which ray a point of the picture sees along.

use std::sync::Arc;

use fearless_simd::{Level, Simd};
use glam::Vec3;

use super::{CameraRays, PicturePoints, RayPacket, gathered};
use crate::lanes::{Packet, Real, Vector};
use crate::packet::on_lanes;
use crate::shader::{Constants, Parameter};
use crate::surface::LaneMode;

/// What there is to know about a camera shader.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraInfo {
    /// Its name.
    pub name: String,
    /// One line on what it shows.
    pub about: String,
    /// Its parameters: shaders refer to them by their place here.
    pub parameters: Vec<Parameter>,
}

/// A point of the picture.
#[derive(Clone, Copy, Debug)]
pub struct PicturePlace<F> {
    /// From the picture's centre, in heights of the picture, to the right.
    pub x: F,
    /// The same upwards.
    pub y: F,
    /// Width of the picture over its height.
    pub aspect: F,
    /// A point of the unit square, another one for each sample: for lenses of the shader's own.
    pub lens: [F; 2],
}

/// A camera shader over lanes, in place of a camera's projection. The camera's place and motion, its lens (which then
/// stands across each ray) and its eyes work as ever. Its functions must be `#[inline(always)]`; see [`crate::lanes`] for what
/// else lanes ask.
///
/// ```
/// use heliostat_shading::lanes::{Real, Vector};
/// use heliostat_shading::{CameraInfo, CameraShader, Constants, Parameter, PicturePlace, ShaderRegistry};
///
/// /// Straight lines across the picture, a cylinder's unrolled side along it.
/// #[derive(Debug)]
/// struct Cylinder;
///
/// impl CameraShader for Cylinder {
///     fn info(&self) -> CameraInfo {
///         let turns = Parameter::float("turns", 1.0, [0.01, 1.0], "", "of the picture's width");
///         CameraInfo { name: "cylinder".into(), about: String::new(), parameters: vec![turns] }
///     }
///
///     #[inline(always)]
///     fn ray<F: Real>(&self, at: &PicturePlace<F>, values: &Constants<'_, F>) -> [Vector<F>; 2] {
///         let turns = at.x / at.aspect * values.float(0);
///         let (cos, sin) = heliostat_shading::lanes::cos_sin_turns(turns);
///         let zero = at.x.splat(0.0);
///         [Vector::grey(zero), Vector::new(sin, at.y, -cos)]
///     }
/// }
///
/// let mut shaders = ShaderRegistry::built_in();
/// shaders.register_camera(Cylinder);
/// ```
///
/// Footprints are those of the picture's centre. Such rays are not traced as tiles of a common origin, and renderers do not
/// remember where points were in the frame before.
pub trait CameraShader: Send + Sync + std::fmt::Debug + 'static {
    /// Name, parameters and what else there is to know.
    fn info(&self) -> CameraInfo;

    /// Origin (metres) and direction (of any length) of the ray in camera space, where the camera looks along −Z with +Y up.
    /// Directions that are zero or not finite look along the axis; rays from places that are not finite meet nothing.
    fn ray<F: Real>(&self, at: &PicturePlace<F>, values: &Constants<'_, F>) -> [Vector<F>; 2];
}

/// A camera shader over packets in memory: what the engine calls.
pub(crate) trait CameraProgram: Send + Sync + std::fmt::Debug {
    fn info(&self) -> CameraInfo;

    /// Rays of camera space through the first `count` points, directions of unit length.
    fn run(
        &self,
        mode: LaneMode,
        count: usize,
        camera: (&CameraRays, &[Vec3]),
        points: &PicturePoints,
        out: &mut RayPacket,
    );
}

/// The program of a shader.
pub(crate) fn camera_program(shader: impl CameraShader) -> Arc<dyn CameraProgram> {
    Arc::new(OnLanes(shader))
}

#[derive(Debug)]
struct OnLanes<T>(T);

impl<T: CameraShader> CameraProgram for OnLanes<T> {
    fn info(&self) -> CameraInfo {
        self.0.info()
    }

    fn run(
        &self,
        mode: LaneMode,
        count: usize,
        camera: (&CameraRays, &[Vec3]),
        points: &PicturePoints,
        out: &mut RayPacket,
    ) {
        let shader = &self.0;
        on_lanes!(mode, count, |token, lane| rays::<_>(token, lane, shader, camera, points, out));
    }
}

#[inline(always)]
fn rays<F: Real>(
    token: F::Token,
    lane: usize,
    shader: &impl CameraShader,
    (camera, values): (&CameraRays, &[Vec3]),
    points: &PicturePoints,
    out: &mut RayPacket,
) {
    let ([x, y], [u, v]) = (&points.pixel, &points.lens);
    let film = camera.film::<F>(token, [gathered(token, x, lane), gathered(token, y, lane)]);
    let place = PicturePlace {
        x: film.x,
        y: film.y,
        aspect: F::constant(token, camera.size.x / camera.size.y),
        lens: [gathered(token, u, lane), gathered(token, v, lane)],
    };
    let [origin, direction] = shader.ray::<F>(&place, &Constants { token, values });
    let ahead = Vector::constant(token, Vec3::NEG_Z);
    origin.store(&mut out.origin, lane);
    direction.normalized_or(ahead).store(&mut out.direction, lane);
}

/// A shader with the values of its parameters.
#[derive(Clone, Debug)]
pub struct ShadedCamera {
    program: Arc<dyn CameraProgram>,
    values: Vec<Vec3>,
}

impl ShadedCamera {
    pub(crate) fn new(program: Arc<dyn CameraProgram>, values: Vec<Vec3>) -> Self {
        Self { program, values }
    }

    pub(super) fn run(
        &self,
        mode: LaneMode,
        count: usize,
        camera: &CameraRays,
        points: &PicturePoints,
        out: &mut RayPacket,
    ) {
        self.program.run(mode, count, (camera, &self.values), points, out);
    }
}

//! Environment shaders: small programs that say how much light comes from a direction outside the scene.
//!
//! A shader is written once, reads like scalar code and runs on lanes. Rays that leave the scene ask it itself, so that what is
//! seen is as sharp as the shader; light sampling draws directions from a table of it.

use std::sync::Arc;

use fearless_simd::{Level, Simd};
use glam::{Mat3, Vec2, Vec3};
use heliostat_scene::{EnvironmentMap, Image, ShadedEnvironment};

use crate::environment::MapLight;
use crate::lanes::{Packet, Real, Vector, Vectors, WIDTH};
use crate::packet::on_lanes;
use crate::shader::{Constants, Parameter};
use crate::sky::direction;
use crate::surface::LaneMode;

/// What there is to know about an environment shader.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentInfo {
    /// Its name.
    pub name: String,
    /// One line on what it looks like.
    pub about: String,
    /// Its parameters: shaders refer to them by their place here.
    pub parameters: Vec<Parameter>,
}

/// An environment shader over lanes. Its functions must be `#[inline(always)]`; see [`crate::lanes`] for what else lanes
/// ask.
///
/// ```
/// use heliostat_shading::lanes::{Real, Vector};
/// use heliostat_shading::{Constants, EnvironmentInfo, EnvironmentShader, Parameter, ShaderRegistry};
///
/// /// Brighter towards the zenith.
/// #[derive(Debug)]
/// struct Overcast;
///
/// impl EnvironmentShader for Overcast {
///     fn info(&self) -> EnvironmentInfo {
///         let zenith = Parameter::color("zenith", [1.0; 3], "radiance straight up");
///         EnvironmentInfo { name: "overcast".into(), about: String::new(), parameters: vec![zenith] }
///     }
///
///     #[inline(always)]
///     fn radiance<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F> {
///         let up = direction.y.max(direction.y.splat(0.0));
///         values.vector(0) * ((up + up + 1.0) * (1.0 / 3.0))
///     }
/// }
///
/// let mut shaders = ShaderRegistry::built_in();
/// shaders.register_environment(Overcast);
/// ```
///
/// Lights that are smaller than a third of a degree may be missed by light sampling: give them as lights.
pub trait EnvironmentShader: Send + Sync + std::fmt::Debug + 'static {
    /// Name, parameters and what else there is to know.
    fn info(&self) -> EnvironmentInfo;

    /// Radiance, W/(m²·sr), from a direction: of unit length, away from the scene, in the environment's space. What is negative
    /// or not finite counts as 0.
    fn radiance<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F>;
}

/// An environment shader over packets in memory: what the engine calls.
pub(crate) trait EnvironmentProgram: Send + Sync + std::fmt::Debug {
    fn info(&self) -> EnvironmentInfo;

    /// Radiance from the first `count` directions.
    fn run(&self, mode: LaneMode, count: usize, values: &[Vec3], directions: &Vectors, out: &mut Vectors);
}

/// The program of a shader.
pub(crate) fn environment_program(shader: impl EnvironmentShader) -> Arc<dyn EnvironmentProgram> {
    Arc::new(OnLanes(shader))
}

#[derive(Debug)]
struct OnLanes<T>(T);

impl<T: EnvironmentShader> EnvironmentProgram for OnLanes<T> {
    fn info(&self) -> EnvironmentInfo {
        self.0.info()
    }

    fn run(&self, mode: LaneMode, count: usize, values: &[Vec3], directions: &Vectors, out: &mut Vectors) {
        let shader = &self.0;
        on_lanes!(mode, count, |token, lane| radiance::<_>(token, lane, shader, values, directions, out));
    }
}

#[inline(always)]
fn radiance<F: Real>(
    token: F::Token,
    lane: usize,
    shader: &impl EnvironmentShader,
    values: &[Vec3],
    directions: &Vectors,
    out: &mut Vectors,
) {
    let direction = Vector::load(token, directions, lane);
    shader.radiance::<F>(direction, &Constants { token, values }).store(out, lane);
}

/// A shader made ready for lookup and importance sampling.
#[derive(Clone, Debug)]
pub struct ShaderLight {
    program: Arc<dyn EnvironmentProgram>,
    values: Vec<Vec3>,
    scale: Vec3,
    environment_from_world: Mat3,
    /// By which directions are drawn.
    pub(crate) table: MapLight,
}

/// Columns and rows of the table.
const TABLE: [u32; 2] = [512, 256];

impl ShaderLight {
    pub(crate) fn new(
        program: Arc<dyn EnvironmentProgram>,
        values: Vec<Vec3>,
        wanted: &ShadedEnvironment,
    ) -> Self {
        let (scale, world_from_environment) = (wanted.scale, wanted.world_from_environment);
        let ask = |count, directions: &Vectors, out: &mut Vectors| {
            program.run(LaneMode::default(), count, &values, directions, out);
        };
        let image = Arc::new(tabulate(TABLE, ask));
        let table = MapLight::new(&EnvironmentMap { image, scale, world_from_environment });
        Self { program, values, scale, environment_from_world: world_from_environment.inverse(), table }
    }

    /// Radiance from a world-space direction of unit length.
    pub(crate) fn radiance(&self, direction: Vec3) -> Vec3 {
        let (mut directions, mut out) = (Vectors::default(), Vectors::default());
        directions.set(0, (self.environment_from_world * direction).normalize_or(Vec3::Y));
        self.program.run(LaneMode::Single, 1, &self.values, &directions, &mut out);
        sound(out.get(0)) * self.scale
    }
}

/// Latitude by longitude, four directions per texel. `ask` answers for so many directions; the width must be a multiple of four.
pub(crate) fn tabulate([width, height]: [u32; 2], ask: impl Fn(usize, &Vectors, &mut Vectors)) -> Image {
    let size = Vec2::new(width as f32, height as f32);
    let (mut directions, mut out) = (Vectors::default(), Vectors::default());
    let mut pixels = Vec::with_capacity((width * height * 4) as usize);
    // Four texels to a packet.
    for first in (0..width * height).step_by(WIDTH / 4) {
        for lane in 0..WIDTH as u32 {
            let (texel, sample) = (first + lane / 4, lane % 4);
            let at = Vec2::new((texel % width) as f32, (texel / width) as f32);
            let within = Vec2::new((sample % 2) as f32, (sample / 2) as f32) * 0.5 + 0.25;
            directions.set(lane as usize, direction((at + within) / size));
        }
        ask(WIDTH, &directions, &mut out);
        for texel in 0..WIDTH / 4 {
            let sum: Vec3 = (0..4).map(|sample| sound(out.get(4 * texel + sample))).sum();
            pixels.extend((0.25 * sum).extend(1.0).to_array());
        }
    }
    Image::rgba_f32(width, height, pixels)
}

/// Radiance as it counts.
fn sound(radiance: Vec3) -> Vec3 {
    if radiance.is_finite() { radiance.max(Vec3::ZERO) } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::EnvironmentLight;
    use crate::sampling::uniform_sphere;
    use crate::shader::ShaderRegistry;
    use heliostat_scene::{ParameterValue, ShaderUse, TextureId, TextureRef};

    /// A lobe around the vertical, with nonsense below.
    #[derive(Debug)]
    struct Lobe;

    impl EnvironmentShader for Lobe {
        fn info(&self) -> EnvironmentInfo {
            let tint = Parameter::color("tint", [1.0, 0.5, 0.25], "");
            let strength = Parameter::float("strength", 2.0, [0.0, 10.0], "", "");
            EnvironmentInfo { name: "lobe".into(), about: String::new(), parameters: vec![tint, strength] }
        }

        #[inline(always)]
        fn radiance<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F> {
            let up = direction.y * direction.y * values.float(1);
            let nonsense = up.splat(f32::NAN);
            (values.vector(0) * up).where_or(direction.y.gt(up.splat(0.0)), Vector::grey(nonsense))
        }
    }

    fn registry() -> ShaderRegistry {
        let mut registry = ShaderRegistry::default();
        registry.register_environment(Lobe);
        registry
    }

    fn lobe(shader: ShaderUse) -> ShadedEnvironment {
        ShadedEnvironment { scale: Vec3::splat(0.5), ..ShadedEnvironment::new(shader) }
    }

    fn light() -> EnvironmentLight {
        registry().environment(&lobe(ShaderUse::named("lobe").with("strength", 3.0))).expect("there is one")
    }

    #[test]
    fn what_is_seen_is_exact() {
        let light = light();
        for y in [1.0, 0.6, 0.1] {
            let direction = Vec3::new((1.0_f32 - y * y).sqrt(), y, 0.0);
            let expected = Vec3::new(1.0, 0.5, 0.25) * (1.5 * y * y);
            assert!(light.radiance(direction).distance(expected) < 1e-6, "{y}");
            assert_eq!(light.radiance(-direction), Vec3::ZERO);
        }
    }

    #[test]
    fn sampling_is_consistent_with_lookup_and_mean() {
        let light = light();
        let n = 200;
        let (mut estimate, mut off) = (Vec3::ZERO, 0);
        for i in 0..n * n {
            let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
            let Some((direction, radiance, pdf)) = light.sample(u) else { panic!("not black") };
            // Rounding takes directions at the border of a texel to its neighbour.
            off += usize::from((light.pdf(direction) - pdf).abs() > 0.02 * pdf);
            assert_eq!(light.radiance(direction), radiance);
            estimate += radiance / pdf / (n * n) as f32;
        }
        assert!(off < n * n / 100, "{off} of {} densities differ", n * n);
        // The mean of y² over the upper half is 1/3, over the sphere half of that.
        let exact = Vec3::new(1.0, 0.5, 0.25) * (4.0 * std::f32::consts::PI * 1.5 / 6.0);
        assert!(estimate.distance(exact) < 2e-3 * exact.length(), "{estimate} instead of {exact}");
        let mean = light.mean() * 4.0 * std::f32::consts::PI;
        assert!(mean.distance(exact) < 1e-3 * exact.length(), "{mean} instead of {exact}");
        // A uniform estimate agrees, too.
        let uniform: Vec3 = (0..n * n)
            .map(|i| {
                let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
                light.radiance(uniform_sphere(u)) * (4.0 * std::f32::consts::PI / (n * n) as f32)
            })
            .sum();
        assert!(uniform.distance(exact) < 2e-3 * exact.length(), "{uniform} instead of {exact}");
    }

    #[test]
    fn mistakes_are_named() {
        let problem = |shader: ShaderUse| registry().environment(&lobe(shader)).expect_err("refused").0;
        assert_eq!(problem(ShaderUse::named("sun")), "there is no environment shader `sun`; there are: lobe");
        let unknown = problem(ShaderUse::named("lobe").with("size", 1.0));
        assert_eq!(unknown, "environment shader `lobe` has no parameter `size`; it has: tint, strength");
        let beyond = problem(ShaderUse::named("lobe").with("strength", 11.0));
        assert!(beyond.contains("`strength` of environment shader `lobe` is [11, 11, 11]"), "{beyond}");
        assert!(problem(ShaderUse::named("lobe").with("strength", f32::NAN)).contains("from 0 to 10"));
        let texture = ParameterValue::Texture(TextureRef::new(TextureId(0)), Vec3::ONE);
        assert!(problem(ShaderUse::named("lobe").with("tint", texture)).contains("cannot be a texture"));
    }
}

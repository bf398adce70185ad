//! Light shaders: small programs that say how strongly a light shines in a direction.
//!
//! A shader is written once, reads like scalar code and runs on lanes. Points that the light reaches ask it itself, so that its
//! edges are as sharp as the shader; what leaves the light, photons and light paths, takes directions from a table of it and the
//! intensity from the shader.

use std::sync::Arc;

use fearless_simd::{Level, Simd};
use glam::{Vec2, Vec3};

use crate::environment::distribution;
use crate::environment_shader::tabulate;
use crate::lanes::{Packet, Real, Vector, Vectors};
use crate::packet::on_lanes;
use crate::sampling::Discrete2d;
use crate::shader::{Constants, Parameter};
use crate::sky::{direction, solid_angle_density};
use crate::surface::LaneMode;

/// What there is to know about a light shader.
#[derive(Clone, Debug, PartialEq)]
pub struct LightInfo {
    /// Its name.
    pub name: String,
    /// One line on what its light looks like.
    pub about: String,
    /// Its parameters: shaders refer to them by their place here.
    pub parameters: Vec<Parameter>,
}

/// A light shader over lanes. Its functions must be `#[inline(always)]`; see [`crate::lanes`] for what else lanes ask.
///
/// ```
/// use heliostat_shading::lanes::{Real, Vector};
/// use heliostat_shading::{Constants, LightInfo, LightShader, Parameter, ShaderRegistry};
///
/// /// A small disk that glows: the cosine to its axis.
/// #[derive(Debug)]
/// struct Disk;
///
/// impl LightShader for Disk {
///     fn info(&self) -> LightInfo {
///         let tint = Parameter::color("tint", [1.0; 3], "W/sr along the axis");
///         LightInfo { name: "disk".into(), about: String::new(), parameters: vec![tint] }
///     }
///
///     #[inline(always)]
///     fn intensity<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F> {
///         values.vector(0) * -direction.z
///     }
/// }
///
/// let mut shaders = ShaderRegistry::built_in();
/// shaders.register_light(Disk);
/// ```
///
/// Photons and light paths may miss beams that are narrower than a degree; points are lit by them all the same.
pub trait LightShader: Send + Sync + std::fmt::Debug + 'static {
    /// Name, parameters and what else there is to know.
    fn info(&self) -> LightInfo;

    /// Radiant intensity, W/sr, in a direction: of unit length, away from the light, in light space, where the light aims along
    /// −Z with +Y up. What is negative or not finite counts as 0.
    fn intensity<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F>;
}

/// A light shader over packets in memory: what the engine calls.
pub(crate) trait LightProgram: Send + Sync + std::fmt::Debug {
    fn info(&self) -> LightInfo;

    /// Intensity, finite and at least zero, in the first `count` directions.
    fn run(&self, mode: LaneMode, count: usize, values: &[Vec3], directions: &Vectors, out: &mut Vectors);
}

/// The program of a shader.
pub(crate) fn light_program(shader: impl LightShader) -> Arc<dyn LightProgram> {
    Arc::new(OnLanes(shader))
}

#[derive(Debug)]
struct OnLanes<T>(T);

impl<T: LightShader> LightProgram for OnLanes<T> {
    fn info(&self) -> LightInfo {
        self.0.info()
    }

    fn run(&self, mode: LaneMode, count: usize, values: &[Vec3], directions: &Vectors, out: &mut Vectors) {
        let shader = &self.0;
        on_lanes!(mode, count, |token, lane| intensity::<_>(token, lane, shader, values, directions, out));
    }
}

#[inline(always)]
fn intensity<F: Real>(
    token: F::Token,
    lane: usize,
    shader: &impl LightShader,
    values: &[Vec3],
    directions: &Vectors,
    out: &mut Vectors,
) {
    let direction = Vector::load(token, directions, lane);
    let found = shader.intensity::<F>(direction, &Constants { token, values });
    let infinity = F::constant(token, f32::INFINITY);
    let size = found.abs();
    let finite = size.x.lt(infinity) & size.y.lt(infinity) & size.z.lt(infinity);
    found.positive().only(finite).store(out, lane);
}

/// A shader with its values, made ready for lookup and for drawing directions.
#[derive(Clone, Debug)]
pub(crate) struct ShadedLight {
    program: Arc<dyn LightProgram>,
    values: Vec<Vec3>,
    /// Over latitude and longitude.
    table: Discrete2d,
    /// Mean intensity over all directions, by the table.
    pub(crate) mean: Vec3,
}

/// Columns and rows of the table: cells of 1.4 degrees.
const TABLE: [u32; 2] = [256, 128];

impl ShadedLight {
    pub(crate) fn new(program: Arc<dyn LightProgram>, values: Vec<Vec3>) -> Self {
        let image = tabulate(TABLE, |count, directions, out| {
            program.run(LaneMode::default(), count, &values, directions, out);
        });
        let (table, mean) = distribution(&image);
        Self { program, values, table, mean }
    }

    /// Intensity in directions of light space, unit length.
    #[inline(always)]
    pub(crate) fn intensity<F: Real>(&self, direction: Vector<F>) -> Vector<F> {
        let token = direction.token();
        let (mut directions, mut out) = (Vectors::default(), Vectors::default());
        direction.store(&mut directions, 0);
        let mode = F::level(token).map_or(LaneMode::Single, LaneMode::Packets);
        self.program.run(mode, F::LANES, &self.values, &directions, &mut out);
        Vector::load(token, &out, 0)
    }

    /// A direction of light space, unit length, and its density per steradian.
    pub(crate) fn sample(&self, u: Vec2) -> Option<(Vec3, f32)> {
        let (uv, density) = self.table.sample(u)?;
        let pdf = density * solid_angle_density(uv.y);
        (pdf > 0.0 && pdf.is_finite()).then(|| (direction(uv), pdf))
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{PI, TAU};

    use glam::Mat3;
    use heliostat_scene::{LightKind, ParameterValue, SceneBounds, ShaderUse, TextureId, TextureRef};

    use super::*;
    use crate::emission::EmittedRay;
    use crate::punctual::PunctualLight;
    use crate::scene::ShadingScene;
    use crate::shader::{ShaderProblem, ShaderRegistry};

    /// A power of the cosine to the axis, with nonsense behind.
    #[derive(Debug)]
    struct Lobe;

    impl LightShader for Lobe {
        fn info(&self) -> LightInfo {
            let tint = Parameter::color("tint", [1.0, 0.5, 0.25], "");
            let power = Parameter::float("power", 2.0, [0.0, 100.0], "", "");
            LightInfo { name: "lobe".into(), about: String::new(), parameters: vec![tint, power] }
        }

        #[inline(always)]
        fn intensity<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F> {
            let (zero, ahead) = (direction.z.splat(0.0), -direction.z);
            let lit = values.vector(0) * crate::lanes::pow(ahead, values.float(1));
            let nonsense = Vector::new(ahead * 5.0, zero.splat(f32::NAN), zero.splat(1.0));
            let negative = Vector::grey(ahead);
            lit.where_or(ahead.gt(zero), nonsense.where_or(direction.x.gt(zero), negative))
        }
    }

    fn registry() -> ShaderRegistry {
        let mut registry = ShaderRegistry::built_in();
        registry.register_light(Lobe);
        registry
    }

    const PLACE: Vec3 = Vec3::new(1.0, 2.0, 3.0);

    fn turned() -> Mat3 {
        Mat3::from_rotation_z(0.7) * Mat3::from_rotation_y(-1.2)
    }

    fn kind(shader: ShaderUse) -> LightKind {
        LightKind::Shader {
            position: PLACE,
            world_from_light: turned(),
            scale: Vec3::new(2.0, 2.0, 4.0),
            shader: Arc::new(shader),
            range: f32::INFINITY,
        }
    }

    fn light(shader: ShaderUse) -> PunctualLight {
        registry().light(&kind(shader)).expect("there is one")
    }

    /// The rays that a light sends, by `n` squared well distributed points.
    fn rays(light: &PunctualLight, n: usize) -> Vec<EmittedRay> {
        let mut scene = ShadingScene::default();
        let bounds = Some(SceneBounds { min: Vec3::ZERO, max: Vec3::ONE });
        scene.relight([light.clone()].into_iter(), Arc::default(), bounds);
        let rays = (0..n * n).map(|i| {
            let [u, v, ..] = crate::Sampler::along(i as u32, 0).set(0);
            scene.emit((0, 1.0), [0.0, 0.0, 0.0, u, v]).expect("light").1.expect("a ray")
        });
        rays.collect()
    }

    #[test]
    fn points_are_lit_as_the_shader_says() {
        let light = light(ShaderUse::named("lobe").with("power", 3.0));
        for (angle, distance) in [(0.0_f32, 1.0), (0.7, 3.0), (1.5, 0.2)] {
            let towards = turned() * Vec3::new(angle.sin(), 0.0, -angle.cos());
            let (wi, far, weight) = light.arriving::<f32>((PLACE + towards * distance).into());
            let expected = Vec3::new(2.0, 1.0, 1.0) * angle.cos().powi(3) / (distance * distance);
            assert!(Vec3::from(wi).distance(-towards) < 1e-5 && (far / distance - 1.0).abs() < 1e-4);
            assert!(Vec3::from(weight).distance(expected) < 1e-4 * expected.length(), "{weight:?}");
        }
        // What is negative, and what is not all finite, is dark.
        for x in [-0.5, 0.5] {
            let behind = light.arriving::<f32>((PLACE + turned() * Vec3::new(x, 0.1, 1.0)).into());
            assert_eq!(Vec3::from(behind.2), Vec3::ZERO);
        }
        assert_eq!(Vec3::from(light.arriving::<f32>(PLACE.into()).2), Vec3::ZERO);
    }

    #[test]
    fn rays_carry_the_flux_of_the_shader() {
        for power in [0.0, 1.0, 20.0, 100.0] {
            let light = light(ShaderUse::named("lobe").with("power", power));
            let rays = rays(&light, 256);
            let total = rays.iter().map(|ray| ray.flux).sum::<Vec3>() / rays.len() as f32;
            // ∫ cosⁿ over half the directions.
            let expected = Vec3::new(2.0, 1.0, 1.0) * (TAU / (power + 1.0));
            assert!((total / expected - 1.0).abs().max_element() < 5e-3, "{power}: {total}, {expected}");
            let known = light.power(1.0) / crate::color::luminance(expected);
            assert!((known - 1.0).abs() < 2e-2, "{power}: the table has {known} of it");
            let largest = rays.iter().fold(0.0_f32, |most, ray| most.max(ray.flux.x));
            assert!(largest < 6.0 * expected.x, "{power}: a ray of {largest} out of {expected}");
        }
    }

    #[test]
    fn rays_are_distributed_as_the_shader_says() {
        // Whatever the shader, flux by direction agrees with intensity times solid angle.
        for shader in [ShaderUse::named("lobe"), ShaderUse::named("barn-doors"), ShaderUse::named("blinds")] {
            let light = light(shader.clone());
            let (rows, columns) = (24, 16);
            let bin = |z: f32, turn: f32| {
                let row = ((z * 0.5 + 0.5) * rows as f32) as usize;
                let column = (turn / TAU * columns as f32).rem_euclid(columns as f32) as usize;
                row.min(rows - 1) * columns + column.min(columns - 1)
            };
            let mut measured = vec![0.0_f64; rows * columns];
            let rays = rays(&light, 512);
            for ray in &rays {
                let local = turned().transpose() * ray.direction;
                measured[bin(local.z, local.y.atan2(local.x))] += f64::from(ray.flux.y) / rays.len() as f64;
            }
            let (mut expected, n) = (vec![0.0_f64; rows * columns], 1536);
            for i in 0..n * n {
                let (z, turn) = ((i % n) as f32 + 0.5, ((i / n) as f32 + 0.5) * TAU / n as f32);
                let z = z * 2.0 / n as f32 - 1.0;
                let r = (1.0 - z * z).sqrt();
                let towards = turned() * Vec3::new(r * turn.cos(), r * turn.sin(), z);
                let (.., weight) = light.arriving::<f32>((PLACE + towards).into());
                expected[bin(z, turn)] += f64::from(weight.y) * f64::from(4.0 * PI) / (n * n) as f64;
            }
            let total: f64 = expected.iter().sum();
            for (i, (measured, expected)) in measured.iter().zip(&expected).enumerate() {
                let off = (measured - expected).abs();
                assert!(off < 0.01 * expected + 2e-4 * total, "{shader:?}, {i}: {measured}, {expected}");
            }
        }
    }

    #[test]
    fn tables_are_shared_as_long_as_they_hold() {
        let light = light(ShaderUse::named("lobe"));
        let table = |light: &PunctualLight| std::ptr::from_ref(light.directions().expect("a table"));
        let same = kind(ShaderUse::named("lobe"));
        let moved = light.like(&same).expect("the shader is the same");
        assert!(light.is_prepared() && table(&moved) == table(&light));
        assert_eq!(light.like(&kind(ShaderUse::named("lobe").with("power", 3.0))), None);
        // Without its shader a light is magenta, and there is nothing to share.
        let missing = PunctualLight::new(&same);
        assert!(!missing.is_prepared());
        let (.., weight) = missing.arriving::<f32>((PLACE + Vec3::Y * 2.0).into());
        assert_eq!(Vec3::from(weight), Vec3::new(0.5, 0.0, 1.0));
        let flux = rays(&missing, 4)[0].flux;
        assert!(flux.distance(Vec3::new(2.0, 0.0, 4.0) * 4.0 * PI) < 1e-4, "{flux}");
    }

    #[test]
    fn mistakes_are_named() {
        let problem = |shader: ShaderUse| match registry().light(&kind(shader)) {
            Err(ShaderProblem(text)) => text,
            Ok(light) => panic!("accepted: {light:?}"),
        };
        let unknown = problem(ShaderUse::named("sun"));
        assert_eq!(unknown, "there is no light shader `sun`; there are: barn-doors, blinds, lobe");
        let parameter = problem(ShaderUse::named("lobe").with("size", 1.0));
        assert_eq!(parameter, "light shader `lobe` has no parameter `size`; it has: tint, power");
        let beyond = problem(ShaderUse::named("lobe").with("power", 101.0));
        assert!(beyond.contains("`power` of light shader `lobe` is [101, 101, 101]"), "{beyond}");
        assert!(problem(ShaderUse::named("lobe").with("power", f32::NAN)).contains("from 0 to 100"));
        let texture = ParameterValue::Texture(TextureRef::new(TextureId(0)), Vec3::ONE);
        assert!(problem(ShaderUse::named("lobe").with("tint", texture)).contains("cannot be a texture"));
    }

    #[test]
    fn doors_and_blinds_cut_where_they_say() {
        let seen = |shader: &ShaderUse, x: f32, y: f32| {
            let light = light(shader.clone());
            let at = PLACE + turned() * Vec3::new(x, y, -1.0).normalize();
            light.arriving::<f32>(at.into()).2.x / 2.0
        };
        let doors = ShaderUse::named("barn-doors").with("top", 0.1).with("left", -0.05);
        // The angles of a door and of the beam's end are tangents on a screen at 1 m.
        assert!((seen(&doors, 0.1, 0.0) - 1.0).abs() < 1e-3, "{}", seen(&doors, 0.1, 0.0));
        assert!((seen(&doors, 0.1, 0.1_f32.tan()) - 0.5).abs() < 1e-2);
        assert!((seen(&doors, 0.05_f32.tan(), 0.0) - 0.5).abs() < 1e-2);
        assert_eq!(
            (seen(&doors, 0.1, 0.2), seen(&doors, 0.0, 0.0), seen(&doors, 0.69, 0.0)),
            (0.0, 0.0, 0.0)
        );
        let blinds = ShaderUse::named("blinds").with("slats", 4.0).with("height", 0.8).with("softness", 0.01);
        // Gaps in the middle of each 0.2 m, half of it.
        for (y, lit) in [(0.1, 1.0), (0.0, 0.0), (0.04, 0.0), (0.06, 1.0), (-0.3, 1.0), (0.45, 0.0)] {
            assert!((seen(&blinds, 0.3, y) - lit).abs() < 1e-3, "{y}: {}", seen(&blinds, 0.3, y));
        }
        assert_eq!(seen(&blinds, 0.41, 0.1), 0.0);
        let (shut, open) = (blinds.clone().with("open", 0.0), blinds.with("open", 1.0));
        assert_eq!(seen(&shut, 0.0, 0.1), 0.0);
        assert!((seen(&open, 0.0, 0.2) - 1.0).abs() < 1e-3 && (seen(&open, 0.0, 0.1) - 1.0).abs() < 1e-3);
    }
}

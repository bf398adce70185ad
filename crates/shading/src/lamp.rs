//! Lights whose intensity depends on direction by a table or a program: measured profiles, projected pictures, shaders.

use std::f32::consts::{FRAC_1_PI, PI, TAU};
use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};
use heliostat_scene::{ColorSpace, Image, LightKind, Profile, ProfileCell};

use crate::color::luminance;
use crate::environment::MAGENTA;
use crate::lanes::{LaneFn, Real, Vector};
use crate::light_shader::ShadedLight;
use crate::sampling::{Discrete, Discrete2d, uniform_sphere};
use crate::texture::texel;

/// Intensity of a profile by direction in profile space (see [`heliostat_scene::Photometry`]), unit length.
struct ByProfile<'a>(&'a Profile);

impl LaneFn<3, 1> for ByProfile<'_> {
    fn at(&self, [x, y, z]: [f32; 3]) -> [f32; 1] {
        [self.0.at(z.clamp(-1.0, 1.0).acos(), y.atan2(x))]
    }
}

/// Intensity of a picture on the way through it by direction in light space, unit length.
struct ByPicture<'a> {
    image: &'a Image,
    /// Half the height of the picture at distance 1.
    half_height: f32,
}

impl ByPicture<'_> {
    fn half_size(&self) -> Vec2 {
        let aspect = self.image.width as f32 / self.image.height as f32;
        Vec2::new(self.half_height * aspect, self.half_height)
    }

    /// Interpolated between texels; the border's continue.
    fn color(&self, uv: Vec2) -> Vec3 {
        let (width, height) = (self.image.width, self.image.height);
        let at = uv * Vec2::new(width as f32, height as f32) - 0.5;
        let (low, f) = (at.floor(), at - at.floor());
        let pixel = |x: f32, y: f32| {
            let (x, y) = ((x.max(0.0) as u32).min(width - 1), (y.max(0.0) as u32).min(height - 1));
            finite(texel(self.image, x, y, ColorSpace::Srgb).truncate())
        };
        let row = |y: f32| pixel(low.x, y).lerp(pixel(low.x + 1.0, y), f.x);
        row(low.y).lerp(row(low.y + 1.0), f.y)
    }
}

/// What cannot be light is none.
fn finite(color: Vec3) -> Vec3 {
    if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ZERO }
}

impl LaneFn<3, 3> for ByPicture<'_> {
    fn at(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let uv = 0.5 + 0.5 * Vec2::new(x, -y) / (-z * self.half_size());
        let inside = z < 0.0 && uv.cmpge(Vec2::ZERO).all() && uv.cmplt(Vec2::ONE).all();
        if !inside {
            return [0.0; 3];
        }
        // On a screen across the axis intensity falls with the cube of the cosine; this makes up for it.
        (self.color(uv) / -(z * z * z)).to_array()
    }
}

/// What a light's table makes of its intensity in directions `wi` towards the light, world space; `None` for lights
/// without a table. `directions` are those of the light.
#[inline(always)]
pub(crate) fn table<F: Real>(
    kind: &LightKind,
    directions: Option<&Directions>,
    wi: Vector<F>,
) -> Option<Vector<F>> {
    match kind {
        LightKind::Profile { world_from_light, profile, .. } => {
            let local = to_local(&world_from_profile(world_from_light, profile), -wi);
            let [value] = F::each([local.x, local.y, local.z], &ByProfile(profile));
            Some(Vector::grey(value))
        }
        LightKind::Projector { world_from_light, vertical_fov, image, .. } => {
            let local = to_local(world_from_light, -wi);
            let picture = ByPicture { image, half_height: (0.5 * vertical_fov).tan() };
            let [r, g, b] = F::each([local.x, local.y, local.z], &picture);
            Some(Vector::new(r, g, b))
        }
        LightKind::Shader { world_from_light, .. } => match directions {
            Some(Directions::Shader(shaded)) => Some(shaded.intensity(to_local(world_from_light, -wi))),
            _ => Some(Vector::constant(wi.token(), MAGENTA)),
        },
        _ => None,
    }
}

fn world_from_profile(world_from_light: &Mat3, profile: &Profile) -> Mat3 {
    *world_from_light * profile.photometry.light_from_profile()
}

#[inline(always)]
fn to_local<F: Real>(world_from_local: &Mat3, v: Vector<F>) -> Vector<F> {
    let token = v.token();
    let along = [world_from_local.x_axis, world_from_local.y_axis, world_from_local.z_axis];
    let [x, y, z] = along.map(|axis| Vector::<F>::constant(token, axis));
    Vector::new(v.dot(x), v.dot(y), v.dot(z))
}

/// The directions that a light with a table sends light to, for drawing them in proportion.
#[derive(Clone, Debug)]
pub(crate) enum Directions {
    /// Patches of a profile, chosen by their flux.
    Profile { cells: Vec<ProfileCell>, choice: Discrete, flux: f32 },
    /// Texels of a picture, chosen by their luminance.
    Picture { texels: Discrete2d, mean: Vec3, half_size: Vec2 },
    /// What a shader says.
    Shader(ShadedLight),
    /// All alike, in magenta: stands for a shader that is not there.
    Missing,
}

impl Directions {
    /// Of a light; `None` for those without a table. Shaders are missing here.
    pub(crate) fn new(kind: &LightKind) -> Option<Self> {
        Some(match kind {
            LightKind::Profile { profile, .. } => {
                let cells: Vec<ProfileCell> = profile.cells().collect();
                let choice = Discrete::new(cells.iter().map(|cell| cell.flux as f32));
                Self::Profile { cells, choice, flux: profile.flux() as f32 }
            }
            LightKind::Projector { image, vertical_fov, .. } => {
                let picture = ByPicture { image, half_height: (0.5 * vertical_fov).tan() };
                let pixels = || (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
                let color = |(x, y)| finite(texel(image, x, y, ColorSpace::Srgb).truncate());
                let count = image.width as f32 * image.height as f32;
                let mean = pixels().map(color).sum::<Vec3>() / count;
                // Lookup blends neighbours: a floor lets every direction be drawn.
                let floor = 0.05 * luminance(mean);
                let weights: Vec<f32> = pixels().map(|at| luminance(color(at)) + floor).collect();
                let texels = Discrete2d::new(image.width as usize, &weights);
                Self::Picture { texels, mean, half_size: picture.half_size() }
            }
            LightKind::Shader { .. } => Self::Missing,
            _ => return None,
        })
    }

    /// The light's flux over its scale or intensity, W per W/sr.
    pub(crate) fn flux(&self) -> Vec3 {
        match self {
            Self::Profile { flux, .. } => Vec3::splat(*flux),
            // Along the picture's plane at distance 1 the irradiance is the intensity.
            Self::Picture { mean, half_size, .. } => *mean * (4.0 * half_size.x * half_size.y),
            Self::Shader(shaded) => shaded.mean * (4.0 * PI),
            Self::Missing => MAGENTA * (4.0 * PI),
        }
    }

    /// A direction in the space of the table, unit length, and its density per steradian.
    pub(crate) fn sample(&self, u: Vec2) -> Option<(Vec3, f32)> {
        match self {
            Self::Profile { cells, choice, .. } => {
                let (index, probability, rest) = choice.sample(u.x)?;
                let cell = &cells[index];
                // Evenly over the patch: the cosine of the polar angle and the azimuth are.
                let [top, bottom] = cell.polar.map(f32::cos);
                let [from, to] = cell.azimuth;
                let z = top + (bottom - top) * rest;
                let r = (1.0 - z * z).max(0.0).sqrt() * Vec2::from_angle(from + (to - from) * u.y);
                let pdf = probability / ((top - bottom) * (to - from).min(TAU));
                (pdf > 0.0 && pdf.is_finite()).then(|| (r.extend(z), pdf))
            }
            Self::Picture { texels, half_size, .. } => {
                let (uv, density) = texels.sample(u)?;
                let at = (2.0 * uv - 1.0) * Vec2::new(1.0, -1.0) * half_size;
                let away = at.extend(-1.0);
                let distance2 = away.length_squared();
                // From the unit square to the plane at distance 1, and on to the sphere.
                let pdf = density / (4.0 * half_size.x * half_size.y) * distance2 * distance2.sqrt();
                (pdf > 0.0 && pdf.is_finite()).then(|| (away.normalize(), pdf))
            }
            Self::Shader(shaded) => shaded.sample(u),
            Self::Missing => Some((uniform_sphere(u), 0.25 * FRAC_1_PI)),
        }
    }
}

/// Rotation from the space of a light's table to the world; `None` for lights without a table.
pub(crate) fn world_from_table(kind: &LightKind) -> Option<Mat3> {
    match kind {
        LightKind::Profile { world_from_light, profile, .. } => {
            Some(world_from_profile(world_from_light, profile))
        }
        LightKind::Projector { world_from_light, .. } | LightKind::Shader { world_from_light, .. } => {
            Some(*world_from_light)
        }
        _ => None,
    }
}

/// Whether two lights have the same table, so that its directions need not be prepared again.
pub(crate) fn same_table(a: &LightKind, b: &LightKind) -> bool {
    match (a, b) {
        (LightKind::Profile { profile: a, .. }, LightKind::Profile { profile: b, .. }) => Arc::ptr_eq(a, b),
        (
            LightKind::Projector { image: a, vertical_fov: fov_a, .. },
            LightKind::Projector { image: b, vertical_fov: fov_b, .. },
        ) => Arc::ptr_eq(a, b) && fov_a == fov_b,
        (LightKind::Shader { shader: a, .. }, LightKind::Shader { shader: b, .. }) => a == b,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use heliostat_scene::{Photometry, SceneBounds};

    use super::*;
    use crate::emission::{EmittedRay, Source};
    use crate::punctual::PunctualLight;
    use crate::scene::ShadingScene;

    /// A profile with a narrow beam off the axis, as of a headlamp.
    fn beam(photometry: Photometry) -> Profile {
        let polar: Vec<f32> = (0..=30).map(|i| 0.9 + i as f32 * 0.05).collect();
        let azimuth: Vec<f32> = (0..=20).map(|i| -0.5 + i as f32 * 0.05).collect();
        let peak = |p: f32, a: f32| 1.0 + 400.0 * (-90.0 * ((p - 1.5).powi(2) + (a - 0.1).powi(2))).exp();
        let intensity = azimuth.iter().flat_map(|&a| polar.iter().map(move |&p| peak(p, a))).collect();
        Profile { photometry, polar, azimuth, intensity }
    }

    fn lamp(profile: Profile, world_from_light: Mat3) -> LightKind {
        LightKind::Profile {
            position: Vec3::new(1.0, 2.0, 3.0),
            world_from_light,
            scale: Vec3::new(1.0, 0.5, 0.25),
            profile: Arc::new(profile),
            range: f32::INFINITY,
        }
    }

    fn projector() -> LightKind {
        // A quarter of the picture is bright, and one texel of the rest.
        let pixel = |i: u32| match (i % 16, i / 16) {
            (x, y) if x < 8 && y < 4 => [1.0, 0.8, 0.6, 1.0],
            (13, 6) => [5.0, 0.0, 0.0, 1.0],
            _ => [0.02, 0.02, 0.02, 1.0],
        };
        LightKind::Projector {
            position: Vec3::new(0.5, 0.0, -1.0),
            world_from_light: Mat3::from_rotation_y(0.4) * Mat3::from_rotation_x(-0.3),
            intensity: Vec3::new(3.0, 4.0, 5.0),
            vertical_fov: 0.9,
            image: Arc::new(Image::rgba_f32(16, 8, (0..128).flat_map(pixel).collect())),
            range: f32::INFINITY,
        }
    }

    /// The rays that a light sends, by `n` squared well distributed points.
    fn rays(kind: &LightKind, n: usize) -> Vec<EmittedRay> {
        let mut scene = ShadingScene::default();
        let bounds = Some(SceneBounds { min: Vec3::ZERO, max: Vec3::ONE });
        scene.relight([PunctualLight::new(kind)].into_iter(), Arc::default(), bounds);
        let rays = (0..n * n).map(|i| {
            let [u, v, ..] = crate::Sampler::along(i as u32, 0).set(0);
            let (source, ray) = scene.emit((0, 1.0), [0.0, 0.0, 0.0, u, v]).expect("light");
            assert!(matches!(source, Source::Light { .. }));
            ray.expect("a ray")
        });
        rays.collect()
    }

    #[test]
    fn a_uniform_profile_is_a_point_light() {
        let place = Vec3::new(1.0, 2.0, 3.0);
        let turned = Mat3::from_rotation_z(0.7) * Mat3::from_rotation_y(-1.2);
        let kind = lamp(Profile::uniform(4.0), turned);
        let point =
            LightKind::Point { position: place, intensity: Vec3::new(4.0, 2.0, 1.0), range: f32::INFINITY };
        for at in [Vec3::ZERO, Vec3::new(-5.0, 2.0, 9.0), place + Vec3::Y] {
            let (wi, distance, weight) = PunctualLight::new(&kind).arriving::<f32>(at.into());
            let (other_wi, other_distance, other_weight) =
                PunctualLight::new(&point).arriving::<f32>(at.into());
            assert_eq!((wi, distance), (other_wi, other_distance));
            assert!(Vec3::from(weight - other_weight).length() < 1e-5 * Vec3::from(weight).length());
        }
        let total: Vec3 = rays(&kind, 64).iter().map(|ray| ray.flux).sum::<Vec3>() / 4096.0;
        assert!(total.distance(Vec3::new(4.0, 2.0, 1.0) * 4.0 * PI) < 1e-3, "{total}");
    }

    #[test]
    fn rays_carry_the_flux_of_the_table() {
        for photometry in [Photometry::A, Photometry::B, Photometry::C] {
            let profile = beam(photometry);
            let flux = profile.flux() as f32;
            let kind = lamp(profile, Mat3::from_rotation_y(0.5));
            let rays = rays(&kind, 256);
            let total = rays.iter().map(|ray| ray.flux.x).sum::<f32>() / rays.len() as f32;
            assert!((total / flux - 1.0).abs() < 2e-3, "{photometry:?}: {total} against {flux}");
            let largest = rays.iter().fold(0.0_f32, |most, ray| most.max(ray.flux.x));
            // Within a patch the intensity is at most four times its mean.
            assert!(largest < 4.0 * flux, "{photometry:?}: a ray of {largest} out of {flux}");
        }
        let kind = projector();
        let expected = Directions::new(&kind).expect("a table").flux() * Vec3::new(3.0, 4.0, 5.0);
        let rays = rays(&kind, 256);
        let total = rays.iter().map(|ray| ray.flux).sum::<Vec3>() / rays.len() as f32;
        assert!((total / expected - 1.0).abs().max_element() < 1e-2, "{total} against {expected}");
    }

    #[test]
    fn rays_are_distributed_as_the_table_says() {
        let profile = beam(Photometry::B);
        let kind = lamp(profile.clone(), Mat3::from_rotation_x(0.3));
        let world_from_table = world_from_table(&kind).expect("a table");
        // Counted over bins of four cells each.
        let (rows, columns) = (profile.polar.len() - 1, profile.azimuth.len() - 1);
        let mut measured = vec![0.0_f64; rows * columns / 4];
        let bin = |p: usize, a: usize| (a / 2) * (rows / 2) + p / 2;
        let rays = rays(&kind, 1024);
        for ray in &rays {
            let local = world_from_table.transpose() * ray.direction;
            let (polar, azimuth) = (local.z.acos(), local.y.atan2(local.x));
            let p = profile.polar.partition_point(|&x| x <= polar).clamp(1, rows) - 1;
            let a = profile.azimuth.partition_point(|&x| x <= azimuth).clamp(1, columns) - 1;
            measured[bin(p, a)] += f64::from(ray.flux.x) / rays.len() as f64;
        }
        let mut expected = vec![0.0_f64; measured.len()];
        for (i, cell) in profile.cells().enumerate() {
            expected[bin(i % rows, i / rows)] += cell.flux;
        }
        let total = profile.flux();
        for (measured, expected) in measured.iter().zip(&expected).filter(|(_, flux)| **flux > 2e-3 * total) {
            assert!((measured / expected - 1.0).abs() < 0.01, "{measured} against {expected}");
        }
    }

    #[test]
    fn a_projected_picture_is_even_on_a_screen() {
        let image = Arc::new(Image::rgba_f32(2, 1, vec![1.0; 8]));
        let kind = LightKind::Projector {
            position: Vec3::ZERO,
            world_from_light: Mat3::IDENTITY,
            intensity: Vec3::splat(8.0),
            vertical_fov: 2.0 * 0.5_f32.atan(),
            image,
            range: f32::INFINITY,
        };
        // At 2 m the picture is 4 m wide and 2 m high.
        let irradiance = |x: f32, y: f32| {
            let (wi, _, weight) = PunctualLight::new(&kind).arriving::<f32>(Vec3::new(x, y, -2.0).into());
            weight.x * wi.z
        };
        for (x, y) in [(0.0, 0.0), (1.9, 0.0), (-1.9, 0.9), (0.0, -0.9)] {
            assert!((irradiance(x, y) - 2.0).abs() < 1e-4, "{x}, {y}: {}", irradiance(x, y));
        }
        assert_eq!((irradiance(2.1, 0.0), irradiance(0.0, 1.1)), (0.0, 0.0));
        assert_eq!(PunctualLight::new(&kind).arriving::<f32>(Vec3::Z.into()).2.x, 0.0);
        // The picture is upright, seen from the projector.
        let half_lit = LightKind::Projector {
            position: Vec3::ZERO,
            world_from_light: Mat3::IDENTITY,
            intensity: Vec3::ONE,
            vertical_fov: 1.0,
            image: Arc::new(Image::rgba_f32(2, 2, [[1.0; 4], [0.0; 4], [0.0; 4], [0.0; 4]].concat())),
            range: f32::INFINITY,
        };
        let lit = |x: f32, y: f32| {
            PunctualLight::new(&half_lit).arriving::<f32>(Vec3::new(x, y, -1.0).into()).2.x > 0.5
        };
        assert!(lit(-0.4, 0.4) && !lit(0.4, 0.4) && !lit(-0.4, -0.4));
    }
}

//! Environments by formula: gradients, and the sky of a clear day with its sun.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Mat3, Vec2, Vec3};
use heliostat_scene::{Gradient, Sky};

use crate::color::luminance;
use crate::sampling::Discrete2d;

/// Columns and rows of the table that directions are drawn from. The horizon lies between two rows.
const TABLE: [usize; 2] = [256, 128];
/// Angular radius of the sun, radians.
const SUN_RADIUS: f32 = 0.2667 * PI / 180.0;
/// Illuminance of the sun above the atmosphere, klx (Darula, Kittler, Gueymard, "Reference luminous solar constant and
/// solar luminance for illuminance calculations", 2005).
const SOLAR_CONSTANT: f32 = 133.334;
/// Its colour there, of luminance 1.
const SUN_COLOR: Vec3 = Vec3::new(1.097, 0.977, 0.944);

/// An environment by formula, made ready for lookup and importance sampling: what is drawn is a tabulation, what is looked
/// up is exact.
#[derive(Clone, Debug)]
pub struct FormulaLight {
    formula: Formula,
    sun: Option<Sun>,
    /// Over latitude and longitude as for maps.
    distribution: Discrete2d,
    /// Probability of drawing the sun.
    sun_share: f32,
    mean: Vec3,
}

#[derive(Clone, Debug)]
enum Formula {
    Gradient(Gradient),
    Daylight(Box<Daylight>),
}

/// The disk of the sun.
#[derive(Clone, Copy, Debug)]
struct Sun {
    /// Unit vector.
    to_sun: Vec3,
    radiance: Vec3,
}

impl Sun {
    /// 1 − cos of the radius, without cancellation.
    const CAP: f32 = 0.5 * SUN_RADIUS * SUN_RADIUS;
    /// Steradian.
    const SOLID_ANGLE: f32 = TAU * Self::CAP;

    fn covers(&self, direction: Vec3) -> bool {
        direction.distance_squared(self.to_sun) <= 2.0 * Self::CAP
    }

    /// Evenly over the disk.
    fn sample(&self, u: Vec2) -> Vec3 {
        let below = u.x * Self::CAP;
        let r = (below * (2.0 - below)).sqrt() * Vec2::from_angle(TAU * u.y);
        let (x, y) = self.to_sun.any_orthonormal_pair();
        (self.to_sun * (1.0 - below) + x * r.x + y * r.y).normalize()
    }
}

impl FormulaLight {
    pub(crate) fn gradient(gradient: &Gradient) -> Self {
        Self::new(Formula::Gradient(*gradient), None)
    }

    pub(crate) fn sky(sky: &Sky) -> Self {
        let mut daylight = Daylight::new(sky);
        let sun = sky.sun.then(|| Sun {
            to_sun: daylight.to_sun,
            radiance: sky.scale * daylight.sun_irradiance() / Sun::SOLID_ANGLE,
        });
        daylight.light_ground(sky, sun.as_ref());
        Self::new(Formula::Daylight(Box::new(daylight)), sun)
    }

    fn new(formula: Formula, sun: Option<Sun>) -> Self {
        let [columns, rows] = TABLE;
        let mut weights = Vec::with_capacity(columns * rows);
        let mut sum = Vec3::ZERO;
        for y in 0..rows {
            let sin = (PI * (y as f32 + 0.5) / rows as f32).sin();
            for x in 0..columns {
                let uv = Vec2::new((x as f32 + 0.5) / columns as f32, (y as f32 + 0.5) / rows as f32);
                let radiance = formula.radiance(direction(uv));
                weights.push(luminance(radiance) * sin);
                sum += radiance * sin;
            }
        }
        // ∫ sin θ dθ dφ / 4π turns the sum into a mean over the sphere.
        let sky = sum * (PI / (2.0 * columns as f32 * rows as f32));
        let sun_mean = sun.map_or(Vec3::ZERO, |sun| sun.radiance * (Sun::SOLID_ANGLE / (4.0 * PI)));
        let total = luminance(sky + sun_mean);
        // At least a tenth of the directions go to either.
        let share = if total > 0.0 { (luminance(sun_mean) / total).clamp(0.1, 0.9) } else { 0.5 };
        Self {
            formula,
            sun,
            distribution: Discrete2d::new(columns, &weights),
            sun_share: if sun.is_some() { share } else { 0.0 },
            mean: sky + sun_mean,
        }
    }

    pub(crate) fn radiance(&self, direction: Vec3) -> Vec3 {
        let sun = self.sun.filter(|sun| sun.covers(direction)).map_or(Vec3::ZERO, |sun| sun.radiance);
        self.formula.radiance(direction) + sun
    }

    pub(crate) fn pdf(&self, direction: Vec3) -> f32 {
        let of_sun = match self.sun {
            Some(sun) if sun.covers(direction) => self.sun_share / Sun::SOLID_ANGLE,
            _ => 0.0,
        };
        let uv = coordinates(direction);
        of_sun + (1.0 - self.sun_share) * self.distribution.pdf(uv) * solid_angle_density(uv.y)
    }

    pub(crate) fn sample(&self, u: Vec2) -> Option<(Vec3, Vec3, f32)> {
        let direction = match self.sun {
            Some(sun) if u.x < self.sun_share => sun.sample(Vec2::new(u.x / self.sun_share, u.y)),
            _ => {
                let rest = (u.x - self.sun_share) / (1.0 - self.sun_share);
                direction(self.distribution.sample(Vec2::new(rest.min(1.0 - f32::EPSILON), u.y))?.0)
            }
        };
        let pdf = self.pdf(direction);
        (pdf > 0.0 && pdf.is_finite()).then(|| (direction, self.radiance(direction), pdf))
    }

    pub(crate) fn mean(&self) -> Vec3 {
        self.mean
    }
}

/// Latitude-longitude coordinates in the unit square, as [`heliostat_scene::EnvironmentMap`] has them.
pub(crate) fn coordinates(direction: Vec3) -> Vec2 {
    let d = direction.normalize_or(Vec3::NEG_Z);
    let u = 0.5 + d.x.atan2(-d.z) / TAU;
    Vec2::new(u - u.floor(), d.y.clamp(-1.0, 1.0).acos() / PI)
}

/// The direction of latitude-longitude coordinates.
pub(crate) fn direction(uv: Vec2) -> Vec3 {
    let (longitude, polar) = (TAU * (uv.x - 0.5), PI * uv.y);
    let (sin, cos) = longitude.sin_cos();
    Vec3::new(polar.sin() * sin, polar.cos(), -polar.sin() * cos)
}

/// Density over the unit square → density per steradian, at latitude coordinate `v`.
pub(crate) fn solid_angle_density(v: f32) -> f32 {
    1.0 / (TAU * PI * (PI * v).sin().max(1e-6))
}

impl Formula {
    fn radiance(&self, direction: Vec3) -> Vec3 {
        match self {
            Self::Gradient(Gradient { zenith, horizon, nadir }) => {
                let towards = if direction.y > 0.0 { zenith } else { nadir };
                horizon.lerp(*towards, direction.y.abs().min(1.0))
            }
            Self::Daylight(daylight) => daylight.radiance(direction),
        }
    }
}

/// The sky without the sun's disk.
///
/// # References
/// Preetham, Shirley, Smits, "A Practical Analytic Model for Daylight", 1999, appendix A; Perez, Seals, Michalsky,
/// "All-Weather Model for Sky Luminance Distribution", 1993.
#[derive(Clone, Debug)]
struct Daylight {
    turbidity: f32,
    to_sun: Vec3,
    /// Angle of the sun from the zenith, radians.
    sun_polar: f32,
    scale: Vec3,
    /// Perez' coefficients A to E for luminance Y and chromaticities x and y.
    perez: [[f32; 5]; 3],
    /// Y (kcd/m²), x and y at the zenith, over Perez' function for the zenith.
    zenith: [f32; 3],
    /// Radiance of the ground.
    ground: Vec3,
}

impl Daylight {
    fn new(sky: &Sky) -> Self {
        let t = sky.turbidity;
        let to_sun = sky.to_sun.normalize_or(Vec3::Y);
        let sun_polar = to_sun.y.clamp(0.0, 1.0).acos();
        let perez = [
            [
                0.1787 * t - 1.4630,
                -0.3554 * t + 0.4275,
                -0.0227 * t + 5.3251,
                0.1206 * t - 2.5771,
                -0.0670 * t + 0.3703,
            ],
            [
                -0.0193 * t - 0.2592,
                -0.0665 * t + 0.0008,
                -0.0004 * t + 0.2125,
                -0.0641 * t - 0.8989,
                -0.0033 * t + 0.0452,
            ],
            [
                -0.0167 * t - 0.2608,
                -0.0950 * t + 0.0092,
                -0.0079 * t + 0.2102,
                -0.0441 * t - 1.6537,
                -0.0109 * t + 0.0529,
            ],
        ];
        let values = zenith(t, sun_polar);
        let zenith = [0, 1, 2].map(|i| values[i] / distribution(&perez[i], 1.0, sun_polar));
        Self { turbidity: t, to_sun, sun_polar, scale: sky.scale, perez, zenith, ground: Vec3::ZERO }
    }

    fn radiance(&self, direction: Vec3) -> Vec3 {
        if direction.y <= 0.0 {
            return self.ground;
        }
        // Near the horizon the formula divides by the cosine.
        let cos = direction.y.max(1e-3);
        let from_sun = direction.dot(self.to_sun).clamp(-1.0, 1.0).acos();
        let [luminance, x, y] =
            [0, 1, 2].map(|i| self.zenith[i] * distribution(&self.perez[i], cos, from_sun));
        let y = y.max(1e-3);
        let xyz = Vec3::new(x / y, 1.0, (1.0 - x - y) / y) * luminance.max(0.0);
        (rgb_from_xyz() * xyz).max(Vec3::ZERO) * self.scale
    }

    /// What the ground reflects of sky and sun.
    fn light_ground(&mut self, sky: &Sky, sun: Option<&Sun>) {
        let n = 64;
        let cell = (TAU / (4 * n) as f32) / n as f32;
        let mut irradiance = Vec3::ZERO;
        for i in 0..n {
            // Evenly in the square of the cosine: each ring has the same weight.
            let cos = ((i as f32 + 0.5) / n as f32).sqrt();
            let sin = (1.0 - cos * cos).sqrt();
            for j in 0..4 * n {
                let (s, c) = (TAU * (j as f32 + 0.5) / (4 * n) as f32).sin_cos();
                irradiance += self.radiance(Vec3::new(sin * s, cos, sin * c)) * (0.5 * cell);
            }
        }
        irradiance +=
            sun.map_or(Vec3::ZERO, |sun| sun.radiance * (Sun::SOLID_ANGLE * self.to_sun.y.max(0.0)));
        self.ground = sky.ground * irradiance / PI;
    }

    /// Of the sun on a surface that faces it, klx: what Rayleigh scattering, haze and ozone leave, each at one wavelength
    /// for red, green and blue.
    fn sun_irradiance(&self) -> Vec3 {
        let wavelength = Vec3::new(0.61, 0.55, 0.465);
        let degrees = self.sun_polar.to_degrees();
        let mass = 1.0 / (self.sun_polar.cos().max(0.0) + 0.15 * (93.885 - degrees).powf(-1.253));
        let rayleigh = wavelength.map(|l| 0.008735 * l.powf(-4.08));
        let haze = wavelength.map(|l| (0.04608 * self.turbidity - 0.04586) * l.powf(-1.3));
        let ozone = 0.35 * Vec3::new(0.12, 0.085, 0.007);
        SUN_COLOR * SOLAR_CONSTANT * (-mass * (rayleigh + haze + ozone)).exp()
    }
}

/// Luminance (kcd/m²) and chromaticities x, y at the zenith, of a turbidity and the sun's angle from the zenith.
fn zenith(t: f32, sun_polar: f32) -> [f32; 3] {
    let s = sun_polar.min(FRAC_PI_2);
    let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * s);
    let luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
    let polynomial = |rows: [[f32; 4]; 3]| {
        let of_sun = rows.map(|[a, b, c, d]| ((a * s + b) * s + c) * s + d);
        (of_sun[0] * t + of_sun[1]) * t + of_sun[2]
    };
    let x = polynomial([
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
    ]);
    let y = polynomial([
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]);
    [luminance.max(0.0), x, y]
}

/// Perez' function of the cosine from the zenith and the angle from the sun.
fn distribution([a, b, c, d, e]: &[f32; 5], cos: f32, from_sun: f32) -> f32 {
    (1.0 + a * (b / cos).exp()) * (1.0 + c * (d * from_sun).exp() + e * from_sun.cos().powi(2))
}

/// Linear Rec. 709 RGB from CIE XYZ (ITU-R BT.709, D65).
fn rgb_from_xyz() -> Mat3 {
    Mat3::from_cols(
        Vec3::new(3.240_97, -0.969_244, 0.055_630),
        Vec3::new(-1.537_383, 1.875_968, -0.203_977),
        Vec3::new(-0.498_611, 0.041_555, 1.056_972),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> impl Iterator<Item = Vec2> {
        (0..n * n).map(move |i| (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32)
    }

    #[test]
    fn the_zenith_has_the_luminance_of_the_formula() {
        for (turbidity, elevation, expected) in [
            // By hand: χ = (4/9 − T/120)(π − 2θ), Y = (4.0453 T − 4.9710) tan χ − 0.2155 T + 2.4192.
            (2.0, 60.0_f32, 5.8867_f32),
            (3.0, 30.0, 5.1392),
            (6.0, 45.0, 14.8933),
        ] {
            let sky = Sky { sun: false, ..Sky::new(turbidity, elevation.to_radians(), 1.0) };
            let zenith = luminance(FormulaLight::sky(&sky).radiance(Vec3::Y));
            assert!((zenith / expected - 1.0).abs() < 1e-3, "T {turbidity}, {elevation}°: {zenith}");
        }
        // The zenith of a clear sky is blue, the low sun is red, and haze pales the sky.
        let clear = FormulaLight::sky(&Sky { sun: false, ..Sky::new(2.0, 0.8, 0.0) }).radiance(Vec3::Y);
        let hazy = FormulaLight::sky(&Sky { sun: false, ..Sky::new(8.0, 0.8, 0.0) }).radiance(Vec3::Y);
        assert!(clear.z > 1.5 * clear.x && hazy.z / hazy.x < clear.z / clear.x, "{clear}, {hazy}");
        let [low, high] = [0.1_f32, 1.2].map(|e| Daylight::new(&Sky::new(3.0, e, 0.0)).sun_irradiance());
        assert!(low.x > 2.0 * low.z && high.x < 1.5 * high.z, "{low}, {high}");
        // A high sun through clear air gives 80 to 110 klx.
        assert!((80.0..110.0).contains(&luminance(high)), "{high}");
    }

    #[test]
    fn drawing_is_consistent_with_lookup_and_mean() {
        let gradient = Gradient { zenith: Vec3::new(0.1, 0.2, 0.9), horizon: Vec3::ONE, nadir: Vec3::ZERO };
        let sky = Sky::new(3.0, 0.6, 2.0);
        for light in [FormulaLight::gradient(&gradient), FormulaLight::sky(&sky)] {
            let n = 400;
            let (mut estimate, mut largest) = (Vec3::ZERO, 0.0_f32);
            for u in grid(n) {
                let (direction, radiance, pdf) = light.sample(u).expect("not black");
                assert!((light.pdf(direction) - pdf).abs() < 0.02 * pdf, "{direction}");
                assert_eq!(light.radiance(direction), radiance);
                estimate += radiance / pdf / (n * n) as f32;
                largest = largest.max(luminance(radiance / pdf));
            }
            let mean = estimate / (4.0 * PI);
            assert!((mean / light.mean() - 1.0).abs().max_element() < 0.01, "{mean}, {}", light.mean());
            assert!(largest < 12.0 * luminance(estimate), "{largest} against {estimate}");
        }
    }

    #[test]
    fn directions_are_drawn_with_the_density_that_is_stated() {
        // Pearson's test over 8×16 patches of equal solid angle, and the sun's own.
        let light = FormulaLight::sky(&Sky::new(4.0, 0.5, -1.0));
        let sun = light.sun.expect("a sun");
        let (rows, columns) = (8, 16);
        let patch = |d: Vec3| {
            let row = ((1.0 - d.y) * 0.5 * rows as f32) as usize;
            let column = (coordinates(d).x * columns as f32) as usize;
            row.min(rows - 1) * columns + column.min(columns - 1)
        };
        let mut expected = vec![0.0_f64; rows * columns];
        let m = 800;
        for u in grid(m) {
            let (z, angle) = (1.0 - 2.0 * u.y, TAU * (u.x - 0.5));
            let r = (1.0 - z * z).sqrt();
            let d = Vec3::new(r * angle.sin(), z, -r * angle.cos());
            if !sun.covers(d) {
                expected[patch(d)] += f64::from(light.pdf(d)) * 4.0 * std::f64::consts::PI / (m * m) as f64;
            }
        }
        let count = 200_000;
        let (mut seen, mut in_sun) = (vec![0.0_f64; rows * columns], 0.0_f64);
        for i in 0..count {
            let [a, b, ..] = crate::Sampler::along(i as u32, 0).set(0);
            let (d, _, _) = light.sample(Vec2::new(a, b)).expect("not black");
            if sun.covers(d) { in_sun += 1.0 } else { seen[patch(d)] += 1.0 }
        }
        let n = count as f64;
        assert!((in_sun / n - f64::from(light.sun_share)).abs() < 2e-3, "{}", in_sun / n);
        let chi2: f64 = seen
            .iter()
            .zip(&expected)
            .filter(|(_, p)| **p * n > 5.0)
            .map(|(seen, p)| (seen - p * n).powi(2) / (p * n))
            .sum();
        // 128 patches at most; the points are stratified, so that they do better than random ones.
        assert!(chi2 < 160.0, "χ² = {chi2}");
    }

    #[test]
    fn the_ground_reflects_what_falls_on_it() {
        let sky = Sky { ground: Vec3::splat(0.5), ..Sky::new(3.0, 0.9, 0.0) };
        let light = FormulaLight::sky(&sky);
        let n = 500;
        let irradiance: Vec3 = grid(n)
            .filter_map(|u| light.sample(u))
            .map(|(d, radiance, pdf)| radiance * (d.y.max(0.0) / pdf) / (n * n) as f32)
            .sum();
        let ground = light.radiance(Vec3::new(0.3, -0.8, 0.1).normalize());
        let expected = irradiance * 0.5 / PI;
        assert!((ground / expected - 1.0).abs().max_element() < 0.02, "{ground} against {expected}");
    }
}

//! Light from outside the scene.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};
use heliostat_scene::{ColorSpace, Environment, Image};

use crate::color::luminance;
use crate::environment_shader::ShaderLight;
use crate::sampling::{Discrete2d, uniform_sphere};
use crate::sky::{FormulaLight, coordinates, direction, solid_angle_density};
use crate::texture::texel;

/// The environment made ready for lookup and importance sampling.
#[derive(Clone, Debug, Default)]
pub enum EnvironmentLight {
    /// Black.
    #[default]
    None,
    /// The same radiance from everywhere.
    Constant(Vec3),
    /// A gradient, or a sky with its sun.
    Formula(FormulaLight),
    /// A latitude-longitude image.
    Map(MapLight),
    /// A shader; see [`ShaderRegistry::environment`](crate::ShaderRegistry::environment).
    Shader(ShaderLight),
}

/// Stands for a shader that is not there.
pub(crate) const MAGENTA: Vec3 = Vec3::new(1.0, 0.0, 1.0);

/// A latitude-longitude image with its sampling distribution.
#[derive(Clone, Debug)]
pub struct MapLight {
    image: Arc<Image>,
    scale: Vec3,
    world_from_environment: Mat3,
    environment_from_world: Mat3,
    distribution: Discrete2d,
    mean: Vec3,
}

impl EnvironmentLight {
    /// Prepares lookup and sampling: radiance times the solid angle of each texel. Shaders take a registry: magenta stands
    /// for them here.
    pub fn new(environment: &Environment) -> Self {
        match environment {
            Environment::None => Self::None,
            Environment::Constant(radiance) => Self::Constant(*radiance),
            Environment::Gradient(gradient) => Self::Formula(FormulaLight::gradient(gradient)),
            Environment::Sky(sky) => Self::Formula(FormulaLight::sky(sky)),
            Environment::Map(map) => Self::Map(MapLight::new(map)),
            Environment::Shader(_) => Self::Constant(MAGENTA),
        }
    }

    /// Radiance from a world-space direction (unit length, away from the scene).
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match self {
            Self::None => Vec3::ZERO,
            Self::Constant(radiance) => *radiance,
            Self::Formula(formula) => formula.radiance(direction),
            Self::Map(map) => map.radiance(map.uv(direction)),
            Self::Shader(shader) => shader.radiance(direction),
        }
    }

    /// Density of [`Self::sample`] for a direction, per steradian.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        match self {
            Self::None => 0.0,
            Self::Constant(_) => 1.0 / (4.0 * PI),
            Self::Formula(formula) => formula.pdf(direction),
            Self::Map(map) => map.pdf(direction),
            Self::Shader(shader) => shader.table.pdf(direction),
        }
    }

    /// A direction, its radiance and its density per steradian; `None` when nothing comes from there.
    pub fn sample(&self, u: Vec2) -> Option<(Vec3, Vec3, f32)> {
        match self {
            Self::None => None,
            Self::Constant(radiance) => Some((uniform_sphere(u), *radiance, 1.0 / (4.0 * PI))),
            Self::Formula(formula) => formula.sample(u),
            Self::Map(map) => map.sample(u).map(|(uv, pdf)| (map.direction(uv), map.radiance(uv), pdf)),
            Self::Shader(shader) => {
                let (uv, pdf) = shader.table.sample(u)?;
                let direction = shader.table.direction(uv);
                Some((direction, shader.radiance(direction), pdf))
            }
        }
    }

    /// Mean radiance over the sphere.
    pub fn mean(&self) -> Vec3 {
        match self {
            Self::None => Vec3::ZERO,
            Self::Constant(radiance) => *radiance,
            Self::Formula(formula) => formula.mean(),
            Self::Map(map) => map.mean,
            Self::Shader(shader) => shader.table.mean,
        }
    }
}

impl MapLight {
    pub(crate) fn new(map: &heliostat_scene::EnvironmentMap) -> Self {
        let (distribution, mean) = distribution(&map.image);
        Self {
            image: map.image.clone(),
            scale: map.scale,
            world_from_environment: map.world_from_environment,
            environment_from_world: map.world_from_environment.inverse(),
            distribution,
            mean: mean * map.scale,
        }
    }

    /// Density of a world-space direction, per steradian.
    fn pdf(&self, direction: Vec3) -> f32 {
        let uv = self.uv(direction);
        self.distribution.pdf(uv) * solid_angle_density(uv.y)
    }

    /// Texture coordinates, and the density per steradian of their direction.
    fn sample(&self, u: Vec2) -> Option<(Vec2, f32)> {
        let (uv, density) = self.distribution.sample(u)?;
        let pdf = density * solid_angle_density(uv.y);
        (pdf > 0.0 && pdf.is_finite()).then_some((uv, pdf))
    }

    /// Texture coordinates of a world-space direction.
    fn uv(&self, direction: Vec3) -> Vec2 {
        coordinates(self.environment_from_world * direction)
    }

    fn direction(&self, uv: Vec2) -> Vec3 {
        (self.world_from_environment * direction(uv)).normalize_or(Vec3::Y)
    }

    /// Interpolated between texels, around the seam too.
    fn radiance(&self, uv: Vec2) -> Vec3 {
        let (width, height) = (self.image.width, self.image.height);
        let at = uv * Vec2::new(width as f32, height as f32) - 0.5;
        let (low, f) = (at.floor(), at - at.floor());
        let column = |x: f32| (x + width as f32) as u32 % width;
        let row = |y: f32| (y.max(0.0) as u32).min(height - 1);
        let between = |y: u32| {
            texel_rgb(&self.image, column(low.x), y).lerp(texel_rgb(&self.image, column(low.x + 1.0), y), f.x)
        };
        between(row(low.y)).lerp(between(row(low.y + 1.0)), f.y) * self.scale
    }
}

/// By which to draw directions of a latitude-longitude image: luminance times the solid angle of each texel; and its mean over
/// the sphere.
pub(crate) fn distribution(image: &Image) -> (Discrete2d, Vec3) {
    let (width, height) = (image.width, image.height);
    let texel = |x: u32, y: u32| texel_rgb(image, x, y);
    // Lookup blends a texel with its neighbours. Its weight does so too (binomially, 1-2-1 along either axis), or a
    // dark texel beside a bright light would be bright near their border and yet hardly ever sampled.
    let row = |x: u32, y: u32| {
        0.25 * (texel((x + width - 1) % width, y) + 2.0 * texel(x, y) + texel((x + 1) % width, y))
    };
    let mut weights = Vec::with_capacity(width as usize * height as usize);
    let mut mean = Vec3::ZERO;
    for y in 0..height {
        let sin = (PI * (y as f32 + 0.5) / height as f32).sin();
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        for x in 0..width {
            let blurred = 0.25 * (row(x, above) + 2.0 * row(x, y) + row(x, below));
            weights.push(luminance(blurred) * sin);
            mean += texel(x, y) * sin;
        }
    }
    // ∫ sin θ dθ dφ / 4π turns the sum over texels into a mean over the sphere.
    let normalise = PI / (2.0 * width as f32 * height as f32);
    (Discrete2d::new(width as usize, &weights), mean * normalise)
}

/// Linear radiance; values that are not finite or negative read as black.
fn texel_rgb(image: &Image, x: u32, y: u32) -> Vec3 {
    let rgb = texel(image, x, y, ColorSpace::Srgb).truncate();
    if rgb.is_finite() { rgb.max(Vec3::ZERO) } else { Vec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;
    use heliostat_scene::EnvironmentMap;

    fn map() -> EnvironmentLight {
        let (width, height) = (16, 8);
        let pixels = (0..width * height).flat_map(|i| [(i % 5) as f32, (i % 3) as f32, 1.0, 1.0]).collect();
        EnvironmentLight::new(&Environment::Map(EnvironmentMap {
            image: Arc::new(Image::rgba_f32(width, height, pixels)),
            scale: Vec3::new(1.0, 2.0, 0.5),
            world_from_environment: Mat3::from_rotation_y(0.7),
        }))
    }

    #[test]
    fn sampling_is_consistent_with_lookup_and_mean() {
        let light = map();
        let n = 300;
        let (mut estimate, mut uniform) = (Vec3::ZERO, Vec3::ZERO);
        for i in 0..n * n {
            let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
            let (direction, radiance, pdf) = light.sample(u).expect("not black");
            assert!((light.pdf(direction) - pdf).abs() < 0.02 * pdf, "{direction}");
            assert!(light.radiance(direction).distance(radiance) < 1e-3);
            estimate += radiance / pdf / (n * n) as f32;
            uniform += light.radiance(uniform_sphere(u)) / (n * n) as f32;
        }
        assert!((estimate / (4.0 * PI)).distance(uniform) < 0.02, "{estimate} against {uniform}");
        assert!(uniform.distance(light.mean()) < 0.05, "{uniform} against {}", light.mean());
    }

    #[test]
    fn a_small_bright_light_gives_no_sample_an_outsized_weight() {
        let (width, height) = (32, 16);
        let pixel = |i: u32| [if i == 5 * width + 9 { 1e4 } else { 0.01 }; 4];
        let light = EnvironmentLight::new(&Environment::Map(EnvironmentMap {
            image: Arc::new(Image::rgba_f32(width, height, (0..width * height).flat_map(pixel).collect())),
            scale: Vec3::ONE,
            world_from_environment: Mat3::IDENTITY,
        }));
        let n = 200;
        let weights: Vec<f32> = (0..n * n)
            .filter_map(|i| light.sample((Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32))
            .map(|(_, radiance, pdf)| radiance.x / pdf)
            .collect();
        let mean = weights.iter().sum::<f32>() / weights.len() as f32;
        let largest = weights.iter().fold(0.0_f32, |a, &b| a.max(b));
        assert!(largest < 6.0 * mean, "largest {largest}, mean {mean}");
    }

    #[test]
    fn orientation() {
        // A single bright texel row at the top lights from +Y; the middle column lies towards −Z.
        let mut pixels = vec![0.0; 4 * 4 * 4];
        pixels[0..16].fill(1.0);
        pixels[2 * 16 + 8..2 * 16 + 12].fill(3.0);
        let light = EnvironmentLight::new(&Environment::Map(EnvironmentMap {
            image: Arc::new(Image::rgba_f32(4, 4, pixels)),
            scale: Vec3::ONE,
            world_from_environment: Mat3::IDENTITY,
        }));
        assert_eq!(light.radiance(Vec3::Y), Vec3::ONE);
        assert_eq!(light.radiance(Vec3::NEG_Y), Vec3::ZERO);
        let middle_of_texel = Vec3::new(0.653_281_5, -0.382_683_4, -0.653_281_5);
        assert!(light.radiance(middle_of_texel).distance(Vec3::splat(3.0)) < 1e-3);
    }
}

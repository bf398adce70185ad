//! What lies around a scene: radiance by direction.

use std::sync::Arc;

use glam::{Mat3, Vec3};

use crate::{Image, ShaderUse};

/// Radiance from outside the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Environment {
    /// Black.
    #[default]
    None,
    /// The same radiance from everywhere.
    Constant(Vec3),
    /// Bands of colour from below to above.
    Gradient(Gradient),
    /// A clear sky with the sun, by formula.
    Sky(Sky),
    /// An image around the scene.
    Map(EnvironmentMap),
    /// What a shader says.
    Shader(ShadedEnvironment),
}

/// Radiance that changes with height alone: linearly with the sine of the elevation, from the horizon up and down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient {
    /// Straight up (+Y), W/(m²·sr).
    pub zenith: Vec3,
    /// At the horizon.
    pub horizon: Vec3,
    /// Straight down.
    pub nadir: Vec3,
}

/// Daylight of a cloudless sky over flat ground.
///
/// # References
/// Preetham, Shirley, Smits, "A Practical Analytic Model for Daylight", 1999.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sky {
    /// Haze: 2 is very clear, 3 clear, 6 hazy, 10 thick. From 1.7 to 10: beyond, the formula's fit is meaningless.
    pub turbidity: f32,
    /// Towards the sun, world space, any length; at or above the horizon (y ≥ 0).
    pub to_sun: Vec3,
    /// Multiplies everything. At 1, a radiance of 1 W/(m²·sr) stands for a luminance of 1000 cd/m².
    pub scale: Vec3,
    /// Whether the disk of the sun is there.
    pub sun: bool,
    /// Reflectance of the ground below the horizon, RGB in [0, 1]: it is lit by sky and sun.
    pub ground: Vec3,
}

impl Sky {
    /// A sky of some turbidity with the sun at an elevation above the horizon and an azimuth from −Z towards +X, both in
    /// radians, over ground that reflects 20 %.
    pub fn new(turbidity: f32, elevation: f32, azimuth: f32) -> Self {
        let (sin, cos) = azimuth.sin_cos();
        let to_sun = Vec3::new(elevation.cos() * sin, elevation.sin(), -elevation.cos() * cos);
        Self { turbidity, to_sun, scale: Vec3::ONE, sun: true, ground: Vec3::splat(0.2) }
    }

    fn problem(&self) -> Option<String> {
        let direction = self.to_sun.try_normalize().filter(|direction| direction.is_finite());
        if !(1.7..=10.0).contains(&self.turbidity) {
            return Some(format!("turbidity is {}; give a value from 1.7 to 10", self.turbidity));
        }
        if direction.is_none_or(|direction| direction.y < -1e-4) {
            let to_sun = self.to_sun;
            return Some(format!("the sun lies towards {to_sun}; give a direction that does not point down"));
        }
        let reflectance = self.ground.is_finite() && self.ground.cmpge(Vec3::ZERO).all();
        (!(reflectance && self.ground.cmple(Vec3::ONE).all()))
            .then(|| format!("the ground reflects {}; give values from 0 to 1", self.ground))
    }
}

/// A latitude-longitude image: row 0 is up (+Y), the middle column lies in direction −Z of environment space, and
/// columns further right turn towards +X.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    /// Radiance: float images as they are, 8-bit ones decoded from sRGB.
    pub image: Arc<Image>,
    /// Multiplies the image.
    pub scale: Vec3,
    /// Rotation of the map.
    pub world_from_environment: Mat3,
}

/// Radiance by a shader that the program registered.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadedEnvironment {
    /// Which, and its parameters: numbers, vectors and colours.
    pub shader: ShaderUse,
    /// Multiplies its answers.
    pub scale: Vec3,
    /// Rotation of what it answers.
    pub world_from_environment: Mat3,
}

impl ShadedEnvironment {
    /// A shader's answers as they are.
    pub fn new(shader: ShaderUse) -> Self {
        Self { shader, scale: Vec3::ONE, world_from_environment: Mat3::IDENTITY }
    }
}

impl EnvironmentMap {
    fn rotation_problem(&self) -> Option<String> {
        rotation_problem(&self.world_from_environment, "world_from_environment")
    }
}

/// Why a matrix is no rotation, if it is none.
pub(crate) fn rotation_problem(matrix: &Mat3, name: &str) -> Option<String> {
    let orthonormal = (matrix.transpose() * *matrix).abs_diff_eq(Mat3::IDENTITY, 1e-3);
    (!orthonormal).then(|| format!("`{name}` is no rotation; give orthonormal columns"))
}

impl Environment {
    /// What is out of range, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        let (radiances, problem) = match self {
            Self::None => return None,
            Self::Constant(radiance) => (vec![*radiance], None),
            Self::Gradient(Gradient { zenith, horizon, nadir }) => (vec![*zenith, *horizon, *nadir], None),
            Self::Sky(sky) => (vec![sky.scale], sky.problem()),
            Self::Map(map) => (vec![map.scale], map.image.inconsistency().or_else(|| map.rotation_problem())),
            Self::Shader(shaded) => {
                let rotation = &shaded.world_from_environment;
                (vec![shaded.scale], rotation_problem(rotation, "world_from_environment"))
            }
        };
        if problem.is_some() {
            return problem;
        }
        let bad = radiances.iter().find(|radiance| !(radiance.is_finite() && radiance.min_element() >= 0.0));
        bad.map(|value| format!("radiance or scale is {value}; give finite values of at least 0"))
    }
}

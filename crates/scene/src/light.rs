//! Lights that are not emissive surfaces, and the environment.

use std::sync::Arc;

use glam::{Mat3, Vec3};

use crate::Image;

/// A light without area. Area lights are instances of objects with emissive materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// For people; need not be unique.
    pub name: String,
    /// Which kind, with its radiometry.
    pub kind: LightKind,
}

/// Kinds of lights. Positions and directions are in world space; directions need not be unit length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Emits equally in all directions.
    Point {
        /// World space, metres.
        position: Vec3,
        /// Radiant intensity, W/sr.
        intensity: Vec3,
        /// Beyond this distance (metres) the light has smoothly faded to nothing; infinity is physical.
        range: f32,
    },
    /// A cone.
    Spot {
        /// World space, metres.
        position: Vec3,
        /// Where the cone points.
        direction: Vec3,
        /// Radiant intensity on the axis, W/sr.
        intensity: Vec3,
        /// Half angle within which intensity is full, radians.
        inner_angle: f32,
        /// Half angle at which it reaches zero, radians, at most π/2.
        outer_angle: f32,
        /// As for [`LightKind::Point`].
        range: f32,
    },
    /// Lights every surface that faces it alike, however far away: the point light of classical renderers and their
    /// formats. No physical light does.
    ConstantPoint {
        /// World space, metres.
        position: Vec3,
        /// Irradiance on a surface facing the light, at any distance, W/m².
        irradiance: Vec3,
    },
    /// Infinitely far away.
    Directional {
        /// Direction in which light travels.
        direction: Vec3,
        /// Irradiance on a surface facing the light, W/m².
        irradiance: Vec3,
    },
}

impl Light {
    /// What is out of range, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        let power_ok = |v: Vec3| v.is_finite() && v.min_element() >= 0.0;
        let direction_ok = |d: Vec3| d.is_finite() && d.length_squared() > 0.0;
        let (place, direction, power, range) = match self.kind {
            LightKind::Point { position, intensity, range } => (position, Vec3::Y, intensity, range),
            LightKind::Spot { position, direction, intensity, range, inner_angle, outer_angle } => {
                if !(0.0 <= inner_angle && inner_angle <= outer_angle && outer_angle <= 1.571) {
                    return Some(format!(
                        "spot angles are {inner_angle} and {outer_angle} rad; give 0 ≤ inner ≤ outer ≤ π/2"
                    ));
                }
                (position, direction, intensity, range)
            }
            LightKind::ConstantPoint { position, irradiance } => (position, Vec3::Y, irradiance, 1.0),
            LightKind::Directional { direction, irradiance } => (Vec3::ZERO, direction, irradiance, 1.0),
        };
        if !place.is_finite() {
            return Some(format!("position is {place}; give finite coordinates"));
        }
        if !direction_ok(direction) {
            return Some(format!("direction is {direction}; give a finite vector of non-zero length"));
        }
        if !power_ok(power) {
            return Some(format!("intensity or irradiance is {power}; give finite values of at least 0"));
        }
        (range.is_nan() || range <= 0.0)
            .then(|| format!("range is {range}; give a positive value or infinity"))
    }
}

/// Radiance from outside the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Environment {
    /// Black.
    #[default]
    None,
    /// The same radiance from everywhere.
    Constant(Vec3),
    /// An image around the scene.
    Map(EnvironmentMap),
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

impl EnvironmentMap {
    fn rotation_problem(&self) -> Option<String> {
        let rotation = self.world_from_environment;
        let orthonormal = (rotation.transpose() * rotation).abs_diff_eq(Mat3::IDENTITY, 1e-3);
        (!orthonormal).then(|| "`world_from_environment` is no rotation; give orthonormal columns".into())
    }
}

impl Environment {
    /// What is out of range, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        let (scale, problem) = match self {
            Self::None => return None,
            Self::Constant(radiance) => (*radiance, None),
            Self::Map(map) => (map.scale, map.image.inconsistency().or_else(|| map.rotation_problem())),
        };
        if problem.is_some() {
            return problem;
        }
        (!(scale.is_finite() && scale.min_element() >= 0.0))
            .then(|| format!("radiance or scale is {scale}; give finite values of at least 0"))
    }
}

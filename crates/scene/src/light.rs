//! Lights that are not emissive surfaces.

use std::sync::Arc;

use glam::{Mat3, Vec3};

use crate::environment::rotation_problem;
use crate::{Image, Profile, ShaderUse};

/// A light without area. Area lights are instances of objects with emissive materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// For people; need not be unique.
    pub name: String,
    /// Which kind, with its radiometry.
    pub kind: LightKind,
}

/// Kinds of lights. Positions and directions are in world space; directions need not be unit length.
#[derive(Clone, Debug, PartialEq)]
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
    /// A point whose intensity over direction was measured.
    Profile {
        /// World space, metres.
        position: Vec3,
        /// Rotation. In light space the light aims along −Z; [`Profile`] says the rest.
        world_from_light: Mat3,
        /// Multiplies the profile.
        scale: Vec3,
        /// Intensity over direction; shared by lights of one make.
        profile: Arc<Profile>,
        /// As for [`LightKind::Point`].
        range: f32,
    },
    /// Throws a picture onto whatever it meets, as bright all over on a screen that stands across its axis.
    Projector {
        /// World space, metres.
        position: Vec3,
        /// Rotation. In light space the picture goes along −Z, its top towards +Y.
        world_from_light: Mat3,
        /// Radiant intensity on the axis where the picture is white, W/sr.
        intensity: Vec3,
        /// Full angle over the picture's height, radians, below π.
        vertical_fov: f32,
        /// Multiplies the intensity: float images as they are, 8-bit ones decoded from sRGB.
        image: Arc<Image>,
        /// As for [`LightKind::Point`].
        range: f32,
    },
    /// A point whose intensity over direction a shader says.
    Shader {
        /// World space, metres.
        position: Vec3,
        /// Rotation. In light space the light aims along −Z, with +Y up.
        world_from_light: Mat3,
        /// Multiplies the shader's answers.
        scale: Vec3,
        /// Which shader, and its parameters: numbers, vectors and colours.
        shader: Arc<ShaderUse>,
        /// As for [`LightKind::Point`].
        range: f32,
    },
}

impl Light {
    /// What is out of range, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        let power_ok = |v: Vec3| v.is_finite() && v.min_element() >= 0.0;
        let direction_ok = |d: Vec3| d.is_finite() && d.length_squared() > 0.0;
        let (place, direction, power, range) = match self.kind {
            LightKind::Point { position, intensity, range } => (position, Vec3::Y, intensity, range),
            LightKind::Profile { position, ref world_from_light, scale, ref profile, range } => {
                let rotation = rotation_problem(world_from_light, "world_from_light");
                if let Some(problem) = rotation.or_else(|| profile.problem()) {
                    return Some(problem);
                }
                (position, Vec3::Y, scale, range)
            }
            LightKind::Projector {
                position,
                ref world_from_light,
                intensity,
                vertical_fov,
                ref image,
                range,
            } => {
                let rotation = rotation_problem(world_from_light, "world_from_light");
                if let Some(problem) = rotation.or_else(|| image.inconsistency()) {
                    return Some(problem);
                }
                if !(1e-3..3.1).contains(&vertical_fov) {
                    return Some(format!(
                        "`vertical_fov` is {vertical_fov} rad; give a value from 0.001 to 3.1"
                    ));
                }
                (position, Vec3::Y, intensity, range)
            }
            LightKind::Shader { position, ref world_from_light, scale, range, .. } => {
                if let Some(problem) = rotation_problem(world_from_light, "world_from_light") {
                    return Some(problem);
                }
                (position, Vec3::Y, scale, range)
            }
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

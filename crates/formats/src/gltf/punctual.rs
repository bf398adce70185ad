//! Cameras and lights, placed in the world.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", section 3.10 (cameras); KHR_lights_punctual.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use heliostat_scene::{Camera, Light, LightKind, Projection};

use super::Loader;
use super::json;
use crate::error::LoadError;

impl Loader<'_, '_> {
    pub(super) fn camera(
        &mut self,
        index: usize,
        node: Option<&str>,
        world: Affine3A,
        user: &str,
    ) -> Result<(), LoadError> {
        let camera = self.item(&self.root.cameras, "cameras", index, user)?;
        let path = format!("cameras[{index}]");
        let (projection, aspect) = match (&camera.perspective, &camera.orthographic) {
            (Some(p), _) => (Projection::Perspective { vertical_fov: p.yfov }, p.aspect_ratio),
            (None, Some(o)) => {
                (Projection::Orthographic { height: 2.0 * o.ymag.abs() }, Some(o.xmag / o.ymag))
            }
            (None, None) => {
                let message = "the camera is neither perspective nor orthographic and was left out";
                self.context.warn(self.place(&path), message, "");
                return Ok(());
            }
        };
        let in_range = match projection {
            Projection::Perspective { vertical_fov } => (1e-4..PI).contains(&vertical_fov),
            Projection::Orthographic { height } => height.is_finite() && height > 0.0,
            Projection::Panoramic => true,
        };
        let Some(world_from_camera) = without_scale(world).filter(|_| in_range) else {
            let message = "the camera's field of view or its node's transform is degenerate; it was left out";
            self.context.warn(self.place(&path), message, "correct `yfov`, `ymag` or the node");
            return Ok(());
        };
        if let Some(aspect) = aspect.filter(|a| a.is_finite() && *a > 0.0) {
            let message = format!("the camera is made for pictures {aspect:.3} times as wide as high");
            self.context.note(
                self.place(&path),
                message,
                "the picture's own ratio counts; the height is kept",
            );
        }
        let name = camera.name.as_deref().or(node).map_or_else(|| format!("camera {index}"), str::to_owned);
        self.builder.camera(Camera { name, world_from_camera, motion: None, projection, lens: None });
        Ok(())
    }

    pub(super) fn light(
        &mut self,
        index: usize,
        node: Option<&str>,
        world: Affine3A,
        user: &str,
    ) -> Result<(), LoadError> {
        let light = self.item(&self.root.extensions.lights.lights, "lights", index, user)?;
        let path = format!("extensions.KHR_lights_punctual.lights[{index}]");
        let Some(kind) = light_kind(light, world) else {
            let message =
                format!("the light of type `{}` has values out of range and was left out", light.kind);
            let hint = "types are point, spot and directional; give finite values of at least 0";
            self.context.warn(self.place(&path), message, hint);
            return Ok(());
        };
        let name = light.name.as_deref().or(node).map_or_else(|| format!("light {index}"), str::to_owned);
        self.builder.light(Light { name, kind });
        Ok(())
    }
}

/// Rotation and position of a node, looking along its −Z with its +Y up as far as possible.
fn without_scale(world: Affine3A) -> Option<Affine3A> {
    let back = Vec3::from(world.matrix3.z_axis).try_normalize()?;
    let right = Vec3::from(world.matrix3.y_axis).cross(back).try_normalize()?;
    let axes = Mat3A::from_cols(right.into(), back.cross(right).into(), back.into());
    Some(Affine3A { matrix3: axes, translation: world.translation })
}

fn light_kind(light: &json::Light, world: Affine3A) -> Option<LightKind> {
    let power = Vec3::from_array(light.color) * light.intensity;
    let range = light.range.unwrap_or(f32::INFINITY);
    let position = Vec3::from(world.translation);
    let direction = Vec3::from(world.matrix3 * Vec3A::NEG_Z);
    if !(power.is_finite() && power.min_element() >= 0.0 && range > 0.0) {
        return None;
    }
    let direction_ok = direction.is_finite() && direction.length_squared() > 0.0;
    match light.kind.as_str() {
        "point" => Some(LightKind::Point { position, intensity: power, range }),
        "directional" if direction_ok => Some(LightKind::Directional { direction, irradiance: power }),
        "spot" if direction_ok => {
            let (inner, outer) =
                light.spot.as_ref().map_or((0.0, PI / 4.0), |s| (s.inner_cone_angle, s.outer_cone_angle));
            let ordered = 0.0 <= inner && inner <= outer && outer <= FRAC_PI_2 + 1e-3;
            let outer_angle = outer.min(FRAC_PI_2);
            ordered.then_some(LightKind::Spot {
                position,
                direction,
                intensity: power,
                inner_angle: inner.min(outer_angle),
                outer_angle,
                range,
            })
        }
        _ => None,
    }
}

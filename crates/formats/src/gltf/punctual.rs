//! Cameras and lights, placed in the world.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", section 3.10 (cameras); KHR_lights_punctual.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use heliostat_scene::{Camera, Light, LightKind, Projection};

use super::Loader;
use super::json;
use super::nodes::Forest;
use crate::error::LoadError;

impl Loader<'_, '_> {
    pub(super) fn camera(
        &mut self,
        index: usize,
        name: Option<&str>,
        (node, forest): (usize, &Forest),
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
            _ => true,
        };
        let Some(world_from_camera) = without_scale(forest.world[node]).filter(|_| in_range) else {
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
        let name = camera.name.as_deref().or(name).map_or_else(|| format!("camera {index}"), str::to_owned);
        let camera = Camera {
            name,
            world_from_camera,
            motion: None,
            projection,
            lens: None,
            stereo: None,
            shader: None,
        };
        self.stage.cameras.push((self.builder.camera(camera.clone()), camera, node));
        Ok(())
    }

    pub(super) fn light(
        &mut self,
        index: usize,
        name: Option<&str>,
        (node, forest): (usize, &Forest),
        user: &str,
    ) -> Result<(), LoadError> {
        let light = self.item(&self.root.extensions.lights.lights, "lights", index, user)?;
        let path = format!("extensions.KHR_lights_punctual.lights[{index}]");
        let at_node = light_kind(light);
        let placed =
            at_node.as_ref().and_then(|kind| place_light(kind, &forest.world[node], forest.visible[node]));
        let (Some(at_node), Some(kind)) = (at_node, placed) else {
            let message =
                format!("the light of type `{}` has values out of range and was left out", light.kind);
            let hint = "types are point, spot and directional; give finite values of at least 0";
            self.context.warn(self.place(&path), message, hint);
            return Ok(());
        };
        let name = light.name.as_deref().or(name).map_or_else(|| format!("light {index}"), str::to_owned);
        let light = Light { name, kind };
        self.stage.lights.push((self.builder.light(light.clone()), light, at_node, node));
        Ok(())
    }
}

/// Rotation and position of a node, looking along its −Z with its +Y up as far as possible.
pub(super) fn without_scale(world: Affine3A) -> Option<Affine3A> {
    let back = Vec3::from(world.matrix3.z_axis).try_normalize()?;
    let right = Vec3::from(world.matrix3.y_axis).cross(back).try_normalize()?;
    let axes = Mat3A::from_cols(right.into(), back.cross(right).into(), back.into());
    Some(Affine3A { matrix3: axes, translation: world.translation })
}

/// A light in the space of its node; `None` for values out of range.
fn light_kind(light: &json::Light) -> Option<LightKind> {
    let power = Vec3::from_array(light.color) * light.intensity;
    let range = light.range.unwrap_or(f32::INFINITY);
    let (position, direction) = (Vec3::ZERO, Vec3::NEG_Z);
    if !(power.is_finite() && power.min_element() >= 0.0 && range > 0.0) {
        return None;
    }
    match light.kind.as_str() {
        "point" => Some(LightKind::Point { position, intensity: power, range }),
        "directional" => Some(LightKind::Directional { direction, irradiance: power }),
        "spot" => {
            let (inner, outer) =
                light.spot.as_ref().map_or((0.0, PI / 4.0), |s| (s.inner_cone_angle, s.outer_cone_angle));
            let ordered = 0.0 <= inner && inner <= outer && outer <= FRAC_PI_2 + 1e-3;
            let outer_angle = outer.min(FRAC_PI_2);
            let inner_angle = inner.min(outer_angle);
            let intensity = power;
            ordered.then_some(LightKind::Spot {
                position,
                direction,
                intensity,
                inner_angle,
                outer_angle,
                range,
            })
        }
        _ => None,
    }
}

/// A light of a node that stands so; a hidden one is dark. `None` where it would shine in no direction.
pub(super) fn place_light(at_node: &LightKind, world: &Affine3A, visible: bool) -> Option<LightKind> {
    let mut kind = at_node.clone();
    let shown = if visible { 1.0 } else { 0.0 };
    let there = Vec3::from(world.translation);
    let ahead = Vec3::from(world.matrix3 * Vec3A::NEG_Z);
    let ahead_ok = ahead.is_finite() && ahead.length_squared() > 0.0;
    match &mut kind {
        LightKind::Point { position, intensity, .. } => {
            *position = there;
            *intensity *= shown;
        }
        LightKind::ConstantPoint { position, irradiance } => {
            *position = there;
            *irradiance *= shown;
        }
        LightKind::Directional { direction, irradiance } => {
            *direction = ahead;
            *irradiance *= shown;
        }
        LightKind::Spot { position, direction, intensity, .. } => {
            (*position, *direction) = (there, ahead);
            *intensity *= shown;
        }
        LightKind::Profile { position, world_from_light, scale: intensity, .. }
        | LightKind::Projector { position, world_from_light, intensity, .. }
        | LightKind::Shader { position, world_from_light, scale: intensity, .. } => {
            *position = there;
            *world_from_light = without_scale(*world)?.matrix3.into();
            *intensity *= shown;
        }
    }
    (ahead_ok || matches!(kind, LightKind::Point { .. } | LightKind::ConstantPoint { .. })).then_some(kind)
}

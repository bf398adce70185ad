//! Lights without area made ready: asked at points, and for their power.

use std::f32::consts::PI;
use std::sync::Arc;

use glam::Vec3;
use heliostat_scene::LightKind;

use crate::color::luminance;
use crate::lamp::{Directions, same_table, table};
use crate::lanes::{Real, Vector};
use crate::light_shader::ShadedLight;

/// A light without area, made ready.
#[derive(Clone, Debug)]
pub struct PunctualLight {
    kind: LightKind,
    /// What a light whose intensity depends on direction by a table or a shader has prepared.
    directions: Option<Arc<Directions>>,
}

/// Lights that the scene says the same of.
impl PartialEq for PunctualLight {
    fn eq(&self, other: &Self) -> bool {
        self.kind == other.kind
    }
}

impl PunctualLight {
    /// Prepares what drawing directions takes. Shaders take a registry, [`ShaderRegistry::light`](crate::ShaderRegistry::light):
    /// magenta stands for them here.
    pub fn new(kind: &LightKind) -> Self {
        Self { kind: kind.clone(), directions: Directions::new(kind).map(Arc::new) }
    }

    pub(crate) fn shaded(kind: &LightKind, shaded: ShadedLight) -> Self {
        Self { kind: kind.clone(), directions: Some(Arc::new(Directions::Shader(shaded))) }
    }

    /// A light with what was prepared for this one, if that is the same: it may stand elsewhere, turned or brighter.
    pub fn like(&self, kind: &LightKind) -> Option<Self> {
        let directions = same_table(kind, &self.kind).then(|| self.directions.clone())?;
        Some(Self { kind: kind.clone(), directions })
    }

    /// Whether something was prepared for it, which other lights of its make can share.
    pub fn is_prepared(&self) -> bool {
        self.directions.as_deref().is_some_and(|directions| !matches!(directions, Directions::Missing))
    }

    /// What the scene says of it.
    pub fn kind(&self) -> &LightKind {
        &self.kind
    }

    pub(crate) fn directions(&self) -> Option<&Directions> {
        self.directions.as_deref()
    }

    /// Where it is; `None` if it is infinitely far away.
    pub(crate) fn position(&self) -> Option<Vec3> {
        match self.kind {
            LightKind::Point { position, .. }
            | LightKind::Spot { position, .. }
            | LightKind::Profile { position, .. }
            | LightKind::Projector { position, .. }
            | LightKind::Shader { position, .. }
            | LightKind::ConstantPoint { position, .. } => Some(position),
            LightKind::Directional { .. } => None,
        }
    }

    /// Whether it shines alike at any distance, and so has no flux.
    pub(crate) fn is_constant(&self) -> bool {
        matches!(self.kind, LightKind::ConstantPoint { .. })
    }

    /// Luminance of its flux, W; `cross_section` of the scene, m², stands in where it has none of its own.
    pub(crate) fn power(&self, cross_section: f32) -> f32 {
        let flux = self.directions().map_or(Vec3::ZERO, Directions::flux);
        match self.kind {
            LightKind::Profile { scale, .. } | LightKind::Shader { scale, .. } => luminance(scale * flux),
            LightKind::Projector { intensity, .. } => luminance(intensity * flux),
            LightKind::Point { intensity, .. } => luminance(intensity) * 4.0 * PI,
            LightKind::Spot { intensity, inner_angle, outer_angle, .. } => {
                luminance(intensity) * 2.0 * PI * (1.0 - (0.5 * (inner_angle + outer_angle)).cos()).max(1e-4)
            }
            LightKind::Directional { irradiance, .. } | LightKind::ConstantPoint { irradiance, .. } => {
                luminance(irradiance) * cross_section
            }
        }
    }

    /// Light at points, per lane: direction, distance and radiance over density; see
    /// [`LightSample::weight`](crate::LightSample::weight).
    #[inline(always)]
    pub(crate) fn arriving<F: Real>(&self, at: Vector<F>) -> (Vector<F>, F, Vector<F>) {
        let (kind, token) = (&self.kind, at.token());
        let constant = |v: Vec3| Vector::<F>::constant(token, v);
        let (position, power, range) = match *kind {
            LightKind::Point { position, intensity, range } => (position, intensity, range),
            LightKind::Spot { position, intensity, range, .. } => (position, intensity, range),
            LightKind::ConstantPoint { position, irradiance } => (position, irradiance, f32::INFINITY),
            LightKind::Profile { position, scale, range, .. } => (position, scale, range),
            LightKind::Projector { position, intensity, range, .. } => (position, intensity, range),
            LightKind::Shader { position, scale, range, .. } => (position, scale, range),
            LightKind::Directional { direction, irradiance } => {
                let wi = (-direction).try_normalize();
                let irradiance = if wi.is_some() { irradiance } else { Vec3::ZERO };
                let far = F::constant(token, f32::INFINITY);
                return (constant(wi.unwrap_or_default()), far, constant(irradiance));
            }
        };
        let to_light = constant(position) - at;
        let distance2 = to_light.length_squared();
        let distance = distance2.sqrt();
        let zero = distance.splat(0.0);
        let wi = to_light.normalized_or(constant(Vec3::ZERO));
        let mut factor = match kind {
            LightKind::ConstantPoint { .. } => zero.splat(1.0),
            _ => distance2.recip() * range_window(distance, range),
        };
        if let LightKind::Spot { direction, inner_angle, outer_angle, .. } = kind {
            let cos = -wi.dot(constant(direction.normalize_or_zero()));
            let (inner, outer) = (inner_angle.cos(), outer_angle.cos());
            // KHR_lights_punctual, "Inner and Outer Cone Angles".
            let fade = ((cos - outer) * (1.0 / (inner - outer).max(1e-3))).clamp(0.0, 1.0);
            factor = factor * fade * fade;
        }
        let usable = factor.gt(zero) & factor.lt(zero.splat(f32::INFINITY)) & distance.gt(zero);
        let mut weight = constant(power) * factor;
        if let Some(share) = table::<F>(kind, self.directions(), wi) {
            weight = weight * share;
        }
        (wi, distance * (1.0 - 1e-5), weight.only(usable))
    }
}

/// The recommended fade of KHR_lights_punctual, without the inverse square.
#[inline(always)]
fn range_window<F: Real>(distance: F, range: f32) -> F {
    if range.is_infinite() {
        return distance.splat(1.0);
    }
    (distance * (1.0 / range)).squared().squared().complement().clamp(0.0, 1.0)
}

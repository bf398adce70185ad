//! Light leaving its sources: the first vertices of light paths, for virtual point lights and photons.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};
use heliostat_scene::{Geometry, LightKind, SceneBounds};

use crate::adjoint::PatchGloss;
use crate::basis::Basis;
use crate::lamp::{table, world_from_table};
use crate::lanes::Vector;
use crate::light::{AreaEmitter, Emitter, Lights, Tables};
use crate::point::Met;
use crate::punctual::PunctualLight;
use crate::quadric;
use crate::sampling::{concentric_disk, cosine_hemisphere, uniform_sphere, uniform_triangle};

/// A point from which light is sent: what a shaded point must know to be lit by it.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A patch of surface: (`radiance` · (1 − `rim` (1 − cos)⁵) + `flux` · gloss) · cos · cos / distance², where `radiance` stands
    /// for radiance times area and the first two cosines are those of the patch. Emits to the side of `normal` alone.
    Patch {
        /// World space.
        position: Vec3,
        /// Bound on the rounding error of `position`, metres.
        error: f32,
        /// Unit vector.
        normal: Vec3,
        /// Radiance along the normal divided by the density of the point.
        radiance: Vec3,
        /// Share by which it is darker seen from its horizon: what layers over a diffuse surface keep (Schlick's term).
        rim: f32,
        /// Light that it reflects by other lobes than the diffuse one: the flux that has reached it, W, and these.
        gloss: Option<(Vec3, PatchGloss)>,
        /// How many points of its kind there are per m² of the emitter: what multiple importance sampling goes by. 0 where rays
        /// of sharp lobes find all light by themselves.
        density: f32,
    },
    /// A light without area, divided by the probability of its choice.
    Light {
        /// The light.
        light: PunctualLight,
        /// Multiplies it.
        factor: f32,
    },
    /// Light from infinitely far away.
    Distant {
        /// Unit vector towards the light.
        wi: Vec3,
        /// Radiance over its density: irradiance on a surface that faces it.
        irradiance: Vec3,
        /// As for a patch, per steradian.
        density: f32,
    },
}

/// A ray of light on its way from a source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmittedRay {
    /// Where it starts, off the surface of the source.
    pub origin: Vec3,
    /// Unit vector.
    pub direction: Vec3,
    /// Flux that it stands for, W: emission over the densities of all choices.
    pub flux: Vec3,
}

impl Lights {
    /// All lights without area as sources of their whole light.
    pub fn without_area(&self) -> impl Iterator<Item = Source> {
        (0..self.len()).filter_map(|index| match self.emitter(index) {
            Emitter::Light(light) => Some(Source::Light { light: light.clone(), factor: 1.0 }),
            _ => None,
        })
    }

    /// Sends light from one emitter, chosen with `probability`: the source, and a ray that carries on its flux, if the
    /// emitter sends any into the scene. `u` are six sample points: three for the place, two for the direction.
    pub(crate) fn emit(
        &self,
        tables: Tables<'_>,
        (emitter, probability): (usize, f32),
        [u_triangle, u, v, u_direction, v_direction]: [f32; 5],
        bounds: Option<SceneBounds>,
    ) -> Option<(Source, Option<EmittedRay>)> {
        let place = Vec2::new(u, v);
        let direction = Vec2::new(u_direction, v_direction);
        match self.emitter(emitter) {
            Emitter::Light(light) => {
                let ray = light_ray(light, direction, bounds).map(|ray| scaled(ray, 1.0 / probability));
                Some((Source::Light { light: light.clone(), factor: 1.0 / probability }, ray))
            }
            Emitter::Area(area) => area.emit(tables, (place, u_triangle), direction, 1.0 / probability),
            Emitter::Environment => {
                let (wi, radiance, pdf) = self.environment_light().sample(place)?;
                let irradiance = radiance / (pdf * probability);
                let ray = from_afar(-wi, direction, irradiance, bounds);
                Some((Source::Distant { wi, irradiance, density: pdf * probability }, ray))
            }
        }
    }
}

fn scaled(ray: EmittedRay, factor: f32) -> EmittedRay {
    EmittedRay { flux: ray.flux * factor, ..ray }
}

/// A ray of parallel light that crosses the scene's bounding sphere.
fn from_afar(direction: Vec3, u: Vec2, irradiance: Vec3, bounds: Option<SceneBounds>) -> Option<EmittedRay> {
    let bounds = bounds?;
    let radius = bounds.radius().max(1e-6);
    let disk = radius * concentric_disk(u);
    let (x, y) = direction.any_orthonormal_pair();
    let origin = bounds.center() - direction * radius + x * disk.x + y * disk.y;
    Some(EmittedRay { origin, direction, flux: irradiance * (PI * radius * radius) })
}

/// A ray from a light without area. [`LightKind::ConstantPoint`] sends none: its flux has no physical meaning.
fn light_ray(light: &PunctualLight, u: Vec2, bounds: Option<SceneBounds>) -> Option<EmittedRay> {
    let kind = light.kind();
    match *kind {
        LightKind::Profile { position, scale: power, .. }
        | LightKind::Projector { position, intensity: power, .. }
        | LightKind::Shader { position, scale: power, .. } => {
            let directions = light.directions()?;
            let (local, pdf) = directions.sample(u)?;
            let direction = (world_from_table(kind)? * local).normalize_or_zero();
            let share = table::<f32>(kind, Some(directions), (-direction).into())?;
            let intensity = power * Vec3::from(share);
            Some(EmittedRay { origin: position, direction, flux: intensity / pdf })
        }
        LightKind::Point { position, intensity, .. } => {
            let flux = intensity * (4.0 * PI);
            Some(EmittedRay { origin: position, direction: uniform_sphere(u), flux })
        }
        LightKind::Spot { position, direction, intensity, outer_angle, .. } => {
            let axis = direction.try_normalize()?;
            let cap = 1.0 - outer_angle.cos();
            let z = 1.0 - u.x * cap;
            let r = (1.0 - z * z).max(0.0).sqrt() * Vec2::from_angle(TAU * u.y);
            let towards: Vec3 =
                Basis::from_normal(Vector::from(axis)).to_world(Vector::new(r.x, r.y, z)).into();
            // The fade of the cone, from the light's own formula at a metre's distance.
            let (.., arriving) = light.arriving::<f32>((position + towards).into());
            let share = Vec3::from(arriving) / intensity.max_element().max(f32::MIN_POSITIVE);
            let flux = intensity * (share.max_element() * TAU * cap);
            Some(EmittedRay { origin: position, direction: towards, flux })
        }
        LightKind::Directional { direction, irradiance } => {
            from_afar(direction.try_normalize()?, u, irradiance, bounds)
        }
        LightKind::ConstantPoint { .. } => None,
    }
}

impl AreaEmitter {
    fn emit(
        &self,
        tables: Tables<'_>,
        (u, u_triangle): (Vec2, f32),
        u_direction: Vec2,
        weight: f32,
    ) -> Option<(Source, Option<EmittedRay>)> {
        let (placement, part, material) = tables.part(self.placement, self.part);
        let (primitive, probability, rest) = self.triangles.sample(u_triangle)?;
        let uv = match &part.shape {
            Geometry::Mesh(_) => uniform_triangle(u),
            Geometry::Quadrics(quadrics) => quadric::sample(&quadrics.shapes[primitive], u),
        };
        let met = Met::new(&part.shape, primitive as u32, uv, 0.0);
        let (position, error, normal, area_pdf) = met.on_light(placement);
        let normal = normal.try_normalize()?;
        // Lights that shine from both sides send half their paths from either.
        let both = material.source().double_sided;
        let back = both && rest < 0.5;
        let normal = if back { -normal } else { normal };
        let radiance = material.visible_emission(&met.coordinates(material, placement, 0.0), !back);
        // Rays that find the light ask for the density of places, not of sides.
        let density = probability * area_pdf / weight;
        let pdf = probability * area_pdf * if both { 0.5 } else { 1.0 };
        let radiance = radiance * (weight / pdf);
        if !(radiance.is_finite() && radiance != Vec3::ZERO) {
            return None;
        }
        let direction =
            Basis::from_normal(Vector::from(normal)).to_world(cosine_hemisphere(u_direction.into()));
        let ray = EmittedRay {
            origin: position + normal * error,
            direction: direction.into(),
            flux: radiance * PI,
        };
        Some((Source::Patch { position, error, normal, radiance, rim: 0.0, gloss: None, density }, Some(ray)))
    }
}

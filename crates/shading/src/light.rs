//! All light sources of a scene, and how they are sampled.

use std::collections::HashMap;
use std::f32::consts::PI;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use heliostat_kernel::Aabb;
use heliostat_scene::{Geometry, SceneBounds};

use crate::color::luminance;
use fearless_simd::{Level, Simd};

use crate::environment::EnvironmentLight;
use crate::lamps::Lamps;
use crate::lanes::{Packet, Real, Vector, Vectors};
use crate::material::SurfaceMaterial;
use crate::packet::{Illumination, on_lanes};
use crate::placement::{Placement, ShadedPart};
use crate::point::{Corners, Met};
use crate::punctual::PunctualLight;
use crate::quadric;
use crate::sampling::{Discrete, uniform_triangle};
use crate::surface::{LaneMode, Surfaces};

/// Every light of a scene: points, spots, directions, emissive parts of placements, the environment.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    emitters: Vec<Emitter>,
    /// Chooses emitters half by power, half evenly.
    choice: Discrete,
    /// Emissive parts by placement and part.
    areas: HashMap<(u32, u32), u32>,
    environment: Arc<EnvironmentLight>,
    environment_index: Option<u32>,
    lamps: Arc<Lamps>,
}

#[derive(Clone, Debug)]
pub(crate) enum Emitter {
    /// A light without area.
    Light(PunctualLight),
    Area(AreaEmitter),
    Environment,
}

/// One emissive part of a placement; triangles, spheres and cones are chosen in proportion to area times mean emission.
#[derive(Clone, Debug)]
pub(crate) struct AreaEmitter {
    pub(crate) placement: u32,
    pub(crate) part: u32,
    pub(crate) triangles: Arc<Discrete>,
}

/// Light arriving at a point from a sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit vector towards the light.
    pub wi: Vec3,
    /// Distance to the light, metres; infinite for far ones.
    pub distance: f32,
    /// Radiance divided by the density of this sample (without the choice of the emitter).
    pub weight: Vec3,
    /// Per steradian; 0 for lights without area, which scattering cannot hit.
    pub pdf: f32,
}

/// What light sampling needs of the shader tables.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tables<'a> {
    pub(crate) placements: &'a [Placement],
    pub(crate) parts: &'a [Arc<[ShadedPart]>],
    pub(crate) materials: &'a [SurfaceMaterial],
}

impl<'a> Tables<'a> {
    #[inline]
    pub(crate) fn part(
        &self,
        placement: u32,
        part: u32,
    ) -> (&'a Placement, &'a ShadedPart, &'a SurfaceMaterial) {
        let placement = &self.placements[placement as usize];
        let part = &self.parts[placement.parts as usize][part as usize];
        (placement, part, &self.materials[part.material as usize])
    }

    /// All emissive parts, as (placement, part).
    pub(crate) fn emissive(&self) -> Vec<(u32, u32)> {
        let shines = |part: &ShadedPart| self.materials[part.material as usize].source().is_emissive();
        // Most objects do not: ask each once.
        let shining: Vec<Vec<u32>> = self
            .parts
            .iter()
            .map(|parts| (0..).zip(parts.iter()).filter(|(_, part)| shines(part)).map(|(i, _)| i).collect())
            .collect();
        let of = |(index, placement): (u32, &Placement)| {
            let parts = &shining[placement.parts as usize];
            parts.iter().map(move |&part| (index, part)).collect::<Vec<_>>()
        };
        (0..)
            .zip(self.placements)
            .filter(|(_, p)| !shining[p.parts as usize].is_empty())
            .flat_map(of)
            .collect()
    }
}

impl Lights {
    /// Collects all emitters: `lights`, the parts that `emissive` lists, the environment. `bounds` sets the power of lights
    /// that are infinitely far away.
    pub(crate) fn new(
        tables: Tables<'_>,
        emissive: &[(u32, u32)],
        lights: impl Iterator<Item = PunctualLight>,
        environment: Arc<EnvironmentLight>,
        bounds: Option<SceneBounds>,
    ) -> Self {
        let cross_section = bounds.map_or(1.0, |b| PI * b.radius().powi(2)).max(1e-6);
        let mut emitters = Vec::new();
        let mut powers = Vec::new();
        let mut lamps = Lamps::default();
        for light in lights {
            let power = light.power(cross_section);
            // One that shines alike at any distance is everywhere.
            match light.position().filter(|_| !light.is_constant()) {
                Some(at) => lamps.push(Aabb { min: at, max: at }, power),
                None => lamps.push_everywhere(power / cross_section),
            }
            powers.push(power);
            emitters.push(Emitter::Light(light));
        }
        let mut areas = HashMap::new();
        let mut shared = HashMap::new();
        for &(index, part_index) in emissive {
            let (placement, part, material) = tables.part(index, part_index);
            let key = (part.geometry, part.material);
            let triangles = shared.entry(key).or_insert_with(|| Arc::new(primitive_weights(part, material)));
            // The cube root of the volume scale, squared, stands for the scale of areas.
            let area_scale = placement.world_from_object.matrix3.determinant().abs().powf(2.0 / 3.0);
            let sides = if material.source().double_sided { 2.0 } else { 1.0 };
            areas.insert((index, part_index), emitters.len() as u32);
            let power = triangles.total() * area_scale * sides * PI;
            lamps.push(part.bounds.transformed(&placement.world_from_object), power);
            powers.push(power);
            let triangles = triangles.clone();
            emitters.push(Emitter::Area(AreaEmitter { placement: index, part: part_index, triangles }));
        }
        let environment_power = luminance(environment.mean()) * 4.0 * PI * cross_section;
        let environment_index = (environment_power > 0.0).then(|| {
            lamps.push_everywhere(environment_power / cross_section);
            powers.push(environment_power);
            emitters.push(Emitter::Environment);
            emitters.len() as u32 - 1
        });
        let total: f32 = powers.iter().filter(|p| p.is_finite()).sum();
        let even = total.max(f32::MIN_POSITIVE) / powers.len().max(1) as f32;
        let choice = Discrete::new(powers.iter().map(|&p| if p > 0.0 { p + even } else { 0.0 }));
        Self { emitters, choice, areas, environment, environment_index, lamps: Arc::new(lamps) }
    }

    /// Number of emitters.
    pub fn len(&self) -> usize {
        self.emitters.len()
    }

    /// Whether there is no light.
    pub fn is_empty(&self) -> bool {
        self.emitters.is_empty()
    }

    /// About where all emitters are, for choosing among many.
    pub fn lamps(&self) -> &Lamps {
        &self.lamps
    }

    /// Probability with which [`Self::choose`] picks an emitter.
    pub fn probability(&self, emitter: usize) -> f32 {
        self.choice.probability(emitter)
    }

    /// Chooses an emitter: its index, its probability, and `u` rescaled.
    pub fn choose(&self, u: f32) -> Option<(usize, f32, f32)> {
        self.choice.sample(u).filter(|&(_, probability, _)| probability > 0.0)
    }

    /// Radiance of the environment from a direction.
    pub fn environment(&self, direction: Vec3) -> Vec3 {
        self.environment.radiance(direction)
    }

    /// Density per steradian with which sampling the environment finds a direction; 0 if it is no light.
    pub fn environment_pdf(&self, direction: Vec3) -> f32 {
        if self.environment_index.is_some() { self.environment.pdf(direction) } else { 0.0 }
    }

    /// The index of the environment among the emitters, if it is one.
    pub fn environment_index(&self) -> Option<usize> {
        self.environment_index.map(|index| index as usize)
    }

    /// The index of the emitter that is this part of a placement, if it is one.
    pub(crate) fn area(&self, placement: u32, part: u32) -> Option<usize> {
        self.areas.get(&(placement, part)).map(|&index| index as usize)
    }

    /// Probability of a triangle within the emitter.
    pub(crate) fn triangle_probability(&self, emitter: usize, primitive: u32) -> f32 {
        match &self.emitters[emitter] {
            Emitter::Area(area) => area.triangles.probability(primitive as usize),
            _ => 0.0,
        }
    }

    /// Samples light from one emitter at `position` and `time` in [0, 1] of the shutter interval. `None` when nothing arrives.
    pub(crate) fn sample(
        &self,
        tables: Tables<'_>,
        emitter: usize,
        (position, time): (Vec3, f32),
        u: Vec2,
        u_triangle: f32,
    ) -> Option<LightSample> {
        match &self.emitters[emitter] {
            Emitter::Light(light) => {
                let (wi, distance, weight) = light.arriving::<f32>(position.into());
                let weight = Vec3::from(weight);
                let sample = LightSample { wi: wi.into(), distance, weight, pdf: 0.0 };
                (weight != Vec3::ZERO).then_some(sample)
            }
            Emitter::Area(area) => area.sample(tables, (position, time), u, u_triangle),
            Emitter::Environment => {
                let (wi, radiance, pdf) = self.environment.sample(u)?;
                Some(LightSample { wi, distance: f32::INFINITY, weight: radiance / pdf, pdf })
            }
        }
    }

    pub(crate) fn emitter(&self, index: usize) -> &Emitter {
        &self.emitters[index]
    }

    pub(crate) fn environment_light(&self) -> &EnvironmentLight {
        &self.environment
    }

    /// Whether sampling the emitter takes random numbers: it has area, or is all around.
    pub fn is_extended(&self, emitter: usize) -> bool {
        !matches!(self.emitters[emitter], Emitter::Light(..))
    }

    /// Samples light from one emitter for the first `count` lanes of a packet. `along` gives the time and the sample points
    /// of a lane; the points are asked for only if the emitter [is extended](Self::is_extended).
    pub(crate) fn illuminate(
        &self,
        tables: Tables<'_>,
        emitter: usize,
        surfaces: &Surfaces,
        along: impl Fn(usize) -> (f32, [f32; 4]),
        count: usize,
        out: &mut Illumination,
    ) {
        if let Emitter::Light(light) = &self.emitters[emitter] {
            let position = &surfaces.position;
            on_lanes!(surfaces.mode, count, |token, lane| light_lanes::<_>(
                token, lane, light, position, out
            ));
            return;
        }
        for lane in 0..count {
            let (time, [u, v, u_triangle, _]) = along(lane);
            let at = (surfaces.position.get(lane), time);
            let sample = self.sample(tables, emitter, at, Vec2::new(u, v), u_triangle);
            out.weight.set(lane, sample.map_or(Vec3::ZERO, |sample| sample.weight));
            if let Some(sample) = sample {
                out.wi.set(lane, sample.wi);
                out.distance.0[lane] = sample.distance;
                out.pdf.0[lane] = sample.pdf;
            }
        }
    }
}

impl AreaEmitter {
    fn sample(
        &self,
        tables: Tables<'_>,
        (position, time): (Vec3, f32),
        u: Vec2,
        u_triangle: f32,
    ) -> Option<LightSample> {
        let (placement, part, material) = tables.part(self.placement, self.part);
        let moved = placement.at(time);
        let placement = moved.as_ref().unwrap_or(placement);
        let (primitive, probability, _) = self.triangles.sample(u_triangle)?;
        let uv = match &part.shape {
            Geometry::Mesh(_) => uniform_triangle(u),
            Geometry::Quadrics(quadrics) => quadric::sample(&quadrics.shapes[primitive], u),
        };
        let met = Met::new(&part.shape, primitive as u32, uv, time);
        let (point, error, normal, area_pdf) = met.on_light(placement);
        let normal = normal.try_normalize()?;
        let to_light = point - position;
        let distance2 = to_light.length_squared();
        let wi = to_light.try_normalize()?;
        let cos = -normal.dot(wi);
        let radiance = material.visible_emission(&met.coordinates(material, placement, 0.0), cos > 0.0);
        let pdf = probability * area_pdf * distance2 / cos.abs();
        let usable = radiance != Vec3::ZERO && pdf > 0.0 && pdf.is_finite();
        // The shadow ray stops just before the light.
        let distance = (distance2.sqrt() * (1.0 - 1e-4) - error).max(0.0);
        usable.then(|| LightSample { wi, distance, weight: radiance / pdf, pdf })
    }
}

/// Area times luminance of the emission at each primitive, object space, with a floor so that every one is found.
fn primitive_weights(part: &ShadedPart, material: &SurfaceMaterial) -> Discrete {
    let floor = 0.05 * luminance(material.mean_emission());
    match &part.shape {
        Geometry::Mesh(mesh) => Discrete::new((0..mesh.indices.len() as u32).map(|primitive| {
            let corners = Corners::new(mesh, primitive, Vec2::splat(1.0 / 3.0), 0.0);
            let [a, b, c] = corners.positions();
            let area = 0.5 * (b - a).cross(c - a).length();
            let at = corners.coordinates(material, (2.0 * area).max(f32::MIN_POSITIVE), area.sqrt());
            area * (luminance(material.visible_emission(&at, true)) + floor)
        })),
        Geometry::Quadrics(quadrics) => {
            let mean = luminance(material.mean_emission());
            Discrete::new(quadrics.shapes.iter().map(|shape| quadric::area(shape) * (mean + floor)))
        }
    }
}

#[inline(always)]
fn light_lanes<F: Real>(
    token: F::Token,
    lane: usize,
    light: &PunctualLight,
    position: &Vectors,
    out: &mut Illumination,
) {
    let (wi, distance, weight) = light.arriving::<F>(Vector::load(token, position, lane));
    wi.store(&mut out.wi, lane);
    distance.store(&mut out.distance, lane);
    weight.store(&mut out.weight, lane);
    F::constant(token, 0.0).store(&mut out.pdf, lane);
}

//! The light that bounding the geometric term takes away, given back by short rays.
//!
//! Where a virtual point light is so near that its geometric term G exceeds the bound b, only b is counted. What is
//! missing is light from surfaces within 1/√b, weighted by 1 − b/G: a ray in a direction of the dull lobes finds it.
//! The surface that it finds is lit under the same bound, and the next short ray finds what is missing there.
//!
//! # References
//! Kollig, Keller, "Illumination in the Presence of Weak Singularities", 2004. The light of the surface found comes from
//! one virtual point light, chosen in proportion to what each would add. Virtual point lights on light sources
//! are not bounded: short rays that find a lamp by chance would be noise.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::color::luminance;
use heliostat_shading::lanes::{Floats, Vectors};
use heliostat_shading::{Lobes, Received, Scattered, Scattering, Selection, Surfaces, Taking};

use super::gather::Block;
use super::vpl::Vpl;
use crate::eye::DULL;
use crate::region::View;
use crate::shadow::{PendingLight, ShadowBatch};
use crate::wave::WaveShader;

/// The lobes that virtual point lights stand for: photons bring the light of all others.
const REFLECTED: Selection = DULL.among(Lobes::REFLECTING);
/// Those of them that are not diffuse.
pub(super) const GLOSS: Selection = REFLECTED.among(Lobes::ALL.without(Lobes::DIFFUSE));
const NOTHING: Selection = Selection::ALL.among(Lobes::NONE);
/// Virtual point lights that are compared at a surface.
const MOST_COMPARED: usize = 8;
/// Short rays of a path at most. Each brings a part of the light of the one before.
pub(super) const LEVELS: usize = 4;

/// A lane and what it makes of radiance that a short ray brings.
#[derive(Clone, Copy, Debug)]
struct Lane {
    block: u32,
    lane: u32,
    /// Times the radiance, irradiance over π.
    irradiance: f32,
    /// Times the radiance, what its other dull lobes reflect.
    gloss: Vec3,
}

/// What a short ray is for.
#[derive(Clone, Copy, Debug)]
struct For {
    lane: Lane,
    /// What of the light that it finds comes to the lane.
    factor: Vec3,
    /// Edges of the path from the eye to its start.
    edges: u32,
    /// Where it starts.
    normal: Vec3,
}

/// The share of its light that a short ray gives back; at most 0 where nothing was taken away.
fn missing(bound: f32, ray: &Ray, hit: &Hit, of: &For) -> f32 {
    if !hit.is_hit() {
        return 0.0;
    }
    let cosines = of.normal.dot(ray.direction) * hit.ng.dot(ray.direction).abs();
    1.0 - bound * hit.t * hit.t / cosines
}

/// Scratch space of the estimate.
#[derive(Debug, Default)]
pub(super) struct Residual {
    samples: Scattered,
    origins: Vectors,
    rays: Vec<Ray>,
    of: Vec<For>,
    hits: Vec<Hit>,
    glossy: Scattering,
    /// The lane that each shadow ray is for.
    lit: Vec<Lane>,
    shader: WaveShader,
    compared: Compared,
    shadows: ShadowBatch,
}

impl Residual {
    /// Rays traced so far besides those that [`Self::add`] returns.
    pub(super) fn shadow_rays(&self) -> u64 {
        self.shadows.traced()
    }

    /// Adds what is missing to the irradiance of all lanes of `blocks`, which `vpls` light with geometric terms of up to
    /// `bound`, in paths of up to `max_edges` edges. Each ray counts `times`, or none is sent; `points` are the numbers of all
    /// lanes, for each ray of a path. Returns the number of short rays.
    pub(super) fn add<Q: RayQuery + ?Sized>(
        &mut self,
        view: &View<'_, Q>,
        (vpls, bound, max_edges): (&[Vpl], f32, u32),
        times: Option<f32>,
        points: &[[f32; 4]; LEVELS],
        blocks: &mut [Block],
    ) -> u64 {
        let Some(times) = times.filter(|_| bound.is_finite() && bound > 0.0) else { return 0 };
        let reach = bound.sqrt().recip();
        self.shoot(blocks, reach, times, points[0]);
        self.lit.clear();
        let mut traced = 0;
        for (level, &[.., u_light]) in points.iter().enumerate() {
            self.hits.clear();
            self.hits.resize(self.rays.len(), Hit::MISS);
            view.query.intersect(&self.rays, &mut self.hits);
            traced += self.rays.len() as u64;
            let next = points.get(level + 1).map(|numbers| numbers.map(Floats::splat));
            self.follow(view, (vpls, bound, max_edges), u_light, next.as_ref(), reach);
        }
        let lit = &self.lit;
        self.shadows.trace(view.query, view.scene, |light| {
            let Lane { block, lane, irradiance, gloss } = lit[light.pixel as usize];
            let (block, lane) = (&mut blocks[block as usize], lane as usize);
            block.irradiance.set(lane, block.irradiance.get(lane) + light.radiance * irradiance);
            block.gloss.set(lane, block.gloss.get(lane) + light.radiance * gloss);
        });
        traced
    }

    /// Asks for the light of the surfaces that the short rays have met, where any was taken away, and replaces the rays by those
    /// that go on from there, in directions of these numbers.
    fn follow<Q: RayQuery + ?Sized>(
        &mut self,
        view: &View<'_, Q>,
        (vpls, bound, max_edges): (&[Vpl], f32, u32),
        u_light: f32,
        next: Option<&[Floats; 4]>,
        reach: f32,
    ) {
        let (rays, mut of) = (std::mem::take(&mut self.rays), std::mem::take(&mut self.of));
        for ((ray, hit), of) in rays.iter().zip(&mut self.hits).zip(&mut of) {
            let missing = missing(bound, ray, hit, of);
            if missing > 0.0 {
                of.factor *= missing;
                of.edges += 1;
            } else {
                *hit = Hit::MISS;
            }
        }
        let Self { shader, compared, samples, rays: next_rays, of: next_of, lit, shadows, .. } = self;
        shader.shade(view.scene, (&rays, &self.hits), |indices, surfaces| {
            let count = indices.len();
            if let Some([u_lobe, u, v, _]) = next {
                surfaces.sample([u_lobe, u, v], REFLECTED, count, samples);
            }
            compared.fill((vpls, bound), (surfaces, count), u_light);
            for (lane, &index) in indices.iter().enumerate() {
                let before = &of[index as usize];
                let most_bounces = max_edges.saturating_sub(before.edges);
                if let Some((light, wi, radiance)) = compared.choose(vpls, (surfaces, lane), most_bounces) {
                    let far = |origin: Vec3| origin.distance(surfaces.position(lane)) * (1.0 - 1e-4);
                    let distance = light.source.origin().map_or(f32::INFINITY, far);
                    let shadow = Ray { t_max: distance, ..Ray::new(surfaces.origin(lane, wi), wi) };
                    let radiance = radiance * before.factor;
                    shadows.push(shadow, PendingLight { pixel: lit.len() as u32, radiance });
                    lit.push(before.lane);
                }
                if next.is_some() && samples.valid[lane] {
                    let (wi, factor) = (samples.wi.get(lane), before.factor * samples.weight.get(lane));
                    next_rays.push(Ray { t_max: reach, ..Ray::new(surfaces.origin(lane, wi), wi) });
                    next_of.push(For { factor, normal: surfaces.normal(lane), ..*before });
                }
            }
        });
    }

    /// A short ray for every lane that scatters dully, or for a share of them. Each counts `times`.
    fn shoot(&mut self, blocks: &[Block], reach: f32, times: f32, numbers: [f32; 4]) {
        self.rays.clear();
        self.of.clear();
        let [u_lobe, u, v, _] = numbers.map(Floats::splat);
        for (index, block) in (0..).zip(blocks) {
            let (surfaces, samples) = (&block.surfaces, &mut self.samples);
            if !surfaces.may_have(REFLECTED) {
                continue;
            }
            surfaces.sample([&u_lobe, &u, &v], REFLECTED, block.count, samples);
            surfaces.spawn(&samples.wi, block.count, &mut self.origins);
            surfaces.evaluate(&samples.wi, GLOSS, block.count, &mut self.glossy);
            for lane in 0..block.count {
                if block.takes(lane) && samples.valid[lane] && block.weights[lane] != Vec3::ZERO {
                    let (normal, wi) = (surfaces.normal(lane), samples.wi.get(lane));
                    let weight = times / (block.share * samples.pdf.0[lane]);
                    let irradiance = normal.dot(wi).max(0.0) * (FRAC_1_PI * weight);
                    let gloss = self.glossy.f_cos.get(lane) * weight;
                    self.rays.push(Ray { t_max: reach, ..Ray::new(self.origins.get(lane), wi) });
                    let (edges, factor) = (block.edges[lane], Vec3::ONE);
                    let lane = Lane { block: index, lane: lane as u32, irradiance, gloss };
                    self.of.push(For { lane, factor, edges, normal });
                }
            }
        }
    }
}

/// Some virtual point lights compared at the surfaces of a packet.
#[derive(Debug, Default)]
struct Compared {
    /// Every so many of all, from one that chance says.
    first: usize,
    step: usize,
    /// Chooses among these.
    u: f32,
    received: Vec<Received>,
}

impl Compared {
    /// What some of `vpls`, which chance takes, would add at the surfaces if nothing stood between.
    fn fill(&mut self, (vpls, bound): (&[Vpl], f32), (surfaces, count): (&Surfaces, usize), u: f32) {
        self.step = vpls.len().div_ceil(MOST_COMPARED).max(1);
        let place = u * self.step as f32;
        self.first = (place as usize).min(self.step - 1);
        // What is left of the number.
        self.u = (place - self.first as f32).min(1.0 - f32::EPSILON);
        let some = vpls.iter().skip(self.first).step_by(self.step);
        self.received.resize_with(some.len(), Received::default);
        for (vpl, received) in some.zip(&mut self.received) {
            let bound = if vpl.bounces > 0 { bound } else { f32::INFINITY };
            let taking = Taking { bound, gloss: DULL, shared: NOTHING };
            surfaces.receive(&vpl.source, &taking, count, received);
        }
    }

    /// Chooses one of them for a lane in proportion to what it would add: the light, the direction to it, and the radiance that
    /// the lane reflects over the probability of the choice. Only those of less than so many bounces are.
    fn choose<'a>(
        &self,
        vpls: &'a [Vpl],
        (surfaces, lane): (&Surfaces, usize),
        most_bounces: u32,
    ) -> Option<(&'a Vpl, Vec3, Vec3)> {
        let diffuse = surfaces.diffuse(lane);
        let reflected =
            |received: &Received| received.irradiance.get(lane) * diffuse + received.gloss.get(lane);
        let weight = |(vpl, received): (&Vpl, &Received)| {
            let weight = luminance(reflected(received));
            if vpl.bounces < most_bounces && weight.is_finite() { weight } else { 0.0 }
        };
        let some = || vpls.iter().skip(self.first).step_by(self.step).zip(&self.received);
        let total: f32 = some().map(weight).sum();
        let mut rest = self.u * total;
        let mut chosen = None;
        // Rounding may leave the last one open.
        for (vpl, received) in some() {
            let weight = weight((vpl, received));
            if weight > 0.0 {
                chosen = Some((vpl, received, weight));
                if rest < weight {
                    break;
                }
                rest -= weight;
            }
        }
        let (vpl, received, weight) = chosen?;
        let scale = total * self.step as f32 / weight;
        Some((vpl, received.wi.get(lane), reflected(received) * scale))
    }
}

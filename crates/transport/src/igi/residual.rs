//! The light that bounding the geometric term takes away, given back by short rays.
//!
//! Where a virtual point light is so near that its geometric term G exceeds the bound b, only b is counted. What is
//! missing is light from surfaces within 1/√b, weighted by 1 − b/G: a ray in a cosine-distributed direction finds it.
//! The surface that it finds is lit under the same bound, and the next short ray finds what is missing there.
//!
//! # References
//! Kollig, Keller, "Illumination in the Presence of Weak Singularities", 2004. The light of the surface found comes from
//! one virtual point light, chosen in proportion to what each would add. Virtual point lights on light sources
//! are not bounded: short rays that find a lamp by chance would be noise.

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::color::luminance;
use heliostat_shading::lanes::{Floats, Vectors};
use heliostat_shading::sampling::cosine_hemisphere;
use heliostat_shading::{Basis, Cone, Lobes, Scattered, Selection, Surface};

use super::gather::Block;
use super::vpl::Vpl;
use crate::region::View;
use crate::shadow::{PendingLight, ShadowBatch};

/// Virtual point lights that are compared at a surface.
const MOST_COMPARED: usize = 8;
/// Short rays of a path at most. Each brings a part of the light of the one before.
pub(super) const LEVELS: usize = 4;

/// What a short ray is for.
#[derive(Clone, Copy, Debug)]
struct For {
    block: u32,
    lane: u32,
    /// What the light that it finds is to be multiplied with.
    factor: Vec3,
    /// Edges of the path from the eye to its start.
    edges: u32,
    /// Where it starts.
    normal: Vec3,
}

/// The surface that a short ray has met if anything is missing of its light, and what rays from there are for.
fn arrive<Q: ?Sized>(
    view: &View<'_, Q>,
    bound: f32,
    (ray, hit): (&Ray, &Hit),
    of: &For,
) -> Option<(Surface<f32>, For)> {
    if !hit.is_hit() {
        return None;
    }
    let cosines = of.normal.dot(ray.direction) * hit.ng.dot(ray.direction).abs();
    let missing = 1.0 - bound * hit.t * hit.t / cosines;
    if missing.is_nan() || missing <= 0.0 {
        return None;
    }
    let surface = view.scene.surface(hit, ray, Cone::default());
    let albedo = Vec3::from(surface.bsdf.albedo_of(Selection::ALL));
    let of = For {
        factor: of.factor * albedo * missing,
        edges: of.edges + 1,
        normal: surface.bsdf.normal().into(),
        ..*of
    };
    Some((surface, of))
}

/// Scratch space of the estimate.
#[derive(Debug, Default)]
pub(super) struct Residual {
    samples: Scattered,
    origins: Vectors,
    rays: Vec<Ray>,
    of: Vec<For>,
    hits: Vec<Hit>,
    /// Block and lane that each shadow ray is for.
    lit: Vec<(u32, u32)>,
    /// Running sum of weights, direction, distance and radiance over weight of each light at a surface.
    lights: Vec<(f32, Vec3, f32, Vec3)>,
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
            let (rays, of) = (std::mem::take(&mut self.rays), std::mem::take(&mut self.of));
            for (index, (ray, of)) in rays.iter().zip(&of).enumerate() {
                let Some((surface, of)) = arrive(view, bound, (ray, &self.hits[index]), of) else { continue };
                self.light((vpls, bound), &surface, &of, (u_light, max_edges));
                if let Some(&[_, u, v, _]) = points.get(level + 1) {
                    let up = cosine_hemisphere([u, v]);
                    let wi = Basis::from_normal(surface.bsdf.normal()).to_world(up);
                    let ray = Ray::new(surface.spawn(wi).into(), wi.into());
                    self.rays.push(Ray { t_max: reach, ..ray });
                    self.of.push(of);
                }
            }
        }
        let lit = &self.lit;
        self.shadows.trace(view.query, view.scene, |light| {
            let (block, lane) = lit[light.pixel as usize];
            let (irradiance, lane) = (&mut blocks[block as usize].irradiance, lane as usize);
            irradiance.set(lane, irradiance.get(lane) + light.radiance);
        });
        traced
    }

    /// Asks for the light of a virtual point light on a surface that a short ray has met.
    fn light(
        &mut self,
        (vpls, bound): (&[Vpl], f32),
        surface: &Surface<f32>,
        of: &For,
        (u_light, max_edges): (f32, u32),
    ) {
        let most_bounces = max_edges.saturating_sub(of.edges);
        if let Some((wi, distance, radiance)) = self.choose((vpls, most_bounces), bound, surface, u_light) {
            let shadow = Ray { t_max: distance, ..Ray::new(surface.spawn(wi.into()).into(), wi) };
            let light = PendingLight { pixel: self.lit.len() as u32, radiance: radiance * of.factor };
            self.shadows.push(shadow, light);
            self.lit.push((of.block, of.lane));
        }
    }

    /// Chooses a virtual point light in proportion to what it would add at a surface if nothing stood between, among some that
    /// chance has taken: direction, distance and irradiance over π, over the probability of the choice. Only those of less than
    /// so many bounces are.
    fn choose(
        &mut self,
        (vpls, most_bounces): (&[Vpl], u32),
        bound: f32,
        surface: &Surface<f32>,
        u: f32,
    ) -> Option<(Vec3, f32, Vec3)> {
        let at = surface.position.into();
        let (normal, ng) = (Vec3::from(surface.bsdf.normal()), Vec3::from(surface.ng()));
        self.lights.clear();
        // Every so many of them, from one that chance says; what is left of the number chooses among these.
        let step = vpls.len().div_ceil(MOST_COMPARED).max(1);
        let place = u * step as f32;
        let first = (place as usize).min(step - 1);
        let u = (place - first as f32).min(1.0 - f32::EPSILON);
        let mut total = 0.0;
        let some = vpls.iter().skip(first).step_by(step);
        for vpl in some.filter(|vpl| vpl.bounces < most_bounces) {
            let light = vpl.source.light(at);
            let cos = if ng.dot(light.wi) > 0.0 { normal.dot(light.wi).max(0.0) } else { 0.0 };
            let term = light.facing * cos;
            let term = if light.is_near && vpl.bounces > 0 { term.min(bound) } else { term };
            let radiance = light.radiance * (term * std::f32::consts::FRAC_1_PI);
            let weight = luminance(radiance);
            if weight > 0.0 && weight.is_finite() {
                total += weight;
                self.lights.push((total, light.wi, light.distance, radiance / weight));
            }
        }
        let chosen = self.lights.partition_point(|light| light.0 <= u * total);
        let &(_, wi, distance, color) = self.lights.get(chosen)?;
        Some((wi, distance, color * (total * step as f32)))
    }

    /// A short ray for every lane that scatters diffusely, or for a share of them. Each counts `times`.
    fn shoot(&mut self, blocks: &[Block], reach: f32, times: f32, numbers: [f32; 4]) {
        self.rays.clear();
        self.of.clear();
        let diffuse = Selection::ALL.among(Lobes::DIFFUSE);
        for (index, block) in blocks.iter().enumerate() {
            if !block.surfaces.may_have(diffuse) {
                continue;
            }
            let [u_lobe, u, v, _] = numbers.map(Floats::splat);
            block.surfaces.sample([&u_lobe, &u, &v], diffuse, block.count, &mut self.samples);
            block.surfaces.spawn(&self.samples.wi, block.count, &mut self.origins);
            for lane in 0..block.count {
                if block.takes(lane) && self.samples.valid[lane] && block.weights[lane] != Vec3::ZERO {
                    let ray = Ray::new(self.origins.get(lane), self.samples.wi.get(lane));
                    self.rays.push(Ray { t_max: reach, ..ray });
                    self.of.push(For {
                        block: index as u32,
                        lane: lane as u32,
                        factor: Vec3::splat(times / block.share),
                        edges: block.edges[lane],
                        normal: block.surfaces.normal(lane),
                    });
                }
            }
        }
    }
}

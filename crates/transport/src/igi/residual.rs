//! The light that bounding the geometric term takes away, given back by short rays.
//!
//! Where a virtual point light is so near that its geometric term G exceeds the bound b, only b is counted. What is
//! missing is light from surfaces within 1/√b, weighted by 1 − b/G: a ray in a cosine-distributed direction finds it.
//!
//! # References
//! Kollig, Keller, "Illumination in the Presence of Weak Singularities", 2004. The light of the surface found comes from
//! one virtual point light, chosen in proportion to what each would add, and is bounded again, where the paper recurses. Virtual point lights on light sources
//! are not bounded: short rays that find a lamp by chance would be noise.

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::color::luminance;
use heliostat_shading::lanes::{Floats, Vectors};
use heliostat_shading::{Cone, Lobes, Scattered, Selection, Surface};

use super::gather::Block;
use super::vpl::Vpl;
use crate::region::View;
use crate::shadow::{PendingLight, ShadowBatch};

/// Virtual point lights that are compared at a surface.
const MOST_COMPARED: usize = 8;

/// Scratch space of the estimate.
#[derive(Debug, Default)]
pub(super) struct Residual {
    samples: Scattered,
    origins: Vectors,
    rays: Vec<Ray>,
    /// Block, lane, number for the choice of a light, and what light is to be multiplied with, of each ray.
    of: Vec<(u32, u32, f32, f32)>,
    hits: Vec<Hit>,
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
    /// `bound`. Each ray counts `times`, or none is sent. Returns the number of short rays.
    pub(super) fn add<Q: RayQuery + ?Sized>(
        &mut self,
        view: &View<'_, Q>,
        vpls: &[Vpl],
        (bound, times): (f32, Option<f32>),
        blocks: &mut [Block],
    ) -> u64 {
        let Some(times) = times.filter(|_| bound.is_finite() && bound > 0.0) else { return 0 };
        self.shoot(blocks, bound.sqrt().recip(), times);
        self.hits.clear();
        self.hits.resize(self.rays.len(), Hit::MISS);
        view.query.intersect(&self.rays, &mut self.hits);
        for i in 0..self.hits.len() {
            let (hit, ray, (block, lane, u_light, times)) = (&self.hits[i], &self.rays[i], self.of[i]);
            if !hit.is_hit() {
                continue;
            }
            let normal = blocks[block as usize].surfaces.normal(lane as usize);
            let cosines = normal.dot(ray.direction) * hit.ng.dot(ray.direction).abs();
            let missing = 1.0 - bound * hit.t * hit.t / cosines;
            if missing <= 0.0 {
                continue;
            }
            let surface = view.scene.surface(hit, ray, Cone::default());
            let chosen = self.choose(vpls, bound, &surface, u_light);
            let Some((wi, distance, radiance)) = chosen else { continue };
            let shadow = Ray { t_max: distance, ..Ray::new(surface.spawn(wi.into()).into(), wi) };
            let radiance = radiance * (missing * times);
            self.shadows.push(shadow, PendingLight { pixel: i as u32, radiance });
        }
        let of = &self.of;
        self.shadows.trace(view.query, view.scene, |light| {
            let (block, lane, ..) = of[light.pixel as usize];
            let (irradiance, lane) = (&mut blocks[block as usize].irradiance, lane as usize);
            irradiance.set(lane, irradiance.get(lane) + light.radiance);
        });
        self.rays.len() as u64
    }

    /// Chooses a virtual point light in proportion to what it would add at a surface if nothing stood between, among some that
    /// chance has taken: direction, distance and radiance, over the probability of the choice.
    fn choose(
        &mut self,
        vpls: &[Vpl],
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
        for vpl in vpls.iter().skip(first).step_by(step) {
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
        let albedo = Vec3::from(surface.bsdf.albedo_of(Selection::ALL));
        Some((wi, distance, albedo * color * (total * step as f32)))
    }

    /// A short ray for every lane that scatters diffusely, or for a share of them. Each counts `times`.
    fn shoot(&mut self, blocks: &[Block], reach: f32, times: f32) {
        self.rays.clear();
        self.of.clear();
        let diffuse = Selection::ALL.among(Lobes::DIFFUSE);
        for (index, block) in blocks.iter().enumerate() {
            if !block.surfaces.may_have(diffuse) {
                continue;
            }
            let [u_lobe, u, v, u_light] = block.point.map(Floats::splat);
            block.surfaces.sample([&u_lobe, &u, &v], diffuse, block.count, &mut self.samples);
            block.surfaces.spawn(&self.samples.wi, block.count, &mut self.origins);
            for lane in 0..block.count {
                if block.takes(lane) && self.samples.valid[lane] && block.weights[lane] != Vec3::ZERO {
                    let ray = Ray::new(self.origins.get(lane), self.samples.wi.get(lane));
                    self.rays.push(Ray { t_max: reach, ..ray });
                    self.of.push((index as u32, lane as u32, u_light.0[lane], times / block.share));
                }
            }
        }
    }
}

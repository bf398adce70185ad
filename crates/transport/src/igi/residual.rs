//! The light that bounding the geometric term takes away, given back by short rays.
//!
//! Where a virtual point light is so near that its geometric term G exceeds the bound b, only b is counted. What is
//! missing is light from surfaces within 1/√b, weighted by 1 − b/G: a ray in a cosine-distributed direction finds it.
//!
//! # References
//! Kollig, Keller, "Illumination in the Presence of Weak Singularities", 2004. The light of the surface found comes from
//! one virtual point light by chance and is bounded again, where the paper recurses.

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::lanes::{Floats, Vectors};
use heliostat_shading::{Cone, Lobes, Scattered, Selection};

use super::gather::Block;
use super::vpl::Vpl;
use crate::region::View;
use crate::shadow::{PendingLight, ShadowBatch};

/// Scratch space of the estimate.
#[derive(Debug, Default)]
pub(super) struct Residual {
    samples: Scattered,
    origins: Vectors,
    rays: Vec<Ray>,
    /// Block, lane and sample points of each ray.
    of: Vec<(u32, u32, [f32; 4])>,
    hits: Vec<Hit>,
    shadows: ShadowBatch,
}

impl Residual {
    /// Rays traced so far besides those that [`Self::add`] returns.
    pub(super) fn shadow_rays(&self) -> u64 {
        self.shadows.traced()
    }

    /// Adds what is missing to the irradiance of all lanes of `blocks`, which `vpls` light with geometric terms of up to
    /// `bound`. Returns the number of short rays.
    pub(super) fn add<Q: RayQuery + ?Sized>(
        &mut self,
        view: &View<'_, Q>,
        vpls: &[Vpl],
        bound: f32,
        blocks: &mut [Block],
    ) -> u64 {
        if !(bound.is_finite() && bound > 0.0) {
            return 0;
        }
        self.shoot(blocks, bound.sqrt().recip());
        self.hits.clear();
        self.hits.resize(self.rays.len(), Hit::MISS);
        view.query.intersect(&self.rays, &mut self.hits);
        for (i, hit) in self.hits.iter().enumerate().filter(|(_, hit)| hit.is_hit()) {
            let (block, lane, points) = self.of[i];
            let ray = &self.rays[i];
            let normal = blocks[block as usize].surfaces.normal(lane as usize);
            let cosines = normal.dot(ray.direction) * hit.ng.dot(ray.direction).abs();
            let missing = 1.0 - bound * hit.t * hit.t / cosines;
            if missing <= 0.0 {
                continue;
            }
            let surface = view.scene.surface(hit, ray, Cone::default());
            let into = &mut blocks[block as usize].irradiance[lane as usize];
            *into += Vec3::from(surface.emission) * missing;
            let [_, _, _, u] = points;
            let Some(vpl) = vpls.get((u * vpls.len() as f32) as usize) else { continue };
            let (normal, ng) = (Vec3::from(surface.bsdf.normal()), Vec3::from(surface.ng()));
            let light = vpl.source.light(surface.position.into());
            let cos = normal.dot(light.wi);
            if cos <= 0.0 || ng.dot(light.wi) <= 0.0 {
                continue;
            }
            let kept = if light.is_near { (bound / (cos * light.facing)).min(1.0) } else { 1.0 };
            let albedo = Vec3::from(surface.bsdf.albedo_of(Selection::ALL));
            let chance = 1.0 / vpls.len() as f32;
            let radiance = albedo * light.radiance * (light.facing * cos * kept * missing / chance);
            let radiance = radiance * std::f32::consts::FRAC_1_PI;
            let origin = surface.spawn(light.wi.into()).into();
            let shadow = Ray { t_max: light.distance, ..Ray::new(origin, light.wi) };
            self.shadows.push(shadow, PendingLight { pixel: i as u32, radiance });
        }
        let of = &self.of;
        self.shadows.trace(view.query, view.scene, |light| {
            let (block, lane, _) = of[light.pixel as usize];
            blocks[block as usize].irradiance[lane as usize] += light.radiance;
        });
        self.rays.len() as u64
    }

    /// A short ray for every lane that scatters diffusely.
    fn shoot(&mut self, blocks: &[Block], reach: f32) {
        self.rays.clear();
        self.of.clear();
        let diffuse = Selection::ALL.among(Lobes::DIFFUSE);
        for (index, block) in blocks.iter().enumerate() {
            if !block.surfaces.may_have(diffuse) {
                continue;
            }
            let mut u = [Floats::ZERO; 3];
            for (lane, points) in block.points[..block.count].iter().enumerate() {
                (u[0].0[lane], u[1].0[lane], u[2].0[lane]) = (points[0], points[1], points[2]);
            }
            block.surfaces.sample(&u, diffuse, block.count, &mut self.samples);
            block.surfaces.spawn(&self.samples.wi, block.count, &mut self.origins);
            for lane in 0..block.count {
                if self.samples.valid[lane] && block.weights[lane] != Vec3::ZERO {
                    let ray = Ray::new(self.origins.get(lane), self.samples.wi.get(lane));
                    self.rays.push(Ray { t_max: reach, ..ray });
                    self.of.push((index as u32, lane as u32, block.points[lane]));
                }
            }
        }
    }
}

//! Shadow rays: light on its way to a surface point, through whatever lets it pass.

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::ShadingScene;

/// Surfaces that a ray of any kind may pass straight through one after the other; what is behind more of them is lost.
pub(crate) const MAX_PASSED: u32 = 256;

/// Light that arrives unless something stands in the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PendingLight {
    /// Index into the region's pixels.
    pub(crate) pixel: u32,
    /// Radiance added to the pixel if the way is free.
    pub(crate) radiance: Vec3,
}

/// Shadow rays of a batch with what they carry.
#[derive(Debug, Default)]
pub(crate) struct ShadowBatch {
    rays: Vec<Ray>,
    lights: Vec<PendingLight>,
    occluded: Vec<bool>,
    /// Not occluded, but by what lets some light pass.
    filtered: Vec<bool>,
    hits: Vec<Hit>,
    traced: u64,
}

impl ShadowBatch {
    /// Adds a ray, of unit direction, that ends at the light.
    pub(crate) fn push(&mut self, ray: Ray, light: PendingLight) {
        self.rays.push(ray);
        self.lights.push(light);
    }

    /// Rays waiting to be traced.
    pub(crate) fn len(&self) -> usize {
        self.rays.len()
    }

    /// Rays traced by all batches so far.
    pub(crate) fn traced(&self) -> u64 {
        self.traced
    }

    /// Traces the batch, hands what arrives to `deliver` in the order of the pushes, and empties it.
    pub(crate) fn trace<Q: RayQuery + ?Sized>(
        &mut self,
        query: &Q,
        scene: &ShadingScene,
        deliver: impl FnMut(PendingLight),
    ) {
        self.occluded.clear();
        self.occluded.resize(self.rays.len(), false);
        self.traced += self.rays.len() as u64;
        if scene.has_see_through() {
            self.filtered.clear();
            self.filtered.resize(self.rays.len(), false);
            query.occluded_through(&self.rays, scene, &mut self.occluded, &mut self.filtered);
            self.attenuate(query, scene);
        } else {
            query.occluded(&self.rays, &mut self.occluded);
        }
        for (light, &occluded) in self.lights.iter_mut().zip(&self.occluded) {
            if occluded {
                light.radiance = Vec3::ZERO;
            }
        }
        self.lights.iter().copied().filter(|light| light.radiance != Vec3::ZERO).for_each(deliver);
        self.rays.clear();
        self.lights.clear();
    }

    /// Follows the rays that only meet what lets light pass from surface to surface until they arrive or are blocked.
    fn attenuate<Q: RayQuery + ?Sized>(&mut self, query: &Q, scene: &ShadingScene) {
        let mut active: Vec<usize> = (0..self.rays.len()).filter(|&i| self.filtered[i]).collect();
        let mut rays: Vec<Ray> = active.iter().map(|&i| self.rays[i]).collect();
        for round in 0.. {
            if active.is_empty() {
                return;
            }
            self.hits.clear();
            self.hits.resize(rays.len(), Hit::MISS);
            query.intersect(&rays, &mut self.hits);
            self.traced += rays.len() as u64;
            let mut next = Vec::new();
            let mut next_rays = Vec::new();
            for ((&index, ray), hit) in active.iter().zip(&rays).zip(&self.hits) {
                if !hit.is_hit() {
                    continue;
                }
                let light = &mut self.lights[index];
                let passage = if round < MAX_PASSED { scene.see_through(hit, ray) } else { None };
                let Some((transmittance, origin)) = passage else {
                    light.radiance = Vec3::ZERO;
                    continue;
                };
                light.radiance *= transmittance;
                let t_max = ray.t_max - hit.t;
                if t_max > 0.0 {
                    next.push(index);
                    next_rays.push(Ray { origin, t_max, ..*ray });
                }
            }
            (active, rays) = (next, next_rays);
        }
    }
}

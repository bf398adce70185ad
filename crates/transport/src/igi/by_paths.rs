//! What Instant Global Illumination is compared with: one path from every point instead of virtual point lights, and the
//! rest alike: the same points behind mirrors and glass, the same filter, the same history.

use glam::Vec3;
use heliostat_kernel::RayQuery;
use heliostat_shading::Surfaces;
use heliostat_shading::color::luminance;

use super::Gathered;
use crate::eye::{Arrived, DULL, Lighting, WeightedRay};
use crate::mis::Visits;
use crate::path::{Path, Start, Tracer};
use crate::region::{PixelSum, View};

/// A point that waits for its light.
#[derive(Clone, Copy, Debug)]
struct Point {
    pixel: u32,
    /// Largest GGX α on the way from the eye.
    alpha: f32,
    /// Albedo of the lobes that paths are sampled by.
    dull: Vec3,
    gathered: Gathered,
}

/// Lights every point by one sample of a light and one path.
pub(super) struct ByPaths<'a, Q: ?Sized> {
    tracer: Tracer<'a, Q>,
    /// What the pixels of the region have received by this sample.
    pub(super) gathered: Vec<Gathered>,
    traced: u64,
    points: Vec<Point>,
    paths: Vec<Path>,
}

impl<'a, Q: RayQuery + ?Sized> ByPaths<'a, Q> {
    /// Whole paths have at most `max_edges` edges.
    pub(super) fn new(view: &'a View<'a, Q>, pixels: usize, max_edges: u32) -> Self {
        Self {
            tracer: Tracer::new(view, max_edges),
            gathered: vec![Gathered::default(); pixels],
            traced: 0,
            points: Vec::new(),
            paths: Vec::new(),
        }
    }

    /// Rays traced for light so far.
    pub(super) fn traced(&self) -> u64 {
        self.traced + self.tracer.shadow_rays()
    }
}

impl<Q: RayQuery + ?Sized> Lighting<Q> for ByPaths<'_, Q> {
    fn visits(&self) -> Visits<'_> {
        Visits::One
    }

    fn groups(&self) -> usize {
        1
    }

    fn group(&self, _: u32) -> usize {
        0
    }

    fn packet(
        &mut self,
        _: &View<'_, Q>,
        arrived: Arrived<'_>,
        surfaces: &Surfaces,
        _: &mut [PixelSum],
    ) -> bool {
        if !surfaces.may_have(DULL) {
            return false;
        }
        for (lane, ray) in arrived.rays().enumerate() {
            let surface = surfaces.lane(lane);
            let dull = Vec3::from(surface.bsdf.albedo_of(DULL));
            if ray.weight == Vec3::ZERO || dull == Vec3::ZERO {
                continue;
            }
            let gathered = Gathered {
                albedo: ray.weight * dull,
                position: surfaces.position(lane),
                normal: surfaces.normal(lane),
                strength: luminance(ray.weight * dull),
                coverage: 1.0,
                straight: ray.edges == 1,
                ..Gathered::default()
            };
            let pixel = self.points.len() as u32;
            let WeightedRay { sampler, ray: way, cone, edges, .. } = *ray;
            let start = Start { pixel, sampler, ray: way, cone, edges };
            self.paths.extend(self.tracer.start_at(&surface, DULL, &start));
            self.points.push(Point { pixel: ray.pixel, alpha: ray.alpha, dull, gathered });
        }
        false
    }

    fn find(&mut self, ray: &WeightedRay, radiance: Vec3, _: &mut PixelSum) {
        self.gathered[ray.pixel as usize].find(ray, radiance);
    }

    fn finish(&mut self, _: &View<'_, Q>, _: usize, _: &mut [PixelSum]) {
        let mut sums = vec![PixelSum::default(); self.points.len()];
        self.traced += self.tracer.follow(std::mem::take(&mut self.paths), &mut sums);
        for (mut point, sum) in self.points.drain(..).zip(&sums) {
            // Apart from the colour; a channel that the surface does not reflect has no light.
            let irradiance = (sum.color + sum.lit) / point.dull;
            point.gathered.irradiance = Vec3::select(point.dull.cmpgt(Vec3::ZERO), irradiance, Vec3::ZERO);
            self.gathered[point.pixel as usize].arrive(point.alpha, point.gathered);
        }
    }
}

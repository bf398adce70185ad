//! Camera rays alone: no materials, no lights, no shaders. What it takes is what tracing takes.
//!
//! # References
//! Wald, Purcell, Schmittler, Benthin, Slusallek, "Realtime Ray Tracing and its use for Interactive Global Illumination",
//! 2003, table 1 (frames with and without shading).

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::ShadingScene;

use crate::region::{Adds, CameraSample, FirstHit, PixelSum, Region, Settings, View, Walk, walk};

/// See [`Integrator::render`](crate::Integrator::render).
pub(crate) fn render<Q: RayQuery + ?Sized>(
    view: &View<'_, Q>,
    settings: &Settings,
    region: &Region,
    sums: &mut [PixelSum],
    after_sample: &dyn Fn() -> bool,
) -> u64 {
    walk(&mut EyeLight { scene: view.scene }, view, settings, region, sums, after_sample)
}

/// Geometry as if a light stood in the eye: as bright as the cosine between ray and surface, black where there is nothing.
struct EyeLight<'a> {
    scene: &'a ShadingScene,
}

impl Walk for EyeLight<'_> {
    type Ray = CameraSample;

    #[inline(always)]
    fn start(sample: &CameraSample) -> CameraSample {
        *sample
    }

    #[inline(always)]
    fn ray(sample: &CameraSample) -> Ray {
        sample.ray
    }

    fn step(
        &mut self,
        rays: Vec<CameraSample>,
        hits: &[Hit],
        sums: &mut [PixelSum],
        adds: Adds,
    ) -> Vec<CameraSample> {
        for (sample, hit) in rays.iter().zip(hits).filter(|(_, hit)| hit.is_hit()) {
            let (sum, ray) = (&mut sums[sample.pixel as usize], &sample.ray);
            let cos = hit.ng.dot(ray.direction);
            sum.color += Vec3::splat(cos.abs());
            if adds == Adds::Light {
                continue;
            }
            sum.depth += hit.t;
            sum.normal -= hit.ng * cos.signum();
            sum.position += ray.origin + ray.direction * hit.t;
            sum.hits += 1.0;
            if adds == Adds::Identifiers {
                sum.first = Some(FirstHit::of(self.scene, hit));
            }
        }
        Vec::new()
    }
}

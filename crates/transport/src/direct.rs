//! The classical ray tracer: shadows from all lights, mirrors and glass, iteratively.
//!
//! Glossy lobes send their ray in a random direction of the lobe; rough ones and diffuse ones see lights alone.

use glam::Vec3;
use heliostat_kernel::{Ray, RayQuery};
use heliostat_shading::lanes::Vectors;
use heliostat_shading::{Illumination, SamplePoints, Scattering, Surfaces};

use crate::eye::{Arrived, DULL, EyeWalk, Lighting, MIRRORS, SIDES, WeightedRay};
use crate::mis::{Visits, power_heuristic};
use crate::region::{PixelSum, Region, Settings, View, walk};
use crate::shadow::{PendingLight, ShadowBatch};

/// Shadow rays traced together.
const SHADOW_BATCH: usize = 4096;

/// See [`Integrator::render`](crate::Integrator::render). Without shadows the first surface is all there is.
pub(crate) fn render<Q: RayQuery + ?Sized>(
    view: &View<'_, Q>,
    settings: &Settings,
    region: &Region,
    sums: &mut [PixelSum],
    after_sample: &dyn Fn() -> bool,
    shadowed: bool,
) -> u64 {
    let lights = AllLights { shadowed, ..AllLights::default() };
    let mut tracer = EyeWalk::new(view, settings, sums.len(), lights);
    walk(&mut tracer, view, settings, region, sums, after_sample) + tracer.lighting.shadows.traced()
}

/// Every surface samples every light.
#[derive(Debug, Default)]
struct AllLights {
    /// Whether shadow rays are traced and mirrors followed.
    shadowed: bool,
    shadows: ShadowBatch,
    points: SamplePoints,
    light: Illumination,
    values: Scattering,
    sharp: Scattering,
    origins: Vectors,
}

impl AllLights {
    fn trace<Q: RayQuery + ?Sized>(&mut self, view: &View<'_, Q>, sums: &mut [PixelSum]) {
        self.shadows.trace(view.query, view.scene, |light| {
            sums[light.pixel as usize].add_lit(light.radiance);
        });
    }
}

impl<Q: RayQuery + ?Sized> Lighting<Q> for AllLights {
    fn visits(&self) -> Visits<'_> {
        Visits::All
    }

    fn follows_mirrors(&self) -> bool {
        self.shadowed
    }

    fn groups(&self) -> usize {
        1
    }

    fn group(&self, _: u32) -> usize {
        0
    }

    /// A shadow ray to a point of every light. Lobes that send rays of their own share the work with them.
    fn packet(
        &mut self,
        view: &View<'_, Q>,
        arrived: Arrived<'_>,
        surfaces: &Surfaces,
        sums: &mut [PixelSum],
    ) -> bool {
        let (scene, count) = (view.scene, arrived.count());
        let Self { shadowed, shadows, points, light, values, sharp, origins } = self;
        for emitter in 0..scene.lights().len() {
            if scene.lights().is_extended(emitter) {
                for (lane, ray) in arrived.rays().enumerate() {
                    ray.ask(2 + emitter as u32, lane, points);
                }
                points.draw(scene.lane_mode(), count);
            }
            let along = |lane: usize| (arrived.ray(lane).ray.time, points.get(lane));
            scene.illuminate(emitter, surfaces, along, count, light);
            surfaces.evaluate(&light.wi, DULL, count, values);
            for side in SIDES {
                if !surfaces.may_have(MIRRORS.among(side)) {
                    continue;
                }
                surfaces.evaluate(&light.wi, MIRRORS.among(side), count, sharp);
                for lane in 0..count {
                    let pdf = light.pdf.0[lane];
                    let share = if pdf == 0.0 { 1.0 } else { power_heuristic(pdf, sharp.pdf.0[lane]) };
                    values.f_cos.set(lane, values.f_cos.get(lane) + sharp.f_cos.get(lane) * share);
                }
            }
            if *shadowed {
                surfaces.spawn(&light.wi, count, origins);
            }
            values.f_cos.scale(&light.weight);
            for (lane, ray) in arrived.rays().enumerate() {
                let radiance = ray.weight * values.f_cos.get(lane);
                if radiance != Vec3::ZERO && !*shadowed {
                    sums[ray.pixel as usize].add_lit(radiance);
                } else if radiance != Vec3::ZERO {
                    let pending = PendingLight { pixel: ray.pixel, radiance };
                    let shadow = Ray::new(origins.get(lane), light.wi.get(lane));
                    let shadow = Ray { t_max: light.distance.0[lane], ..shadow };
                    shadows.push(shadow.at_time(ray.ray.time), pending);
                }
            }
        }
        if self.shadows.len() >= SHADOW_BATCH {
            self.trace(view, sums);
        }
        true
    }

    fn find(&mut self, _: &WeightedRay, radiance: Vec3, sum: &mut PixelSum) {
        sum.add_radiance(radiance);
    }

    fn finish(&mut self, view: &View<'_, Q>, _: usize, sums: &mut [PixelSum]) {
        self.trace(view, sums);
    }
}

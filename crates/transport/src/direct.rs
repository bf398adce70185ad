//! The classical ray tracer: shadows from all lights, mirrors and glass, iteratively.
//!
//! Every ray carries its pixel and weight, so there is no recursion: a surface adds what it can see of the lights and
//! sends on at most one reflected, one refracted and one straight-on ray. Glossy lobes send their ray in a random
//! direction of the lobe; rough ones and diffuse ones see lights alone.
//!
//! # References
//! Whitted, "An Improved Illumination Model for Shaded Display", 1980. Cook, Porter, Carpenter, "Distributed Ray
//! Tracing", 1984. Hall, Greenberg, "A Testbed for Realistic Image Synthesis", 1983 (adaptive depth).

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::lanes::{Floats, Vectors, WIDTH};
use heliostat_shading::{
    Arrival, Cone, HitPacket, HitSorter, Illumination, Lobes, Sampler, Scattered as ScatteredPacket,
    Scattering, Selection, ShadeScratch, Surfaces,
};

use crate::mis::{Scattered, Visits, emission_weight, environment, power_heuristic};
use crate::region::{CameraSample, PixelSum, Region, Settings, View, Walk, walk};
use crate::shadow::{MAX_PASSED, PendingLight, ShadowBatch};

/// Edges when the request does not say.
const DEFAULT_MAX_EDGES: u32 = 12;
/// Rays of less weight are dropped.
const LEAST_WEIGHT: f32 = 1.0 / 512.0;
/// GGX α up to which a lobe reflects its surroundings (perceptual roughness 0.5).
const MIRROR_ALPHA: f32 = 0.25;
/// The lobes that do.
const MIRRORS: Selection = Selection::up_to(MIRROR_ALPHA);
/// They send a ray to either side.
const SIDES: [Lobes; 2] = [Lobes::REFLECTING, Lobes::TRANSMITTING];
/// Rays of one pixel in flight; further ones are dropped, so that memory stays bounded.
const MAX_RAYS_PER_PIXEL: u16 = 256;
/// Shadow rays traced together.
const SHADOW_BATCH: usize = 4096;

/// A ray with its place in the tree.
#[derive(Clone, Copy, Debug)]
struct WeightedRay {
    pixel: u32,
    sampler: Sampler,
    ray: Ray,
    cone: Cone,
    weight: Vec3,
    edges: u32,
    /// Density with which a lobe chose the direction; 0 if no light sample could have.
    scatter_pdf: f32,
    passed_distance: f32,
    /// Surfaces passed straight through.
    passed: u32,
    /// Whether a surface was seen: the auxiliary planes show the first.
    seen: bool,
    /// Which branch of the tree this is: decorrelates the random numbers of siblings.
    branch: u32,
}

impl WeightedRay {
    fn scattered(&self, hit: &Hit) -> Scattered {
        let distance = self.passed_distance + hit.t;
        Scattered { ray: self.ray, pdf: self.scatter_pdf, distance }
    }

    fn arrival<'a>(&'a self, hit: &'a Hit) -> Arrival<'a> {
        Arrival { hit, ray: &self.ray, cone: self.cone, level: self.edges + 1 }
    }

    /// Sample points for use `slot` at this vertex: stratified along the first branch, hashed elsewhere.
    fn points(&self, slot: u32) -> [f32; 4] {
        match self.branch {
            1 => self.sampler.set(1 + slot),
            // Far from the sets of the trunk; where deep branches wrap round they merely share points.
            branch => self.sampler.set((branch << 12).wrapping_add(slot) | 1 << 31),
        }
    }
}

/// See [`Integrator::render`](crate::Integrator::render).
pub(crate) fn render<Q: RayQuery + ?Sized>(
    view: &View<'_, Q>,
    settings: &Settings,
    region: &Region,
    sums: &mut [PixelSum],
    after_sample: &dyn Fn() -> bool,
) -> u64 {
    let max_edges = settings.max_depth.unwrap_or(DEFAULT_MAX_EDGES);
    let ambient = settings.ambient;
    let mut tracer = Tracer {
        view,
        max_edges,
        ambient,
        shadows: ShadowBatch::default(),
        next: Vec::new(),
        in_flight: vec![0; sums.len()],
        shader: Box::default(),
    };
    walk(&mut tracer, view, settings, region, sums, after_sample) + tracer.shadows.traced()
}

struct Tracer<'a, Q: ?Sized> {
    view: &'a View<'a, Q>,
    max_edges: u32,
    ambient: Vec3,
    shadows: ShadowBatch,
    next: Vec<WeightedRay>,
    /// Rays in `next`, by pixel.
    in_flight: Vec<u16>,
    shader: Box<Shader>,
}

/// Scratch space of shading.
#[derive(Debug, Default)]
struct Shader {
    sorter: HitSorter,
    scratch: ShadeScratch,
    surfaces: Surfaces,
    light: Illumination,
    values: Scattering,
    samples: ScatteredPacket,
    origins: Vectors,
}

/// The rays of a packet at the surfaces they met, lane by lane.
struct Arrived {
    rays: [WeightedRay; WIDTH],
    count: usize,
}

impl<Q: RayQuery + ?Sized> Walk for Tracer<'_, Q> {
    type Ray = WeightedRay;

    fn start(sample: &CameraSample) -> WeightedRay {
        WeightedRay {
            pixel: sample.pixel,
            sampler: sample.sampler,
            ray: sample.ray,
            cone: sample.cone,
            weight: Vec3::ONE,
            edges: 0,
            scatter_pdf: 0.0,
            passed_distance: 0.0,
            passed: 0,
            seen: false,
            branch: 1,
        }
    }

    fn ray(ray: &WeightedRay) -> Ray {
        ray.ray
    }

    fn step(
        &mut self,
        mut rays: Vec<WeightedRay>,
        hits: &[Hit],
        sums: &mut [PixelSum],
        first_sample: bool,
    ) -> Vec<WeightedRay> {
        let scene = self.view.scene;
        self.in_flight.fill(0);
        for (ray, hit) in rays.iter_mut().zip(hits) {
            if hit.is_hit() {
                ray.cone = ray.cone.advanced(hit.t);
            } else {
                let radiance = environment(scene, Visits::All, &ray.scattered(hit));
                sums[ray.pixel as usize].add_radiance(ray.weight * radiance);
            }
        }
        let mut shader = std::mem::take(&mut self.shader);
        shader.sorter.sort(scene, hits);
        let Shader { sorter, scratch, surfaces, light, values, samples, origins } = &mut *shader;
        for packet in sorter.packets() {
            scene.shade(&packet, |i| rays[i].arrival(&hits[i]), scratch, surfaces);
            let arrived = self.arrive(&packet, &rays, hits, surfaces, sums, first_sample);
            if arrived.count > 0 {
                self.sample_lights(&arrived, surfaces, light, values, origins);
                self.reflect(&arrived, surfaces, samples, origins);
            }
            if self.shadows.len() >= SHADOW_BATCH {
                self.trace_shadows(sums);
            }
        }
        self.shader = shader;
        self.trace_shadows(sums);
        std::mem::take(&mut self.next)
    }
}

impl<Q: RayQuery + ?Sized> Tracer<'_, Q> {
    fn trace_shadows(&mut self, sums: &mut [PixelSum]) {
        self.shadows.trace(self.view.query, self.view.scene, |light| {
            sums[light.pixel as usize].add_lit(light.radiance);
        });
    }

    /// What the surfaces of a packet add by themselves, and the rays whose light they scatter: of weight zero where
    /// nothing is left to follow.
    fn arrive(
        &mut self,
        packet: &HitPacket<'_>,
        rays: &[WeightedRay],
        hits: &[Hit],
        surfaces: &Surfaces,
        sums: &mut [PixelSum],
        first_sample: bool,
    ) -> Arrived {
        let scene = self.view.scene;
        let mut arrived = Arrived { rays: [rays[packet.hits[0] as usize]; WIDTH], count: 0 };
        for (lane, &index) in packet.hits.iter().enumerate() {
            let (ray, hit) = (&mut arrived.rays[lane], &hits[index as usize]);
            *ray = rays[index as usize];
            let sum = &mut sums[ray.pixel as usize];
            let absorption = surfaces.absorption(lane);
            if absorption != Vec3::ZERO {
                ray.weight *= (-absorption * hit.t).exp();
            }
            let through = surfaces.through(lane);
            if through != Vec3::ZERO {
                let coverage = surfaces.coverage(lane);
                self.send(WeightedRay {
                    ray: Ray { origin: surfaces.origin(lane, ray.ray.direction), ..ray.ray },
                    weight: ray.weight * through,
                    passed_distance: ray.passed_distance + hit.t,
                    passed: ray.passed + 1,
                    seen: ray.seen || coverage > 0.0,
                    ..*ray
                });
                ray.weight *= coverage;
                if coverage == 0.0 {
                    continue;
                }
            }
            if !ray.seen {
                sum.add_first_hit(scene, hit, surfaces, lane, ray.passed_distance + hit.t, first_sample);
                ray.seen = true;
            }
            let emission = surfaces.emission(lane);
            let mut radiance = surfaces.ambient(lane) + self.ambient * surfaces.albedo(lane);
            if emission != Vec3::ZERO {
                radiance += emission * emission_weight(scene, Visits::All, &ray.scattered(hit), hit);
            }
            sum.add_radiance(ray.weight * radiance);
            ray.edges += 1;
            if ray.edges >= self.max_edges {
                ray.weight = Vec3::ZERO;
            } else {
                arrived.count = lane + 1;
            }
        }
        if surfaces.lobes().is_empty() {
            arrived.count = 0;
        }
        arrived
    }

    /// A shadow ray to a point of every light. Lobes that send rays of their own share the work with them.
    fn sample_lights(
        &mut self,
        arrived: &Arrived,
        surfaces: &Surfaces,
        light: &mut Illumination,
        values: &mut Scattering,
        origins: &mut Vectors,
    ) {
        let scene = self.view.scene;
        let Arrived { rays, count } = arrived;
        for emitter in 0..scene.lights().len() {
            let along = |lane: usize| {
                let ray: &WeightedRay = &rays[lane];
                let [u, v, u_triangle, w] = ray.points(2 + emitter as u32);
                (ray.ray.time, [u, v, u_triangle, w])
            };
            scene.illuminate(emitter, surfaces, along, *count, light);
            surfaces.evaluate(&light.wi, Selection::above(MIRROR_ALPHA), *count, values);
            let mut f_cos = values.f_cos.clone();
            for side in SIDES {
                if !surfaces.may_have(MIRRORS.among(side)) {
                    continue;
                }
                surfaces.evaluate(&light.wi, MIRRORS.among(side), *count, values);
                for lane in 0..*count {
                    let pdf = light.pdf.0[lane];
                    let share = if pdf == 0.0 { 1.0 } else { power_heuristic(pdf, values.pdf.0[lane]) };
                    f_cos.set(lane, f_cos.get(lane) + values.f_cos.get(lane) * share);
                }
            }
            surfaces.spawn(&light.wi, *count, origins);
            for (lane, ray) in rays[..*count].iter().enumerate() {
                let radiance = ray.weight * f_cos.get(lane) * light.weight.get(lane);
                if radiance != Vec3::ZERO {
                    let pending = PendingLight { pixel: ray.pixel, radiance };
                    let shadow = Ray::new(origins.get(lane), light.wi.get(lane));
                    let shadow = Ray { t_max: light.distance.0[lane], ..shadow };
                    self.shadows.push(shadow.at_time(ray.ray.time), pending);
                }
            }
        }
    }

    /// One ray for the reflecting and one for the transmitting lobes that are sharp enough.
    fn reflect(
        &mut self,
        arrived: &Arrived,
        surfaces: &Surfaces,
        samples: &mut ScatteredPacket,
        origins: &mut Vectors,
    ) {
        let Arrived { rays, count } = arrived;
        for (side, lobes) in SIDES.into_iter().enumerate() {
            let which = MIRRORS.among(lobes);
            if !surfaces.may_have(which) {
                continue;
            }
            let mut points = [Floats::ZERO; 3];
            for (lane, ray) in rays[..*count].iter().enumerate() {
                let [u, v, u_lobe, _] = ray.points(side as u32);
                (points[0].0[lane], points[1].0[lane], points[2].0[lane]) = (u_lobe, u, v);
            }
            surfaces.sample(&points, which, *count, samples);
            surfaces.spawn(&samples.wi, *count, origins);
            for (lane, ray) in rays[..*count].iter().enumerate().filter(|&(lane, _)| samples.valid[lane]) {
                self.send(WeightedRay {
                    ray: Ray::new(origins.get(lane), samples.wi.get(lane)).at_time(ray.ray.time),
                    cone: Cone { spread: ray.cone.spread + 0.5 * samples.alpha.0[lane], ..ray.cone },
                    weight: ray.weight * samples.weight.get(lane),
                    scatter_pdf: samples.pdf.0[lane],
                    passed_distance: 0.0,
                    passed: 0,
                    branch: ray.branch.wrapping_mul(2).wrapping_add(side as u32),
                    ..*ray
                });
            }
        }
    }

    /// Sends a ray on unless it is too light to matter or its pixel has too many.
    fn send(&mut self, ray: WeightedRay) {
        let matters = ray.weight.is_finite() && ray.weight.max_element() >= LEAST_WEIGHT;
        let in_flight = &mut self.in_flight[ray.pixel as usize];
        if matters && ray.passed <= MAX_PASSED && *in_flight < MAX_RAYS_PER_PIXEL {
            *in_flight += 1;
            self.next.push(ray);
        }
    }
}

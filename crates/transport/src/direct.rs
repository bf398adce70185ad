//! The classical ray tracer: shadows from all lights, mirrors and glass, iteratively.
//!
//! Every ray carries its pixel and weight, so there is no recursion: a surface adds what it can see of the lights and
//! sends on at most one reflected, one refracted and one straight-on ray. Glossy lobes send their ray in a random
//! direction of the lobe; rough ones and diffuse ones see lights alone.
//!
//! # References
//! Whitted, "An Improved Illumination Model for Shaded Display", 1980. Cook, Porter, Carpenter, "Distributed Ray
//! Tracing", 1984. Hall, Greenberg, "A Testbed for Realistic Image Synthesis", 1983 (adaptive depth).

use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::{Cone, Lobes, Sampler, Surface};

use crate::mis::{Scattered, Visits, emission_weight, environment, power_heuristic};
use crate::region::{CameraSample, PixelSum, Region, Settings, View, Walk, walk};
use crate::shadow::{MAX_PASSED, PendingLight, ShadowBatch};

/// Edges when the request does not say.
const DEFAULT_MAX_EDGES: u32 = 12;
/// Rays of less weight are dropped.
const LEAST_WEIGHT: f32 = 1.0 / 512.0;
/// GGX α up to which a lobe reflects its surroundings (perceptual roughness 0.5).
const MIRROR_ALPHA: f32 = 0.25;
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
        rays: Vec<WeightedRay>,
        hits: &[Hit],
        sums: &mut [PixelSum],
        first_sample: bool,
    ) -> Vec<WeightedRay> {
        let scene = self.view.scene;
        self.in_flight.fill(0);
        for (ray, hit) in rays.iter().zip(hits) {
            let sum = &mut sums[ray.pixel as usize];
            if hit.is_hit() {
                self.at_surface(ray, hit, sum, first_sample);
                if self.shadows.len() >= SHADOW_BATCH {
                    self.trace_shadows(sums);
                }
            } else {
                sum.add_radiance(ray.weight * environment(scene, Visits::All, &ray.scattered(hit)));
            }
        }
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

    fn at_surface(&mut self, ray: &WeightedRay, hit: &Hit, sum: &mut PixelSum, first_sample: bool) {
        let scene = self.view.scene;
        let cone = ray.cone.advanced(hit.t);
        let surface = scene.surface(hit, &ray.ray, cone);
        let mut ray = WeightedRay { cone, weight: ray.weight * (-surface.absorption * hit.t).exp(), ..*ray };
        if surface.through != Vec3::ZERO {
            self.send(WeightedRay {
                ray: Ray { origin: surface.spawn(ray.ray.direction), ..ray.ray },
                weight: ray.weight * surface.through,
                passed_distance: ray.passed_distance + hit.t,
                passed: ray.passed + 1,
                seen: ray.seen || surface.coverage > 0.0,
                ..ray
            });
            if surface.coverage == 0.0 {
                return;
            }
            ray.weight *= surface.coverage;
        }
        if !ray.seen {
            sum.add_first_hit(scene, hit, &surface, ray.passed_distance + hit.t, first_sample);
            ray.seen = true;
        }
        let emission = surface.emission * emission_weight(scene, Visits::All, &ray.scattered(hit), hit);
        let ambient = surface.ambient + self.ambient * surface.albedo;
        sum.add_radiance(ray.weight * (emission + ambient));
        ray.edges += 1;
        if ray.edges >= self.max_edges || surface.bsdf.lobes().is_empty() {
            return;
        }
        let mirrors = surface.bsdf.sharper_than(MIRROR_ALPHA);
        self.sample_lights(&ray, &surface, mirrors);
        self.reflect(&ray, &surface, mirrors);
    }

    /// A shadow ray to a point of every light. Lobes that send rays of their own share the work with them.
    fn sample_lights(&mut self, ray: &WeightedRay, surface: &Surface, mirrors: Lobes) {
        let scene = self.view.scene;
        let groups = [mirrors.intersection(Lobes::REFLECTING), mirrors.intersection(Lobes::TRANSMITTING)];
        for emitter in 0..scene.lights().len() {
            let [u, v, u_triangle, _] = ray.points(2 + emitter as u32);
            let Some(light) =
                scene.sample_light(emitter, (surface.position, ray.ray.time), Vec2::new(u, v), u_triangle)
            else {
                continue;
            };
            let mut f_cos = surface.bsdf.evaluate(light.wi, Lobes::ALL.without(mirrors)).f_cos;
            for lobes in groups {
                if lobes.is_empty() {
                    continue;
                }
                let value = surface.bsdf.evaluate(light.wi, lobes);
                f_cos += match light.pdf == 0.0 {
                    true => value.f_cos,
                    false => value.f_cos * power_heuristic(light.pdf, value.pdf),
                };
            }
            let radiance = ray.weight * f_cos * light.weight;
            if radiance != Vec3::ZERO {
                let pending = PendingLight { pixel: ray.pixel, radiance };
                let shadow = Ray { t_max: light.distance, ..Ray::new(surface.spawn(light.wi), light.wi) };
                self.shadows.push(shadow.at_time(ray.ray.time), pending);
            }
        }
    }

    /// One ray for the reflecting and one for the transmitting lobes that are sharp enough.
    fn reflect(&mut self, ray: &WeightedRay, surface: &Surface, mirrors: Lobes) {
        for (side, group) in [Lobes::REFLECTING, Lobes::TRANSMITTING].into_iter().enumerate() {
            let lobes = mirrors.intersection(group);
            if lobes.is_empty() {
                continue;
            }
            let [u, v, u_lobe, _] = ray.points(side as u32);
            let Some(sample) = surface.bsdf.sample(u_lobe, Vec2::new(u, v), lobes) else { continue };
            self.send(WeightedRay {
                ray: Ray::new(surface.spawn(sample.wi), sample.wi).at_time(ray.ray.time),
                cone: Cone { spread: ray.cone.spread + 0.5 * sample.alpha, ..ray.cone },
                weight: ray.weight * sample.weight,
                scatter_pdf: sample.pdf,
                passed_distance: 0.0,
                passed: 0,
                branch: ray.branch.wrapping_mul(2).wrapping_add(side as u32),
                ..*ray
            });
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

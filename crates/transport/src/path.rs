//! The unbiased reference: unidirectional path tracing with next-event estimation.
//!
//! # References
//! Kajiya, "The Rendering Equation", 1986. Veach 1997, chapters 9 (multiple importance sampling) and 10.2 (Russian
//! roulette).

use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::{
    Arrival, Cone, HitSorter, SamplePoints, Sampler, Selection, ShadeScratch, ShadingScene, Surface, Surfaces,
};

use crate::eye::MIRROR_ALPHA;
use crate::mis::{Scattered, Visits, emission_weight, environment, power_heuristic};
use crate::region::{Adds, CameraSample, FirstHit, PixelSum, Region, Settings, View, Walk, walk};
use crate::shadow::{MAX_PASSED, PendingLight, ShadowBatch};

/// Edges after which paths may be ended by Russian roulette.
const ROULETTE_FROM: u32 = 4;

/// A path on its way: the ray that extends it and what its end is worth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Path {
    pixel: u32,
    sampler: Sampler,
    ray: Ray,
    cone: Cone,
    /// β of the literature: contribution of a unit of radiance at the end of the ray.
    throughput: Vec3,
    /// β without the η² of refraction, on which roulette decides.
    roulette_scale: f32,
    /// Edges before this ray.
    edges: u32,
    /// Density with which scattering chose the ray's direction; 0 if no light sample could have.
    scatter_pdf: f32,
    /// Distance covered since the last scattering, through surfaces that let the path pass.
    passed_distance: f32,
    passed: u32,
    /// Whether a dull lobe has sent it on.
    dull: bool,
}

/// Where a path starts that does not start at the camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub(crate) pixel: u32,
    pub(crate) sampler: Sampler,
    /// The ray that found the surface.
    pub(crate) ray: Ray,
    pub(crate) cone: Cone,
    /// Edges from the camera, at least one.
    pub(crate) edges: u32,
}

/// See [`Integrator::render`](crate::Integrator::render).
pub(crate) fn render<Q: RayQuery + ?Sized>(
    view: &View<'_, Q>,
    settings: &Settings,
    region: &Region,
    sums: &mut [PixelSum],
    after_sample: &dyn Fn() -> bool,
) -> u64 {
    let max_edges = settings.max_depth.unwrap_or(u32::MAX);
    let mut tracer = Tracer::new(view, max_edges);
    walk(&mut tracer, view, settings, region, sums, after_sample) + tracer.shadows.traced()
}

/// Follows paths vertex by vertex.
pub(crate) struct Tracer<'a, Q: ?Sized> {
    view: &'a View<'a, Q>,
    max_edges: u32,
    shadows: ShadowBatch,
    shader: Shader,
}

/// Scratch space of shading.
#[derive(Debug, Default)]
struct Shader {
    sorter: HitSorter,
    scratch: ShadeScratch,
    vertices: Vertices,
}

/// The vertices of a packet of paths.
#[derive(Debug, Default)]
struct Vertices {
    surfaces: Surfaces,
    /// Sample points for the light of a vertex.
    light: SamplePoints,
    /// Sample points for the way on from it.
    scattering: SamplePoints,
}

impl Vertices {
    /// Draws the sample points of a packet of vertices.
    fn draw<'a>(&mut self, scene: &ShadingScene, paths: impl Iterator<Item = &'a Path>) {
        let mut count = 0;
        for (lane, path) in paths.enumerate() {
            self.scattering.ask(lane, &path.sampler, 2 * path.edges + 1);
            self.light.ask(lane, &path.sampler, 2 * path.edges + 2);
            count = lane + 1;
        }
        self.scattering.draw(scene.lane_mode(), count);
        self.light.draw(scene.lane_mode(), count);
    }
}

impl<Q: RayQuery + ?Sized> Walk for Tracer<'_, Q> {
    type Ray = Path;

    #[inline(always)]
    fn start(sample: &CameraSample) -> Path {
        Path {
            pixel: sample.pixel,
            sampler: sample.sampler,
            ray: sample.ray,
            cone: sample.cone,
            throughput: Vec3::ONE,
            roulette_scale: 1.0,
            edges: 0,
            scatter_pdf: 0.0,
            passed_distance: 0.0,
            passed: 0,
            dull: false,
        }
    }

    #[inline(always)]
    fn ray(path: &Path) -> Ray {
        path.ray
    }

    fn step(&mut self, mut paths: Vec<Path>, hits: &[Hit], sums: &mut [PixelSum], adds: Adds) -> Vec<Path> {
        let scene = self.view.scene;
        let mut next = Vec::with_capacity(paths.len());
        for (path, hit) in paths.iter_mut().zip(hits) {
            if hit.is_hit() {
                path.cone = path.cone.advanced(hit.t);
            } else {
                let radiance = environment(scene, Visits::One, &path.scattered(hit));
                sums[path.pixel as usize].add_radiance(path.throughput * radiance);
            }
        }
        let mut shader = std::mem::take(&mut self.shader);
        shader.sorter.sort(scene, hits);
        for packet in shader.sorter.packets() {
            let along = |i: usize| paths[i].arrival(&hits[i]);
            scene.shade(&packet, along, &mut shader.scratch, &mut shader.vertices.surfaces);
            shader.vertices.draw(scene, packet.hits.iter().map(|&i| &paths[i as usize]));
            for (lane, &index) in packet.hits.iter().enumerate() {
                let (path, hit) = (paths[index as usize], &hits[index as usize]);
                let sum = &mut sums[path.pixel as usize];
                next.extend(self.at_surface(path, hit, (&shader.vertices, lane), sum, adds));
            }
        }
        self.shader = shader;
        self.shadows.trace(self.view.query, scene, |light| {
            sums[light.pixel as usize].add_lit(light.radiance);
        });
        next
    }
}

impl Path {
    fn arrival<'a>(&'a self, hit: &'a Hit) -> Arrival<'a> {
        Arrival { hit, ray: &self.ray, cone: self.cone, level: self.edges + 1 }
    }

    fn scattered(&self, hit: &Hit) -> Scattered {
        let distance = self.passed_distance + hit.t;
        Scattered { ray: self.ray, pdf: self.scatter_pdf, distance }
    }
}

impl<'a, Q: RayQuery + ?Sized> Tracer<'a, Q> {
    /// Paths may have `max_edges` edges.
    pub(crate) fn new(view: &'a View<'a, Q>, max_edges: u32) -> Self {
        Self { view, max_edges, shadows: ShadowBatch::default(), shader: Shader::default() }
    }

    /// Shadow rays traced so far.
    pub(crate) fn shadow_rays(&self) -> u64 {
        self.shadows.traced()
    }

    /// Starts a path at a surface that a ray from the camera has found after some edges: asks for light by `lobes` and
    /// returns the way on by them. `pixel` is where the sums take what it finds.
    pub(crate) fn start_at(
        &mut self,
        surface: &Surface<f32>,
        lobes: Selection,
        from: &Start,
    ) -> Option<Path> {
        let Start { pixel, sampler, ray, cone, edges } = *from;
        let path = Path {
            pixel,
            sampler,
            ray,
            cone,
            throughput: Vec3::ONE,
            roulette_scale: 1.0,
            edges,
            scatter_pdf: 0.0,
            passed_distance: 0.0,
            passed: 0,
            dull: false,
        };
        if edges >= self.max_edges {
            return None;
        }
        self.sample_light(&path, surface, lobes, sampler.set(2 * edges));
        scatter(path, surface, lobes, sampler.set(2 * edges - 1))
    }

    /// Follows paths to their ends and returns the number of rays.
    pub(crate) fn follow(&mut self, mut paths: Vec<Path>, sums: &mut [PixelSum]) -> u64 {
        let (mut hits, mut traced) = (Vec::new(), 0);
        loop {
            let rays: Vec<Ray> = paths.iter().map(|path| path.ray).collect();
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            self.view.query.intersect(&rays, &mut hits);
            traced += rays.len() as u64;
            // Once more when no path is left: shadow rays still wait.
            paths = self.step(paths, &hits, sums, Adds::Light);
            if paths.is_empty() {
                return traced;
            }
        }
    }

    /// One vertex of the path: emission, light sampling, scattering. Returns the path if it goes on.
    fn at_surface(
        &mut self,
        mut path: Path,
        hit: &Hit,
        (vertices, lane): (&Vertices, usize),
        sum: &mut PixelSum,
        adds: Adds,
    ) -> Option<Path> {
        let scene = self.view.scene;
        let surfaces = &vertices.surfaces;
        let surface = &surfaces.lane(lane);
        if adds != Adds::Light {
            sum.shaded += 1.0;
        }
        // Beer's law over the way through the solid that ends here.
        path.throughput *= (-Vec3::from(surface.absorption) * hit.t).exp();

        // A share of the light meets the surface, the rest passes: choose one by chance.
        let pass = surface.through.largest().min(1.0);
        if pass > 0.0 {
            if path.sampler.random(path.passed) < pass {
                return pass_through(path, surface, hit, pass);
            }
            path.passed += 1;
            path.throughput *= surface.coverage / (1.0 - pass);
        }
        if path.edges == 0 && adds != Adds::Light {
            let first = (adds == Adds::Identifiers).then(|| FirstHit::of(scene, hit));
            sum.add_first_hit(surfaces, lane, path.passed_distance + hit.t, first);
        }
        let emission = Vec3::from(surface.emission);
        // What is unlit is seen, in mirrors too, and is no light.
        let is_seen = || !(path.dull && scene.part(hit).2.source().unlit);
        if emission != Vec3::ZERO && is_seen() {
            let weight = emission_weight(scene, Visits::One, &path.scattered(hit), hit);
            sum.add_radiance(path.throughput * emission * weight);
        }
        path.edges += 1;
        if path.edges >= self.max_edges || !surface.bsdf.scatters() {
            return None;
        }
        self.sample_light(&path, surface, Selection::ALL, vertices.light.get(lane));
        scatter(path, surface, Selection::ALL, vertices.scattering.get(lane))
    }

    /// Next-event estimation: one light, chosen by power, one point on it.
    fn sample_light(&mut self, path: &Path, surface: &Surface<f32>, lobes: Selection, point: [f32; 4]) {
        let scene = self.view.scene;
        let [u_choice, u_triangle, u, v] = point;
        let Some((emitter, probability, _)) = scene.lights().choose(u_choice) else { return };
        let Some(light) = scene.sample_light(
            emitter,
            (surface.position.into(), path.ray.time),
            Vec2::new(u, v),
            u_triangle,
        ) else {
            return;
        };
        let scattered = surface.bsdf.evaluate(light.wi.into(), lobes);
        let f_cos = Vec3::from(scattered.f_cos);
        if f_cos == Vec3::ZERO {
            return;
        }
        let weight =
            if light.pdf == 0.0 { 1.0 } else { power_heuristic(probability * light.pdf, scattered.pdf) };
        let radiance = path.throughput * f_cos * light.weight * (weight / probability);
        let pending = PendingLight { pixel: path.pixel, radiance };
        let shadow =
            Ray { t_max: light.distance, ..Ray::new(surface.spawn(light.wi.into()).into(), light.wi) };
        self.shadows.push(shadow.at_time(path.ray.time), pending);
    }
}

/// The path goes on in its direction as if the surface were not there; its scattering density stays valid.
fn pass_through(mut path: Path, surface: &Surface<f32>, hit: &Hit, chance: f32) -> Option<Path> {
    path.passed += 1;
    path.throughput *= Vec3::from(surface.through) / chance;
    path.passed_distance += hit.t;
    path.ray.origin = surface.spawn(path.ray.direction.into()).into();
    (path.passed <= MAX_PASSED).then_some(path)
}

/// Chooses the next direction; Russian roulette ends paths of little worth.
fn scatter(mut path: Path, surface: &Surface<f32>, lobes: Selection, point: [f32; 4]) -> Option<Path> {
    let [u_lobe, u_roulette, u, v] = point;
    let sample = surface.bsdf.sample(u_lobe, [u, v], lobes);
    if !sample.valid {
        return None;
    }
    path.throughput *= Vec3::from(sample.weight);
    if sample.transmitted {
        path.roulette_scale *= surface.bsdf.transmitted_eta().powi(2);
    }
    if path.edges >= ROULETTE_FROM {
        let survival = (path.throughput.max_element() * path.roulette_scale).clamp(0.05, 0.95);
        if u_roulette >= survival {
            return None;
        }
        path.throughput /= survival;
    }
    path.scatter_pdf = sample.pdf;
    path.dull |= sample.alpha > MIRROR_ALPHA && !sample.transmitted;
    path.passed_distance = 0.0;
    // A rough bounce spreads the footprint; texture lookups behind it may be coarse.
    path.cone.spread += 0.5 * sample.alpha;
    path.ray = Ray::new(surface.spawn(sample.wi).into(), sample.wi.into()).at_time(path.ray.time);
    (path.throughput.is_finite() && path.throughput != Vec3::ZERO).then_some(path)
}

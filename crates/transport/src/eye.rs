//! Rays from the camera through mirrors and glass to the surfaces that are lit: what `direct` and `igi` share.
//!
//! Every ray carries its pixel and weight, so there is no recursion: a surface adds what it emits, is handed over to be
//! lit, and sends on at most one reflected, one refracted and one straight-on ray.
//!
//! # References
//! Whitted, "An Improved Illumination Model for Shaded Display", 1980. Cook, Porter, Carpenter, "Distributed Ray
//! Tracing", 1984. Hall, Greenberg, "A Testbed for Realistic Image Synthesis", 1983 (adaptive depth).

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::lanes::Vectors;
use heliostat_shading::{
    Arrival, Cone, HitPacket, HitSorter, Lobes, SamplePoints, Sampler, Scattered as ScatteredPacket,
    Selection, ShadeScratch, Surfaces,
};

use crate::mis::{Scattered, Visits, emission_weight, environment};
use crate::region::{Adds, CameraSample, FirstHit, PixelSum, Settings, View, Walk};
use crate::shadow::MAX_PASSED;

/// Edges when the request does not say.
const DEFAULT_MAX_EDGES: u32 = 12;
/// Rays of less weight are dropped.
const LEAST_WEIGHT: f32 = 1.0 / 512.0;
/// GGX α up to which a lobe reflects its surroundings (perceptual roughness 0.5).
pub(crate) const MIRROR_ALPHA: f32 = 0.25;
/// The lobes that do.
pub(crate) const MIRRORS: Selection = Selection::up_to(MIRROR_ALPHA);
/// The lobes that are lit by sampled lights alone.
pub(crate) const DULL: Selection = Selection::above(MIRROR_ALPHA);
/// Mirrors send a ray to either side.
pub(crate) const SIDES: [Lobes; 2] = [Lobes::REFLECTING, Lobes::TRANSMITTING];
/// Rays of one pixel in flight; further ones are dropped, so that memory stays bounded.
const MAX_RAYS_PER_PIXEL: u16 = 256;

/// A ray with its place in the tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedRay {
    pub(crate) pixel: u32,
    pub(crate) sampler: Sampler,
    pub(crate) ray: Ray,
    pub(crate) cone: Cone,
    pub(crate) weight: Vec3,
    /// Edges from the camera to the ray's end.
    pub(crate) edges: u32,
    /// Density with which a lobe chose the direction; 0 if no light sample could have.
    scatter_pdf: f32,
    passed_distance: f32,
    /// Surfaces passed straight through.
    passed: u32,
    /// Whether a surface was seen: the auxiliary planes show the first.
    seen: bool,
    /// Which branch of the tree this is: decorrelates the random numbers of siblings.
    branch: u32,
    /// Largest GGX α of the lobes that sent it.
    pub(crate) alpha: f32,
}

impl WeightedRay {
    fn scattered(&self, hit: &Hit) -> Scattered {
        let distance = self.passed_distance + hit.t;
        Scattered { ray: self.ray, pdf: self.scatter_pdf, distance }
    }

    fn arrival<'a>(&'a self, hit: &'a Hit) -> Arrival<'a> {
        Arrival { hit, ray: &self.ray, cone: self.cone.advanced(hit.t), level: self.edges + 1 }
    }

    /// Asks for the sample points of use `slot` at this vertex.
    pub(crate) fn ask(&self, slot: u32, lane: usize, points: &mut SamplePoints) {
        let set = match self.branch {
            1 => 1 + slot,
            // Far from the sets of the trunk; where deep branches wrap round they merely share points.
            branch => (branch << 12).wrapping_add(slot) | 1 << 31,
        };
        points.ask(lane, &self.sampler, set);
    }
}

/// The rays of a packet at the surfaces they met. Rays of weight zero have nothing left to carry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrived<'a> {
    rays: &'a [WeightedRay],
    /// The rays of the lanes that may carry something.
    lanes: &'a [u32],
}

impl<'a> Arrived<'a> {
    /// Number of lanes.
    pub(crate) fn count(&self) -> usize {
        self.lanes.len()
    }

    /// The ray of a lane.
    pub(crate) fn ray(&self, lane: usize) -> &'a WeightedRay {
        &self.rays[self.lanes[lane] as usize]
    }

    /// The rays, lane by lane.
    pub(crate) fn rays(&self) -> impl Iterator<Item = &'a WeightedRay> {
        self.lanes.iter().map(|&index| &self.rays[index as usize])
    }
}

/// How surfaces are lit.
pub(crate) trait Lighting<Q: ?Sized> {
    /// How often it samples the light of each emitter for sharp lobes, where it shares that with their rays.
    fn visits(&self) -> Visits<'_>;

    /// Whether rays are sent on by mirrors and glass.
    fn follows_mirrors(&self) -> bool {
        true
    }

    /// Number of groups of pixels; each is lit by itself.
    fn groups(&self) -> usize;

    /// The group of a pixel, by its index in the region.
    fn group(&self, pixel: u32) -> usize;

    /// Lights the surfaces of a packet, now or at the end of the group. Returns whether light that it samples is shared with rays
    /// of sharp lobes that find it too.
    fn packet(
        &mut self,
        view: &View<'_, Q>,
        arrived: Arrived<'_>,
        surfaces: &Surfaces,
        sums: &mut [PixelSum],
    ) -> bool;

    /// Adds light that a ray found by itself.
    fn find(&mut self, ray: &WeightedRay, radiance: Vec3, sum: &mut PixelSum);

    /// All packets of a group have been handed over.
    fn finish(&mut self, view: &View<'_, Q>, group: usize, sums: &mut [PixelSum]);
}

/// The walk of camera rays.
pub(crate) struct EyeWalk<'a, Q: ?Sized, L> {
    view: &'a View<'a, Q>,
    max_edges: u32,
    ambient: Vec3,
    pub(crate) lighting: L,
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
    points: SamplePoints,
    samples: ScatteredPacket,
    origins: Vectors,
    /// Indices of the rays, group by group, in their order, and where each group ends.
    by_group: Vec<u32>,
    ends: Vec<u32>,
    /// The rays of one group with their hits.
    rays: Vec<WeightedRay>,
    hits: Vec<Hit>,
}

impl Shader {
    /// Indices of a group's rays.
    fn of_group(&self, group: usize) -> &[u32] {
        let start = if group == 0 { 0 } else { self.ends[group - 1] };
        &self.by_group[start as usize..self.ends[group] as usize]
    }
}

impl<'a, Q: ?Sized, L> EyeWalk<'a, Q, L> {
    /// A walk over `pixels` pixels.
    pub(crate) fn new(view: &'a View<'a, Q>, settings: &Settings, pixels: usize, lighting: L) -> Self {
        Self {
            view,
            max_edges: settings.max_depth.unwrap_or(DEFAULT_MAX_EDGES),
            ambient: settings.ambient,
            lighting,
            next: Vec::new(),
            in_flight: vec![0; pixels],
            shader: Box::default(),
        }
    }
}

impl<Q: RayQuery + ?Sized, L: Lighting<Q>> Walk for EyeWalk<'_, Q, L> {
    type Ray = WeightedRay;

    #[inline(always)]
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
            alpha: 0.0,
        }
    }

    #[inline(always)]
    fn ray(ray: &WeightedRay) -> Ray {
        ray.ray
    }

    fn step(
        &mut self,
        mut rays: Vec<WeightedRay>,
        hits: &[Hit],
        sums: &mut [PixelSum],
        adds: Adds,
    ) -> Vec<WeightedRay> {
        let scene = self.view.scene;
        self.in_flight.fill(0);
        for (ray, hit) in rays.iter().zip(hits).filter(|(_, hit)| !hit.is_hit()) {
            let radiance = environment(scene, self.lighting.visits(), &ray.scattered(hit));
            self.lighting.find(ray, ray.weight * radiance, &mut sums[ray.pixel as usize]);
        }
        let mut shader = std::mem::take(&mut self.shader);
        if self.lighting.groups() == 1 {
            self.shade(&mut shader, &mut rays, hits, sums, adds);
            self.lighting.finish(self.view, 0, sums);
        } else {
            self.sort_by_group(&mut shader, &rays);
            let (mut own, mut own_hits) =
                (std::mem::take(&mut shader.rays), std::mem::take(&mut shader.hits));
            for group in 0..self.lighting.groups() {
                own.clear();
                own_hits.clear();
                for &index in shader.of_group(group) {
                    own.push(rays[index as usize]);
                    own_hits.push(hits[index as usize]);
                }
                self.shade(&mut shader, &mut own, &own_hits, sums, adds);
                self.lighting.finish(self.view, group, sums);
            }
            (shader.rays, shader.hits) = (own, own_hits);
        }
        self.shader = shader;
        std::mem::take(&mut self.next)
    }
}

impl<Q: RayQuery + ?Sized, L: Lighting<Q>> EyeWalk<'_, Q, L> {
    /// A counting sort of rays by the groups of their pixels.
    fn sort_by_group(&self, shader: &mut Shader, rays: &[WeightedRay]) {
        let Shader { by_group, ends, .. } = shader;
        ends.clear();
        ends.resize(self.lighting.groups() + 1, 0);
        for ray in rays {
            ends[self.lighting.group(ray.pixel) + 1] += 1;
        }
        for group in 1..ends.len() {
            ends[group] += ends[group - 1];
        }
        by_group.clear();
        by_group.resize(rays.len(), 0);
        // The start of each group moves on to its end.
        for (index, ray) in (0..).zip(rays) {
            let place = &mut ends[self.lighting.group(ray.pixel)];
            by_group[*place as usize] = index;
            *place += 1;
        }
    }

    /// Shades the ends of rays in packets, hands the packets over to be lit and sends on what mirrors.
    fn shade(
        &mut self,
        shader: &mut Shader,
        rays: &mut [WeightedRay],
        hits: &[Hit],
        sums: &mut [PixelSum],
        adds: Adds,
    ) {
        let scene = self.view.scene;
        shader.sorter.sort(scene, hits);
        let Shader { sorter, scratch, surfaces, points, samples, origins, .. } = shader;
        for packet in sorter.packets() {
            let before = &*rays;
            scene.shade(&packet, |i| before[i].arrival(&hits[i]), scratch, surfaces);
            let count = self.arrive(&packet, rays, hits, surfaces, (sums, adds));
            if count > 0 {
                let arrived = Arrived { rays, lanes: &packet.hits[..count] };
                let shared = self.lighting.packet(self.view, arrived, surfaces, sums);
                if self.lighting.follows_mirrors() {
                    self.reflect((arrived, shared), surfaces, (points, samples), origins);
                }
            }
        }
    }

    /// What the surfaces of a packet add by themselves. Rays go on with the weight of what is scattered, zero where nothing is
    /// left to follow: those of lanes up to the returned number may carry something.
    fn arrive(
        &mut self,
        packet: &HitPacket<'_>,
        rays: &mut [WeightedRay],
        hits: &[Hit],
        surfaces: &Surfaces,
        (sums, adds): (&mut [PixelSum], Adds),
    ) -> usize {
        let scene = self.view.scene;
        let glows = surfaces.glows() || self.ambient != Vec3::ZERO;
        let (filters, shown) = (surfaces.filters(), adds != Adds::Light);
        let mut count = 0;
        // Neighbours mostly lie on the same part.
        let mut known: Option<(&Hit, FirstHit)> = None;
        for (lane, &index) in packet.hits.iter().enumerate() {
            let (ray, hit) = (&mut rays[index as usize], &hits[index as usize]);
            let pixel = ray.pixel as usize;
            if shown {
                sums[pixel].shaded += 1.0;
            }
            ray.cone = ray.cone.advanced(hit.t);
            if filters && !self.filter(ray, hit, surfaces, lane) {
                continue;
            }
            if shown && !ray.seen {
                let first = (adds == Adds::Identifiers).then(|| match known {
                    Some((before, first)) if hit.is_on_part_of(before) => first,
                    _ => FirstHit::of(scene, hit),
                });
                known = first.map(|first| (hit, first));
                sums[pixel].add_first_hit(surfaces, lane, ray.passed_distance + hit.t, first);
            }
            ray.seen = true;
            if glows {
                self.glow(ray, hit, surfaces, lane, &mut sums[pixel]);
            }
            ray.edges += 1;
            if ray.edges >= self.max_edges {
                ray.weight = Vec3::ZERO;
            } else {
                count = lane + 1;
            }
        }
        if surfaces.lobes().is_empty() { 0 } else { count }
    }

    /// Takes away what is absorbed before a lane's surface and sends on what passes straight through it. Whether anything is left
    /// that meets the surface.
    fn filter(&mut self, ray: &mut WeightedRay, hit: &Hit, surfaces: &Surfaces, lane: usize) -> bool {
        let absorption = surfaces.absorption(lane);
        if absorption != Vec3::ZERO {
            ray.weight *= (-absorption * hit.t).exp();
        }
        let through = surfaces.through(lane);
        if through == Vec3::ZERO {
            return true;
        }
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
        coverage > 0.0
    }

    /// Adds the light that a lane's surface sends by itself.
    fn glow(&mut self, ray: &WeightedRay, hit: &Hit, surfaces: &Surfaces, lane: usize, sum: &mut PixelSum) {
        let emission = surfaces.emission(lane);
        let mut radiance = surfaces.ambient(lane) + self.ambient * surfaces.albedo(lane);
        if emission != Vec3::ZERO {
            let visits = self.lighting.visits();
            radiance += emission * emission_weight(self.view.scene, visits, &ray.scattered(hit), hit);
        }
        if radiance != Vec3::ZERO {
            self.lighting.find(ray, ray.weight * radiance, sum);
        }
    }

    /// One ray for the reflecting and one for the transmitting lobes that are sharp enough. `shared` says whether light that they
    /// find is sampled too.
    fn reflect(
        &mut self,
        (arrived, shared): (Arrived<'_>, bool),
        surfaces: &Surfaces,
        (points, samples): (&mut SamplePoints, &mut ScatteredPacket),
        origins: &mut Vectors,
    ) {
        let count = arrived.count();
        for (side, lobes) in SIDES.into_iter().enumerate() {
            let which = MIRRORS.among(lobes);
            if !surfaces.may_have(which) {
                continue;
            }
            for (lane, ray) in arrived.rays().enumerate() {
                ray.ask(side as u32, lane, points);
            }
            points.draw(self.view.scene.lane_mode(), count);
            let [u, v, u_lobe, _] = &points.u;
            surfaces.sample([u_lobe, u, v], which, count, samples);
            surfaces.spawn(&samples.wi, count, origins);
            for (lane, ray) in arrived.rays().enumerate().filter(|&(lane, _)| samples.valid[lane]) {
                self.send(WeightedRay {
                    ray: Ray::new(origins.get(lane), samples.wi.get(lane)).at_time(ray.ray.time),
                    cone: Cone { spread: ray.cone.spread + 0.5 * samples.alpha.0[lane], ..ray.cone },
                    weight: ray.weight * samples.weight.get(lane),
                    scatter_pdf: if shared { samples.pdf.0[lane] } else { 0.0 },
                    passed_distance: 0.0,
                    passed: 0,
                    branch: ray.branch.wrapping_mul(2).wrapping_add(side as u32),
                    alpha: ray.alpha.max(samples.alpha.0[lane]),
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

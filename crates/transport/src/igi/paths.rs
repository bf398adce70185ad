//! Light paths: they leave candidates for virtual point lights wherever they meet surfaces that scatter light.
//!
//! # References
//! Keller, "Instant Radiosity", 1997. Veach 1997, chapter 10.2 (Russian roulette).

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::sampling::Discrete;
use heliostat_shading::{
    Arrival, Cone, HitSorter, PatchReflectance, Sampler, Selection, ShadeScratch, Source, Surface, Surfaces,
};

use super::vpl::{Candidate, Vpl};
use crate::eye::DULL;
use crate::region::View;

/// Longest light path, in bounces.
const MAX_BOUNCES: u32 = 16;
/// Bounces before paths may be ended by Russian roulette.
const ROULETTE_FROM: u32 = 1;
/// Surfaces that a light path may pass straight through.
const MAX_PASSED: u32 = 64;
/// So many lights without area light everything themselves; where there are more, light paths choose among them.
const MOST_EXACT: usize = 8;

/// How light paths are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathPlan {
    /// Sets of virtual point lights.
    pub(super) sets: u32,
    /// Light paths of each.
    pub(super) paths: u32,
    /// How many of these are kept in the mean.
    pub(super) kept: u32,
    /// Which pass: each continues the sequence where the last one ended.
    pub(super) pass: u32,
    pub(super) seed: u32,
    /// Bounces a path may have.
    pub(super) max_bounces: u32,
}

/// A light path on its way.
struct Walker {
    set: u32,
    /// Number in its set.
    number: u32,
    ray: Ray,
    flux: Vec3,
    bounces: u32,
    passed: u32,
}

impl Walker {
    /// Every set takes a block of the sequence, which is well distributed by itself.
    fn block(&self, plan: &PathPlan) -> u32 {
        plan.pass.wrapping_mul(plan.sets).wrapping_add(self.set)
    }

    /// Place in the sequence.
    fn index(&self, plan: &PathPlan) -> u32 {
        self.block(plan).wrapping_mul(plan.paths).wrapping_add(self.number)
    }
}

/// Draws all paths, wave by wave, and returns what they leave and the number of rays. `lights` chooses the emitters; by
/// power if there is none.
pub(super) fn draw<Q: RayQuery + ?Sized>(
    view: &View<'_, Q>,
    plan: &PathPlan,
    lights: Option<&Discrete>,
) -> (Vec<Candidate>, u64) {
    let mut drawing = Drawing { view, plan, lights, candidates: Vec::new(), by_emitter: Vec::new() };
    let mut walkers = drawing.start();
    let (mut hits, mut traced) = (Vec::new(), 0);
    let (mut sorter, mut scratch) = (HitSorter::default(), ShadeScratch::default());
    let mut surfaces = Surfaces::default();
    while !walkers.is_empty() {
        let rays: Vec<Ray> = walkers.iter().map(|walker| walker.ray).collect();
        hits.clear();
        hits.resize(rays.len(), Hit::MISS);
        view.query.intersect(&rays, &mut hits);
        traced += rays.len() as u64;
        let mut next = Vec::with_capacity(walkers.len());
        sorter.sort(view.scene, &hits);
        for packet in sorter.packets() {
            let along = |i: usize| Arrival { hit: &hits[i], ray: &rays[i], cone: Cone::default(), level: 1 };
            view.scene.shade(&packet, along, &mut scratch, &mut surfaces);
            for (lane, &index) in packet.hits.iter().enumerate() {
                let walker = &mut walkers[index as usize];
                if drawing.bounce(walker, &surfaces.lane(lane), hits[index as usize].t) {
                    next.push(index);
                }
            }
        }
        // In the order of their start, whatever they met.
        next.sort_unstable();
        let mut next = next.into_iter().peekable();
        let mut index = 0;
        walkers.retain(|_| {
            index += 1;
            next.next_if_eq(&(index - 1)).is_some()
        });
    }
    (drawing.candidates, traced)
}

struct Drawing<'a, Q: ?Sized> {
    view: &'a View<'a, Q>,
    plan: &'a PathPlan,
    lights: Option<&'a Discrete>,
    candidates: Vec<Candidate>,
    /// Candidates on lights without area in the set at hand, by emitter: one for all paths that start there.
    by_emitter: Vec<(usize, usize)>,
}

impl<Q: ?Sized> Drawing<'_, Q> {
    /// The starts of all paths.
    fn start(&mut self) -> Vec<Walker> {
        let lights = self.view.scene.lights();
        let exact: Vec<Source> = lights.without_area().take(MOST_EXACT + 1).collect();
        let exact = if exact.len() > MOST_EXACT { Vec::new() } else { exact };
        let mut walkers = Vec::new();
        for set in 0..self.plan.sets {
            self.by_emitter.clear();
            let vpl = |source: &Source| Vpl { source: source.clone(), bounces: 0 };
            let certain = |source| Candidate { vpl: vpl(source), set, certain: true };
            self.candidates.extend(exact.iter().map(certain));
            for number in 0..self.plan.paths {
                walkers.extend(self.start_path(set, number, !exact.is_empty()));
            }
        }
        walkers
    }

    /// The start of a path. `exact` says that lights without area need no candidates.
    fn start_path(&mut self, set: u32, number: u32, exact: bool) -> Option<Walker> {
        let plan = self.plan;
        let ray = Ray::new(Vec3::ZERO, Vec3::ZERO);
        let mut walker = Walker { set, number, ray, flux: Vec3::ZERO, bounces: 0, passed: 0 };
        let [choice, triangle, u, v] = self.points(&walker, 0);
        let [u_direction, v_direction, ..] = self.points(&walker, 1);
        let scene = self.view.scene;
        let chosen = match self.lights {
            Some(lights) => lights.sample(choice).filter(|&(_, probability, _)| probability > 0.0),
            None => scene.lights().choose(choice),
        };
        let (emitter, probability, _) = chosen?;
        let place = [triangle, u, v, u_direction, v_direction];
        let (source, ray) = scene.emit((emitter, probability), place)?;
        let share = 1.0 / plan.paths as f32;
        let source = scaled(source, share).among(plan.kept as f32);
        match &source {
            Source::Light { .. } if exact => {}
            Source::Light { .. } => self.light(emitter, source, set),
            _ => self.leave(source, &walker),
        }
        let ray = ray.filter(|_| plan.max_bounces > 0)?;
        walker.ray = Ray::new(ray.origin, ray.direction);
        walker.flux = ray.flux * share;
        Some(walker)
    }

    /// A candidate on a light without area: all paths of a set that start there share one.
    fn light(&mut self, emitter: usize, source: Source, set: u32) {
        let known = self.by_emitter.iter().find(|(other, _)| *other == emitter);
        match known.map(|&(_, index)| &mut self.candidates[index].vpl.source) {
            Some(Source::Light { factor, .. }) => {
                if let Source::Light { factor: more, .. } = source {
                    *factor += more;
                }
            }
            _ => {
                self.by_emitter.push((emitter, self.candidates.len()));
                self.candidates.push(Candidate { vpl: Vpl { source, bounces: 0 }, set, certain: false });
            }
        }
    }

    fn leave(&mut self, source: Source, walker: &Walker) {
        let vpl = Vpl { source, bounces: walker.bounces };
        self.candidates.push(Candidate { vpl, set: walker.set, certain: false });
    }

    /// Leaves a candidate where a path arrived after `distance` and says whether anything is left of it to go on.
    fn bounce(&mut self, walker: &mut Walker, surface: &Surface<f32>, distance: f32) -> bool {
        walker.flux *= (-Vec3::from(surface.absorption) * distance).exp();
        let [u_lobe, u_end, u, v] = self.points(walker, 2 + walker.bounces + walker.passed);
        let pass = surface.through.largest().min(1.0);
        if pass > 0.0 {
            // One number decides on passing and, stretched, on the lobe.
            if u_end < pass {
                walker.flux *= Vec3::from(surface.through) / pass;
                walker.passed += 1;
                walker.ray.origin = surface.spawn(walker.ray.direction.into()).into();
                return walker.passed < MAX_PASSED;
            }
            walker.flux *= surface.coverage / (1.0 - pass);
        }
        let u_end = if pass > 0.0 { (u_end - pass) / (1.0 - pass) } else { u_end };
        walker.bounces += 1;
        self.reflect(walker, surface);
        if walker.bounces >= self.plan.max_bounces.min(MAX_BOUNCES) {
            return false;
        }
        let sample = surface.bsdf.sample_onward(u_lobe, [u, v], Selection::ALL);
        if !sample.valid {
            return false;
        }
        let mut weight = Vec3::from(sample.weight);
        if walker.bounces > ROULETTE_FROM {
            // By the largest channel: no saturated colour is made stronger than it was.
            let survival = weight.max_element().clamp(0.05, 0.95);
            if u_end >= survival {
                return false;
            }
            weight /= survival;
        }
        walker.flux *= weight;
        walker.ray = Ray::new(surface.spawn(sample.wi).into(), sample.wi.into());
        walker.flux.is_finite() && walker.flux != Vec3::ZERO
    }

    /// Leaves a candidate for what dull lobes reflect, if there is any.
    fn reflect(&mut self, walker: &Walker, surface: &Surface<f32>) {
        let PatchReflectance { diffuse, rim, gloss } = surface.bsdf.as_patch(DULL);
        let radiance = walker.flux * Vec3::from(diffuse) * std::f32::consts::FRAC_1_PI;
        let gloss = gloss.map(|gloss| (walker.flux, gloss));
        if radiance.is_finite() && walker.flux.is_finite() && (radiance != Vec3::ZERO || gloss.is_some()) {
            let (position, normal) = (surface.position.into(), surface.ng().into());
            let error = surface.error;
            self.leave(Source::Patch { position, error, normal, radiance, rim, gloss, density: 0.0 }, walker);
        }
    }

    /// Four numbers in [0, 1) for a vertex of a path, the same for every frame so that still pictures stand still.
    fn points(&self, walker: &Walker, vertex: u32) -> [f32; 4] {
        Sampler::along(walker.index(self.plan), self.plan.seed).set(vertex)
    }
}

/// A source of a share of the light.
pub(super) fn scaled(mut source: Source, share: f32) -> Source {
    match &mut source {
        Source::Patch { radiance, gloss, .. } => {
            *radiance *= share;
            if let Some((flux, _)) = gloss {
                *flux *= share;
            }
        }
        Source::Light { factor, .. } => *factor *= share,
        Source::Distant { irradiance, .. } => *irradiance *= share,
    }
    source
}

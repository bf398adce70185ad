//! Virtual point lights: where light paths from all sources meet surfaces that scatter it diffusely.
//!
//! # References
//! Keller, "Instant Radiosity", 1997. Wald, Kollig, Benthin, Keller, Slusallek, "Interactive Global Illumination using
//! Fast Ray Tracing", 2002.

use glam::{UVec3, Vec3};
use heliostat_kernel::{Aabb, RayQuery};
use heliostat_shading::color::luminance;
use heliostat_shading::{Sampler, Source};

use super::importance::Contributions;
use super::lights;
use super::paths::{self, PathPlan, scaled};
use super::residual::LEVELS;
use super::sight::Sight;
use crate::region::View;

/// Keeps the numbers of short rays apart from those of light paths.
const SHORT_RAYS: u32 = 0x7368_6f72;
/// The same for the turns of parts.
const TURNS: u32 = 0x7475_726e;
/// The same for the combs that choose among candidates.
const COMBS: u32 = 0x636f_6d62;
/// Sets, or parts of them, whose points send short rays, at least.
const SHORT_SETS: usize = 8;
/// Candidates for each virtual point light that is kept.
pub(super) const CANDIDATES: u32 = 8;
/// Where more paths are asked for than these, there are fewer candidates for each.
const MOST_PATHS: u32 = 1 << 16;
/// Pairs of candidates and points that they are compared at.
const MOST_PAIRS: usize = 1 << 20;

/// A source of light that many points share: on a light (bounce 0) or on a surface that light has reached.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Vpl {
    /// What it sends, divided by the number of paths.
    pub(super) source: Source,
    /// Edges of the light path before it.
    pub(super) bounces: u32,
}

impl Vpl {
    /// Luminance that a geometric term of one brings to a point; infinite where there is none that could be bounded: light
    /// straight from its source is left as it is.
    pub(super) fn strength(&self) -> f32 {
        let radiance = if self.bounces > 0 { self.source.patch_radiance() } else { None };
        radiance.map_or(f32::INFINITY, luminance)
    }
}

impl Vpl {
    /// Luminance of the irradiance that one brings to a point if nothing stands between. `bound` limits geometric terms.
    pub(super) fn irradiance(&self, bound: f32, position: Vec3, normal: Vec3) -> f32 {
        let light = self.source.light(position);
        let irradiance = luminance(light.radiance) * light.facing * normal.dot(light.wi).max(0.0);
        let most = self.strength() * bound;
        if irradiance.is_nan() { 0.0 } else { irradiance.min(most) }
    }
}

/// What may become a virtual point light of a set.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    pub(super) vpl: Vpl,
    pub(super) set: u32,
    /// Whether it is kept in any case.
    pub(super) certain: bool,
}

impl Candidate {
    /// Whether it is on a light.
    pub(super) fn is_direct(&self) -> bool {
        self.vpl.bounces == 0
    }

    /// What sorts candidates by set, those on lights apart, by neighbourhood. `bounds` are those of the scene.
    fn order(&self, bounds: &Aabb) -> (u32, bool, bool, u64) {
        let (far, place) = match &self.vpl.source {
            Source::Distant { wi, .. } => (true, 0.5 + 0.5 * *wi),
            source => (false, (source.origin().unwrap_or_default() - bounds.min) / bounds.size()),
        };
        (self.set, self.is_direct(), far, curve(place))
    }
}

/// The place of a point of the unit cube on Hilbert's curve through it (Skilling, "Programming the Hilbert Curve", 2004).
fn curve(point: Vec3) -> u64 {
    /// Of each coordinate.
    const BITS: u32 = 16;
    let most = (1 << BITS) - 1;
    let mut cell = (point * (1 << BITS) as f32).as_uvec3().min(UVec3::splat(most)).to_array();
    for bit in (1..BITS).rev().map(|bit| 1 << bit) {
        for i in 0..3 {
            if cell[i] & bit != 0 {
                cell[0] ^= bit - 1;
            } else {
                let swapped = (cell[0] ^ cell[i]) & (bit - 1);
                cell[0] ^= swapped;
                cell[i] ^= swapped;
            }
        }
    }
    // Gray's code.
    cell[1] ^= cell[0];
    cell[2] ^= cell[1];
    let turns = (1..BITS).map(|bit| 1 << bit).filter(|bit| cell[2] & bit != 0);
    let turned = turns.fold(0, |turned, bit| turned ^ (bit - 1));
    let [x, y, z] = cell.map(|cell| cell ^ turned);
    let bit = |number: u32, bit: u32| u64::from((number >> bit) & 1);
    (0..BITS).rev().fold(0, |place, i| place << 3 | bit(x, i) << 2 | bit(y, i) << 1 | bit(z, i))
}

/// The virtual point lights of one pass, a set for every pixel of the interleaving pattern.
#[derive(Debug, Default)]
pub(super) struct VplSets {
    pub(super) sets: Vec<Vec<Vpl>>,
    /// Parts of each set, one for each sample of a pixel: a power of two.
    parts: u32,
    /// Every part of every set, where there are several: strengthened, so that each stands for all of its set.
    dealt: Vec<Vec<Vpl>>,
    /// Which part of each set is for the first sample: in the mean over passes all are for every sample.
    turns: Vec<u32>,
    /// All candidates, each of its share of the light: for what the camera's view says little about.
    pub(super) candidates: Vec<Vpl>,
    /// Largest geometric term that a patch may have, 1/m².
    pub(super) bound: f32,
    /// Sample points of each part of each set for the short rays of its pixels. Like the virtual point lights they are few and shared:
    /// neighbours together have a well distributed handful, and what is left of the noise is smooth.
    pub(super) points: Vec<[[f32; 4]; LEVELS]>,
    /// How many virtual point lights of a set are on each emitter, in the mean.
    pub(super) visits: Vec<f32>,
    /// Rays traced to make them.
    pub(super) rays: u64,
}

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct VplPlan {
    pub(super) paths: PathPlan,
    /// Parts of each set.
    pub(super) parts: u32,
    /// A virtual point light may add this many times the mean irradiance at a point.
    pub(super) clamp: f32,
    /// Whether to draw more paths and to keep what matters to the camera.
    pub(super) importance: bool,
}

impl VplSets {
    /// Parts of each set.
    pub(super) fn parts(&self) -> u32 {
        self.parts
    }

    /// The part of a set that lights a sample of its pixels, among the parts of all sets.
    pub(super) fn part(&self, set: usize, sample: u32) -> usize {
        let parts = self.parts as usize;
        set * parts + self.turns[set].wrapping_add(sample) as usize % parts
    }

    /// The virtual point lights of a part.
    pub(super) fn of_part(&self, part: usize) -> &[Vpl] {
        if self.parts == 1 { &self.sets[part] } else { &self.dealt[part] }
    }

    /// How many virtual point lights of a part are a share of them: at least one for all parts of a set.
    pub(super) fn budget(&self, part: usize, share: f32) -> f32 {
        (share * self.of_part(part).len() as f32).max(1.0 / self.parts as f32)
    }

    /// By what the short rays of a part are to be multiplied, none if it has none: however many there are, those of
    /// [`SHORT_SETS`] are enough.
    pub(super) fn short_rays(&self, part: usize) -> Option<f32> {
        let parts = self.points.len();
        let step = (parts / SHORT_SETS).max(1);
        // The last ones of a step that is not whole.
        let count = parts.div_ceil(step);
        part.is_multiple_of(step).then(|| parts as f32 / count as f32)
    }

    /// Draws all paths and keeps what matters of what they leave.
    pub(super) fn new<Q: RayQuery + ?Sized>(view: &View<'_, Q>, plan: &VplPlan) -> Self {
        let PathPlan { sets, pass, seed, .. } = plan.paths;
        let parts = sets * plan.parts;
        let numbers = |of: u32, one, seed| Sampler::along(pass.wrapping_mul(of).wrapping_add(one), seed);
        let point = |part| [0, 1, 2, 3].map(|level| numbers(parts, part, seed ^ SHORT_RAYS).set(level));
        let points = (0..parts).map(point).collect();
        let turn = |set| (numbers(sets, set, seed ^ TURNS).set(0)[0] * plan.parts as f32) as u32;
        let turns: Vec<u32> = (0..sets).map(turn).collect();
        let most = (MOST_PATHS / (plan.paths.paths * sets).max(1)).clamp(1, CANDIDATES);
        let times = if plan.importance { most } else { 1 };
        let paths = PathPlan { paths: plan.paths.paths * times, ..plan.paths };
        let mut sight = Sight::new(view, seed.wrapping_add(pass));
        let lights = if plan.importance { lights::choice(view, &mut sight, &plan.paths) } else { None };
        let chance = |emitter| match &lights {
            Some(lights) => lights.probability(emitter),
            None => view.scene.lights().probability(emitter),
        };
        let kept = plan.paths.paths as f32;
        let visits = (0..view.scene.lights().len()).map(|emitter| kept * chance(emitter)).collect();
        let (mut candidates, mut rays) = paths::draw(view, &paths, lights.as_ref());
        let bounds = view.query.bounds();
        candidates.sort_by_cached_key(|candidate| candidate.order(&bounds));
        sight.keep((MOST_PAIRS / candidates.len().max(1)).max(1));
        let (contributions, traced) = Contributions::new(view, &candidates, &sight);
        rays += sight.traced + traced;
        // One of typical strength, when it is kept, adds `clamp` times the typical light of a set.
        let strength = contributions.typical_strength(&candidates) * times as f32;
        let limit = plan.clamp * contributions.typical() / (sets as f32 * strength);
        let bound = if limit > 0.0 { limit } else { f32::INFINITY };
        let factors = if plan.importance {
            // The combs of all sets together are one comb.
            let [surfaces, lights, ..] = Sampler::along(pass, seed ^ COMBS).set(0);
            let shift = |set| [surfaces, lights].map(|shift| (shift + set as f32 / sets as f32).fract());
            let shifts: Vec<_> = (0..sets).map(shift).collect();
            contributions.choose(&candidates, &sight, (bound, times as f32), &shifts)
        } else {
            vec![1.0; candidates.len()]
        };
        let mut kept = vec![Vec::new(); sets as usize];
        for (candidate, factor) in candidates.iter().zip(factors) {
            if factor > 0.0 {
                let source = scaled(candidate.vpl.source.clone(), factor);
                let vpl = Vpl { source, ..candidate.vpl };
                kept[candidate.set as usize].push(Candidate { vpl, ..candidate.clone() });
            }
        }
        let dealt = if plan.parts > 1 {
            kept.iter().flat_map(|set| deal(set, plan.parts)).collect()
        } else {
            Vec::new()
        };
        let own = |set: Vec<Candidate>| set.into_iter().map(|candidate| candidate.vpl).collect();
        let sets = kept.into_iter().map(own).collect();
        let candidates = own(candidates);
        Self { sets, parts: plan.parts, dealt, turns, candidates, bound, points, visits, rays }
    }
}

/// The parts of a set: what samples of a pixel that see the same surface bring together is the light of the set. Neighbours are
/// dealt out in turn. What is certain is in all parts.
fn deal(set: &[Candidate], parts: u32) -> Vec<Vec<Vpl>> {
    let mut dealt = vec![Vec::new(); parts as usize];
    let mut part = 0;
    for Candidate { vpl, certain, .. } in set {
        if *certain {
            dealt.iter_mut().for_each(|part| part.push(vpl.clone()));
        } else {
            let source = scaled(vpl.source.clone(), parts as f32);
            dealt[part].push(Vpl { source, ..*vpl });
            part = (part + 1) % parts as usize;
        }
    }
    dealt
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_goes_from_neighbour_to_neighbour() {
        const EDGE: u32 = 8;
        let cell = |i: u32| UVec3::new(i % EDGE, i / EDGE % EDGE, i / EDGE / EDGE);
        let mut cells: Vec<UVec3> = (0..EDGE.pow(3)).map(cell).collect();
        cells.sort_by_key(|cell| curve((cell.as_vec3() + 0.5) / EDGE as f32));
        let step = |a: UVec3, b: UVec3| a.as_ivec3().distance_squared(b.as_ivec3());
        assert!(cells.windows(2).all(|pair| step(pair[0], pair[1]) == 1));
        assert!(curve(Vec3::splat(f32::NAN)) == curve(Vec3::ZERO) && curve(Vec3::ONE) > 0);
    }

    #[test]
    fn the_parts_of_a_set_are_as_bright_as_it() {
        let candidate = |(bounces, certain)| {
            let (position, normal, radiance) = (Vec3::ZERO, Vec3::Z, Vec3::ONE);
            let source =
                Source::Patch { position, error: 0.0, normal, radiance, rim: 0.0, gloss: None, density: 0.0 };
            Candidate { vpl: Vpl { source, bounces }, set: 0, certain }
        };
        let mut set = vec![candidate((0, true))];
        set.extend([0, 0, 0, 0, 0, 1, 1, 2].map(|bounces| candidate((bounces, false))));
        let parts = deal(&set, 4);
        let brightness = |vpls: &[Vpl]| -> f32 {
            let strength = |vpl: &Vpl| match vpl.source {
                Source::Patch { radiance, .. } => radiance.x,
                _ => 0.0,
            };
            vpls.iter().map(strength).sum()
        };
        let sum: f32 = parts.iter().map(|part| brightness(part)).sum();
        assert_eq!(sum / 4.0, 9.0);
        // What is certain is in all of them, and none is left with it alone.
        assert!(parts.iter().all(|part| part.len() > 1 && brightness(part) > 1.0));
    }
}

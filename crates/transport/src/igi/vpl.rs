//! Virtual point lights: where light paths from all sources meet surfaces that scatter it diffusely.
//!
//! # References
//! Keller, "Instant Radiosity", 1997. Wald, Kollig, Benthin, Keller, Slusallek, "Interactive Global Illumination using
//! Fast Ray Tracing", 2002.

use glam::Vec3;
use heliostat_kernel::RayQuery;
use heliostat_shading::color::luminance;
use heliostat_shading::{Sampler, Source};

use super::importance::Contributions;
use super::lights;
use super::paths::{self, PathPlan, scaled};
use super::sight::Sight;
use crate::region::View;

/// Keeps the numbers of short rays apart from those of light paths.
const SHORT_RAYS: u32 = 0x7368_6f72;
/// Sets whose pixels send short rays, at least.
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
        match self.source {
            Source::Patch { radiance, .. } if self.bounces > 0 => luminance(radiance),
            _ => f32::INFINITY,
        }
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
    /// In [0, 1), evenly distributed: it is kept if the probability is larger. Without one it is kept in any case.
    pub(super) threshold: Option<f32>,
}

impl Candidate {
    /// One that is kept in any case.
    pub(super) fn certain(vpl: Vpl, set: u32) -> Self {
        Self { vpl, set, threshold: None }
    }

    /// Whether it is on a light.
    pub(super) fn is_direct(&self) -> bool {
        self.vpl.bounces == 0
    }
}

/// The virtual point lights of one pass, a set for every pixel of the interleaving pattern.
#[derive(Debug, Default)]
pub(super) struct VplSets {
    pub(super) sets: Vec<Vec<Vpl>>,
    /// All candidates, each of its share of the light: for what the camera's view says little about.
    pub(super) candidates: Vec<Vpl>,
    /// Largest geometric term that a patch may have, 1/m².
    pub(super) bound: f32,
    /// A sample point of each set for the short rays of its pixels. Like the virtual point lights they are few and shared:
    /// neighbours together have a well distributed handful, and what is left of the noise is smooth.
    pub(super) points: Vec<[f32; 4]>,
    /// Rays traced to make them.
    pub(super) rays: u64,
}

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct VplPlan {
    pub(super) paths: PathPlan,
    /// A virtual point light may add this many times the mean irradiance at a point.
    pub(super) clamp: f32,
    /// Whether to draw more paths and to keep what matters to the camera.
    pub(super) importance: bool,
}

impl VplSets {
    /// By what the short rays of a set are to be multiplied, none if it has none: however many sets a pattern has, those of
    /// [`SHORT_SETS`] are enough.
    pub(super) fn short_rays(&self, set: usize) -> Option<f32> {
        let step = (self.sets.len() / SHORT_SETS).max(1);
        // The last ones of a step that is not whole.
        let count = self.sets.len().div_ceil(step);
        set.is_multiple_of(step).then(|| self.sets.len() as f32 / count as f32)
    }

    /// Draws all paths and keeps what matters of what they leave.
    pub(super) fn new<Q: RayQuery + ?Sized>(view: &View<'_, Q>, plan: &VplPlan) -> Self {
        let PathPlan { sets, pass, seed, .. } = plan.paths;
        let point = |set| Sampler::along(pass.wrapping_mul(sets).wrapping_add(set), seed ^ SHORT_RAYS).set(0);
        let points = (0..sets).map(point).collect();
        let most = (MOST_PATHS / (plan.paths.paths * sets).max(1)).clamp(1, CANDIDATES);
        let times = if plan.importance { most } else { 1 };
        let paths = PathPlan { paths: plan.paths.paths * times, ..plan.paths };
        let mut sight = Sight::new(view, seed.wrapping_add(pass));
        let lights = if plan.importance { lights::choice(view, &mut sight, &plan.paths) } else { None };
        let (candidates, mut rays) = paths::draw(view, &paths, lights.as_ref());
        sight.keep((MOST_PAIRS / candidates.len().max(1)).max(1));
        let (contributions, traced) = Contributions::new(view, &candidates, &sight);
        rays += sight.traced + traced;
        // One of typical strength, when it is kept, adds `clamp` times the typical light of a set.
        let strength = contributions.typical_strength(&candidates) * times as f32;
        let limit = plan.clamp * contributions.typical() / (sets as f32 * strength);
        let bound = if limit > 0.0 { limit } else { f32::INFINITY };
        let factors = if plan.importance {
            contributions.choose(&candidates, &sight, (bound, times as f32))
        } else {
            vec![1.0; candidates.len()]
        };
        let mut kept = vec![Vec::new(); sets as usize];
        for (Candidate { vpl, set, .. }, factor) in candidates.iter().zip(factors) {
            if factor > 0.0 {
                kept[*set as usize].push(Vpl { source: scaled(vpl.source.clone(), factor), ..*vpl });
            }
        }
        let candidates = candidates.into_iter().map(|candidate| candidate.vpl).collect();
        Self { sets: kept, candidates, bound, points, rays }
    }
}

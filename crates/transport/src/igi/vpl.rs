//! Virtual point lights: where light paths from all sources meet surfaces that scatter it diffusely.
//!
//! # References
//! Keller, "Instant Radiosity", 1997. Wald, Kollig, Benthin, Keller, Slusallek, "Interactive Global Illumination using
//! Fast Ray Tracing", 2002. Veach 1997, chapter 10.2 (Russian roulette).

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::color::luminance;
use heliostat_shading::{Cone, EmittedRay, Sampler, Selection, Source};

use crate::eye::DULL;
use crate::region::View;

/// Longest light path, in bounces.
const MAX_BOUNCES: u32 = 16;
/// Bounces before paths may be ended by Russian roulette.
const ROULETTE_FROM: u32 = 1;
/// Keeps the numbers of short rays apart from those of light paths.
const SHORT_RAYS: u32 = 0x7368_6f72;
/// Surfaces that a light path may pass straight through.
const MAX_PASSED: u32 = 64;

/// A source of light that many points share: on a light (bounce 0) or on a surface that light has reached.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Vpl {
    /// What it sends, divided by the number of paths.
    pub(crate) source: Source,
    /// Edges of the light path before it.
    pub(crate) bounces: u32,
}

/// The virtual point lights of one pass, a set for every pixel of the interleaving pattern.
#[derive(Debug, Default)]
pub(crate) struct VplSets {
    pub(crate) sets: Vec<Vec<Vpl>>,
    /// Largest geometric term that a patch may have, 1/m².
    pub(crate) bound: f32,
    /// A sample point of each set for the short rays of its pixels. Like the virtual point lights they are few and shared:
    /// neighbours together have a well distributed handful, and what is left of the noise is smooth.
    pub(crate) points: Vec<[f32; 4]>,
    /// Rays traced to make them.
    pub(crate) rays: u64,
}

/// How light paths are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathPlan {
    /// Sets of virtual point lights.
    pub(crate) sets: u32,
    /// Light paths of each.
    pub(crate) paths: u32,
    /// Which pass: each continues the sequence where the last one ended.
    pub(crate) pass: u32,
    pub(crate) seed: u32,
    /// Bounces a path may have.
    pub(crate) max_bounces: u32,
    /// A virtual point light may add this many times the mean irradiance at a point.
    pub(crate) clamp: f32,
}

/// A light path on its way.
struct Walker {
    set: u32,
    /// Place in the sequence.
    index: u32,
    ray: Ray,
    flux: Vec3,
    bounces: u32,
    passed: u32,
}

impl VplSets {
    /// Draws all paths, wave by wave.
    pub(crate) fn new<Q: RayQuery + ?Sized>(view: &View<'_, Q>, plan: &PathPlan) -> Self {
        let block = plan.pass.wrapping_mul(plan.sets);
        let point = |set| Sampler::along(block.wrapping_add(set), plan.seed ^ SHORT_RAYS).set(0);
        let points = (0..plan.sets).map(point).collect();
        let mut result =
            Self { sets: vec![Vec::new(); plan.sets as usize], bound: f32::INFINITY, points, rays: 0 };
        let mut walkers = Vec::new();
        for set in 0..plan.sets {
            for path in 0..plan.paths {
                // Every set takes a block of the sequence, which is well distributed by itself.
                let block = plan.pass.wrapping_mul(plan.sets).wrapping_add(set);
                let index = block.wrapping_mul(plan.paths).wrapping_add(path);
                walkers.extend(result.start(view, plan, set, index));
            }
        }
        let mut hits = Vec::new();
        while !walkers.is_empty() {
            let rays: Vec<Ray> = walkers.iter().map(|walker| walker.ray).collect();
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            view.query.intersect(&rays, &mut hits);
            result.rays += rays.len() as u64;
            let arrived = walkers.into_iter().zip(&hits).filter(|(_, hit)| hit.is_hit());
            walkers = arrived.filter_map(|(walker, hit)| result.bounce(view, plan, walker, hit)).collect();
        }
        result.bound = bound(&result.sets, plan.clamp);
        result
    }

    fn start<Q: ?Sized>(
        &mut self,
        view: &View<'_, Q>,
        plan: &PathPlan,
        set: u32,
        index: u32,
    ) -> Option<Walker> {
        let [choice, triangle, u, v] = points(plan, index, 0);
        let [u_direction, v_direction, ..] = points(plan, index, 1);
        let (source, ray) = view.scene.emit([choice, triangle, u, v, u_direction, v_direction])?;
        let share = 1.0 / plan.paths as f32;
        self.sets[set as usize].push(Vpl { source: scaled(source, share), bounces: 0 });
        let EmittedRay { origin, direction, flux } = ray.filter(|_| plan.max_bounces > 0)?;
        Some(Walker {
            set,
            index,
            ray: Ray::new(origin, direction),
            flux: flux * share,
            bounces: 0,
            passed: 0,
        })
    }

    /// Leaves a virtual point light where a path arrived and sends the path on, if anything is left of it.
    fn bounce<Q: RayQuery + ?Sized>(
        &mut self,
        view: &View<'_, Q>,
        plan: &PathPlan,
        mut walker: Walker,
        hit: &Hit,
    ) -> Option<Walker> {
        let surface = view.scene.surface(hit, &walker.ray, Cone::default());
        walker.flux *= (-Vec3::from(surface.absorption) * hit.t).exp();
        let [u_lobe, u_end, u, v] = points(plan, walker.index, 2 + walker.bounces + walker.passed);
        let pass = surface.through.largest().min(1.0);
        if pass > 0.0 {
            // One number decides on passing and, stretched, on the lobe.
            if u_end < pass {
                walker.flux *= Vec3::from(surface.through) / pass;
                walker.passed += 1;
                walker.ray.origin = surface.spawn(walker.ray.direction.into()).into();
                return (walker.passed < MAX_PASSED).then_some(walker);
            }
            walker.flux *= surface.coverage / (1.0 - pass);
        }
        let u_end = if pass > 0.0 { (u_end - pass) / (1.0 - pass) } else { u_end };
        walker.bounces += 1;
        // Rough lobes are taken for diffuse ones of the same albedo.
        let reflectance = Vec3::from(surface.bsdf.albedo_of(DULL));
        let radiance = walker.flux * reflectance * std::f32::consts::FRAC_1_PI;
        if radiance.is_finite() && radiance != Vec3::ZERO {
            let source = Source::Patch {
                position: surface.position.into(),
                error: surface.error,
                normal: surface.ng().into(),
                radiance,
            };
            self.sets[walker.set as usize].push(Vpl { source, bounces: walker.bounces });
        }
        if walker.bounces >= plan.max_bounces.min(MAX_BOUNCES) {
            return None;
        }
        let sample = surface.bsdf.sample(u_lobe, [u, v], Selection::ALL);
        if !sample.valid {
            return None;
        }
        let mut weight = Vec3::from(sample.weight);
        if sample.transmitted {
            // Flux is not squeezed by refraction as radiance is.
            weight *= surface.bsdf.transmitted_eta().powi(2);
        }
        if walker.bounces > ROULETTE_FROM {
            let survival = luminance(weight).clamp(0.05, 0.95);
            if u_end >= survival {
                return None;
            }
            weight /= survival;
        }
        walker.flux *= weight;
        walker.ray = Ray::new(surface.spawn(sample.wi).into(), sample.wi.into());
        (walker.flux.is_finite() && walker.flux != Vec3::ZERO).then_some(walker)
    }
}

/// Four numbers in [0, 1) for a vertex of a path, the same for every frame so that still pictures stand still.
fn points(plan: &PathPlan, index: u32, vertex: u32) -> [f32; 4] {
    Sampler::along(index, plan.seed).set(vertex)
}

fn scaled(source: Source, share: f32) -> Source {
    match source {
        Source::Patch { position, error, normal, radiance } => {
            Source::Patch { position, error, normal, radiance: radiance * share }
        }
        Source::Light { kind, factor } => Source::Light { kind, factor: factor * share },
        Source::Distant { wi, irradiance } => Source::Distant { wi, irradiance: irradiance * share },
    }
}

/// A bound of the geometric term with which the patch of mean power adds `clamp` times the typical irradiance of a set:
/// the median over patches themselves, which lie where there is light. What stands in the way is not asked for.
fn bound(sets: &[Vec<Vpl>], clamp: f32) -> f32 {
    /// Patches that are asked for their irradiance, over all sets.
    const MOST: usize = 256;
    let patches = |set: &[Vpl]| -> Vec<(Vec3, Vec3, f32)> {
        let patch = |vpl: &Vpl| match vpl.source {
            Source::Patch { position, normal, radiance, .. } => Some((position, normal, luminance(radiance))),
            _ => None,
        };
        set.iter().filter_map(patch).collect()
    };
    let (mut irradiances, mut power, mut count) = (Vec::new(), 0.0, 0.0);
    for set in sets {
        let patches = patches(set);
        power += patches.iter().map(|p| p.2).sum::<f32>();
        count += patches.len() as f32;
        if irradiances.len() < MOST {
            let step = patches.len() / MOST + 1;
            irradiances.extend(patches.iter().step_by(step).map(|&(x, nx, _)| {
                patches
                    .iter()
                    .map(|&(y, ny, radiance)| radiance * geometric_term((x, nx), (y, ny)))
                    .sum::<f32>()
            }));
        }
    }
    irradiances.sort_unstable_by(f32::total_cmp);
    let typical = irradiances.get(irradiances.len() / 2).copied().unwrap_or(0.0);
    let limit = clamp * typical * count / power;
    if limit > 0.0 { limit } else { f32::INFINITY }
}

/// cos · cos / distance² of two points with normals that face each other.
fn geometric_term((x, nx): (Vec3, Vec3), (y, ny): (Vec3, Vec3)) -> f32 {
    let d = y - x;
    let cosines = nx.dot(d).max(0.0) * (-ny.dot(d)).max(0.0);
    // The cosines have not been divided by the distance yet.
    if cosines > 0.0 { cosines / d.length_squared().powi(2).max(1e-12) } else { 0.0 }
}

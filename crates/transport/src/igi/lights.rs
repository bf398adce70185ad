//! Which lights matter to what the camera sees, when there are many.
//!
//! At points that the camera sees, and at points that these see in turn, a few lights are drawn in proportion to what each
//! would bring if nothing stood between, and asked for by a shadow ray. What arrives, relative to what the point receives
//! in all, is the importance of its light. Paths start on lights by a mixture of that, of what the lights would bring
//! unshadowed, and of power: no light is left out, so that the mean is right whatever the points miss.
//!
//! # References
//! Wald, Benthin, Slusallek, "Interactive Global Illumination in Complex and Highly Occluded Environments", 2003. Shirley,
//! Wang, Zimmerman, "Monte Carlo Techniques for Direct Lighting Calculations", 1996 (many lights).

use glam::Vec2;
use heliostat_kernel::{Ray, RayQuery};
use heliostat_shading::Sampler;
use heliostat_shading::color::luminance;
use heliostat_shading::sampling::Discrete;

use super::paths::PathPlan;
use super::sight::{Seen, Sight};
use crate::region::View;
use crate::shadow::{PendingLight, ShadowBatch};

/// So many lights are few: paths choose among them by power.
const FEW: usize = 16;
/// Lights that are asked for at each point.
const DRAWN: u32 = 8;
/// Points times lights that are compared at most.
const MOST_PAIRS: usize = 1 << 23;
/// Shares of what arrives, of what would arrive unshadowed, and (the rest) of power in the choice.
const ARRIVING: f32 = 0.7;
const UNSHADOWED: f32 = 0.2;
/// Keeps these numbers apart from those of other rays.
const SEED: u32 = 0x6c69_6768;

/// A light that was drawn at a point.
struct Asked {
    point: u32,
    light: u32,
    arrived: f32,
}

/// How light paths are to choose their lights; `None` where power is good enough.
pub(super) fn choice<Q: RayQuery + ?Sized>(
    view: &View<'_, Q>,
    sight: &mut Sight,
    plan: &PathPlan,
) -> Option<Discrete> {
    let lights = view.scene.lights().len();
    if lights <= FEW {
        return None;
    }
    let seed = plan.seed.wrapping_add(plan.pass) ^ SEED;
    let behind = sight.behind(view, seed);
    let most = (MOST_PAIRS / lights / 2).max(1);
    let points: Vec<Seen> =
        sight.points().iter().take(most).chain(behind.iter().take(most)).copied().collect();
    let (unshadowed, mut asked, mut shadows) = draw(view, &points, lights, seed);
    shadows.trace(view.query, view.scene, |light| {
        asked[light.pixel as usize].arrived = luminance(light.radiance);
    });
    sight.traced += shadows.traced();
    let mut total = vec![0.0; points.len()];
    for asked in &asked {
        total[asked.point as usize] += asked.arrived;
    }
    let mut arriving = vec![0.0; lights];
    for Asked { point, light, arrived } in asked.into_iter().filter(|asked| asked.arrived > 0.0) {
        let (point, light) = (point as usize, light as usize);
        arriving[light] += points[point].weight.min(1.0) * arrived / total[point];
    }
    Some(mixture(view, &arriving, &unshadowed))
}

/// Draws lights at all points: what every light would bring relative to all, the lights drawn, and their shadow rays.
fn draw<Q: ?Sized>(
    view: &View<'_, Q>,
    points: &[Seen],
    lights: usize,
    seed: u32,
) -> (Vec<f32>, Vec<Asked>, ShadowBatch) {
    let (mut unshadowed, mut estimates) = (vec![0.0; lights], Vec::new());
    let (mut asked, mut shadows) = (Vec::new(), ShadowBatch::default());
    for (index, point) in (0..).zip(points) {
        view.scene.lights().lamps().irradiances(point.position, point.normal, &mut estimates);
        let sum: f32 = estimates.iter().sum();
        if !(sum > 0.0 && sum.is_finite()) {
            continue;
        }
        let scale = point.weight.min(1.0) / sum;
        unshadowed.iter_mut().zip(&estimates).for_each(|(all, estimate)| *all += scale * estimate);
        let [shift, ..] = Sampler::along(index, seed).set(0);
        // The lights under a comb of evenly spaced points of the running sum.
        let (mut below, mut tooth) = (0.0, 0);
        for (light, &estimate) in (0_u32..).zip(&estimates) {
            below += estimate;
            while tooth < DRAWN && (tooth as f32 + shift) * sum < below * DRAWN as f32 {
                let [u, v, u_triangle, _] = Sampler::along(index, seed).set(1 + tooth);
                tooth += 1;
                let position = (point.position, 0.0);
                let sample = view.scene.sample_light(light as usize, position, Vec2::new(u, v), u_triangle);
                let Some(sample) = sample else { continue };
                let radiance = sample.weight * (point.normal.dot(sample.wi).max(0.0) * sum / estimate);
                if radiance.is_finite() && luminance(radiance) > 0.0 {
                    let shadow = Ray { t_max: sample.distance, ..Ray::new(point.position, sample.wi) };
                    shadows.push(shadow, PendingLight { pixel: asked.len() as u32, radiance });
                    asked.push(Asked { point: index, light, arrived: 0.0 });
                }
            }
        }
    }
    (unshadowed, asked, shadows)
}

/// The mixture of all three.
fn mixture<Q: ?Sized>(view: &View<'_, Q>, arriving: &[f32], unshadowed: &[f32]) -> Discrete {
    let share = |part: f32, of: &[f32]| {
        let sum: f32 = of.iter().sum();
        if sum > 0.0 { part / sum } else { 0.0 }
    };
    let scales = [share(ARRIVING, arriving), share(UNSHADOWED, unshadowed)];
    let lights = view.scene.lights();
    Discrete::new(arriving.iter().zip(unshadowed).enumerate().map(|(light, (arriving, unshadowed))| {
        let power = (1.0 - ARRIVING - UNSHADOWED) * lights.probability(light);
        // A light without power sends nothing.
        if power > 0.0 { scales[0] * arriving + scales[1] * unshadowed + power } else { 0.0 }
    }))
}

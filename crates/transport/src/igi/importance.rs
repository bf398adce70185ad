//! Which candidates for virtual point lights are worth their shadow rays.
//!
//! Many more light paths are drawn than shadow rays can be traced to. What each candidate adds at a handful of points that
//! the camera sees, with its visibility, says how much it matters; it is kept with a probability in proportion to that
//! and strengthened by the inverse. Candidates that nothing seen depends on keep a small probability, so that the mean is
//! right whatever the points miss.
//!
//! Probabilities decide against a number that each candidate has from its place in the sequence: those of like importance
//! are kept as one block, which is well distributed, and when the view changes little, so does the choice. A candidate
//! near its threshold counts in part, so that none comes or goes at once.
//!
//! # References
//! Georgiev, Slusallek, "Simple and Robust Iterative Importance Sampling of Virtual Point Lights", 2010. Wald, Benthin,
//! Slusallek, "Interactive Global Illumination in Complex and Highly Occluded Environments", 2003. Neyman, "On the Two
//! Different Aspects of the Representative Method", 1934 (allocation by standard deviation). The blocks and the soft
//! thresholds are ours.

use heliostat_kernel::RayQuery;
use rayon::prelude::*;

use super::sight::{Asking, Sight};
use super::vpl::Candidate;
use crate::region::View;

/// Share of the mean importance that every candidate has besides its own.
const FLOOR: f32 = 0.5;
/// Candidates that a thread takes at a time.
const CHUNK: usize = 64;
/// Width of the soft thresholds, as a share of the probability on either side.
const SOFTNESS: f32 = 0.1;

/// What candidates add at the points that the camera sees.
#[derive(Debug)]
pub(super) struct Contributions {
    /// Irradiance at each point from all candidates.
    total: Vec<f32>,
    /// Candidate, point, irradiance.
    added: Vec<(u32, u32, f32)>,
}

impl Contributions {
    /// Asks for all of them, one tile of shadow rays for each candidate, on all threads of the pool at hand. Returns the
    /// number of rays too.
    pub(super) fn new<Q: RayQuery + ?Sized>(
        view: &View<'_, Q>,
        candidates: &[Candidate],
        sight: &Sight,
    ) -> (Self, u64) {
        let points = sight.points();
        let ask = |(chunk, candidates): (usize, &[Candidate])| {
            let (mut asking, mut added, mut traced) = (Asking::default(), Vec::new(), 0);
            for (index, candidate) in (chunk * CHUNK..).zip(candidates) {
                traced += asking.light(view, (points, &candidate.vpl.source), |point, irradiance| {
                    added.push((index as u32, point as u32, irradiance));
                });
            }
            (added, traced)
        };
        let chunks: Vec<_> = candidates.par_chunks(CHUNK).enumerate().map(ask).collect();
        let (mut total, mut added, mut traced) = (vec![0.0_f32; points.len()], Vec::new(), 0);
        for (more, rays) in chunks {
            more.iter().for_each(|&(_, point, irradiance)| total[point as usize] += irradiance);
            added.extend(more);
            traced += rays;
        }
        (Self { total, added }, traced)
    }

    /// Irradiance that is typical of the points: the geometric mean, which neither a few bright points nor a spike near a
    /// candidate shift by much. Zero if all are dark.
    pub(super) fn typical(&self) -> f32 {
        let (mut sum, mut count) = (0.0, 0.0_f32);
        for total in self.total.iter().filter(|total| **total > 0.0 && total.is_finite()) {
            sum += total.ln();
            count += 1.0;
        }
        if count > 0.0 { (sum / count).exp() } else { 0.0 }
    }

    /// Strength that is typical of the candidates on surfaces, each as important as what it adds to the points: the geometric
    /// mean, which a few strong ones from lights that are seldom chosen do not shift by much. Zero if none adds anything.
    pub(super) fn typical_strength(&self, candidates: &[Candidate]) -> f32 {
        let (mut sum, mut weights) = (0.0, 0.0_f32);
        for &(index, point, irradiance) in &self.added {
            let strength = candidates[index as usize].vpl.strength();
            let weight = irradiance / self.total[point as usize];
            if strength.is_finite() && strength > 0.0 && weight.is_finite() {
                sum += weight * strength.ln();
                weights += weight;
            }
        }
        if weights > 0.0 { (sum / weights).exp() } else { 0.0 }
    }

    /// By how much each candidate is to be multiplied, 0 for those that are not kept: one of `times` in the mean. `bound`
    /// limits geometric terms.
    ///
    /// Candidates on lights and those on lit surfaces do not compete: what lights bring is larger, but well distributed
    /// over them, so that fewer of them do.
    pub(super) fn choose(
        &self,
        candidates: &[Candidate],
        sight: &Sight,
        (bound, times): (f32, f32),
    ) -> Vec<f32> {
        let importance = self.importance(candidates, sight, bound);
        let of = |direct: bool| {
            let own = candidates.iter().zip(&importance).filter(|(c, _)| c.is_direct() == direct);
            let own: Vec<f32> = own.filter(|(c, _)| c.threshold.is_some()).map(|(_, &i)| i).collect();
            let mean = own.iter().sum::<f32>() / own.len().max(1) as f32;
            let floor = if mean > 0.0 { FLOOR * mean } else { 1.0 };
            let budget = own.len() as f32 / times;
            (scale(own.into_iter().map(|i| i + floor).collect(), budget), floor)
        };
        let scales = [of(false), of(true)];
        let weight = |(candidate, importance): (&Candidate, &f32)| {
            let (scale, floor) = scales[usize::from(candidate.is_direct())];
            candidate.threshold.map_or(1.0, |threshold| weight(scale * (importance + floor), threshold))
        };
        candidates.iter().zip(&importance).map(weight).collect()
    }

    /// Root mean square of what each candidate adds to the points, relative to all that they receive.
    fn importance(&self, candidates: &[Candidate], sight: &Sight, bound: f32) -> Vec<f32> {
        let mut importance = vec![0.0; candidates.len()];
        for &(index, point, irradiance) in &self.added {
            let (index, point) = (index as usize, point as usize);
            let kept = irradiance.min(candidates[index].vpl.strength() * bound);
            let share = sight.points()[point].weight.min(1.0) * kept / self.total[point];
            importance[index] += share * share;
        }
        importance.iter_mut().for_each(|square| *square = square.sqrt());
        importance
    }
}

/// What importances are to be multiplied with for so many candidates to be kept in the mean, when none can be kept with a
/// probability of more than one.
pub(super) fn scale(mut importance: Vec<f32>, budget: f32) -> f32 {
    importance.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut rest: f64 = importance.iter().map(|&i| f64::from(i)).sum();
    let mut budget = f64::from(budget);
    for &largest in &importance {
        let scale = budget / rest;
        if scale * f64::from(largest) <= 1.0 {
            return scale as f32;
        }
        rest -= f64::from(largest);
        budget -= 1.0;
        if budget <= 0.0 {
            break;
        }
    }
    f32::INFINITY
}

/// The factor of a candidate that is kept with a probability, for its number in [0, 1): one over the probability below it,
/// none above it, and a ramp between.
fn weight(probability: f32, threshold: f32) -> f32 {
    if probability >= 1.0 {
        return 1.0;
    }
    let ramp = SOFTNESS * probability;
    let kept = ((probability + ramp - threshold) / (2.0 * ramp)).clamp(0.0, 1.0);
    // The mean of `kept` over all thresholds.
    let beyond = (probability + ramp - 1.0).max(0.0);
    kept / (probability - beyond * beyond / (4.0 * ramp))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_factor_is_one() {
        for probability in [0.001, 0.1, 0.5, 0.93, 0.999, 1.0, 3.0] {
            let steps = 100_000;
            let sum: f64 =
                (0..steps).map(|i| f64::from(weight(probability, (i as f32 + 0.5) / steps as f32))).sum();
            assert!((sum / f64::from(steps) - 1.0).abs() < 1e-3, "{probability}: {}", sum / f64::from(steps));
        }
    }

    #[test]
    fn probabilities_add_up_to_the_budget() {
        let importance = vec![1.0, 2.0, 100.0, 0.5, 3.0, 0.1, 7.0];
        for budget in [1.0, 2.0, 4.5, 6.0] {
            let scale = scale(importance.clone(), budget);
            let sum: f32 = importance.iter().map(|i| (scale * i).min(1.0)).sum();
            assert!((sum - budget).abs() < 1e-4, "{budget}: {sum}");
        }
        // As many as there are, or more: all are kept.
        assert!([7.0, 9.0].into_iter().all(|budget| scale(importance.clone(), budget) * 0.1 >= 1.0));
    }
}

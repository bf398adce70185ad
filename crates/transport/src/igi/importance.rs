//! Which candidates for virtual point lights are worth their shadow rays.
//!
//! Many more light paths are drawn than shadow rays can be traced to. What each candidate adds at a handful of points that
//! the camera sees, with its visibility, says how much it matters; it is kept with a probability in proportion to that
//! and strengthened by the inverse. Candidates that nothing seen depends on keep a small probability, so that the mean is
//! right whatever the points miss.
//!
//! The candidates of a set stand in the order of their places along a curve through space, each as wide as its probability,
//! and a comb of evenly spaced teeth picks them (systematic sampling). What is kept is spread as all of them are, and sums up
//! to what they do. When the view changes little, teeth move on to neighbours, with a soft step: none comes or goes at once.
//!
//! # References
//! Georgiev, Slusallek, "Simple and Robust Iterative Importance Sampling of Virtual Point Lights", 2010. Wald, Benthin,
//! Slusallek, "Interactive Global Illumination in Complex and Highly Occluded Environments", 2003. Madow, "On the Theory of
//! Systematic Sampling, II", 1949 (with unequal probabilities). Neyman, "On the Two Different Aspects of the Representative
//! Method", 1934 (allocation by standard deviation). The soft steps are ours.

use heliostat_kernel::RayQuery;
use rayon::prelude::*;

use super::sight::{Asking, Sight};
use super::vpl::Candidate;
use crate::region::View;

/// Share of the mean importance that every candidate has besides its own.
const FLOOR: f32 = 0.25;
/// Candidates that a thread takes at a time.
const CHUNK: usize = 64;
/// Width of the soft steps between neighbours, as a share of the smaller probability on either side.
const SOFTNESS: f32 = 0.05;

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
        let (points, receivers) = (sight.points(), sight.receivers(view));
        let ask = |(chunk, candidates): (usize, &[Candidate])| {
            let (mut asking, mut added, mut traced) = (Asking::default(), Vec::new(), 0);
            for (index, candidate) in (chunk * CHUNK..).zip(candidates) {
                traced +=
                    asking.light(view, (points, &receivers), &candidate.vpl.source, |point, irradiance| {
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
    /// limits geometric terms; `shifts` place the combs of each set, for candidates on surfaces and on lights.
    ///
    /// Candidates on lights and those on lit surfaces do not compete: what lights bring is larger, but well distributed
    /// over them, so that fewer of them do.
    pub(super) fn choose(
        &self,
        candidates: &[Candidate],
        sight: &Sight,
        (bound, times): (f32, f32),
        shifts: &[[f32; 2]],
    ) -> Vec<f32> {
        let importance = self.importance(candidates, sight, bound);
        let of = |direct: bool| {
            let own = candidates.iter().zip(&importance).filter(|(c, _)| c.is_direct() == direct);
            let own: Vec<f32> = own.filter(|(c, _)| !c.certain).map(|(_, &i)| i).collect();
            let mean = own.iter().sum::<f32>() / own.len().max(1) as f32;
            let floor = if mean > 0.0 { FLOOR * mean } else { 1.0 };
            let budget = own.len() as f32 / times;
            (scale(own.into_iter().map(|i| i + floor).collect(), budget), floor)
        };
        let scales = [of(false), of(true)];
        let mut factors = Vec::with_capacity(candidates.len());
        for run in candidates.chunk_by(|a, b| (a.set, a.is_direct()) == (b.set, b.is_direct())) {
            let class = usize::from(run[0].is_direct());
            let (scale, floor) = scales[class];
            let own = run.iter().zip(&importance[factors.len()..]);
            let chances: Vec<f32> =
                own.map(|(c, i)| if c.certain { 1.0 } else { scale * (i + floor) }).collect();
            factors.extend(comb(&chances, shifts[run[0].set as usize][class]));
        }
        factors
    }

    /// Root of the root mean square of what each candidate adds to the points, relative to all that they receive. Candidates chosen
    /// one by one would be best chosen by the root mean square itself (Neyman); of those that stand in a row each stands for
    /// its neighbours, and the more it adds, the less that varies among them.
    fn importance(&self, candidates: &[Candidate], sight: &Sight, bound: f32) -> Vec<f32> {
        let mut importance = vec![0.0; candidates.len()];
        for &(index, point, irradiance) in &self.added {
            let (index, point) = (index as usize, point as usize);
            let kept = irradiance.min(candidates[index].vpl.strength() * bound);
            let share = sight.points()[point].weight.min(1.0) * kept / self.total[point];
            importance[index] += share * share;
        }
        importance.iter_mut().for_each(|square| *square = square.sqrt().sqrt());
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

/// The factors of things in a row, each of which is kept with its own chance: one over the chance for those under the teeth of a
/// comb of step 1 that starts at `shift` in [0, 1), in part for those beside them, 0 for others. Those of chance 1 and more are
/// kept as they are.
pub(super) fn comb(chances: &[f32], shift: f32) -> Vec<f32> {
    let mut factors = vec![1.0; chances.len()];
    let unsure: Vec<usize> = (0..chances.len()).filter(|&i| chances[i] < 1.0).collect();
    let mut start = -f64::from(shift);
    let mut below = unsure.first().map_or(0.0, |&i| f64::from(SOFTNESS * chances[i]));
    for (place, &index) in unsure.iter().enumerate() {
        let own = chances[index];
        let beside = unsure.get(place + 1).map_or(own, |&next| own.min(chances[next]));
        let (end, above) = (start + f64::from(own), f64::from(SOFTNESS * beside));
        // How far the teeth, which are whole numbers here, reach into it.
        let (mut kept, mut tooth) = (0.0, (start - below).ceil());
        while tooth < end + above {
            let into = ((tooth - start + below) / (2.0 * below)).min((end + above - tooth) / (2.0 * above));
            kept += into.min(1.0);
            tooth += 1.0;
        }
        factors[index] = if kept > 0.0 { (kept / f64::from(own)) as f32 } else { 0.0 };
        (start, below) = (end, above);
    }
    factors
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_factor_is_one() {
        let chances = [0.001, 0.1, 0.5, 0.93, 0.999, 1.0, 0.3, 3.0, 0.0002, 0.2];
        let steps = 100_000;
        let mut sums = [0.0_f64; 10];
        for i in 0..steps {
            let factors = comb(&chances, (i as f32 + 0.5) / steps as f32);
            sums.iter_mut().zip(factors).for_each(|(sum, factor)| *sum += f64::from(factor));
        }
        for (chance, sum) in chances.iter().zip(sums) {
            let mean = sum / f64::from(steps);
            // As near as so many steps tell of those that few of them meet.
            assert!((mean - 1.0).abs() < 1e-3 + 1e-5 / f64::from(*chance), "{chance}: {mean}");
        }
    }

    #[test]
    fn what_a_comb_keeps_sums_up_to_all() {
        let chances: Vec<f32> = (0..400_u32).map(|i| 0.02 + 0.001 * (i * 37 % 211) as f32).collect();
        let total: f32 = chances.iter().sum();
        for shift in [0.0, 0.2, 0.77, 0.999] {
            let factors = comb(&chances, shift);
            let sum: f32 = factors.iter().zip(&chances).map(|(factor, chance)| factor * chance).sum();
            assert!((sum - total).abs() <= 1.0, "{sum} of {total}");
            let kept = factors.iter().filter(|&&factor| factor > 0.0).count() as f32;
            assert!(kept < 1.2 * total, "{kept} of {total}");
        }
    }

    #[test]
    fn a_small_change_of_chances_changes_little() {
        let chances: Vec<f32> = (0..100_u32).map(|i| 0.1 + 0.001 * (i * 37 % 211) as f32).collect();
        let mut before = comb(&chances, 0.4);
        for step in 1..200 {
            let moved: Vec<f32> =
                (0..).zip(&chances).map(|(i, c)| c * (1.0 + 1e-6 * (i * step) as f32)).collect();
            let factors = comb(&moved, 0.4);
            let change = before.iter().zip(&factors).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(change < 2.0, "{change}");
            before = factors;
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

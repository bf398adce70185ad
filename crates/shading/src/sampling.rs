//! Warps of the unit square and discrete distributions.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use crate::lanes::{Real, Vector, cos_sin_turns};

/// The largest float below one.
pub(crate) const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// Uniform point of the unit disk by the concentric map.
///
/// # References
/// Shirley, Chiu, "A Low Distortion Map Between Disk and Square", 1997.
pub fn concentric_disk(u: Vec2) -> Vec2 {
    disk_lanes(u.to_array()).into()
}

/// [`concentric_disk`] on lanes.
#[inline(always)]
pub(crate) fn disk_lanes<F: Real>(u: [F; 2]) -> [F; 2] {
    let [x, y] = [u[0] * 2.0 - 1.0, u[1] * 2.0 - 1.0];
    let wide = x.abs().gt(y.abs());
    let (r, other) = (x.where_or(wide, y), y.where_or(wide, x));
    // An eighth of a turn on either side of the axis.
    let off = (other / r * 0.125).only(!r.equals(r.splat(0.0)));
    let (cos, sin) = cos_sin_turns(off.where_or(wide, off.splat(0.25) - off));
    [r * cos, r * sin]
}

/// Cosine-distributed direction around +Z; pdf = z / π.
#[inline(always)]
pub fn cosine_hemisphere<F: Real>(u: [F; 2]) -> Vector<F> {
    let [x, y] = disk_lanes(u);
    Vector::new(x, y, (x * x + y * y).complement().positive().sqrt())
}

/// Uniform direction; pdf = 1 / 4π.
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let r = (1.0 - z * z).max(0.0).sqrt();
    (r * Vec2::from_angle(TAU * u.y)).extend(z)
}

/// Uniform barycentric coordinates (weights of the second and third vertex).
///
/// # References
/// Heitz, "A Low-Distortion Map Between Triangle and Square", 2019.
pub fn uniform_triangle(u: Vec2) -> Vec2 {
    if u.y > u.x {
        let x = 0.5 * u.x;
        Vec2::new(x, u.y - x)
    } else {
        let y = 0.5 * u.y;
        Vec2::new(u.x - y, y)
    }
}

/// A discrete distribution over `0..len`, sampled by inversion in constant time on average.
///
/// # References
/// Chen, Asau, "On Generating Random Variates from an Empirical Distribution", 1974 (guide tables).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Discrete {
    /// Cumulative probabilities, `cdf[i]` = P(index ≤ i); the last is 1.
    cdf: Vec<f32>,
    /// Of as many equal intervals of [0, 1): an index close to those that they lead to, where the search starts.
    guide: Vec<u32>,
    total: f32,
}

impl Discrete {
    /// In proportion to `weights`; weights that are not finite or not positive count as zero. When all are zero,
    /// all indices are equally likely.
    pub fn new(weights: impl IntoIterator<Item = f32>) -> Self {
        let mut sum = 0.0_f64;
        let mut sums: Vec<f64> = weights
            .into_iter()
            .map(|w| {
                sum += if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 };
                sum
            })
            .collect();
        let total = sum as f32;
        if sum <= 0.0 {
            sums.iter_mut().enumerate().for_each(|(i, s)| *s = (i + 1) as f64);
            sum = sums.len() as f64;
        }
        let mut cdf: Vec<f32> = sums.into_iter().map(|s| (s / sum) as f32).collect();
        if let Some(last) = cdf.last_mut() {
            *last = 1.0;
        }
        let intervals = cdf.len() as f32;
        let mut index = 0;
        let guide = (0..cdf.len()).map(|interval| {
            index += cdf[index..].iter().take_while(|&&c| c <= interval as f32 / intervals).count();
            index as u32
        });
        Self { guide: guide.collect(), cdf, total }
    }

    /// Number of indices.
    pub fn len(&self) -> usize {
        self.cdf.len()
    }

    /// Whether there is nothing to choose from.
    pub fn is_empty(&self) -> bool {
        self.cdf.is_empty()
    }

    /// Sum of the weights.
    pub fn total(&self) -> f32 {
        self.total
    }

    /// Probability of an index.
    pub fn probability(&self, index: usize) -> f32 {
        self.cdf[index] - if index == 0 { 0.0 } else { self.cdf[index - 1] }
    }

    /// The index at `u` in [0, 1), its probability, and `u` rescaled to [0, 1) within it. `None` when empty.
    pub fn sample(&self, u: f32) -> Option<(usize, f32, f32)> {
        let last = self.cdf.len().checked_sub(1)?;
        let mut index =
            self.guide[((u * self.cdf.len() as f32) as usize).min(last)].min(last as u32) as usize;
        // Rounding may have led into the interval after.
        while index > 0 && self.cdf[index - 1] > u {
            index -= 1;
        }
        while index < last && self.cdf[index] <= u {
            index += 1;
        }
        let below = if index == 0 { 0.0 } else { self.cdf[index - 1] };
        let probability = self.cdf[index] - below;
        let rest =
            if probability > 0.0 { ((u - below) / probability).clamp(0.0, ONE_MINUS_EPSILON) } else { 0.0 };
        Some((index, probability, rest))
    }
}

/// A piecewise constant distribution over the unit square, row by row.
#[derive(Clone, Debug)]
pub struct Discrete2d {
    rows: Discrete,
    columns: Vec<Discrete>,
}

impl Discrete2d {
    /// In proportion to `weights`, `width` per row.
    pub fn new(width: usize, weights: &[f32]) -> Self {
        let columns: Vec<_> =
            weights.chunks(width.max(1)).map(|row| Discrete::new(row.iter().copied())).collect();
        Self { rows: Discrete::new(columns.iter().map(Discrete::total)), columns }
    }

    /// A point of the unit square and its density there. `None` when empty.
    pub fn sample(&self, u: Vec2) -> Option<(Vec2, f32)> {
        let (y, p_y, v) = self.rows.sample(u.y)?;
        let (x, p_x, w) = self.columns[y].sample(u.x)?;
        let (width, height) = (self.columns[y].len() as f32, self.columns.len() as f32);
        Some((Vec2::new((x as f32 + w) / width, (y as f32 + v) / height), p_x * p_y * width * height))
    }

    /// Density at a point of the unit square.
    pub fn pdf(&self, p: Vec2) -> f32 {
        let y = ((p.y * self.columns.len() as f32) as usize).min(self.columns.len() - 1);
        let row = &self.columns[y];
        let x = ((p.x * row.len() as f32) as usize).min(row.len() - 1);
        row.probability(x) * self.rows.probability(y) * (row.len() * self.columns.len()) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> impl Iterator<Item = Vec2> {
        (0..n * n).map(move |i| (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32)
    }

    #[test]
    fn warps_have_their_first_moments() {
        let n = 256;
        let count = (n * n) as f32;
        let mean_z: f32 = grid(n).map(|u| cosine_hemisphere(u.to_array()).z).sum::<f32>() / count;
        // The square root at the horizon limits midpoints on this grid to about 1e-4.
        assert!((mean_z - 2.0 / 3.0).abs() < 3e-4, "cosine hemisphere: E[z] = 2/3, got {mean_z}");
        let mean: Vec3 = grid(n).map(uniform_sphere).sum::<Vec3>() / count;
        assert!(mean.length() < 1e-4, "uniform sphere: E[ω] = 0, got {mean}");
        let mean: Vec2 = grid(n).map(uniform_triangle).sum::<Vec2>() / count;
        assert!((mean - Vec2::splat(1.0 / 3.0)).length() < 1e-3, "triangle: E[b] = 1/3, got {mean}");
    }

    #[test]
    fn discrete_inverts_its_probabilities() {
        let d = Discrete::new([1.0, 0.0, 3.0, f32::NAN, -1.0]);
        assert_eq!(d.total(), 4.0);
        assert_eq!(d.sample(0.1).map(|s| (s.0, s.1)), Some((0, 0.25)));
        assert_eq!(d.sample(0.25).map(|s| (s.0, s.1, s.2)), Some((2, 0.75, 0.0)));
        assert_eq!(d.sample(ONE_MINUS_EPSILON).map(|s| s.0), Some(2));
        assert_eq!(Discrete::new([]).sample(0.5), None);
        assert_eq!(Discrete::new([0.0, 0.0]).sample(0.7).map(|s| (s.0, s.1)), Some((1, 0.5)));
    }

    #[test]
    fn guides_lead_where_a_search_does() {
        let weights = |i: u32| if i % 7 == 3 { 50.0 } else { (i % 3) as f32 * 0.01 };
        for len in [1, 2, 10, 1000] {
            let d = Discrete::new((0..len).map(weights));
            for i in 0..5000 {
                let u = (i as f32 / 5000.0).min(ONE_MINUS_EPSILON);
                let searched = d.cdf.partition_point(|&c| c <= u).min(len as usize - 1);
                assert_eq!(d.sample(u).map(|s| s.0), Some(searched), "{u} of {len}");
            }
        }
    }

    #[test]
    fn discrete_2d_pdf_matches_its_samples() {
        let d = Discrete2d::new(3, &[1.0, 2.0, 0.0, 0.0, 5.0, 1.0]);
        for u in grid(37) {
            let (p, pdf) = d.sample(u).expect("not empty");
            assert!((d.pdf(p) - pdf).abs() < 1e-4 * pdf, "{p}: {} against {pdf}", d.pdf(p));
        }
    }
}

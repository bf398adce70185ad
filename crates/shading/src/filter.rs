//! Reconstruction filters by importance sampling.
//!
//! # References
//! Ernst, Stamminger, Greiner, "Filter Importance Sampling", 2006.

use std::f32::consts::TAU;

use glam::Vec2;
use heliostat_scene::Filter;

/// Intervals of the tabulated inverse cumulative distribution.
const INTERVALS: usize = 512;

/// A separable, non-negative filter made ready for sampling.
#[derive(Clone, Debug)]
pub struct PixelFilter {
    /// Offsets at evenly spaced cumulative probabilities; empty for the box.
    inverse: Vec<f32>,
}

impl PixelFilter {
    /// Tabulates the inverse of the filter's cumulative distribution.
    pub fn new(filter: Filter) -> Self {
        let (radius, shape): (f32, Box<dyn Fn(f32) -> f32>) = match filter {
            Filter::Box => return Self { inverse: Vec::new() },
            Filter::Tent => (1.0, Box::new(|x: f32| 1.0 - x.abs())),
            Filter::Gaussian(sigma) => {
                let sigma = sigma.max(1e-3);
                (3.0 * sigma, Box::new(move |x: f32| (-0.5 * (x / sigma).powi(2)).exp()))
            }
            Filter::BlackmanHarris => (
                2.0,
                Box::new(|x: f32| {
                    // Harris 1978, the minimum 4-term window, over [−2, 2].
                    let phase = TAU * (x + 2.0) / 4.0;
                    0.35875 - 0.48829 * phase.cos() + 0.14128 * (2.0 * phase).cos()
                        - 0.01168 * (3.0 * phase).cos()
                }),
            ),
        };
        let steps = 8 * INTERVALS;
        let at = |i: usize| radius * (2.0 * (i as f32 + 0.5) / steps as f32 - 1.0);
        let total: f64 = (0..steps).map(|i| f64::from(shape(at(i)))).sum();
        let mut inverse = vec![-radius];
        let mut sum = 0.0;
        for i in 0..steps {
            sum += f64::from(shape(at(i))) / total;
            while inverse.len() < INTERVALS && sum * INTERVALS as f64 >= inverse.len() as f64 {
                inverse.push(at(i));
            }
        }
        inverse.resize(INTERVALS + 1, radius);
        Self { inverse }
    }

    /// Offset from the pixel's centre, in pixels, for a point of the unit square.
    pub fn sample(&self, u: Vec2) -> Vec2 {
        if self.inverse.is_empty() {
            return u - 0.5;
        }
        let axis = |u: f32| {
            let at = u * INTERVALS as f32;
            let index = (at as usize).min(INTERVALS - 1);
            let (low, high) = (self.inverse[index], self.inverse[index + 1]);
            low + (high - low) * (at - index as f32)
        };
        Vec2::new(axis(u.x), axis(u.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_have_the_filters_mean_and_variance() {
        // Variances: box 1/12, tent 1/6, normal σ² (cut at 3σ: 0.973 σ²).
        let cases =
            [(Filter::Box, 1.0 / 12.0), (Filter::Tent, 1.0 / 6.0), (Filter::Gaussian(0.5), 0.25 * 0.9733)];
        for (filter, variance) in cases {
            let sampled = PixelFilter::new(filter);
            let n = 4096;
            let offsets = (0..n).map(|i| sampled.sample(Vec2::splat((i as f32 + 0.5) / n as f32)).x);
            let mean = offsets.clone().sum::<f32>() / n as f32;
            let second = offsets.map(|x| x * x).sum::<f32>() / n as f32;
            assert!(mean.abs() < 1e-3, "{filter:?}: {mean}");
            assert!((second - variance).abs() < 0.01 * variance, "{filter:?}: {second} against {variance}");
        }
        let wide = PixelFilter::new(Filter::BlackmanHarris);
        assert!(wide.sample(Vec2::ZERO).x >= -2.0 && wide.sample(Vec2::ONE).x <= 2.0);
    }
}

//! Several samples of a pixel in one pass, which share the virtual point lights of its set.
//!
//! Each sample is lit by a part of the set: as many shadow rays as for a single one. What samples that see the same surface
//! receive is averaged, as are the surface's colours, so that most pixels go on as if they had one sample lit by the whole
//! set. Where a pixel sees several surfaces the one that fills most of it goes on, and the others, its fragments, take the
//! light of neighbours that see more of them.
//!
//! # References
//! Benthin, Wald, Slusallek, "A Scalable Approach to Interactive Global Illumination", 2003 (samples of a pixel share virtual
//! point lights). Carpenter, "The A-buffer, an Antialiased Hidden Surface Method", 1984 (fragments of pixels). Larcher,
//! Pillichshammer, "Walsh Series Analysis of the L2-Discrepancy of Symmetrisized Point Sets", 2001 (the places).

use glam::{Vec2, Vec3};

use super::Gathered;
use super::discontinuity::{Light, PLANE_DISTANCE, is_alike};
use crate::region::{Adds, Sample, aligned_point};

/// A surface in a pixel that another one fills more of.
#[derive(Clone, Copy, Debug)]
pub struct Fragment {
    /// Index of the pixel among those that were rendered together.
    pub pixel: u32,
    pub(super) point: Gathered,
}

impl Fragment {
    /// The same among other pixels.
    pub fn at(self, pixel: u32) -> Self {
        Self { pixel, ..self }
    }

    /// Radiance that it adds to its pixel, by the light of a neighbour that sees the same surface, or else its own.
    pub(super) fn color(&self, light: Option<Light>) -> Vec3 {
        let point = &self.point;
        let own = || Light { irradiance: point.irradiance, gloss: point.gloss + point.scattered };
        point.coverage * light.unwrap_or_else(own).reflected(point.albedo)
    }
}

/// One of `count` samples of a pass, a power of two: evenly over all pixels, elsewhere in every pass.
pub(super) fn sample(pass: u32, index: u32, count: u32, adds: Adds) -> Sample {
    let number = pass.wrapping_mul(count).wrapping_add(index);
    if count == 1 {
        return Sample::new(number, adds);
    }
    let (mut rest, mut direction, mut y) = (index, count / 2, 0);
    while rest > 0 {
        if rest & 1 == 1 {
            y ^= direction;
        }
        rest >>= 1;
        direction |= direction >> 1;
    }
    let place = (Vec2::new(index as f32, y as f32) + 0.5) / count as f32;
    let place = (place + aligned_point(pass) - 0.5).rem_euclid(Vec2::ONE);
    Sample { number, place: place.min(Vec2::splat(1.0 - f32::EPSILON)), adds }
}

/// Brings the samples of pixels together, one sample of all of them after the other.
pub(super) struct Fold {
    eye: Vec3,
    /// Of a pixel, for each sample.
    share: f32,
    /// The first surface that each pixel has seen.
    pixels: Vec<Gathered>,
    /// Others.
    fragments: Vec<Fragment>,
    /// The last fragment of each pixel and the one before each fragment, counted from 1; 0 for none.
    last: Vec<u32>,
    before: Vec<u32>,
}

impl Fold {
    pub(super) fn new(pixels: usize, samples: u32, eye: Vec3) -> Self {
        Self {
            eye,
            share: 1.0 / samples as f32,
            pixels: vec![Gathered::default(); pixels],
            fragments: Vec::new(),
            last: vec![0; pixels],
            before: Vec::new(),
        }
    }

    /// Adds a sample of all pixels, and leaves nothing of it where it was.
    pub(super) fn add(&mut self, samples: &mut [Gathered]) {
        for (pixel, sample) in (0..).zip(samples) {
            self.add_to(pixel, std::mem::take(sample));
        }
    }

    fn add_to(&mut self, pixel: u32, sample: Gathered) {
        let share = self.share;
        let whole = &mut self.pixels[pixel as usize];
        whole.emitted += share * sample.emitted;
        whole.other += share * sample.other;
        if sample.strength == 0.0 {
            whole.other += share * sample.scattered;
            return;
        }
        let sample = Gathered { emitted: Vec3::ZERO, other: Vec3::ZERO, coverage: share, ..sample };
        if whole.strength == 0.0 {
            *whole = Gathered { emitted: whole.emitted, other: whole.other, ..sample };
            return;
        }
        let scale = PLANE_DISTANCE * sample.position.distance(self.eye);
        if is_alike(whole, &sample, scale) {
            whole.blend(&sample);
            return;
        }
        let mut next = self.last[pixel as usize];
        while next > 0 {
            let fragment = &mut self.fragments[next as usize - 1].point;
            if is_alike(fragment, &sample, scale) {
                fragment.blend(&sample);
                return;
            }
            next = self.before[next as usize - 1];
        }
        self.fragments.push(Fragment { pixel, point: sample });
        self.before.push(self.last[pixel as usize]);
        self.last[pixel as usize] = self.fragments.len() as u32;
    }

    /// What each pixel receives at the surface that fills most of it, and the fragments pixel by pixel.
    pub(super) fn finish(mut self) -> (Vec<Gathered>, Vec<Fragment>) {
        for Fragment { pixel, point } in &mut self.fragments {
            let whole = &mut self.pixels[*pixel as usize];
            if point.coverage > whole.coverage {
                std::mem::swap(whole, point);
                std::mem::swap(&mut whole.emitted, &mut point.emitted);
                std::mem::swap(&mut whole.other, &mut point.other);
            }
        }
        self.fragments.sort_by_key(|fragment| fragment.pixel);
        (self.pixels, self.fragments)
    }
}

impl Gathered {
    /// Becomes the mean of itself and what else its pixel sees of the same surface.
    fn blend(&mut self, other: &Self) {
        self.coverage += other.coverage;
        let share = other.coverage / self.coverage;
        let blend = |mean: &mut Vec3, other: Vec3| *mean += (other - *mean) * share;
        blend(&mut self.scattered, other.scattered);
        blend(&mut self.irradiance, other.irradiance);
        blend(&mut self.albedo, other.albedo);
        blend(&mut self.gloss, other.gloss);
        blend(&mut self.position, other.position);
        self.strength += (other.strength - self.strength) * share;
        if self.normal != other.normal {
            blend(&mut self.normal, other.normal);
            self.normal = self.normal.normalize_or(other.normal);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_lie_evenly_around_the_centre() {
        for count in [2, 4, 8, 16] {
            let places: Vec<Vec2> = (0..count).map(|i| sample(0, i, count, Adds::Light).place).collect();
            let mean = places.iter().sum::<Vec2>() / count as f32;
            assert!(mean.abs_diff_eq(Vec2::splat(0.5), 1e-6), "{count}: {mean}");
            // One in every column and one in every row of a grid.
            for axis in [0, 1] {
                let strips =
                    places.iter().fold(0_u32, |seen, place| seen | 1 << (place[axis] * count as f32) as u32);
                assert_eq!(strips, (1 << count) - 1, "{places:?}");
            }
            let later = (0..count).map(|i| sample(5, i, count, Adds::Light));
            assert!(
                later.into_iter().all(|s| s.place.cmpge(Vec2::ZERO).all() && s.place.cmplt(Vec2::ONE).all())
            );
        }
    }

    #[test]
    fn the_surface_that_fills_most_goes_on() {
        let seen = |strength: f32, z: f32, irradiance: f32| Gathered {
            irradiance: Vec3::splat(irradiance),
            albedo: Vec3::ONE,
            position: Vec3::Z * z,
            normal: Vec3::Z,
            strength,
            straight: true,
            other: Vec3::X,
            ..Gathered::default()
        };
        let mut fold = Fold::new(1, 4, Vec3::Z * 10.0);
        for sample in [seen(1.0, 0.0, 8.0), seen(1.0, 1.0, 1.0), seen(1.0, 1.0, 3.0), seen(0.0, 0.0, 0.0)] {
            fold.add(&mut [sample]);
        }
        let (pixels, fragments) = fold.finish();
        assert_eq!((pixels[0].irradiance, pixels[0].coverage), (Vec3::splat(2.0), 0.5));
        assert_eq!(pixels[0].other, Vec3::X);
        assert_eq!(fragments.len(), 1);
        assert_eq!(fragments[0].color(None), Vec3::splat(0.25 * 8.0));
    }
}

//! Sample points: Owen-scrambled Sobol sequences, a pure function of pixel, frame, seed, sample and dimension.

use glam::Vec2;

use crate::lanes::Whole;

/// Samples the sequence offers before it continues with a fresh scramble.
const SEQUENCE_LENGTH: u32 = 1 << 16;
/// Sets of four dimensions that the sequence has.
const SETS: u32 = 64;

/// The sample points of one sample of one pixel.
///
/// Dimensions come in sets of four; a use (camera, first bounce, first light, …) owns its sets by number, so that
/// stratification is kept whatever happens along a path.
///
/// # References
/// Burley, "Practical Hash-based Owen Scrambling", 2020.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampler {
    seed: u32,
    sample: u32,
}

impl Sampler {
    /// For one sample of pixel (x, y).
    pub fn new(x: u32, y: u32, frame: u32, seed: u32, sample: u32) -> Self {
        let scramble = sample / SEQUENCE_LENGTH;
        let seed = [y, frame, seed, scramble].into_iter().fold(hash(x), |h, value| hash(h ^ hash(value)));
        Self { seed, sample: sample % SEQUENCE_LENGTH }
    }

    /// Four numbers in [0, 1). Sets beyond the sequence's dimensions are hashed: random, but still reproducible.
    pub fn set(&self, set: u32) -> [f32; 4] {
        if set < SETS {
            return sobol_burley::sample_4d(self.sample, set, self.seed);
        }
        let key = hash(self.seed ^ hash(self.sample ^ hash(set)));
        std::array::from_fn(|i| unit_float(hash(key.wrapping_add(i as u32))))
    }

    /// A time in [0, 1) of the shutter interval, stratified over a pixel's samples by a scramble of its own.
    pub fn time(&self) -> f32 {
        sobol_burley::sample(self.sample, 0, hash(self.seed ^ 0x7469_6d65))
    }

    /// A number in [0, 1) outside the sequence, for decisions that are rare and need no stratification.
    pub fn random(&self, key: u32) -> f32 {
        unit_float(hash(self.seed ^ hash(self.sample ^ hash(key ^ 0x9e37_79b9))))
    }
}

/// The two halves of a set as points.
pub fn points(set: [f32; 4]) -> (Vec2, Vec2) {
    (Vec2::new(set[0], set[1]), Vec2::new(set[2], set[3]))
}

fn unit_float(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// See [`Whole::hashed`].
fn hash(x: u32) -> u32 {
    x.hashed()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deterministic_and_stratified() {
        let n = 256;
        let mut cells = [0; 16];
        for sample in 0..n {
            let sampler = Sampler::new(3, 5, 0, 7, sample);
            assert_eq!(sampler, Sampler::new(3, 5, 0, 7, sample));
            let (p, _) = points(sampler.set(2));
            cells[(p.x * 4.0) as usize + 4 * (p.y * 4.0) as usize] += 1;
        }
        assert!(
            cells.iter().all(|&c| c == 16),
            "a (0,2)-sequence fills every elementary interval: {cells:?}"
        );
    }

    #[test]
    fn every_input_changes_the_points() {
        let base = Sampler::new(1, 2, 3, 4, 5).set(0);
        let others = [(2, 2, 3, 4, 5), (1, 3, 3, 4, 5), (1, 2, 4, 4, 5), (1, 2, 3, 5, 5), (1, 2, 3, 4, 6)];
        for (x, y, frame, seed, sample) in others {
            assert_ne!(Sampler::new(x, y, frame, seed, sample).set(0), base);
        }
        assert_ne!(
            Sampler::new(1, 2, 3, 4, 5 + SEQUENCE_LENGTH).set(0),
            base,
            "the sequence does not repeat"
        );
        let beyond = Sampler::new(1, 2, 3, 4, 5).set(SETS + 9);
        assert!(beyond.iter().all(|v| (0.0..1.0).contains(v)));
    }
}

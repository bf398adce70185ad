//! Small deterministic random numbers and tileable noise, so that a scene is the same on every machine and run.

use glam::Vec2;

/// A SplitMix64 generator.
///
/// # References
/// Steele, Lea, Flood, "Fast Splittable Pseudorandom Number Generators", 2014.
pub(crate) struct Rng(u64);

impl Rng {
    /// Different seeds give unrelated sequences.
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Uniform in [low, high).
    pub(crate) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Uniform among 0 … count − 1.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f32) as usize).min(count.saturating_sub(1))
    }
}

fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A number in [0, 1) for each integer point.
pub(crate) fn hash(x: u32, y: u32, seed: u32) -> f32 {
    let key = u64::from(x) ^ (u64::from(y) << 24) ^ (u64::from(seed) << 48);
    (mix(key.wrapping_add(0x9e37_79b9_7f4a_7c15)) >> 40) as f32 / (1u64 << 24) as f32
}

/// Smooth value noise in [0, 1) that repeats every `period` in both directions.
pub(crate) fn noise(p: Vec2, period: u32, seed: u32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let s = f * f * (Vec2::splat(3.0) - 2.0 * f);
    let wrap = |v: f32| (v as i64).rem_euclid(i64::from(period)) as u32;
    let (x0, y0) = (wrap(cell.x), wrap(cell.y));
    let (x1, y1) = ((x0 + 1) % period, (y0 + 1) % period);
    let lerp = |a: f32, b: f32, t: f32| a + (b - a) * t;
    lerp(
        lerp(hash(x0, y0, seed), hash(x1, y0, seed), s.x),
        lerp(hash(x0, y1, seed), hash(x1, y1, seed), s.x),
        s.y,
    )
}

/// Sum of `octaves` of noise in [0, 1); the first repeats every `period`.
pub(crate) fn fbm(p: Vec2, period: u32, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 0.5, 0.0);
    for octave in 0..octaves {
        let scale = 1u32 << octave;
        sum += weight * noise(p * scale as f32, period * scale, seed + octave);
        total += weight;
        weight *= 0.5;
    }
    sum / total
}

//! Sample points: Owen-scrambled Sobol sequences, a pure function of pixel, frame, seed, sample and dimension.

use fearless_simd::{Level, Simd};
use glam::Vec2;

use crate::lanes::{Floats, Packet, Real, WIDTH, Whole, Wholes};
use crate::packet::on_lanes;
use crate::surface::LaneMode;

/// Samples the sequence offers before it continues with a fresh scramble.
const SEQUENCE_LENGTH: u32 = 1 << 16;
/// The set that times are taken from.
const TIME_SET: u32 = 0x7469_6d65;

/// The sample points of one sample of one pixel.
///
/// Dimensions come in sets of four; a use (camera, first bounce, first light, …) owns its sets by number, so that
/// stratification is kept whatever happens along a path. Every set is the four-dimensional Sobol sequence, shuffled and
/// scrambled by itself.
///
/// # References
/// Burley, "Practical Hash-based Owen Scrambling", 2020.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sampler {
    seed: u32,
    sample: u32,
}

impl Sampler {
    /// For one sample of pixel (x, y).
    pub fn new(x: u32, y: u32, frame: u32, seed: u32, sample: u32) -> Self {
        Samplers::new(frame, seed, sample).pixel(x, y)
    }

    /// For point `index` of a sequence that belongs to no pixel.
    pub fn along(index: u32, seed: u32) -> Self {
        let scramble = index / SEQUENCE_LENGTH;
        Self { seed: (seed.hashed() ^ scramble).hashed(), sample: index % SEQUENCE_LENGTH }
    }

    /// Four numbers in [0, 1).
    pub fn set(&self, set: u32) -> [f32; 4] {
        points::<f32>(self.seed, self.sample, set)
    }

    /// A time in [0, 1) of the shutter interval, stratified over a pixel's samples by a set of its own.
    pub fn time(&self) -> f32 {
        self.set(TIME_SET)[0]
    }

    /// A number in [0, 1) outside the sequence, for decisions that are rare and need no stratification.
    pub fn random(&self, key: u32) -> f32 {
        (self.seed ^ (self.sample ^ (key ^ 0x9e37_79b9).hashed()).hashed()).hashed().unit()
    }
}

/// What the samplers of one sample of all pixels have in common.
#[derive(Clone, Copy, Debug)]
pub struct Samplers {
    seed: u32,
    sample: u32,
}

impl Samplers {
    /// For one sample of every pixel.
    pub fn new(frame: u32, seed: u32, sample: u32) -> Self {
        let seed = ((frame.hashed() ^ seed).hashed() ^ (sample / SEQUENCE_LENGTH)).hashed();
        Self { seed, sample: sample % SEQUENCE_LENGTH }
    }

    /// The one of pixel (x, y).
    #[inline]
    pub fn pixel(&self, x: u32, y: u32) -> Sampler {
        Sampler { seed: ((self.seed ^ x).hashed() ^ y).hashed(), sample: self.sample }
    }
}

/// The two halves of a set as points.
pub fn halves(set: [f32; 4]) -> (Vec2, Vec2) {
    (Vec2::new(set[0], set[1]), Vec2::new(set[2], set[3]))
}

/// A set for each of sixteen samplers: the bits of [`Sampler::set`], many at once.
#[derive(Clone, Debug, Default)]
pub struct SamplePoints {
    seeds: Wholes,
    samples: Wholes,
    sets: Wholes,
    /// The numbers of the sets, filled by [`Self::draw`].
    pub u: [Floats; 4],
}

impl SamplePoints {
    /// Asks for a set of a sampler.
    pub fn ask(&mut self, lane: usize, sampler: &Sampler, set: u32) {
        (self.seeds.0[lane], self.samples.0[lane], self.sets.0[lane]) = (sampler.seed, sampler.sample, set);
    }

    /// Draws what the first `count` lanes were asked for.
    pub fn draw(&mut self, mode: LaneMode, count: usize) {
        on_lanes!(mode, count.min(WIDTH), |token, lane| draw::<_>(token, lane, self));
    }

    /// The numbers of one lane.
    pub fn get(&self, lane: usize) -> [f32; 4] {
        let [a, b, c, d] = &self.u;
        [a.0[lane], b.0[lane], c.0[lane], d.0[lane]]
    }
}

#[inline(always)]
fn draw<F: Real>(token: F::Token, lane: usize, points: &mut SamplePoints) {
    let seed = F::Whole::gather(token, lane, |lane| points.seeds.0[lane]);
    let sample = F::Whole::gather(token, lane, |lane| points.samples.0[lane]);
    let set = F::Whole::gather(token, lane, |lane| points.sets.0[lane]);
    let u = self::points::<F>(seed, sample, set);
    for (u, to) in u.into_iter().zip(&mut points.u) {
        u.store(to, lane);
    }
}

/// Point `sample` of the sequence of `set`.
#[inline(always)]
fn points<F: Real>(seed: F::Whole, sample: F::Whole, set: F::Whole) -> [F; 4] {
    let key = (seed ^ set.hashed()).hashed();
    // A nested scramble of the index shuffles the points and leaves every block of a power of two together. It works on
    // the reversed index, which is the first dimension: van der Corput's.
    let first = scrambled(sample.reversed(), key) & key.splat(0xffff_0000);
    let dimensions = [first, second(first), sum(first, &THIRD), sum(first, &FOURTH)];
    let (mut key, mut u) = (key, [first.unit(); 4]);
    for (x, u) in dimensions.into_iter().zip(&mut u) {
        key = key.plus(key.splat(0x9e37_79b9));
        *u = scrambled(x.reversed(), key.hashed()).reversed().unit();
    }
    u
}

/// A nested uniform scramble of reversed bits: each bit is flipped depending on those below it.
///
/// # References
/// Laine, Karras, "Stratified Sampling for Stochastic Transparency", 2011; constants by Vegdahl, "Building a Better LK
/// Hash", 2021.
#[inline(always)]
fn scrambled<W: Whole>(x: W, seed: W) -> W {
    let x = x ^ x.times(x.splat(0x3d20_adea));
    let x = x.plus(seed);
    let x = x.times(seed.right(16) | seed.splat(1));
    let x = x ^ x.times(x.splat(0x0552_6c56));
    x ^ x.times(x.splat(0x53a2_2864))
}

/// Sobol's second dimension from the first. Its matrix is Pascal's triangle modulo 2: bit by bit the sum over all
/// subsets of the position, which takes a step for each of the position's bits.
#[inline(always)]
fn second<W: Whole>(first: W) -> W {
    let mut x = first;
    for (distance, low) in
        [(16, 0x0000_ffff), (8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)]
    {
        x = x ^ (x & x.splat(low)).left(distance);
    }
    x
}

/// Another dimension from the first: the sum modulo 2 of the directions of the index's bits.
#[inline(always)]
fn sum<W: Whole>(first: W, directions: &[u32; 16]) -> W {
    let mut sum = first.splat(0);
    for (bit, &direction) in (0..).zip(directions) {
        sum = sum ^ first.splat(direction).only(first.has(1 << (31 - bit)));
    }
    sum
}

const THIRD: [u32; 16] = directions(2, 1, [1, 3, 0]);
const FOURTH: [u32; 16] = directions(3, 1, [1, 3, 1]);

/// The directions of a primitive polynomial of some degree with inner coefficients `a` and initial numbers `m`.
///
/// # References
/// Joe, Kuo, "Constructing Sobol Sequences with Better Two-Dimensional Projections", 2008, §2 and its table of
/// initial numbers.
const fn directions(degree: usize, a: u32, m: [u32; 3]) -> [u32; 16] {
    let mut v = [0; 16];
    let mut i = 0;
    while i < 16 {
        if i < degree {
            v[i] = m[i] << (31 - i);
        } else {
            v[i] = v[i - degree] ^ (v[i - degree] >> degree);
            let mut k = 1;
            while k < degree {
                if a >> (degree - 1 - k) & 1 == 1 {
                    v[i] ^= v[i - k];
                }
                k += 1;
            }
        }
        i += 1;
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;
    use heliostat_kernel::Isa;

    #[test]
    fn deterministic_and_stratified() {
        let n = 256;
        let (mut planes, mut lines) = ([[0; 16]; 2], [[0; 256]; 4]);
        for sample in 0..n {
            let sampler = Sampler::new(3, 5, 0, 7, sample);
            assert_eq!(sampler, Sampler::new(3, 5, 0, 7, sample));
            let set = sampler.set(2);
            let (p, q) = halves(set);
            planes[0][(p.x * 4.0) as usize + 4 * (p.y * 4.0) as usize] += 1;
            planes[1][(q.x * 4.0) as usize + 4 * (q.y * 4.0) as usize] += 1;
            for (line, u) in lines.iter_mut().zip(set) {
                line[(u * 256.0) as usize] += 1;
            }
        }
        assert!(planes.as_flattened().iter().all(|&c| c == 16), "even over coarse squares: {planes:?}");
        assert!(lines.as_flattened().iter().all(|&c| c == 1), "even along every axis: {lines:?}");
    }

    #[test]
    fn first_two_dimensions_fill_every_elementary_interval() {
        for exponent in 0..=8 {
            let mut cells = [0; 256];
            for sample in 256..512 {
                let [x, y, ..] = Sampler::new(1, 9, 3, 7, sample).set(5);
                let columns = 1 << exponent;
                cells[(x * columns as f32) as usize + columns * (y * (256 / columns) as f32) as usize] += 1;
            }
            assert!(cells.iter().all(|&c| c == 1), "{exponent}: {cells:?}");
        }
    }

    #[test]
    fn dimensions_are_sobols() {
        // The fifth point in the order of the Gray code, whose index is 6, as tables print it.
        let first = 6_u32.reverse_bits();
        let point = [first, second(first), sum(first, &THIRD), sum(first, &FOURTH)].map(Whole::unit);
        assert_eq!(point, [0.375, 0.375, 0.625, 0.875]);
    }

    #[test]
    fn every_input_changes_the_points() {
        let base = Sampler::new(1, 2, 3, 4, 5).set(0);
        let others = [(2, 2, 3, 4, 5), (1, 3, 3, 4, 5), (1, 2, 4, 4, 5), (1, 2, 3, 5, 5), (1, 2, 3, 4, 6)];
        for (x, y, frame, seed, sample) in others {
            assert_ne!(Sampler::new(x, y, frame, seed, sample).set(0), base);
        }
        let repeated = Sampler::new(1, 2, 3, 4, 5 + SEQUENCE_LENGTH).set(0);
        assert_ne!(repeated, base, "the sequence does not repeat");
        assert_ne!(Sampler::new(1, 2, 3, 4, 5).set(1), base);
    }

    #[test]
    fn lanes_draw_the_same_bits() {
        let mut points = SamplePoints::default();
        let sampler = |lane: usize| Sampler::new(lane as u32, 7, 1, 2, 1000 * lane as u32);
        let set = |lane: usize| (lane as u32) << (lane + 12) | lane as u32;
        for isa in Isa::available() {
            let mode = isa.level().map_or(LaneMode::Single, LaneMode::Packets);
            points.u = [Floats::ZERO; 4];
            for lane in 0..WIDTH {
                points.ask(lane, &sampler(lane), set(lane));
            }
            points.draw(mode, WIDTH);
            for lane in 0..WIDTH {
                assert_eq!(points.get(lane), sampler(lane).set(set(lane)), "{isa:?} {lane}");
            }
        }
    }
}

//! Noise against what it promises: range, mean, smoothness, derivatives, footprints, the same bits on all lanes.

use fearless_simd::{Level, Simd};
use glam::Vec3;
use heliostat_kernel::Isa;

use super::*;
use crate::lanes::{Floats, Packet, Vectors, WIDTH};
use crate::packet::on_lanes;
use crate::sampler::Sampler;
use crate::surface::LaneMode;

/// Points of a box of edge `size` around the origin.
fn places(n: u32, size: f32) -> impl Iterator<Item = Vec3> {
    (0..n).map(move |i| {
        let [x, y, z, _] = Sampler::along(i % (1 << 16), 7 + (i >> 16)).set(0);
        (Vec3::new(x, y, z) - 0.5) * size
    })
}

fn octaves(count: f32, width: f32) -> Octaves<f32> {
    Octaves { count, gain: 0.5, width, seed: 3 }
}

/// Smallest, largest value and mean over many places.
fn survey(f: impl Fn(Vector<f32>) -> f32) -> [f32; 3] {
    let (mut low, mut high, mut sum, n) = (f32::MAX, f32::MIN, 0.0, 1 << 18);
    for p in places(n, 300.0) {
        let value = f(p.into());
        low = low.min(value);
        high = high.max(value);
        sum += f64::from(value);
    }
    [low, high, (sum / f64::from(n)) as f32]
}

#[test]
fn ranges_are_used_and_kept_and_means_are_as_stated() {
    let noise = |p| gradient_noise(p, 1).value;
    let [low, high, mean] = survey(noise);
    assert!(low > -1.04 && low < -0.8 && high < 1.04 && high > 0.8, "{low} {high}");
    assert!(mean.abs() < 2e-3, "{mean}");
    let [_, _, mean] = survey(|p| noise(p).abs());
    assert!((mean - MEAN_MAGNITUDE).abs() < 2e-3, "{mean}");
    let [_, _, mean] = survey(|p| noise(p).abs().complement().squared());
    assert!((mean - MEAN_CREST).abs() < 2e-3, "{mean}");
    let [low, high, mean] = survey(|p| fbm(p, octaves(6.0, 0.0)));
    assert!(low > -1.0 && low < -0.5 && high < 1.0 && high > 0.5 && mean.abs() < 2e-3, "{low} {high} {mean}");
    for sum in [turbulence::<f32>, ridged::<f32>] {
        let [low, high, _] = survey(|p| sum(p, octaves(6.0, 0.0)));
        assert!(low >= 0.0 && high <= 1.0, "{low} {high}");
    }
    // The nearest of one point to a cell lies 0.55 away on average (Worley), never farther than a cell's diagonal.
    let [low, high, mean] = survey(|p| cells(p, 1).nearest);
    assert!(low < 0.05 && high < 1.5 && (mean - 0.52).abs() < 0.04, "{low} {high} {mean}");
}

#[test]
fn derivatives_are_those_of_the_value() {
    const STEP: f32 = 2e-3;
    for p in places(2000, 20.0) {
        let gradient = Vec3::from(gradient_noise(p.into(), 5).gradient);
        for (axis, slope) in Vec3::AXES.into_iter().zip(gradient.to_array()) {
            let value = |t: f32| gradient_noise((p + t * axis).into(), 5).value;
            let difference = (value(STEP) - value(-STEP)) / (2.0 * STEP);
            assert!((difference - slope).abs() < 2e-3, "{p} {axis}: {difference} against {slope}");
        }
    }
}

#[test]
fn everything_is_continuous() {
    const STEP: f32 = 1e-3;
    type Field = fn(Vector<f32>) -> f32;
    let fields: [(&str, Field); 5] = [
        ("gradient noise", |p| gradient_noise(p, 2).value),
        ("fbm", |p| fbm(p, octaves(4.0, 0.0))),
        ("turbulence", |p| turbulence(p, octaves(4.0, 0.0))),
        ("ridged", |p| ridged(p, octaves(4.0, 0.0))),
        ("nearest", |p| cells(p, 2).nearest),
    ];
    for (name, field) in fields {
        // Across cell borders in particular.
        for p in places(4000, 12.0) {
            let p = Vec3::new(p.x.round() - 0.5 * STEP, p.y, p.z);
            let difference = (field(p.into()) - field((p + STEP * Vec3::X).into())).abs();
            assert!(difference < 8.0 * STEP, "{name} jumps by {difference} at {p}");
        }
    }
}

/// No direction and no place relative to the lattice stands out in a sum of octaves.
#[test]
fn sums_have_no_grain() {
    let correlation = |offset: Vec3| -> f32 {
        let (mut product, mut square) = (0.0, 0.0);
        for p in places(1 << 15, 500.0) {
            let a = fbm(p.into(), octaves(5.0, 0.0));
            product += a * fbm((p + offset).into(), octaves(5.0, 0.0));
            square += a * a;
        }
        product / square
    };
    let diagonal = Vec3::ONE.normalize();
    for distance in [0.25, 0.5] {
        let along = Vec3::AXES.map(|axis| correlation(distance * axis));
        let across = correlation(distance * diagonal);
        for value in along {
            assert!((value - across).abs() < 0.12, "at {distance}: {along:?} along axes, {across} across");
        }
    }
    // All octaves of plain noise vanish at the origin's lattice points: those of a sum must not.
    let largest = |p: Vec3| fbm(p.into(), Octaves { seed: 9, ..octaves(6.0, 0.0) }).abs();
    let sum: f32 = (0..64).map(|i| largest(Vec3::new((i % 8) as f32, (i / 8) as f32, 0.0))).sum();
    assert!(sum / 64.0 > 0.02);
}

#[test]
fn octaves_finer_than_the_footprint_fade_to_their_mean() {
    for sum in [fbm::<f32>, turbulence::<f32>, ridged::<f32>] {
        let spread = |width: f32| {
            let [low, high, _] = survey_few(|p| sum(p, octaves(6.0, width)));
            high - low
        };
        let widths = [0.0, 0.05, 0.1, 0.2, 0.3, 0.5];
        for pair in widths.windows(2) {
            assert!(spread(pair[1]) <= spread(pair[0]) + 0.02);
        }
        assert!(spread(0.5) < 1e-6);
        // The mean stays where it was.
        let mean = |width| survey_few(|p| sum(p, octaves(6.0, width)))[2];
        assert!((mean(0.0) - mean(0.6)).abs() < 0.01, "{} {}", mean(0.0), mean(0.6));
    }
    // What two samples per wavelength cannot show is gone: an octave of wavelength 1 at a width of one half.
    assert_eq!(fbm(Vector::new(0.3, 0.4, 0.2), octaves(1.0, 0.5)), 0.0);
}

fn survey_few(f: impl Fn(Vector<f32>) -> f32) -> [f32; 3] {
    let values: Vec<f32> = places(1 << 13, 100.0).map(|p| f(p.into())).collect();
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    [values.iter().copied().fold(f32::MAX, f32::min), values.iter().copied().fold(f32::MIN, f32::max), mean]
}

#[test]
fn steps_are_averages() {
    assert_eq!(linear_step(1.0, 3.0, 2.0_f32), 0.5);
    assert_eq!(smooth_step(1.0, 3.0, 0.0_f32), 0.0);
    assert_eq!(smooth_step(1.0, 3.0, 9.0_f32), 1.0);
    assert_eq!(filtered_step(0.5_f32, 0.5, 0.1), 0.5);
    assert_eq!(filtered_step(0.5_f32, 0.6, 0.0), 1.0);
    for x in [-3.7_f32, -0.2, 0.1, 0.85, 2.5, 100.3] {
        for width in [0.02_f32, 0.4, 3.0] {
            let n = 20_000;
            let inside = |i: i32| {
                let at = x + width * ((i as f32 + 0.5) / n as f32 - 0.5);
                if at - at.floor() < 0.7 { 1.0 } else { 0.0 }
            };
            let mean = (0..n).map(inside).sum::<f32>() / n as f32;
            let filtered = filtered_pulses(x, 0.7, width);
            assert!((filtered - mean).abs() < 2e-3, "{x} over {width}: {filtered} against {mean}");
        }
    }
}

/// Everything at once, so that one comparison of bits covers all.
#[inline(always)]
fn everything<F: Real>(token: F::Token, lane: usize, at: &Vectors, out: &mut [Floats; 8]) {
    let p = Vector::<F>::load(token, at, lane);
    let octaves = Octaves {
        count: F::constant(token, 5.5),
        gain: F::constant(token, 0.6),
        width: p.x.abs() * 0.01,
        seed: 11,
    };
    let noise = gradient_noise(p, 4);
    let cells = cells(p, 6);
    let [value, x, sum, crests, billows, nearest, second, id] = out;
    noise.value.store(value, lane);
    noise.gradient.x.store(x, lane);
    fbm(p, octaves).store(sum, lane);
    ridged(p, octaves).store(crests, lane);
    turbulence(p, octaves).store(billows, lane);
    cells.nearest.store(nearest, lane);
    cells.second.store(second, lane);
    (cells.id.unit() + cell_hash(p, 8).unit() + filtered_pulses(p.x, p.y.clamp(0.0, 1.0), p.z.abs()))
        .store(id, lane);
}

#[test]
fn lanes_agree_with_single_values_on_every_instruction_set() {
    let edges = [0.0, -0.0, 1.0, -1.0, 1e-30, 4e6, -5e9, 1e38, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
    let edges = edges.map(Vec3::splat);
    let all: Vec<Vec3> = places(1600, 40.0).chain(edges).collect();
    for isa in Isa::available() {
        for chunk in all.chunks(WIDTH) {
            let mut at = Vectors::default();
            for (lane, &p) in chunk.iter().enumerate() {
                at.set(lane, p);
            }
            let [lanes, single] = [isa.level().map_or(LaneMode::Single, LaneMode::Packets), LaneMode::Single]
                .map(|mode| {
                    let mut out = [Floats::ZERO; 8];
                    on_lanes!(mode, WIDTH, |token, lane| everything::<_>(token, lane, &at, &mut out));
                    out.map(|floats| floats.0.map(f32::to_bits))
                });
            assert_eq!(lanes, single, "{isa} at {chunk:?}");
            assert!(single.iter().flatten().all(|&bits| f32::from_bits(bits).is_finite()), "{chunk:?}");
        }
    }
}

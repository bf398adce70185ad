//! FLIP: the difference between two pictures as an observer sees it when flipping between them.
//!
//! # References
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, "FLIP: A Difference Evaluator for Alternating
//! Images", 2020 (LDR-FLIP; symbols and section numbers below are the paper's).

use std::f32::consts::PI;

use glam::{Mat3, Vec2, Vec3};

/// Pixels per degree of visual angle: a 0.7 m wide display of 3840 pixels seen from 0.7 m.
const PIXELS_PER_DEGREE: f32 = 3840.0 * PI / 180.0;
/// Exponent of the colour difference, and the point at which it is compressed (section 4.1.3).
const QC: f32 = 0.7;
const PC: f32 = 0.4;
const PT: f32 = 0.95;
/// Exponent of the feature difference, and the width of a feature in degrees (section 4.2).
const QF: f32 = 0.5;
const FEATURE_WIDTH: f32 = 0.082;

/// Mean FLIP error between two pictures of linear Rec. 709 colours from 0 to 1 as a display shows them; rows have
/// `width` pixels. 0 is the same, 1 the largest difference. Both pictures must have the same number of pixels.
pub fn flip(width: usize, test: &[Vec3], reference: &[Vec3]) -> f64 {
    let seen = [test, reference].map(|picture| Seen::new(width, picture));
    let largest = hyab(hunt(lab(Vec3::Y)), hunt(lab(Vec3::Z))).powf(QC);
    let total: f64 = (0..test.len().min(reference.len()))
        .map(|i| {
            let color = redistribute(hyab(seen[0].lab[i], seen[1].lab[i]).powf(QC), largest);
            let difference = |f: fn(&Seen) -> &Vec<f32>| (f(&seen[0])[i] - f(&seen[1])[i]).abs();
            let feature = difference(|s| &s.edges).max(difference(|s| &s.points));
            let feature = (feature / 2.0f32.sqrt()).powf(QF);
            f64::from(color.powf(1.0 - feature))
        })
        .sum();
    total / test.len().max(1) as f64
}

/// One picture as it reaches the comparison.
struct Seen {
    /// Blurred as by the eye, in L*a*b* with the Hunt effect.
    lab: Vec<Vec3>,
    /// Strength of edges and points in the achromatic channel.
    edges: Vec<f32>,
    points: Vec<f32>,
}

impl Seen {
    fn new(width: usize, picture: &[Vec3]) -> Self {
        let opponent: Vec<Vec3> = picture.iter().map(|&c| ycxcz(c)).collect();
        let channel = |f: fn(Vec3) -> f32| opponent.iter().map(|&c| f(c)).collect::<Vec<f32>>();
        let (y, cx, cz) = (channel(|c| c.x), channel(|c| c.y), channel(|c| c.z));

        // Contrast sensitivity of the three channels (table 1) as sums of Gaussians a √(π/b) exp(−π² d² / b).
        let filtered = [
            contrast_filter(width, &y, &[(1.0, 0.0047)]),
            contrast_filter(width, &cx, &[(1.0, 0.0053)]),
            contrast_filter(width, &cz, &[(34.1, 0.04), (13.5, 0.025)]),
        ];
        let lab = (0..picture.len())
            .map(|i| Vec3::new(filtered[0][i], filtered[1][i], filtered[2][i]))
            .map(|c| hunt(lab(from_ycxcz(c).clamp(Vec3::ZERO, Vec3::ONE))))
            .collect();

        let grey: Vec<f32> = y.iter().map(|y| (y + 16.0) / 116.0).collect();
        let sigma = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
        let smooth = kernel(sigma, |_| 1.0);
        // Positive and negative weights each sum to one.
        let normalise = |mut weights: Vec<f32>| {
            let positive: f32 = weights.iter().filter(|w| **w > 0.0).sum();
            let negative: f32 = -weights.iter().filter(|w| **w < 0.0).sum::<f32>();
            weights.iter_mut().for_each(|w| *w /= if *w > 0.0 { positive } else { negative });
            weights
        };
        let first = normalise(kernel(sigma, |x| -x));
        let second = normalise(kernel(sigma, |x| x * x / (sigma * sigma) - 1.0));
        let smooth: Vec<f32> = smooth.iter().map(|w| w / smooth.iter().sum::<f32>()).collect();
        let strength = |derivative: &[f32]| {
            let dx = convolve(width, &grey, derivative, &smooth);
            let dy = convolve(width, &grey, &smooth, derivative);
            dx.into_iter().zip(dy).map(|(x, y)| Vec2::new(x, y).length()).collect()
        };
        Self { lab, edges: strength(&first), points: strength(&second) }
    }
}

/// Weights `shape(x) exp(−x² / 2σ²)` for x from −3σ to 3σ, rounded outwards.
fn kernel(sigma: f32, shape: impl Fn(f32) -> f32) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as i32;
    let weight = |x: f32| shape(x) * (-x * x / (2.0 * sigma * sigma)).exp();
    (-reach..=reach).map(|x| weight(x as f32)).collect()
}

/// The channel filtered by a sum of two-dimensional Gaussians (a, b), normalised.
fn contrast_filter(width: usize, channel: &[f32], gaussians: &[(f32, f32)]) -> Vec<f32> {
    // All channels share the reach of the widest Gaussian.
    let reach = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let mut sum = vec![0.0; channel.len()];
    let mut total = 0.0;
    for &(a, b) in gaussians {
        let weight = |x: i32| (-(PI * x as f32 / PIXELS_PER_DEGREE).powi(2) / b).exp();
        let kernel: Vec<f32> = (-reach..=reach).map(weight).collect();
        let scale = a * (PI / b).sqrt();
        total += scale * kernel.iter().sum::<f32>().powi(2);
        let part = convolve(width, channel, &kernel, &kernel);
        sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += scale * part);
    }
    sum.iter_mut().for_each(|v| *v /= total);
    sum
}

/// Correlation with the separable kernel `along_x · along_y`; the border pixels continue outwards.
fn convolve(width: usize, channel: &[f32], along_x: &[f32], along_y: &[f32]) -> Vec<f32> {
    let height = channel.len() / width.max(1);
    let tap = |i: usize, k: usize, kernel: &[f32], count: usize| {
        (i + k).saturating_sub(kernel.len() / 2).min(count - 1)
    };
    let mut rows = vec![0.0; channel.len()];
    for y in 0..height {
        let row = &channel[y * width..][..width];
        for x in 0..width {
            rows[y * width + x] =
                along_x.iter().enumerate().map(|(k, w)| w * row[tap(x, k, along_x, width)]).sum();
        }
    }
    let mut result = vec![0.0; channel.len()];
    for y in 0..height {
        for (k, w) in along_y.iter().enumerate() {
            let source = &rows[tap(y, k, along_y, height) * width..][..width];
            result[y * width..][..width].iter_mut().zip(source).for_each(|(r, s)| *r += w * s);
        }
    }
    result
}

/// Compresses large colour differences to [0.95, 1] (section 4.1.3).
fn redistribute(difference: f32, largest: f32) -> f32 {
    let knee = PC * largest;
    if difference < knee {
        PT / knee * difference
    } else {
        PT + (difference - knee) / (largest - knee) * (1.0 - PT)
    }
}

/// |ΔL| + the Euclidean distance in a and b.
fn hyab(a: Vec3, b: Vec3) -> f32 {
    (a.x - b.x).abs() + Vec2::new(a.y - b.y, a.z - b.z).length()
}

/// The Hunt effect: colours look less chromatic when dark.
fn hunt(lab: Vec3) -> Vec3 {
    Vec3::new(lab.x, 0.01 * lab.x * lab.y, 0.01 * lab.x * lab.z)
}

/// CIE XYZ from linear Rec. 709, relative to the white point of the display.
fn relative_xyz(rgb: Vec3) -> Vec3 {
    let xyz = XYZ_FROM_RGB * rgb;
    xyz / (XYZ_FROM_RGB * Vec3::ONE)
}

/// Columns are the XYZ of the Rec. 709 primaries for the white point D65.
const XYZ_FROM_RGB: Mat3 = Mat3::from_cols(
    Vec3::new(0.412_386_56, 0.212_636_82, 0.019_330_62),
    Vec3::new(0.357_591_49, 0.715_182_98, 0.119_197_16),
    Vec3::new(0.180_450_49, 0.072_180_2, 0.950_372_6),
);

fn ycxcz(rgb: Vec3) -> Vec3 {
    let r = relative_xyz(rgb);
    Vec3::new(116.0 * r.y - 16.0, 500.0 * (r.x - r.y), 200.0 * (r.y - r.z))
}

fn from_ycxcz(c: Vec3) -> Vec3 {
    let y = (c.x + 16.0) / 116.0;
    let relative = Vec3::new(y + c.y / 500.0, y, y - c.z / 200.0);
    XYZ_FROM_RGB.inverse() * (relative * (XYZ_FROM_RGB * Vec3::ONE))
}

/// CIE L*a*b* from linear Rec. 709.
fn lab(rgb: Vec3) -> Vec3 {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |t: f32| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = relative_xyz(rgb).to_array().map(f);
    Vec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
}

#[cfg(test)]
mod tests {
    use heliostat_shading::color::srgb_decode;

    use super::*;

    const WIDTH: usize = 96;
    const HEIGHT: usize = 64;

    /// Linear colours of an 8-bit picture given by a formula.
    fn picture(bytes: impl Fn(usize, usize) -> [usize; 3]) -> Vec<Vec3> {
        let linear = |v: usize| srgb_decode(v as f32 / 255.0);
        (0..WIDTH * HEIGHT).map(|i| Vec3::from_array(bytes(i % WIDTH, i / WIDTH).map(linear))).collect()
    }

    #[test]
    fn agrees_with_the_authors_implementation() {
        // The figures come from the authors' package flip-evaluator 1.7 on the same two pairs of pictures.
        let ground = |x: usize, y: usize| [(x * 2) % 256, (y * 4) % 256, (x * y / 8) % 256];
        let shifted = |x: usize, y: usize| {
            let [r, g, b] = ground(x, y);
            let shift = if (x / 8 + y / 8) % 2 == 1 { 40 } else { 0 };
            [(r + shift).min(255), g, b.saturating_sub(shift)]
        };
        let ramp = |x: usize, _: usize| [60 + x; 3];
        let noisy = |x: usize, y: usize| {
            let v = 60 + x;
            let noise = (x * 7919 + y * 104_729) % 61;
            [(v + noise).saturating_sub(30), v, if x == 48 || y == 32 { 255 } else { v }]
        };
        for (test, reference, expected) in
            [(picture(shifted), picture(ground), 0.256_326), (picture(noisy), picture(ramp), 0.118_629)]
        {
            let error = flip(WIDTH, &test, &reference);
            // Single precision and the order of sums.
            assert!((error - expected).abs() < 2e-4, "{error} instead of {expected}");
        }
    }

    #[test]
    fn equal_pictures_do_not_differ_and_opposite_ones_do() {
        let black = vec![Vec3::ZERO; 400];
        let white = vec![Vec3::ONE; 400];
        assert_eq!(flip(20, &white, &white), 0.0);
        assert!(flip(20, &white, &black) > 0.9);
    }
}

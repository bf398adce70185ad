//! From linear radiance to 8 bits: exposure, a filmic curve, the sRGB encoding.

use crate::color::{luminance, srgb_encode};
use glam::Vec3;

/// Linear value that the curve maps to itself: a middle grey card stays a middle grey card.
const MIDDLE_GREY: f32 = 0.18;

/// The exposure, in stops, at which the picture's log-average luminance becomes a middle grey; 0 for a black one.
/// Pixels darker than a millionth of the brightest do not count, so a black background does not blow out the rest.
///
/// # References
/// Reinhard et al., "Photographic Tone Reproduction for Digital Images", 2002, equation 1.
pub fn auto_exposure(color: &[Vec3]) -> f32 {
    let luminances = || color.iter().map(|&c| luminance(c)).filter(|l| l.is_finite());
    let floor = luminances().fold(0.0, f32::max) * 1e-6;
    let (sum, count) = luminances()
        .filter(|&l| l > floor && l > 0.0)
        .fold((0.0_f64, 0_u64), |(sum, count), l| (sum + f64::from(l).log2(), count + 1));
    if count == 0 {
        return 0.0;
    }
    (MIDDLE_GREY.log2() - (sum / count as f64) as f32).clamp(-30.0, 30.0)
}

/// Rows of RGB bytes, sRGB-encoded, after `ev` stops of exposure and the filmic curve.
pub fn tone_map(color: &[Vec3], ev: f32) -> Vec<u8> {
    let gain = ev.exp2();
    let byte = |x: f32| (srgb_encode(filmic(x * gain)).clamp(0.0, 1.0) * 255.0).round() as u8;
    color.iter().flat_map(|c| c.to_array().map(byte)).collect()
}

/// A filmic curve from [0, ∞) to [0, 1): a slight toe, a straight middle, a long shoulder.
///
/// # References
/// Narkowicz, "ACES Filmic Tone Mapping Curve", 2016; scaled so that middle grey is kept.
fn filmic(x: f32) -> f32 {
    let x = if x.is_nan() { 0.0 } else { x.clamp(0.0, 1e6) * 0.718 };
    ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_keeps_middle_grey_and_is_monotonic() {
        assert!((filmic(MIDDLE_GREY) - MIDDLE_GREY).abs() < 2e-3, "{}", filmic(MIDDLE_GREY));
        assert_eq!(filmic(0.0), 0.0);
        assert_eq!(filmic(f32::NAN), 0.0);
        assert!(filmic(f32::INFINITY) <= 1.0);
        let values: Vec<_> = (0..1000).map(|i| filmic(i as f32 * 0.01)).collect();
        assert!(values.is_sorted());
    }

    #[test]
    fn auto_exposure_undoes_a_change_of_light() {
        let picture: Vec<_> = (1..100).map(|i| Vec3::splat(i as f32 * 0.01)).collect();
        let brighter: Vec<_> = picture.iter().map(|c| *c * 8.0).collect();
        let ev = auto_exposure(&picture);
        assert!((auto_exposure(&brighter) - (ev - 3.0)).abs() < 1e-4);
        assert_eq!(tone_map(&brighter, ev - 3.0), tone_map(&picture, ev));
        assert_eq!(auto_exposure(&[Vec3::ZERO; 4]), 0.0);
        let mut with_background = picture.clone();
        with_background.extend([Vec3::ZERO; 500]);
        assert_eq!(auto_exposure(&with_background), ev);
        assert_eq!(auto_exposure(&[Vec3::splat(f32::NAN)]), 0.0);
    }
}

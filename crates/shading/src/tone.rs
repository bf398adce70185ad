//! From linear radiance to 8 bits: exposure, a filmic curve, the sRGB encoding.

use crate::color::{luminance, srgb_encode};
use crate::pixel::{BoundPixelShader, PixelFrame, filmic};
use crate::surface::LaneMode;
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
    color.iter().flat_map(|c| c.to_array().map(|x| byte(filmic(x * gain)))).collect()
}

/// Rows of RGB bytes, sRGB-encoded, of a picture so many pixels wide after `ev` stops of exposure and a tone curve: a pixel
/// shader that answers for a display, see [`PixelInfo::for_display`](crate::pixel::PixelInfo::for_display).
pub fn tone_map_by(curve: &BoundPixelShader, color: &[Vec3], width: u32, ev: f32) -> Vec<u8> {
    let gain = ev.exp2();
    let color: Vec<Vec3> = color.iter().map(|&c| c * gain).collect();
    let width = width.max(1) as usize;
    let frame = PixelFrame { width, height: color.len() / width, color: &color, depth: &[], normal: &[] };
    let mut row = vec![Vec3::ZERO; width];
    let mut bytes = Vec::with_capacity(3 * color.len());
    for y in 0..frame.height {
        curve.row(LaneMode::default(), &frame, y, &mut row);
        bytes.extend(row.iter().flat_map(|c| c.to_array().map(byte)));
    }
    bytes
}

fn byte(shown: f32) -> u8 {
    (srgb_encode(shown).clamp(0.0, 1.0) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use crate::pixel::PixelRegistry;
    use heliostat_scene::ShaderUse;

    use super::*;

    #[test]
    fn the_curve_keeps_middle_grey_and_is_monotonic() {
        assert!((filmic(MIDDLE_GREY) - MIDDLE_GREY).abs() < 2e-3, "{}", filmic(MIDDLE_GREY));
        assert_eq!(filmic(0.0_f32), 0.0);
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

    #[test]
    fn the_default_curve_is_the_shader_of_its_name() {
        let picture: Vec<_> = (0..60).map(|i| Vec3::new(i as f32 * 0.03, 0.2, 1e3 / (i as f32))).collect();
        let filmic = PixelRegistry::built_in().bind(&ShaderUse::named("filmic")).unwrap();
        assert_eq!(tone_map_by(&filmic, &picture, 20, 1.5), tone_map(&picture, 1.5));
        let clip = PixelRegistry::built_in().bind(&ShaderUse::named("clip")).unwrap();
        assert_eq!(tone_map_by(&clip, &[Vec3::new(0.0, 1.0, 9.0)], 1, 0.0), [0, 255, 255]);
    }
}

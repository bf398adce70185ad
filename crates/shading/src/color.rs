//! Colour: luminance and the sRGB transfer curve.

use std::sync::LazyLock;

use glam::Vec3;

use crate::lanes::{Real, Vector};

/// A colour with alpha.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rgba<F> {
    /// Linear, not multiplied by alpha.
    pub(crate) rgb: Vector<F>,
    pub(crate) a: F,
}

impl<F: Real> Rgba<F> {
    /// Opaque white, in the registers that `like` is in.
    #[inline(always)]
    pub(crate) fn white(like: F) -> Self {
        let one = like.splat(1.0);
        Self { rgb: Vector::grey(one), a: one }
    }
}

impl From<glam::Vec4> for Rgba<f32> {
    fn from(v: glam::Vec4) -> Self {
        Self { rgb: v.truncate().into(), a: v.w }
    }
}

/// Relative luminance of linear Rec. 709 RGB (ITU-R BT.709).
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Linear value of an sRGB-encoded one (IEC 61966-2-1).
pub fn srgb_decode(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// sRGB encoding of a linear value (IEC 61966-2-1).
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.0031308 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The step between 8-bit codes of linear values.
pub(crate) const UNIT: f32 = 1.0 / 255.0;

/// Values of all 8-bit linear codes.
pub(crate) static UNIT8: [f32; 256] = {
    let (mut values, mut code) = ([0.0; 256], 0);
    while code < 256 {
        values[code] = code as f32 * UNIT;
        code += 1;
    }
    values
};

/// Linear values of all 8-bit sRGB codes.
pub(crate) static SRGB8: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| srgb_decode(code as f32 * UNIT)));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trip_and_reference_values() {
        for code in 0..=255 {
            let linear = SRGB8[code];
            assert_eq!((srgb_encode(linear) * 255.0).round() as usize, code);
        }
        assert_eq!((SRGB8[0], SRGB8[255]), (0.0, 1.0));
        // 50 % grey code 188 ≈ 0.5029 linear by the standard's formula.
        assert!((srgb_decode(188.0 / 255.0) - 0.502886).abs() < 1e-5);
        assert!((luminance(Vec3::ONE) - 1.0).abs() < 1e-6);
    }
}

//! Elementary functions as minimax polynomials: the same bits in every lane of every instruction set.

use super::{Real, Whole};

/// 2^x with a relative error below 2e-7; the argument is moved into −126 ≤ x < 128.
#[expect(clippy::approx_constant, reason = "a minimax coefficient is near ln 2, and not it")]
#[inline(always)]
pub fn exp2<F: Real>(x: F) -> F {
    let x = x.clamp(-126.0, 127.999_99);
    let whole = x.floor();
    let t = x - whole;
    let p = t * 2.170_225_6e-4 + 1.243_968_8e-3;
    let p = p * t + 9.678_841e-3;
    let p = p * t + 5.548_334e-2;
    let p = p * t + 2.402_298_4e-1;
    let p = p * t + 6.931_47e-1;
    let p = p * t + 1.0;
    // The power of two, by its bits.
    p * (whole + 127.0).truncate().left(23).as_real_bits()
}

/// log₂ x of a positive normal number, with an absolute error below 2e-7 or a relative one of as much, whichever is
/// larger; −126 for smaller numbers, zero and negative ones.
#[inline(always)]
pub fn log2<F: Real>(x: F) -> F {
    let x = x.max(x.splat(f32::MIN_POSITIVE));
    // x = 2^e m with m between √½ and √2.
    let bits = x.bits();
    let root_half = bits.splat(0x3f35_04f3);
    let above = bits.plus(bits.splat(0x3f35_04f3_u32.wrapping_neg()).plus(bits.splat(128 << 23)));
    let exponent = above.right(23).to_real() - 128.0;
    let mantissa = (above & bits.splat(0x007f_ffff)).plus(root_half).as_real_bits();
    let t = mantissa - 1.0;
    let p = t * 1.258_370_5e-1 + -2.072_697_6e-1;
    let p = p * t + 2.157_156e-1;
    let p = p * t + -2.389_448_2e-1;
    let p = p * t + 2.879_162_5e-1;
    let p = p * t + -3.607_036_8e-1;
    let p = p * t + 4.809_106_4e-1;
    let p = p * t + -7.213_473_5e-1;
    let p = p * t + std::f32::consts::LOG2_E;
    p * t + exponent
}

/// e^x, by [`exp2`].
#[inline(always)]
pub fn exp<F: Real>(x: F) -> F {
    exp2(x * std::f32::consts::LOG2_E)
}

/// x^y of x ≥ 0; zero to any power is (next to) zero.
#[inline(always)]
pub fn pow<F: Real>(x: F, y: F) -> F {
    exp2(log2(x) * y)
}

/// (cos 2πx, sin 2πx), absolute error below 1e-7 for |x| < 1000.
#[inline(always)]
pub fn cos_sin_turns<F: Real>(x: F) -> (F, F) {
    // Quarter turns, and the rest in −1/8 … 1/8.
    let quarter = (x * 4.0 + 0.5).floor();
    let t = x - quarter * 0.25;
    let t2 = t * t;
    let s = t2 * -75.393_56 + 81.592_354;
    let s = s * t2 + -41.341_663;
    let s = (s * t2 + std::f32::consts::TAU) * t;
    let c = t2 * 59.202_8 + -85.442_3;
    let c = c * t2 + 64.939_31;
    let c = c * t2 + -19.739_208;
    let c = c * t2 + 1.0;
    let quadrant = quarter.truncate();
    let odd = quadrant.has(1);
    let (cos, sin) = (s.where_or(odd, c), c.where_or(odd, s));
    // cos is negative in quadrants 1 and 2, sin in 2 and 3.
    let cos = (-cos).where_or(quadrant.plus(quadrant.splat(1)).has(2), cos);
    let sin = (-sin).where_or(quadrant.has(2), sin);
    (cos, sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst(range: (f32, f32), f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64, floor: f64) -> f64 {
        let n = 200_000;
        (0..=n)
            .map(|i| range.0 + (range.1 - range.0) * i as f32 / n as f32)
            .map(|x| {
                let e = exact(f64::from(x));
                (f64::from(f(x)) - e).abs() / e.abs().max(floor)
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn errors_are_as_stated() {
        assert!(worst((-20.0, 20.0), exp2, f64::exp2, 0.0) < 2.5e-7);
        assert!(worst((0.01, 100.0), log2, f64::log2, 1.0) < 2e-7);
        assert!(worst((1e-30, 1e-20), log2, f64::log2, 1.0) < 2e-7);
        assert!(worst((0.0, 10.0), |x| pow(x, 2.2), |x| x.powf(2.2), 1e-3) < 2e-6);
        let turns = |x: f64| x * std::f64::consts::TAU;
        assert!(worst((-5.0, 5.0), |x| cos_sin_turns(x).0, |x| turns(x).cos(), 1.0) < 3e-7);
        assert!(worst((-5.0, 5.0), |x| cos_sin_turns(x).1, |x| turns(x).sin(), 1.0) < 3e-7);
    }

    #[test]
    fn edges() {
        assert_eq!(exp2(0.0_f32), 1.0);
        assert!(exp2(-200.0_f32) < 1e-37 && exp2(300.0_f32) > 1e38);
        assert!(exp2(f32::NAN).is_finite());
        assert_eq!(log2(1.0_f32), 0.0);
        assert_eq!(log2(8.0_f32), 3.0);
        assert_eq!(log2(0.0_f32), -126.0);
        assert_eq!(log2(-1.0_f32), -126.0);
        assert_eq!(cos_sin_turns(0.25_f32), (0.0, 1.0));
        assert_eq!(cos_sin_turns(-0.5_f32).0, -1.0);
    }
}

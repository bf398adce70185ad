//! The trait of lane values and its two kinds: one float, and sixteen.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use fearless_simd::{Level, Simd, f32x16, mask32x16, prelude::*, u32x16};

use super::{Floats, WIDTH, Whole};

/// Sixteen floats in the registers of an instruction set.
pub type Packet<S> = f32x16<S>;

/// A truth value per lane.
pub trait Mask:
    Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> + 'static
{
    /// Whether any lane is true. Only to skip work that would change nothing: a lane must not depend on others.
    fn any(self) -> bool;

    /// Whether all lanes are.
    fn all(self) -> bool;

    /// Stores the lanes from `lane` on.
    fn store(self, to: &mut [bool; WIDTH], lane: usize);
}

/// A scalar function that lanes are put through one by one.
pub trait LaneFn<const I: usize, const O: usize> {
    /// Its value.
    fn at(&self, of: [f32; I]) -> [f32; O];
}

/// A function of lanes that is large and called from many places, and therefore compiled once for each instruction set.
pub trait LanesFn<const I: usize, const O: usize> {
    /// Its values; must be `#[inline(always)]`.
    fn on<F: Real>(&self, of: [F; I]) -> [F; O];
}

/// See [`Real::call`].
#[inline(never)]
fn call_single<const I: usize, const O: usize>(f: &impl LanesFn<I, O>, of: [f32; I]) -> [f32; O] {
    f.on(of)
}

/// See [`Real::call`].
#[inline(never)]
fn call_packet<S: Simd, const I: usize, const O: usize>(
    token: S,
    f: &impl LanesFn<I, O>,
    inputs: &[Floats; I],
    outputs: &mut [Floats; O],
) {
    token.vectorize(
        #[inline(always)]
        || {
            let mut of = [<Packet<S> as SimdBase<S>>::splat(token, 0.0); I];
            for (value, lanes) in of.iter_mut().zip(inputs) {
                *value = Packet::load_array_ref(token, &lanes.0);
            }
            for (value, lanes) in f.on(of).iter().zip(outputs) {
                value.store_array(&mut lanes.0);
            }
        },
    );
}

/// Applies a function to every lane; compiled once for all instruction sets.
#[inline(never)]
fn each_lane<const I: usize, const O: usize>(
    f: &impl LaneFn<I, O>,
    inputs: &[Floats; I],
    outputs: &mut [Floats; O],
) {
    for lane in 0..WIDTH {
        let input = std::array::from_fn(|i| inputs[i].0[lane]);
        for (value, lanes) in f.at(input).into_iter().zip(outputs.iter_mut()) {
            lanes.0[lane] = value;
        }
    }
}

/// A number per lane, with the arithmetic of `f32`.
pub trait Real:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f32, Output = Self>
    + Sub<f32, Output = Self>
    + Mul<f32, Output = Self>
    + Div<f32, Output = Self>
    + 'static
{
    /// What comparisons give.
    type Mask: Mask;
    /// Whole numbers of as many lanes, for hashing.
    type Whole: Whole<Real = Self>;
    /// Proof that the instruction set is there.
    type Token: Copy + Debug;
    /// Number of lanes.
    const LANES: usize;

    /// Loads [`Self::LANES`] lanes from `lane` on.
    fn load(token: Self::Token, from: &Floats, lane: usize) -> Self;

    /// A number for each of [`Self::LANES`] lanes from `lane` on, put together in registers: for numbers that lie apart or that
    /// were just written one by one, which a wide load would have to wait for.
    fn gather(token: Self::Token, lane: usize, from: impl Fn(usize) -> f32) -> Self;

    /// Stores [`Self::LANES`] lanes from `lane` on.
    fn store(self, to: &mut Floats, lane: usize);

    /// All lanes alike.
    fn constant(token: Self::Token, value: f32) -> Self;

    /// The token it was made with.
    fn token(self) -> Self::Token;

    /// The instruction set of packets; `None` for single lanes.
    fn level(token: Self::Token) -> Option<Level>;

    /// All lanes alike, in the registers that `self` is in.
    #[inline(always)]
    fn splat(self, value: f32) -> Self {
        Self::constant(self.token(), value)
    }

    /// The smaller one; `other` where `self` is not a number.
    fn min(self, other: Self) -> Self;

    /// The larger one; `other` where `self` is not a number.
    fn max(self, other: Self) -> Self;

    /// Square root.
    fn sqrt(self) -> Self;

    /// Without its sign.
    fn abs(self) -> Self;

    /// The next lower whole number.
    fn floor(self) -> Self;

    /// The magnitude of `self` with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;

    /// self < other
    fn lt(self, other: Self) -> Self::Mask;

    /// self ≤ other
    fn le(self, other: Self) -> Self::Mask;

    /// self = other
    fn equals(self, other: Self) -> Self::Mask;

    /// `self` where `mask` is true, `otherwise` elsewhere.
    fn where_or(self, mask: Self::Mask, otherwise: Self) -> Self;

    /// The number rounded towards zero; numbers beyond ±2³¹ give anything, the same on every machine is not promised.
    fn truncate(self) -> Self::Whole;

    /// The bits of the number.
    fn bits(self) -> Self::Whole;

    /// Applies a scalar function to every lane. For tables and textures: nothing else pays for leaving the registers.
    fn each<const I: usize, const O: usize>(of: [Self; I], f: &impl LaneFn<I, O>) -> [Self; O];

    /// Calls a function of lanes that is not to be compiled anew at every place where it is called.
    fn call<const I: usize, const O: usize>(of: [Self; I], f: &impl LanesFn<I, O>) -> [Self; O];

    /// self > other
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }

    /// self ≥ other
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }

    /// `self` where `mask` is true, zero elsewhere.
    #[inline(always)]
    fn only(self, mask: Self::Mask) -> Self {
        self.where_or(mask, self.splat(0.0))
    }

    /// At least `low` and at most `high`; `low` where `self` is not a number.
    #[inline(always)]
    fn clamp(self, low: f32, high: f32) -> Self {
        self.max(self.splat(low)).min(self.splat(high))
    }

    /// At least zero.
    #[inline(always)]
    fn positive(self) -> Self {
        self.max(self.splat(0.0))
    }

    /// 1 − self
    #[inline(always)]
    fn complement(self) -> Self {
        self.splat(1.0) - self
    }

    /// self²
    #[inline(always)]
    fn squared(self) -> Self {
        self * self
    }

    /// 1 / self
    #[inline(always)]
    fn recip(self) -> Self {
        self.splat(1.0) / self
    }

    /// `self` at 0, `other` at 1.
    #[inline(always)]
    fn mix(self, other: Self, at: Self) -> Self {
        self + (other - self) * at
    }
}

impl Mask for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }

    #[inline(always)]
    fn all(self) -> bool {
        self
    }

    #[inline(always)]
    fn store(self, to: &mut [bool; WIDTH], lane: usize) {
        to[lane] = self;
    }
}

impl<S: Simd> Mask for mask32x16<S> {
    #[inline(always)]
    fn any(self) -> bool {
        self.any_true()
    }

    #[inline(always)]
    fn all(self) -> bool {
        self.all_true()
    }

    #[inline(always)]
    fn store(self, to: &mut [bool; WIDTH], _: usize) {
        let bits = self.to_bitmask();
        for (lane, value) in to.iter_mut().enumerate() {
            *value = bits >> lane & 1 == 1;
        }
    }
}

impl Real for f32 {
    type Mask = bool;
    type Whole = u32;
    type Token = ();
    const LANES: usize = 1;

    #[inline(always)]
    fn load((): (), from: &Floats, lane: usize) -> Self {
        from.0[lane]
    }

    #[inline(always)]
    fn gather((): (), lane: usize, from: impl Fn(usize) -> f32) -> Self {
        from(lane)
    }

    #[inline(always)]
    fn store(self, to: &mut Floats, lane: usize) {
        to.0[lane] = self;
    }

    #[inline(always)]
    fn constant((): (), value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn token(self) {}

    #[inline(always)]
    fn level((): ()) -> Option<Level> {
        None
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self::abs(self)
    }

    #[inline(always)]
    fn floor(self) -> Self {
        // Spelt out because the library's is a call where the instruction is not part of the baseline.
        const WHOLE_FROM: f32 = (1 << 23) as f32;
        if Self::abs(self) < WHOLE_FROM {
            let truncated = self as i32 as f32;
            let whole = if truncated > self { truncated - 1.0 } else { truncated };
            return Self::copysign(whole, self);
        }
        self
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        Self::copysign(self, sign)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn equals(self, other: Self) -> bool {
        self == other
    }

    #[inline(always)]
    fn where_or(self, mask: bool, otherwise: Self) -> Self {
        if mask { self } else { otherwise }
    }

    #[inline(always)]
    fn truncate(self) -> u32 {
        self as i32 as u32
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        self.to_bits()
    }

    #[inline(always)]
    fn each<const I: usize, const O: usize>(of: [Self; I], f: &impl LaneFn<I, O>) -> [Self; O] {
        f.at(of)
    }

    #[inline(always)]
    fn call<const I: usize, const O: usize>(of: [Self; I], f: &impl LanesFn<I, O>) -> [Self; O] {
        call_single(f, of)
    }
}

impl<S: Simd> Real for Packet<S> {
    type Mask = mask32x16<S>;
    type Whole = u32x16<S>;
    type Token = S;
    const LANES: usize = WIDTH;

    #[inline(always)]
    fn load(token: S, from: &Floats, _: usize) -> Self {
        Self::load_array_ref(token, &from.0)
    }

    #[inline(always)]
    fn gather(token: S, _: usize, from: impl Fn(usize) -> f32) -> Self {
        let mut lanes = [0.0; WIDTH];
        for (lane, value) in lanes.iter_mut().enumerate() {
            *value = from(lane);
        }
        Self::load_array(token, lanes)
    }

    #[inline(always)]
    fn store(self, to: &mut Floats, _: usize) {
        self.store_array(&mut to.0);
    }

    #[inline(always)]
    fn constant(token: S, value: f32) -> Self {
        <Self as SimdBase<S>>::splat(token, value)
    }

    #[inline(always)]
    fn token(self) -> S {
        ExtractToken::token(&self)
    }

    #[inline(always)]
    fn level(token: S) -> Option<Level> {
        Some(token.level())
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // By comparison, since the instruction's answer to NaN differs between machines.
        self.where_or(Real::lt(self, other), other)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.where_or(Real::lt(other, self), other)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        SimdFloat::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        SimdBase::abs(self)
    }

    #[inline(always)]
    fn floor(self) -> Self {
        SimdFloat::floor(self)
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        SimdFloat::copysign(self, sign)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        self.simd_lt(other)
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        self.simd_le(other)
    }

    #[inline(always)]
    fn equals(self, other: Self) -> Self::Mask {
        self.simd_eq(other)
    }

    #[inline(always)]
    fn where_or(self, mask: Self::Mask, otherwise: Self) -> Self {
        mask.select(self, otherwise)
    }

    #[inline(always)]
    fn truncate(self) -> Self::Whole {
        let whole: fearless_simd::i32x16<S> = self.to_int();
        whole.bitcast()
    }

    #[inline(always)]
    fn bits(self) -> Self::Whole {
        self.bitcast()
    }

    #[inline(always)]
    fn call<const I: usize, const O: usize>(of: [Self; I], f: &impl LanesFn<I, O>) -> [Self; O] {
        let (inputs, mut outputs) = (stored(&of), [Floats::ZERO; O]);
        call_packet(Real::token(of[0]), f, &inputs, &mut outputs);
        loaded(of[0], &outputs)
    }

    #[inline(always)]
    fn each<const I: usize, const O: usize>(of: [Self; I], f: &impl LaneFn<I, O>) -> [Self; O] {
        let (inputs, mut outputs) = (stored(&of), [Floats::ZERO; O]);
        each_lane(f, &inputs, &mut outputs);
        loaded(of[0], &outputs)
    }
}

#[inline(always)]
fn stored<S: Simd, const N: usize>(values: &[Packet<S>; N]) -> [Floats; N] {
    let mut lanes = [Floats::ZERO; N];
    for (value, lanes) in values.iter().zip(&mut lanes) {
        value.store_array(&mut lanes.0);
    }
    lanes
}

/// Lanes in the registers that `like` is in.
#[inline(always)]
fn loaded<S: Simd, const N: usize>(like: Packet<S>, lanes: &[Floats; N]) -> [Packet<S>; N] {
    let mut values = [like; N];
    for (value, lanes) in values.iter_mut().zip(lanes) {
        *value = Packet::load_array_ref(Real::token(like), &lanes.0);
    }
    values
}

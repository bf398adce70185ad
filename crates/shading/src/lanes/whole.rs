//! Whole numbers per lane, as far as hashing and noise need them.

use std::fmt::Debug;
use std::ops::{BitAnd, BitOr, BitXor};

use fearless_simd::{Simd, f32x16, prelude::*, u32x4, u32x16, u64x8};

use super::{Real, WIDTH};

/// One unsigned number per lane, in memory.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wholes(pub [u32; WIDTH]);

/// An unsigned number of 32 bits per lane; arithmetic wraps round.
pub trait Whole:
    Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + BitXor<Output = Self> + 'static
{
    /// Floats of as many lanes.
    type Real: Real<Whole = Self>;

    /// Loads as many lanes from `lane` on.
    fn load(token: <Self::Real as Real>::Token, from: &Wholes, lane: usize) -> Self;

    /// A number for as many lanes from `lane` on; see [`Real::gather`].
    fn gather(token: <Self::Real as Real>::Token, lane: usize, from: impl Fn(usize) -> u32) -> Self;

    /// Two numbers for as many lanes from `lane` on: the lower half of 64 bits and the upper one.
    fn gather_pairs(
        token: <Self::Real as Real>::Token,
        lane: usize,
        from: impl Fn(usize) -> u64,
    ) -> [Self; 2];

    /// Four numbers for as many lanes from `lane` on, which lie side by side.
    fn gather_quads(
        token: <Self::Real as Real>::Token,
        lane: usize,
        from: impl Fn(usize) -> [u32; 4],
    ) -> [Self; 4];

    /// Stores as many lanes from `lane` on.
    fn store(self, to: &mut Wholes, lane: usize);

    /// All lanes alike, in the registers that `self` is in.
    fn splat(self, value: u32) -> Self;

    /// self + other
    fn plus(self, other: Self) -> Self;

    /// self · other
    fn times(self, other: Self) -> Self;

    /// Shifted towards the high bits; `count` < 32.
    fn left(self, count: u32) -> Self;

    /// Shifted towards the low bits; `count` < 32.
    fn right(self, count: u32) -> Self;

    /// The number as a float; below 2³¹.
    fn to_real(self) -> Self::Real;

    /// The float that has these bits.
    fn as_real_bits(self) -> Self::Real;

    /// Where the bits of `mask` are set in `self`.
    fn has(self, mask: u32) -> <Self::Real as Real>::Mask;

    /// `self` where `mask` is true, zero elsewhere.
    fn only(self, mask: <Self::Real as Real>::Mask) -> Self;

    /// The bits in reverse order.
    #[inline(always)]
    fn reversed(self) -> Self {
        let swap = [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff)];
        let mut x = self;
        for (distance, low) in swap {
            let low = x.splat(low);
            x = (x.right(distance) & low) | (x & low).left(distance);
        }
        x.right(16) | x.left(16)
    }

    /// The bits as a float in [0, 1): the 24 highest count.
    #[inline(always)]
    fn unit(self) -> Self::Real {
        self.right(8).to_real() * (1.0 / (1 << 24) as f32)
    }

    /// A bijective hash (two multiply–xorshift rounds) whose every input bit affects every output bit.
    #[inline(always)]
    fn hashed(self) -> Self {
        let x = self.plus(self.splat(0x6a09_e667));
        let x = (x ^ x.right(16)).times(self.splat(0x7feb_352d));
        let x = (x ^ x.right(15)).times(self.splat(0x846c_a68b));
        x ^ x.right(16)
    }
}

impl Whole for u32 {
    type Real = f32;

    #[inline(always)]
    fn load((): (), from: &Wholes, lane: usize) -> Self {
        from.0[lane]
    }

    #[inline(always)]
    fn gather((): (), lane: usize, from: impl Fn(usize) -> u32) -> Self {
        from(lane)
    }

    #[inline(always)]
    fn gather_pairs((): (), lane: usize, from: impl Fn(usize) -> u64) -> [Self; 2] {
        let pair = from(lane);
        [pair as u32, (pair >> 32) as u32]
    }

    #[inline(always)]
    fn gather_quads((): (), lane: usize, from: impl Fn(usize) -> [u32; 4]) -> [Self; 4] {
        from(lane)
    }

    #[inline(always)]
    fn store(self, to: &mut Wholes, lane: usize) {
        to.0[lane] = self;
    }

    #[inline(always)]
    fn splat(self, value: u32) -> Self {
        value
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.wrapping_add(other)
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        self.wrapping_mul(other)
    }

    #[inline(always)]
    fn left(self, count: u32) -> Self {
        self << count
    }

    #[inline(always)]
    fn right(self, count: u32) -> Self {
        self >> count
    }

    #[inline(always)]
    fn to_real(self) -> f32 {
        self as i32 as f32
    }

    #[inline(always)]
    fn as_real_bits(self) -> f32 {
        f32::from_bits(self)
    }

    #[inline(always)]
    fn has(self, mask: u32) -> bool {
        self & mask == mask
    }

    #[inline(always)]
    fn only(self, mask: bool) -> Self {
        if mask { self } else { 0 }
    }

    #[inline(always)]
    fn reversed(self) -> Self {
        self.reverse_bits()
    }
}

impl<S: Simd> Whole for u32x16<S> {
    type Real = f32x16<S>;

    #[inline(always)]
    fn load(token: S, from: &Wholes, _: usize) -> Self {
        Self::load_array_ref(token, &from.0)
    }

    #[inline(always)]
    fn gather(token: S, _: usize, from: impl Fn(usize) -> u32) -> Self {
        let mut lanes = [0; WIDTH];
        for (lane, value) in lanes.iter_mut().enumerate() {
            *value = from(lane);
        }
        Self::load_array(token, lanes)
    }

    #[inline(always)]
    fn gather_pairs(token: S, _: usize, from: impl Fn(usize) -> u64) -> [Self; 2] {
        let (mut low, mut high) = ([0; WIDTH / 2], [0; WIDTH / 2]);
        for lane in 0..WIDTH / 2 {
            low[lane] = from(lane);
            high[lane] = from(WIDTH / 2 + lane);
        }
        let low: Self = u64x8::load_array(token, low).bitcast();
        let high: Self = u64x8::load_array(token, high).bitcast();
        [low.unzip_low(high), low.unzip_high(high)]
    }

    #[inline(always)]
    fn gather_quads(token: S, _: usize, from: impl Fn(usize) -> [u32; 4]) -> [Self; 4] {
        let mut quads = [<u32x4<S> as SimdBase<S>>::splat(token, 0); WIDTH];
        for (lane, quad) in quads.iter_mut().enumerate() {
            *quad = u32x4::load_array(token, from(lane));
        }
        let mut rows = [<Self as SimdBase<S>>::splat(token, 0); 4];
        for (row, &[a, b, c, d]) in rows.iter_mut().zip(quads.as_chunks().0) {
            *row = a.combine(b).combine(c.combine(d));
        }
        let [a, b, c, d] = rows;
        let (even, odd) = ([a.unzip_low(b), c.unzip_low(d)], [a.unzip_high(b), c.unzip_high(d)]);
        [
            even[0].unzip_low(even[1]),
            odd[0].unzip_low(odd[1]),
            even[0].unzip_high(even[1]),
            odd[0].unzip_high(odd[1]),
        ]
    }

    #[inline(always)]
    fn store(self, to: &mut Wholes, _: usize) {
        self.store_array(&mut to.0);
    }

    #[inline(always)]
    fn splat(self, value: u32) -> Self {
        <Self as SimdBase<S>>::splat(self.token(), value)
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self + other
    }

    #[inline(always)]
    fn times(self, other: Self) -> Self {
        self * other
    }

    #[inline(always)]
    fn left(self, count: u32) -> Self {
        self << count
    }

    #[inline(always)]
    fn right(self, count: u32) -> Self {
        self >> count
    }

    #[inline(always)]
    fn to_real(self) -> f32x16<S> {
        let signed: fearless_simd::i32x16<S> = self.bitcast();
        signed.to_float()
    }

    #[inline(always)]
    fn as_real_bits(self) -> f32x16<S> {
        self.bitcast()
    }

    #[inline(always)]
    fn has(self, mask: u32) -> <f32x16<S> as Real>::Mask {
        let mask = Whole::splat(self, mask);
        (self & mask).simd_eq(mask)
    }

    #[inline(always)]
    fn only(self, mask: <f32x16<S> as Real>::Mask) -> Self {
        mask.select(self, Whole::splat(self, 0))
    }
}

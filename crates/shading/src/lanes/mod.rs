//! The numbers that shaders are written in: one value, or sixteen of them side by side.
//!
//! A shader is generic over [`Real`] and reads like scalar code. `f32` is one lane; [`Packet`] is sixteen lanes of one
//! instruction set. Both compute the same bits: nothing is fused, and functions beyond the four operations and the root
//! are polynomials of our own (`math.rs`). Lanes never see each other, so that a value does not depend on its neighbours.
//!
//! Code that is generic over [`Real`] must be `#[inline(always)]` and pass no closures that compute with packets: a closure
//! is compiled without the instruction set, and every operation in it becomes a call.

mod math;
pub mod noise;
mod real;
mod vector;
mod whole;

pub use math::{cos_sin_turns, exp, exp2, log2, pow};
pub use real::{LaneFn, LanesFn, Mask, Packet, Real};
pub use vector::Vector;
pub use whole::{Whole, Wholes};

/// Lanes of a packet and entries of a [`Floats`].
pub const WIDTH: usize = 16;

/// One value per lane, in memory.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Floats(pub [f32; WIDTH]);

impl Floats {
    /// All lanes zero.
    pub const ZERO: Self = Self([0.0; WIDTH]);

    /// All lanes alike.
    pub const fn splat(value: f32) -> Self {
        Self([value; WIDTH])
    }
}

impl Default for Floats {
    fn default() -> Self {
        Self::ZERO
    }
}

/// One vector or colour per lane, in memory.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vectors {
    /// First components.
    pub x: Floats,
    /// Second components.
    pub y: Floats,
    /// Third components.
    pub z: Floats,
}

impl Vectors {
    /// The same vector in every lane.
    pub fn splat(v: glam::Vec3) -> Self {
        Self { x: Floats::splat(v.x), y: Floats::splat(v.y), z: Floats::splat(v.z) }
    }

    /// The vector of one lane.
    #[inline]
    pub fn get(&self, lane: usize) -> glam::Vec3 {
        glam::Vec3::new(self.x.0[lane], self.y.0[lane], self.z.0[lane])
    }

    /// Sets the vector of one lane.
    #[inline]
    pub fn set(&mut self, lane: usize, v: glam::Vec3) {
        (self.x.0[lane], self.y.0[lane], self.z.0[lane]) = (v.x, v.y, v.z);
    }

    /// Multiplies them by others, component by component.
    pub fn scale(&mut self, by: &Self) {
        for (values, others) in [(&mut self.x, &by.x), (&mut self.y, &by.y), (&mut self.z, &by.z)] {
            values.0.iter_mut().zip(&others.0).for_each(|(value, other)| *value *= other);
        }
    }

    /// Adds the vectors of those lanes whose bit is set in `mask`.
    pub fn add_lanes(&mut self, other: &Self, mask: u16) {
        // All bits or none of each lane, which compilers know how to do side by side.
        let kept: [u32; WIDTH] = std::array::from_fn(|lane| (u32::from(mask) >> lane & 1).wrapping_neg());
        let pairs = [(&mut self.x, &other.x), (&mut self.y, &other.y), (&mut self.z, &other.z)];
        for (sums, others) in pairs {
            for ((sum, other), kept) in sums.0.iter_mut().zip(&others.0).zip(&kept) {
                *sum += f32::from_bits(other.to_bits() & kept);
            }
        }
    }
}

//! Vectors and colours of lanes.

use std::ops::{Add, Mul, Neg, Sub};

use glam::Vec3;

use super::{Real, Vectors};

/// Three numbers per lane: a point, a direction or a linear RGB colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector<F> {
    /// First component; red.
    pub x: F,
    /// Second component; green.
    pub y: F,
    /// Third component; blue.
    pub z: F,
}

impl<F> Vector<F> {
    /// From its components.
    #[inline(always)]
    pub fn new(x: F, y: F, z: F) -> Self {
        Self { x, y, z }
    }
}

impl<F: Real> Vector<F> {
    /// The same vector in every lane.
    #[inline(always)]
    pub fn constant(token: F::Token, v: Vec3) -> Self {
        Self::new(F::constant(token, v.x), F::constant(token, v.y), F::constant(token, v.z))
    }

    /// All components alike.
    #[inline(always)]
    pub fn grey(value: F) -> Self {
        Self::new(value, value, value)
    }

    /// Loads lanes from `lane` on.
    #[inline(always)]
    pub fn load(token: F::Token, from: &Vectors, lane: usize) -> Self {
        Self::new(F::load(token, &from.x, lane), F::load(token, &from.y, lane), F::load(token, &from.z, lane))
    }

    /// A vector for each lane from `lane` on; see [`Real::gather`].
    #[inline(always)]
    pub fn gather(token: F::Token, lane: usize, from: impl Fn(usize) -> Vec3) -> Self {
        let x = F::gather(token, lane, |lane| from(lane).x);
        let y = F::gather(token, lane, |lane| from(lane).y);
        let z = F::gather(token, lane, |lane| from(lane).z);
        Self::new(x, y, z)
    }

    /// Stores lanes from `lane` on.
    #[inline(always)]
    pub fn store(self, to: &mut Vectors, lane: usize) {
        self.x.store(&mut to.x, lane);
        self.y.store(&mut to.y, lane);
        self.z.store(&mut to.z, lane);
    }

    /// The token of its components.
    #[inline(always)]
    pub fn token(self) -> F::Token {
        self.x.token()
    }

    /// Times a constant.
    #[inline(always)]
    pub fn scaled(self, factor: f32) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }

    /// Inner product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> F {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }

    /// Square of the length.
    #[inline(always)]
    pub fn length_squared(self) -> F {
        self.dot(self)
    }

    /// Length.
    #[inline(always)]
    pub fn length(self) -> F {
        self.length_squared().sqrt()
    }

    /// At unit length; `otherwise` where the length is zero, infinite or not a number.
    #[inline(always)]
    pub fn normalized_or(self, otherwise: Self) -> Self {
        let inverse = self.length().recip();
        let usable = inverse.gt(inverse.splat(0.0)) & inverse.lt(inverse.splat(f32::INFINITY));
        (self * inverse).where_or(usable, otherwise)
    }

    /// `self` where `mask` is true, `otherwise` elsewhere.
    #[inline(always)]
    pub fn where_or(self, mask: F::Mask, otherwise: Self) -> Self {
        Self::new(
            self.x.where_or(mask, otherwise.x),
            self.y.where_or(mask, otherwise.y),
            self.z.where_or(mask, otherwise.z),
        )
    }

    /// `self` where `mask` is true, zero elsewhere.
    #[inline(always)]
    pub fn only(self, mask: F::Mask) -> Self {
        Self::new(self.x.only(mask), self.y.only(mask), self.z.only(mask))
    }

    /// `self` at 0, `other` at 1.
    #[inline(always)]
    pub fn mix(self, other: Self, at: F) -> Self {
        self + (other - self) * at
    }

    /// Every component between two constants.
    #[inline(always)]
    pub fn clamp(self, low: f32, high: f32) -> Self {
        Self::new(self.x.clamp(low, high), self.y.clamp(low, high), self.z.clamp(low, high))
    }

    /// Without the signs of the components.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self::new(self.x.abs(), self.y.abs(), self.z.abs())
    }

    /// The larger ones, component by component.
    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        Self::new(self.x.max(other.x), self.y.max(other.y), self.z.max(other.z))
    }

    /// Where all components are zero.
    #[inline(always)]
    pub fn is_zero(self) -> F::Mask {
        let zero = self.x.splat(0.0);
        self.x.equals(zero) & self.y.equals(zero) & self.z.equals(zero)
    }

    /// Largest component.
    #[inline(always)]
    pub fn largest(self) -> F {
        self.x.max(self.y).max(self.z)
    }

    /// Relative luminance of linear Rec. 709 RGB (ITU-R BT.709).
    #[inline(always)]
    pub fn luminance(self) -> F {
        self.x * 0.2126 + self.y * 0.7152 + self.z * 0.0722
    }

    /// Every component at least zero.
    #[inline(always)]
    pub fn positive(self) -> Self {
        Self::new(self.x.positive(), self.y.positive(), self.z.positive())
    }

    /// One minus every component.
    #[inline(always)]
    pub fn complement(self) -> Self {
        Self::new(self.x.complement(), self.y.complement(), self.z.complement())
    }
}

impl<F: Real> Add for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl<F: Real> Sub for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl<F: Real> Neg for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

/// Component by component.
impl<F: Real> Mul for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self::new(self.x * other.x, self.y * other.y, self.z * other.z)
    }
}

impl<F: Real> Mul<F> for Vector<F> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: F) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }
}

impl From<Vec3> for Vector<f32> {
    fn from(v: Vec3) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

impl From<Vector<f32>> for Vec3 {
    fn from(v: Vector<f32>) -> Self {
        Self::new(v.x, v.y, v.z)
    }
}

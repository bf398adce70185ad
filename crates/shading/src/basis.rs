//! Orthonormal bases: local shading space ↔ world space.

use crate::lanes::{Real, Vector};

/// An orthonormal basis whose z axis is a surface normal. Local vectors have the normal at (0, 0, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basis<F> {
    /// First tangent.
    pub x: Vector<F>,
    /// Second tangent.
    pub y: Vector<F>,
    /// Normal.
    pub z: Vector<F>,
}

impl<F: Real> Basis<F> {
    /// Any basis around a unit normal.
    ///
    /// # References
    /// Duff et al., "Building an Orthonormal Basis, Revisited", 2017.
    #[inline(always)]
    pub fn from_normal(z: Vector<F>) -> Self {
        let sign = z.x.splat(1.0).copysign(z.z);
        let a = -(sign + z.z).recip();
        let b = z.x * z.y * a;
        Self {
            x: Vector::new(sign * z.x * z.x * a + 1.0, sign * b, -(sign * z.x)),
            y: Vector::new(b, sign + z.y * z.y * a, -z.y),
            z,
        }
    }

    /// Local coordinates of a world-space vector.
    #[inline(always)]
    pub fn to_local(&self, v: Vector<F>) -> Vector<F> {
        Vector::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// World-space vector of local coordinates.
    #[inline(always)]
    pub fn to_world(&self, v: Vector<F>) -> Vector<F> {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

//! Orthonormal bases: local shading space ↔ world space.

use glam::Vec3;

/// An orthonormal basis whose z axis is a surface normal. Local vectors have the normal at (0, 0, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basis {
    /// First tangent.
    pub x: Vec3,
    /// Second tangent.
    pub y: Vec3,
    /// Normal.
    pub z: Vec3,
}

impl Basis {
    /// Any basis around a unit normal.
    pub fn from_normal(z: Vec3) -> Self {
        let (x, y) = z.any_orthonormal_pair();
        Self { x, y, z }
    }

    /// Local coordinates of a world-space vector.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// World-space vector of local coordinates.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

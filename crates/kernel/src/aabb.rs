//! Axis-aligned bounding boxes: the one volume that every accelerator speaks.
use glam::{Affine3A, Vec3, Vec3A};

/// An axis-aligned box, closed on all sides. The empty box has inverted infinite corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Aabb {
    /// The box that holds nothing and is the neutral element of [`Aabb::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box of two opposite corners, given as (smallest, largest).
    #[must_use]
    pub const fn new(min: Vec3, max: Vec3) -> Self {
        Self { min, max }
    }

    /// The smallest box around `points`. Points that are not finite widen it to match.
    #[must_use]
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::including)
    }

    /// This box grown to hold `point`.
    #[must_use]
    pub fn including(self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box around both boxes.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// True if no point lies inside, as in [`Aabb::EMPTY`].
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The middle of the box; meaningless for an empty one.
    #[must_use]
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Edge lengths along the three axes; zero for an empty box.
    #[must_use]
    pub fn size(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.max - self.min }
    }

    /// Surface area; zero for an empty box.
    #[must_use]
    pub fn area(&self) -> f32 {
        let s = self.size();
        2.0 * (s.x * s.y + s.y * s.z + s.z * s.x)
    }

    /// True if `point` lies inside or on the surface.
    #[must_use]
    pub fn contains(&self, point: Vec3) -> bool {
        self.min.cmple(point).all() && self.max.cmpge(point).all()
    }

    /// The box around this box after `transform`, widened by a few rounding errors so that it holds the
    /// transformed content for certain. An empty box stays empty.
    #[must_use]
    pub fn transformed(&self, transform: &Affine3A) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let center = Vec3A::from(self.center());
        let half = Vec3A::from((self.max * 0.5 - self.min * 0.5) * (1.0 + 4.0 * f32::EPSILON));
        let m = transform.matrix3;
        let (x, y, z) = (m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
        let mid = transform.transform_point3a(center);
        let reach = x * half.x + y * half.y + z * half.z;
        // The rounding error of the middle is bounded by the magnitudes that were summed, not by the result.
        let terms =
            x * center.x.abs() + y * center.y.abs() + z * center.z.abs() + transform.translation.abs();
        let half = reach + (terms + reach) * (4.0 * f32::EPSILON);
        Self { min: (mid - half).into(), max: (mid + half).into() }
    }
}

impl Default for Aabb {
    fn default() -> Self {
        Self::EMPTY
    }
}

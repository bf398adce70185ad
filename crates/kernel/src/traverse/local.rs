//! A ray in the space of the object at hand, checked to lie in the range where the arithmetic holds.
use glam::{Affine3A, Vec3A};

use crate::{ray::Ray, triangle_bvh::MAX_COORDINATE};

/// Lengths of directions (largest component) that are accepted.
const DIRECTION_RANGE: std::ops::RangeInclusive<f32> = 1.0e-12..=1.0e12;

#[derive(Clone, Copy, Debug)]
pub(super) struct LocalRay {
    pub origin: Vec3A,
    pub direction: Vec3A,
    /// Not negative.
    pub t_min: f32,
}

impl LocalRay {
    /// The world-space ray, or `None` if it can hit nothing.
    #[inline(always)]
    pub(super) fn new(ray: &Ray) -> Option<Self> {
        if ray.t_min.is_nan() {
            return None;
        }
        let t_min = ray.t_min.max(0.0);
        let local = Self { origin: ray.origin.into(), direction: ray.direction.into(), t_min };
        (local.in_range() && t_min < ray.t_max).then_some(local)
    }

    /// The ray carried into another space; parameters stay the same. `None` if it leaves the usable range.
    #[inline(always)]
    pub(super) fn transformed(&self, map: &Affine3A) -> Option<Self> {
        let local = Self {
            origin: map.transform_point3a(self.origin),
            direction: map.transform_vector3a(self.direction),
            t_min: self.t_min,
        };
        local.in_range().then_some(local)
    }

    #[inline(always)]
    pub(super) fn in_range(&self) -> bool {
        // Both comparisons are false for NaN; the sum catches a NaN that maxima might drop.
        let (o, d) = (self.origin.abs(), self.direction.abs());
        let d_sum = d.x + d.y + d.z;
        o.cmple(Vec3A::splat(MAX_COORDINATE)).all()
            && d_sum.is_finite()
            && DIRECTION_RANGE.contains(&d.max_element())
    }
}

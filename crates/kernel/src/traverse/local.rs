//! A ray in the space of the object at hand, checked to lie in the range where the arithmetic holds.
use glam::{Affine3A, Vec3A};

use crate::{ray::Ray, triangle_bvh::MAX_COORDINATE};

#[derive(Clone, Copy, Debug)]
pub(super) struct LocalRay {
    pub origin: Vec3A,
    pub direction: Vec3A,
    /// Not negative.
    pub t_min: f32,
    /// The last distance that counts, whatever the ray met so far.
    pub end: f32,
    /// The moment in the shutter interval, in 0..=1.
    pub time: f32,
}

/// Trees are walked so much farther than to the hit so far: what coincides with it must be met too, for the choice
/// between them not to depend on the order of the walk, and distances from the boxes' and the triangles' arithmetic
/// differ by roundings over the cosine between ray and normal.
pub(super) const REACH: f32 = 1.0 + 1.0 / 8192.0;

/// How far boxes count for a hit at `t`; finite.
#[inline(always)]
pub(super) fn behind(t: f32) -> f32 {
    (t * REACH).min(f32::MAX)
}

/// The float before `t_max`, which is positive or belongs to a ray that can hit nothing.
#[inline(always)]
pub(super) const fn before(t_max: f32) -> f32 {
    f32::from_bits(t_max.to_bits().wrapping_sub(1))
}

impl LocalRay {
    /// Largest components of directions that are accepted.
    pub(super) const DIRECTION_RANGE: std::ops::RangeInclusive<f32> = 1.0e-12..=1.0e12;

    #[inline(always)]
    pub(super) fn origin_in_range(origin: Vec3A) -> bool {
        origin.abs().cmple(Vec3A::splat(MAX_COORDINATE)).all()
    }

    /// The world-space ray, or `None` if it can hit nothing.
    #[inline(always)]
    pub(super) fn new(ray: &Ray) -> Option<Self> {
        if ray.t_min.is_nan() {
            return None;
        }
        let local = Self::unchecked(ray);
        (local.in_range() && local.t_min < ray.t_max).then_some(local)
    }

    /// A ray that [`LocalRay::new`] accepts.
    #[inline(always)]
    pub(super) fn unchecked(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.into(),
            direction: ray.direction.into(),
            t_min: ray.t_min.max(0.0),
            end: before(ray.t_max),
            time: ray.clamped_time(),
        }
    }

    /// The ray carried into another space; parameters stay the same. `None` if it leaves the usable range.
    #[inline(always)]
    pub(super) fn transformed(&self, map: &Affine3A) -> Option<Self> {
        let local = Self {
            origin: map.transform_point3a(self.origin),
            direction: map.transform_vector3a(self.direction),
            t_min: self.t_min,
            end: self.end,
            time: self.time,
        };
        local.in_range().then_some(local)
    }

    /// How far to look, end included, once something is known to lie at `t`.
    #[inline(always)]
    pub(super) fn reach(&self, t: f32) -> f32 {
        (t * REACH).min(self.end)
    }

    #[inline(always)]
    pub(super) fn in_range(&self) -> bool {
        // Comparisons are false for NaN; a maximum alone might drop one.
        let d = self.direction.abs();
        Self::origin_in_range(self.origin)
            && d.cmple(Vec3A::splat(*Self::DIRECTION_RANGE.end())).all()
            && d.max_element() >= *Self::DIRECTION_RANGE.start()
    }
}

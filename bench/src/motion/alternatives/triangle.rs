//! A triangle by itself, for the methods that keep no tree.

use heliostat::kernel::Ray;
use heliostat::kernel::glam::{DVec3, Vec3};

/// Corners in world space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle(pub(super) [Vec3; 3]);

impl Triangle {
    /// Where a ray meets it, in double precision.
    ///
    /// # References
    /// Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
    pub(super) fn intersect(&self, ray: &Ray) -> Option<f32> {
        let [a, b, c] = self.0.map(Vec3::as_dvec3);
        let (origin, direction): (DVec3, DVec3) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (ab, ac) = (b - a, c - a);
        let p = direction.cross(ac);
        let determinant = ab.dot(p);
        if determinant == 0.0 {
            return None;
        }
        let s = origin - a;
        let u = s.dot(p) / determinant;
        let q = s.cross(ab);
        let v = direction.dot(q) / determinant;
        let t = (ac.dot(q) / determinant) as f32;
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        (inside && t > ray.t_min && t < ray.t_max).then_some(t)
    }

    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        let [a, b, c] = self.0;
        (a.min(b).min(c), a.max(b).max(c))
    }
}

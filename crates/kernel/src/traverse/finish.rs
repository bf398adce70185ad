//! From the triangle that a traversal settled on to an exact hit, in double precision.
use glam::{DVec3, Vec3};

use super::local::LocalRay;
use crate::build::triangles::double_area_vector;

/// Distance, barycentrics and unit normal in the object's space.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exact {
    pub t: f32,
    pub u: f32,
    pub v: f32,
    pub normal: Vec3,
}

/// Intersects `ray` with the triangle again. `t` is the traversal's own answer: it stands if the exact one falls
/// outside `t_min < t < t_max`, as it can when the hit lies within a rounding error of an end.
#[inline(always)]
pub(super) fn exact(ray: &LocalRay, corners: [[f32; 3]; 3], t: f32, t_max: f32) -> Exact {
    let [a, b, c] = corners.map(Vec3::from_array);
    let origin: DVec3 = Vec3::from(ray.origin).as_dvec3();
    let direction: DVec3 = Vec3::from(ray.direction).as_dvec3();
    let n = double_area_vector(a, b, c);
    let (p0, p1, p2) = (a.as_dvec3() - origin, b.as_dvec3() - origin, c.as_dvec3() - origin);
    // Weights are the volumes spanned by the ray and each edge, clamped to the triangle.
    let (mut w0, mut w1, mut w2) = (
        direction.dot(p2.cross(p1 - p2)),
        direction.dot(p0.cross(p2 - p0)),
        direction.dot(p1.cross(p0 - p1)),
    );
    let sign = if w0 + w1 + w2 < 0.0 { -1.0 } else { 1.0 };
    (w0, w1, w2) = ((w0 * sign).max(0.0), (w1 * sign).max(0.0), (w2 * sign).max(0.0));
    let sum = w0 + w1 + w2;
    let (u, v) = if sum > 0.0 { (w1 / sum, w2 / sum) } else { (1.0 / 3.0, 1.0 / 3.0) };
    let point = p0 + (p1 - p0) * u + (p2 - p0) * v;
    let exact_t = (point.dot(direction) / direction.length_squared()) as f32;
    let t = if exact_t > ray.t_min && exact_t < t_max { exact_t } else { t };
    let (u, v) = (u as f32, v as f32);
    let normal = n.normalize_or_zero().as_vec3();
    // Rounding both weights up must not leave a negative third one.
    Exact { t, u, v: v.min(1.0 - u), normal }
}

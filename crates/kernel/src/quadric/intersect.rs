//! Ray against sphere and cone: one quadratic, in double precision.
//!
//! The equation is set up around the ray's point nearest to the middle of the shape, so that its coefficients are as
//! large as the shape and not as the distance to it (Hearn and Baker 2004; Haines, Günther and Akenine-Möller 2019).
//! In double precision, from single-precision input, the distance is then right to the last bit but for rays within
//! about 1e-7 radii of being tangent. A ray that leaves from as little as one rounding beside the surface therefore
//! does not meet it again: what remains is the rounding of the starting point, which is the caller's.
//!
//! # References
//! Hearn, Baker 2004, "Computer Graphics with OpenGL", 3rd edition, section 10-8. Haines, Günther, Akenine-Möller 2019,
//! "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems 7. Pharr, Jakob, Humphreys 2016, "Physically
//! Based Rendering", 3rd edition, section 3.9.4 (why rounding shows as self-shadowing).

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::{Quadric, cone_axes};

/// Where a ray meets a shape, in the shape's space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    pub t: f32,
    /// From the middle of the shape.
    pub point: DVec3,
}

/// A shape around its middle.
enum Centered {
    Sphere {
        radius: f64,
    },
    /// Unit axis, half height, radius in the middle, and how it grows per unit of height.
    Cone {
        axis: DVec3,
        half: f64,
        radius: f64,
        growth: f64,
    },
}

impl Quadric {
    fn centered(&self) -> Option<(DVec3, Centered)> {
        match *self {
            Self::Sphere { center, radius } => {
                Some((center.as_dvec3(), Centered::Sphere { radius: f64::from(radius.abs()) }))
            }
            Self::Cone { base, base_radius, apex, apex_radius } => {
                let [axis, ..] = cone_axes(base, apex)?;
                let (base, apex) = (base.as_dvec3(), apex.as_dvec3());
                let (r0, r1) = (f64::from(base_radius.abs()), f64::from(apex_radius.abs()));
                let half = 0.5 * (apex - base).length();
                let shape =
                    Centered::Cone { axis, half, radius: 0.5 * (r0 + r1), growth: (r1 - r0) / (2.0 * half) };
                Some((0.5 * (base + apex), shape))
            }
        }
    }

    /// The nearest crossing with `t_min < t < t_max`.
    pub(crate) fn intersect(
        &self,
        origin: Vec3,
        direction: Vec3,
        t_min: f32,
        t_max: f32,
    ) -> Option<Crossing> {
        let (middle, shape) = self.centered()?;
        let (from, d) = (origin.as_dvec3() - middle, direction.as_dvec3());
        let nearest = -from.dot(d) / d.length_squared();
        let p = from + d * nearest;
        // Points p + s d with a s² + 2 b s + c = 0.
        let (dd, pd, pp) = (d.length_squared(), p.dot(d), p.length_squared());
        let roots = match shape {
            Centered::Sphere { radius } => solve(dd, pd, pp - radius * radius),
            Centered::Cone { axis, radius, growth, .. } => {
                let (m, n) = (d.dot(axis), p.dot(axis));
                let r = radius + growth * n;
                let (slope, offset) = (growth * m, m * n);
                solve(dd - m * m - slope * slope, pd - offset - slope * r, pp - n * n - r * r)
            }
        };
        let valid = |s: f64| {
            let (t, point) = ((nearest + s) as f32, p + d * s);
            let within = match shape {
                Centered::Sphere { .. } => true,
                Centered::Cone { axis, half, .. } => point.dot(axis).abs() <= half,
            };
            (within && t > t_min && t < t_max).then_some(Crossing { t, point })
        };
        roots.into_iter().find_map(valid)
    }

    /// The middle of the shape, from which crossings are counted.
    pub(crate) fn middle(&self) -> DVec3 {
        self.centered().map_or(DVec3::ZERO, |(middle, _)| middle)
    }

    /// Unit normal on the front side at a crossing.
    pub(crate) fn normal(&self, crossing: &Crossing) -> Vec3 {
        let p = crossing.point;
        let (outwards, sign) = match (*self, self.centered()) {
            (Self::Cone { base_radius, apex_radius, .. }, Some((_, Centered::Cone { axis, growth, .. }))) => {
                let around = (p - axis * p.dot(axis)).normalize_or_zero();
                (around - axis * growth, base_radius + apex_radius)
            }
            (Self::Sphere { radius, .. }, _) => (p, radius),
            (Self::Cone { .. }, _) => (DVec3::ZERO, 1.0),
        };
        outwards.normalize_or_zero().as_vec3() * sign.signum()
    }

    /// (u, v) of a point of the shape, given from its middle.
    pub(crate) fn coordinates(&self, p: DVec3) -> [f32; 2] {
        let turn = |y: f64, x: f64| (y.atan2(x) / TAU).rem_euclid(1.0) as f32;
        match *self {
            Self::Sphere { .. } => [turn(p.z, p.x), (p.x.hypot(p.z).atan2(p.y) / PI) as f32],
            Self::Cone { base, apex, .. } => {
                let Some([axis, x, y]) = cone_axes(base, apex) else { return [0.0; 2] };
                let height = (apex.as_dvec3() - base.as_dvec3()).length();
                [turn(p.dot(y), p.dot(x)), (0.5 + p.dot(axis) / height).clamp(0.0, 1.0) as f32]
            }
        }
    }
}

/// The roots of a s² + 2 b s + c in ascending order, without cancellation; NaN where there is none.
fn solve(a: f64, b: f64, c: f64) -> [f64; 2] {
    let discriminant = b * b - a * c;
    if discriminant.is_nan() || discriminant < 0.0 {
        return [f64::NAN; 2];
    }
    let q = -(b + discriminant.sqrt().copysign(b));
    let (one, other) = (q / a, c / q);
    if one > other { [other, one] } else { [one, other] }
}

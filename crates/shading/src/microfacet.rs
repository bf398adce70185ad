//! The isotropic GGX microfacet distribution with Smith masking; vectors are in local space (normal = +Z).
//!
//! # References
//! Walter et al., "Microfacet Models for Refraction through Rough Surfaces", 2007. Heitz, "Understanding the
//! Masking-Shadowing Function", 2014. Dupuy, Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023.

use std::f32::consts::PI;

use crate::lanes::{Real, Vector, cos_sin_turns};

/// Below this α a surface is treated as perfectly smooth: floats cannot resolve the lobe.
pub const SMOOTH_ALPHA: f32 = 1e-3;

/// Density of microfacet normals D(h), per steradian of projected area.
#[inline(always)]
pub fn density<F: Real>(h: Vector<F>, alpha: F) -> F {
    let a2 = alpha * alpha;
    // sin² from x and y: 1 − z² would cancel for narrow lobes.
    let s = h.z * h.z * a2 + h.x * h.x + h.y * h.y;
    a2 / (s * s * PI)
}

/// D G2 / (4 cos θo) and the density D G1 / (4 cos θo) of reflection about a microfacet normal along `h`, which need not have unit
/// length, for the cosines of both directions with the normal. With as few divisions as there are results: these weigh most.
#[inline(always)]
pub fn reflection<F: Real>(normal: Vector<F>, h: Vector<F>, [cos_o, cos_i]: [F; 2], alpha: F) -> (F, F) {
    let (a2, h2, cos_h) = (alpha * alpha, h.length_squared(), normal.dot(h));
    // sin² by the vector product, as above.
    let s = (cos_h * cos_h * a2 + normal.cross(h).length_squared()).max(alpha.splat(f32::MIN_POSITIVE));
    let (above, below) = (a2 * h2 * h2, s * s * (2.0 * PI));
    let (out, back) = (projected(cos_o, alpha), projected(cos_i, alpha));
    (above * cos_i / (below * (cos_i * out + cos_o * back)), above / (below * (cos_o + out)))
}

/// Smith's masking G1 for a direction with cosine `cos` > 0.
#[inline(always)]
pub fn masking<F: Real>(cos: F, alpha: F) -> F {
    cos * 2.0 / (cos + projected(cos, alpha))
}

/// Height-correlated masking and shadowing G2 of two directions on the same side.
pub fn masking_shadowing(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    cos_o * cos_i * 2.0 / (cos_i * projected(cos_o, alpha) + cos_o * projected(cos_i, alpha))
}

/// √(α² + (1 − α²) cos²)
#[inline(always)]
fn projected<F: Real>(cos: F, alpha: F) -> F {
    let a2 = alpha * alpha;
    (a2 + a2.complement() * cos * cos).sqrt()
}

/// Density of the normals visible from `wo`: G1 ⟨wo·h⟩ D / cos θo.
#[inline(always)]
pub fn visible_density<F: Real>(wo: Vector<F>, h: Vector<F>, alpha: F) -> F {
    masking(wo.z, alpha) * wo.dot(h).positive() * density(h, alpha) / wo.z
}

/// A microfacet normal visible from `wo`, distributed by [`visible_density`].
#[inline(always)]
pub fn sample_visible<F: Real>(wo: Vector<F>, alpha: F, u: [F; 2]) -> Vector<F> {
    let up = Vector::new(alpha.splat(0.0), alpha.splat(0.0), alpha.splat(1.0));
    let stretched = Vector::new(wo.x * alpha, wo.y * alpha, wo.z).normalized_or(up);
    // A uniform point of the spherical cap of reflected directions, then the halfway vector.
    let z = u[1].complement() * (stretched.z + 1.0) - stretched.z;
    let r = (z * z).complement().positive().sqrt();
    let (cos, sin) = cos_sin_turns(u[0]);
    let h = Vector::new(r * cos, r * sin, z) + stretched;
    Vector::new(h.x * alpha, h.y * alpha, h.z.max(alpha.splat(1e-12))).normalized_or(up)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use glam::{Vec2, Vec3};

    use super::*;

    #[test]
    fn normals_are_normalised_over_projected_area() {
        // ∫ D(h) cos θ dω = 1, by midpoints in tan θ where narrow lobes are smooth.
        for alpha in [0.01_f32, 0.1, 0.5, 1.0] {
            let n = 20_000;
            let integral: f64 = (0..n)
                .map(|i| {
                    let u = (i as f32 + 0.5) / n as f32;
                    let tan2 = alpha * alpha * u / (1.0 - u);
                    let cos = (1.0 / (1.0 + tan2)).sqrt();
                    let sin = (1.0 - cos * cos).max(0.0).sqrt();
                    // dω = 2π sin dθ; with u = tan²/(α² + tan²): dθ = α² (1 + tan²)^-1 / (2 tan (1 − u)²) du.
                    let tan = tan2.sqrt();
                    let d_theta = alpha * alpha / ((1.0 + tan2) * 2.0 * tan * (1.0 - u) * (1.0 - u));
                    f64::from(density(Vector::new(sin, 0.0, cos), alpha) * cos * TAU * sin * d_theta)
                })
                .sum::<f64>()
                / f64::from(n);
            assert!((integral - 1.0).abs() < 2e-3, "α = {alpha}: {integral}");
        }
    }

    #[test]
    fn visible_normals_follow_their_density() {
        // E[1/pdf over a set] = its measure: the mean of cos-weighted tests must match quadrature on a fine grid.
        let (wo, alpha, n) = (Vec3::new(0.8, 0.0, 0.6), 0.4, 400);
        let mut sampled = Vec3::ZERO;
        let mut integrated = Vec3::ZERO;
        for i in 0..n * n {
            let u = (Vec2::new((i % n) as f32, (i / n) as f32) + 0.5) / n as f32;
            sampled += Vec3::from(sample_visible(wo.into(), alpha, u.into())) / (n * n) as f32;
            let cos = u.x;
            let h = ((1.0 - cos * cos).sqrt() * Vec2::from_angle(TAU * u.y)).extend(cos);
            integrated += h * visible_density(wo.into(), h.into(), alpha) * TAU / (n * n) as f32;
        }
        assert!((sampled - integrated).length() < 5e-3, "{sampled} against {integrated}");
    }
}

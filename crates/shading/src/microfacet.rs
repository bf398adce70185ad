//! The isotropic GGX microfacet distribution with Smith masking, in local space (normal = +Z).
//!
//! # References
//! Walter et al., "Microfacet Models for Refraction through Rough Surfaces", 2007. Heitz, "Understanding the
//! Masking-Shadowing Function", 2014. Dupuy, Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

/// Below this α a surface is treated as perfectly smooth: floats cannot resolve the lobe.
pub const SMOOTH_ALPHA: f32 = 1e-3;

/// Density of microfacet normals D(h), per steradian of projected area.
pub fn density(h: Vec3, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    // sin² from x and y: 1 − z² would cancel for narrow lobes.
    let s = h.z * h.z * a2 + h.x * h.x + h.y * h.y;
    a2 / (PI * s * s)
}

/// Smith's masking G1 for a direction with cosine `cos` > 0.
pub fn masking(cos: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    2.0 * cos / (cos + (a2 + (1.0 - a2) * cos * cos).sqrt())
}

/// Height-correlated masking and shadowing G2 of two directions on the same side.
pub fn masking_shadowing(cos_o: f32, cos_i: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let lambda = |c: f32| (a2 + (1.0 - a2) * c * c).sqrt();
    2.0 * cos_o * cos_i / (cos_i * lambda(cos_o) + cos_o * lambda(cos_i))
}

/// Density of the normals visible from `wo`: G1 ⟨wo·h⟩ D / cos θo.
pub fn visible_density(wo: Vec3, h: Vec3, alpha: f32) -> f32 {
    masking(wo.z, alpha) * wo.dot(h).max(0.0) * density(h, alpha) / wo.z
}

/// A microfacet normal visible from `wo`, distributed by [`visible_density`].
pub fn sample_visible(wo: Vec3, alpha: f32, u: Vec2) -> Vec3 {
    let stretched = Vec3::new(wo.x * alpha, wo.y * alpha, wo.z).normalize();
    // A uniform point of the spherical cap of reflected directions, then the halfway vector.
    let z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    let r = (1.0 - z * z).max(0.0).sqrt();
    let h = (r * Vec2::from_angle(TAU * u.x)).extend(z) + stretched;
    Vec3::new(h.x * alpha, h.y * alpha, h.z.max(1e-12)).normalize()
}

#[cfg(test)]
mod tests {
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
                    f64::from(density(Vec3::new(sin, 0.0, cos), alpha) * cos * TAU * sin * d_theta)
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
            sampled += sample_visible(wo, alpha, u) / (n * n) as f32;
            let cos = u.x;
            let h = ((1.0 - cos * cos).sqrt() * Vec2::from_angle(TAU * u.y)).extend(cos);
            integrated += h * visible_density(wo, h, alpha) * TAU / (n * n) as f32;
        }
        assert!((sampled - integrated).length() < 5e-3, "{sampled} against {integrated}");
    }
}

//! Reflectance and refraction at smooth interfaces.

use crate::lanes::{Real, Vector};

/// Fresnel reflectance of a dielectric for unpolarised light. `cos_i` ≥ 0 is the cosine on the incident side, `eta`
/// the index on the transmitted side over that on the incident side. 1 under total internal reflection.
#[inline(always)]
pub fn dielectric<F: Real>(cos_i: F, eta: F) -> F {
    let sin2_t = (cos_i * cos_i).complement().positive() / (eta * eta);
    let cos_t = sin2_t.complement().positive().sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let partial = (parallel * parallel + perpendicular * perpendicular) * 0.5;
    partial.where_or(sin2_t.lt(sin2_t.splat(1.0)), sin2_t.splat(1.0))
}

/// Reflectance at normal incidence; an index of 0 reflects everything (KHR_materials_ior).
pub fn normal_incidence(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

/// (1 − cos)⁵, the blend from `f0` to `f90` in Schlick's approximation.
///
/// # References
/// Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", 1994.
#[inline(always)]
pub fn schlick_weight<F: Real>(cos: F) -> F {
    let m = cos.complement().clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// Direction refracted by Snell's law: `w` points away from the surface on the incident side, `n` is the unit
/// normal on the same side. The mask is false under total internal reflection.
#[inline(always)]
pub fn refract<F: Real>(w: Vector<F>, n: Vector<F>, eta: F) -> (Vector<F>, F::Mask) {
    let cos_i = w.dot(n);
    let sin2_t = (cos_i * cos_i).complement().positive() / (eta * eta);
    let cos_t = sin2_t.complement().positive().sqrt();
    let inverse = eta.recip();
    (n * (cos_i * inverse - cos_t) - w * inverse, sin2_t.lt(sin2_t.splat(1.0)))
}

/// Mirror direction of `w` about `n`.
#[inline(always)]
pub fn reflect<F: Real>(w: Vector<F>, n: Vector<F>) -> Vector<F> {
    n * (w.dot(n) * 2.0) - w
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn fresnel_textbook_values() {
        // Air to glass at normal incidence: ((1.5 − 1)/(1.5 + 1))² = 0.04.
        assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-6);
        assert!((normal_incidence(1.5) - 0.04).abs() < 1e-6);
        assert_eq!(normal_incidence(0.0), 1.0);
        // Brewster's angle: the parallel part vanishes, R = ½ ((η² − 1)/(η² + 1))².
        let brewster = 1.5_f32.atan();
        assert!((dielectric(brewster.cos(), 1.5) - 0.5 * (1.25_f32 / 3.25).powi(2)).abs() < 1e-6);
        // Grazing and total internal reflection (critical angle of glass: 41.8°).
        assert!((dielectric(0.0, 1.5) - 1.0).abs() < 1e-6);
        assert_eq!(dielectric(42.0_f32.to_radians().cos(), 1.0 / 1.5), 1.0);
        assert!(dielectric(41.5_f32.to_radians().cos(), 1.0 / 1.5) < 1.0);
        // Reversibility (Stokes): the same reflectance from both sides along one path.
        let (outside, inside) = (30.0_f32.to_radians(), (0.5_f32 / 1.5).asin());
        assert!((dielectric(outside.cos(), 1.5) - dielectric(inside.cos(), 1.0 / 1.5)).abs() < 1e-6);
    }

    #[test]
    fn snell_holds() {
        let n = Vector::from(Vec3::Z);
        for degrees in [0.0_f32, 10.0, 45.0, 80.0] {
            let w = Vector::new(degrees.to_radians().sin(), 0.0, degrees.to_radians().cos());
            let (t, passes) = refract(w, n, 1.5);
            assert!(passes, "no total reflection into glass");
            assert!((t.length() - 1.0).abs() < 1e-6);
            assert!((-t.x * 1.5 - w.x).abs() < 1e-6, "sin θi = 1.5 sin θt");
            let (back, passes) = refract(t, -n, 1.0 / 1.5);
            assert!(passes && (back - w).length() < 1e-5, "{back:?} against {w:?}");
        }
        assert!(!refract(Vector::new(0.8, 0.0, 0.6), n, 1.0 / 1.5).1);
    }
}

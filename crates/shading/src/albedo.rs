//! Directional albedo of GGX lobes: what single scattering keeps, so that the rest can be given back.
//!
//! # References
//! Kulla, Conty, "Revisiting Physically Based Shading at Imageworks", 2017 (the lost energy and its tables).
//! Turquin, "Practical Multiple Scattering Compensation for Microfacet Models", 2019 (scaling the lobe instead of
//! adding one).

use std::sync::LazyLock;

use glam::Vec2;

use crate::fresnel;
use crate::lanes::{LaneFn, Real, Vector};
use crate::microfacet::{SMOOTH_ALPHA, masking, masking_shadowing, sample_visible};

const COSINES: usize = 32;
const ROUGHNESSES: usize = 32;
const SAMPLES: u32 = 1024;

/// A function of cos θo and perceptual roughness, tabulated with denser cosines towards grazing angles.
#[derive(Clone, Debug)]
pub struct Table {
    /// `ROUGHNESSES` rows of `COSINES` entries.
    values: Vec<Vec2>,
}

impl Table {
    fn new(entry: impl Fn(f32, f32) -> Vec2) -> Self {
        let node = |i: usize, n: usize| i as f32 / (n - 1) as f32;
        let values = (0..COSINES * ROUGHNESSES)
            .map(|i| {
                let (column, row) = (i % COSINES, i / COSINES);
                let cos = node(column, COSINES).powi(2).max(1e-5);
                let alpha = node(row, ROUGHNESSES).powi(2).max(SMOOTH_ALPHA);
                entry(cos, alpha)
            })
            .collect();
        Self { values }
    }

    /// Bilinear lookup at cos θo in [0, 1] and GGX α in [0, 1]: both entries.
    #[inline(always)]
    pub fn lookup<F: Real>(&self, cos: F, alpha: F) -> [F; 2] {
        F::each([cos, alpha], self)
    }
}

impl LaneFn<2, 2> for Table {
    fn at(&self, [cos, alpha]: [f32; 2]) -> [f32; 2] {
        let split = |node: f32, n: usize| {
            let at = node.clamp(0.0, 1.0) * (n - 1) as f32;
            let index = (at as usize).min(n - 2);
            (index, at - index as f32)
        };
        let (x, fx) = split(cos.max(0.0).sqrt(), COSINES);
        let (y, fy) = split(alpha.max(0.0).sqrt(), ROUGHNESSES);
        let at = |x: usize, y: usize| self.values[y * COSINES + x];
        at(x, y).lerp(at(x + 1, y), fx).lerp(at(x, y + 1).lerp(at(x + 1, y + 1), fx), fy).to_array()
    }
}

/// Mean of `value` over visible normals of a direction with cosine `cos`; it gets the direction and the normal.
fn mean_over_normals(cos: f32, alpha: f32, value: impl Fn(Vector<f32>, Vector<f32>) -> Vec2) -> Vec2 {
    let wo = Vector::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let mut sum = Vec2::ZERO;
    for i in 0..SAMPLES {
        let radical_inverse = (i.reverse_bits() >> 8) as f32 / (1 << 24) as f32;
        let u = [(i as f32 + 0.5) / SAMPLES as f32, radical_inverse];
        sum += value(wo, sample_visible(wo, alpha, u));
    }
    sum / SAMPLES as f32
}

/// Albedo of the reflection lobe under Schlick's Fresnel term: `f0 · x + f90 · y`. `x + y` is the albedo under F = 1.
pub fn reflection() -> &'static Table {
    static TABLE: LazyLock<Table> = LazyLock::new(|| {
        Table::new(|cos, alpha| {
            mean_over_normals(cos, alpha, |wo, h| {
                let wi = fresnel::reflect(wo, h);
                if wi.z <= 0.0 {
                    return Vec2::ZERO;
                }
                let weight = masking_shadowing(wo.z, wi.z, alpha) / masking(wo.z, alpha);
                let schlick = fresnel::schlick_weight(wo.dot(h));
                weight * Vec2::new(1.0 - schlick, schlick)
            })
        })
    });
    &TABLE
}

/// Albedo of a rough dielectric interface seen from either side: reflection in x, transmission in y.
#[derive(Clone, Debug)]
pub struct InterfaceTables {
    /// Seen from outside: relative index `ior`.
    pub entering: Table,
    /// Seen from inside: relative index 1/`ior`.
    pub leaving: Table,
}

impl InterfaceTables {
    /// Tabulates an interface to a solid of index `ior` > 0. Takes some tens of milliseconds: keep it.
    pub fn new(ior: f32) -> Self {
        let table = |eta: f32| {
            Table::new(|cos, alpha| {
                mean_over_normals(cos, alpha, |wo, h| {
                    let reflectance = fresnel::dielectric(wo.dot(h).max(0.0), eta);
                    let reflected = fresnel::reflect(wo, h);
                    let kept_reflected = match reflected.z > 0.0 {
                        true => masking_shadowing(wo.z, reflected.z, alpha) / masking(wo.z, alpha),
                        false => 0.0,
                    };
                    let kept_transmitted = match fresnel::refract(wo, h, eta) {
                        (wi, true) if wi.z < 0.0 => masking(-wi.z, alpha),
                        _ => 0.0,
                    };
                    Vec2::new(reflectance * kept_reflected, (1.0 - reflectance) * kept_transmitted)
                })
            })
        };
        Self { entering: table(ior), leaving: table(1.0 / ior) }
    }
}

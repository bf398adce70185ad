//! Scattering of light that comes from its source: what light paths need of lobes that are made for a viewer.
//!
//! What reflecting layers keep from the diffuse lobe below depends on the direction of the viewer alone, so the scattering
//! function is not the same both ways. A light path knows where light comes from and takes that for the viewer; where it
//! leaves for, the true viewer is.
//!
//! # References
//! Veach, "Non-symmetric Scattering in Light Transport Algorithms", 1996.

use std::f32::consts::FRAC_1_PI;

use crate::bsdf::{Bsdf, BsdfSample, Reflection};
use crate::lanes::Vector;
use crate::lobe_set::{Lobes, Selection};
use crate::lobes::kept_by_ggx;

/// Nodes and weights of Gauss and Legendre on [0, 1]: exact for polynomials up to degree 7.
const NODES: [(f32, f32); 4] = [
    (0.069_431_84, 0.173_927_42),
    (0.330_009_5, 0.326_072_58),
    (0.669_990_5, 0.326_072_58),
    (0.930_568_16, 0.173_927_42),
];
/// Mean of (1 − cos)⁵ over the directions of a diffuse lobe.
const MEAN_RIM: f32 = 1.0 / 21.0;

/// How a point sends on the light that it receives if taken for a patch: π times radiance over irradiance along the normal, and
/// by which share that is less at the horizon, with Schlick's term between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchReflectance {
    /// Along the normal.
    pub normal: Vector<f32>,
    /// In [0, 1].
    pub rim: f32,
}

/// In each method the direction that lobes were made for is where light comes from.
impl Bsdf<f32> {
    /// Reflectance of the diffuse lobe for a viewer at a cosine. Exact for dielectrics under a coat or none; metal that is mixed
    /// in is taken for a dielectric.
    pub(crate) fn diffuse_at(&self, cos: f32) -> Vector<f32> {
        let own = self.normal.dot(self.wo).clamp(1e-5, 1.0);
        let cos = cos.clamp(1e-5, 1.0);
        let one = Vector::grey(1.0);
        let (mut before, mut after) = (one, one);
        let mut uncoated = 1.0;
        if self.lobes.contains(Lobes::COAT) {
            uncoated = 1.0 - reflected(&self.coat, own).x;
            before = before.scaled(uncoated);
            after = after.scaled(1.0 - reflected(&self.coat, cos).x);
        }
        if self.lobes.contains(Lobes::SPECULAR) && uncoated > 0.0 {
            let below = 1.0 / uncoated;
            before = before * reflected(&self.specular, own).scaled(below).complement();
            after = after * reflected(&self.specular, cos).scaled(below).complement();
        }
        let ratio = |before: f32, after: f32| if before > 0.0 { after.max(0.0) / before } else { 0.0 };
        let ratio = Vector::new(ratio(before.x, after.x), ratio(before.y, after.y), ratio(before.z, after.z));
        self.diffuse * ratio
    }

    /// What the selected reflecting lobes make of a point that light has reached. Gloss is spread as a diffuse lobe of its albedo.
    pub fn as_patch(&self, which: Selection) -> PatchReflectance {
        let (chances, _) = self.chances(which);
        let black = Vector::grey(0.0);
        let mut spread = black;
        let own = self.normal.dot(self.wo).clamp(1e-5, 1.0);
        for (chance, lobe) in [(chances[1], &self.specular), (chances[2], &self.coat)] {
            if chance > 0.0 {
                spread = spread + reflected(lobe, own);
            }
        }
        if chances[0] == 0.0 {
            return PatchReflectance { normal: spread, rim: 0.0 };
        }
        let mean = NODES
            .iter()
            .fold(black, |sum, &(cos, weight)| sum + self.diffuse_at(cos).scaled(2.0 * cos * weight));
        let along = self.diffuse_at(1.0).luminance();
        let rim =
            if along > 0.0 { ((1.0 - mean.luminance() / along) / MEAN_RIM).clamp(0.0, 1.0) } else { 0.0 };
        // The mean is what counts: it is kept whatever the shape.
        let diffuse = mean.scaled(1.0 / (1.0 - rim * MEAN_RIM));
        let normal = diffuse + spread;
        let share = diffuse.luminance() / normal.luminance();
        PatchReflectance { normal, rim: if share.is_finite() { rim * share } else { 0.0 } }
    }

    /// Samples where light goes on. Its weight is for flux: refraction does not squeeze it as it does radiance.
    pub fn sample_onward(&self, u_lobe: f32, u: [f32; 2], which: Selection) -> BsdfSample<f32> {
        let mut sample = self.sample(u_lobe, u, which);
        if sample.transmitted {
            sample.weight = sample.weight.scaled(self.transmitted_eta().powi(2));
        } else if sample.pdf > 0.0 && self.chances(which).0[0] > 0.0 {
            let cos = self.normal.dot(sample.wi).max(0.0);
            let more = self.diffuse_at(cos) - self.diffuse;
            sample.weight = sample.weight + more.scaled(cos * FRAC_1_PI / sample.pdf);
        }
        sample
    }
}

/// Albedo of a reflecting lobe for a viewer at a cosine.
fn reflected(lobe: &Reflection<f32>, cos: f32) -> Vector<f32> {
    let [at_normal, at_horizon] = kept_by_ggx(cos, lobe.alpha);
    lobe.f0.scaled(at_normal) + lobe.f90.scaled(at_horizon)
}

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
use crate::lanes::{Real, Vector};
use crate::lobe_set::{Lobes, Selection};
use crate::lobes::kept_by_ggx;

/// Nodes and weights of Gauss and Legendre on [0, 1]: exact for polynomials up to degree 7.
const NODES: [(f32, f32); 4] = [
    (0.069_431_84, 0.173_927_42),
    (0.330_009_5, 0.326_072_58),
    (0.669_990_5, 0.326_072_58),
    (0.930_568_16, 0.173_927_42),
];
/// Lobes at angles beyond are as at this cosine: both sides of a quotient vanish there.
const LEAST_COSINE: f32 = 1e-4;
/// Gloss of at most this GGX α is nearly the same from either end: what multiple scattering gives back is little.
const ALIKE: f32 = 0.25;
/// Cosines at which what lobes keep is interpolated exactly.
const KEPT_AT: [f32; 4] = [0.05, 0.3, 0.65, 1.0];
/// Mean of (1 − cos)⁵ over the directions of a diffuse lobe.
pub(crate) const MEAN_RIM: f32 = 1.0 / 21.0;

/// How a point sends on the light that it receives if taken for a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchReflectance {
    /// Of the diffuse lobe: π times radiance over irradiance along the normal.
    pub diffuse: Vector<f32>,
    /// By which share that is less at the horizon, with Schlick's term between; in [0, 1].
    pub rim: f32,
    /// The other lobes, if there are any.
    pub gloss: Option<PatchGloss>,
}

/// Rough lobes of a point that light has reached from one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatchGloss {
    /// Unit vector towards where the light came from.
    wo: Vector<f32>,
    /// The base's and the coat's.
    lobes: [Option<PatchLobe>; 2],
    /// Share of the light that they reflect.
    pub(crate) albedo: Vector<f32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct PatchLobe {
    normal: Vector<f32>,
    /// Without what multiple scattering gives back.
    lobe: Reflection<f32>,
    /// What single scattering keeps of white light, by powers of the viewer's cosine.
    kept: [f32; 4],
}

impl PatchLobe {
    /// From a lobe made for a viewer at a cosine. It is taken for one of a single kind, metal or dielectric, under no coat.
    fn new(normal: Vector<f32>, lobe: &Reflection<f32>, cos: f32) -> Self {
        let kept = |cos| kept_by_ggx(cos, lobe.alpha).iter().sum::<f32>();
        let lost = 1.0 / kept(cos).max(1e-3) - 1.0;
        // What is stored is f0 + lost · f0².
        let single = |f0: f32| 2.0 * f0 / (1.0 + (1.0 + 4.0 * lost * f0).sqrt());
        let f0 = Vector::new(single(lobe.f0.x), single(lobe.f0.y), single(lobe.f0.z));
        let given = |f0: f32| 1.0 / (1.0 + lost * f0);
        let given = Vector::new(given(f0.x), given(f0.y), given(f0.z));
        let single = Reflection { f0, f90: lobe.f90 * given, alpha: lobe.alpha };
        Self { normal, lobe: single, kept: cubic(KEPT_AT, KEPT_AT.map(kept)) }
    }

    /// Of light towards a unit vector: f · cos, and the cosine. `wo` is where it came from.
    #[inline(always)]
    fn value<F: Real>(&self, token: F::Token, wo: Vector<F>, wi: Vector<F>) -> (Vector<F>, F) {
        let constant = |v: Vector<f32>| Vector::<F>::constant(token, v.into());
        let normal = constant(self.normal);
        let (f0, f90) = (constant(self.lobe.f0), constant(self.lobe.f90));
        let lobe = Reflection { f0, f90, alpha: F::constant(token, self.lobe.alpha) };
        let (f_cos, _) = lobe.value(normal, wo, wi);
        let cos = normal.dot(wi).max(F::constant(token, LEAST_COSINE));
        let [a, b, c, d] = self.kept;
        let kept = ((cos * d + c) * cos + b) * cos + a;
        let lost = kept.recip() - 1.0;
        (f_cos * (f0 * lost + Vector::grey(F::constant(token, 1.0))), cos)
    }
}

impl PatchGloss {
    /// Radiance over irradiance towards a unit vector, 1/sr: what the lobes make of light for a viewer there.
    #[inline(always)]
    pub(crate) fn towards<F: Real>(&self, token: F::Token, direction: Vector<F>) -> Vector<F> {
        let wo = Vector::<F>::constant(token, self.wo.into());
        let mut sum = Vector::grey(F::constant(token, 0.0));
        for lobe in self.lobes.iter().flatten() {
            let (f_cos, cos) = lobe.value(token, wo, direction);
            sum = sum + f_cos * cos.recip();
        }
        sum
    }
}

/// The polynomial through four points, by powers.
fn cubic(at: [f32; 4], values: [f32; 4]) -> [f32; 4] {
    // Newton's divided differences, then expanded.
    let mut differences = values;
    for order in 1..4 {
        for i in (order..4).rev() {
            differences[i] = (differences[i] - differences[i - 1]) / (at[i] - at[i - order]);
        }
    }
    let mut powers = [0.0; 4];
    for i in (0..4).rev() {
        for power in (1..4).rev() {
            powers[power] = powers[power - 1] - at[i] * powers[power];
        }
        powers[0] = differences[i] - at[i] * powers[0];
    }
    powers
}

/// A reflection, its normal before it, and the cosine of `wo` with that.
type Gloss<'a> = (Vector<f32>, f32, &'a Reflection<f32>);

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

    /// What the selected reflecting lobes make of a point that light has reached.
    pub fn as_patch(&self, which: Selection) -> PatchReflectance {
        let (chances, _) = self.chances(which);
        let black = Vector::grey(0.0);
        let mut albedo = black;
        let lobes = self.gloss(&chances).map(|lobe| {
            lobe.map(|(normal, cos, lobe)| {
                albedo = albedo + reflected(lobe, cos);
                PatchLobe::new(normal, lobe, cos)
            })
        });
        let any = lobes.iter().any(Option::is_some);
        let gloss = any.then_some(PatchGloss { wo: self.wo, lobes, albedo });
        if chances[0] == 0.0 {
            return PatchReflectance { diffuse: black, rim: 0.0, gloss };
        }
        let mean = NODES
            .iter()
            .fold(black, |sum, &(cos, weight)| sum + self.diffuse_at(cos).scaled(2.0 * cos * weight));
        let along = self.diffuse_at(1.0).luminance();
        let rim =
            if along > 0.0 { ((1.0 - mean.luminance() / along) / MEAN_RIM).clamp(0.0, 1.0) } else { 0.0 };
        // The mean is what counts: it is kept whatever the shape.
        PatchReflectance { diffuse: mean.scaled(1.0 / (1.0 - rim * MEAN_RIM)), rim, gloss }
    }

    /// Samples where light goes on. Its weight is for flux: refraction does not squeeze it as it does radiance.
    pub fn sample_onward(&self, u_lobe: f32, u: [f32; 2], which: Selection) -> BsdfSample<f32> {
        let mut sample = self.sample(u_lobe, u, which);
        if sample.transmitted {
            sample.weight = sample.weight.scaled(self.transmitted_eta().powi(2));
        } else if sample.pdf > 0.0 {
            let more = self.more_onward(sample.wi, which);
            sample.weight = sample.weight + more.scaled(1.0 / sample.pdf);
        }
        sample
    }

    /// The GGX reflections that take part, with their normals and the cosine of `wo` with these.
    fn gloss(&self, chances: &[f32; 5]) -> [Option<Gloss<'_>>; 2] {
        [(chances[1], self.normal, &self.specular), (chances[2], self.coat_normal, &self.coat)].map(
            |(chance, normal, lobe)| {
                (chance > 0.0).then(|| (normal, normal.dot(self.wo).clamp(1e-5, 1.0), lobe))
            },
        )
    }

    /// By how much f · cos of the selected lobes for a viewer at `wi` is more than for one at `wo`.
    fn more_onward(&self, wi: Vector<f32>, which: Selection) -> Vector<f32> {
        let (chances, _) = self.chances(which);
        let mut more = Vector::grey(0.0);
        if chances[0] > 0.0 {
            let cos = self.normal.dot(wi).max(0.0);
            more = (self.diffuse_at(cos) - self.diffuse).scaled(cos * FRAC_1_PI);
        }
        for (normal, cos, lobe) in self.gloss(&chances).into_iter().flatten() {
            if lobe.alpha > ALIKE {
                let (there, _) = PatchLobe::new(normal, lobe, cos).value((), self.wo, wi);
                more = more + there - lobe.value(normal, self.wo, wi).0;
            }
        }
        more
    }
}

/// Albedo of a reflecting lobe for a viewer at a cosine.
fn reflected(lobe: &Reflection<f32>, cos: f32) -> Vector<f32> {
    let [at_normal, at_horizon] = kept_by_ggx(cos, lobe.alpha);
    lobe.f0.scaled(at_normal) + lobe.f90.scaled(at_horizon)
}

//! The scattering function of a surface point: a handful of lobes, each sampled, evaluated and furnace-tested alone.
//!
//! Directions point away from the surface. `wo` (towards the viewer) always lies on the positive side of the shading
//! normal; scattering keeps to the sides of the geometric normal, so bumps cannot leak light.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use crate::basis::Basis;
use crate::color::luminance;
use crate::fresnel::{dielectric, reflect, refract, schlick_weight};
use crate::microfacet::{SMOOTH_ALPHA, density, masking, masking_shadowing, sample_visible, visible_density};
use crate::sampling::{ONE_MINUS_EPSILON, cosine_hemisphere};

/// A set of lobes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lobes(u8);

impl Lobes {
    /// No lobe.
    pub const NONE: Self = Self(0);
    /// Lambertian reflection.
    pub const DIFFUSE: Self = Self(1);
    /// GGX reflection of the base (metal or dielectric).
    pub const SPECULAR: Self = Self(2);
    /// GGX reflection of the clear coat.
    pub const COAT: Self = Self(4);
    /// Reflection by the interface of a transmitting solid.
    pub const GLASS_REFLECT: Self = Self(8);
    /// Refraction into or out of a solid.
    pub const GLASS_TRANSMIT: Self = Self(16);
    /// Straight-on transmission through a rough thin sheet.
    pub const THIN_TRANSMIT: Self = Self(32);
    /// All of them.
    pub const ALL: Self = Self(63);
    /// Those on the viewer's side of the surface.
    pub const REFLECTING: Self = Self(1 | 2 | 4 | 8);
    /// Those on the other side.
    pub const TRANSMITTING: Self = Self(16 | 32);

    const EACH: [Self; 6] = [
        Self::DIFFUSE,
        Self::SPECULAR,
        Self::COAT,
        Self::GLASS_REFLECT,
        Self::GLASS_TRANSMIT,
        Self::THIN_TRANSMIT,
    ];

    /// Whether all of `other` are in the set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The lobes of this set that are not in `other`.
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Lobes of both sets.
    pub fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Lobes of either set.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether light goes through the surface; for a single lobe.
    fn transmits(self) -> bool {
        !self.intersection(Self::TRANSMITTING).is_empty()
    }

    /// Each lobe of the set by itself.
    pub fn iter(self) -> impl Iterator<Item = Self> {
        Self::EACH.into_iter().filter(move |&lobe| self.contains(lobe))
    }
}

/// Lobes that are chosen together. The two of a solid's interface share one microfacet, whose Fresnel term decides
/// between them: chosen one by one, refraction near the critical angle would have unbounded weights.
const GROUPS: [Lobes; 5] = [
    Lobes::DIFFUSE,
    Lobes::SPECULAR,
    Lobes::COAT,
    Lobes::GLASS_REFLECT.union(Lobes::GLASS_TRANSMIT),
    Lobes::THIN_TRANSMIT,
];

/// GGX reflection with Schlick's Fresnel term between `f0` and `f90`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reflection {
    pub(crate) f0: Vec3,
    pub(crate) f90: Vec3,
    pub(crate) alpha: f32,
}

/// A rough dielectric interface to a solid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glass {
    /// Index on the far side over that on `wo`'s side.
    pub(crate) eta: f32,
    pub(crate) alpha: f32,
    /// Share of light that is reflected, over all microfacets.
    pub(crate) reflectance: f32,
    /// Weight of reflected light, energy compensation included.
    pub(crate) reflect: Vec3,
    /// Weight of transmitted light, tint and energy compensation included.
    pub(crate) transmit: Vec3,
}

/// Transmission through a thin rough sheet: the GGX lobe about the direction straight on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThinTransmission {
    pub(crate) color: Vec3,
    pub(crate) alpha: f32,
}

/// The scattering function at a point, for one direction `wo`.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    pub(crate) basis: Basis,
    /// The clear coat's own basis; normal maps of the base do not reach it.
    pub(crate) coat_basis: Basis,
    /// Geometric normal on `wo`'s side.
    pub(crate) ng: Vec3,
    pub(crate) wo: Vec3,
    pub(crate) diffuse: Vec3,
    pub(crate) specular: Reflection,
    pub(crate) coat: Reflection,
    pub(crate) glass: Glass,
    pub(crate) thin: ThinTransmission,
    /// The lobes with any energy.
    pub(crate) lobes: Lobes,
    /// Probability of choosing each group of lobes, in the order of [`GROUPS`].
    pub(crate) choice: [f32; 5],
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Where light comes from.
    pub wi: Vec3,
    /// f · |cos θi| / pdf.
    pub weight: Vec3,
    /// Per steradian; 0 for a perfectly smooth lobe.
    pub pdf: f32,
    /// GGX α of the lobe that was sampled; 1 for diffuse.
    pub alpha: f32,
    /// Whether `wi` lies behind the surface.
    pub transmitted: bool,
}

impl BsdfSample {
    /// Whether the direction came from a perfectly smooth lobe, which light sampling cannot hit.
    pub fn is_delta(&self) -> bool {
        self.pdf == 0.0
    }
}

/// f · |cos θi| and the density of [`Bsdf::sample`] for a pair of directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BsdfValue {
    /// f · |cos θi|; smooth lobes contribute nothing.
    pub f_cos: Vec3,
    /// Per steradian.
    pub pdf: f32,
}

impl Bsdf {
    /// Sets the lobes present and how often each is sampled: in proportion to the light it reflects.
    pub(crate) fn finish(mut self, specular_albedo: Vec3, coat_albedo: f32) -> Self {
        let albedos =
            [self.diffuse, specular_albedo, Vec3::splat(coat_albedo), self.glass.albedo(), self.thin.color];
        let weights = albedos.map(luminance);
        let total: f32 = weights.iter().sum();
        self.lobes = Lobes::NONE;
        self.choice = [0.0; 5];
        if total <= 0.0 {
            return self;
        }
        for (i, group) in GROUPS.into_iter().enumerate() {
            if weights[i] > 0.0 {
                self.lobes = self.lobes.union(group);
                // A floor keeps lobes whose estimate is far too low at some angle from becoming fireflies.
                self.choice[i] = weights[i].max(0.02 * total);
            }
        }
        let total: f32 = self.choice.iter().sum();
        self.choice = self.choice.map(|c| c / total);
        self
    }

    /// The same surface without any scattering.
    pub(crate) fn black(mut self) -> Self {
        self.lobes = Lobes::NONE;
        self
    }

    /// The lobes with any energy.
    pub fn lobes(&self) -> Lobes {
        self.lobes
    }

    /// The shading normal, on `wo`'s side.
    pub fn normal(&self) -> Vec3 {
        self.basis.z
    }

    /// Relative index of the far side of a solid's interface; 1 where there is none.
    pub fn transmitted_eta(&self) -> f32 {
        if self.glass.eta > 0.0 { self.glass.eta } else { 1.0 }
    }

    /// The lobes present whose α is at most `alpha`: mirrors, glass and clear gloss.
    pub fn sharper_than(&self, alpha: f32) -> Lobes {
        let sharp = |lobe: Lobes| self.alpha(lobe) <= alpha;
        self.lobes.iter().filter(|&lobe| sharp(lobe)).fold(Lobes::NONE, Lobes::union)
    }

    fn alpha(&self, lobe: Lobes) -> f32 {
        match lobe {
            Lobes::SPECULAR => self.specular.alpha,
            Lobes::COAT => self.coat.alpha,
            Lobes::GLASS_REFLECT | Lobes::GLASS_TRANSMIT => self.glass.alpha,
            Lobes::THIN_TRANSMIT => self.thin.alpha,
            _ => 1.0,
        }
    }

    /// Probability of each group when only `lobes` take part, and the sum before normalisation.
    fn chances(&self, lobes: Lobes) -> ([f32; 5], f32) {
        let mut chances = self.choice;
        for (chance, group) in chances.iter_mut().zip(GROUPS) {
            if lobes.intersection(group).is_empty() {
                *chance = 0.0;
            }
        }
        (chances, chances.iter().sum())
    }

    /// f · |cos θi| of the chosen lobes for light from `wi`, and the density of sampling it from those lobes.
    pub fn evaluate(&self, wi: Vec3, lobes: Lobes) -> BsdfValue {
        let lobes = self.lobes.intersection(lobes);
        let mut value = BsdfValue::default();
        if lobes.is_empty() {
            return value;
        }
        let (chances, total) = self.chances(lobes);
        let side = if self.ng.dot(wi) > 0.0 { Lobes::REFLECTING } else { Lobes::TRANSMITTING };
        for (group, chance) in GROUPS.into_iter().zip(chances) {
            // At most one lobe of a group lies on either side.
            let lobe = group.intersection(lobes).intersection(side);
            if chance > 0.0 && !lobe.is_empty() {
                let (f_cos, pdf) = self.lobe_value(lobe, lobes, wi);
                value.f_cos += f_cos;
                value.pdf += pdf * chance / total;
            }
        }
        value
    }

    /// Samples a direction from the chosen lobes. `None` when there are none or the sample is absorbed.
    pub fn sample(&self, u_lobe: f32, u: Vec2, lobes: Lobes) -> Option<BsdfSample> {
        let lobes = self.lobes.intersection(lobes);
        let (chances, total) = self.chances(lobes);
        let mut rest = u_lobe * total;
        let mut chosen = None;
        for (group, chance) in GROUPS.into_iter().zip(chances).filter(|(_, chance)| *chance > 0.0) {
            chosen = Some((group, chance, (rest / chance).clamp(0.0, ONE_MINUS_EPSILON)));
            rest -= chance;
            if rest < 0.0 {
                break;
            }
        }
        let (group, chance, u_branch) = chosen?;
        let (lobe, wi, delta_weight) = self.group_sample(group.intersection(lobes), u_branch, u)?;
        let transmitted = lobe.transmits();
        if (self.ng.dot(wi) > 0.0) == transmitted {
            return None;
        }
        let alpha = self.alpha(lobe);
        if let Some(weight) = delta_weight {
            return Some(BsdfSample { wi, weight: weight * (total / chance), pdf: 0.0, alpha, transmitted });
        }
        let value = self.evaluate(wi, lobes);
        let usable = value.pdf > 0.0 && value.pdf.is_finite();
        usable.then(|| BsdfSample { wi, weight: value.f_cos / value.pdf, pdf: value.pdf, alpha, transmitted })
    }

    /// f · |cos θi| of one lobe and the density of sampling it from its group within `lobes`; zero for smooth ones.
    fn lobe_value(&self, lobe: Lobes, lobes: Lobes, wi: Vec3) -> (Vec3, f32) {
        let both = lobes.contains(GROUPS[3]);
        match lobe {
            Lobes::DIFFUSE => {
                let pdf = self.basis.z.dot(wi).max(0.0) * FRAC_1_PI;
                (self.diffuse * pdf, pdf)
            }
            Lobes::SPECULAR => self.specular.value(&self.basis, self.wo, wi),
            Lobes::COAT => self.coat.value(&self.coat_basis, self.wo, wi),
            Lobes::GLASS_REFLECT => self.glass.reflected_value(&self.basis, self.wo, wi, both),
            Lobes::GLASS_TRANSMIT => self.glass.transmitted_value(&self.basis, self.wo, wi, both),
            _ => self.thin.value(&self.basis, self.wo, wi),
        }
    }

    /// A direction from one group: the lobe it came from and, for smooth lobes, f · |cos θi| / pdf.
    fn group_sample(&self, lobes: Lobes, u_branch: f32, u: Vec2) -> Option<(Lobes, Vec3, Option<Vec3>)> {
        let (lobe, (wi, weight)) = match lobes {
            Lobes::DIFFUSE => (lobes, (self.basis.to_world(cosine_hemisphere(u)), None)),
            Lobes::SPECULAR => (lobes, self.specular.sample(&self.basis, self.wo, u)),
            Lobes::COAT => (lobes, self.coat.sample(&self.coat_basis, self.wo, u)),
            Lobes::THIN_TRANSMIT => (lobes, self.thin.sample(&self.basis, self.wo, u)),
            _ => self.glass.sample(&self.basis, self.wo, lobes, u_branch, u)?,
        };
        Some((lobe, wi, weight))
    }
}

/// `wo` in local space, kept off the horizon where the formulas divide by its cosine.
fn local_wo(basis: &Basis, wo: Vec3) -> Vec3 {
    let local = basis.to_local(wo);
    local.with_z(local.z.max(1e-5))
}

impl Reflection {
    pub(crate) const NONE: Self = Self { f0: Vec3::ZERO, f90: Vec3::ZERO, alpha: 1.0 };

    fn fresnel(&self, cos: f32) -> Vec3 {
        self.f0.lerp(self.f90, schlick_weight(cos))
    }

    fn value(&self, basis: &Basis, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let (shape, pdf, cos) = ggx_reflection(local_wo(basis, wo), basis.to_local(wi), self.alpha);
        (self.fresnel(cos) * shape, pdf)
    }

    fn sample(&self, basis: &Basis, wo: Vec3, u: Vec2) -> (Vec3, Option<Vec3>) {
        if self.alpha <= SMOOTH_ALPHA {
            return (reflect(wo, basis.z), Some(self.fresnel(basis.z.dot(wo))));
        }
        let local = local_wo(basis, wo);
        (basis.to_world(reflect(local, sample_visible(local, self.alpha, u))), None)
    }
}

/// D G2 / (4 cos θo) of GGX reflection (F = 1), its sampling density and the cosine at the microfacet. Local space.
fn ggx_reflection(wo: Vec3, wi: Vec3, alpha: f32) -> (f32, f32, f32) {
    if wi.z <= 0.0 || alpha <= SMOOTH_ALPHA {
        return (0.0, 0.0, 0.0);
    }
    let h = (wo + wi).normalize_or(Vec3::Z);
    let d = density(h, alpha);
    let shape = d * masking_shadowing(wo.z, wi.z, alpha) / (4.0 * wo.z);
    (shape, masking(wo.z, alpha) * d / (4.0 * wo.z), wo.dot(h).max(0.0))
}

impl Glass {
    pub(crate) const NONE: Self =
        Self { eta: 0.0, alpha: 1.0, reflectance: 0.0, reflect: Vec3::ZERO, transmit: Vec3::ZERO };

    /// Light sent on in uniform white light.
    pub(crate) fn albedo(&self) -> Vec3 {
        self.transmit.lerp(self.reflect, self.reflectance)
    }

    fn reflected_value(&self, basis: &Basis, wo: Vec3, wi: Vec3, both: bool) -> (Vec3, f32) {
        let (shape, pdf, cos) = ggx_reflection(local_wo(basis, wo), basis.to_local(wi), self.alpha);
        let reflectance = dielectric(cos, self.eta);
        (self.reflect * (reflectance * shape), if both { pdf * reflectance } else { pdf })
    }

    /// Walter et al. 2007, equation 21, for radiance: divided by η² because beams spread as they refract.
    fn transmitted_value(&self, basis: &Basis, wo: Vec3, wi: Vec3, both: bool) -> (Vec3, f32) {
        let (wo, wi) = (local_wo(basis, wo), basis.to_local(wi));
        if wi.z >= 0.0 || self.alpha <= SMOOTH_ALPHA {
            return (Vec3::ZERO, 0.0);
        }
        let h = (wo + wi * self.eta).normalize_or(Vec3::Z);
        let h = if h.z < 0.0 { -h } else { h };
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let denominator = (cos_i + cos_o / self.eta).powi(2);
        let pdf = visible_density(wo, h, self.alpha) * -cos_i / denominator;
        let shadowing = masking(-wi.z, self.alpha);
        let transmittance = 1.0 - dielectric(cos_o, self.eta);
        let f_cos = self.transmit * (transmittance * shadowing * pdf / (self.eta * self.eta));
        (f_cos, if both { pdf * transmittance } else { pdf })
    }

    /// Samples a microfacet, then reflection or refraction by its Fresnel term, or the only one that is asked for.
    fn sample(
        &self,
        basis: &Basis,
        wo: Vec3,
        lobes: Lobes,
        u_branch: f32,
        u: Vec2,
    ) -> Option<(Lobes, (Vec3, Option<Vec3>))> {
        let smooth = self.alpha <= SMOOTH_ALPHA;
        let local = local_wo(basis, wo);
        let h = if smooth { Vec3::Z } else { sample_visible(local, self.alpha, u) };
        let reflectance = dielectric(local.dot(h).max(0.0), self.eta);
        let both = lobes.contains(GROUPS[3]);
        let reflects = if both { u_branch < reflectance } else { lobes == Lobes::GLASS_REFLECT };
        if reflects {
            let weight = if both { self.reflect } else { self.reflect * reflectance };
            return Some((
                Lobes::GLASS_REFLECT,
                (basis.to_world(reflect(local, h)), smooth.then_some(weight)),
            ));
        }
        let wi = refract(local, h, self.eta)?;
        let weight = if both { self.transmit } else { self.transmit * (1.0 - reflectance) };
        let weight = weight / (self.eta * self.eta);
        Some((Lobes::GLASS_TRANSMIT, (basis.to_world(wi), smooth.then_some(weight))))
    }
}

impl ThinTransmission {
    fn value(&self, basis: &Basis, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let wi = basis.to_local(wi);
        let (shape, pdf, _) = ggx_reflection(local_wo(basis, wo), wi.with_z(-wi.z), self.alpha);
        (self.color * shape, pdf)
    }

    fn sample(&self, basis: &Basis, wo: Vec3, u: Vec2) -> (Vec3, Option<Vec3>) {
        if self.alpha <= SMOOTH_ALPHA {
            return (-wo, Some(self.color));
        }
        let local = local_wo(basis, wo);
        let wi = reflect(local, sample_visible(local, self.alpha, u));
        (basis.to_world(wi.with_z(-wi.z)), None)
    }
}

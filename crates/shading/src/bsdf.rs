//! The scattering function of a surface point: a handful of lobes, each sampled, evaluated and furnace-tested alone.
//!
//! Directions point away from the surface. `wo` (towards the viewer) always lies on the positive side of the shading
//! normal; scattering keeps to the sides of the geometric normal, so bumps cannot leak light.

use std::f32::consts::FRAC_1_PI;

use crate::basis::Basis;
use crate::fresnel::{dielectric, reflect, refract, schlick_weight};
use crate::lanes::{Mask, Real, Vector};
use crate::lobe_set::{GROUPS, Lobes, Selection};
use crate::microfacet::{SMOOTH_ALPHA, masking, reflection, sample_visible, visible_density};
use crate::sampling::{ONE_MINUS_EPSILON, cosine_hemisphere};

/// `wo` is kept off the horizon by this cosine where formulas divide by it.
const LEAST_COSINE: f32 = 1e-5;

/// GGX reflection with Schlick's Fresnel term between `f0` and `f90`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reflection<F> {
    pub(crate) f0: Vector<F>,
    pub(crate) f90: Vector<F>,
    pub(crate) alpha: F,
}

/// A rough dielectric interface to a solid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glass<F> {
    /// Index on the far side over that on `wo`'s side.
    pub(crate) eta: F,
    pub(crate) alpha: F,
    /// Share of light that is reflected, over all microfacets.
    pub(crate) reflectance: F,
    /// Weight of reflected light, energy compensation included.
    pub(crate) reflect: F,
    /// Weight of transmitted light, tint and energy compensation included.
    pub(crate) transmit: Vector<F>,
}

/// Transmission through a thin rough sheet: the GGX lobe about the direction straight on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThinTransmission<F> {
    pub(crate) color: Vector<F>,
    pub(crate) alpha: F,
}

/// The scattering function at a point, for one direction `wo`.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<F> {
    /// Shading normal, on `wo`'s side.
    pub(crate) normal: Vector<F>,
    /// The clear coat's own normal; normal maps of the base do not reach it.
    pub(crate) coat_normal: Vector<F>,
    /// Geometric normal on `wo`'s side.
    pub(crate) ng: Vector<F>,
    pub(crate) wo: Vector<F>,
    pub(crate) diffuse: Vector<F>,
    pub(crate) specular: Reflection<F>,
    pub(crate) coat: Reflection<F>,
    pub(crate) glass: Glass<F>,
    pub(crate) thin: ThinTransmission<F>,
    /// The lobes that may have energy in some lane; the fields of others mean nothing.
    pub(crate) lobes: Lobes,
    /// Probability of choosing each group of lobes, in the order of [`GROUPS`]; zero where it has no energy.
    pub(crate) choice: [F; 5],
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample<F: Real> {
    /// Whether there is one: none where no lobe takes part or the sample is absorbed.
    pub valid: F::Mask,
    /// Where light comes from.
    pub wi: Vector<F>,
    /// f · |cos θi| / pdf.
    pub weight: Vector<F>,
    /// Per steradian; 0 for a perfectly smooth lobe, which light sampling cannot hit.
    pub pdf: F,
    /// GGX α of the lobe that was sampled; 1 for diffuse.
    pub alpha: F,
    /// Whether `wi` lies behind the surface.
    pub transmitted: F::Mask,
}

/// f · |cos θi| and the density of [`Bsdf::sample`] for a pair of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfValue<F> {
    /// f · |cos θi|; smooth lobes contribute nothing.
    pub f_cos: Vector<F>,
    /// Per steradian.
    pub pdf: F,
}

/// A direction from one group of lobes.
#[derive(Clone, Copy, Debug)]
struct GroupSample<F: Real> {
    wi: Vector<F>,
    /// f · |cos θi| / pdf of the group where the lobe is smooth.
    smooth_weight: Vector<F>,
    smooth: F::Mask,
    transmitted: F::Mask,
    valid: F::Mask,
}

impl<F: Real> Bsdf<F> {
    /// Sets how often each group is sampled: in proportion to the light it reflects.
    #[inline(always)]
    pub(crate) fn choose(&mut self, specular_albedo: Vector<F>, coat_albedo: F) {
        let zero = coat_albedo.splat(0.0);
        let weights = [
            if self.has(0) { self.diffuse.luminance() } else { zero },
            if self.has(1) { specular_albedo.luminance() } else { zero },
            if self.has(2) { coat_albedo } else { zero },
            if self.has(3) { self.glass.albedo().luminance() } else { zero },
            if self.has(4) { self.thin.color.luminance() } else { zero },
        ];
        let total = weights[0] + weights[1] + weights[2] + weights[3] + weights[4];
        // A floor keeps lobes whose estimate is far too low at some angle from becoming fireflies.
        let floor = total * 0.02;
        let mut sum = zero;
        for (group, weight) in weights.into_iter().enumerate() {
            if self.has(group) {
                self.choice[group] = weight.max(floor).only(weight.gt(zero));
                sum = sum + self.choice[group];
            }
        }
        let inverse = sum.recip().only(sum.gt(zero));
        for group in 0..GROUPS.len() {
            if self.has(group) {
                self.choice[group] = self.choice[group] * inverse;
            }
        }
    }

    /// Whether a group of [`GROUPS`] may have energy in some lane.
    #[inline(always)]
    fn has(&self, group: usize) -> bool {
        !self.lobes.intersection(GROUPS[group]).is_empty()
    }

    /// The lobes that may have energy in some lane.
    pub fn lobes(&self) -> Lobes {
        self.lobes
    }

    /// The shading normal, on `wo`'s side.
    pub fn normal(&self) -> Vector<F> {
        self.normal
    }

    /// Where any lobe has energy.
    #[inline(always)]
    pub fn scatters(&self) -> F::Mask {
        let [a, b, c, d, e] = self.choice;
        (a + b + c + d + e).gt(a.splat(0.0))
    }

    /// Where any of the selected lobes has energy.
    #[inline(always)]
    pub fn has_any(&self, which: Selection) -> F::Mask {
        let total = self.chances(which).1;
        total.gt(total.splat(0.0))
    }

    /// Share of uniform white light that the selected reflecting lobes send towards the viewer, roughly: gloss without its
    /// Fresnel term's rise.
    #[inline(always)]
    pub fn albedo_of(&self, which: Selection) -> Vector<F> {
        let zero = self.choice[0].splat(0.0);
        let (chances, _) = self.chances(which);
        let diffuse = self.diffuse.only(chances[0].gt(zero));
        let specular = self.specular.f0.only(chances[1].gt(zero));
        let coat = self.coat.f0.only(chances[2].gt(zero));
        let mut albedo = diffuse;
        if self.has(1) {
            albedo = albedo + specular;
        }
        if self.has(2) {
            albedo = albedo + coat;
        }
        albedo.clamp(0.0, 1.0)
    }

    /// Relative index of the far side of a solid's interface; 1 where there is none.
    #[inline(always)]
    pub fn transmitted_eta(&self) -> F {
        let eta = self.glass.eta;
        let one = eta.splat(1.0);
        if self.has(3) { eta.where_or(eta.gt(eta.splat(0.0)), one) } else { one }
    }

    #[inline(always)]
    fn alpha(&self, group: usize) -> F {
        match group {
            1 => self.specular.alpha,
            2 => self.coat.alpha,
            3 => self.glass.alpha,
            4 => self.thin.alpha,
            _ => self.choice[0].splat(1.0),
        }
    }

    /// The GGX α that a selection goes by. An interface counts as sharp however rough: what it lets through cannot be lit past
    /// the solid itself, but by rays alone.
    #[inline(always)]
    fn class(&self, group: usize) -> F {
        if group == 3 { self.choice[0].splat(0.0) } else { self.alpha(group) }
    }

    /// Probability of each group when only the selected lobes take part, and the sum before normalisation.
    #[inline(always)]
    pub(crate) fn chances(&self, which: Selection) -> ([F; 5], F) {
        let zero = self.choice[0].splat(0.0);
        let mut chances = [zero; 5];
        let mut total = zero;
        for (group, chance) in chances.iter_mut().enumerate() {
            if self.has(group) && !which.lobes.intersection(GROUPS[group]).is_empty() {
                *chance = self.choice[group].only(which.takes(self.class(group)));
                total = total + *chance;
            }
        }
        (chances, total)
    }

    /// f · |cos θi| of the selected lobes for light from `wi`, and the density of sampling it from them.
    #[inline(always)]
    pub fn evaluate(&self, wi: Vector<F>, which: Selection) -> BsdfValue<F> {
        let zero = self.choice[0].splat(0.0);
        let (chances, total) = self.chances(which);
        let above = self.ng.dot(wi).gt(zero);
        let mut f_cos = Vector::grey(zero);
        let mut pdf = zero;
        for group in 0..GROUPS.len() {
            let chance = chances[group];
            let present = chance.gt(zero);
            let lobes = GROUPS[group].intersection(self.lobes).intersection(which.lobes);
            if lobes.is_empty() || !present.any() {
                continue;
            }
            let (f, p) = self.group_value(group, lobes, wi, above);
            f_cos = f_cos + f.only(present);
            pdf = pdf + (p * chance).only(present);
        }
        BsdfValue { f_cos, pdf: (pdf / total).only(total.gt(zero)) }
    }

    /// f · |cos θi| of the `lobes` of a group and the density of sampling it from the group; zero for smooth ones. At
    /// most one lobe of a group lies on either side, which `above` tells.
    #[inline(always)]
    fn group_value(&self, group: usize, lobes: Lobes, wi: Vector<F>, above: F::Mask) -> (Vector<F>, F) {
        match group {
            0 => {
                let pdf = self.normal.dot(wi).positive().only(above) * FRAC_1_PI;
                (self.diffuse * pdf, pdf)
            }
            1 => only(self.specular.value(self.normal, self.wo, wi), above),
            2 => only(self.coat.value(self.coat_normal, self.wo, wi), above),
            3 => self.glass.value(&Basis::from_normal(self.normal), self.wo, wi, lobes, above),
            _ => only(self.thin.value(self.normal, self.wo, wi), !above),
        }
    }

    /// Samples a direction from the selected lobes.
    #[inline(always)]
    pub fn sample(&self, u_lobe: F, u: [F; 2], which: Selection) -> BsdfSample<F> {
        let zero = u_lobe.splat(0.0);
        let one = u_lobe.splat(1.0);
        let (chances, total) = self.chances(which);
        // The group whose interval holds u; rounding may leave the last one open.
        let mut rest = u_lobe * total;
        let mut done = zero.lt(zero);
        let (mut chosen, mut chance, mut u_branch) = (zero - 1.0, one, zero);
        for (group, own) in chances.into_iter().enumerate() {
            let take = own.gt(zero) & !done;
            chosen = zero.splat(group as f32).where_or(take, chosen);
            chance = own.where_or(take, chance);
            u_branch = (rest / own).where_or(take, u_branch);
            done = done | (take & rest.lt(own));
            rest = rest - own.only(take);
        }
        let u_branch = u_branch.clamp(0.0, ONE_MINUS_EPSILON);
        let mut taken = GroupSample::none(zero);
        let mut alpha = one;
        for (group, lobes) in GROUPS.into_iter().enumerate() {
            let mine = chosen.equals(zero.splat(group as f32));
            if self.has(group) && mine.any() {
                let lobes = lobes.intersection(self.lobes).intersection(which.lobes);
                taken = self.group_sample(group, lobes, u_branch, u).where_or(mine, taken);
                alpha = self.alpha(group).where_or(mine, alpha);
            }
        }
        let GroupSample { wi, smooth_weight, smooth, transmitted, valid } = taken;
        let above = self.ng.dot(wi).gt(zero);
        let valid = valid & ((above & !transmitted) | (!above & transmitted));
        let value = self.evaluate(wi, which);
        let inverse = value.pdf.recip();
        let usable = smooth | (inverse.gt(zero) & inverse.lt(inverse.splat(f32::INFINITY)));
        BsdfSample {
            valid: valid & usable,
            wi,
            weight: (smooth_weight * (total / chance)).where_or(smooth, value.f_cos * inverse),
            pdf: value.pdf.only(!smooth),
            alpha,
            transmitted,
        }
    }

    #[inline(always)]
    fn group_sample(&self, group: usize, lobes: Lobes, u_branch: F, u: [F; 2]) -> GroupSample<F> {
        match group {
            0 => {
                let wi = Basis::from_normal(self.normal).to_world(cosine_hemisphere(u));
                let none = GroupSample::none(u_branch);
                GroupSample { wi, valid: !none.valid, ..none }
            }
            1 => self.specular.sample(&Basis::from_normal(self.normal), self.wo, u),
            2 => self.coat.sample(&Basis::from_normal(self.coat_normal), self.wo, u),
            3 => self.glass.sample(&Basis::from_normal(self.normal), self.wo, lobes, u_branch, u),
            _ => self.thin.sample(&Basis::from_normal(self.normal), self.wo, u),
        }
    }
}

impl<F: Real> GroupSample<F> {
    #[inline(always)]
    fn none(like: F) -> Self {
        let zero = like.splat(0.0);
        let no = zero.lt(zero);
        let vector = Vector::grey(zero);
        Self { wi: vector, smooth_weight: vector, smooth: no, transmitted: no, valid: no }
    }

    #[inline(always)]
    fn where_or(self, mask: F::Mask, otherwise: Self) -> Self {
        Self {
            wi: self.wi.where_or(mask, otherwise.wi),
            smooth_weight: self.smooth_weight.where_or(mask, otherwise.smooth_weight),
            smooth: either::<F>(mask, self.smooth, otherwise.smooth),
            transmitted: either::<F>(mask, self.transmitted, otherwise.transmitted),
            valid: either::<F>(mask, self.valid, otherwise.valid),
        }
    }
}

#[inline(always)]
fn either<F: Real>(mask: F::Mask, a: F::Mask, b: F::Mask) -> F::Mask {
    (a & mask) | (b & !mask)
}

#[inline(always)]
fn only<F: Real>((f_cos, pdf): (Vector<F>, F), mask: F::Mask) -> (Vector<F>, F) {
    (f_cos.only(mask), pdf.only(mask))
}

/// `wo` in local space, kept off the horizon where the formulas divide by its cosine.
#[inline(always)]
fn local_wo<F: Real>(basis: &Basis<F>, wo: Vector<F>) -> Vector<F> {
    let local = basis.to_local(wo);
    Vector::new(local.x, local.y, local.z.max(local.z.splat(LEAST_COSINE)))
}

#[inline(always)]
fn is_smooth<F: Real>(alpha: F) -> F::Mask {
    alpha.le(alpha.splat(SMOOTH_ALPHA))
}

impl<F: Real> Reflection<F> {
    #[inline(always)]
    pub(crate) fn none(like: F) -> Self {
        let black = Vector::grey(like.splat(0.0));
        Self { f0: black, f90: black, alpha: like.splat(1.0) }
    }

    #[inline(always)]
    fn fresnel(&self, cos: F) -> Vector<F> {
        self.f0.mix(self.f90, schlick_weight(cos))
    }

    /// f · cos θi and the density of sampling it.
    #[inline(always)]
    pub(crate) fn value(&self, normal: Vector<F>, wo: Vector<F>, wi: Vector<F>) -> (Vector<F>, F) {
        let (shape, pdf, cos) = ggx_reflection(normal, wo, wi, self.alpha);
        (self.fresnel(cos) * shape, pdf)
    }

    #[inline(always)]
    fn sample(&self, basis: &Basis<F>, wo: Vector<F>, u: [F; 2]) -> GroupSample<F> {
        let smooth = is_smooth(self.alpha);
        let local = local_wo(basis, wo);
        let rough = basis.to_world(reflect(local, sample_visible(local, self.alpha, u)));
        let none = GroupSample::none(self.alpha);
        GroupSample {
            wi: reflect(wo, basis.z).where_or(smooth, rough),
            smooth_weight: self.fresnel(basis.z.dot(wo)),
            smooth,
            valid: !none.valid,
            ..none
        }
    }
}

/// D G2 / (4 cos θo) of GGX reflection (F = 1), its sampling density and the cosine at the microfacet.
#[inline(always)]
fn ggx_reflection<F: Real>(normal: Vector<F>, wo: Vector<F>, wi: Vector<F>, alpha: F) -> (F, F, F) {
    let (cos_o, cos_i) = (normal.dot(wo).max(alpha.splat(LEAST_COSINE)), normal.dot(wi));
    let valid = cos_i.gt(cos_i.splat(0.0)) & !is_smooth(alpha);
    let h = wo + wi;
    let (shape, pdf) = reflection(normal, h, [cos_o, cos_i], alpha);
    // Of unit vectors: half of their sum's length.
    (shape.only(valid), pdf.only(valid), h.length() * 0.5)
}

#[inline(always)]
fn up<F: Real>(like: F) -> Vector<F> {
    Vector::new(like.splat(0.0), like.splat(0.0), like.splat(1.0))
}

impl<F: Real> ThinTransmission<F> {
    #[inline(always)]
    pub(crate) fn none(like: F) -> Self {
        let zero = like.splat(0.0);
        Self { color: Vector::grey(zero), alpha: zero.splat(1.0) }
    }
}

impl<F: Real> Glass<F> {
    #[inline(always)]
    pub(crate) fn none(like: F) -> Self {
        let zero = like.splat(0.0);
        let transmit = Vector::grey(zero);
        Self { eta: zero, alpha: like.splat(1.0), reflectance: zero, reflect: zero, transmit }
    }

    /// Light sent on in uniform white light.
    #[inline(always)]
    pub(crate) fn albedo(&self) -> Vector<F> {
        self.transmit.mix(Vector::grey(self.reflect), self.reflectance)
    }

    /// Reflection above, transmission below; each only if it is among `lobes`.
    #[inline(always)]
    fn value(
        &self,
        basis: &Basis<F>,
        wo: Vector<F>,
        wi: Vector<F>,
        lobes: Lobes,
        above: F::Mask,
    ) -> (Vector<F>, F) {
        let both = lobes.contains(GROUPS[3]);
        let black = (Vector::grey(self.eta.splat(0.0)), self.eta.splat(0.0));
        let reflected = match lobes.contains(Lobes::GLASS_REFLECT) && above.any() {
            true => only(self.reflected_value(basis, wo, wi, both), above),
            false => black,
        };
        let transmitted = match lobes.contains(Lobes::GLASS_TRANSMIT) && !above.all() {
            true => only(self.transmitted_value(basis, wo, wi, both), !above),
            false => black,
        };
        (reflected.0 + transmitted.0, reflected.1 + transmitted.1)
    }

    #[inline(always)]
    fn reflected_value(&self, basis: &Basis<F>, wo: Vector<F>, wi: Vector<F>, both: bool) -> (Vector<F>, F) {
        let (shape, pdf, cos) = ggx_reflection(basis.z, wo, wi, self.alpha);
        let reflectance = dielectric(cos, self.eta);
        let value = Vector::grey(self.reflect * reflectance * shape);
        (value, if both { pdf * reflectance } else { pdf })
    }

    /// Walter et al. 2007, equation 21, for radiance: divided by η² because beams spread as they refract.
    #[inline(always)]
    fn transmitted_value(
        &self,
        basis: &Basis<F>,
        wo: Vector<F>,
        wi: Vector<F>,
        both: bool,
    ) -> (Vector<F>, F) {
        let (wo, wi) = (local_wo(basis, wo), basis.to_local(wi));
        let zero = self.eta.splat(0.0);
        let h = (wo + wi * self.eta).normalized_or(up(zero));
        let h = (-h).where_or(h.z.lt(zero), h);
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        let valid = wi.z.lt(zero) & !is_smooth(self.alpha) & cos_o.gt(zero) & cos_i.lt(zero);
        let denominator = (cos_i + cos_o / self.eta).squared();
        let pdf = visible_density(wo, h, self.alpha) * -cos_i / denominator;
        let shadowing = masking(-wi.z, self.alpha);
        let transmittance = dielectric(cos_o, self.eta).complement();
        let f_cos = self.transmit * (transmittance * shadowing * pdf / (self.eta * self.eta));
        only((f_cos, if both { pdf * transmittance } else { pdf }), valid)
    }

    /// Samples a microfacet, then reflection or refraction by its Fresnel term, or the only one that is asked for.
    #[inline(always)]
    fn sample(
        &self,
        basis: &Basis<F>,
        wo: Vector<F>,
        lobes: Lobes,
        u_branch: F,
        u: [F; 2],
    ) -> GroupSample<F> {
        let smooth = is_smooth(self.alpha);
        let local = local_wo(basis, wo);
        let h = up(u_branch).where_or(smooth, sample_visible(local, self.alpha, u));
        let reflectance = dielectric(local.dot(h).positive(), self.eta);
        let both = lobes.contains(GROUPS[3]);
        let never = u_branch.lt(u_branch.splat(0.0));
        let reflects = match (both, lobes.contains(Lobes::GLASS_REFLECT)) {
            (true, _) => u_branch.lt(reflectance),
            (false, true) => !never,
            (false, false) => never,
        };
        let (refracted, passes) = refract(local, h, self.eta);
        let (mut reflect_weight, mut transmit_weight) = (self.reflect, self.transmit);
        if !both {
            reflect_weight = reflect_weight * reflectance;
            transmit_weight = transmit_weight * reflectance.complement();
        }
        let transmit_weight = transmit_weight * (self.eta * self.eta).recip();
        GroupSample {
            wi: basis.to_world(reflect(local, h).where_or(reflects, refracted)),
            smooth_weight: Vector::grey(reflect_weight).where_or(reflects, transmit_weight),
            smooth,
            transmitted: !reflects,
            valid: reflects | passes,
        }
    }
}

impl<F: Real> ThinTransmission<F> {
    #[inline(always)]
    fn value(&self, normal: Vector<F>, wo: Vector<F>, wi: Vector<F>) -> (Vector<F>, F) {
        let mirrored = wi - normal * (normal.dot(wi) * 2.0);
        let (shape, pdf, _) = ggx_reflection(normal, wo, mirrored, self.alpha);
        (self.color * shape, pdf)
    }

    #[inline(always)]
    fn sample(&self, basis: &Basis<F>, wo: Vector<F>, u: [F; 2]) -> GroupSample<F> {
        let smooth = is_smooth(self.alpha);
        let local = local_wo(basis, wo);
        let wi = reflect(local, sample_visible(local, self.alpha, u));
        let rough = basis.to_world(Vector::new(wi.x, wi.y, -wi.z));
        let none = GroupSample::none(self.alpha);
        GroupSample {
            wi: (-wo).where_or(smooth, rough),
            smooth_weight: self.color,
            smooth,
            transmitted: !none.transmitted,
            valid: !none.valid,
        }
    }
}

//! From a closure to lobes: the layered model that all surfaces share.
//!
//! # References
//! Khronos glTF 2.0 specification, appendix B, for the mix; Turquin 2019 for the energy that single scattering loses.

use crate::albedo::reflection;
use crate::bsdf::{Bsdf, Glass, Reflection, ThinTransmission};
use crate::closure::Closure;
use crate::fresnel::{dielectric, normal_incidence, schlick_weight};
use crate::lanes::{Mask, Real, Vector};
use crate::lobe_set::Lobes;
use crate::material::SurfaceMaterial;
use crate::microfacet::SMOOTH_ALPHA;

/// Reflectance of the clear coat at normal incidence: index 1.5.
const COAT_F0: f32 = 0.04;
/// Stands for an infinite index (ior = 0 in KHR_materials_ior): reflects 99.996 % at normal incidence.
const MIRROR_IOR: f32 = 1e5;

/// The geometry that lobes need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LobeGeometry<F: Real> {
    /// On `wo`'s side.
    pub(crate) ng: Vector<F>,
    pub(crate) wo: Vector<F>,
    /// Whether `wo` sees the front.
    pub(crate) front: F::Mask,
}

/// What a material does with light at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Appearance<F> {
    pub(crate) bsdf: Bsdf<F>,
    /// Light that passes straight through, per channel: holes and clear thin sheets.
    pub(crate) through: Vector<F>,
    /// Reflected share of uniform white light.
    pub(crate) albedo: Vector<F>,
}

/// The lobes of a closure, whose normals lie on the viewer's side; at most `lobes`, which are the material's.
#[inline(always)]
pub(crate) fn appearance<F: Real>(
    (material, lobes): (&SurfaceMaterial, Lobes),
    closure: &Closure<F>,
    geometry: &LobeGeometry<F>,
) -> Appearance<F> {
    let (base, metallic, coverage) = (closure.base_color, closure.metallic, closure.opacity);
    let (zero, one) = (coverage.splat(0.0), coverage.splat(1.0));
    let black = Vector::grey(zero);
    let alpha = closure.roughness.squared();
    let cos = closure.normal.dot(geometry.wo).clamp(1e-5, 1.0);

    let coat = coat_layer(lobes, closure, geometry);
    let uncoated = coat.albedo.complement();
    let below = metallic.complement() * uncoated;
    let transmission = closure.transmission;
    let solid = material.interface.is_some();

    // A thin sheet's two faces reflect together like the opaque base's one; a solid's interface is a lobe of its own.
    let (mut specular, mut specular_albedo, mut base_kept) = (Reflection::none(zero), black, base);
    if lobes.contains(Lobes::SPECULAR) {
        let kept = kept_by_ggx(cos, alpha);
        let tint = closure.specular_color.scaled(normal_incidence(material.source().ior));
        let f0 = tint.clamp(0.0, 1.0) * closure.specular;
        let metal = Layer::new(base, Vector::grey(one), kept);
        let dielectric = Layer::new(f0, Vector::grey(closure.specular), kept);
        base_kept = base * dielectric.albedo.complement().positive();
        let metal_weight = metallic * uncoated;
        let dielectric_weight = if solid { below * transmission.complement() } else { below };
        specular_albedo = metal.albedo * metal_weight + dielectric.albedo * dielectric_weight;
        specular = Reflection {
            f0: metal.f0 * metal_weight + dielectric.f0 * dielectric_weight,
            f90: metal.f90 * metal_weight + dielectric.f90 * dielectric_weight,
            alpha,
        };
    }
    let diffuse = base_kept * (below * transmission.complement());
    let mut albedo = diffuse + specular_albedo + Vector::grey(coat.albedo);
    let mut through = Vector::grey(coverage.complement());
    let mut glass_lobes = Glass::none(zero);
    let mut thin = ThinTransmission { color: black, alpha };
    if solid {
        let weight = below * transmission;
        glass_lobes = glass(material, base, alpha, cos, geometry.front, weight);
        // What single scattering loses at rough interfaces is in the lobe's scale, not in the light that it sends on.
        let shares = base.mix(Vector::grey(one), glass_lobes.reflectance);
        albedo = albedo + shares * weight;
    } else if lobes.contains(Lobes::THIN_TRANSMIT) {
        let sheet = base_kept * (below * transmission);
        let clear = sheet.only(alpha.le(alpha.splat(SMOOTH_ALPHA)));
        let kept = kept_by_ggx(cos, alpha);
        thin.color = (sheet - clear) * (kept[0] + kept[1]).max(zero.splat(1e-3)).recip();
        through = through + clear * coverage;
        albedo = albedo + sheet;
    }
    let mut bsdf = Bsdf {
        normal: closure.normal,
        coat_normal: closure.coat_normal,
        ng: geometry.ng,
        wo: geometry.wo,
        diffuse,
        specular,
        coat: coat.reflection,
        glass: glass_lobes,
        thin,
        lobes,
        choice: [zero; 5],
    };
    bsdf.choose(specular_albedo, coat.albedo);
    Appearance { bsdf, through, albedo }
}

/// The interface of a solid, weighted so that a clear one loses nothing at any roughness.
#[inline(always)]
fn glass<F: Real>(
    material: &SurfaceMaterial,
    base: Vector<F>,
    alpha: F,
    cos: F,
    front: F::Mask,
    weight: F,
) -> Glass<F> {
    let zero = alpha.splat(0.0);
    let Some(tables) = material.interface.as_ref() else { return Glass::none(zero) };
    let ior = effective_ior(material.source().ior);
    let eta = zero.splat(ior).where_or(front, zero.splat(1.0 / ior));
    // Without a step of the index nothing bends, however rough.
    let alpha = if (ior - 1.0).abs() < 1e-3 { zero } else { alpha };
    let smooth = alpha.le(alpha.splat(SMOOTH_ALPHA));
    let (mut reflectance, mut kept) = (dielectric(cos, eta), zero.splat(1.0));
    if !smooth.all() {
        let entering = tables.entering.lookup(cos, alpha);
        let leaving = tables.leaving.lookup(cos, alpha);
        let reflected = entering[0].where_or(front, leaving[0]);
        let sum = (reflected + entering[1].where_or(front, leaving[1])).max(zero.splat(1e-3));
        reflectance = reflectance.where_or(smooth, reflected / sum);
        kept = kept.where_or(smooth, sum);
    }
    let weight = weight / kept;
    Glass { eta, alpha, reflectance, reflect: weight, transmit: base * weight }
}

#[inline(always)]
fn coat_layer<F: Real>(lobes: Lobes, closure: &Closure<F>, geometry: &LobeGeometry<F>) -> Coat<F> {
    let zero = closure.coat.splat(0.0);
    if !lobes.contains(Lobes::COAT) {
        return Coat { reflection: Reflection::none(zero), albedo: zero };
    }
    let alpha = closure.coat_roughness.squared();
    let cos = closure.coat_normal.dot(geometry.wo).clamp(1e-5, 1.0);
    let f0 = Vector::grey(zero.splat(COAT_F0));
    let layer = Layer::new(f0, Vector::grey(zero.splat(1.0)), kept_by_ggx(cos, alpha));
    let reflection = Reflection { f0: layer.f0 * closure.coat, f90: layer.f90 * closure.coat, alpha };
    Coat { reflection, albedo: (layer.albedo.x * closure.coat).min(zero.splat(1.0)) }
}

/// A reflecting layer under Schlick's Fresnel term with the energy of multiple scattering given back.
struct Layer<F> {
    f0: Vector<F>,
    f90: Vector<F>,
    albedo: Vector<F>,
}

impl<F: Real> Layer<F> {
    /// Turquin 2019, equation 15: the lobe is scaled by 1 + F0 (1 − E) / E.
    #[inline(always)]
    fn new(f0: Vector<F>, f90: Vector<F>, kept: [F; 2]) -> Self {
        let one = kept[0].splat(1.0);
        let lost = (kept[0] + kept[1]).max(kept[0].splat(1e-3)).recip() - 1.0;
        let compensation = Vector::grey(one) + f0 * lost;
        let albedo = (f0 * kept[0] + f90 * kept[1]) * compensation;
        Self { f0: f0 * compensation, f90: f90 * compensation, albedo }
    }
}

struct Coat<F> {
    reflection: Reflection<F>,
    albedo: F,
}

/// The split albedo of single scattering; smooth lobes follow Schlick's term exactly.
#[inline(always)]
pub(crate) fn kept_by_ggx<F: Real>(cos: F, alpha: F) -> [F; 2] {
    let smooth = alpha.le(alpha.splat(SMOOTH_ALPHA));
    let schlick = schlick_weight(cos);
    let exact = [schlick.complement(), schlick];
    if smooth.all() {
        return exact;
    }
    let [a, b] = reflection().lookup(cos, alpha);
    [exact[0].where_or(smooth, a), exact[1].where_or(smooth, b)]
}

pub(crate) fn effective_ior(ior: f32) -> f32 {
    if ior == 0.0 { MIRROR_IOR } else { ior.min(MIRROR_IOR) }
}

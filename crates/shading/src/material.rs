//! Materials made ready for shading: textures resolved, interfaces tabulated, parameters to lobes.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use heliostat_scene::{AlphaMode, Material, MaterialId, MaterialOverride, TextureId, TextureRef};

use crate::albedo::{InterfaceTables, reflection};
use crate::bsdf::{Bsdf, Glass, Lobes, Reflection, ThinTransmission};
use crate::color::Rgba;
use crate::fresnel::{dielectric, normal_incidence, schlick_weight};
use crate::lanes::{LaneFn, Mask, Real, Vector};
use crate::microfacet::SMOOTH_ALPHA;
use crate::texture::MipMap;

/// Reflectance of the clear coat at normal incidence: index 1.5.
const COAT_F0: f32 = 0.04;
/// Stands for an infinite index (ior = 0 in KHR_materials_ior): reflects 99.996 % at normal incidence.
const MIRROR_IOR: f32 = 1e5;

/// A texture in use: the pyramid and how coordinates map to it.
#[derive(Clone, Debug)]
pub(crate) struct Slot {
    map: Arc<MipMap>,
    pub(crate) reference: TextureRef,
    /// log2 of the texels along a unit of the mesh's coordinates.
    scale: f32,
}

/// A material with everything it refers to.
#[derive(Clone, Debug)]
pub struct SurfaceMaterial {
    /// The handle, for identifier planes.
    pub id: MaterialId,
    source: Arc<Material>,
    base_color: Option<Slot>,
    metallic_roughness: Option<Slot>,
    pub(crate) normal: Option<Slot>,
    emissive: Option<Slot>,
    specular: Option<Slot>,
    specular_color: Option<Slot>,
    transmission: Option<Slot>,
    coat: Option<Slot>,
    coat_roughness: Option<Slot>,
    pub(crate) coat_normal: Option<Slot>,
    interface: Option<Arc<InterfaceTables>>,
    textured: bool,
    /// The lobes that may have energy somewhere.
    lobes: Lobes,
}

/// Texture coordinates at a point: both sets, and the footprint per set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TextureCoordinates<F> {
    pub(crate) uv: [[F; 2]; 2],
    /// log2 of the footprint's width in texture space; anything where nothing is looked up.
    pub(crate) lod: [F; 2],
    /// Of the mesh.
    pub(crate) color: Rgba<F>,
}

/// The geometry that lobes need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LobeGeometry<F: Real> {
    /// Shading normal on `wo`'s side.
    pub(crate) normal: Vector<F>,
    /// The coat's.
    pub(crate) coat_normal: Vector<F>,
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
    /// Share of light that meets the surface at all.
    pub(crate) coverage: F,
    /// Light that passes straight through, per channel: holes and clear thin sheets.
    pub(crate) through: Vector<F>,
    /// Reflected share of uniform white light.
    pub(crate) albedo: Vector<F>,
    /// Radiance of the classical ambient term.
    pub(crate) ambient: Vector<F>,
}

/// Shared tables of interfaces, by the bits of their index.
pub type InterfaceCache = BTreeMap<u32, Arc<InterfaceTables>>;

impl SurfaceMaterial {
    /// Resolves a material's textures, which must be in `textures`; missing ones read as white.
    pub fn new(
        id: MaterialId,
        source: &Arc<Material>,
        textures: &BTreeMap<TextureId, Arc<MipMap>>,
        interfaces: &mut InterfaceCache,
    ) -> Self {
        let slot = |reference: &Option<TextureRef>| {
            let reference = (*reference)?;
            Some(Slot::new(textures.get(&reference.texture)?.clone(), reference))
        };
        let coat = source.clearcoat.as_ref();
        let solid = source.transmission > 0.0 && source.volume.is_some() && !source.unlit;
        let interface = solid.then(|| {
            let ior = effective_ior(source.ior);
            interfaces.entry(ior.to_bits()).or_insert_with(|| Arc::new(InterfaceTables::new(ior))).clone()
        });
        Self {
            id,
            source: source.clone(),
            base_color: slot(&source.base_color_texture),
            metallic_roughness: slot(&source.metallic_roughness_texture),
            normal: slot(&source.normal_texture),
            emissive: slot(&source.emissive_texture),
            specular: slot(&source.specular_texture),
            specular_color: slot(&source.specular_color_texture),
            transmission: slot(&source.transmission_texture),
            coat: coat.and_then(|c| slot(&c.texture)),
            coat_roughness: coat.and_then(|c| slot(&c.roughness_texture)),
            coat_normal: coat.and_then(|c| slot(&c.normal_texture)),
            interface,
            textured: source.textures().next().is_some(),
            lobes: possible_lobes(source),
        }
    }

    /// The lobes that may have energy somewhere.
    pub fn lobes(&self) -> Lobes {
        self.lobes
    }

    /// The material as it is or as `materials` makes it.
    pub fn overridden(material: &Arc<Material>, materials: MaterialOverride) -> Arc<Material> {
        match materials {
            MaterialOverride::None => material.clone(),
            MaterialOverride::Diffuse => Arc::new(Material {
                base_color: material.base_color,
                base_color_texture: material.base_color_texture,
                normal_texture: material.normal_texture,
                normal_scale: material.normal_scale,
                emissive: material.emissive,
                emissive_texture: material.emissive_texture,
                double_sided: material.double_sided,
                ..Material::diffuse(material.name.clone(), Vec3::ONE)
            }),
        }
    }

    /// The description it was made from.
    pub fn source(&self) -> &Material {
        &self.source
    }

    /// Whether anything is looked up by texture coordinates.
    pub(crate) fn is_textured(&self) -> bool {
        self.textured
    }

    /// Whether light can pass straight through: such surfaces do not simply occlude.
    pub fn is_see_through(&self) -> bool {
        let m = &self.source;
        // A texture may make any place smooth.
        let may_be_smooth =
            m.roughness * m.roughness <= SMOOTH_ALPHA || m.metallic_roughness_texture.is_some();
        m.alpha_mode != AlphaMode::Opaque
            || (m.transmission > 0.0 && m.volume.is_none() && may_be_smooth && !m.unlit)
    }

    /// Radiance emitted where `at`, towards the front (`front`) or the back.
    #[inline(always)]
    pub(crate) fn emission<F: Real>(&self, at: &TextureCoordinates<F>, front: F::Mask) -> Vector<F> {
        let token = at.color.a.token();
        if self.source.emissive == Vec3::ZERO {
            return Vector::constant(token, Vec3::ZERO);
        }
        let emission = Vector::constant(token, self.source.emissive) * lookup(&self.emissive, at).rgb;
        if self.source.double_sided { emission } else { emission.only(front) }
    }

    /// Emission of the share of the surface that is there; nothing comes from its holes.
    pub(crate) fn visible_emission(&self, at: &TextureCoordinates<f32>, front: bool) -> Vec3 {
        let coverage = match self.source.alpha_mode {
            AlphaMode::Opaque => 1.0,
            _ => self.coverage(self.base_color(at).a),
        };
        (self.emission(at, front) * coverage).into()
    }

    /// Mean of the emission over the texture.
    pub(crate) fn mean_emission(&self) -> Vec3 {
        let texture = self.emissive.as_ref().map_or(Vec3::ONE, |slot| slot.map.mean().truncate());
        self.source.emissive * texture
    }

    /// Absorption per metre inside the solid that this material bounds.
    pub(crate) fn absorption(&self) -> Vec3 {
        let Some(volume) = self.source.volume.filter(|_| self.source.transmission > 0.0) else {
            return Vec3::ZERO;
        };
        // −ln c / d; a channel that lets nothing through is given a transmittance of 1e-6.
        volume.attenuation_color.max(Vec3::splat(1e-6)).map(|c| -c.ln()) / volume.attenuation_distance
    }

    /// Base colour with alpha, mesh colours included.
    #[inline(always)]
    pub(crate) fn base_color<F: Real>(&self, at: &TextureCoordinates<F>) -> Rgba<F> {
        let token = at.color.a.token();
        let factor = self.source.base_color;
        let texel = lookup(&self.base_color, at);
        Rgba {
            rgb: (Vector::constant(token, factor.truncate()) * texel.rgb * at.color.rgb).clamp(0.0, 1.0),
            a: (texel.a * at.color.a * factor.w).clamp(0.0, 1.0),
        }
    }

    /// Radiance of the classical ambient term.
    #[inline(always)]
    fn ambient<F: Real>(&self, at: &TextureCoordinates<F>) -> Vector<F> {
        let ambient = Vector::constant(at.color.a.token(), self.source.ambient);
        if self.source.ambient == Vec3::ZERO { ambient } else { ambient * lookup(&self.base_color, at).rgb }
    }

    /// Share of light that meets the surface, from the base colour's alpha.
    #[inline(always)]
    pub(crate) fn coverage<F: Real>(&self, alpha: F) -> F {
        let one = alpha.splat(1.0);
        match self.source.alpha_mode {
            AlphaMode::Opaque => one,
            AlphaMode::Mask { cutoff } => one.only(alpha.ge(alpha.splat(cutoff))),
            AlphaMode::Blend => alpha,
        }
    }

    /// The material's parameters at a point turned into lobes.
    #[inline(always)]
    pub(crate) fn appearance<F: Real>(
        &self,
        at: &TextureCoordinates<F>,
        geometry: &LobeGeometry<F>,
    ) -> Appearance<F> {
        let m = &*self.source;
        let base = self.base_color(at);
        let coverage = self.coverage(base.a);
        let base = base.rgb;
        let (zero, one) = (coverage.splat(0.0), coverage.splat(1.0));
        let black = Vector::grey(zero);
        let metallic_roughness = lookup(&self.metallic_roughness, at).rgb;
        let alpha = (metallic_roughness.y * m.roughness).clamp(0.0, 1.0).squared();
        let metallic = (metallic_roughness.z * m.metallic).clamp(0.0, 1.0);
        let cos = geometry.normal.dot(geometry.wo).clamp(1e-5, 1.0);

        let coat = self.coat_layer(at, geometry);
        let uncoated = coat.albedo.complement();
        let below = metallic.complement() * uncoated;
        let transmission = match m.transmission > 0.0 {
            true => (lookup(&self.transmission, at).rgb.x * m.transmission).clamp(0.0, 1.0),
            false => zero,
        };
        let solid = self.interface.is_some();

        // A thin sheet's two faces reflect together like the opaque base's one; a solid's interface is a lobe of its own.
        let (mut specular, mut specular_albedo, mut base_kept) = (Reflection::none(zero), black, base);
        if self.lobes.contains(Lobes::SPECULAR) {
            let kept = kept_by_ggx(cos, alpha);
            let strength = (lookup(&self.specular, at).a * m.specular).clamp(0.0, 1.0);
            let tint = Vector::constant(zero.token(), m.specular_color) * lookup(&self.specular_color, at).rgb;
            let f0 = tint.scaled(normal_incidence(m.ior)).clamp(0.0, 1.0) * strength;
            let metal = Layer::new(base, Vector::grey(one), kept);
            let dielectric = Layer::new(f0, Vector::grey(strength), kept);
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
        let mut glass = Glass::none(zero);
        let mut thin = ThinTransmission { color: black, alpha };
        if solid {
            glass = self.glass(base, alpha, cos, geometry.front, below * transmission);
            albedo = albedo + glass.albedo();
        } else if m.transmission > 0.0 {
            let sheet = base_kept * (below * transmission);
            let clear = sheet.only(alpha.le(alpha.splat(SMOOTH_ALPHA)));
            let kept = kept_by_ggx(cos, alpha);
            thin.color = (sheet - clear) * (kept[0] + kept[1]).max(zero.splat(1e-3)).recip();
            through = through + clear * coverage;
            albedo = albedo + sheet;
        }
        let mut bsdf = Bsdf {
            normal: geometry.normal,
            coat_normal: geometry.coat_normal,
            ng: geometry.ng,
            wo: geometry.wo,
            diffuse,
            specular,
            coat: coat.reflection,
            glass,
            thin,
            lobes: self.lobes,
            choice: [zero; 5],
        };
        bsdf.choose(specular_albedo, coat.albedo);
        Appearance { bsdf, coverage, through, albedo, ambient: self.ambient(at) }
    }

    /// The interface of a solid, weighted so that a clear one loses nothing at any roughness.
    #[inline(always)]
    fn glass<F: Real>(&self, base: Vector<F>, alpha: F, cos: F, front: F::Mask, weight: F) -> Glass<F> {
        let zero = alpha.splat(0.0);
        let Some(tables) = self.interface.as_ref() else { return Glass::none(zero) };
        let ior = effective_ior(self.source.ior);
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
    fn coat_layer<F: Real>(&self, at: &TextureCoordinates<F>, geometry: &LobeGeometry<F>) -> Coat<F> {
        let zero = at.color.a.splat(0.0);
        let Some(coat) = self.source.clearcoat.as_ref().filter(|_| self.lobes.contains(Lobes::COAT)) else {
            return Coat { reflection: Reflection::none(zero), albedo: zero };
        };
        let factor = (lookup(&self.coat, at).rgb.x * coat.factor).clamp(0.0, 1.0);
        let alpha = (lookup(&self.coat_roughness, at).rgb.y * coat.roughness).clamp(0.0, 1.0).squared();
        let cos = geometry.coat_normal.dot(geometry.wo).clamp(1e-5, 1.0);
        let f0 = Vector::grey(zero.splat(COAT_F0));
        let layer = Layer::new(f0, Vector::grey(zero.splat(1.0)), kept_by_ggx(cos, alpha));
        let reflection = Reflection { f0: layer.f0 * factor, f90: layer.f90 * factor, alpha };
        Coat { reflection, albedo: (layer.albedo.x * factor).min(zero.splat(1.0)) }
    }
}

/// The lobes that a material may have anywhere, by its constants.
fn possible_lobes(m: &Material) -> Lobes {
    if m.unlit {
        return Lobes::NONE;
    }
    let solid = m.volume.is_some();
    // The constants are multiplied by textures of values up to 1: those below 1 may reach anything, those of 1 too.
    let all_metal = m.metallic >= 1.0 && m.metallic_roughness_texture.is_none();
    let all_transmitted = m.transmission >= 1.0 && m.transmission_texture.is_none();
    let present = [
        (Lobes::DIFFUSE, !all_metal && !all_transmitted),
        (Lobes::SPECULAR, m.metallic > 0.0 || (m.specular > 0.0 && !(solid && all_transmitted))),
        (Lobes::COAT, m.clearcoat.as_ref().is_some_and(|coat| coat.factor > 0.0)),
        (Lobes::GLASS_REFLECT.union(Lobes::GLASS_TRANSMIT), m.transmission > 0.0 && solid && !all_metal),
        (Lobes::THIN_TRANSMIT, m.transmission > 0.0 && !solid && !all_metal),
    ];
    present.into_iter().filter(|(_, is)| *is).fold(Lobes::NONE, |set, (lobe, _)| set.union(lobe))
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
fn kept_by_ggx<F: Real>(cos: F, alpha: F) -> [F; 2] {
    let smooth = alpha.le(alpha.splat(SMOOTH_ALPHA));
    let schlick = schlick_weight(cos);
    let exact = [schlick.complement(), schlick];
    if smooth.all() {
        return exact;
    }
    let [a, b] = reflection().lookup(cos, alpha);
    [exact[0].where_or(smooth, a), exact[1].where_or(smooth, b)]
}

fn effective_ior(ior: f32) -> f32 {
    if ior == 0.0 { MIRROR_IOR } else { ior.min(MIRROR_IOR) }
}

#[inline(always)]
pub(crate) fn lookup<F: Real>(slot: &Option<Slot>, at: &TextureCoordinates<F>) -> Rgba<F> {
    match slot {
        Some(slot) => slot.lookup(at),
        None => Rgba::white(at.color.a),
    }
}

impl Slot {
    fn new(map: Arc<MipMap>, reference: TextureRef) -> Self {
        let texels = map.size();
        let area = reference.transform.0.matrix2.determinant().abs() * texels.x * texels.y;
        Self { map, reference, scale: 0.5 * area.max(1e-20).log2() }
    }

    /// The texel under the footprint.
    #[inline(always)]
    pub(crate) fn lookup<F: Real>(&self, at: &TextureCoordinates<F>) -> Rgba<F> {
        let set = usize::from(self.reference.uv_set.min(1));
        let [u, v] = at.uv[set];
        let [r, g, b, a] = F::each([u, v, at.lod[set]], self);
        Rgba { rgb: Vector::new(r, g, b), a }
    }
}

/// The texel at the mesh's coordinates, and log2 of the footprint's width in them.
impl LaneFn<3, 4> for Slot {
    fn at(&self, [u, v, lod]: [f32; 3]) -> [f32; 4] {
        let transform = &self.reference.transform.0;
        self.map.lookup(transform.transform_point2(Vec2::new(u, v)), lod + self.scale).to_array()
    }
}

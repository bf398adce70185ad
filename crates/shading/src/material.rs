//! Materials made ready for shading: textures resolved, interfaces tabulated, parameters to lobes.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use heliostat_scene::{AlphaMode, Material, MaterialId, MaterialOverride, TextureId, TextureRef};

use crate::albedo::{InterfaceTables, reflection};
use crate::basis::Basis;
use crate::bsdf::{Bsdf, Glass, Lobes, Reflection, ThinTransmission};
use crate::fresnel::{dielectric, normal_incidence};
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
}

/// Texture coordinates at a point: both sets, and the footprint per set.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TextureCoordinates {
    pub(crate) uv: [Vec2; 2],
    /// log2 of the footprint's width in texture space; 0 where nothing is looked up.
    pub(crate) lod: [f32; 2],
    /// Linear RGBA of the mesh.
    pub(crate) color: Vec4,
}

/// The geometry that lobes need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LobeGeometry {
    pub(crate) basis: Basis,
    pub(crate) coat_basis: Basis,
    /// On `wo`'s side.
    pub(crate) ng: Vec3,
    pub(crate) wo: Vec3,
    /// Whether `wo` sees the front.
    pub(crate) front: bool,
}

/// What a material does with light at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Appearance {
    pub(crate) bsdf: Bsdf,
    /// Share of light that meets the surface at all.
    pub(crate) coverage: f32,
    /// Light that passes straight through, per channel: holes and clear thin sheets.
    pub(crate) through: Vec3,
    /// Reflected share of uniform white light.
    pub(crate) albedo: Vec3,
    /// Radiance of the classical ambient term.
    pub(crate) ambient: Vec3,
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
            Some(Slot { map: textures.get(&reference.texture)?.clone(), reference })
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
        }
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
    pub(crate) fn emission(&self, at: &TextureCoordinates, front: bool) -> Vec3 {
        if !(front || self.source.double_sided) || self.source.emissive == Vec3::ZERO {
            return Vec3::ZERO;
        }
        self.source.emissive * lookup(&self.emissive, at).truncate()
    }

    /// Emission of the share of the surface that is there; nothing comes from its holes.
    pub(crate) fn visible_emission(&self, at: &TextureCoordinates, front: bool) -> Vec3 {
        match self.source.alpha_mode {
            AlphaMode::Opaque => self.emission(at, front),
            _ => self.emission(at, front) * self.coverage(self.base_color(at).w),
        }
    }

    /// Mean of the emission over the texture.
    pub(crate) fn mean_emission(&self) -> Vec3 {
        let texture = self.emissive.as_ref().map_or(Vec4::ONE, |slot| slot.map.mean());
        self.source.emissive * texture.truncate()
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
    pub(crate) fn base_color(&self, at: &TextureCoordinates) -> Vec4 {
        (self.source.base_color * lookup(&self.base_color, at) * at.color).clamp(Vec4::ZERO, Vec4::ONE)
    }

    /// Radiance of the classical ambient term.
    fn ambient(&self, at: &TextureCoordinates) -> Vec3 {
        let ambient = self.source.ambient;
        if ambient == Vec3::ZERO { ambient } else { ambient * lookup(&self.base_color, at).truncate() }
    }

    /// Share of light that meets the surface, from the base colour's alpha.
    pub(crate) fn coverage(&self, alpha: f32) -> f32 {
        match self.source.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(alpha >= cutoff),
            AlphaMode::Blend => alpha,
        }
    }

    /// The material's parameters at a point turned into lobes.
    pub(crate) fn appearance(&self, at: &TextureCoordinates, geometry: &LobeGeometry) -> Appearance {
        let m = &*self.source;
        let base = self.base_color(at);
        let coverage = self.coverage(base.w);
        let base = base.truncate();
        let metallic_roughness = lookup(&self.metallic_roughness, at);
        let alpha = squared((m.roughness * metallic_roughness.y).clamp(0.0, 1.0));
        let metallic = (m.metallic * metallic_roughness.z).clamp(0.0, 1.0);
        let transmission = (m.transmission * lookup(&self.transmission, at).x).clamp(0.0, 1.0);
        let specular = (m.specular * lookup(&self.specular, at).w).clamp(0.0, 1.0);
        let tint = m.specular_color * lookup(&self.specular_color, at).truncate();

        let cos = geometry.basis.z.dot(geometry.wo).clamp(1e-5, 1.0);
        let kept = kept_by_ggx(cos, alpha);
        let solid = self.interface.is_some();
        // A thin sheet's two faces reflect together like the opaque base's one; a solid's interface is a lobe of its own.
        let dielectric_weight = (1.0 - metallic) * if solid { 1.0 - transmission } else { 1.0 };
        let f0 = (normal_incidence(m.ior) * tint).min(Vec3::ONE) * specular;
        let metal = Layer::new(base, Vec3::ONE, kept);
        let dielectric = Layer::new(f0, Vec3::splat(specular), kept);
        let below = base * (Vec3::ONE - dielectric.albedo).max(Vec3::ZERO);

        let coat = self.coat_layer(at, geometry);
        let uncoated = 1.0 - coat.albedo;
        let specular_albedo = (metal.albedo * metallic + dielectric.albedo * dielectric_weight) * uncoated;
        let diffuse = below * ((1.0 - metallic) * (1.0 - transmission) * uncoated);
        let sheet = if solid { Vec3::ZERO } else { below * ((1.0 - metallic) * transmission * uncoated) };
        let smooth = alpha <= SMOOTH_ALPHA;
        let clear = if smooth { sheet } else { Vec3::ZERO };
        let glass = self.glass(base, alpha, cos, geometry.front, (1.0 - metallic) * transmission * uncoated);

        let bsdf = Bsdf {
            basis: geometry.basis,
            coat_basis: geometry.coat_basis,
            ng: geometry.ng,
            wo: geometry.wo,
            diffuse,
            specular: Reflection {
                f0: (metal.f0 * metallic + dielectric.f0 * dielectric_weight) * uncoated,
                f90: (metal.f90 * metallic + dielectric.f90 * dielectric_weight) * uncoated,
                alpha,
            },
            coat: coat.reflection,
            glass,
            thin: ThinTransmission { color: (sheet - clear) / (kept.x + kept.y).max(1e-3), alpha },
            lobes: Lobes::NONE,
            choice: [0.0; 5],
        };
        Appearance {
            bsdf: bsdf.finish(specular_albedo, coat.albedo),
            coverage,
            through: Vec3::splat(1.0 - coverage) + clear * coverage,
            albedo: diffuse
                + specular_albedo
                + coat.albedo
                + glass.reflect.lerp(glass.transmit, 1.0 - glass.reflectance)
                + sheet,
            ambient: self.ambient(at),
        }
    }

    /// The interface of a solid, weighted so that a clear one loses nothing at any roughness.
    fn glass(&self, base: Vec3, alpha: f32, cos: f32, front: bool, weight: f32) -> Glass {
        let Some(tables) = self.interface.as_ref().filter(|_| weight > 0.0) else { return Glass::NONE };
        let ior = effective_ior(self.source.ior);
        let (eta, table) = if front { (ior, &tables.entering) } else { (1.0 / ior, &tables.leaving) };
        // Without a step of the index nothing bends, however rough.
        let alpha = if (ior - 1.0).abs() < 1e-3 { 0.0 } else { alpha };
        let (reflectance, kept) = if alpha <= SMOOTH_ALPHA {
            (dielectric(cos, eta), 1.0)
        } else {
            let split = table.lookup(cos, alpha);
            let kept = split.element_sum().max(1e-3);
            (split.x / kept, kept)
        };
        let weight = Vec3::splat(weight / kept);
        Glass { eta, alpha, reflectance, reflect: weight, transmit: base * weight }
    }

    fn coat_layer(&self, at: &TextureCoordinates, geometry: &LobeGeometry) -> Coat {
        let Some(coat) = &self.source.clearcoat else { return Coat::NONE };
        let factor = (coat.factor * lookup(&self.coat, at).x).clamp(0.0, 1.0);
        if factor == 0.0 {
            return Coat::NONE;
        }
        let alpha = squared((coat.roughness * lookup(&self.coat_roughness, at).y).clamp(0.0, 1.0));
        let cos = geometry.coat_basis.z.dot(geometry.wo).clamp(1e-5, 1.0);
        let layer = Layer::new(Vec3::splat(COAT_F0), Vec3::ONE, kept_by_ggx(cos, alpha));
        let reflection = Reflection { f0: layer.f0 * factor, f90: layer.f90 * factor, alpha };
        Coat { reflection, albedo: (layer.albedo.x * factor).min(1.0) }
    }
}

/// A reflecting layer under Schlick's Fresnel term with the energy of multiple scattering given back.
struct Layer {
    f0: Vec3,
    f90: Vec3,
    albedo: Vec3,
}

impl Layer {
    /// Turquin 2019, equation 15: the lobe is scaled by 1 + F0 (1 − E) / E.
    fn new(f0: Vec3, f90: Vec3, kept: Vec2) -> Self {
        let compensation = Vec3::ONE + f0 * (1.0 / (kept.x + kept.y).max(1e-3) - 1.0);
        let albedo = (f0 * kept.x + f90 * kept.y) * compensation;
        Self { f0: f0 * compensation, f90: f90 * compensation, albedo }
    }
}

struct Coat {
    reflection: Reflection,
    albedo: f32,
}

impl Coat {
    const NONE: Self = Self { reflection: Reflection::NONE, albedo: 0.0 };
}

/// The split albedo of single scattering; smooth lobes follow Schlick's term exactly.
fn kept_by_ggx(cos: f32, alpha: f32) -> Vec2 {
    if alpha <= SMOOTH_ALPHA {
        let schlick = crate::fresnel::schlick_weight(cos);
        return Vec2::new(1.0 - schlick, schlick);
    }
    reflection().lookup(cos, alpha)
}

fn effective_ior(ior: f32) -> f32 {
    if ior == 0.0 { MIRROR_IOR } else { ior.min(MIRROR_IOR) }
}

fn squared(x: f32) -> f32 {
    x * x
}

pub(crate) fn lookup(slot: &Option<Slot>, at: &TextureCoordinates) -> Vec4 {
    slot.as_ref().map_or(Vec4::ONE, |slot| slot.lookup(at))
}

impl Slot {
    pub(crate) fn lookup(&self, at: &TextureCoordinates) -> Vec4 {
        let set = usize::from(self.reference.uv_set.min(1));
        let transform = &self.reference.transform.0;
        let texels = self.map.size();
        let scale = 0.5 * (transform.matrix2.determinant().abs() * texels.x * texels.y).max(1e-20).log2();
        self.map.lookup(transform.transform_point2(at.uv[set]), at.lod[set] + scale)
    }
}

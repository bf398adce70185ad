//! What a surface is made of: the metallic-roughness model of glTF 2.0 with its ratified extensions.

use std::sync::Arc;

use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};

use crate::{ShaderUse, TextureId};

/// A surface's look. Every texture multiplies the factor of the same name.
///
/// The model is a weighted mix: `metallic` between a conductor and a dielectric, the dielectric between an opaque
/// base (`1 − transmission`) under a Fresnel reflection and a transmitting interface, and a clear coat on top.
/// Surfaces reflect on both sides; `double_sided` concerns emission only.
///
/// # References
/// Khronos glTF 2.0 specification, appendix B; KHR_materials_{clearcoat, emissive_strength, ior, specular,
/// transmission, unlit, volume}.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// For people; need not be unique.
    pub name: String,
    /// Linear RGB reflectance in [0, 1] and alpha.
    pub base_color: Vec4,
    /// Multiplies `base_color`, alpha included.
    pub base_color_texture: Option<TextureRef>,
    /// 0 = dielectric, 1 = metal.
    pub metallic: f32,
    /// Perceptual roughness in [0, 1]; the GGX α is its square.
    pub roughness: f32,
    /// Roughness in green, metallic in blue.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals, RGB in [0, 1] mapped to [−1, 1].
    pub normal_texture: Option<TextureRef>,
    /// Scales x and y of the texture's normals.
    pub normal_scale: f32,
    /// Emitted radiance, strength included.
    pub emissive: Vec3,
    /// Multiplies `emissive`.
    pub emissive_texture: Option<TextureRef>,
    /// Emits from both sides; otherwise from the front only.
    pub double_sided: bool,
    /// How `base_color`'s alpha is used.
    pub alpha_mode: AlphaMode,
    /// Index of refraction, at least 1; or 0 for a reflectance of one at every angle, as KHR_materials_ior has it.
    pub ior: f32,
    /// Strength of the dielectric reflection at all angles, 0 to 1. Zero makes the base a pure Lambertian.
    pub specular: f32,
    /// Multiplies `specular`; alpha channel.
    pub specular_texture: Option<TextureRef>,
    /// Tint of the dielectric reflection at normal incidence.
    pub specular_color: Vec3,
    /// Multiplies `specular_color`.
    pub specular_color_texture: Option<TextureRef>,
    /// Share of the dielectric's base that transmits light instead of scattering it diffusely, 0 to 1.
    pub transmission: f32,
    /// Multiplies `transmission`; red channel.
    pub transmission_texture: Option<TextureRef>,
    /// `Some`: the surface bounds a solid, light bends and is absorbed. `None`: a thin sheet, light goes straight on.
    pub volume: Option<Volume>,
    /// A transparent layer on top.
    pub clearcoat: Option<Clearcoat>,
    /// Show `base_color` as it is, without any lighting. It is seen, in mirrors and through glass too, and lights nothing.
    pub unlit: bool,
    /// The ambient term of classical ray tracing: linear RGB radiance, times the base colour's texture, that the
    /// renderer `direct` adds wherever the surface is, lit or not. It stands for the light between surfaces in scenes
    /// made for such renderers. Physical materials have none, and renderers that follow that light ignore it.
    pub ambient: Vec3,
    /// A shader that changes any of the above from point to point; it starts from what they say.
    pub shader: Option<Arc<ShaderUse>>,
}

impl Default for Material {
    /// White, fully rough, dielectric of index 1.5, opaque.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            double_sided: false,
            alpha_mode: AlphaMode::Opaque,
            ior: 1.5,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            volume: None,
            clearcoat: None,
            unlit: false,
            ambient: Vec3::ZERO,
            shader: None,
        }
    }
}

impl Material {
    /// A Lambertian reflector.
    pub fn diffuse(name: impl Into<String>, reflectance: Vec3) -> Self {
        Self { name: name.into(), base_color: reflectance.extend(1.0), specular: 0.0, ..Self::default() }
    }

    /// A plastic-like surface: a dielectric reflection over a diffuse base.
    pub fn plastic(name: impl Into<String>, base_color: Vec3, roughness: f32) -> Self {
        Self { name: name.into(), base_color: base_color.extend(1.0), roughness, ..Self::default() }
    }

    /// A metal of the given reflectance at normal incidence.
    pub fn metal(name: impl Into<String>, reflectance: Vec3, roughness: f32) -> Self {
        Self {
            name: name.into(),
            base_color: reflectance.extend(1.0),
            metallic: 1.0,
            roughness,
            ..Self::default()
        }
    }

    /// Clear solid glass that bends light.
    pub fn glass(name: impl Into<String>, ior: f32) -> Self {
        Self {
            name: name.into(),
            roughness: 0.0,
            transmission: 1.0,
            ior,
            volume: Some(Volume::default()),
            ..Self::default()
        }
    }

    /// A black surface that emits `radiance` from its front side.
    pub fn emitter(name: impl Into<String>, radiance: Vec3) -> Self {
        Self { emissive: radiance, ..Self::diffuse(name, Vec3::ZERO) }
    }

    /// Every texture the material refers to, with the field's name.
    pub fn textures(&self) -> impl Iterator<Item = (&str, &TextureRef)> {
        let coat = self.clearcoat.as_ref();
        [
            ("base_color_texture", self.base_color_texture.as_ref()),
            ("metallic_roughness_texture", self.metallic_roughness_texture.as_ref()),
            ("normal_texture", self.normal_texture.as_ref()),
            ("emissive_texture", self.emissive_texture.as_ref()),
            ("specular_texture", self.specular_texture.as_ref()),
            ("specular_color_texture", self.specular_color_texture.as_ref()),
            ("transmission_texture", self.transmission_texture.as_ref()),
            ("clearcoat.texture", coat.and_then(|c| c.texture.as_ref())),
            ("clearcoat.roughness_texture", coat.and_then(|c| c.roughness_texture.as_ref())),
            ("clearcoat.normal_texture", coat.and_then(|c| c.normal_texture.as_ref())),
        ]
        .into_iter()
        .filter_map(|(name, texture)| Some((name, texture?)))
        .chain(self.shader.iter().flat_map(|shader| shader.textures()))
    }

    /// Whether any of it emits light.
    pub fn is_emissive(&self) -> bool {
        self.emissive.max_element() > 0.0 && !self.unlit
    }

    /// What is out of range, if anything: the field, its value and the range.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        let unit = [
            ("metallic", self.metallic),
            ("roughness", self.roughness),
            ("specular", self.specular),
            ("transmission", self.transmission),
            ("base_color.r", self.base_color.x),
            ("base_color.g", self.base_color.y),
            ("base_color.b", self.base_color.z),
            ("base_color.a", self.base_color.w),
            ("clearcoat.factor", self.clearcoat.as_ref().map_or(0.0, |c| c.factor)),
            ("clearcoat.roughness", self.clearcoat.as_ref().map_or(0.0, |c| c.roughness)),
        ];
        for (name, value) in unit {
            if !(0.0..=1.0).contains(&value) {
                return Some(format!("`{name}` is {value}; give a value from 0 to 1"));
            }
        }
        for (name, value) in
            [("emissive", self.emissive), ("specular_color", self.specular_color), ("ambient", self.ambient)]
        {
            if !(value.is_finite() && value.min_element() >= 0.0) {
                return Some(format!("`{name}` is {value}; give finite values of at least 0"));
            }
        }
        if !(self.ior == 0.0 || (1.0..=1e6).contains(&self.ior)) {
            return Some(format!("`ior` is {}; give a value of at least 1, or 0", self.ior));
        }
        let cutoff = if let AlphaMode::Mask { cutoff } = self.alpha_mode { cutoff } else { 0.0 };
        let coat_scale = self.clearcoat.as_ref().map_or(0.0, |c| c.normal_scale);
        let finite = [
            ("normal_scale", self.normal_scale),
            ("alpha_mode.cutoff", cutoff),
            ("clearcoat.normal_scale", coat_scale),
        ];
        if let Some((name, value)) = finite.into_iter().find(|(_, value)| !value.is_finite()) {
            return Some(format!("`{name}` is {value}; give a finite value"));
        }
        if let Some((name, _)) = self.textures().find(|(_, t)| !t.transform.0.is_finite()) {
            return Some(format!(
                "`{name}` has a coordinate transform that is not finite; give finite numbers"
            ));
        }
        let volume = self.volume.as_ref()?;
        let color = volume.attenuation_color;
        if !(color.min_element() >= 0.0 && color.max_element() <= 1.0) {
            return Some(format!("`volume.attenuation_color` is {color}; give values from 0 to 1"));
        }
        let distance = volume.attenuation_distance;
        (distance.is_nan() || distance <= 0.0).then(|| {
            format!("`volume.attenuation_distance` is {distance}; give a positive value or infinity")
        })
    }
}

/// A use of a texture: which one, which coordinates, and how they are mapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// The texture.
    pub texture: TextureId,
    /// Which of the mesh's two coordinate sets.
    pub uv_set: u8,
    /// Applied to the mesh's coordinates before the lookup.
    pub transform: UvTransform,
}

impl TextureRef {
    /// The texture looked up by the first coordinate set, untransformed.
    pub fn new(texture: TextureId) -> Self {
        Self { texture, uv_set: 0, transform: UvTransform::IDENTITY }
    }
}

/// `texture_from_mesh` for texture coordinates: scale, then rotation, then offset (KHR_texture_transform).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UvTransform(pub Affine2);

impl UvTransform {
    /// Leaves coordinates as they are.
    pub const IDENTITY: Self = Self(Affine2::IDENTITY);

    /// By the extension's parameters; `rotation` is counter-clockwise in radians as seen in the image.
    pub fn new(offset: Vec2, rotation: f32, scale: Vec2) -> Self {
        let (sin, cos) = rotation.sin_cos();
        let rotate = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos));
        Self(Affine2::from_mat2_translation(rotate * Mat2::from_diagonal(scale), offset))
    }
}

/// Use of the base colour's alpha.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Ignored.
    Opaque,
    /// Holes where alpha is below `cutoff`.
    Mask {
        /// Threshold, usually 0.5.
        cutoff: f32,
    },
    /// Alpha is the surface's coverage; the rest of the light passes straight through.
    Blend,
}

/// The inside of a solid: absorption by Beer's law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Transmittance over `attenuation_distance`, per channel.
    pub attenuation_color: Vec3,
    /// In metres; infinity absorbs nothing.
    pub attenuation_distance: f32,
}

impl Default for Volume {
    fn default() -> Self {
        Self { attenuation_color: Vec3::ONE, attenuation_distance: f32::INFINITY }
    }
}

/// A thin clear dielectric layer (index 1.5) over everything else.
#[derive(Clone, Debug, PartialEq)]
pub struct Clearcoat {
    /// Coverage, 0 to 1.
    pub factor: f32,
    /// Multiplies `factor`; red channel.
    pub texture: Option<TextureRef>,
    /// Perceptual roughness.
    pub roughness: f32,
    /// Multiplies `roughness`; green channel.
    pub roughness_texture: Option<TextureRef>,
    /// The layer's own normals. Without it the layer is smooth: the base's normal map does not apply.
    pub normal_texture: Option<TextureRef>,
    /// Scales x and y of the texture's normals.
    pub normal_scale: f32,
}

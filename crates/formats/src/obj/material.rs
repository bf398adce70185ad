//! From MTL's empirical model to a physical one.
//!
//! - `Kd` is the base colour, at most 1.
//! - `Ks` is the reflectance at normal incidence of a dielectric coat over it, `specular · 0.04 · specular_color`:
//!   nothing is lost however coloured or strong it is, and `Ks` 0 is exactly Lambertian. `Ns` becomes a GGX
//!   roughness of the same width, α = √(2 / (Ns + 2)).
//! - `illum` 3, 5 and 8 are mirrors: the same with roughness 0.
//! - `illum` 4, 6, 7 and 9 are glass: solid if `Ni` exceeds 1, a thin sheet otherwise. `Tf` tints it by hue: files
//!   use its strength as a filter, as opacity, and as transparency, so its largest channel counts as 1.
//! - `Tf` above 0 in a material without `illum`, `d` and `Tr` lets that share of light straight through
//!   (as `d` = 1 − Tf).
//! - `d` below 1, or `Tr` above 0 when `d` is absent, is coverage.
//! - `Ke` leaves the front side only.
//! - `Pr`, `Pm`, `Pc`, `Pcr` with their maps replace `Ks` and `Ns`.
//!
//! # References
//! Wavefront, "Advanced Visualizer: MTL material format", 1995. Walter, Marschner, Li, Torrance, "Microfacet Models
//! for Refraction through Rough Surfaces", 2007, section 5 (Phong exponent and α).

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use heliostat_scene::{
    AlphaMode, Clearcoat, ColorSpace, Image, Material, SceneBuilder, Texture, TextureId, TextureRef,
    UvTransform, Volume, Wrap,
};

use super::mtl::{Map, MapKind, Mtl};
use crate::context::Context;
use crate::error::LoadError;
use crate::image::pixels;
use crate::textures::{ImageFiles, or_placeholder};

/// Converts materials; keeps what their textures share.
#[derive(Default)]
pub(super) struct Converter {
    files: ImageFiles,
    textures: HashMap<TextureKey, TextureId>,
}

/// What makes two textures the same.
#[derive(PartialEq, Eq, Hash)]
struct TextureKey {
    files: Vec<String>,
    use_: &'static str,
    clamp: bool,
    /// Bits of the bump strength.
    strength: u32,
}

/// Reflectance of a dielectric of index 1.5 at normal incidence.
const F0: f32 = 0.04;

impl Converter {
    pub(super) fn convert(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        mtl: &Mtl,
    ) -> Result<Material, LoadError> {
        let mut material = Material { name: mtl.name.clone(), ..Material::default() };
        material.base_color = base_color(context, mtl).extend(1.0);
        material.emissive = mtl.emission.unwrap_or(Vec3::ZERO);
        if mtl.map(MapKind::Emission).is_some() && material.emissive == Vec3::ZERO {
            material.emissive = Vec3::ONE;
        }
        reflection(context, mtl, &mut material);
        transparency(context, mtl, &mut material);
        self.maps(context, builder, mtl, &mut material)?;
        Ok(material)
    }

    fn maps(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        mtl: &Mtl,
        material: &mut Material,
    ) -> Result<(), LoadError> {
        let (diffuse, opacity) = (mtl.map(MapKind::Diffuse), mtl.map(MapKind::Opacity));
        if let Some(first) = diffuse.or(opacity) {
            let make = |images: &[Option<Arc<Image>>]| match (diffuse, &images[0], images.last()) {
                (Some(_), None, _) => None,
                (_, Some(base), Some(Some(mask))) if opacity.is_some() => {
                    let base =
                        if diffuse.is_some() { base.clone() } else { Arc::new(pixels::white_like(mask)) };
                    Some(Arc::new(pixels::with_lanes(&base, &[(3, mask)])))
                }
                (_, image, _) => image.clone(),
            };
            let maps: Vec<&Map> = [diffuse, opacity].into_iter().flatten().collect();
            // With a diffuse map alone the file's image is shared as it is.
            let use_ = if opacity.is_some() { "base and opacity" } else { "colour" };
            let id = self.texture(context, builder, &maps, use_, ColorSpace::Srgb, make)?;
            material.base_color_texture = Some(reference(id, first));
            if opacity.is_some() {
                material.alpha_mode = AlphaMode::Blend;
            }
        }
        for (kind, slot) in [
            (MapKind::Specular, &mut material.specular_color_texture),
            (MapKind::Emission, &mut material.emissive_texture),
        ] {
            if let Some(map) = mtl.map(kind) {
                let id =
                    self.texture(context, builder, &[map], "colour", ColorSpace::Srgb, |i| i[0].clone())?;
                *slot = Some(reference(id, map));
            }
        }
        self.normal_map(context, builder, mtl, material)?;
        self.roughness_map(context, builder, mtl, material)
    }

    fn normal_map(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        mtl: &Mtl,
        material: &mut Material,
    ) -> Result<(), LoadError> {
        let Some((map, is_bump)) = mtl
            .map(MapKind::Normal)
            .map(|map| (map, false))
            .or_else(|| mtl.map(MapKind::Bump).map(|map| (map, true)))
        else {
            return Ok(());
        };
        let flat = || Arc::new(Image::rgba8(1, 1, vec![128, 128, 255, 255]));
        let make = |images: &[Option<Arc<Image>>]| {
            Some(match &images[0] {
                None => flat(),
                Some(image) if is_bump && pixels::is_grey(image) => {
                    Arc::new(pixels::normals_from_heights(image, map.bump))
                }
                Some(image) => image.clone(),
            })
        };
        let use_ = if is_bump { "bump" } else { "normal" };
        let id = self.texture(context, builder, &[map], use_, ColorSpace::Linear, make)?;
        material.normal_texture = Some(reference(id, map));
        Ok(())
    }

    fn roughness_map(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        mtl: &Mtl,
        material: &mut Material,
    ) -> Result<(), LoadError> {
        let (roughness, metallic) = (mtl.map(MapKind::Roughness), mtl.map(MapKind::Metallic));
        let Some(first) = roughness.or(metallic) else { return Ok(()) };
        let make = |images: &[Option<Arc<Image>>]| {
            let mut lanes = Vec::new();
            let mut images = images.iter();
            for (lane, map) in [(1, roughness), (2, metallic)] {
                if let (Some(_), Some(Some(image))) = (map, map.and_then(|_| images.next())) {
                    lanes.push((lane, image.as_ref()));
                }
            }
            let base = pixels::white_like(lanes.first()?.1);
            Some(Arc::new(pixels::with_lanes(&base, &lanes)))
        };
        let use_ = if roughness.is_some() { "roughness" } else { "metallic" };
        let maps: Vec<&Map> = [roughness, metallic].into_iter().flatten().collect();
        let id = self.texture(context, builder, &maps, use_, ColorSpace::Linear, make)?;
        // The maps multiply factors that such files leave at 0.
        material.roughness =
            if roughness.is_some() { mtl.roughness.unwrap_or(1.0) } else { material.roughness };
        material.metallic = if metallic.is_some() { mtl.metallic.unwrap_or(1.0) } else { material.metallic };
        material.roughness = material.roughness.clamp(0.0, 1.0);
        material.metallic = material.metallic.clamp(0.0, 1.0);
        material.metallic_roughness_texture = Some(reference(id, first));
        Ok(())
    }

    /// The texture that `make` makes of the maps' images, once for each combination.
    fn texture(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        maps: &[&Map],
        use_: &'static str,
        color_space: ColorSpace,
        make: impl Fn(&[Option<Arc<Image>>]) -> Option<Arc<Image>>,
    ) -> Result<TextureId, LoadError> {
        let (first, files) = (maps[0], maps.iter().map(|map| map.file.clone()).collect());
        let key = TextureKey { files, use_, clamp: first.clamp, strength: first.bump.to_bits() };
        if let Some(&known) = self.textures.get(&key) {
            return Ok(known);
        }
        let mut images = Vec::new();
        for map in maps {
            images.push(self.files.read(context, &map.place, &map.file)?);
        }
        // What `make` makes, and its copies on the way.
        let bytes: u64 = images.iter().flatten().map(|image| pixels::byte_len(image)).sum();
        if use_ != "colour" && use_ != "normal" {
            context.charge(bytes.saturating_mul(4), &first.place)?;
        }
        let mut texture = Texture::new(first.file.as_str(), or_placeholder(make(&images)), color_space);
        if first.clamp {
            texture.wrap = [Wrap::Clamp; 2];
        }
        context.count_materials(1, &first.place)?;
        let id = builder.texture(texture);
        self.textures.insert(key, id);
        Ok(id)
    }
}

/// MTL maps coordinates as `uv · scale + offset` with v upwards; ours run downwards.
fn reference(texture: TextureId, map: &Map) -> TextureRef {
    let ([su, sv], [ou, ov]) = (map.scale, map.offset);
    let transform = if (map.scale, map.offset) == ([1.0; 2], [0.0; 2]) {
        UvTransform::IDENTITY
    } else {
        UvTransform::new(Vec2::new(ou, 1.0 - sv - ov), 0.0, Vec2::new(su, sv))
    };
    TextureRef { texture, uv_set: 0, transform }
}

fn base_color(context: &mut Context<'_>, mtl: &Mtl) -> Vec3 {
    let textured = mtl.map(MapKind::Diffuse).is_some();
    let color = match mtl.diffuse {
        None if textured => Vec3::ONE,
        // Neither a colour nor what could stand for one.
        None => Vec3::splat(if mtl.emission.is_some() || mtl.specular.is_some() { 0.0 } else { 0.5 }),
        Some(black) if textured && black == Vec3::ZERO => {
            let message = format!("material `{}` has `Kd 0 0 0` with a `map_Kd`", mtl.name);
            context.note(mtl.place.clone(), message, "the map is shown as it is");
            Vec3::ONE
        }
        Some(color) => color,
    };
    if color.max_element() > 1.0 {
        let message = format!("material `{}` has a `Kd` of {color}", mtl.name);
        context.warn(mtl.place.clone(), message, "nothing reflects more than 1, to which it was cut");
    }
    color.min(Vec3::ONE)
}

fn illumination(mtl: &Mtl) -> Option<u32> {
    mtl.illumination.map(|value| value as u32)
}

fn is_glass(mtl: &Mtl) -> bool {
    matches!(illumination(mtl), Some(4 | 6 | 7 | 9))
}

fn reflection(context: &mut Context<'_>, mtl: &Mtl, material: &mut Material) {
    if let Some(ior) = mtl.ior {
        if (1.0..=1e6).contains(&ior) {
            material.ior = if is_glass(mtl) && ior > 1.0 { ior } else { material.ior };
        } else {
            let message = format!("material `{}` has an `Ni` of {ior}", mtl.name);
            context.warn(mtl.place.clone(), message, "1.5 was taken; give an index of at least 1");
        }
    }
    if mtl.roughness.is_some() || mtl.metallic.is_some() {
        let unit = |value: f32| if value.is_nan() { 1.0 } else { value.clamp(0.0, 1.0) };
        material.roughness = unit(mtl.roughness.unwrap_or(0.5));
        material.metallic = unit(mtl.metallic.unwrap_or(0.0));
    } else {
        let specular = mtl.specular.unwrap_or(Vec3::ZERO).min(Vec3::ONE);
        material.specular = (specular.max_element() / F0).min(1.0);
        if material.specular > 0.0 {
            material.specular_color = specular / (F0 * material.specular);
        }
        let mirror = matches!(illumination(mtl), Some(3 | 5 | 8));
        material.roughness = if mirror { 0.0 } else { roughness(mtl.exponent.unwrap_or(10.0)) };
    }
    if let Some(factor) = mtl.clearcoat.filter(|factor| *factor > 0.0) {
        material.clearcoat = Some(Clearcoat {
            factor: factor.min(1.0),
            texture: None,
            roughness: mtl.clearcoat_roughness.unwrap_or(0.0).max(0.0).min(1.0),
            roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
        });
    }
}

/// Perceptual roughness, √α, of a Phong exponent.
fn roughness(exponent: f32) -> f32 {
    let exponent = if exponent.is_nan() { 0.0 } else { exponent.max(0.0) };
    (2.0 / (exponent + 2.0)).sqrt().sqrt()
}

fn transparency(context: &mut Context<'_>, mtl: &Mtl, material: &mut Material) {
    let unit = |value: f32| if value.is_nan() { 1.0 } else { value.clamp(0.0, 1.0) };
    if is_glass(mtl) {
        let filter = mtl.filter.unwrap_or(Vec3::ONE);
        let hue = if filter.max_element() > 0.0 { filter / filter.max_element() } else { Vec3::ONE };
        material.transmission = 1.0;
        material.roughness = mtl.roughness.map_or(0.0, unit);
        material.base_color = hue.extend(1.0);
        material.volume = (mtl.ior.unwrap_or(1.0) > 1.0).then(Volume::default);
        (material.specular, material.specular_color) = (1.0, Vec3::ONE);
        return;
    }
    let stated = mtl.opacity.or(mtl.transparency.map(|t| 1.0 - t)).map(unit);
    let opacity = match (stated, mtl.filter, mtl.illumination) {
        (Some(opacity), _, _) => opacity,
        (None, Some(filter), None) => 1.0 - unit(filter.element_sum() / 3.0),
        _ => 1.0,
    };
    if opacity == 0.0 {
        let message = format!("material `{}` is fully transparent", mtl.name);
        context.note(mtl.place.clone(), message, "`d` is 1 for an opaque surface");
    }
    if opacity < 1.0 {
        material.base_color = Vec4::from((material.base_color.truncate(), opacity));
        material.alpha_mode = AlphaMode::Blend;
    }
}

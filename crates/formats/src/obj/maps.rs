//! MTL's texture maps: one texture from one or two images.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec2;
use heliostat_scene::{
    AlphaMode, ColorSpace, Image, Material, SceneBuilder, Texture, TextureId, TextureRef, UvTransform, Wrap,
};

use super::mtl::{Map, MapKind, Mtl};
use crate::context::Context;
use crate::error::LoadError;
use crate::image::pixels;
use crate::textures::{ImageFiles, or_placeholder};

/// The textures of one file, each made once.
#[derive(Default)]
pub(super) struct Maps {
    files: ImageFiles,
    textures: HashMap<Key, Option<TextureId>>,
}

/// What makes two textures the same.
#[derive(PartialEq, Eq, Hash)]
struct Key {
    files: Vec<String>,
    recipe: Recipe,
    clamp: bool,
    /// Bits of the bump strength.
    bump: u32,
}

/// How the images of a texture's maps become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Recipe {
    /// A colour image as it is.
    Color,
    /// A colour image with the brightness of the second as alpha.
    Masked,
    /// White with the brightness of the image as alpha.
    Mask,
    /// A normal map as it is.
    Normal,
    /// Heights, which become normals; an image with colours is taken to hold normals already.
    Bump,
    /// Brightness as roughness (green).
    Roughness,
    /// Brightness as metallic (blue).
    Metallic,
    /// Brightness of the first as roughness, of the second as metallic.
    RoughnessMetallic,
}

impl Recipe {
    fn is_color(self) -> bool {
        matches!(self, Self::Color | Self::Masked)
    }

    /// `None` when an image is missing without which there is nothing to show.
    fn mix(self, images: &[Option<Arc<Image>>], bump: f32) -> Option<Arc<Image>> {
        let lanes = |lanes: &[(usize, &Option<Arc<Image>>)]| {
            let lanes: Vec<_> = lanes.iter().filter_map(|(lane, i)| Some((*lane, i.as_deref()?))).collect();
            let white = pixels::white_like(lanes.first()?.1);
            Some(Arc::new(pixels::with_lanes(&white, &lanes)))
        };
        match (self, images) {
            (Self::Masked, [Some(color), Some(mask)]) => {
                Some(Arc::new(pixels::with_lanes(color, &[(3, mask)])))
            }
            (Self::Mask, [mask]) => lanes(&[(3, mask)]),
            (Self::Bump, [Some(image)]) if pixels::is_grey(image) => {
                Some(Arc::new(pixels::normals_from_heights(image, bump)))
            }
            (Self::Roughness, [image]) => lanes(&[(1, image)]),
            (Self::Metallic, [image]) => lanes(&[(2, image)]),
            (Self::RoughnessMetallic, [roughness, metallic]) => lanes(&[(1, roughness), (2, metallic)]),
            (_, images) => images.first()?.clone(),
        }
    }
}

impl Maps {
    /// Sets the material's textures.
    pub(super) fn apply(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        mtl: &Mtl,
        material: &mut Material,
    ) -> Result<(), LoadError> {
        let map = |kind| mtl.map(kind);
        let mut make = |recipe, maps: &[&Map]| self.texture(context, builder, recipe, maps);
        material.base_color_texture = match (map(MapKind::Diffuse), map(MapKind::Opacity)) {
            (Some(color), Some(mask)) => make(Recipe::Masked, &[color, mask])?,
            (Some(color), None) => make(Recipe::Color, &[color])?,
            (None, Some(mask)) => make(Recipe::Mask, &[mask])?,
            (None, None) => None,
        };
        if map(MapKind::Opacity).is_some() {
            material.alpha_mode = AlphaMode::Blend;
        }
        if let Some(specular) = map(MapKind::Specular) {
            material.specular_color_texture = make(Recipe::Color, &[specular])?;
        }
        if let Some(emission) = map(MapKind::Emission) {
            material.emissive_texture = make(Recipe::Color, &[emission])?;
        }
        material.normal_texture = match (map(MapKind::Normal), map(MapKind::Bump)) {
            (Some(normal), _) => make(Recipe::Normal, &[normal])?,
            (None, Some(bump)) => make(Recipe::Bump, &[bump])?,
            (None, None) => None,
        };
        material.metallic_roughness_texture = match (map(MapKind::Roughness), map(MapKind::Metallic)) {
            (Some(roughness), Some(metallic)) => make(Recipe::RoughnessMetallic, &[roughness, metallic])?,
            (Some(roughness), None) => make(Recipe::Roughness, &[roughness])?,
            (None, Some(metallic)) => make(Recipe::Metallic, &[metallic])?,
            (None, None) => None,
        };
        Ok(())
    }

    /// A use of the texture that `recipe` makes of the maps' images. The first map's options count.
    fn texture(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        recipe: Recipe,
        maps: &[&Map],
    ) -> Result<Option<TextureRef>, LoadError> {
        let (first, files) = (maps[0], maps.iter().map(|map| map.file.clone()).collect());
        let key = Key { files, recipe, clamp: first.clamp, bump: first.bump.to_bits() };
        if let Some(known) = self.textures.get(&key) {
            return Ok(known.map(|id| reference(id, first)));
        }
        let mut images = Vec::new();
        for map in maps {
            images.push(self.files.read(context, &map.place, &map.file)?);
        }
        if !matches!(recipe, Recipe::Color | Recipe::Normal) {
            // The result, and 8-bit copies on the way.
            let bytes: u64 = images.iter().flatten().map(|image| pixels::byte_len(image)).sum();
            context.charge(bytes.saturating_mul(4), &first.place)?;
        }
        context.count_materials(1, &first.place)?;
        let image = recipe.mix(&images, first.bump);
        let id = (image.is_some() || recipe.is_color()).then(|| {
            let space = if recipe.is_color() { ColorSpace::Srgb } else { ColorSpace::Linear };
            let mut texture = Texture::new(first.file.as_str(), or_placeholder(image), space);
            if first.clamp {
                texture.wrap = [Wrap::Clamp; 2];
            }
            builder.texture(texture)
        });
        self.textures.insert(key, id);
        Ok(id.map(|id| reference(id, first)))
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

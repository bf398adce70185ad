//! From a formula to an image: sRGB-encoded textures.

use std::sync::{Arc, OnceLock};

use glam::{Affine2, Vec2, Vec3, Vec4};
use heliostat_scene::{
    ColorSpace, Image, Material, MaterialId, SceneBuilder, Texture, TextureId, TextureRef, UvTransform, Wrap,
};

/// An 8-bit sRGB image of a function from (u, v), both in [0, 1) from the top left, to linear RGB and alpha.
pub(crate) fn image(width: u32, height: u32, color: impl Fn(Vec2) -> Vec4) -> Arc<Image> {
    let mut pixels = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        for x in 0..width {
            let uv = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let c = color(uv).clamp(Vec4::ZERO, Vec4::ONE);
            pixels.extend([encode(c.x), encode(c.y), encode(c.z), (c.w * 255.0 + 0.5) as u8]);
        }
    }
    Arc::new(Image::rgba8(width, height, pixels))
}

/// The IEC 61966-2-1 curve by table: 4096 steps are finer than 8 bits wherever the curve is steepest.
fn encode(linear: f32) -> u8 {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let curve = |l: f32| if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
        (0..=4095).map(|i| (curve(i as f32 / 4095.0) * 255.0 + 0.5) as u8).collect()
    });
    table[(linear * 4095.0 + 0.5) as usize]
}

/// A repeating opaque texture of a function from (u, v) to linear RGB.
pub(crate) fn texture(
    builder: &mut SceneBuilder,
    name: &str,
    size: u32,
    color: impl Fn(Vec2) -> Vec3,
) -> TextureId {
    builder.texture(Texture::new(name, image(size, size, |uv| color(uv).extend(1.0)), ColorSpace::Srgb))
}

/// A texture shown once, with alpha.
pub(crate) fn decal(
    builder: &mut SceneBuilder,
    name: &str,
    [width, height]: [u32; 2],
    color: impl Fn(Vec2) -> Vec4,
) -> TextureId {
    let image = image(width, height, color);
    builder.texture(Texture { wrap: [Wrap::Clamp; 2], ..Texture::new(name, image, ColorSpace::Srgb) })
}

/// A dielectric of the texture's colour; the texture covers `tile` metres.
pub(crate) fn textured(
    builder: &mut SceneBuilder,
    name: &str,
    texture: TextureId,
    tile: Vec2,
    roughness: f32,
) -> MaterialId {
    let transform = UvTransform(Affine2::from_scale(tile.recip()));
    let reference = TextureRef { transform, ..TextureRef::new(texture) };
    builder.material(Material {
        name: name.into(),
        base_color_texture: Some(reference),
        roughness,
        ..Material::default()
    })
}

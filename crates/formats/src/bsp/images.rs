//! The files of a game: images and scripts by the names that maps and scripts give them, below one folder.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;
use heliostat_scene::{
    ColorSpace, Image, Pixels, SceneBuilder, Texture, TextureId, TextureRef, UvTransform, Wrap,
};

use crate::context::Context;
use crate::error::LoadError;
use crate::image::pixels;
use crate::place::Place;
use crate::source::SourceError;
use crate::textures::{decode_or_warn, or_placeholder};

/// What an image may end in, in the order of the search: the game's own first.
const EXTENSIONS: [&str; 4] = ["tga", "jpg", "jpeg", "png"];

/// How the folder with `textures` and `scripts` is reached from the map's own: the one above, if that is called `maps`
/// or nothing is known of it but that no scripts lie in it.
pub(super) fn root(context: &Context<'_>, file: &str) -> &'static str {
    let mut parts = file.rsplit(['/', '\\']).skip(1);
    match parts.next() {
        Some(folder) if folder.eq_ignore_ascii_case("maps") => "../",
        None if context.list("scripts").is_empty() => "../",
        _ => "",
    }
}

/// Whether a name stays below the folder it is looked up in.
fn stays_inside(name: &str) -> bool {
    !name.is_empty()
        && !name.contains([':', '\0'])
        && name.split('/').all(|part| part != ".." && !part.is_empty())
}

/// The images of one load, each read once.
pub(super) struct Images {
    root: &'static str,
    images: HashMap<String, Option<Arc<Image>>>,
    textures: HashMap<(String, bool), TextureId>,
    /// Names that lead out of the folder.
    pub(super) refused: usize,
    missing: Vec<String>,
}

impl Images {
    pub(super) fn new(root: &'static str) -> Self {
        Self { root, images: HashMap::new(), textures: HashMap::new(), refused: 0, missing: Vec::new() }
    }

    /// The image of this name, whatever it ends in; `None` if it cannot be read.
    ///
    /// # Errors
    /// When the images exceed the memory limit.
    pub(super) fn read(
        &mut self,
        context: &mut Context<'_>,
        place: &Place,
        name: &str,
    ) -> Result<Option<Arc<Image>>, LoadError> {
        if let Some(known) = self.images.get(name) {
            return Ok(known.clone());
        }
        context.charge(2 * name.len() as u64 + 64, place)?;
        let image = if stays_inside(name) { self.search(context, place, name)? } else { None };
        if !stays_inside(name) {
            self.refused += 1;
        }
        if image.is_none() {
            self.missing.push(name.to_owned());
        }
        self.images.insert(name.to_owned(), image.clone());
        Ok(image)
    }

    fn search(
        &self,
        context: &mut Context<'_>,
        place: &Place,
        name: &str,
    ) -> Result<Option<Arc<Image>>, LoadError> {
        for extension in EXTENSIONS {
            let path = format!("{}{name}.{extension}", self.root);
            match context.read(&path) {
                Ok(bytes) => return decode_or_warn(context, place, &path.as_str().into(), &bytes),
                Err(SourceError::NotFound | SourceError::NoFiles) => {}
                Err(error) => {
                    let hint = "a checkerboard takes its place, or it is left out where it glows";
                    context.warn(place.clone(), format!("image `{path}`: {error}"), hint);
                    return Ok(None);
                }
            }
        }
        Ok(None)
    }

    /// A texture of an image; the checkerboard, if that could not be read.
    ///
    /// # Errors
    /// When the images exceed the memory limit.
    pub(super) fn texture(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        place: &Place,
        (name, clamp): (&str, bool),
    ) -> Result<TextureRef, LoadError> {
        let key = (name.to_owned(), clamp);
        if let Some(&known) = self.textures.get(&key) {
            return Ok(TextureRef::new(known));
        }
        context.count_materials(1, place)?;
        let image = or_placeholder(self.read(context, place, name)?);
        let wrap = [if clamp { Wrap::Clamp } else { Wrap::Repeat }; 2];
        let texture = Texture { wrap, ..Texture::new(name, image, ColorSpace::Srgb) };
        let id = builder.texture(texture);
        self.textures.insert(key, id);
        Ok(TextureRef::new(id))
    }

    /// How many images were found, and the names of those that were not.
    pub(super) fn found_and_missing(&self) -> (usize, &[String]) {
        (self.images.len() - self.missing.len(), &self.missing)
    }
}

/// A texture with the coordinates of a stage.
pub(super) fn transformed(texture: TextureRef, transform: glam::Affine2) -> TextureRef {
    TextureRef { transform: UvTransform(transform), ..texture }
}

/// Mean linear colour of an image as it is shown.
pub(super) fn mean(image: &Image) -> Vec3 {
    let count = (image.width as f32 * image.height as f32).max(1.0);
    let sum = match &image.pixels {
        Pixels::Rgba8(values) => {
            let mut histogram = [[0u32; 256]; 3];
            for pixel in values.as_chunks::<4>().0 {
                for (lane, &value) in histogram.iter_mut().zip(pixel) {
                    lane[usize::from(value)] += 1;
                }
            }
            let lane = |lane: &[u32; 256]| {
                (0..256).map(|v| lane[v] as f32 * pixels::srgb_to_linear(v as f32 / 255.0)).sum::<f32>()
            };
            Vec3::new(lane(&histogram[0]), lane(&histogram[1]), lane(&histogram[2]))
        }
        Pixels::RgbaF32(values) => {
            values.as_chunks::<4>().0.iter().map(|p| Vec3::new(p[0], p[1], p[2])).sum()
        }
    };
    let mean = sum / count;
    if mean.is_finite() { mean.max(Vec3::ZERO) } else { Vec3::ZERO }
}

/// A colour as scripts state it, on the screen, as linear light.
pub(super) fn linear(color: Vec3) -> Vec3 {
    color.map(pixels::srgb_to_linear)
}

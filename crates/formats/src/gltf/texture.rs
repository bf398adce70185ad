//! Images, samplers and texture references.

use std::sync::Arc;

use glam::Vec2;
use heliostat_scene::{ColorSpace, Image, Texture, TextureId, TextureRef, UvTransform, Wrap};

use super::json::{Sampler, TextureInfo};
use super::{Loader, container};
use crate::error::LoadError;
use crate::textures::{decode_or_warn, or_placeholder};

impl Loader<'_, '_> {
    /// A use of a texture. Colours that cannot be read become a checkerboard; other data is left out.
    pub(super) fn texture(
        &mut self,
        info: Option<&TextureInfo>,
        color_space: ColorSpace,
        path: &str,
    ) -> Result<Option<TextureRef>, LoadError> {
        let Some(info) = info else { return Ok(None) };
        let id = match self.textures.get(&(info.index, color_space)) {
            Some(&known) => known,
            None => {
                let made = self.make_texture(info.index, color_space, path)?;
                self.textures.insert((info.index, color_space), made);
                made
            }
        };
        let Some(texture) = id else { return Ok(None) };
        let (mut uv_set, mut transform) = (info.tex_coord, UvTransform::IDENTITY);
        if let Some(extension) = &info.extensions.transform {
            uv_set = extension.tex_coord.unwrap_or(uv_set);
            let (offset, scale) = (Vec2::from_array(extension.offset), Vec2::from_array(extension.scale));
            if offset.is_finite() && scale.is_finite() && extension.rotation.is_finite() {
                transform = UvTransform::new(offset, extension.rotation, scale);
            }
        }
        if uv_set > 1 {
            let message = format!("the texture uses coordinate set {uv_set}; sets 0 and 1 are supported");
            self.context.warn(self.place(path), message, "set 0 takes its place");
            uv_set = 0;
        }
        Ok(Some(TextureRef { texture, uv_set: uv_set as u8, transform }))
    }

    fn make_texture(
        &mut self,
        index: usize,
        color_space: ColorSpace,
        path: &str,
    ) -> Result<Option<TextureId>, LoadError> {
        let definition = self.item(&self.root.textures, "textures", index, path)?;
        let texture_path = format!("textures[{index}]");
        self.context.count_materials(1, &self.place(&texture_path))?;
        let sampler = match definition.sampler {
            Some(sampler) => Some(self.item(&self.root.samplers, "samplers", sampler, &texture_path)?),
            None => None,
        };
        let image = match definition.source {
            Some(source) => self.image(source, &texture_path)?,
            None => {
                let message = "the texture has no image in a supported format";
                self.context.warn(self.place(&texture_path), message, "export it as PNG or JPEG");
                None
            }
        };
        if image.is_none() && color_space == ColorSpace::Linear {
            return Ok(None);
        }
        let source = definition.source.and_then(|source| self.root.images.get(source));
        let name = definition.name.as_deref().or(source.and_then(|i| i.name.as_deref().or(i.uri.as_deref())));
        let name = name.filter(|n| !n.starts_with("data:")).unwrap_or(&texture_path);
        let mut texture = Texture::new(name, or_placeholder(image), color_space);
        if let Some(sampler) = sampler {
            texture.wrap = [sampler.wrap_s, sampler.wrap_t].map(wrap);
            texture.nearest = is_nearest(sampler);
        }
        Ok(Some(self.builder.texture(texture)))
    }

    /// The image of that number; `None` after a warning, once per image, when it cannot be read.
    pub(super) fn image(&mut self, index: usize, user: &str) -> Result<Option<Arc<Image>>, LoadError> {
        if let Some(known) = self.images.get(&index) {
            return Ok(known.clone());
        }
        let definition = self.item(&self.root.images, "images", index, user)?;
        let place = self.place(&format!("images[{index}]"));
        let name: Arc<str> = match (&definition.uri, &definition.name) {
            (Some(uri), _) if !uri.starts_with("data:") => container::file_name(uri).as_str().into(),
            (_, Some(name)) => name.as_str().into(),
            _ => format!("images[{index}]").as_str().into(),
        };
        let image = match (&definition.uri, definition.buffer_view) {
            (Some(uri), _) => match container::read_uri(self.context, &place, uri) {
                Ok(bytes) => decode_or_warn(self.context, &place, &name, &bytes)?,
                Err(problem) => {
                    let hint = "colours show a checkerboard, other data is left out; put the file there";
                    self.context.warn(place, format!("image {problem}"), hint);
                    None
                }
            },
            (None, Some(view)) => {
                let (bytes, _) = self.view(view, &format!("images[{index}].bufferView"))?;
                decode_or_warn(self.context, &place, &name, bytes)?
            }
            (None, None) => {
                self.context.warn(place, "the image has neither `uri` nor `bufferView`", "");
                None
            }
        };
        self.images.insert(index, image.clone());
        Ok(image)
    }
}

fn wrap(mode: Option<u32>) -> Wrap {
    match mode {
        Some(33071) => Wrap::Clamp,
        Some(33648) => Wrap::Mirror,
        _ => Wrap::Repeat,
    }
}

fn is_nearest(sampler: &Sampler) -> bool {
    sampler.mag_filter == Some(9728)
}

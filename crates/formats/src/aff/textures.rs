//! Textures by the names that AFF files use.

use std::collections::HashMap;

use heliostat_scene::{ColorSpace, SceneBuilder, Texture, TextureId};

use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;
use crate::source::SourceError;
use crate::textures::{decode_or_warn, or_placeholder};

/// Where textures lie, from the file's folder.
const FOLDERS: [&str; 3] = ["", "TextureFiles/", "../TextureFiles/"];

/// The textures of one load, each made once.
#[derive(Default)]
pub(super) struct Textures(HashMap<String, TextureId>);

impl Textures {
    /// The texture called `name`; a checkerboard after a warning where it cannot be read.
    pub(super) fn get(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        place: &Place,
        name: &str,
    ) -> Result<TextureId, LoadError> {
        if let Some(&known) = self.0.get(name) {
            return Ok(known);
        }
        context.count_materials(1, place)?;
        let file = name.replace('\\', "/");
        let mut found = Err(SourceError::NotFound);
        for folder in FOLDERS {
            found = context.read(&format!("{folder}{file}"));
            if !matches!(found, Err(SourceError::NotFound)) {
                break;
            }
        }
        let image = match found {
            Ok(bytes) => decode_or_warn(context, place, &file.as_str().into(), &bytes)?,
            Err(error) => {
                let hint =
                    "a checkerboard stands for it; it is looked for beside the file and in `TextureFiles`";
                context.warn(place.clone(), format!("texture `{file}`: {error}"), hint);
                None
            }
        };
        let id = builder.texture(Texture::new(file, or_placeholder(image), ColorSpace::Srgb));
        self.0.insert(name.to_owned(), id);
        Ok(id)
    }
}

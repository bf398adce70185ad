//! Images that scene files refer to: read once, shared, and replaced by a placeholder when they cannot be read.

use std::collections::HashMap;
use std::sync::Arc;

use heliostat_scene::Image;

use crate::context::Context;
use crate::error::LoadError;
use crate::image::{decode_within, pixels};
use crate::place::Place;

/// The images of one load by name.
#[derive(Default)]
pub(crate) struct ImageFiles {
    images: HashMap<String, Option<Arc<Image>>>,
}

impl ImageFiles {
    /// The image in the file called `name`, which `place` refers to; `None` after a warning, once per file, when
    /// it cannot be read.
    ///
    /// # Errors
    /// When the images exceed the memory limit.
    pub(crate) fn read(
        &mut self,
        context: &mut Context<'_>,
        place: &Place,
        name: &str,
    ) -> Result<Option<Arc<Image>>, LoadError> {
        if let Some(known) = self.images.get(name) {
            return Ok(known.clone());
        }
        let image = match context.read(name) {
            Ok(bytes) => decode_or_warn(context, place, &name.into(), &bytes)?,
            Err(error) => {
                let hint = "colours show a checkerboard, other data is left out; put the file there or correct the name";
                context.warn(place.clone(), format!("image `{name}`: {error}"), hint);
                None
            }
        };
        self.images.insert(name.to_owned(), image.clone());
        Ok(image)
    }
}

/// The image in `bytes`; `None` after a warning when it is broken.
///
/// # Errors
/// When the image exceeds the memory limit.
pub(crate) fn decode_or_warn(
    context: &mut Context<'_>,
    place: &Place,
    name: &Arc<str>,
    bytes: &[u8],
) -> Result<Option<Arc<Image>>, LoadError> {
    match decode_within(name, bytes, context.limits, context.memory_left()) {
        Ok(image) => {
            context.charge(pixels::byte_len(&image), place)?;
            Ok(Some(Arc::new(image)))
        }
        Err(error) => {
            let message = format!("image `{name}`: {}", error.problem());
            let hint = error.hint().unwrap_or("convert the image");
            context.warn(
                place.clone(),
                message,
                format!("colours show a checkerboard, other data is left out; {hint}"),
            );
            Ok(None)
        }
    }
}

/// The image, or the picture shown in the place of one that could not be read.
pub(crate) fn or_placeholder(image: Option<Arc<Image>>) -> Arc<Image> {
    image.unwrap_or_else(|| Arc::new(Image::placeholder()))
}

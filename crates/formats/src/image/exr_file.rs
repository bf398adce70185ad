//! OpenEXR reading: headers first, so that nothing is allocated that the limits forbid.

use std::io::Cursor;
use std::sync::Arc;

use exr::meta::MetaData;
use exr::prelude::{AnyChannels, FlatSamples, Layer, ReadChannels, ReadLayers, read};
use heliostat_scene::Image;

use super::{check_size, guarded, too_large};
use crate::error::LoadError;
use crate::limits::Limits;
use crate::place::Place;

pub(super) fn decode(
    file: &Arc<str>,
    bytes: &[u8],
    limits: &Limits,
    memory: u64,
) -> Result<Image, LoadError> {
    let meta = guarded(file, || MetaData::read_from_buffered(Cursor::new(bytes), false))?
        .map_err(|error| failed(file, &error))?;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.width() as u64, header.layer_size.height() as u64);
        check_size(file, width, height, limits)?;
        // All channels as f32, and four more for the result; and a tile, which may be larger than the image.
        let per_pixel = (header.channels.list.len() as u64).saturating_add(4).saturating_mul(4);
        let tile = guarded(file, || header.max_block_byte_size())? as u64;
        if (width * height).saturating_mul(per_pixel).saturating_add(tile.saturating_mul(2)) > memory {
            return Err(too_large(file, limits));
        }
    }
    let image = guarded(file, || {
        read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
    })?
    .map_err(|error| failed(file, &error))?;
    rgba(file, &image.layer_data)
}

/// The channels that make a colour, by the last part of their names; a single channel is grey.
fn rgba(file: &Arc<str>, layer: &Layer<AnyChannels<FlatSamples>>) -> Result<Image, LoadError> {
    let (width, height) = (layer.size.width(), layer.size.height());
    let list = &layer.channel_data.list;
    let named = |wanted: &str| {
        let exact = list.iter().position(|c| c.name.to_string() == wanted);
        exact.or_else(|| list.iter().position(|c| c.name.to_string().rsplit('.').next() == Some(wanted)))
    };
    let colour = match [named("R"), named("G"), named("B")] {
        [Some(r), Some(g), Some(b)] => [r, g, b],
        _ => match named("Y").or((list.len() == 1).then_some(0)) {
            Some(grey) => [grey; 3],
            None => {
                let names: Vec<_> = list.iter().map(|c| c.name.to_string()).collect();
                let problem = format!("no R, G, B channels among {}", names.join(", "));
                return Err(LoadError::unsupported(Place::whole(file), problem, "export an RGB image"));
            }
        },
    };
    let mut pixels = vec![1.0f32; width * height * 4];
    let sources = [Some(colour[0]), Some(colour[1]), Some(colour[2]), named("A")];
    for (lane, source) in sources.into_iter().enumerate() {
        let Some(channel) = source.map(|index| &list[index]) else { continue };
        if channel.sample_data.len() != width * height {
            let problem = format!("channel {} is subsampled", channel.name);
            return Err(LoadError::unsupported(
                Place::whole(file),
                problem,
                "export full-resolution channels",
            ));
        }
        for (pixel, value) in
            pixels.as_chunks_mut::<4>().0.iter_mut().zip(channel.sample_data.values_as_f32())
        {
            pixel[lane] = value;
        }
    }
    Ok(Image::rgba_f32(width as u32, height as u32, pixels))
}

fn failed(file: &Arc<str>, error: &exr::error::Error) -> LoadError {
    let place = Place::whole(file);
    match error {
        exr::error::Error::NotSupported(what) => {
            let hint = "convert the image to ZIP compression with full-resolution channels and no deep data";
            LoadError::unsupported(place, format!("EXR feature: {what}"), hint)
        }
        other => {
            LoadError::input(place, format!("the EXR data is broken: {other}"), "the file may be truncated")
        }
    }
}

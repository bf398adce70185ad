//! Small pictures: 256 colours by median cut, in an indexed PNG.

/// Pixels with the same colours that a box of colour space holds.
type Pixel = [u8; 3];

/// An indexed PNG of RGB bytes, rows from the top.
///
/// # References
/// Heckbert, "Color Image Quantization for Frame Buffer Display", 1982.
pub(super) fn encode(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>, String> {
    let pixels: Vec<Pixel> = rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    let palette = median_cut(pixels.clone(), 256);
    let indices: Vec<u8> = pixels.iter().map(|&pixel| nearest(&palette, pixel)).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette.concat());
    encoder.set_compression(png::Compression::High);
    // Neighbouring indices say nothing about each other.
    encoder.set_filter(png::Filter::NoFilter);
    let mut writer = encoder.write_header().map_err(|error| error.to_string())?;
    writer.write_image_data(&indices).map_err(|error| error.to_string())?;
    writer.finish().map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// At most `count` colours that stand for the pixels: the box of the largest extent is cut at its median until there are
/// enough.
fn median_cut(pixels: Vec<Pixel>, count: usize) -> Vec<Pixel> {
    let mut boxes = vec![pixels];
    while boxes.len() < count {
        let widest =
            (0..boxes.len()).max_by_key(|&i| widest_channel(&boxes[i]).1 as usize * weight(&boxes[i]));
        let Some(widest) = widest.filter(|&i| widest_channel(&boxes[i]).1 > 0) else { break };
        let mut pixels = boxes.swap_remove(widest);
        let channel = widest_channel(&pixels).0;
        pixels.sort_unstable_by_key(|pixel| pixel[channel]);
        // At the median or, where that is the lowest value, above it: no half is empty.
        let median = pixels[pixels.len() / 2][channel].max(pixels[0][channel] + 1);
        let at = pixels.partition_point(|pixel| pixel[channel] < median);
        let upper = pixels.split_off(at);
        boxes.extend([pixels, upper]);
    }
    boxes.iter().filter(|pixels| !pixels.is_empty()).map(|pixels| mean(pixels)).collect()
}

/// Many pixels count more than few, but not in proportion: highlights are small.
fn weight(pixels: &[Pixel]) -> usize {
    (pixels.len() as f64).powf(0.3) as usize
}

/// The channel of the largest extent, and its extent.
fn widest_channel(pixels: &[Pixel]) -> (usize, u8) {
    let extent = |channel: usize| {
        let values = pixels.iter().map(|pixel| pixel[channel]);
        values.clone().max().unwrap_or(0) - values.min().unwrap_or(0)
    };
    (0..3).map(|channel| (channel, extent(channel))).max_by_key(|&(_, extent)| extent).unwrap_or((0, 0))
}

fn mean(pixels: &[Pixel]) -> Pixel {
    [0, 1, 2].map(|channel| {
        let sum: usize = pixels.iter().map(|pixel| usize::from(pixel[channel])).sum();
        ((sum + pixels.len() / 2) / pixels.len()) as u8
    })
}

fn nearest(palette: &[Pixel], pixel: Pixel) -> u8 {
    let distance = |color: &Pixel| -> u32 {
        color.iter().zip(pixel).map(|(&a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
    };
    (0..palette.len()).min_by_key(|&i| distance(&palette[i])).unwrap_or(0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colours_stay_as_they_are_and_many_come_close() {
        let few: Vec<u8> = (0..64).flat_map(|i| [[0, 0, 0], [255, 255, 255], [200, 10, 30]][i % 3]).collect();
        let bytes = encode(8, 8, &few).expect("a picture");
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().expect("a header");
        let palette = reader.info().palette.as_ref().expect("a palette").to_vec();
        let mut indices = vec![0; 64];
        reader.next_frame(&mut indices).expect("pixels");
        let shown: Vec<u8> =
            indices.iter().flat_map(|&i| palette[3 * usize::from(i)..][..3].to_vec()).collect();
        assert_eq!(shown, few);

        let many: Vec<Pixel> =
            (0..4096_u32).map(|i| [(i % 16 * 16) as u8, (i / 16 % 16 * 16) as u8, 90]).collect();
        let palette = median_cut(many.clone(), 64);
        assert!(palette.len() == 64);
        for pixel in many {
            let near = palette[usize::from(nearest(&palette, pixel))];
            assert!(near.iter().zip(pixel).all(|(a, b)| a.abs_diff(b) <= 24), "{pixel:?} became {near:?}");
        }
    }
}

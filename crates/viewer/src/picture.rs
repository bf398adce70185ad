//! Finished pictures: from radiance to 8 bits, quickly, and to JPEG or PNG for the way to a browser.

use std::sync::Arc;

use glam::Vec3;
use heliostat_scene::{Frame, Plane, PlaneData};
use heliostat_shading::heat_color;

use crate::gizmo::Line;
use crate::stats::Stats;

/// A picture to be shown.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Grows by one with every picture of a session.
    pub number: u64,
    /// The frame with linear radiance.
    pub frame: Arc<Frame>,
    /// Rows of RGB bytes, tone mapped.
    pub rgb: Arc<Vec<u8>>,
    /// Stops by which it was brightened.
    pub exposure: f32,
    /// Frames of which it is the mean; more than one only when nothing moves.
    pub frames: u32,
    /// Number of the picture of the first of these frames.
    pub first: u64,
    /// Whether it stands still: the next one shows the same, with less noise.
    pub still: bool,
    /// Whether no better one will come until something changes.
    pub done: bool,
    /// The view it shows, as eight numbers that `Input::View` takes.
    pub view: String,
    /// Seconds from the start of the clip.
    pub time: f64,
    /// Lines to draw over it.
    pub lines: Vec<Line>,
    /// What it took.
    pub stats: Stats,
    /// The latest input that it shows, for each viewer's numbers.
    pub input: u64,
}

/// Share of the pixels of a heat map that may count more than what is white, and of how many it is found.
const BRIGHTEST: f32 = 0.01;
const ASKED: usize = 4096;

/// Mean of a plane of counts, and the count that its heat map shows white: one that few pixels exceed. `None` for other
/// planes.
pub(crate) fn count_range(plane: &PlaneData) -> Option<[f32; 2]> {
    let finite = |v: &f32| v.is_finite();
    let some = plane.values.iter().step_by(plane.values.len() / ASKED + 1);
    let mut values: Vec<f32> = some.copied().filter(finite).collect();
    if !plane.plane.is_count() || values.is_empty() {
        return None;
    }
    let all = || plane.values.iter().copied().filter(finite);
    let mean = all().map(f64::from).sum::<f64>() / all().count() as f64;
    let place = ((values.len() - 1) as f32 * (1.0 - BRIGHTEST)) as usize;
    let (_, white, _) = values.select_nth_unstable_by(place, f32::total_cmp);
    Some([mean as f32, white.max(1.0)])
}

/// A plane as colours from 0 to 1: depth and position over their range, normals as 0.5 + 0.5 n, identifiers as distinct
/// colours, counts in false colours up to one that few pixels exceed, the rest as it is.
pub fn plane_colors(plane: &PlaneData) -> Vec<Vec3> {
    let color = color_of(plane);
    (0..pixels_of(plane)).map(color).collect()
}

fn pixels_of(plane: &PlaneData) -> usize {
    plane.values.len() / plane.plane.channels()
}

/// The colour of each pixel.
fn color_of(plane: &PlaneData) -> impl Fn(usize) -> Vec3 {
    let finite = || plane.values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max));
    let white = count_range(plane).map_or(1.0, |[_, white]| white);
    move |pixel| {
        let triple = || Vec3::from_slice(&plane.values[3 * pixel..]);
        let value = plane.values[pixel];
        match plane.plane {
            // Near is bright; what is hit nowhere stays black.
            Plane::Depth => Vec3::splat(if value > 0.0 { 1.0 - 0.9 * value / high } else { 0.0 }),
            Plane::Normal => 0.5 + 0.5 * triple(),
            Plane::Position if high > low => (triple() - low) / (high - low),
            Plane::Position => Vec3::ZERO,
            Plane::Albedo => triple(),
            Plane::Alpha => Vec3::splat(value),
            Plane::ObjectId | Plane::InstanceId | Plane::MaterialId => identity_color(value as u32),
            Plane::Nodes | Plane::Triangles | Plane::Cost => heat_color(value / white),
        }
    }
}

/// Hues a golden angle apart; 0 is black.
fn identity_color(id: u32) -> Vec3 {
    if id == 0 {
        return Vec3::ZERO;
    }
    let hue = (id as f32 * 0.618_034).fract() * 6.0;
    let channel = |offset: f32| (((hue + offset).rem_euclid(6.0) - 3.0).abs() - 1.0).clamp(0.0, 1.0);
    let value = 0.55 + 0.45 * (id as f32 * 0.754_877).fract();
    value * (Vec3::splat(0.25) + 0.75 * Vec3::new(channel(0.0), channel(4.0), channel(2.0)))
}

/// Makes `bytes` the rows of RGB of a shown plane. Albedo and the false colours of counts get the sRGB curve; everything
/// else is data and stays as it is.
pub fn plane_bytes(plane: &PlaneData, bytes: &mut Vec<u8>) {
    let curve = |l: f32| if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
    let curved = plane.plane == Plane::Albedo || plane.plane.is_count();
    let encode = |v: f32| if curved { curve(v.clamp(0.0, 1.0)) } else { v.clamp(0.0, 1.0) };
    let color = color_of(plane);
    bytes.clear();
    bytes.reserve_exact(3 * pixels_of(plane));
    for pixel in 0..pixels_of(plane) {
        bytes.extend(color(pixel).to_array().map(|v| (encode(v) * 255.0 + 0.5) as u8));
    }
}

/// Why a picture could not be packed.
#[derive(Debug, thiserror::Error)]
#[error("a picture of {width}×{height} cannot be packed: {problem}")]
pub struct PackError {
    width: u32,
    height: u32,
    problem: String,
}

impl Picture {
    fn error(&self, problem: impl ToString) -> PackError {
        PackError { width: self.frame.width, height: self.frame.height, problem: problem.to_string() }
    }

    /// Makes `bytes` a JPEG of it, of a quality from 1 to 100: small, with losses.
    ///
    /// # Errors
    /// When it has more than 65535 columns or rows.
    pub fn to_jpeg(&self, quality: u8, bytes: &mut Vec<u8>) -> Result<(), PackError> {
        let (width, height) = (u16::try_from(self.frame.width), u16::try_from(self.frame.height));
        let (Ok(width), Ok(height)) = (width, height) else { return Err(self.error("too large")) };
        bytes.clear();
        let mut encoder = jpeg_encoder::Encoder::new(bytes, quality.clamp(1, 100));
        if quality < 90 {
            encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::R_4_2_0);
        }
        let packed = encoder.encode(&self.rgb, width, height, jpeg_encoder::ColorType::Rgb);
        packed.map_err(|error| self.error(error))
    }

    /// Makes `bytes` a PNG of it, without losses, packed quickly rather than tightly.
    ///
    /// # Errors
    /// When the encoder refuses.
    pub fn to_png(&self, bytes: &mut Vec<u8>) -> Result<(), PackError> {
        bytes.clear();
        let mut encoder = png::Encoder::new(bytes, self.frame.width, self.frame.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&self.rgb));
        written.map_err(|error| self.error(error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_and_depth_become_colors() {
        let normal = PlaneData { plane: Plane::Normal, values: vec![0.0, 1.0, -1.0] };
        assert_eq!(plane_colors(&normal), [Vec3::new(0.5, 1.0, 0.0)]);
        let depth = PlaneData { plane: Plane::Depth, values: vec![0.0, 1.0, 2.0] };
        assert_eq!(plane_colors(&depth)[0], Vec3::ZERO);
        let counts: Vec<f32> = (0..=200).map(|i| i as f32).chain([1e6]).collect();
        let counts = PlaneData { plane: Plane::Nodes, values: counts };
        let [mean, white] = count_range(&counts).expect("counts");
        assert!((198.0..=200.0).contains(&white) && mean > 100.0, "{mean} {white}");
        let colors = plane_colors(&counts);
        let light: Vec<f32> = colors.iter().map(|c| c.dot(Vec3::new(0.2126, 0.7152, 0.0722))).collect();
        assert!(light[0] < 1e-3 && light[201] > 0.99 && light[50] < light[100] && light[100] < light[150]);
        assert_eq!(count_range(&depth), None);
        let ids = PlaneData { plane: Plane::InstanceId, values: vec![0.0, 1.0, 2.0] };
        let colors = plane_colors(&ids);
        assert!(colors[0] == Vec3::ZERO && colors[1] != colors[2]);
    }
}

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

/// Share of the pixels of a heat map that may count more than what is white.
const BRIGHTEST: f32 = 0.01;

/// Mean of a plane of counts, and the count that its heat map shows white: one that few pixels exceed. `None` for other
/// planes.
pub(crate) fn count_range(plane: &PlaneData) -> Option<[f32; 2]> {
    let mut values: Vec<f32> = plane.values.iter().copied().filter(|v| v.is_finite()).collect();
    if !plane.plane.is_count() || values.is_empty() {
        return None;
    }
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
    let place = ((values.len() - 1) as f32 * (1.0 - BRIGHTEST)) as usize;
    let (_, white, _) = values.select_nth_unstable_by(place, f32::total_cmp);
    Some([mean as f32, white.max(1.0)])
}

/// A plane as colours from 0 to 1: depth and position over their range, normals as 0.5 + 0.5 n, identifiers as distinct
/// colours, counts in false colours up to one that few pixels exceed, the rest as it is.
pub fn plane_colors(plane: &PlaneData) -> Vec<Vec3> {
    let finite = || plane.values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max));
    let over_range = |v: f32| if high > low { (v - low) / (high - low) } else { 0.0 };
    let grey = |map: &dyn Fn(f32) -> f32| plane.values.iter().map(|&v| Vec3::splat(map(v))).collect();
    let triples = |map: &dyn Fn(f32) -> f32| {
        plane.values.chunks_exact(3).map(|v| Vec3::new(map(v[0]), map(v[1]), map(v[2]))).collect()
    };
    match plane.plane {
        // Near is bright; what is hit nowhere stays black.
        Plane::Depth => grey(&|v| if v > 0.0 { 1.0 - 0.9 * v / high } else { 0.0 }),
        Plane::Normal => triples(&|v| 0.5 + 0.5 * v),
        Plane::Position => triples(&over_range),
        Plane::Albedo => triples(&|v| v),
        Plane::Alpha => grey(&|v| v),
        Plane::ObjectId | Plane::InstanceId | Plane::MaterialId => {
            plane.values.iter().map(|&id| identity_color(id as u32)).collect()
        }
        Plane::Nodes | Plane::Triangles | Plane::Cost => {
            let white = count_range(plane).map_or(1.0, |[_, white]| white);
            plane.values.iter().map(|&count| heat_color(count / white)).collect()
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

/// The bytes of a shown plane. Albedo and the false colours of counts get the sRGB curve; everything else is data and
/// stays as it is.
pub fn plane_bytes(colors: &[Vec3], plane: Plane) -> Vec<u8> {
    let curve = |l: f32| if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
    let encode = |v: f32| {
        if plane == Plane::Albedo || plane.is_count() { curve(v.clamp(0.0, 1.0)) } else { v.clamp(0.0, 1.0) }
    };
    colors.iter().flat_map(|c| c.to_array().map(|v| (encode(v) * 255.0 + 0.5) as u8)).collect()
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

    /// Packs it as JPEG of a quality from 1 to 100: small, with losses.
    ///
    /// # Errors
    /// When it has more than 65535 columns or rows.
    pub fn to_jpeg(&self, quality: u8) -> Result<Vec<u8>, PackError> {
        let (width, height) = (u16::try_from(self.frame.width), u16::try_from(self.frame.height));
        let (Ok(width), Ok(height)) = (width, height) else { return Err(self.error("too large")) };
        let mut bytes = Vec::with_capacity(self.rgb.len() / 8);
        let mut encoder = jpeg_encoder::Encoder::new(&mut bytes, quality.clamp(1, 100));
        if quality < 90 {
            encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::R_4_2_0);
        }
        encoder
            .encode(&self.rgb, width, height, jpeg_encoder::ColorType::Rgb)
            .map_err(|error| self.error(error))?;
        Ok(bytes)
    }

    /// Packs it as PNG, without losses, quickly rather than tightly.
    ///
    /// # Errors
    /// When the encoder refuses.
    pub fn to_png(&self) -> Result<Vec<u8>, PackError> {
        let mut bytes = Vec::with_capacity(self.rgb.len() / 2);
        let mut encoder = png::Encoder::new(&mut bytes, self.frame.width, self.frame.height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&self.rgb));
        written.map_err(|error| self.error(error))?;
        Ok(bytes)
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

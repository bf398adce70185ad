//! Light that earlier frames have seen, for frames that follow each other: a running mean at every surface point.
//!
//! Every point of a picture looks up the picture before where that saw the same point. What both have received, without
//! the surface's colour, is averaged: the more frames have seen the point, the less the new one weighs, down to a floor.
//! Frames that follow each other take virtual point lights of their own, so that the mean is over many more of them than
//! a frame can afford. Where an edit has changed the scene, one frame of the past counts at most: old light halves with
//! every frame.
//!
//! # References
//! Scherzer, Jeschke, Wimmer, "Pixel-Correct Shadow Maps with Temporal Reprojection and Shadow Test Confidence", 2007.
//! Schied et al., "Spatiotemporal Variance-Guided Filtering", 2017 (§4.1). Both blend colours of pixels; the average of
//! irradiance over frames of virtual point lights is ours.

use glam::{Vec2, Vec3};
use heliostat_shading::CameraRays;

use super::Gathered;
use super::discontinuity::Light;

/// Frames that a point remembers at most.
const MOST_FRAMES: f32 = 16.0;
/// The same for light that mirrors more or less, which depends on where it is seen from.
const MOST_GLOSSY_FRAMES: f32 = 4.0;
/// Pictures after an edit of which the past counts as one frame: old light halves with each.
const DOUBTED_FRAMES: u32 = 8;
/// Normals may differ by this much: cosine.
const LEAST_COSINE: f32 = 0.9;
/// A point may lie off the tangent plane by this share of its distance from the camera.
const PLANE_DISTANCE: f32 = 0.01;

/// What a pixel remembers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Remembered {
    light: Light,
    position: Vec3,
    normal: Vec3,
    /// Frames that the light is the mean of; 0 if there is none.
    frames: f32,
}

impl Remembered {
    /// What a pixel receives, with what its point has received in the picture before, if there was one.
    pub(super) fn of(point: &Gathered, light: Light, history: Option<&History>) -> Self {
        let frames = if point.strength > 0.0 && point.straight { 1.0 } else { 0.0 };
        let first = Self { light, position: point.position, normal: point.normal, frames };
        match history {
            Some(history) if frames > 0.0 => history.blend(first),
            _ => first,
        }
    }

    /// The mean light.
    pub(super) fn light(&self) -> Light {
        self.light
    }
}

/// The picture before.
#[derive(Clone, Debug)]
pub struct History {
    camera: CameraRays,
    size: (u32, u32),
    pixels: Vec<Remembered>,
    /// Pictures so far, but for those of which the past is in doubt.
    frames: u32,
    /// Pictures still to come of which the past is in doubt.
    doubt: u32,
}

impl History {
    /// After the first picture. `pixels` row by row.
    pub fn new(camera: CameraRays, size: (u32, u32), pixels: Vec<Remembered>) -> Self {
        Self { camera, size, pixels, frames: 1, doubt: 0 }
    }

    /// After another picture, of any size. Returns the pixels of the one before, which nobody needs any more.
    pub fn advance(
        &mut self,
        camera: CameraRays,
        size: (u32, u32),
        pixels: Vec<Remembered>,
    ) -> Vec<Remembered> {
        let frames = if self.doubt > 0 { 0 } else { self.frames.wrapping_add(1) };
        let now = Self { camera, size, pixels, frames, doubt: self.doubt.saturating_sub(1) };
        std::mem::replace(self, now).pixels
    }

    /// Pictures so far. Each takes light paths of its own; but while the past is in doubt all take the same, or the little
    /// that is remembered would let them flicker.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// After an edit: for some pictures all of the past counts as one frame at most.
    pub fn distrust(&mut self) {
        (self.frames, self.doubt) = (0, DOUBTED_FRAMES);
    }

    /// The mean of what a point receives and what it has received before.
    fn blend(&self, mut point: Remembered) -> Remembered {
        if let Some((before, frames)) = self.look_up(&point) {
            let most = if self.doubt > 0 { 2.0 } else { MOST_FRAMES };
            point.frames = (frames + 1.0).min(most);
            let mix = |before: Vec3, now: Vec3, most: f32| before + (now - before) / point.frames.min(most);
            point.light = Light {
                irradiance: mix(before.irradiance, point.light.irradiance, MOST_FRAMES),
                gloss: mix(before.gloss, point.light.gloss, MOST_GLOSSY_FRAMES),
            };
        }
        point
    }

    /// The light that a point had in the picture before, between the four pixels around it, and how many frames it is the
    /// mean of; `None` if it was not seen.
    fn look_up(&self, point: &Remembered) -> Option<(Light, f32)> {
        let at = self.camera.project(point.position)? - 0.5;
        let corner = at.floor();
        let (mut sum, mut frames, mut weights) = (Light::default(), 0.0, 0.0);
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let tap = corner + Vec2::new(dx, dy);
            let size = Vec2::new(self.size.0 as f32, self.size.1 as f32);
            if tap.cmplt(Vec2::ZERO).any() || tap.cmpge(size).any() {
                continue;
            }
            let pixel = &self.pixels[tap.y as usize * self.size.0 as usize + tap.x as usize];
            let near = Vec2::ONE - (at - tap).abs();
            let weight = near.x * near.y;
            if weight > 0.0 && self.is_same(pixel, point) {
                sum.irradiance += pixel.light.irradiance * weight;
                sum.gloss += pixel.light.gloss * weight;
                frames += pixel.frames * weight;
                weights += weight;
            }
        }
        // A sliver of one pixel says little.
        (weights > 0.05).then(|| {
            let light = Light { irradiance: sum.irradiance / weights, gloss: sum.gloss / weights };
            (light, frames / weights)
        })
    }

    fn is_same(&self, pixel: &Remembered, point: &Remembered) -> bool {
        let scale = PLANE_DISTANCE * point.position.distance(self.camera.position());
        let off = (pixel.position - point.position).dot(point.normal).abs();
        pixel.frames > 0.0 && pixel.normal.dot(point.normal) > LEAST_COSINE && off < scale
    }
}

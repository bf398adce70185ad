//! What is asked of a backend and what comes back.

use glam::Vec3;

use crate::{Camera, ShaderUse};

/// One picture to be made.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameRequest {
    /// Point of view.
    pub camera: Camera,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Which renderer; the backend lists those it has.
    pub renderer: String,
    /// Samples per pixel, at least 1.
    pub samples: u32,
    /// Longest path in edges: 1 shows emission alone, 2 adds direct light, and so on. `None` leaves it to the
    /// renderer: no limit for `path`, its own default for others.
    pub max_depth: Option<u32>,
    /// Same scene, request and seed: same bits.
    pub seed: u32,
    /// Number of the frame in a sequence; decorrelates the noise of successive frames.
    pub frame: u32,
    /// Reconstruction filter.
    pub filter: Filter,
    /// Constant radiance added to every surface, times its albedo, by the classical renderer `direct`.
    pub ambient: Vec3,
    /// Replaces the look of everything.
    pub materials: MaterialOverride,
    /// Further planes of data to deliver.
    pub planes: Vec<Plane>,
    /// Parameters of the renderer `igi`.
    pub igi: IgiOptions,
    /// Pixel shaders that the finished picture goes through, one after the other.
    pub pixel_shaders: Vec<ShaderUse>,
}

/// Parameters of Instant Global Illumination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IgiOptions {
    /// Light paths of each set of virtual point lights, at least 1; of all sets together at most 2^18.
    pub paths: u32,
    /// Columns and rows of the interleaving pattern, 1 to 8 each: neighbouring pixels take as many different sets.
    pub interleave: [u32; 2],
    /// Whether neighbouring pixels share their light (the discontinuity buffer).
    pub filter: bool,
    /// Whether pixels at edges take more samples, where `filter` is on and `antialias` is 1.
    pub edges: bool,
    /// Rays from the camera through each pixel that share the light paths of a pass: 1, 2, 4, 8 or 16. Each is lit by a
    /// part of the pixel's set, so that there are about as many shadow rays as for one.
    pub antialias: u32,
    /// A virtual point light adds at most this many times the typical irradiance of its set; infinity bounds nothing.
    pub clamp: f32,
    /// Whether short rays give back the light that `clamp` takes away.
    pub compensate: bool,
    /// Whether eight times as many light paths are drawn and as many virtual point lights kept as matter most to the camera.
    pub importance: bool,
    /// Passes that frames of the same view have made before: this one goes on where they ended, and the mean of all
    /// converges.
    pub first_pass: u32,
    /// Whether the frame goes on from the last one that asked for this too: light is averaged
    /// over the frames that have seen a point, and after an edit over two of them at most.
    pub accumulate: bool,
    /// Photons of each pass, which bring the light that mirrors and glass throw on other surfaces; at most 2^20, none at 0.
    pub photons: u32,
}

impl Default for IgiOptions {
    /// 3×3 sets of 8 paths, filtered, bounded at twice the typical irradiance, with the rest given back; 20,000 photons.
    fn default() -> Self {
        Self {
            paths: 8,
            interleave: [3, 3],
            filter: true,
            edges: true,
            antialias: 1,
            clamp: 2.0,
            compensate: true,
            importance: true,
            first_pass: 0,
            accumulate: false,
            photons: 20_000,
        }
    }
}

impl IgiOptions {
    /// What is out of range, if anything.
    pub fn problem(&self) -> Option<String> {
        if !(1..=1 << 16).contains(&self.paths) {
            return Some(format!("{} light paths per set; give 1 to 65536", self.paths));
        }
        let [n, m] = self.interleave;
        if !(1..=8).contains(&n) || !(1..=8).contains(&m) {
            return Some(format!("a pattern of {n}×{m} sets; give 1 to 8 columns and rows"));
        }
        let most = 1 << 18;
        if self.paths * n * m > most {
            let paths = self.paths;
            return Some(format!("{paths} paths for each of {n}×{m} sets; give at most {most} in all"));
        }
        if !(self.antialias.is_power_of_two() && self.antialias <= 16) {
            return Some(format!(
                "{} rays from the camera for each pixel; give 1, 2, 4, 8 or 16",
                self.antialias
            ));
        }
        if self.photons > 1 << 20 {
            return Some(format!("{} photons; give at most {}", self.photons, 1 << 20));
        }
        (self.clamp.is_nan() || self.clamp <= 0.0)
            .then(|| format!("`clamp` is {}; give a positive number or infinity", self.clamp))
    }
}

impl FrameRequest {
    /// A frame by the reference path tracer with 16 samples per pixel and a box filter.
    pub fn new(camera: Camera, width: u32, height: u32) -> Self {
        Self {
            camera,
            width,
            height,
            renderer: "path".into(),
            samples: 16,
            max_depth: None,
            seed: 0,
            frame: 0,
            filter: Filter::Box,
            ambient: Vec3::ZERO,
            materials: MaterialOverride::None,
            planes: Vec::new(),
            igi: IgiOptions::default(),
            pixel_shaders: Vec::new(),
        }
    }
}

/// Reconstruction filters; samples are drawn in proportion to them, so every pixel keeps its own samples.
///
/// # References
/// Ernst, Stamminger, Greiner, "Filter Importance Sampling", 2006.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Filter {
    /// The pixel's own square.
    #[default]
    Box,
    /// Linear fall-off over one pixel to each side.
    Tent,
    /// Normal distribution with this standard deviation in pixels, cut off at three of them.
    Gaussian(f32),
    /// Blackman–Harris window, two pixels to each side.
    BlackmanHarris,
}

/// Replaces the look of everything, for comparisons.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum MaterialOverride {
    /// Materials as they are.
    #[default]
    None,
    /// Every surface is an opaque Lambertian of its base colour; emission stays.
    Diffuse,
    /// Every surface is by this shader, which starts from the material as it is.
    Shader {
        /// Which.
        shader: ShaderUse,
        /// Whether mirrors and glass stay as they are, so that what they show is by the shader.
        mirrors: bool,
    },
}

/// Auxiliary data per pixel: the mean over the pixel's samples, except for the identifiers, which belong to the
/// pixel's first sample, and nodes and triangles, which are of one ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Plane {
    /// Distance from the camera along the ray, metres; 0 where nothing is hit.
    Depth,
    /// Shading normal, world space; 0 where nothing is hit.
    Normal,
    /// Geometric position, world space; 0 where nothing is hit.
    Position,
    /// Share of light reflected under uniform white light.
    Albedo,
    /// Fraction of samples that hit something.
    Alpha,
    /// Handle number of the object + 1; 0 where nothing is hit.
    ObjectId,
    /// Handle number of the innermost instance + 1; 0 where nothing is hit.
    InstanceId,
    /// Handle number of the material + 1; 0 where nothing is hit.
    MaterialId,
    /// Nodes of acceleration structures that the ray through the pixel's centre passes before it hits something.
    Nodes,
    /// Triangles, and other primitives, in the leaves that it passes.
    Triangles,
    /// Points shaded for a sample of the pixel: those that camera rays meet, and those further on along the paths.
    Cost,
}

impl Plane {
    /// All planes.
    pub const ALL: [Self; 11] = [
        Self::Depth,
        Self::Normal,
        Self::Position,
        Self::Albedo,
        Self::Alpha,
        Self::ObjectId,
        Self::InstanceId,
        Self::MaterialId,
        Self::Nodes,
        Self::Triangles,
        Self::Cost,
    ];

    /// The name used on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Position => "position",
            Self::Albedo => "albedo",
            Self::Alpha => "alpha",
            Self::ObjectId => "object-id",
            Self::InstanceId => "instance-id",
            Self::MaterialId => "material-id",
            Self::Nodes => "nodes",
            Self::Triangles => "triangles",
            Self::Cost => "cost",
        }
    }

    /// Whether it counts what pixels cost: data for heat maps.
    pub fn is_count(self) -> bool {
        matches!(self, Self::Nodes | Self::Triangles | Self::Cost)
    }

    /// Values per pixel.
    pub fn channels(self) -> usize {
        match self {
            Self::Normal | Self::Position | Self::Albedo => 3,
            _ => 1,
        }
    }
}

/// One delivered plane.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneData {
    /// Which.
    pub plane: Plane,
    /// `width × height × channels` values, rows from the top.
    pub values: Vec<f32>,
}

/// A finished picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear Rec. 709 radiance, rows from the top.
    pub color: Vec<Vec3>,
    /// The planes asked for, in the order of the request.
    pub planes: Vec<PlaneData>,
    /// What it took.
    pub stats: FrameStats,
    /// What went wrong on the way and shows in the picture, such as a plug-in shader that answers nonsense. Each is told
    /// once, with the first picture that has it.
    pub problems: Vec<String>,
}

/// What a frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameStats {
    /// Wall time of the frame, milliseconds, without building accelerators.
    pub milliseconds: f64,
    /// Rays traced, of all kinds.
    pub rays: u64,
    /// Time in ray queries, summed over all threads, milliseconds: the rest of their time is shading and all else.
    pub query_milliseconds: f64,
}

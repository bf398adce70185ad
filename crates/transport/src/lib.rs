//! How light gets there: the integrators.
//!
//! An integrator renders one region of the picture at a time, a whole region per step: it asks the kernel in batches
//! (tiles of camera rays with a common origin where the camera has one) and shades between the queries. It is generic
//! over [`RayQuery`], so that the oracle or a recorder can stand in for the kernel. The
//! result of a pixel depends on the pixel alone, never on the region, its neighbours or the number of threads.
#![forbid(unsafe_code)]

mod direct;
mod eye;
mod eyelight;
mod igi;
mod mis;
mod path;
mod region;
mod shadow;
mod wave;

pub use igi::{Fragment, Gathered, History, IgiFrame, IgiSettings, Light, Lit, Remembered};
pub use region::{FirstHit, PixelSum, Region, Settings, View};

use heliostat_kernel::RayQuery;

/// The renderers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// The unbiased reference path tracer.
    Path,
    /// The classical recursive ray tracer: direct light, mirrors and glass.
    Direct,
    /// Ray casting: the first surface, lit by all lights, without shadows.
    Cast,
    /// The geometry alone, as bright as it faces the camera: neither materials nor lights.
    Eyelight,
}

impl Integrator {
    /// All of them with their names.
    pub const NAMES: &[(&str, Self)] =
        &[("path", Self::Path), ("direct", Self::Direct), ("cast", Self::Cast), ("eyelight", Self::Eyelight)];

    /// The integrator of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(known, _)| *known == name).map(|&(_, integrator)| integrator)
    }

    /// Renders all samples of a region's pixels. `sums` has one entry per pixel in the order of
    /// [`Region::pixels`]; the number of rays traced is returned. After each sample `after_sample` tells whether to go
    /// on: it is the place to count progress and to cancel.
    pub fn render<Q: RayQuery + ?Sized>(
        self,
        view: &View<'_, Q>,
        settings: &Settings,
        region: &Region,
        sums: &mut [PixelSum],
        after_sample: &dyn Fn() -> bool,
    ) -> u64 {
        match self {
            Self::Path => path::render(view, settings, region, sums, after_sample),
            Self::Direct => direct::render(view, settings, region, sums, after_sample, true),
            Self::Cast => direct::render(view, settings, region, sums, after_sample, false),
            Self::Eyelight => eyelight::render(view, settings, region, sums, after_sample),
        }
    }
}

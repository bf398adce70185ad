//! Instant Global Illumination: all light from a few hundred virtual point lights, anew in every frame.
//!
//! Light paths leave virtual point lights where they meet surfaces; every point that the camera sees is lit by one of
//! several sets of them, by shadow rays from a common origin. Neighbouring pixels take different sets (interleaved
//! sampling), and a filter that stops at edges (the discontinuity buffer) brings the sets together again.
//!
//! # References
//! Wald, Kollig, Benthin, Keller, Slusallek, "Interactive Global Illumination using Fast Ray Tracing", 2002; Benthin, Wald,
//! Slusallek, "A Scalable Approach to Interactive Global Illumination", 2003.

mod by_paths;
mod discontinuity;
mod edges;
mod gather;
mod history;
mod importance;
mod launch;
mod lights;
mod paths;
mod photon_map;
mod photons;
mod residual;
mod samples;
mod sight;
mod vpl;

use glam::Vec3;
use heliostat_kernel::RayQuery;

use crate::eye::{EyeWalk, Lighting, WeightedRay};
use crate::region::{Adds, PixelSum, Region, Settings, View, walk_sample};
use by_paths::ByPaths;
pub use discontinuity::Light;
use discontinuity::Window;
pub use edges::Lit;
use gather::ByVpls;
pub use history::{History, Remembered};
use paths::PathPlan;
use photon_map::PhotonMap;
use photons::PhotonPlan;
use samples::Fold;
pub use samples::Fragment;
use vpl::{VplPlan, VplSets};

/// Edges of whole paths when the request does not say.
const DEFAULT_MAX_EDGES: u32 = 24;

/// Passes whose light neighbours share.
const FILTERED_PASSES: u32 = 16;

/// Light that comes by lobes of a larger GGX α is shared between neighbours as diffuse light is; mirrors stay sharp.
const CLEAR_ALPHA: f32 = 1e-2;

/// Parameters of Instant Global Illumination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IgiSettings {
    /// Light paths of each set.
    pub paths: u32,
    /// Columns and rows of the interleaving pattern: as many sets as it has pixels.
    pub interleave: [u32; 2],
    /// Whether neighbouring pixels share their light.
    pub filter: bool,
    /// Whether pixels at edges take more samples where they do and have but one.
    pub edges: bool,
    /// Samples of each pixel that share the virtual point lights of a pass: a power of two.
    pub antialias: u32,
    /// A virtual point light adds at most this many times the typical irradiance of its set.
    pub clamp: f32,
    /// Whether short rays give back what the bound takes away.
    pub compensate: bool,
    /// Whether more light paths are drawn and what matters to the camera is kept.
    pub importance: bool,
    /// Passes that were made before this frame.
    pub first_pass: u32,
    /// Photons of each pass, for light that mirrors and glass throw on other surfaces.
    pub photons: u32,
    /// Whether every point is lit by a path of its own instead of virtual point lights and photons: for comparison.
    pub by_paths: bool,
}

impl Default for IgiSettings {
    /// 3×3 sets of 8 paths, filtered, chosen by importance, with what the bound takes away given back, and 20,000
    /// photons.
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
            photons: 20_000,
            by_paths: false,
        }
    }
}

/// What a pixel has received: the point that matters most to it, with its light apart from its colour, and all else.
#[derive(Clone, Copy, Debug, Default)]
pub struct Gathered {
    /// Radiance of what the camera sees itself: lamps, the sky.
    emitted: Vec3,
    /// Radiance of points that matter less, and what rays found in mirrors and behind glass.
    other: Vec3,
    /// Radiance that rays found in random directions of rough mirrors and glass.
    scattered: Vec3,
    /// Irradiance over π: times the colour it is what the point's diffuse lobe reflects.
    irradiance: Vec3,
    /// The colour: what the pixel sees of the diffuse lobe.
    albedo: Vec3,
    /// Light that its other rough lobes reflect.
    gloss: Vec3,
    position: Vec3,
    normal: Vec3,
    /// How much the pixel sees of the point; 0 if there is none.
    strength: f32,
    /// How much of the pixel the point's surface fills.
    coverage: f32,
    /// Whether the camera sees it itself rather than in a mirror or through glass.
    straight: bool,
}

impl Gathered {
    /// Takes the light of a point that was found on a way of a largest GGX `alpha`.
    fn arrive(&mut self, alpha: f32, point: Self) {
        match alpha > CLEAR_ALPHA {
            true => self.scattered += point.reflected(),
            false => self.meet(point),
        }
    }

    /// Takes radiance that a ray found by itself; what is not finite counts as black rather than spoiling the pixel.
    fn find(&mut self, ray: &WeightedRay, radiance: Vec3) {
        if radiance.is_finite() {
            match (ray.alpha > CLEAR_ALPHA, ray.edges == 0) {
                (true, _) => self.scattered += radiance,
                (_, true) => self.emitted += radiance,
                (_, false) => self.other += radiance,
            }
        }
    }

    /// Meets another point along the same ray: the one that matters more stays.
    fn meet(&mut self, mut point: Self) {
        if self.strength == 0.0 && point.strength > 0.0 {
            let Self { emitted, other, scattered, .. } = *self;
            *self = Self { emitted, other, scattered, ..point };
            return;
        }
        if point.strength > self.strength {
            std::mem::swap(self, &mut point);
            (self.other, self.scattered, self.emitted) = (point.other, point.scattered, point.emitted);
        }
        self.other += point.reflected();
    }

    /// Radiance that the pixel sees of the point.
    fn reflected(&self) -> Vec3 {
        self.albedo * self.irradiance + self.gloss
    }
}

/// A frame of Instant Global Illumination in the making.
pub struct IgiFrame<'a, Q: ?Sized> {
    view: &'a View<'a, Q>,
    settings: &'a Settings,
    igi: IgiSettings,
    /// Which pass is in the making.
    pass: u32,
    /// Passes before this frame whose virtual point lights are not to come again.
    before: u32,
    /// Its virtual point lights.
    vpls: VplSets,
    photons: PhotonMap,
    /// Rays traced to make both.
    rays: u64,
}

impl<'a, Q: RayQuery + ?Sized> IgiFrame<'a, Q> {
    /// A frame that starts with its first pass. `remembered` passes are in the history that it goes on from.
    pub fn new(view: &'a View<'a, Q>, settings: &'a Settings, igi: IgiSettings, remembered: u32) -> Self {
        let mut frame = Self {
            view,
            settings,
            igi,
            pass: 0,
            before: igi.first_pass.wrapping_add(remembered),
            vpls: VplSets::default(),
            photons: PhotonMap::default(),
            rays: 0,
        };
        frame.draw();
        frame
    }

    /// Goes on to another pass: draws its virtual point lights and photons. Returns the number of rays.
    pub fn start(&mut self, pass: u32) -> u64 {
        if pass != self.pass {
            self.pass = pass;
            self.draw();
        }
        self.rays
    }

    /// Number of the pass among all of this view.
    fn sample(&self) -> u32 {
        self.igi.first_pass.wrapping_add(self.pass)
    }

    /// The virtual point lights and photons of the pass.
    fn draw(&mut self) {
        if self.igi.by_paths {
            return;
        }
        let max_edges = self.settings.max_depth.unwrap_or(DEFAULT_MAX_EDGES);
        let [n, m] = self.igi.interleave;
        let paths = PathPlan {
            sets: n * m,
            paths: self.igi.paths,
            kept: self.igi.paths,
            pass: self.pass.wrapping_add(self.before),
            seed: self.settings.seed,
            max_bounces: max_edges.saturating_sub(2),
        };
        let parts = self.igi.antialias.max(1);
        let plan = VplPlan { paths, parts, clamp: self.igi.clamp, importance: self.igi.importance };
        self.vpls = VplSets::new(self.view, &plan);
        let plan = PhotonPlan {
            count: self.igi.photons,
            pass: self.pass.wrapping_add(self.before),
            seed: self.settings.seed,
            max_edges: max_edges.saturating_sub(1),
        };
        let (photons, rays) = photons::trace(self.view, &self.vpls, &plan);
        self.photons = PhotonMap::new(photons, self.view.query.bounds().size().length(), self.sample());
        self.rays = self.vpls.rays + rays;
    }

    /// The regions of a picture: as many pixels of every set in each as fill a tile.
    pub fn regions(&self, width: u32, height: u32) -> Vec<Region> {
        let [n, m] = self.igi.interleave;
        Region::cover_by(width, height, [16 * n, 16 * m]).collect()
    }

    /// Renders the pass of a region. `sums` and the first result have one entry per pixel in the order of [`Region::pixels`];
    /// fragments of them and the number of rays are returned too.
    pub fn render(&self, region: &Region, sums: &mut [PixelSum]) -> (Vec<Gathered>, Vec<Fragment>, u64) {
        let max_edges = self.settings.max_depth.unwrap_or(DEFAULT_MAX_EDGES);
        if self.igi.by_paths {
            let lighting = ByPaths::new(self.view, sums.len(), max_edges);
            let mut walk = EyeWalk::new(self.view, self.settings, sums.len(), lighting);
            let (pixels, fragments, traced) =
                self.gather(&mut walk, region, sums, |paths| &mut paths.gathered);
            return (pixels, fragments, traced + walk.lighting.traced());
        }
        let [n, m] = self.igi.interleave;
        let groups: Vec<u8> = region.pixels().into_iter().map(|(x, y)| (x % n + n * (y % m)) as u8).collect();
        let lighting = ByVpls::new(&groups, (&self.vpls, &self.photons), max_edges, self.igi.compensate);
        let mut walk = EyeWalk::new(self.view, self.settings, sums.len(), lighting);
        let (pixels, fragments, traced) = self.gather(&mut walk, region, sums, ByVpls::go_on);
        (pixels, fragments, traced + walk.lighting.traced())
    }

    /// Takes all samples of the pass. `gathered` says what the pixels have received by the last one and makes ready for the
    /// next. Returns what they have received by all, fragments and the number of rays.
    fn gather<L: Lighting<Q>>(
        &self,
        walk: &mut EyeWalk<'_, Q, L>,
        region: &Region,
        sums: &mut [PixelSum],
        gathered: impl Fn(&mut L) -> &mut Vec<Gathered>,
    ) -> (Vec<Gathered>, Vec<Fragment>, u64) {
        let count = self.igi.antialias.max(1);
        let mut trace = |walk: &mut _, index| {
            let adds = Adds::new(self.settings, self.pass == 0 && index == 0);
            let sample = samples::sample(self.sample(), index, count, adds);
            walk_sample(walk, self.view, self.settings, region, sample, sums)
        };
        if count == 1 {
            let traced = trace(walk, 0);
            return (std::mem::take(gathered(&mut walk.lighting)), Vec::new(), traced);
        }
        let mut fold = Fold::new(region.area(), count, self.view.camera.position());
        let mut traced = 0;
        for index in 0..count {
            traced += trace(walk, index);
            fold.add(gathered(&mut walk.lighting));
        }
        let (pixels, fragments) = fold.finish();
        (pixels, fragments, traced)
    }

    /// The light that falls on what a row of the picture sees in the pass, filtered if that was asked for. `gathered` is the
    /// whole picture, row by row. Only the first passes are filtered, so that what the filter gets wrong vanishes as more
    /// follow. What a history is to remember of the row is put into `remembered`, if there is to be one; `history` is the one
    /// before.
    pub fn light(
        &self,
        gathered: &[Gathered],
        (width, height): (u32, u32),
        y: u32,
        history: Option<&History>,
        mut remembered: Option<&mut Vec<Remembered>>,
    ) -> Vec<Light> {
        let window = Window {
            pixels: gathered,
            width,
            height,
            pattern: if self.is_filtered() { self.igi.interleave } else { [1, 1] },
            eye: self.view.camera.position(),
        };
        let pixel = |x| {
            let point = &gathered[(y * width + x) as usize];
            let mut light = window.light(x, y);
            if let Some(remembered) = &mut remembered {
                let memory = Remembered::of(point, light, history);
                light = memory.light();
                remembered.push(memory);
            }
            light
        };
        (0..width).map(pixel).collect()
    }

    /// Whether neighbours share their light in the pass.
    fn is_filtered(&self) -> bool {
        self.igi.filter && self.sample() < FILTERED_PASSES
    }

    /// A row of the picture, by the light that falls on what it sees, as the sum over the samples of each pixel, and the
    /// number of rays. Where light is shared between neighbours, pixels at edges that have but one sample take more.
    pub fn row(&self, lit: &Lit<'_>, y: u32) -> (Vec<Vec3>, u64) {
        let mut colors: Vec<Vec3> = (0..lit.size.0).map(|x| lit.color(x, y)).collect();
        let samples = self.igi.antialias.max(1);
        let mut rays = 0;
        if samples > 1 {
            lit.add_fragments(y, self.is_filtered().then(|| self.view.camera.position()), &mut colors);
            colors.iter_mut().for_each(|color| *color *= samples as f32);
        } else if self.is_filtered() && self.igi.edges {
            rays = edges::refine(self.view, self.settings, lit, y, &mut colors);
        }
        (colors, rays)
    }
}

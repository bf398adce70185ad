//! What integrators share: the view, the settings, a region of pixels, its camera rays and its sums.

use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, Ray, RayQuery, Tile};
use heliostat_shading::lanes::WIDTH;
use heliostat_shading::{
    CameraRays, Cone, PicturePoints, PixelFilter, Placement, RayPacket, SamplePoints, Sampler, Samplers,
    ShadingScene, Surfaces, halves,
};

/// What is looked at, and from where.
#[derive(Debug)]
pub struct View<'a, Q: ?Sized> {
    /// Answers rays.
    pub query: &'a Q,
    /// Shader tables.
    pub scene: &'a ShadingScene,
    /// Camera rays.
    pub camera: &'a CameraRays,
    /// Whether anything moves while the shutter is open: rays then have times of their own.
    pub moving: bool,
}

/// Parameters of a frame.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Samples per pixel.
    pub samples: u32,
    /// Longest path in edges (1: emission only); `None` is the integrator's default.
    pub max_depth: Option<u32>,
    /// Same seed, same bits.
    pub seed: u32,
    /// Decorrelates frames.
    pub frame: u32,
    /// Where samples lie around a pixel's centre.
    pub filter: PixelFilter,
    /// Whether all pixels put a sample at the same place, the first at their centres: coherent rays, and steps along edges
    /// rather than noise.
    pub aligned: bool,
    /// Constant radiance that every surface reflects, times its albedo. For `direct` alone.
    pub ambient: Vec3,
    /// Whether sums of all but light are wanted: for a picture alone they would be made in vain.
    pub planes: bool,
}

/// A rectangle of pixels: large enough to fill shader packets, small enough for the caches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Region {
    /// Edge length of a full region, as most renderers take it.
    pub const SIZE: u32 = 32;
    /// Edge length of the part that one tile of camera rays covers.
    const TILE: u32 = 16;

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// All regions of a picture, row by row.
    pub fn cover(width: u32, height: u32) -> impl Iterator<Item = Self> {
        Self::cover_by(width, height, [Self::SIZE; 2])
    }

    /// All regions of a picture in steps of so many columns and rows.
    pub(crate) fn cover_by(width: u32, height: u32, [columns, rows]: [u32; 2]) -> impl Iterator<Item = Self> {
        let starts = |extent: u32, step: u32| (0..extent).step_by(step as usize);
        starts(height, rows).flat_map(move |y| {
            starts(width, columns).map(move |x| Self {
                x,
                y,
                width: columns.min(width - x),
                height: rows.min(height - y),
            })
        })
    }

    /// The pixels, first those of one tile of 16×16, then of the next; in a tile by blocks of 4×4, so that every 16 camera
    /// rays in a row form a narrow frustum.
    pub fn pixels(self) -> Vec<(u32, u32)> {
        // Nested loops, since nested iterators take longer than some renderers take for their pixels.
        let mut pixels = Vec::with_capacity(self.area());
        for tile in self.parts(Self::TILE) {
            for block in tile.parts(4) {
                for y in block.y..block.y + block.height {
                    pixels.extend((block.x..block.x + block.width).map(|x| (x, y)));
                }
            }
        }
        pixels
    }

    /// Squares of some edge length, row by row; smaller at the right and at the bottom.
    fn parts(self, edge: u32) -> impl Iterator<Item = Self> {
        Self::cover_by(self.width, self.height, [edge; 2]).map(move |part| Self {
            x: self.x + part.x,
            y: self.y + part.y,
            ..part
        })
    }
}

/// What the samples of one pixel add up to. All but the light stays zero where [`Settings::planes`] does not ask for it.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSum {
    /// Radiance found by camera rays and bounces.
    pub color: Vec3,
    /// Radiance found by shadow rays. A sum of its own, so that a pixel's bits do not depend on when batches are traced.
    pub lit: Vec3,
    /// Distance along the ray.
    pub depth: f32,
    /// Shading normals.
    pub normal: Vec3,
    /// Positions.
    pub position: Vec3,
    /// Albedos.
    pub albedo: Vec3,
    /// Number of samples that hit something.
    pub hits: f32,
    /// Number of points that were shaded.
    pub shaded: f32,
    /// Identifiers of the first sample's first hit.
    pub first: Option<FirstHit>,
}

/// What was hit, by handle number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FirstHit {
    /// Object handle.
    pub object: u32,
    /// Innermost instance handle.
    pub instance: u32,
    /// Material handle.
    pub material: u32,
}

impl FirstHit {
    #[inline]
    pub(crate) fn of(scene: &ShadingScene, hit: &Hit) -> Self {
        let (placement, _, material) = scene.part(hit);
        let Placement { object, instance, .. } = placement;
        Self { object: object.0, instance: instance.0, material: material.id.0 }
    }
}

impl PixelSum {
    /// Adds the first surface a camera ray met (behind see-through ones it passed); `first` are its identifiers if this is the
    /// pixel's first sample.
    #[inline]
    pub(crate) fn add_first_hit(
        &mut self,
        surfaces: &Surfaces,
        lane: usize,
        distance: f32,
        first: Option<FirstHit>,
    ) {
        self.depth += distance;
        self.normal += surfaces.normal(lane);
        self.position += surfaces.position(lane);
        self.albedo += surfaces.albedo(lane);
        self.hits += 1.0;
        self.first = first.or(self.first);
    }

    /// Adds what a shadow ray let through; as for [`Self::add_radiance`].
    pub(crate) fn add_lit(&mut self, radiance: Vec3) {
        if radiance.is_finite() {
            self.lit += radiance;
        }
    }

    /// Adds radiance; a sample that is not finite counts as black rather than spoiling the pixel.
    pub(crate) fn add_radiance(&mut self, radiance: Vec3) {
        if radiance.is_finite() {
            self.color += radiance;
        }
    }
}

/// The place of a sample for all pixels alike: the centre first, then evenly over the square.
///
/// # References
/// Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018 (R2).
pub(crate) fn aligned_point(sample: u32) -> Vec2 {
    const STEP: [f64; 2] = [0.754_877_666_246_692_8, 0.569_840_290_998_053_3];
    let at = STEP.map(|step| (0.5 + step * f64::from(sample)).fract() as f32);
    Vec2::from_array(at).min(Vec2::splat(1.0 - f32::EPSILON))
}

/// Which sample of all pixels of a region is taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub(crate) number: u32,
    /// Its place in every pixel, from 0 to 1, where all put it at the same.
    pub(crate) place: Vec2,
    /// What it adds to the sums.
    pub(crate) adds: Adds,
}

/// What a sample adds to the sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Adds {
    /// Light.
    Light,
    /// And the geometry seen first.
    Geometry,
    /// And, as a pixel's first sample, the identifiers of that.
    Identifiers,
}

impl Adds {
    pub(crate) fn new(settings: &Settings, first: bool) -> Self {
        match (settings.planes, first) {
            (false, _) => Self::Light,
            (true, false) => Self::Geometry,
            (true, true) => Self::Identifiers,
        }
    }
}

impl Sample {
    /// One of a sequence.
    pub(crate) fn new(number: u32, adds: Adds) -> Self {
        Self { number, place: aligned_point(number), adds }
    }
}

/// One camera ray on its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraSample {
    /// Index into the region's pixels.
    pub(crate) pixel: u32,
    pub(crate) sampler: Sampler,
    pub(crate) ray: Ray,
    pub(crate) cone: Cone,
}

/// The camera rays of one sample of all pixels of a region.
fn camera_rays<Q: ?Sized, W: Walk>(
    view: &View<'_, Q>,
    settings: &Settings,
    region: &Region,
    sample: Sample,
) -> Vec<W::Ray> {
    // Pinholes whose pixels all put their samples at the same place need no numbers.
    let drawn = !(settings.aligned && view.camera.common_origin().is_some());
    let mut started = Vec::with_capacity(region.area());
    let (mut set, mut points) = (SamplePoints::default(), PicturePoints::default());
    let mut rays = RayPacket::default();
    let pixels = region.pixels();
    let samplers = Samplers::new(settings.frame, settings.seed, sample.number);
    for pixels in pixels.chunks(WIDTH) {
        let mut own = [Sampler::default(); WIDTH];
        for (lane, &(x, y)) in pixels.iter().enumerate() {
            own[lane] = samplers.pixel(x, y);
            if drawn {
                set.ask(lane, &own[lane], 0);
            }
            points.time.0[lane] = if view.moving { own[lane].time() } else { 0.0 };
        }
        if drawn {
            set.draw(view.scene.lane_mode(), pixels.len());
        }
        for (lane, &(x, y)) in pixels.iter().enumerate() {
            let (u_pixel, u_lens) = halves(set.get(lane));
            let u_filter = if settings.aligned { sample.place } else { u_pixel };
            let at = Vec2::new(x as f32, y as f32) + 0.5 + settings.filter.sample(u_filter);
            (points.pixel[0].0[lane], points.pixel[1].0[lane]) = (at.x, at.y);
            (points.lens[0].0[lane], points.lens[1].0[lane]) = (u_lens.x, u_lens.y);
        }
        view.camera.rays(view.scene.lane_mode(), &points, pixels.len(), &mut rays);
        let (first, cone) = (started.len() as u32, view.camera.cone());
        started.extend(own[..pixels.len()].iter().enumerate().map(|(lane, &sampler)| {
            let ray = Ray::new(rays.origin.get(lane), rays.direction.get(lane));
            let ray = ray.at_time(points.time.0[lane]);
            W::start(&CameraSample { pixel: first + lane as u32, sampler, ray, cone })
        }));
    }
    started
}

/// What camera rays hit first.
fn camera_hits<Q: RayQuery + ?Sized, W: Walk>(view: &View<'_, Q>, rays: &[W::Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    match view.camera.common_origin() {
        Some(origin) if !view.moving => {
            let mut tile = Tile::new(origin);
            for (rays, hits) in rays.chunks(Tile::CAPACITY).zip(hits.chunks_mut(Tile::CAPACITY)) {
                tile.restart(origin);
                for ray in rays {
                    tile.push(W::ray(ray).direction, f32::INFINITY);
                }
                view.query.intersect_tile(&tile, hits);
            }
        }
        _ => {
            let rays: Vec<Ray> = rays.iter().map(W::ray).collect();
            view.query.intersect(&rays, &mut hits);
        }
    }
    hits
}

/// How an integrator follows rays from the camera: one step per edge, for all rays of a region at once.
pub(crate) trait Walk {
    /// A ray on its way, with what it carries.
    type Ray;

    /// Where a camera sample starts.
    fn start(sample: &CameraSample) -> Self::Ray;

    /// What to ask the kernel.
    fn ray(ray: &Self::Ray) -> Ray;

    /// Shades the ends of all rays and returns those that go on.
    fn step(
        &mut self,
        rays: Vec<Self::Ray>,
        hits: &[Hit],
        sums: &mut [PixelSum],
        adds: Adds,
    ) -> Vec<Self::Ray>;
}

/// Walks all samples of a region's pixels and returns the number of rays that were followed. `after_sample` is asked
/// after each whether to go on.
pub(crate) fn walk<Q: RayQuery + ?Sized, W: Walk>(
    walk: &mut W,
    view: &View<'_, Q>,
    settings: &Settings,
    region: &Region,
    sums: &mut [PixelSum],
    after_sample: &dyn Fn() -> bool,
) -> u64 {
    let mut traced = 0;
    for sample in 0..settings.samples {
        traced += walk_sample(
            walk,
            view,
            settings,
            region,
            Sample::new(sample, Adds::new(settings, sample == 0)),
            sums,
        );
        if !after_sample() {
            break;
        }
    }
    traced
}

/// Walks one sample of a region's pixels and returns the number of rays that were followed.
pub(crate) fn walk_sample<Q: RayQuery + ?Sized, W: Walk>(
    walk: &mut W,
    view: &View<'_, Q>,
    settings: &Settings,
    region: &Region,
    sample: Sample,
    sums: &mut [PixelSum],
) -> u64 {
    let mut traced = 0;
    let mut current = camera_rays::<Q, W>(view, settings, region, sample);
    let mut hits = camera_hits::<Q, W>(view, &current);
    while !current.is_empty() {
        traced += current.len() as u64;
        current = walk.step(current, &hits, sums, sample.adds);
        let rays: Vec<Ray> = current.iter().map(W::ray).collect();
        hits.clear();
        hits.resize(rays.len(), Hit::MISS);
        view.query.intersect(&rays, &mut hits);
    }
    traced
}

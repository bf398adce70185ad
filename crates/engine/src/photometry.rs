//! Photometry: how strongly a scene shines in which direction, measured as a goniophotometer far away would, by following
//! particles of light from the lights through lenses and mirrors until they leave.
//!
//! # References
//! CIE 121, "The Photometry and Goniophotometry of Luminaires", 1996 (planes of measurement). Veach 1997, chapter 4
//! (particles as importance-weighted samples of light leaving its sources; refraction scales radiance but not flux).

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::{Mutex, PoisonError};

use glam::{DVec3, Vec3};
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_scene::{BackendError, LightKind, Progress};
use heliostat_shading::color::luminance;
use heliostat_shading::{Cone, Sampler, Selection, ShadingScene, Source};

use crate::queue::work_through;

/// Particles that travel together.
const BATCH: u64 = 8192;
/// Sums that are kept apart while particles travel and added in order afterwards: no result depends on the threads.
const STRANDS: usize = 8;
/// Most bins in all.
const MAX_BINS: u64 = 1 << 20;
/// Particles are numbered by 32 bits.
const MAX_PARTICLES: u64 = 1 << 32;
/// Keeps the numbers of these particles apart from those of others.
const SEED: u32 = 0x676f_6e69;
/// Edges after which weak particles may be ended by Russian roulette.
const ROULETTE_FROM: u32 = 8;

/// What is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotometryRequest {
    /// Particles sent from the lights.
    pub particles: u64,
    /// Bins over the horizontal and the vertical angle.
    pub bins: [u32; 2],
    /// Half the horizontal and half the vertical angle that the bins cover around −Z, radians: at most π and π/2, which
    /// are all directions.
    pub window: [f64; 2],
    /// Surfaces that a particle may meet before it is given up.
    pub max_edges: u32,
    /// Another seed gives other noise.
    pub seed: u32,
}

impl Default for PhotometryRequest {
    /// A million particles into 2° × 2° over all directions, up to 64 surfaces each.
    fn default() -> Self {
        Self { particles: 1 << 20, bins: [180, 90], window: [PI, FRAC_PI_2], max_edges: 64, seed: 0 }
    }
}

/// Where a scene's light goes.
///
/// A direction is given by its horizontal angle H about +Y, from −Z (0) towards +X (π/2), and by its vertical angle V
/// towards +Y: the planes of a head lamp that aims along −Z. In the C-γ system of luminaires, γ is V + π/2, measured
/// from straight down, and C is H.
#[derive(Clone, Debug, PartialEq)]
pub struct Photometry {
    /// Columns (H, ascending) and rows (V, ascending).
    pub bins: [u32; 2],
    /// Half extents of the bins' window, radians.
    pub window: [f64; 2],
    /// Mean radiant intensity of each bin weighted by luminance, W/sr, row by row. Times 683 lm/W it is in candela.
    pub intensity: Vec<f64>,
    /// What became of the flux.
    pub flux: FluxBalance,
    /// Particles that were sent.
    pub particles: u64,
    /// Rays that were traced.
    pub rays: u64,
}

/// Flux by its fate: linear RGB, W.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FluxBalance {
    /// Sent by the lights.
    pub emitted: DVec3,
    /// Gone out into the far.
    pub left: DVec3,
    /// Taken up by surfaces and volumes.
    pub absorbed: DVec3,
    /// On its way when its particle had met too many surfaces.
    pub given_up: DVec3,
    /// Of lights that are infinitely far away (sun, sky), which have no intensity; it is not part of what was sent.
    pub from_afar: DVec3,
}

impl FluxBalance {
    fn add(&mut self, other: &Self) {
        self.emitted += other.emitted;
        self.left += other.left;
        self.absorbed += other.absorbed;
        self.given_up += other.given_up;
        self.from_afar += other.from_afar;
    }

    fn scaled(&self, factor: f64) -> Self {
        Self {
            emitted: self.emitted * factor,
            left: self.left * factor,
            absorbed: self.absorbed * factor,
            given_up: self.given_up * factor,
            from_afar: self.from_afar * factor,
        }
    }
}

impl Photometry {
    /// The horizontal and vertical angle of the middle of a bin, radians.
    pub fn angles(&self, column: u32, row: u32) -> [f64; 2] {
        let middle = |index: u32, axis: usize| {
            let t = (f64::from(index) + 0.5) / f64::from(self.bins[axis]);
            (2.0 * t - 1.0) * self.window[axis]
        };
        [middle(column, 0), middle(row, 1)]
    }

    /// The strongest bin: column, row, W/sr.
    pub fn peak(&self) -> (u32, u32, f64) {
        let strongest = self.intensity.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let (index, &value) = strongest.unwrap_or((0, &0.0));
        (index as u32 % self.bins[0], index as u32 / self.bins[0], value)
    }
}

/// The bin of a direction.
fn bin(request: &PhotometryRequest, direction: Vec3) -> Option<usize> {
    let d = direction.as_dvec3();
    let angles = [d.x.atan2(-d.z), d.y.clamp(-1.0, 1.0).asin()];
    let at = |axis: usize| {
        let t = 0.5 * (angles[axis] / request.window[axis] + 1.0);
        let count = request.bins[axis];
        (0.0..=1.0).contains(&t).then(|| ((t * f64::from(count)) as u32).min(count - 1) as usize)
    };
    Some(at(1)? * request.bins[0] as usize + at(0)?)
}

/// The solid angle of a bin in `row`, sr.
fn solid_angle(request: &PhotometryRequest, row: u32) -> f64 {
    let edge =
        |row: u32| ((2.0 * f64::from(row) / f64::from(request.bins[1]) - 1.0) * request.window[1]).sin();
    2.0 * request.window[0] / f64::from(request.bins[0]) * (edge(row + 1) - edge(row))
}

/// What is out of range, if anything.
fn problem(request: &PhotometryRequest) -> Option<String> {
    let bins = u64::from(request.bins[0]) * u64::from(request.bins[1]);
    if bins == 0 || bins > MAX_BINS {
        return Some(format!("{}×{} bins; give 1 to {MAX_BINS} in all", request.bins[0], request.bins[1]));
    }
    if request.particles == 0 || request.particles > MAX_PARTICLES {
        return Some(format!("{} particles; give 1 to {MAX_PARTICLES}", request.particles));
    }
    let [h, v] = request.window;
    let within = |angle: f64, most: f64| angle > 0.0 && angle <= most * (1.0 + 1e-12);
    if !(within(h, PI) && within(v, FRAC_PI_2)) {
        return Some(format!("the window reaches {h} and {v} rad from the axis; give up to π and π/2"));
    }
    (request.max_edges == 0).then(|| "particles that meet no surface at all; give at least 1 edge".into())
}

/// What a strand of particles has found.
struct Strand {
    /// Luminance of the flux by bin, W.
    bins: Vec<f64>,
    flux: FluxBalance,
    rays: u64,
}

/// A particle on its way.
struct Particle {
    sampler: Sampler,
    ray: Ray,
    flux: Vec3,
    edges: u32,
}

/// Measures the lights of `scene` through everything in it.
///
/// # Errors
/// [`BackendError::Request`] if the request is out of range or no light can be followed; [`BackendError::Cancelled`].
pub(crate) fn measure<Q: RayQuery + Sync + ?Sized>(
    query: &Q,
    scene: &ShadingScene,
    request: &PhotometryRequest,
    pool: &rayon::ThreadPool,
    progress: &Progress,
) -> Result<Photometry, BackendError> {
    if let Some(problem) = problem(request) {
        return Err(BackendError::Request(problem));
    }
    let count = request.bins[0] as usize * request.bins[1] as usize;
    let empty = || Strand { bins: vec![0.0; count], flux: FluxBalance::default(), rays: 0 };
    let strands: Vec<Mutex<Strand>> = (0..STRANDS).map(|_| Mutex::new(empty())).collect();
    let batches = request.particles.div_ceil(BATCH);
    progress.start(batches);
    work_through(pool, STRANDS, &|| progress.is_cancelled(), &|index| {
        let mut strand = strands[index].lock().unwrap_or_else(PoisonError::into_inner);
        let mut batch = index as u64;
        while batch < batches && !progress.is_cancelled() {
            let numbers = batch * BATCH..request.particles.min((batch + 1) * BATCH);
            follow(query, scene, request, numbers, &mut strand);
            progress.advance(1);
            batch += STRANDS as u64;
        }
    })?;
    if progress.is_cancelled() {
        return Err(BackendError::Cancelled);
    }
    let mut all = empty();
    for strand in strands {
        let strand = strand.into_inner().unwrap_or_else(PoisonError::into_inner);
        all.bins.iter_mut().zip(&strand.bins).for_each(|(sum, value)| *sum += value);
        all.flux.add(&strand.flux);
        all.rays += strand.rays;
    }
    if all.flux.emitted == DVec3::ZERO {
        let lights = "lights that stand in it: points, spots, profiles, projectors or surfaces that emit";
        return Err(BackendError::Request(format!("the scene has no light to measure; give it {lights}")));
    }
    let share = 1.0 / request.particles as f64;
    let columns = request.bins[0] as usize;
    let intensity = |(i, flux): (usize, &f64)| flux * share / solid_angle(request, (i / columns) as u32);
    Ok(Photometry {
        bins: request.bins,
        window: request.window,
        intensity: all.bins.iter().enumerate().map(intensity).collect(),
        flux: all.flux.scaled(share),
        particles: request.particles,
        rays: all.rays,
    })
}

/// Sends the particles of these numbers and follows them to their ends.
fn follow<Q: RayQuery + ?Sized>(
    query: &Q,
    scene: &ShadingScene,
    request: &PhotometryRequest,
    numbers: std::ops::Range<u64>,
    strand: &mut Strand,
) {
    let mut particles: Vec<Particle> =
        numbers.filter_map(|number| launch(scene, request, number as u32, &mut strand.flux)).collect();
    let mut hits = Vec::new();
    while !particles.is_empty() {
        let rays: Vec<Ray> = particles.iter().map(|particle| particle.ray).collect();
        hits.clear();
        hits.resize(rays.len(), Hit::MISS);
        query.intersect(&rays, &mut hits);
        strand.rays += rays.len() as u64;
        let arrive = |(particle, hit): (Particle, &Hit)| {
            if hit.is_hit() {
                return scatter(scene, request, particle, hit, &mut strand.flux);
            }
            strand.flux.left += particle.flux.as_dvec3();
            if let Some(bin) = bin(request, particle.ray.direction) {
                strand.bins[bin] += f64::from(luminance(particle.flux));
            }
            None
        };
        particles = particles.into_iter().zip(&hits).filter_map(arrive).collect();
    }
}

/// A particle that leaves its light.
fn launch(
    scene: &ShadingScene,
    request: &PhotometryRequest,
    number: u32,
    flux: &mut FluxBalance,
) -> Option<Particle> {
    let sampler = Sampler::along(number, request.seed ^ SEED);
    let [choice, place, u, v] = sampler.set(0);
    let [direction_u, direction_v, ..] = sampler.set(1);
    let (emitter, probability, _) = scene.lights().choose(choice)?;
    let points = [place, u, v, direction_u, direction_v];
    let (source, ray) = scene.emit((emitter, probability), points)?;
    let ray = ray.filter(|ray| ray.flux.is_finite())?;
    let far = match &source {
        Source::Distant { .. } => true,
        Source::Light { light, .. } => matches!(light.kind(), LightKind::Directional { .. }),
        Source::Patch { .. } => false,
    };
    if far {
        flux.from_afar += ray.flux.as_dvec3();
        return None;
    }
    flux.emitted += ray.flux.as_dvec3();
    Some(Particle { sampler, ray: Ray::new(ray.origin, ray.direction), flux: ray.flux, edges: 0 })
}

/// What becomes of a particle at a surface.
fn scatter(
    scene: &ShadingScene,
    request: &PhotometryRequest,
    mut particle: Particle,
    hit: &Hit,
    flux: &mut FluxBalance,
) -> Option<Particle> {
    let surface = scene.surface(hit, &particle.ray, Cone::default());
    let arrived = particle.flux;
    particle.flux *= (-Vec3::from(surface.absorption) * hit.t).exp();
    flux.absorbed += (arrived - particle.flux).as_dvec3();
    particle.edges += 1;
    if particle.edges > request.max_edges {
        flux.given_up += particle.flux.as_dvec3();
        return None;
    }
    let [u_lobe, u_end, u, v] = particle.sampler.set(particle.edges + 1);
    // One number decides on passing straight through and, stretched, on the end of the path.
    let pass = surface.through.largest().min(1.0);
    let before = particle.flux;
    if u_end < pass {
        particle.flux *= Vec3::from(surface.through) / pass;
        particle.ray.origin = surface.spawn(particle.ray.direction.into()).into();
        flux.absorbed += (before - particle.flux).as_dvec3();
        return Some(particle);
    }
    let u_end = (u_end - pass) / (1.0 - pass);
    let sample = surface.bsdf.sample(u_lobe, [u, v], Selection::ALL);
    let mut weight = if sample.valid { Vec3::from(sample.weight) } else { Vec3::ZERO };
    if sample.valid && sample.transmitted {
        // Flux is not squeezed by refraction as radiance is.
        weight *= surface.bsdf.transmitted_eta().powi(2);
    }
    particle.flux *= surface.coverage / (1.0 - pass) * weight;
    if !(particle.flux.is_finite() && particle.flux != Vec3::ZERO) {
        flux.absorbed += before.as_dvec3();
        return None;
    }
    flux.absorbed += (before - particle.flux).as_dvec3();
    if particle.edges >= ROULETTE_FROM {
        // What roulette takes from one particle it gives to others: it is no absorption.
        let survival = luminance(weight).clamp(0.05, 1.0);
        if u_end >= survival {
            return None;
        }
        particle.flux /= survival;
    }
    particle.ray = Ray::new(surface.spawn(sample.wi).into(), sample.wi.into());
    Some(particle)
}

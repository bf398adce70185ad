//! A handful of points that the camera sees: what lights them matters.

use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, Ray, RayQuery, Tile};
use heliostat_shading::color::luminance;
use heliostat_shading::lanes::{Floats, WIDTH};
use heliostat_shading::sampling::cosine_hemisphere;
use heliostat_shading::{Basis, Cone, Receivers, Sampler, Source, Surface};

use crate::eye::{DULL, MIRRORS};
use crate::region::View;

/// Rays from the camera.
const RAYS: usize = 128;
/// Surfaces that a ray from the camera may pass or be sent on by.
const MAX_EDGES: u32 = 8;
/// Points of less weight are not worth asking for.
const LEAST_WEIGHT: f32 = 1.0 / 64.0;
/// Keeps the numbers of these rays apart from those of light paths.
const SEED: u32 = 0x7369_6768;
/// Shadow rays end this share of the way before the point.
const REACH: f32 = 1.0 - 1e-4;

/// A point that the camera sees.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Off the surface, world space.
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    /// What the camera sees of light there: the reflectance, and what mirrors on the way have left.
    pub(super) weight: f32,
}

impl Seen {
    fn at(surface: &Surface<f32>, weight: f32) -> Self {
        let position = Vec3::from(surface.position) + Vec3::from(surface.ng()) * surface.error;
        Self { position, normal: surface.bsdf.normal().into(), weight }
    }
}

/// Points all over the picture.
#[derive(Debug, Default)]
pub(super) struct Sight {
    points: Vec<Seen>,
    /// Rays traced.
    pub(super) traced: u64,
}

/// Scratch space for asking which points a source lights.
#[derive(Debug)]
pub(super) struct Asking {
    tile: Tile,
    /// Which of them a source would light if nothing stood between, and how.
    lit: Vec<(usize, f32)>,
    irradiance: Floats,
    rays: Vec<Ray>,
    occluded: Vec<bool>,
    filtered: Vec<bool>,
}

impl Default for Asking {
    fn default() -> Self {
        Self {
            tile: Tile::new(Vec3::ZERO),
            lit: Vec::new(),
            irradiance: Floats::default(),
            rays: Vec::new(),
            occluded: Vec::new(),
            filtered: Vec::new(),
        }
    }
}

struct EyeRay {
    sampler: Sampler,
    ray: Ray,
    weight: f32,
    edges: u32,
}

impl Sight {
    /// What some rays from the camera see: the first surfaces that are not mirrors, at most as many as a tile holds.
    pub(super) fn new<Q: RayQuery + ?Sized>(view: &View<'_, Q>, seed: u32) -> Self {
        let size = view.camera.size();
        let start = |index: usize| {
            let sampler = Sampler::along(index as u32, seed ^ SEED);
            let [x, y, u, v] = sampler.set(0);
            let camera = view.camera.ray(size * Vec2::new(x, y), Vec2::new(u, v), 0.0);
            EyeRay { sampler, ray: Ray::new(camera.origin, camera.direction), weight: 1.0, edges: 0 }
        };
        let mut eyes: Vec<EyeRay> = (0..RAYS).map(start).collect();
        let mut sight = Self::default();
        let mut hits = Vec::new();
        while !eyes.is_empty() {
            let rays: Vec<Ray> = eyes.iter().map(|eye| eye.ray).collect();
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            view.query.intersect(&rays, &mut hits);
            sight.traced += rays.len() as u64;
            let arrived = eyes.into_iter().zip(&hits).filter(|(_, hit)| hit.is_hit());
            eyes = arrived.filter_map(|(eye, hit)| sight.arrive(view, eye, hit)).collect();
        }
        sight
    }

    /// Notes the surface that a ray met and sends it on where the surface lets it pass or mirrors it.
    fn arrive<Q: ?Sized>(&mut self, view: &View<'_, Q>, mut eye: EyeRay, hit: &Hit) -> Option<EyeRay> {
        let surface: Surface<f32> = view.scene.surface(hit, &eye.ray, Cone::default());
        eye.edges += 1;
        let [u_lobe, u_pass, u, v] = eye.sampler.set(eye.edges);
        let pass = surface.through.largest().min(1.0);
        if u_pass < pass {
            eye.ray.origin = surface.spawn(eye.ray.direction.into()).into();
            return (eye.edges < MAX_EDGES).then_some(eye);
        }
        let dull = luminance(surface.bsdf.albedo_of(DULL).into());
        if dull > 0.0 && self.points.len() < Tile::CAPACITY {
            self.points.push(Seen::at(&surface, eye.weight * dull));
        }
        let sample = surface.bsdf.sample(u_lobe, [u, v], MIRRORS);
        if !sample.valid || eye.edges >= MAX_EDGES {
            return None;
        }
        eye.weight *= luminance(sample.weight.into());
        eye.ray = Ray::new(surface.spawn(sample.wi).into(), sample.wi.into());
        (eye.weight > LEAST_WEIGHT).then_some(eye)
    }

    /// The points.
    pub(super) fn points(&self) -> &[Seen] {
        &self.points
    }

    /// The points in packets.
    pub(super) fn receivers<Q: ?Sized>(&self, view: &View<'_, Q>) -> Vec<Receivers> {
        let points = |points: &[Seen]| {
            Receivers::new(view.scene.lane_mode(), points.iter().map(|point| (point.position, point.normal)))
        };
        self.points.chunks(WIDTH).map(points).collect()
    }

    /// Keeps at most so many points, as well distributed as all.
    pub(super) fn keep(&mut self, count: usize) {
        self.points.truncate(count);
    }

    /// What is seen from the points in turn, in a direction each.
    pub(super) fn behind<Q: RayQuery + ?Sized>(&mut self, view: &View<'_, Q>, seed: u32) -> Vec<Seen> {
        let ray = |(index, point): (u32, &Seen)| {
            let [u, v, ..] = Sampler::along(index, seed ^ SEED).set(MAX_EDGES + 1);
            let up = cosine_hemisphere([u, v]);
            Ray::new(point.position, Basis::from_normal(point.normal.into()).to_world(up).into())
        };
        let rays: Vec<Ray> = (0..).zip(&self.points).map(ray).collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        view.query.intersect(&rays, &mut hits);
        self.traced += rays.len() as u64;
        let seen = |((ray, hit), from): ((&Ray, &Hit), &Seen)| {
            let surface = view.scene.surface(hit, ray, Cone::default());
            let albedo = luminance(surface.bsdf.albedo_of(DULL).into());
            (albedo > 0.0).then(|| Seen::at(&surface, from.weight * albedo))
        };
        let arrived = rays.iter().zip(&hits).zip(&self.points).filter(|((_, hit), _)| hit.is_hit());
        arrived.filter_map(seen).collect()
    }
}

impl Asking {
    /// Luminance of the irradiance that a source causes at every point that it reaches: `deliver` is called with both.
    /// Returns the number of rays. `points` fit into a tile; `receivers` are the same.
    pub(super) fn light<Q: RayQuery + ?Sized>(
        &mut self,
        view: &View<'_, Q>,
        (points, receivers): (&[Seen], &[Receivers]),
        source: &Source,
        mut deliver: impl FnMut(usize, f32),
    ) -> u64 {
        self.lit.clear();
        self.rays.clear();
        let origin = source.origin();
        self.tile.restart(origin.unwrap_or_default());
        for (block, receivers) in receivers.iter().enumerate() {
            receivers.irradiance(source, &mut self.irradiance);
            let start = block * WIDTH;
            for (index, (point, &irradiance)) in (start..).zip(points[start..].iter().zip(&self.irradiance.0))
            {
                if irradiance.is_nan() || irradiance <= 0.0 {
                    continue;
                }
                match origin {
                    Some(origin) => _ = self.tile.push(point.position - origin, REACH),
                    None => self.rays.push(Ray::new(point.position, source.light(point.position).wi)),
                }
                self.lit.push((index, irradiance));
            }
        }
        let Self { lit, occluded, filtered, tile, rays, .. } = self;
        if lit.is_empty() {
            return 0;
        }
        for flags in [&mut *occluded, &mut *filtered] {
            flags.clear();
            flags.resize(lit.len(), false);
        }
        // What lets some light pass counts as if it let all pass.
        match (view.scene.has_see_through(), origin.is_some()) {
            (false, true) => view.query.occluded_tile(tile, occluded),
            (false, false) => view.query.occluded(rays, occluded),
            (true, true) => view.query.occluded_tile_through(tile, view.scene, occluded, filtered),
            (true, false) => view.query.occluded_through(rays, view.scene, occluded, filtered),
        }
        let open = lit.iter().zip(occluded).filter(|(_, occluded)| !**occluded);
        open.for_each(|(&(index, irradiance), _)| deliver(index, irradiance));
        lit.len() as u64
    }
}

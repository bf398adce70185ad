//! Photons: light that mirrors and glass throw on other surfaces, which virtual point lights cannot reach.
//!
//! Every photon leaves a virtual point light (a light source or a lit surface) towards a reflector, is sent on by sharp
//! lobes alone and is left on every dull surface that it meets. What such a surface receives from dull ones is counted
//! by shadow rays, what it receives by sharp lobes by photons: no light is counted twice.
//!
//! # References
//! Jensen, "Global Illumination using Photon Maps", 1996 (caustic photons, sent towards specular objects). Wald, Kollig,
//! Benthin, Keller, Slusallek, "Interactive Global Illumination using Fast Ray Tracing", 2002, §5.3.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_shading::color::luminance;
use heliostat_shading::sampling::concentric_disk;
use heliostat_shading::{Reflector, Sampler, Source, Surface};
use rayon::prelude::*;

use super::launch::{Launch, Launches};
use super::vpl::{Vpl, VplSets};
use crate::eye::{DULL, MIRROR_ALPHA, MIRRORS};
use crate::region::View;
use crate::wave::WaveShader;

/// Surfaces that a photon may pass straight through or be sent on by.
const MAX_EDGES: u32 = 16;
/// Photons that a thread takes at a time.
const CHUNK: u32 = 1024;
/// Keeps the numbers of photons apart from those of light paths.
const SEED: u32 = 0x7068_6f74;

/// Light that has arrived at a dull surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Photon {
    /// World space.
    pub(super) position: Vec3,
    /// Unit geometric normal, on the side that it arrived at.
    pub(super) normal: Vec3,
    /// Unit vector towards where it came from.
    pub(super) wi: Vec3,
    /// W.
    pub(super) flux: Vec3,
    /// Edges of its path from the light.
    pub(super) edges: u32,
}

/// How photons are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct PhotonPlan {
    /// Photons of each pass.
    pub(super) count: u32,
    pub(super) pass: u32,
    pub(super) seed: u32,
    /// Edges that a path may have before the surface that it is left on.
    pub(super) max_edges: u32,
}

/// A photon on its way.
#[derive(Clone)]
struct Flight {
    sampler: Sampler,
    ray: Ray,
    /// What it carries; per steradian times distance² until the first hit, where `source` says more.
    flux: Vec3,
    edges: u32,
    steps: u32,
    /// What it was sent to, until it is there, and where from.
    aim: Option<(Reflector, u32)>,
}

/// Sends photons from `vpls`, on all threads of the pool at hand; the second result is the number of rays.
pub(super) fn trace<Q: RayQuery + ?Sized>(
    view: &View<'_, Q>,
    vpls: &VplSets,
    plan: &PhotonPlan,
) -> (Vec<Photon>, u64) {
    if plan.count == 0 {
        return (Vec::new(), 0);
    }
    let sources: Vec<&Vpl> = vpls.candidates.iter().filter(|vpl| vpl.source.has_flux()).collect();
    let mut reflectors = view.scene.reflectors(MIRROR_ALPHA.sqrt());
    let Some(launches) = Launches::new(sources, &mut reflectors) else { return (Vec::new(), 0) };
    let extent = view.query.bounds().size().length();
    let share = 1.0 / (plan.count as f32 * vpls.sets.len() as f32);
    let launch = |i: u32| {
        let sampler = Sampler::along(plan.pass.wrapping_mul(plan.count).wrapping_add(i), plan.seed ^ SEED);
        let [u_source, u_reflector, u, v] = sampler.set(0);
        let Launch { source: index, reflector, probability } = launches.choose(u_source, u_reflector)?;
        let vpl = launches.source(index);
        let (ray, factor) = aimed(&vpl.source, reflector, Vec2::new(u, v), extent)?;
        let flux = Vec3::splat(factor * share / probability);
        Some(Flight { sampler, ray, flux, edges: vpl.bounces, steps: 0, aim: Some((*reflector, index)) })
    };
    let fly = |chunk: u32| {
        let end = plan.count.min((chunk + 1) * CHUNK);
        let mut flights: Vec<Flight> = (chunk * CHUNK..end).filter_map(launch).collect();
        let (mut photons, mut hits, mut rays_traced) = (Vec::new(), Vec::new(), 0);
        let mut shader = WaveShader::default();
        while !flights.is_empty() {
            let rays: Vec<Ray> = flights.iter().map(|flight| flight.ray).collect();
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            view.query.intersect(&rays, &mut hits);
            rays_traced += rays.len() as u64;
            let mut sent_on = Vec::new();
            shader.shade(view.scene, (&rays, &hits), |indices, surfaces| {
                for (lane, &index) in indices.iter().enumerate() {
                    let (flight, hit) = (flights[index as usize].clone(), &hits[index as usize]);
                    sent_on.extend(land(plan, &launches, flight, (hit, &surfaces.lane(lane)), &mut photons));
                }
            });
            flights = sent_on;
        }
        (photons, rays_traced)
    };
    let chunks: Vec<_> = (0..plan.count.div_ceil(CHUNK)).into_par_iter().map(fly).collect();
    let rays_traced = chunks.iter().map(|(_, rays)| rays).sum();
    (chunks.into_iter().flat_map(|(photons, _)| photons).collect(), rays_traced)
}

/// A ray from a source into the sphere around a reflector, and what radiant intensity (or, for light from afar,
/// irradiance) is to be multiplied with for its flux.
fn aimed(source: &Source, reflector: &Reflector, u: Vec2, extent: f32) -> Option<(Ray, f32)> {
    let Some(origin) = source.origin() else {
        let wi = source.light(reflector.center).wi;
        let (x, y) = wi.any_orthonormal_pair();
        let disk = reflector.radius * concentric_disk(u);
        let origin = reflector.center + x * disk.x + y * disk.y + wi * extent;
        return Some((Ray::new(origin, -wi), PI * reflector.radius * reflector.radius));
    };
    let to_center = reflector.center - origin;
    let distance = to_center.length();
    // 1 − cos of the half angle that the sphere fills, without cancellation where it is far; everything from inside.
    let sin = reflector.radius / distance;
    let cap = if sin < 1.0 { sin * sin / (1.0 + (1.0 - sin * sin).sqrt()) } else { 2.0 };
    let axis = if sin < 1.0 { to_center / distance } else { Vec3::Y };
    let z = 1.0 - cap * u.x;
    let ring = (1.0 - z * z).max(0.0).sqrt() * Vec2::from_angle(TAU * u.y);
    let (x, y) = axis.any_orthonormal_pair();
    let direction = (axis * z + x * ring.x + y * ring.y).try_normalize()?;
    Some((Ray::new(origin, direction), TAU * cap))
}

/// A photon at the end of its ray: it is left there if the surface is dull, and sent on if it is sharp.
fn land(
    plan: &PhotonPlan,
    launches: &Launches<'_>,
    mut flight: Flight,
    (hit, surface): (&Hit, &Surface<f32>),
    photons: &mut Vec<Photon>,
) -> Option<Flight> {
    flight.flux *= (-Vec3::from(surface.absorption) * hit.t).exp();
    flight.steps += 1;
    let [u_lobe, u_end, u, v] = flight.sampler.set(flight.steps);
    let pass = surface.through.largest().min(1.0);
    // One number decides on passing and, stretched, on the end of the path.
    if u_end < pass {
        flight.flux *= Vec3::from(surface.through) / pass;
        flight.ray.origin = surface.spawn(flight.ray.direction.into()).into();
        return (flight.steps < MAX_EDGES).then_some(flight);
    }
    let u_end = (u_end - pass) / (1.0 - pass);
    flight.flux *= surface.coverage / (1.0 - pass);
    match flight.aim.take() {
        Some((reflector, source)) => {
            let there = hit.path.0 as u32 == reflector.placement && hit.geometry == reflector.part;
            flight.flux *= emitted(&launches.source(source).source, surface.position.into());
            if !there {
                return None;
            }
        }
        None => leave(surface, &flight, photons),
    }
    flight.edges += 1;
    if flight.edges >= plan.max_edges || flight.steps >= MAX_EDGES {
        return None;
    }
    let sample = surface.bsdf.sample_onward(u_lobe, [u, v], MIRRORS);
    if !sample.valid {
        return None;
    }
    let weight = Vec3::from(sample.weight);
    let survival = luminance(weight).clamp(0.02, 1.0);
    if u_end >= survival {
        return None;
    }
    flight.flux *= weight / survival;
    flight.ray = Ray::new(surface.spawn(sample.wi).into(), sample.wi.into());
    (flight.flux.is_finite() && flight.flux != Vec3::ZERO).then_some(flight)
}

/// Radiant intensity of a source towards a point, or its irradiance if it is far away.
fn emitted(source: &Source, at: Vec3) -> Vec3 {
    let light = source.light(at);
    let distance2 = source.origin().map_or(1.0, |origin| origin.distance_squared(at));
    light.radiance * (light.facing * distance2)
}

fn leave(surface: &Surface<f32>, flight: &Flight, photons: &mut Vec<Photon>) {
    let dull = Vec3::from(surface.bsdf.albedo_of(DULL));
    if dull != Vec3::ZERO && flight.flux.is_finite() {
        photons.push(Photon {
            position: surface.position.into(),
            normal: surface.ng().into(),
            wi: -flight.ray.direction,
            flux: flight.flux,
            edges: flight.edges + 1,
        });
    }
}

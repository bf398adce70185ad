//! Lighting of whole tiles of points by the virtual point lights of their set.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;
use heliostat_kernel::{Hit, Ray, RayQuery, Tile};
use heliostat_shading::color::luminance;
use heliostat_shading::lanes::{Vectors, WIDTH, Whole};
use heliostat_shading::microfacet::SMOOTH_ALPHA;
use heliostat_shading::{Lobes, Received, Scattering, Selection, Surfaces, Taking};

use super::importance;
use super::paths::scaled;
use super::photon_map::{Caught, PhotonMap};
use super::residual::{GLOSS, Residual};
use super::vpl::{Vpl, VplSets};
use super::{CLEAR_ALPHA, Gathered};
use crate::eye::{Arrived, DULL, Lighting, MIRROR_ALPHA, MIRRORS, WeightedRay};
use crate::mis::Visits;
use crate::region::{PixelSum, View};
use crate::shadow::{PendingLight, ShadowBatch};

/// Times what the eye sees of some points, the share of a set of virtual point lights that lights them.
const FULL: f32 = 2.0;
/// Share of the mean importance that every virtual point light of a set has besides its own.
const SOME_FLOOR: f32 = 0.1;
/// The lobes whose light neighbours share.
const SHARED: Selection = Selection::above(CLEAR_ALPHA);
/// Sharp lobes that light from a few points of a lamp may fall into.
const GLOSSY: Selection = Selection::between(SMOOTH_ALPHA, MIRROR_ALPHA);
/// Light along a surface is as if it came at this cosine: rough lobes reflect none of it.
const LEAST_COSINE: f32 = 1e-3;
/// Shadow rays end this share of the way before the point: it lies on a surface.
const REACH: f32 = 1.0 - 1e-4;

/// Points that wait for the end of their group.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub(super) surfaces: Surfaces,
    pub(super) count: usize,
    pixels: [u32; WIDTH],
    /// What the eye sees of the point; zero for lanes without one.
    pub(super) weights: [Vec3; WIDTH],
    pub(super) edges: [u32; WIDTH],
    /// Of the lobes that virtual point lights light.
    /// Of the lobes whose light neighbours share.
    shared_albedo: Vectors,
    /// Largest GGX α on the way from the eye.
    alphas: [f32; WIDTH],
    /// Sample point for the light that bounds take away, the same for all lanes.
    pub(super) point: [f32; 4],
    pub(super) irradiance: Vectors,
    pub(super) gloss: Vectors,
    /// Share of the virtual point lights that light it, and of the lanes that short rays and photons light.
    pub(super) share: f32,
    /// Whether it has sharp lobes alone.
    mirrors: bool,
    /// Lanes with a weight.
    alive: u16,
    /// Most edges of any lane.
    most_edges: u32,
}

/// A block with the light that some of its lanes receive unless something stands in the way.
#[derive(Clone, Debug, Default)]
struct Pending {
    block: usize,
    /// A bit for each of these lanes.
    lanes: u16,
    received: Received,
}

/// A ray among those asked about, and the lane of a pending block that it is for.
#[derive(Clone, Copy, Debug)]
struct Asked {
    pending: u16,
    lane: u16,
}

/// Lights groups of pixels, each by a set of virtual point lights.
pub(super) struct ByVpls<'a> {
    vpls: &'a VplSets,
    photons: &'a PhotonMap,
    groups: &'a [u8],
    /// Which sample of each pixel is at hand: says which part of its set lights it.
    sample: u32,
    /// Edges of whole paths.
    max_edges: u32,
    /// What the pixels of the region have received by this sample.
    gathered: Vec<Gathered>,
    traced: u64,
    blocks: Vec<Block>,
    used: usize,
    tile: Tile,
    /// Blocks that light from the source at hand may reach; only the first ones are in use.
    pending: Vec<Pending>,
    waiting: usize,
    /// Rays that met nothing but what lets some light pass.
    asked: Vec<Asked>,
    occluded: Vec<bool>,
    /// Not occluded, but by what lets some light pass.
    filtered: Vec<bool>,
    /// The rays of the tile that are.
    filtered_tile: Tile,
    rays: Vec<Ray>,
    hits: Vec<Hit>,
    shadows: ShadowBatch,
    compensate: bool,
    residual: Residual,
    caught: CaughtLight,
    scattering: Scattering,
}

/// What photons bring to lobes other than the diffuse one, each from a direction.
#[derive(Debug, Default)]
struct CaughtLight {
    wi: Vectors,
    /// Flux per area that faces it, W/m².
    irradiance: Vectors,
}

impl<'a> ByVpls<'a> {
    /// `groups` says which set lights each pixel.
    pub(super) fn new(
        groups: &'a [u8],
        (vpls, photons): (&'a VplSets, &'a PhotonMap),
        max_edges: u32,
        compensate: bool,
    ) -> Self {
        Self {
            vpls,
            photons,
            groups,
            sample: 0,
            max_edges,
            gathered: vec![Gathered::default(); groups.len()],
            traced: 0,
            blocks: Vec::new(),
            used: 0,
            tile: Tile::new(Vec3::ZERO),
            pending: Vec::new(),
            waiting: 0,
            asked: Vec::new(),
            occluded: Vec::new(),
            filtered: Vec::new(),
            filtered_tile: Tile::new(Vec3::ZERO),
            rays: Vec::new(),
            hits: Vec::new(),
            shadows: ShadowBatch::default(),
            compensate,
            residual: Residual::default(),
            caught: CaughtLight::default(),
            scattering: Scattering::default(),
        }
    }

    /// Goes on to the next sample of all pixels. Returns what they have received by the last one.
    pub(super) fn go_on(&mut self) -> &mut Vec<Gathered> {
        self.sample += 1;
        &mut self.gathered
    }

    /// Rays traced for light so far.
    pub(super) fn traced(&self) -> u64 {
        self.traced + self.shadows.traced() + self.residual.shadow_rays()
    }

    /// Light from one source for the blocks from `start` to `end`, which have at most a tile's worth of lanes.
    fn light<Q: RayQuery + ?Sized>(
        &mut self,
        view: &View<'_, Q>,
        (vpl, bound): (&Vpl, f32),
        (start, end): (usize, usize),
    ) {
        let origin = vpl.source.origin();
        self.tile.restart(origin.unwrap_or_default());
        self.rays.clear();
        self.waiting = 0;
        // Light straight from its source is left as it is: there are many samples of it, and short rays that find a lamp by
        // chance are noise.
        let bound = if vpl.bounces == 0 { f32::INFINITY } else { bound };
        let taking = Taking { bound, gloss: DULL, shared: MIRRORS };
        for index in start..end {
            let block = &self.blocks[index];
            let short = block.short_enough(self.max_edges.saturating_sub(vpl.bounces));
            // What is lit is seen in mirrors by their rays alone.
            if short == 0 || (block.mirrors && vpl.bounces > 0) {
                continue;
            }
            if self.waiting == self.pending.len() {
                self.pending.push(Pending::default());
            }
            let pending = &mut self.pending[self.waiting];
            block.surfaces.receive(&vpl.source, &taking, block.count, &mut pending.received);
            let received = &pending.received;
            let lit = if block.mirrors { received.glossy(block.count) } else { received.lit(block.count) };
            (pending.block, pending.lanes) = (index, short & lit);
            if pending.lanes == 0 {
                continue;
            }
            self.waiting += 1;
            match origin {
                Some(_) => push(&mut self.tile, &pending.received.way, pending.lanes),
                None => self.rays.extend(lanes(pending.lanes).map(|lane| {
                    let wi = pending.received.wi.get(lane);
                    Ray::new(block.surfaces.origin(lane, wi), wi)
                })),
            }
        }
        if self.waiting > 0 {
            self.ask(view, origin.is_some());
        }
    }

    /// Traces the shadow rays of all pending blocks and adds what arrives.
    fn ask<Q: RayQuery + ?Sized>(&mut self, view: &View<'_, Q>, from_origin: bool) {
        let Self { tile, rays, pending, occluded, filtered, blocks, asked, .. } = self;
        let count = if from_origin { tile.len() } else { rays.len() };
        self.traced += count as u64;
        for flags in [&mut *occluded, &mut *filtered] {
            flags.clear();
            flags.resize(count, false);
        }
        match (view.scene.has_see_through(), from_origin) {
            (false, true) => view.query.occluded_tile(tile, occluded),
            (false, false) => view.query.occluded(rays, occluded),
            (true, true) => view.query.occluded_tile_through(tile, view.scene, occluded, filtered),
            (true, false) => view.query.occluded_through(rays, view.scene, occluded, filtered),
        }
        asked.clear();
        let mut flags = occluded.iter().zip(&*filtered);
        for (index, pending) in (0..).zip(&mut pending[..self.waiting]) {
            let mut arrived = pending.lanes;
            for lane in lanes(pending.lanes) {
                let (occluded, filtered) = flags.next().unwrap_or((&true, &false));
                arrived &= !(u16::from(*occluded | *filtered) << lane);
                if *filtered {
                    asked.push(Asked { pending: index, lane: lane as u16 });
                }
            }
            let block = &mut blocks[pending.block];
            block.irradiance.add_lanes(&pending.received.irradiance, arrived);
            block.gloss.add_lanes(&pending.received.gloss, arrived);
        }
        if !asked.is_empty() {
            self.ask_through(view, from_origin);
        }
    }

    /// Follows the few rays that nothing stops but surfaces that let some light pass.
    fn ask_through<Q: RayQuery + ?Sized>(&mut self, view: &View<'_, Q>, from_origin: bool) {
        if from_origin {
            self.filtered_tile.restart(self.tile.origin());
            let ways = (0..self.tile.len()).filter(|&i| self.filtered[i]).filter_map(|i| self.tile.ray(i));
            ways.for_each(|ray| _ = self.filtered_tile.push(ray.direction, ray.t_max));
        } else {
            let mut filtered = self.filtered.iter();
            self.rays.retain(|_| filtered.next() == Some(&true));
        }
        self.traced += self.asked.len() as u64;
        self.hits.clear();
        self.hits.resize(self.asked.len(), Hit::MISS);
        match from_origin {
            true => view.query.intersect_tile(&self.filtered_tile, &mut self.hits),
            false => view.query.intersect(&self.rays, &mut self.hits),
        }
        for (i, (asked, hit)) in self.asked.iter().zip(&self.hits).enumerate() {
            if !hit.is_hit() {
                asked.add(&self.pending, &mut self.blocks, Vec3::ONE);
                continue;
            }
            let ray = if from_origin { self.filtered_tile.ray(i) } else { Some(self.rays[i]) };
            let Some(ray) = ray else { continue };
            // Shading asks for unit directions.
            let length = ray.direction.length();
            let unit = Ray { direction: ray.direction / length, t_max: ray.t_max * length, ..ray };
            let unit_hit = Hit { t: hit.t * length, ..*hit };
            if let Some((radiance, origin)) = view.scene.see_through(&unit_hit, &unit) {
                let rest = Ray { origin, t_max: unit.t_max - unit_hit.t, ..unit };
                self.shadows.push(rest, PendingLight { pixel: i as u32, radiance });
            }
        }
        let (blocks, pending, asked) = (&mut self.blocks, &self.pending, &self.asked);
        self.shadows.trace(view.query, view.scene, |light| {
            asked[light.pixel as usize].add(pending, blocks, light.radiance);
        });
    }

    /// Adds the light that photons have brought to a block's lanes: to one sample of each pixel, another one in each.
    fn catch(&mut self, index: usize) {
        let Self { blocks, caught, scattering, .. } = self;
        let (block, parts) = (&mut blocks[index], self.vpls.parts());
        if block.mirrors {
            return;
        }
        let mut any = false;
        caught.irradiance = Vectors::default();
        for lane in lanes(block.alive) {
            let turn = block.pixels[lane].hashed() ^ self.sample;
            if !block.takes(lane) || turn & (parts - 1) != 0 {
                continue;
            }
            let (position, normal) = (block.surfaces.position(lane), block.surfaces.normal(lane));
            let max_edges = self.max_edges.saturating_sub(block.edges[lane]);
            // Neighbours of a set take numbers of their own, which change from pass to pass.
            let u = block.pixels[lane].hashed() as f32 / u32::MAX as f32 + block.point[3];
            let Caught { irradiance, wi, from_there } =
                self.photons.caught(position, normal, max_edges, u.fract());
            if irradiance != Vec3::ZERO {
                let weight = parts as f32 / block.share;
                let radiance = irradiance * (FRAC_1_PI * weight);
                block.irradiance.set(lane, block.irradiance.get(lane) + radiance);
                // What of it lobes other than the diffuse one receive, along the normal.
                let cos = normal.dot(wi).max(LEAST_COSINE);
                caught.wi.set(lane, wi);
                caught.irradiance.set(lane, from_there * (weight / cos));
                any = true;
            }
        }
        if !any || !block.surfaces.may_have(GLOSS) {
            return;
        }
        block.surfaces.evaluate(&caught.wi, GLOSS, block.count, scattering);
        for lane in lanes(block.alive) {
            let gloss = scattering.f_cos.get(lane) * caught.irradiance.get(lane);
            block.gloss.set(lane, block.gloss.get(lane) + gloss);
        }
    }

    /// Hands the light of a block's lanes to their pixels.
    fn deliver(&mut self, index: usize) {
        let block = &self.blocks[index];
        for lane in 0..block.count {
            let weight = block.weights[lane];
            if weight == Vec3::ZERO {
                continue;
            }
            let surfaces = &block.surfaces;
            let albedo = weight * surfaces.diffuse(lane);
            let point = Gathered {
                irradiance: block.irradiance.get(lane),
                albedo,
                gloss: weight * block.gloss.get(lane),
                position: surfaces.position(lane),
                normal: surfaces.normal(lane),
                // Mirrors stand for themselves only where nothing else is seen in them.
                strength: luminance(weight * (block.shared_albedo.get(lane) + 1e-4 * surfaces.albedo(lane))),
                coverage: 1.0,
                straight: block.edges[lane] == 1,
                ..Gathered::default()
            };
            self.gathered[block.pixels[lane] as usize].arrive(block.alphas[lane], point);
        }
    }
}

impl Block {
    /// Whether a lane is among the share of them that short rays and photons light.
    pub(super) fn takes(&self, lane: usize) -> bool {
        let chance = (self.pixels[lane].hashed() >> 8) as f32 * (1.0 / (1 << 24) as f32);
        self.share == 1.0 || chance < self.share
    }

    /// The lanes whose paths may have `max_edges` edges before the last one, as a bit each.
    fn short_enough(&self, max_edges: u32) -> u16 {
        if self.most_edges < max_edges {
            return self.alive;
        }
        lanes(self.alive).filter(|&lane| self.edges[lane] < max_edges).fold(0, |mask, lane| mask | 1 << lane)
    }
}

impl Asked {
    /// Adds the light that passes to the lane.
    fn add(&self, pending: &[Pending], blocks: &mut [Block], transmittance: Vec3) {
        let pending = &pending[usize::from(self.pending)];
        let (block, lane) = (&mut blocks[pending.block], usize::from(self.lane));
        let (irradiance, gloss) = (pending.received.irradiance.get(lane), pending.received.gloss.get(lane));
        block.irradiance.set(lane, block.irradiance.get(lane) + irradiance * transmittance);
        block.gloss.set(lane, block.gloss.get(lane) + gloss * transmittance);
    }
}

/// Which share of a set of virtual point lights is enough for blocks that the eye sees as faintly as these.
fn share(blocks: &[Block]) -> f32 {
    let (mut sum, mut count) = (0.0, 0.0_f32);
    for block in blocks {
        for lane in lanes(block.alive) {
            sum += luminance(block.weights[lane]);
            count += 1.0;
        }
    }
    (FULL * sum / count.max(1.0)).min(1.0)
}

/// So many of some virtual point lights in the mean, chosen by what they would bring to a point of each block if nothing stood
/// between, and strengthened by the inverse of their chance.
fn some_of(vpls: &[Vpl], bound: f32, blocks: &[Block], budget: f32) -> Vec<Vpl> {
    let points = || {
        blocks.iter().filter(|block| block.alive != 0).map(|block| {
            let lane = block.alive.trailing_zeros() as usize;
            (block.surfaces.position(lane), block.surfaces.normal(lane), luminance(block.weights[lane]))
        })
    };
    let mut importance: Vec<f32> = vpls
        .iter()
        .map(|vpl| {
            points().map(|(position, normal, weight)| weight * vpl.irradiance(bound, position, normal)).sum()
        })
        .collect();
    let floor = SOME_FLOOR * importance.iter().sum::<f32>() / vpls.len().max(1) as f32;
    importance.iter_mut().for_each(|importance| *importance += floor);
    let scale = importance::scale(importance.clone(), budget);
    let chances: Vec<f32> = importance.iter().map(|importance| scale * importance).collect();
    let [.., shift] = blocks.first().map_or([0.0; 4], |block| block.point);
    let chosen = vpls.iter().zip(importance::comb(&chances, shift)).filter(|&(_, factor)| factor > 0.0);
    chosen.map(|(vpl, factor)| Vpl { source: scaled(vpl.source.clone(), factor), ..*vpl }).collect()
}

/// The lanes whose bits are set.
fn lanes(mut mask: u16) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < WIDTH).then_some(lane)
    })
}

/// Adds the ways of some lanes to a tile: side by side where they are the first ones, as in most blocks.
fn push(tile: &mut Tile, ways: &Vectors, mask: u16) {
    let count = mask.trailing_ones() as usize;
    if mask.checked_shr(count as u32).unwrap_or(0) == 0 {
        tile.push_run([&ways.x.0[..count], &ways.y.0[..count], &ways.z.0[..count]], REACH);
    } else {
        lanes(mask).for_each(|lane| _ = tile.push(ways.get(lane), REACH));
    }
}

impl<Q: RayQuery + ?Sized> Lighting<Q> for ByVpls<'_> {
    fn visits(&self) -> Visits<'_> {
        Visits::Often(&self.vpls.visits)
    }

    fn groups(&self) -> usize {
        self.vpls.sets.len()
    }

    fn group(&self, pixel: u32) -> usize {
        usize::from(self.groups[pixel as usize])
    }

    fn packet(
        &mut self,
        _: &View<'_, Q>,
        arrived: Arrived<'_>,
        surfaces: &Surfaces,
        _: &mut [PixelSum],
    ) -> bool {
        let mirrors = !surfaces.have(DULL, arrived.count());
        let glass = Selection::ALL.among(Lobes::GLASS_REFLECT);
        if mirrors && !surfaces.may_have(glass) && !surfaces.have(GLOSSY, arrived.count()) {
            return false;
        }
        if self.used == self.blocks.len() {
            self.blocks.push(Block::default());
        }
        let block = &mut self.blocks[self.used];
        self.used += 1;
        block.surfaces.clone_from(surfaces);
        (block.count, block.mirrors) = (arrived.count(), mirrors);
        block.surfaces.albedo_of(SHARED, block.count, &mut block.shared_albedo);
        for (lane, ray) in arrived.rays().enumerate() {
            (block.pixels[lane], block.weights[lane], block.edges[lane]) = (ray.pixel, ray.weight, ray.edges);
            block.alphas[lane] = ray.alpha;
        }
        let alive = arrived.rays().enumerate().filter(|(_, ray)| ray.weight != Vec3::ZERO);
        (block.alive, block.most_edges) =
            alive.fold((0, 0), |(alive, edges), (lane, ray)| (alive | 1 << lane, edges.max(ray.edges)));
        let group = usize::from(self.groups[arrived.ray(0).pixel as usize]);
        [block.point, ..] = self.vpls.points[self.vpls.part(group, self.sample)];
        (block.irradiance, block.gloss) = (Vectors::default(), Vectors::default());
        true
    }

    fn find(&mut self, ray: &WeightedRay, radiance: Vec3, _: &mut PixelSum) {
        self.gathered[ray.pixel as usize].find(ray, radiance);
    }

    fn finish(&mut self, view: &View<'_, Q>, group: usize, _: &mut [PixelSum]) {
        let vpls = self.vpls;
        let part = vpls.part(group, self.sample);
        const BLOCKS: usize = Tile::CAPACITY / WIDTH;
        for start in (0..self.used).step_by(BLOCKS) {
            let end = (start + BLOCKS).min(self.used);
            let share = share(&self.blocks[start..end]);
            self.blocks[start..end].iter_mut().for_each(|block| block.share = share);
            if share == 1.0 {
                for vpl in vpls.of_part(part) {
                    self.light(view, (vpl, vpls.bound), (start, end));
                }
            } else {
                let budget = vpls.budget(part, share);
                for vpl in some_of(vpls.of_part(part), vpls.bound, &self.blocks[start..end], budget) {
                    self.light(view, (&vpl, vpls.bound), (start, end));
                }
            }
        }
        if self.compensate {
            let blocks = &mut self.blocks[..self.used];
            let short = vpls.short_rays(part);
            let lights = (&vpls.sets[group][..], vpls.bound, self.max_edges);
            self.traced += self.residual.add(view, lights, short, &vpls.points[part], blocks);
        }
        for index in 0..self.used {
            self.catch(index);
            self.deliver(index);
        }
        self.used = 0;
    }
}

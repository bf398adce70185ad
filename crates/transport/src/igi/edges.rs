//! Pixels at edges take more samples of what they see. The light comes from neighbours that see the same surface: another
//! sample costs one ray from the camera and no shadow rays.
//!
//! # References
//! Bala, Walter, Greenberg, "Combining Edges and Points for Interactive High-Quality Rendering", 2003 (points take light from
//! their own side of an edge). Benthin, Wald, Slusallek, "A Scalable Approach to Interactive Global Illumination", 2003
//! (samples of a pixel share virtual point lights).

use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, Ray, RayQuery, Tile};
use heliostat_shading::{Arrival, HitSorter, Selection, ShadeScratch, Surfaces};

use super::discontinuity::{Light, PLANE_DISTANCE, is_alike};
use super::{CLEAR_ALPHA, Fragment, Gathered};
use crate::eye::{DULL, MIRRORS};
use crate::region::{Settings, View};

/// Places of the further samples within a pixel: a rotated grid.
const PLACES: [Vec2; 4] =
    [Vec2::new(0.375, 0.125), Vec2::new(0.875, 0.375), Vec2::new(0.625, 0.875), Vec2::new(0.125, 0.625)];
/// Radiance that differs by more than this share is an edge, where nothing else tells.
const CONTRAST: f32 = 0.1;

/// A picture whose pixels have gathered their light, filtered or not.
#[derive(Clone, Copy, Debug)]
pub struct Lit<'a> {
    /// What the pixels see, row by row.
    pub gathered: &'a [Gathered],
    /// What falls on it.
    pub lights: &'a [Light],
    /// What they see besides, in the order of their pixels.
    pub fragments: &'a [Fragment],
    /// Columns and rows.
    pub size: (u32, u32),
}

impl Lit<'_> {
    fn index(&self, x: i32, y: i32) -> Option<usize> {
        let (width, height) = (self.size.0 as i32, self.size.1 as i32);
        ((0..width).contains(&x) && (0..height).contains(&y)).then(|| (y * width + x) as usize)
    }

    /// Radiance of a pixel.
    pub(super) fn color(&self, x: u32, y: u32) -> Vec3 {
        let index = (y * self.size.0 + x) as usize;
        let point = &self.gathered[index];
        let light = &self.lights[index];
        match point.strength > 0.0 {
            true => point.emitted + point.other + point.coverage * light.reflected(point.albedo),
            false => point.emitted + point.other + light.gloss,
        }
    }

    /// Adds their fragments to the pixels of a row. Where neighbours share their light these take it too, as they are seen
    /// from `eye`.
    pub(super) fn add_fragments(&self, y: u32, eye: Option<Vec3>, colors: &mut [Vec3]) {
        let start = y * self.size.0;
        let from = self.fragments.partition_point(|fragment| fragment.pixel < start);
        let row = self.fragments[from..].iter().take_while(|fragment| fragment.pixel < start + self.size.0);
        for fragment in row {
            let x = fragment.pixel - start;
            let light = eye.and_then(|eye| self.beside((x, y), &fragment.point, eye));
            colors[x as usize] += fragment.color(light);
        }
    }

    /// Whether a pixel and one beside or below or above it see different surfaces.
    fn is_edge(&self, x: u32, y: u32, eye: Vec3) -> bool {
        let (x, y) = (x as i32, y as i32);
        let Some(center) = self.index(x, y).map(|index| &self.gathered[index]) else { return false };
        let scale = PLANE_DISTANCE * center.position.distance(eye);
        [(1, 0), (-1, 0), (0, 1), (0, -1)].into_iter().any(|(dx, dy)| {
            let Some(other) = self.index(x + dx, y + dy).map(|index| &self.gathered[index]) else {
                return false;
            };
            let difference = (center.emitted - other.emitted).abs().max_element();
            let most = center.emitted.max(other.emitted).max_element();
            let seen = center.strength > 0.0 && other.strength > 0.0;
            difference > CONTRAST * most
                || (center.strength > 0.0) != (other.strength > 0.0)
                || (seen && !is_alike(center, other, scale))
        })
    }

    /// Light on a point that lies in a pixel: as much as a neighbour that sees the same surface receives. `None` if there is
    /// none.
    fn beside(&self, (x, y): (u32, u32), point: &Gathered, eye: Vec3) -> Option<Light> {
        let scale = PLANE_DISTANCE * point.position.distance(eye);
        const NEAREST: [(i32, i32); 9] =
            [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)];
        NEAREST.into_iter().find_map(|(dx, dy)| {
            let index = self.index(x as i32 + dx, y as i32 + dy)?;
            let other = &self.gathered[index];
            is_alike(point, other, scale).then(|| self.lights[index])
        })
    }
}

/// Means over several samples for the pixels at edges in a row of a picture; `colors` has what the first sample of each has.
/// Returns the number of rays.
pub(super) fn refine<Q: RayQuery + ?Sized>(
    view: &View<'_, Q>,
    settings: &Settings,
    lit: &Lit<'_>,
    y: u32,
    colors: &mut [Vec3],
) -> u64 {
    // Rays of one origin and one time.
    let Some(eye) = view.camera.common_origin().filter(|_| !view.moving) else { return 0 };
    let edges: Vec<u32> = (0..lit.size.0).filter(|&x| lit.is_edge(x, y, eye)).collect();
    let ray = |(&x, place): (&u32, Vec2)| {
        let at = Vec2::new(x as f32, y as f32) + 0.5 + settings.filter.sample(place);
        let camera = view.camera.ray(at, Vec2::splat(0.5), 0.0);
        Ray::new(camera.origin, camera.direction)
    };
    let rays: Vec<Ray> = edges.iter().flat_map(|x| PLACES.map(|place| ray((x, place)))).collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut tile = Tile::new(eye);
    for (rays, hits) in rays.chunks(Tile::CAPACITY).zip(hits.chunks_mut(Tile::CAPACITY)) {
        tile.restart(eye);
        for ray in rays {
            tile.push(ray.direction, f32::INFINITY);
        }
        view.query.intersect_tile(&tile, hits);
    }
    let mut sums: Vec<(Vec3, f32)> = edges.iter().map(|&x| (colors[x as usize], 1.0)).collect();
    let mut add = |index: usize, color: Option<Vec3>| {
        if let Some(color) = color.filter(|color| color.is_finite()) {
            let (sum, count) = &mut sums[index / PLACES.len()];
            (*sum, *count) = (*sum + color, *count + 1.0);
        }
    };
    for (index, (ray, _)) in rays.iter().zip(&hits).enumerate().filter(|(_, (_, hit))| !hit.is_hit()) {
        add(index, Some(view.scene.lights().environment(ray.direction)));
    }
    let (mut sorter, mut scratch, mut surfaces) =
        (HitSorter::default(), ShadeScratch::default(), Surfaces::default());
    sorter.sort(view.scene, &hits);
    for packet in sorter.packets() {
        let cone = |i: usize| view.camera.cone().advanced(hits[i].t);
        let along = |i: usize| Arrival { hit: &hits[i], ray: &rays[i], cone: cone(i), level: 1 };
        view.scene.shade(&packet, along, &mut scratch, &mut surfaces);
        for (lane, &index) in packet.hits.iter().enumerate() {
            let index = index as usize;
            let x = edges[index / PLACES.len()];
            add(
                index,
                seen(settings, &surfaces, lane).and_then(|point| match point.strength > 0.0 {
                    true => lit
                        .beside((x, y), &point, eye)
                        .map(|light| point.emitted + light.reflected(point.albedo)),
                    false => Some(point.emitted),
                }),
            );
        }
    }
    for (&x, (sum, count)) in edges.iter().zip(sums) {
        colors[x as usize] = sum / count;
    }
    rays.len() as u64
}

/// The point of a packet's lane; `None` if more is to be seen of it than its own light and what neighbours share.
fn seen(settings: &Settings, surfaces: &Surfaces, lane: usize) -> Option<Gathered> {
    if surfaces.through(lane) != Vec3::ZERO {
        return None;
    }
    let surface = surfaces.lane(lane);
    let albedo = |which| surface.bsdf.albedo_of(which).largest();
    let dull = albedo(DULL);
    if albedo(Selection::up_to(CLEAR_ALPHA)) > 0.0 || (dull == 0.0 && albedo(MIRRORS) > 0.0) {
        return None;
    }
    Some(Gathered {
        emitted: surfaces.emission(lane) + surfaces.ambient(lane) + settings.ambient * surfaces.albedo(lane),
        albedo: surfaces.diffuse(lane),
        position: surfaces.position(lane),
        normal: surfaces.normal(lane),
        strength: dull,
        straight: true,
        ..Gathered::default()
    })
}

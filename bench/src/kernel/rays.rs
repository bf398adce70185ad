//! The rays that are measured: made once from a view of the scene, in an order that suits packets of every width.

use std::f32::consts::TAU;

use heliostat::kernel::glam::{Vec2, Vec3};
use heliostat::kernel::{Aabb, Hit, Ray, RayQuery, Tile};

use super::scenes::View;

/// Edge of a tile of rays, pixels.
const TILE: u32 = 16;
/// Pixels between the pixels of an interleaved set.
const INTERLEAVE: u32 = 3;
/// Virtual point lights that each pixel asks.
const VPLS: usize = 16;
/// Length of ambient-occlusion rays, in diagonals of the scene: elbow room in a room.
const AO_LENGTH: f32 = 0.05;
/// Distance by which rays start above surfaces, in diagonals of the scene.
const OFFSET: f32 = 2.0e-5;
/// Shadow rays end short of their target by this share.
const SHORT: f32 = 1.0e-4;

/// What is asked of a set of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Query {
    /// The closest hit.
    Closest,
    /// Whether there is any hit.
    Any,
}

/// The kinds of rays, named as in the results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// From the camera, closest hit.
    Primary,
    /// From what the camera sees to one point light, any hit.
    Light,
    /// To 16 virtual point lights, all pixels the same ones; any hit.
    Vpl16,
    /// To 16 virtual point lights, each of 3×3 interleaved sets of pixels its own; any hit.
    Vpl16Interleaved,
    /// One cosine-distributed bounce, closest hit.
    Diffuse,
    /// Short cosine-distributed rays, any hit.
    Ao,
    /// The mirror image of the camera's rays, closest hit.
    Mirror,
}

impl Kind {
    pub(super) const ALL: [Self; 7] = [
        Self::Primary,
        Self::Light,
        Self::Vpl16,
        Self::Vpl16Interleaved,
        Self::Diffuse,
        Self::Ao,
        Self::Mirror,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Primary => "primary",
            Self::Light => "light",
            Self::Vpl16 => "vpl16",
            Self::Vpl16Interleaved => "vpl16-3x3",
            Self::Diffuse => "diffuse",
            Self::Ao => "ao",
            Self::Mirror => "mirror",
        }
    }

    pub(super) fn query(self) -> Query {
        match self {
            Self::Primary | Self::Diffuse | Self::Mirror => Query::Closest,
            Self::Light | Self::Vpl16 | Self::Vpl16Interleaved | Self::Ao => Query::Any,
        }
    }
}

/// Up to 256 rays that belong together.
pub(super) enum Item {
    /// With a common origin.
    Tile(Box<Tile>),
    /// Without.
    Batch(Vec<Ray>),
}

impl Item {
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Tile(tile) => tile.len(),
            Self::Batch(rays) => rays.len(),
        }
    }

    pub(super) fn rays(&self) -> Vec<Ray> {
        match self {
            Self::Tile(tile) => (0..tile.len()).filter_map(|i| tile.ray(i)).collect(),
            Self::Batch(rays) => rays.clone(),
        }
    }
}

/// All rays of one kind on one scene.
pub(super) struct RaySet {
    pub(super) kind: Kind,
    pub(super) items: Vec<Item>,
    /// In all items together.
    pub(super) count: usize,
}

/// What the camera sees through one pixel.
#[derive(Clone, Copy)]
struct Surface {
    /// Lifted off the surface.
    point: Vec3,
    /// Unit, on the camera's side.
    normal: Vec3,
    /// Unit, from the camera.
    incoming: Vec3,
}

/// A place on a surface that sends light.
#[derive(Clone, Copy)]
struct Vpl {
    point: Vec3,
    normal: Vec3,
}

/// A view of a scene, from which every kind of rays follows.
pub(super) struct Source<'a, Q: RayQuery> {
    world: &'a Q,
    size: u32,
    most: usize,
    view: View,
    surfaces: Vec<Option<Surface>>,
    seen: usize,
    light: Vec3,
    offset: f32,
    diagonal: f32,
}

impl<'a, Q: RayQuery> Source<'a, Q> {
    /// Looks at the scene with `size`² pixels. Kinds with many more than `most` rays are thinned out to every k-th
    /// tile.
    /// Without a light one is hung up where it reaches much of what is seen.
    pub(super) fn new(world: &'a Q, view: View, light: Option<Vec3>, size: u32, most: usize) -> Self {
        let bounds = world.bounds();
        let diagonal = extent(&bounds);
        let offset = OFFSET * diagonal;
        let mut surfaces = vec![None; (size * size) as usize];
        let mut hits = [Hit::MISS; Tile::CAPACITY];
        for corner in tiles(size, TILE) {
            let (tile, pixels) = camera_tile(&view, size, corner);
            world.intersect_tile(&tile, &mut hits[..tile.len()]);
            for (i, (x, y)) in pixels.into_iter().enumerate() {
                let ray = tile.ray(i).filter(|_| hits[i].is_hit());
                surfaces[(y * size + x) as usize] = ray.map(|ray| surface(&ray, &hits[i], offset));
            }
        }
        let seen = surfaces.iter().flatten().count();
        let mut source =
            Self { world, size, most, view, surfaces, seen, light: Vec3::ZERO, offset, diagonal };
        source.light = light.unwrap_or_else(|| source.hang_light(&bounds));
        source
    }

    /// Share of the pixels that see something.
    pub(super) fn coverage(&self) -> f64 {
        self.seen as f64 / self.surfaces.len().max(1) as f64
    }

    /// Makes all rays of a kind.
    pub(super) fn rays(&self, kind: Kind) -> RaySet {
        let items: Vec<Item> = match kind {
            Kind::Primary => tiles(self.size, TILE)
                .map(|corner| Item::Tile(Box::new(camera_tile(&self.view, self.size, corner).0)))
                .collect(),
            Kind::Light => self.shadow_tiles(&[Vpl { point: self.light, normal: Vec3::ZERO }], 1),
            Kind::Vpl16 => self.shadow_tiles(&self.vpls(VPLS), 1),
            Kind::Vpl16Interleaved => {
                self.shadow_tiles(&self.vpls(VPLS * (INTERLEAVE * INTERLEAVE) as usize), INTERLEAVE)
            }
            Kind::Diffuse => {
                self.batches(|surface, pixel| Ray::new(surface.point, cosine(surface, pixel, 1)))
            }
            Kind::Ao => self.batches(|surface, pixel| Ray {
                t_max: AO_LENGTH * self.diagonal,
                ..Ray::new(surface.point, cosine(surface, pixel, 2))
            }),
            Kind::Mirror => {
                self.batches(|surface, _| Ray::new(surface.point, surface.incoming.reflect(surface.normal)))
            }
        };
        let items: Vec<Item> = items.into_iter().filter(|item| item.len() > 0).collect();
        let count = items.iter().map(Item::len).sum();
        RaySet { kind, items, count }
    }

    fn surface(&self, (x, y): (u32, u32)) -> Option<&Surface> {
        self.surfaces[(y * self.size + x) as usize].as_ref()
    }

    /// One ray per pixel that sees something, in batches of a tile.
    fn batches(&self, ray: impl Fn(&Surface, u32) -> Ray) -> Vec<Item> {
        let make = |corner| {
            let rays = tile_pixels(corner, 1, self.size)
                .filter_map(|(x, y)| self.surface((x, y)).map(|surface| ray(surface, y * self.size + x)));
            Item::Batch(rays.collect())
        };
        tiles(self.size, TILE).map(make).collect()
    }

    /// For each tile of each of `stride`² interleaved sets of pixels and each light of that set, the rays from the
    /// light to the surfaces that face it. A light without a normal shines everywhere.
    fn shadow_tiles(&self, lights: &[Vpl], stride: u32) -> Vec<Item> {
        let sets = stride * stride;
        let per_set = lights.len() / sets as usize;
        let every = (self.seen * per_set).div_ceil(self.most).max(1);
        let places = tiles(self.size, TILE * stride)
            .flat_map(|corner| (0..sets).map(move |set| (corner, set)))
            .step_by(every);
        let mut items = Vec::new();
        for ((x, y), set) in places {
            let corner = (x + set % stride, y + set / stride);
            let pixels = tile_pixels(corner, stride, self.size);
            let receivers: Vec<&Surface> = pixels.filter_map(|pixel| self.surface(pixel)).collect();
            for light in lights.iter().skip(set as usize).step_by(sets as usize) {
                let mut tile = Box::new(Tile::new(light.point));
                for receiver in &receivers {
                    let direction = receiver.point - light.point;
                    let sent = light.normal == Vec3::ZERO || light.normal.dot(direction) > 0.0;
                    if sent && receiver.normal.dot(direction) < 0.0 {
                        tile.push(direction, 1.0 - SHORT);
                    }
                }
                items.push(Item::Tile(tile));
            }
        }
        items
    }

    /// Above the middle of what is seen: below the ceiling in a room, high above anything else.
    fn hang_light(&self, bounds: &Aabb) -> Vec3 {
        let seen: Vec<&Surface> = self.surfaces.iter().flatten().step_by((self.seen / 512).max(1)).collect();
        let middle = seen.iter().map(|s| s.point).sum::<Vec3>() / seen.len().max(1) as f32;
        let up: Vec<Ray> = seen.iter().map(|s| Ray::new(s.point, Vec3::Y)).collect();
        let mut hits = vec![Hit::MISS; up.len()];
        self.world.intersect(&up, &mut hits);
        let mut heights: Vec<f32> = up.iter().zip(&hits).map(|(ray, hit)| ray.origin.y + hit.t).collect();
        heights.sort_by(f32::total_cmp);
        match heights.get(heights.len() / 2).filter(|h| h.is_finite()) {
            Some(&ceiling) => middle.with_y(middle.y + 0.9 * (ceiling - middle.y).max(0.0)),
            None => bounds.center() + Vec3::new(0.25, 0.8, 0.35) * self.diagonal,
        }
    }

    /// Ends of random walks from the light: half of them where its light falls on something seen, half one
    /// cosine-distributed bounce further.
    fn vpls(&self, count: usize) -> Vec<Vpl> {
        let seen: Vec<&Surface> = self.surfaces.iter().flatten().collect();
        if seen.is_empty() {
            return vec![Vpl { point: self.light, normal: Vec3::ZERO }; count];
        }
        (0..count as u32)
            .map(|i| {
                let target = seen[hash(i, 77) as usize % seen.len()];
                let ray = Ray::new(self.light, target.point - self.light);
                let first = self.lit(&ray).unwrap_or(*target);
                let bounce = || self.lit(&Ray::new(first.point, cosine(&first, i, 3)));
                let end = if i % 2 == 1 { bounce().unwrap_or(first) } else { first };
                Vpl { point: end.point, normal: end.normal }
            })
            .collect()
    }

    fn lit(&self, ray: &Ray) -> Option<Surface> {
        let mut hit = [Hit::MISS];
        self.world.intersect(&[*ray], &mut hit);
        hit[0].is_hit().then(|| surface(ray, &hit[0], self.offset))
    }
}

fn extent(bounds: &Aabb) -> f32 {
    if bounds.is_empty() { 1.0 } else { (bounds.max - bounds.min).length() }
}

fn surface(ray: &Ray, hit: &Hit, offset: f32) -> Surface {
    let incoming = ray.direction.normalize_or_zero();
    let normal = if hit.ng.dot(incoming) > 0.0 { -hit.ng } else { hit.ng };
    Surface { point: ray.at(hit.t) + offset * normal, normal, incoming }
}

/// The camera's rays through the tile at a corner, and their pixels.
fn camera_tile(view: &View, size: u32, corner: (u32, u32)) -> (Tile, Vec<(u32, u32)>) {
    let mut tile = Tile::new(view.eye);
    let pixels: Vec<_> = tile_pixels(corner, 1, size).collect();
    for &(x, y) in &pixels {
        let at = |k: u32| (2 * k + 1) as f32 / size as f32 - 1.0;
        tile.push(view.forward + view.right * at(x) - view.up * at(y), f32::INFINITY);
    }
    (tile, pixels)
}

/// Corners of the tiles of a square picture, along a Morton curve.
fn tiles(size: u32, edge: u32) -> impl Iterator<Item = (u32, u32)> {
    let across = size.div_ceil(edge);
    let all = across.next_power_of_two().pow(2);
    (0..all)
        .map(deinterleave)
        .filter(move |&(x, y)| x < across && y < across)
        .map(move |(x, y)| (x * edge, y * edge))
}

/// The pixels of a tile of 16×16 that are `stride` apart, along a Morton curve: each run of 16 is a block of 4×4.
fn tile_pixels((x, y): (u32, u32), stride: u32, size: u32) -> impl Iterator<Item = (u32, u32)> {
    let pixels = (0..TILE * TILE).map(deinterleave).map(move |(u, v)| (x + u * stride, y + v * stride));
    pixels.filter(move |&(x, y)| x < size && y < size)
}

/// Splits the bits of a Morton number.
fn deinterleave(code: u32) -> (u32, u32) {
    let even = |mut bits: u32| {
        bits &= 0x5555_5555;
        for shift in [1_u32, 2, 4, 8] {
            let mask = [0x3333_3333, 0x0f0f_0f0f, 0x00ff_00ff, 0x0000_ffff][shift.ilog2() as usize];
            bits = (bits | bits >> shift) & mask;
        }
        bits
    };
    (even(code), even(code >> 1))
}

/// A cosine-distributed direction, random by pixel and purpose.
fn cosine(surface: &Surface, pixel: u32, purpose: u32) -> Vec3 {
    let unit = |salt| (hash(pixel, salt) >> 8) as f32 / (1 << 24) as f32;
    let random = Vec2::new(unit(2 * purpose), unit(2 * purpose + 1));
    let z = 1.0 - 2.0 * random.x;
    let (sin, cos) = (TAU * random.y).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    (surface.normal + 0.9999 * Vec3::new(radius * cos, radius * sin, z)).normalize()
}

/// A well-mixed number (PCG output function, twice).
fn hash(value: u32, salt: u32) -> u32 {
    let mix = |x: u32| {
        let state = x.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        (word >> 22) ^ word
    };
    mix(value ^ mix(salt))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use heliostat::kernel::{BuildOptions, Mesh, Object, TriangleBvh, World};

    #[test]
    fn sixteen_in_a_row_are_a_block_of_four_by_four() {
        for stride in [1, 3] {
            let pixels: Vec<_> = tile_pixels((48, 96), stride, 1024).collect();
            assert_eq!(pixels.len(), 256);
            for block in pixels.chunks(16) {
                let (x, y) = (block[0].0, block[0].1);
                let expected: std::collections::BTreeSet<_> =
                    (0..16).map(|i| (x + i % 4 * stride, y + i / 4 * stride)).collect();
                assert_eq!(block.iter().copied().collect::<std::collections::BTreeSet<_>>(), expected);
            }
        }
    }

    #[test]
    fn interleaved_sets_cover_each_pixel_once() {
        let size = 100;
        let mut seen = vec![0; (size * size) as usize];
        for (x, y) in tiles(size, TILE * INTERLEAVE) {
            for set in 0..INTERLEAVE * INTERLEAVE {
                let corner = (x + set % INTERLEAVE, y + set / INTERLEAVE);
                tile_pixels(corner, INTERLEAVE, size).for_each(|(x, y)| seen[(y * size + x) as usize] += 1);
            }
        }
        assert!(seen.iter().all(|&n| n == 1));
    }

    /// Looks down on a square floor that fills the picture.
    fn over_a_floor(most: usize, check: impl Fn(&Source<'_, World>)) {
        let corners = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
        let positions: Vec<Vec3> = corners.iter().map(|&(x, z)| Vec3::new(x, 0.0, z)).collect();
        let mesh = Mesh::new(positions, vec![[0, 2, 1], [0, 3, 2]]);
        let tree = TriangleBvh::build(&[mesh], &BuildOptions::default()).expect("a tree");
        let world = World::new(Arc::new(Object::new(Some(tree.into()), Vec::new()).expect("an object")));
        let view = View { eye: 4.0 * Vec3::Y, forward: Vec3::NEG_Y, right: Vec3::X, up: Vec3::NEG_Z };
        check(&Source::new(&world, view, Some(Vec3::new(1.0, 3.0, 0.5)), 64, most));
    }

    #[test]
    fn every_kind_has_the_rays_that_it_says() {
        over_a_floor(usize::MAX, |source| {
            assert_eq!(source.coverage(), 1.0);
            for kind in [Kind::Primary, Kind::Light, Kind::Diffuse, Kind::Ao, Kind::Mirror] {
                assert_eq!(source.rays(kind).count, 64 * 64, "{}", kind.name());
            }
            for item in &source.rays(Kind::Light).items {
                assert!(item.rays().iter().all(|ray| ray.direction.y < 0.0 && ray.t_max < 1.0));
            }
            for item in &source.rays(Kind::Mirror).items {
                assert!(item.rays().iter().all(|ray| ray.direction.y > 0.0 && ray.origin.y > 0.0));
            }
            // All virtual lights lie on the floor, so none sends light along it.
            assert_eq!(source.rays(Kind::Vpl16).count, 0);
        });
    }

    #[test]
    fn about_as_many_rays_as_allowed() {
        over_a_floor(1000, |source| {
            let light = source.rays(Kind::Light);
            // To whole tiles.
            assert!((500..1000 + 256).contains(&light.count), "{}", light.count);
        });
    }
}

//! Shared by the tests: random numbers, scenes, and the comparison with the oracle.
#![allow(dead_code, reason = "each test program uses its own part")]
use std::sync::Arc;

use heliostat_kernel::{
    BuildOptions, Hit, Isa, KdOptions, KdTree, Layout, Mesh, Object, Oracle, Ray, RayQuery, Tile,
    TriangleBvh, World, glam::Vec3,
};

/// Rounds of a randomised hunt: `default` in a normal run, more on demand through `HELIOSTAT_HUNT`.
pub(crate) fn hunt(default: u64) -> u64 {
    std::env::var("HELIOSTAT_HUNT")
        .map_or(default, |rounds| rounds.parse().expect("HELIOSTAT_HUNT is a number"))
}

/// A small deterministic generator (PCG, O'Neill 2014).
pub(crate) struct Rng(u64);

impl Rng {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x1234_5678_9abc_def1)
    }

    pub(crate) fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((((old >> 18) ^ old) >> 27) as u32).rotate_right((old >> 59) as u32)
    }

    /// Uniform in 0..1.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / (1 << 24) as f32
    }

    /// Uniform in −1..1.
    pub(crate) fn signed(&mut self) -> f32 {
        self.unit() * 2.0 - 1.0
    }

    pub(crate) fn vec(&mut self) -> Vec3 {
        Vec3::new(self.signed(), self.signed(), self.signed())
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.bits()) * n as u64) >> 32) as usize
    }
}

/// Makes an object of meshes.
pub(crate) type MakeObject = fn(&[Mesh]) -> Arc<Object>;

/// One way to make an object for each builder and each layout of the bounding volume hierarchy.
pub(crate) const HIERARCHIES: [MakeObject; 4] = [
    object,
    |meshes| object_by(meshes, &BuildOptions::quality()),
    |meshes| object_by(meshes, &BuildOptions::fast()),
    |meshes| object_by(meshes, &compact()),
];

/// Those, and the kd-tree.
pub(crate) const ACCELERATORS: [MakeObject; 5] = {
    let [plain, quality, fast, compact] = HIERARCHIES;
    [plain, quality, fast, compact, kd_object]
};

/// Options for every builder and every layout of the bounding volume hierarchy.
pub(crate) fn all_builders() -> Vec<BuildOptions> {
    vec![BuildOptions::default(), BuildOptions::quality(), BuildOptions::fast(), compact()]
}

fn compact() -> BuildOptions {
    BuildOptions { layout: Layout::Compact, ..BuildOptions::default() }
}

/// Over a bounding volume hierarchy.
pub(crate) fn object(meshes: &[Mesh]) -> Arc<Object> {
    object_by(meshes, &BuildOptions::default())
}

fn object_by(meshes: &[Mesh], options: &BuildOptions) -> Arc<Object> {
    let tree = TriangleBvh::build(meshes, options).expect("valid meshes");
    Arc::new(Object::new(Some(tree.into()), Vec::new()).expect("no instances"))
}

/// Over a kd-tree.
pub(crate) fn kd_object(meshes: &[Mesh]) -> Arc<Object> {
    let tree = KdTree::build(meshes, &KdOptions::default()).expect("valid meshes");
    Arc::new(Object::new(Some(tree.into()), Vec::new()).expect("no instances"))
}

/// `count` loose triangles of about `size` in a cube of half edge `scale` about `center`.
pub(crate) fn soup(rng: &mut Rng, count: usize, scale: f32, size: f32, center: Vec3) -> Mesh {
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for i in 0..count as u32 {
        let p = center + rng.vec() * scale;
        positions.extend([p, p + rng.vec() * size, p + rng.vec() * size]);
        indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    Mesh::new(positions, indices)
}

/// Rays from in and around a cube of half edge `scale`, some short, some not unit, some along axes.
pub(crate) fn rays(rng: &mut Rng, count: usize, scale: f32, center: Vec3) -> Vec<Ray> {
    (0..count)
        .map(|i| {
            let origin = center + rng.vec() * scale * 1.5;
            let target = center + rng.vec() * scale;
            let mut direction = (target - origin) * 10.0_f32.powf(rng.signed());
            if i % 8 == 0 {
                direction = Vec3::AXES[i / 8 % 3] * direction.x.signum();
            }
            let mut ray = Ray::new(origin, direction);
            if i % 5 == 0 {
                ray.t_min = rng.unit() * scale / direction.length();
                ray.t_max = ray.t_min + 2.0 * rng.unit() * scale / direction.length();
            }
            ray
        })
        .collect()
}

/// Tiles of rays from common origins: narrow frusta, wide fans, and full spheres of directions.
pub(crate) fn tiles(rng: &mut Rng, count: usize, scale: f32, center: Vec3) -> Vec<Tile> {
    (0..count)
        .map(|i| {
            let origin = center + rng.vec() * scale * 1.5;
            let mut tile = Tile::new(origin);
            let spread = [0.05, 0.3, 3.0, 50.0][i % 4] * scale;
            let target = center + rng.vec() * scale * 0.5;
            let len = if i % 3 == 0 { 1 + rng.below(Tile::CAPACITY) } else { Tile::CAPACITY };
            for _ in 0..len {
                let direction = target + rng.vec() * spread - origin;
                let t_max = if i % 2 == 0 { f32::INFINITY } else { 2.0 * rng.unit() };
                let t_min = if i % 5 == 4 { 0.5 * rng.unit() } else { 0.0 };
                tile.push_interval(direction, t_min, t_max);
            }
            tile
        })
        .collect()
}

/// [`check_all`] over every accelerator, builder and layout.
pub(crate) fn check_each(meshes: &[Mesh], rays: &[Ray], tiles: &[Tile], error: f64) {
    for object in ACCELERATORS {
        check_all(&object(meshes), rays, tiles, error);
    }
}

/// Compares every query of `root` with the oracle, on every instruction set of this machine. `error` is the
/// rounding error of positions to allow, in world units.
pub(crate) fn check_all(root: &Arc<Object>, rays: &[Ray], tiles: &[Tile], error: f64) {
    for isa in Isa::available() {
        let world = World::with_isa(Arc::clone(root), isa).expect("available");
        let oracle = Oracle::new(&world);
        let what = format!("{isa}");

        let (mut hits, mut occluded) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
        world.intersect(rays, &mut hits);
        world.occluded(rays, &mut occluded);
        for i in 0..rays.len() {
            check_ray(&oracle, &rays[i], &hits[i], occluded[i], error, &format!("{what} batch ray {i}"));
            let (mut hit, mut any) = ([Hit::MISS], [false]);
            world.intersect(&rays[i..=i], &mut hit);
            world.occluded(&rays[i..=i], &mut any);
            check_ray(&oracle, &rays[i], &hit[0], any[0], error, &format!("{what} single ray {i}"));
        }
        for (k, tile) in tiles.iter().enumerate() {
            let (mut hits, mut occluded) = (vec![Hit::MISS; tile.len()], vec![false; tile.len()]);
            world.intersect_tile(tile, &mut hits);
            world.occluded_tile(tile, &mut occluded);
            for i in 0..tile.len() {
                let ray = tile.ray(i).expect("in range");
                check_ray(&oracle, &ray, &hits[i], occluded[i], error, &format!("{what} tile {k} ray {i}"));
            }
        }
    }
}

/// A hit is right if its point lies on its triangle and on the ray up to `error`, and nothing that the oracle
/// sees clearly (farther than `error` from every edge, across the ray) lies nearer. Rays closer to an edge than
/// that may go either way here: single precision cannot tell. Closed meshes have their own, exact, tests.
fn check_ray(oracle: &Oracle, ray: &Ray, hit: &Hit, occluded: bool, error: f64, what: &str) {
    let near = oracle.near(ray, error);
    let length = f64::from(ray.direction.length());
    for n in &near {
        let across = error / n.cosine;
        let (t, along) = (f64::from(n.hit.t), across / length);
        // f32 rounding of t itself comes on top of the rounding of positions.
        let along = along + t * 2.0e-7;
        let clear = n.margin > across
            && t - along > f64::from(ray.t_min.max(0.0))
            && t + along < f64::from(ray.t_max);
        if clear {
            assert!(occluded, "{what}: occlusion lost: {ray:?} {n:?}");
            assert!(f64::from(hit.t) <= t + along, "{what}: lost or not closest: {ray:?} {hit:?} {n:?}");
        }
    }
    if occluded {
        // Edge-on triangles are not in the oracle's list; a closest hit vouches for itself below.
        assert!(!near.is_empty() || hit.is_hit(), "{what}: occlusion invented: {ray:?}");
    }
    if !hit.is_hit() {
        assert_eq!(*hit, Hit::MISS, "{what}");
        return;
    }
    assert!(hit.t > ray.t_min.max(0.0) && hit.t < ray.t_max, "{what}: outside the interval: {ray:?} {hit:?}");
    assert!(hit.u >= 0.0 && hit.v >= 0.0 && hit.u + hit.v <= 1.0, "{what}: {hit:?}");
    assert!((hit.ng.length() - 1.0).abs() < 1e-5, "{what}: {hit:?}");
    let same = |n: &&heliostat_kernel::NearHit| {
        (n.hit.geometry, n.hit.primitive, n.hit.path) == (hit.geometry, hit.primitive, hit.path)
    };
    if let Some(n) = near.iter().find(same) {
        // Where the plane is met moves by the error over the cosine, but never farther than the triangle reaches;
        // below 1e-3 the precise answer is the one clamped to the triangle, checked by its occlusion only.
        let along = error / n.cosine / length + f64::from(hit.t) * 4.0e-7;
        let off = (f64::from(n.hit.t) - f64::from(hit.t)).abs();
        assert!(off <= 2.0 * along || n.cosine < 1e-3, "{what}: wrong t: {ray:?} {hit:?} {n:?}");
        // Nearly flat triangles have uncertain normals after nested transforms.
        assert!(n.hit.ng.dot(hit.ng) > 0.99, "{what}: wrong normal: {hit:?} {n:?}");
    } else {
        let cosine = hit.ng.dot(ray.direction.normalize()).abs();
        assert!(cosine < 1e-3, "{what}: invented: {ray:?} {hit:?}");
    }
}

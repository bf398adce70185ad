//! Every query against the brute-force oracle, on every instruction set.
mod common;
use common::{ACCELERATORS, Rng, check_all, check_each, hunt, rays, soup, tiles};
use heliostat_kernel::{
    BuildOptions, Hit, Isa, KdOptions, KdTree, Mesh, Object, Ray, RayQuery, Tile, TriangleBvh, World,
    glam::{Vec2, Vec3},
};

/// Rounding of positions: about ten operations at 2^-24 of the largest coordinate, times three in reserve.
const RELATIVE_ERROR: f64 = 2.0e-6;

fn check_soup(seed: u64, count: usize, scale: f32, size: f32, center: Vec3) {
    let mut rng = Rng::new(seed);
    let meshes = [
        soup(&mut rng, count, scale, size, center),
        Mesh::default(),
        soup(&mut rng, count / 3, scale, size * 0.2, center),
    ];
    let rays = rays(&mut rng, 300, scale, center);
    let tiles = tiles(&mut rng, 12, scale, center);
    let reach = f64::from(2.5 * scale + center.abs().max_element());
    check_each(&meshes, &rays, &tiles, RELATIVE_ERROR * reach);
}

#[test]
fn soups_of_several_sizes() {
    for (seed, count) in [(1, 1), (2, 3), (3, 8), (4, 17), (5, 100), (6, 700)] {
        check_soup(seed, count, 1.0, 0.5, Vec3::ZERO);
    }
}

#[test]
fn huge_coordinates() {
    check_soup(7, 200, 1.0e6, 4.0e5, Vec3::ZERO);
}

#[test]
fn tiny_coordinates() {
    check_soup(8, 200, 1.0e-6, 4.0e-7, Vec3::ZERO);
}

#[test]
fn far_from_the_origin() {
    check_soup(9, 200, 1.0, 0.5, Vec3::new(1000.0, -300.0, 50.0));
}

#[test]
fn needles_and_specks() {
    let mut rng = Rng::new(10);
    let mut positions = Vec::new();
    for _ in 0..150 {
        let p = rng.vec();
        let along = rng.vec();
        positions.extend([p, p + along, p + along * 0.5 + rng.vec() * 1.0e-3]);
    }
    let indices: Vec<[u32; 3]> = (0..150).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let mesh = Mesh::new(positions, indices);
    let rays = rays(&mut rng, 300, 1.0, Vec3::ZERO);
    check_each(&[mesh], &rays, &tiles(&mut rng, 8, 1.0, Vec3::ZERO), RELATIVE_ERROR * 3.0);
}

#[test]
fn coplanar_and_coincident_triangles() {
    let mut rng = Rng::new(11);
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for i in 0..120_u32 {
        let z = [0.0, 0.0, 0.25][i as usize % 3];
        let flat = |p: Vec2| Vec3::new(p.x, p.y, z);
        let p = Vec2::new(rng.signed(), rng.signed());
        positions.extend([flat(p), flat(p + Vec2::new(0.5, 0.0)), flat(p + Vec2::new(0.0, 0.5))]);
        indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
        indices.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    // The same place forty times: nothing to split by.
    indices.extend([[0, 1, 2]; 40]);
    let mesh = Mesh::new(positions, indices);
    let rays = rays(&mut rng, 300, 1.0, Vec3::ZERO);
    check_each(&[mesh], &rays, &tiles(&mut rng, 8, 1.0, Vec3::ZERO), RELATIVE_ERROR * 3.0);
}

#[test]
fn bad_triangles_are_skipped_and_good_ones_stay() {
    let mut rng = Rng::new(12);
    let good = soup(&mut rng, 50, 1.0, 0.5, Vec3::ZERO);
    let mut positions = good.positions.to_vec();
    let mut indices = good.indices.to_vec();
    let n = positions.len() as u32;
    positions.extend([
        Vec3::new(f32::NAN, 0.0, 0.0),
        Vec3::new(0.0, f32::INFINITY, 0.0),
        Vec3::splat(f32::MAX),
        Vec3::new(0.0, 0.0, f32::NEG_INFINITY),
    ]);
    indices.extend([[0, 1, n], [n + 1, 4, 5], [2, n + 2, 7], [n, n + 1, n + 3]]);
    // Zero area: a point, a doubled corner, three corners on a line.
    positions.extend([Vec3::ZERO, Vec3::splat(0.5), Vec3::splat(1.0)]);
    indices.extend([[3, 3, 3], [3, 4, 4], [n + 4, n + 5, n + 6]]);
    let mesh = Mesh::new(positions, indices);
    let tree = TriangleBvh::build(std::slice::from_ref(&mesh), &BuildOptions::default()).expect("builds");
    assert_eq!(tree.stats().triangles, 50);
    let tree = KdTree::build(std::slice::from_ref(&mesh), &KdOptions::default()).expect("builds");
    assert_eq!(tree.stats().triangles, 50);
    let rays = rays(&mut rng, 300, 1.0, Vec3::ZERO);
    check_each(&[mesh], &rays, &tiles(&mut rng, 6, 1.0, Vec3::ZERO), RELATIVE_ERROR * 3.0);
}

#[test]
fn nothing_to_hit() {
    let mut rng = Rng::new(13);
    let nothing = ACCELERATORS.map(|object| [object(&[]), object(&[Mesh::default()])]);
    for root in nothing.into_iter().flatten().chain([Object::empty().into()]) {
        assert!(root.bounds().is_empty());
        let rays = rays(&mut rng, 20, 1.0, Vec3::ZERO);
        check_all(&root, &rays, &tiles(&mut rng, 2, 1.0, Vec3::ZERO), 1e-6);
    }
    assert!(World::empty().bounds().is_empty());
}

#[test]
fn bad_rays_hit_nothing() {
    // A box all around, which any good ray meets.
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for axis in 0..3 {
        for side in [-1.0_f32, 1.0] {
            let n = positions.len() as u32;
            for (u, v) in [(-9.0, -9.0), (9.0, -9.0), (0.0, 9.0)] {
                let mut p = [0.0; 3];
                p[axis] = side;
                p[(axis + 1) % 3] = u;
                p[(axis + 2) % 3] = v;
                positions.push(Vec3::from_array(p));
            }
            indices.push([n, n + 1, n + 2]);
        }
    }
    let mesh = Mesh::new(positions, indices);
    let good = Ray::new(Vec3::ZERO, Vec3::X);
    let mut bad = Vec::new();
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for k in 0..3 {
            let mut broken = Vec3::ZERO;
            broken[k] = x;
            bad.push(Ray { origin: broken, ..good });
            bad.push(Ray { direction: Vec3::ONE + broken, ..good });
        }
    }
    bad.push(Ray { direction: Vec3::ZERO, ..good });
    bad.push(Ray { direction: Vec3::NEG_X * 0.0, ..good });
    bad.push(Ray { t_min: f32::NAN, ..good });
    bad.push(Ray { t_max: f32::NAN, ..good });
    bad.push(Ray { t_min: 2.0, t_max: 1.0, ..good });
    bad.push(Ray { t_max: -1.0, ..good });
    bad.push(Ray { t_max: f32::NEG_INFINITY, ..good });
    bad.push(Ray { origin: Vec3::splat(f32::MAX), ..good });
    let worlds = ACCELERATORS.into_iter().flat_map(|object| {
        let root = object(std::slice::from_ref(&mesh));
        Isa::available().into_iter().map(move |isa| World::with_isa(root.clone(), isa).expect("available"))
    });
    for world in worlds {
        let isa = world.isa();
        let (mut hit, mut any) = ([Hit::MISS], [false]);
        world.intersect(&[good], &mut hit);
        world.occluded(&[good], &mut any);
        assert!(hit[0].is_hit() && any[0]);
        let (mut hits, mut occluded) = (vec![hit[0]; bad.len()], vec![true; bad.len()]);
        world.intersect(&bad, &mut hits);
        world.occluded(&bad, &mut occluded);
        for (i, ray) in bad.iter().enumerate() {
            assert_eq!((hits[i], occluded[i]), (Hit::MISS, false), "{isa} {ray:?}");
            // The same among good rays of a tile, which must not be disturbed.
            let mut tile = Tile::new(ray.origin);
            for _ in 0..20 {
                tile.push(Vec3::X, 100.0);
            }
            tile.push_interval(ray.direction, ray.t_min, ray.t_max);
            let (mut hits, mut occluded) = (vec![hit[0]; 21], vec![true; 21]);
            world.intersect_tile(&tile, &mut hits);
            world.occluded_tile(&tile, &mut occluded);
            assert_eq!((hits[20], occluded[20]), (Hit::MISS, false), "{isa} tile {ray:?}");
            let usable = ray.origin.is_finite() && ray.origin.abs().max_element() < 1.0e9;
            assert!(hits[..20].iter().all(|h| h.is_hit() == usable), "{isa} tile {ray:?}");
            assert!(occluded[..20].iter().all(|&o| o == usable), "{isa} tile {ray:?}");
        }
    }
}

/// A wide sweep of sizes, densities and places, a few of them; `HELIOSTAT_HUNT` sets how many, to hunt for rare cases.
#[test]
fn many_soups() {
    for seed in 1000..1000 + hunt(16) {
        let mut rng = Rng::new(seed);
        let scale = 10.0_f32.powf(rng.signed() * 6.0);
        let size = scale * 10.0_f32.powf(rng.signed() - 1.0);
        let center = rng.vec() * scale * 10.0_f32.powf(rng.signed() * 2.0);
        check_soup(seed, 1 + rng.below(600), scale, size, center);
    }
}

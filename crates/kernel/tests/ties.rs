//! Surfaces that coincide exactly: the hit kept is the least in (t, path, geometry, primitive), in every walk through
//! every tree, however the tree came about.
mod common;
use std::sync::Arc;

use common::{ACCELERATORS, HIERARCHIES, MakeObject, Rng, all_builders, rays, soup, tiles};
use heliostat_kernel::{
    BuildOptions, Hit, Instance, InstanceChange, Isa, Mesh, Object, Oracle, Quadric, Quadrics, Ray, RayQuery,
    Tile, TriangleBvh, World,
    glam::{Affine3A, Mat3, Quat, Vec3},
};

/// A soup that lists every triangle three times, in an order of its own.
fn thrice(rng: &mut Rng, count: usize) -> Mesh {
    let mut mesh = soup(rng, count, 1.0, 0.8, Vec3::ZERO);
    let mut indices = mesh.indices.repeat(3);
    for i in (1..indices.len()).rev() {
        indices.swap(i, rng.below(i + 1));
    }
    mesh.indices = indices.into();
    mesh
}

fn instance(object: &Arc<Object>, parent_from_object: Affine3A, id: u32) -> Instance {
    Instance { object: Arc::clone(object), parent_from_object, motion: None, id }
}

/// A few placements, as instances that coincide share them: moved, turned, mirrored and sheared.
fn placements() -> [Affine3A; 4] {
    let turn = Mat3::from_quat(Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.4));
    let shear = Mat3::from_cols(Vec3::new(1.0, 0.2, 0.0), Vec3::new(0.5, -1.0, 0.3), Vec3::Z);
    [
        Affine3A::IDENTITY,
        Affine3A::from_translation(Vec3::new(0.75, 0.0, -0.5)),
        Affine3A::from_mat3(turn),
        Affine3A::from_mat3_translation(turn * shear, Vec3::new(0.1, 0.2, -0.3)),
    ]
}

/// What tells hits apart.
fn name(hit: &Hit) -> (u64, u32, u32) {
    (hit.path.0, hit.geometry, hit.primitive)
}

/// The answers of every walk on one instruction set: rays one by one, all together, and tiles.
struct Walks {
    single: Vec<Hit>,
    batch: Vec<Hit>,
    tiles: Vec<Vec<Hit>>,
}

fn walks(root: &Arc<Object>, isa: Isa, rays: &[Ray], tiles: &[Tile]) -> Walks {
    let world = World::with_isa(Arc::clone(root), isa).expect("available");
    let all = |rays: &[Ray]| {
        let mut hits = vec![Hit::MISS; rays.len()];
        world.intersect(rays, &mut hits);
        hits
    };
    let tile = |tile: &Tile| {
        let mut hits = vec![Hit::MISS; tile.len()];
        world.intersect_tile(tile, &mut hits);
        hits
    };
    let single = rays.iter().flat_map(|ray| all(std::slice::from_ref(ray))).collect();
    Walks { single, batch: all(rays), tiles: tiles.iter().map(tile).collect() }
}

/// Whether the ray's nearest hit is clear but for others at the very same distance: no edge and no other surface is near.
fn is_clear(oracle: &Oracle, ray: &Ray, best: &Hit) -> bool {
    let hits = oracle.all_hits(ray);
    let apart = |hit: &Hit| hit.t == best.t || (hit.t - best.t).abs() > 1.0e-3 * best.t;
    let near = oracle.near(ray, 1.0e-4);
    let steep = near.iter().all(|near| near.cosine > 0.01);
    near.len() == hits.len() && steep && hits.iter().all(apart)
}

/// Every walk agrees with the oracle in what was hit. Returns how many hits were ties.
fn check(root: &Arc<Object>, rays: &[Ray], tiles: &[Tile]) -> usize {
    let oracle = Oracle::new(&World::new(Arc::clone(root)));
    let expect = |ray: &Ray| {
        let mut best = [Hit::MISS];
        oracle.intersect(std::slice::from_ref(ray), &mut best);
        let [best] = best;
        (best.is_hit() && is_clear(&oracle, ray, &best)).then_some(best)
    };
    let by_ray: Vec<_> = rays.iter().map(expect).collect();
    let by_tile: Vec<Vec<_>> = tiles
        .iter()
        .map(|tile| (0..tile.len()).map(|i| expect(&tile.ray(i).expect("in range"))).collect())
        .collect();
    let same = |expected: &[Option<Hit>], found: &[Hit], what: &str, isa: Isa| {
        for (i, (expected, found)) in expected.iter().zip(found).enumerate() {
            if let Some(expected) = expected {
                assert_eq!(name(found), name(expected), "{isa} {what} {i}: {found:?} {expected:?}");
            }
        }
    };
    for isa in Isa::available() {
        let walks = walks(root, isa, rays, tiles);
        same(&by_ray, &walks.single, "single", isa);
        same(&by_ray, &walks.batch, "batch", isa);
        for (expected, found) in by_tile.iter().zip(&walks.tiles) {
            same(expected, found, "tile", isa);
        }
    }
    let tied = |ray: &Ray, best: &Hit| oracle.all_hits(ray).iter().filter(|hit| hit.t == best.t).count() > 1;
    rays.iter().zip(&by_ray).filter(|(ray, best)| best.is_some_and(|best| tied(ray, &best))).count()
}

#[test]
fn of_equal_triangles_the_first_is_hit() {
    for make in ACCELERATORS {
        let mut rng = Rng::new(91);
        let first = thrice(&mut rng, 40);
        let meshes = [first.clone(), thrice(&mut rng, 10), first];
        let (rays, tiles) = (rays(&mut rng, 300, 1.5, Vec3::ZERO), tiles(&mut rng, 8, 1.5, Vec3::ZERO));
        assert!(check(&make(&meshes), &rays, &tiles) > 60);
    }
}

/// Instances that coincide in pairs and triples, some of them nested, over leaves that list triangles several times.
fn coinciding(make: MakeObject, order: usize) -> Object {
    let mut rng = Rng::new(92);
    let leaf = make(&[thrice(&mut rng, 12)]);
    let places = placements();
    let pair = vec![instance(&leaf, places[1], 0), instance(&leaf, Affine3A::IDENTITY, 1)];
    let pair = Arc::new(Object::new(leaf.triangles().cloned(), pair).expect("valid"));
    let far = |i: usize| Affine3A::from_translation(Vec3::splat(3.0 + i as f32));
    let place = |i: usize| if i % 5 == 4 { far(i) } else { places[i * 7 % places.len()] };
    let object = |i: usize| if i.is_multiple_of(3) { &pair } else { &leaf };
    let wanted: Vec<_> = (0..14).map(|i| instance(object(i), place(i), i as u32)).collect();
    if order == 0 {
        return Object::new(leaf.triangles().cloned(), wanted).expect("valid");
    }
    // Somewhere else first, then to their places one after the other, in other orders.
    let elsewhere = |i: usize| Affine3A::from_translation(Vec3::X * (i * order) as f32);
    let elsewhere =
        wanted.iter().enumerate().map(|(i, to)| Instance { parent_from_object: elsewhere(i), ..to.clone() });
    let mut object = Object::new(leaf.triangles().cloned(), elsewhere.collect()).expect("valid");
    for step in 0..wanted.len() {
        let index = step * (2 * order - 1) % wanted.len();
        let mut change = [InstanceChange { index, instance: wanted[index].clone() }];
        object.update(&mut change).expect("valid");
    }
    object
}

#[test]
fn of_coinciding_instances_the_first_path_is_hit() {
    for make in ACCELERATORS {
        let root = Arc::new(coinciding(make, 0));
        let mut rng = Rng::new(93);
        let (rays, tiles) = (rays(&mut rng, 200, 1.5, Vec3::ZERO), tiles(&mut rng, 6, 1.5, Vec3::ZERO));
        assert!(check(&root, &rays, &tiles) > 60);
    }
}

/// Hits are the same bit for bit.
fn assert_same(a: &Walks, b: &Walks, what: &str) {
    assert_eq!(a.single, b.single, "{what}: single");
    assert_eq!(a.batch, b.batch, "{what}: batch");
    assert_eq!(a.tiles, b.tiles, "{what}: tiles");
}

#[test]
fn the_order_of_updates_leaves_no_trace() {
    let mut rng = Rng::new(94);
    let (rays, tiles) = (rays(&mut rng, 300, 1.5, Vec3::ZERO), tiles(&mut rng, 8, 1.5, Vec3::ZERO));
    for make in ACCELERATORS {
        let fresh = walks(&Arc::new(coinciding(make, 0)), Isa::best(), &rays, &tiles);
        for order in [1, 2, 3, 6] {
            let updated = Arc::new(coinciding(make, order));
            assert_same(&fresh, &walks(&updated, Isa::best(), &rays, &tiles), &format!("order {order}"));
        }
    }
}

#[test]
fn refits_and_builders_leave_no_trace() {
    let mut rng = Rng::new(95);
    let meshes = [thrice(&mut rng, 60), thrice(&mut rng, 8)];
    let elsewhere = meshes.each_ref().map(|mesh| {
        let positions: Vec<Vec3> = mesh.positions.iter().map(|&p| p + rng.vec()).collect();
        Mesh::new(positions, mesh.indices.clone())
    });
    let (rays, tiles) = (rays(&mut rng, 300, 1.5, Vec3::ZERO), tiles(&mut rng, 8, 1.5, Vec3::ZERO));
    let root =
        |tree: TriangleBvh| Arc::new(Object::new(Some(tree.into()), Vec::new()).expect("no instances"));
    let build = |meshes: &[Mesh], options: &BuildOptions| TriangleBvh::build(meshes, options).expect("valid");
    let expected = walks(&root(build(&meshes, &all_builders()[0])), Isa::best(), &rays, &tiles);
    for options in all_builders() {
        let fresh = walks(&root(build(&meshes, &options)), Isa::best(), &rays, &tiles);
        // A ray in the edge of a triangle may pass for another group's in the tiles of another tree.
        assert_eq!((&fresh.single, &fresh.batch), (&expected.single, &expected.batch), "{options:?}");
        let mut tree = build(&elsewhere, &options);
        tree.refit(&meshes).expect("the same numbers");
        assert_same(&fresh, &walks(&root(tree), Isa::best(), &rays, &tiles), "refitted");
    }
}

/// A square in the plane y = 0 of `cells`² cells of two triangles each.
fn floor(cells: u32) -> Mesh {
    let row = cells + 1;
    let at =
        |i: u32| Vec3::new((i % row) as f32, 0.0, (i / row) as f32) / cells as f32 - Vec3::new(0.5, 0.0, 0.5);
    let quads = (0..cells * cells).map(|q| q % cells + q / cells * row);
    let indices: Vec<[u32; 3]> =
        quads.flat_map(|a| [[a, a + row, a + row + 1], [a, a + row + 1, a + 1]]).collect();
    Mesh::new((0..row * row).map(at).collect::<Vec<_>>(), indices)
}

#[test]
fn coplanar_instances_are_the_same_to_every_walk() {
    let mut rng = Rng::new(96);
    for make in HIERARCHIES {
        let leaves = [make(&[floor(3)]), make(&[floor(4)]), make(&[floor(7)])];
        let place = |i: usize| {
            let shift = Vec3::new((i % 4) as f32, 0.0, (i / 4) as f32) * 0.25;
            let turn = Quat::from_rotation_y((i % 3) as f32);
            Affine3A::from_rotation_translation(turn, shift - Vec3::new(0.5, 0.0, 0.5))
        };
        let instances = (0..12).map(|i| instance(&leaves[i % 3], place(i), i as u32)).collect();
        let root = Arc::new(Object::new(None, instances).expect("valid"));
        let mut tile = Tile::new(Vec3::new(0.3, 1.1, -0.2));
        for _ in 0..Tile::CAPACITY {
            tile.push(Vec3::new(rng.signed() * 0.4, -1.0, rng.signed() * 0.4), f32::INFINITY);
        }
        let rays: Vec<Ray> = (0..tile.len()).map(|i| tile.ray(i).expect("in range")).collect();
        for isa in Isa::available() {
            let walks = walks(&root, isa, &rays, &[tile.clone()]);
            let differ = |a: &[Hit], b: &[Hit]| a.iter().zip(b).filter(|(a, b)| a != b).count();
            assert_eq!(walks.single, walks.batch, "{isa}");
            // Triangles overlap by a rounding in tiles, where an edge is shared.
            assert!(differ(&walks.single, &walks.tiles[0]) <= 2, "{isa}");
            assert!(walks.single.iter().filter(|hit| hit.is_hit()).count() > 100);
        }
    }
}

#[test]
fn of_equal_spheres_the_first_is_hit() {
    let sphere = |x: f32| Quadric::Sphere { center: Vec3::X * x, radius: 0.5 };
    let lists = [[sphere(0.0), sphere(0.25), sphere(0.0)], [sphere(0.25), sphere(-0.5), sphere(0.0)]];
    let quadrics = Quadrics::build([(1, &lists[0][..]), (0, &lists[1][..])]).expect("few");
    let mut leaf = Object::empty();
    leaf.set_quadrics(Some(Arc::new(quadrics)));
    let leaf = Arc::new(leaf);
    let children = placements().into_iter().chain(placements()).zip(0..);
    let children: Vec<_> = children.map(|(place, id)| instance(&leaf, place, id)).collect();
    let mut root = Object::new(None, children.clone()).expect("valid");
    root.set_quadrics(leaf.quadrics().cloned());
    let mut rng = Rng::new(97);
    let rays = rays(&mut rng, 200, 1.5, Vec3::ZERO);
    let tiles = tiles(&mut rng, 6, 1.5, Vec3::ZERO);
    let walks = walks(&Arc::new(root), Isa::best(), &rays, &tiles);
    let mut seen = 0;
    for hit in walks.single.iter().chain(&walks.batch).chain(walks.tiles.iter().flatten()) {
        if hit.is_hit() {
            seen += 1;
            // Of those at (0, 0.25, −0.5): never a later one of the same place, and never the later instance.
            assert!([(0, 2), (0, 0), (0, 1)].contains(&(hit.geometry, hit.primitive)), "{hit:?}");
            assert!(hit.path.0 < 5, "{hit:?}");
        }
    }
    assert!(seen > 300, "{seen}");
}

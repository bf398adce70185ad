//! What a ray meets depends on the ray and the scene, bit for bit: not on how the trees came about, nor on the walk that
//! takes it through them. Attacked with rays aimed at edges and corners of meshes, where one rounding more decides.
mod common;

use std::{f32::consts::TAU, sync::Arc};

use common::{Rng, hunt, object};
use heliostat_kernel::{
    BuildOptions, Hit, Instance, InstanceChange, Isa, Mesh, Object, Quadrics, Ray, RayQuery, Tile,
    TriangleBvh, World,
    glam::{Affine3A, Mat3, Quat, Vec3},
};

/// A tube along x with waves, closed around, and rays of triangles through it that meet its walls at slanting lines.
fn tube(around: u32, along: u32, radius: f32, wave: impl Fn(f32, f32) -> Vec3) -> Mesh {
    let point = |i: u32| {
        let (a, x) = ((i % around) as f32 / around as f32, (i / around) as f32 / along as f32 - 0.5);
        let (s, c) = (a * TAU).sin_cos();
        Vec3::new(x, radius * c, radius * s) + wave(x, a)
    };
    let quads = (0..around * along).map(|q| (q, q / around * around + (q + 1) % around));
    let indices: Vec<_> =
        quads.flat_map(|(a, b)| [[a, b, b + around], [a, b + around, a + around]]).collect();
    Mesh::new((0..around * (along + 1)).map(point).collect::<Vec<_>>(), indices)
}

fn waves(x: f32, a: f32) -> Vec3 {
    Vec3::new(0.0, 0.02 * (x * 40.0).sin(), 0.02 * (x * 31.0 + a * TAU).cos())
}

/// The mesh with its points elsewhere.
fn twisted(mesh: &Mesh, by: f32) -> Mesh {
    let place = |p: &Vec3| Quat::from_rotation_x(p.x * by) * *p * Vec3::new(1.0 + 0.3 * p.y, 1.0, 1.0);
    Mesh::new(mesh.positions.iter().map(place).collect::<Vec<_>>(), mesh.indices.clone())
}

/// An object of `mesh` whose tree was built for another shape.
fn refitted(mesh: &Mesh, before: &Mesh) -> Arc<Object> {
    let mut tree = TriangleBvh::build(std::slice::from_ref(before), &BuildOptions::default()).expect("valid");
    tree.refit(std::slice::from_ref(mesh)).expect("the same topology");
    Arc::new(Object::new(Some(tree.into()), Vec::new()).expect("no instances"))
}

/// The same object, never opened in the tree over its instances: spheres, of which there are none, could be anywhere.
fn closed(object: &Object) -> Arc<Object> {
    let mut closed = object.clone();
    closed.set_quadrics(Some(Arc::new(Quadrics::build([]).expect("none"))));
    Arc::new(closed)
}

fn placed(object: &Arc<Object>, places: &[Affine3A]) -> Vec<Instance> {
    let place =
        |(&parent_from_object, id)| Instance { object: object.clone(), parent_from_object, motion: None, id };
    places.iter().zip(0..).map(place).collect()
}

fn heap(object: &Arc<Object>, places: &[Affine3A]) -> Object {
    Object::new(None, placed(object, places)).expect("valid")
}

/// In all directions, mirrored and sheared, some moved alone.
fn places(rng: &mut Rng, count: usize) -> Vec<Affine3A> {
    let place = |i: usize| {
        let turn = Quat::from_xyzw(rng.signed(), rng.signed(), rng.signed(), rng.signed()).normalize();
        let shape = match i % 4 {
            0 => Mat3::IDENTITY,
            1 => Mat3::from_quat(turn) * Mat3::from_cols(Vec3::X, Vec3::new(0.5, -1.0, 0.0), Vec3::Z),
            _ => Mat3::from_quat(turn),
        };
        Affine3A::from_mat3_translation(shape, rng.vec() * 0.6)
    };
    (0..count).map(place).collect()
}

/// Points on edges and at corners of the mesh.
fn targets(rng: &mut Rng, mesh: &Mesh, count: usize) -> Vec<Vec3> {
    let target = |i: usize| {
        let triangle = mesh.indices[rng.below(mesh.indices.len())];
        let [a, b] = [triangle[i % 3], triangle[(i + 1) % 3]].map(|corner| mesh.positions[corner as usize]);
        if i.is_multiple_of(5) { a } else { a.lerp(b, rng.unit()) }
    };
    (0..count).map(target).collect()
}

/// Rays from one place to targets, as a tile holds them.
fn aimed(from: Vec3, targets: &[Vec3]) -> Tile {
    let mut tile = Tile::new(from);
    for target in targets {
        tile.push(target - from, f32::INFINITY);
    }
    tile
}

/// The answers of a world: closest hits by tiles, by batches and one by one, and what is occluded.
struct Answers {
    hits: [Vec<Hit>; 3],
    dark: [Vec<bool>; 3],
}

fn answers(root: &Arc<Object>, isa: Isa, tile: &Tile) -> Answers {
    let world = World::with_isa(root.clone(), isa).expect("available");
    let rays: Vec<Ray> = (0..tile.len()).map(|i| tile.ray(i).expect("in range")).collect();
    let mut hits = [(); 3].map(|()| vec![Hit::MISS; rays.len()]);
    let mut dark = [(); 3].map(|()| vec![false; rays.len()]);
    world.intersect_tile(tile, &mut hits[0]);
    world.occluded_tile(tile, &mut dark[0]);
    world.intersect(&rays, &mut hits[1]);
    world.occluded(&rays, &mut dark[1]);
    for (i, ray) in rays.chunks(1).enumerate() {
        world.intersect(ray, &mut hits[2][i..=i]);
        world.occluded(ray, &mut dark[2][i..=i]);
    }
    Answers { hits, dark }
}

/// Every walk gives the same answers in all worlds: those of single rays in the first one.
fn assert_same(worlds: &[Arc<Object>], tiles: &[Tile], what: &str) {
    let mut others = [[0; 3]; 2];
    for isa in Isa::available() {
        for tile in tiles {
            let expected = answers(&worlds[0], isa, tile);
            for world in worlds {
                let got = answers(world, isa, tile);
                for walk in [0, 1, 2] {
                    others[0][walk] += differing(&got.hits[walk], &expected.hits[2]);
                    others[1][walk] += differing(&got.dark[walk], &expected.dark[2]);
                }
            }
        }
    }
    assert_eq!(others, [[0; 3]; 2], "{what}: hits and occlusion, by tiles, batches and single rays");
}

fn differing<T: PartialEq>(a: &[T], b: &[T]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a != b).count()
}

/// Tiles of rays at targets from near and far, narrow and wide.
fn attack(rng: &mut Rng, count: usize, mut targets: impl FnMut(&mut Rng, usize) -> Vec<Vec3>) -> Vec<Tile> {
    let tile = |i: usize| {
        let from = rng.vec().normalize() * [0.3, 1.5, 20.0, 300.0][i % 4];
        let count = if i.is_multiple_of(3) { 1 + rng.below(20) } else { Tile::CAPACITY };
        aimed(from, &targets(rng, count))
    };
    (0..count).map(tile).collect()
}

#[test]
fn trees_of_triangles() {
    for round in 0..hunt(2) {
        let mut rng = Rng::new(201 + round);
        let mesh = tube(9, 60, 0.2, waves);
        let before = [twisted(&mesh, 7.0), twisted(&mesh, -20.0)];
        let worlds =
            [object(std::slice::from_ref(&mesh)), refitted(&mesh, &before[0]), refitted(&mesh, &before[1])];
        let tiles = attack(&mut rng, 24, |rng, count| targets(rng, &mesh, count));
        assert_same(&worlds, &tiles, &format!("round {round}"));
    }
}

#[test]
fn trees_of_instances() {
    for round in 0..hunt(2) {
        let mut rng = Rng::new(301 + round);
        let mesh = tube(6, 80, 0.01, |_, _| Vec3::ZERO);
        let now = places(&mut rng, 60);
        let fresh = object(std::slice::from_ref(&mesh));
        let worn = refitted(&mesh, &twisted(&mesh, 30.0));
        let mut moved = heap(&worn, &places(&mut rng, 60));
        for (index, instance) in placed(&fresh, &now).into_iter().enumerate() {
            moved.update(&mut [InstanceChange { index, instance }]).expect("valid");
        }
        let worlds =
            [heap(&fresh, &now), heap(&worn, &now), heap(&closed(&fresh), &now), moved].map(Arc::new);
        let tiles = attack(&mut rng, 24, |rng, count| {
            let place = now[rng.below(now.len())];
            let near = targets(rng, &mesh, count);
            near.into_iter()
                .enumerate()
                .map(|(i, p)| {
                    let place = if i % 2 == 0 { place } else { now[rng.below(now.len())] };
                    place.transform_point3(p)
                })
                .collect()
        });
        assert_same(&worlds, &tiles, &format!("round {round}"));
    }
}

/// Rays from about one place to seams of about one part of the mesh: what a packet keeps together, as behind a mirror, or
/// not at all.
fn neighbours(rng: &mut Rng, mesh: &Mesh, place: &Affine3A, i: usize) -> Vec<Ray> {
    let from = rng.vec().normalize() * [0.3, 1.5, 20.0][i % 3];
    let (spread, triangles) = [(1.0e-4, 1), (0.02, 6), (0.3, 40)][i / 3 % 3];
    let first = rng.below(mesh.indices.len());
    let ray = |j: usize| {
        let triangle = mesh.indices[(first + rng.below(triangles)) % mesh.indices.len()];
        let [a, b] = [j % 3, (j + 1) % 3].map(|k| mesh.positions[triangle[k] as usize]);
        let target = place.transform_point3(a.lerp(b, if j.is_multiple_of(5) { 0.0 } else { rng.unit() }));
        let origin = from + rng.vec() * spread;
        match j % 4 {
            0 => Ray::segment(origin, target),
            1 => Ray::segment(target, origin),
            _ => Ray::new(origin, target - origin),
        }
    };
    (0..8 + i % 50).map(ray).collect()
}

/// Short rays every way from about one place near seams: a packet keeps them together though their signs differ.
fn short_rays(rng: &mut Rng, mesh: &Mesh, place: &Affine3A, i: usize) -> Vec<Ray> {
    let length = [0.02, 0.1, 0.3][i % 3];
    let first = rng.below(mesh.indices.len());
    let [a, b, _] = mesh.indices[first].map(|k| mesh.positions[k as usize]);
    let from = a.lerp(b, rng.unit());
    let ray = |j: usize| {
        let origin = from + rng.vec() * (0.3 * length);
        let triangle = mesh.indices[(first + rng.below(6)) % mesh.indices.len()];
        let [a, b] = [j % 3, (j + 1) % 3].map(|k| mesh.positions[triangle[k] as usize]);
        let direction = if j.is_multiple_of(2) { a.lerp(b, rng.unit()) - origin } else { rng.vec() };
        let direction = direction.normalize_or(Vec3::X) * length * rng.unit().max(0.1);
        let (origin, end) = (place.transform_point3(origin), place.transform_point3(origin + direction));
        Ray { t_max: if j.is_multiple_of(5) { 2.0 } else { 1.0 }, ..Ray::segment(origin, end) }
    };
    (0..8 + i % 50).map(ray).collect()
}

type MakeRays = fn(&mut Rng, &Mesh, &Affine3A, usize) -> Vec<Ray>;

#[test]
fn batches_of_neighbours() {
    batches(401, neighbours);
}

#[test]
fn batches_of_short_rays() {
    batches(501, short_rays);
}

fn batches(seed: u64, make: MakeRays) {
    let alone = [Affine3A::IDENTITY];
    for round in 0..hunt(2) {
        let mut rng = Rng::new(seed + round);
        let (thick, thin) = (tube(9, 60, 0.2, waves), tube(6, 80, 0.01, |_, _| Vec3::ZERO));
        let many = places(&mut rng, 60);
        let heaped = Arc::new(heap(&object(std::slice::from_ref(&thin)), &many));
        let cases = [(object(std::slice::from_ref(&thick)), &thick, &alone[..]), (heaped, &thin, &many[..])];
        for (root, mesh, places) in cases {
            for i in 0..180 {
                let rays = make(&mut rng, mesh, &places[i % places.len()], i);
                for isa in Isa::available() {
                    let world = World::with_isa(root.clone(), isa).expect("available");
                    assert_as_alone(&world, &rays, &format!("{isa} {round} {i}"));
                }
            }
        }
    }
}

/// A batch's answers are those of its rays one by one.
fn assert_as_alone(world: &World, rays: &[Ray], what: &str) {
    let (mut hits, mut dark) = ([Hit::MISS; 64], [false; 64]);
    world.intersect(rays, &mut hits[..rays.len()]);
    world.occluded(rays, &mut dark[..rays.len()]);
    for (j, ray) in rays.iter().enumerate() {
        let (mut hit, mut occluded) = ([Hit::MISS], [false]);
        world.intersect(std::slice::from_ref(ray), &mut hit);
        world.occluded(std::slice::from_ref(ray), &mut occluded);
        assert_eq!((hits[j], dark[j]), (hit[0], occluded[0]), "{what} {j}: {ray:?}");
    }
}

//! Instances that overlap much are opened in the tree over them: nobody can tell by the answers.
mod common;

use std::{f32::consts::TAU, sync::Arc};

use common::{Rng, check_all, hunt, object, rays, tiles};
use heliostat_kernel::{
    Hit, Instance, InstanceChange, Isa, Mesh, Object, Quadrics, Ray, RayQuery, Tile, UpdateKind, World,
    glam::{Affine3A, Mat3, Quat, Vec3, Vec3A},
};

/// A long thin rod along x.
fn rod() -> Arc<Object> {
    let (around, along) = (6, 200);
    let ring = |i: u32| {
        let (s, c) = ((i % around) as f32 * TAU / around as f32).sin_cos();
        Vec3::new((i / around) as f32 / along as f32 - 0.5, 0.01 * c, 0.01 * s)
    };
    let quads = (0..around * along).map(|q| (q, q / around * around + (q + 1) % around));
    let indices: Vec<_> =
        quads.flat_map(|(a, b)| [[a, b, b + around], [a, b + around, a + around]]).collect();
    object(&[Mesh::new((0..around * (along + 1)).map(ring).collect::<Vec<_>>(), indices)])
}

/// The same, but never opened: spheres, of which there are none, could be anywhere in it.
fn closed(rod: &Object) -> Arc<Object> {
    let mut closed = rod.clone();
    closed.set_quadrics(Some(Arc::new(Quadrics::build([]).expect("none"))));
    Arc::new(closed)
}

/// Places in all directions: turned, mirrored, sheared.
fn places(rng: &mut Rng, count: usize) -> Vec<Affine3A> {
    let place = |i: usize| {
        let turn = Quat::from_xyzw(rng.signed(), rng.signed(), rng.signed(), rng.signed()).normalize();
        let shear = Mat3::from_cols(Vec3::X, Vec3::new(0.5, -1.0, 0.0), Vec3::Z);
        let shape = Mat3::from_quat(turn) * if i.is_multiple_of(3) { shear } else { Mat3::IDENTITY };
        Affine3A::from_mat3_translation(shape, rng.vec() * 0.7)
    };
    (0..count).map(place).collect()
}

fn instances(object: &Arc<Object>, places: &[Affine3A]) -> Vec<Instance> {
    let instance =
        |(&parent_from_object, id)| Instance { object: object.clone(), parent_from_object, motion: None, id };
    places.iter().zip(0..).map(instance).collect()
}

fn sah(object: &mut Object) -> f32 {
    object.update(&mut []).expect("nothing to do").sah
}

/// What all walks on all instruction sets find; any hit agrees.
fn walks(object: &Object, rays: &[Ray], tile: &Tile) -> Vec<[Vec<Hit>; 3]> {
    let root = Arc::new(object.clone());
    let on = |isa| {
        let world = World::with_isa(root.clone(), isa).expect("available");
        let mut hits =
            [vec![Hit::MISS; rays.len()], vec![Hit::MISS; rays.len()], vec![Hit::MISS; tile.len()]];
        world.intersect(rays, &mut hits[0]);
        for (ray, hit) in rays.chunks(1).zip(hits[1].chunks_mut(1)) {
            world.intersect(ray, hit);
        }
        world.intersect_tile(tile, &mut hits[2]);
        let mut dark = [vec![false; rays.len()], vec![false; tile.len()]];
        world.occluded(rays, &mut dark[0]);
        world.occluded_tile(tile, &mut dark[1]);
        for (hits, dark) in [&hits[0], &hits[2]].into_iter().zip(&dark) {
            assert!(hits.iter().zip(dark).all(|(hit, dark)| hit.is_hit() == *dark), "{isa}");
        }
        hits
    };
    Isa::available().into_iter().map(on).collect()
}

#[test]
fn heaps_are_opened_and_answers_stay() {
    for round in 0..hunt(1) {
        let mut rng = Rng::new(101 + round);
        let rod = rod();
        let mut places = places(&mut rng, 60);
        let mut heap = Object::new(None, instances(&rod, &places)).expect("valid");
        for step in [7, 1, 20] {
            let mut whole = Object::new(None, instances(&closed(&rod), &places)).expect("valid");
            assert_ne!(sah(&mut heap), sah(&mut whole), "opened, it has other leaves");
            assert_eq!((heap.bounds(), heap.path_count()), (whole.bounds(), whole.path_count()));
            let mut tile = Tile::new(Vec3::new(0.3, 0.2, 2.0));
            while tile.push(rng.vec() * 0.7 - tile.origin(), f32::INFINITY).is_some() {}
            let rays: Vec<_> = (0..2000).map(|_| Ray::new(rng.vec() * 1.5, rng.vec())).collect();
            let (opened, whole) = (walks(&heap, &rays, &tile), walks(&whole, &rays, &tile));
            assert_eq!(opened, whole);
            assert!(opened[0].iter().all(|hits| hits.iter().filter(|hit| hit.is_hit()).count() > 20));
            // Moved, all or a few: the parts move along.
            let mut changes = Vec::new();
            for index in (0..places.len()).step_by(step) {
                places[index].translation += Vec3A::from(rng.vec() * 0.3);
                let instance = instances(&rod, &places[index..=index]).remove(0);
                changes.push(InstanceChange { index, instance: Instance { id: index as u32, ..instance } });
            }
            heap.update(&mut changes).expect("valid");
        }
    }
}

#[test]
fn heaps_agree_with_the_oracle() {
    let mut rng = Rng::new(102);
    let heap = Object::new(None, instances(&rod(), &places(&mut rng, 25))).expect("valid");
    // Below another object, too.
    let turned = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.5), Vec3::X);
    let root = Object::new(None, instances(&Arc::new(heap), &[Affine3A::IDENTITY, turned])).expect("valid");
    let (rays, tiles) = (rays(&mut rng, 150, 1.0, Vec3::ZERO), tiles(&mut rng, 4, 1.0, Vec3::ZERO));
    check_all(&Arc::new(root), &rays, &tiles, 2.0e-6 * 3.0 * 8.0);
}

#[test]
fn what_lies_apart_stays_whole() {
    let rod = rod();
    let row: Vec<_> = (0..60).map(|i| Affine3A::from_translation(Vec3::Y * i as f32)).collect();
    let row_of = |rod: &Arc<Object>| Object::new(None, instances(rod, &row)).expect("valid");
    assert_eq!(sah(&mut row_of(&rod)), sah(&mut row_of(&closed(&rod))));
}

#[test]
fn other_objects_are_opened_otherwise() {
    let mut rng = Rng::new(103);
    let places = places(&mut rng, 60);
    let rod = rod();
    let mut heap = Object::new(None, instances(&rod, &places)).expect("valid");
    let small = object(&[Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])]);
    let seen = |heap: &Object| {
        let from = places[7].transform_point3(Vec3::new(0.2, 0.3, 1.0e-3));
        let mut hits = [Hit::MISS];
        let ray = Ray::new(from, -places[7].transform_vector3(Vec3::Z));
        World::new(Arc::new(heap.clone())).intersect(&[ray], &mut hits);
        (hits[0].path.0, hits[0].primitive)
    };
    let before = seen(&heap);
    assert_ne!(before, (8, 0));
    let mut change = |object| {
        let placed = instances(object, &places[7..8]).remove(0);
        heap.update(&mut [InstanceChange { index: 7, instance: placed }]).expect("valid");
        seen(&heap)
    };
    // Fewer leaves than before, and then as many again.
    assert_eq!(change(&small), (8, 0));
    assert_eq!(change(&rod), before);
}

#[test]
fn turning_opens_and_closes() {
    let mut rng = Rng::new(104);
    let (rod, askew) = (rod(), places(&mut rng, 60));
    let straight: Vec<_> =
        askew.iter().map(|place| Affine3A::from_translation(place.translation.into())).collect();
    let heap_of = |places: &[Affine3A]| Object::new(None, instances(&rod, places)).expect("valid");
    let rays: Vec<_> = (0..2000).map(|_| Ray::new(rng.vec() * 1.5, rng.vec())).collect();
    let tile = Tile::new(Vec3::ZERO);
    let mut heap = heap_of(&straight);
    assert_eq!(
        sah(&mut heap),
        sah(&mut Object::new(None, instances(&closed(&rod), &straight)).expect("valid"))
    );
    for places in [&askew, &straight, &askew] {
        let all = instances(&rod, places).into_iter().enumerate();
        let mut changes: Vec<_> = all.map(|(index, instance)| InstanceChange { index, instance }).collect();
        // One after the other, and at last all in one place.
        for change in changes.chunks_mut(7) {
            heap.update(change).expect("valid");
        }
        assert_eq!(walks(&heap, &rays, &tile), walks(&heap_of(places), &rays, &tile));
    }
    let update = heap.update(&mut []).expect("nothing to do");
    assert_ne!(update.kind, UpdateKind::Rebuilt);
}

/// Rays that pass between the parts of an opened mesh are met by one of them, from near and far.
#[test]
fn parts_leave_no_gaps() {
    let mut rng = Rng::new(105);
    let (rows, columns) = (4_u32, 200_u32);
    let point = |i: u32| Vec3::new((i / (rows + 1)) as f32, 0.0, (i % (rows + 1)) as f32) / columns as f32;
    let quads = (0..rows * columns).map(|q| q % rows + q / rows * (rows + 1));
    let indices: Vec<_> =
        quads.flat_map(|a| [[a, a + 1, a + rows + 2], [a, a + rows + 2, a + rows + 1]]).collect();
    let points: Vec<_> = (0..(rows + 1) * (columns + 1)).map(point).collect();
    let strip = object(&[Mesh::new(points, indices)]);
    let width = rows as f32 / columns as f32;
    for round in 0..10 * hunt(2) {
        let far = [2.0, 30.0, 1000.0][round as usize % 3];
        // Turned about, but never along an axis.
        let turn = Quat::from_rotation_x(rng.signed() * 3.0) * Quat::from_rotation_y(0.6 + 0.3 * rng.unit());
        let turn = Quat::from_rotation_z(0.6 + 0.3 * rng.unit()) * turn;
        let place = Affine3A::from_rotation_translation(turn, rng.vec() * [0.0, 1.0, 50.0][rng.below(3)]);
        let mut heap = Object::new(None, instances(&strip, &[place])).expect("valid");
        assert_ne!(sah(&mut heap), 5.0, "a node and a leaf, were it not opened");
        let normal = place.transform_vector3(Vec3::Y);
        let origin = place.transform_point3(Vec3::X * 0.5) + (normal + rng.vec() * 0.5) * far;
        let mut tile = Tile::new(origin);
        let mut rays = Vec::new();
        for _ in 0..4000 {
            // On the lines between cells, and so often on those between parts.
            let line = (1 + rng.below(columns as usize - 1)) as f32 / columns as f32;
            let to = place.transform_point3(Vec3::new(line, 0.0, width * (0.3 + 0.4 * rng.unit())));
            rays.push(Ray::new(origin, to - origin));
            tile.push(to - origin, f32::INFINITY);
        }
        for hits in walks(&heap, &rays, &tile) {
            assert!(hits.iter().flatten().all(Hit::is_hit), "round {round}");
        }
    }
}

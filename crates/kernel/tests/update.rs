//! Objects whose instances move: an updated object answers as a new one does, and errors leave it alone.
mod common;
use std::sync::Arc;

use common::{Rng, check_all, hunt, object, rays, soup, tiles};
use heliostat_kernel::{
    BuildError, Instance, InstanceChange, Mesh, Object, PathId, UpdateKind, World,
    glam::{Affine3A, Mat3, Quat, Vec3},
};

fn placement(rng: &mut Rng, spread: f32) -> Affine3A {
    let turn = Quat::from_xyzw(rng.signed(), rng.signed(), rng.signed(), rng.signed()).normalize();
    let scale = Vec3::new(rng.signed().signum(), 0.5 + rng.unit(), 1.0);
    Affine3A::from_mat3_translation(Mat3::from_quat(turn) * Mat3::from_diagonal(scale), rng.vec() * spread)
}

fn instance(rng: &mut Rng, objects: &[Arc<Object>], spread: f32) -> Instance {
    let object = Arc::clone(&objects[rng.below(objects.len())]);
    Instance { object, parent_from_object: placement(rng, spread), motion: None, id: rng.bits() }
}

/// Leaves of several sizes, one with nothing in it, and one with instances of its own.
fn objects(rng: &mut Rng) -> Vec<Arc<Object>> {
    let mut objects: Vec<_> =
        [1, 3, 12].into_iter().map(|count| object(&[soup(rng, count, 0.5, 0.5, Vec3::ZERO)])).collect();
    let pair = (0..2).map(|_| instance(rng, &objects, 1.0)).collect();
    objects.push(Arc::new(Object::new(None, pair).expect("valid")));
    objects.push(Arc::new(Object::empty()));
    objects
}

/// Some instances, each once, in order.
fn changes(
    rng: &mut Rng,
    count: usize,
    share: f32,
    objects: &[Arc<Object>],
    spread: f32,
) -> Vec<InstanceChange> {
    let chosen: Vec<_> = (0..count).filter(|_| rng.unit() < share).collect();
    chosen
        .into_iter()
        .map(|index| InstanceChange { index, instance: instance(rng, objects, spread) })
        .collect()
}

/// Everything that a caller sees of two objects but the order of their trees.
fn assert_same(a: &Object, b: &Object) {
    assert_eq!(a.bounds(), b.bounds());
    assert_eq!((a.depth(), a.path_count()), (b.depth(), b.path_count()));
    let paths = |object: &Object| {
        let mut list = Vec::new();
        let world = World::new(Arc::new(object.clone()));
        world.for_each_path(&mut |path, place, ids, object| {
            let resolved = world.resolve(path).expect("visited");
            assert_eq!((resolved.ids.as_slice(), resolved.world_from_object), (ids, *place));
            list.push((path, *place, ids.to_vec(), object.bounds()));
        });
        list
    };
    assert!(paths(a) == paths(b));
}

#[test]
fn updated_objects_answer_like_new_ones() {
    let mut rng = Rng::new(71);
    let objects = objects(&mut rng);
    let mut kinds = Vec::new();
    for round in 0..hunt(6) {
        let count = [1, 7, 300][round as usize % 3];
        let instances = (0..count).map(|_| instance(&mut rng, &objects, 4.0)).collect();
        let mut updated = Object::new(None, instances).expect("valid");
        for (share, spread) in [(0.01, 4.0), (1.0, 4.0), (0.05, 9.0), (0.4, 1.0)] {
            let mut changes = changes(&mut rng, count, share, &objects, spread);
            kinds.push(updated.update(&mut changes).expect("valid").kind);
        }
        let fresh = Object::new(None, updated.instances().cloned().collect()).expect("valid");
        assert_same(&updated, &fresh);
        let (rays, tiles) = (rays(&mut rng, 100, 4.0, Vec3::ZERO), tiles(&mut rng, 4, 4.0, Vec3::ZERO));
        check_all(&Arc::new(updated), &rays, &tiles, 2.0e-6 * 10.0 * 8.0);
    }
    for kind in [UpdateKind::RefittedPaths, UpdateKind::Refitted, UpdateKind::Rebuilt] {
        assert!(kinds.contains(&kind), "{kind:?} never happened: {kinds:?}");
    }
}

#[test]
fn applying_again_takes_back() {
    let mut rng = Rng::new(72);
    let objects = objects(&mut rng);
    let before =
        Object::new(None, (0..200).map(|_| instance(&mut rng, &objects, 4.0)).collect()).expect("valid");
    for share in [0.01, 0.3, 1.0] {
        let mut object = before.clone();
        let mut changes = changes(&mut rng, 200, share, &objects, 8.0);
        object.update(&mut changes).expect("valid");
        assert_ne!(object.bounds(), before.bounds());
        object.update(&mut changes).expect("was valid before");
        assert_same(&object, &before);
    }
}

#[test]
fn a_child_that_grew_is_found() {
    let mut rng = Rng::new(73);
    let small = object(&[Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])]);
    let large = object(&[Mesh::new(vec![Vec3::ZERO, Vec3::X * 9.0, Vec3::Y * 9.0], vec![[0, 1, 2]])]);
    let instances = (0..50).map(|_| instance(&mut rng, std::slice::from_ref(&small), 5.0)).collect();
    let mut object = Object::new(None, instances).expect("valid");
    let mut grown = object.instances().nth(20).expect("50 of them").clone();
    grown.object = large;
    object.update(&mut [InstanceChange { index: 20, instance: grown }]).expect("valid");
    let (rays, tiles) = (rays(&mut rng, 300, 9.0, Vec3::ZERO), tiles(&mut rng, 8, 9.0, Vec3::ZERO));
    check_all(&Arc::new(object), &rays, &tiles, 2.0e-6 * 20.0 * 8.0);
}

#[test]
fn far_moves_are_reported_and_mended() {
    let mut rng = Rng::new(74);
    let cube = [object(&[soup(&mut rng, 12, 0.1, 0.1, Vec3::ZERO)])];
    let mut object =
        Object::new(None, (0..2000).map(|_| instance(&mut rng, &cube, 5.0)).collect()).expect("valid");
    let one = |rng: &mut Rng, index| [InstanceChange { index, instance: instance(rng, &cube, 5.0) }];
    let update = object.update(&mut one(&mut rng, 1000)).expect("valid");
    assert_eq!(update.kind, UpdateKind::RefittedPaths);
    assert!(update.nodes <= 8, "{update:?}");
    assert!(update.sah_refitted == update.sah && update.sah <= 1.3 * update.sah_at_build, "{update:?}");
    // All change places: the old tree is worthless.
    let mut changes = changes(&mut rng, 2000, 2.0, &cube, 5.0);
    let update = object.update(&mut changes).expect("valid");
    assert_eq!(update.kind, UpdateKind::Rebuilt);
    assert!(update.sah_refitted > 1.3 * update.sah_before && update.sah == update.sah_at_build, "{update:?}");
}

#[test]
fn errors_leave_the_object_as_it_was() {
    let mut rng = Rng::new(75);
    let objects = objects(&mut rng);
    let before =
        Object::new(None, (0..20).map(|_| instance(&mut rng, &objects, 4.0)).collect()).expect("valid");
    let change = |rng: &mut Rng, index| InstanceChange { index, instance: instance(rng, &objects, 4.0) };
    let mut singular = change(&mut rng, 9);
    singular.instance.parent_from_object = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
    let mut moving = change(&mut rng, 9);
    moving.instance.motion = Some(Affine3A::from_translation(Vec3::NAN));
    let cases = [
        (vec![change(&mut rng, 3), singular], BuildError::SingularTransform { instance: 9 }),
        (vec![change(&mut rng, 3), moving], BuildError::NonFiniteTransform { instance: 9 }),
        (
            vec![change(&mut rng, 3), change(&mut rng, 20)],
            BuildError::NoSuchInstance { change: 1, instance: 20, count: 20 },
        ),
        (vec![change(&mut rng, 3), change(&mut rng, 3)], BuildError::UnorderedChanges { change: 1 }),
        (vec![change(&mut rng, 3), change(&mut rng, 2)], BuildError::UnorderedChanges { change: 1 }),
    ];
    let mut object = before.clone();
    for (mut changes, error) in cases {
        assert_eq!(object.update(&mut changes), Err(error));
        assert_same(&object, &before);
    }
    assert_eq!(World::new(Arc::new(object)).resolve(PathId::ROOT).expect("root").ids, []);
}

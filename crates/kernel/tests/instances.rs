//! Worlds of nested instances: transforms of every kind, path ids, shared subtrees, limits.
mod common;
use std::{collections::HashSet, sync::Arc};

use common::{ACCELERATORS, MakeObject, Rng, check_all, hunt, kd_object, object, rays, soup, tiles};
use heliostat_kernel::{
    BuildError, Hit, Instance, MAX_INSTANCE_DEPTH, Mesh, Object, PathId, Ray, RayQuery, World,
    glam::{Affine3A, Mat3, Quat, Vec3},
};

fn turn(rng: &mut Rng) -> Quat {
    Quat::from_xyzw(rng.signed(), rng.signed(), rng.signed(), rng.signed()).normalize()
}

/// Rotated, then mirrored, sheared or scaled by `kind`, then moved.
fn placement(rng: &mut Rng, kind: usize) -> Affine3A {
    let shape = match kind % 4 {
        0 => Mat3::IDENTITY,
        1 => Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)),
        2 => Mat3::from_cols(Vec3::new(1.0, 0.2, 0.0), Vec3::new(0.5, 1.0, -0.3), Vec3::new(0.0, 0.4, 0.9)),
        _ => Mat3::from_diagonal(Vec3::new(0.5, 1.7, 0.9)),
    };
    let turn = Mat3::from_quat(turn(rng));
    Affine3A::from_mat3_translation(turn * shape, rng.vec() * 0.5)
}

fn instance(object: &Arc<Object>, parent_from_object: Affine3A, id: u32) -> Instance {
    Instance { object: Arc::clone(object), parent_from_object, motion: None, id }
}

/// Accelerators of outer and inner objects: of one kind, and mixed.
const PAIRS: [[MakeObject; 2]; 4] =
    [[object, object], [kd_object, kd_object], [object, kd_object], [kd_object, object]];

#[test]
fn one_level_of_every_kind() {
    for [outer, inner] in PAIRS {
        one_level(outer, inner);
    }
}

fn one_level(outer: MakeObject, inner: MakeObject) {
    let mut rng = Rng::new(31);
    let leaf = inner(&[soup(&mut rng, 20, 1.0, 0.7, Vec3::ZERO)]);
    let own = outer(&[soup(&mut rng, 10, 2.0, 0.7, Vec3::ZERO)]).triangles().cloned().expect("some");
    let mut children = Vec::new();
    for i in 0..30 {
        let mut place = placement(&mut rng, i);
        place.translation *= 6.0;
        children.push(instance(&leaf, place, i as u32));
    }
    let root = Arc::new(Object::new(Some(own), children).expect("valid"));
    let rays = rays(&mut rng, 400, 4.0, Vec3::ZERO);
    let tiles = tiles(&mut rng, 12, 4.0, Vec3::ZERO);
    // As without instances, doubled for the transform of the ray, times the condition of the shears (< 4).
    check_all(&root, &rays, &tiles, 2.0e-6 * 10.0 * 8.0);
}

#[test]
fn nested_to_depth_forty() {
    let mut rng = Rng::new(32);
    for (depth, [odd, even]) in [1, 2, 5, 13, 40].into_iter().zip(PAIRS.into_iter().cycle()) {
        let mut node = odd(&[soup(&mut rng, 12, 1.0, 0.9, Vec3::ZERO)]);
        for level in 0..depth {
            let object = if level % 2 == 0 { even } else { odd };
            let tree = object(&[soup(&mut rng, 3, 1.0, 0.5, Vec3::ZERO)]);
            // Only turns and mirrors in the long chain, so that shapes stay comparable with f32.
            let mut place = placement(&mut rng, level % 2);
            place.translation *= 0.2;
            let children = vec![instance(&node, place, level as u32)];
            node = Arc::new(Object::new(tree.triangles().cloned(), children).expect("valid"));
        }
        assert_eq!(node.depth(), depth);
        let rays = rays(&mut rng, 200, 2.0, Vec3::ZERO);
        let tiles = tiles(&mut rng, 6, 2.0, Vec3::ZERO);
        // Each level rounds the ray once more.
        check_all(&node, &rays, &tiles, 2.0e-6 * 6.0 * (1.0 + depth as f64));
    }
}

#[test]
fn mirrored_normals_keep_the_front_side() {
    let triangle = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    for object in ACCELERATORS {
        mirrored(&object(std::slice::from_ref(&triangle)));
    }
}

fn mirrored(leaf: &Arc<Object>) {
    let place = |scale: Vec3| {
        let root = Object::new(None, vec![instance(leaf, Affine3A::from_scale(scale), 0)]).expect("valid");
        World::new(Arc::new(root))
    };
    for (scale, ng) in [
        (Vec3::ONE, Vec3::Z),
        (Vec3::new(-1.0, 1.0, 1.0), Vec3::Z),
        (Vec3::new(1.0, 1.0, -1.0), Vec3::NEG_Z),
        (Vec3::new(3.0, -2.0, 0.5), Vec3::Z),
    ] {
        let mut hits = [Hit::MISS; 2];
        let p = Vec3::new(0.25, 0.25, 0.0) * scale;
        let both = [Ray::new(p + Vec3::Z, Vec3::NEG_Z), Ray::new(p - Vec3::Z, Vec3::Z)];
        place(scale).intersect(&both, &mut hits);
        assert_eq!([hits[0].ng, hits[1].ng], [ng, ng], "{scale}");
        assert_eq!(hits[0].t, 1.0);
    }
}

/// Three levels that share children: 1 + 3·(1 + 2·(1 + 2)) paths.
fn shared(rng: &mut Rng, object: MakeObject) -> Arc<Object> {
    let leaf = object(&[soup(rng, 5, 0.5, 0.5, Vec3::ZERO)]);
    let place =
        |rng: &mut Rng, spread: f32| Affine3A::from_rotation_translation(turn(rng), rng.vec() * spread);
    let pair =
        Object::new(None, vec![instance(&leaf, place(rng, 1.0), 10), instance(&leaf, place(rng, 1.0), 11)]);
    let pair = Arc::new(pair.expect("valid"));
    let four = Object::new(
        leaf.triangles().cloned(),
        vec![instance(&pair, place(rng, 2.0), 20), instance(&pair, place(rng, 2.0), 21)],
    );
    let four = Arc::new(four.expect("valid"));
    let three = (0..3).map(|i| instance(&four, place(rng, 3.0), 30 + i)).collect();
    Arc::new(Object::new(None, three).expect("valid"))
}

#[test]
fn shared_subtrees_have_unique_resolvable_paths() {
    for object in ACCELERATORS {
        shared_subtrees(object);
    }
}

fn shared_subtrees(object: MakeObject) {
    let mut rng = Rng::new(33);
    let root = shared(&mut rng, object);
    let world = World::new(Arc::clone(&root));
    assert_eq!(world.path_count(), 22);
    let (mut next, mut tags) = (0, HashSet::new());
    world.for_each_path(&mut |path, world_from_object, ids, object| {
        assert_eq!(path, PathId(next));
        next += 1;
        assert!(tags.insert(ids.to_vec()), "tags of a path are unique here");
        let resolved = world.resolve(path).expect("counted");
        assert_eq!(resolved.ids, ids);
        assert_eq!(resolved.world_from_object, *world_from_object);
        assert!(std::ptr::eq(&raw const **resolved.object, object));
        let round_trip = resolved.object_from_world * resolved.world_from_object;
        assert!(round_trip.abs_diff_eq(Affine3A::IDENTITY, 1e-5));
    });
    assert_eq!(next, 22);
    assert!(world.resolve(PathId(22)).is_none() && world.resolve(PathId(u64::MAX)).is_none());
    assert!(world.resolve(PathId::ROOT).expect("root").ids.is_empty());

    let rays = rays(&mut rng, 400, 4.0, Vec3::ZERO);
    check_all(&root, &rays, &tiles(&mut rng, 8, 4.0, Vec3::ZERO), 2.0e-6 * 40.0);
    // A hit's path leads to the triangle that was hit.
    let mut hits = vec![Hit::MISS; rays.len()];
    world.intersect(&rays, &mut hits);
    for (ray, hit) in rays.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
        let resolved = world.resolve(hit.path).expect("from a hit");
        let local = resolved.object_from_world.transform_point3(ray.at(hit.t));
        let tree = resolved.object.triangles().expect("has the triangle");
        let bounds = tree.bounds();
        assert!((local - local.clamp(bounds.min, bounds.max)).length() < 1e-4, "{hit:?}");
    }
}

#[test]
fn doubling_is_counted_not_expanded() {
    let mut node = object(&[Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])]);
    for level in 0..62 {
        let shift = Affine3A::from_translation(Vec3::new(0.0, 0.0, -1.0e-3));
        let children = vec![instance(&node, Affine3A::IDENTITY, level), instance(&node, shift, level)];
        node = Arc::new(Object::new(None, children).expect("2^63 − 1 paths are within the limit"));
    }
    let world = World::new(Arc::clone(&node));
    assert_eq!(world.path_count(), (1 << 63) - 1);
    assert_eq!(world.resolve(PathId((1 << 63) - 2)).expect("last").ids.len(), 62);
    let children = vec![instance(&node, Affine3A::IDENTITY, 0); 3];
    assert_eq!(Object::new(None, children).unwrap_err(), BuildError::TooManyPaths { instance: 2 });
}

#[test]
fn limits_are_errors_that_name_the_instance() {
    let leaf = object(&[Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])]);
    let with = |place: Affine3A| {
        let good = instance(&leaf, Affine3A::IDENTITY, 0);
        Object::new(None, vec![good, instance(&leaf, place, 1)]).unwrap_err()
    };
    let flat = with(Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)));
    assert_eq!(flat, BuildError::SingularTransform { instance: 1 });
    assert!(flat.to_string().contains("instance 1") && flat.to_string().contains("singular"), "{flat}");
    let nan = with(Affine3A::from_translation(Vec3::new(f32::NAN, 0.0, 0.0)));
    assert_eq!(nan, BuildError::NonFiniteTransform { instance: 1 });
    assert!(nan.to_string().contains("instance 1") && nan.to_string().contains("not finite"), "{nan}");
    let infinite = with(Affine3A::from_scale(Vec3::new(1.0, f32::INFINITY, 1.0)));
    assert_eq!(infinite, BuildError::NonFiniteTransform { instance: 1 });

    let mut node = leaf;
    for _ in 0..MAX_INSTANCE_DEPTH {
        node = Arc::new(Object::new(None, vec![instance(&node, Affine3A::IDENTITY, 0)]).expect("within"));
    }
    let deep = Object::new(None, vec![instance(&node, Affine3A::IDENTITY, 0)]).unwrap_err();
    assert_eq!(deep, BuildError::TooDeep { instance: 0, depth: 65, limit: 64 });
    assert!(deep.to_string().contains("65") && deep.to_string().contains("64"), "{deep}");
    // The deepest allowed still answers, on a test thread's small stack.
    let mut hits = [Hit::MISS];
    World::new(node).intersect(&[Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z)], &mut hits);
    assert_eq!(hits[0].t, 1.0);
    assert_eq!(hits[0].path, PathId(64));
}

/// Rays that begin close to each other and go much the same way, as those towards a light do.
fn bundles(rng: &mut Rng, count: usize, scale: f32) -> Vec<Ray> {
    let mut rays = Vec::new();
    for bundle in 0..count {
        let origin = rng.vec() * scale * 1.5;
        let target = rng.vec() * scale * 0.5;
        let spread = [0.02, 0.2, 1.0][bundle % 3] * scale;
        for _ in 0..48 {
            let origin = origin + rng.vec() * spread;
            let direction = target + rng.vec() * spread - origin;
            let t_max = if bundle % 2 == 0 { f32::INFINITY } else { 0.5 + rng.unit() };
            rays.push(Ray { t_max, ..Ray::new(origin, direction) });
        }
    }
    rays
}

#[test]
fn bundles_stay_together_through_instances() {
    for (round, [outer, inner]) in (0..hunt(1)).flat_map(|round| PAIRS.map(|pair| (round, pair))) {
        let mut rng = Rng::new(36 + round);
        let leaves = [
            inner(&[soup(&mut rng, 40, 1.0, 0.9, Vec3::ZERO)]),
            inner(&[soup(&mut rng, 4, 1.0, 0.9, Vec3::ZERO), soup(&mut rng, 6, 1.0, 0.9, Vec3::ZERO)]),
        ];
        let many = |rng: &mut Rng, leaves: &[Arc<Object>], own: MakeObject, spread: f32| {
            let tree = own(&[soup(rng, 5, 2.0, 0.5, Vec3::ZERO)]);
            let children = (0..9).map(|i| {
                let mut place = placement(rng, i);
                place.translation *= spread;
                instance(&leaves[i % leaves.len()], place, i as u32)
            });
            let children = children.collect();
            Arc::new(Object::new(tree.triangles().cloned(), children).expect("valid"))
        };
        let middle = many(&mut rng, &leaves, inner, 3.0);
        let root = many(&mut rng, &[middle, leaves[0].clone()], outer, 6.0);
        check_all(&root, &bundles(&mut rng, 12, 4.0), &[], 2.0e-6 * 10.0 * 24.0);
    }
}

#[test]
fn batches_find_what_single_rays_find() {
    let mut rng = Rng::new(37);
    let leaf = object(&[soup(&mut rng, 60, 1.0, 0.5, Vec3::ZERO)]);
    let children = (0..40).map(|i| instance(&leaf, placement(&mut rng, i), i as u32)).collect();
    let world = World::new(Arc::new(Object::new(None, children).expect("valid")));
    let mut rays = bundles(&mut rng, 60, 2.0);
    // Rays that hit nothing stay out of packets and leave their neighbours alone.
    rays.iter_mut().step_by(7).for_each(|ray| ray.direction = Vec3::ZERO);
    let (mut hits, mut occluded) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
    world.intersect(&rays, &mut hits);
    world.occluded(&rays, &mut occluded);
    let mut found = 0;
    for ((ray, hit), occluded) in rays.iter().zip(&hits).zip(occluded) {
        let mut alone = [Hit::MISS];
        world.intersect(std::slice::from_ref(ray), &mut alone);
        let [alone] = alone;
        // The rays below are the same bit for bit, so the triangles tested are; their distances differ by rounding.
        assert_eq!((hit.path, hit.primitive), (alone.path, alone.primitive), "{ray:?}");
        assert_eq!(occluded, alone.is_hit(), "{ray:?}");
        if alone.is_hit() {
            found += 1;
            // As for the oracle: positions are rounded, and the plane is met farther off the flatter the ray comes in.
            let length = ray.direction.length();
            let cosine = (hit.ng.dot(ray.direction) / length).abs().max(1.0e-3);
            let along = 2.0e-6 * 4.0 / cosine / length + alone.t * 4.0e-7;
            assert!((hit.t - alone.t).abs() <= along, "{hit:?} {alone:?}");
            assert!(hit.ng.dot(alone.ng) > 0.9999, "{hit:?} {alone:?}");
        }
    }
    assert!(found > 300, "{found}");
}

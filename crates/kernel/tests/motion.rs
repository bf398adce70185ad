//! Motion while the shutter is open: moving vertices, moving placements and both, against the oracle at random times.
mod common;
use std::sync::Arc;

use common::{Rng, check_all, hunt, object, rays, soup, tiles};
use heliostat_kernel::{
    BuildError, BuildOptions, Hit, Instance, KdOptions, KdTree, Layout, Mesh, Object, Ray, RayQuery, Tile,
    TriangleBvh, World,
    glam::{Affine3A, Mat3, Quat, Vec3},
};

/// Loose triangles, each of whose vertices goes its own way.
fn moving_soup(rng: &mut Rng, count: usize, way: f32) -> Mesh {
    let mesh = soup(rng, count, 1.0, 0.6, Vec3::ZERO);
    let end: Vec<Vec3> = mesh.positions.iter().map(|&p| p + rng.vec() * way).collect();
    Mesh { motion: Some(end.into()), ..mesh }
}

fn placement(rng: &mut Rng) -> Affine3A {
    let turn = Quat::from_xyzw(rng.signed(), rng.signed(), rng.signed(), rng.signed()).normalize();
    let scale = Mat3::from_diagonal(Vec3::new(1.0, 0.6 + rng.unit(), 1.0));
    Affine3A::from_mat3_translation(Mat3::from_quat(turn) * scale, rng.vec() * 2.0)
}

/// Turned by less than a right angle and shifted: what lies between has an inverse that is not far off.
fn moving_instance(rng: &mut Rng, object: &Arc<Object>, id: u32) -> Instance {
    let open = placement(rng);
    let turn = Affine3A::from_rotation_translation(Quat::from_rotation_y(rng.signed()), rng.vec());
    Instance { object: Arc::clone(object), parent_from_object: open, motion: Some(turn * open), id }
}

fn random_times(rng: &mut Rng, rays: &mut [Ray], tiles: &mut [Tile]) {
    rays.iter_mut().for_each(|ray| *ray = ray.at_time(rng.unit()));
    for tile in tiles {
        (0..tile.len()).for_each(|i| tile.set_time(i, rng.unit()));
    }
}

fn check_at_random_times(rng: &mut Rng, root: &Arc<Object>, scale: f32, error: f64) {
    assert!(root.has_motion());
    let (mut rays, mut tiles) = (rays(rng, 120, scale, Vec3::ZERO), tiles(rng, 3, scale, Vec3::ZERO));
    random_times(rng, &mut rays, &mut tiles);
    check_all(root, &rays, &tiles, error);
}

#[test]
fn moving_vertices_are_hit_where_they_are() {
    for round in 0..hunt(2) {
        let mut rng = Rng::new(81 + round);
        let still = soup(&mut rng, 20, 1.0, 0.6, Vec3::ZERO);
        let root = object(&[moving_soup(&mut rng, 30, 1.5), still]);
        check_at_random_times(&mut rng, &root, 2.0, 2.0e-6 * 6.0);
    }
}

#[test]
fn moving_placements_are_met_where_they_are() {
    for round in 0..hunt(2) {
        let mut rng = Rng::new(83 + round);
        let leaves =
            [object(&[soup(&mut rng, 6, 0.7, 0.6, Vec3::ZERO)]), object(&[moving_soup(&mut rng, 6, 0.8)])];
        let inner: Vec<_> = (0..6).map(|i| moving_instance(&mut rng, &leaves[i as usize % 2], i)).collect();
        let inner = Arc::new(Object::new(None, inner).expect("valid"));
        let mut outer = vec![moving_instance(&mut rng, &inner, 7), moving_instance(&mut rng, &leaves[0], 8)];
        outer.push(Instance { motion: None, ..moving_instance(&mut rng, &inner, 9) });
        let root = Arc::new(Object::new(leaves[1].triangles().cloned(), outer).expect("valid"));
        check_at_random_times(&mut rng, &root, 3.0, 2.0e-6 * 10.0 * 8.0);
    }
}

#[test]
fn at_both_ends_worlds_are_those_without_motion() {
    let mut rng = Rng::new(85);
    let mesh = moving_soup(&mut rng, 40, 1.0);
    let opening = Mesh { motion: None, ..mesh.clone() };
    let child = object(std::slice::from_ref(&mesh));
    let instances: Vec<_> = (0..5).map(|i| moving_instance(&mut rng, &child, i)).collect();
    let moving = World::new(Arc::new(Object::new(None, instances.clone()).expect("valid")));
    for (time, mesh) in [(0.0, opening), (1.0, mesh.closing())] {
        let child = object(&[mesh]);
        let place = |instance: &Instance| Instance {
            object: Arc::clone(&child),
            parent_from_object: instance.parent_from_object_at(time),
            motion: None,
            id: instance.id,
        };
        let still = Object::new(None, instances.iter().map(place).collect()).expect("valid");
        assert!(!still.has_motion());
        let still = World::new(Arc::new(still));
        let rays: Vec<_> = rays(&mut rng, 300, 3.0, Vec3::ZERO).iter().map(|ray| ray.at_time(time)).collect();
        for ray in rays {
            let mut hits = [[Hit::MISS]; 2];
            moving.intersect(&[ray], &mut hits[0]);
            still.intersect(&[ray.at_time(0.7)], &mut hits[1]);
            assert_eq!(hits[0], hits[1], "{ray:?}");
            if let Some(path) = hits[0][0].is_hit().then_some(hits[0][0].path) {
                let [a, b] =
                    [moving.resolve_at(path, time), still.resolve(path)].map(|r| r.expect("from a hit"));
                assert_eq!(
                    (a.world_from_object, a.object_from_world),
                    (b.world_from_object, b.object_from_world)
                );
            }
        }
    }
}

#[test]
fn times_outside_count_as_the_nearer_end() {
    let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    let end: Vec<Vec3> = mesh.positions.iter().map(|&p| p - Vec3::Z).collect();
    let world = World::new(object(&[Mesh { motion: Some(end.into()), ..mesh }]));
    let ray = Ray::new(Vec3::new(0.25, 0.25, 1.0), Vec3::NEG_Z);
    for (time, t) in [(0.0, 1.0), (0.25, 1.25), (1.0, 2.0), (-3.0, 1.0), (7.0, 2.0), (f32::NAN, 1.0)] {
        let mut hits = [Hit::MISS];
        world.intersect(&[ray.at_time(time)], &mut hits);
        assert_eq!(hits[0].t, t, "{time}");
    }
}

#[test]
fn refits_take_new_ways_along() {
    let mut rng = Rng::new(86);
    let mesh = moving_soup(&mut rng, 60, 0.5);
    let mut tree = TriangleBvh::build(std::slice::from_ref(&mesh), &BuildOptions::default()).expect("valid");
    let again = moving_soup(&mut rng, 60, 1.0);
    let mut broken = again.motion.as_deref().expect("moves").to_vec();
    broken[0] = Vec3::NAN;
    for motion in [again.motion.clone(), Some(broken.into()), None, again.motion.clone()] {
        let now = Mesh { motion, ..again.clone() };
        tree.refit(std::slice::from_ref(&now)).expect("same triangles");
        assert_eq!(tree.has_motion(), now.motion.is_some());
        let fresh = TriangleBvh::build(&[now], &BuildOptions::default()).expect("valid");
        assert_eq!(tree.bounds(), fresh.bounds());
        let root = Arc::new(Object::new(Some(tree.clone().into()), Vec::new()).expect("no instances"));
        let (mut rays, mut tiles) =
            (rays(&mut rng, 60, 2.0, Vec3::ZERO), tiles(&mut rng, 2, 2.0, Vec3::ZERO));
        random_times(&mut rng, &mut rays, &mut tiles);
        check_all(&root, &rays, &tiles, 2.0e-6 * 6.0);
    }
}

#[test]
fn what_cannot_move_says_so() {
    let mut rng = Rng::new(87);
    let still = soup(&mut rng, 3, 1.0, 0.6, Vec3::ZERO);
    let moving = [still.clone(), moving_soup(&mut rng, 3, 1.0)];
    let kd = KdTree::build(&moving, &KdOptions::default()).unwrap_err();
    assert_eq!(kd, BuildError::MotionUnsupported { mesh: 1, tree: "a kd-tree" });
    let compact = BuildOptions { layout: Layout::Compact, ..BuildOptions::default() };
    let refused = BuildError::MotionUnsupported { mesh: 1, tree: "the compact layout" };
    assert_eq!(TriangleBvh::build(&moving, &compact).unwrap_err(), refused);
    let mut tree = TriangleBvh::build(&[still.clone(), still.clone()], &compact).expect("still");
    assert_eq!(tree.refit(&moving), Err(refused));
    let short = Mesh { motion: Some(still.positions[1..].into()), ..still };
    let length = BuildError::MotionLength { mesh: 0, positions: 9, motion: 8 };
    assert_eq!(TriangleBvh::build(&[short], &BuildOptions::default()).unwrap_err(), length);
}

//! Refitted trees answer like new ones, whatever became of the vertices.
mod common;
use std::{f32::consts::TAU, sync::Arc};

use common::{Rng, all_builders, check_all, rays, soup, tiles};
use heliostat_kernel::{
    BuildError, BuildOptions, Hit, Mesh, Object, Oracle, Ray, RayQuery, RefitPolicy, TriangleBvh, World,
    glam::{Quat, Vec3},
};

fn build(meshes: &[Mesh], options: &BuildOptions) -> TriangleBvh {
    TriangleBvh::build(meshes, options).expect("valid meshes")
}

fn moved(mesh: &Mesh, place: impl Fn(usize, Vec3) -> Vec3) -> Mesh {
    let positions: Vec<Vec3> = mesh.positions.iter().enumerate().map(|(i, &p)| place(i, p)).collect();
    Mesh::new(positions, mesh.indices.clone())
}

fn object(tree: TriangleBvh) -> Arc<Object> {
    Arc::new(Object::new(Some(tree.into()), Vec::new()).expect("no instances"))
}

#[test]
fn without_any_move_nothing_changes() {
    let mut rng = Rng::new(51);
    let meshes = [soup(&mut rng, 20_000, 1.0, 0.05, Vec3::ZERO), soup(&mut rng, 7, 1.0, 0.5, Vec3::ONE)];
    for options in [BuildOptions::default(), BuildOptions::fast()] {
        let mut tree = build(&meshes, &options);
        let before = (tree.fingerprint(), tree.bounds(), tree.stats());
        tree.refit(&meshes).expect("the same meshes");
        assert_eq!((tree.fingerprint(), tree.bounds()), (before.0, before.1));
        assert!((tree.stats().sah / before.2.sah - 1.0).abs() < 1.0e-5);
        assert_eq!(tree.stats().sah_at_build, before.2.sah);
    }
}

#[test]
fn moved_vertices_are_hit_where_they_are_now() {
    let mut rng = Rng::new(52);
    let meshes = [soup(&mut rng, 600, 1.0, 0.4, Vec3::ZERO), soup(&mut rng, 200, 1.0, 0.1, Vec3::ZERO)];
    let there = Vec3::new(3.0, -2.0, 1.0);
    let shift: Vec<Vec3> = (0..3000).map(|_| rng.vec() * 0.3 + there).collect();
    let now = [0, 1].map(|m| moved(&meshes[m], |i, p| p * 1.5 + shift[i]));
    let rays = rays(&mut rng, 300, 1.5, there);
    let tiles = tiles(&mut rng, 8, 1.5, there);
    for options in all_builders() {
        let mut tree = build(&meshes, &options);
        tree.refit(&now).expect("the same topology");
        assert_eq!(tree.bounds(), build(&now, &options).bounds());
        assert!(tree.stats().sah > tree.stats().sah_at_build);
        let root = object(tree);
        assert_eq!(Oracle::new(&World::new(root.clone())).triangle_count(), 800);
        check_all(&root, &rays, &tiles, 2.0e-6 * 9.0);
    }
}

#[test]
fn refits_are_the_same_for_any_number_of_threads_and_any_way_there() {
    let mut rng = Rng::new(53);
    let mesh = soup(&mut rng, 60_000, 10.0, 0.1, Vec3::ZERO);
    let far = moved(&mesh, |i, p| p * if i % 2 == 0 { 2.0 } else { -3.0 });
    let now = moved(&mesh, |_, p| Vec3::new(p.x + p.y.sin(), p.y, p.z * 0.5));
    let print = |threads: usize, way: &[&Mesh]| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| {
            let mut tree = build(std::slice::from_ref(&mesh), &BuildOptions::default());
            for &mesh in way {
                tree.refit(std::slice::from_ref(mesh)).expect("the same topology");
            }
            (tree.fingerprint(), tree.stats().sah)
        })
    };
    let direct = print(1, &[&now]);
    for (threads, way) in [(2, vec![&now]), (5, vec![&now]), (2, vec![&far, &mesh, &far, &now])] {
        assert_eq!(print(threads, &way), direct);
    }
}

#[test]
fn triangles_vanish_and_come_back() {
    let mut rng = Rng::new(54);
    let mesh = soup(&mut rng, 300, 1.0, 0.5, Vec3::ZERO);
    let broken = moved(&mesh, |i, p| match i / 3 % 5 {
        0 if i % 3 == 0 => Vec3::new(f32::NAN, 0.0, 0.0),
        1 if i % 3 == 1 => Vec3::INFINITY,
        2 => Vec3::splat(0.25),
        3 if i % 3 == 2 => Vec3::splat(2.0e10),
        _ => p,
    });
    let rays = rays(&mut rng, 200, 1.0, Vec3::ZERO);
    let tiles = tiles(&mut rng, 4, 1.0, Vec3::ZERO);
    for options in all_builders() {
        let mut tree = build(std::slice::from_ref(&mesh), &options);
        tree.refit(std::slice::from_ref(&broken)).expect("the same topology");
        assert_eq!(tree.bounds(), build(std::slice::from_ref(&broken), &options).bounds());
        let root = object(tree);
        assert_eq!(Oracle::new(&World::new(root.clone())).triangle_count(), 60);
        check_all(&root, &rays, &tiles, 2.0e-6 * 3.0);

        let mut tree = build(std::slice::from_ref(&mesh), &options);
        let nowhere = moved(&mesh, |_, _| Vec3::NAN);
        tree.refit(&[nowhere]).expect("the same topology");
        assert!(tree.bounds().is_empty() && tree.stats().sah == 0.0);
        tree.refit(std::slice::from_ref(&mesh)).expect("the same topology");
        let root = object(tree);
        assert_eq!(Oracle::new(&World::new(root.clone())).triangle_count(), 300);
        check_all(&root, &rays, &tiles, 2.0e-6 * 3.0);
    }
}

#[test]
fn a_tree_whose_triangles_are_all_gone_is_never_hit() {
    let mesh = soup(&mut Rng::new(55), 100, 1.0, 0.5, Vec3::ZERO);
    let mut tree = build(std::slice::from_ref(&mesh), &BuildOptions::default());
    tree.refit(&[moved(&mesh, |_, _| Vec3::ZERO)]).expect("the same topology");
    let world = World::new(object(tree));
    // Empty lanes and vanished triangles are points at the origin: aim there.
    let aimed: Vec<Ray> = [Vec3::X, Vec3::ONE, Vec3::new(1.0, 2.0, -3.0)].map(|o| Ray::new(o, -o)).to_vec();
    let mut hits = vec![Hit::MISS; aimed.len()];
    world.intersect(&aimed, &mut hits);
    assert!(hits.iter().all(|hit| !hit.is_hit()));
}

#[test]
fn another_topology_is_refused_and_changes_nothing() {
    let mut rng = Rng::new(56);
    let meshes = [soup(&mut rng, 40, 1.0, 0.5, Vec3::ZERO), soup(&mut rng, 30, 1.0, 0.5, Vec3::ZERO)];
    let mut tree = build(&meshes, &BuildOptions::default());
    let before = tree.fingerprint();
    let error = tree.refit(&meshes[..1]).unwrap_err();
    assert_eq!(error, BuildError::MeshCountChanged { built: 2, given: 1 });
    let [a, b] = meshes.clone();
    let fewer = Mesh::new(b.positions.clone(), &b.indices[..29]);
    let error = tree.refit(&[a.clone(), fewer]).unwrap_err();
    assert_eq!(error, BuildError::TriangleCountChanged { mesh: 1, built: 30, given: 29 });
    assert!(error.to_string().contains("mesh 1") && error.to_string().contains("30"), "{error}");
    let error = tree.refit(&[Mesh::new(&a.positions[..5], a.indices.clone()), b]).unwrap_err();
    assert!(matches!(error, BuildError::IndexOutOfRange { mesh: 0, triangle: 1, .. }), "{error}");
    assert_eq!(tree.fingerprint(), before);
}

/// A tube of about 2·`rows`·`columns` triangles along y, twisted by `turns` over its length.
fn twisted_tube(columns: u32, rows: u32, turns: f32) -> Mesh {
    let mut positions = Vec::new();
    let mut indices = Vec::new();
    for j in 0..=rows {
        let y = j as f32 / rows as f32;
        for i in 0..columns {
            let angle = TAU * (i as f32 / columns as f32);
            // Flat, so that a twist tears its boxes apart.
            let p = Vec3::new(angle.cos(), 4.0 * y, 0.1 * angle.sin());
            positions.push(Quat::from_rotation_y(TAU * turns * y) * p);
            if j < rows {
                let (a, b) = (j * columns + i, j * columns + (i + 1) % columns);
                indices.extend([[a, b, a + columns], [b, b + columns, a + columns]]);
            }
        }
    }
    Mesh::new(positions, indices)
}

#[test]
fn following_keeps_trees_near_fresh_ones_and_hits_right() {
    let mut rng = Rng::new(57);
    for options in all_builders() {
        let mesh = |turns| [twisted_tube(60, 80, turns)];
        let mut tree = TriangleBvh::build(&mesh(0.0), &options).expect("valid");
        let mut plain = tree.clone();
        let mut repairs = 0;
        for frame in 1..=30 {
            let now = mesh(frame as f32 / 15.0);
            let done = tree.follow(&now, &RefitPolicy::default()).expect("same triangles");
            assert_eq!((done.sah, done.sah_at_build), (tree.stats().sah, tree.stats().sah_at_build));
            assert!(
                done.sah <= done.sah_refitted && done.repaired == (done.sah < done.sah_refitted),
                "{done:?}"
            );
            repairs += u32::from(done.repaired);
            plain.refit(&now).expect("same triangles");
        }
        let fresh = TriangleBvh::build(&mesh(2.0), &options).expect("valid").stats().sah;
        let (followed, refitted) = (tree.stats().sah, plain.stats().sah);
        let what = format!("{options:?}: {repairs} repairs, {followed}; refitted {refitted}, fresh {fresh}");
        assert!(repairs > 0 && repairs < 20 && followed < 1.5 * fresh && followed < 0.8 * refitted, "{what}");
        let root = Arc::new(Object::new(Some(tree.into()), Vec::new()).expect("no instances"));
        let (rays, tiles) = (rays(&mut rng, 20, 2.0, Vec3::Y * 2.0), tiles(&mut rng, 1, 2.0, Vec3::Y * 2.0));
        check_all(&root, &rays, &tiles, 2.0e-6 * 10.0);
    }
}

#[test]
fn repairs_keep_triangles_that_are_gone_for_now() {
    let mut rng = Rng::new(58);
    let mesh = soup(&mut rng, 400, 1.0, 0.1, Vec3::ZERO);
    let mut tree = TriangleBvh::build(std::slice::from_ref(&mesh), &BuildOptions::default()).expect("valid");
    let policy = RefitPolicy { repair_above: 0.0, ..RefitPolicy::default() };
    let gone: Vec<Vec3> = mesh.positions.iter().map(|&p| if p.x < 0.0 { Vec3::NAN } else { p }).collect();
    for positions in [gone.into(), mesh.positions.clone()] {
        let now = Mesh { positions, ..mesh.clone() };
        assert!(tree.follow(std::slice::from_ref(&now), &policy).expect("same triangles").repaired);
        let fresh = TriangleBvh::build(&[now], &BuildOptions::default()).expect("valid");
        assert_eq!(tree.bounds(), fresh.bounds());
        let root = Arc::new(Object::new(Some(tree.clone().into()), Vec::new()).expect("no instances"));
        check_all(
            &root,
            &rays(&mut rng, 60, 1.0, Vec3::ZERO),
            &tiles(&mut rng, 2, 1.0, Vec3::ZERO),
            2.0e-6 * 4.0,
        );
    }
}

#[test]
fn beside_a_collapsed_triangle_all_others_stay() {
    let corner = |i: u32| {
        Vec3::new((i / 3) as f32 + [0.0, 0.8, 0.0][i as usize % 3], [0.0, 0.0, 0.8][i as usize % 3], 0.0)
    };
    let indices: Vec<[u32; 3]> = (0..8).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let whole = Mesh::new((0..24).map(corner).collect::<Vec<_>>(), indices);
    for options in all_builders() {
        for gone in 0..8 {
            let mut tree = build(std::slice::from_ref(&whole), &options);
            let flat = moved(&whole, |i, p| if i / 3 == gone { corner(3 * gone as u32) } else { p });
            tree.refit(&[flat]).expect("the same topology");
            let world = World::new(object(tree));
            for other in 0..8 {
                // So many that they stay together in a packet.
                let ray = |i: usize| {
                    let place = Vec3::new(other as f32 + 0.2 + 0.01 * i as f32, 0.2, 1.0);
                    Ray::new(place, Vec3::new(0.001, 0.001, -1.0))
                };
                let rays: Vec<Ray> = (0..16).map(ray).collect();
                let mut hits = vec![Hit::MISS; rays.len()];
                world.intersect(&rays, &mut hits);
                let expected = if other == gone { u32::MAX } else { other as u32 };
                assert!(hits.iter().all(|hit| hit.primitive == expected), "{gone} {other} {options:?}");
            }
        }
    }
}

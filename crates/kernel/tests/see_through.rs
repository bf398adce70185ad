//! Queries past what lets light through: against the oracle, for every walk, accelerator and instruction set.
mod common;

use std::{collections::BTreeMap, sync::Arc};

use common::{ACCELERATORS, MakeObject, Rng, hunt, kd_object, object, rays, soup, tiles};
use heliostat_kernel::{
    BuildOptions, Hit, Instance, Isa, Mesh, Object, Oracle, PathId, Quadric, Quadrics, Ray, RayQuery,
    SeeThrough, Tile, TriangleBvh, World,
    glam::{Affine3A, Mat3, Quat, Vec3},
};

/// What lets light through, by path; the rest does as `other`.
struct Table {
    own: BTreeMap<u64, Vec<u64>>,
    other: Vec<u64>,
}

impl SeeThrough for Table {
    fn geometries(&self, path: PathId) -> &[u64] {
        self.own.get(&path.0).unwrap_or(&self.other)
    }
}

impl Table {
    fn all(geometries: &[u64]) -> Self {
        Self { own: BTreeMap::new(), other: geometries.to_vec() }
    }

    fn has(&self, hit: &Hit) -> bool {
        let words = self.geometries(hit.path);
        words.get(hit.geometry as usize / 64).is_some_and(|word| word >> (hit.geometry % 64) & 1 == 1)
    }
}

/// (occluded, filtered) by rays together, by rays one by one, and by tiles.
fn ask(world: &impl RayQuery, table: &Table, rays: &[Ray], tiles: &[Tile]) -> [Vec<(bool, bool)>; 3] {
    let mut answers = [Vec::new(), Vec::new(), Vec::new()];
    let mut take = |walk: usize, count: usize, run: &dyn Fn(&mut [bool], &mut [bool])| {
        let (mut occluded, mut filtered) = (vec![true; count], vec![true; count]);
        run(&mut occluded, &mut filtered);
        answers[walk].extend(occluded.into_iter().zip(filtered));
    };
    take(0, rays.len(), &|occluded, filtered| world.occluded_through(rays, table, occluded, filtered));
    for ray in rays.chunks(1) {
        take(1, 1, &|occluded, filtered| world.occluded_through(ray, table, occluded, filtered));
    }
    for tile in tiles {
        take(2, tile.len(), &|occluded, filtered| {
            world.occluded_tile_through(tile, table, occluded, filtered);
        });
    }
    answers
}

fn rays_of(tiles: &[Tile]) -> Vec<Ray> {
    tiles.iter().flat_map(|tile| (0..tile.len()).filter_map(|i| tile.ray(i))).collect()
}

/// Compares all walks with what the oracle sees clearly, as `check_all` does: farther than `error` from every edge.
/// Returns how many rays were filtered.
fn check(root: &Arc<Object>, table: &Table, rays: &[Ray], tiles: &[Tile], error: f64) -> usize {
    let in_tiles = rays_of(tiles);
    let mut count = 0;
    for isa in Isa::available() {
        let world = World::with_isa(Arc::clone(root), isa).expect("available");
        let oracle = Oracle::new(&world);
        for (walk, answers) in ask(&world, table, rays, tiles).into_iter().enumerate() {
            let asked = if walk == 2 { &in_tiles } else { rays };
            assert_eq!(asked.len(), answers.len());
            for (ray, (occluded, filtered)) in asked.iter().zip(answers) {
                let what = format!("{isa}, walk {walk}: {ray:?} {occluded} {filtered}");
                check_ray(&oracle, table, ray, (occluded, filtered), error, &what);
                count += usize::from(filtered);
            }
        }
    }
    count
}

fn check_ray(
    oracle: &Oracle,
    table: &Table,
    ray: &Ray,
    (occluded, filtered): (bool, bool),
    error: f64,
    what: &str,
) {
    let near = oracle.near(ray, error);
    let length = f64::from(ray.direction.length());
    for n in &near {
        let across = error / n.cosine;
        let (t, along) = (f64::from(n.hit.t), across / length);
        let along = along + t * 2.0e-7;
        let clear = n.margin > across
            && t - along > f64::from(ray.t_min.max(0.0))
            && t + along < f64::from(ray.t_max);
        if clear && !table.has(&n.hit) {
            assert!(occluded, "lost: {what} {n:?}");
        } else if clear {
            assert!(occluded || filtered, "not noted: {what} {n:?}");
        }
    }
    assert!(!(occluded && filtered), "both: {what}");
    // Edge-on triangles are not in the oracle's list; there are none here that a ray could meet.
    assert!(!occluded || near.iter().any(|n| !table.has(&n.hit)), "invented: {what}");
    assert!(!filtered || near.iter().any(|n| table.has(&n.hit)), "invented: {what}");
}

/// Seventy meshes, so that flags take two words; every third lets light through.
fn meshes(rng: &mut Rng) -> (Vec<Mesh>, Table) {
    let meshes = (0..70).map(|i| soup(rng, 1 + i % 7, 1.0, 0.5, Vec3::ZERO)).collect();
    let bits = |word: u32| {
        (0..64).filter(|bit| (word * 64 + bit).is_multiple_of(3)).fold(0, |all, bit| all | 1_u64 << bit)
    };
    (meshes, Table::all(&[bits(0), bits(1) & 0x3f]))
}

#[test]
fn panes_are_passed_and_noted() {
    for round in 0..hunt(1) {
        let mut rng = Rng::new(81 + round);
        let (meshes, table) = meshes(&mut rng);
        let (rays, tiles) = (rays(&mut rng, 500, 1.2, Vec3::ZERO), tiles(&mut rng, 10, 1.2, Vec3::ZERO));
        for make in ACCELERATORS {
            let root = make(&meshes);
            assert!(check(&root, &table, &rays, &tiles, 2.0e-6 * 4.0) > 100);
            // Without any it is the plain query, and with all of them nothing is occluded.
            let world = World::new(root);
            for (walk, answers) in ask(&world, &Table::all(&[]), &rays, &tiles).into_iter().enumerate() {
                let mut plain = vec![false; answers.len()];
                match walk {
                    0 => world.occluded(&rays, &mut plain),
                    1 => rays.iter().zip(&mut plain).for_each(|(ray, out)| {
                        world.occluded(std::slice::from_ref(ray), std::slice::from_mut(out));
                    }),
                    _ => {
                        let mut rest = &mut plain[..];
                        for tile in &tiles {
                            let (out, others) = rest.split_at_mut(tile.len());
                            world.occluded_tile(tile, out);
                            rest = others;
                        }
                    }
                }
                let plain: Vec<_> = plain.into_iter().map(|occluded| (occluded, false)).collect();
                assert_eq!(answers, plain);
            }
            for answers in ask(&world, &Table::all(&[u64::MAX; 2]), &rays, &tiles) {
                assert!(answers.iter().all(|&(occluded, _)| !occluded));
            }
        }
    }
}

#[test]
fn each_path_has_panes_of_its_own() {
    const PAIRS: [[MakeObject; 2]; 3] = [[object, object], [object, kd_object], [kd_object, object]];
    for (round, [outer, inner]) in (0..hunt(1)).flat_map(|round| PAIRS.map(|pair| (round, pair))) {
        let mut rng = Rng::new(82 + round);
        let (meshes, table) = meshes(&mut rng);
        let leaf = inner(&meshes);
        let own =
            outer(&[soup(&mut rng, 10, 2.0, 0.7, Vec3::ZERO), soup(&mut rng, 10, 2.0, 0.7, Vec3::ZERO)]);
        let placed = |rng: &mut Rng, i: u32| {
            let turn = Quat::from_xyzw(rng.signed(), rng.signed(), rng.signed(), rng.signed()).normalize();
            // Some only moved, some turned, some mirrored and sheared.
            let shape = match i % 4 {
                0 => Mat3::IDENTITY,
                1 => Mat3::from_quat(turn),
                2 => Mat3::from_quat(turn) * Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0)),
                _ => Mat3::from_quat(turn) * Mat3::from_cols(Vec3::X, Vec3::new(0.5, 1.0, 0.0), Vec3::Z),
            };
            let place = Affine3A::from_mat3_translation(shape, rng.vec() * 2.5);
            Instance { object: leaf.clone(), parent_from_object: place, motion: None, id: i }
        };
        let children = (0..12).map(|i| placed(&mut rng, i)).collect();
        let root = Arc::new(Object::new(own.triangles().cloned(), children).expect("valid"));
        let opaque = (1..13).filter(|path| path % 5 == 0).map(|path| (path, Vec::new()));
        let clear = (1..13).filter(|path| path % 5 == 1).map(|path| (path, vec![u64::MAX; 2]));
        let own = opaque.chain(clear).chain([(0, vec![0b10])]).collect();
        let table = Table { own, ..table };
        let (rays, tiles) = (rays(&mut rng, 500, 3.0, Vec3::ZERO), tiles(&mut rng, 10, 3.0, Vec3::ZERO));
        assert!(check(&root, &table, &rays, &tiles, 2.0e-6 * 8.0 * 8.0) > 100);
    }
}

#[test]
fn moving_and_round_panes() {
    let mut rng = Rng::new(83);
    let mut sheets: Vec<Mesh> = (0..4).map(|_| soup(&mut rng, 6, 1.0, 0.7, Vec3::ZERO)).collect();
    for mesh in &mut sheets {
        mesh.motion = Some(mesh.positions.iter().map(|&p| p + rng.vec() * 0.3).collect());
    }
    let tree = TriangleBvh::build(&sheets, &BuildOptions::default()).expect("valid");
    let balls = |rng: &mut Rng| -> Vec<Quadric> {
        (0..10).map(|_| Quadric::Sphere { center: rng.vec(), radius: 0.05 + 0.2 * rng.unit() }).collect()
    };
    let lists = [balls(&mut rng), balls(&mut rng)];
    let shapes = Quadrics::build([(4, &lists[0][..]), (5, &lists[1][..])]).expect("few");
    let table = Table::all(&[0b10_0101]);
    let (mut rays, tiles) = (rays(&mut rng, 800, 1.2, Vec3::ZERO), tiles(&mut rng, 8, 1.2, Vec3::ZERO));
    rays.iter_mut().for_each(|ray| ray.time = rng.unit());
    let moving = Arc::new(Object::new(Some(tree.into()), Vec::new()).expect("valid"));
    assert!(check(&moving, &table, &rays, &tiles, 2.0e-6 * 4.0) > 100);

    // Spheres are met in double precision, so answers are those of the oracle.
    let mut round = Object::empty();
    round.set_quadrics(Some(Arc::new(shapes)));
    let round = Arc::new(round);
    for isa in Isa::available() {
        let world = World::with_isa(round.clone(), isa).expect("available");
        let expected = ask(&Oracle::new(&world), &table, &rays, &tiles);
        assert!(expected.iter().flatten().filter(|(_, filtered)| *filtered).count() > 100);
        assert_eq!(ask(&world, &table, &rays, &tiles), expected, "{isa}");
    }
}

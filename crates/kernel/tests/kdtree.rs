//! Kd-trees: determinism, completeness of the leaves, quality, limits of depth and memory.
mod common;
use common::{Rng, check_all, hunt, kd_object, soup};
use heliostat_kernel::{
    Aabb, BuildError, KdNodeKind, KdOptions, KdSplit, KdTree, Mesh, Ray, Tile,
    glam::{DVec3, Vec3},
};

fn build(meshes: &[Mesh]) -> KdTree {
    KdTree::build(meshes, &KdOptions::default()).expect("valid meshes")
}

fn median() -> KdOptions {
    KdOptions { split: KdSplit::Median, ..KdOptions::default() }
}

/// Every leaf: its cell and its references.
fn leaves(tree: &KdTree) -> Vec<(Aabb, &[u32])> {
    let mut open = if tree.nodes().is_empty() { Vec::new() } else { vec![(0, tree.bounds())] };
    let mut leaves = Vec::new();
    while let Some((node, cell)) = open.pop() {
        match tree.nodes()[node as usize].kind() {
            KdNodeKind::Leaf { first, count } => {
                leaves.push((cell, &tree.references()[first as usize..][..count as usize]));
            }
            KdNodeKind::Inner { axis, split, children } => {
                let (mut below, mut above) = (cell, cell);
                assert!(cell.min[axis] <= split && split <= cell.max[axis], "a plane meets its cell");
                below.max[axis] = split;
                above.min[axis] = split;
                open.extend([(children, below), (children + 1, above)]);
            }
        }
    }
    leaves
}

/// Whether `point` is within `slack` of the box.
fn near(cell: &Aabb, point: DVec3, slack: f64) -> bool {
    let (lo, hi) = (cell.min.as_dvec3() - slack, cell.max.as_dvec3() + slack);
    point.cmpge(lo).all() && point.cmple(hi).all()
}

#[test]
fn every_point_of_every_triangle_is_in_a_leaf_that_lists_it() {
    let mut rng = Rng::new(51);
    for (count, size, options) in [
        (1, 0.5, KdOptions::default()),
        (40, 2.0, KdOptions::default()),
        (400, 0.3, KdOptions::default()),
        (400, 0.3, median()),
        (3000, 0.05, KdOptions::default()),
    ] {
        let meshes = [soup(&mut rng, count, 1.0, size, Vec3::ZERO), soup(&mut rng, 5, 1.0, size, Vec3::X)];
        let tree = KdTree::build(&meshes, &options).expect("valid");
        let leaves = leaves(&tree);
        let listed: usize = leaves.iter().map(|(_, list)| list.len()).sum();
        assert_eq!(listed, tree.references().len());
        for (index, corners) in tree.corners().iter().enumerate() {
            let (mesh, triangle) = tree.identify(index as u32).expect("in range");
            let original = meshes[mesh as usize].corners(triangle as usize).expect("exists");
            assert_eq!(original.map(|p| p.to_array()), *corners);
            let homes: Vec<&Aabb> = leaves
                .iter()
                .filter(|(_, list)| list.contains(&(index as u32)))
                .map(|(cell, _)| cell)
                .collect();
            let [a, b, c] = original.map(|p| p.as_dvec3());
            for _ in 0..20 {
                let (mut u, mut v) = (f64::from(rng.unit()), f64::from(rng.unit()));
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let point = a + (b - a) * u + (c - a) * v;
                assert!(homes.iter().any(|cell| near(cell, point, 1.0e-12)), "{index} at {point}");
            }
        }
        assert_eq!(tree.identify(tree.corners().len() as u32), None);
    }
}

/// Long thin triangles that cross many cells in parts still thinner, some almost along a plane.
fn slivers(rng: &mut Rng, count: u32) -> Mesh {
    let mut positions = Vec::new();
    for _ in 0..count {
        let (p, mut along) = (rng.vec() * 10.0, rng.vec() * 12.0);
        along[rng.below(3)] *= 10.0_f32.powf(-6.0 * rng.unit());
        let width = along.cross(rng.vec()).normalize() * 10.0_f32.powf(-1.5 * rng.unit());
        positions.extend([p, p + along, p + along * rng.unit() + width]);
    }
    Mesh::new(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect::<Vec<_>>())
}

#[test]
fn nothing_is_lost_at_the_planes_between_cells() {
    for round in 0..hunt(2) {
        let mut rng = Rng::new(60 + round);
        let meshes = [slivers(&mut rng, 300)];
        let tree = build(&meshes);
        let leaves = leaves(&tree);
        // A point of a triangle, moved along it to where it meets a side of a cell that lists it.
        let mut target = || {
            let (cell, list) = leaves[rng.below(leaves.len())];
            let axis = rng.below(3);
            let plane = if rng.bits() & 1 == 0 { cell.min[axis] } else { cell.max[axis] };
            let Some(&index) = list.get(rng.below(list.len().max(1))) else { return (cell.center(), axis) };
            let [a, b, c] = tree.corners()[index as usize].map(Vec3::from_array);
            let (u, v) = (rng.unit(), rng.unit());
            let (from, to) = (a.lerp(c, u), b.lerp(c, v));
            let s = (plane - from[axis]) / (to[axis] - from[axis]);
            (if (0.0..=1.0).contains(&s) { from.lerp(to, s) } else { from.lerp(to, v) }, axis)
        };
        let targets: Vec<_> = (0..800).map(|_| target()).collect();
        // Half of the rays almost in the plane.
        let rays: Vec<_> = targets[..500]
            .iter()
            .enumerate()
            .map(|(i, &(to, axis))| {
                let mut direction = rng.vec() * 15.0;
                if i % 2 == 0 {
                    direction[axis] *= 10.0_f32.powf(-8.0 * rng.unit());
                }
                Ray::new(to - direction, direction)
            })
            .collect();
        let mut tile = Tile::new(targets[0].0 + rng.vec() * 10.0);
        while tile.push(targets[500 + rng.below(300)].0 - tile.origin(), f32::INFINITY).is_some() {}
        check_all(&kd_object(&meshes), &rays, &[tile], 2.0e-6 * 40.0);
    }
}

#[test]
fn leaves_list_only_what_touches_them() {
    // A diagonal strip: its box covers everything, its clipped parts hardly anything.
    let mesh = Mesh::new(
        vec![Vec3::ZERO, Vec3::new(8.0, 8.0, 0.1), Vec3::new(8.0, 8.1, 0.2), Vec3::new(0.1, 7.9, 0.3)],
        vec![[0, 1, 2], [3, 3, 0], [3, 0, 0], [0, 2, 3]],
    );
    let options = KdOptions { max_depth: Some(20), ..median() };
    let options = KdOptions { median_leaf: 0, max_references: 10_000, ..options };
    let tree = KdTree::build(std::slice::from_ref(&mesh), &options).expect("valid");
    assert_eq!(tree.stats().triangles, 2);
    let far_corner = leaves(&tree)
        .into_iter()
        .filter(|(cell, list)| cell.min.x > 6.0 && cell.max.y < 4.0 && !list.is_empty());
    assert_eq!(far_corner.count(), 0);
    assert!(tree.stats().empty_leaves > 0);
}

#[test]
fn same_bits_for_any_number_of_threads() {
    let mut rng = Rng::new(52);
    let meshes = [soup(&mut rng, 20_000, 10.0, 0.2, Vec3::ZERO), soup(&mut rng, 500, 3.0, 1.0, Vec3::X)];
    for options in [KdOptions::default(), median()] {
        let trees = [1, 2, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
            pool.install(|| KdTree::build(&meshes, &options).expect("valid"))
        });
        for tree in &trees[1..] {
            assert!(tree.nodes() == trees[0].nodes() && tree.references() == trees[0].references());
            assert!(tree.corners() == trees[0].corners() && tree.stats() == trees[0].stats());
        }
    }
}

#[test]
fn the_heuristic_beats_the_middle() {
    let mut rng = Rng::new(53);
    // Dense clusters in a wide space, as in a furnished room.
    let clusters: Vec<Mesh> = (0..10)
        .map(|_| {
            let center = rng.vec() * 10.0;
            soup(&mut rng, 800, 0.3, 0.05, center)
        })
        .collect();
    let (sah, middle) =
        (build(&clusters).stats(), KdTree::build(&clusters, &median()).expect("valid").stats());
    assert!(sah.sah < 0.75 * middle.sah, "{sah:?} {middle:?}");
    // A leaf with everything costs 1 per triangle.
    assert!(sah.sah < 0.01 * 8000.0, "{sah:?}");
}

#[test]
fn a_wall_in_the_plane_goes_to_one_side() {
    // Two squares facing each other across empty space; both lie in planes of their own.
    let square = |z: f32| {
        [Vec3::new(0.0, 0.0, z), Vec3::new(1.0, 0.0, z), Vec3::new(1.0, 1.0, z), Vec3::new(0.0, 1.0, z)]
    };
    let positions: Vec<Vec3> = [0.0, 1.0, 2.0, 8.0].into_iter().flat_map(square).collect();
    let indices: Vec<[u32; 3]> =
        (0..4).flat_map(|i| [[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]]).collect();
    let tree = build(&[Mesh::new(positions, indices)]);
    let stats = tree.stats();
    assert_eq!((stats.triangles, stats.references), (8, 8), "nothing is listed twice: {stats:?}");
    assert!(stats.empty_leaves > 0, "the gap is cut off: {stats:?}");
}

#[test]
fn a_tree_over_nothing_is_empty() {
    for meshes in [&[][..], &[Mesh::default()]] {
        let tree = build(meshes);
        assert!(tree.bounds().is_empty() && tree.nodes().is_empty());
        assert_eq!(tree.stats(), heliostat_kernel::KdStats::default());
    }
}

#[test]
fn hopeless_input_still_ends_within_its_limits() {
    // Everything in one place, everything crossing everything, exponentially shrinking steps, NaN costs.
    let mut rng = Rng::new(54);
    let mut positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let mut indices = vec![[0, 1, 2]; 2000];
    let mut size = 1.0e9_f32;
    for _ in 0..200 {
        let n = positions.len() as u32;
        positions.extend([Vec3::splat(size), Vec3::splat(size) + Vec3::X * size, Vec3::Y * size]);
        indices.push([n, n + 1, n + 2]);
        size *= 0.7;
    }
    let crossing = soup(&mut rng, 500, 0.01, 5.0, Vec3::ZERO);
    for meshes in [[Mesh::new(positions, indices)], [crossing]] {
        let nan = KdOptions { traversal_cost: f32::NAN, empty_bonus: f32::NAN, ..KdOptions::default() };
        let free = KdOptions { traversal_cost: -1.0e30, max_depth: Some(u32::MAX), ..KdOptions::default() };
        let tight = KdOptions { max_references: 0, ..median() };
        for options in [KdOptions::default(), median(), nan, free, tight] {
            let stats = KdTree::build(&meshes, &options).expect("valid").stats();
            let limit = stats.triangles * options.max_references.max(1) as usize;
            assert!(stats.references <= limit && stats.leaves <= limit, "{options:?} {stats:?}");
            assert!(stats.depth <= KdTree::MAX_DEPTH, "{options:?} {stats:?}");
            assert!(stats.references >= stats.triangles, "{options:?} {stats:?}");
        }
    }
}

#[test]
fn bad_indices_are_errors_that_name_the_place() {
    let bad = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2], [0, 7, 2]]);
    let error = KdTree::build(&[Mesh::default(), bad], &KdOptions::default()).unwrap_err();
    assert_eq!(error, BuildError::IndexOutOfRange { mesh: 1, triangle: 1, index: 7, vertices: 3 });
}

#[test]
fn words_are_what_the_documentation_says() {
    let mut rng = Rng::new(55);
    let tree = build(&[soup(&mut rng, 100, 1.0, 0.2, Vec3::ZERO)]);
    for node in tree.nodes() {
        let [first, second] = node.words();
        match node.kind() {
            KdNodeKind::Inner { axis, split, children } => {
                assert_eq!((first, second), (children << 2 | axis as u32, split.to_bits()));
            }
            KdNodeKind::Leaf { first: at, count } => assert_eq!((first, second), (count << 2 | 3, at)),
        }
    }
}

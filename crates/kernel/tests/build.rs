//! Trees: determinism, completeness, limits and messages; instruction sets by name.
mod common;
use std::sync::{
    Mutex,
    atomic::{AtomicUsize, Ordering},
};

use common::{Rng, all_builders, soup};
use heliostat_kernel::{
    BuildError, BuildOptions, BuildProgress, Isa, IsaError, Mesh, TriangleBvh, World, glam::Vec3,
};

fn build_by(meshes: &[Mesh], options: &BuildOptions) -> TriangleBvh {
    TriangleBvh::build(meshes, options).expect("valid meshes")
}

#[test]
fn same_bits_for_any_number_of_threads() {
    let mut rng = Rng::new(41);
    // Above the sizes from which tasks and binning run in parallel.
    let meshes = [soup(&mut rng, 90_000, 10.0, 0.1, Vec3::ZERO), soup(&mut rng, 5_000, 3.0, 1.0, Vec3::X)];
    for options in all_builders() {
        let print = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
            pool.install(|| build_by(&meshes, &options).fingerprint())
        };
        let one = print(1);
        assert!([2, 5].map(print) == [one; 2], "{options:?}");
    }
}

#[test]
fn every_good_triangle_is_in_the_tree() {
    let mut rng = Rng::new(42);
    for count in [1, 2, 7, 8, 9, 16, 17, 1000, 9001] {
        let mesh = soup(&mut rng, count, 1.0, 0.1, Vec3::ZERO);
        for options in all_builders() {
            let tree = build_by(std::slice::from_ref(&mesh), &options);
            let stats = tree.stats();
            assert_eq!(stats.triangles, count);
            assert!(stats.nodes >= 1 && stats.leaves >= 1 && stats.bytes >= 128 + 32 && stats.sah > 0.0);
            for p in mesh.positions.iter() {
                assert!(tree.bounds().contains(*p));
            }
        }
    }
}

#[test]
fn a_tree_over_nothing_is_empty() {
    for options in all_builders() {
        let tree = build_by(&[], &options);
        assert!(tree.bounds().is_empty());
        assert_eq!((tree.stats().triangles, tree.stats().nodes), (0, 0));
    }
}

#[test]
fn hopeless_input_still_ends() {
    // Equal centres, extreme spreads and exponentially shrinking steps: no split helps, depth stays bounded.
    let mut positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let mut indices = vec![[0, 1, 2]; 5000];
    let mut size = 1.0e9_f32;
    for _ in 0..200 {
        let n = positions.len() as u32;
        positions.extend([Vec3::splat(size), Vec3::splat(size) + Vec3::X * size, Vec3::Y * size]);
        indices.push([n, n + 1, n + 2]);
        size *= 0.7;
    }
    let meshes = [Mesh::new(positions, indices)];
    for options in all_builders() {
        assert!(build_by(&meshes, &options).stats().triangles > 5000);
    }
}

#[test]
fn bad_indices_are_errors_that_name_the_place() {
    let good = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
    let bad = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2], [0, 7, 2], [9, 9, 9]]);
    let error = TriangleBvh::build(&[good, bad], &BuildOptions::default()).unwrap_err();
    assert_eq!(error, BuildError::IndexOutOfRange { mesh: 1, triangle: 1, index: 7, vertices: 3 });
    let message = error.to_string();
    for part in ["mesh 1", "triangle 1", "index 7", "3 vertices"] {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn instruction_sets_are_chosen_by_name() {
    let available = Isa::available();
    assert!(available.contains(&Isa::Scalar));
    assert_eq!(available.first(), Some(&Isa::best()));
    for isa in Isa::ALL {
        assert_eq!(isa.name().parse(), Ok(isa));
        let world = World::with_isa(World::empty().root().clone(), isa);
        assert_eq!(world.is_ok(), available.contains(&isa));
        if let Err(error) = world {
            assert!(error.to_string().contains(isa.name()), "{error}");
        }
    }
    assert_eq!("avx9".parse::<Isa>(), Err(IsaError::Unknown { name: "avx9".into() }));
}

/// Remembers what it was told and cancels after some questions.
struct Follower {
    fractions: Mutex<Vec<f32>>,
    questions: AtomicUsize,
    patience: usize,
}

impl BuildProgress for Follower {
    fn fraction(&self, done: f32) {
        self.fractions.lock().expect("no panics").push(done);
    }

    fn cancelled(&self) -> bool {
        self.questions.fetch_add(1, Ordering::Relaxed) >= self.patience
    }
}

fn follow(
    meshes: &[Mesh],
    options: &BuildOptions,
    patience: usize,
) -> (Result<TriangleBvh, BuildError>, Vec<f32>, usize) {
    let follower = Follower { fractions: Mutex::default(), questions: AtomicUsize::new(0), patience };
    let result = TriangleBvh::build_with(meshes, options, &follower);
    (result, follower.fractions.into_inner().expect("no panics"), follower.questions.into_inner())
}

#[test]
fn a_build_shows_its_progress_and_can_be_stopped_anywhere() {
    let mut rng = Rng::new(43);
    let meshes = [soup(&mut rng, 150_000, 10.0, 0.1, Vec3::ZERO)];
    for options in all_builders() {
        let (tree, fractions, questions) = follow(&meshes, &options, usize::MAX);
        assert_eq!(tree.expect("not cancelled").fingerprint(), build_by(&meshes, &options).fingerprint());
        assert!(fractions.is_sorted() && fractions.len() > 20, "{fractions:?}");
        assert!(
            fractions[0] > 0.0
                && fractions[fractions.len() - 1] > 0.95
                && fractions.iter().all(|&f| f <= 1.0)
        );
        assert!(questions > 50, "asked {questions} times");
        for patience in
            [0, 1, 2, 5, questions / 8, questions / 4, questions / 2, questions * 3 / 4, questions - 8]
        {
            let (tree, _, asked) = follow(&meshes, &options, patience);
            assert_eq!(tree.err(), Some(BuildError::Cancelled), "after {patience} of {questions}");
            assert!(asked <= patience + 64, "went on for {asked} questions");
        }
    }
}

/// A fine mesh under a few long boards that lie across it.
fn boards_over_dust(rng: &mut Rng) -> [Mesh; 2] {
    let mut positions = Vec::new();
    for _ in 0..60 {
        let center = rng.vec() * 5.0;
        positions.extend([center + Vec3::splat(8.0), center - Vec3::splat(8.0), center + rng.vec() * 0.1]);
    }
    let indices: Vec<[u32; 3]> = (0..60).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    [soup(rng, 3000, 10.0, 0.05, Vec3::ZERO), Mesh::new(positions, indices)]
}

#[test]
fn spatial_splits_pay_for_long_triangles_and_keep_to_their_budget() {
    let meshes = boards_over_dust(&mut Rng::new(44));
    let plain = build_by(&meshes, &BuildOptions::default()).stats();
    let mut last = plain;
    for spatial_budget in [0.05, 0.3, 1.0] {
        let stats = build_by(&meshes, &BuildOptions { spatial_budget, ..BuildOptions::quality() }).stats();
        assert!(stats.sah < last.sah, "{} after {} at a budget of {spatial_budget}", stats.sah, last.sah);
        assert_eq!(stats.triangles, 3060);
        last = stats;
    }
    assert!(last.sah < 0.9 * plain.sah, "{} against {}", last.sah, plain.sah);
    let none = BuildOptions { spatial_budget: 0.0, ..BuildOptions::quality() };
    assert_eq!(build_by(&meshes, &none).stats(), plain);
}

#[test]
fn fast_trees_cost_little_more_than_default_ones() {
    let mut rng = Rng::new(45);
    let dust = soup(&mut rng, 20_000, 10.0, 0.1, Vec3::ZERO);
    // Like the leaves of a palm: long, crossing, many in one place.
    let mut fan = || {
        let center = rng.vec() * 10.0;
        soup(&mut rng, 100, 0.5, 4.0, center)
    };
    let leaves: Vec<Mesh> = (0..40).map(|_| fan()).collect();
    let boards = boards_over_dust(&mut rng).to_vec();
    for (meshes, most) in [(vec![dust], 1.25), (leaves, 1.25), (boards, 1.25)] {
        let [fast, default] = [BuildOptions::fast(), BuildOptions::default()]
            .map(|options| build_by(&meshes, &options).stats());
        assert!(fast.sah < most * default.sah, "{} against {}", fast.sah, default.sah);
    }
}

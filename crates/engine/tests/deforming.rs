//! Meshes that deform: refitted, rebuilt in time or in the background, and never another picture for it.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    ApplyReport, Backend, Camera, Edit, Frame, FrameRequest, FrameStats, Geometry, GeometryId, Light,
    LightKind, Material, Mesh, Progress, RebuildKind, RebuildReason, SceneBuilder,
};

const SIZE: u32 = 48;

/// A sheet whose points are scattered further and further from where they were.
fn sheet(time: f32) -> Mesh {
    let row = SIZE + 1;
    let vertex = |i: u32| {
        let flat =
            Vec3::new((i % row) as f32, 0.0, (i / row) as f32) / SIZE as f32 - Vec3::new(0.5, 0.0, 0.5);
        let wild = |k: f32| (i as f32 * k).fract() - 0.5;
        flat + time * Vec3::new(wild(0.618), wild(0.414), wild(0.732))
    };
    let quads = (0..SIZE * SIZE).map(|q| q % SIZE + q / SIZE * row);
    let indices = quads.flat_map(|a| [[a, a + row, a + row + 1], [a, a + row + 1, a + 1]]).collect();
    Mesh::new((0..row * row).map(vertex).collect(), indices)
}

fn deformed(time: f32) -> Edit {
    Edit::Geometry(GeometryId(0), Geometry::Mesh(Arc::new(sheet(time))))
}

fn engine(budget: Duration) -> Engine {
    let mut scene = SceneBuilder::new();
    let material = scene.material(Material::diffuse("grey", Vec3::splat(0.6)));
    let mesh = scene.mesh(sheet(0.0));
    let object = scene.object("sheet", [(mesh, material)]);
    scene.instance(object, Affine3A::IDENTITY);
    let kind = LightKind::Directional { direction: Vec3::new(0.3, -1.0, 0.2), irradiance: Vec3::ONE };
    scene.light(Light { name: "sun".into(), kind });
    let options = EngineOptions { rebuild_budget: budget, ..EngineOptions::default() };
    let mut engine = Engine::new(options).expect("an engine");
    engine.apply(&scene.finish(), &Progress::new()).expect("valid");
    engine
}

fn apply(engine: &mut Engine, time: f32) -> ApplyReport {
    engine.apply(&[deformed(time)], &Progress::new()).expect("valid")
}

fn frame(engine: &mut Engine) -> Frame {
    let camera = Camera::look_at("", Vec3::new(0.4, 1.2, 1.4), Vec3::ZERO, Vec3::Y, 0.8);
    let mut request = FrameRequest::new(camera, 40, 30);
    request.renderer = "direct".into();
    request.samples = 2;
    let frame = engine.render(&request, &Progress::new()).expect("a frame");
    Frame { stats: FrameStats::default(), ..frame }
}

fn triangle_tree(report: &ApplyReport) -> (RebuildReason, RebuildKind) {
    let tree = report.rebuilt.iter().find(|r| r.what.starts_with("triangle tree")).expect("a tree changed");
    (tree.reason, tree.kind)
}

#[test]
fn a_small_change_is_a_refit_and_a_large_one_a_rebuild_in_time() {
    let mut engine = engine(Duration::from_secs(10));
    assert!(matches!(
        triangle_tree(&apply(&mut engine, 0.001)),
        (RebuildReason::Changed, RebuildKind::Refitted { cost }) if cost < 1.2
    ));
    let kinds: Vec<_> = (1..12).map(|step| triangle_tree(&apply(&mut engine, 0.05 * step as f32))).collect();
    assert!(kinds.contains(&(RebuildReason::Worn, RebuildKind::Built)), "{kinds:?}");
}

#[test]
fn without_time_the_old_tree_serves_until_the_new_one_is_there() {
    let mut engine = engine(Duration::ZERO);
    for step in 1..12 {
        let (_, kind) = triangle_tree(&apply(&mut engine, 0.05 * step as f32));
        assert!(matches!(kind, RebuildKind::Refitted { .. }), "no build holds up an edit: {kind:?}");
    }
    // The tree in the making is taken up by an edit that comes after it is done.
    let waiting = Instant::now();
    for step in 0.. {
        let (_, kind) = triangle_tree(&apply(&mut engine, 0.55 + 1e-5 * step as f32));
        if matches!(kind, RebuildKind::Refitted { cost } if cost < 1.4) {
            break;
        }
        assert!(waiting.elapsed() < Duration::from_secs(60), "nothing came from the background: {kind:?}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn the_way_a_tree_came_to_be_changes_no_picture() {
    let mut fresh = engine(Duration::ZERO);
    apply(&mut fresh, 0.55);
    let scene = fresh.scene().to_edits();
    let mut expected = Engine::new(EngineOptions::default()).expect("an engine");
    expected.apply(&scene, &Progress::new()).expect("valid");
    let expected = frame(&mut expected);
    for budget in [Duration::ZERO, Duration::from_secs(10)] {
        let mut engine = engine(budget);
        (1..12).for_each(|step| _ = apply(&mut engine, 0.05 * step as f32));
        assert_eq!(frame(&mut engine), expected);
        std::thread::sleep(Duration::from_millis(100));
        assert_eq!(frame(&mut engine), expected, "also once the background is done");
    }
}

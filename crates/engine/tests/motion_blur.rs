//! An open shutter: every pixel is the mean over time of what a still picture would show.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    Backend, Camera, Edit, Frame, FrameRequest, Geometry, GeometryId, InstanceId, Light, LightKind, Material,
    Mesh, Progress, Projection, SceneBuilder,
};

/// Pixels per metre of the flat pictures.
const PIXELS: u32 = 32;
const SAMPLES: u32 = 256;

/// A glowing strip, half a metre wide, in front of a camera that looks along −Z at 2 × 1 metres.
fn strip() -> Mesh {
    Mesh::quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 0.5, Vec3::Y * 2.0)
}

fn engine(nested: bool) -> Engine {
    let mut scene = SceneBuilder::new();
    let glow = scene.material(Material::emitter("glow", Vec3::ONE));
    let mesh = scene.mesh(strip());
    let object = scene.object("strip", [(mesh, glow)]);
    if nested {
        let group = scene.object("group", []);
        scene.instance(group, Affine3A::from_translation(Vec3::X));
        scene.child(group, object, Affine3A::from_translation(Vec3::NEG_X));
    } else {
        scene.instance(object, Affine3A::IDENTITY);
    }
    let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
    engine.apply(&scene.finish(), &Progress::new()).expect("valid");
    engine
}

fn camera() -> Camera {
    let mut camera = Camera::look_at("", Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 1.0);
    camera.projection = Projection::Orthographic { height: 1.0 };
    camera
}

fn picture(engine: &mut Engine, camera: Camera, renderer: &str) -> Frame {
    let mut request = FrameRequest::new(camera, 2 * PIXELS, PIXELS);
    request.renderer = renderer.into();
    request.samples = SAMPLES;
    engine.render(&request, &Progress::new()).expect("a frame")
}

/// Share of the time from 0 to 1 during which a strip over [−1, −0.5] that moves by 1 covers `x`, and its mean over a pixel.
fn covered(pixel: u32) -> f32 {
    let at = |x: f32| ((x + 1.0).min(1.0) - (x + 0.5).max(0.0)).clamp(0.0, 1.0);
    let steps = 64;
    let point = |i: u32| (pixel as f32 + (i as f32 + 0.5) / steps as f32) / PIXELS as f32 - 1.0;
    (0..steps).map(|i| at(point(i))).sum::<f32>() / steps as f32
}

fn assert_swept(frame: &Frame, what: &str) {
    for (i, color) in frame.color.iter().enumerate() {
        let expected = covered(i as u32 % frame.width);
        let error = (color.x - expected).abs();
        assert!(error < 0.04, "{what}: pixel {i} is {}, expected {expected}", color.x);
    }
}

#[test]
fn a_moving_instance_is_seen_for_as_long_as_it_is_there() {
    for renderer in ["path", "direct"] {
        let mut engine = engine(false);
        let sweep =
            Edit::SweepInstance(InstanceId(0), Affine3A::IDENTITY, Affine3A::from_translation(Vec3::X));
        engine.apply(&[sweep], &Progress::new()).expect("valid");
        assert_swept(&picture(&mut engine, camera(), renderer), renderer);
    }
}

#[test]
fn nested_instances_add_up_and_can_hold_each_other_still() {
    let mut engine = engine(true);
    let shift = |x: f32| Affine3A::from_translation(Vec3::X * x);
    let half = [
        Edit::SweepInstance(InstanceId(0), shift(1.0), shift(1.5)),
        Edit::SweepInstance(InstanceId(1), shift(-1.0), shift(-0.5)),
    ];
    engine.apply(&half, &Progress::new()).expect("valid");
    assert_swept(&picture(&mut engine, camera(), "path"), "two halves");
    let against = [
        Edit::SweepInstance(InstanceId(0), shift(1.0), shift(2.0)),
        Edit::SweepInstance(InstanceId(1), shift(-1.0), shift(-2.0)),
    ];
    engine.apply(&against, &Progress::new()).expect("valid");
    let still = picture(&mut engine, camera(), "path");
    let lit = still.color.iter().filter(|c| c.x > 0.5).count() as u32;
    assert_eq!(lit, PIXELS / 2 * PIXELS, "what goes back and forth at once stands still");
}

#[test]
fn a_deforming_mesh_is_seen_for_as_long_as_it_is_there() {
    let mut engine = engine(false);
    let mut mesh = strip();
    mesh.motion = mesh.positions.iter().map(|&p| p + Vec3::X).collect();
    let edit = Edit::Geometry(GeometryId(0), Geometry::Mesh(Arc::new(mesh)));
    engine.apply(&[edit], &Progress::new()).expect("valid");
    assert_swept(&picture(&mut engine, camera(), "path"), "mesh");
    let still = Edit::Geometry(GeometryId(0), Geometry::Mesh(Arc::new(strip())));
    engine.apply(&[still], &Progress::new()).expect("valid");
    let sharp = picture(&mut engine, camera(), "path");
    assert!(sharp.color.iter().all(|c| c.x == 0.0 || c.x == 1.0), "nothing moves any more");
}

#[test]
fn a_moving_camera_is_the_world_moving_the_other_way() {
    let mut engine = engine(false);
    let mut moving = camera();
    moving.motion = Some(Affine3A::from_translation(Vec3::NEG_X) * moving.world_from_camera);
    assert_swept(&picture(&mut engine, moving, "direct"), "camera");
}

#[test]
fn shadows_of_what_moves_are_as_long_as_their_time() {
    // A strip sweeps between a far light and a wall; what the wall loses is the share of time in the strip's shadow.
    let mut scene = SceneBuilder::new();
    let white = scene.material(Material::diffuse("white", Vec3::ONE));
    let wall = scene.mesh(Mesh::quad(Vec3::new(-2.0, -2.0, -1.0), Vec3::X * 4.0, Vec3::Y * 4.0));
    let wall = scene.object("wall", [(wall, white)]);
    scene.instance(wall, Affine3A::IDENTITY);
    let mesh = scene.mesh(strip());
    let strip = scene.object("strip", [(mesh, white)]);
    let strip = scene.instance(strip, Affine3A::from_translation(Vec3::Z * 10.0));
    let kind =
        LightKind::Directional { direction: Vec3::NEG_Z, irradiance: Vec3::splat(std::f32::consts::PI) };
    scene.light(Light { name: "sun".into(), kind });
    let mut edits = scene.finish();
    let place = |x: f32| Affine3A::from_translation(Vec3::new(x, 0.0, 10.0));
    edits.push(Edit::SweepInstance(strip, place(0.0), place(1.0)));
    let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
    engine.apply(&edits, &Progress::new()).expect("valid");
    for renderer in ["path", "direct"] {
        let frame = picture(&mut engine, camera(), renderer);
        for (i, color) in frame.color.iter().enumerate() {
            let expected = 1.0 - covered(i as u32 % frame.width);
            assert!(
                (color.x - expected).abs() < 0.04,
                "{renderer}: pixel {i} is {}, not {expected}",
                color.x
            );
        }
    }
}

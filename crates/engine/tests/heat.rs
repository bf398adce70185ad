//! Planes that count what pixels cost.

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    Backend, Camera, Environment, Frame, FrameRequest, Material, Mesh, Plane, Progress, SceneBuilder,
};

/// A wall of two halves as seen from the front: on the left a mirror, on the right white; a heap of small things lies before
/// the upper right quarter.
fn frame(renderer: &str) -> Frame {
    let mut scene = SceneBuilder::new();
    let white = scene.material(Material::diffuse("white", Vec3::splat(0.7)));
    let mirror = scene.material(Material::metal("mirror", Vec3::splat(0.9), 0.0));
    let quad = |x: f32| Mesh::quad(Vec3::new(x, -1.0, 0.0), Vec3::X, Vec3::Y * 2.0);
    let (left, right) = (scene.mesh(quad(-1.0)), scene.mesh(quad(0.0)));
    let walls = scene.object("walls", [(left, mirror), (right, white)]);
    scene.instance(walls, Affine3A::IDENTITY);
    let small = scene.mesh(Mesh::quad(Vec3::ZERO, Vec3::X * 0.01, Vec3::Y * 0.01));
    let grain = scene.object("grain", [(small, white)]);
    for i in 0..400 {
        let at = Vec3::new(0.2 + 0.03 * (i % 20) as f32, 0.2 + 0.03 * (i / 20) as f32, 0.05);
        scene.instance(grain, Affine3A::from_translation(at));
    }
    scene.environment(Environment::Constant(Vec3::ONE));
    let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
    engine.apply(&scene.finish(), &Progress::new()).expect("valid edits");
    let camera = Camera::look_at("", Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 0.9);
    let mut request = FrameRequest::new(camera, 48, 48);
    (request.renderer, request.samples) = (renderer.into(), 2);
    request.planes = vec![Plane::Cost, Plane::Nodes, Plane::Triangles, Plane::Alpha];
    engine.render(&request, &Progress::new()).expect("a frame")
}

/// The mean of a plane over a part of the picture: from and to, columns and rows.
fn mean(frame: &Frame, plane: usize, [x0, x1]: [usize; 2], [y0, y1]: [usize; 2]) -> f32 {
    let places = (y0..y1).flat_map(|y| (x0..x1).map(move |x| y * 48 + x));
    let sum: f32 = places.map(|place| frame.planes[plane].values[place]).sum();
    sum / ((x1 - x0) * (y1 - y0)) as f32
}

#[test]
fn heat_is_where_the_work_is() {
    let frame = frame("direct");
    let kinds: Vec<Plane> = frame.planes.iter().map(|data| data.plane).collect();
    assert_eq!(kinds, [Plane::Cost, Plane::Nodes, Plane::Triangles, Plane::Alpha]);
    let (left, right, up, down) = ([10, 22], [28, 38], [10, 20], [28, 38]);
    // The mirror sees the sky: as much is shaded there as on the wall, and nothing beyond the walls.
    assert_eq!(mean(&frame, 0, right, down), 1.0);
    assert!(mean(&frame, 0, left, down) >= 1.0);
    assert_eq!(mean(&frame, 0, [0, 4], [0, 4]), 0.0);
    // The heap costs nodes, whether it is hit or missed.
    let [heap, wall] = [up, down].map(|rows| mean(&frame, 1, right, rows));
    assert!(heap > 1.5 * wall && wall >= 2.0, "{heap} {wall}");
    assert!(mean(&frame, 2, right, down) >= 1.0 && mean(&frame, 2, [0, 4], [0, 4]) == 0.0);
}

#[test]
fn counts_do_not_depend_on_the_renderer_but_shading_does() {
    let [direct, path] = ["direct", "path"].map(frame);
    assert_eq!(direct.planes[1..3], path.planes[1..3]);
    let (all, rows) = ([0, 48], [0, 48]);
    assert!(mean(&path, 0, all, rows) >= mean(&direct, 0, all, rows));
}

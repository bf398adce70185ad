//! The promises of the backend: an edit costs what it touches, threads never change a picture, work can be cancelled.

use std::num::NonZeroUsize;
use std::sync::Arc;

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    Backend, BackendError, Camera, Edit, EditError, Environment, Filter, FrameRequest, Instance, InstanceId,
    Lens, Material, MaterialId, MaterialOverride, Mesh, Object, ObjectId, Plane, Progress, RebuildReason,
    SceneBuilder, ShaderUse, Target,
};

/// Two objects, one nested in the other, a floor and a lamp; handles in the order of their making.
struct Small {
    edits: Vec<Edit>,
    inner: ObjectId,
    inner_instance: InstanceId,
    outer_instance: InstanceId,
    red: MaterialId,
}

fn small_scene() -> Small {
    let mut scene = SceneBuilder::new();
    let red = scene.material(Material::plastic("red", Vec3::new(0.8, 0.1, 0.1), 0.3));
    let white = scene.material(Material::diffuse("white", Vec3::splat(0.7)));
    let lamp = scene.material(Material::emitter("lamp", Vec3::splat(4.0)));
    let tile = scene.mesh(Mesh::quad(Vec3::new(-0.5, 0.0, 0.5), Vec3::X, Vec3::NEG_Z));
    let inner = scene.object("inner", [(tile, red)]);
    let outer = scene.object("outer", []);
    let inner_instance = scene.child(outer, inner, Affine3A::from_translation(Vec3::Y * 0.5));
    let outer_instance = scene.instance(outer, Affine3A::from_rotation_z(0.3));
    let floor = scene.object("floor", [(tile, white)]);
    scene.instance(floor, Affine3A::from_scale(Vec3::splat(4.0)));
    let ceiling = scene.object("lamp", [(tile, lamp)]);
    scene.instance(
        ceiling,
        Affine3A::from_translation(Vec3::Y * 2.0) * Affine3A::from_rotation_x(std::f32::consts::PI),
    );
    scene.environment(Environment::Constant(Vec3::splat(0.1)));
    Small { edits: scene.finish(), inner, inner_instance, outer_instance, red }
}

fn request(renderer: &str) -> FrameRequest {
    let mut camera = Camera::look_at("", Vec3::new(1.5, 1.2, 2.5), Vec3::new(0.0, 0.4, 0.0), Vec3::Y, 0.8);
    camera.lens = Some(Lens { radius: 0.02, focus_distance: 2.5 });
    let mut request = FrameRequest::new(camera, 53, 37);
    request.renderer = renderer.into();
    request.samples = 3;
    request.filter = Filter::BlackmanHarris;
    request.planes = Plane::ALL.to_vec();
    request
}

fn engine(threads: usize) -> Engine {
    let options = EngineOptions { threads: NonZeroUsize::new(threads), ..EngineOptions::default() };
    let mut engine = Engine::new(options).expect("an engine");
    engine.apply(&small_scene().edits, &Progress::new()).expect("valid edits");
    engine
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for renderer in ["path", "direct", "igi", "instant-radiosity", "path-filtered", "cast", "eyelight"] {
        let frames: Vec<_> = [1, 2, 5]
            .into_iter()
            .map(|threads| {
                let mut frame =
                    engine(threads).render(&request(renderer), &Progress::new()).expect("a frame");
                (frame.stats.milliseconds, frame.stats.query_milliseconds) = (0.0, 0.0);
                frame
            })
            .collect();
        assert!(frames[0].color.iter().any(|c| c.length() > 0.1), "the picture is not black");
        assert_eq!(frames[0], frames[1], "{renderer}, 2 threads");
        assert_eq!(frames[0], frames[2], "{renderer}, 5 threads");
    }
}

#[test]
fn buffers_that_are_used_again_leave_nothing_behind() {
    let mut engine = engine(2);
    let wide =
        FrameRequest { width: 80, height: 61, planes: vec![Plane::Normal, Plane::Cost], ..request("path") };
    for renderer in ["direct", "igi"] {
        let wanted =
            FrameRequest { planes: vec![Plane::Depth, Plane::Position, Plane::Nodes], ..request(renderer) };
        let mut frames = [&wanted, &wide, &wanted].map(|request| {
            let frame = engine.render(request, &Progress::new()).expect("a frame");
            engine.reuse(frame.clone());
            frame
        });
        let cancelled = Progress::new();
        cancelled.cancel();
        assert_eq!(engine.render(&wide, &cancelled), Err(BackendError::Cancelled));
        for frame in &mut frames {
            (frame.stats.milliseconds, frame.stats.query_milliseconds) = (0.0, 0.0);
        }
        assert_eq!(frames[0], frames[2], "{renderer}");
    }
}

#[test]
fn seeds_and_frames_change_the_noise_alone() {
    let mut engine = engine(2);
    let base = engine.render(&request("path"), &Progress::new()).expect("a frame");
    for other in [FrameRequest { seed: 1, ..request("path") }, FrameRequest { frame: 1, ..request("path") }] {
        let frame = engine.render(&other, &Progress::new()).expect("a frame");
        assert_ne!(frame.color, base.color);
        let mean = |c: &[Vec3]| c.iter().sum::<Vec3>() / c.len() as f32;
        assert!((mean(&frame.color) - mean(&base.color)).length() < 0.05);
    }
}

#[test]
fn an_edit_rebuilds_what_it_touches() {
    let scene = small_scene();
    let mut engine = engine(2);
    let mut apply = |edit: Edit| {
        let report = engine.apply(&[edit], &Progress::new()).expect("a valid edit");
        report.rebuilt.into_iter().map(|r| (r.what, r.cause, r.reason)).collect::<Vec<_>>()
    };
    let moved = Target::Instance(scene.outer_instance);
    assert_eq!(
        apply(Edit::MoveInstance(scene.outer_instance, Affine3A::from_rotation_z(0.5))),
        [("instance tree of the world".to_owned(), moved, RebuildReason::InstanceMoved)],
        "moving an instance of the world rebuilds the top level alone"
    );
    let moved = Target::Instance(scene.inner_instance);
    assert_eq!(
        apply(Edit::MoveInstance(scene.inner_instance, Affine3A::from_rotation_z(0.5))),
        [
            ("instance tree of object 1 (\"outer\")".to_owned(), moved, RebuildReason::InstanceMoved),
            ("instance tree of the world".to_owned(), moved, RebuildReason::ChildChanged),
        ],
        "moving a nested instance rebuilds the trees above it and no triangles"
    );
    let green = Arc::new(Material::diffuse("green", Vec3::Y));
    assert_eq!(apply(Edit::Material(scene.red, green)), [], "a material touches no geometry");
    let view = Camera::look_at("", Vec3::ZERO, Vec3::X, Vec3::Y, 1.0);
    assert_eq!(apply(Edit::Camera(heliostat_scene::CameraId(0), view)), [], "a camera touches nothing");
    let same_shape = engine.scene().objects()[&scene.inner].clone();
    let report = engine.apply(&[Edit::Object(scene.inner, same_shape)], &Progress::new()).expect("valid");
    assert_eq!(report.rebuilt, [], "an object of the same geometries keeps its tree");
}

#[test]
fn edits_change_the_picture_as_if_made_from_scratch() {
    let scene = small_scene();
    let edit = Edit::MoveInstance(scene.inner_instance, Affine3A::from_translation(Vec3::new(0.3, 0.8, 0.0)));
    let mut edited = engine(2);
    edited.apply(std::slice::from_ref(&edit), &Progress::new()).expect("valid");
    let mut fresh = Engine::new(EngineOptions::default()).expect("an engine");
    let all: Vec<Edit> = scene.edits.into_iter().chain([edit]).collect();
    fresh.apply(&all, &Progress::new()).expect("valid");
    let render =
        |engine: &mut Engine| engine.render(&request("path"), &Progress::new()).expect("a frame").color;
    let before = render(&mut engine(2));
    assert_eq!(render(&mut edited), render(&mut fresh));
    assert_ne!(render(&mut edited), before);
}

#[test]
fn refused_and_cancelled_edits_leave_everything_as_it_was() {
    let mut engine = engine(2);
    let before = engine.render(&request("direct"), &Progress::new()).expect("a frame").color;
    let bad = [Edit::RemoveInstance(InstanceId(0)), Edit::MoveInstance(InstanceId(99), Affine3A::IDENTITY)];
    let error = engine.apply(&bad, &Progress::new()).expect_err("instance 99 does not exist");
    assert_eq!(error, BackendError::Edit(EditError::Unknown { target: Target::Instance(InstanceId(99)) }));
    let cancelled = Progress::new();
    cancelled.cancel();
    let edits = [Edit::RemoveInstance(InstanceId(0))];
    assert_eq!(engine.apply(&edits, &cancelled), Err(BackendError::Cancelled));
    assert_eq!(engine.scene().instances().len(), 4);
    let after = engine.render(&request("direct"), &Progress::new()).expect("a frame").color;
    assert_eq!(after, before);
    assert_eq!(engine.render(&request("direct"), &cancelled).map(|f| f.color), Err(BackendError::Cancelled));
}

#[test]
fn a_hierarchy_beyond_the_limit_is_refused_and_leaves_everything_as_it_was() {
    let mut engine = engine(2);
    let before = engine.render(&request("direct"), &Progress::new()).expect("a frame").color;
    // Each object holds the one before it twice: 23 of them make eight million placements.
    let mut edits = Vec::new();
    let object = |i: u32| ObjectId(100 + i);
    for i in 0..23 {
        edits.push(Edit::Object(object(i), Object::default()));
        for copy in 0..2 * u32::from(i > 0) {
            edits.push(place(InstanceId(100 + 2 * i + copy), object(i.saturating_sub(1)), Some(object(i))));
        }
    }
    edits.push(place(InstanceId(99), object(22), None));
    // What comes with it goes with it.
    edits.push(Edit::MoveInstance(InstanceId(0), Affine3A::from_translation(Vec3::Y)));
    let error = engine.apply(&edits, &Progress::new()).expect_err("too large");
    assert!(matches!(error, BackendError::Limit(_)), "{error}");
    assert_eq!(engine.scene().instances().len(), 4);
    let after = engine.render(&request("direct"), &Progress::new()).expect("a frame").color;
    assert_eq!(after, before);
    let moved = Edit::MoveInstance(InstanceId(1), Affine3A::from_rotation_z(0.5));
    engine.apply(&[moved], &Progress::new()).expect("it goes on");
}

fn place(id: InstanceId, object: ObjectId, parent: Option<ObjectId>) -> Edit {
    let parent_from_object = Affine3A::IDENTITY;
    let name = String::new();
    Edit::Instance(id, Instance { name, object, parent, parent_from_object, motion: None, visible: true })
}

#[test]
fn planes_describe_the_first_hit() {
    let mut engine = engine(2);
    let mut request = request("path");
    request.camera.lens = None;
    request.filter = Filter::Box;
    let frame = engine.render(&request, &Progress::new()).expect("a frame");
    let plane = |wanted: Plane| {
        let data = frame.planes.iter().find(|p| p.plane == wanted).expect("asked for");
        assert_eq!(data.values.len(), 53 * 37 * wanted.channels());
        data
    };
    let pixel = 30 * 53 + 26;
    let position = Vec3::from_slice(&plane(Plane::Position).values[3 * pixel..]);
    assert!(position.y.abs() < 0.01, "the lower middle shows the floor: {position}");
    let depth = plane(Plane::Depth).values[pixel];
    assert!((position.distance(Vec3::new(1.5, 1.2, 2.5)) - depth).abs() < 0.01);
    let normal = Vec3::from_slice(&plane(Plane::Normal).values[3 * pixel..]);
    assert!(normal.distance(Vec3::Y) < 1e-4, "{normal}");
    assert!((plane(Plane::Albedo).values[3 * pixel] - 0.7).abs() < 1e-4);
    assert_eq!(plane(Plane::Alpha).values[pixel], 1.0);
    assert_eq!(plane(Plane::ObjectId).values[pixel], 3.0, "object 2, plus one");
    assert_eq!(plane(Plane::MaterialId).values[pixel], 2.0);
    assert_eq!(plane(Plane::InstanceId).values[pixel], 3.0);
}

#[test]
fn diffuse_override_removes_gloss_and_nothing_else() {
    let mut engine = engine(2);
    let mut request = request("path");
    let shiny = engine.render(&request, &Progress::new()).expect("a frame").color;
    request.materials = MaterialOverride::Diffuse;
    let dull = engine.render(&request, &Progress::new()).expect("a frame").color;
    assert_ne!(shiny, dull);
    request.materials = MaterialOverride::None;
    assert_eq!(engine.render(&request, &Progress::new()).expect("a frame").color, shiny);
}

#[test]
fn a_shader_can_take_the_place_of_all_others() {
    let mut engine = engine(2);
    let mut request = request("cast");
    // One sample: the mean of several colours is not the colour of the mean.
    request.samples = 1;
    request.planes = vec![Plane::Normal, Plane::Alpha];
    let shader = ShaderUse::named("show-normal");
    request.materials = MaterialOverride::Shader { shader, mirrors: false };
    let frame = engine.render(&request, &Progress::new()).expect("a frame");
    let (normals, alpha) = (&frame.planes[0].values, &frame.planes[1].values);
    let decoded = |v: f32| ((0.5 * v + 0.5 + 0.055) / 1.055).powf(2.4);
    let mut seen = 0;
    for (i, color) in frame.color.iter().enumerate().filter(|(i, _)| alpha[*i] == 1.0) {
        let expected = Vec3::from_slice(&normals[3 * i..]);
        if expected.min_element() > -0.8 {
            assert!(color.distance(expected.to_array().map(decoded).into()) < 1e-2, "{color} {expected}");
            seen += 1;
        }
    }
    assert!(seen > 100, "{seen} pixels of one surface");
    // Another one takes its place, and one that there is not is refused.
    let shader = ShaderUse::named("show-facing");
    request.materials = MaterialOverride::Shader { shader, mirrors: true };
    assert_ne!(engine.render(&request, &Progress::new()).expect("a frame").color, frame.color);
    let shader = ShaderUse::named("show-magic");
    request.materials = MaterialOverride::Shader { shader, mirrors: false };
    let refused = engine.render(&request, &Progress::new()).expect_err("refused").to_string();
    assert!(refused.contains("show-magic") && refused.contains("show-normal"), "{refused}");
}

#[test]
fn impossible_requests_are_refused_with_the_reason() {
    let mut engine = engine(1);
    let mut refused = |change: fn(&mut FrameRequest)| {
        let mut request = request("path");
        change(&mut request);
        engine.render(&request, &Progress::new()).expect_err("refused").to_string()
    };
    assert!(refused(|r| r.renderer = "magic".into()).contains("`magic`"));
    assert!(refused(|r| r.renderer = "magic".into()).contains("path, direct"));
    assert!(refused(|r| r.width = 0).contains("0×37"));
    assert!(refused(|r| (r.width, r.height) = (u32::MAX, u32::MAX)).contains("the limit is"));
    assert!(refused(|r| r.samples = 0).contains("at least 1"));
    assert!(refused(|r| r.max_depth = Some(0)).contains("depth"));
    assert!(refused(|r| r.filter = Filter::Gaussian(f32::INFINITY)).contains("standard deviation"));
    assert!(refused(|r| r.ambient = Vec3::splat(f32::NAN)).contains("ambient"));
    let infinite = Lens { radius: 0.1, focus_distance: f32::INFINITY };
    let mut with_lens = request("path");
    with_lens.camera.lens = Some(infinite);
    assert!(with_lens.camera.problem().is_some_and(|problem| problem.contains("focus distance")));
    assert!(refused(|r| r.camera.world_from_camera = Affine3A::ZERO).contains("invertible"));
}

#[test]
fn singular_instances_are_left_out_with_a_warning() {
    let mut engine = engine(1);
    let edit = Edit::MoveInstance(InstanceId(1), Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)));
    let report = engine.apply(&[edit], &Progress::new()).expect("allowed");
    assert_eq!(report.warnings.len(), 1);
    assert!(report.warnings[0].contains("instance 1"), "{}", report.warnings[0]);
    engine.render(&request("path"), &Progress::new()).expect("the rest renders");
}

#[test]
fn vertices_that_are_nowhere_are_reported() {
    let mut scene = SceneBuilder::new();
    let white = scene.material(Material::diffuse("white", Vec3::ONE));
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::NAN];
    let mesh = scene.mesh(Mesh::new(corners, vec![[0, 1, 2], [0, 1, 3]]));
    let object = scene.object("torn", [(mesh, white)]);
    scene.instance(object, Affine3A::IDENTITY);
    let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
    let report = engine.apply(&scene.finish(), &Progress::new()).expect("the rest is shown");
    assert!(report.warnings.iter().any(|w| w.contains("1 vertices are not finite")), "{:?}", report.warnings);
}

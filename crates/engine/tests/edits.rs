//! Whatever the edits and their order: the picture is that of a fresh engine with the same scene, bit for bit.

use std::sync::Arc;

use glam::{Affine3A, EulerRot, Mat3, Quat, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    Backend, Camera, CameraId, Edit, Environment, Frame, FrameRequest, Geometry, GeometryId, Instance,
    InstanceId, Light, LightId, LightKind, Material, MaterialId, Mesh, Object, ObjectId, Part, Plane,
    Progress, Scene,
};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// Handles are drawn from small ranges, so that edits meet each other.
const GEOMETRIES: u32 = 4;
const MATERIALS: u32 = 4;
const OBJECTS: u32 = 5;
const INSTANCES: u32 = 8;
const LIGHTS: u32 = 3;

fn transform() -> impl Strategy<Value = Affine3A> {
    let angles = prop::array::uniform3(-3.0..3.0_f32);
    let scale = prop::array::uniform3(prop_oneof![0.4..1.5_f32, -1.2..-0.5_f32]);
    let place = prop::array::uniform3(-1.0..1.0_f32);
    let shear = -0.5..0.5_f32;
    let regular = (angles, scale, place, shear).prop_map(|([x, y, z], scale, place, shear)| {
        let turn = Quat::from_euler(EulerRot::XYZ, x, y, z);
        let mut shearing = Mat3::IDENTITY;
        shearing.y_axis.x = shear;
        Affine3A::from_translation(place.into())
            * Affine3A::from_quat(turn)
            * Affine3A::from_mat3(shearing)
            * Affine3A::from_scale(scale.into())
    });
    // Common ones, so that surfaces coincide: the same instance twice, planes that fall together, turned and mirrored.
    let common = prop::sample::select(vec![
        Affine3A::IDENTITY,
        Affine3A::from_translation(Vec3::new(0.25, 0.0, 0.5)),
        Affine3A::from_rotation_y(0.5),
        Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)),
    ]);
    prop_oneof![
        10 => regular,
        8 => common,
        2 => Just(Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0))),
    ]
}

/// A bumpy sheet: always the same triangles for a size, so that some edits refit and some rebuild. Large ones are long and
/// narrow: where they are turned, trees over their instances open them.
fn mesh() -> impl Strategy<Value = Mesh> {
    let size = prop_oneof![4 => Just(2_u32), 1 => Just(1), 1 => Just(3), 6 => Just(12)];
    let broken = prop::bool::weighted(0.2);
    let moving = prop::bool::weighted(0.15);
    (size, prop::collection::vec(-0.3..0.3_f32, 16), broken, moving).prop_map(
        |(size, heights, broken, moving)| {
            let row = size + 1;
            let vertex = |i: u32| {
                let (x, z) = (i % row, i / row);
                let at = Vec3::new(x as f32, 0.0, z as f32) / size as f32 - Vec3::new(0.5, 0.0, 0.5);
                let narrow = if size > 3 { Vec3::new(1.0, 0.05, 0.05) } else { Vec3::ONE };
                (at + Vec3::Y * heights[i as usize % 16]) * narrow
            };
            let mut positions: Vec<Vec3> = (0..row * row).map(vertex).collect();
            if broken {
                positions[0] = positions[1];
            }
            let quads = (0..size * size).map(|q| q % size + q / size * row);
            let indices = quads.flat_map(|a| [[a, a + row, a + row + 1], [a, a + row + 1, a + 1]]).collect();
            let mut mesh = Mesh::new(positions, indices);
            if moving {
                mesh.motion = mesh.positions.iter().map(|&p| p + Vec3::Y * p.x).collect();
            }
            mesh
        },
    )
}

fn material() -> impl Strategy<Value = Material> {
    let color = || prop::array::uniform3(0.1..0.9_f32).prop_map(Vec3::from);
    prop_oneof![
        4 => color().prop_map(|c| Material::diffuse("diffuse", c)),
        2 => (color(), 0.1..0.9_f32).prop_map(|(c, r)| Material::plastic("plastic", c, r)),
        1 => color().prop_map(|c| Material::emitter("emitter", c * 4.0)),
        1 => color().prop_map(|c| Material { transmission: 1.0, ..Material::plastic("sheet", c, 0.0) }),
    ]
}

fn edit() -> impl Strategy<Value = Edit> {
    let geometry = || (0..GEOMETRIES).prop_map(GeometryId);
    let material_id = || (0..MATERIALS).prop_map(MaterialId);
    let object = || (0..OBJECTS).prop_map(ObjectId);
    let instance = || (0..INSTANCES).prop_map(InstanceId);
    // Also one geometry twice: the first of the two is then seen.
    let parts = prop::collection::vec((geometry(), material_id()), 0..3).prop_map(|parts| {
        let parts = parts.into_iter().map(|(geometry, material)| Part { geometry, material });
        Object { name: String::new(), parts: parts.collect() }
    });
    let placed = (object(), prop::option::weighted(0.4, object()), transform(), any::<bool>()).prop_map(
        |(object, parent, parent_from_object, visible)| Instance {
            name: String::new(),
            object,
            parent,
            parent_from_object,
            motion: None,
            visible,
        },
    );
    let light = prop::array::uniform3(-2.0..2.0_f32).prop_map(|at| Light {
        name: String::new(),
        kind: LightKind::Point {
            position: Vec3::from(at) + Vec3::Y * 2.0,
            intensity: Vec3::ONE,
            range: f32::INFINITY,
        },
    });
    prop_oneof![
        8 => (instance(), transform()).prop_map(|(id, to)| Edit::MoveInstance(id, to)),
        2 => (instance(), transform(), transform()).prop_map(|(id, from, to)| Edit::SweepInstance(id, from, to)),
        8 => (geometry(), mesh()).prop_map(|(id, mesh)| Edit::Geometry(id, Geometry::Mesh(Arc::new(mesh)))),
        3 => (material_id(), material()).prop_map(|(id, material)| Edit::Material(id, Arc::new(material))),
        2 => (instance(), any::<bool>()).prop_map(|(id, visible)| Edit::ShowInstance(id, visible)),
        3 => (instance(), placed).prop_map(|(id, instance)| Edit::Instance(id, instance)),
        2 => (object(), parts).prop_map(|(id, object)| Edit::Object(id, object)),
        2 => ((0..LIGHTS).prop_map(LightId), light).prop_map(|(id, light)| Edit::Light(id, light)),
        1 => (0.0..1.0_f32).prop_map(|x| Edit::Environment(Environment::Constant(Vec3::splat(x)))),
        1 => instance().prop_map(Edit::RemoveInstance),
        1 => object().prop_map(Edit::RemoveObject),
        1 => (0..LIGHTS).prop_map(|id| Edit::RemoveLight(LightId(id))),
        1 => material_id().prop_map(Edit::RemoveMaterial),
        1 => geometry().prop_map(Edit::RemoveGeometry),
    ]
}

/// Something of everything, so that most edits are valid from the start.
fn start() -> Vec<Edit> {
    let quad = || Mesh::quad(Vec3::new(-0.5, 0.0, 0.5), Vec3::X, Vec3::NEG_Z);
    let mut edits = vec![Edit::Environment(Environment::Constant(Vec3::splat(0.3)))];
    edits.extend((0..GEOMETRIES).map(|i| Edit::Geometry(GeometryId(i), Geometry::Mesh(Arc::new(quad())))));
    let grey = || Arc::new(Material::diffuse("grey", Vec3::splat(0.6)));
    edits.extend((0..MATERIALS).map(|i| Edit::Material(MaterialId(i), grey())));
    edits.extend((0..OBJECTS).map(|i| {
        let part = Part { geometry: GeometryId(i % GEOMETRIES), material: MaterialId(i % MATERIALS) };
        Edit::Object(ObjectId(i), Object { name: String::new(), parts: vec![part] })
    }));
    edits.extend((0..INSTANCES / 2).map(|i| {
        let place = Affine3A::from_translation(Vec3::new(i as f32 * 0.7 - 1.0, i as f32 * 0.2, 0.0));
        let parent = (i == 3).then_some(ObjectId(0));
        let object = ObjectId(1 + i % (OBJECTS - 1));
        let instance = Instance {
            name: String::new(),
            object: if parent.is_none() { ObjectId(i % OBJECTS) } else { object },
            parent,
            parent_from_object: place,
            motion: None,
            visible: true,
        };
        Edit::Instance(InstanceId(i), instance)
    }));
    edits
}

fn engine() -> Engine {
    Engine::new(EngineOptions { threads: std::num::NonZeroUsize::new(2), ..EngineOptions::default() })
        .expect("an engine")
}

fn frame(engine: &mut Engine, renderer: &str) -> Frame {
    let camera = Camera::look_at("", Vec3::new(1.0, 1.5, 3.5), Vec3::ZERO, Vec3::Y, 0.9);
    let mut request = FrameRequest::new(camera, 24, 18);
    request.renderer = renderer.into();
    request.samples = 2;
    request.max_depth = Some(4);
    // Trees that were refitted cost more than new ones.
    let of_scene = |plane: &Plane| !matches!(plane, Plane::Nodes | Plane::Triangles);
    request.planes = Plane::ALL.into_iter().filter(of_scene).collect();
    let mut frame = engine.render(&request, &Progress::new()).expect("a frame");
    frame.stats = heliostat_scene::FrameStats::default();
    frame
}

fn fresh(scene: &Scene) -> Engine {
    let mut engine = engine();
    engine.apply(&scene.to_edits(), &Progress::new()).expect("a scene is its own edits");
    engine
}

/// Sequences: 1,000, or as many as `HELIOSTAT_HUNT` says.
fn cases() -> u32 {
    std::env::var("HELIOSTAT_HUNT").map_or(1000, |cases| cases.parse().expect("HELIOSTAT_HUNT is a number"))
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: cases(),
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(4),
        ..ProptestConfig::default()
    })]

    #[test]
    fn incremental_edits_end_in_the_picture_of_a_fresh_load(
        lists in prop::collection::vec(prop::collection::vec(edit(), 1..4), 1..12),
        diffuse in any::<bool>(),
    ) {
        let mut engine = engine();
        engine.apply(&start(), &Progress::new()).expect("valid");
        let renderer = if diffuse { "direct" } else { "path" };
        for (round, edits) in lists.iter().enumerate() {
            let before = engine.scene().to_edits();
            if engine.apply(edits, &Progress::new()).is_err() {
                // Refused edits leave no trace.
                prop_assert_eq!(format!("{:?}", engine.scene().to_edits()), format!("{before:?}"));
            }
            if round % 4 == 3 || round + 1 == lists.len() {
                let expected = frame(&mut fresh(engine.scene()), renderer);
                prop_assert_eq!(frame(&mut engine, renderer), expected);
            }
        }
    }
}

#[test]
fn a_camera_touches_nothing() {
    let mut engine = engine();
    engine.apply(&start(), &Progress::new()).expect("valid");
    let camera = Camera::look_at("", Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0);
    let report = engine.apply(&[Edit::Camera(CameraId(0), camera)], &Progress::new()).expect("valid");
    assert_eq!(report.rebuilt, []);
}

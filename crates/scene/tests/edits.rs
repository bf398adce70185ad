//! Edits: all or nothing, references always valid, errors that name the handle and the fix.

use std::sync::Arc;

use glam::{Affine2, Affine3A, Vec2, Vec3};
use heliostat_scene::{
    Attribute, AttributeScope, Camera, Clip, Edit, EditError, Geometry, GeometryId, Image, InstanceId, Light,
    LightId, LightKind, Material, MaterialId, Mesh, Motion, ObjectId, Pose, Scene, SceneBuilder, Target,
    TextureId, TextureRef, Timeline, UvTransform,
};

fn triangle() -> Mesh {
    Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])
}

/// Object 0 holds geometry 0 with material 0; object 1 holds object 0; instance 1 places object 1 in the world.
fn scene() -> Scene {
    let mut builder = SceneBuilder::new();
    let (mesh, material) = (builder.mesh(triangle()), builder.material(Material::default()));
    let inner = builder.object("inner", [(mesh, material)]);
    let outer = builder.object("outer", []);
    builder.child(outer, inner, Affine3A::from_translation(Vec3::X));
    builder.instance(outer, Affine3A::from_scale(Vec3::splat(2.0)));
    let mut scene = Scene::default();
    scene.apply(&builder.finish()).expect("valid");
    scene
}

fn refused(edits: &[Edit]) -> EditError {
    let mut scene = scene();
    let before = format!("{scene:?}");
    let error = scene.apply(edits).expect_err("refused");
    assert_eq!(format!("{scene:?}"), before, "a refused list leaves the scene as it was");
    error
}

#[test]
fn bounds_follow_nested_transforms() {
    let bounds = scene().bounds().expect("something is visible");
    assert_eq!((bounds.min, bounds.max), (Vec3::new(2.0, 0.0, 0.0), Vec3::new(4.0, 2.0, 0.0)));
    assert!(Scene::default().bounds().is_none());
}

#[test]
fn what_is_in_use_cannot_go() {
    let in_use = |target, user| EditError::InUse { target, user };
    let (object, geometry) = (Target::Object(ObjectId(0)), Target::Geometry(GeometryId(0)));
    assert_eq!(refused(&[Edit::RemoveGeometry(GeometryId(0))]), in_use(geometry, object));
    let material = Target::Material(MaterialId(0));
    assert_eq!(refused(&[Edit::RemoveMaterial(MaterialId(0))]), in_use(material, object));
    assert_eq!(refused(&[Edit::RemoveObject(ObjectId(0))]), in_use(object, Target::Instance(InstanceId(0))));
    let mut scene = scene();
    let all = [
        Edit::RemoveGeometry(GeometryId(0)),
        Edit::RemoveObject(ObjectId(0)),
        Edit::RemoveInstance(InstanceId(0)),
    ];
    scene.apply(&all).expect("the users go in the same list, in any order");
}

#[test]
fn dangling_and_unknown_handles_are_named() {
    let object = heliostat_scene::Object { name: String::new(), parts: Vec::new() };
    let instance = |object, parent| heliostat_scene::Instance {
        name: String::new(),
        object,
        parent,
        parent_from_object: Affine3A::IDENTITY,
        motion: None,
        visible: true,
    };
    let textured =
        Material { base_color_texture: Some(TextureRef::new(TextureId(7))), ..Material::default() };
    let error =
        refused(&[Edit::Object(ObjectId(5), object), Edit::Material(MaterialId(3), Arc::new(textured))]);
    assert_eq!(
        error.to_string().split(';').next(),
        Some("material 3 refers to texture 7, which does not exist")
    );
    let error = refused(&[Edit::Instance(InstanceId(9), instance(ObjectId(0), Some(ObjectId(8))))]);
    assert_eq!(
        error,
        EditError::Dangling { target: Target::Instance(InstanceId(9)), missing: Target::Object(ObjectId(8)) }
    );
    let error = refused(&[Edit::RemoveLight(LightId(4))]);
    assert_eq!(error, EditError::Unknown { target: Target::Light(LightId(4)) });
}

#[test]
fn objects_cannot_contain_themselves() {
    let cycle = heliostat_scene::Instance {
        name: String::new(),
        object: ObjectId(1),
        parent: Some(ObjectId(0)),
        parent_from_object: Affine3A::IDENTITY,
        motion: None,
        visible: true,
    };
    let error = refused(&[Edit::Instance(InstanceId(2), cycle)]);
    assert!(matches!(error, EditError::Cycle { target: Target::Object(ObjectId(0 | 1)) }), "{error}");
}

#[test]
fn contradictory_data_is_refused_with_value_and_fix() {
    let problem = |edit: Edit| refused(&[edit]).to_string();
    let mesh = |mesh: Mesh| Edit::Geometry(GeometryId(1), Geometry::Mesh(Arc::new(mesh)));
    let out_of_range = Mesh::new(vec![Vec3::ZERO; 3], vec![[0, 1, 2], [0, 1, 3]]);
    assert!(
        problem(mesh(out_of_range)).contains("geometry 1: triangle 1 uses indices [0, 1, 3] of 3 vertices")
    );
    let normals = Mesh { normals: vec![Vec3::Z; 2], ..triangle() };
    assert!(problem(mesh(normals)).contains("`normals` has 2 entries for 3 positions"));
    let material = |m: Material| problem(Edit::Material(MaterialId(1), Arc::new(m)));
    assert!(material(Material { roughness: 1.5, ..Material::default() }).contains("`roughness` is 1.5"));
    assert!(material(Material { metallic: f32::NAN, ..Material::default() }).contains("`metallic` is NaN"));
    assert!(material(Material { ior: 0.5, ..Material::default() }).contains("`ior` is 0.5"));
    let light = |kind: LightKind| problem(Edit::Light(LightId(0), Light { name: String::new(), kind }));
    let sun = LightKind::Directional { direction: Vec3::ZERO, irradiance: Vec3::ONE };
    assert!(light(sun).contains("non-zero length"));
    let mut camera = Camera::look_at("", Vec3::ZERO, Vec3::X, Vec3::Y, 1.0);
    camera.world_from_camera = Affine3A::ZERO;
    assert!(problem(Edit::Camera(heliostat_scene::CameraId(0), camera)).contains("invertible"));
    let image = |width, height, len| {
        let image = Arc::new(Image::rgba8(width, height, vec![0; len]));
        let texture = heliostat_scene::Texture::new("t", image, heliostat_scene::ColorSpace::Srgb);
        problem(Edit::Texture(TextureId(0), Arc::new(texture)))
    };
    assert!(image(2, 2, 15).contains("15 channel values for 2×2"));
    assert!(image(3, 0, 0).contains("the image is 3×0"));
    assert!(image((1 << 24) + 1, 1, 0).contains("the limit for either side is 16777216"));
    assert!(image(1 << 16, 1 << 15, 4).contains("4 channel values for 65536×32768"));
    assert!(image(1 << 16, (1 << 15) + 1, 0).contains("the limit is 2147483648 pixels in all"));
    let nan = Affine3A::from_translation(Vec3::NAN);
    assert!(
        problem(Edit::MoveInstance(InstanceId(0), nan)).contains("instance 0: the transform is not finite")
    );
}

#[test]
fn revert_takes_exactly_one_list_back() {
    let mut scene = scene();
    let before = format!("{scene:?}");
    let edits = [
        Edit::MoveInstance(InstanceId(1), Affine3A::IDENTITY),
        Edit::RemoveInstance(InstanceId(0)),
        Edit::Material(MaterialId(0), Arc::new(Material::glass("glass", 1.5))),
        Edit::Material(MaterialId(1), Arc::new(Material::default())),
    ];
    let applied = scene.apply(&edits).expect("valid");
    assert_ne!(format!("{scene:?}"), before);
    scene.revert(applied);
    assert_eq!(format!("{scene:?}"), before);
}

#[test]
fn builders_continue_after_existing_handles() {
    let scene = scene();
    let mut builder = SceneBuilder::continuing(&scene);
    assert_eq!(builder.mesh(triangle()), GeometryId(1));
    assert_eq!(builder.object("", []), ObjectId(2));
    assert_eq!(builder.camera(Camera::look_at("", Vec3::ZERO, Vec3::X, Vec3::Y, 1.0)).0, 0);
}

#[test]
fn texture_transform_is_the_extensions() {
    // KHR_texture_transform: a quarter turn counter-clockwise takes +u to −v (v runs downwards).
    let turn = UvTransform::new(Vec2::new(0.5, 0.0), std::f32::consts::FRAC_PI_2, Vec2::new(2.0, 1.0));
    let moved = turn.0.transform_point2(Vec2::new(1.0, 0.0));
    assert!((moved - Vec2::new(0.5, -2.0)).length() < 1e-6, "{moved}");
    assert_eq!(UvTransform::new(Vec2::ZERO, 0.0, Vec2::ONE).0, Affine2::IDENTITY);
}

#[test]
fn look_at_is_orthonormal_even_when_up_is_along_the_view() {
    for up in [Vec3::Y, Vec3::X, Vec3::ZERO] {
        let camera = Camera::look_at("", Vec3::ZERO, Vec3::Y * 3.0, up, 1.0);
        assert_eq!(camera.problem(), None);
        let m = camera.world_from_camera.matrix3;
        assert!((m.determinant() - 1.0).abs() < 1e-5, "right-handed");
        assert!(Vec3::from(-m.z_axis).distance(Vec3::Y) < 1e-6);
    }
}

#[derive(Debug)]
struct Slide;

impl Motion for Slide {
    fn duration(&self) -> f64 {
        4.0
    }

    fn sample(&self, time: f64, pose: &mut Pose) {
        pose.instance(InstanceId(0), Affine3A::IDENTITY);
        pose.instance(InstanceId(1), Affine3A::from_translation(Vec3::X * time as f32));
        pose.show(InstanceId(1), time < 3.0);
        let height = Vec3::Y * time.min(2.0) as f32;
        let positions: Vec<_> = triangle().positions.iter().map(|&p| p + height).collect();
        pose.mesh(GeometryId(0), Arc::new(Mesh { positions: positions.into(), ..triangle() }));
    }
}

fn timeline() -> Timeline {
    Timeline::new(vec![Clip { name: "slide".into(), frame_rate: None, motion: Arc::new(Slide) }])
}

#[test]
fn a_timeline_sends_everything_once_and_then_what_changed() {
    let mut timeline = timeline();
    let mut scene = scene();
    let first = timeline.edits_at(1.0);
    assert_eq!(first.len(), 4, "two instances, one visibility, one mesh: {first:?}");
    scene.apply(&first).expect("valid");
    assert_eq!(scene.instances()[&InstanceId(1)].parent_from_object.translation.x, 1.0);
    assert!(timeline.edits_at(1.0).is_empty());
    let second = timeline.edits_at(2.0);
    assert!(matches!(second[..], [Edit::MoveInstance(InstanceId(1), _), Edit::Geometry(GeometryId(0), _)]));
    let third = timeline.edits_at(3.0);
    assert!(
        matches!(third[..], [Edit::MoveInstance(..), Edit::ShowInstance(InstanceId(1), false)]),
        "the mesh rests from second 2 on: {third:?}"
    );
    scene.apply(&second).expect("valid");
    scene.apply(&third).expect("valid");
    let mesh = scene.geometries()[&GeometryId(0)].as_mesh().unwrap();
    assert_eq!(mesh.positions[0], Vec3::Y * 2.0);
    assert!(scene.bounds().is_none(), "it is hidden");
}

#[test]
fn an_open_shutter_makes_sweeps() {
    let mut timeline = timeline();
    let mut scene = scene();
    scene.apply(&timeline.edits_over(1.0, 1.5)).expect("valid");
    let moving = &scene.instances()[&InstanceId(1)];
    assert_eq!(moving.motion, Some(Affine3A::from_translation(Vec3::X * 1.5)));
    assert_eq!(scene.instances()[&InstanceId(0)].motion, None);
    let mesh = scene.geometries()[&GeometryId(0)].as_mesh().unwrap();
    assert_eq!((mesh.positions[0].y, mesh.motion[0].y), (1.0, 1.5));
    scene.apply(&timeline.edits_at(1.0)).expect("valid");
    assert_eq!(
        scene.instances()[&InstanceId(1)].motion,
        None,
        "a shutter that does not open stops everything"
    );
    let mesh = scene.geometries()[&GeometryId(0)].as_mesh().unwrap();
    assert!(mesh.motion.is_empty());
}

#[test]
fn a_transform_that_is_not_finite_is_refused_wherever_it_stands() {
    let broken = Affine3A::from_translation(Vec3::NAN);
    let edits = [
        Edit::MoveInstance(InstanceId(1), broken),
        Edit::SweepInstance(InstanceId(1), Affine3A::IDENTITY, broken),
    ];
    for edit in edits {
        assert!(matches!(
            refused(&[edit]),
            EditError::Invalid { target: Target::Instance(InstanceId(1)), .. }
        ));
    }
    let missing = Edit::ShowInstance(InstanceId(9), true);
    assert_eq!(refused(&[missing]), EditError::Unknown { target: Target::Instance(InstanceId(9)) });
}

#[test]
fn attributes_fit_their_geometry_and_go_with_it() {
    let id = GeometryId(0);
    let heat = |attribute: Attribute| Edit::Attribute(id, "heat".into(), attribute);
    let of = |scope, values: &[f32]| heat(Attribute::new(scope, values.to_vec()));
    let problem = |edits: &[Edit]| refused(edits).to_string();
    let wrong = problem(&[of(AttributeScope::Vertex, &[1.0; 4])]);
    let takes = "geometry 0: attribute `heat`: 4 values for a geometry that takes";
    assert_eq!(wrong, format!("{takes} 3, one per vertex"));
    assert_eq!(problem(&[of(AttributeScope::Primitive, &[1.0; 4])]), format!("{takes} 1, one per primitive"));
    assert!(
        problem(&[of(AttributeScope::Object, &[])]).contains("0 values for a geometry that takes 1, one for")
    );
    let bad = problem(&[of(AttributeScope::Vertex, &[1.0, f32::NAN, 1.0])]);
    assert_eq!(bad, "geometry 0: attribute `heat`: value 1 is not finite; give finite numbers");
    let vector = Attribute::vector(Vec3::new(0.0, f32::INFINITY, 0.0));
    assert!(problem(&[heat(vector)]).contains("value 0 is not finite"));
    let absent = Edit::Attribute(GeometryId(7), "heat".into(), Attribute::float(1.0));
    assert_eq!(refused(&[absent]), EditError::Unknown { target: Target::Geometry(GeometryId(7)) });
    assert!(problem(&[Edit::RemoveAttribute(id, "heat".into())]).contains("no attribute `heat` to remove"));

    let mut scene = scene();
    let per_vertex = of(AttributeScope::Vertex, &[1.0, 2.0, 3.0]);
    let constant = Edit::Attribute(id, "tint".into(), Attribute::vector(Vec3::X));
    scene.apply(&[per_vertex, constant]).expect("valid");
    assert_eq!(scene.attributes()[&id].keys().collect::<Vec<_>>(), ["heat", "tint"]);
    let mut copy = Scene::default();
    copy.apply(&scene.to_edits()).expect("valid");
    assert_eq!(copy.attributes(), scene.attributes());
    // A mesh of other vertices does not fit any more, unless the same list says what it has.
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE];
    let larger =
        Edit::Geometry(id, Geometry::Mesh(Arc::new(Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]))));
    let before = format!("{scene:?}");
    let error = scene.apply(std::slice::from_ref(&larger)).expect_err("refused").to_string();
    assert!(error.contains("attribute `heat`: 3 values for a geometry that takes 4"), "{error}");
    assert_eq!(format!("{scene:?}"), before);
    let applied = scene.apply(&[of(AttributeScope::Vertex, &[0.0; 4]), larger]).expect("valid");
    scene.revert(applied);
    assert_eq!(format!("{scene:?}"), before);
    // What goes takes its attributes along, and brings them back.
    let all = [
        Edit::RemoveAttribute(id, "tint".into()),
        Edit::RemoveInstance(InstanceId(0)),
        Edit::RemoveObject(ObjectId(0)),
        Edit::RemoveGeometry(id),
    ];
    let applied = scene.apply(&all).expect("valid");
    assert!(scene.attributes().is_empty());
    scene.revert(applied);
    assert_eq!(format!("{scene:?}"), before);
}

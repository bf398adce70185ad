//! Parameters of shaders per object, primitive and vertex: exact pictures, and edits that cost nothing else.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    ApplyReport, Attribute, AttributeScope, Backend, Camera, Edit, Frame, FrameRequest, Geometry, GeometryId,
    Material, MaterialId, MaterialOverride, Mesh, ParameterValue, Plane, Progress, Projection, Quadric,
    SceneBuilder, ShaderUse,
};
use heliostat_shading::lanes::Real;
use heliostat_shading::{
    Closure, Inputs, LaneMode, Lobes, Parameter, ParameterKind, Point, ShaderInfo, ShaderRegistry,
    SurfaceShader,
};

/// Emits what its parameters say and does nothing else: the picture shows them as they are.
#[derive(Debug)]
struct Glow;

impl SurfaceShader for Glow {
    fn info(&self) -> ShaderInfo {
        let range = [-10.0, 10.0];
        let kind = ParameterKind::Vector;
        let about = String::new();
        let color =
            Parameter { kind, range, default: [0.5, 0.25, 0.125], ..Parameter::color("color", [0.0; 3], "") };
        let parameters = vec![color, Parameter::float("times", 1.0, range, "", "")];
        ShaderInfo { name: "glow".into(), about, parameters, lobes: Lobes::NONE, see_through: false }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, _: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        closure.emission = inputs.vector(0) * inputs.float(1);
    }
}

const SIZE: u32 = 16;

fn engine(lanes: LaneMode) -> Engine {
    let mut shaders = ShaderRegistry::built_in();
    shaders.register(Glow);
    Engine::with_shaders(EngineOptions { lanes, ..EngineOptions::default() }, shaders).expect("an engine")
}

fn heat() -> ParameterValue {
    ParameterValue::Attribute("heat".into(), Vec3::ONE)
}

fn glowing(shader: ShaderUse) -> Material {
    Material { shader: Some(Arc::new(shader)), ..Material::diffuse("glow", Vec3::ZERO) }
}

fn glow() -> ShaderUse {
    ShaderUse::named("glow").with("color", heat())
}

/// The square from −1 to 1 in x and y, of two triangles.
fn square() -> Mesh {
    Mesh::quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0)
}

/// Geometry 0 in front of everything else, as material 0.
fn scene(mesh: Mesh, shader: ShaderUse) -> SceneBuilder {
    let mut scene = SceneBuilder::new();
    let material = scene.material(glowing(shader));
    let mesh = scene.mesh(mesh);
    let object = scene.object("square", [(mesh, material)]);
    scene.instance(object, Affine3A::IDENTITY);
    scene
}

fn apply(engine: &mut Engine, edits: &[Edit]) -> ApplyReport {
    engine.apply(edits, &Progress::new()).expect("valid edits")
}

/// Looks at the square, which fills the picture, without perspective.
fn render(engine: &mut Engine, change: impl Fn(&mut FrameRequest)) -> Frame {
    let mut camera = Camera::look_at("", Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 1.0);
    camera.projection = Projection::Orthographic { height: 2.0 };
    let mut request = FrameRequest::new(camera, SIZE, SIZE);
    request.renderer = "path".into();
    request.samples = 1;
    request.planes = vec![Plane::Position];
    change(&mut request);
    engine.render(&request, &Progress::new()).expect("a frame")
}

fn picture(engine: &mut Engine) -> Vec<Vec3> {
    let frame = render(engine, |_| ());
    assert_eq!(frame.problems, [""; 0]);
    frame.color
}

/// The same everywhere, but for the rounding of weights that add up to 1.
fn assert_shows(engine: &mut Engine, expected: Vec3) {
    let picture = picture(engine);
    assert!(picture.iter().all(|c| c.distance(expected) < 4e-6), "{:?}, {expected}", picture[0]);
}

fn edit(attribute: Attribute) -> Edit {
    Edit::Attribute(GeometryId(0), "heat".into(), attribute)
}

fn per_primitive(values: impl Into<heliostat_scene::AttributeValues>) -> Attribute {
    Attribute::new(AttributeScope::Primitive, values)
}

#[test]
fn values_per_primitive_are_shown_exactly() {
    let (below, above) = (Vec3::new(0.1, 0.7, 3.3), Vec3::new(5.5, 0.2, 0.9));
    let mut engine = engine(LaneMode::default());
    let mut edits = scene(square(), glow()).finish();
    edits.push(edit(per_primitive(vec![below, above])));
    assert_eq!(apply(&mut engine, &edits).problems, [""; 0]);
    let frame = render(&mut engine, |_| ());
    let mut seen = [0, 0];
    for (color, at) in frame.color.iter().zip(frame.planes[0].values.chunks(3)) {
        // The diagonal itself belongs to both.
        if (at[0] - at[1]).abs() > 1e-3 {
            let second = at[1] > at[0];
            assert_eq!(*color, if second { above } else { below });
            seen[usize::from(second)] += 1;
        }
    }
    assert!(seen.iter().all(|&pixels| pixels > 80), "{seen:?} pixels");
}

#[test]
fn values_per_vertex_are_interpolated_linearly() {
    // The value at each vertex is a linear function of its place: so it is everywhere between.
    let value = |p: Vec3| Vec3::new(1.0 + 0.5 * p.x, 2.0 - p.y + 0.25 * p.x, 3.0 + p.x * 2.0 + p.y);
    let mut engine = engine(LaneMode::default());
    let mesh = square();
    let values: Vec<Vec3> = mesh.positions.iter().map(|&p| value(p)).collect();
    let mut edits = scene(mesh, glow()).finish();
    edits.push(edit(Attribute::new(AttributeScope::Vertex, values)));
    apply(&mut engine, &edits);
    let frame = render(&mut engine, |_| ());
    for (color, at) in frame.color.iter().zip(frame.planes[0].values.chunks(3)) {
        let expected = value(Vec3::from_slice(at));
        // A few roundings of values below 8.
        assert!(color.distance(expected) < 4e-6, "{color} instead of {expected}");
    }
    assert!(frame.color.iter().all(|color| color.min_element() > 0.0));
}

#[test]
fn two_objects_share_a_mesh_and_a_material_and_differ() {
    let mut scene = SceneBuilder::new();
    let material = scene.material(glowing(glow()));
    let mesh = Arc::new(Mesh::quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X, Vec3::Y * 2.0));
    let mut edits = Vec::new();
    for (i, x) in [(0, 0.0), (1, 1.0)] {
        edits.push(Edit::Geometry(GeometryId(i), Geometry::Mesh(mesh.clone())));
        edits.push(Edit::Attribute(GeometryId(i), "heat".into(), Attribute::float(0.25 + x)));
        let object = scene.object("half", [(GeometryId(i), material)]);
        scene.instance(object, Affine3A::from_translation(Vec3::X * x));
    }
    edits.extend(scene.finish());
    let mut engine = engine(LaneMode::default());
    apply(&mut engine, &edits);
    for (i, color) in picture(&mut engine).into_iter().enumerate() {
        let right = i as u32 % SIZE >= SIZE / 2;
        assert_eq!(color, Vec3::splat(if right { 1.25 } else { 0.25 }), "pixel {i}");
    }
}

#[test]
fn spheres_have_values_too() {
    let mut scene = SceneBuilder::new();
    let material = scene.material(glowing(glow()));
    let sphere = |x| Quadric::Sphere { center: Vec3::new(x, 0.0, 0.0), radius: 0.4 };
    let shapes = scene.quadrics(vec![sphere(-0.5), sphere(0.5)]);
    scene.attribute(shapes, "heat", per_primitive(vec![1.0, 2.0]));
    let object = scene.object("spheres", [(shapes, material)]);
    scene.instance(object, Affine3A::IDENTITY);
    let mut engine = engine(LaneMode::default());
    apply(&mut engine, &scene.finish());
    let frame = render(&mut engine, |_| ());
    for (color, x) in [(Vec3::ONE, 4), (Vec3::splat(2.0), 12)] {
        assert_eq!(frame.color[(SIZE / 2 * SIZE + x) as usize], color);
    }
    let per_vertex = Attribute::new(AttributeScope::Vertex, vec![1.0, 2.0]);
    let error = engine.apply(&[edit(per_vertex)], &Progress::new()).expect_err("refused").to_string();
    assert!(error.contains("have no vertices; give one value per primitive"), "{error}");
}

#[test]
fn an_edit_of_an_attribute_costs_nothing_else() {
    let mut engine = engine(LaneMode::default());
    let mut edits = scene(square(), glow()).finish();
    edits.push(edit(Attribute::float(1.0)));
    apply(&mut engine, &edits);
    let shared = |engine: &Engine| match &engine.scene().geometries()[&GeometryId(0)] {
        Geometry::Mesh(mesh) => Arc::as_ptr(mesh),
        Geometry::Quadrics(_) => panic!("a mesh"),
    };
    let before = shared(&engine);
    for (attribute, expected) in [
        (Attribute::float(2.0), Vec3::splat(2.0)),
        (Attribute::vector(Vec3::new(1.0, 2.0, 3.0)), Vec3::new(1.0, 2.0, 3.0)),
        (per_primitive(vec![4.0, 4.0]), Vec3::splat(4.0)),
        (Attribute::new(AttributeScope::Vertex, vec![5.0; 4]), Vec3::splat(5.0)),
    ] {
        let report = apply(&mut engine, &[edit(attribute)]);
        assert_eq!((report.rebuilt, report.problems), (Vec::new(), Vec::new()));
        assert_shows(&mut engine, expected);
    }
    assert_eq!(shared(&engine), before, "the mesh is the one that it was");
    // A mesh that deforms keeps its attributes and is refitted, not rebuilt.
    let raised = square().positions.iter().map(|&p| p + Vec3::Z).collect::<Vec<_>>();
    let raised = Mesh { positions: raised.into(), ..square() };
    apply(&mut engine, &[Edit::Geometry(GeometryId(0), Geometry::Mesh(Arc::new(raised)))]);
    assert_shows(&mut engine, Vec3::splat(5.0));
    // A new attribute for a material that was there before: late binding.
    let times = glow().with("times", ParameterValue::Attribute("times".into(), Vec3::splat(2.0)));
    let attribute = Edit::Attribute(GeometryId(0), "times".into(), Attribute::float(0.5));
    let material = Edit::Material(MaterialId(0), Arc::new(glowing(times)));
    assert_eq!(apply(&mut engine, &[material, attribute]).rebuilt, []);
    assert_shows(&mut engine, Vec3::splat(5.0));
    let attribute = Edit::Attribute(GeometryId(0), "times".into(), Attribute::float(1.0));
    apply(&mut engine, &[attribute]);
    assert_shows(&mut engine, Vec3::splat(10.0));
}

#[test]
fn a_missing_attribute_is_told_and_leaves_the_default() {
    let mut engine = engine(LaneMode::default());
    let report = apply(&mut engine, &scene(square(), glow()).finish());
    let expected = "material `glow`: geometry 0 has no attribute `heat`; `color` keeps its default there";
    assert_eq!(report.problems, [expected]);
    let default = Vec3::new(0.5, 0.25, 0.125);
    assert!(picture(&mut engine).iter().all(|&color| color == default));
    assert_eq!(apply(&mut engine, &[edit(Attribute::float(1.0))]).problems, [""; 0]);
    assert!(picture(&mut engine).iter().all(|&color| color == Vec3::ONE));
    let remove = Edit::RemoveAttribute(GeometryId(0), "heat".into());
    assert_eq!(apply(&mut engine, std::slice::from_ref(&remove)).problems, [expected]);
    assert!(picture(&mut engine).iter().all(|&color| color == default));
    let error = engine.apply(&[remove], &Progress::new()).expect_err("refused").to_string();
    assert!(error.contains("has no attribute `heat` to remove"), "{error}");
    // Materials that stand in for all others tell it with the picture, once.
    let named = glow().with("color", ParameterValue::Attribute("cold".into(), Vec3::ONE));
    let cold = |request: &mut FrameRequest| {
        request.materials = MaterialOverride::Shader { shader: named.clone(), mirrors: false };
    };
    let frame = render(&mut engine, cold);
    assert_eq!(frame.problems, [expected.replace("heat", "cold")]);
    assert_eq!(render(&mut engine, cold).problems, [""; 0]);
}

#[test]
fn values_beyond_the_range_of_a_parameter_are_moved_into_it() {
    let mut engine = engine(LaneMode::default());
    let scaled = glow().with("color", ParameterValue::Attribute("heat".into(), Vec3::new(1e30, 1.0, -1e30)));
    let mut edits = scene(square(), scaled).finish();
    edits.push(edit(per_primitive(vec![Vec3::splat(1e30), Vec3::new(1.0, 11.0, 1.0)])));
    apply(&mut engine, &edits);
    let picture = picture(&mut engine);
    // Emission that is negative counts as none.
    assert!(picture.iter().all(|&color| color == Vec3::new(10.0, 10.0, 0.0)), "{:?}", picture[0]);
}

#[test]
fn lanes_and_renderers_agree() {
    let values: Vec<f32> = (0..81).map(|i| (i * 37 % 81) as f32 / 8.0).collect();
    let grid = |row: u32| {
        let positions = (0..row * row).map(|i| {
            Vec3::new((i % row) as f32, (i / row) as f32, 0.0) * (2.0 / (row - 1) as f32) - Vec3::ONE
        });
        let quads = (0..(row - 1) * (row - 1)).map(|q| q % (row - 1) + q / (row - 1) * row);
        let triangles = quads.flat_map(|a| [[a, a + 1, a + row + 1], [a, a + row + 1, a + row]]);
        Mesh::new(positions.collect(), triangles.collect())
    };
    let mut edits = scene(grid(9), glow().with("times", heat())).finish();
    edits.push(edit(Attribute::new(AttributeScope::Vertex, values)));
    let pictures = [LaneMode::Single, LaneMode::default()].map(|lanes| {
        let mut engine = engine(lanes);
        apply(&mut engine, &edits);
        ["path", "direct", "igi"]
            .map(|name| render(&mut engine, |request| request.renderer = name.into()).color)
    });
    assert_eq!(pictures[0], pictures[1], "one by one and sixteen at a time");
    let [path, direct, _] = &pictures[0];
    let mut colors: Vec<[u32; 3]> = path.iter().map(|color| color.to_array().map(f32::to_bits)).collect();
    colors.sort_unstable();
    colors.dedup();
    assert!(colors.len() > 200, "{} colours", colors.len());
    // They sample pixels at other places.
    let mean = |picture: &[Vec3]| picture.iter().sum::<Vec3>() / picture.len() as f32;
    assert!(mean(path).distance(mean(direct)) < 0.1 * mean(path).length());
}

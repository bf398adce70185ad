//! Shader plug-ins end to end: examples and faulty ones, built with this machine's compilers, in pictures. A test whose
//! compiler is missing says so and passes.
#![allow(clippy::print_stderr, reason = "a test says when it did not run")]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use glam::{Affine3A, Vec3};
use heliostat::engine::{Engine, EngineOptions};
use heliostat::plugins::Plugins;
use heliostat::scene::{
    ApplyReport, Attribute, AttributeScope, Backend, Camera, ColorSpace, Environment, Frame, FrameRequest,
    Image, Material, Mesh, ParameterValue, Progress, SceneBuilder, ShaderRef, ShaderUse, Texture, TextureRef,
    UvTransform,
};
use heliostat::shading::lanes::{Floats, Vectors};
use heliostat::shading::{Closures, LaneMode, Points, ShaderRegistry};

const C: &[&str] = &["-std=c11", "-O3", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off"];
const CPP: &[&str] = &["-std=c++17", "-O2"];
const WARNINGS: &[&str] = &["-Wall", "-Wextra", "-Werror", "-pedantic"];
const LIBRARY: &[&str] = &["-fPIC", "-shared"];

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A folder of this test's own, emptied.
fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("plugins").join(name);
    _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

/// Makes a library of a source file; `None`, with a note, without a compiler.
fn compile(compiler: &str, arguments: &[&[&str]], source: &str, library: PathBuf) -> Option<PathBuf> {
    let mut command = Command::new(compiler);
    command.current_dir(here()).args(arguments.concat()).arg(source).arg("-o").arg(&library);
    if source.ends_with(".c") {
        // Some systems keep the mathematics apart.
        command.arg("-lm");
    }
    match command.output() {
        Ok(output) => {
            assert!(output.status.success(), "{source}: {}", String::from_utf8_lossy(&output.stderr));
            Some(library)
        }
        Err(error) => {
            eprintln!("note: `{compiler}` does not run ({error}); what needs {source} was not tested");
            None
        }
    }
}

fn c(source: &str, macros: &[&str], library: PathBuf) -> Option<PathBuf> {
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    compile(&compiler, &[C, LIBRARY, &["-Iinclude"], macros], source, library)
}

fn checker(folder: &Path) -> Option<PathBuf> {
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    let library = folder.join("checker.so");
    compile(&compiler, &[C, WARNINGS, LIBRARY, &["-Iinclude"]], "examples/shaders/c/checker.c", library)
}

fn toon(folder: &Path) -> Option<PathBuf> {
    c("examples/shaders/c/toon.c", WARNINGS, folder.join("toon.so"))
}

fn marble(folder: &Path) -> Option<PathBuf> {
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    let library = folder.join("marble.so");
    compile(&compiler, &[CPP, WARNINGS, LIBRARY, &["-Iinclude"]], "examples/shaders/cpp/marble.cpp", library)
}

fn weave(folder: &Path) -> Option<PathBuf> {
    let compiler = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let arguments = ["--edition", "2024", "--crate-type", "cdylib", "--crate-name", "weave", "-O"];
    compile(&compiler, &[&arguments], "examples/shaders/rust/src/lib.rs", folder.join("weave.so"))
}

fn plugin(file: PathBuf, shader: &str) -> ShaderUse {
    let shader = ShaderRef::Plugin { file, shader: shader.into() };
    ShaderUse { shader, parameters: Default::default() }
}

fn engine(allowed: bool) -> Engine {
    let mut shaders = ShaderRegistry::built_in();
    if allowed {
        shaders.allow_plugins(Arc::new(Plugins::default()));
    }
    Engine::with_shaders(EngineOptions::default(), shaders).expect("an engine")
}

/// A tilted wall with a shader under an even sky, and two pictures of it.
fn show(shader: Option<ShaderUse>, allowed: bool) -> (ApplyReport, [Frame; 2]) {
    let mut scene = SceneBuilder::new();
    let grey = Material::plastic("wall", Vec3::splat(0.5), 0.6);
    let wall = scene.material(Material { shader: shader.map(Arc::new), ..grey });
    let mesh = scene.mesh(Mesh::quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::new(0.3, 2.0, -1.0)));
    let object = scene.object("wall", [(mesh, wall)]);
    scene.instance(object, Affine3A::from_scale(Vec3::new(1.0, 1.2, 1.0)));
    scene.environment(Environment::Constant(Vec3::ONE));
    render(scene, allowed)
}

fn render(scene: SceneBuilder, allowed: bool) -> (ApplyReport, [Frame; 2]) {
    let mut engine = engine(allowed);
    let report = engine.apply(&scene.finish(), &Progress::new()).expect("a scene");
    let camera = Camera::look_at("", Vec3::new(0.2, 0.1, 3.0), Vec3::ZERO, Vec3::Y, 0.7);
    let request = FrameRequest { renderer: "direct".into(), samples: 2, ..FrameRequest::new(camera, 48, 32) };
    let mut frame = || engine.render(&request, &Progress::new()).expect("a picture");
    let frames = [frame(), frame()];
    assert!(frames[0].color.iter().all(|c| c.is_finite()));
    assert_eq!(frames[0].color, frames[1].color);
    (report, frames)
}

fn middle(frame: &Frame) -> Vec3 {
    frame.color[16 * 48 + 24]
}

/// Largest difference of a channel.
fn difference(a: &Frame, b: &Frame) -> f32 {
    let pairs = a.color.iter().zip(&b.color);
    pairs.map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max)
}

#[test]
fn the_checker_in_c_is_the_built_in_one() {
    let Some(file) = checker(&folder("checker")) else { return };
    let set = |shader: ShaderUse| shader.with("size", 0.3).with("first", Vec3::new(0.9, 0.2, 0.1));
    let (_, [plain, _]) = show(None, true);
    let (report, [built_in, _]) = show(Some(set(ShaderUse::named("checker"))), true);
    assert_eq!(report.problems, [""; 0]);
    let (report, [ours, _]) = show(Some(set(plugin(file, "checker"))), true);
    assert_eq!((&report.problems[..], &ours.problems[..]), (&[][..], &[][..]));
    assert!(difference(&plain, &ours) > 0.1, "it shows");
    // The same operations in the same order; compilers may still pair a product with a sum, which moves the edge of a cell
    // by some units in the last place of a coordinate of size 10 over a footprint of 1/100.
    let difference = difference(&built_in, &ours);
    assert!(difference <= 1e-3, "{difference}");
    eprintln!("largest difference of a channel: {difference:e}");
}

#[test]
fn the_toon_in_c_follows_the_camera_in_mirrors_too() {
    let Some(file) = toon(&folder("toon")) else { return };
    let corner = |shader: ShaderUse| {
        let shaded = |shader: ShaderUse| Material { shader: Some(Arc::new(shader)), ..Material::default() };
        let mut scene = SceneBuilder::new();
        let toon = scene.material(shaded(shader.with("bands", 7.0)));
        let mirror = scene.material(shaded(ShaderUse::named("mirror").with("tint", Vec3::ONE)));
        let wall = scene.mesh(Mesh::quad(Vec3::new(-4.0, -4.0, 0.0), Vec3::X * 8.0, Vec3::Y * 8.0));
        let side = scene.mesh(Mesh::quad(Vec3::new(0.5, -3.0, 0.0), Vec3::Z * 4.0, Vec3::Y * 6.0));
        let object = scene.object("corner", [(wall, toon), (side, mirror)]);
        scene.instance(object, Affine3A::IDENTITY);
        scene.environment(Environment::Constant(Vec3::ONE));
        let (report, [frame, _]) = render(scene, true);
        assert_eq!((&report.problems[..], &frame.problems[..]), (&[][..], &[][..]));
        frame
    };
    // The same operations in the same order give the same bits where products stay apart from sums, which the compiler's
    // arguments ask for; bands that followed the reflected rays would be off by a band's colour.
    let (built_in, ours) = (corner(ShaderUse::named("toon")), corner(plugin(file, "toon")));
    assert_eq!(difference(&built_in, &ours), 0.0);
}

#[test]
fn plugins_of_the_first_version_still_load() {
    let file = folder("first").join("first.so");
    let Some(file) = c("tests/shaders/faulty.c", &["-w", "-DFIRST_VERSION"], file) else { return };
    let (report, [frame, _]) = show(Some(plugin(file.clone(), "faulty")), true);
    assert_eq!((&report.problems[..], &frame.problems[..]), (&[][..], &[][..]));
    let (_, [other, _]) = show(Some(plugin(file, "faulty").with("amount", 0.2)), true);
    assert!(difference(&frame, &other) > 0.1, "its parameter does something");
}

#[test]
fn examples_in_cpp_and_rust_render() {
    let folder = folder("examples");
    let (_, [plain, _]) = show(None, true);
    for (file, name, parameter, value) in
        [(marble(&folder), "marble", "seed", 7.0), (weave(&folder), "weave", "threads", 5.0)]
    {
        let Some(file) = file else { continue };
        let (report, [frame, _]) = show(Some(plugin(file.clone(), name)), true);
        assert_eq!((&report.problems[..], &frame.problems[..]), (&[][..], &[][..]), "{name}");
        assert!(difference(&plain, &frame) > 0.1, "{name} shows");
        let (_, [other, _]) = show(Some(plugin(file, name).with(parameter, value)), true);
        assert!(difference(&other, &frame) > 0.1, "{parameter} of {name} does something");
    }
}

#[test]
fn a_constructor_may_refuse_and_explain_itself() {
    let folder = folder("refuses");
    let image = Arc::new(Image::rgba8(1, 1, vec![255; 4]));
    let Some(file) = marble(&folder) else { return };
    let mut scene = SceneBuilder::new();
    let texture = scene.texture(Texture::new("seeds", image, ColorSpace::Linear));
    let reference = TextureRef { texture, uv_set: 0, transform: UvTransform::IDENTITY };
    let seeds = ParameterValue::Texture(reference, Vec3::ONE);
    let shader = Some(Arc::new(plugin(file, "marble").with("seed", seeds)));
    let wall = scene.material(Material { shader, ..Material::diffuse("wall", Vec3::ONE) });
    let mesh = scene.mesh(Mesh::quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0));
    let object = scene.object("wall", [(mesh, wall)]);
    scene.instance(object, Affine3A::IDENTITY);
    let (report, [frame, _]) = render(scene, true);
    let [problem] = &report.problems[..] else { panic!("one problem: {:?}", report.problems) };
    assert!(problem.contains("refuses its parameters (`seed` cannot be a texture)"), "{problem}");
    assert_placeholder(&frame);
}

/// Black and magenta, and nothing of the wall's own grey.
fn assert_placeholder(frame: &Frame) {
    let c = middle(frame);
    assert!(c.x == c.z && c.y < 0.1, "{c}");
    assert!(frame.color.iter().any(|c| c.x > 0.9 && c.y < 0.1), "some squares are magenta");
}

#[test]
fn what_is_not_allowed_is_not_loaded() {
    let Some(file) = checker(&folder("refused")) else { return };
    let (report, [frame, _]) = show(Some(plugin(file, "checker")), false);
    let [problem] = &report.problems[..] else { panic!("one problem: {:?}", report.problems) };
    assert!(problem.contains("`wall`") && problem.contains("--allow-plugins"), "{problem}");
    assert_placeholder(&frame);
}

#[test]
fn broken_plugins_leave_a_placeholder_and_a_problem() {
    let folder = folder("broken");
    let faults = [
        ("OTHER_VERSION", "was made for version 77 of the interface"),
        ("OLDER", "does not know the engine's interface"),
        ("NO_ENTRY", "no function `heliostat_plugin`"),
        ("UNRESOLVED", "nowhere_to_be_found"),
        ("OTHER_SIZE", "another packing"),
        ("NO_SHADERS", "it has 0 shaders"),
        ("NULL_SHADERS", "table of shaders is null"),
        ("NO_SHADE", "`faulty`: it has no function `shade`"),
        ("BAD_NAME", "\"Not a name\""),
        ("BAD_FLAGS", "0x400"),
        ("NO_TEXT", "`about` is null"),
        ("NO_PARAMETERS", "table of parameters is null"),
        ("MANY_PARAMETERS", "4000000000 parameters; the limit is 32"),
        ("TWICE", "two parameters `amount`"),
        ("BAD_RANGE", "the default 2 of `amount`"),
    ];
    for (fault, expected) in faults {
        let file = folder.join(format!("{fault}.so"));
        let Some(file) = c("tests/shaders/faulty.c", &["-w", &format!("-D{fault}")], file) else { return };
        let (report, [frame, _]) = show(Some(plugin(file, "faulty")), true);
        let [problem] = &report.problems[..] else { panic!("{fault}: {:?}", report.problems) };
        assert!(problem.contains(expected) && problem.contains(fault), "{fault}: {problem}");
        assert_placeholder(&frame);
    }
    let Some(sound) = c("tests/shaders/faulty.c", &[], folder.join("sound.so")) else { return };
    std::fs::write(folder.join("text.so"), "not a library").expect("a file");
    for (shader, expected) in [
        (plugin(sound.clone(), "faulty").with("amount", 1.0), "(`amount` is too much)"),
        (plugin(sound.clone(), "faulty").with("count", 1.0), "no parameter `count`; it has: amount"),
        (plugin(sound.clone(), "other"), "there is no shader `other` in it; it has: faulty"),
        (plugin(folder.join("missing.so"), "faulty"), "missing.so"),
        (plugin(folder.join("text.so"), "faulty"), "the system cannot load it"),
        (ShaderUse::named("nonsense"), "there is no shader `nonsense`; there are: "),
    ] {
        let (report, [frame, _]) = show(Some(shader), true);
        let [problem] = &report.problems[..] else { panic!("{expected}: {:?}", report.problems) };
        assert!(problem.contains(expected), "{expected}: {problem}");
        assert_placeholder(&frame);
    }
    let (report, [frame, _]) = show(Some(plugin(sound, "faulty")), true);
    assert_eq!((&report.problems[..], &frame.problems[..]), (&[][..], &[][..]), "and this one has no fault");
}

#[test]
fn answers_that_make_no_sense_are_marked_and_told_once() {
    let folder = folder("answers");
    for (fault, field) in [
        ("ANSWERS_NAN", "roughness"),
        ("ANSWERS_INFINITY", "emission"),
        ("ANSWERS_BEYOND", "opacity"),
        ("ANSWERS_NO_NORMAL", "normal"),
    ] {
        let file = folder.join(format!("{fault}.so"));
        let Some(file) = c("tests/shaders/faulty.c", &["-w", &format!("-D{fault}")], file) else { return };
        let (report, [first, second]) = show(Some(plugin(file, "faulty")), true);
        assert_eq!(report.problems, [""; 0], "nothing is wrong with it before it runs");
        let [problem] = &first.problems[..] else { panic!("{fault}: {:?}", first.problems) };
        assert!(problem.contains("shader `faulty`") && problem.contains(&format!("`{field}`")), "{problem}");
        assert_eq!(second.problems, [""; 0], "told once");
        assert_eq!(middle(&first), Vec3::new(1.0, 0.0, 1.0), "{fault}");
    }
}

#[test]
fn textures_can_be_sampled_anywhere() {
    let Some(file) = c("tests/shaders/sampler.c", WARNINGS, folder("sampler").join("sampler.so")) else {
        return;
    };
    let mut scene = SceneBuilder::new();
    // Columns of red 0, 1, 0, 1 and rows of green 0, 0.5, with alpha 0.25.
    let pixels = (0..8).flat_map(|i| [(i % 2) as f32, (i / 4) as f32 * 0.5, 0.0, 0.25]).collect();
    let mut texture = Texture::new("columns", Arc::new(Image::rgba_f32(4, 2, pixels)), ColorSpace::Linear);
    texture.nearest = true;
    let texture = scene.texture(texture);
    let reference = TextureRef { texture, uv_set: 0, transform: UvTransform::IDENTITY };
    let picture = ParameterValue::Texture(reference, Vec3::new(0.5, 1.0, 1.0));
    let shader = Some(Arc::new(plugin(file, "swapped").with("picture", picture)));
    let wall = scene.material(Material { shader, ..Material::diffuse("wall", Vec3::ZERO) });
    let mesh = scene.mesh(Mesh::quad(Vec3::new(-4.0, -4.0, 0.0), Vec3::X * 8.0, Vec3::Y * 8.0));
    let object = scene.object("wall", [(mesh, wall)]);
    scene.instance(object, Affine3A::IDENTITY);
    let (report, [frame, _]) = render(scene, true);
    assert_eq!((&report.problems[..], &frame.problems[..]), (&[][..], &[][..]));
    // The camera looks at the middle from the right and from above: columns lie across and rows along the picture, each
    // a quarter and a half of the wall.
    let at = |x: usize, y: usize| frame.color[y * 48 + x];
    assert_eq!(at(0, 4), Vec3::new(0.5, 0.0, 0.25), "above and left: second column, first row");
    assert_eq!(at(47, 4), Vec3::new(0.5, 0.5, 0.25), "above and right: second column, second row");
    assert_eq!(at(0, 28), Vec3::new(0.0, 0.0, 0.25), "below and left: third column, first row");
}

#[test]
fn attributes_arrive_like_all_values() {
    let folder = folder("attributes");
    let Some(sampler) = c("tests/shaders/sampler.c", WARNINGS, folder.join("sampler.so")) else { return };
    let Some(checker) = checker(&folder) else { return };
    let half = Vec3::new(0.5, 1.0, 1.0);
    let show = |shader: ShaderUse| {
        let mut scene = SceneBuilder::new();
        let shader = Some(Arc::new(shader));
        let wall = scene.material(Material { shader, ..Material::diffuse("wall", Vec3::ZERO) });
        let mesh = scene.mesh(Mesh::quad(Vec3::new(-4.0, -4.0, 0.0), Vec3::X * 8.0, Vec3::Y * 8.0));
        let colors = vec![Vec3::new(0.5, 0.25, 0.75), Vec3::new(1.0, 0.75, 0.5)];
        scene.attribute(mesh, "tint", Attribute::new(AttributeScope::Primitive, colors));
        scene.attribute(mesh, "width", Attribute::float(0.5));
        let object = scene.object("wall", [(mesh, wall)]);
        scene.instance(object, Affine3A::IDENTITY);
        let (report, [frame, _]) = render(scene, true);
        assert_eq!((&report.problems[..], &frame.problems[..]), (&[][..], &[][..]));
        frame
    };
    // What has no texture is the same wherever it is looked up.
    let tint = ParameterValue::Attribute("tint".into(), half);
    let frame = show(plugin(sampler, "swapped").with("picture", tint));
    let at = |x: usize, y: usize| frame.color[y * 48 + x];
    assert_eq!(at(2, 2), Vec3::new(0.5, 0.75, 1.0), "above and left: the second triangle, and alpha 1");
    assert_eq!(at(45, 29), Vec3::new(0.25, 0.25, 1.0), "below and right: the first triangle");
    // The same pictures as by constants of the same values.
    let width = ParameterValue::Attribute("width".into(), half);
    let (varying, constant) = (
        plugin(checker.clone(), "checker").with("size", width),
        plugin(checker, "checker").with("size", 0.25),
    );
    assert_eq!(show(varying).color, show(constant).color);
}

#[test]
fn a_library_stays_as_long_as_a_shader_of_it() {
    let Some(file) = checker(&folder("stays")) else { return };
    let program = Plugins::default().load(&file).expect("a plug-in").remove(0);
    let inputs: Vec<_> =
        [Vec3::ONE, Vec3::ZERO, Vec3::splat(0.5)].map(heliostat::shading::Input::constant).into();
    let prepared = program.prepared(&inputs).expect("prepared").expect("plug-ins prepare");
    drop(program);
    let unit = Vectors { x: Floats::ZERO, y: Floats::ZERO, z: Floats::splat(1.0) };
    let inside = Vectors { x: Floats::splat(0.1), y: Floats::splat(0.1), z: Floats::splat(0.1) };
    let points = Points { object_position: inside, ng: unit, normal: unit, ..Points::default() };
    let mut closures = Closures { normal: unit, coat_normal: unit, ..Closures::default() };
    prepared.run(LaneMode::Single, 3, &points, &inputs, &mut closures);
    assert_eq!(prepared.take_problem(), None);
    // The cell at the origin is of the first colour; the width of the filter, of a cell's thousandth, costs digits.
    assert!((closures.base_color.get(0) - Vec3::ONE).abs().max_element() < 1e-3);
}

/// A wall of glTF whose material names a plug-in beside the file.
fn document(plugin: &str) -> String {
    // Three corners of a triangle as little-endian floats.
    let corners = [-2.0_f32, -2.0, 0.0, 2.0, -2.0, 0.0, 0.0, 2.0, 0.0];
    let bytes: Vec<u8> = corners.iter().flat_map(|v| v.to_le_bytes()).collect();
    let escaped: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
    serde_json::json!({
        "asset": {"version": "2.0"},
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
            "min": [-2, -2, 0], "max": [2, 2, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": bytes.len()}],
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:application/octet-stream,{escaped}")}],
        "materials": [{"name": "wall", "extras": {"heliostat_shader":
            {"plugin": plugin, "shader": "checker", "parameters": {"size": 0.5}}}}],
    })
    .to_string()
}

#[test]
fn the_command_loads_plugins_only_when_told_to() {
    let folder = folder("command");
    if checker(&folder).is_none() {
        return;
    }
    std::fs::write(folder.join("wall.gltf"), document("checker.so")).expect("a file");
    std::fs::write(folder.join("out.gltf"), document("../command/checker.so")).expect("a file");
    let run = |scene: &str, extra: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_heliostat"));
        command.args([
            "render",
            scene,
            "-o",
            "wall.png",
            "--size",
            "32x24",
            "--renderer",
            "direct",
            "--spp",
            "1",
        ]);
        let output = command.args(extra).current_dir(&folder).output().expect("it runs");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        (said, std::fs::read(folder.join("wall.png")).expect("a picture"))
    };
    let (said, refused) = run("wall.gltf", &[]);
    assert!(
        said.contains("warning: material `wall`: shader `checker`") && said.contains("--allow-plugins"),
        "{said}"
    );
    let (said, shown) = run("wall.gltf", &["--allow-plugins"]);
    assert!(!said.contains("warning"), "{said}");
    assert_ne!(refused, shown);
    let (said, _) = run("out.gltf", &["--allow-plugins"]);
    assert!(said.contains("stays in the scene file's folder"), "{said}");
}

//! Tests of the NFF importer.

use std::f32::consts::PI;

use glam::{Vec3, Vec4};
use heliostat_scene::{Geometry, LightKind, Material, Mesh, Quadric, Scene};

use super::*;
use crate::{Limits, Loaded, NoFiles, load_bytes};

const VIEW: &str = "v\nfrom 0 -5 1\nat 0 0 0\nup 0 0 1\nangle 45\nhither 1\nresolution 512 512\n";

fn read(text: &str) -> Result<Loaded, LoadError> {
    load_bytes("test.nff", text.as_bytes(), &NoFiles, &Limits::default())
}

fn scene(text: &str) -> Scene {
    let loaded = read(&format!("{VIEW}{text}")).unwrap();
    assert_eq!(loaded.diagnostics, []);
    let mut scene = Scene::default();
    scene.apply(&loaded.edits).unwrap();
    scene
}

fn meshes(scene: &Scene) -> Vec<&Mesh> {
    scene.geometries().values().filter_map(|g| Some(&**g.as_mesh()?)).collect()
}

fn material(text: &str) -> Material {
    let scene = scene(&format!("{text}\ns 0 0 0 1"));
    (**scene.materials().values().next().unwrap()).clone()
}

#[test]
fn every_statement_is_read() {
    let text = "# comment\nb 0.1 0.2 0.3\nl 1 2 3\nl 4 5 6 1 0.5 0 % comment\nf 1 0.5 0.25 0.5 0 1 0 1\n\
        s 1 2 3 4\nc 0 0 0 1 0 0 2 0.5\np 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n\
        pp 3\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n";
    let scene = scene(text);
    assert_eq!(*scene.environment(), Environment::Constant(linear(Vec3::new(0.1, 0.2, 0.3))));
    assert_eq!(scene.materials().len(), 1);
    let flat = meshes(&scene);
    assert_eq!(flat.iter().map(|m| m.indices.len()).collect::<Vec<_>>(), [2, 1]);
    assert_eq!((flat[0].normals.len(), flat[1].normals.len()), (0, 3));
    let Some(Geometry::Quadrics(list)) = scene.geometries().values().find(|g| g.as_mesh().is_none()) else {
        panic!("no quadrics");
    };
    let sphere = Quadric::Sphere { center: Vec3::new(1.0, 2.0, 3.0), radius: 4.0 };
    let cone = Quadric::Cone {
        base: Vec3::ZERO,
        base_radius: 1.0,
        apex: Vec3::new(0.0, 0.0, 2.0),
        apex_radius: 0.5,
    };
    assert_eq!(list.shapes, [sphere, cone]);
}

#[test]
fn what_is_up_in_the_file_is_up_in_the_scene() {
    let standing = scene("s 0 0 7 1\nl 0 0 9");
    let bounds = standing.bounds().unwrap();
    assert!(bounds.center().abs_diff_eq(Vec3::new(0.0, 7.0, 0.0), 1e-5), "{bounds:?}");
    let camera = standing.cameras().values().next().unwrap().world_from_camera;
    assert!(Vec3::from(camera.translation).abs_diff_eq(Vec3::new(0.0, 1.0, 5.0), 1e-5));
    let LightKind::ConstantPoint { position, irradiance } = standing.lights().values().next().unwrap().kind
    else {
        panic!("another kind of light");
    };
    assert!(position.abs_diff_eq(Vec3::new(0.0, 9.0, 0.0), 1e-5) && irradiance == Vec3::splat(PI));
    let text = format!("{VIEW}s 0 0 7 1").replace("up 0 0 1", "up 0 1 0");
    let mut lying = Scene::default();
    lying.apply(&read(&text).unwrap().edits).unwrap();
    assert_eq!(lying.bounds().unwrap().center(), Vec3::new(0.0, 0.0, 7.0));
}

#[test]
fn lights_without_a_colour_share_the_light() {
    let four = scene("s 0 0 0 1\nl 1 0 0\nl 2 0 0\nl 3 0 0\nl 4 0 0 0.25 0 0");
    let power: Vec<Vec3> = four
        .lights()
        .values()
        .map(|light| match light.kind {
            LightKind::ConstantPoint { irradiance, .. } => irradiance / PI,
            _ => Vec3::ZERO,
        })
        .collect();
    assert_eq!(power[0], Vec3::splat(0.5));
    assert!(power[3].abs_diff_eq(Vec3::new(0.25, 0.0, 0.0), 1e-6));
}

/// What looks so on the screen.
fn screen(r: f32, g: f32, b: f32) -> Vec4 {
    linear(Vec3::new(r, g, b)).extend(1.0)
}

#[test]
fn fills_become_materials() {
    let matte = material("f 1 0.5 0.25 0.5 0 1000 0 1");
    assert_eq!((matte.base_color, matte.specular), (screen(0.5, 0.25, 0.125), 0.0));
    assert!((matte.base_color.x - 0.21404).abs() < 1e-5, "the sRGB curve: {}", matte.base_color.x);
    assert_eq!(matte.ambient, Vec3::ZERO);
    let mirror = material("f 1 0.9 0.7 0.5 0.5 3 0 1");
    let head_on = mirror.specular * 0.04 * mirror.specular_color;
    assert!(head_on.abs_diff_eq(Vec3::splat(0.21404), 1e-5) && (mirror.specular - 0.21404).abs() < 1e-5);
    assert_eq!(mirror.roughness, 0.1);
    let shiny = material("f 1 1 1 0.5 0.02 1e9 0 1");
    assert!(shiny.roughness < 0.01 && (shiny.specular - 0.02 / 12.92).abs() < 1e-6);
    let glass = material("f 1 1 1 0.2 0 3 0.6 1.5");
    assert_eq!((glass.ior, glass.volume.is_some(), glass.roughness), (1.5, true, 0.0));
    // Passed and scattered shares, of red: 0.6 and 0.2.
    let (passed, all) = (glass.transmission * glass.base_color.x, glass.base_color.x);
    let expected = screen(0.6, 0.2, 0.0);
    assert!((passed - expected.x).abs() < 1e-6 && (all - expected.x - expected.y).abs() < 1e-6, "{glass:?}");
    assert!(material("f 1 1 1 0 0 3 0.6 1").volume.is_none());
    assert_eq!(material("").base_color, screen(0.5, 0.5, 0.5));
}

#[test]
fn errors_name_line_and_column() {
    let error = |text: &str| read(text).unwrap_err().to_string();
    assert!(error("s 0 0 0").starts_with("test.nff:1:8: the radius is missing"));
    assert!(error("\n s 0 0 x 1").starts_with("test.nff:2:8: the centre is `x`"));
    assert!(error("p 2\n0 0 0").contains("the number of corners is 2; give a whole number of at least 3"));
    assert!(error("p 3.5").contains("which is not a whole number"));
    assert!(error("c 0 0 0 1 0 0 1 -1").contains("opposite signs"));
    assert!(error("f 1 1 1 -0.5 0 0 0 0").contains("Kd is -0.5"));
    assert!(error("v\nfrom 1 2 3\ns 0 0 0 1").contains("test.nff:"));
    assert!(error("").contains("no view and no shapes"));
    assert!(error("p 4000000000\n0 0 0").contains("the file ends"));
}

#[test]
fn what_is_no_statement_is_told_of_once() {
    let loaded = read("s 0 0 0 1\nfoo 1 2\n1 2 3\nfoo\n4 5 6\ns 1 1 1 1").unwrap();
    let told: Vec<_> = loaded.diagnostics.iter().map(|d| d.message.as_str()).collect();
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told[0].starts_with("`foo` is no statement") && told[1].starts_with("a number"));
}

#[test]
fn limits_hold() {
    let limits = Limits { vertices: 5, ..Limits::default() };
    let text = "p 3 0 0 0 1 0 0 0 1 0\n".repeat(2);
    let error = load_bytes("a.nff", text.as_bytes(), &NoFiles, &limits).unwrap_err();
    assert!(error.to_string().contains("6 vertices, the limit is 5"), "{error}");
}

#[test]
fn the_format_is_known_by_its_view() {
    let text = format!("# a\nb 0 0 0\n{VIEW}s 0 0 0 1");
    assert!(load_bytes("upload", text.as_bytes(), &NoFiles, &Limits::default()).is_ok());
}

#[test]
fn cut_and_damaged_files_never_panic() {
    let text = format!(
        "{VIEW}b 0 0 0\nl 1 2 3\nf 1 1 1 0.5 0.5 3 0.2 1.5\ns 0 0 0 1\nc 0 0 0 1 0 0 1 0\npp 3\n0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n"
    );
    for cut in 0..text.len() {
        _ = read(&text[..cut]);
        for byte in [b'-', b'9', b'e', b'.', b' ', b'{', 0xFF] {
            let mut damaged = text.clone().into_bytes();
            damaged[cut] = byte;
            if let Ok(loaded) = load_bytes("a.nff", &damaged, &NoFiles, &Limits::default()) {
                Scene::default().apply(&loaded.edits).unwrap();
            }
        }
    }
}

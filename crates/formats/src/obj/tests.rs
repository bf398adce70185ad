//! Tests of the OBJ importer.

use glam::{Vec2, Vec3};
use heliostat_scene::{AlphaMode, Geometry, Material, Mesh, Texture, Wrap};

use super::*;
use crate::image::encode_png;
use crate::{Limits, Loaded, Memory, NoFiles, Severity, load_bytes};

fn read(text: &str) -> Result<Loaded, LoadError> {
    load_bytes("test.obj", text.as_bytes(), &NoFiles, &Limits::default())
}

fn meshes(loaded: &Loaded) -> Vec<Arc<Mesh>> {
    let mesh = |edit: &Edit| match edit {
        Edit::Geometry(_, Geometry::Mesh(mesh)) => Some(mesh.clone()),
        _ => None,
    };
    loaded.edits.iter().filter_map(mesh).collect()
}

fn materials(loaded: &Loaded) -> Vec<Arc<Material>> {
    let material = |edit: &Edit| match edit {
        Edit::Material(_, material) => Some(material.clone()),
        _ => None,
    };
    loaded.edits.iter().filter_map(material).collect()
}

fn textures(loaded: &Loaded) -> Vec<Arc<Texture>> {
    let texture = |edit: &Edit| match edit {
        Edit::Texture(_, texture) => Some(texture.clone()),
        _ => None,
    };
    loaded.edits.iter().filter_map(texture).collect()
}

/// The only mesh of a text that gives no diagnostics.
fn mesh(text: &str) -> Arc<Mesh> {
    let loaded = read(text).unwrap();
    assert_eq!(loaded.diagnostics, []);
    let mut all = meshes(&loaded);
    assert_eq!(all.len(), 1);
    all.remove(0)
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

/// One triangle for each of the named materials, of the library `a.mtl` in `text`.
fn with_library(text: &str, names: &[&str], images: &[(&str, Vec<u8>)]) -> Loaded {
    let mut obj = format!("mtllib a.mtl\n{SQUARE}");
    for name in names {
        obj += &format!("usemtl {name}\nf 1 2 3\n");
    }
    let mut files = Memory([("a.mtl".to_owned(), text.as_bytes().to_vec())].into());
    files.0.extend(images.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.clone())));
    let loaded = load_bytes("test.obj", obj.as_bytes(), &files, &Limits::default()).unwrap();
    heliostat_scene::Scene::default().apply(&loaded.edits).unwrap();
    loaded
}

fn material(text: &str) -> Material {
    let loaded = with_library(&format!("newmtl a\n{text}"), &["a"], &[]);
    assert_eq!(loaded.diagnostics, []);
    Arc::unwrap_or_clone(materials(&loaded).remove(0))
}

#[test]
fn all_index_forms_give_the_same_triangle() {
    for face in ["1 2 3", "1/ 2/ 3/", "1// 2// 3//", "-4 -3 -2", "1 \\\n 2 \\\n 3", "1 2 3 # comment"] {
        let mesh = mesh(&format!("{SQUARE}f {face}\n"));
        assert_eq!(*mesh.indices, [[0, 1, 2]], "{face}");
        assert_eq!(*mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y]);
        assert!(mesh.normals.is_empty() && mesh.uvs[0].is_empty());
    }
}

#[test]
fn coordinates_are_flipped_and_corners_that_differ_are_split() {
    let mesh = mesh(&format!(
        "{SQUARE}vt 0.25 0.75\nvt 1\nvn 0 0 2\nvn 1 0 0\nf 1/1/1 2/1/1 3/2/1\nf 1/1/1 3/2/1 4/1/2\nf 1/2/1 2/1/1 3/2/2\n"
    ));
    assert_eq!(*mesh.indices, [[0, 1, 2], [0, 2, 3], [4, 1, 5]]);
    assert_eq!(mesh.uvs[0][0], Vec2::new(0.25, 0.25));
    assert_eq!(mesh.uvs[0][2], Vec2::new(1.0, 1.0));
    assert_eq!(mesh.normals[0], Vec3::new(0.0, 0.0, 2.0));
    assert_eq!(mesh.normals[3], Vec3::X);
    assert_eq!(mesh.positions[4], mesh.positions[0]);
}

#[test]
fn polygons_may_be_concave_and_refer_to_what_follows() {
    let mesh = mesh("f 1 2 3 4\nv 0 0 0\nv 2 1 0\nv 0 2 0\nv 0.5 1 0\n");
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        0.5 * (b - a).cross(c - a).z
    };
    let areas: Vec<f32> = mesh.indices.iter().map(area).collect();
    assert!(areas.len() == 2 && areas.iter().all(|a| *a > 0.0), "{areas:?}");
    assert!((areas.iter().sum::<f32>() - 1.5).abs() < 1e-6);
}

#[test]
fn smoothing_groups_give_smooth_normals_within_the_group() {
    let roof = "v 0 0 0\nv 1 0 0\nv 0 0 -1\nv 1 0 -1\nv 0 -1 0\nv 1 -1 0\n";
    let faces =
        |groups: [&str; 2]| mesh(&format!("{roof}s {}\nf 1 2 4 3\ns {}\nf 5 6 2 1\n", groups[0], groups[1]));
    let smooth = faces(["1", "1"]);
    assert_eq!(smooth.positions.len(), 6);
    assert!((smooth.normals[0] - Vec3::new(0.0, 0.5, 0.5).normalize()).length() < 1e-4);
    let creased = faces(["1", "2"]);
    assert_eq!(creased.positions.len(), 8);
    assert!((creased.normals[0] - Vec3::Y).length() < 1e-4);
    // One group and one flat face.
    let mixed = faces(["1", "off"]);
    assert_eq!(mixed.positions.len(), 8);
    assert!(mixed.normals[4..].iter().all(|n| *n == Vec3::Z));
    assert!(faces(["off", "0"]).normals.is_empty());
}

#[test]
fn vertex_colours_are_linearised() {
    let mesh = mesh("v 0 0 0 1 0 0.5\nv 1 0 0 0 1 0\nv 0 1 0\nf 1 2 3\n");
    assert_eq!(mesh.colors[1], glam::Vec4::new(0.0, 1.0, 0.0, 1.0));
    assert!((mesh.colors[0].z - 0.214).abs() < 1e-3);
    assert_eq!(mesh.colors[2], glam::Vec4::ONE);
}

#[test]
fn each_material_is_one_part_and_lasts_until_the_next() {
    let text = "newmtl red wine\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n";
    let files = Memory([("my lib.mtl".to_owned(), text.as_bytes().to_vec())].into());
    let obj = format!(
        "mtllib my lib.mtl\n{SQUARE}f 1 2 3\nusemtl \"red wine\"\no one\ng a b\nf 1 2 3\nusemtl blue\nf 1 3 4\n\
         o two\nf 1 2 4\nusemtl red wine\nf 2 3 4\n"
    );
    let loaded = load_bytes("dir/test.obj", obj.as_bytes(), &files, &Limits::default()).unwrap();
    assert_eq!(loaded.diagnostics, []);
    let counts: Vec<usize> = meshes(&loaded).iter().map(|m| m.indices.len()).collect();
    assert_eq!(counts, [1, 2, 2]);
    let names: Vec<_> = materials(&loaded).iter().map(|m| m.name.clone()).collect();
    assert_eq!(names, ["default", "red wine", "blue"]);
    let objects: Vec<_> = loaded.edits.iter().filter(|e| matches!(e, Edit::Object(..))).collect();
    assert!(matches!(objects[..], [Edit::Object(_, o)] if o.name == "test" && o.parts.len() == 3));
}

#[test]
fn missing_libraries_and_materials_are_warnings_and_grey() {
    let loaded = read(&format!("mtllib a.mtl\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n")).unwrap();
    assert_eq!(loaded.diagnostics.len(), 1);
    assert!(loaded.diagnostics[0].to_string().starts_with("warning: test.obj:1:1: material library `a.mtl`"));
    assert!(materials(&loaded).iter().all(|m| m.base_color.x == 0.5 && m.specular == 0.0));
    let loaded = with_library("newmtl a\nKd 1 1 1\n", &["a", "b"], &[]);
    assert!(loaded.diagnostics[0].to_string().contains("test.obj:8:1: material `b` is not defined"));
}

#[test]
fn diffuse_plastic_mirror_and_emitter_become_what_they_mean() {
    let diffuse = material("Kd 0.2 0.4 0.6\nKs 0 0 0\nNs 10\nillum 2\nNi 1.5\nd 1\nTr 0\nTf 1 1 1");
    assert_eq!((diffuse.specular, diffuse.base_color), (0.0, glam::Vec4::new(0.2, 0.4, 0.6, 1.0)));
    assert_eq!((diffuse.transmission, diffuse.alpha_mode), (0.0, AlphaMode::Opaque));
    // The reflectance at normal incidence is Ks for weak and strong ones alike.
    for ks in [0.01, 0.04, 0.7] {
        let coated = material(&format!("Kd 0.5 0.5 0.5\nKs {ks} {ks} 0\nNs 198"));
        let f0 = 0.04 * coated.specular_color * coated.specular;
        assert!((f0 - Vec3::new(ks, ks, 0.0)).length() < 1e-6, "{f0}");
        assert!((coated.roughness.powi(2) - 0.1).abs() < 1e-6);
    }
    let mirror = material("Kd 0.01 0.01 0.01\nKs 0.95 0.95 0.95\nNs 1000\nillum 5");
    assert_eq!(mirror.roughness, 0.0);
    assert!((0.04 * mirror.specular_color.x * mirror.specular - 0.95).abs() < 1e-6);
    let lamp = material("Kd 0.78 0.78 0.78\nKe 17 12 4");
    assert_eq!((lamp.emissive, lamp.double_sided), (Vec3::new(17.0, 12.0, 4.0), false));
}

#[test]
fn glass_and_coverage_are_told_apart() {
    let ball = material("Kd 0.01 0.01 0.01\nKs 0.3 0.3 0.3\nTf 0.1 0.1 0.1\nNs 200\nNi 2.5\nillum 7");
    assert_eq!((ball.transmission, ball.ior, ball.roughness), (1.0, 2.5, 0.0));
    assert!(ball.volume.is_some());
    assert_eq!(ball.base_color, glam::Vec4::ONE);
    let sheet = material("illum 4\nTf 0 0.5 0");
    assert!(sheet.volume.is_none() && sheet.base_color.y == 1.0 && sheet.base_color.x == 0.0);
    let veil = material("Kd 1 1 1\nd 0.25\nTr 0.1\nillum 2");
    assert_eq!((veil.alpha_mode, veil.base_color.w), (AlphaMode::Blend, 0.25));
    let inverse = material("Kd 1 1 1\nTr 0.25");
    assert_eq!(inverse.base_color.w, 0.75);
    // Without `illum` and `d`, the filter is all there is to tell how much passes.
    let pane = material("Kd 0 0 0\nTf 0.9 0.9 0.9");
    assert!(pane.alpha_mode == AlphaMode::Blend && (pane.base_color.w - 0.1).abs() < 1e-6);
    assert_eq!(material("Kd 0.5 0.5 0.5\nTf 0 0 0").alpha_mode, AlphaMode::Opaque);
}

#[test]
fn pbr_statements_replace_the_empirical_ones() {
    let car = material("Kd 0.8 0 0\nKs 1 1 1\nPr 0.3\nPm 0.9\nPc 1\nPcr 0.1");
    assert_eq!((car.roughness, car.metallic, car.specular), (0.3, 0.9, 1.0));
    let coat = car.clearcoat.unwrap();
    assert_eq!((coat.factor, coat.roughness), (1.0, 0.1));
}

#[test]
fn maps_are_shared_mixed_and_transformed() {
    let color = encode_png(2, 1, &[255, 0, 0, 0, 255, 0]).unwrap();
    let grey = encode_png(2, 2, &[0, 0, 0, 255, 255, 255, 0, 0, 0, 255, 255, 255]).unwrap();
    let images = [("wood plank.png", color), ("tex/grey.png", grey)];
    let text = "newmtl a\nmap_Kd -s 2 4 1 -o 0.5 0.25 -clamp on wood plank.png\nmap_Ks -clamp on wood plank.png\n\
        newmtl b\nKd 0 0 0\nmap_Kd WOOD plank.png\nmap_d tex\\grey.png\nmap_Bump -bm 2 tex/grey.png\n\
        map_Pr tex/grey.png\nmap_Pm tex/grey.png\n";
    let loaded = with_library(text, &["a", "b"], &images);
    assert_eq!(loaded.diagnostics.len(), 1, "{:?}", loaded.diagnostics);
    assert_eq!(loaded.diagnostics[0].severity, Severity::Note);
    let (materials, textures) = (materials(&loaded), textures(&loaded));
    assert_eq!(textures.len(), 4);
    let base = materials[0].base_color_texture.unwrap();
    assert_eq!(Some(base.texture), materials[0].specular_color_texture.map(|t| t.texture));
    assert_eq!(textures[0].wrap, [Wrap::Clamp; 2]);
    // (u, v) = (0.5, 0.5) upwards becomes (1.5, 2.25) upwards, which is −1.25 downwards.
    let moved = base.transform.0.transform_point2(Vec2::new(0.5, 0.5));
    assert!((moved - Vec2::new(1.5, -1.25)).length() < 1e-6, "{moved}");
    let pixels = |i: usize| crate::image::pixels::to_rgba8(&textures[i].image);
    assert_eq!(pixels(1), [[255, 0, 0, 0], [0, 255, 0, 255]]);
    assert_eq!(materials[1].alpha_mode, AlphaMode::Blend);
    // A repeating ridge: both columns have equal neighbours, so the normals stand upright.
    assert_eq!(pixels(2), [[128, 128, 255, 255]; 4]);
    assert_eq!(pixels(3)[..2], [[255, 0, 0, 255], [255, 255, 255, 255]]);
    assert_eq!((materials[1].roughness, materials[1].metallic), (1.0, 1.0));
}

#[test]
fn a_slope_in_a_bump_map_tilts_the_normal_against_it() {
    let image = heliostat_scene::Image::rgba8(4, 1, [0u8, 50, 100, 50].map(|v| [v, v, v, 255]).concat());
    let normals = crate::image::pixels::to_rgba8(&crate::image::pixels::normals_from_heights(&image, 64.0));
    assert!(normals[1][0] < 100 && normals[3][0] > 150 && normals[1][1] == 128, "{normals:?}");
}

#[test]
fn a_missing_texture_is_a_warning_and_a_checkerboard() {
    let loaded = with_library("newmtl a\nmap_Kd none.png\nbump none.png\n", &["a"], &[]);
    assert_eq!(loaded.diagnostics.len(), 1);
    assert!(loaded.diagnostics[0].to_string().contains("a.mtl:2:1: image `none.png`: there is no such file"));
    assert_eq!(*textures(&loaded)[0].image, heliostat_scene::Image::placeholder());
    assert!(materials(&loaded)[0].normal_texture.is_none());
}

#[test]
fn odd_values_are_warned_about_and_put_right() {
    let text = "newmtl a\nKd 2 -1 0.5\nNi 0\nKs spectral a.rfl\nPs 1\nmap_Ns x.png\n";
    let loaded = with_library(text, &["a"], &[]);
    let messages: Vec<_> = loaded.diagnostics.iter().map(ToString::to_string).collect();
    assert_eq!(messages.len(), 6, "{messages:#?}");
    let a = &materials(&loaded)[0];
    assert_eq!((a.base_color.truncate(), a.ior), (Vec3::new(1.0, 0.0, 0.5), 1.5));
    // One number for all three colours is checked like three.
    for value in ["-5", "nan", "inf"] {
        let loaded = with_library(&format!("newmtl a\nKd {value}\nKe {value}\n"), &["a"], &[]);
        assert_eq!(loaded.diagnostics.len(), 2);
        assert_eq!(materials(&loaded)[0].base_color.truncate(), Vec3::ZERO);
    }
}

#[test]
fn errors_say_where_and_what() {
    let error = |text: &str| read(text).unwrap_err();
    let bad = error(&format!("{SQUARE}# x\nf 1 2 x\n"));
    assert_eq!(bad.to_string().split(';').next().unwrap(), "test.obj:6:7: `x` is not an index");
    let snippet = bad.snippet().unwrap();
    assert_eq!((snippet.text.as_str(), snippet.start, snippet.length), ("f 1 2 x", 6, 1));
    let beyond = error(&format!("{SQUARE}f 1 2 5\n"));
    assert!(
        beyond.to_string().starts_with("test.obj:5:1: the face refers to vertex 5, the file has 4"),
        "{beyond}"
    );
    assert!(error("v 0 0 0\nf -1 -1 -2\n").to_string().contains("vertex -2 of 1 so far"));
    assert!(error("v 0 0 0\nf 0 1 1\n").to_string().contains("vertex 0 of 1 so far"));
    assert!(error("v 0 0\nf 1 1 1\n").to_string().starts_with("test.obj:1:6: z is missing"));
    assert!(error("v 0 0 0\nf 1 1\n").to_string().contains("a face of 2 corners"));
    assert!(error("v 0 0 0\nvt 0\nvn 0 0 1\nf 1/1/1/1 1 1\n").to_string().contains("too many parts"));
    assert!(error("hello").to_string().contains("no vertices and no faces"));
    let unknown = load_bytes("a.xyz", b"hello", &NoFiles, &Limits::default());
    assert!(matches!(unknown, Err(LoadError::Unsupported(_))));
    assert!(load_bytes("a", SQUARE.as_bytes(), &NoFiles, &Limits::default()).is_ok());
}

#[test]
fn unknown_statements_are_warned_about_once() {
    let loaded = read(&format!("{SQUARE}f 1 2 3\nl 1 2\nl 2 3\nfoo\n")).unwrap();
    let messages: Vec<_> = loaded.diagnostics.iter().map(|d| d.message.clone()).collect();
    assert_eq!(messages, ["`l` is not supported and was ignored", "`foo` is not supported and was ignored"]);
}

#[test]
fn limits_hold() {
    let text = format!("{SQUARE}{}", "f 1 2 3 4\n".repeat(100));
    let limited = |limits: Limits| load_bytes("a.obj", text.as_bytes(), &NoFiles, &limits);
    assert!(limited(Limits::default()).is_ok());
    for (name, limits) in [
        ("triangles", Limits { triangles: 199, ..Limits::default() }),
        ("vertices", Limits { vertices: 3, ..Limits::default() }),
        ("memory_bytes", Limits { memory_bytes: 4000, ..Limits::default() }),
        ("file_bytes", Limits { file_bytes: 1000, ..Limits::default() }),
    ] {
        let error = limited(limits).unwrap_err();
        assert!(matches!(error, LoadError::Limit(_)) && error.to_string().contains(name), "{name}: {error}");
    }
    let many: String = (0..300).map(|i| format!("x{i}\n")).collect();
    let loaded = read(&format!("{SQUARE}f 1 2 3\n{many}")).unwrap();
    assert_eq!(loaded.diagnostics.len(), 32);
}

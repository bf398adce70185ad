//! Tests of the PLY importer.

use std::collections::BTreeMap;

use heliostat_scene::Geometry;

use super::*;
use crate::{Limits, Loaded, Memory, NoFiles, load_bytes};

fn read(bytes: &[u8]) -> Result<Loaded, LoadError> {
    load_bytes("test.ply", bytes, &NoFiles, &Limits::default())
}

fn mesh(bytes: &[u8]) -> Arc<Mesh> {
    let loaded = read(bytes).unwrap();
    assert_eq!(loaded.diagnostics, []);
    mesh_of(&loaded)
}

fn mesh_of(loaded: &Loaded) -> Arc<Mesh> {
    let mut meshes = loaded.edits.iter().filter_map(|edit| match edit {
        Edit::Geometry(_, Geometry::Mesh(mesh)) => Some(mesh.clone()),
        _ => None,
    });
    meshes.next().unwrap()
}

const SQUARE: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\n\
    property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";

#[test]
fn an_ascii_polygon_becomes_smooth_triangles() {
    let mesh = mesh(SQUARE.as_bytes());
    assert_eq!(*mesh.indices, [[0, 1, 2], [0, 2, 3]]);
    assert!(mesh.normals.iter().all(|n| (*n - Vec3::Z).length() < 1e-6));
    assert_eq!(mesh.positions[2], Vec3::new(1.0, 1.0, 0.0));
}

/// A triangle with every attribute, in any encoding.
fn rich(format: &str, big: bool) -> Vec<u8> {
    let mut bytes = format!(
        "ply\r\nformat {format} 1.0\r\nelement extra 2\r\nproperty list uchar short s\r\nelement vertex 3\r\n\
         property double x\r\nproperty float y\r\nproperty short z\r\nproperty float nx\r\nproperty float ny\r\n\
         property float nz\r\nproperty uchar red\r\nproperty uchar green\r\nproperty uchar blue\r\n\
         property uchar alpha\r\nproperty float s\r\nproperty float t\r\nelement face 1\r\nproperty uchar q\r\n\
         property list ushort uint vertex_index\r\nend_header\r\n"
    )
    .into_bytes();
    let ascii = format == "ascii";
    let mut put = |value: f64, kind: &str| {
        if ascii {
            bytes.extend(format!("{value} ").bytes());
            return;
        }
        let mut raw = match kind {
            "u8" => vec![value as u8],
            "i16" => (value as i16).to_le_bytes().to_vec(),
            "u32" => (value as u32).to_le_bytes().to_vec(),
            "f32" => (value as f32).to_le_bytes().to_vec(),
            _ => value.to_le_bytes().to_vec(),
        };
        if big {
            raw.reverse();
        }
        bytes.extend(raw);
    };
    for _ in 0..2 {
        put(1.0, "u8");
        put(-7.0, "i16");
    }
    for i in 0..3 {
        let i = f64::from(i);
        put(0.5 + i, "f64");
        put(i * i, "f32");
        put(-i, "i16");
        [0.0, 1.0, 0.0].into_iter().for_each(|v| put(v, "f32"));
        [255.0, 0.0, 188.0, 51.0].into_iter().for_each(|v| put(v, "u8"));
        [0.25, 0.75].into_iter().for_each(|v| put(v, "f32"));
    }
    put(9.0, "u8");
    put(3.0, "i16");
    [2.0, 1.0, 0.0].into_iter().for_each(|v| put(v, "u32"));
    bytes
}

#[test]
fn all_encodings_give_the_same_mesh_with_every_attribute() {
    for (format, big) in [("ascii", false), ("binary_little_endian", false), ("binary_big_endian", true)] {
        let mesh = mesh(&rich(format, big));
        assert_eq!(*mesh.indices, [[2, 1, 0]], "{format}");
        assert_eq!(mesh.positions[2], Vec3::new(2.5, 4.0, -2.0));
        assert_eq!(mesh.normals, [Vec3::Y; 3]);
        assert_eq!(mesh.uvs[0][1], Vec2::new(0.25, 0.25));
        let color = mesh.colors[0];
        assert_eq!((color.x, color.y), (1.0, 0.0));
        assert!((color.z - 0.5029).abs() < 1e-3 && (color.w - 0.2).abs() < 1e-6);
    }
}

#[test]
fn every_truncation_is_an_error_and_never_a_panic() {
    for (format, big) in [("ascii", false), ("binary_little_endian", false), ("binary_big_endian", true)] {
        let bytes = rich(format, big);
        // The text may lose its last space and, as `0` is an index like `0 `, nothing more.
        let complete = bytes.len() - usize::from(!big && format == "ascii");
        for len in 0..complete {
            assert!(read(&bytes[..len]).is_err(), "{format} cut at {len}");
        }
    }
}

#[test]
fn triangle_strips_alternate_and_restart() {
    let text = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
        element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        0 0 0 1 0 0 0 1 0 1 1 0 0 2 0 1 2 0\n8 0 1 2 3 -1 2 3 4\n";
    assert_eq!(*mesh(text.as_bytes()).indices, [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
}

#[test]
fn a_compressed_file_is_read_like_the_plain_one() {
    use std::io::Write;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(SQUARE.as_bytes()).unwrap();
    let bytes = encoder.finish().unwrap();
    assert_eq!(mesh(&bytes).indices.len(), 2);
    let broken = read(&bytes[..bytes.len() / 2]).unwrap_err();
    assert!(matches!(broken, LoadError::Input(_)), "{broken}");
    let limits = Limits { file_bytes: 200, ..Limits::default() };
    assert!(matches!(load_bytes("a.ply.gz", &bytes, &NoFiles, &limits), Err(LoadError::Limit(_))));
}

#[test]
fn a_point_cloud_is_a_warning() {
    let text = SQUARE.replace("element face 1", "element face 0").replace("4 0 1 2 3", "");
    let loaded = read(text.as_bytes()).unwrap();
    assert!(loaded.edits.is_empty());
    assert!(loaded.diagnostics[0].message.contains("point cloud"));
}

#[test]
fn a_texture_named_in_a_comment_is_used() {
    let text = SQUARE
        .replace("comment made by hand", "comment TextureFile some image.png")
        .replace("property float z\n", "property float z\nproperty float u\nproperty float v\n")
        .replace("0 0 0\n1 0 0\n1 1 0\n0 1 0\n", "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n");
    let png = crate::image::encode_png(1, 1, &[1, 2, 3]).unwrap();
    let files = Memory([("some image.png".to_owned(), png)].into());
    let loaded = load_bytes("a.ply", text.as_bytes(), &files, &Limits::default()).unwrap();
    assert_eq!(loaded.diagnostics, []);
    assert!(loaded.edits.iter().any(|e| matches!(e, Edit::Texture(_, t) if t.image.width == 1)));
}

#[test]
fn errors_say_where_and_what() {
    let error = |from: &str, to: &str| read(SQUARE.replace(from, to).as_bytes()).unwrap_err();
    let index = error("4 0 1 2 3", "4 0 1 2 4");
    assert_eq!(index.to_string().split(';').next().unwrap(), "test.ply:15:9: index 4 of 4 vertices");
    let snippet = index.snippet().unwrap();
    assert_eq!(&snippet.text[snippet.start..snippet.start + snippet.length], "4");
    let word = error("1 1 0\n", "1 one 0\n");
    assert!(word.to_string().starts_with("test.ply:13:3: `one` is not a number"), "{word}");
    let count = error("vertex 4", "vertex 4000000000000000000");
    assert!(count.to_string().contains("4000000000000000000 elements `vertex`"), "{count}");
    assert!(error("float x", "float32x x").to_string().starts_with("test.ply:5:10: unknown type"));
    assert!(error("property float z\n", "").to_string().contains("lack x, y or z"));
    assert!(error("end_header", "end").to_string().contains("`end` in the header"));
    assert!(error("4 0 1 2 3", "-1 0 1 2 3").to_string().contains("list of -1 items"));
    let limits = Limits { triangles: 1, ..Limits::default() };
    let limit = load_bytes("a.ply", SQUARE.as_bytes(), &NoFiles, &limits).unwrap_err();
    assert!(matches!(limit, LoadError::Limit(_)) && limit.to_string().contains("Limits::triangles"));
}

/// The attributes by name.
fn attributes(loaded: &Loaded) -> BTreeMap<String, Attribute> {
    let attribute = |edit: &Edit| match edit {
        Edit::Attribute(_, name, attribute) => Some((name.clone(), attribute.clone())),
        _ => None,
    };
    loaded.edits.iter().filter_map(attribute).collect()
}

/// A triangle and a square with two properties of vertices and of faces beyond the usual ones.
const MEASURED: &str = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n\
    property float z\nproperty float quality\nproperty short label\nelement face 2\nproperty uchar red\n\
    property list uchar int vertex_indices\nproperty uchar green\nproperty uchar blue\nproperty float quality\n\
    end_header\n0 0 0 0.5 -1\n1 0 0 1.5 2\n1 1 0 2.5 3\n0 1 0 3.5 4\n2 0 0 4.5 5\n\
    255 4 0 1 2 3 0 188 7\n0 3 1 4 2 255 0 -8\n";

#[test]
fn further_properties_become_attributes() {
    let loaded = read(MEASURED.as_bytes()).unwrap();
    assert_eq!(loaded.diagnostics, []);
    let mesh = mesh_of(&loaded);
    assert_eq!((mesh.indices.len(), mesh.colors.len()), (3, 0));
    let attributes = attributes(&loaded);
    let names: Vec<&str> = attributes.keys().map(String::as_str).collect();
    assert_eq!(names, ["face_color", "face_quality", "label", "quality"]);
    let per_vertex = |values: [f32; 5]| Attribute::new(AttributeScope::Vertex, values.to_vec());
    assert_eq!(attributes["quality"], per_vertex([0.5, 1.5, 2.5, 3.5, 4.5]));
    assert_eq!(attributes["label"], per_vertex([-1.0, 2.0, 3.0, 4.0, 5.0]));
    let per_face = Attribute::new(AttributeScope::Primitive, vec![7.0, 7.0, -8.0]);
    assert_eq!(attributes["face_quality"], per_face, "both triangles of the square have its value");
    let grey = srgb_to_linear(188.0 / 255.0);
    let square = Vec3::new(1.0, 0.0, grey);
    let colors = Attribute::new(AttributeScope::Primitive, vec![square, square, Vec3::Y]);
    assert_eq!(attributes["face_color"], colors);
    let mut scene = heliostat_scene::Scene::default();
    scene.apply(&loaded.edits).expect("the attributes fit their mesh");
}

#[test]
fn attributes_that_make_no_sense_are_left_out_with_a_warning() {
    let broken = MEASURED.replace("2 3\n1 1 0 2.5 3", "2 3").replace("0 0 0 0.5", "0 0 0 nan");
    let loaded = read(broken.as_bytes()).unwrap();
    assert_eq!(loaded.diagnostics.len(), 1, "{:?}", loaded.diagnostics);
    assert!(loaded.diagnostics[0].message.contains("`quality` of vertices has values that are not finite"));
    assert!(!attributes(&loaded).contains_key("quality") && attributes(&loaded).contains_key("label"));
    let strips = MEASURED
        .replace("end_header", "element tristrips 1\nproperty list int int vertex_indices\nend_header");
    let loaded = read((strips + "3 0 1 2\n").as_bytes()).unwrap();
    assert!(loaded.diagnostics.iter().any(|d| d.message.contains("`quality` of faces is not there once")));
    assert!(attributes(&loaded).keys().all(|name| !name.starts_with("face_")));
}

#[test]
fn attributes_count_as_memory() {
    let least = |text: &str| {
        let load = |memory_bytes| {
            let limits = Limits { memory_bytes, ..Limits::default() };
            load_bytes("a.ply", text.as_bytes(), &NoFiles, &limits)
        };
        (0..4096).find(|&bytes| load(bytes).is_ok()).expect("enough")
    };
    // Lists are read and thrown away.
    let plain = MEASURED
        .replace("property float quality\nproperty short label", "property list uchar short ignored")
        .replace("property float quality", "property list uchar uchar i");
    let plain = ["0.5 -1", "1.5 2", "2.5 3", "3.5 4", "4.5 5"]
        .iter()
        .fold(plain, |text, row| text.replace(row, "0"))
        .replace(" 188 7", " 188 0")
        .replace(" 0 -8", " 0 0");
    // Two numbers for each of five vertices; beside the colour, which both have, one for each of three triangles.
    let pad = "comment ".len() + 1;
    let comment = format!("comment {}\nelement vertex", "x".repeat(MEASURED.len() - plain.len() - pad));
    let plain = plain.replace("element vertex", &comment);
    assert_eq!(plain.len(), MEASURED.len());
    assert_eq!(least(MEASURED) - least(&plain), 4 * (2 * 5 + 3));
}

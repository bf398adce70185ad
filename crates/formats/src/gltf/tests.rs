//! Tests of the glTF importer, on documents made here.

use base64::Engine;
use glam::{Affine3A, Vec2, Vec3, Vec4};
use heliostat_scene::{Camera, Geometry, Instance, Light, LightKind, Material, Mesh, Projection, Scene};
use serde_json::{Value, json};

use super::*;
use crate::{Limits, Loaded, Memory, NoFiles, load_bytes};

pub(super) fn read(document: &Value) -> Result<Loaded, LoadError> {
    load_bytes("test.gltf", document.to_string().as_bytes(), &NoFiles, &Limits::default())
}

/// The scene of a document that gives no diagnostics.
pub(super) fn scene(document: &Value) -> Scene {
    let loaded = read(document).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(loaded.diagnostics, []);
    applied(&loaded)
}

pub(super) fn applied(loaded: &Loaded) -> Scene {
    let mut scene = Scene::default();
    scene.apply(&loaded.edits).unwrap();
    scene
}

fn error(document: &Value) -> LoadError {
    read(document).unwrap_err()
}

pub(super) fn meshes(scene: &Scene) -> Vec<Arc<Mesh>> {
    let mesh = |geometry: &Geometry| geometry.as_mesh().unwrap().clone();
    scene.geometries().values().map(mesh).collect()
}

pub(super) fn material(scene: &Scene) -> &Material {
    scene.materials().values().next().unwrap()
}

pub(super) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

pub(super) fn data_uri(bytes: &[u8]) -> String {
    let text = base64::engine::general_purpose::STANDARD.encode(bytes);
    format!("data:application/octet-stream;base64,{text}")
}

/// Collects accessors: each has a view of its own, all in one buffer.
#[derive(Default)]
pub(super) struct Data {
    bytes: Vec<u8>,
    views: Vec<Value>,
    pub(super) accessors: Vec<Value>,
}

impl Data {
    pub(super) fn view(&mut self, bytes: &[u8]) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    pub(super) fn add(&mut self, bytes: &[u8], component: u32, shape: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessors
            .push(json!({"bufferView": view, "componentType": component, "type": shape, "count": count}));
        self.accessors.len() - 1
    }

    pub(super) fn floats(&mut self, values: &[f32], shape: &str) -> usize {
        let width = [("SCALAR", 1), ("VEC2", 2), ("VEC3", 3), ("VEC4", 4), ("MAT4", 16)];
        let width = width.iter().find(|(name, _)| *name == shape).unwrap().1;
        self.add(&floats(values), 5126, shape, values.len() / width)
    }

    /// The document with the data embedded.
    pub(super) fn finish(self, rest: Value) -> Value {
        let mut document = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"uri": data_uri(&self.bytes), "byteLength": self.bytes.len()}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        document.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
        document
    }
}

pub(super) const TRIANGLE: [f32; 9] = [0., 0., 0., 1., 0., 0., 0., 1., 0.];

/// A document with one triangle as mesh 0, material 0 on it if `rest` defines one.
pub(super) fn triangle(rest: Value) -> Value {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let mut primitive = json!({"attributes": {"POSITION": position}});
    if rest.get("materials").is_some() {
        primitive["material"] = json!(0);
    }
    let mut document = data.finish(json!({"meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0}]}));
    document.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
    document
}

/// A document whose only primitive has these attributes and further members.
fn primitive(data: Data, attributes: Value, rest: Value) -> Value {
    let mut primitive = json!({"attributes": attributes});
    primitive.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
    data.finish(json!({"meshes": [{"primitives": [primitive]}], "nodes": [{"mesh": 0}]}))
}

#[test]
fn the_smallest_document_shows_a_flat_triangle() {
    let scene = scene(&triangle(json!({})));
    let mesh = &meshes(&scene)[0];
    assert_eq!(*mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(*mesh.indices, [[0, 1, 2]]);
    assert!(mesh.normals.is_empty());
    // The default material is the specification's: white, metallic, rough.
    assert_eq!((material(&scene).metallic, material(&scene).roughness), (1.0, 1.0));
    assert_eq!(scene.instances().len(), 1);
}

#[test]
fn attributes_of_all_component_types_are_read() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let normal = data.floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1.], "VEC3");
    let tangent = data.floats(&[1., 0., 0., -1., 1., 0., 0., -1., 1., 0., 0., -1.], "VEC4");
    let uv = data.add(&[0, 255, 51, 0, 0, 0], 5121, "VEC2", 3);
    data.accessors[uv]["normalized"] = json!(true);
    let uv1: Vec<u8> = [0u16, 65535, 0, 0, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let uv1 = data.add(&uv1, 5123, "VEC2", 3);
    data.accessors[uv1]["normalized"] = json!(true);
    let color = data.add(&[255, 0, 51, 0, 0, 0, 0, 0, 0], 5121, "VEC3", 3);
    data.accessors[color]["normalized"] = json!(true);
    let indices = data.add(&[2, 1, 0], 5121, "SCALAR", 3);
    let attributes = json!({
        "POSITION": position, "NORMAL": normal, "TANGENT": tangent, "TEXCOORD_0": uv, "TEXCOORD_1": uv1,
        "COLOR_0": color,
    });
    let scene = scene(&primitive(data, attributes, json!({"indices": indices})));
    let mesh = &meshes(&scene)[0];
    assert_eq!(*mesh.indices, [[2, 1, 0]]);
    assert_eq!(mesh.normals, [Vec3::Z; 3]);
    assert_eq!(mesh.tangents[0], Vec4::new(1.0, 0.0, 0.0, -1.0));
    assert_eq!(mesh.uvs[0][..2], [Vec2::new(0.0, 1.0), Vec2::new(0.2, 0.0)]);
    assert_eq!(mesh.uvs[1][0], Vec2::new(0.0, 1.0));
    assert_eq!(mesh.colors[0], Vec4::new(1.0, 0.0, 0.2, 1.0));
}

#[test]
fn indices_of_all_widths_strips_and_fans_are_triangles() {
    let square = [0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.];
    let indices = |component: u32| -> Vec<u8> {
        [0u32, 1, 2, 3]
            .iter()
            .flat_map(|v| match component {
                5121 => vec![*v as u8],
                5123 => (*v as u16).to_le_bytes().to_vec(),
                _ => v.to_le_bytes().to_vec(),
            })
            .collect()
    };
    for (component, mode, expected) in [
        (5121, 5, vec![[0, 1, 2], [2, 1, 3]]),
        (5123, 5, vec![[0, 1, 2], [2, 1, 3]]),
        (5125, 6, vec![[1, 2, 0], [2, 3, 0]]),
    ] {
        let mut data = Data::default();
        let position = data.floats(&square, "VEC3");
        let indices = data.add(&indices(component), component, "SCALAR", 4);
        let attributes = json!({"POSITION": position});
        let scene = scene(&primitive(data, attributes, json!({"indices": indices, "mode": mode})));
        assert_eq!(meshes(&scene)[0].indices.to_vec(), expected);
    }
}

#[test]
fn points_and_lines_are_left_out_with_a_warning() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let loaded = read(&primitive(data, json!({"POSITION": position}), json!({"mode": 1}))).unwrap();
    assert!(loaded.diagnostics[0].to_string().contains("meshes[0].primitives[0]: points and lines"));
    assert!(applied(&loaded).instances().is_empty());
}

#[test]
fn interleaved_and_sparse_accessors_are_followed() {
    let mut data = Data::default();
    let interleaved: Vec<f32> = (0..3).flat_map(|i| [i as f32, 1.0, 2.0, 9.0, 9.0, 9.0]).collect();
    let view = data.view(&floats(&interleaved));
    data.views[view]["byteStride"] = json!(24);
    let indices = data.view(&[1, 0, 2, 0]);
    let values = data.view(&floats(&[7., 7., 7., 8., 8., 8.]));
    let sparse = json!({
        "count": 2,
        "indices": {"bufferView": indices, "componentType": 5123},
        "values": {"bufferView": values},
    });
    data.accessors = vec![
        json!({"bufferView": view, "componentType": 5126, "type": "VEC3", "count": 3, "sparse": sparse}),
        json!({"componentType": 5126, "type": "VEC3", "count": 3, "sparse": sparse}),
    ];
    let scene = scene(&primitive(data, json!({"POSITION": 0, "NORMAL": 1}), json!({})));
    let mesh = &meshes(&scene)[0];
    assert_eq!(*mesh.positions, [Vec3::new(0.0, 1.0, 2.0), Vec3::splat(7.0), Vec3::splat(8.0)]);
    assert_eq!(mesh.normals, [Vec3::ZERO, Vec3::splat(7.0), Vec3::splat(8.0)]);
}

#[test]
fn hierarchies_become_groups_and_chains_collapse() {
    // 0 ─ 1 ─ 2 (mesh) ─ 3 (mesh), and an empty branch 4.
    let nodes = json!([
        {"children": [1, 4], "translation": [1, 0, 0]},
        {"children": [2], "scale": [2, 2, 2]},
        {"name": "two", "children": [3], "mesh": 0, "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,3,0,1]},
        {"mesh": 0, "rotation": [0, 0, 1, 0]},
        {"children": []},
    ]);
    let scene = scene(&triangle(json!({"nodes": nodes, "scenes": [{"nodes": [0]}], "scene": 0})));
    let instances: Vec<&Instance> = scene.instances().values().collect();
    assert_eq!((instances.len(), scene.objects().len(), scene.geometries().len()), (3, 2, 1));
    let world = instances.iter().find(|i| i.parent.is_none()).unwrap();
    assert_eq!(world.name, "two");
    assert_eq!(world.parent_from_object.transform_point3(Vec3::X), Vec3::new(3.0, 6.0, 0.0));
    let inside: Vec<_> = instances.iter().filter(|i| i.parent == Some(world.object)).collect();
    assert_eq!(inside.len(), 2);
    assert_eq!(inside[0].object, inside[1].object);
    let turned = inside.iter().find(|i| i.parent_from_object != Affine3A::IDENTITY).unwrap();
    assert!((turned.parent_from_object.transform_point3(Vec3::X) + Vec3::X).length() < 1e-6);
}

#[test]
fn deep_hierarchies_are_flattened_below_the_deepest_group() {
    // Every node has a mesh and the next node, so every one would be a group.
    let count = 200;
    let node = |i: usize| {
        let children: Vec<usize> = (i + 1..count.min(i + 2)).collect();
        json!({"mesh": 0, "translation": [1, 0, 0], "children": children})
    };
    let nodes: Vec<Value> = (0..count).map(node).collect();
    let scene = scene(&triangle(json!({"nodes": nodes, "scenes": [{"nodes": [0]}]})));
    let mut depth = BTreeMap::new();
    for object in scene.bottom_up().into_iter().rev() {
        let own = depth.get(&object).copied().unwrap_or(1usize);
        for instance in scene.instances().values().filter(|i| i.parent == Some(object)) {
            depth.insert(instance.object, own + 1);
        }
    }
    assert!(depth.values().all(|&d| d <= 50));
    let bounds = scene.bounds().unwrap();
    assert_eq!((bounds.min.x, bounds.max.x), (1.0, 201.0));
}

#[test]
fn only_the_chosen_scene_is_shown() {
    let nodes = json!([{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}]);
    let scenes = json!([{"nodes": [0]}, {"nodes": [1]}]);
    let shown = |rest: Value| {
        let mut document = triangle(json!({"nodes": nodes}));
        document.as_object_mut().unwrap().extend(rest.as_object().unwrap().clone());
        let scene = scene(&document);
        let bounds = scene.bounds().unwrap();
        (scene.instances().len(), bounds.min.x)
    };
    assert_eq!(shown(json!({"scenes": scenes, "scene": 1})), (1, 5.0));
    assert_eq!(shown(json!({"scenes": scenes})), (1, 0.0));
    assert_eq!(shown(json!({})), (2, 0.0));
}

#[test]
fn cyclic_and_shared_nodes_are_errors() {
    let with = |nodes: Value| error(&triangle(json!({"nodes": nodes}))).to_string();
    let cyclic = with(json!([{"children": [1]}, {"children": [0]}]));
    assert!(cyclic.starts_with("test.gltf: nodes[0]: the node is its own ancestor"), "{cyclic}");
    assert!(with(json!([{"children": [0]}])).contains("its own ancestor"));
    let shared = with(json!([{"children": [2]}, {"children": [2]}, {}]));
    assert!(shared.contains("nodes[1].children: nodes[2] is already a child of nodes[0]"), "{shared}");
    assert!(with(json!([{"children": [7]}])).contains("it refers to nodes[7], but there are 1"));
    assert!(
        with(json!([{"mesh": 0, "scale": [1e38, 1e38, 1e38], "children": [1]}, {"scale": [1e38, 1, 1]}]))
            .contains("not finite")
    );
    let chain: Vec<Value> =
        (0..1100).map(|i| json!({"children": if i < 1099 { vec![i + 1] } else { vec![] }})).collect();
    assert!(with(json!(chain)).contains("Limits::nesting"));
}

#[test]
fn skins_stand_as_their_joints_do() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let normal = data.floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1.], "VEC3");
    let joints = data.add(&[0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0], 5121, "VEC4", 3);
    let weights = data.floats(&[1., 0., 0., 0., 0., 2., 0., 0., 0.5, 0.5, 0., 0.], "VEC4");
    let identity = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];
    let mut shifted = identity;
    shifted[12] = -1.0;
    let bind = data.floats(&[identity, shifted].concat(), "MAT4");
    let attributes =
        json!({"POSITION": position, "NORMAL": normal, "JOINTS_0": joints, "WEIGHTS_0": weights});
    let document = data.finish(json!({
        "meshes": [{"primitives": [{"attributes": attributes}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": bind}],
        // The skinned node's own transform does not count; joint 2 turns about x = 1.
        "nodes": [
            {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
            {"children": [2], "translation": [0, 0, 5]},
            {"translation": [1, 0, 0], "rotation": [0, 1, 0, 0]},
        ],
    }));
    let scene = scene(&document);
    let mesh = &meshes(&scene)[0];
    let expected = [Vec3::new(0.0, 0.0, 5.0), Vec3::new(1.0, 0.0, 5.0), Vec3::new(1.0, 1.0, 5.0)];
    for (found, expected) in mesh.positions.iter().zip(expected) {
        assert!((*found - expected).length() < 1e-5, "{found} {expected}");
    }
    assert!((mesh.normals[1] - Vec3::NEG_Z).length() < 1e-6);
    assert_eq!(scene.bounds().unwrap().max.z, 5.0);
}

#[test]
fn morph_targets_have_their_default_weights() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let up = data.floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1.], "VEC3");
    let far = data.floats(&[9.; 9], "VEC3");
    let targets = json!([{"POSITION": up}, {"POSITION": far}]);
    let document = data.finish(json!({
        "meshes": [{"weights": [0.5, 0], "primitives": [{"attributes": {"POSITION": position}, "targets": targets}]}],
        "nodes": [{"mesh": 0}, {"mesh": 0}, {"mesh": 0, "weights": [2, 0]}],
    }));
    let scene = scene(&document);
    let heights: Vec<f32> = meshes(&scene).iter().map(|mesh| mesh.positions[0].z).collect();
    assert_eq!(heights, [0.5, 2.0]);
    assert_eq!(scene.instances().len(), 3);
}

#[test]
fn cameras_and_lights_are_placed_in_the_world() {
    let lights = json!([
        {"type": "spot", "color": [1, 0.5, 0], "intensity": 8, "range": 7, "spot": {"outerConeAngle": 0.5}},
        {"type": "directional", "name": "sun"},
        {"type": "point", "intensity": -1},
    ]);
    let light = |number: usize| json!({"KHR_lights_punctual": {"light": number}});
    let loaded = read(&triangle(json!({
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": lights}},
        "cameras": [
            {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}},
            {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": 2, "zfar": 1, "znear": 0}},
        ],
        "nodes": [
            {"children": [1, 2, 3, 4], "translation": [1, 2, 3], "scale": [2, 2, 2]},
            {"name": "eye", "camera": 0, "translation": [1, 0, 0]},
            {"camera": 1, "extensions": light(1)},
            {"name": "lamp", "extensions": light(0), "rotation": [0, 1, 0, 0]},
            {"extensions": light(2)},
        ],
    })))
    .unwrap();
    let messages: Vec<_> = loaded.diagnostics.iter().map(|d| d.severity.to_string() + &d.message).collect();
    assert_eq!(messages.len(), 2, "{messages:#?}");
    let scene = applied(&loaded);
    let cameras: Vec<&Camera> = scene.cameras().values().collect();
    assert_eq!(
        (cameras[0].name.as_str(), cameras[0].projection),
        ("eye", Projection::Perspective { vertical_fov: 0.8 })
    );
    assert_eq!(cameras[0].world_from_camera, Affine3A::from_translation(Vec3::new(3.0, 2.0, 3.0)));
    assert_eq!(cameras[1].projection, Projection::Orthographic { height: 4.0 });
    let lights: Vec<&Light> = scene.lights().values().collect();
    assert_eq!(lights.len(), 2);
    assert!(
        matches!(lights[0].kind, LightKind::Directional { irradiance: Vec3::ONE, .. })
            && lights[0].name == "sun"
    );
    let LightKind::Spot { position, direction, intensity, inner_angle, outer_angle, range } = lights[1].kind
    else {
        panic!("{:?}", lights[1])
    };
    assert_eq!((position, intensity), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(8.0, 4.0, 0.0)));
    assert!((direction.normalize() - Vec3::Z).length() < 1e-6);
    assert_eq!((inner_angle, outer_angle, range), (0.0, 0.5, 7.0));
}

#[test]
fn extensions_and_versions_are_checked() {
    let required = error(&triangle(
        json!({"extensionsRequired": ["KHR_texture_transform", "KHR_draco_mesh_compression"]}),
    ));
    assert!(matches!(required, LoadError::Unsupported(_)));
    assert!(
        required.to_string().contains("extensionsRequired[1]: the file requires the extension `KHR_draco")
    );
    let optional = read(&triangle(json!({"extensionsUsed": ["A_b", "C_d", "KHR_materials_ior"]}))).unwrap();
    assert_eq!(optional.diagnostics.len(), 1);
    assert!(optional.diagnostics[0].message.ends_with("A_b, C_d"));
    assert!(matches!(error(&json!({"asset": {"version": "1.0"}})), LoadError::Unsupported(_)));
    assert!(matches!(
        error(&json!({"asset": {"version": "2.1", "minVersion": "2.1"}})),
        LoadError::Unsupported(_)
    ));
    assert!(read(&json!({"asset": {"version": "2.1"}})).is_ok());
    assert!(matches!(error(&json!({"a": 1})), LoadError::Input(_)));
    let animated = read(&triangle(json!({"animations": [{}]}))).unwrap();
    assert!(animated.diagnostics[0].message.contains("no channel"));
    assert!(animated.timeline.is_empty());
}

#[test]
fn external_files_are_found_by_decoded_names() {
    let mut document = triangle(json!({}));
    let length = document["buffers"][0]["byteLength"].as_u64().unwrap();
    document["buffers"][0] = json!({"uri": "my%20data\\a.bin", "byteLength": length});
    let text = document.to_string();
    let files = |bytes: Vec<u8>| Memory([("my data/a.bin".to_owned(), bytes)].into());
    let load = |files: &Memory| load_bytes("test.gltf", text.as_bytes(), files, &Limits::default());
    assert!(load(&files(floats(&TRIANGLE))).is_ok());
    let short = load(&files(vec![0; 35])).unwrap_err().to_string();
    assert!(short.contains("buffers[0]: `byteLength` is 36, the data has 35 bytes"), "{short}");
    let missing = load(&Memory::default()).unwrap_err().to_string();
    assert!(missing.contains("buffers[0]: `my data/a.bin`: there is no such file"), "{missing}");
}

/// The document as a `.glb` file with `binary` as buffer 0.
fn glb(mut document: Value, binary: &[u8]) -> Vec<u8> {
    document["buffers"] = json!([{"byteLength": binary.len()}]);
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

#[test]
fn binary_files_are_read_and_every_truncation_is_an_error() {
    let bytes = glb(triangle(json!({})), &floats(&TRIANGLE));
    let load = |bytes: &[u8]| load_bytes("test.glb", bytes, &NoFiles, &Limits::default());
    assert_eq!(meshes(&applied(&load(&bytes).unwrap()))[0].positions.len(), 3);
    for length in 0..bytes.len() {
        assert!(load(&bytes[..length]).is_err(), "cut at {length}");
        // The same with a header that says so.
        let mut cut = bytes[..length].to_vec();
        if length >= 12 {
            cut[8..12].copy_from_slice(&(length as u32).to_le_bytes());
            assert!(load(&cut).is_err(), "cut at {length}, said so");
        }
    }
    let mut old = bytes.clone();
    old[4] = 1;
    assert!(matches!(load(&old).unwrap_err(), LoadError::Unsupported(_)));
}

#[test]
fn data_outside_its_view_is_an_error_with_the_path() {
    let with = |change: &dyn Fn(&mut Value)| {
        let mut document = triangle(json!({}));
        change(&mut document);
        error(&document).to_string()
    };
    let count = with(&|d| d["accessors"][0]["count"] = json!(4));
    assert!(count.contains("accessors[0]: 4 elements end at byte 48 of a view of 36 bytes"), "{count}");
    assert!(with(&|d| d["accessors"][0]["count"] = json!(u64::MAX)).contains("the limit is"));
    assert!(with(&|d| d["accessors"][0]["byteOffset"] = json!(u64::MAX)).contains("end at byte"));
    assert!(
        with(&|d| d["bufferViews"][0]["byteLength"] = json!(37)).contains("bufferViews[0]: the view ends at")
    );
    assert!(
        with(&|d| d["bufferViews"][0]["byteStride"] = json!(4))
            .contains("`byteStride` of bufferViews[0] is 4")
    );
    assert!(with(&|d| d["accessors"][0]["type"] = json!("VEC2")).contains("must be VEC3"));
    assert!(with(&|d| d["accessors"][0]["componentType"] = json!(5130)).contains("`componentType` is 5130"));
    assert!(with(&|d| d["meshes"][0]["primitives"][0]["indices"] = json!(0)).contains("accessors[0]"));
    assert!(with(&|d| d["meshes"][0]["primitives"][0]["mode"] = json!(9)).contains("`mode` is 9"));
    assert!(with(&|d| d["nodes"][0]["mesh"] = json!(3)).contains("nodes[0].mesh: it refers to meshes[3]"));
}

#[test]
fn broken_json_is_shown_with_its_place() {
    let load = |text: &str| load_bytes("a.gltf", text.as_bytes(), &NoFiles, &Limits::default()).unwrap_err();
    let wrong = load("{\"asset\": {\"version\": \"2.0\"},\n \"nodes\": [{}, {\"mesh\": \"x\"}]}");
    assert!(wrong.to_string().starts_with("a.gltf:2:"), "{wrong}");
    assert!(
        wrong.to_string().contains("nodes[1].mesh: invalid type: string \"x\", expected usize"),
        "{wrong}"
    );
    assert!(wrong.snippet().unwrap().text.contains("\"mesh\": \"x\""));
    assert!(load("{\"asset\": {").to_string().contains("truncated"));
    assert!(load(&format!("{{\"nodes\":{}", "[".repeat(100_000))).to_string().starts_with("a.gltf:1:"));
    let limits = Limits { memory_bytes: 1 << 20, ..Limits::default() };
    let many = format!("{{\"nodes\": [{}]}}", "{},".repeat(2000));
    let error = load_bytes("a.gltf", many.as_bytes(), &NoFiles, &limits).unwrap_err();
    assert!(matches!(error, LoadError::Limit(_)), "{error}");
}

//! Tests of shaders in materials' extras, on documents made here.

use std::path::Path;

use glam::Vec3;
use heliostat_scene::{Attribute, AttributeScope, GeometryId, ParameterValue, ShaderRef};
use serde_json::{Value, json};

use super::tests::{applied, data_uri, material, read, scene, triangle};
use crate::{Directory, Limits, load_bytes};

fn document(extras: Value) -> Value {
    let png = data_uri(&crate::image::encode_png(1, 1, &[1, 2, 3]).unwrap());
    triangle(json!({
        "textures": [{"source": 0}],
        "images": [{"uri": png}],
        "materials": [{"name": "m", "extras": extras}],
    }))
}

#[test]
fn shaders_of_the_engine_are_read_with_their_parameters() {
    let scene = scene(&document(json!({"other": [1, {"a": null}], "heliostat_shader": {
        "name": "checker",
        "parameters": {"size": 0.5, "first": [1, 0.5, 0], "second": {"index": 0, "factor": [0.5, 1, 1]},
            "third": {"index": 0, "linear": true}},
    }})));
    let shader = material(&scene).shader.as_ref().unwrap();
    assert_eq!(shader.shader, ShaderRef::Named("checker".into()));
    assert_eq!(shader.parameters["size"], ParameterValue::Float(0.5));
    assert_eq!(shader.parameters["first"], ParameterValue::Vector(Vec3::new(1.0, 0.5, 0.0)));
    let ParameterValue::Texture(second, factor) = shader.parameters["second"] else { panic!("a texture") };
    assert_eq!(factor, Vec3::new(0.5, 1.0, 1.0));
    let ParameterValue::Texture(third, _) = shader.parameters["third"] else { panic!("a texture") };
    assert_ne!(second.texture, third.texture, "one as colour and one as data");
}

#[test]
fn extras_of_others_are_left_alone() {
    for extras in [json!(3), json!("text"), json!([1]), json!({"a": 1}), json!(null)] {
        assert!(material(&scene(&document(extras))).shader.is_none());
    }
}

#[test]
fn plugins_stay_in_the_folder_of_the_document() {
    let load = |plugin: &str| {
        let shader = json!({"plugin": plugin, "shader": "a"});
        let text = document(json!({"heliostat_shader": shader})).to_string();
        let source = Directory("some/folder".into());
        load_bytes("test.gltf", text.as_bytes(), &source, &Limits::default()).unwrap()
    };
    let loaded = load("sub/my%20wood.so");
    assert_eq!(loaded.diagnostics, []);
    let scene = applied(&loaded);
    let ShaderRef::Plugin { file, shader } = &material(&scene).shader.as_ref().unwrap().shader else {
        panic!("a plug-in")
    };
    assert_eq!((file.as_path(), shader.as_str()), (Path::new("some/folder/sub/my wood.so"), "a"));
    for outside in ["../wood.so", "/usr/lib/wood.so", "a/%2e%2e/../wood.so", "C:\\wood.so"] {
        let loaded = load(outside);
        assert_eq!(loaded.diagnostics.len(), 1, "{outside}: {:?}", loaded.diagnostics);
        assert!(loaded.diagnostics[0].message.contains("stays in the scene file's folder"), "{outside}");
        assert!(material(&applied(&loaded)).shader.is_none());
    }
}

#[test]
fn mistakes_cost_the_shader_and_not_the_scene() {
    for shader in [
        json!("checker"),
        json!({}),
        json!({"name": "a", "plugin": "b.so"}),
        json!({"plugin": "b.so"}),
        json!({"plugin": "b.so", "shader": "c"}),
        json!({"name": "a", "parameter": {}}),
        json!({"name": "a", "parameters": {"size": [1, 2]}}),
    ] {
        let loaded = read(&document(json!({"heliostat_shader": shader}))).unwrap();
        assert_eq!(loaded.diagnostics.len(), 1, "{shader}: {:?}", loaded.diagnostics);
        assert!(material(&applied(&loaded)).shader.is_none());
    }
    let loaded =
        read(&document(json!({"heliostat_shader": {"name": "a", "parameters": {"x": 1e39}}}))).unwrap();
    assert_eq!(loaded.diagnostics.len(), 1, "{:?}", loaded.diagnostics);
    assert!(material(&applied(&loaded)).shader.as_ref().unwrap().parameters.is_empty());
}

/// A triangle with an attribute of its own of three elements, and a material whose shader takes it.
fn attributed(kind: &str, components: &[f32]) -> Value {
    let bytes: Vec<u8> = components.iter().flat_map(|value| value.to_le_bytes()).collect();
    let shader = json!({"name": "checker", "parameters": {"size": {"attribute": "_HEAT", "factor": [2, 2, 2]},
        "first": {"attribute": "_HEAT"}}});
    let mut document = document(json!({"heliostat_shader": shader}));
    let add = |document: &mut Value, list: &str, value: Value| {
        let values = document[list].as_array_mut().expect("a list");
        values.push(value);
        values.len() - 1
    };
    let buffer = json!({"byteLength": bytes.len(), "uri": data_uri(&bytes)});
    let buffer = add(&mut document, "buffers", buffer);
    let view = json!({"buffer": buffer, "byteLength": bytes.len()});
    let view = add(&mut document, "bufferViews", view);
    let accessor = json!({"bufferView": view, "componentType": 5126, "count": 3, "type": kind});
    let accessor = add(&mut document, "accessors", accessor);
    document["meshes"][0]["primitives"][0]["attributes"]["_HEAT"] = json!(accessor);
    document
}

#[test]
fn shaders_take_attributes_of_meshes() {
    let scene = scene(&attributed("SCALAR", &[1.0, 2.0, 4.0]));
    let shader = material(&scene).shader.as_ref().unwrap();
    assert_eq!(shader.parameters["size"], ParameterValue::Attribute("_HEAT".into(), Vec3::splat(2.0)));
    assert_eq!(shader.parameters["first"], ParameterValue::Attribute("_HEAT".into(), Vec3::ONE));
    let attributes = &scene.attributes()[&GeometryId(0)];
    let expected = Attribute::new(AttributeScope::Vertex, vec![1.0, 2.0, 4.0]);
    assert_eq!(attributes.iter().collect::<Vec<_>>(), [(&"_HEAT".to_owned(), &expected)]);
    let colors = [Vec3::X, Vec3::Y, Vec3::Z];
    let flat: Vec<f32> = colors.iter().flat_map(|color| color.to_array()).collect();
    let vectors = super::tests::scene(&attributed("VEC3", &flat));
    let expected = Attribute::new(AttributeScope::Vertex, colors.to_vec());
    assert_eq!(vectors.attributes()[&GeometryId(0)]["_HEAT"], expected);
}

#[test]
fn attributes_that_shaders_cannot_take_are_left_out_with_a_warning() {
    for (kind, components, problem) in
        [("VEC2", &[0.0; 6][..], "type VEC2"), ("SCALAR", &[0.0, f32::NAN, 0.0][..], "not finite")]
    {
        let loaded = read(&attributed(kind, components)).unwrap();
        assert_eq!(loaded.diagnostics.len(), 1, "{:?}", loaded.diagnostics);
        assert!(loaded.diagnostics[0].message.contains(problem), "{:?}", loaded.diagnostics);
        assert!(applied(&loaded).attributes().is_empty());
    }
    let mut short = attributed("SCALAR", &[1.0, 2.0, 4.0]);
    short["accessors"].as_array_mut().unwrap().last_mut().unwrap()["count"] = json!(2);
    let error = read(&short).unwrap_err().to_string();
    assert!(error.contains("2 elements for 3 positions"), "{error}");
}

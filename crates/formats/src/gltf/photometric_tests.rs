//! Tests of measured lights, projectors and lights by shaders, on documents made here.

use glam::{Mat3, Vec3};
use heliostat_scene::{LightKind, ShaderUse};
use serde_json::{Value, json};

use super::tests::{applied, data_uri, read};

const IES: &str = "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 2 1 1 2 0 0 0\n1 1 60\n0 90\n0\n100 50\n";

fn document(profiles: Value, nodes: Value) -> Value {
    let png = data_uri(&crate::image::encode_png(2, 1, &[255; 6]).unwrap());
    json!({
        "asset": {"version": "2.0"},
        "extensionsUsed": ["EXT_lights_ies"],
        "extensions": {"EXT_lights_ies": {"lights": profiles}},
        "images": [{"uri": png}],
        "nodes": nodes,
    })
}

#[test]
fn nodes_place_measured_lights() {
    let embedded = data_uri(IES.as_bytes());
    let turn = [0.0, std::f32::consts::FRAC_1_SQRT_2, 0.0, std::f32::consts::FRAC_1_SQRT_2];
    let loaded = read(&document(
        json!([{"uri": embedded}]),
        json!([
            {"name": "lamp", "translation": [1, 2, 3], "rotation": turn, "scale": [2, 2, 2],
             "extensions": {"EXT_lights_ies": {"light": 0, "multiplier": 3, "color": [1, 0.5, 0]}}},
            {"extensions": {"EXT_lights_ies": {"light": 0}}},
        ]),
    ))
    .unwrap();
    assert_eq!(loaded.diagnostics, []);
    let scene = applied(&loaded);
    let lights: Vec<_> = scene.lights().values().collect();
    let LightKind::Profile { position, world_from_light, scale, profile, .. } = &lights[0].kind else {
        panic!("{:?}", lights[0])
    };
    assert_eq!((lights[0].name.as_str(), *position), ("lamp", Vec3::new(1.0, 2.0, 3.0)));
    assert_eq!(*scale, Vec3::new(3.0, 1.5, 0.0));
    // A quarter turn about +Y takes the aim from −Z to −X.
    assert!((*world_from_light * Vec3::NEG_Z).distance(Vec3::NEG_X) < 1e-6);
    assert!((world_from_light.transpose() * *world_from_light).abs_diff_eq(Mat3::IDENTITY, 1e-5));
    assert_eq!(profile.at(0.0, 0.0), 100.0);
    let LightKind::Profile { profile: other, scale, .. } = &lights[1].kind else { panic!() };
    assert!(std::sync::Arc::ptr_eq(profile, other), "read once");
    assert_eq!(*scale, Vec3::ONE);
}

#[test]
fn broken_profiles_cost_their_lights_alone() {
    let lamp = |light: usize| json!({"extensions": {"EXT_lights_ies": {"light": light}}});
    let loaded = read(&document(
        json!([{"uri": "missing.ies"}, {"uri": data_uri(b"no lamp")}, {}]),
        json!([lamp(0), lamp(0), lamp(1), lamp(2)]),
    ))
    .unwrap();
    let messages: Vec<_> = loaded.diagnostics.iter().map(|d| d.message.as_str()).collect();
    assert_eq!(messages.len(), 3, "once per profile: {messages:?}");
    assert!(messages[0].contains("missing.ies") && messages[1].contains("TILT="), "{messages:?}");
    assert!(applied(&loaded).lights().is_empty());
}

#[test]
fn nodes_may_be_projectors() {
    let node = |projector: Value| json!({"extras": {"a": 1, "heliostat_projector": projector}});
    let loaded = read(&document(
        json!([]),
        json!([
            node(json!({"image": 0, "intensity": [1, 2, 3], "vertical_fov": 0.5})),
            node(json!({"image": 0, "colour": 3})),
            node(json!({"image": 0, "vertical_fov": 4})),
            {"extras": "text"},
        ]),
    ))
    .unwrap();
    let scene = applied(&loaded);
    assert_eq!((scene.lights().len(), loaded.diagnostics.len()), (1, 2), "{:?}", loaded.diagnostics);
    assert!(loaded.diagnostics[0].message.contains("colour"), "{:?}", loaded.diagnostics);
    let light = scene.lights().values().next().unwrap();
    let LightKind::Projector { intensity, vertical_fov, image, .. } = &light.kind else { panic!() };
    assert_eq!((*intensity, *vertical_fov, image.width), (Vec3::new(1.0, 2.0, 3.0), 0.5, 2));
}

#[test]
fn nodes_may_be_lights_by_shaders() {
    let node =
        |light: Value| json!({"rotation": [0, 1, 0, 0], "extras": {"heliostat_light": light, "b": []}});
    let parameters = json!({"open": 0.25, "tint": [1, 0.5, 0]});
    let loaded = read(&document(
        json!([]),
        json!([
            node(json!({"name": "blinds", "intensity": [1, 2, 3], "parameters": parameters})),
            node(json!({"intensity": [1, 2, 3]})),
            node(json!({"name": "blinds", "parameters": {"open": {"index": 0}}})),
            node(json!({"name": "blinds", "intensity": [-1, 2, 3]})),
        ]),
    ))
    .unwrap();
    let scene = applied(&loaded);
    assert_eq!((scene.lights().len(), loaded.diagnostics.len()), (1, 3), "{:?}", loaded.diagnostics);
    assert!(loaded.diagnostics[0].message.contains("name"), "{:?}", loaded.diagnostics);
    let light = scene.lights().values().next().unwrap();
    let LightKind::Shader { world_from_light, scale, shader, .. } = &light.kind else { panic!() };
    let expected = ShaderUse::named("blinds").with("open", 0.25).with("tint", Vec3::new(1.0, 0.5, 0.0));
    assert_eq!((*scale, &**shader), (Vec3::new(1.0, 2.0, 3.0), &expected));
    assert!((*world_from_light * Vec3::NEG_Z).distance(Vec3::Z) < 1e-6);
}

#[test]
fn a_node_may_be_a_projector_and_a_light() {
    let extras = json!({
        "heliostat_projector": {"image": 0, "intensity": [1, 2, 3], "vertical_fov": 0.5},
        "heliostat_light": {"name": "blinds"},
    });
    let nodes = json!([{ "extras": extras }, { "extras": "other" }, { "extras": {} }]);
    let loaded = read(&document(json!([]), nodes)).unwrap();
    assert_eq!(
        (applied(&loaded).lights().len(), loaded.diagnostics.len()),
        (2, 0),
        "{:?}",
        loaded.diagnostics
    );
}

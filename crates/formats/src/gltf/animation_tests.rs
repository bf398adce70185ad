//! Tests of animation: documents made here, whose states at any time are known in closed form.

use glam::{Affine3A, Quat, Vec3};
use heliostat_scene::{CameraId, Edit, GeometryId, InstanceId, LightId, LightKind, Scene, Target};
use serde_json::{Value, json};

use super::tests::{Data, TRIANGLE, applied, floats, meshes, read, triangle};
use super::*;
use crate::{Loaded, Severity};

/// A document that plays: the scene follows the timeline.
struct Played {
    loaded: Loaded,
    scene: Scene,
}

impl Played {
    fn new(document: &Value) -> Self {
        let loaded = read(document).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(loaded.diagnostics, []);
        let scene = applied(&loaded);
        Self { loaded, scene }
    }

    /// Moves to a time; returns what was sent.
    fn go(&mut self, time: f64) -> Vec<Edit> {
        let edits = self.loaded.timeline.edits_at(time);
        self.scene.apply(&edits).unwrap_or_else(|error| panic!("at {time}: {error}"));
        edits
    }

    fn play(&mut self, clip: usize) {
        assert!(self.loaded.timeline.play(clip));
    }

    /// `parent_from_object` of an instance.
    fn stand(&mut self, time: f64, instance: u32) -> Affine3A {
        self.go(time);
        self.scene.instances()[&InstanceId(instance)].parent_from_object
    }

    fn positions(&mut self, time: f64, mesh: usize) -> Vec<Vec3> {
        self.go(time);
        meshes(&self.scene)[mesh].positions.to_vec()
    }
}

#[track_caller]
fn close(found: Vec3, expected: Vec3) {
    assert!((found - expected).length() < 2e-5, "{found} instead of {expected}");
}

/// A channel for each `(node, path, output, interpolation)`, all with the same keys.
fn animation(input: usize, channels: &[(usize, &str, usize, &str)]) -> Value {
    let sampler = |&(.., output, interpolation): &(usize, &str, usize, &str)| json!({"input": input, "output": output, "interpolation": interpolation});
    let channel = |(number, &(node, path, ..)): (usize, &(usize, &str, usize, &str))| json!({"sampler": number, "target": {"node": node, "path": path}});
    json!({
        "samplers": channels.iter().map(sampler).collect::<Vec<_>>(),
        "channels": channels.iter().enumerate().map(channel).collect::<Vec<_>>(),
    })
}

/// Mesh 0: the triangle.
fn mesh(position: usize) -> Value {
    json!([{"primitives": [{"attributes": {"POSITION": position}}]}])
}

#[test]
fn nodes_move_turn_and_grow_as_their_keys_say() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let times = data.floats(&[0., 1., 3.], "SCALAR");
    let places = data.floats(&[0., 0., 0., 2., 0., 0., 2., 4., 0.], "VEC3");
    let turns = [0.0, 1.0, 2.5].map(|angle| Quat::from_rotation_y(angle).to_array()).concat();
    let turns = data.floats(&turns, "VEC4");
    let scales = data.floats(&[1., 1., 1., 2., 2., 2., 3., 3., 3.], "VEC3");
    let channels = [
        (0, "translation", places, "LINEAR"),
        (0, "rotation", turns, "LINEAR"),
        (0, "scale", scales, "STEP"),
    ];
    let mut document = data.finish(json!({
        "meshes": mesh(position),
        "nodes": [{"mesh": 0, "translation": [9, 9, 9]}],
        "animations": [animation(times, &channels)],
    }));
    document["animations"][0]["name"] = json!("dance");
    let mut played = Played::new(&document);
    // At rest until asked.
    assert_eq!(played.scene.bounds().unwrap().min, Vec3::splat(9.0));
    let clip = played.loaded.timeline.playing().unwrap();
    assert_eq!((clip.name.as_str(), clip.frame_rate), ("dance", None));
    assert_eq!(played.loaded.timeline.duration(), 3.0);
    for (time, place, angle, scale) in [
        (0.0, Vec3::ZERO, 0.0, 1.0),
        (0.5, Vec3::X, 0.5, 1.0),
        (1.0, Vec3::X * 2.0, 1.0, 2.0),
        (2.0, Vec3::new(2.0, 2.0, 0.0), 1.75, 2.0),
        (3.0, Vec3::new(2.0, 4.0, 0.0), 2.5, 3.0),
        (7.0, Vec3::new(2.0, 4.0, 0.0), 2.5, 3.0),
    ] {
        let stands = played.stand(time, 0);
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            let expected = place + Quat::from_rotation_y(angle) * axis * scale;
            close(stands.transform_point3(axis), expected);
        }
    }
    assert!(played.go(9.0).is_empty(), "it stays at the end");
}

#[test]
fn outputs_may_be_normalised_sparse_and_splines() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let times = data.floats(&[0., 2.], "SCALAR");
    // A half turn about z in normalised 16-bit integers, and the identity.
    let turn: Vec<u8> = [0i16, 0, 0, 32767, 0, 0, 32767, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let turn = data.add(&turn, 5122, "VEC4", 2);
    data.accessors[turn]["normalized"] = json!(true);
    // All zeros but for the value of the second key and its in-tangent.
    let indices = data.view(&[3, 0, 4, 0]);
    let values = data.view(&floats(&[3., 0., 0., 2., 0., 0.]));
    data.accessors.push(json!({
        "componentType": 5126, "type": "VEC3", "count": 6,
        "sparse": {"count": 2, "indices": {"bufferView": indices, "componentType": 5123}, "values": {"bufferView": values}},
    }));
    let places = data.accessors.len() - 1;
    let channels = [(0, "translation", places, "CUBICSPLINE"), (0, "rotation", turn, "LINEAR")];
    let mut played = Played::new(&data.finish(json!({
        "meshes": mesh(position), "nodes": [{"mesh": 0}], "animations": [animation(times, &channels)],
    })));
    // Hermite: x(s) = 2 (3s² − 2s³) + 2 · 3 (s³ − s²), the tangent scaled by the interval of two seconds.
    for i in 0..=8 {
        let s = i as f32 / 8.0;
        let x = 2.0 * (3.0 * s * s - 2.0 * s * s * s) + 6.0 * (s * s * s - s * s);
        let stands = played.stand(f64::from(s) * 2.0, 0);
        close(stands.translation.into(), Vec3::X * x);
        close(stands.transform_vector3(Vec3::X), Quat::from_rotation_z(s * std::f32::consts::PI) * Vec3::X);
    }
}

#[test]
fn clips_leave_what_others_move_at_rest() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let times = data.floats(&[0., 1.], "SCALAR");
    let up = data.floats(&[0., 0., 0., 0., 5., 0.], "VEC3");
    let nodes = json!([{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0]}]);
    let mut played = Played::new(&data.finish(json!({
        "meshes": mesh(position),
        "nodes": nodes,
        "animations": [
            animation(times, &[(0, "translation", up, "LINEAR")]),
            animation(times, &[(1, "translation", up, "LINEAR")]),
        ],
    })));
    let names: Vec<&str> = played.loaded.timeline.clips().iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(names, ["animation 0", "animation 1"]);
    let moves: Vec<_> = played.loaded.timeline.clips().iter().map(|clip| clip.motion.moves()).collect();
    assert_eq!(moves, [0, 1].map(|i| [Target::Instance(InstanceId(i))].into()));
    assert_eq!(played.loaded.timeline.targets().len(), 2);
    assert_eq!(played.stand(1.0, 0).translation.y, 5.0);
    assert_eq!(played.stand(1.0, 1).translation.x, 3.0);
    played.play(1);
    assert_eq!(played.stand(1.0, 0).translation.y, 0.0);
    assert_eq!(played.stand(1.0, 1).translation.to_array(), [0.0, 5.0, 0.0]);
}

#[test]
fn a_moving_group_is_one_edit_and_what_is_in_it_none() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let times = data.floats(&[0., 1.], "SCALAR");
    let up = data.floats(&[0., 0., 0., 0., 5., 0.], "VEC3");
    // 0 moves; 1 is between; 2 and 3 are two things below; 4 stands beside and moves by itself in the group.
    let nodes = json!([
        {"children": [1]},
        {"children": [2, 3, 4], "translation": [1, 0, 0]},
        {"mesh": 0}, {"mesh": 0, "translation": [2, 0, 0]},
        {"mesh": 0, "translation": [7, 0, 0]},
        {"mesh": 0, "translation": [0, 0, -9]},
    ]);
    let channels = [(0, "translation", up, "LINEAR"), (4, "translation", up, "STEP")];
    let mut played = Played::new(&data.finish(json!({
        "meshes": mesh(position), "nodes": nodes, "animations": [animation(times, &channels)],
    })));
    played.go(0.0);
    let edits = played.go(0.5);
    let [Edit::MoveInstance(group, to)] = edits[..] else { panic!("{edits:?}") };
    assert_eq!(to.translation.to_array(), [1.0, 2.5, 0.0]);
    assert!(played.scene.instances()[&group].parent.is_none());
    assert_eq!(played.go(1.0).len(), 2, "the group, and node 4 in it");
    assert_eq!(played.scene.bounds().unwrap().max.y, 11.0);
}

/// Two joints, one above the other, of which the upper bends about z; vertices hang on the lower one, on both by half,
/// and on the upper one. `extra` goes to the primitive.
fn two_joints(data: &mut Data, extra: &Value) -> Value {
    let position = data.floats(&[0., 0., 0., 0., 1., 0., 0., 2., 0.], "VEC3");
    let normal = data.floats(&[1., 0., 0., 1., 0., 0., 1., 0., 0.], "VEC3");
    let tangent = data.floats(&[0., 1., 0., -1., 0., 1., 0., -1., 0., 1., 0., -1.], "VEC4");
    let joints = data.add(&[0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0], 5121, "VEC4", 3);
    let weights = data.add(&[255, 0, 0, 0, 128, 128, 0, 0, 255, 0, 0, 0], 5121, "VEC4", 3);
    data.accessors[weights]["normalized"] = json!(true);
    let mut primitive = json!({"attributes": {
        "POSITION": position, "NORMAL": normal, "TANGENT": tangent, "JOINTS_0": joints, "WEIGHTS_0": weights,
    }});
    primitive.as_object_mut().unwrap().extend(extra.as_object().unwrap().clone());
    json!([{"primitives": [primitive]}])
}

/// Inverse bind matrices of joints that were bound at heights 0 and 1.
fn bind(data: &mut Data) -> usize {
    let at = |y: f32| Affine3A::from_translation(Vec3::new(0.0, -y, 0.0));
    let matrices: Vec<f32> =
        [0.0, 1.0].iter().flat_map(|&y| glam::Mat4::from(at(y)).to_cols_array()).collect();
    data.floats(&matrices, "MAT4")
}

#[test]
fn skins_bend_with_their_joints() {
    let mut data = Data::default();
    let meshes_of = two_joints(&mut data, &json!({}));
    let bind = bind(&mut data);
    let times = data.floats(&[0., 1.], "SCALAR");
    let turn = |angle: f32| Quat::from_rotation_z(angle);
    let turns = data.floats(&[turn(0.0).to_array(), turn(1.5).to_array()].concat(), "VEC4");
    let mut played = Played::new(&data.finish(json!({
        "meshes": meshes_of,
        "skins": [{"joints": [1, 2], "inverseBindMatrices": bind}],
        "nodes": [
            {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
            {"children": [2], "translation": [5, 0, 0]},
            {"translation": [0, 1, 0]},
        ],
        "animations": [animation(times, &[(2, "rotation", turns, "LINEAR")])],
    })));
    let rest = meshes(&played.scene)[0].clone();
    assert_eq!(*rest.positions, [Vec3::X * 5.0, Vec3::new(5.0, 1.0, 0.0), Vec3::new(5.0, 2.0, 0.0)]);
    for time in [0.0, 0.25, 0.5, 1.0] {
        let turn = turn(1.5 * time as f32);
        let edits = played.go(time);
        assert!(matches!(edits[..], [Edit::Geometry(GeometryId(0), _)]), "{edits:?}");
        let mesh = &meshes(&played.scene)[0];
        let pivot = Vec3::new(5.0, 1.0, 0.0);
        close(mesh.positions[0], Vec3::X * 5.0);
        // On the pivot both joints agree.
        close(mesh.positions[1], pivot);
        close(mesh.positions[2], pivot + turn * Vec3::Y);
        close(mesh.normals[0], Vec3::X);
        close(mesh.normals[2], turn * Vec3::X);
        close(mesh.tangents[2].truncate(), turn * Vec3::Y);
        assert_eq!(mesh.tangents[2].w, -1.0);
        // The mean of two rotations about one axis turns normals by half the angle.
        close(mesh.normals[1], Quat::from_rotation_z(0.75 * time as f32) * Vec3::X);
        assert!(Arc::ptr_eq(&mesh.indices, &rest.indices), "the same triangles: refitted, not rebuilt");
    }
    let before = meshes(&played.scene)[0].clone();
    assert!(played.go(1.0).is_empty() && Arc::ptr_eq(&before, &meshes(&played.scene)[0]));
}

#[test]
fn copies_of_a_mesh_bend_by_their_own_skins_and_those_at_rest_rest() {
    let mut data = Data::default();
    let meshes_of = two_joints(&mut data, &json!({}));
    let bind = bind(&mut data);
    let times = data.floats(&[0., 1.], "SCALAR");
    let up = data.floats(&[0., 0., 0., 0., 5., 0.], "VEC3");
    let far = data.floats(&[0., 0., 0., 0., 0., 7.], "VEC3");
    let skin = |joints: [usize; 2]| json!({"joints": joints, "inverseBindMatrices": bind});
    let mut played = Played::new(&data.finish(json!({
        "meshes": meshes_of,
        "skins": [skin([3, 4]), skin([5, 6]), skin([7, 7])],
        "nodes": [
            {"mesh": 0, "skin": 0}, {"mesh": 0, "skin": 1}, {"mesh": 0, "skin": 2},
            {}, {"translation": [0, 1, 0]}, {}, {"translation": [0, 1, 0]}, {},
        ],
        "animations": [
            animation(times, &[(3, "translation", up, "LINEAR")]),
            animation(times, &[(5, "translation", far, "LINEAR")]),
        ],
    })));
    assert_eq!(played.scene.geometries().len(), 3);
    let moves: Vec<_> = played.loaded.timeline.clips().iter().map(|clip| clip.motion.moves()).collect();
    assert_eq!(moves, [0, 1].map(|i| [Target::Geometry(GeometryId(i))].into()));
    assert_eq!(played.go(0.0).len(), 2, "the third copy never moves");
    assert!(matches!(played.go(0.5)[..], [Edit::Geometry(GeometryId(0), _)]));
    close(meshes(&played.scene)[0].positions[0], Vec3::Y * 2.5);
    played.play(1);
    let edits = played.go(0.5);
    assert_eq!(edits.len(), 2, "one moves, the other goes back to rest");
    close(meshes(&played.scene)[0].positions[0], Vec3::ZERO);
    close(meshes(&played.scene)[1].positions[0], Vec3::Z * 3.5);
    close(meshes(&played.scene)[1].positions[2], Vec3::new(0.0, 2.0, 0.0));
}

#[test]
fn morph_targets_follow_their_weights_and_come_before_skins() {
    let mut data = Data::default();
    let sideways = data.floats(&[1., 0., 0., 1., 0., 0., 1., 0., 0.], "VEC3");
    let forward = data.floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1.], "VEC3");
    let targets =
        json!([{"POSITION": sideways}, {"POSITION": forward, "NORMAL": forward, "TANGENT": sideways}]);
    let mut definition = two_joints(&mut data, &json!({"targets": targets}));
    definition[0]["weights"] = json!([0.5]);
    let bind = bind(&mut data);
    let times = data.floats(&[0., 2.], "SCALAR");
    let weights = data.floats(&[0., 0., 4., 2.], "SCALAR");
    let nodes = json!([
        {"mesh": 0, "skin": 0},
        {"children": [2], "rotation": Quat::from_rotation_z(std::f32::consts::FRAC_PI_2).to_array()},
        {"translation": [0, 1, 0]},
        // The same mesh, as it is; and moved by the same weights but no skin.
        {"mesh": 0}, {"mesh": 0},
    ]);
    let channels = [(0, "weights", weights, "LINEAR"), (4, "weights", weights, "STEP")];
    let mut played = Played::new(&data.finish(json!({
        "meshes": definition,
        "skins": [{"joints": [1, 2], "inverseBindMatrices": bind}],
        "nodes": nodes,
        "animations": [animation(times, &channels)],
    })));
    // Morphed along x by 0.5 at rest, then turned by the joint: x becomes y.
    close(meshes(&played.scene)[0].positions[0], Vec3::Y * 0.5);
    close(meshes(&played.scene)[1].positions[0], Vec3::X * 0.5);
    for (time, w) in [(0.0, [0.0, 0.0]), (1.0, [2.0, 1.0]), (1.5, [3.0, 1.5]), (2.0, [4.0, 2.0])] {
        close(played.positions(time, 0)[0], Vec3::new(0.0, w[0], w[1]));
        close(played.positions(time, 1)[0], Vec3::X * 0.5);
        close(meshes(&played.scene)[0].normals[0], Vec3::new(0.0, 1.0, w[1]).normalize());
    }
    close(played.positions(1.9, 2)[0], Vec3::ZERO);
    close(played.positions(2.0, 2)[0], Vec3::new(4.0, 0.0, 2.0));
    assert_eq!(meshes(&played.scene)[2].tangents[0].to_array(), [2.0, 1.0, 0.0, -1.0]);
}

#[test]
fn lights_and_cameras_follow_their_nodes_and_things_appear() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let times = data.floats(&[0., 1., 2.], "SCALAR");
    let up = data.floats(&[0., 0., 0., 0., 5., 0., 0., 10., 0.], "VEC3");
    let shown = data.add(&[0, 1, 0], 5121, "SCALAR", 3);
    let hidden = json!({"KHR_node_visibility": {"visible": false}});
    let pointer = |pointer: &str| json!({"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}});
    let mut moves = animation(times, &[(0, "translation", up, "LINEAR")]);
    moves["samplers"].as_array_mut().unwrap().push(json!({"input": times, "output": shown}));
    let visible = "/nodes/3/extensions/KHR_node_visibility/visible";
    moves["channels"].as_array_mut().unwrap().push(json!({"sampler": 1, "target": pointer(visible)}));
    let mut played = Played::new(&data.finish(json!({
        "extensionsUsed": ["KHR_lights_punctual", "KHR_node_visibility", "KHR_animation_pointer"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 3}]}},
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}],
        "meshes": mesh(position),
        "nodes": [
            {"children": [1, 2]},
            {"camera": 0, "translation": [1, 0, 0]},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"mesh": 0, "extensions": hidden, "children": [4, 5]},
            {"mesh": 0, "translation": [0, 0, 1]},
            {"extensions": {"KHR_lights_punctual": {"light": 0}}},
            {"mesh": 0, "translation": [2, 0, 0], "extensions": hidden},
        ],
        "animations": [moves],
    })));
    // Everything that is hidden is so at rest, whatever is below it; the second hidden node never appears.
    let visible =
        |scene: &Scene| scene.instances().values().filter(|i| i.parent.is_none() && i.visible).count();
    let power = |scene: &Scene, light: u32| match scene.lights()[&LightId(light)].kind {
        LightKind::Point { position, intensity, .. } => (position.y, intensity.x),
        ref other => panic!("{other:?}"),
    };
    assert_eq!((visible(&played.scene), power(&played.scene, 1)), (0, (0.0, 0.0)));
    played.go(1.5);
    assert_eq!((visible(&played.scene), power(&played.scene, 1)), (1, (0.0, 3.0)));
    assert_eq!(power(&played.scene, 0), (7.5, 3.0));
    let eye = played.scene.cameras()[&CameraId(0)].world_from_camera.translation;
    assert_eq!(eye.to_array(), [1.0, 7.5, 0.0]);
    played.go(2.0);
    assert_eq!((visible(&played.scene), power(&played.scene, 1)), (0, (0.0, 0.0)));
    let kinds = played.loaded.timeline.targets();
    assert_eq!(kinds.len(), 4, "{kinds:?}");
}

#[test]
fn channels_that_cannot_be_played_are_left_out_with_a_warning() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let times = data.floats(&[0., 1.], "SCALAR");
    let up = data.floats(&[0., 0., 0., 0., 5., 0.], "VEC3");
    let backwards = data.floats(&[1., 0.], "SCALAR");
    let short = data.floats(&[0., 0., 0.], "VEC3");
    let bad = [
        (json!({"sampler": 0, "target": {"path": "translation"}}), "no target node"),
        (json!({"sampler": 0, "target": {"node": 0, "path": "colour"}}), "the path `colour` is unknown"),
        (json!({"target": {"node": 0, "path": "scale"}}), "no sampler"),
        (json!({"sampler": 0, "target": {"node": 0, "path": "rotation"}}), "VEC3 instead of VEC4"),
        (json!({"sampler": 0, "target": {"node": 0, "path": "weights"}}), "VEC3 instead of SCALAR"),
        (json!({"sampler": 5, "target": {"node": 0, "path": "weights"}}), "no mesh with morph targets"),
        (json!({"sampler": 1, "target": {"node": 0, "path": "scale"}}), "times"),
        (json!({"sampler": 2, "target": {"node": 0, "path": "scale"}}), "3 numbers for 2 keys of 3"),
        (json!({"sampler": 3, "target": {"node": 0, "path": "scale"}}), "`BOUNCE` is unknown"),
        (json!({"sampler": 4, "target": {"node": 0, "path": "scale"}}), "no input or no output"),
        (json!({"sampler": 0, "target": {"node": 1, "path": "scale"}}), "nodes[1] has a `matrix`"),
        (
            json!({"sampler": 0, "target": {"extensions": {"KHR_animation_pointer": {"pointer": "/materials/0/x"}}}}),
            "`/materials/0/x` cannot",
        ),
    ];
    let good = json!({"sampler": 0, "target": {"node": 0, "path": "translation"}});
    let mut channels: Vec<Value> = bad.iter().map(|(channel, _)| channel.clone()).collect();
    channels.extend([good.clone(), good]);
    let samplers = json!([
        {"input": times, "output": up}, {"input": backwards, "output": up}, {"input": times, "output": short},
        {"input": times, "output": up, "interpolation": "BOUNCE"}, {"input": times},
        {"input": times, "output": times},
    ]);
    let matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
    let document = data.finish(json!({
        "meshes": mesh(position),
        "nodes": [{"mesh": 0}, {"matrix": matrix}],
        "animations": [{"channels": channels, "samplers": samplers}, {"channels": [bad[0].0]}],
    }));
    let mut loaded = read(&document).unwrap();
    let messages: Vec<String> = loaded.diagnostics.iter().map(ToString::to_string).collect();
    assert_eq!(messages.len(), bad.len() + 1 + 2, "{messages:#?}");
    for (number, (_, problem)) in bad.iter().enumerate() {
        assert!(
            messages[number].contains(&format!("animations[0].channels[{number}]: ")),
            "{}",
            messages[number]
        );
        assert!(messages[number].contains(problem), "{}: {problem}", messages[number]);
    }
    assert!(messages[bad.len()].contains("an earlier channel has the same target"));
    assert!(messages.last().unwrap().contains("animations[1]: the animation has no channel"));
    assert!(loaded.diagnostics.iter().all(|d| d.severity == Severity::Warning));
    assert_eq!(loaded.timeline.clips().len(), 1);
    assert_eq!(loaded.timeline.edits_at(1.0).len(), 1);
    // What points nowhere is refused as it is everywhere.
    let mut lost = document.clone();
    lost["animations"][0]["samplers"][0]["output"] = json!(99);
    assert!(read(&lost).unwrap_err().to_string().contains("accessors[99]"));
    let mut lost = document;
    lost["animations"][0]["channels"][12]["target"]["node"] = json!(7);
    assert!(
        read(&lost)
            .unwrap_err()
            .to_string()
            .contains("animations[0].channels[12].target: it refers to nodes[7]")
    );
}

#[test]
fn what_gets_out_of_hand_stays_at_rest() {
    let mut data = Data::default();
    let position = data.floats(&TRIANGLE, "VEC3");
    let times = data.floats(&[0., 1.], "SCALAR");
    let huge = data.floats(&[1., 1., 1., 3e38, 3e38, 3e38], "VEC3");
    let channels = [(0, "scale", huge, "STEP"), (1, "scale", huge, "STEP")];
    let mut played = Played::new(&data.finish(json!({
        "meshes": mesh(position),
        "nodes": [{"children": [1]}, {"mesh": 0}],
        "animations": [animation(times, &channels)],
    })));
    let stands = played.stand(1.0, 0);
    assert_eq!(stands.matrix3.x_axis.x, 3e38, "the first factor alone is still finite");
}

#[test]
fn files_without_animation_have_no_timeline() {
    assert!(read(&triangle(json!({}))).unwrap().timeline.is_empty());
}

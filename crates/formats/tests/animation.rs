//! Animated real files against an evaluation written down straight from the specification, in double precision. The
//! files lie where `HELIOSTAT_SCENES` points; without it these tests pass and say what did not run.

use std::io::Write;
use std::path::{Path, PathBuf};

use base64::Engine;
use glam::{DMat4, DQuat, DVec3, Vec3};
use heliostat_formats::{Limits, load};
use heliostat_scene::Scene;
use serde_json::Value;

/// The folder of real scenes, or a line on stderr.
fn scenes(test: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("HELIOSTAT_SCENES").map(PathBuf::from);
    if folder.is_none() {
        _ = writeln!(std::io::stderr(), "{test} did not run: HELIOSTAT_SCENES is not set");
    }
    folder
}

/// A document and its only buffer.
struct Document {
    json: Value,
    buffer: Vec<u8>,
}

impl Document {
    fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap();
        if bytes.starts_with(b"glTF") {
            let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
            let json = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
            return Self { json, buffer: bytes[28 + length..].to_vec() };
        }
        let json: Value = serde_json::from_slice(&bytes).unwrap();
        assert!(json["buffers"].as_array().unwrap().iter().all(|b| b["uri"].is_string()));
        let mut buffer = Vec::new();
        let uri = json["buffers"][0]["uri"].as_str().unwrap();
        match uri.split_once("base64,") {
            Some((_, text)) => buffer.extend(base64::engine::general_purpose::STANDARD.decode(text).unwrap()),
            None => buffer.extend(std::fs::read(path.with_file_name(uri)).unwrap()),
        }
        Self { json, buffer }
    }

    /// The numbers of a plain accessor in buffer 0, or in an embedded buffer of its own.
    fn numbers(&self, accessor: &Value) -> Vec<f64> {
        let accessor = &self.json["accessors"][accessor.as_u64().unwrap() as usize];
        let number = |value: &Value| value.as_u64().unwrap_or(0) as usize;
        let view = &self.json["bufferViews"][number(&accessor["bufferView"])];
        let own;
        let buffer = match number(&view["buffer"]) {
            0 => &self.buffer,
            other => {
                let uri = self.json["buffers"][other]["uri"].as_str().unwrap();
                let text = uri.split_once("base64,").unwrap().1;
                own = base64::engine::general_purpose::STANDARD.decode(text).unwrap();
                &own
            }
        };
        let width = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            other => panic!("{other}"),
        };
        let size = match number(&accessor["componentType"]) {
            5121 => 1,
            5123 => 2,
            _ => 4,
        };
        let start = number(&view["byteOffset"]) + number(&accessor["byteOffset"]);
        let stride = view["byteStride"].as_u64().map_or(width * size, |stride| stride as usize);
        let component = |element: usize, i: usize| {
            let bytes = &buffer[start + element * stride + i * size..][..size];
            match size {
                1 => f64::from(bytes[0]),
                2 => f64::from(u16::from_le_bytes([bytes[0], bytes[1]])),
                _ => f64::from(f32::from_le_bytes(bytes.try_into().unwrap())),
            }
        };
        let mut values: Vec<f64> = (0..number(&accessor["count"]))
            .flat_map(|element| (0..width).map(move |i| (element, i)))
            .map(|(element, i)| component(element, i))
            .collect();
        if accessor["sparse"].is_object() {
            panic!("sparse accessors are not read here");
        }
        values.truncate(number(&accessor["count"]) * width);
        values
    }

    fn array(value: &Value) -> Vec<f64> {
        value.as_array().map_or(Vec::new(), |v| v.iter().map(|n| n.as_f64().unwrap()).collect())
    }

    /// The value of a node's property at a time of an animation, linear between keys.
    fn property(&self, animation: usize, node: usize, path: &str, time: f64) -> Vec<f64> {
        let animation = &self.json["animations"][animation];
        let channel = animation["channels"]
            .as_array()
            .unwrap()
            .iter()
            .find(|channel| channel["target"]["node"] == node && channel["target"]["path"] == path);
        let Some(channel) = channel else { return Self::array(&self.json["nodes"][node][path]) };
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        assert!(sampler["interpolation"].is_null() || sampler["interpolation"] == "LINEAR");
        let (times, values) = (self.numbers(&sampler["input"]), self.numbers(&sampler["output"]));
        let width = values.len() / times.len();
        let key = |k: usize| values[k * width..(k + 1) * width].to_vec();
        let Some(next) = times.iter().position(|&t| t > time) else { return key(times.len() - 1) };
        if next == 0 {
            return key(0);
        }
        let s = (time - times[next - 1]) / (times[next] - times[next - 1]);
        let (a, b) = (key(next - 1), key(next));
        if path == "rotation" {
            let [a, b] = [a, b].map(|q| DQuat::from_slice(&q).normalize());
            return a.slerp(b, s).to_array().to_vec();
        }
        a.iter().zip(&b).map(|(a, b)| a + s * (b - a)).collect()
    }

    /// `world_from_node`, by multiplying down from the root.
    fn world(&self, animation: usize, node: usize, time: f64) -> DMat4 {
        let parent = self.json["nodes"]
            .as_array()
            .unwrap()
            .iter()
            .position(|n| n["children"].as_array().is_some_and(|c| c.iter().any(|child| *child == node)));
        let above = parent.map_or(DMat4::IDENTITY, |parent| self.world(animation, parent, time));
        let matrix = Self::array(&self.json["nodes"][node]["matrix"]);
        if !matrix.is_empty() {
            return above * DMat4::from_cols_slice(&matrix);
        }
        let part = |path: &str, default: &[f64]| {
            let found = self.property(animation, node, path, time);
            if found.is_empty() { default.to_vec() } else { found }
        };
        let translation = DVec3::from_slice(&part("translation", &[0.0; 3]));
        let rotation = DQuat::from_slice(&part("rotation", &[0.0, 0.0, 0.0, 1.0])).normalize();
        let scale = DVec3::from_slice(&part("scale", &[1.0; 3]));
        above * DMat4::from_scale_rotation_translation(scale, rotation, translation)
    }

    /// Positions of a node's primitive: morphed, then skinned.
    fn positions(&self, animation: usize, node: usize, primitive: usize, time: f64) -> Vec<DVec3> {
        let definition = &self.json["nodes"][node];
        let mesh = &self.json["meshes"][definition["mesh"].as_u64().unwrap() as usize];
        let primitive = &mesh["primitives"][primitive];
        let vectors = |accessor: &Value| -> Vec<DVec3> {
            self.numbers(accessor).chunks_exact(3).map(DVec3::from_slice).collect()
        };
        let mut positions = vectors(&primitive["attributes"]["POSITION"]);
        let mut weights = self.property(animation, node, "weights", time);
        if weights.is_empty() {
            weights = Self::array(&mesh["weights"]);
        }
        for (target, weight) in primitive["targets"].as_array().unwrap_or(&Vec::new()).iter().zip(weights) {
            for (position, delta) in positions.iter_mut().zip(vectors(&target["POSITION"])) {
                *position += weight * delta;
            }
        }
        let Some(skin) = definition["skin"].as_u64() else { return positions };
        let skin = &self.json["skins"][skin as usize];
        let bind = self.numbers(&skin["inverseBindMatrices"]);
        let joints: Vec<DMat4> = Self::array(&skin["joints"])
            .iter()
            .zip(bind.chunks_exact(16))
            .map(|(&joint, bind)| self.world(animation, joint as usize, time) * DMat4::from_cols_slice(bind))
            .collect();
        let numbers = self.numbers(&primitive["attributes"]["JOINTS_0"]);
        let weights = self.numbers(&primitive["attributes"]["WEIGHTS_0"]);
        let bent = positions.iter().zip(numbers.chunks_exact(4).zip(weights.chunks_exact(4)));
        bent.map(|(&position, (numbers, weights))| {
            let sum: f64 = weights.iter().sum();
            let moved = numbers
                .iter()
                .zip(weights)
                .map(|(&joint, weight)| *weight / sum * joints[joint as usize].transform_point3(position));
            moved.sum()
        })
        .collect()
    }
}

#[test]
fn real_files_move_as_the_specification_says() {
    let Some(folder) = scenes("real_files_move_as_the_specification_says") else { return };
    for (file, clips) in [
        ("CesiumMan/CesiumMan.glb", &["animation 0"][..]),
        ("Fox/Fox.glb", &["Survey", "Walk", "Run"]),
        ("SimpleSkin/SimpleSkin.gltf", &["animation 0"]),
        ("MorphStressTest/MorphStressTest.gltf", &["Individuals", "Pulse", "TheWave"]),
        ("AnimatedMorphCube/AnimatedMorphCube.gltf", &["Square"]),
    ] {
        let path = folder.join("gltf").join(file);
        let document = Document::read(&path);
        let mut loaded = load(&path, &Limits::default()).unwrap_or_else(|error| panic!("{error}"));
        let names: Vec<_> = loaded.timeline.clips().iter().map(|clip| clip.name.clone()).collect();
        assert_eq!(names, clips, "{file}");
        let mut scene = Scene::default();
        scene.apply(&loaded.edits).unwrap();
        let points =
            || scene.geometries().values().flat_map(|geometry| geometry.as_mesh().unwrap().positions.iter());
        let size = points().fold(0.0f32, |size, p| size.max(p.length()));
        let node =
            document.json["nodes"].as_array().unwrap().iter().position(|n| n["mesh"].is_u64()).unwrap();
        for (clip, name) in clips.iter().enumerate() {
            loaded.timeline.play(clip);
            let duration = loaded.timeline.duration();
            assert!(duration > 0.0, "{file}: {duration}");
            let mut moved = 0.0f32;
            for step in 0..=7 {
                let time = duration * f64::from(step) / 7.0;
                let edits = loaded.timeline.edits_at(time);
                let before = scene.geometries().clone();
                scene.apply(&edits).unwrap();
                for (primitive, (id, geometry)) in scene.geometries().iter().enumerate() {
                    let mesh = geometry.as_mesh().unwrap();
                    let expected = document.positions(clip, node, primitive, time);
                    assert_eq!(mesh.positions.len(), expected.len());
                    let worst = mesh.positions.iter().zip(&expected);
                    let worst = worst.map(|(a, b)| (*a - b.as_vec3()).length()).fold(0.0, f32::max);
                    // Single precision through a dozen joints of a figure of this size.
                    let tolerance = 2e-5 * size;
                    assert!(worst < tolerance, "{file}, {name}, at {time}: off by {worst}");
                    let old = before[id].as_mesh().unwrap();
                    let far = |(a, b): (&Vec3, &Vec3)| (*a - *b).length();
                    moved = mesh.positions.iter().zip(old.positions.iter()).map(far).fold(moved, f32::max);
                }
            }
            assert!(moved > 0.02 * size, "{file}, {name}: moved by {moved}");
        }
    }
}

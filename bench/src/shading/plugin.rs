//! A plug-in in C against the built-in shader of the same formula.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use heliostat::engine::LaneMode;
use heliostat::kernel::glam::{Affine3A, Vec3};
use heliostat::scene::{
    Camera, Edit, FrameRequest, Light, LightKind, Material, Mesh, SceneBuilder, ShaderRef, ShaderUse,
};
use serde_json::{Value, json};

use super::{Arguments, Setup, measure, ms, table, value};
use crate::result;

/// The shader in both.
const NAME: &str = "checker";

pub(super) fn run(arguments: &Arguments) -> Result<Option<Value>, String> {
    let (Some(baseline), Some(native)) = (compiled("baseline")?, compiled("native")?) else {
        return Ok(None);
    };
    let files = [baseline.clone(), native.clone()];
    let plugin = |file| Some(ShaderRef::Plugin { file, shader: NAME.into() });
    let built_in = || Some(ShaderRef::Named(NAME.into()));
    let packets = LaneMode::default();
    let kinds = [
        ("no shader", None, packets),
        ("built in", built_in(), packets),
        ("plug-in in C", plugin(baseline), packets),
        ("for this machine", plugin(native), packets),
        ("built in, one by one", built_in(), LaneMode::Single),
    ];
    let mut names: Vec<&str> = kinds.iter().map(|(name, ..)| *name).collect();
    let setup = |(_, shader, lanes)| Setup::new(&edits(shader), lanes, request(arguments.size));
    let mut setups = kinds.into_iter().map(setup).collect::<Result<Vec<_>, _>>()?;
    let times = measure(&mut setups, arguments.runs)?;
    for file in files {
        std::fs::remove_file(&file).map_err(|error| format!("cannot remove {}: {error}", file.display()))?;
    }
    let overhead = |which: usize| times[which].milliseconds / times[1].milliseconds - 1.0;
    let overheads = [overhead(2), overhead(3)];
    let [baseline, native] = overheads.map(|overhead| format!("{:+.1} %", 100.0 * overhead));
    let mut row: Vec<String> = times.iter().map(|&time| ms(time)).collect();
    row.push(format!("{baseline}, {native}"));
    names.push("plug-ins over built in");
    table("A floor of checkers, primary rays: milliseconds", &names, &[row]);
    let all: Vec<Value> = names.iter().zip(times).map(|(name, time)| value(name, time)).collect();
    Ok(Some(json!({ "overhead": overheads[0], "native_overhead": overheads[1], "times": all })))
}

/// The example in C as a library, for all machines of this kind (`baseline`) or for this one (`native`); `None`, with a note,
/// if the machine has no compiler.
fn compiled(target: &str) -> Result<Option<PathBuf>, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let name = format!("heliostat-bench-{}-{NAME}-{target}.so", std::process::id());
    let library = std::env::temp_dir().join(name);
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    let options = ["-std=c11", "-O3", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off"];
    let mut command = Command::new(&compiler);
    command.current_dir(root).args(options).args(["-fPIC", "-shared", "-Iinclude"]);
    if target == "native" {
        command.arg("-march=native");
    }
    command.arg("examples/shaders/c/checker.c").arg("-o").arg(&library).arg("-lm");
    match command.output() {
        Ok(output) if output.status.success() => Ok(Some(library)),
        Ok(output) => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        Err(error) => {
            result(&format!("`{compiler}` does not run ({error}): the plug-in was not measured"));
            Ok(None)
        }
    }
}

fn request(size: u32) -> FrameRequest {
    let camera = Camera::look_at("", Vec3::new(0.0, 1.5, 4.0), Vec3::ZERO, Vec3::Y, 0.7);
    FrameRequest { renderer: "cast".into(), samples: 1, ..FrameRequest::new(camera, size, size) }
}

/// A large floor with a shader, under one light.
fn edits(shader: Option<ShaderRef>) -> Vec<Edit> {
    let mut scene = SceneBuilder::new();
    let shader = shader.map(|shader| Arc::new(ShaderUse { shader, parameters: Default::default() }));
    let floor = scene.material(Material { shader, ..Material::diffuse("floor", Vec3::splat(0.5)) });
    let mesh = scene.mesh(Mesh::quad(Vec3::new(-50.0, 0.0, 50.0), Vec3::X * 100.0, Vec3::Z * -100.0));
    let object = scene.object("floor", [(mesh, floor)]);
    scene.instance(object, Affine3A::IDENTITY);
    scene.light(Light {
        name: "lamp".into(),
        kind: LightKind::Point {
            position: Vec3::Y * 3.0,
            intensity: Vec3::splat(20.0),
            range: f32::INFINITY,
        },
    });
    scene.finish()
}

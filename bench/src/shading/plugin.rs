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
    let Some(file) = compiled()? else { return Ok(None) };
    let plugin = ShaderRef::Plugin { file, shader: NAME.into() };
    let shaders = [None, Some(ShaderRef::Named(NAME.into())), Some(plugin)];
    let setup = |(shader, lanes)| Setup::new(&edits(shader), lanes, request(arguments.size));
    let [none, built_in, plugin] = shaders;
    let packets = LaneMode::default();
    let kinds =
        [(none, packets), (built_in.clone(), packets), (plugin, packets), (built_in, LaneMode::Single)];
    let mut setups = kinds.into_iter().map(setup).collect::<Result<Vec<_>, _>>()?;
    let times = measure(&mut setups, arguments.runs)?;
    let names = ["no shader", "built in", "plug-in in C", "built in, one by one"];
    let row: Vec<String> = times.iter().map(|&time| ms(time)).collect();
    let overhead = times[2].milliseconds / times[1].milliseconds - 1.0;
    let last = format!("{:+.1} %", 100.0 * overhead);
    let columns = [&names[..], &["plug-in over built in"]].concat();
    table("A floor of checkers, primary rays: milliseconds", &columns, &[[row, vec![last]].concat()]);
    let all: Vec<Value> = names.iter().zip(times).map(|(name, time)| value(name, time)).collect();
    Ok(Some(json!({ "overhead": overhead, "times": all })))
}

/// The example in C as a library; `None`, with a note, if the machine has no compiler.
fn compiled() -> Result<Option<PathBuf>, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let library = std::env::temp_dir().join(format!("heliostat-bench-{}-{NAME}.so", std::process::id()));
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    let options = ["-std=c11", "-O3", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off"];
    let mut command = Command::new(&compiler);
    command.current_dir(root).args(options).args(["-fPIC", "-shared", "-Iinclude"]);
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

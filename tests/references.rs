//! The path tracer against pictures by an independent renderer, through the command line.
//!
//! They lie beside the real scenes (`HELIOSTAT_SCENES`/../references); without them these tests say that they did not
//! run. Samples are fewer than a full comparison takes (`docs/testing.md` has its commands), so the tolerances are too.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Relative tolerance for the mean of each channel. The references themselves stand for the rest: the office's is made
/// from another triangulation of its concave polygons, which alone moves the means by 0.2 %.
const MEAN_TOLERANCE: f64 = 0.005;

fn folders() -> Option<(PathBuf, PathBuf)> {
    let scenes = PathBuf::from(std::env::var_os("HELIOSTAT_SCENES")?);
    // Tests run in the package's folder; the variable may be relative to it.
    let references = scenes.join("../references");
    references.is_dir().then_some((scenes, references))
}

/// Said past the test harness, which keeps what passing tests print to itself.
fn skipped(name: &str) {
    let reason = "HELIOSTAT_SCENES is not set, or has no `references` beside it";
    _ = writeln!(std::io::stderr(), "{name} did not run: {reason}");
}

fn heliostat(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_heliostat")).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Renders what the reference's `.json` describes and compares.
fn check(reference: &str, scene: &str, samples: u32, max_relmse: f64) {
    let Some((scenes, references)) = folders() else { return skipped(reference) };
    let read = |path: &Path| std::fs::read_to_string(path).unwrap();
    let about: Value = serde_json::from_str(&read(&references.join(format!("{reference}.json")))).unwrap();
    let list = |key: &str| {
        let numbers: Vec<String> = about[key].as_array().unwrap().iter().map(|v| v.to_string()).collect();
        numbers
    };
    let picture = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{reference}.exr"));
    let (picture, scene) = (picture.to_str().unwrap(), scenes.join(scene));
    let samples = samples.to_string();
    let fov = about["vertical_fov_deg"].to_string();
    let (eye, target, size) = (list("origin").join(","), list("target").join(","), list("size").join("x"));
    let mut arguments = vec!["render", scene.to_str().unwrap(), "-o", picture, "--renderer", "path"];
    arguments.extend(["--materials", "diffuse", "--spp", &samples, "--size", &size]);
    arguments.extend(["--eye", &eye, "--target", &target, "--fov", &fov]);
    let depth = about["max_depth"].as_i64().unwrap();
    let depth_argument = depth.to_string();
    if depth > 0 {
        arguments.extend(["--max-depth", &depth_argument]);
    }
    heliostat(&arguments);
    let exr = references.join(format!("{reference}.exr"));
    let compared = heliostat(&["compare", picture, exr.to_str().unwrap(), "--blur", "5", "--json"]);
    let compared: Value = serde_json::from_str(&compared).unwrap();
    for channel in 0..3 {
        let mean = |of: &str| compared[of][channel].as_f64().unwrap();
        let error = (mean("mean_a") / mean("mean_b") - 1.0).abs();
        assert!(error <= MEAN_TOLERANCE, "{reference}, channel {channel}: the mean is off by {error}");
    }
    let relmse = compared["relmse"].as_f64().unwrap();
    assert!(relmse <= max_relmse, "{reference}: relMSE {relmse}");
}

#[test]
fn cornell_global() {
    check("cornell-original-global", "cornell-mcguire/CornellBox-Original.obj", 64, 0.01);
}

#[test]
fn cornell_direct() {
    check("cornell-original-direct", "cornell-mcguire/CornellBox-Original.obj", 64, 0.01);
}

#[test]
fn office_global() {
    check("office-global", "office-mgf/office.obj", 96, 0.01);
}

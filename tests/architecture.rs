//! Dependencies between the rooms point the way that ARCHITECTURE.md says, checked from `cargo metadata`.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use serde_json::Value;

/// Which rooms each room uses. A new arrow is a design decision: it edits ARCHITECTURE.md too.
const ARROWS: &[(&str, &[&str])] = &[
    ("heliostat-scene", &[]),
    ("heliostat-kernel", &[]),
    ("heliostat-shading", &["kernel", "scene"]),
    ("heliostat-transport", &["kernel", "shading"]),
    ("heliostat-engine", &["kernel", "scene", "shading", "transport"]),
    ("heliostat-formats", &["scene"]),
    ("heliostat-builtin", &["scene"]),
    ("heliostat-plugins", &["scene", "shading"]),
    ("heliostat-viewer", &["builtin", "engine", "scene", "shading"]),
    (
        "heliostat",
        &["builtin", "engine", "formats", "kernel", "plugins", "scene", "shading", "transport", "viewer"],
    ),
    ("heliostat-bench", &[""]),
];

fn packages() -> Vec<Value> {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    metadata["packages"].as_array().expect("packages").clone()
}

/// The workspace's own packages that a package uses, tests included.
fn arrows(package: &Value) -> BTreeSet<String> {
    let dependencies = package["dependencies"].as_array().expect("dependencies");
    let names = dependencies.iter().filter_map(|d| d["name"].as_str());
    names.filter(|name| name.starts_with("heliostat")).map(Into::into).collect()
}

#[test]
fn dependencies_point_down() {
    let allowed: BTreeMap<&str, &[&str]> = ARROWS.iter().copied().collect();
    for package in packages() {
        let name = package["name"].as_str().expect("a name");
        let Some(allowed) = allowed.get(name) else {
            panic!("`{name}` is a new room: add it to ARCHITECTURE.md and to this table");
        };
        let allowed: BTreeSet<String> = allowed
            .iter()
            .map(|room| format!("heliostat-{room}").trim_end_matches('-').to_string())
            .collect();
        let used = arrows(&package);
        assert_eq!(used, allowed, "what `{name}` uses (left) and what this table says (right)");
    }
}

#[test]
fn every_room_is_described() {
    let page =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/ARCHITECTURE.md")).expect("the page");
    for package in packages() {
        let name = package["name"].as_str().expect("a name");
        assert!(page.contains(&format!("`{name}`")), "ARCHITECTURE.md does not mention `{name}`");
    }
}

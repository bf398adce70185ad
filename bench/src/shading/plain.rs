//! Primary rays with simple shading against tracing alone: table 1 of the report as a ratio.

use std::f32::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use heliostat::engine::LaneMode;
use heliostat::kernel::glam::{Vec2, Vec3};
use heliostat::scene::{
    Backend, Camera, ColorSpace, Edit, Environment, FrameRequest, Geometry, Image, Light, LightKind,
    Material, MaterialOverride, Mesh, Progress, Scene, SceneBuilder, Texture, TextureRef,
};
use serde_json::{Value, json};

use super::{Arguments, Setup, measure, ms, percent, table, value};

/// Edge of the texture, texels.
const TEXELS: u32 = 512;

pub(super) fn run(arguments: &Arguments) -> Result<Vec<Value>, String> {
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for name in &arguments.scene {
        let mut setups = setups(name, arguments.size)?;
        let times = measure(&mut setups, arguments.runs)?;
        let [traced, simple, whole, single] = times[..] else { unreachable!("four setups") };
        let share = |time: super::Time| 1.0 - traced.milliseconds / time.milliseconds;
        let name = Path::new(name).file_stem().map_or(name.as_str().into(), |stem| stem.to_string_lossy());
        let mut row = vec![name.to_string(), ms(traced)];
        for time in [simple, whole, single] {
            row.push(format!("{}: {}", ms(time), percent(share(time))));
        }
        row.push(percent(simple.queries));
        rows.push(row);
        values.push(json!({
            "scene": name, "simple_share": share(simple), "whole_share": share(whole),
            "times": [value("traced", traced), value("simple", simple), value("whole", whole), value("single", single)],
        }));
    }
    table(
        "Frames of primary rays, one point light, no shadows, everything textured: milliseconds, and the share that is shading",
        &[
            "scene",
            "traced alone",
            "diffuse",
            "materials as they are",
            "diffuse, one by one",
            "kernel's share (diffuse)",
        ],
        &rows,
    );
    Ok(values)
}

/// The scene traced alone, shaded simply, with its whole materials, and simply by single values.
fn setups(name: &str, size: u32) -> Result<Vec<Setup>, String> {
    let edits = edits(name)?;
    let any = Camera::look_at("", Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0);
    let mut first = Setup::new(&edits, LaneMode::default(), FrameRequest::new(any, size, size))?;
    let camera = crate::motion::camera(&first.engine)?;
    let light = Light {
        name: "lamp".into(),
        kind: LightKind::Point {
            position: camera.world_from_camera.translation.into(),
            intensity: Vec3::splat(10.0),
            range: f32::INFINITY,
        },
    };
    let mut builder = SceneBuilder::continuing(first.engine.scene());
    builder.light(light);
    let light = builder.finish();
    first.engine.apply(&light, &Progress::new()).map_err(|error| error.to_string())?;
    let edits = [edits, light].concat();
    let request = |renderer: &str, materials| FrameRequest {
        renderer: renderer.into(),
        materials,
        samples: 1,
        ..FrameRequest::new(camera.clone(), size, size)
    };
    first.request = request("eyelight", MaterialOverride::None);
    let packets = LaneMode::default();
    Ok(vec![
        first,
        Setup::new(&edits, packets, request("cast", MaterialOverride::Diffuse))?,
        Setup::new(&edits, packets, request("cast", MaterialOverride::None))?,
        Setup::new(&edits, LaneMode::Single, request("cast", MaterialOverride::Diffuse))?,
    ])
}

/// The scene without its light, and with a texture on every material that has none.
fn edits(name: &str) -> Result<Vec<Edit>, String> {
    let mut edits = crate::motion::scene(name)?.edits;
    let mut scene = Scene::default();
    scene.apply(&edits).map_err(|error| error.to_string())?;
    edits.push(Edit::Environment(Environment::None));
    edits.extend(scene.lights().keys().map(|&id| Edit::RemoveLight(id)));
    let mut builder = SceneBuilder::continuing(&scene);
    let texture = builder.texture(Texture::new("rings", Arc::new(rings()), ColorSpace::Srgb));
    edits.extend(builder.finish());
    for (&id, material) in scene.materials() {
        let base_color_texture = material.base_color_texture.or_else(|| Some(TextureRef::new(texture)));
        let dark =
            Material { emissive: Vec3::ZERO, base_color_texture, unlit: false, ..Material::clone(material) };
        edits.push(Edit::Material(id, Arc::new(dark)));
    }
    for (&id, geometry) in scene.geometries() {
        if let Some(mesh) = geometry.as_mesh().filter(|mesh| mesh.uvs[0].is_empty()) {
            let uvs = mesh.positions.iter().map(|p| Vec2::new(p.x + 0.5 * p.y, p.z + 0.5 * p.y)).collect();
            let mesh = Mesh { uvs: [uvs, mesh.uvs[1].clone()], ..Mesh::clone(mesh) };
            edits.push(Edit::Geometry(id, Geometry::Mesh(Arc::new(mesh))));
        }
    }
    Ok(edits)
}

/// A picture of rings that repeats.
fn rings() -> Image {
    let texel = |i: u32| {
        let [x, y] = [i % TEXELS, i / TEXELS].map(|c| (c as f32 / TEXELS as f32 - 0.5).abs());
        let wave = 0.5 + 0.5 * (12.0 * TAU * x.hypot(y)).sin();
        let code = |low: f32| (255.0 * (low + (1.0 - low) * wave)) as u8;
        [code(0.5), code(0.4), code(0.3), 255]
    };
    Image::rgba8(TEXELS, TEXELS, (0..TEXELS * TEXELS).flat_map(texel).collect())
}

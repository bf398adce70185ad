//! 32 shaders interleaved at random against the same geometry with one of them.

use std::sync::Arc;

use heliostat::engine::LaneMode;
use heliostat::kernel::glam::{Affine3A, Vec2, Vec3, Vec4};
use heliostat::scene::{
    Camera, Edit, FrameRequest, Light, LightKind, Material, Mesh, SceneBuilder, ShaderUse,
};
use heliostat::shading::ShaderRegistry;
use serde_json::{Value, json};

use super::{Arguments, Setup, Time, measure, ms, percent, table, value};
use crate::result;

/// Number of shaders.
const SHADERS: usize = 32;
/// Edges of the squares that have a shader each, pixels.
const SQUARES: [u32; 3] = [16, 4, 1];

pub(super) fn run(arguments: &Arguments) -> Result<Vec<Value>, String> {
    let materials = materials();
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for square in SQUARES {
        let wall = |first: Option<usize>, lanes| {
            let edits = edits(&materials, arguments.size, square, first);
            Setup::new(&edits, lanes, request(arguments.size))
        };
        let mixed = [LaneMode::default(), LaneMode::Single].map(|lanes| wall(None, lanes));
        let ones = (0..SHADERS).map(|shader| wall(Some(shader), LaneMode::default()));
        let mut setups = mixed.into_iter().chain(ones).collect::<Result<Vec<_>, _>>()?;
        let times = measure(&mut setups, arguments.runs)?;
        let (mixed, single, ones) = (times[0], times[1], &times[2..]);
        let alone = Time {
            milliseconds: ones.iter().map(|time| time.milliseconds).sum::<f64>() / SHADERS as f64,
            queries: ones.iter().map(|time| time.queries).sum::<f64>() / SHADERS as f64,
        };
        let slower = |than: f64| mixed.milliseconds / than - 1.0;
        rows.push(vec![
            format!("{square}×{square}"),
            ms(alone),
            ms(mixed),
            format!("{:+.0} %", 100.0 * slower(alone.milliseconds)),
            format!("{:.2}×", single.milliseconds / mixed.milliseconds),
            percent(mixed.queries),
        ]);
        let each = materials.iter().zip(ones).map(|(material, &time)| value(&material.name, time));
        values.push(json!({
            "square": square, "slower": slower(alone.milliseconds), "one": value("mean of one", alone),
            "mixed": value("mixed", mixed), "single": value("mixed, single lanes", single),
            "each": each.collect::<Vec<_>>(),
        }));
    }
    table(
        "A wall of squares with 32 shaders at random, against the mean of the same wall with each of the 32 alone: milliseconds",
        &["squares, pixels", "one shader", "32 shaders", "slower", "one by one", "kernel's share"],
        &rows,
    );
    result(&format!(
        "\nThe shaders: {}.",
        materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ")
    ));
    Ok(values)
}

/// One sample per pixel of a wall from 0 to 1 in x and y.
fn request(size: u32) -> FrameRequest {
    let eye = Vec3::new(0.5, 0.5, 1.0);
    let camera = Camera::look_at("", eye, eye - Vec3::Z, Vec3::Y, 2.0 * 0.5_f32.atan());
    FrameRequest { renderer: "cast".into(), samples: 1, ..FrameRequest::new(camera, size, size) }
}

/// All built-in shaders, and plain materials of many kinds.
fn materials() -> Vec<Material> {
    let grey = Material { base_color: Vec4::new(0.6, 0.5, 0.4, 1.0), ..Material::default() };
    let registry = ShaderRegistry::built_in();
    let shaded = registry.programs().keys().map(|name| Material {
        name: name.clone(),
        shader: Some(Arc::new(ShaderUse::named(name))),
        ..grey.clone()
    });
    let plain = (0..SHADERS as u32).map(|i| Material {
        name: format!("plain {i}"),
        metallic: (i % 2) as f32,
        roughness: 0.2 + 0.02 * i as f32,
        ..grey.clone()
    });
    shaded.chain(plain).take(SHADERS).collect()
}

/// The wall cut into squares. Each shader has a part of them, drawn at random; with `one`, all parts have that shader.
fn edits(materials: &[Material], size: u32, square: u32, one: Option<usize>) -> Vec<Edit> {
    let columns = size.div_ceil(square);
    let mut parts = vec![(Vec::new(), Vec::new()); SHADERS];
    let edge = square as f32 / size as f32;
    for index in 0..columns * columns {
        let (positions, triangles): &mut (Vec<Vec3>, Vec<[u32; 3]>) = &mut parts[random(index) % SHADERS];
        let corner = Vec2::new((index % columns) as f32, (index / columns) as f32);
        let first = positions.len() as u32;
        for at in [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y] {
            positions.push(((corner + at) * edge).extend(0.0));
        }
        triangles.extend([[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|corner| first + corner)));
    }
    let mut scene = SceneBuilder::new();
    let ids: Vec<_> = materials.iter().map(|material| scene.material(material.clone())).collect();
    let parts: Vec<_> = (0..)
        .zip(parts)
        .filter(|(_, (positions, _))| !positions.is_empty())
        .map(|(shader, (positions, triangles))| {
            let uvs = positions.iter().map(|p: &Vec3| p.truncate() * 8.0).collect();
            let mesh = Mesh { uvs: [uvs, Vec::new()], ..Mesh::new(positions, triangles) };
            (scene.mesh(mesh), ids[one.unwrap_or(shader)])
        })
        .collect();
    let wall = scene.object("wall", parts);
    scene.instance(wall, Affine3A::IDENTITY);
    scene.light(Light {
        name: "lamp".into(),
        kind: LightKind::Point {
            position: Vec3::new(0.2, 0.8, 1.0),
            intensity: Vec3::splat(4.0),
            range: f32::INFINITY,
        },
    });
    scene.finish()
}

/// A number that looks random.
fn random(index: u32) -> usize {
    let mut x = index.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    (x ^ (x >> 16)) as usize
}

#[cfg(test)]
mod tests {
    use heliostat::scene::Scene;

    use super::*;

    #[test]
    fn every_shader_has_its_squares_and_one_takes_all() {
        let materials = materials();
        assert_eq!(materials.len(), SHADERS);
        for (one, kinds) in [(None, SHADERS), (Some(7), 1)] {
            let mut scene = Scene::default();
            scene.apply(&edits(&materials, 64, 1, one)).expect("a scene");
            let wall = scene.objects().values().next().expect("the wall");
            let used: std::collections::BTreeSet<_> = wall.parts.iter().map(|part| part.material).collect();
            assert_eq!(used.len(), kinds);
            let meshes = scene.geometries().values().filter_map(|geometry| geometry.as_mesh());
            assert_eq!(meshes.map(|mesh| mesh.indices.len()).sum::<usize>(), 2 * 64 * 64);
        }
    }
}

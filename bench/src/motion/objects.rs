//! Many objects against one: what a frame costs that is drawn over placed parts instead of one flat tree, without and with
//! shading.

use heliostat::engine::Engine;
use heliostat::kernel::Mesh as KernelMesh;
use heliostat::kernel::glam::{Affine3A, Quat, Vec3};
use heliostat::scene::{
    Backend, Camera, Edit, Light, LightKind, Material, Mesh, Progress, Scene, SceneBuilder,
};

use crate::measure::interleave;
use crate::{flatten, kernel, result};

pub(super) fn run(name: &str, count: usize, turned: bool, runs: usize) -> Result<(), String> {
    let mut scene = Scene::default();
    scene.apply(&super::scene(name)?.edits).map_err(|error| error.to_string())?;
    let camera = scene.cameras().values().next().cloned().ok_or("the scene has no camera")?;
    let bounds = scene.bounds().ok_or("there is nothing to see")?;
    let mesh = flatten::scene(&scene)?;
    let parts = kernel::split::objects(&mesh, count);
    let lamp = bounds.center() + 0.3 * Vec3::Y * (bounds.max.y - bounds.min.y);
    let placed = parts.iter().map(|part| about_its_own_middle(part, turned)).collect::<Vec<_>>();
    let whole = [(mesh, Affine3A::IDENTITY)];
    let [mut flat, mut many] = [&whole[..], &placed[..]].map(|parts| engine(parts, lamp));
    result(&format!(
        "{name}: {} triangles, one tree against {} objects, 1024×1024, one sample per pixel",
        whole[0].0.indices.len(),
        placed.len()
    ));
    for (what, depth) in [("unshaded primary rays", 1), ("direct light and shadows", 2)] {
        let frame = |engine: &mut Result<Engine, String>| draw(engine, &camera, depth);
        let (a, b) = interleave(runs, || frame(&mut flat), || frame(&mut many))?;
        result(&format!("{what:25} flat {a:8.1} ms, many {b:8.1} ms: {:5.2} times the time", b / a));
    }
    Ok(())
}

fn draw(engine: &mut Result<Engine, String>, camera: &Camera, depth: u32) -> Result<f64, String> {
    let engine = engine.as_mut().map_err(|error| error.clone())?;
    let mut request = super::request(camera.clone(), "direct");
    (request.width, request.height, request.max_depth) = (1024, 1024, Some(depth));
    let frame = engine.render(&request, &Progress::new()).map_err(|error| error.to_string())?;
    Ok(frame.stats.milliseconds)
}

/// A part moved to its own origin, and where it stands.
fn about_its_own_middle(part: &KernelMesh, turned: bool) -> (KernelMesh, Affine3A) {
    let (low, high) = part
        .positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let turn = if turned { Quat::from_rotation_y(0.7) } else { Quat::IDENTITY };
    let place = Affine3A::from_rotation_translation(turn, 0.5 * (low + high));
    let object_from_world = place.inverse();
    let positions: Vec<Vec3> =
        part.positions.iter().map(|&p| object_from_world.transform_point3(p)).collect();
    (KernelMesh::new(positions, part.indices.to_vec()), place)
}

/// All parts in grey under one point light.
fn engine(parts: &[(KernelMesh, Affine3A)], lamp: Vec3) -> Result<Engine, String> {
    let mut builder = SceneBuilder::new();
    let grey = builder.material(Material::diffuse("grey", Vec3::splat(0.5)));
    for (mesh, place) in parts {
        let mesh =
            Mesh { positions: mesh.positions.clone(), indices: mesh.indices.clone(), ..Mesh::default() };
        let mesh = builder.mesh(mesh);
        let object = builder.object("part", [(mesh, grey)]);
        builder.instance(object, *place);
    }
    let kind = LightKind::Point { position: lamp, intensity: Vec3::ONE, range: f32::INFINITY };
    builder.light(Light { name: "lamp".into(), kind });
    let edits: Vec<Edit> = builder.finish();
    super::engine(&edits).map(|(engine, _)| engine)
}

//! Nothing is left behind: after thousands of edits an engine holds what a fresh one with the same scene holds.

use std::sync::Arc;

use glam::{Affine3A, Vec3};
use heliostat_engine::{Engine, EngineOptions};
use heliostat_scene::{
    Backend, Camera, ColorSpace, Edit, FrameRequest, Geometry, GeometryId, Image, Instance, InstanceId,
    Light, LightId, LightKind, Material, MaterialId, Mesh, Object, ObjectId, Part, Progress, Texture,
    TextureId, TextureRef,
};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

const EDITS: u32 = 10_000;
const INSTANCES: u32 = 300;
const GEOMETRIES: u32 = 12;

fn grid(size: u32, time: f32) -> Mesh {
    let row = size + 1;
    let vertex = |i: u32| {
        let (x, z) = ((i % row) as f32 / size as f32, (i / row) as f32 / size as f32);
        Vec3::new(x, 0.1 * (9.0 * x + time).sin(), z)
    };
    let quads = (0..size * size).map(|q| q % size + q / size * row);
    let indices = quads.flat_map(|a| [[a, a + row, a + row + 1], [a, a + row + 1, a + 1]]).collect();
    Mesh::new((0..row * row).map(vertex).collect(), indices)
}

fn geometry(id: u32, time: f32) -> Edit {
    Edit::Geometry(GeometryId(id), Geometry::Mesh(Arc::new(grid(20 + id, time))))
}

fn texture(seed: u8) -> Edit {
    let pixels = (0..64 * 64 * 4).map(|i| (i % 251) as u8 ^ seed).collect();
    let image = Arc::new(Image::rgba8(64, 64, pixels));
    Edit::Texture(TextureId(0), Arc::new(Texture::new("t", image, ColorSpace::Srgb)))
}

fn material(id: u32, shade: f32) -> Edit {
    let mut material = Material::plastic("m", Vec3::splat(shade), 0.4);
    if id == 0 {
        material.base_color_texture = Some(TextureRef::new(TextureId(0)));
    }
    Edit::Material(MaterialId(id), Arc::new(material))
}

fn object(id: u32) -> Edit {
    let part = Part { geometry: GeometryId(id % GEOMETRIES), material: MaterialId(id % 3) };
    Edit::Object(ObjectId(id), Object { name: format!("object {id}"), parts: vec![part] })
}

fn instance(id: u32, step: u32) -> Edit {
    let place = Vec3::new((id % 17) as f32, (step % 5) as f32, (id / 17) as f32);
    let instance = Instance {
        name: String::new(),
        object: ObjectId((id + step) % GEOMETRIES),
        parent: None,
        parent_from_object: Affine3A::from_translation(place),
        motion: None,
        visible: true,
    };
    Edit::Instance(InstanceId(id), instance)
}

fn light(id: u32, step: u32) -> Edit {
    let position = Vec3::new(step as f32 % 13.0, 5.0, 3.0);
    let kind = LightKind::Point { position, intensity: Vec3::ONE, range: f32::INFINITY };
    Edit::Light(LightId(id), Light { name: String::new(), kind })
}

/// One edit of many kinds; things go and come back.
fn edit(step: u32) -> Edit {
    let id = step / 8 % INSTANCES;
    match step % 8 {
        0..3 => Edit::MoveInstance(InstanceId(id), Affine3A::from_rotation_y(step as f32)),
        3 => geometry(step / 8 % GEOMETRIES, step as f32 * 0.01),
        4 => material(step / 8 % 3, 0.2 + 0.1 * (step % 7) as f32),
        5 if step % 64 == 5 => texture(step as u8),
        5 => light(step / 8 % 4, step),
        6 if (step / 8).is_multiple_of(2) => Edit::RemoveInstance(InstanceId(id)),
        6 => object(step / 8 % GEOMETRIES),
        _ => instance(id, step),
    }
}

fn engine() -> Engine {
    let options = EngineOptions { threads: std::num::NonZeroUsize::new(2), ..EngineOptions::default() };
    Engine::new(options).expect("an engine")
}

fn draw(engine: &mut Engine) {
    let camera = Camera::look_at("", Vec3::new(8.0, 9.0, 30.0), Vec3::new(8.0, 0.0, 8.0), Vec3::Y, 0.9);
    let mut request = FrameRequest::new(camera, 16, 16);
    request.renderer = "direct".into();
    request.samples = 1;
    engine.render(&request, &Progress::new()).expect("a frame");
}

#[test]
fn ten_thousand_edits_leave_nothing_behind() {
    let start = MEMORY.current_usage();
    let mut edits = vec![texture(0)];
    edits.extend((0..3).map(|id| material(id, 0.5)));
    edits.extend((0..GEOMETRIES).map(|id| geometry(id, 0.0)));
    edits.extend((0..GEOMETRIES).map(object));
    edits.extend((0..INSTANCES).map(|id| instance(id, 0)));

    let mut worked = engine();
    worked.apply(&edits, &Progress::new()).expect("valid");
    let mut refused = 0;
    for step in 0..EDITS {
        refused += u32::from(worked.apply(&[edit(step)], &Progress::new()).is_err());
        if step % 2000 == 0 {
            draw(&mut worked);
        }
    }
    assert!(refused < EDITS / 20, "{refused} edits refused");
    drop(edits);
    draw(&mut worked);
    let used = MEMORY.current_usage() - start;

    // The first engine's figure counts the scene's own data: the second one must bring its own.
    let before = MEMORY.current_usage();
    let copy = worked.scene().to_edits().into_iter().map(owned).collect::<Vec<_>>();
    let mut fresh = engine();
    fresh.apply(&copy, &Progress::new()).expect("valid");
    drop(copy);
    draw(&mut fresh);
    let expected = MEMORY.current_usage() - before;
    let ratio = used as f64 / expected as f64;
    assert!((0.95..1.05).contains(&ratio), "{used} bytes after the edits, {expected} fresh: {ratio:.3}");
}

/// An edit that shares no data with the one it was made from.
fn owned(edit: Edit) -> Edit {
    match edit {
        Edit::Geometry(id, Geometry::Mesh(mesh)) => {
            let mut copy = (*mesh).clone();
            copy.positions = mesh.positions.to_vec().into();
            copy.indices = mesh.indices.to_vec().into();
            Edit::Geometry(id, Geometry::Mesh(Arc::new(copy)))
        }
        Edit::Material(id, material) => Edit::Material(id, Arc::new((*material).clone())),
        Edit::Texture(id, texture) => {
            let mut copy = (*texture).clone();
            copy.image = Arc::new((*texture.image).clone());
            Edit::Texture(id, Arc::new(copy))
        }
        other => other,
    }
}

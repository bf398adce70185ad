//! A stand for one material: a ball on a block in a photographer's studio.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, Edit, Light, LightKind, Material, SceneBuilder, ShaderUse};

use crate::shape::Shape;
use crate::sky;
use crate::solid::sphere;

/// The edits that show a material on a ball of `diameter` metres, which lies on a block of the same material. Patterns in
/// object space appear as on a thing of that size; the picture's frame does not change. The floor is grey unless given.
///
/// ```
/// use heliostat_scene::{Material, Scene};
///
/// let mut scene = Scene::default();
/// scene.apply(&heliostat_builtin::stand(&Material::default(), None, 0.24))?;
/// # Ok::<(), heliostat_scene::EditError>(())
/// ```
pub fn stand(material: &Material, floor: Option<Material>, diameter: f32) -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let shown = builder.material(material.clone());
    let size = diameter.clamp(1e-3, 1e3);
    let ball = builder.mesh(sphere(Vec3::Y * 0.72 * size, 0.5 * size, 96).mesh());
    let block = Shape::rounded_block(Vec3::new(1.5, 0.22, 1.2) * size, 0.05 * size, 6, 1);
    let block = builder.mesh(block.moved(Vec3::Y * 0.11 * size).with_uvs(|uv| uv / size).mesh());
    let object = builder.object("shown", [(ball, shown), (block, shown)]);
    // In the world the ball has a diameter of a metre.
    let turned = Affine3A::from_rotation_y(-0.35) * Affine3A::from_scale(Vec3::splat(1.0 / size));
    builder.place("shown", object, None, turned);
    studio(&mut builder, floor.unwrap_or_else(tiles));
    builder.finish()
}

/// Grey squares.
fn tiles() -> Material {
    let tiles = ShaderUse::named("checker")
        .with("first", Vec3::splat(0.30))
        .with("second", Vec3::splat(0.20))
        .with("size", 0.4);
    Material { shader: Some(Arc::new(tiles)), roughness: 0.6, ..Material::default() }
}

/// Floor, light and camera.
fn studio(builder: &mut SceneBuilder, floor: Material) {
    let floor = builder.material(floor);
    let square =
        Shape::patch(1, 1, Vec2::splat(24.0), |u, v| Vec3::new(24.0 * u - 12.0, 0.0, 12.0 - 24.0 * v));
    let square = builder.mesh(square.mesh());
    let object = builder.object("floor", [(square, floor)]);
    builder.place("floor", object, None, Affine3A::from_translation(Vec3::NEG_Y * 0.001));
    builder.environment(sky::studio());
    let key = LightKind::Spot {
        position: Vec3::new(-3.0, 5.0, 3.5),
        direction: Vec3::new(3.0, -4.4, -3.5),
        intensity: Vec3::new(1.0, 0.95, 0.88) * 45.0,
        inner_angle: 0.3,
        outer_angle: 0.5,
        range: f32::INFINITY,
    };
    builder.light(Light { name: "key".into(), kind: key });
    let (eye, target) = (Vec3::new(0.35, 1.75, 3.6), Vec3::new(0.0, 0.5, 0.0));
    builder.camera(Camera::look_at("front", eye, target, Vec3::Y, 0.50));
}

//! The material model at a glance: rows of spheres over roughness in a photographer's studio.

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, Clearcoat, Edit, Material, SceneBuilder, Volume};

use crate::pattern;
use crate::shape::Shape;
use crate::sky;
use crate::solid::{circle, solid, sphere};
use crate::{paint, random::fbm};

/// Spheres per row; roughness grows from left to right.
const COLUMNS: usize = 6;

pub(crate) fn build() -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    backdrop(&mut builder);
    let ball = builder.mesh(sphere(Vec3::Y * 0.42, 0.40, 96).mesh());
    let foot = [(0.0, 0.0), (0.02, 0.01), (0.0, 0.03)];
    let foot = builder.mesh(solid(&circle(0.16, 48), &foot).mesh());
    let stand = builder.material(Material::metal("stand", Vec3::splat(0.35), 0.35));
    for (row, kind) in ["gold", "lacquer", "plastic", "glass"].into_iter().enumerate() {
        for column in 0..COLUMNS {
            let roughness = column as f32 / (COLUMNS - 1) as f32;
            let material = builder.material(material(kind, roughness));
            let object = builder.object(format!("{kind} {roughness:.1}"), [(ball, material), (foot, stand)]);
            let x = (column as f32 - 0.5 * (COLUMNS - 1) as f32) * 1.05;
            let place = Vec3::new(x, 0.32 * row as f32, -1.05 * row as f32);
            builder.instance(object, Affine3A::from_translation(place));
        }
    }
    builder.environment(sky::studio());
    let (eye, target) = (Vec3::new(0.0, 3.3, 8.3), Vec3::new(0.0, 0.78, -1.3));
    builder.camera(Camera::look_at("front", eye, target, Vec3::Y, 0.54));
    builder.camera(Camera::look_at(
        "low",
        Vec3::new(-3.4, 0.7, 3.2),
        Vec3::new(0.0, 0.7, -1.2),
        Vec3::Y,
        0.7,
    ));
    builder.finish()
}

fn material(kind: &str, roughness: f32) -> Material {
    let base = match kind {
        "gold" => Material::metal("", Vec3::new(1.0, 0.71, 0.29), roughness),
        "glass" => Material {
            roughness: roughness * 0.6,
            volume: Some(Volume {
                attenuation_color: Vec3::new(0.75, 0.93, 0.88),
                attenuation_distance: 0.8,
            }),
            ..Material::glass("", 1.5)
        },
        "lacquer" => Material {
            clearcoat: Some(Clearcoat {
                factor: 1.0,
                texture: None,
                roughness: 0.03,
                roughness_texture: None,
                normal_texture: None,
                normal_scale: 1.0,
            }),
            metallic: 0.6,
            ..Material::plastic("", Vec3::new(0.45, 0.02, 0.03), roughness)
        },
        _ => Material::plastic("", Vec3::new(0.04, 0.16, 0.42), roughness),
    };
    Material { name: format!("{kind} {roughness:.1}"), ..base }
}

/// A floor that bends up into a wall, with steps for the rows of spheres.
fn backdrop(builder: &mut SceneBuilder) {
    let paper = paint::texture(builder, "paper", 256, |uv| Vec3::splat(0.26 + 0.05 * fbm(uv * 8.0, 8, 4, 3)));
    let paper = paint::textured(builder, "paper", paper, Vec2::splat(4.0), 0.6);
    let sweep = Shape::patch(1, 48, Vec2::new(24.0, 20.0), |u, v| {
        // Straight floor, a quarter circle of three metres, straight wall.
        let s = v * 20.0 - 12.0;
        let bend = (s / 3.0).clamp(0.0, std::f32::consts::FRAC_PI_2);
        let straight = (s.min(0.0), (s - 3.0 * std::f32::consts::FRAC_PI_2).max(0.0));
        let (sin, cos) = bend.sin_cos();
        Vec3::new(24.0 * (u - 0.5), 3.0 * (1.0 - cos) + straight.1, -4.5 - straight.0 - 3.0 * sin)
    });
    let sweep = builder.mesh(sweep.mesh());
    let floor = builder.object("backdrop", [(sweep, paper)]);
    builder.place("backdrop", floor, None, Affine3A::IDENTITY);

    let oak = paint::texture(builder, "oak", 256, |uv| {
        pattern::wood(uv, Vec3::new(0.16, 0.085, 0.04), Vec3::new(0.34, 0.20, 0.10), 2)
    });
    let oak = paint::textured(builder, "oak", oak, Vec2::new(1.6, 0.8), 0.4);
    let steps = (1..4).map(|row| {
        let (y, z) = (0.32 * row as f32, -1.05 * row as f32);
        Shape::rounded_block(Vec3::new(6.8, y, 1.04), 0.015, 2, 1).moved(Vec3::new(0.0, 0.5 * y, z))
    });
    let steps = builder.mesh(Shape::union(steps).mesh());
    let steps = builder.object("steps", [(steps, oak)]);
    builder.place("steps", steps, None, Affine3A::IDENTITY);
}

//! What makes the atrium a place: fountain, plants, banners, curtains, doors and benches.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Affine3A, Vec2, Vec3, Vec4};
use heliostat_scene::{AlphaMode, Material, SceneBuilder, TextureRef};

use super::{BAY, HALF_LENGTH, HALF_WIDTH, Palette, WALK, at_bay, bays, fixed, object};
use crate::pattern::{fabric, segment_distance, smooth};
use crate::plant::{self, Habit, potted};
use crate::random::Rng;
use crate::shape::{Shape, place};
use crate::solid::{circle, lathe, solid, sphere, superellipse, torus, tube};
use crate::{paint, random::fbm};

pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) {
    fountain(builder, palette);
    plants(builder, palette);
    banners(builder, palette);
    curtains(builder, palette);
    doors_and_benches(builder, palette);
}

/// A round basin, a bowl on a turned foot, and water in both.
fn fountain(builder: &mut SceneBuilder, palette: &Palette) {
    let basin = [
        (1.75, 0.0),
        (1.75, 0.10),
        (1.66, 0.14),
        (1.60, 0.22),
        (1.60, 0.44),
        (1.66, 0.48),
        (1.74, 0.52),
        (1.74, 0.60),
        (1.68, 0.63),
        (1.48, 0.63),
        (1.44, 0.60),
        (1.44, 0.10),
    ];
    let foot = [
        (0.42, 0.0),
        (0.42, 0.34),
        (0.34, 0.42),
        (0.20, 0.52),
        (0.15, 0.70),
        (0.19, 0.88),
        (0.25, 0.98),
        (0.17, 1.08),
        (0.14, 1.16),
        (0.30, 1.26),
        (0.62, 1.36),
        (0.84, 1.52),
        (0.88, 1.58),
        (0.86, 1.61),
        (0.81, 1.58),
        (0.60, 1.44),
        (0.0, 1.38),
    ];
    let finial =
        [(0.10, 1.38), (0.08, 1.60), (0.12, 1.70), (0.16, 1.80), (0.10, 1.90), (0.05, 2.00), (0.0, 2.12)];
    let stone = Shape::union([lathe(64, &basin), lathe(40, &foot)]);
    let water = Shape::union([
        solid(&circle(1.45, 48), &[(0.0, 0.45), (0.0, 0.50)]),
        solid(&circle(0.78, 40), &[(-0.1, 1.50), (0.0, 1.555)]),
    ]);
    let parts = [(stone, palette.limestone), (water, palette.water), (lathe(32, &finial), palette.bronze)];
    let parts = parts.map(|(shape, material)| (builder.mesh(shape.mesh()), material));
    let fountain = builder.object("fountain", parts);
    builder.place("fountain", fountain, None, Affine3A::from_translation(Vec3::X * 1.7));
}

fn plants(builder: &mut SceneBuilder, palette: &Palette) {
    let shared = plant::Palette::new(builder);
    let shrub = Habit {
        seed: 1,
        pot_radius: 0.36,
        pot_height: 0.62,
        stems: 7,
        stem_length: 1.0,
        leaves: 18,
        leaf_length: 0.30,
        spread: 0.75,
    };
    let palm =
        Habit { seed: 2, stems: 9, stem_length: 1.5, leaf_length: 0.46, leaves: 14, spread: 0.95, ..shrub };
    let kinds = [shrub, palm].map(|habit| potted(builder, shared, palette.terracotta, &habit));
    let mut rng = Rng::new(7);
    for side in [-1.0, 1.0] {
        for i in 0..5 {
            let x = (i as f32 - 2.0) * 2.0 * BAY + 0.5 * BAY * side + rng.range(-0.2, 0.2);
            let at =
                Vec3::new(x.clamp(-HALF_LENGTH + 1.0, HALF_LENGTH - 1.0), 0.0, side * (HALF_WIDTH - 0.95));
            let size = rng.range(0.85, 1.1);
            let turned = place(at, rng.range(0.0, TAU)) * Affine3A::from_scale(Vec3::splat(size));
            builder.place("plant", kinds[(i + usize::from(side > 0.0)) % 2], None, turned);
        }
    }
}

/// Painted banners on cables across the court.
fn banners(builder: &mut SceneBuilder, palette: &Palette) {
    const SIZE: Vec2 = Vec2::new(1.9, 2.9);
    let fields = [Vec3::new(0.40, 0.03, 0.03), Vec3::new(0.03, 0.09, 0.30), Vec3::new(0.55, 0.30, 0.04)];
    let gold = Vec3::new(0.80, 0.58, 0.18);
    for (i, field) in fields.into_iter().enumerate() {
        let picture = paint::decal(builder, "banner", [256, 384], |uv| banner(uv, field, gold));
        let cloth = builder.material(Material {
            name: "banner".into(),
            base_color_texture: Some(TextureRef::new(picture)),
            alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
            roughness: 0.9,
            ..Material::default()
        });
        let phase = i as f32 * 1.7;
        let sheet = Shape::patch(20, 32, Vec2::ONE, |u, v| {
            let hang = 1.0 - v;
            let sway = 0.12 * hang * ((u * 2.4 + hang * 1.6 + phase) * PI).sin();
            Vec3::new(SIZE.x * (u - 0.5), SIZE.y * (v - 1.0), sway)
        });
        let rod = (Vec3::new(-0.5 * SIZE.x - 0.08, 0.0, 0.0), 0.022);
        let rod = tube(&[rod, (Vec3::new(-rod.0.x, 0.0, 0.0), 0.022)], 8, true);
        let parts = [(sheet, cloth), (rod, palette.bronze)];
        let parts = parts.map(|(shape, material)| (builder.mesh(shape.mesh()), material));
        let banner = builder.object("banner", parts);
        let x = (i as f32 - 1.0) * 2.0 * BAY + 1.7;
        let height = 8.55;
        builder.instance(banner, place(Vec3::new(x, height, 0.0), -FRAC_PI_2));

        let sag =
            |t: f32| Vec3::new(x, 9.3 - 0.74 * (1.0 - (2.0 * t - 1.0).powi(2)), (2.0 * t - 1.0) * HALF_WIDTH);
        let cable: Vec<_> = (0..=16).map(|k| (sag(k as f32 / 16.0), 0.012)).collect();
        fixed(builder, "cable", tube(&cable, 6, false), palette.bronze);
    }
}

/// A heliostat's emblem: the sun over two rows of mirrors, within a border.
fn banner(uv: Vec2, field: Vec3, gold: Vec3) -> Vec4 {
    let p = Vec2::new(uv.x - 0.5, (uv.y - 0.42) * 1.5);
    let radius = p.length();
    let ray = (p.y.atan2(p.x) * 8.0 / PI + 0.5).rem_euclid(2.0) - 1.0;
    let sun = radius < 0.13 || (radius > 0.16 && radius < 0.29 && ray.abs() < 0.42 * (0.30 - radius) / 0.14);
    let edge = uv.x.min(1.0 - uv.x).min(uv.y.min(1.0 - uv.y) * 1.5);
    let border = (0.045..0.06).contains(&edge) || (0.07..0.075).contains(&edge);
    let mirrors = (0..5).any(|i| {
        let foot = Vec2::new((i as f32 - 2.0) * 0.15, 0.60 + 0.05 * (i % 2) as f32);
        let tilt = Vec2::new(0.05, -0.035 * (i as f32 - 2.0) * 0.5);
        segment_distance(p, foot - tilt, foot + tilt) < 0.012
            || segment_distance(p, foot, foot + Vec2::Y * 0.06) < 0.006
    });
    let weave = fabric(uv, Vec3::ONE, 5) * (0.85 + 0.3 * fbm(uv * 4.0, 4, 3, 9));
    let color = if sun || border || mirrors { gold } else { field };
    // The lower edge is cut into points.
    let point = 0.94 + 0.055 * (1.0 - ((uv.x * 5.0).fract() - 0.5).abs() * 2.0);
    (color * weave).extend(1.0 - smooth(point, point + 0.002, uv.y))
}

/// Curtains drawn to one side behind every other arch of the long sides.
fn curtains(builder: &mut SceneBuilder, palette: &Palette) {
    let sheet = Shape::patch(48, 14, Vec2::new(1.6, 3.0), |u, v| {
        // Gathered at a tie two fifths up, full at the top.
        let gather = 1.0 - 0.62 * (-((v - 0.40) / 0.22).powi(2)).exp();
        let fold = 0.07 * (0.5 + 0.5 * gather) * (u * TAU * 6.0 + 0.8 * (3.0 * v).sin()).sin();
        let x = -1.32 + (0.12 + 0.95 * u * gather) * (0.75 + 0.35 * v);
        Vec3::new(x, 0.03 + 3.55 * v, fold)
    });
    let rod_end = Vec3::new(1.4, 3.6, 0.0);
    let rod = object(
        builder,
        "curtain rod",
        tube(&[(-rod_end + Vec3::Y * 7.2, 0.025), (rod_end, 0.025)], 10, true),
        palette.bronze,
    );
    let half = object(builder, "curtain", sheet, palette.curtain);
    for (i, bay) in bays().filter(|bay| bay.2 == BAY).enumerate() {
        if (i / 2) % 2 == 1 {
            let frame = at_bay(bay, 0.0) * Affine3A::from_translation(Vec3::Z * -0.62);
            builder.instance(half, frame);
            builder.instance(half, frame * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)));
            builder.instance(rod, frame);
        }
    }
}

/// Arched doors in the outer wall, with benches between them.
fn doors_and_benches(builder: &mut SceneBuilder, palette: &Palette) {
    let frame_points: Vec<_> = [(-0.72, 0.0), (-0.72, 1.95)]
        .into_iter()
        .chain((1..16).map(|i| PI * (1.0 - i as f32 / 16.0)).map(|a| (0.72 * a.cos(), 1.95 + 0.72 * a.sin())))
        .chain([(0.72, 1.95), (0.72, 0.0)])
        .map(|(x, y)| (Vec3::new(x, y, 0.04), 0.09))
        .collect();
    let frame = tube(&frame_points, 8, false);
    let mut leaves = Shape::default();
    for i in 0..6 {
        let x = -0.60 + 0.24 * i as f32;
        let height = 1.95 + (0.72f32.powi(2) - x * x).max(0.0).sqrt();
        let plank = Shape::rounded_block(Vec3::new(0.23, height, 0.07), 0.012, 1, 1);
        leaves.add(&plank.with_uvs(|uv| Vec2::new(uv.y, uv.x + 0.31 * i as f32)).moved(Vec3::new(
            x,
            0.5 * height,
            0.03,
        )));
    }
    let hardware = Shape::union(
        [0.55, 1.75]
            .into_iter()
            .map(|y| {
                Shape::rounded_block(Vec3::new(1.36, 0.07, 0.02), 0.008, 1, 1).moved(Vec3::new(0.0, y, 0.075))
            })
            .chain([torus(Vec3::ZERO, 0.07, 0.012, [16, 6])
                .at(Affine3A::from_translation(Vec3::new(0.12, 1.1, 0.10))
                    * Affine3A::from_rotation_x(FRAC_PI_2))])
            .chain([sphere(Vec3::new(0.12, 1.17, 0.08), 0.025, 10)]),
    );
    let parts = [(frame, palette.limestone), (leaves, palette.timber), (hardware, palette.bronze)];
    let parts = parts.map(|(shape, material)| (builder.mesh(shape.mesh()), material));
    let door = builder.object("door", parts);

    let seat = solid(
        &superellipse(Vec2::new(0.85, 0.24), 6.0, 40),
        &[(-0.03, 0.40), (0.0, 0.42), (0.0, 0.47), (-0.02, 0.49)],
    );
    let foot = |x: f32| {
        Shape::block_on(Vec3::X * x, Vec3::new(0.16, 0.41, 0.34))
            .warped(|p| Vec3::new(p.x, p.y, p.z * (0.75 + 0.5 * (p.y - 0.2).powi(2) / 0.04)))
    };
    let bench = object(builder, "bench", Shape::union([seat, foot(-0.55), foot(0.55)]), palette.limestone);
    for (i, bay) in bays().enumerate() {
        let against_wall = |out: f32| at_bay(bay, 0.0) * Affine3A::from_translation(Vec3::Z * (out - WALK));
        if (i / 2) % 2 == 0 {
            builder.instance(door, against_wall(0.0));
            let upper = Affine3A::from_translation(Vec3::Y * super::UPPER_FLOOR);
            builder.instance(door, upper * against_wall(0.0));
        } else {
            builder.instance(bench, against_wall(0.42));
        }
    }
}

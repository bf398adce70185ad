//! An elliptic hall with a dome, a colonnade and an ambulatory behind it, under 1,164 lamps: many small lights, half of
//! which see only a part of the room.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, Edit, SceneBuilder};

use crate::interior::{Finish, Palette, Piece, wall_between};
use crate::shape::{Shape, place};
use crate::solid::{cap, circle, cylinder, lathe, loft, sphere, superellipse, tube};

/// Half axes of the outer wall and of the colonnade along X and Z, metres.
const OUTER: Vec2 = Vec2::new(30.0, 20.0);
const INNER: Vec2 = Vec2::new(21.0, 13.0);
/// Of the ambulatory's ceiling, of the dome's springing, and of its crown above that, metres.
const LOW: f32 = 5.0;
const SPRING: f32 = 7.6;
const RISE: f32 = 4.6;
const COLUMNS: usize = 40;
/// Rings of lamps in the dome and over the ambulatory; each has [`MORE`] lamps more than the one before.
const DOME_RINGS: usize = 8;
const RINGS: usize = 12;
const FIRST: usize = 31;
const MORE: usize = 12;

pub(crate) fn build() -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder, Vec3::new(88.0, 78.0, 63.0));
    shell().fixed(&mut builder, &palette, "hall");
    colonnade(&mut builder, &palette);
    benches().fixed(&mut builder, &palette, "benches");
    exhibits(&mut builder, &palette);
    lamps(&mut builder, &palette);
    let views = [
        ("hall", Vec3::new(17.5, 3.4, 4.2), Vec3::new(-6.0, 2.6, -1.0), 1.0),
        ("ambulatory", Vec3::new(24.5, 1.7, 3.5), Vec3::new(15.5, 1.6, 15.0), 1.05),
        ("dome", Vec3::new(-8.0, 1.4, 5.0), Vec3::new(6.0, 9.5, -4.0), 1.15),
        ("between the columns", Vec3::new(0.9, 1.65, 17.8), Vec3::new(-1.5, 1.9, -6.0), 0.95),
    ];
    for (name, eye, target, fov) in views {
        builder.camera(Camera::look_at(name, eye, target, Vec3::Y, fov));
    }
    builder.finish()
}

/// The point at `angle` on the ellipse of half axes `axes`, on the ground.
fn on(axes: Vec2, angle: f32) -> Vec3 {
    Vec3::new(axes.x * angle.cos(), 0.0, axes.y * angle.sin())
}

/// The dome's height over the share `t` of the way from its axis to its springing.
fn vault(t: f32) -> f32 {
    SPRING + RISE * (1.0 - t * t).max(0.0).sqrt()
}

/// Floors, the outer wall, the ambulatory's ceiling, the drum and the dome.
fn shell() -> Piece {
    const AROUND: u32 = 120;
    let [outer, inner] = [OUTER, INNER].map(|axes| superellipse(axes, 2.0, AROUND));
    // Downwards along a profile is the inside.
    let walls = loft(&outer, &[(0.0, LOW), (0.0, 0.9)]);
    let dado = loft(&outer, &[(0.0, 0.9), (-0.04, 0.9), (-0.04, 0.0)]);
    let drum = loft(&inner, &[(0.0, SPRING), (0.0, LOW + 0.35)]);
    let cornice = loft(
        &inner,
        &[
            (0.0, LOW + 0.35),
            (-0.30, LOW + 0.30),
            (-0.34, LOW + 0.20),
            (-0.34, LOW - 0.10),
            (0.34, LOW - 0.10),
            (0.34, LOW),
        ],
    );
    let spring = loft(
        &inner,
        &[(0.0, SPRING + 0.12), (-0.22, SPRING + 0.10), (-0.22, SPRING - 0.05), (0.0, SPRING - 0.16)],
    );
    let ring = |from: Vec2, to: Vec2, y: f32| {
        Shape::patch(AROUND, 4, Vec2::ONE, |u, v| on(from.lerp(to, v), u * TAU) + Vec3::Y * y).planar_uvs()
    };
    // Around by u and outwards by v faces down.
    let low = ring(INNER, OUTER, LOW);
    let walk = ring(OUTER, INNER, 0.0);
    let inlay = ring(INNER, INNER - 1.0, 0.0);
    let court = cap(&superellipse(INNER - 1.0, 2.0, AROUND), 0.0, 0.0, true);
    let dome = Shape::patch(AROUND, 24, Vec2::new(100.0, 20.0), |u, v| {
        let (up, out) = (v * FRAC_PI_2).sin_cos();
        on(INNER * out, u * TAU) + Vec3::Y * (SPRING + RISE * up)
    });
    Piece::default()
        .with(Finish::Plaster, &Shape::union([walls, drum, low, dome]))
        .with(Finish::Oak, &dado)
        .with(Finish::White, &Shape::union([cornice, spring]))
        .with(Finish::Terrazzo, &Shape::union([walk, court]))
        .with(Finish::Accent, &inlay)
}

/// Columns under the drum; every other space between them is walled up, so that the ambulatory lights the hall in strips.
fn colonnade(builder: &mut SceneBuilder, palette: &Palette) {
    let profile = [
        (0.0, 0.0),
        (0.44, 0.0),
        (0.44, 0.12),
        (0.36, 0.20),
        (0.38, 0.27),
        (0.30, 0.36),
        (0.29, 1.5),
        (0.24, LOW - 0.55),
        (0.28, LOW - 0.50),
        (0.30, LOW - 0.40),
        (0.42, LOW - 0.22),
        (0.42, LOW - 0.10),
    ];
    let column = Piece::default().with(Finish::White, &lathe(28, &profile));
    let column = column.object(builder, palette, "column");
    let angle = |i: usize| (i as f32 + 0.5) / COLUMNS as f32 * TAU;
    let mut walls = Shape::default();
    for i in 0..COLUMNS {
        let foot = on(INNER, angle(i));
        builder.place("column", column, None, place(foot, -angle(i)));
        if i % 2 == 0 {
            let next = on(INNER, angle(i + 1));
            let ends = [foot, next].map(|p| Vec2::new(p.x, p.z));
            walls.add(&wall_between(ends[0], ends[1], LOW - 0.10, 0.22, &[]));
        }
    }
    Piece::default().with(Finish::Accent, &walls).fixed(builder, palette, "screens");
}

/// Three rows of curved benches around the middle, with aisles along both axes.
fn benches() -> Piece {
    let (mut seats, mut feet) = (Shape::default(), Shape::default());
    for row in 0..3 {
        let middle = Vec2::new(8.5, 4.6) + 2.1 * row as f32;
        for quarter in 0..4 {
            let (from, to) = (quarter as f32 * FRAC_PI_2 + 0.20, (quarter + 1) as f32 * FRAC_PI_2 - 0.20);
            // A board bent around the hall's middle: a round-cornered section swept along the arc.
            let section = |v: f32| {
                let (sin, cos) = (v * TAU).sin_cos();
                let soft = |x: f32| x.signum() * x.abs().powf(0.35);
                Vec2::new(0.24 * soft(cos), 0.43 + 0.035 * soft(sin))
            };
            seats.add(&Shape::patch(24, 16, Vec2::new(6.0, 1.1), |u, v| {
                let at = section(-v);
                on(middle + at.x, from + (to - from) * u) + Vec3::Y * at.y
            }));
            for leg in 0..4 {
                let a = from + (to - from) * (leg as f32 + 0.4) / 3.8;
                let foot = Shape::block_on(Vec3::ZERO, Vec3::new(0.36, 0.42, 0.05));
                feet.add(&foot.at(place(on(middle, a), -a)));
            }
        }
    }
    Piece::default().with(Finish::Oak, &seats).with(Finish::Black, &feet)
}

/// A globe on a podium in the middle, and vases on plinths around the ambulatory.
fn exhibits(builder: &mut SceneBuilder, palette: &Palette) {
    let podium = lathe(64, &[(0.0, 0.0), (2.3, 0.0), (2.3, 0.16), (1.9, 0.16), (1.9, 0.32), (0.0, 0.32)]);
    let globe = sphere(Vec3::Y * 1.55, 1.05, 64);
    let ring: Vec<_> = (0..=64)
        .map(|i| i as f32 / 64.0 * TAU)
        .map(|a| (Vec3::new(1.4 * a.cos(), 1.55 + 0.5 * a.cos(), 1.4 * a.sin()), 0.03))
        .collect();
    let stand = lathe(32, &[(0.5, 0.32), (0.5, 0.38), (0.2, 0.48), (0.25, 0.56), (0.0, 0.56)]);
    Piece::default()
        .with(Finish::Terrazzo, &podium)
        .with(Finish::Steel, &Shape::union([globe, tube(&ring, 10, false)]))
        .with(Finish::Black, &stand)
        .fixed(builder, palette, "globe");
    let vase = [
        (0.0, 0.0),
        (0.12, 0.0),
        (0.14, 0.03),
        (0.24, 0.22),
        (0.27, 0.40),
        (0.20, 0.58),
        (0.10, 0.68),
        (0.13, 0.76),
        (0.11, 0.76),
        (0.08, 0.68),
    ];
    let plinth = Shape::block_on(Vec3::ZERO, Vec3::new(0.6, 1.0, 0.6));
    let plinths = [Finish::Accent, Finish::Steel, Finish::White].map(|finish| {
        let piece = Piece::default().with(Finish::Terrazzo, &plinth);
        piece.with(finish, &lathe(40, &vase).moved(Vec3::Y)).object(builder, palette, "vase")
    });
    for i in 0..COLUMNS / 2 {
        let angle = (2 * i) as f32 / COLUMNS as f32 * TAU + TAU / COLUMNS as f32;
        let at = place(on(INNER + 1.1, angle), -angle);
        builder.place("vase", plinths[i % plinths.len()], None, at);
    }
}

/// Rings of small round lamps in collars: in the dome and over the ambulatory.
fn lamps(builder: &mut SceneBuilder, palette: &Palette) {
    let glow = Piece::default().with(Finish::Lamp, &cap(&circle(0.07, 8), 0.0, -0.03, false));
    let glow = glow.object(builder, palette, "lamp face");
    let collar = Piece::default().with(Finish::White, &cylinder(Vec3::Y * -0.025, 0.10, 0.03, 12));
    let collar = collar.object(builder, palette, "collar");
    for ring in 0..RINGS {
        let count = FIRST + MORE * ring;
        let (axes, height) = if ring < DOME_RINGS {
            let t = (ring as f32 + 0.6) / DOME_RINGS as f32;
            (INNER * t, vault(t) - 0.08)
        } else {
            let t = (ring - DOME_RINGS) as f32 + 0.5;
            (INNER.lerp(OUTER, t / (RINGS - DOME_RINGS) as f32), LOW - 0.005)
        };
        for i in 0..count {
            let at = on(axes, (i as f32 + 0.5 * (ring % 2) as f32) / count as f32 * TAU);
            let at = Affine3A::from_translation(at + Vec3::Y * height);
            builder.place("collar", collar, None, at);
            builder.place("lamp", glow, None, at);
        }
    }
}

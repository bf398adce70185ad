//! The steelwork: columns, beams, braces, floors of gratings, rails and stairs.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Light, LightKind, SceneBuilder};

use super::{BAY, BAYS, BOILER, LEVELS, PITCH, Palette, fixed, object};
use crate::random::hash;
use crate::shape::{Shape, place};
use crate::solid::tube;

/// A panel of grating, along X and Z, metres.
const PANEL: Vec2 = Vec2::new(2.5, 1.0);

pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) {
    frame(builder, palette);
    gratings(builder, palette);
    rails(builder, palette);
    lamps(builder);
    stairs(builder, palette);
    let ground = Shape::quad(Vec3::new(-160.0, 0.0, 160.0), Vec3::X * 320.0, Vec3::NEG_Z * 320.0);
    fixed(builder, "ground", [(ground, palette.concrete)]);
}

/// An I-beam of `length` along +X from the origin, `depth` high, centred on the axis.
fn beam(length: f32, depth: f32) -> Shape {
    let (flange, web) = (0.06 * depth, 0.03 * depth);
    let half = 0.5 * depth;
    let bar = |y: [f32; 2], z: f32| Shape::block(Vec3::new(0.0, y[0], -z), Vec3::new(length, y[1], z));
    Shape::union([
        bar([half - flange, half], 0.3 * depth),
        bar([-half, flange - half], 0.3 * depth),
        bar([flange - half, half - flange], web),
    ])
}

/// Whether the bay with its lowest corner at column (i, k) is where the boiler hangs.
fn over_boiler(i: i32, k: i32) -> bool {
    let middle = |n: i32, of: i32| (n as f32 + 0.5 - 0.5 * of as f32) * BAY;
    middle(i, BAYS[0]).abs() < BOILER && middle(k, BAYS[1]).abs() < BOILER
}

/// Whether column (i, k) would stand in the boiler.
fn inside_boiler(i: i32, k: i32) -> bool {
    let at = column(i, k, 0);
    at.x.abs() < BOILER && at.z.abs() < BOILER
}

/// Where column (i, k) stands.
fn column(i: i32, k: i32, level: i32) -> Vec3 {
    Vec3::new(
        (i as f32 - 0.5 * BAYS[0] as f32) * BAY,
        level as f32 * PITCH,
        (k as f32 - 0.5 * BAYS[1] as f32) * BAY,
    )
}

/// Whether floor `level` covers bay (i, k): some are left open, none covers the boiler.
fn has_floor(i: i32, k: i32, level: i32) -> bool {
    let within = (0..BAYS[0]).contains(&i) && (0..BAYS[1]).contains(&k);
    within && !over_boiler(i, k) && (level % 4 == 0 || hash(i as u32, k as u32, level as u32) < 0.82)
}

fn frame(builder: &mut SceneBuilder, palette: &Palette) {
    let upright = object(builder, "column", [(beam(PITCH, 0.55), palette.steel)]);
    let main = object(builder, "beam", [(beam(BAY, 0.60), palette.steel)]);
    let brace_length = PITCH.hypot(BAY);
    let brace = [(Vec3::ZERO, 0.09), (Vec3::X * brace_length, 0.09)];
    let brace = object(builder, "brace", [(tube(&brace, 12, false), palette.steel)]);
    let stand = Affine3A::from_rotation_z(FRAC_PI_2);
    let drop = Vec3::Y * 0.36;
    for level in 0..LEVELS {
        for i in 0..=BAYS[0] {
            for k in 0..=BAYS[1] {
                if !inside_boiler(i, k) {
                    builder.place("column", upright, None, place(column(i, k, level), 0.0) * stand);
                }
                let at = column(i, k, level + 1) - drop;
                // The boiler hangs from the topmost beams; below them it interrupts those through its middle.
                let whole = |to: (i32, i32)| {
                    level == LEVELS - 1 || !inside_boiler(i, k) && !inside_boiler(to.0, to.1)
                };
                if i < BAYS[0] && whole((i + 1, k)) {
                    builder.place("beam", main, None, place(at, 0.0));
                }
                if k < BAYS[1] && whole((i, k + 1)) {
                    builder.place("beam", main, None, place(at, -FRAC_PI_2));
                }
                let border = k == 0 || k == BAYS[1];
                if border && i < BAYS[0] && (i + level) % 3 == 0 {
                    let pitch = Affine3A::from_rotation_z(PITCH.atan2(BAY));
                    builder.place("brace", brace, None, place(column(i, k, level), 0.0) * pitch);
                }
            }
        }
    }
}

/// Floors of panels whose bars let light and views through: a bay's panels and joists are one object.
fn gratings(builder: &mut SceneBuilder, palette: &Palette) {
    let panel = panel();
    let (mut bars, mut joists) = (Shape::default(), Shape::default());
    for z in 0..(BAY / PANEL.y) as u32 {
        for x in 0..(BAY / PANEL.x) as u32 {
            bars.add(&panel.clone().moved(Vec3::new(x as f32 * PANEL.x, 0.0, z as f32 * PANEL.y)));
        }
    }
    for z in 1..4 {
        joists.add(&beam(BAY, 0.24).moved(Vec3::new(0.0, -0.16, z as f32 * PANEL.x)));
    }
    let floor = object(builder, "floor", [(bars, palette.zinc), (joists, palette.steel)]);
    for level in 1..=LEVELS {
        for (i, k) in bays().filter(|&(i, k)| has_floor(i, k, level)) {
            builder.place("floor", floor, None, place(column(i, k, level), 0.0));
        }
    }
}

/// Bearing bars along X and cross bars.
fn panel() -> Shape {
    const BEARING: u32 = 34;
    const CROSS: u32 = 34;
    let mut bars = Shape::default();
    for i in 0..BEARING {
        let z = (i as f32 + 0.5) / BEARING as f32 * PANEL.y;
        bars.add(&Shape::block(Vec3::new(0.0, -0.035, z - 0.0025), Vec3::new(PANEL.x, 0.0, z + 0.0025)));
    }
    for i in 0..CROSS {
        let x = (i as f32 + 0.5) / CROSS as f32 * PANEL.x;
        bars.add(&Shape::block(Vec3::new(x - 0.003, -0.010, 0.0), Vec3::new(x + 0.003, -0.004, PANEL.y)));
    }
    bars
}

/// A lamp below the floor over every bay.
fn lamps(builder: &mut SceneBuilder) {
    for level in 1..=LEVELS {
        for (i, k) in bays().filter(|&(i, k)| has_floor(i, k, level)) {
            let kind = LightKind::Point {
                position: column(i, k, level) + Vec3::new(0.5 * BAY, -0.9, 0.5 * BAY + 1.1),
                intensity: Vec3::new(1.0, 0.82, 0.58) * 9.0,
                range: f32::INFINITY,
            };
            builder.light(Light { name: "lamp".into(), kind });
        }
    }
}

fn bays() -> impl Iterator<Item = (i32, i32)> {
    (0..BAYS[0]).flat_map(|i| (0..BAYS[1]).map(move |k| (i, k)))
}

/// Handrails where a floor ends.
fn rails(builder: &mut SceneBuilder, palette: &Palette) {
    let mut shape = Shape::default();
    for y in [0.55, 1.05] {
        shape.add(&tube(&[(Vec3::Y * y, 0.022), (Vec3::new(BAY, y, 0.0), 0.022)], 10, false));
    }
    for i in 0..=8 {
        let x = Vec3::X * (BAY * i as f32 / 8.0);
        shape.add(&tube(&[(x, 0.022), (x + Vec3::Y * 1.05, 0.022)], 10, true));
    }
    let toe = Shape::block(Vec3::new(0.0, 0.0, -0.008), Vec3::new(BAY, 0.12, 0.008));
    let rail = object(builder, "rail", [(shape, palette.yellow), (toe, palette.yellow)]);
    for level in 1..=LEVELS {
        for (i, k) in bays().filter(|&(i, k)| has_floor(i, k, level)) {
            let sides = [
                ((i, k - 1), column(i, k, level), 0.0),
                ((i, k + 1), column(i, k + 1, level), 0.0),
                ((i - 1, k), column(i, k, level), -FRAC_PI_2),
                ((i + 1, k), column(i + 1, k, level), -FRAC_PI_2),
            ];
            for ((i, k), at, yaw) in sides {
                if !has_floor(i, k, level) {
                    builder.place("rail", rail, None, place(at, yaw));
                }
            }
        }
    }
}

/// Flights of stairs with treads of grating, outside the southern front, one above the other.
fn stairs(builder: &mut SceneBuilder, palette: &Palette) {
    const STEPS: u32 = 30;
    const WIDTH: f32 = 1.2;
    let (rise, run) = (PITCH / STEPS as f32, (BAY - 2.0) / STEPS as f32);
    let (mut treads, mut strings) = (Shape::default(), Shape::default());
    for i in 0..STEPS {
        let at = Vec3::new(1.0 + i as f32 * run, (i + 1) as f32 * rise, 0.0);
        for bar in 0..8 {
            let x = at.x + run * bar as f32 / 7.5;
            treads.add(&Shape::block(Vec3::new(x, at.y - 0.035, 0.0), Vec3::new(x + 0.006, at.y, WIDTH)));
        }
    }
    let slope = Vec3::new(BAY - 2.0, PITCH, 0.0);
    let pitch = Affine3A::from_rotation_z(PITCH.atan2(BAY - 2.0));
    for z in [0.0, WIDTH] {
        strings.add(&beam(slope.length(), 0.26).at(pitch).moved(Vec3::new(1.0, 0.0, z)));
        for y in [0.55, 1.05] {
            let rail = [Vec3::ZERO, slope].map(|p| (p + Vec3::new(1.0, y, z), 0.022));
            strings.add(&tube(&rail, 10, false));
        }
        for i in 0..=8 {
            let foot = Vec3::new(1.0, 0.0, z) + slope * (i as f32 / 8.0);
            strings.add(&tube(&[(foot, 0.02), (foot + Vec3::Y * 1.05, 0.02)], 8, false));
        }
    }
    let landing = Shape::block(Vec3::new(0.0, -0.05, -0.1), Vec3::new(1.0, 0.0, 2.0 * WIDTH + 0.4));
    let parts = [(treads, palette.zinc), (strings, palette.yellow), (landing, palette.zinc)];
    let flight = object(builder, "stairs", parts);
    for level in 0..LEVELS {
        for tower in [1, 4] {
            // Flights turn at every floor.
            let at = column(tower, BAYS[1], level) + Vec3::Z * 0.4;
            let frame = if level % 2 == 0 {
                place(at, 0.0)
            } else {
                place(at + Vec3::new(BAY, 0.0, 2.0 * WIDTH + 0.3), std::f32::consts::PI)
            };
            builder.place("stairs", flight, None, frame);
        }
    }
}

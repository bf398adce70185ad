//! The boiler of bent tubes, its drum and ducts; turbines, silos, tanks and the chimney.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::SceneBuilder;

use super::{BAY, BAYS, BOILER, BOILER_ENDS, Palette, fixed, object, parallel};
use crate::shape::{Shape, place};
use crate::solid::{lathe, loft, rectangle, tube};

/// Spacing of the tubes in the boiler's walls, metres.
const TUBE_PITCH: f32 = 0.075;

pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) {
    let walls = parallel(4, wall).into_iter().map(|wall| (wall, palette.boiler));
    fixed(builder, "boiler walls", walls);
    platens(builder, palette);
    drum(builder, palette);
    turbines(builder, palette);
    yard(builder, palette);
}

/// One of the boiler's four walls: tubes side by side from the lower to the upper header, bent around burners and into
/// the hopper.
fn wall(side: usize) -> Shape {
    let count = (2.0 * BOILER / TUBE_PITCH) as usize;
    let [low, high] = BOILER_ENDS;
    let mut shape = Shape::default();
    for i in 0..count {
        let x = (i as f32 + 0.5) * TUBE_PITCH - BOILER;
        let line: Vec<_> = (0..=26)
            .map(|k| {
                let t = k as f32 / 26.0;
                let y = low + (high - low) * t;
                // Towards the middle in the hopper, outwards around four rows of burners.
                let hopper = 5.0 * (1.0 - (y - low) / 6.0).max(0.0);
                let burner = |by: f32, bx: f32| (-((x - bx) / 0.5).powi(2) - ((y - by) / 0.7).powi(2)).exp();
                let around: f32 =
                    [(16.0, -4.0), (16.0, 0.0), (16.0, 4.0), (21.0, -4.0), (21.0, 0.0), (21.0, 4.0)]
                        .into_iter()
                        .map(|(by, bx)| burner(by, bx))
                        .sum();
                (Vec3::new(x, y, BOILER - hopper + 0.35 * around), 0.032)
            })
            .collect();
        shape.add(&tube(&line, 8, false));
    }
    for y in [low, high] {
        let z = if y == low { BOILER - 5.0 } else { BOILER };
        let header = [-BOILER - 0.3, BOILER + 0.3].map(|x| (Vec3::new(x, y, z), 0.22));
        shape.add(&tube(&header, 24, true));
    }
    for k in 0..6 {
        // Buckstays hold the wall.
        let y = 12.0 + 6.5 * k as f32;
        let size = Vec3::new(2.0 * BOILER + 0.8, 0.4, 0.25);
        shape.add(&Shape::block_on(Vec3::new(0.0, y + 1.6, BOILER + 0.30), size));
    }
    shape.at(Affine3A::from_rotation_y(side as f32 * FRAC_PI_2))
}

/// Hanging coils of superheater tubes over the boiler's roof.
fn platens(builder: &mut SceneBuilder, palette: &Palette) {
    let mut coil = Shape::default();
    for layer in 0..10 {
        let z = layer as f32 * 0.09;
        let mut line = Vec::new();
        for turn in 0..14 {
            let x = turn as f32 * 0.28;
            for k in 0..6 {
                let a = k as f32 / 5.0 * std::f32::consts::PI;
                let up = turn % 2 == 0;
                let (y, bend) = if up { (2.6, a.sin()) } else { (0.0, -a.sin()) };
                line.push((Vec3::new(x - 0.14 * a.cos(), y + 0.14 * bend, z), 0.03));
            }
        }
        coil.add(&tube(&line, 8, false));
    }
    let coil = object(builder, "platen", [(coil, palette.boiler)]);
    for i in 0..4 {
        for k in 0..12 {
            let at = Vec3::new(-7.9 + 4.05 * i as f32, BOILER_ENDS[1] + 0.4, -7.6 + 1.3 * k as f32);
            builder.place("platen", coil, None, place(at, 0.0));
        }
    }
}

/// The steam drum on top, downcomers, and the duct to the chimney.
fn drum(builder: &mut SceneBuilder, palette: &Palette) {
    let body = [
        (0.0, -9.6),
        (0.5, -9.55),
        (0.9, -9.3),
        (1.0, -8.9),
        (1.0, 8.9),
        (0.9, 9.3),
        (0.5, 9.55),
        (0.0, 9.6),
    ];
    let lying = Affine3A::from_rotation_z(FRAC_PI_2);
    let drum = lathe(64, &body).at(lying).moved(Vec3::new(0.0, BOILER_ENDS[1] + 1.8, 9.3));
    let mut down = Shape::default();
    for i in 0..8 {
        let x = -7.7 + 2.2 * i as f32;
        let line = [
            (Vec3::new(x, BOILER_ENDS[1] + 1.0, 9.3), 0.16),
            (Vec3::new(x, 8.0, 9.1), 0.16),
            (Vec3::new(x, 7.2, 8.2), 0.16),
            (Vec3::new(x, BOILER_ENDS[0], 3.4), 0.16),
        ];
        down.add(&tube(&line, 20, false));
    }
    // The flue: a duct with ribs from the boiler's back to the chimney.
    let flue = |x0: f32, x1: f32, grow: f32| {
        let (y, z) = ([41.0 - grow, 46.0 + grow], 3.0 + grow);
        Shape::block(Vec3::new(x0, y[0], -z), Vec3::new(x1, y[1], z))
    };
    let mut duct = flue(-50.0, -BOILER - 0.4, 0.0);
    for i in 0..26 {
        let x = -10.0 - 1.5 * i as f32;
        duct.add(&flue(x - 0.06, x + 0.06, 0.18));
    }
    fixed(builder, "drum", [(drum, palette.cladding), (down, palette.pipes[4]), (duct, palette.cladding)]);
}

/// Two turbine sets on a table beside the boiler house.
fn turbines(builder: &mut SceneBuilder, palette: &Palette) {
    let x = 0.5 * BAYS[0] as f32 * BAY + 6.0;
    let mut table = Shape::block(Vec3::new(x, 5.4, -16.0), Vec3::new(x + 42.0, 6.2, 16.0));
    for i in 0..6 {
        for k in 0..4 {
            let foot = Vec3::new(x + 1.5 + 7.8 * i as f32, 0.0, -14.5 + 9.6 * k as f32);
            table.add(&Shape::block_on(foot, Vec3::new(1.2, 5.4, 1.2)));
        }
    }
    fixed(builder, "table", [(table, palette.concrete)]);
    // Casings of three stages, ribbed, and the generator, along Y before they are laid down.
    let mut profile = vec![(0.0, 0.0)];
    for (from, to, radius) in [(0.5, 6.0, 1.3), (8.0, 16.0, 2.2), (18.0, 26.0, 2.2), (28.0, 37.0, 1.8)] {
        profile.push((0.45, from));
        let ribs = ((to - from) / 0.8) as u32;
        for rib in 0..ribs {
            let y = from + 0.2 + 0.8 * rib as f32;
            let swell = radius * (0.75 + 0.25 * (std::f32::consts::PI * (y - from) / (to - from)).sin());
            profile.extend([
                (swell, y),
                (swell, y + 0.5),
                (swell + 0.12, y + 0.52),
                (swell + 0.12, y + 0.72),
                (swell, y + 0.75),
            ]);
        }
        profile.push((0.45, to));
    }
    profile.push((0.0, 37.4));
    let casing = lathe(96, &profile).at(Affine3A::from_rotation_z(-FRAC_PI_2));
    let mut saddles = Shape::default();
    for at in [1.0, 5.4, 8.6, 15.2, 18.6, 25.2, 28.6, 36.2] {
        saddles.add(&Shape::block_on(Vec3::new(at, -2.6, 0.0), Vec3::new(0.8, 2.4, 3.0)));
    }
    let cross: Vec<_> = (0..=24)
        .map(|k| k as f32 / 24.0)
        .map(|t| (Vec3::new(4.0 + 8.0 * t, 1.0 + 3.2 * (t * std::f32::consts::PI).sin(), 0.0), 0.45))
        .collect();
    let over = tube(&cross, 32, false);
    let parts = [(casing, palette.enamel), (saddles, palette.steel), (over, palette.cladding)];
    let set = object(builder, "turbine", parts);
    for z in [-8.0, 8.0] {
        builder.place("turbine", set, None, place(Vec3::new(x + 2.2, 8.8, z), 0.0));
    }
}

/// Chimney, coal silos, tanks.
fn yard(builder: &mut SceneBuilder, palette: &Palette) {
    let mut chimney = vec![(5.5, 0.0)];
    chimney.extend((1..=20).map(|k| k as f32 / 20.0).map(|t| (5.5 - 2.2 * t, 110.0 * t)));
    chimney.extend([(3.7, 110.5), (3.7, 112.0), (2.9, 112.0), (2.9, 104.0)]);
    let chimney = lathe(96, &chimney).moved(Vec3::new(-54.0, 0.0, 0.0));
    fixed(builder, "chimney", [(chimney, palette.brick)]);
    let silo = [
        (0.4, 0.0),
        (0.4, 0.8),
        (3.2, 6.5),
        (3.2, 14.0),
        (3.3, 14.0),
        (3.3, 14.4),
        (0.6, 15.8),
        (0.6, 16.4),
        (0.0, 16.4),
    ];
    let silo = object(builder, "silo", [(lathe(64, &silo), palette.steel)]);
    for i in 0..BAYS[0] {
        let x = (i as f32 + 0.5 - 0.5 * BAYS[0] as f32) * BAY;
        let z = -0.5 * BAYS[1] as f32 * BAY - 4.5;
        builder.place("silo", silo, None, place(Vec3::new(x, 22.0, z), 0.0));
        let legs = loft(&rectangle(Vec2::splat(2.6)), &[(0.0, 0.0), (0.0, 22.0)]);
        fixed(builder, "silo's shaft", [(legs.moved(Vec3::new(x, 0.0, z)), palette.cladding)]);
    }
    let tank = [(0.0, 0.0), (5.0, 0.0), (5.0, 9.0), (5.12, 9.0), (5.12, 9.3), (3.2, 10.6), (0.0, 11.2)];
    let mut spiral: Vec<_> = Vec::new();
    for k in 0..=64 {
        let t = k as f32 / 64.0;
        let (sin, cos) = (0.6 * TAU * t).sin_cos();
        spiral.push((Vec3::new(5.6 * cos, 0.3 + 9.6 * t, 5.6 * sin), 0.03));
    }
    let spiral = tube(&spiral, 8, false);
    let tank = object(builder, "tank", [(lathe(96, &tank), palette.pipes[4]), (spiral, palette.yellow)]);
    for (x, z) in [(-44.0, 30.0), (-30.0, 34.0), (-44.0, 44.0)] {
        builder.place("tank", tank, None, place(Vec3::new(x, 0.0, z), 0.3 * x));
    }
}

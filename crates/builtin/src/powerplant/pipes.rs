//! Pipes in bundles through all storeys, with flanges and valves.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Quat, Vec3};
use heliostat_scene::{Mesh, SceneBuilder};

use super::{BAY, BAYS, LEVELS, PITCH, Palette, meets_boiler, object, parallel};
use crate::random::Rng;
use crate::shape::Shape;
use crate::solid::{lathe, torus, tube};

const BUNDLES: usize = 138;
/// Corners of a bundle's way.
const CORNERS: usize = 9;

/// A straight piece of pipe on which a valve sits.
struct Seat {
    middle: Vec3,
    axis: Vec3,
    radius: f32,
}

pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) {
    let valve = valve(builder, palette);
    let mut parts = Vec::new();
    for (i, (mesh, seats)) in parallel(BUNDLES, bundle).into_iter().enumerate() {
        parts.push((builder.mesh(mesh), palette.pipes[i % palette.pipes.len()]));
        for seat in seats {
            let turn = Quat::from_rotation_arc(Vec3::X, seat.axis);
            let size = Vec3::splat(seat.radius);
            let frame = Affine3A::from_scale_rotation_translation(size, turn, seat.middle);
            builder.place("valve", valve, None, frame);
        }
    }
    // One object: bundles reach through each other, and a ray should not have to enter every one of them.
    let pipes = builder.object("pipes", parts);
    builder.place("pipes", pipes, None, Affine3A::IDENTITY);
}

/// Parallel pipes of one radius along one way.
fn bundle(index: usize) -> (Mesh, Vec<Seat>) {
    let mut rng = Rng::new(0x919E + index as u64);
    let way = way(&mut rng);
    // Few thick ones, many thin ones.
    let radius = 0.04 + 0.26 * rng.unit().powi(3);
    let sides = if radius < 0.1 { 14 } else { 22 };
    let pipes = if radius < 0.1 { 3 + rng.below(4) } else { 1 + rng.below(3) };
    let (mut shape, mut seats) = (Shape::default(), Vec::new());
    for pipe in 0..pipes {
        let shift = Vec3::splat(pipe as f32 * 3.4 * radius);
        let points: Vec<_> = way.iter().map(|p| *p + shift).collect();
        shape.add(&tube(&rounded(&points, radius), sides, true));
        for ends in points.windows(2) {
            let (axis, length) = ((ends[1] - ends[0]).normalize(), ends[0].distance(ends[1]));
            let joints = (length / 3.0) as usize;
            for joint in 1..=joints {
                let at = ends[0].lerp(ends[1], joint as f32 / (joints + 1) as f32);
                shape.add(&flange(at, axis, radius, sides));
            }
            if length > 4.0 && rng.unit() < 0.42 {
                seats.push(Seat { middle: ends[0] + axis * rng.range(0.9, 1.4), axis, radius });
            }
        }
    }
    (shape.mesh(), seats)
}

/// Corners of a way along the axes, under the floors and up between them, around the boiler.
fn way(rng: &mut Rng) -> Vec<Vec3> {
    let half = [BAYS[0] as f32 * 0.5 * BAY - 1.5, BAYS[1] as f32 * 0.5 * BAY - 1.5];
    let height = |rng: &mut Rng| rng.below(LEVELS as usize) as f32 * PITCH + rng.range(3.0, 4.6);
    let mut at = Vec3::new(half[0] - 2.0, 0.0, rng.range(-half[1], half[1]));
    at.y = height(rng);
    let mut way = vec![at];
    for step in 0.. {
        if way.len() == CORNERS || step == 200 {
            break;
        }
        let mut next = at;
        match way.len() % 3 {
            0 => next.y = height(rng),
            1 => next.x = rng.range(-half[0], half[0]),
            _ => next.z = rng.range(-half[1], half[1]),
        }
        if next.distance(at) > 2.5 && !meets_boiler(at, next) {
            way.push(next);
            at = next;
        }
    }
    way
}

/// The points of a pipe with bends of three radii in place of the corners, each with the pipe's radius.
fn rounded(points: &[Vec3], radius: f32) -> Vec<(Vec3, f32)> {
    const STEPS: u32 = 7;
    let bend = 3.0 * radius;
    let mut line = vec![(points[0], radius)];
    for corner in points.windows(3) {
        let [a, b] = [corner[0] - corner[1], corner[2] - corner[1]].map(Vec3::normalize);
        let center = corner[1] + bend * (a + b);
        for step in 0..=STEPS {
            let (sin, cos) = (step as f32 / STEPS as f32 * FRAC_PI_2).sin_cos();
            line.push((center - bend * (cos * b + sin * a), radius));
        }
    }
    line.push((points[points.len() - 1], radius));
    line
}

/// Two rings bolted together.
fn flange(at: Vec3, axis: Vec3, radius: f32, sides: u32) -> Shape {
    let (out, thick) = (1.55 * radius, 0.22 * radius);
    let profile = [
        (radius, -thick),
        (out, -thick),
        (out, -0.04 * radius),
        (0.95 * out, 0.0),
        (out, 0.04 * radius),
        (out, thick),
        (radius, thick),
    ];
    let turn = Affine3A::from_rotation_translation(Quat::from_rotation_arc(Vec3::Y, axis), at);
    lathe(sides, &profile).at(turn)
}

/// A gate valve on a pipe of radius 1 along X: body, bonnet, spindle and handwheel.
fn valve(builder: &mut SceneBuilder, palette: &Palette) -> heliostat_scene::ObjectId {
    let along = Affine3A::from_rotation_z(-FRAC_PI_2);
    let body = [
        (1.0, -2.4),
        (1.75, -2.4),
        (1.75, -1.95),
        (1.15, -1.9),
        (1.5, -0.9),
        (1.6, 0.0),
        (1.5, 0.9),
        (1.15, 1.9),
        (1.75, 1.95),
        (1.75, 2.4),
        (1.0, 2.4),
    ];
    let mut iron = lathe(16, &body).at(along);
    let bonnet = [
        (1.2, 0.8),
        (1.1, 2.2),
        (1.6, 2.25),
        (1.6, 2.75),
        (0.7, 2.85),
        (0.5, 3.6),
        (0.3, 3.7),
        (0.18, 3.8),
        (0.18, 5.2),
        (0.0, 5.3),
    ];
    iron.add(&lathe(14, &bonnet));
    let mut wheel = torus(Vec3::Y * 4.9, 1.7, 0.16, [20, 6]);
    for i in 0..4 {
        let (sin, cos) = (i as f32 * FRAC_PI_2).sin_cos();
        let rim = Vec3::new(1.7 * cos, 4.9, 1.7 * sin);
        wheel.add(&tube(&[(Vec3::Y * 4.9, 0.11), (rim, 0.11)], 6, false));
    }
    object(builder, "valve", [(iron, palette.enamel), (wheel, palette.red)])
}

//! A car's body: one superellipse after the other along its length, hollows for the wheels, a cabin of glass.

use std::f32::consts::{PI, TAU};

use glam::{Affine3A, Vec2, Vec3};

use super::wheel::RADIUS;
use crate::shape::Shape;
use crate::solid::{cap, loft, sphere, superellipse, torus, tube};

/// Half of the length and of the width, metres. The front is at −x.
const HALF_LENGTH: f32 = 2.15;
const HALF_WIDTH: f32 = 0.90;
/// Places of the axles along x, and of the wheels' middles to either side.
pub(super) const AXLES: [f32; 2] = [-1.32, 1.30];
pub(super) const TRACK: f32 = 0.755;
/// Of the hollows around the wheels.
const ARCH: f32 = 0.385;
/// Height at which the cabin begins, sunk into the body.
const WAIST: f32 = 0.80;

pub(super) struct Body {
    pub(super) painted: Shape,
    pub(super) windows: Shape,
    pub(super) trim: Shape,
    pub(super) chrome: Shape,
    pub(super) head_lamps: Shape,
    pub(super) tail_lamps: Shape,
}

pub(super) fn parts() -> Body {
    let hull = Shape::patch(640, 200, Vec2::new(2.0 * HALF_LENGTH, 4.0), hull);
    let mut trim = Shape::default();
    for x in AXLES {
        for side in [1.0, -1.0] {
            let edge = torus(Vec3::ZERO, ARCH + 0.004, 0.016, [96, 12]);
            let upright = Affine3A::from_rotation_x(0.5 * PI);
            let place = Affine3A::from_translation(Vec3::new(x, RADIUS, side * (arch_depth(x) - 0.008)));
            trim.add(&edge.at(place * upright));
        }
    }
    // The mouth below the front, and the same at the back.
    for (x, y, size) in [(-2.085, 0.40, Vec3::new(0.1, 0.13, 1.05)), (2.10, 0.34, Vec3::new(0.08, 0.10, 1.1))]
    {
        trim.add(&Shape::rounded_block(size, 0.04, 4, 1).moved(Vec3::new(x, y, 0.0)));
    }
    let (windows, roof, pillars) = cabin();
    trim.add(&pillars);
    let lamp = |x: f32, y: f32, z: f32, size: Vec3, turn: f32| {
        let stretched = Affine3A::from_translation(Vec3::new(x, y, z)) * Affine3A::from_rotation_y(turn);
        sphere(Vec3::ZERO, 1.0, 48).at(stretched * Affine3A::from_scale(size))
    };
    let both = |make: &dyn Fn(f32) -> Shape| Shape::union([make(1.0), make(-1.0)]);
    let mirrors = both(&|side| {
        let at = Vec3::new(-0.62, 0.93, side * 0.93);
        Shape::rounded_block(Vec3::new(0.13, 0.11, 0.2), 0.05, 5, 1).moved(at)
    });
    let chrome = both(&|side| {
        let z = side * (HALF_WIDTH + 0.004);
        tube(&[(Vec3::new(0.10, 0.76, z), 0.011), (Vec3::new(0.28, 0.76, z), 0.011)], 12, true)
    });
    Body {
        painted: Shape::union([hull, roof, mirrors]),
        windows,
        trim,
        chrome,
        head_lamps: both(&|side| lamp(-1.955, 0.60, side * 0.60, Vec3::new(0.10, 0.055, 0.19), side * 0.42)),
        tail_lamps: both(&|side| lamp(2.045, 0.70, side * 0.56, Vec3::new(0.05, 0.045, 0.25), side * -0.22)),
    }
}

fn smooth(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// sign(x) |x|ᵉ
fn power(x: f32, exponent: f32) -> f32 {
    x.abs().powf(exponent).copysign(x)
}

/// Half the width where the wheels are, at their height.
fn arch_depth(x: f32) -> f32 {
    HALF_WIDTH * (1.0 - (x / HALF_LENGTH).abs().powf(5.0)).max(0.0).powf(0.2)
}

/// A point of the body: u around, v from the front to the back.
fn hull(u: f32, v: f32) -> Vec3 {
    // Along the length as along a superellipse of exponent 5, so that both ends are round.
    let (sin, cos) = (PI * v.clamp(0.0, 1.0)).sin_cos();
    let x = -HALF_LENGTH * power(cos, 0.4);
    let end = sin.max(0.0).powf(0.4);
    let bonnet = 0.66 + 0.20 * smooth(-2.1, -0.75, x);
    let top = bonnet + 0.05 * smooth(0.3, 1.5, x) - 0.03 * smooth(1.7, 2.15, x);
    let bottom = 0.19 + 0.09 * smooth(1.3, 2.1, x.abs());
    let (middle, half) = (0.5 * (top + bottom), 0.5 * (top - bottom));
    let (sin, cos) = (-TAU * u).sin_cos();
    let y = middle + half * power(sin, 0.55) * end.powf(0.45);
    // Narrower above the shoulder, with a hollow along the doors.
    let height = (y - bottom) / (top - bottom);
    let doors = smooth(-1.1, -0.8, x) * (1.0 - smooth(0.8, 1.1, x));
    let hollow = 0.022 * (-((height - 0.40) / 0.16).powi(2)).exp() * doors;
    let width = HALF_WIDTH * (1.0 - 0.06 * smooth(0.62, 1.0, height)) - hollow;
    let z = width * power(cos, 0.42) * end;
    Vec3::new(x, y, arched(x, y, z))
}

/// Moves the sides inwards around the wheels.
fn arched(x: f32, y: f32, z: f32) -> f32 {
    let nearest = AXLES.map(|axle| Vec2::new(x - axle, y - RADIUS).length());
    let inside = 1.0 - smooth(ARCH - 0.012, ARCH + 0.012, nearest[0].min(nearest[1]));
    let inner = z.clamp(-0.55, 0.55);
    z + (inner - z) * inside
}

/// Windows, roof and pillars: a cabin that leans inwards all round, most at the front and the back.
fn cabin() -> (Shape, Shape, Shape) {
    let outline = superellipse(Vec2::new(1.42, 0.765), 3.2, 192);
    let glass = [(0.02, -0.05), (0.0, 0.02), (-0.035, 0.14), (-0.085, 0.27), (-0.13, 0.36)];
    let roof = [
        (-0.13, 0.36),
        (-0.155, 0.395),
        (-0.20, 0.43),
        (-0.28, 0.458),
        (-0.40, 0.475),
        (-0.55, 0.483),
        (-0.7, 0.486),
    ];
    let lean = |p: Vec3| {
        // The windscreen lies flatter than the rear window.
        let slope = if p.x < 0.0 { 1.25 } else { 0.95 };
        let height = p.y.max(0.0);
        let shortened = p.x * (1.0 - slope * height).max(0.35);
        Vec3::new(shortened + 0.42, p.y + WAIST, p.z)
    };
    let windows = loft(&outline, &glass).warped(lean);
    let mut top = loft(&outline, &roof);
    top.add(&cap(&outline, -0.7, 0.486, true));
    let mut pillars = Shape::default();
    for (x, n) in [(-0.62, 1.0), (0.05, 1.0), (0.72, 1.0), (-0.62, -1.0), (0.05, -1.0), (0.72, -1.0)] {
        let at = |growth: f32, y: f32| {
            let z = 0.765 * (1.0 - (x / 1.42_f32).abs().powf(3.2)).powf(1.0 / 3.2) + growth;
            lean(Vec3::new(x, y, n * z))
        };
        let points: Vec<(Vec3, f32)> = glass.iter().map(|&(growth, y)| (at(growth, y), 0.018)).collect();
        pillars.add(&tube(&points, 12, false));
    }
    (windows, top.warped(lean), pillars)
}

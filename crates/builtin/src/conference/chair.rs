//! An office chair on five castors.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Vec3};
use heliostat_scene::{ObjectId, SceneBuilder};

use super::{Palette, object};
use crate::shape::Shape;
use crate::solid::{lathe, tube};

/// The chair stands on the origin and faces −Z.
pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) -> ObjectId {
    let cushions = Shape::union([seat(), back()]);
    let frame = Shape::union([star(), arm(1.0), arm(-1.0), shell()]);
    object(builder, "chair", [(cushions, palette.cushion), (frame, palette.black), (metal(), palette.chrome)])
}

/// Hollowed for sitting, rolled down at the front edge.
fn seat() -> Shape {
    Shape::rounded_block(Vec3::new(0.50, 0.085, 0.49), 0.04, 2, 4)
        .warped(|p| {
            let hollow = 0.9 * p.x * p.x + 0.35 * p.z * p.z;
            let roll = 6.0 * (-p.z - 0.10).max(0.0).powi(3);
            Vec3::new(p.x * (1.0 - 0.25 * p.z), p.y + 0.5 * hollow - 3.0 * roll, p.z)
        })
        .moved(Vec3::Y * 0.465)
}

/// Curved around the sitter, bulging at the small of the back, leaning backwards.
fn back() -> Shape {
    Shape::rounded_block(Vec3::new(0.46, 0.60, 0.06), 0.028, 2, 5).warped(back_bend)
}

/// The stiff shell behind the back's cushion.
fn shell() -> Shape {
    let panel = Shape::rounded_block(Vec3::new(0.42, 0.54, 0.02), 0.009, 1, 4);
    let panel = panel.warped(|p| back_bend(p + Vec3::Z * 0.042));
    let spine = [(0.28, 0.40, 0.03), (0.31, 0.42, 0.024), (0.335, 0.52, 0.024), (0.36, 0.70, 0.022)];
    let spine: Vec<_> =
        [(0.02, 0.40, 0.03)].into_iter().chain(spine).map(|(z, y, r)| (Vec3::new(0.0, y, z), r)).collect();
    Shape::union([panel, tube(&spine, 12, true)])
}

fn back_bend(p: Vec3) -> Vec3 {
    let taper = 1.0 - 0.25 * (p.y + 0.1).max(0.0);
    let wrap = -0.9 * p.x * p.x;
    let lumbar = -0.045 * (-((p.y + 0.14) / 0.13).powi(2)).exp();
    let lean = 0.16 * p.y;
    Vec3::new(p.x * taper, p.y + 0.86, p.z + wrap + lumbar + lean + 0.27)
}

/// An arm rest at the side `x` = ±1: a bracket and a pad.
fn arm(x: f32) -> Shape {
    let bracket: Vec<_> = [
        (0.10, 0.44, 0.06),
        (0.235, 0.44, 0.06),
        (0.285, 0.48, 0.05),
        (0.29, 0.60, 0.03),
        (0.28, 0.665, 0.0),
    ]
    .map(|(out, y, z)| (Vec3::new(out * x, y, z), 0.017))
    .into();
    let pad =
        Shape::rounded_block(Vec3::new(0.07, 0.03, 0.26), 0.014, 2, 2).moved(Vec3::new(0.28 * x, 0.675, 0.0));
    Shape::union([tube(&bracket, 12, false), pad])
}

/// Five legs with a twin castor each.
fn star() -> Shape {
    let wheel =
        [(0.0, -0.012), (0.024, -0.012), (0.029, -0.006), (0.029, 0.006), (0.024, 0.012), (0.0, 0.012)];
    let wheel = lathe(12, &wheel).at(Affine3A::from_rotation_z(FRAC_PI_2));
    let mut leg = Shape::rounded_block(Vec3::new(0.30, 0.036, 0.05), 0.014, 1, 3).warped(|p| {
        let t = (p.x + 0.15) / 0.30;
        Vec3::new(p.x + 0.17, p.y * (1.3 - 0.6 * t) + 0.105 - 0.035 * t, p.z * (1.15 - 0.45 * t))
    });
    for side in [-0.019, 0.019] {
        leg.add(&wheel.clone().at(Affine3A::from_rotation_y(0.5)).moved(Vec3::new(0.30, 0.03, side)));
    }
    Shape::union((0..5).map(|i| leg.clone().at(Affine3A::from_rotation_y(i as f32 / 5.0 * TAU + 0.3))))
}

/// The gas spring, the hub, and the plate under the seat.
fn metal() -> Shape {
    let spring = [
        (0.0, 0.07),
        (0.035, 0.07),
        (0.042, 0.085),
        (0.042, 0.13),
        (0.034, 0.14),
        (0.026, 0.145),
        (0.026, 0.27),
        (0.014, 0.275),
        (0.014, 0.38),
        (0.05, 0.39),
        (0.05, 0.41),
        (0.0, 0.41),
    ];
    let plate = Shape::rounded_block(Vec3::new(0.26, 0.02, 0.24), 0.008, 2, 1).moved(Vec3::Y * 0.415);
    let lever: Vec<_> =
        [(0.02, 0.40), (0.16, 0.40), (0.24, 0.39)].map(|(x, y)| (Vec3::new(x, y, -0.05), 0.007)).into();
    Shape::union([lathe(24, &spring), plate, tube(&lever, 8, true)])
}

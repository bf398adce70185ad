//! A wheel: a tyre, a rim with spokes, a brake disk; its axle is z, its outside at +z.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Vec3};

use crate::shape::Shape;
use crate::solid::lathe;

/// Of the tyre, metres.
pub(super) const RADIUS: f32 = 0.335;
const HALF_WIDTH: f32 = 0.11;
const SPOKES: usize = 10;

pub(super) struct Wheel {
    pub(super) tyre: Shape,
    pub(super) rim: Shape,
    pub(super) brake: Shape,
}

pub(super) fn parts() -> Wheel {
    // Lathes turn about y; +y becomes +z.
    let axle = Affine3A::from_rotation_x(FRAC_PI_2);
    let w = HALF_WIDTH;
    let tyre = [
        (0.235, -w),
        (0.29, -w),
        (0.317, -0.85 * w),
        (0.332, -0.6 * w),
        (RADIUS, -0.3 * w),
        (RADIUS, 0.3 * w),
        (0.332, 0.6 * w),
        (0.317, 0.85 * w),
        (0.29, w),
        (0.235, w),
        (0.228, 0.8 * w),
    ];
    let rim = [
        (0.19, -0.9 * w),
        (0.236, -0.95 * w),
        (0.236, 0.95 * w),
        (0.232, 1.02 * w),
        (0.222, 0.98 * w),
        (0.205, 0.5 * w),
        (0.19, -0.9 * w),
    ];
    let hub = [
        (0.0, 0.2 * w),
        (0.06, 0.2 * w),
        (0.06, 0.62 * w),
        (0.045, 0.8 * w),
        (0.03, 0.82 * w),
        (0.0, 0.84 * w),
    ];
    let mut metal = Shape::union([lathe(96, &rim), lathe(48, &hub)]).at(axle);
    for spoke in 0..SPOKES {
        let turn = Affine3A::from_rotation_z(spoke as f32 / SPOKES as f32 * TAU);
        let lean =
            Affine3A::from_translation(Vec3::new(0.13, 0.0, 0.66 * w)) * Affine3A::from_rotation_y(-0.10);
        metal.add(&Shape::rounded_block(Vec3::new(0.19, 0.026, 0.024), 0.008, 3, 1).at(turn * lean));
    }
    let brake = [(0.0, -0.5 * w), (0.17, -0.5 * w), (0.17, -0.3 * w), (0.0, -0.3 * w)];
    let well = [(0.0, -0.8 * w), (0.19, -0.8 * w), (0.19, -0.75 * w), (0.0, -0.75 * w)];
    Wheel {
        tyre: lathe(96, &tyre).at(axle),
        rim: metal,
        brake: Shape::union([lathe(64, &brake), lathe(64, &well)]).at(axle),
    }
}

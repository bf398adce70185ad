//! The surfaces that make the beam: reflector, lens, bulb and filament. The filament is at the origin.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Affine3A, Vec2, Vec3};

use crate::shape::Shape;
use crate::solid::{lathe, tube};

/// Half the reflector's aperture and half the lens, along X and Y, metres.
const APERTURE: Vec2 = Vec2::new(0.130, 0.080);
pub(super) const LENS: Vec2 = Vec2::new(0.134, 0.084);
/// Focal length of the reflector's paraboloid, metres.
const FOCUS: f32 = 0.036;
/// Facets of the reflector, and quadrilaterals along an edge of each.
const FACETS: [u32; 2] = [32, 18];
const FINENESS: u32 = 18;
/// How much more strongly than the paraboloid facets curve along X and Y, 1/m: they spread the beam to the sides.
const SPREAD: Vec2 = Vec2::new(3.0, 0.8);
/// Radius of the hole for the bulb, metres.
const HOLE: f32 = 0.0105;
/// The lens: where its outer face is on the axis, its thickness, the flutes' pitch and depth, metres.
const FACE: f32 = 0.150;
const THICKNESS: f32 = 0.0045;
const FLUTE: f32 = 0.0078;
const FLUTE_DEPTH: f32 = 0.0009;
/// Radii of the filament's coil and of its wire, metres, its turns, and its ends along Z.
pub(super) const COIL: f32 = 0.0007;
const WIRE: f32 = 0.000_12;
const TURNS: u32 = 14;
pub(super) const FILAMENT_ENDS: [f32; 2] = [-0.002_25, 0.002_25];

/// From solids about +Y to ones about the lamp's axis, −Z.
pub(super) fn forwards() -> Affine3A {
    Affine3A::from_rotation_x(-FRAC_PI_2)
}

/// A paraboloid about the filament, cut into facets of stronger curvature. It faces the lens.
pub(super) fn reflector() -> Shape {
    let size = 2.0 * APERTURE / Vec2::new(FACETS[0] as f32, FACETS[1] as f32);
    let mut shape = Shape::default();
    for j in 0..FACETS[1] {
        for i in 0..FACETS[0] {
            let middle = (Vec2::new(i as f32, j as f32) + 0.5) * size - APERTURE;
            if middle.length() < HOLE {
                continue;
            }
            // About the facet's own middle: differences of small numbers keep the normals exact.
            let facet = Shape::patch(FINENESS, FINENESS, size, |u, v| {
                let own = Vec2::new(0.5 - u, v - 0.5) * size;
                let rise = (2.0 * middle.dot(own) + own.length_squared()) / (4.0 * FOCUS);
                // Bulging the same at all borders, facets meet without gaps.
                let bulge = (own * own - 0.25 * size * size).dot(SPREAD);
                own.extend(bulge - rise)
            });
            let depth = FOCUS - middle.length_squared() / (4.0 * FOCUS);
            shape.add(&facet.moved(middle.extend(depth)));
        }
    }
    shape
}

/// A closed pane with a smooth, slightly curved outer face and flutes inside: upright ones that spread the beam to the
/// sides in the upper part, slanting ones below.
pub(super) fn lens() -> Shape {
    const ACROSS: u32 = 480;
    const UP: u32 = 190;
    let outer = |p: Vec2| FACE - 0.55 * p.x * p.x - 0.35 * p.y * p.y;
    let inner = |p: Vec2| {
        let slant = if p.y < -0.02 { 0.35 * (p.y + 0.02) } else { 0.0 };
        // The flutes run out towards the border, so that the rim stays as thick as the pane.
        let rim = (1.0 - (p / LENS).abs().max_element()).clamp(0.0, 0.08) / 0.08;
        let wave = 0.5 - 0.5 * (TAU * (p.x + slant) / FLUTE).cos();
        outer(p) - THICKNESS - FLUTE_DEPTH * rim * wave
    };
    let at = |x: f32, y: f32| Vec2::new(x, y) * LENS;
    let on = |p: Vec2, w: f32| Vec3::new(p.x, p.y, -w);
    let size = 2.0 * LENS;
    let front = Shape::patch(ACROSS, UP, size, |u, v| {
        let p = at(1.0 - 2.0 * u, 2.0 * v - 1.0);
        on(p, outer(p))
    });
    let back = Shape::patch(ACROSS, UP, size, |u, v| {
        let p = at(2.0 * u - 1.0, 2.0 * v - 1.0);
        on(p, inner(p))
    });
    // The rim, `t` from the inner face to the outer one.
    let rim = |p: Vec2, t: f32| on(p, inner(p) + (outer(p) - inner(p)) * t);
    let right = Shape::patch(1, UP, size, |u, v| rim(at(1.0, 2.0 * v - 1.0), u));
    let left = Shape::patch(1, UP, size, |u, v| rim(at(-1.0, 2.0 * v - 1.0), 1.0 - u));
    let top = Shape::patch(ACROSS, 1, size, |u, v| rim(at(2.0 * u - 1.0, 1.0), v));
    let bottom = Shape::patch(ACROSS, 1, size, |u, v| rim(at(2.0 * u - 1.0, -1.0), 1.0 - v));
    Shape::union([front, back, right, left, top, bottom])
}

/// The bulb's glass: outside upwards and back down on the inside, round at the tip.
pub(super) fn envelope() -> Shape {
    let (outer, inner, foot, tip) = (0.0060, 0.0051, -0.0184, 0.0085);
    let dome = |radius: f32, steps: u32| {
        (0..=steps).map(move |k| {
            let (sin, cos) = (k as f32 / steps as f32 * FRAC_PI_2).sin_cos();
            (if k == steps { 0.0 } else { radius * cos }, tip + radius * sin)
        })
    };
    let mut profile: Vec<(f32, f32)> =
        (0..=16).map(|k| (outer, foot + (tip - foot) * k as f32 / 16.0)).collect();
    profile.extend(dome(outer, 20).skip(1));
    let mut inside: Vec<(f32, f32)> =
        (0..=16).map(|k| (inner, foot + 0.0008 + (tip - foot - 0.0008) * k as f32 / 16.0)).collect();
    inside.extend(dome(inner, 20).skip(1));
    profile.extend(inside.into_iter().rev());
    // Closed at the foot, so that it is a solid.
    let mut closed = vec![(0.0, foot)];
    closed.extend(profile);
    closed.push((0.0, foot + 0.0008));
    lathe(128, &closed).at(forwards())
}

/// A coil of wire along the axis.
pub(super) fn filament() -> Shape {
    const STEPS: u32 = 32;
    let [from, to] = FILAMENT_ENDS;
    let line: Vec<_> = (0..=TURNS * STEPS)
        .map(|k| {
            let t = k as f32 / (TURNS * STEPS) as f32;
            let (sin, cos) = (2.0 * PI * TURNS as f32 * t).sin_cos();
            (Vec3::new(COIL * cos, COIL * sin, from + (to - from) * t), WIRE)
        })
        .collect();
    tube(&line, 24, true)
}

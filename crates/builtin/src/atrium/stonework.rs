//! The atrium's architecture: columns, arcades, cornices, walls, floors and roof.

use std::f32::consts::PI;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{ObjectId, SceneBuilder};

use super::{
    BAY, EAVES, HALF_LENGTH, HALF_WIDTH, Palette, STOREYS, Storey, UPPER_FLOOR, WALK, at_bay, bays, fixed,
    object,
};
use crate::shape::{Shape, place};
use crate::solid::{lathe, loft, rectangle, torus, tube};

/// Thickness of the arcade's wall.
const WALL: f32 = 0.62;
/// Radius of the arches' openings.
const ARCH: f32 = 1.27;

pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) {
    for storey in STOREYS {
        arcade(builder, palette, storey);
    }
    balustrade(builder, palette);
    shell(builder, palette);
    roof(builder, palette);
    beams(builder, palette);
}

fn arcade(builder: &mut SceneBuilder, palette: &Palette, storey: Storey) {
    let column = column(builder, palette, storey);
    let (long, short) = (BAY, super::END_BAY);
    let walls = [long, short].map(|width| {
        let wall = builder.mesh(arch_wall(width, storey.top - storey.spring).mesh());
        let trim = builder.mesh(arch_trim(width).mesh());
        builder.object("arch", [(wall, palette.ashlar), (trim, palette.limestone)])
    });
    for bay in bays() {
        let wall = if bay.2 == long { walls[0] } else { walls[1] };
        builder.instance(wall, at_bay(bay, storey.spring));
        // Each bay brings the column on its left; those at the corners are piers instead.
        let left = place(bay.0, bay.1).transform_point3(Vec3::X * -0.5 * bay.2);
        if left.x.abs() < HALF_LENGTH - 0.1 || left.z.abs() < HALF_WIDTH - 0.1 {
            builder.instance(column, place(left + Vec3::Y * storey.floor, bay.1));
        }
    }
    let pier = object(builder, "pier", pier(storey), palette.limestone);
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        builder.instance(pier, place(Vec3::new(x * HALF_LENGTH, storey.floor, z * HALF_WIDTH), 0.0));
    }
    // A moulding runs round the court at the top of each storey: downwards along the profile is the inside.
    let (face, y) = (-0.5 * WALL, storey.top);
    let profile = [
        (face, y + 0.32),
        (face - 0.36, y + 0.32),
        (face - 0.36, y + 0.22),
        (face - 0.30, y + 0.20),
        (face - 0.20, y + 0.10),
        (face - 0.12, y + 0.06),
        (face - 0.12, y),
        (face - 0.06, y - 0.02),
        (face - 0.06, y - 0.09),
        (face, y - 0.12),
    ];
    let court = rectangle(Vec2::new(HALF_LENGTH, HALF_WIDTH));
    fixed(builder, "cornice", loft(&court, &profile), palette.limestone);
}

/// A fluted column with an Attic base and a leafy capital, from the floor to where the arches spring.
fn column(builder: &mut SceneBuilder, palette: &Palette, storey: Storey) -> ObjectId {
    let (r, height) = (storey.column_radius, storey.spring - storey.floor);
    let base_top = 0.24 + 0.9 * r;
    let neck = height - 2.9 * r;
    let mut shape = Shape::block_on(Vec3::ZERO, Vec3::new(3.0 * r, 0.24, 3.0 * r));
    // Torus, scotia, torus.
    let base: Vec<_> = [
        (1.40, 0.0),
        (1.47, 0.12),
        (1.42, 0.26),
        (1.26, 0.30),
        (1.18, 0.42),
        (1.20, 0.52),
        (1.30, 0.58),
        (1.29, 0.74),
        (1.12, 0.80),
        (1.0, 0.90),
    ]
    .iter()
    .map(|&(x, y)| (x * r, 0.24 + y * r))
    .collect();
    shape.add(&lathe(20, &base));
    shape.add(&shaft(r, base_top, neck));
    let bell: Vec<_> =
        [(0.86, 0.0), (0.95, 0.06), (0.86, 0.14), (0.88, 1.2), (1.02, 1.9), (1.30, 2.4), (1.36, 2.5)]
            .iter()
            .map(|&(x, y)| (x * r, neck + y * r))
            .collect();
    shape.add(&lathe(20, &bell));
    for row in 0..2 {
        for i in 0..8 {
            let turn = (i as f32 + 0.5 * row as f32) * 0.25 * PI;
            let foot = neck + 0.15 * r;
            shape.add(&acanthus(r, (1.05 + 0.75 * row as f32) * r, foot).at(Affine3A::from_rotation_y(turn)));
        }
    }
    // Volutes under the abacus's corners.
    for i in 0..4 {
        let turn = Affine3A::from_rotation_y((i as f32 + 0.5) * 0.5 * PI);
        let scroll = torus(Vec3::ZERO, 0.22 * r, 0.10 * r, [8, 5]).at(Affine3A::from_rotation_x(0.5 * PI));
        shape.add(&scroll.moved(Vec3::new(1.52 * r, neck + 2.2 * r, 0.0)).at(turn));
    }
    shape.add(&Shape::block_on(Vec3::Y * (neck + 2.5 * r), Vec3::new(3.0 * r, 0.4 * r, 3.0 * r)));
    object(builder, "column", shape, palette.limestone)
}

/// A shaft with sixteen flutes and a slight swelling.
fn shaft(r: f32, bottom: f32, top: f32) -> Shape {
    const FLUTES: u32 = 16;
    Shape::patch(FLUTES * 4, 10, Vec2::new(2.0 * PI * r, top - bottom), |u, v| {
        let ends = (v * (1.0 - v) * 30.0).clamp(0.0, 1.0);
        let flute = 0.055 * ends * (1.0 - (FLUTES as f32 * PI * u).cos().powi(2).powf(0.6));
        let swell = 1.0 - 0.14 * v * v;
        let (sin, cos) = (2.0 * PI * u).sin_cos();
        let radius = r * (swell - flute);
        Vec3::new(radius * cos, bottom + v * (top - bottom), -radius * sin)
    })
}

/// One leaf of a capital, standing against the bell on the +X side and curling outwards at its tip.
fn acanthus(r: f32, height: f32, foot: f32) -> Shape {
    Shape::patch(2, 5, Vec2::splat(0.3), |u, v| {
        let width = 0.62 * r * (1.0 - 0.75 * v * v);
        let angle = (u - 0.5) * width / r * 1.3;
        let curl = (v * 1.15).powi(5) * 0.42 * r;
        let bulge = 0.05 * r * (2.0 * PI * u).cos();
        let reach = 0.93 * r + 0.10 * r * v + curl - bulge;
        let y = foot + height * (v - 0.35 * v.powi(8));
        Vec3::new(reach * angle.cos(), y, -reach * angle.sin())
    })
}

fn pier(storey: Storey) -> Shape {
    let height = storey.spring - storey.floor;
    let half = 0.36;
    let profile = [
        (0.10, 0.0),
        (0.10, 0.28),
        (0.06, 0.32),
        (0.0, 0.40),
        (0.0, height - 0.42),
        (0.04, height - 0.38),
        (0.04, height - 0.30),
        (0.10, height - 0.14),
        (0.10, height),
    ];
    loft(&rectangle(Vec2::splat(half)), &profile)
}

/// The wall above one arch: two faces, the soffit, and the undersides that rest on the capitals.
fn arch_wall(width: f32, height: f32) -> Shape {
    const STEPS: u32 = 16;
    let half = 0.5 * width;
    let mut shape = Shape::default();
    for side in [1.0f32, -1.0] {
        let z = side * 0.5 * WALL;
        let normal = Vec3::Z * side;
        let mut vertex =
            |x: f32, y: f32| shape.vertex(Vec3::new(side * x, y, z), normal, Vec2::new(side * x + half, -y));
        // Seen from its own side, each face runs from left to right below (the arch) and above (the top edge).
        let arch: Vec<u32> = (0..=STEPS)
            .map(|i| PI * (1.0 - i as f32 / STEPS as f32))
            .map(|a| vertex(ARCH * a.cos(), ARCH * a.sin()))
            .collect();
        let top: Vec<u32> =
            (0..=STEPS).map(|i| vertex(-half + width * i as f32 / STEPS as f32, height)).collect();
        let feet = [vertex(-half, 0.0), vertex(half, 0.0)];
        let last = STEPS as usize;
        for i in 0..last {
            shape.quad_face([arch[i], arch[i + 1], top[i + 1], top[i]]);
        }
        shape.triangle([feet[0], arch[0], top[0]]);
        shape.triangle([arch[last], feet[1], top[last]]);
    }
    let soffit = Shape::patch(STEPS, 1, Vec2::new(PI * ARCH, WALL), |u, v| {
        let (sin, cos) = (PI * u).sin_cos();
        Vec3::new(ARCH * cos, ARCH * sin, WALL * (0.5 - v))
    });
    shape.add(&soffit);
    for x in [-half, ARCH] {
        let corner = Vec3::new(x, 0.0, -0.5 * WALL);
        shape.add(&Shape::quad(corner, Vec3::X * (half - ARCH), Vec3::Z * WALL));
    }
    shape
}

/// Mouldings around an arch on both faces, its keystone, and a roundel over the column to its left.
fn arch_trim(width: f32) -> Shape {
    let mut shape = Shape::default();
    for z in [0.5 * WALL, -0.5 * WALL] {
        for (radius, thick) in [(ARCH + 0.05, 0.05), (ARCH + 0.20, 0.035)] {
            let ring: Vec<_> = (0..=16)
                .map(|i| PI * i as f32 / 16.0)
                .map(|a| (Vec3::new(radius * a.cos(), radius * a.sin(), z), thick))
                .collect();
            shape.add(&tube(&ring, 4, false));
        }
        let roundel = torus(Vec3::ZERO, 0.26, 0.045, [16, 5]).at(Affine3A::from_rotation_x(0.5 * PI));
        shape.add(&roundel.moved(Vec3::new(-0.5 * width, 1.25, z)));
    }
    let keystone = Shape::block_on(Vec3::ZERO, Vec3::new(0.30, 0.46, WALL + 0.16));
    shape.add(
        &keystone.warped(|p| Vec3::new(p.x * (0.75 + 0.6 * p.y), p.y, p.z)).moved(Vec3::Y * (ARCH - 0.06)),
    );
    shape
}

/// Balusters between a plinth and a handrail around the gallery.
fn balustrade(builder: &mut SceneBuilder, palette: &Palette) {
    const PER_BAY: usize = 8;
    let profile: Vec<_> = [
        (0.07, 0.0),
        (0.07, 0.05),
        (0.035, 0.09),
        (0.05, 0.14),
        (0.082, 0.25),
        (0.06, 0.40),
        (0.032, 0.54),
        (0.05, 0.60),
        (0.065, 0.63),
        (0.065, 0.68),
    ]
    .into();
    let baluster = object(builder, "baluster", lathe(8, &profile), palette.limestone);
    for bay in bays() {
        let frame = at_bay(bay, UPPER_FLOOR + 0.12);
        let room = bay.2 - 2.6 * STOREYS[1].column_radius;
        for i in 0..PER_BAY {
            let x = ((i as f32 + 0.5) / PER_BAY as f32 - 0.5) * room;
            builder.instance(baluster, frame * Affine3A::from_translation(Vec3::X * x));
        }
    }
    let court = rectangle(Vec2::new(HALF_LENGTH, HALF_WIDTH));
    let rail = |bottom: f32, top: f32, half: f32| {
        let mut ring =
            loft(&court, &[(half, bottom), (half, top), (-half, top), (-half, bottom), (half, bottom)]);
        ring = ring.moved(Vec3::Y * UPPER_FLOOR);
        ring
    };
    let rails = Shape::union([rail(0.0, 0.12, 0.13), rail(0.80, 0.93, 0.13)]);
    fixed(builder, "rails", rails, palette.limestone);
}

/// Floors, the gallery's slab and the outer walls.
fn shell(builder: &mut SceneBuilder, palette: &Palette) {
    let (x, z) = (HALF_LENGTH + WALK, HALF_WIDTH + WALK);
    let court = Vec3::new(HALF_LENGTH, 0.0, HALF_WIDTH);
    let floor =
        Shape::quad(Vec3::new(-court.x, 0.0, court.z), Vec3::X * 2.0 * court.x, Vec3::NEG_Z * 2.0 * court.z);
    fixed(builder, "court floor", floor, palette.court);
    fixed(builder, "walk floor", around_court(0.0, true), palette.walk);
    fixed(builder, "gallery floor", around_court(UPPER_FLOOR, true), palette.walk);
    let below = [around_court(UPPER_FLOOR - 0.22, false), around_court(EAVES - 0.12, false)];
    fixed(builder, "ceilings", Shape::union(below), palette.plaster);

    let wall = |bottom: f32, top: f32| {
        loft(&rectangle(Vec2::new(x, z)), &[(0.0, top), (0.0, bottom)]).with_uvs(|uv| Vec2::new(uv.x, -uv.y))
    };
    let stone = Shape::union([wall(0.0, 1.3), wall(UPPER_FLOOR, UPPER_FLOOR + 1.0)]);
    fixed(builder, "dado", stone, palette.ashlar);
    let plaster = Shape::union([wall(1.3, UPPER_FLOOR), wall(UPPER_FLOOR + 1.0, EAVES + 1.4)]);
    fixed(builder, "outer walls", plaster, palette.plaster);
    let dado = [1.3, UPPER_FLOOR + 1.0].map(|y| {
        let profile =
            [(0.0, y + 0.06), (-0.07, y + 0.05), (-0.07, y - 0.02), (-0.03, y - 0.07), (0.0, y - 0.09)];
        loft(&rectangle(Vec2::new(x, z)), &profile)
    });
    fixed(builder, "string course", Shape::union(dado), palette.limestone);
}

/// The ring between the court's edge and the outer walls at height `y`, facing up or down.
fn around_court(y: f32, up: bool) -> Shape {
    let inner = 0.5 * WALL;
    let (out, into) = ((WALK, y), (if y == 0.0 { 0.0 } else { -inner }, y));
    let profile = if up { [out, into] } else { [into, out] };
    let mut shape = loft(&rectangle(Vec2::new(HALF_LENGTH, HALF_WIDTH)), &profile);
    // Lay the texture flat instead of along the outline.
    shape = shape.planar_uvs();
    shape
}

/// Tiled lean-to roofs that fall towards the court.
fn roof(builder: &mut SceneBuilder, palette: &Palette) {
    let slope = |half_length: f32| {
        let waves = (half_length * 2.0 / 0.28).round();
        Shape::patch(waves as u32 * 3, 2, Vec2::splat(1.0), |u, v| {
            let run = WALK + 0.75;
            // Towards the ridge the sides grow by the same run: a mitred corner.
            let x = (u - 0.5) * 2.0 * (half_length - 0.65 + v * run);
            let ripple = 0.05 * (u * waves * 2.0 * PI).cos();
            Vec3::new(x, EAVES + 0.42 + v * 1.25 + ripple, 0.65 - v * run)
        })
    };
    let sides = [
        (HALF_LENGTH, Vec3::new(0.0, 0.0, -HALF_WIDTH), 0.0),
        (HALF_LENGTH, Vec3::new(0.0, 0.0, HALF_WIDTH), PI),
        (HALF_WIDTH, Vec3::new(-HALF_LENGTH, 0.0, 0.0), 0.5 * PI),
        (HALF_WIDTH, Vec3::new(HALF_LENGTH, 0.0, 0.0), -0.5 * PI),
    ];
    let slopes = sides.map(|(half, position, yaw)| slope(half).at(place(position, yaw)));
    fixed(builder, "roof", Shape::union(slopes), palette.tile);
}

/// Timber beams across the walk under both ceilings.
fn beams(builder: &mut SceneBuilder, palette: &Palette) {
    let size = Vec3::new(WALK, 0.24, 0.18);
    let beam = Shape::rounded_block(size, 0.015, 1, 1);
    let beam = object(builder, "beam", beam, palette.timber);
    for (position, yaw, width) in bays() {
        for (height, step) in [(UPPER_FLOOR - 0.34, -0.25), (UPPER_FLOOR - 0.34, 0.25), (EAVES - 0.24, 0.0)] {
            let middle = Vec3::new(step * width, height, -0.5 * WALK);
            let turned = place(position, yaw) * Affine3A::from_translation(middle);
            builder.instance(beam, turned * Affine3A::from_rotation_y(0.5 * PI));
        }
    }
}

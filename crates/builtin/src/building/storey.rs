//! One storey: six rows of rooms along three corridors, two cross corridors; furniture, doors and lamps.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Light, LightKind, ObjectId, SceneBuilder};

use super::{CLEAR, CORRIDOR, DEPTH, HALF_LENGTH, HALL, OFFICE_LEVEL, PITCH};
use crate::interior::furniture::{self, Books, Detail};
use crate::interior::room::{self, Back, Row, WALL, lamp_places, slab};
use crate::interior::{Finish, Opening, Palette, Piece, wall_between};
use crate::random::Rng;
use crate::shape::{Shape, place};
use crate::solid::lathe;

/// A trough of three tubes and a tube's length, metres.
const TROUGH: Vec2 = Vec2::new(1.22, 0.36);
const TUBE: f32 = 1.15;
/// Of doors that are closed.
const CLOSED: f32 = 0.8;
/// Of rooms with a table for meetings instead of desks.
const MEETING: f32 = 0.15;

/// What rooms are filled with.
pub(super) struct Kit {
    office: room::Kit,
    trough: ObjectId,
    tube: ObjectId,
    downlight: ObjectId,
    table: ObjectId,
    seat: ObjectId,
}

impl Kit {
    pub(super) fn new(builder: &mut SceneBuilder, palette: &Palette) -> Self {
        let office = room::Kit::new(builder, palette, Detail::Plain, 8, Books::Single(10));
        let mut make = |piece: Piece, name: &str| piece.object(builder, palette, name);
        let top = Shape::rounded_block(Vec3::new(1.1, 0.04, 3.0), 0.015, 2, 1).moved(Vec3::Y * 0.72);
        let feet = [-1.0, 1.0].map(|z| Shape::block_on(Vec3::Z * z, Vec3::new(0.7, 0.70, 0.06)));
        let table = Piece::default().with(Finish::Oak, &top).with(Finish::Black, &Shape::union(feet));
        let rim = lathe(10, &[(0.06, 0.0), (0.06, -0.02), (0.075, -0.02), (0.075, 0.0)]);
        Self {
            trough: make(furniture::trough(TROUGH), "trough"),
            tube: make(furniture::tube_lamp(TUBE), "tube face"),
            downlight: make(Piece::default().with(Finish::White, &rim), "downlight rim"),
            table: make(table, "table"),
            seat: make(furniture::visitor(Detail::Plain), "seat"),
            office,
        }
    }

    /// The row of rooms that the camera `office` stands in, at the height of the ground floor.
    pub(super) fn row_of_the_office(&self) -> Row {
        rows(OFFICE_LEVEL).swap_remove(0)
    }

    /// A round table in the middle of a room with seats on both sides.
    fn meet(&self, builder: &mut SceneBuilder, (frame, size): (Affine3A, Vec2), rng: &mut Rng) {
        let middle = Vec3::new(0.2, 0.0, 0.55 * size.y);
        builder.place("table", self.table, None, frame * place(middle, 0.0));
        for side in [-1.0f32, 1.0] {
            for k in -1..=1 {
                let at = middle + Vec3::new(side * rng.range(0.75, 0.95), 0.0, k as f32 * 0.9);
                let yaw = side * FRAC_PI_2 + rng.range(-0.25, 0.25);
                builder.place("seat", self.seat, None, frame * place(at, yaw));
            }
        }
    }

    /// Three tubes in each trough of a room; the tubes are lights of their own.
    fn light(&self, builder: &mut SceneBuilder, room: (Affine3A, Vec2)) {
        let across = (room.1.x / 1.65).round().max(1.0) as u32;
        for at in lamp_places(room, [across, 3], CLEAR) {
            builder.place("trough", self.trough, None, at);
            for z in [-0.12, 0.0, 0.12] {
                builder.place("tube", self.tube, None, at * Affine3A::from_translation(Vec3::Z * z));
            }
        }
    }
}

/// The rows of rooms of a storey, at the height of the ground floor.
fn rows(level: usize) -> Vec<Row> {
    let mut rng = Rng::new(0x50DA + level as u64);
    let (inner, outer) = (HALL[0] + CORRIDOR, HALF_LENGTH);
    let sides = [(-outer, -inner), (inner, outer)];
    let (back, front) = (HALL[1] + DEPTH, HALL[1] + DEPTH + CORRIDOR);
    let mut rows = Vec::new();
    for (z, yaw) in [(-1.0f32, PI), (1.0, 0.0)] {
        // Outermost rooms with windows; behind the corridor rooms that back on the hall or on those of the middle corridor.
        let mut row = |z: f32, yaw: f32, (from, to): (f32, f32), back: Back| {
            let edges = edges(&mut rng, from, to);
            let world_from_row = place(Vec3::Z * z, yaw);
            rows.push(Row { world_from_row, edges, depth: DEPTH, height: CLEAR, back });
        };
        row(z * front, yaw, (-outer, outer), Back::Windows);
        row(z * back, yaw + PI, (-HALL[0], HALL[0]), Back::Wall);
        for side in sides {
            row(z * back, yaw + PI, side, Back::Wall);
            row(z * 0.5 * CORRIDOR, yaw, side, Back::Shared);
        }
    }
    rows
}

/// Where the walls of rooms stand between `from` and `to`: widths differ.
fn edges(rng: &mut Rng, from: f32, to: f32) -> Vec<f32> {
    let count = ((to - from) / 4.8).round().max(1.0) as usize;
    let widths: Vec<f32> = (0..count).map(|_| rng.range(3.8, 6.2)).collect();
    let stretch = (to - from) / widths.iter().sum::<f32>();
    let mut edges = vec![from];
    for width in &widths[..count - 1] {
        edges.push(edges[edges.len() - 1] + width * stretch);
    }
    edges.push(to);
    edges
}

/// The storey `level`, with everything in it.
pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette, kit: &Kit, level: usize) {
    let mut rng = Rng::new(0xD00 + level as u64);
    let up = Affine3A::from_translation(Vec3::Y * (level as f32 * PITCH));
    let mut shell = corridors(level);
    for row in rows(level) {
        shell.join(&row.shell(Detail::Plain), Affine3A::IDENTITY);
        for (frame, size) in row.rooms() {
            let room = (up * frame, size);
            let closed = rng.unit() < CLOSED;
            let angle = if closed { 0.0 } else { rng.range(0.4, 1.7) };
            kit.office.door(builder, room, angle);
            if rng.unit() < MEETING {
                kit.meet(builder, room, &mut rng);
            } else {
                kit.office.furnish(builder, room, &mut rng);
            }
            kit.light(builder, room);
        }
    }
    let object = shell.object(builder, palette, "storey");
    builder.place(format!("storey {level}"), object, None, up);
    for (min, max) in corridor_floors() {
        downlights(builder, kit, up, min, max);
    }
}

/// The corridors' floors as corners on the ground, (x, z).
fn corridor_floors() -> [(Vec2, Vec2); 6] {
    let (inner, outer) = (HALL[0] + CORRIDOR, HALF_LENGTH);
    let (near, far) = (HALL[1] + DEPTH, HALL[1] + DEPTH + CORRIDOR);
    let half = 0.5 * CORRIDOR;
    let area = |x: [f32; 2], z: [f32; 2]| (Vec2::new(x[0], z[0]), Vec2::new(x[1], z[1]));
    [
        area([-outer, outer], [-far, -near]),
        area([-outer, outer], [near, far]),
        area([-outer, -inner], [-half, half]),
        area([inner, outer], [-half, half]),
        area([-inner, -HALL[0]], [-near, near]),
        area([HALL[0], inner], [-near, near]),
    ]
}

/// Floors and ceilings of the corridors, the walls at their ends with a window each, and the edge towards the hall.
fn corridors(level: usize) -> Piece {
    let mut piece = Piece::default();
    for (min, max) in corridor_floors() {
        let (floor, ceiling) = slab(min, max, CLEAR);
        piece.add(Finish::Terrazzo, &floor);
        piece.add(Finish::Ceiling, &ceiling);
    }
    let window = Opening { middle: 0.5 * CORRIDOR, width: 1.5, sill: 0.4, head: 2.4 };
    let middles = [-1.0, 0.0, 1.0].map(|side| side * (HALL[1] + DEPTH + 0.5 * CORRIDOR));
    for x in [-HALF_LENGTH, HALF_LENGTH] {
        for z in middles {
            let [a, b] = [-0.5, 0.5].map(|side| Vec2::new(x, z + side * CORRIDOR));
            piece.add(Finish::Accent, &wall_between(a, b, CLEAR, WALL, &[window]));
            let size = Vec2::new(window.width, window.head - window.sill);
            let yaw = if x > 0.0 { FRAC_PI_2 } else { -FRAC_PI_2 };
            let side = if x > 0.0 { 0.5 } else { -0.5 };
            let corner = Vec3::new(x, window.sill, z + side * window.width);
            piece.join(&furniture::window(Detail::Plain, size), place(corner, yaw));
        }
    }
    // Between this ceiling and the next floor the hall shows the slab's edge.
    let (x, z) = (HALL[0], HALL[1]);
    let edge =
        |a: [f32; 2], b: [f32; 2]| Shape::block(Vec3::new(a[0], CLEAR, a[1]), Vec3::new(b[0], PITCH, b[1]));
    for side in [-1.0f32, 1.0] {
        let (near, far) = (side * x, side * (x + 0.3));
        piece.add(Finish::Concrete, &edge([near.min(far), -z], [near.max(far), z]));
        let (near, far) = (side * (z - 0.5 * WALL), side * (z + 0.3));
        piece.add(Finish::Concrete, &edge([-x, near.min(far)], [x, near.max(far)]));
    }
    if level == 0 {
        let (floor, _) = slab(Vec2::new(-x, -z), Vec2::new(x, z), CLEAR);
        piece.add(Finish::Terrazzo, &floor);
    }
    piece
}

/// A row of recessed spots along a corridor.
fn downlights(builder: &mut SceneBuilder, kit: &Kit, up: Affine3A, min: Vec2, max: Vec2) {
    let size = max - min;
    let long = size.max_element();
    let count = (long / 2.4).round() as u32;
    for i in 0..count {
        let t = (i as f32 + 0.5) / count as f32;
        let at = if size.x > size.y {
            Vec2::new(min.x + t * size.x, 0.5 * (min.y + max.y))
        } else {
            Vec2::new(0.5 * (min.x + max.x), min.y + t * size.y)
        };
        let at = up * place(Vec3::new(at.x, CLEAR, at.y), 0.0);
        builder.place("downlight", kit.downlight, None, at);
        let kind = LightKind::Spot {
            position: at.transform_point3(Vec3::Y * -0.03),
            direction: Vec3::NEG_Y,
            intensity: Vec3::new(1.0, 0.86, 0.66) * 5.5,
            inner_angle: 0.45,
            outer_angle: 1.2,
            range: f32::INFINITY,
        };
        builder.light(Light { name: "downlight".into(), kind });
    }
}

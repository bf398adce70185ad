//! The hall in the building's middle: bridges, flights of stairs between them, railings, hanging lamps, a glass roof.

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::SceneBuilder;

use super::{HALL, PITCH, STOREYS};
use crate::interior::furniture::{self, Detail};
use crate::interior::room::slab;
use crate::interior::{Finish, Palette, Piece};
use crate::shape::{Shape, place};
use crate::solid::{lathe, sphere, tube};

/// Half the width of a bridge, the width of a flight of stairs, its run on the ground, metres.
const BRIDGE: f32 = 1.0;
const FLIGHT: f32 = 1.6;
const RUN: f32 = 6.2;
/// Length of the platform where a flight arrives beside a bridge, metres.
const PLATFORM: f32 = 1.7;

pub(super) fn build(builder: &mut SceneBuilder, palette: &Palette) {
    let stairs = furniture::stairs(Detail::Fine, PITCH, RUN, FLIGHT, 21);
    let stairs = stairs.object(builder, palette, "stairs");
    let flight = BRIDGE + 0.06 + 0.5 * FLIGHT;
    for level in 0..STOREYS - 1 {
        // Flights start at the western and the eastern gallery by turns, on either side of the bridges.
        let side = if level % 2 == 0 { 1.0f32 } else { -1.0 };
        let foot = Vec3::new(-side * HALL[0], level as f32 * PITCH, -side * flight);
        let towards_x = side * std::f32::consts::FRAC_PI_2;
        builder.place("stairs", stairs, None, place(foot, towards_x));
        bridge(side).fixed_at(builder, palette, (level + 1) as f32 * PITCH);
    }
    lamps(builder, palette);
    let top = STOREYS as f32 * PITCH;
    let (_, glass) = slab(Vec2::new(-HALL[0], -HALL[1]), Vec2::new(HALL[0], HALL[1]), top);
    let mut bars = Shape::default();
    for i in 0..=10 {
        let x = (i as f32 / 5.0 - 1.0) * HALL[0];
        bars.add(&Shape::block_on(Vec3::new(x, top - 0.25, 0.0), Vec3::new(0.08, 0.25, 2.0 * HALL[1])));
    }
    for i in 0..=6 {
        let z = (i as f32 / 3.0 - 1.0) * HALL[1];
        bars.add(&Shape::block_on(Vec3::new(0.0, top - 0.12, z), Vec3::new(2.0 * HALL[0], 0.11, 0.06)));
    }
    let roof = Piece::default().with(Finish::Night, &glass).with(Finish::White, &bars);
    roof.fixed(builder, palette, "roof");
}

impl Piece {
    /// The piece as an object that stands once in the world, raised to `height`.
    fn fixed_at(self, builder: &mut SceneBuilder, palette: &Palette, height: f32) {
        let object = self.object(builder, palette, "bridge");
        builder.place("bridge", object, None, Affine3A::from_translation(Vec3::Y * height));
    }
}

/// A bridge along X at y = 0 with the platform of the flight that arrives on its side −`side`, the railings, and those
/// of the galleries at both ends.
fn bridge(side: f32) -> Piece {
    let deck = |x: [f32; 2], z: [f32; 2]| {
        let (x0, x1, z0, z1) = (x[0].min(x[1]), x[0].max(x[1]), z[0].min(z[1]), z[0].max(z[1]));
        Shape::block(Vec3::new(x0, -0.25, z0), Vec3::new(x1, 0.0, z1))
    };
    // Where the flight arrives, and the platform's end and outer border.
    let arrival = -side * (HALL[0] - RUN);
    let end = arrival + side * PLATFORM;
    let border = -side * (BRIDGE + 0.12 + FLIGHT);
    let decks = Shape::union([
        deck([-HALL[0], HALL[0]], [-BRIDGE, BRIDGE]),
        deck([arrival, end], [-side * BRIDGE, border]),
    ]);
    let mut piece = Piece::default().with(Finish::Concrete, &decks);
    let mut rail = |a: [f32; 2], b: [f32; 2]| {
        let along = Vec2::new(b[0] - a[0], b[1] - a[1]);
        let frame = place(Vec3::new(a[0], 0.0, a[1]), (-along.y).atan2(along.x));
        piece.join(&furniture::railing(along.length()), frame);
    };
    let inset = 0.05;
    let (plain, busy) = (side * (BRIDGE - inset), -side * (BRIDGE - inset));
    rail([-HALL[0], plain], [HALL[0], plain]);
    rail([-side * HALL[0], busy], [arrival, busy]);
    rail([end, busy], [side * HALL[0], busy]);
    rail([end, busy], [end, border]);
    rail([arrival, border], [end, border]);
    // Galleries: gaps where the bridge leaves, and where the next flight, on the other side, starts.
    for x in [-1.0f32, 1.0] {
        let at = x * (HALL[0] + inset);
        for z in [-1.0f32, 1.0] {
            let next_flight = x == side && z == side;
            let from = if next_flight { BRIDGE + 0.12 + FLIGHT } else { BRIDGE };
            rail([at, z * from], [at, z * HALL[1]]);
        }
    }
    piece
}

/// Globes on cables, at a different height each.
fn lamps(builder: &mut SceneBuilder, palette: &Palette) {
    const RADIUS: f32 = 0.20;
    let globe = Piece::default().with(Finish::Lamp, &sphere(Vec3::ZERO, RADIUS, 12));
    let globe = globe.object(builder, palette, "globe");
    let socket = lathe(12, &[(0.0, 0.24), (0.07, 0.22), (0.09, 0.17), (0.0, 0.17)]);
    let socket = Piece::default().with(Finish::Steel, &socket).object(builder, palette, "socket");
    let top = STOREYS as f32 * PITCH - 0.2;
    let mut cables = Shape::default();
    for i in 0..70 {
        let (column, row) = ((i % 10) as f32, i / 10);
        let x = (column - 4.5) * 2.3;
        let z = if i % 2 == 0 { 5.4 } else { -5.4 } + 0.5 * (row as f32 - 3.0) * 0.3;
        let y = 2.6 + PITCH * row as f32 + 0.9 * (1.7 * column).sin().abs();
        let at = Affine3A::from_translation(Vec3::new(x, y.min(top - 0.6), z));
        builder.place("hanging lamp", globe, None, at);
        builder.place("socket", socket, None, at);
        let from = Vec3::new(x, y.min(top - 0.6) + 0.2, z);
        cables.add(&tube(&[(from, 0.006), (Vec3::new(x, top, z), 0.006)], 4, false));
    }
    Piece::default().with(Finish::Black, &cables).fixed(builder, palette, "cables");
}

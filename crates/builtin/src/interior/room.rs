//! Rooms in a row along a corridor: their shells, what stands in them, where their lamps hang.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{InstanceId, ObjectId, SceneBuilder};

use super::Finish::{Carpet, Ceiling, Plaster};
use super::furniture::{self, Books, DOOR, Detail};
use super::{Opening, Palette, Piece, wall_between};
use crate::random::Rng;
use crate::shape::{Shape, place};

/// Thickness of all walls, metres.
pub(crate) const WALL: f32 = 0.12;
/// Of windows above the floor, metres.
const SILL: f32 = 0.90;
const LINTEL: f32 = 2.30;

/// Rooms side by side along +X whose doors are in the wall at z = 0; they reach to z = `depth`.
pub(crate) struct Row {
    pub(crate) world_from_row: Affine3A,
    /// Where the walls between the rooms stand, ascending.
    pub(crate) edges: Vec<f32>,
    pub(crate) depth: f32,
    pub(crate) height: f32,
    pub(crate) back: Back,
}

/// What closes the rooms opposite their doors.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Back {
    Windows,
    Wall,
    /// A wall that another row brings.
    Shared,
}

impl Row {
    /// Each room: the frame at the middle of its door wall, into the room along +Z, and (width, depth).
    pub(crate) fn rooms(&self) -> impl Iterator<Item = (Affine3A, Vec2)> {
        self.edges.windows(2).map(|ends| {
            let middle = Vec3::X * 0.5 * (ends[0] + ends[1]);
            (
                self.world_from_row * Affine3A::from_translation(middle),
                Vec2::new(ends[1] - ends[0], self.depth),
            )
        })
    }

    /// Walls, floors, ceilings, door casings and windows, in world space.
    pub(crate) fn shell(&self, detail: Detail) -> Piece {
        let (first, last) = (self.edges[0], self.edges[self.edges.len() - 1]);
        // The walls along the row reach round its corners.
        let (start, end) = (first - 0.5 * WALL, last + 0.5 * WALL);
        let rooms = || self.edges.windows(2);
        let doors: Vec<_> = rooms()
            .map(|ends| 0.5 * (ends[0] + ends[1]) + door_middle(ends[1] - ends[0]) - start)
            .map(|middle| Opening { middle, width: DOOR.x, sill: 0.0, head: DOOR.y + 0.02 })
            .collect();
        let windows: Vec<_> = rooms()
            .filter(|_| self.back == Back::Windows)
            .map(|ends| Opening {
                middle: 0.5 * (ends[0] + ends[1]) - start,
                width: (ends[1] - ends[0] - 1.2).min(2.4),
                sill: SILL,
                head: LINTEL,
            })
            .collect();
        let along = |z: f32, openings: &[Opening]| {
            wall_between(Vec2::new(start, z), Vec2::new(end, z), self.height, WALL, openings)
        };
        let mut walls = along(0.0, &doors);
        if self.back != Back::Shared {
            walls.add(&along(self.depth, &windows));
        }
        for &x in &self.edges {
            let (near, far) = (Vec2::new(x, 0.5 * WALL), Vec2::new(x, self.depth - 0.5 * WALL));
            walls.add(&wall_between(near, far, self.height, WALL, &[]));
        }
        let (floor, ceiling) = slab(Vec2::new(start, 0.0), Vec2::new(end, self.depth), self.height);
        let mut piece = Piece::default().with(Plaster, &walls).with(Carpet, &floor).with(Ceiling, &ceiling);
        let casing = furniture::casing(detail, WALL);
        for door in &doors {
            let hinge = Vec3::X * (start + door.middle - 0.5 * DOOR.x);
            piece.join(&casing, Affine3A::from_translation(hinge));
        }
        for hole in &windows {
            let size = Vec2::new(hole.width, hole.head - hole.sill);
            let corner = Vec3::new(start + hole.middle - 0.5 * hole.width, hole.sill, self.depth);
            piece.join(&furniture::window(detail, size), Affine3A::from_translation(corner));
        }
        let mut placed = Piece::default();
        placed.join(&piece, self.world_from_row);
        placed
    }
}

/// Where the middle of the door is along the wall of a room of `width`, from the wall's middle.
fn door_middle(width: f32) -> f32 {
    0.85 - 0.5 * width
}

/// A floor at y = 0 and a ceiling at `height` between two corners on the ground, (x, z).
pub(crate) fn slab(min: Vec2, max: Vec2, height: f32) -> (Shape, Shape) {
    let (x, z) = (Vec3::X * (max.x - min.x), Vec3::Z * (max.y - min.y));
    let corner = Vec3::new(min.x, 0.0, min.y);
    (Shape::quad(corner + z, x, -z), Shape::quad(corner + Vec3::Y * height, x, z))
}

/// The furniture of offices as objects to place.
pub(crate) struct Kit {
    desk: ObjectId,
    workplace: ObjectId,
    chair: ObjectId,
    visitor: ObjectId,
    shelves: Vec<ObjectId>,
    bin: ObjectId,
    picture: ObjectId,
    door: ObjectId,
}

impl Kit {
    /// With `shelves` kinds of shelves.
    pub(crate) fn new(
        builder: &mut SceneBuilder,
        palette: &Palette,
        detail: Detail,
        shelves: u64,
        books: Books,
    ) -> Self {
        let mut make = |piece: Piece, name: &str| piece.object(builder, palette, name);
        Self {
            desk: make(furniture::desk(detail), "desk"),
            workplace: make(furniture::workplace(detail), "workplace"),
            chair: make(furniture::chair(detail), "chair"),
            visitor: make(furniture::visitor(detail), "visitor's chair"),
            shelves: (0..shelves).map(|seed| make(furniture::shelf(books, seed + 3), "shelf")).collect(),
            bin: make(furniture::bin(detail), "bin"),
            picture: make(furniture::picture(detail), "picture"),
            door: make(furniture::door(detail), "door"),
        }
    }

    /// The door of a room as [`Row::rooms`] gives it, opened by `angle` radians into the room.
    pub(crate) fn door(
        &self,
        builder: &mut SceneBuilder,
        (world_from_room, size): (Affine3A, Vec2),
        angle: f32,
    ) -> InstanceId {
        let hinge = Vec3::X * (door_middle(size.x) - 0.5 * DOOR.x);
        builder.place("door", self.door, None, world_from_room * place(hinge, -angle))
    }

    /// Furnishes a room: a desk before the window, in wide rooms two; shelves on the wall beside the door.
    pub(crate) fn furnish(
        &self,
        builder: &mut SceneBuilder,
        (world_from_room, size): (Affine3A, Vec2),
        rng: &mut Rng,
    ) {
        let mut put = |name: &str, object: ObjectId, x: f32, y: f32, z: f32, yaw: f32| {
            builder.place(name, object, None, world_from_room * place(Vec3::new(x, y, z), yaw));
        };
        let desks: &[f32] = if size.x > 5.2 { &[-1.15, 1.15] } else { &[0.3] };
        for &x in desks {
            let z = size.y - 1.75;
            put("desk", self.desk, x, 0.0, z, 0.0);
            put("workplace", self.workplace, x + rng.range(-0.1, 0.1), 0.0, z, 0.0);
            let shift = rng.range(-0.15, 0.15);
            put("chair", self.chair, x + shift, 0.0, z + rng.range(0.62, 0.75), rng.range(-0.5, 0.5));
            put("bin", self.bin, x - 0.95, 0.0, z + 0.35, 0.0);
        }
        let turn = PI + rng.range(-0.4, 0.4);
        put("visitor's chair", self.visitor, 0.2 + rng.range(-0.2, 0.2), 0.0, size.y - 2.85, turn);
        let wall = 0.5 * (size.x - WALL);
        let room_for = ((size.y - 2.2) / 1.25).floor().clamp(1.0, 2.0) as usize;
        for i in 0..room_for {
            let kind = self.shelves[rng.below(self.shelves.len())];
            put("shelf", kind, -wall, 0.0, 2.3 + 1.22 * i as f32, FRAC_PI_2);
        }
        put("picture", self.picture, wall, 1.62, 0.42 * size.y, -FRAC_PI_2);
    }
}

/// Where `count.x × count.y` lamps hang in a room of `size`, in the frame of [`Row::rooms`], at `height`.
pub(crate) fn lamp_places(
    (world_from_room, size): (Affine3A, Vec2),
    count: [u32; 2],
    height: f32,
) -> impl Iterator<Item = Affine3A> {
    (0..count[0] * count[1]).map(move |i| {
        let [x, z] = [i % count[0], i / count[0]].map(|k| k as f32 + 0.5);
        let [x, z] = [x / count[0] as f32 - 0.5, z / count[1] as f32];
        world_from_room * place(Vec3::new(x * size.x, height, z * size.y), 0.0)
    })
}

//! Offices by night: one room under six lamps, and ten of them along a corridor under a hundred. The smaller scenes of
//! the report's section on many lights, to our own plan.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, Edit, Light, LightKind, ObjectId, SceneBuilder};

use crate::interior::furniture::{self, Books, DESK_HEIGHT, Detail};
use crate::interior::room::{Back, Kit, Row, WALL, lamp_places, slab};
use crate::interior::{Finish, Palette, wall_between};
use crate::random::Rng;
use crate::shape::place;

/// Width, depth and height of a room, metres.
const ROOM: Vec3 = Vec3::new(4.2, 5.4, 2.8);
const CORRIDOR: f32 = 2.2;
/// The glowing face of a ceiling lamp, metres.
const LAMP: Vec2 = Vec2::new(0.60, 0.28);
const RADIANCE: Vec3 = Vec3::new(13.0, 12.0, 10.4);

/// One room with its door ajar on a dark corridor.
pub(crate) fn build_room() -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder, RADIANCE);
    let kit = Kit::new(&mut builder, &palette, Detail::Plain, 1, Books::Runs);
    let lamp = Lamp::new(&mut builder, &palette, Detail::Plain);
    let half = 0.5 * ROOM.x;
    let row = Row {
        world_from_row: Affine3A::IDENTITY,
        edges: vec![-half, half],
        depth: ROOM.y,
        height: ROOM.z,
        back: Back::Windows,
    };
    row.shell(Detail::Plain).fixed(&mut builder, &palette, "room");
    corridor(&mut builder, &palette, half, true);
    for room in row.rooms() {
        kit.furnish(&mut builder, room, &mut Rng::new(6));
        kit.door(&mut builder, room, 0.55);
        lamp_places(room, [2, 3], ROOM.z).for_each(|at| lamp.hang(&mut builder, at));
    }
    let eye = Vec3::new(1.75, 1.62, 0.35);
    builder.camera(Camera::look_at("room", eye, Vec3::new(-0.35, 0.85, 3.4), Vec3::Y, 1.02));
    let eye = Vec3::new(1.2, 1.25, 4.95);
    builder.camera(Camera::look_at("desk", eye, Vec3::new(-0.7, 0.85, 2.0), Vec3::Y, 0.98));
    let eye = Vec3::new(0.9, 1.6, -1.6);
    builder.camera(Camera::look_at("corridor", eye, Vec3::new(-1.3, 1.1, 0.6), Vec3::Y, 0.95));
    builder.finish()
}

/// Two rows of five rooms; in each six lamps in the ceiling, one on the desk and one on the floor; twenty in the corridor.
pub(crate) fn build_ten() -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder, RADIANCE);
    let kit = Kit::new(&mut builder, &palette, Detail::Fine, 4, Books::Single(14));
    let lamp = Lamp::new(&mut builder, &palette, Detail::Fine);
    let extra = Extra::new(&mut builder, &palette);
    let half = 2.5 * ROOM.x;
    let mut rng = Rng::new(10);
    for (z, yaw) in [(0.0, 0.0), (-CORRIDOR, PI)] {
        let row = Row {
            world_from_row: place(Vec3::Z * z, yaw),
            edges: (0..=5).map(|i| i as f32 * ROOM.x - half).collect(),
            depth: ROOM.y,
            height: ROOM.z,
            back: Back::Windows,
        };
        row.shell(Detail::Fine).fixed(&mut builder, &palette, "rooms");
        for (i, room) in row.rooms().enumerate() {
            kit.furnish(&mut builder, room, &mut rng);
            // Every other door is closed, the rest open more or less.
            let open = if i % 2 == 1 { 0.0 } else { rng.range(0.5, 1.6) };
            kit.door(&mut builder, room, open);
            lamp_places(room, [2, 3], ROOM.z).for_each(|at| lamp.hang(&mut builder, at));
            extra.place(&mut builder, room);
        }
    }
    corridor(&mut builder, &palette, half, false);
    let middle = Affine3A::from_translation(Vec3::new(0.0, 0.0, -CORRIDOR));
    let turned = Affine3A::from_rotation_y(FRAC_PI_2);
    for at in lamp_places((middle, Vec2::new(2.0 * half, CORRIDOR)), [20, 1], ROOM.z) {
        lamp.hang(&mut builder, at * turned);
    }
    let z = -0.5 * CORRIDOR;
    let eye = Vec3::new(half - 0.6, 1.62, z);
    builder.camera(Camera::look_at("corridor", eye, Vec3::new(-half, 1.1, z), Vec3::Y, 0.95));
    let eye = Vec3::new(1.75, 1.62, 0.35);
    builder.camera(Camera::look_at("room", eye, Vec3::new(-0.35, 0.85, 3.4), Vec3::Y, 1.02));
    let eye = Vec3::new(-1.75, 1.6, -1.75);
    builder.camera(Camera::look_at("through the door", eye, Vec3::new(-0.75, 1.15, 2.0), Vec3::Y, 0.95));
    builder.finish()
}

/// The corridor between z = −[`CORRIDOR`] and 0: floor, ceiling, ends, and the far wall unless rooms bring it.
fn corridor(builder: &mut SceneBuilder, palette: &Palette, half: f32, far_wall: bool) {
    let ([left, right], [near, far]) = ([-half, half], [-0.5 * WALL, 0.5 * WALL - CORRIDOR]);
    let (floor, ceiling) = slab(Vec2::new(left - WALL, -CORRIDOR), Vec2::new(right + WALL, 0.0), ROOM.z);
    let wall = |a: Vec2, b: Vec2| wall_between(a, b, ROOM.z, WALL, &[]);
    let mut walls = wall(Vec2::new(left, far), Vec2::new(left, near));
    walls.add(&wall(Vec2::new(right, far), Vec2::new(right, near)));
    let mut piece = crate::interior::Piece::default();
    if far_wall {
        let z = -CORRIDOR;
        walls.add(&wall(Vec2::new(left - 0.5 * WALL, z), Vec2::new(right + 0.5 * WALL, z)));
    }
    piece.add(Finish::Accent, &walls);
    let piece = piece.with(Finish::Terrazzo, &floor).with(Finish::Ceiling, &ceiling);
    piece.fixed(builder, palette, "corridor");
}

/// A rectangular ceiling lamp: its rim and its face.
struct Lamp {
    rim: ObjectId,
    face: ObjectId,
}

impl Lamp {
    fn new(builder: &mut SceneBuilder, palette: &Palette, detail: Detail) -> Self {
        Self {
            rim: furniture::lamp_rim(detail, LAMP).object(builder, palette, "lamp rim"),
            face: furniture::lamp_face(LAMP).object(builder, palette, "lamp face"),
        }
    }

    fn hang(&self, builder: &mut SceneBuilder, at: Affine3A) {
        builder.place("lamp rim", self.rim, None, at);
        builder.place("lamp", self.face, None, at);
    }
}

/// The lamps of a room besides those in the ceiling.
struct Extra {
    desk: (ObjectId, Vec3),
    floor: (ObjectId, Vec3),
}

impl Extra {
    fn new(builder: &mut SceneBuilder, palette: &Palette) -> Self {
        let [desk, floor] = [furniture::desk_lamp(Detail::Fine), furniture::floor_lamp(Detail::Fine)];
        Self {
            desk: (desk.0.object(builder, palette, "desk lamp"), desk.1),
            floor: (floor.0.object(builder, palette, "floor lamp"), floor.1),
        }
    }

    /// A spot on the desk and a point over the floor lamp's bowl.
    fn place(&self, builder: &mut SceneBuilder, (world_from_room, size): (Affine3A, Vec2)) {
        let desk = world_from_room * place(Vec3::new(-0.3, DESK_HEIGHT, size.y - 1.9), 0.0);
        builder.place("desk lamp", self.desk.0, None, desk);
        let spot = LightKind::Spot {
            position: desk.transform_point3(self.desk.1),
            direction: Vec3::NEG_Y,
            intensity: Vec3::new(1.0, 0.76, 0.48) * 0.9,
            inner_angle: 0.5,
            outer_angle: 1.0,
            range: f32::INFINITY,
        };
        builder.light(Light { name: "desk lamp".into(), kind: spot });
        let floor = world_from_room * place(Vec3::new(0.5 * size.x - 0.4, 0.0, size.y - 0.45), 0.0);
        builder.place("floor lamp", self.floor.0, None, floor);
        let point = LightKind::Point {
            position: floor.transform_point3(self.floor.1),
            intensity: Vec3::new(1.0, 0.80, 0.56) * 0.5,
            range: f32::INFINITY,
        };
        builder.light(Light { name: "floor lamp".into(), kind: point });
    }
}

//! An office corner of procedural shaders: a wooden desk on marble before a brick wall, a wavy mirror, balls of metal and
//! glass, a lamp.

use std::f32::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{
    Camera, Edit, Environment, Light, LightKind, Material, MaterialId, SceneBuilder, ShaderUse,
};

use crate::plant::{self, Habit, potted};
use crate::shape::{Shape, place};
use crate::solid::{circle, cylinder, lathe, solid, sphere, torus, tube};

/// Height of the desk's top, and its half extents along X and Z.
const DESK_HEIGHT: f32 = 0.74;
const DESK: Vec2 = Vec2::new(0.95, 0.42);
/// The brick wall's front.
const WALL: f32 = -0.75;

pub(crate) fn build() -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder);
    room(&mut builder, &palette);
    opposite(&mut builder, &palette);
    desk(&mut builder, &palette);
    mirror(&mut builder, &palette);
    desk_lamp(&mut builder, &palette);
    on_the_desk(&mut builder, &palette);
    let leaves = plant::Palette::of_shaders(&mut builder);
    let habit = Habit {
        seed: 12,
        pot_radius: 0.15,
        pot_height: 0.28,
        stems: 9,
        stem_length: 0.75,
        leaves: 9,
        leaf_length: 0.24,
        spread: 0.7,
    };
    let plant = potted(&mut builder, leaves, palette.terracotta, &habit);
    builder.place("plant", plant, None, place(Vec3::new(1.5, 0.0, -0.25), 0.6));
    builder.environment(Environment::Constant(Vec3::new(0.30, 0.34, 0.42)));
    let eye = Vec3::new(1.05, 1.42, 2.35);
    builder.camera(Camera::look_at("desk", eye, Vec3::new(0.05, 0.84, -0.35), Vec3::Y, 0.66));
    let eye = Vec3::new(-0.55, 1.0, 0.62);
    builder.camera(Camera::look_at("close", eye, Vec3::new(0.02, 0.83, -0.2), Vec3::Y, 0.6));
    builder.finish()
}

/// What things are made of.
struct Palette {
    brick: MaterialId,
    floor: MaterialId,
    oak: MaterialId,
    walnut: MaterialId,
    stone: MaterialId,
    plaster: MaterialId,
    wavy: MaterialId,
    hammered: MaterialId,
    chrome: MaterialId,
    glass: MaterialId,
    enamel: MaterialId,
    bulb: MaterialId,
    window: MaterialId,
    terracotta: MaterialId,
    covers: [MaterialId; 3],
    paper: MaterialId,
    painting: MaterialId,
}

impl Palette {
    fn new(builder: &mut SceneBuilder) -> Self {
        let mut shaded = |name: &str, base: Material, shader: ShaderUse| {
            builder.material(Material { name: name.into(), shader: Some(Arc::new(shader)), ..base })
        };
        let plain = Material::default;
        let walnut = ShaderUse::named("wood")
            .with("light", Vec3::new(0.22, 0.115, 0.055))
            .with("dark", Vec3::new(0.075, 0.035, 0.018))
            .with("ring_width", 0.016)
            .with("pith", 0.07)
            .with("roughness", 0.3);
        let slate = ShaderUse::named("marble")
            .with("base", Vec3::new(0.035, 0.05, 0.042))
            .with("vein", Vec3::new(0.55, 0.56, 0.5))
            .with("size", 0.09);
        let brass = Material::metal("", Vec3::new(0.91, 0.68, 0.36), 0.16);
        let brick = shaded("brick", plain(), ShaderUse::named("brick"));
        let floor = shaded("marble", plain(), ShaderUse::named("marble").with("size", 0.45));
        let oak =
            ShaderUse::named("wood").with("ring_width", 0.014).with("pith", 0.11).with("distortion", 1.2);
        let oak = shaded("oak", plain(), oak);
        let walnut = shaded("walnut", plain(), walnut);
        let stone = shaded("green marble", plain(), slate);
        let waves = ShaderUse::named("bump").with("height", 0.0025).with("size", 0.2).with("octaves", 1.5);
        let wavy = shaded("wavy mirror", Material::metal("", Vec3::splat(0.92), 0.0), waves);
        let hammered = shaded(
            "hammered brass",
            brass,
            ShaderUse::named("dents").with("size", 0.022).with("depth", 0.0016),
        );
        let chrome = shaded("chrome", plain(), ShaderUse::named("mirror"));
        let glass = shaded("glass", Material::glass("", 1.5), ShaderUse::named("glass").with("waves", 0.0));
        let peel = ShaderUse::named("bump").with("height", 0.0004).with("size", 0.02);
        let clay = Material::plastic("", Vec3::new(0.42, 0.16, 0.08), 0.8);
        let terracotta = shaded("terracotta", clay, peel);
        let rough = ShaderUse::named("bump").with("height", 0.0015).with("size", 0.05).with("octaves", 6.0);
        let plaster = shaded("plaster", Material::diffuse("", Vec3::new(0.62, 0.59, 0.53)), rough);
        let sunset = ShaderUse::named("clouds")
            .with("sky", Vec3::new(0.62, 0.17, 0.06))
            .with("cloud", Vec3::new(0.10, 0.12, 0.28))
            .with("size", 0.5);
        let painting = shaded("painting", plain(), sunset);
        let cover = |builder: &mut SceneBuilder, color: [f32; 3]| {
            builder.material(Material::plastic("cover", color.into(), 0.55))
        };
        Self {
            brick,
            floor,
            oak,
            walnut,
            stone,
            plaster,
            wavy,
            hammered,
            chrome,
            glass,
            terracotta,
            enamel: builder.material(Material::plastic("enamel", Vec3::new(0.02, 0.12, 0.09), 0.2)),
            bulb: builder.material(Material::emitter("bulb", Vec3::new(1.0, 0.72, 0.42) * 6.0)),
            window: builder.material(Material::emitter("window", Vec3::new(0.82, 0.92, 1.0) * 7.0)),
            covers: [[0.32, 0.05, 0.04], [0.03, 0.10, 0.24], [0.45, 0.33, 0.10]].map(|c| cover(builder, c)),
            painting,
            paper: builder.material(Material::diffuse("paper", Vec3::new(0.75, 0.71, 0.62))),
        }
    }
}

/// Floor, the brick wall at the back, a plastered wall with a window on the left.
fn room(builder: &mut SceneBuilder, palette: &Palette) {
    let floor = Shape::quad(Vec3::new(-2.2, 0.0, 4.0), Vec3::X * 5.4, Vec3::NEG_Z * (4.0 - WALL));
    let back = Shape::quad(Vec3::new(-2.2, 0.0, WALL), Vec3::X * 5.4, Vec3::Y * 2.9);
    let skirting = Shape::block(Vec3::new(-2.2, 0.0, WALL), Vec3::new(3.2, 0.09, WALL + 0.018));
    // The left wall, around an opening.
    let (low, high, near, far) = (0.85, 2.25, 1.35, -0.15);
    let left = |z0: f32, z1: f32, y0: f32, y1: f32| {
        Shape::quad(Vec3::new(-2.2, y0, z0), Vec3::NEG_Z * (z0 - z1), Vec3::Y * (y1 - y0))
    };
    let left = Shape::union([
        left(4.0, near, 0.0, 2.9),
        left(far, WALL, 0.0, 2.9),
        left(near, far, 0.0, low),
        left(near, far, high, 2.9),
    ]);
    let frame = |at: Vec3, size: Vec3| Shape::block(at - 0.5 * size, at + 0.5 * size);
    let (middle, half) = (0.5 * (near + far), 0.5 * (low + high));
    let bar = |y: f32| frame(Vec3::new(-2.22, y, middle), Vec3::new(0.06, 0.05, near - far + 0.05));
    let post = |z: f32| frame(Vec3::new(-2.22, half, z), Vec3::new(0.058, high - low, 0.05));
    let window_frame = Shape::union([bar(low), bar(half), bar(high), post(near), post(middle), post(far)]);
    let light = Shape::quad(Vec3::new(-2.3, low, near), Vec3::NEG_Z * (near - far), Vec3::Y * (high - low));
    put(
        builder,
        "room",
        Vec3::ZERO,
        [
            (floor, palette.floor),
            (back, palette.brick),
            (skirting, palette.walnut),
            (left, palette.plaster),
            (window_frame, palette.paper),
            (light, palette.window),
        ],
    );
}

/// What the mirror sees: the wall behind the viewer with a door and a painting.
fn opposite(builder: &mut SceneBuilder, palette: &Palette) {
    let wall = Shape::quad(Vec3::new(3.2, 0.0, 4.0), Vec3::NEG_X * 5.4, Vec3::Y * 2.9);
    let slab =
        |x: f32, y: f32, size: Vec3| Shape::rounded_block(size, 0.012, 3, 1).moved(Vec3::new(x, y, 3.98));
    let door = Shape::union([
        slab(-1.2, 1.03, Vec3::new(0.92, 2.06, 0.06)),
        slab(-1.2, 0.55, Vec3::new(0.62, 0.70, 0.10)),
        slab(-1.2, 1.48, Vec3::new(0.62, 0.80, 0.10)),
    ]);
    let painting = slab(0.75, 1.62, Vec3::new(1.5, 1.0, 0.06));
    let frame = Shape::union([
        slab(0.75, 2.14, Vec3::new(1.6, 0.05, 0.09)),
        slab(0.75, 1.10, Vec3::new(1.6, 0.05, 0.09)),
        slab(-0.025, 1.62, Vec3::new(0.05, 1.09, 0.09)),
        slab(1.525, 1.62, Vec3::new(0.05, 1.09, 0.09)),
    ]);
    let parts = [
        (wall, palette.plaster),
        (door, palette.walnut),
        (painting, palette.painting),
        (frame, palette.hammered),
    ];
    put(builder, "opposite", Vec3::ZERO, parts);
}

/// An object of shapes with their materials, placed unturned.
fn put(
    builder: &mut SceneBuilder,
    name: &str,
    at: Vec3,
    parts: impl IntoIterator<Item = (Shape, MaterialId)>,
) {
    let parts: Vec<_> =
        parts.into_iter().map(|(shape, material)| (builder.mesh(shape.mesh()), material)).collect();
    let object = builder.object(name, parts);
    builder.place(name, object, None, Affine3A::from_translation(at));
}

/// A board, its grain along its object's x axis.
fn board(builder: &mut SceneBuilder, material: MaterialId, size: Vec3, world_from_board: Affine3A) {
    let shape = Shape::rounded_block(size, 0.006, 3, 1);
    let mesh = builder.mesh(shape.mesh());
    let object = builder.object("board", [(mesh, material)]);
    builder.place("board", object, None, world_from_board);
}

/// The top, two pedestals with drawers, a back.
fn desk(builder: &mut SceneBuilder, palette: &Palette) {
    let at = |x: f32, y: f32, z: f32| Affine3A::from_translation(Vec3::new(x, y, z - 0.3));
    let top = Vec3::new(2.0 * DESK.x, 0.04, 2.0 * DESK.y);
    board(builder, palette.oak, top, at(0.0, DESK_HEIGHT - 0.02, 0.0));
    board(builder, palette.oak, Vec3::new(1.0, 0.45, 0.02), at(0.0, 0.46, -0.36));
    let upright = Affine3A::from_rotation_z(FRAC_PI_2);
    for side in [-1.0, 1.0] {
        for edge in [0.50, 0.91] {
            let size = Vec3::new(DESK_HEIGHT - 0.04, 0.02, 0.74);
            board(builder, palette.oak, size, at(side * edge, 0.35, 0.0) * upright);
        }
        for drawer in 0..3 {
            let y = 0.14 + 0.215 * drawer as f32;
            let z = if side > 0.0 && drawer == 2 { 0.42 } else { 0.36 };
            board(builder, palette.walnut, Vec3::new(0.385, 0.205, 0.02), at(side * 0.705, y, z));
            let handle = [-0.06, -0.05, 0.05, 0.06].map(|x: f32| {
                let out = if x.abs() > 0.055 { 0.0 } else { 0.028 };
                (Vec3::new(x, 0.0, out), 0.005)
            });
            let handle = tube(&handle, 10, true);
            put(builder, "handle", Vec3::new(side * 0.705, y, z - 0.29), [(handle, palette.hammered)]);
        }
    }
}

/// A round mirror of wavy glass in a wooden ring.
fn mirror(builder: &mut SceneBuilder, palette: &Palette) {
    let glass = solid(&circle(0.36, 96), &[(0.0, 0.0), (0.0, 0.01)]);
    let ring = torus(Vec3::Y * 0.008, 0.37, 0.028, [96, 20]);
    let parts = [(glass, palette.wavy), (ring, palette.walnut)].map(|(shape, material)| {
        // Facing the room.
        (shape.at(Affine3A::from_rotation_x(FRAC_PI_2)), material)
    });
    put(builder, "mirror", Vec3::new(0.1, 1.42, WALL + 0.02), parts);
}

/// A lamp on a jointed arm; its shade points at the desk.
fn desk_lamp(builder: &mut SceneBuilder, palette: &Palette) {
    let foot = Vec3::new(-0.72, DESK_HEIGHT, -0.46);
    let base = lathe(64, &[(0.0, 0.0), (0.1, 0.0), (0.1, 0.014), (0.03, 0.024), (0.012, 0.05), (0.0, 0.05)]);
    let (elbow, head) = (Vec3::new(-0.14, 0.30, 0.03), Vec3::new(0.16, 0.52, 0.14));
    let arm = tube(&[(Vec3::Y * 0.03, 0.007), (elbow, 0.007)], 12, true);
    let forearm = tube(&[(elbow, 0.007), (head, 0.007)], 12, true);
    let joints = Shape::union([sphere(elbow, 0.014, 24), sphere(head, 0.016, 24)]);
    // Inside and outside of the shade, from the rim to the neck and back.
    let shade = [(0.095, -0.13), (0.097, -0.13), (0.075, -0.05), (0.035, 0.0), (0.0, 0.005)];
    let inside = [(0.0, -0.003), (0.032, -0.008), (0.072, -0.055), (0.095, -0.13)];
    let tilt =
        Affine3A::from_translation(head) * Affine3A::from_rotation_z(0.35) * Affine3A::from_rotation_x(-0.25);
    let shade = lathe(64, &shade).at(tilt);
    let inside = lathe(64, &inside).at(tilt);
    let bulb = sphere(Vec3::Y * -0.065, 0.036, 32).at(tilt);
    // The light comes from below the bulb, so that balls of glass do not throw sparks.
    let glow = LightKind::Spot {
        position: foot + tilt.transform_point3(Vec3::Y * -0.11),
        direction: tilt.transform_vector3(Vec3::NEG_Y),
        intensity: Vec3::new(1.0, 0.72, 0.42) * 0.6,
        inner_angle: 0.4,
        outer_angle: 1.15,
        range: f32::INFINITY,
    };
    builder.light(Light { name: "lamp".into(), kind: glow });
    put(
        builder,
        "lamp",
        foot,
        [
            (base, palette.enamel),
            (Shape::union([arm, forearm, joints]), palette.hammered),
            (shade, palette.enamel),
            (inside, palette.paper),
            (bulb, palette.bulb),
        ],
    );
}

/// Balls of chrome, brass and glass on a slab of marble; a vase; books.
fn on_the_desk(builder: &mut SceneBuilder, palette: &Palette) {
    let top = |x: f32, z: f32| Vec3::new(x, DESK_HEIGHT, z - 0.3);
    let slab = Shape::rounded_block(Vec3::new(0.56, 0.03, 0.30), 0.006, 3, 1).moved(Vec3::Y * 0.015);
    put(builder, "slab", top(0.02, 0.14), [(slab, palette.stone)]);
    let ball = |radius: f32| sphere(Vec3::Y * (radius + 0.0305), radius, 96);
    put(builder, "chrome ball", top(-0.12, 0.10), [(ball(0.09), palette.chrome)]);
    put(builder, "glass ball", top(0.07, 0.17), [(ball(0.075), palette.glass)]);
    put(builder, "brass ball", top(0.20, 0.09), [(ball(0.06), palette.hammered)]);
    let vase = [
        (0.0, 0.001),
        (0.055, 0.001),
        (0.075, 0.05),
        (0.08, 0.10),
        (0.06, 0.18),
        (0.035, 0.23),
        (0.045, 0.27),
        (0.041, 0.27),
        (0.031, 0.23),
        (0.055, 0.18),
        (0.075, 0.10),
        (0.069, 0.052),
        (0.05, 0.012),
        (0.0, 0.012),
    ];
    put(builder, "vase", top(0.44, -0.14), [(lathe(96, &vase), palette.glass)]);
    let mut y = 0.0;
    for (i, &cover) in palette.covers.iter().enumerate() {
        let (width, depth, thick) =
            (0.24 - 0.02 * i as f32, 0.17 - 0.012 * i as f32, 0.035 + 0.006 * i as f32);
        let half = Vec3::new(0.5 * width, 0.5 * thick, 0.5 * depth);
        let board =
            |at: f32| Shape::rounded_block(Vec3::new(width, 0.003, depth), 0.0014, 2, 1).moved(Vec3::Y * at);
        let spine =
            Shape::rounded_block(Vec3::new(0.003, thick, depth), 0.0014, 2, 1).moved(Vec3::NEG_X * half.x);
        let covers = Shape::union([board(0.0015), board(thick - 0.0015), spine.moved(Vec3::Y * half.y)]);
        let pages = Shape::block(
            Vec3::new(-half.x + 0.002, 0.003, -half.z + 0.004),
            Vec3::new(half.x - 0.004, thick - 0.003, half.z - 0.004),
        );
        let turned = Affine3A::from_rotation_y(0.5 - 0.35 * i as f32);
        let parts = [(covers.at(turned), cover), (pages.at(turned), palette.paper)];
        put(builder, "book", top(0.68, 0.12) + Vec3::Y * y, parts);
        y += thick + 0.0005;
    }
    let pencils = cylinder(Vec3::Y * 0.0005, 0.04, 0.10, 48);
    put(builder, "cup", top(-0.44, -0.12), [(pencils, palette.stone)]);
}

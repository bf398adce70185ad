//! The conference room: a long table with eighteen chairs, shelves of books, windows on the evening, plants.

mod books;
mod chair;
mod room;
mod tabletop;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Camera, Edit, Material, MaterialId, ObjectId, SceneBuilder};

use crate::plant::{self, Habit, potted};
use crate::shape::{Shape, place};
use crate::{paint, pattern};

/// Half the room's extent along X and Z, and its height, metres. The windows are in the wall at −Z, the shelves at
/// +Z, the whiteboard at −X, the door at +X.
const HALF: Vec2 = Vec2::new(5.0, 3.5);
const HEIGHT: f32 = 3.1;
/// Half extents of the table's top, and its height.
const TABLE: Vec2 = Vec2::new(3.15, 0.78);
const TABLE_HEIGHT: f32 = 0.74;

/// What lights the room.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lighting {
    /// Eight panels of one material.
    Ceiling,
    /// One rectangle over the table and nothing else; the windows are dark.
    OneLamp,
    /// 220 small round lamps, each a light of its own.
    ManyLamps,
}

/// What things are made of.
struct Palette {
    oak: MaterialId,
    walnut: MaterialId,
    white: MaterialId,
    black: MaterialId,
    chrome: MaterialId,
    aluminium: MaterialId,
    cushion: MaterialId,
    paper: MaterialId,
    porcelain: MaterialId,
}

impl Palette {
    fn new(builder: &mut SceneBuilder) -> Self {
        let oak = paint::texture(builder, "oak", 512, |uv| {
            pattern::wood(uv, Vec3::new(0.26, 0.14, 0.06), Vec3::new(0.50, 0.31, 0.15), 3)
        });
        let walnut = paint::texture(builder, "walnut", 512, |uv| {
            pattern::wood(uv, Vec3::new(0.075, 0.038, 0.02), Vec3::new(0.20, 0.105, 0.055), 8)
        });
        let weave = paint::texture(builder, "upholstery", 256, |uv| {
            pattern::fabric(uv, Vec3::new(0.05, 0.085, 0.15), 4)
        });
        let metal = |name, color, roughness| Material::metal(name, Vec3::splat(color), roughness);
        Self {
            oak: paint::textured(builder, "oak", oak, Vec2::new(2.0, 1.0), 0.35),
            walnut: paint::textured(builder, "walnut", walnut, Vec2::new(2.4, 1.2), 0.22),
            cushion: paint::textured(builder, "upholstery", weave, Vec2::splat(0.12), 0.95),
            white: builder.material(Material::plastic("white paint", Vec3::splat(0.76), 0.4)),
            black: builder.material(Material::plastic("black plastic", Vec3::splat(0.025), 0.35)),
            chrome: builder.material(metal("chrome", 0.62, 0.12)),
            aluminium: builder.material(metal("aluminium", 0.75, 0.35)),
            paper: builder.material(Material::diffuse("paper", Vec3::new(0.80, 0.77, 0.70))),
            porcelain: builder.material(Material::plastic("porcelain", Vec3::new(0.80, 0.79, 0.76), 0.12)),
        }
    }
}

pub(crate) fn build(lighting: Lighting) -> Vec<Edit> {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder);
    room::build(&mut builder, &palette, lighting);
    tabletop::build(&mut builder, &palette);
    chairs(&mut builder, &palette);
    books::build(&mut builder, &palette);
    plants(&mut builder, &palette);

    let eye = Vec3::new(4.55, 1.95, 3.05);
    builder.camera(Camera::look_at("corner", eye, Vec3::new(-1.2, 0.95, -0.35), Vec3::Y, 0.98));
    let eye = Vec3::new(3.75, 1.28, 0.12);
    builder.camera(Camera::look_at("table", eye, Vec3::new(-3.0, 1.02, -0.05), Vec3::Y, 0.90));
    let eye = Vec3::new(-4.2, 1.8, -2.0);
    builder.camera(Camera::look_at("shelves", eye, Vec3::new(0.9, 0.85, 1.5), Vec3::Y, 0.95));
    builder.finish()
}

/// Several meshes with their materials as an object.
fn object<const N: usize>(
    builder: &mut SceneBuilder,
    name: &str,
    parts: [(Shape, MaterialId); N],
) -> ObjectId {
    let parts = parts.map(|(shape, material)| (builder.mesh(shape.mesh()), material));
    builder.object(name, parts)
}

/// An object that stands once in the world as modelled.
fn fixed<const N: usize>(builder: &mut SceneBuilder, name: &str, parts: [(Shape, MaterialId); N]) {
    let object = object(builder, name, parts);
    builder.place(name, object, None, Affine3A::IDENTITY);
}

/// Seven chairs on each side, one at each end, two by the wall; none quite straight.
fn chairs(builder: &mut SceneBuilder, palette: &Palette) {
    use std::f32::consts::{FRAC_PI_2, PI};
    let chair = chair::build(builder, palette);
    let mut rng = crate::random::Rng::new(12);
    let mut seat = |x: f32, z: f32, yaw: f32| {
        let at = Vec3::new(x + rng.range(-0.04, 0.04), 0.0, z + rng.range(-0.05, 0.05));
        builder.place("chair", chair, None, place(at, yaw + rng.range(-0.28, 0.28)));
    };
    for i in 0..7 {
        let x = (i as f32 - 3.0) * 0.79;
        seat(x, -1.12, PI);
        seat(x, 1.12, 0.0);
    }
    seat(-3.55, 0.0, -FRAC_PI_2);
    seat(3.55, -0.1, FRAC_PI_2 + 0.5);
    seat(-4.35, 2.15, -2.2);
    seat(4.35, -1.6, 1.9);
}

fn plants(builder: &mut SceneBuilder, palette: &Palette) {
    let shared = plant::Palette::new(builder);
    let fig = Habit {
        seed: 31,
        pot_radius: 0.24,
        pot_height: 0.42,
        stems: 9,
        stem_length: 1.25,
        leaves: 22,
        leaf_length: 0.24,
        spread: 0.62,
    };
    let small =
        Habit { seed: 5, pot_radius: 0.11, pot_height: 0.16, stem_length: 0.32, leaf_length: 0.15, ..fig };
    let places = [
        (fig, Vec3::new(-4.5, 0.0, -3.0)),
        (Habit { seed: 77, stem_length: 1.05, ..fig }, Vec3::new(4.5, 0.0, -3.0)),
        (Habit { seed: 9, stem_length: 1.1, ..fig }, Vec3::new(0.85, 0.0, 3.05)),
        (small, Vec3::new(3.3, room::SIDEBOARD_HEIGHT, 3.22)),
    ];
    for (habit, at) in places {
        let plant = potted(builder, shared, palette.porcelain, &habit);
        builder.place("plant", plant, None, Affine3A::from_translation(at));
    }
}

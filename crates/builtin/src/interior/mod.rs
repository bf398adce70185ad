//! A kit of rooms for scenes of many lights: finishes, walls with openings, furniture, and where it stands.

pub(crate) mod furniture;
pub(crate) mod room;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{Material, MaterialId, ObjectId, SceneBuilder};

use crate::shape::Shape;
use crate::{paint, pattern};

/// What a surface is made of.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Finish {
    Plaster,
    Accent,
    Ceiling,
    Carpet,
    Terrazzo,
    Oak,
    White,
    Black,
    Steel,
    Cloth,
    Books,
    Paper,
    /// A window pane by night.
    Night,
    Concrete,
    Lamp,
}

/// The finishes' materials.
pub(crate) struct Palette([MaterialId; Finish::Lamp as usize + 1]);

impl Palette {
    /// Lamps emit `radiance`.
    pub(crate) fn new(builder: &mut SceneBuilder, radiance: Vec3) -> Self {
        let mut tiled = |name: &str, size: u32, tile: Vec2, roughness: f32, color: &dyn Fn(Vec2) -> Vec3| {
            let texture = paint::texture(builder, name, size, color);
            paint::textured(builder, name, texture, tile, roughness)
        };
        let plaster = tiled("plaster", 256, Vec2::splat(2.5), 0.9, &|uv| {
            pattern::plaster(uv, Vec3::new(0.74, 0.71, 0.65), 2)
        });
        let accent = tiled("painted wall", 256, Vec2::splat(2.5), 0.85, &|uv| {
            pattern::plaster(uv, Vec3::new(0.50, 0.22, 0.13), 6)
        });
        let ceiling = tiled("ceiling", 256, Vec2::splat(2.4), 0.95, &|uv| {
            pattern::slabs(uv, 4, [Vec3::splat(0.74); 2], 12)
        });
        let carpet = tiled("carpet", 256, Vec2::splat(1.0), 1.0, &|uv| {
            pattern::carpet(uv, [Vec3::new(0.11, 0.14, 0.17), Vec3::new(0.09, 0.12, 0.155)], 3)
        });
        let terrazzo = tiled("terrazzo", 512, Vec2::splat(2.4), 0.6, &|uv| {
            pattern::slabs(uv, 4, [Vec3::new(0.46, 0.43, 0.38), Vec3::new(0.40, 0.37, 0.33)], 5)
        });
        let oak = tiled("oak", 256, Vec2::new(2.0, 1.0), 0.35, &|uv| {
            pattern::wood(uv, Vec3::new(0.27, 0.15, 0.065), Vec3::new(0.52, 0.32, 0.155), 3)
        });
        let cloth = tiled("upholstery", 128, Vec2::splat(0.12), 0.95, &|uv| {
            pattern::fabric(uv, Vec3::new(0.07, 0.15, 0.20), 4)
        });
        let books = tiled("books", 512, Vec2::ONE, 0.55, &|uv| pattern::spines(uv, 6));
        let mut plain = |material: Material| builder.material(material);
        Self([
            plaster,
            accent,
            ceiling,
            carpet,
            terrazzo,
            oak,
            plain(Material::plastic("white laminate", Vec3::splat(0.74), 0.4)),
            plain(Material::plastic("black plastic", Vec3::splat(0.03), 0.35)),
            plain(Material::metal("steel", Vec3::splat(0.66), 0.28)),
            cloth,
            books,
            plain(Material::diffuse("paper", Vec3::new(0.80, 0.77, 0.70))),
            plain(Material::plastic("night", Vec3::new(0.008, 0.010, 0.018), 0.03)),
            plain(Material::diffuse("concrete", Vec3::splat(0.42))),
            plain(Material::emitter("lamp", radiance)),
        ])
    }

    pub(crate) fn of(&self, finish: Finish) -> MaterialId {
        self.0[finish as usize]
    }
}

/// A thing of several finishes under construction.
#[derive(Clone, Default)]
pub(crate) struct Piece(Vec<(Finish, Shape)>);

impl Piece {
    pub(crate) fn add(&mut self, finish: Finish, shape: &Shape) {
        match self.0.iter_mut().find(|(other, _)| *other == finish) {
            Some((_, all)) => all.add(shape),
            None => self.0.push((finish, shape.clone())),
        }
    }

    #[must_use]
    pub(crate) fn with(mut self, finish: Finish, shape: &Shape) -> Self {
        self.add(finish, shape);
        self
    }

    /// Appends another piece, moved by `transform`.
    pub(crate) fn join(&mut self, other: &Self, transform: Affine3A) {
        for (finish, shape) in &other.0 {
            self.add(*finish, &shape.clone().at(transform));
        }
    }

    /// The piece as an object with one part for each finish.
    pub(crate) fn object(self, builder: &mut SceneBuilder, palette: &Palette, name: &str) -> ObjectId {
        let parts: Vec<_> = self
            .0
            .into_iter()
            .map(|(finish, shape)| (builder.mesh(shape.mesh()), palette.of(finish)))
            .collect();
        builder.object(name, parts)
    }

    /// The piece as an object that stands once in the world as modelled.
    pub(crate) fn fixed(self, builder: &mut SceneBuilder, palette: &Palette, name: &str) {
        let object = self.object(builder, palette, name);
        builder.place(name, object, None, Affine3A::IDENTITY);
    }
}

/// A hole in a wall: a door when `sill` is 0, otherwise a window. Metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Opening {
    /// Where along the wall its middle is.
    pub(crate) middle: f32,
    pub(crate) width: f32,
    pub(crate) sill: f32,
    pub(crate) head: f32,
}

/// A wall of `length` along +X from the origin, `height` high, its thickness centred on z = 0, with `openings` in order
/// along it that do not overlap.
pub(crate) fn wall(length: f32, height: f32, thickness: f32, openings: &[Opening]) -> Shape {
    let half = 0.5 * thickness;
    let block =
        |x: [f32; 2], y: [f32; 2]| Shape::block(Vec3::new(x[0], y[0], -half), Vec3::new(x[1], y[1], half));
    let mut shape = Shape::default();
    let mut start = 0.0;
    for hole in openings {
        let [left, right] = [-0.5, 0.5].map(|side| hole.middle + side * hole.width);
        shape.add(&block([start, left], [0.0, height]));
        shape.add(&block([left, right], [hole.head, height]));
        if hole.sill > 0.0 {
            shape.add(&block([left, right], [0.0, hole.sill]));
        }
        start = right;
    }
    shape.add(&block([start, length], [0.0, height]));
    shape
}

/// [`wall`] from `a` to `b` on the ground, (x, z).
pub(crate) fn wall_between(a: Vec2, b: Vec2, height: f32, thickness: f32, openings: &[Opening]) -> Shape {
    let along = b - a;
    let frame = crate::shape::place(Vec3::new(a.x, 0.0, a.y), (-along.y).atan2(along.x));
    wall(along.length(), height, thickness, openings).at(frame)
}

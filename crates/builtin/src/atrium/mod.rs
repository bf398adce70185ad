//! The atrium: a two-storey cloister around a court under the open sky, with the sun falling in from one side.

mod dressing;
mod stonework;

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};
use heliostat_scene::{
    Camera, Clip, Edit, Light, LightId, LightKind, Material, MaterialId, Motion, ObjectId, Pose,
    SceneBuilder, Timeline,
};

use crate::shape::{Shape, place};
use crate::{paint, pattern, sky};

// The plan, in metres. The court lies around the origin, its long side along X; the columns' axes stand on its edge,
// the walk behind them runs all round.
const BAY: f32 = 3.4;
const BAYS: usize = 9;
const HALF_LENGTH: f32 = 0.5 * BAY * BAYS as f32;
const HALF_WIDTH: f32 = 4.6;
const END_BAYS: usize = 3;
const END_BAY: f32 = 2.0 * HALF_WIDTH / END_BAYS as f32;
const WALK: f32 = 4.0;
const UPPER_FLOOR: f32 = 5.2;
const EAVES: f32 = 9.6;

/// Where the arches of each storey spring from, and their top.
const STOREYS: [Storey; 2] = [
    Storey { floor: 0.0, spring: 3.05, top: 5.0, column_radius: 0.27 },
    Storey { floor: UPPER_FLOOR, spring: 7.75, top: EAVES, column_radius: 0.20 },
];

/// Heights of one storey, metres.
#[derive(Clone, Copy)]
struct Storey {
    floor: f32,
    spring: f32,
    top: f32,
    column_radius: f32,
}

/// What things are made of.
struct Palette {
    limestone: MaterialId,
    ashlar: MaterialId,
    plaster: MaterialId,
    court: MaterialId,
    walk: MaterialId,
    timber: MaterialId,
    tile: MaterialId,
    terracotta: MaterialId,
    bronze: MaterialId,
    water: MaterialId,
    curtain: MaterialId,
}

impl Palette {
    fn new(builder: &mut SceneBuilder) -> Self {
        use paint::{texture, textured};
        let limestone = texture(builder, "limestone", 512, |uv| {
            pattern::marble(uv, Vec3::new(0.66, 0.58, 0.46), Vec3::new(0.46, 0.37, 0.27), 21)
        });
        let ashlar =
            texture(builder, "ashlar", 512, |uv| pattern::ashlar(uv, 8, Vec3::new(0.50, 0.42, 0.31), 4));
        let plaster =
            texture(builder, "plaster", 256, |uv| pattern::plaster(uv, Vec3::new(0.72, 0.57, 0.40), 8));
        let court = texture(builder, "court", 512, |uv| {
            pattern::slabs(uv, 4, [Vec3::new(0.52, 0.46, 0.38), Vec3::new(0.30, 0.17, 0.12)], 3)
        });
        let walk = texture(builder, "walk", 512, |uv| {
            pattern::slabs(uv, 8, [Vec3::new(0.42, 0.36, 0.28), Vec3::new(0.36, 0.30, 0.23)], 14)
        });
        let timber = texture(builder, "timber", 256, |uv| {
            pattern::wood(uv, Vec3::new(0.10, 0.055, 0.03), Vec3::new(0.24, 0.14, 0.075), 6)
        });
        let red =
            texture(builder, "curtain", 256, |uv| pattern::fabric(uv, Vec3::new(0.42, 0.045, 0.035), 2));
        Self {
            limestone: textured(builder, "limestone", limestone, Vec2::splat(2.2), 0.55),
            ashlar: textured(builder, "ashlar", ashlar, Vec2::splat(3.6), 0.85),
            plaster: textured(builder, "plaster", plaster, Vec2::splat(3.0), 0.9),
            court: textured(builder, "court floor", court, Vec2::splat(4.0), 0.32),
            walk: textured(builder, "walk floor", walk, Vec2::splat(4.0), 0.4),
            timber: textured(builder, "timber", timber, Vec2::new(1.4, 0.7), 0.6),
            curtain: textured(builder, "curtain", red, Vec2::splat(0.5), 0.95),
            tile: builder.material(Material::plastic("roof tile", Vec3::new(0.42, 0.17, 0.09), 0.8)),
            terracotta: builder.material(Material::plastic("terracotta", Vec3::new(0.46, 0.20, 0.11), 0.7)),
            bronze: builder.material(Material::metal("bronze", Vec3::new(0.55, 0.38, 0.20), 0.35)),
            water: builder.material(Material {
                ior: 1.33,
                ..Material::plastic("water", Vec3::new(0.015, 0.05, 0.05), 0.04)
            }),
        }
    }
}

/// By day: under a clear sky and the sun.
pub(crate) fn build() -> Vec<Edit> {
    let mut builder = architecture();
    builder.environment(sky::clear(1.25));
    builder.light(sky::sun(Vec3::new(0.38, -1.0, 0.46), 6.5));
    builder.finish()
}

/// By evening: under the last of the sky, with a lamp that wanders through the court.
pub(crate) fn build_evening() -> Vec<Edit> {
    evening().0
}

/// The lamp goes round once.
pub(crate) fn evening_timeline() -> Timeline {
    let motion = Arc::new(Wandering(evening().1));
    Timeline::new(vec![Clip { name: "wandering lamp".into(), frame_rate: None, motion }])
}

fn evening() -> (Vec<Edit>, LightId) {
    let mut builder = architecture();
    builder.environment(sky::clear(0.05));
    let lamp = builder.light(lamp(0.0));
    (builder.finish(), lamp)
}

#[derive(Debug)]
struct Wandering(LightId);

impl Motion for Wandering {
    fn duration(&self) -> f64 {
        30.0
    }

    fn sample(&self, time: f64, pose: &mut Pose) {
        pose.light(self.0, lamp((time / self.duration()).fract() as f32));
    }
}

/// The lamp after a share of its round; within the court, at the height of a head and above.
fn lamp(share: f32) -> Light {
    let (sin, cos) = (share * std::f32::consts::TAU).sin_cos();
    let position = Vec3::new(-1.0 - 7.5 * cos, 2.6 + 0.8 * sin * cos, 2.6 * sin);
    let intensity = Vec3::new(30.0, 21.0, 12.0);
    let kind = LightKind::Point { position, intensity, range: f32::INFINITY };
    Light { name: "wandering lamp".into(), kind }
}

/// The building and its points of view, without light.
fn architecture() -> SceneBuilder {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder);
    stonework::build(&mut builder, &palette);
    dressing::build(&mut builder, &palette);

    let eye = Vec3::new(-13.6, 1.9, -1.7);
    builder.camera(Camera::look_at("nave", eye, Vec3::new(3.0, 3.35, 0.55), Vec3::Y, 1.05));
    let eye = Vec3::new(-10.6, 7.0, -5.4);
    builder.camera(Camera::look_at("gallery", eye, Vec3::new(2.2, 3.3, 2.6), Vec3::Y, 1.0));
    let eye = Vec3::new(-3.2, 1.6, 7.3);
    builder.camera(Camera::look_at("walk", eye, Vec3::new(3.4, 1.9, 2.6), Vec3::Y, 0.95));
    builder
}

/// A mesh of one material as an object.
fn object(builder: &mut SceneBuilder, name: &str, shape: Shape, material: MaterialId) -> ObjectId {
    let mesh = builder.mesh(shape.mesh());
    builder.object(name, [(mesh, material)])
}

/// A mesh of one material that stands once in the world as modelled.
fn fixed(builder: &mut SceneBuilder, name: &str, shape: Shape, material: MaterialId) {
    let object = object(builder, name, shape, material);
    builder.place(name, object, None, Affine3A::IDENTITY);
}

/// Placements along the four sides of the court at the columns' line, turned so that local +Z faces the court:
/// `(position on the ground, yaw, bay width)` for the middle of every bay.
fn bays() -> impl Iterator<Item = (Vec3, f32, f32)> {
    use std::f32::consts::{FRAC_PI_2, PI};
    let middle = |i: usize, count: usize, width: f32| (i as f32 + 0.5 - 0.5 * count as f32) * width;
    let long = (0..BAYS).flat_map(move |i| {
        let x = middle(i, BAYS, BAY);
        [(Vec3::new(x, 0.0, -HALF_WIDTH), 0.0, BAY), (Vec3::new(-x, 0.0, HALF_WIDTH), PI, BAY)]
    });
    let short = (0..END_BAYS).flat_map(move |i| {
        let z = middle(i, END_BAYS, END_BAY);
        [
            (Vec3::new(-HALF_LENGTH, 0.0, -z), FRAC_PI_2, END_BAY),
            (Vec3::new(HALF_LENGTH, 0.0, z), -FRAC_PI_2, END_BAY),
        ]
    });
    long.chain(short)
}

/// Places `object` at the middle of a bay, raised to `height`.
fn at_bay((position, yaw, _): (Vec3, f32, f32), height: f32) -> Affine3A {
    place(position + Vec3::Y * height, yaw)
}

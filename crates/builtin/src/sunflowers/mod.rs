//! A field of sunflowers: ten kinds of plants placed 28,000 times, and trees of a million triangles around it, about a
//! billion triangles in all. The report's example of mass instancing (its section 6.3), to our own plan.

mod flower;
mod tree;

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{Affine3A, EulerRot, Quat, Vec2, Vec3};
use heliostat_scene::{
    Camera, Clip, Edit, LightId, Material, MaterialId, Motion, Pose, SceneBuilder, Timeline,
};

use crate::random::{Rng, fbm};
use crate::shape::Shape;
use crate::{paint, pattern, sky};

/// Kinds of sunflowers.
const KINDS: usize = 10;
/// Sunflowers that stand in the field.
pub(crate) const PLANTS: usize = 28_000;
/// Half the field's edge, metres; rows run along X.
const HALF_FIELD: f32 = 64.0;
const ROW_SPACING: f32 = 0.86;
/// Half the width of the path that leads through the field along Z.
const HALF_PATH: f32 = 1.1;
/// The ground reaches this far, metres.
const HALF_GROUND: f32 = 400.0;
const TREES: usize = 26;

/// What things are made of.
struct Palette {
    leaf: MaterialId,
    petal: MaterialId,
    stem: MaterialId,
    floret: MaterialId,
    bark: MaterialId,
    foliage: MaterialId,
    soil: MaterialId,
}

impl Palette {
    fn new(builder: &mut SceneBuilder) -> Self {
        let mut cut_out = |name: &str, size: [u32; 2], roughness: f32, color: &dyn Fn(Vec2) -> glam::Vec4| {
            let texture = paint::decal(builder, name, size, color);
            builder.material(Material {
                name: name.into(),
                base_color_texture: Some(heliostat_scene::TextureRef::new(texture)),
                alpha_mode: heliostat_scene::AlphaMode::Mask { cutoff: 0.5 },
                roughness,
                double_sided: true,
                ..Material::default()
            })
        };
        let leaf = cut_out("sunflower leaf", [256, 256], 0.6, &flower::leaf_color);
        let petal = cut_out("sunflower petal", [64, 128], 0.7, &flower::petal_color);
        let green = Vec3::new(0.11, 0.20, 0.035);
        let foliage = cut_out("foliage", [128, 128], 0.55, &|uv| pattern::leaf(uv, green, 9));
        let soil = paint::texture(builder, "soil", 512, soil_color);
        Self {
            leaf,
            petal,
            foliage,
            stem: builder.material(Material::plastic("stem", Vec3::new(0.18, 0.27, 0.07), 0.7)),
            floret: builder.material(Material::diffuse("floret", Vec3::new(0.16, 0.075, 0.025))),
            bark: builder.material(Material::plastic("bark", Vec3::new(0.17, 0.12, 0.08), 0.9)),
            soil: paint::textured(builder, "soil", soil, Vec2::splat(6.0), 0.95),
        }
    }
}

fn soil_color(uv: Vec2) -> Vec3 {
    let clod = fbm(uv * 24.0, 24, 5, 3);
    let straw = pattern::smooth(0.62, 0.75, fbm(uv * Vec2::new(96.0, 12.0), 96, 3, 8));
    Vec3::new(0.24, 0.165, 0.095) * (0.5 + 0.9 * clod) + Vec3::new(0.16, 0.13, 0.06) * straw
}

/// Grass takes over where the field ends: a factor on the soil's colour.
fn meadow(at: Vec3) -> Vec3 {
    let out = at.x.abs().max(at.z.abs()) - HALF_FIELD;
    let patches = 10.0 * (fbm(Vec2::new(at.x, at.z) / 9.0 + Vec2::splat(64.0), 256, 3, 31) - 0.5);
    Vec3::ONE + (Vec3::new(0.42, 1.25, 0.36) - Vec3::ONE) * pattern::smooth(-1.0, 6.0, out + patches)
}

/// Gentle hills.
fn ground(x: f32, z: f32) -> f32 {
    let p = Vec2::new(x, z);
    let hills = 14.0 * (fbm(p / 160.0 + Vec2::splat(64.0), 256, 3, 77) - 0.5);
    let far = pattern::smooth(70.0, 300.0, p.length());
    hills * (0.25 + 2.2 * far) + 0.05 * fbm(p + Vec2::splat(512.0), 2048, 2, 5)
}

/// The edits of the scene.
pub(crate) fn build() -> Vec<Edit> {
    make().0
}

/// The edits, and the sun's handle.
fn make() -> (Vec<Edit>, LightId) {
    let mut builder = SceneBuilder::new();
    let palette = Palette::new(&mut builder);
    let mut land = land().mesh();
    land.colors = land.positions.iter().map(|p| meadow(*p).extend(1.0)).collect();
    let land = builder.mesh(land);
    let land = builder.object("ground", [(land, palette.soil)]);
    builder.instance(land, Affine3A::IDENTITY);
    plant_field(&mut builder, &palette);
    plant_trees(&mut builder, &palette);
    builder.environment(sky::clear(0.9));
    let sun = builder.light(sky::sun(sunlight(0.0), 3.2));
    let stand = |x: f32, up: f32, z: f32| Vec3::new(x, ground(x, z) + up, z);
    let views = [
        ("path", stand(0.35, 2.05, 24.0), stand(-0.6, 1.35, 0.0), 0.85),
        ("among the flowers", stand(6.0, 1.75, 14.0), stand(8.4, 1.9, 10.0), 0.9),
        ("from above", stand(-30.0, 34.0, 96.0), stand(6.0, 0.0, 0.0), 0.8),
    ];
    for (name, eye, target, fov) in views {
        builder.camera(Camera::look_at(name, eye, target, Vec3::Y, fov));
    }
    (builder.finish(), sun)
}

/// Seconds that a day takes.
const DAY: f64 = 12.0;

/// Where sunlight travels to, `share` of the day after the morning of the still scene: over the south and down in the
/// west.
fn sunlight(share: f32) -> Vec3 {
    let hour = 0.62 + 1.9 * share;
    let (s, c) = hour.sin_cos();
    Vec3::new(-0.95 * c, -0.85 * s - 0.05, -0.45)
}

/// The sun crosses the sky while nothing else moves.
pub(crate) fn timeline() -> Timeline {
    let motion = Arc::new(Day(make().1));
    Timeline::new(vec![Clip { name: "day".into(), frame_rate: None, motion }])
}

#[derive(Debug)]
struct Day(LightId);

impl Motion for Day {
    fn duration(&self) -> f64 {
        DAY
    }

    fn sample(&self, time: f64, pose: &mut Pose) {
        pose.light(self.0, sky::sun(sunlight((time / DAY) as f32), 3.2));
    }
}

/// The ground: finer where one stands.
fn land() -> Shape {
    let stretch = |t: f32| {
        let s = 2.0 * t - 1.0;
        HALF_GROUND * (0.25 * s + 0.75 * s * s.abs())
    };
    let steps = 160;
    Shape::patch(steps, steps, Vec2::ONE, |u, v| {
        let (x, z) = (stretch(u), -stretch(v));
        Vec3::new(x, ground(x, z), z)
    })
    .planar_uvs()
}

/// Plants in rows, all facing the morning sun more or less.
fn plant_field(builder: &mut SceneBuilder, palette: &Palette) {
    let kinds: Vec<_> = (0..KINDS).map(|kind| flower::sunflower(builder, palette, kind)).collect();
    let mut rng = Rng::new(0x5EED);
    let rows = (2.0 * HALF_FIELD / ROW_SPACING) as usize;
    let per_row = PLANTS.div_ceil(rows);
    let mut planted = 0;
    let sunlight = sunlight(0.15);
    let sun = sunlight.x.atan2(sunlight.z) + 0.5 * TAU;
    for row in 0..rows {
        let along_row = 2.0 * (HALF_FIELD - HALF_PATH) / per_row as f32;
        for place in 0..per_row.min(PLANTS - planted) {
            let run = (place as f32 + rng.range(0.2, 0.8)) * along_row - (HALF_FIELD - HALF_PATH);
            let x = run + HALF_PATH.copysign(run);
            let z = row as f32 * ROW_SPACING - HALF_FIELD + rng.range(-0.14, 0.14);
            let turn = sun + rng.range(-0.5, 0.5);
            let lean = rng.range(-0.07, 0.07);
            let size = rng.range(0.84, 1.14);
            let transform = Affine3A::from_translation(Vec3::new(x, ground(x, z) - 0.03, z))
                * Affine3A::from_quat(Quat::from_euler(EulerRot::YXZ, turn, lean, rng.range(-0.07, 0.07)))
                * Affine3A::from_scale(Vec3::new(size, size * rng.range(0.92, 1.08), size));
            builder.instance(kinds[rng.below(KINDS)], transform);
            planted += 1;
        }
    }
}

/// Trees around the field, away from the views.
fn plant_trees(builder: &mut SceneBuilder, palette: &Palette) {
    let kinds: Vec<_> = (0..2).map(|kind| tree::tree(builder, palette, kind)).collect();
    let mut rng = Rng::new(0x7EE5);
    for i in 0..TREES {
        let around = (i as f32 + rng.range(-0.3, 0.3)) / TREES as f32 * TAU;
        let far = HALF_FIELD * rng.range(1.5, 2.6);
        let (x, z) = (around.sin() * far, around.cos() * far);
        let size = rng.range(0.8, 1.25);
        let transform = Affine3A::from_translation(Vec3::new(x, ground(x, z) - 0.2, z))
            * Affine3A::from_rotation_y(rng.range(0.0, TAU))
            * Affine3A::from_scale(Vec3::splat(size));
        builder.instance(kinds[i % kinds.len()], transform);
    }
}

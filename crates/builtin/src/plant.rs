//! Potted plants: a turned pot, stems, and curved leaves cut out by an alpha mask.

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};
use heliostat_scene::{AlphaMode, Material, MaterialId, ObjectId, SceneBuilder, ShaderUse, TextureRef};

use crate::paint::decal;
use crate::pattern;
use crate::random::Rng;
use crate::shape::Shape;
use crate::solid::{circle, lathe, solid, tube};

/// The materials plants share.
#[derive(Clone, Copy)]
pub(crate) struct Palette {
    leaf: MaterialId,
    bark: MaterialId,
    soil: MaterialId,
}

impl Palette {
    pub(crate) fn new(builder: &mut SceneBuilder) -> Self {
        let mask =
            decal(builder, "leaf", [128, 256], |uv| pattern::leaf(uv, Vec3::new(0.075, 0.21, 0.035), 5));
        let leaf = builder.material(Material {
            name: "leaf".into(),
            base_color_texture: Some(TextureRef::new(mask)),
            alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
            roughness: 0.45,
            ..Material::default()
        });
        let bark = builder.material(Material::plastic("bark", Vec3::new(0.16, 0.10, 0.06), 0.9));
        let soil = builder.material(Material::diffuse("soil", Vec3::new(0.045, 0.03, 0.02)));
        Self { leaf, bark, soil }
    }

    /// The same by procedural shaders, with leaves that let light through.
    pub(crate) fn of_shaders(builder: &mut SceneBuilder) -> Self {
        let shader = |name: &str| Some(Arc::new(ShaderUse::named(name)));
        let leaf = Material { name: "leaf".into(), shader: shader("foliage"), ..Material::default() };
        let bark = Material {
            shader: shader("bump"),
            ..Material::plastic("bark", Vec3::new(0.16, 0.10, 0.06), 0.9)
        };
        let soil =
            Material { shader: shader("bump"), ..Material::diffuse("soil", Vec3::new(0.045, 0.03, 0.02)) };
        Self { leaf: builder.material(leaf), bark: builder.material(bark), soil: builder.material(soil) }
    }
}

/// How a plant grows. Lengths in metres.
#[derive(Clone, Copy)]
pub(crate) struct Habit {
    pub(crate) seed: u64,
    pub(crate) pot_radius: f32,
    pub(crate) pot_height: f32,
    pub(crate) stems: usize,
    pub(crate) stem_length: f32,
    /// Leaves on each stem.
    pub(crate) leaves: usize,
    pub(crate) leaf_length: f32,
    /// Lean of the outermost stems from the vertical, radians.
    pub(crate) spread: f32,
}

/// A plant in a pot of the given material, standing on the origin.
pub(crate) fn potted(
    builder: &mut SceneBuilder,
    palette: Palette,
    pot: MaterialId,
    habit: &Habit,
) -> ObjectId {
    let (r, h) = (habit.pot_radius, habit.pot_height);
    let profile = [
        (0.0, 0.0),
        (0.62 * r, 0.0),
        (0.66 * r, 0.03 * h),
        (0.80 * r, 0.45 * h),
        (0.92 * r, 0.86 * h),
        (r, 0.88 * h),
        (1.02 * r, 0.93 * h),
        (r, h),
        (0.92 * r, h),
        (0.90 * r, 0.85 * h),
    ];
    let vessel = lathe(40, &profile);
    let soil = solid(&circle(0.91 * r, 24), &[(-0.1 * r, 0.84 * h), (0.0, 0.86 * h)]);

    let mut rng = Rng::new(habit.seed);
    let (mut stems, mut leaves) = (Shape::default(), Shape::default());
    for stem in 0..habit.stems {
        grow(&mut rng, habit, stem, &mut stems, &mut leaves);
    }
    let parts = [(vessel, pot), (soil, palette.soil), (stems, palette.bark), (leaves, palette.leaf)];
    let parts: Vec<_> =
        parts.into_iter().map(|(shape, material)| (builder.mesh(shape.mesh()), material)).collect();
    builder.object("plant", parts)
}

/// One stem that leans outwards and droops, with leaves in a spiral by the golden angle.
fn grow(rng: &mut Rng, habit: &Habit, stem: usize, stems: &mut Shape, leaves: &mut Shape) {
    const GOLDEN_ANGLE: f32 = 2.399_963;
    const JOINTS: usize = 10;
    let around = stem as f32 * GOLDEN_ANGLE + rng.range(-0.3, 0.3);
    let lean = habit.spread * ((stem as f32 + 0.5) / habit.stems as f32).sqrt();
    let out = Vec3::new(around.cos(), 0.0, around.sin());
    let length = habit.stem_length * rng.range(0.75, 1.1);
    let foot = out * habit.pot_radius * 0.35 + Vec3::Y * 0.84 * habit.pot_height;
    let at = |t: f32| {
        let angle = lean * (0.45 + 0.75 * t);
        foot + length * t * (Vec3::Y * angle.cos() + out * angle.sin())
    };
    let thick = 0.012 * habit.stem_length.max(0.5);
    let joints: Vec<_> =
        (0..=JOINTS).map(|i| i as f32 / JOINTS as f32).map(|t| (at(t), thick * (1.0 - 0.75 * t))).collect();
    stems.add(&tube(&joints, 8, false));
    for i in 0..habit.leaves {
        let t = 0.22 + 0.78 * (i as f32 + 0.6) / habit.leaves as f32;
        let axis = (at(t + 0.02) - at(t - 0.02)).normalize();
        let turn = i as f32 * GOLDEN_ANGLE + rng.range(-0.4, 0.4);
        let side = axis.any_orthonormal_vector();
        let away = glam::Quat::from_axis_angle(axis, turn) * side;
        let rise = rng.range(0.15, 0.7) + 0.5 * t * t;
        let direction = (away + axis * rise).normalize();
        let size = habit.leaf_length * rng.range(0.7, 1.15) * (1.0 - 0.35 * t);
        leaves.add(&leaf(at(t), direction, size, rng.range(0.3, 1.0)));
    }
}

/// A leaf that starts at `base` and curls downwards by `curl` radians along its length.
fn leaf(base: Vec3, direction: Vec3, length: f32, curl: f32) -> Shape {
    let across = direction.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
    let frame = Mat3::from_cols(across, across.cross(direction).normalize(), direction);
    Shape::patch(2, 4, Vec2::ONE, |u, v| {
        let (x, t) = (u - 0.5, v * curl);
        let forward = t.sin() / curl;
        let drop = (1.0 - t.cos()) / curl;
        // A slight keel along the midrib.
        let keel = 0.25 * x.abs() * (TAU * 0.5 * v).sin();
        base + frame * (length * Vec3::new(0.42 * x, keel - drop, forward))
    })
}

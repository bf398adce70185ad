//! One sunflower of about 36,000 triangles: a hairy stem, heart-shaped leaves, two rings of ray petals, a disc of florets
//! in Vogel's spiral.
//!
//! # References
//! Vogel, "A Better Way to Construct the Sunflower Head", 1979.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Quat, Vec2, Vec3, Vec4};
use heliostat_scene::{ObjectId, SceneBuilder};

use super::Palette;
use crate::pattern::smooth;
use crate::random::{Rng, fbm};
use crate::shape::Shape;
use crate::solid::tube;

const GOLDEN_ANGLE: f32 = 2.399_963;
const FLORETS: usize = 760;

/// A heart-shaped leaf with its stem at the bottom.
pub(super) fn leaf_color(uv: Vec2) -> Vec4 {
    let along = 1.0 - uv.y;
    let across = (uv.x - 0.5).abs() * 2.0;
    let teeth = 0.03 * (along * 60.0).sin().abs();
    let width = 1.35 * (along * PI).sin().max(0.0).powf(0.55) * (1.0 - 0.62 * along) - teeth;
    let rib = 1.0 - smooth(0.0, 0.035, across);
    let veins = smooth(0.88, 1.0, ((along * 7.0 - across * 2.0).fract() - 0.5).abs() * 2.0) * 0.5;
    let tone = 0.7 + 0.6 * fbm(uv * 8.0, 8, 4, 21);
    let green = Vec3::new(0.10, 0.205, 0.035) * tone;
    let color = green + (Vec3::new(0.36, 0.44, 0.16) - green) * (0.6 * rib + 0.45 * veins).min(1.0);
    color.extend(if across < width { 1.0 } else { 0.0 })
}

/// A pointed petal, darker where it leaves the disc.
pub(super) fn petal_color(uv: Vec2) -> Vec4 {
    let along = 1.0 - uv.y;
    let across = (uv.x - 0.5).abs() * 2.0;
    let width = 1.5 * (along + 0.02).powf(0.4) * (1.0 - along).max(0.0).powf(0.6);
    let stripes = 0.85 + 0.15 * (across * 22.0).cos();
    let glow = Vec3::new(0.88, 0.53, 0.02) * stripes;
    let base = Vec3::new(0.62, 0.27, 0.01);
    (base + (glow - base) * smooth(0.0, 0.4, along)).extend(if across < width { 1.0 } else { 0.0 })
}

/// How one kind differs from the others. Metres and radians.
struct Habit {
    height: f32,
    disc: f32,
    petal: f32,
    /// Of the disc from the vertical.
    nod: f32,
    leaves: usize,
    /// Petals of the outer ring; the inner one has two fewer.
    rays: usize,
}

/// Kind number `kind`, standing on the origin, its disc turned towards +Z.
pub(super) fn sunflower(builder: &mut SceneBuilder, palette: &Palette, kind: usize) -> ObjectId {
    let mut rng = Rng::new(1000 + kind as u64);
    let habit = Habit {
        height: rng.range(1.35, 1.95),
        disc: rng.range(0.075, 0.115),
        petal: rng.range(0.085, 0.125),
        nod: rng.range(0.95, 1.75),
        leaves: 12 + kind % 4,
        rays: 30 + rng.below(8),
    };
    let stalk = Stalk::new(&habit, &mut rng);
    let stem = stem(&stalk, &mut rng);
    let leaves = Shape::union((0..habit.leaves).map(|i| leaf(&habit, &stalk, i, &mut rng)));
    let head = Head { frame: stalk.head(), at: stalk.at(1.0), habit: &habit };
    let (petals, bracts) = (head.petals(&mut rng), head.bracts(&mut rng));
    let florets = head.florets(&mut rng);
    let green = Shape::union([stem, bracts]);
    let parts =
        [(green, palette.stem), (leaves, palette.leaf), (petals, palette.petal), (florets, palette.floret)];
    let parts: Vec<_> = parts.into_iter().map(|(shape, id)| (builder.mesh(shape.mesh()), id)).collect();
    builder.object(format!("sunflower {}", kind + 1), parts)
}

/// The curve that the stem follows: upright, then over into the nod.
struct Stalk {
    height: f32,
    nod: f32,
    sway: Vec2,
}

impl Stalk {
    fn new(habit: &Habit, rng: &mut Rng) -> Self {
        let sway = Vec2::new(rng.range(-0.06, 0.06), rng.range(-0.06, 0.06));
        Self { height: habit.height, nod: habit.nod, sway }
    }

    /// The point at parameter t from 0 (ground) to 1 (disc).
    fn at(&self, t: f32) -> Vec3 {
        let bend = smooth(0.86, 1.0, t);
        let sway = self.sway * (t * PI).sin();
        let over = 0.12 * bend * self.nod.sin();
        let rise = t - 0.045 * bend * bend * (1.0 - self.nod.cos());
        Vec3::new(sway.x, self.height * rise, sway.y + over)
    }

    /// Axes of the disc: the third looks out of it.
    fn head(&self) -> Mat3 {
        let out = Vec3::new(0.0, self.nod.cos(), self.nod.sin());
        Mat3::from_cols(Vec3::X, out.cross(Vec3::X), out)
    }
}

fn stem(stalk: &Stalk, rng: &mut Rng) -> Shape {
    let joint = |i: u32| {
        let t = i as f32 / 40.0;
        (stalk.at(t), 0.017 * (1.0 - 0.4 * t))
    };
    let joints: Vec<_> = (0..=40).map(joint).collect();
    let mut stem = tube(&joints, 12, false);
    // Bristles.
    for _ in 0..900 {
        let t = rng.range(0.02, 0.97);
        let axis = (stalk.at((t + 0.02).min(1.0)) - stalk.at(t - 0.02)).normalize();
        let out = Quat::from_axis_angle(axis, rng.range(0.0, TAU)) * axis.any_orthonormal_vector();
        let foot = stalk.at(t) + out * 0.016 * (1.0 - 0.4 * t);
        let tip = foot + (out + 0.4 * axis).normalize() * rng.range(0.003, 0.006);
        spike(&mut stem, foot, tip, 0.0005);
    }
    stem
}

/// A three-sided spike.
fn spike(shape: &mut Shape, foot: Vec3, tip: Vec3, radius: f32) {
    let (a, b) = (tip - foot).normalize().any_orthonormal_pair();
    let corner = |i: u32| {
        let angle = i as f32 / 3.0 * TAU;
        foot + radius * (a * angle.cos() + b * angle.sin())
    };
    for i in 0..3 {
        let corners = [corner(i), corner(i + 1), tip];
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        let indices = corners.map(|p| shape.vertex(p, normal, Vec2::ZERO));
        shape.triangle(indices);
    }
}

fn leaf(habit: &Habit, stalk: &Stalk, index: usize, rng: &mut Rng) -> Shape {
    let t = 0.14 + 0.68 * (index as f32 + rng.range(0.0, 0.6)) / habit.leaves as f32;
    let around = index as f32 * GOLDEN_ANGLE + rng.range(-0.3, 0.3);
    let out = Vec3::new(around.cos(), 0.0, around.sin());
    let size = rng.range(0.20, 0.28) * (1.1 - 0.55 * t);
    let base = stalk.at(t);
    let petiole = 0.55 * size;
    let elbow = base + out * petiole + Vec3::Y * 0.35 * petiole;
    let mut shape =
        tube(&[(base, 0.005), (0.5 * (base + elbow) + Vec3::Y * 0.02, 0.004), (elbow, 0.003)], 6, false);
    let across = Vec3::Y.cross(out).normalize();
    let (sag, fold, twist) = (rng.range(0.5, 1.3), rng.range(0.1, 0.35), rng.range(-0.3, 0.3));
    let blade = Shape::patch(8, 14, Vec2::ONE, |u, v| {
        let (x, angle) = (u - 0.5, 0.3 - sag * v);
        let forward = out * angle.cos() + Vec3::Y * angle.sin();
        let wave = 0.05 * (v * 9.0 + 3.0 * twist).sin() * x.abs();
        let lift = Vec3::Y * (fold * x.abs() + wave + twist * x * v);
        elbow + size * (forward * v + across * x * 0.95 + lift * (1.0 - 0.3 * v))
    });
    shape.add(&blade);
    shape
}

/// The flower head around its axes.
struct Head<'a> {
    frame: Mat3,
    at: Vec3,
    habit: &'a Habit,
}

impl Head<'_> {
    /// Two rings of petals.
    fn petals(&self, rng: &mut Rng) -> Shape {
        let mut shape = Shape::default();
        for (ring, count) in [(0, self.habit.rays), (1, self.habit.rays - 2)] {
            for i in 0..count {
                let around = (i as f32 + rng.range(-0.25, 0.25)) / count as f32 * TAU + ring as f32 * 0.1;
                let open = 0.15 + 0.28 * ring as f32 + rng.range(-0.15, 0.25);
                let length = self.habit.petal * rng.range(0.8, 1.12);
                let (curl, twist) = (rng.range(-0.7, 0.5), rng.range(-0.5, 0.5));
                shape.add(&self.ray(around, open, length, curl, twist, [6, 12]));
            }
        }
        shape
    }

    /// The green leaves behind the petals.
    fn bracts(&self, rng: &mut Rng) -> Shape {
        let mut shape = Shape::default();
        for i in 0..40 {
            let around = i as f32 * GOLDEN_ANGLE;
            let length = self.habit.petal * rng.range(0.35, 0.55);
            shape.add(&self.pointed(around, -0.35 + rng.range(-0.2, 0.2), length));
        }
        // The back of the disc, a shallow bowl.
        let r = self.habit.disc;
        shape.add(&Shape::patch(40, 6, Vec2::ONE, |u, v| {
            let (s, c) = (u * TAU).sin_cos();
            let far = r * 1.02 * v.max(0.02);
            self.at + self.frame * Vec3::new(far * s, far * c, -0.35 * r * (1.0 - v * v) - 0.004)
        }));
        shape
    }

    /// A petal; `open` lifts it out of the disc's plane, `curl` bends its tip.
    fn ray(&self, around: f32, open: f32, length: f32, curl: f32, twist: f32, cuts: [u32; 2]) -> Shape {
        let (s, c) = around.sin_cos();
        let out = Vec3::new(c, s, 0.0);
        let across = Vec3::new(-s, c, 0.0);
        Shape::patch(cuts[0], cuts[1], Vec2::ONE, |u, v| {
            let (x, angle) = (u - 0.5, open + curl * v);
            let forward = out * angle.cos() + Vec3::Z * angle.sin();
            let side = across * (twist * v).cos() + Vec3::Z * (twist * v).sin();
            let keel = 0.18 * (0.25 - x * x) * length;
            let p = out * self.habit.disc * 0.96 + forward * length * v + side * x * 0.36 * length;
            self.at + self.frame * (p - Vec3::Z * keel)
        })
    }

    /// A bract: narrow to its point, without a mask.
    fn pointed(&self, around: f32, open: f32, length: f32) -> Shape {
        let (s, c) = around.sin_cos();
        let (out, across) = (Vec3::new(c, s, 0.0), Vec3::new(-s, c, 0.0));
        Shape::patch(4, 6, Vec2::ONE, |u, v| {
            let width = 0.42 * length * (1.0 - 0.94 * v);
            let forward = out * open.cos() + Vec3::Z * open.sin();
            let p = out * self.habit.disc * 0.9 + forward * length * v + across * (u - 0.5) * width;
            self.at + self.frame * (p - Vec3::Z * 0.003)
        })
    }

    /// The disc: florets in a spiral, open at the rim and closed in the middle.
    fn florets(&self, rng: &mut Rng) -> Shape {
        let mut shape = Shape::default();
        let r = self.habit.disc;
        for i in 0..FLORETS {
            let share = ((i as f32 + 0.5) / FLORETS as f32).sqrt();
            let (s, c) = (i as f32 * GOLDEN_ANGLE).sin_cos();
            let bulge = 0.22 * r * (1.0 - share * share);
            let foot = Vec3::new(r * share * c, r * share * s, bulge - 0.004);
            let lean = Vec3::new(c, s, 0.0) * 0.5 * share;
            let up = (Vec3::Z + lean).normalize();
            let tall = r * (0.06 + 0.12 * smooth(0.35, 0.9, share)) * rng.range(0.85, 1.15);
            let joints = [
                (self.at + self.frame * foot, r * 0.026),
                (self.at + self.frame * (foot + up * tall * 0.6), r * 0.03),
                (self.at + self.frame * (foot + up * tall), r * 0.012),
            ];
            shape.add(&tube(&joints, 6, false));
        }
        shape
    }
}

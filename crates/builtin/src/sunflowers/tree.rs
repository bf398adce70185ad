//! A broad-leaved tree of about a million triangles: branches that fork, and leaves at their ends.

use glam::{Quat, Vec2, Vec3};
use heliostat_scene::{ObjectId, SceneBuilder};

use super::Palette;
use crate::random::Rng;
use crate::shape::Shape;
use crate::solid::tube;

/// Levels of forks above the trunk.
const LEVELS: u32 = 6;
const LEAVES_PER_TWIG: usize = 18;

/// Tree number `kind`, standing on the origin.
pub(super) fn tree(builder: &mut SceneBuilder, palette: &Palette, kind: usize) -> ObjectId {
    let mut growth = Growth {
        rng: Rng::new(70 + kind as u64),
        spread: [0.62, 0.48][kind % 2],
        wood: Shape::default(),
        leaves: Shape::default(),
    };
    growth.branch(Vec3::ZERO, Vec3::Y, 3.4, 0.34, LEVELS);
    let Growth { wood, leaves, .. } = growth;
    let parts = [(wood, palette.bark), (leaves, palette.foliage)];
    let parts: Vec<_> = parts.into_iter().map(|(shape, id)| (builder.mesh(shape.mesh()), id)).collect();
    builder.object(format!("tree {}", kind + 1), parts)
}

struct Growth {
    rng: Rng,
    /// How far forks bend away, radians.
    spread: f32,
    wood: Shape,
    leaves: Shape,
}

impl Growth {
    /// A branch of `length` and `radius` metres and everything that grows on it.
    fn branch(&mut self, foot: Vec3, direction: Vec3, length: f32, radius: f32, levels: u32) {
        let side = direction.any_orthonormal_vector() * length * self.rng.range(-0.08, 0.08);
        let joint = |t: f32| foot + direction * length * t + side * (t * std::f32::consts::PI).sin();
        let joints: Vec<_> =
            (0..=4).map(|i| i as f32 / 4.0).map(|t| (joint(t), radius * (1.0 - 0.35 * t))).collect();
        self.wood.add(&tube(&joints, 4 + 2 * levels, false));
        if levels == 0 {
            for i in 0..LEAVES_PER_TWIG {
                let t = (i as f32 + self.rng.unit()) / LEAVES_PER_TWIG as f32;
                self.leaf(joint(t), direction);
            }
            return;
        }
        let forks = if levels == LEVELS { 5 } else { 4 };
        let tip = joint(1.0);
        for i in 0..forks {
            let turn = (i as f32 + self.rng.range(-0.3, 0.3)) / forks as f32 * std::f32::consts::TAU;
            let bend = self.spread * self.rng.range(0.6, 1.5);
            let axis = Quat::from_axis_angle(direction, turn) * direction.any_orthonormal_vector();
            let towards = (Quat::from_axis_angle(axis, bend) * direction + 0.08 * Vec3::Y).normalize();
            let shorter = length * self.rng.range(0.58, 0.76);
            self.branch(tip, towards, shorter, radius * 0.6, levels - 1);
        }
    }

    fn leaf(&mut self, foot: Vec3, along: Vec3) {
        let turn = Quat::from_axis_angle(along, self.rng.range(0.0, std::f32::consts::TAU));
        let out = (turn * along.any_orthonormal_vector() + 0.5 * along).normalize();
        let across = out.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
        let size = self.rng.range(0.10, 0.17);
        let sag = self.rng.range(0.2, 0.9);
        let blade = Shape::patch(2, 2, Vec2::ONE, |u, v| {
            let x = u - 0.5;
            foot + size * (out * v + across * 0.6 * x + Vec3::Y * (0.2 * x.abs() - sag * v * v * 0.5))
        });
        self.leaves.add(&blade);
    }
}

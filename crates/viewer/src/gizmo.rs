//! Handles in the picture by which the selected thing is moved, turned or scaled, and the lines that show them.

use std::f32::consts::TAU;

use glam::{Affine3A, Quat, Vec2, Vec3};
use heliostat_scene::{Camera, SceneBounds};
use serde::{Deserialize, Serialize};

use crate::geometry::{PictureRay, corners, project, ray_through};

/// What dragging a handle does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GizmoMode {
    /// Moves along an axis of the world.
    #[default]
    Move,
    /// Turns about an axis of the world.
    Rotate,
    /// Scales evenly.
    Scale,
}

/// What a line is, for those who draw it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LineKind {
    /// Handles of the first, second and third axis.
    X,
    /// See [`Self::X`].
    Y,
    /// See [`Self::X`].
    Z,
    /// The box of the selected thing.
    Selection,
    /// A light that has no surface.
    Light,
}

/// A line over the picture; points run from (0, 0) at the top left to (1, 1) at the bottom right.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Line {
    /// What it is.
    pub kind: LineKind,
    /// Two or more points.
    pub points: Vec<[f32; 2]>,
}

/// Length of the handles as a share of the picture's height.
const LENGTH: f32 = 0.16;
/// Nearest that a pointer must come to a handle, as a share of the picture's height.
const REACH: f32 = 0.025;
/// Straight pieces of a ring.
const PIECES: u32 = 32;
/// Scale of one drag, least and most.
const SCALES: [f32; 2] = [0.01, 100.0];

/// Handles at a point of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gizmo {
    /// What the handles do.
    pub mode: GizmoMode,
    /// Where they stand, world space.
    pub origin: Vec3,
}

/// A handle being dragged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drag {
    gizmo: Gizmo,
    axis: usize,
    /// Place on the axis, metres, or angle about it, radians, at which the drag began.
    start: f32,
    /// World length of the handles then.
    length: f32,
}

const AXES: [Vec3; 3] = [Vec3::X, Vec3::Y, Vec3::Z];
const KINDS: [LineKind; 3] = [LineKind::X, LineKind::Y, LineKind::Z];

impl Gizmo {
    /// The handles' length in the world, so that they look the same size from anywhere; `None` behind the camera.
    fn length(&self, camera: &Camera, aspect: f32) -> Option<f32> {
        let at = project(camera, self.origin, aspect)?;
        let up: Vec3 = camera.world_from_camera.matrix3.y_axis.into();
        let unit = project(camera, self.origin + up, aspect)?;
        let height = at.distance(unit);
        (height > 1e-9).then_some(LENGTH / height)
    }

    /// The handle of an axis as points in the world.
    fn handle(&self, axis: usize, length: f32) -> Vec<Vec3> {
        match self.mode {
            GizmoMode::Move | GizmoMode::Scale => vec![self.origin, self.origin + length * AXES[axis]],
            GizmoMode::Rotate => {
                let (u, v) = (AXES[(axis + 1) % 3], AXES[(axis + 2) % 3]);
                let point = |i| {
                    let (sin, cos) = (TAU * i as f32 / PIECES as f32).sin_cos();
                    self.origin + length * (cos * u + sin * v)
                };
                (0..=PIECES).map(point).collect()
            }
        }
    }

    /// The lines that show the handles.
    pub(crate) fn lines(&self, camera: &Camera, aspect: f32) -> Vec<Line> {
        let Some(length) = self.length(camera, aspect) else { return Vec::new() };
        let axes = (0..3).map(|axis| polyline(camera, aspect, KINDS[axis], &self.handle(axis, length)));
        axes.flatten().collect()
    }

    /// Takes hold of the handle under the pointer, if there is one.
    pub(crate) fn grasp(&self, camera: &Camera, at: Vec2, aspect: f32) -> Option<Drag> {
        let length = self.length(camera, aspect)?;
        let scale = Vec2::new(aspect, 1.0);
        let distance = |axis: usize| {
            let points: Vec<Vec2> =
                self.handle(axis, length).iter().filter_map(|&p| project(camera, p, aspect)).collect();
            let pieces =
                points.windows(2).map(|ends| distance_to_piece(at * scale, ends[0] * scale, ends[1] * scale));
            pieces.fold(f32::INFINITY, f32::min)
        };
        let (axis, nearest) = (0..3).map(|axis| (axis, distance(axis))).min_by(|a, b| a.1.total_cmp(&b.1))?;
        let start = self.measure(axis, &ray_through(camera, at, aspect))?;
        (nearest <= REACH).then_some(Drag { gizmo: *self, axis, start, length })
    }

    /// Where a ray passes an axis: place along it or angle about it; `None` where that is not defined.
    fn measure(&self, axis: usize, ray: &PictureRay) -> Option<f32> {
        let (a, d, from) = (AXES[axis], ray.direction, ray.origin - self.origin);
        match self.mode {
            GizmoMode::Move | GizmoMode::Scale => {
                let along = a.dot(d);
                let sine = 1.0 - along * along;
                (sine > 1e-4).then(|| (from.dot(a) - along * from.dot(d)) / sine)
            }
            GizmoMode::Rotate => {
                let slope = a.dot(d);
                let p = from - from.dot(a) / slope * d;
                let (u, v) = (AXES[(axis + 1) % 3], AXES[(axis + 2) % 3]);
                (slope.abs() > 1e-3).then(|| p.dot(v).atan2(p.dot(u)))
            }
        }
    }
}

impl Drag {
    /// What the drag has done to the world so far: to be put before the thing's place at its beginning. `None` where the
    /// pointer means nothing, such as along the axis.
    pub(crate) fn world_change(&self, camera: &Camera, at: Vec2, aspect: f32) -> Option<Affine3A> {
        let Gizmo { mode, origin } = self.gizmo;
        let now = self.gizmo.measure(self.axis, &ray_through(camera, at, aspect))?;
        let axis = AXES[self.axis];
        let change = match mode {
            GizmoMode::Move => return Some(Affine3A::from_translation((now - self.start) * axis)),
            GizmoMode::Rotate => Affine3A::from_quat(Quat::from_axis_angle(axis, now - self.start)),
            GizmoMode::Scale => {
                let factor = 1.0 + (now - self.start) / self.length;
                Affine3A::from_scale(Vec3::splat(factor.clamp(SCALES[0], SCALES[1])))
            }
        };
        Some(Affine3A::from_translation(origin) * change * Affine3A::from_translation(-origin))
    }
}

fn distance_to_piece(p: Vec2, a: Vec2, b: Vec2) -> f32 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
    p.distance(a + t * along)
}

/// Points of the world as a line; nothing if any of them is behind the camera.
fn polyline(camera: &Camera, aspect: f32, kind: LineKind, points: &[Vec3]) -> Option<Line> {
    let points: Option<Vec<_>> =
        points.iter().map(|&p| project(camera, p, aspect).map(|p| p.to_array())).collect();
    Some(Line { kind, points: points? })
}

/// The edges of a box that stands at `world_from_box`.
pub(crate) fn box_lines(
    camera: &Camera,
    aspect: f32,
    bounds: &SceneBounds,
    world_from_box: Affine3A,
) -> Vec<Line> {
    let corners: Vec<Vec3> = corners(bounds).map(|c| world_from_box.transform_point3(c)).collect();
    let edges = (0..8).flat_map(|i| [1, 2, 4].map(|bit| (i, i | bit))).filter(|(i, j)| i != j);
    edges
        .filter_map(|(i, j)| polyline(camera, aspect, LineKind::Selection, &[corners[i], corners[j]]))
        .collect()
}

/// A small diamond where a light stands; `None` when it is not in the picture.
pub(crate) fn light_mark(camera: &Camera, aspect: f32, position: Vec3) -> Option<Line> {
    let at = project(camera, position, aspect)?;
    let inside = at.cmpge(Vec2::ZERO).all() && at.cmple(Vec2::ONE).all();
    let size = Vec2::new(0.012 / aspect, 0.012);
    let ring = [Vec2::NEG_Y, Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y];
    inside.then(|| Line { kind: LineKind::Light, points: ring.map(|d| (at + d * size).to_array()).to_vec() })
}

/// Whether a pointer is on the mark of a light.
pub(crate) fn on_light(camera: &Camera, aspect: f32, position: Vec3, at: Vec2) -> bool {
    let scale = Vec2::new(aspect, 1.0);
    project(camera, position, aspect).is_some_and(|mark| (mark * scale).distance(at * scale) < 0.02)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::look_at("", Vec3::new(2.0, 3.0, 6.0), Vec3::ZERO, Vec3::Y, 0.8)
    }

    #[test]
    fn dragging_a_handle_moves_turns_and_scales() {
        let camera = camera();
        let origin = Vec3::new(0.3, -0.2, 0.1);
        for mode in [GizmoMode::Move, GizmoMode::Rotate, GizmoMode::Scale] {
            let gizmo = Gizmo { mode, origin };
            let length = gizmo.length(&camera, 1.5).expect("before the camera");
            for (axis, way) in AXES.into_iter().enumerate() {
                let handle = gizmo.handle(axis, length);
                // A place on the handle that no other one crosses.
                let from = handle[handle.len() / 5 * 2 + usize::from(handle.len() == 2)];
                let to = match mode {
                    GizmoMode::Move | GizmoMode::Scale => from + 0.5 * length * way,
                    GizmoMode::Rotate => origin + Quat::from_axis_angle(way, 0.7) * (from - origin),
                };
                let at = |p| project(&camera, p, 1.5).expect("before the camera");
                let drag = gizmo.grasp(&camera, at(from), 1.5).expect("a handle");
                assert_eq!(drag.axis, axis, "{mode:?}");
                let change = drag.world_change(&camera, at(to), 1.5).expect("defined");
                let expected = match mode {
                    GizmoMode::Scale => origin + 1.5 * (from - origin),
                    _ => to,
                };
                assert!(change.transform_point3(from).abs_diff_eq(expected, 1e-3), "{mode:?} {axis}");
            }
        }
    }

    #[test]
    fn pointers_elsewhere_take_hold_of_nothing() {
        let gizmo = Gizmo { mode: GizmoMode::Move, origin: Vec3::ZERO };
        assert_eq!(gizmo.grasp(&camera(), Vec2::new(0.9, 0.9), 1.5), None);
        let behind = Gizmo { origin: Vec3::new(4.0, 6.0, 12.0), ..gizmo };
        assert!(behind.lines(&camera(), 1.5).is_empty());
        let bounds = SceneBounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
        assert_eq!(box_lines(&camera(), 1.5, &bounds, Affine3A::IDENTITY).len(), 12);
        assert!(light_mark(&camera(), 1.5, Vec3::ZERO).is_some());
        assert!(on_light(&camera(), 1.5, Vec3::ZERO, Vec2::new(0.505, 0.5)));
    }
}

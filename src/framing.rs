//! A point of view for scenes that bring none: around things, inside rooms.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, Ray, RayQuery};
use heliostat_scene::{Camera, SceneBounds};
use heliostat_shading::sampling::uniform_sphere;

/// Directions looked into from the middle of the scene.
const PROBES: u32 = 256;
/// Directions along which a camera may stand inside a room.
const AZIMUTHS: u32 = 32;
/// Share of probes that must see the front of something far away for the scene to be a room.
const ROOM_SHARE: f32 = 0.5;
/// Distance that a camera inside must be able to step back, in radii of the scene.
const LEAST_SPACE: f32 = 0.4;
/// Vertical field of view inside rooms, radians: wide enough for two walls.
const ROOM_FOV: f32 = 1.05;
/// Vertical field of view from outside, radians.
const OUTSIDE_FOV: f32 = 0.7;

/// A camera that shows a scene well: for a room, from within (or through its open side) along the longest view; for
/// anything else all of it, in a three-quarter view. `aspect` is the picture's width over its height; `vertical_fov`
/// (radians) replaces the camera's own choice.
pub fn frame_scene(
    rays: &impl RayQuery,
    bounds: &SceneBounds,
    aspect: f32,
    vertical_fov: Option<f32>,
) -> Camera {
    middle_of_room(rays, bounds)
        .and_then(|middle| inside(rays, bounds, middle, aspect, vertical_fov.unwrap_or(ROOM_FOV)))
        .unwrap_or_else(|| outside(bounds, aspect, vertical_fov.unwrap_or(OUTSIDE_FOV)))
}

/// The most enclosed of some points around the middle of the bounds (furniture may stand in the very middle), if it is
/// enclosed enough for a room.
fn middle_of_room(rays: &impl RayQuery, bounds: &SceneBounds) -> Option<Vec3> {
    let half = 0.5 * (bounds.max - bounds.min);
    let steps = [0.0, -0.4, 0.4];
    let offsets = [0.0, 0.4].into_iter().flat_map(|y| {
        steps.into_iter().flat_map(move |x| steps.into_iter().map(move |z| Vec3::new(x, y, z)))
    });
    let points = offsets.map(|offset| bounds.center() + half * offset);
    let (middle, share) = points.map(|point| (point, enclosure(rays, bounds, point))).fold(
        (bounds.center(), 0.0),
        // The middle itself comes first and yields only to a clearly better place.
        |best, candidate| if candidate.1 > best.1 + 0.05 { candidate } else { best },
    );
    (share >= ROOM_SHARE).then_some(middle)
}

/// Share of directions in which a point sees the front of something not much nearer than the bounds, over all
/// directions or over the level ones, whichever is less. Walls face their room, while from within a solid all faces are
/// seen from behind, and over a plain there are no walls.
fn enclosure(rays: &impl RayQuery, bounds: &SceneBounds, point: Vec3) -> f32 {
    let probes: Vec<Ray> = (0..PROBES)
        .map(|i| {
            let golden = (i as f32 * 0.618_034).fract();
            let direction = uniform_sphere(Vec2::new((i as f32 + 0.5) / PROBES as f32, golden));
            // The sphere's axis is z; turned up, the level directions are those of small y.
            Ray::new(point, Vec3::new(direction.x, direction.z, direction.y))
        })
        .collect();
    let mut hits = vec![Hit::MISS; probes.len()];
    rays.intersect(&probes, &mut hits);
    let sees_wall = |(ray, hit): (&Ray, &Hit)| {
        let exit = distance_to_bounds(bounds, point, ray.direction);
        hit.is_hit() && hit.ng.dot(ray.direction) < 0.0 && hit.t > 0.25 * exit
    };
    let share = |level: bool| {
        let chosen = || probes.iter().zip(&hits).filter(|(ray, _)| !level || ray.direction.y.abs() < 0.5);
        chosen().filter(|&pair| sees_wall(pair)).count() as f32 / chosen().count().max(1) as f32
    };
    share(false).min(share(true))
}

/// From a point inside the box to its surface.
fn distance_to_bounds(bounds: &SceneBounds, point: Vec3, direction: Vec3) -> f32 {
    let room = Vec3::select(direction.cmpgt(Vec3::ZERO), bounds.max - point, point - bounds.min);
    (room / direction.abs().max(Vec3::splat(1e-6))).min_element()
}

/// Stands back from the middle of a room: through its open side if it has one, else as far as there is space. `None`
/// where there is little space: the inside of a helmet is no room.
fn inside(
    rays: &impl RayQuery,
    bounds: &SceneBounds,
    middle: Vec3,
    aspect: f32,
    vertical_fov: f32,
) -> Option<Camera> {
    let backwards: Vec<Ray> = (0..AZIMUTHS)
        .map(|i| {
            let (sin, cos) = (TAU * i as f32 / AZIMUTHS as f32).sin_cos();
            Ray::new(middle, Vec3::new(sin, 0.0, cos))
        })
        .collect();
    let mut hits = vec![Hit::MISS; backwards.len()];
    rays.intersect(&backwards, &mut hits);
    let ways = || backwards.iter().map(|ray| ray.direction).zip(&hits);
    let open: Vec3 = ways().filter(|(_, hit)| !hit.is_hit()).map(|(direction, _)| direction).sum();
    if open.length() > 1.0 {
        // Straight through an opening that roughly lies along an axis, from where the room fills the picture.
        let mean = open.normalize();
        let axis =
            if mean.x.abs() > mean.z.abs() { Vec3::X * mean.x.signum() } else { Vec3::Z * mean.z.signum() };
        let direction = if mean.dot(axis) > 0.85 { axis } else { mean };
        let (center, half) = (bounds.center(), 0.5 * (bounds.max - bounds.min));
        let across = Vec3::new(direction.z, 0.0, -direction.x).abs().dot(half);
        let back = (across / aspect).max(half.y) / (0.5 * vertical_fov).tan();
        let eye = center + direction * (distance_to_bounds(bounds, center, direction) + back);
        return Some(Camera::look_at("inside", eye, center, Vec3::Y, vertical_fov));
    }
    // Among equals the view from +Z wins.
    let (direction, distance) = ways().fold((Vec3::Z, 0.0), |best, (direction, hit)| {
        let free = 0.9 * hit.t;
        if hit.is_hit() && free > 1.001 * best.1 { (direction, free) } else { best }
    });
    let eye = middle + distance * direction;
    (distance > LEAST_SPACE * bounds.radius())
        .then(|| Camera::look_at("inside", eye, middle, Vec3::Y, vertical_fov))
}

/// From above and the right, as near as it can be while every corner of the bounds stays in the picture.
fn outside(bounds: &SceneBounds, aspect: f32, vertical_fov: f32) -> Camera {
    const MARGIN: f32 = 1.06;
    let center = bounds.center();
    let toward_eye = Vec3::new(0.62, 0.42, 1.0).normalize();
    let axes =
        Camera::look_at("", center + toward_eye, center, Vec3::Y, vertical_fov).world_from_camera.matrix3;
    let slope = (0.5 * vertical_fov).tan();
    let half = 0.5 * (bounds.max - bounds.min);
    // A corner at (x, y, z) in camera axes around the centre needs |x| ≤ (d − z) · slope · aspect, and |y| likewise.
    let distance = (0..8)
        .map(|i| {
            Vec3::from_array([0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -half[axis] } else { half[axis] }))
        })
        .map(|corner| axes.transpose() * corner)
        .map(|p| p.z + (p.x.abs() / aspect).max(p.y.abs()) / slope)
        .fold(0.0, f32::max);
    // A scene that is a single point still gets a camera outside it.
    let distance = (MARGIN * distance).max(1e-3);
    Camera::look_at("outside", center + distance * toward_eye, center, Vec3::Y, vertical_fov)
}

#[cfg(test)]
mod tests {
    use super::*;
    use heliostat_engine::{Engine, EngineOptions};
    use heliostat_scene::{Backend, Material, Mesh, Progress, SceneBuilder};

    #[test]
    fn framing_fits_the_bounds_tightly() {
        for aspect in [0.5, 1.0, 2.0] {
            let bounds = SceneBounds { min: Vec3::new(-1.0, 0.0, 2.0), max: Vec3::new(5.0, 1.0, 3.0) };
            let camera = outside(&bounds, aspect, 0.7);
            let camera_from_world = camera.world_from_camera.inverse();
            let mut extent = 0.0f32;
            for i in 0..8 {
                let pick = |axis: usize| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
                let p = camera_from_world.transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
                let edge = -p.z * 0.35f32.tan();
                assert!(p.z < 0.0);
                extent = extent.max(p.x.abs() / (edge * aspect)).max(p.y.abs() / edge);
            }
            assert!((0.85..=1.0).contains(&extent), "{aspect}: {extent}");
        }
    }

    /// A 2×2×6 box of the given sides facing in or out.
    fn framed(sides: &[Vec3], inwards: bool) -> Camera {
        let mut scene = SceneBuilder::new();
        let grey = scene.material(Material::diffuse("", Vec3::splat(0.5)));
        for &side in sides {
            let (u, v) = side.any_orthonormal_pair();
            let (u, v) = if (u.cross(v).dot(side) > 0.0) == inwards { (v, u) } else { (u, v) };
            let mesh = scene.mesh(Mesh::quad(side - u - v, 2.0 * u, 2.0 * v));
            let object = scene.object("", [(mesh, grey)]);
            scene.instance(object, glam::Affine3A::from_scale(Vec3::new(1.0, 1.0, 3.0)));
        }
        let mut engine = Engine::new(EngineOptions::default()).expect("an engine");
        engine.apply(&scene.finish(), &Progress::new()).expect("valid");
        let bounds = engine.scene().bounds().expect("not empty");
        frame_scene(engine.rays(), &bounds, 1.0, None)
    }

    #[test]
    fn rooms_are_seen_from_inside_and_things_from_outside() {
        let sides = [Vec3::NEG_Z, Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z];
        let eye = |camera: &Camera| Vec3::from(camera.world_from_camera.translation);
        let closed = framed(&sides, true);
        assert!(
            eye(&closed).z.abs() < 3.0 && eye(&closed).z.abs() > 2.0,
            "along the long axis: {}",
            eye(&closed)
        );
        let open = framed(&sides[..5], true);
        assert!(eye(&open).z > 3.0, "through the open side: {}", eye(&open));
        assert_eq!(open.name, "inside");
        assert_eq!(framed(&sides, false).name, "outside", "a solid box is no room");
    }
}

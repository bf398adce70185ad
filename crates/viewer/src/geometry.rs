//! Between the picture and the world: rays through picture points, projections back, boxes of placed things.

use std::collections::BTreeMap;
use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};
use heliostat_scene::{Camera, Geometry, ObjectId, Projection, Quadric, Scene, SceneBounds};

use crate::placed::MAX_NESTING;

/// Where a ray starts and its unit direction, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PictureRay {
    /// Metres.
    pub(crate) origin: Vec3,
    /// Unit length.
    pub(crate) direction: Vec3,
}

/// The ray through a point of the picture; `at` runs from (0, 0) at the top left to (1, 1) at the bottom right, `aspect`
/// is width over height. Lenses are taken for pinholes, two eyes for one.
pub(crate) fn ray_through(camera: &Camera, at: Vec2, aspect: f32) -> PictureRay {
    let place = camera.world_from_camera;
    let (x, y) = ((2.0 * at.x - 1.0) * aspect, 1.0 - 2.0 * at.y);
    let (origin, direction) = match camera.projection {
        Projection::Perspective { vertical_fov } => {
            let slope = (0.5 * vertical_fov).tan();
            (Vec3::ZERO, Vec3::new(x * slope, y * slope, -1.0))
        }
        Projection::Orthographic { height } => (0.5 * height * Vec3::new(x, y, 0.0), Vec3::NEG_Z),
        Projection::Panoramic => {
            let (sin, cos) = ((at.x - 0.5) * TAU).sin_cos();
            let (sin_polar, cos_polar) = (at.y * PI).sin_cos();
            (Vec3::ZERO, Vec3::new(sin_polar * sin, cos_polar, -sin_polar * cos))
        }
        // The angle from the axis, or the sine of its half, is in proportion to the distance from the centre.
        Projection::FisheyeEquidistant { fov } => {
            (Vec3::ZERO, off_axis(x, y, (0.5 * fov * x.hypot(y)).min(PI)))
        }
        Projection::FisheyeEquisolid { fov } => {
            let sine = ((0.25 * fov).sin() * x.hypot(y)).min(1.0);
            (Vec3::ZERO, off_axis(x, y, 2.0 * sine.asin()))
        }
    };
    PictureRay {
        origin: place.transform_point3(origin),
        direction: place.transform_vector3(direction).normalize_or(Vec3::NEG_Z),
    }
}

/// A direction at an angle from the view axis, towards (x, y) of the picture.
fn off_axis(x: f32, y: f32, angle: f32) -> Vec3 {
    let across = Vec2::new(x, y).normalize_or_zero() * angle.sin();
    across.extend(-angle.cos())
}

/// Where a point of the world appears in the picture; `None` behind the camera and for panoramas and fisheyes, in which
/// straight lines are not straight.
pub(crate) fn project(camera: &Camera, point: Vec3, aspect: f32) -> Option<Vec2> {
    let p = camera.world_from_camera.inverse().transform_point3(point);
    let (x, y) = match camera.projection {
        Projection::Perspective { vertical_fov } => {
            let depth = -p.z * (0.5 * vertical_fov).tan();
            (depth > 1e-6).then_some((p.x / depth, p.y / depth))?
        }
        Projection::Orthographic { height } => (2.0 * p.x / height, 2.0 * p.y / height),
        Projection::Panoramic
        | Projection::FisheyeEquidistant { .. }
        | Projection::FisheyeEquisolid { .. } => return None,
    };
    let at = Vec2::new(0.5 + 0.5 * x / aspect, 0.5 - 0.5 * y);
    at.is_finite().then_some(at)
}

/// The box around an object in its own space, everything placed in it included; `None` when it is empty.
pub(crate) fn object_bounds(scene: &Scene, object: ObjectId) -> Option<SceneBounds> {
    boxes(scene, object, &mut BTreeMap::new(), 0)
}

fn boxes(
    scene: &Scene,
    object: ObjectId,
    known: &mut BTreeMap<ObjectId, Option<SceneBounds>>,
    depth: usize,
) -> Option<SceneBounds> {
    if let Some(bounds) = known.get(&object) {
        return *bounds;
    }
    let mut bounds = None;
    for part in &scene.objects().get(&object)?.parts {
        match &scene.geometries()[&part.geometry] {
            Geometry::Mesh(mesh) => mesh.positions.iter().for_each(|&p| grow(&mut bounds, p)),
            Geometry::Quadrics(shapes) => {
                shapes.shapes.iter().flat_map(Quadric::bounds).for_each(|p| grow(&mut bounds, p));
            }
        }
    }
    if depth < MAX_NESTING {
        for id in scene.placed_in(Some(object)) {
            let instance = &scene.instances()[&id];
            if let Some(inner) = boxes(scene, instance.object, known, depth + 1) {
                corners(&inner)
                    .for_each(|c| grow(&mut bounds, instance.parent_from_object.transform_point3(c)));
            }
        }
    }
    known.insert(object, bounds);
    bounds
}

/// The eight corners; bit 0, 1, 2 of the index choose the far end in x, y, z.
pub(crate) fn corners(bounds: &SceneBounds) -> impl Iterator<Item = Vec3> {
    let (min, max) = (bounds.min, bounds.max);
    (0..8).map(move |i| Vec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), max, min))
}

fn grow(bounds: &mut Option<SceneBounds>, p: Vec3) {
    if p.is_finite() {
        let old = bounds.unwrap_or(SceneBounds { min: p, max: p });
        *bounds = Some(SceneBounds { min: old.min.min(p), max: old.max.max(p) });
    }
}

#[cfg(test)]
mod tests {
    use glam::Affine3A;
    use heliostat_scene::{Material, Mesh, SceneBuilder};

    use super::*;

    #[test]
    fn projection_undoes_rays() {
        let mut camera =
            Camera::look_at("", Vec3::new(1.0, 2.0, 3.0), Vec3::new(-4.0, 0.5, 0.0), Vec3::Y, 0.8);
        for projection in
            [Projection::Perspective { vertical_fov: 0.8 }, Projection::Orthographic { height: 3.0 }]
        {
            camera.projection = projection;
            for at in [Vec2::new(0.5, 0.5), Vec2::new(0.1, 0.8), Vec2::new(1.0, 0.0)] {
                let ray = ray_through(&camera, at, 1.5);
                let back = project(&camera, ray.origin + 4.0 * ray.direction, 1.5).expect("in front");
                assert!(back.abs_diff_eq(at, 1e-5), "{at} {back}");
            }
        }
        camera.projection = Projection::Perspective { vertical_fov: 0.8 };
        assert_eq!(project(&camera, Vec3::new(6.0, 3.5, 6.0), 1.0), None, "behind");
    }

    #[test]
    fn nested_things_have_boxes() {
        let mut builder = SceneBuilder::new();
        let grey = builder.material(Material::default());
        let quad = builder.mesh(Mesh::quad(Vec3::ZERO, Vec3::X, Vec3::Y));
        let leaf = builder.object("leaf", [(quad, grey)]);
        let group = builder.object("group", []);
        builder.child(group, leaf, Affine3A::from_translation(Vec3::X));
        let mut scene = Scene::default();
        scene.apply(&builder.finish()).unwrap();
        let bounds = object_bounds(&scene, group).expect("not empty");
        assert_eq!((bounds.min, bounds.max), (Vec3::X, Vec3::new(2.0, 1.0, 0.0)));
    }
}

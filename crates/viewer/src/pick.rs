//! What lies under a point of the picture: a picture of one pixel, so that every backend can answer.

use glam::{Vec2, Vec3};
use heliostat_scene::{
    Backend, BackendError, Camera, Frame, FrameRequest, InstanceId, MaterialId, Plane, Progress,
};

use crate::geometry::ray_through;

/// Vertical field of view of the one pixel, radians: the narrowest that the arithmetic of cameras takes well.
const NEEDLE: f32 = 2e-4;

/// What a ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pick {
    /// The innermost instance.
    pub instance: InstanceId,
    /// What it is made of there.
    pub material: MaterialId,
    /// World space, metres.
    pub position: Vec3,
    /// From the ray's origin, metres.
    pub distance: f32,
}

/// What lies under `at` of the camera's picture, which runs from (0, 0) at the top left to (1, 1); `None` for nothing.
///
/// # Errors
/// Those of [`Backend::render`].
pub(crate) fn pick(
    backend: &mut dyn Backend,
    camera: &Camera,
    at: Vec2,
    aspect: f32,
) -> Result<Option<Pick>, BackendError> {
    let ray = ray_through(camera, at, aspect);
    look_along(backend, ray.origin, ray.direction)
}

/// What a ray meets first.
///
/// # Errors
/// Those of [`Backend::render`].
pub(crate) fn look_along(
    backend: &mut dyn Backend,
    origin: Vec3,
    direction: Vec3,
) -> Result<Option<Pick>, BackendError> {
    let renderers = backend.renderers();
    let renderer = ["cast", "direct"].into_iter().find(|name| renderers.contains(name));
    let renderer = renderer.or(renderers.first().copied()).unwrap_or("cast");
    let needle = Camera::look_at("", origin, origin + direction, Vec3::Y, NEEDLE);
    let request = FrameRequest {
        renderer: renderer.into(),
        samples: 1,
        max_depth: Some(1),
        planes: vec![Plane::InstanceId, Plane::MaterialId, Plane::Position, Plane::Depth],
        ..FrameRequest::new(needle, 1, 1)
    };
    Ok(read(&backend.render(&request, &Progress::new())?))
}

/// Reads the planes of the one pixel.
fn read(frame: &Frame) -> Option<Pick> {
    let plane = |wanted: Plane| {
        frame.planes.iter().find(|data| data.plane == wanted).map_or(&[][..], |data| &data.values)
    };
    let id = |wanted: Plane| plane(wanted).first().filter(|&&id| id >= 1.0).map(|id| *id as u32 - 1);
    let &[x, y, z] = plane(Plane::Position) else { return None };
    Some(Pick {
        instance: InstanceId(id(Plane::InstanceId)?),
        material: MaterialId(id(Plane::MaterialId)?),
        position: Vec3::new(x, y, z),
        distance: *plane(Plane::Depth).first()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::tests::document;

    #[test]
    fn the_needle_agrees_with_the_planes_of_a_picture() {
        let mut document = document("cornell");
        let camera = document.scene().cameras().values().next().expect("a camera").clone();
        let (width, height) = (16, 12);
        let planes = vec![Plane::InstanceId, Plane::MaterialId];
        let request = FrameRequest {
            renderer: "cast".into(),
            samples: 1,
            planes,
            ..FrameRequest::new(camera.clone(), width, height)
        };
        let frame = document.backend().render(&request, &Progress::new()).expect("a picture");
        let mut agreed = 0;
        for y in 0..height {
            for x in 0..width {
                let at = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
                let aspect = width as f32 / height as f32;
                let found = pick(document.backend(), &camera, at, aspect).expect("an answer");
                let id = found.map_or(0.0, |pick| pick.instance.0 as f32 + 1.0);
                agreed += u32::from(id == frame.planes[0].values[(y * width + x) as usize]);
            }
        }
        // Samples lie anywhere in their pixel: at edges the two may differ.
        assert!(agreed > width * height * 8 / 10, "{agreed}");
    }
}

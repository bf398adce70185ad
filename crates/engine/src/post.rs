//! What happens to a finished picture: counts of what its rays pass, and its pixel shaders.

use glam::Vec2;
use heliostat_kernel::{Ray, World};
use heliostat_scene::{Frame, FrameRequest, Plane};
use heliostat_shading::pixel::{BoundPixelShader, PixelFrame};
use heliostat_shading::{CameraRays, LaneMode};
use rayon::prelude::*;

/// The planes of a request, and behind them those that its pixel shaders look at besides.
pub(crate) fn planes(request: &FrameRequest, shaders: &[BoundPixelShader]) -> Vec<Plane> {
    let mut planes = request.planes.clone();
    if shaders.iter().any(|shader| shader.info().needs_geometry) {
        planes.extend([Plane::Depth, Plane::Normal].iter().filter(|plane| !request.planes.contains(plane)));
    }
    planes
}

/// Puts the picture through shaders, one after the other, all rows at once.
pub(crate) fn shade(frame: &mut Frame, shaders: &[BoundPixelShader], mode: LaneMode) {
    for shader in shaders {
        let plane = |wanted: Plane| {
            let found = frame.planes.iter().find(|data| data.plane == wanted);
            found.map_or(&[][..], |data| &data.values)
        };
        let (width, height) = (frame.width as usize, frame.height as usize);
        let (depth, normal) = (plane(Plane::Depth), plane(Plane::Normal));
        let picture = PixelFrame { width, height, color: &frame.color, depth, normal };
        let mut shaded = frame.color.clone();
        shaded
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(row, colors)| shader.row(mode, &picture, row, colors));
        frame.color = shaded;
    }
}

/// Counts what the rays through the pixels' centres pass, for the planes that show it.
pub(crate) fn count_visits(frame: &mut Frame, world: &World, camera: &CameraRays) {
    let width = frame.width as usize;
    for data in frame.planes.iter_mut().filter(|data| matches!(data.plane, Plane::Nodes | Plane::Triangles)) {
        let count = |row: usize, column: usize| {
            let center = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
            let along = camera.ray(center, Vec2::splat(0.5), 0.0);
            let visits = world.visits(&Ray::new(along.origin, along.direction));
            if data.plane == Plane::Nodes { visits.nodes } else { visits.primitives }
        };
        data.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
            values.iter_mut().enumerate().for_each(|(column, value)| *value = count(row, column) as f32);
        });
    }
}

//! What happens to a finished picture: its pixel shaders.

use heliostat_scene::{Frame, FrameRequest, Plane};
use heliostat_shading::LaneMode;
use heliostat_shading::pixel::{BoundPixelShader, PixelFrame};
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

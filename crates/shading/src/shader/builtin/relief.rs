//! Bumps from height functions: what procedural shaders share to bend normals.

use crate::lanes::{Real, Vector};
use crate::shader::Point;

/// Slopes beyond this are cut: steeper ones hide themselves.
const STEEPEST: f32 = 4.0;

/// A height over the surface as a function of the place.
pub(super) trait Relief<F: Real> {
    /// Metres of object space, at a place in it.
    fn height(&self, p: Vector<F>) -> F;
}

/// Width of the footprint along the surface, metres of object space. At grazing angles it is cut as for textures.
#[inline(always)]
pub(super) fn footprint<F: Real>(at: &Point<F>) -> F {
    let cos = at.ng.dot(at.wo).abs().clamp(0.25, 1.0);
    at.width * at.object_axes[0].length() / cos
}

/// The normal of a surface whose unit normal is `normal`, raised by a relief with details of about `detail` metres of
/// object space. The relief itself fades out what the footprint cannot show.
///
/// # References
/// Blinn, "Simulation of Wrinkled Surfaces", 1978; Mikkelsen, "Bump Mapping Unparametrized Surfaces on the GPU", 2010,
/// and "Surface Gradient-Based Bump Mapping Framework", 2020: the normal less the surface gradient, here by forward
/// differences in the tangent plane.
#[inline(always)]
pub(super) fn raised<F: Real>(
    at: &Point<F>,
    relief: &impl Relief<F>,
    detail: F,
    normal: Vector<F>,
) -> Vector<F> {
    // Metres of object space to a metre of the world.
    let scale = at.object_axes[0].length().max(detail.splat(1e-20));
    let step = (footprint(at) * 0.3).max(detail * 0.02) / scale;
    let [a, b] = at.object_axes;
    let places = [at.object_position, at.object_position + a * step, at.object_position + b * step];
    let mut heights = [step; 3];
    for (height, place) in heights.iter_mut().zip(places) {
        *height = relief.height(place);
    }
    let [here, along_a, along_b] = heights;
    let per_step = (scale * step).recip();
    let slope_a = ((along_a - here) * per_step).clamp(-STEEPEST, STEEPEST);
    let slope_b = ((along_b - here) * per_step).clamp(-STEEPEST, STEEPEST);
    (normal - at.axes[0] * slope_a - at.axes[1] * slope_b).normalized_or(normal)
}

//! Cartoon shading as far as a closure goes: bands of matte colour by the angle to the camera, and an outline.

use super::{make_matte, matte};
use crate::closure::Closure;
use crate::lanes::Real;
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const LIT: usize = 0;
const SHADE: usize = 1;
const BANDS: usize = 2;
const OUTLINE: usize = 3;
const OUTLINE_WIDTH: usize = 4;

/// Flat bands by the facing angle. A closure does not know where light comes from, so the camera's direction stands for it;
/// lights still add their shading and shadows. Paths of light and reflections see the bands that the camera sees: for a
/// frame, the surface is a matte one of fixed colours.
///
/// # References
/// Lake, Marshall, Harris, Blackstein, "Stylized Rendering Techniques for Scalable Real-Time 3D Animation", 2000; Gooch,
/// Sloan, Gooch, Shirley, Riesenfeld, "Interactive Technical Illustration", 1999, for the silhouette by angle.
#[derive(Debug)]
pub(super) struct Toon;

impl SurfaceShader for Toon {
    fn info(&self) -> ShaderInfo {
        matte(
            "toon",
            "flat bands of colour by the angle to the viewer, with an outline",
            vec![
                Parameter::color("lit", [0.95, 0.55, 0.12], "colour of the band that faces the viewer"),
                Parameter::color("shade", [0.32, 0.06, 0.10], "colour of the band at the rim"),
                Parameter::float("bands", 4.0, [1.0, 16.0], "", "number of bands"),
                Parameter::color("outline", [0.01, 0.01, 0.015], "colour of the outline"),
                Parameter::float(
                    "outline_width",
                    0.3,
                    [0.0, 1.0],
                    "",
                    "largest cosine of the angle to the viewer that is outline",
                ),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let facing = closure.normal.dot(at.eye).abs().clamp(0.0, 1.0);
        let bands = inputs.float(BANDS).max(inputs.constant(1.0)).floor();
        let band = (facing * bands).floor().min(bands - 1.0);
        let share = band / (bands - 1.0).max(inputs.constant(1.0));
        let color = inputs.vector(SHADE).mix(inputs.vector(LIT), share);
        let inside = facing.ge(inputs.float(OUTLINE_WIDTH));
        make_matte(closure, color.where_or(inside, inputs.vector(OUTLINE)));
    }
}

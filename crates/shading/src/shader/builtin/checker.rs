//! A three-dimensional checkerboard, box-filtered over the footprint.

use crate::closure::Closure;
use crate::lanes::noise::LIMIT;
use crate::lanes::{Real, Vector};
use crate::lobe_set::Lobes;
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const FIRST: usize = 0;
const SECOND: usize = 1;
const SIZE: usize = 2;

/// How far below the surface the cubes are looked up, in cubes.
const INSIDE: f32 = 1e-3;

/// Cubes of two colours in object space.
#[derive(Debug)]
pub(super) struct Checker;

impl SurfaceShader for Checker {
    fn info(&self) -> ShaderInfo {
        ShaderInfo {
            name: "checker".into(),
            about: "cubes of two colours in object space, like a board carved from a block".into(),
            parameters: vec![
                Parameter::color("first", [0.8, 0.8, 0.8], "colour of the cubes around the origin"),
                Parameter::color("second", [0.1, 0.1, 0.1], "colour of their neighbours"),
                Parameter::float("size", 0.25, [1e-6, 1e6], "m", "edge of a cube, object space"),
            ],
            lobes: Lobes::NONE,
            see_through: false,
        }
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let per_cell = inputs.float(SIZE).recip();
        // A little below the surface, so that faces on a border between cubes show the cubes behind them.
        let [across, along] = at.object_axes;
        let below = across.cross(along).normalized_or(Vector::grey(inputs.constant(0.0)));
        let p = at.object_position * per_cell - below.scaled(INSIDE);
        let p = p.clamp(-LIMIT, LIMIT);
        // The footprint lies in the surface: along an axis at right angles to it, it has no extent.
        let width = at.width * per_cell;
        let extent = across * across + along * along;
        let [x, y, z] = [extent.x.sqrt() * width, extent.y.sqrt() * width, extent.z.sqrt() * width];
        // The mean of the sign over the footprint is about the product of the means along the axes.
        let sign = wave(p.x, x) * wave(p.y, y) * wave(p.z, z);
        closure.base_color = inputs.vector(SECOND).mix(inputs.vector(FIRST), sign * 0.5 + 0.5);
    }
}

/// The square wave of period 2 that is 1 on [0, 1) and −1 on [1, 2), averaged over `width` around `x`.
#[inline(always)]
fn wave<F: Real>(x: F, width: F) -> F {
    // Beyond ten thousand cells the mean is zero; below, what is left of a cell must not reach back over its border.
    let width = width.clamp(INSIDE, 1e4);
    ((integral(x + width * 0.5) - integral(x - width * 0.5)) / width).clamp(-1.0, 1.0)
}

/// Its integral from 0: a triangle wave between 0 and 1.
#[inline(always)]
fn integral<F: Real>(x: F) -> F {
    let t = x * 0.5 - (x * 0.5).floor();
    (t * 2.0 - 1.0).abs().complement()
}

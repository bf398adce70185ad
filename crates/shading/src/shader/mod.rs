//! Surface shaders: small programs that change a material's closure from point to point.
//!
//! A shader is written once, reads like scalar code and runs on lanes ([`SurfaceShader`]). The engine sees it through
//! [`SurfaceProgram`], which works on packets in memory; plug-ins implement the same interface from outside.

mod builtin;
mod constants;
mod inputs;
mod registry;
#[cfg(test)]
pub(crate) mod testing;

use std::sync::Arc;

use fearless_simd::{Level, Simd};

use crate::closure::{Closure, Closures};
use crate::lanes::{Packet, Real, Vector};
use crate::lobe_set::Lobes;
use crate::packet::on_lanes;
use crate::point::Points;
use crate::surface::LaneMode;

pub(crate) use builtin::cube_helix;
pub use builtin::heat_color;
pub use constants::Constants;
pub(crate) use constants::constants;
pub(crate) use inputs::InputSource;
pub use inputs::{Input, Inputs};
pub(crate) use registry::Bound;
pub use registry::{PluginSource, ShaderProblem, ShaderRegistry};

/// What a parameter holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// A number.
    Float,
    /// A linear Rec. 709 RGB colour.
    Color,
    /// A vector.
    Vector,
}

/// A parameter of a shader.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name, in snake case.
    pub name: String,
    /// What it holds.
    pub kind: ParameterKind,
    /// Its value unless set; numbers take the first component.
    pub default: [f32; 3],
    /// Smallest and largest value that makes sense; values beyond are moved to the nearer end.
    pub range: [f32; 2],
    /// Such as `m` or `1/m`; empty for pure numbers.
    pub unit: String,
    /// One line on what it does.
    pub about: String,
}

impl Parameter {
    /// A number.
    pub fn float(name: &str, default: f32, range: [f32; 2], unit: &str, about: &str) -> Self {
        let kind = ParameterKind::Float;
        let default = [default; 3];
        Self { name: name.into(), kind, default, range, unit: unit.into(), about: about.into() }
    }

    /// A colour with components from 0 to 1.
    pub fn color(name: &str, default: [f32; 3], about: &str) -> Self {
        let kind = ParameterKind::Color;
        Self { name: name.into(), kind, default, range: [0.0, 1.0], unit: String::new(), about: about.into() }
    }
}

/// What there is to know about a shader.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderInfo {
    /// Its name.
    pub name: String,
    /// One line on what it looks like.
    pub about: String,
    /// Its parameters: shaders refer to them by their place here.
    pub parameters: Vec<Parameter>,
    /// Lobes that it may give energy to where the material has none.
    pub lobes: Lobes,
    /// Whether it may make an opaque material let light pass.
    pub see_through: bool,
}

/// Points as a shader sees them.
#[derive(Clone, Copy, Debug)]
pub struct Point<F: Real> {
    /// World space, metres.
    pub position: Vector<F>,
    /// Object space.
    pub object_position: Vector<F>,
    /// Unit geometric normal in world space, on the front side.
    pub ng: Vector<F>,
    /// Unit vector towards where the ray came from, world space.
    pub wo: Vector<F>,
    /// Unit vector towards the camera of the frame, world space, whatever ray arrived: the same for light and in mirrors.
    /// Where there is no frame, as when lamps are measured, it is `wo`.
    pub eye: Vector<F>,
    /// Whether the viewer sees the front.
    pub front: F::Mask,
    /// First set of texture coordinates.
    pub uv: [F; 2],
    /// Width of the footprint across the ray, metres: detail finer than this should fade out.
    pub width: F,
    /// Distance along the ray that arrived, metres.
    pub distance: F,
    /// Edges between the camera and this point, from 1.
    pub level: F,
    /// Two unit axes in the tangent plane of the shading normal, world space.
    pub axes: [Vector<F>; 2],
    /// What a metre along those axes is in object space.
    pub object_axes: [Vector<F>; 2],
}

/// A surface shader over lanes. Its functions must be `#[inline(always)]`; see [`crate::lanes`] for what else lanes ask.
pub trait SurfaceShader: Send + Sync + std::fmt::Debug + 'static {
    /// Name, parameters and what else there is to know.
    fn info(&self) -> ShaderInfo;

    /// Changes the material's closure at points. Values out of range are moved into it afterwards.
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>);
}

/// A surface shader over packets in memory: what the engine calls.
pub trait SurfaceProgram: Send + Sync + std::fmt::Debug {
    /// Name, parameters and what else there is to know.
    fn info(&self) -> ShaderInfo;

    /// Changes the first `count` closures. `inputs` are in the order of the parameters.
    fn run(&self, mode: LaneMode, count: usize, points: &Points, inputs: &[Input], closures: &mut Closures);

    /// The program that runs with these inputs and no others, if the shader wants to prepare something for them.
    ///
    /// # Errors
    /// Why the shader cannot work with them, and what to do.
    fn prepared(&self, _inputs: &[Input]) -> Result<Option<Arc<dyn SurfaceProgram>>, String> {
        Ok(None)
    }

    /// What went wrong while it ran and was not told before.
    fn take_problem(&self) -> Option<String> {
        None
    }
}

/// Makes every lane shader a program.
#[derive(Debug)]
pub struct OnLanes<T>(pub T);

impl<T: SurfaceShader> SurfaceProgram for OnLanes<T> {
    fn info(&self) -> ShaderInfo {
        self.0.info()
    }

    fn run(&self, mode: LaneMode, count: usize, points: &Points, inputs: &[Input], closures: &mut Closures) {
        let shader = &self.0;
        on_lanes!(mode, count, |token, lane| run_lanes::<_>(token, lane, shader, points, inputs, closures));
    }
}

#[inline(always)]
fn run_lanes<F: Real>(
    token: F::Token,
    lane: usize,
    shader: &impl SurfaceShader,
    points: &Points,
    inputs: &[Input],
    closures: &mut Closures,
) {
    let at = points.point::<F>(token, lane);
    let inputs = Inputs::new(token, lane, inputs, points);
    let mut closure = closures.load::<F>(token, lane);
    shader.shade(&at, &inputs, &mut closure);
    closures.store(&closure, lane);
}

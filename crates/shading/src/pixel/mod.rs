//! Pixel shaders: small programs that change the colours of a finished picture, with what lies around each pixel.
//!
//! A shader is written once, reads like scalar code and runs on lanes ([`PixelShader`]), sixteen pixels of a row at a time.
//! Those that are tone curves end in colours for a display: linear, from 0 to 1.

mod curves;
mod effects;
mod registry;
#[cfg(test)]
mod tests;

use fearless_simd::{Level, Simd};
use glam::Vec3;

use crate::lanes::{Floats, Packet, Real, Vector, Vectors, WIDTH};
use crate::packet::on_lanes;
use crate::shader::Parameter;
use crate::surface::LaneMode;

pub use crate::shader::Constants as PixelValues;
pub use curves::filmic;
pub use registry::{BoundPixelShader, PixelProgram, PixelRegistry};

/// What there is to know about a pixel shader.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelInfo {
    /// Its name.
    pub name: String,
    /// One line on what it does.
    pub about: String,
    /// Its parameters: shaders refer to them by their place here.
    pub parameters: Vec<Parameter>,
    /// Whether its answers are colours for a display, linear and from 0 to 1, rather than radiance.
    pub for_display: bool,
    /// Whether it looks at [`PixelFrame::depth`] and [`PixelFrame::normal`].
    pub needs_geometry: bool,
}

/// A finished picture, rows from the top.
#[derive(Clone, Copy, Debug)]
pub struct PixelFrame<'a> {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear Rec. 709 radiance.
    pub color: &'a [Vec3],
    /// Distance along the ray, metres, 0 where nothing is hit; empty if no shader asked for it.
    pub depth: &'a [f32],
    /// Shading normals, three numbers each; empty if no shader asked for them.
    pub normal: &'a [f32],
}

impl PixelFrame<'_> {
    /// Index of a pixel; beyond the border the last one continues.
    fn index(&self, x: isize, y: isize) -> usize {
        let inside = |at: isize, size: usize| at.clamp(0, size as isize - 1) as usize;
        inside(y, self.height) * self.width + inside(x, self.width)
    }
}

/// A row of pixels as a shader sees them, from one on.
#[derive(Clone, Copy, Debug)]
pub struct Pixels<'a, F: Real> {
    token: F::Token,
    lane: usize,
    frame: &'a PixelFrame<'a>,
    column: usize,
    row: usize,
}

impl<F: Real> Pixels<'_, F> {
    /// Radiance of the pixels so many columns to the right and rows below; the border continues.
    #[inline(always)]
    pub fn color(&self, right: isize, down: isize) -> Vector<F> {
        let mut lanes = Vectors::default();
        colors(self.frame, self.column, self.row, [right, down], &mut lanes);
        Vector::load(self.token, &lanes, self.lane)
    }

    /// Distance along the ray, metres; a million where nothing is hit.
    #[inline(always)]
    pub fn depth(&self, right: isize, down: isize) -> F {
        let mut lanes = Floats::ZERO;
        depths(self.frame, self.column, self.row, [right, down], &mut lanes);
        F::load(self.token, &lanes, self.lane)
    }

    /// Shading normal; zero where nothing is hit.
    #[inline(always)]
    pub fn normal(&self, right: isize, down: isize) -> Vector<F> {
        let mut lanes = Vectors::default();
        normals(self.frame, self.column, self.row, [right, down], &mut lanes);
        Vector::load(self.token, &lanes, self.lane)
    }

    /// Place in the picture: (0, 0) in the middle, y up, 1 at half the diagonal.
    #[inline(always)]
    pub fn place(&self) -> [F; 2] {
        let (width, height) = (self.frame.width as f32, self.frame.height as f32);
        let scale = 2.0 / (width * width + height * height).sqrt();
        let mut columns = Floats::ZERO;
        for (lane, column) in columns.0.iter_mut().zip(self.column..) {
            *lane = column as f32;
        }
        let x = F::load(self.token, &columns, self.lane);
        let y = F::constant(self.token, self.row as f32);
        [(x + (0.5 - 0.5 * width)) * scale, (y + (0.5 - 0.5 * height)) * -scale]
    }
}

// Gathered one by one: rows start anywhere, so that nothing is aligned for wide loads.

#[inline(never)]
fn colors(frame: &PixelFrame<'_>, column: usize, row: usize, [right, down]: [isize; 2], out: &mut Vectors) {
    for lane in 0..WIDTH {
        let at = frame.index((column + lane) as isize + right, row as isize + down);
        out.set(lane, frame.color[at]);
    }
}

#[inline(never)]
fn depths(frame: &PixelFrame<'_>, column: usize, row: usize, [right, down]: [isize; 2], out: &mut Floats) {
    for (lane, value) in out.0.iter_mut().enumerate() {
        let at = frame.index((column + lane) as isize + right, row as isize + down);
        let depth = frame.depth.get(at).copied().unwrap_or(0.0);
        *value = if depth > 0.0 { depth } else { 1e6 };
    }
}

#[inline(never)]
fn normals(frame: &PixelFrame<'_>, column: usize, row: usize, [right, down]: [isize; 2], out: &mut Vectors) {
    for lane in 0..WIDTH {
        let at = 3 * frame.index((column + lane) as isize + right, row as isize + down);
        out.set(lane, frame.normal.get(at..at + 3).map_or(Vec3::ZERO, Vec3::from_slice));
    }
}

/// A pixel shader over lanes. Its functions must be `#[inline(always)]`; see [`crate::lanes`] for what else lanes ask.
pub trait PixelShader: Send + Sync + std::fmt::Debug + 'static {
    /// Name, parameters and what else there is to know.
    fn info(&self) -> PixelInfo;

    /// The new colours of some pixels. What is not finite becomes black.
    fn shade<F: Real>(&self, at: &Pixels<'_, F>, values: &PixelValues<'_, F>) -> Vector<F>;
}

/// Makes every lane shader a program.
#[derive(Debug)]
struct OnLanes<T>(T);

impl<T: PixelShader> PixelProgram for OnLanes<T> {
    fn info(&self) -> PixelInfo {
        self.0.info()
    }

    fn row(&self, mode: LaneMode, frame: &PixelFrame<'_>, row: usize, values: &[Vec3], out: &mut [Vec3]) {
        let shader = &self.0;
        let mut lanes = Vectors::default();
        for (colors, first) in out.chunks_mut(WIDTH).zip((0..).step_by(WIDTH)) {
            let (at, lanes) = ((first, row), &mut lanes);
            on_lanes!(mode, colors.len(), |token, lane| run::<_>(
                token, lane, shader, frame, at, values, lanes
            ));
            for (lane, color) in colors.iter_mut().enumerate() {
                let answer = lanes.get(lane);
                *color = if answer.is_finite() { answer } else { Vec3::ZERO };
            }
        }
    }
}

#[inline(always)]
fn run<F: Real>(
    token: F::Token,
    lane: usize,
    shader: &impl PixelShader,
    frame: &PixelFrame<'_>,
    (column, row): (usize, usize),
    values: &[Vec3],
    out: &mut Vectors,
) {
    let at = Pixels { token, lane, frame, column, row };
    shader.shade::<F>(&at, &PixelValues { token, values }).store(out, lane);
}

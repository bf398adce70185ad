//! Quantities made visible: surfaces that glow in the colour of a number and do nothing else.

use crate::closure::Closure;
use crate::lanes::noise::linear_step;
use crate::lanes::{Real, Vector, cos_sin_turns, pow};
use crate::lobe_set::Lobes;
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

fn shows(name: &str, about: &str, parameters: Vec<Parameter>) -> ShaderInfo {
    ShaderInfo { name: name.into(), about: about.into(), parameters, lobes: Lobes::NONE, see_through: false }
}

/// Makes a closure an unlit black surface that glows.
#[inline(always)]
fn glow<F: Real>(closure: &mut Closure<F>, color: Vector<F>) {
    let black = Vector::grey(closure.opacity.splat(0.0));
    closure.base_color = black;
    closure.metallic = black.x;
    closure.specular = black.x;
    closure.transmission = black.x;
    closure.coat = black.x;
    closure.ambient = black;
    closure.opacity = black.x.splat(1.0);
    closure.emission = color;
}

/// From black over blue-violet, green and pink to white as `x` goes from 0 to 1: lightness grows steadily, so that the order
/// survives without hues. Linear Rec. 709.
///
/// # References
/// Green, "A Colour Scheme for the Display of Astronomical Intensity Images", 2011, equation 2, with start 0.5,
/// −1.5 rotations, hue 1 and γ 1; its values are display-encoded and are decoded by IEC 61966-2-1.
#[inline(always)]
pub(crate) fn cube_helix<F: Real>(x: F) -> Vector<F> {
    const START: f32 = 0.5;
    const ROTATIONS: f32 = -1.5;
    let x = x.clamp(0.0, 1.0);
    let turns = x * ROTATIONS + (START / 3.0 + 2.0);
    let (cos, sin) = cos_sin_turns(turns - turns.floor());
    let amplitude = x * x.complement() * 0.5;
    decoded(Vector::new(
        x + amplitude * (cos * -0.148_61 + sin * 1.782_77),
        x + amplitude * (cos * -0.292_27 - sin * 0.906_49),
        x + amplitude * (cos * 1.972_94),
    ))
}

/// The colour that false colours give to a quantity from 0 (black) to 1 (white), linear Rec. 709: a path through blue, green
/// and red along which lightness grows steadily.
///
/// # References
/// Green, "A Colour Scheme for the Display of Astronomical Intensity Images", 2011, equation 2.
pub fn heat_color(x: f32) -> glam::Vec3 {
    cube_helix(x).into()
}

/// Linear values of sRGB-encoded ones.
#[inline(always)]
fn decoded<F: Real>(encoded: Vector<F>) -> Vector<F> {
    Vector::new(decoded_channel(encoded.x), decoded_channel(encoded.y), decoded_channel(encoded.z))
}

#[inline(always)]
fn decoded_channel<F: Real>(encoded: F) -> F {
    let encoded = encoded.clamp(0.0, 1.0);
    let curve = pow((encoded + 0.055) * (1.0 / 1.055), encoded.splat(2.4));
    (encoded * (1.0 / 12.92)).where_or(encoded.le(encoded.splat(0.04045)), curve)
}

/// World-space normals as colours.
#[derive(Debug)]
pub(super) struct ShowNormal;

impl SurfaceShader for ShowNormal {
    fn info(&self) -> ShaderInfo {
        shows("show-normal", "the shading normal in world space: (n + 1) / 2 as red, green, blue", Vec::new())
    }

    #[inline(always)]
    fn shade<F: Real>(&self, _: &Point<F>, _: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let half = Vector::grey(closure.opacity.splat(0.5));
        let color = decoded(closure.normal.scaled(0.5) + half);
        glow(closure, color);
    }
}

/// Distances as colours.
#[derive(Debug)]
pub(super) struct ShowDepth;

impl SurfaceShader for ShowDepth {
    fn info(&self) -> ShaderInfo {
        shows(
            "show-depth",
            "distance along the ray that arrived, from white (near) to black (far)",
            vec![
                Parameter::float("near", 0.0, [0.0, 1e9], "m", "distance that is white"),
                Parameter::float("far", 10.0, [1e-6, 1e9], "m", "distance that is black"),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let near = inputs.float(0);
        let depth = (inputs.float(1) - near).max(inputs.constant(1e-6));
        glow(closure, cube_helix(((at.distance - near) / depth).complement()));
    }
}

/// Ray-tree levels as colours.
#[derive(Debug)]
pub(super) struct ShowLevel;

impl SurfaceShader for ShowLevel {
    fn info(&self) -> ShaderInfo {
        let levels = Parameter::float(
            "levels",
            8.0,
            [2.0, 1000.0],
            "",
            "edges between camera and surface that are white",
        );
        shows(
            "show-level",
            "how many rays it took to get here: dark at first sight, brighter in mirrors",
            vec![levels],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let levels = inputs.float(0).max(inputs.constant(2.0));
        glow(closure, cube_helix(at.level / levels));
    }
}

/// Texture coordinates as colours.
#[derive(Debug)]
pub(super) struct ShowUv;

impl SurfaceShader for ShowUv {
    fn info(&self) -> ShaderInfo {
        shows(
            "show-uv",
            "texture coordinates: u as red, v as green, every other unit with blue",
            vec![Parameter::float("repeat", 1.0, [1e-6, 1e6], "", "cycles of colour along a unit")],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let repeat = inputs.float(0);
        let (u, v) = (at.uv[0] * repeat, at.uv[1] * repeat);
        let cells = (u.floor() + v.floor()) * 0.5;
        let odd = cells - cells.floor();
        glow(closure, decoded(Vector::new(u - u.floor(), v - v.floor(), odd)));
    }
}

/// The angle to the viewer as a colour.
#[derive(Debug)]
pub(super) struct ShowFacing;

impl SurfaceShader for ShowFacing {
    fn info(&self) -> ShaderInfo {
        let back = Parameter::color("back", [0.8, 0.02, 0.02], "tint of surfaces seen from behind");
        shows(
            "show-facing",
            "cosine of the angle to the viewer, from black (grazing) to white (head-on)",
            vec![back],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let facing = linear_step(0.0, 1.0, closure.normal.dot(at.wo).abs());
        let tint = Vector::grey(inputs.constant(1.0)).where_or(at.front, inputs.vector(0));
        glow(closure, cube_helix(facing) * tint);
    }
}

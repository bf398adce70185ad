//! Light shaders: what stands in front of a lamp on a stage.

use std::f32::consts::TAU;

use crate::lanes::{Real, Vector, cos_sin_turns};
use crate::light_shader::{LightInfo, LightShader};
use crate::shader::{Constants, Parameter};

/// A spotlight between four doors, each of which cuts the beam along a straight edge.
#[derive(Debug)]
pub(super) struct BarnDoors;

/// A right angle, nearly.
const SQUARE: f32 = 1.57;

const BEAM: usize = 0;
const FIELD: usize = 1;
const LEFT: usize = 2;
const RIGHT: usize = 3;
const TOP: usize = 4;
const BOTTOM: usize = 5;
const SOFTNESS: usize = 6;

impl LightShader for BarnDoors {
    fn info(&self) -> LightInfo {
        let angle = |name: &str, default: f32, about: &str| {
            Parameter::float(name, default, [0.0, SQUARE], "rad", about)
        };
        let door = |name: &str, default: f32| {
            let about = format!("angle from the axis to the edge of the {name} door; negative ones cross it");
            Parameter::float(name, default, [-SQUARE, SQUARE], "rad", &about)
        };
        LightInfo {
            name: "barn-doors".into(),
            about: "a soft spotlight of 1 W/sr between four doors that cut its beam".into(),
            parameters: vec![
                angle("beam", 0.3, "half angle within which the light is full"),
                angle("field", 0.6, "half angle at which it has faded to nothing"),
                door("left", SQUARE),
                door("right", SQUARE),
                door("top", 0.2),
                door("bottom", 0.2),
                Parameter::float("softness", 0.03, [1e-3, 1.0], "rad", "width of the doors' half shadows"),
            ],
        }
    }

    #[inline(always)]
    fn intensity<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F> {
        let Vector { x, y, z } = direction;
        let (full, _) = cos_sin_turns(values.float(BEAM) * (1.0 / TAU));
        let (dark, _) = cos_sin_turns(values.float(FIELD) * (1.0 / TAU));
        let fade = ((-z - dark) / (full - dark).max(z.splat(1e-4))).clamp(0.0, 1.0);
        let mut share = smooth(fade);
        for (door, aside) in [(LEFT, -x), (RIGHT, x), (TOP, y), (BOTTOM, -y)] {
            let (cos, sin) = cos_sin_turns(values.float(door) * (1.0 / TAU));
            // Sine of the angle from the direction out to the door's edge.
            let inside = -z * sin - aside * cos;
            share = share * soft_edge(inside, values.float(SOFTNESS));
        }
        Vector::grey(share)
    }
}

/// Light through a window with blinds: stripes on whatever it meets.
#[derive(Debug)]
pub(super) struct Blinds;

const WIDTH: usize = 0;
const HEIGHT: usize = 1;
const SLATS: usize = 2;
const OPEN: usize = 3;
const BLUR: usize = 4;

impl LightShader for Blinds {
    fn info(&self) -> LightInfo {
        let size = |name: &str, default: f32, about: &str| {
            Parameter::float(name, default, [1e-3, 100.0], "m", about)
        };
        LightInfo {
            name: "blinds".into(),
            about: "light of 1 W/sr through a window with blinds".into(),
            parameters: vec![
                size("width", 0.8, "of the window, at a distance of 1 m"),
                size("height", 1.0, "of the window, at a distance of 1 m"),
                Parameter::float("slats", 10.0, [1.0, 1000.0], "", "number of slats"),
                Parameter::float("open", 0.5, [0.0, 1.0], "", "share of the light that passes between them"),
                Parameter::float("softness", 0.2, [1e-3, 1.0], "", "of edges, in slats"),
            ],
        }
    }

    #[inline(always)]
    fn intensity<F: Real>(&self, direction: Vector<F>, values: &Constants<'_, F>) -> Vector<F> {
        let zero = direction.z.splat(0.0);
        let ahead = direction.z.lt(zero);
        // Where the ray crosses the window, from its centre.
        let depth = -direction.z;
        let (x, y) = (direction.x / depth, direction.y / depth);
        let per_slat = values.float(SLATS) / values.float(HEIGHT);
        let (blur, slat) = (values.float(BLUR), y * per_slat + values.float(SLATS) * 0.5);
        // From the middle of the gap (0) to that of the slat (1).
        let aside = ((slat - slat.floor()) * 2.0 - 1.0).abs();
        // All or nothing passes at the ends of the range, whatever the blur.
        let edge = values.float(OPEN) * (blur * 2.0 + 1.0) - blur;
        let stripe = soft_edge(edge - aside, blur * 2.0);
        let (across, along) = (values.float(WIDTH) * 0.5 - x.abs(), values.float(HEIGHT) * 0.5 - y.abs());
        let window = soft_edge(across * per_slat, blur) * soft_edge(along * per_slat, blur);
        Vector::grey((stripe * window).only(ahead))
    }
}

/// What passes an edge that is so far outside, with a half shadow of some width.
#[inline(always)]
fn soft_edge<F: Real>(distance: F, width: F) -> F {
    smooth((distance / width + 0.5).clamp(0.0, 1.0))
}

/// From 0 to 1 without corners.
#[inline(always)]
fn smooth<F: Real>(t: F) -> F {
    t * t * (t * -2.0 + 3.0)
}

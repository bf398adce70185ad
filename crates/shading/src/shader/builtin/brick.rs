//! Brickwork in running bond, with mortar joints as colour and as relief.

use super::relief::{Relief, footprint, raised};
use super::{make_plastic, plastic};
use crate::closure::Closure;
use crate::lanes::noise::{Octaves, cell_hash, fbm, filtered_pulses, smooth_step};
use crate::lanes::{Real, Vector, Whole};
use crate::shader::{Inputs, Parameter, Point, ShaderInfo, SurfaceShader};

const FIRST: usize = 0;
const SECOND: usize = 1;
const MORTAR: usize = 2;
const LENGTH: usize = 3;
const HEIGHT: usize = 4;
const JOINT: usize = 5;
const DEPTH: usize = 6;
const VARIATION: usize = 7;
const ROUGHNESS: usize = 8;

/// A brick wall. Courses lie in planes of constant y; faces that look along x run along z, all others along x; level ones
/// are paved.
#[derive(Debug)]
pub(super) struct Brick;

/// The wall in bricks: where bricks and joints lie.
struct Wall<F: Real> {
    /// Whether bricks run along z instead of x.
    turned: F::Mask,
    /// Whether courses follow each other along z instead of y.
    level: F::Mask,
    /// Bricks per metre along and across the courses.
    per_metre: [F; 2],
    /// Share of the joint, per direction.
    joint: [F; 2],
    depth: F,
    /// Of the footprint, metres of object space.
    width: F,
}

/// A place in a wall.
struct Place<F: Real> {
    course: F,
    /// Along the course, from the first brick's end, in bricks.
    along: F,
    across: F,
}

impl<F: Real> Wall<F> {
    #[inline(always)]
    fn new(at: &Point<F>, inputs: &Inputs<'_, F>) -> Self {
        let least = inputs.constant(1e-6);
        let (length, height) = (inputs.float(LENGTH).max(least), inputs.float(HEIGHT).max(least));
        let joint = inputs.float(JOINT);
        let n = at.object_axes[0].cross(at.object_axes[1]);
        let (x, y, z) = (n.x.abs(), n.y.abs(), n.z.abs());
        let level = y.gt(x) & y.gt(z);
        Self {
            turned: x.gt(z) & !level,
            level,
            per_metre: [length.recip(), height.recip()],
            joint: [(joint / length).clamp(0.0, 1.0), (joint / height).clamp(0.0, 1.0)],
            depth: inputs.float(DEPTH),
            width: footprint(at),
        }
    }

    #[inline(always)]
    fn place(&self, p: Vector<F>) -> Place<F> {
        // Joints lie half on either side of the bricks' borders.
        let across = p.z.where_or(self.level, p.y) * self.per_metre[1] + self.joint[1] * 0.5;
        let course = across.floor();
        // Every other course is moved by half a brick.
        let half = course * 0.5 - (course * 0.5).floor();
        let along = p.z.where_or(self.turned, p.x) * self.per_metre[0] + self.joint[0] * 0.5 + half;
        Place { course, along, across }
    }

    /// Share of brick in the footprint.
    #[inline(always)]
    fn brick(&self, place: &Place<F>) -> F {
        let along = filtered_pulses(
            place.along - self.joint[0],
            self.joint[0].complement(),
            self.width * self.per_metre[0],
        );
        let across = filtered_pulses(
            place.across - self.joint[1],
            self.joint[1].complement(),
            self.width * self.per_metre[1],
        );
        along * across
    }
}

impl<F: Real> Relief<F> for Wall<F> {
    #[inline(always)]
    fn height(&self, p: Vector<F>) -> F {
        let place = self.place(p);
        // Metres to the nearest edge, negative in the joint.
        let along = edge_distance(place.along, self.joint[0]) / self.per_metre[0];
        let across = edge_distance(place.across, self.joint[1]) / self.per_metre[1];
        let per_metre = self.per_metre[1] * 3.0;
        let octaves =
            Octaves { count: p.x.splat(4.0), gain: p.x.splat(0.6), width: self.width * per_metre, seed: 31 };
        let rough = fbm(p * per_metre, octaves);
        // Edges are rounded over half the depth or what the footprint shows, if that is more.
        let round = (self.depth.max(self.width) + 1e-6).recip();
        let brick = smooth_step(-0.5, 0.7, along.min(across) * round);
        self.depth * (brick + rough * 0.35)
    }
}

/// Signed distance to the nearer edge of the brick around, in bricks: negative in the joint.
#[inline(always)]
fn edge_distance<F: Real>(x: F, joint: F) -> F {
    let t = x - x.floor();
    let brick = (t - joint).min(t.complement());
    let mortar = (t - joint).max(-t);
    brick.where_or(t.ge(joint), mortar)
}

impl SurfaceShader for Brick {
    fn info(&self) -> ShaderInfo {
        plastic(
            "brick",
            "a wall in running bond, courses level in object space",
            vec![
                Parameter::color("first", [0.33, 0.10, 0.055], "colour of some bricks"),
                Parameter::color("second", [0.19, 0.065, 0.05], "colour of others; most lie between"),
                Parameter::color("mortar", [0.42, 0.40, 0.37], "colour of the joints"),
                Parameter::float("length", 0.25, [1e-6, 1e6], "m", "of a brick and a joint, object space"),
                Parameter::float("height", 0.075, [1e-6, 1e6], "m", "of a brick and a joint, object space"),
                Parameter::float("joint", 0.012, [0.0, 1e6], "m", "width of the joints, object space"),
                Parameter::float("depth", 0.006, [0.0, 1e6], "m", "how far joints lie behind the bricks"),
                Parameter::float(
                    "variation",
                    0.35,
                    [0.0, 1.0],
                    "",
                    "how much bricks differ in brightness and are stained",
                ),
                Parameter::float("roughness", 0.85, [0.0, 1.0], "", "of bricks; mortar has half the gloss"),
            ],
        )
    }

    #[inline(always)]
    fn shade<F: Real>(&self, at: &Point<F>, inputs: &Inputs<'_, F>, closure: &mut Closure<F>) {
        let wall = Wall::new(at, inputs);
        let p = at.object_position;
        let place = wall.place(p);
        let brick = wall.brick(&place);
        let id = cell_hash(Vector::new(place.along.floor(), place.course, p.x.splat(0.0)), 32);
        let per_metre = wall.per_metre[1] * 2.0;
        let octaves = Octaves {
            count: inputs.constant(5.0),
            gain: inputs.constant(0.6),
            width: wall.width * per_metre,
            seed: 33,
        };
        let stain = fbm(p * per_metre, octaves);
        let variation = inputs.float(VARIATION);
        // From afar all bricks are alike.
        let seen = smooth_step(0.35, 1.0, wall.width * wall.per_metre[1]).complement();
        let (shade, mixture) = ((id.hashed().unit() - 0.5) * seen, (id.unit() - 0.5) * seen + 0.5);
        let light = (shade + stain * 1.2) * variation + 1.0;
        let color = inputs.vector(FIRST).mix(inputs.vector(SECOND), mixture) * light.positive();
        let mortar = inputs.vector(MORTAR) * (stain * variation * 0.8 + 1.0).positive();
        let roughness = inputs.float(ROUGHNESS);
        let mortar_roughness = roughness.mix(inputs.constant(1.0), inputs.constant(0.5));
        make_plastic(closure, mortar.mix(color, brick), mortar_roughness.mix(roughness, brick));
        let detail = wall.depth.max(inputs.float(JOINT)).max(inputs.constant(1e-6));
        closure.normal = raised(at, &wall, detail, closure.normal);
    }
}

//! A car's body: one superellipse after the other along its length, hollows for the wheels, a cabin of glass.

use std::f32::consts::{PI, TAU};

use glam::{Affine3A, Vec2, Vec3};

use super::wheel::RADIUS;
use crate::shape::Shape;
use crate::solid::{loft, sphere, superellipse, tube};

/// Half of the length and of the width, metres. The front is at −x.
const HALF_LENGTH: f32 = 2.15;
const HALF_WIDTH: f32 = 0.90;
/// Places of the axles along x, and of the wheels' middles to either side.
pub(super) const AXLES: [f32; 2] = [-1.32, 1.30];
pub(super) const TRACK: f32 = 0.755;
/// Of the hollows around the wheels.
const ARCH: f32 = 0.41;
/// Exponents of a section's height and width over sine and cosine: small ones are boxes.
const TALL: f32 = 0.5;
const WIDE: f32 = 0.36;
/// Height at which the cabin begins, sunk into the body.
const WAIST: f32 = 0.80;

pub(super) struct Body {
    pub(super) painted: Shape,
    pub(super) windows: Shape,
    pub(super) trim: Shape,
    pub(super) chrome: Shape,
    pub(super) head_lamps: Shape,
    pub(super) tail_lamps: Shape,
}

pub(super) fn parts() -> Body {
    let hull = Shape::patch(320, 360, Vec2::new(2.0 * HALF_LENGTH, 4.0), hull);
    let mut trim = Shape::default();
    for x in AXLES {
        for side in [1.0, -1.0] {
            trim.add(&arch_edge(x, side));
            trim.add(&liner(x, side));
        }
    }
    // Bars before the mouth.
    for (y, reach) in [(0.34, 0.50), (0.385, 0.54), (0.43, 0.50)] {
        let at = |i: i32| (front(y, reach * i as f32 / 12.0), 0.02);
        trim.add(&tube(&(-12..=12).map(at).collect::<Vec<_>>(), 12, true));
    }
    let bumper = Shape::rounded_block(Vec3::new(0.08, 0.10, 1.1), 0.035, 4, 1);
    trim.add(&bumper.moved(Vec3::new(2.125, 0.34, 0.0)));
    let (windows, roof, pillars) = cabin();
    trim.add(&pillars);
    let lamp = |x: f32, y: f32, z: f32, size: Vec3, turn: f32| {
        let stretched = Affine3A::from_translation(Vec3::new(x, y, z)) * Affine3A::from_rotation_y(turn);
        sphere(Vec3::ZERO, 1.0, 48).at(stretched * Affine3A::from_scale(size))
    };
    let both = |make: &dyn Fn(f32) -> Shape| Shape::union([make(1.0), make(-1.0)]);
    let mirrors = both(&|side| {
        let at = Vec3::new(-0.62, 0.93, side * 0.93);
        Shape::rounded_block(Vec3::new(0.13, 0.11, 0.2), 0.05, 5, 1).moved(at)
    });
    let chrome = both(&|side| {
        let at = |x: f32| Vec3::new(x, 0.70, side * (Station::at(x).half_width(0.70) + 0.006));
        tube(&[(at(0.10), 0.011), (at(0.28), 0.011)], 12, true)
    });
    Body {
        painted: Shape::union([hull, roof, mirrors]),
        windows,
        trim,
        chrome,
        head_lamps: both(&|side| lamp(-1.955, 0.60, side * 0.60, Vec3::new(0.10, 0.055, 0.19), side * 0.42)),
        tail_lamps: both(&|side| lamp(2.045, 0.70, side * 0.56, Vec3::new(0.05, 0.045, 0.25), side * -0.22)),
    }
}

/// The inside of the hollow above a wheel.
fn liner(axle: f32, side: f32) -> Shape {
    Shape::patch(64, 4, Vec2::ONE, |u, v| {
        let p = Vec2::new(axle, RADIUS) + (ARCH - 0.05) * Vec2::from_angle(PI * (1.1 * u - 0.05));
        let outside = Station::at(p.x).half_width(p.y) - 0.012;
        Vec3::new(p.x, p.y, side * (0.60 + (outside - 0.60) * v))
    })
}

fn smooth(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// sign(x) |x|ᵉ
fn power(x: f32, exponent: f32) -> f32 {
    x.abs().powf(exponent).copysign(x)
}

/// The body's outline across its length at a place along it, without the hollows for the wheels.
struct Station {
    x: f32,
    bottom: f32,
    top: f32,
    /// 1 where the body is fullest, 0 at both ends.
    end: f32,
}

impl Station {
    /// `x` within the body.
    fn at(x: f32) -> Self {
        Self::new(x, (1.0 - (x / HALF_LENGTH).abs().powi(5)).max(0.0).powf(0.2))
    }

    /// Along the length as along a superellipse of exponent 5, so that both ends are round: (x / half length, `end`) is a
    /// point of it.
    fn new(x: f32, end: f32) -> Self {
        let bonnet = 0.66 + 0.20 * smooth(-2.1, -0.75, x);
        let top = bonnet + 0.05 * smooth(0.3, 1.5, x) - 0.03 * smooth(1.7, 2.15, x);
        Self { x, bottom: 0.19 + 0.09 * smooth(1.3, 2.1, x.abs()), top, end }
    }

    fn middle(&self) -> f32 {
        0.5 * (self.top + self.bottom)
    }

    fn half_height(&self) -> f32 {
        0.5 * (self.top - self.bottom) * self.end.powf(0.45)
    }

    /// Half the width at the shoulder's height: narrower above, with a hollow along the doors.
    fn fullness(&self, y: f32) -> f32 {
        let height = (y - self.bottom) / (self.top - self.bottom);
        let doors = smooth(-1.1, -0.8, self.x) * (1.0 - smooth(0.8, 1.1, self.x));
        let hollow = 0.022 * (-((height - 0.40) / 0.16).powi(2)).exp() * doors;
        (HALF_WIDTH * (1.0 - 0.06 * smooth(0.62, 1.0, height)) - hollow) * self.end
    }

    /// A point by the angle around.
    fn point(&self, angle: f32) -> Vec3 {
        let (sin, cos) = angle.sin_cos();
        let y = self.middle() + self.half_height() * power(sin, TALL);
        Vec3::new(self.x, y, self.fullness(y) * power(cos, WIDE))
    }

    /// Half the width at a height.
    fn half_width(&self, y: f32) -> f32 {
        let sin =
            ((y - self.middle()) / self.half_height().max(1e-6)).clamp(-1.0, 1.0).abs().powf(1.0 / TALL);
        self.fullness(y) * (1.0 - sin * sin).max(0.0).powf(0.5 * WIDE)
    }
}

/// A point of the body: u around, v from the front to the back, both in even steps.
fn hull(u: f32, v: f32) -> Vec3 {
    let along = 2.0 * v.clamp(0.0, 1.0) - 1.0;
    let end = 1.0 - along.abs();
    let scale = (along.abs().powi(5) + end.powi(5)).powf(-0.2);
    let p = Station::new(HALF_LENGTH * along * scale, end * scale).point(-angle(u));
    Vec3::new(p.x, p.y, arched(p.x, p.y, p.z))
}

/// The angle around a section at which its points are spaced evenly: height grows with `q` in the lower half of a quarter,
/// width falls with it in the upper half.
fn angle(u: f32) -> f32 {
    let quarters = 4.0 * u.rem_euclid(1.0);
    let quarter = quarters.floor();
    let q = quarters - quarter;
    let rising = |q: f32| q.powf(1.0 / TALL).atan2((1.0 - q).powf(1.0 / WIDE));
    let within = if quarter % 2.0 == 0.0 { rising(q) } else { 0.5 * PI - rising(1.0 - q) };
    0.5 * PI * quarter + within
}

/// Where the front is at a height and to a side.
fn front(y: f32, z: f32) -> Vec3 {
    let (mut outside, mut inside) = (-HALF_LENGTH, -1.0);
    for _ in 0..24 {
        let x = 0.5 * (outside + inside);
        if Station::at(x).half_width(y) < z.abs() { outside = x } else { inside = x }
    }
    Vec3::new(inside, y, z)
}

/// The edge of the hollow around a wheel, on the body's surface.
fn arch_edge(axle: f32, side: f32) -> Shape {
    let points: Vec<(Vec3, f32)> = (0..=48)
        .map(|i| PI * (1.16 * i as f32 / 48.0 - 0.08))
        .map(|angle| Vec2::new(axle, RADIUS) + (ARCH + 0.004) * Vec2::from_angle(angle))
        .map(|p| (Vec3::new(p.x, p.y, side * (Station::at(p.x).half_width(p.y) - 0.008)), 0.022))
        .collect();
    tube(&points, 12, true)
}

/// Moves the sides inwards around the wheels.
fn arched(x: f32, y: f32, z: f32) -> f32 {
    let nearest = AXLES.map(|axle| Vec2::new(x - axle, y - RADIUS).length());
    let inside = 1.0 - smooth(ARCH - 0.06, ARCH, nearest[0].min(nearest[1]));
    let inner = z.clamp(-0.62, 0.62);
    z + (inner - z) * inside
}

/// The cabin's plan: a superellipse.
struct Plan {
    half: Vec2,
    exponent: f32,
}

const CABIN: Plan = Plan { half: Vec2::new(1.42, 0.765), exponent: 3.2 };

impl Plan {
    /// Half the width at a place along x.
    fn width(&self, x: f32) -> f32 {
        self.half.y * (1.0 - (x / self.half.x).abs().powf(self.exponent)).powf(1.0 / self.exponent)
    }

    /// The point (x, −z) of the outline, grown by `growth`, u around.
    fn rim(&self, u: f32, growth: f32) -> Vec2 {
        let d = Vec2::from_angle(TAU * u);
        let p = d * (d.abs().powf(self.exponent).element_sum()).powf(-1.0 / self.exponent);
        let gradient = p.signum() * p.abs().powf(self.exponent - 1.0) / self.half;
        p * self.half + growth * gradient.normalize()
    }
}

/// Windows, roof and pillars: a cabin that leans inwards all round, most at the front and the back.
fn cabin() -> (Shape, Shape, Shape) {
    let outline = superellipse(CABIN.half, CABIN.exponent, 192);
    let glass = [(0.02, -0.05), (0.0, 0.02), (-0.035, 0.14), (-0.085, 0.27), (-0.13, 0.36)];
    let lean = |p: Vec3| {
        // The windscreen lies flatter than the rear window.
        let slope = if p.x < 0.0 { 1.25 } else { 0.95 };
        let height = p.y.max(0.0);
        let shortened = p.x * (1.0 - slope * height).max(0.35);
        Vec3::new(shortened + 0.42, p.y + WAIST, p.z)
    };
    let windows = loft(&outline, &glass).warped(lean);
    let top = Shape::patch(192, 24, Vec2::new(4.0, 1.0), |u, v| {
        let rim = CABIN.rim(u, -0.13);
        let out = 1.0 - v;
        Vec3::new(rim.x * out, 0.36 + 0.12 * (1.0 - out.powi(4)), -rim.y * out)
    });
    let mut pillars = Shape::default();
    for (x, n) in [(-0.62, 1.0), (0.05, 1.0), (0.72, 1.0), (-0.62, -1.0), (0.05, -1.0), (0.72, -1.0)] {
        let at = |growth: f32, y: f32| {
            let z = CABIN.width(x) + growth;
            lean(Vec3::new(x, y, n * z))
        };
        let points: Vec<(Vec3, f32)> = glass.iter().map(|&(growth, y)| (at(growth, y), 0.018)).collect();
        pillars.add(&tube(&points, 12, false));
    }
    (windows, top.warped(lean), pillars)
}

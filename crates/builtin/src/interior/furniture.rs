//! Furniture in two degrees of detail: plain boxes, or boxes with rounded edges.

use std::f32::consts::TAU;

use glam::{Affine3A, Vec2, Vec3};

use super::Finish::{Black, Cloth, Lamp, Night, Oak, Paper, Steel, White};
use super::{Finish, Piece};
use crate::random::Rng;
use crate::shape::Shape;
use crate::solid::{lathe, tube};

/// Of a door leaf, metres.
pub(crate) const DOOR: Vec2 = Vec2::new(0.92, 2.08);
/// Height of a desk's top, metres.
pub(crate) const DESK_HEIGHT: f32 = 0.74;

/// How boards are modelled.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Detail {
    /// Boxes of 12 triangles.
    Plain,
    /// Boxes with rounded edges, of 108.
    Fine,
}

impl Detail {
    /// A board of `size` with its lowest corner at `min`.
    fn board(self, min: Vec3, size: Vec3) -> Shape {
        match self {
            Self::Plain => Shape::block(min, min + size),
            Self::Fine => {
                let radius = 0.3 * size.min_element().min(0.04);
                Shape::rounded_block(size, radius, 1, 1).moved(min + 0.5 * size)
            }
        }
    }

    fn sides(self) -> u32 {
        if self == Self::Plain { 4 } else { 12 }
    }
}

fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A desk 1.6 × 0.8 m; one sits at its +Z side. Drawers on the right.
pub(crate) fn desk(detail: Detail) -> Piece {
    let board = |min: Vec3, size: Vec3| detail.board(min, size);
    let mut wood = board(v(-0.8, DESK_HEIGHT - 0.03, -0.4), v(1.6, 0.03, 0.8));
    wood.add(&board(v(-0.78, 0.0, -0.38), v(0.03, DESK_HEIGHT - 0.03, 0.74)));
    wood.add(&board(v(-0.75, 0.30, -0.34), v(1.10, 0.40, 0.02)));
    let mut white = board(v(0.35, 0.03, -0.36), v(0.42, DESK_HEIGHT - 0.06, 0.70));
    let mut handles = Shape::default();
    for drawer in 0..3 {
        let y = 0.05 + 0.215 * drawer as f32;
        white.add(&board(v(0.355, y, 0.34), v(0.41, 0.205, 0.018)));
        if detail == Detail::Fine {
            handles.add(&board(v(0.48, y + 0.13, 0.358), v(0.16, 0.014, 0.018)));
        }
    }
    let piece = Piece::default().with(Oak, &wood).with(White, &white);
    if detail == Detail::Fine { piece.with(Steel, &handles) } else { piece }
}

/// A screen, keyboard and papers as they lie on a desk at the origin.
pub(crate) fn workplace(detail: Detail) -> Piece {
    let board = |min: Vec3, size: Vec3| detail.board(min + Vec3::Y * DESK_HEIGHT, size);
    let mut black = board(v(-0.14, 0.0, -0.26), v(0.28, 0.012, 0.18));
    black.add(&board(v(-0.02, 0.01, -0.20), v(0.04, 0.20, 0.03)));
    black.add(&board(v(-0.30, 0.12, -0.17), v(0.60, 0.36, 0.025)));
    let screen = Shape::quad(v(-0.285, DESK_HEIGHT + 0.135, -0.143), Vec3::X * 0.57, Vec3::Y * 0.33);
    let keys = board(v(-0.22, 0.0, 0.10), v(0.44, 0.015, 0.14));
    let papers = Shape::block(v(0.0, 0.0, 0.0), v(0.21, 0.02, 0.297))
        .at(Affine3A::from_rotation_y(0.2))
        .moved(v(0.36, DESK_HEIGHT, -0.10));
    Piece::default().with(Black, &black).with(Night, &screen).with(White, &keys).with(Paper, &papers)
}

/// An office chair that faces −Z: seat, back and arms on a post with five legs.
pub(crate) fn chair(detail: Detail) -> Piece {
    let mut cushions = detail.board(v(-0.24, 0.43, -0.24), v(0.48, 0.07, 0.48));
    cushions.add(
        &detail
            .board(v(-0.22, 0.0, 0.0), v(0.44, 0.52, 0.06))
            .at(Affine3A::from_rotation_x(0.16))
            .moved(v(0.0, 0.56, 0.23)),
    );
    let post = [(v(0.0, 0.06, 0.0), 0.03), (v(0.0, 0.43, 0.0), 0.025)];
    let mut frame = tube(&post, detail.sides(), false);
    frame.add(&detail.board(v(-0.03, 0.41, 0.22), v(0.06, 0.30, 0.03)));
    for leg in 0..5 {
        let turn = Affine3A::from_rotation_y((leg as f32 + 0.25) / 5.0 * TAU);
        frame.add(&detail.board(v(-0.022, 0.045, 0.0), v(0.044, 0.035, 0.29)).at(turn));
    }
    if detail == Detail::Fine {
        for side in [-0.27, 0.27] {
            frame.add(&detail.board(v(side - 0.025, 0.64, -0.12), v(0.05, 0.03, 0.26)));
            frame.add(&detail.board(v(side - 0.015, 0.45, 0.02), v(0.03, 0.19, 0.05)));
        }
    }
    Piece::default().with(Cloth, &cushions).with(Black, &frame)
}

/// A visitor's chair that faces −Z, on four legs.
pub(crate) fn visitor(detail: Detail) -> Piece {
    let mut cushions = detail.board(v(-0.22, 0.43, -0.22), v(0.44, 0.05, 0.44));
    cushions.add(&detail.board(v(-0.22, 0.58, 0.19), v(0.44, 0.28, 0.035)));
    let mut frame = Shape::default();
    for x in [-0.21f32, 0.18] {
        if detail == Detail::Plain {
            frame.add(&detail.board(v(x, 0.0, -0.20), v(0.03, 0.44, 0.38)));
            continue;
        }
        frame.add(&detail.board(v(x, 0.0, -0.21), v(0.03, 0.43, 0.03)));
        frame.add(&detail.board(v(x, 0.0, 0.185), v(0.03, 0.60, 0.03)));
    }
    Piece::default().with(Cloth, &cushions).with(Steel, &frame)
}

/// What stands in a shelf.
#[derive(Clone, Copy)]
pub(crate) enum Books {
    /// A block for each run of books.
    Runs,
    /// Every book for itself, up to so many on a board.
    Single(usize),
}

/// A shelf 1.2 × 2 m against a wall at −Z.
pub(crate) fn shelf(books: Books, seed: u64) -> Piece {
    let boards: usize = if matches!(books, Books::Runs) { 5 } else { 6 };
    let (w, h, d, t) = (1.2, 2.0, 0.30, 0.025);
    let height = |k: usize| 0.06 + (h - 0.06 - t) * k as f32 / (boards - 1) as f32;
    let mut case = Shape::block(v(-0.5 * w, 0.0, 0.0), v(0.5 * w, h, 0.012));
    for x in [-0.5 * w, 0.5 * w - t] {
        case.add(&Shape::block(v(x, 0.0, 0.012), v(x + t, h, d)));
    }
    for k in 0..boards {
        case.add(&Shape::block(v(-0.5 * w + t, height(k), 0.012), v(0.5 * w - t, height(k) + t, d - 0.005)));
    }
    let mut rng = Rng::new(seed);
    let mut volumes = Shape::default();
    for k in 0..boards - 1 {
        let (first, last) = (v(-0.5 * w + t + 0.01, height(k) + t, 0.04), 0.5 * w - t - 0.01);
        match books {
            Books::Runs => volumes.add(&run(&mut rng, first, last)),
            Books::Single(most) => row(&mut rng, most, first, last, &mut volumes),
        }
    }
    Piece::default().with(Oak, &case).with(Finish::Books, &volumes)
}

/// A block that shows several spines, somewhere between `first` and x = `last`.
fn run(rng: &mut Rng, first: Vec3, last: f32) -> Shape {
    let spines = 7.0 + rng.below(9) as f32;
    let size = v(0.042 * spines, rng.range(0.24, 0.31), 0.19);
    let corner = first + Vec3::X * rng.range(0.0, (last - first.x - size.x).max(0.0));
    let start = rng.below(16) as f32;
    let shown = move |uv: Vec2| Vec2::new((start + spines * uv.x / size.x) / 16.0, uv.y / size.y);
    Shape::block(corner, corner + size).with_uvs(shown)
}

/// Up to `most` books side by side with gaps, from `first` to x = `last` at the most.
fn row(rng: &mut Rng, most: usize, first: Vec3, last: f32, volumes: &mut Shape) {
    let mut corner = first + Vec3::X * rng.range(0.0, 0.25);
    for _ in 0..most {
        let size = v(rng.range(0.025, 0.06), rng.range(0.20, 0.31), rng.range(0.16, 0.22));
        if corner.x + size.x > last {
            break;
        }
        let column = rng.below(16) as f32;
        // A spine of the texture on the front; its colour everywhere else.
        let bound =
            move |uv: Vec2| Vec2::new((column + 0.2 + 0.6 * (uv.x / 0.25).min(1.0)) / 16.0, uv.y / size.y);
        volumes.add(&Shape::block(corner, corner + size).with_uvs(bound));
        corner.x += size.x + if rng.unit() > 0.9 { rng.range(0.05, 0.2) } else { 0.002 };
    }
}

/// A door leaf hinged at the origin, closed along +X, standing on the ground; with its handles.
pub(crate) fn door(detail: Detail) -> Piece {
    let leaf = detail.board(v(0.0, 0.01, -0.02), v(DOOR.x, DOOR.y, 0.04));
    let leaf = leaf.with_uvs(|uv| Vec2::new(uv.y, uv.x));
    let handle =
        Shape::union([0.02f32, -0.05].map(|z| detail.board(v(DOOR.x - 0.16, 1.02, z), v(0.12, 0.025, 0.03))));
    Piece::default().with(Oak, &leaf).with(Steel, &handle)
}

/// The casing around a door of a wall `thickness` thick; the hinge is at the origin.
pub(crate) fn casing(detail: Detail, thickness: f32) -> Piece {
    let (t, depth) = (0.05, thickness + 0.03);
    let z = -0.5 * depth;
    let mut shape = detail.board(v(-t, 0.0, z), v(t, DOOR.y + 0.02, depth));
    shape.add(&detail.board(v(DOOR.x, 0.0, z), v(t, DOOR.y + 0.02, depth)));
    shape.add(&detail.board(v(-t, DOOR.y + 0.02, z), v(DOOR.x + 2.0 * t, t, depth)));
    Piece::default().with(White, &shape)
}

/// A window `size` large with its pane, the lower left corner at the origin, looking towards −Z.
pub(crate) fn window(detail: Detail, size: Vec2) -> Piece {
    let (t, d) = (0.05, 0.06);
    let bar = |x: f32, y: f32, w: f32, h: f32| detail.board(v(x, y, -0.5 * d), v(w, h, d));
    let mut frame = bar(0.0, 0.0, size.x, t);
    frame.add(&bar(0.0, size.y - t, size.x, t));
    frame.add(&bar(0.0, t, t, size.y - 2.0 * t));
    frame.add(&bar(size.x - t, t, t, size.y - 2.0 * t));
    frame.add(&bar(0.5 * (size.x - t), t, t, size.y - 2.0 * t));
    let pane = Shape::quad(v(size.x, 0.0, 0.0), Vec3::NEG_X * size.x, Vec3::Y * size.y);
    Piece::default().with(White, &frame).with(Night, &pane)
}

/// A waste paper bin.
pub(crate) fn bin(detail: Detail) -> Piece {
    let profile = [(0.0, 0.0), (0.12, 0.0), (0.15, 0.32), (0.14, 0.32), (0.11, 0.02)];
    Piece::default().with(Black, &lathe(detail.sides(), &profile))
}

/// A picture in a frame against a wall at −Z, its middle at the origin.
pub(crate) fn picture(detail: Detail) -> Piece {
    let frame = detail.board(v(-0.45, -0.32, 0.0), v(0.90, 0.64, 0.02));
    let canvas = Shape::quad(v(-0.41, -0.28, 0.022), Vec3::X * 0.82, Vec3::Y * 0.56);
    Piece::default().with(Black, &frame).with(Finish::Accent, &canvas)
}

/// What holds a glowing face of `size` below a ceiling at y = 0: a box, or a rim around it.
pub(crate) fn lamp_rim(detail: Detail, size: Vec2) -> Piece {
    let (h, t) = (0.5 * size, 0.02);
    let bar = |x: [f32; 2], z: [f32; 2], drop: f32| Shape::block(v(x[0], -drop, z[0]), v(x[1], 0.0, z[1]));
    let mut shape = bar([-h.x - t, h.x + t], [-h.y - t, h.y + t], 0.025);
    if detail == Detail::Fine {
        for side in [-1.0f32, 1.0] {
            let ends = |inner: f32| [side * inner, side * (inner + t)];
            let ordered = |[a, b]: [f32; 2]| [a.min(b), a.max(b)];
            shape.add(&bar([-h.x - t, h.x + t], ordered(ends(h.y)), 0.05));
            shape.add(&bar(ordered(ends(h.x)), [-h.y, h.y], 0.05));
        }
    }
    Piece::default().with(White, &shape)
}

/// The glowing face of a ceiling lamp, which looks down from 3 cm below y = 0.
pub(crate) fn lamp_face(size: Vec2) -> Piece {
    let corner = v(-0.5 * size.x, -0.03, -0.5 * size.y);
    Piece::default().with(Lamp, &Shape::quad(corner, Vec3::X * size.x, Vec3::Z * size.y))
}

/// A desk lamp with its foot at the origin, bent towards +X, and where its bulb is.
pub(crate) fn desk_lamp(detail: Detail) -> (Piece, Vec3) {
    let sides = 2 * detail.sides();
    let mut metal = lathe(sides, &[(0.0, 0.0), (0.08, 0.0), (0.08, 0.015), (0.0, 0.02)]);
    let (elbow, head) = (v(-0.12, 0.28, 0.0), v(0.14, 0.46, 0.0));
    metal.add(&tube(&[(v(0.0, 0.02, 0.0), 0.007), (elbow, 0.007), (head, 0.007)], detail.sides(), false));
    let shade = lathe(sides, &[(0.075, -0.10), (0.078, -0.10), (0.03, 0.0), (0.0, 0.005)]).moved(head);
    (Piece::default().with(Steel, &metal).with(Black, &shade), head - Vec3::Y * 0.11)
}

/// A floor lamp that washes the ceiling, and where its bulb is.
pub(crate) fn floor_lamp(detail: Detail) -> (Piece, Vec3) {
    let sides = 2 * detail.sides();
    let mut metal = lathe(sides, &[(0.0, 0.0), (0.15, 0.0), (0.15, 0.02), (0.0, 0.03)]);
    metal.add(&tube(&[(v(0.0, 0.02, 0.0), 0.012), (v(0.0, 1.72, 0.0), 0.012)], detail.sides(), false));
    let bowl = lathe(sides, &[(0.0, 1.70), (0.05, 1.70), (0.18, 1.80)]);
    (Piece::default().with(Steel, &metal).with(White, &bowl), v(0.0, 1.84, 0.0))
}

/// A flight of stairs that rises `rise` towards +Z from the origin with `steps` treads, `width` wide; open risers between
/// two stringers, a handrail on each side.
pub(crate) fn stairs(detail: Detail, rise: f32, run: f32, width: f32, steps: u32) -> Piece {
    let (step_rise, step_run) = (rise / steps as f32, run / steps as f32);
    let half = 0.5 * width;
    let mut treads = Shape::default();
    for i in 0..steps {
        let at = v(-half, (i + 1) as f32 * step_rise - 0.05, i as f32 * step_run);
        treads.add(&detail.board(at, v(width, 0.05, step_run + 0.03)));
    }
    let slope = v(0.0, rise, run);
    let pitch = Affine3A::from_rotation_x(-rise.atan2(run));
    let mut steel = Shape::default();
    for x in [-half - 0.03, half] {
        let stringer = detail.board(v(0.0, -0.22, 0.0), v(0.03, 0.24, slope.length())).at(pitch);
        steel.add(&stringer.moved(v(x, 0.0, 0.0)));
        let x = x + 0.015;
        let rail = [(v(x, 0.95, 0.0), 0.022), (v(x, 0.95, 0.0) + slope, 0.022)];
        steel.add(&tube(&rail, 8, false));
        for post in 0..=steps / 2 {
            let t = post as f32 / (steps / 2).max(1) as f32;
            let foot = v(x, 0.0, 0.0) + slope * t;
            steel.add(&tube(&[(foot, 0.01), (foot + Vec3::Y * 0.95, 0.01)], 6, false));
        }
    }
    Piece::default().with(Oak, &treads).with(Steel, &steel)
}

/// A railing of `length` along +X, one metre high.
pub(crate) fn railing(length: f32) -> Piece {
    let posts = (length / 0.12).ceil() as u32;
    let mut shape = tube(&[(Vec3::Y * 1.0, 0.025), (v(length, 1.0, 0.0), 0.025)], 10, false);
    for i in 0..=posts {
        let foot = Vec3::X * (length * i as f32 / posts as f32);
        shape.add(&tube(&[(foot, 0.008), (foot + Vec3::Y, 0.008)], 6, false));
    }
    Piece::default().with(Steel, &shape)
}

/// A tube lamp of `length` along X that looks down: its glowing underside alone.
pub(crate) fn tube_lamp(length: f32) -> Piece {
    let corner = v(-0.5 * length, -0.045, -0.02);
    Piece::default().with(Lamp, &Shape::quad(corner, Vec3::X * length, Vec3::Z * 0.04))
}

/// A trough of three tubes below a ceiling at y = 0: housing and lamellae.
pub(crate) fn trough(size: Vec2) -> Piece {
    let h = 0.5 * size;
    let mut body = Shape::block(v(-h.x, -0.02, -h.y), v(h.x, 0.0, h.y));
    for z in [-h.y - 0.01, h.y] {
        body.add(&Shape::block(v(-h.x - 0.01, -0.08, z), v(h.x + 0.01, 0.0, z + 0.01)));
    }
    for i in 0..=6 {
        let x = -h.x + size.x * i as f32 / 6.0;
        body.add(&Shape::block(v(x - 0.002, -0.08, -h.y), v(x + 0.002, -0.05, h.y)));
    }
    Piece::default().with(White, &body)
}

//! Bézier patches: biquadratic surfaces, cut into triangles to a tolerance and without cracks.
//!
//! A patch is a grid of 3×3 pieces that share their borders. Each piece is cut evenly, in powers of two, finely enough
//! for its curvature and twist. A border is cut as its own three control points ask and nothing else: the two pieces that
//! share it, of one patch or of two, make the same vertices there, bit by bit, whichever way they run along it. Where a
//! piece is cut more finely inside, its outermost vertices move along the border to the nearest one of these. A straight
//! border gets no vertex in between, so that flat faces can join it as well.
//!
//! # References
//! Farin, "Curves and Surfaces for CAGD", 5th edition, 2002, chapters 5 and 14 (de Casteljau, tensor products).

use glam::{Vec2, Vec3, Vec4};

/// Greatest distance between a patch and its triangles, units of the game: 8 mm. Pieces that would take more than
/// [`MOST_CUTS`], or more than [`MOST_FOR_TWIST`] where straight borders bound what is twisted, are coarser.
pub(super) const TOLERANCE: f32 = 0.25;
/// Most cuts of a piece in either direction.
const MOST_CUTS: u32 = 64;
/// Most cuts in either direction for twist, which takes many and is seen little.
const MOST_FOR_TWIST: u32 = 8;

/// A control point, or a point of the surface: texture coordinates, normals and colours are interpolated alike.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Point {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    pub(super) uvs: [Vec2; 2],
    pub(super) color: Vec4,
}

impl Point {
    fn weighted(points: [&Self; 3], weights: [f32; 3]) -> Self {
        // The outer terms first: the same bits come out when the curve runs the other way.
        fn sum<T>(values: [T; 3], w: [f32; 3]) -> T
        where
            T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
        {
            (values[0] * w[0] + values[2] * w[2]) + values[1] * w[1]
        }
        Self {
            position: sum(points.map(|p| p.position), weights),
            normal: sum(points.map(|p| p.normal), weights),
            uvs: [0, 1].map(|set| sum(points.map(|p| p.uvs[set]), weights)),
            color: sum(points.map(|p| p.color), weights),
        }
    }
}

/// The three quadratic Bernstein polynomials at `step / cuts`.
fn bernstein(step: u32, cuts: u32) -> [f32; 3] {
    let (t, s) = (step as f32 / cuts as f32, (cuts - step) as f32 / cuts as f32);
    [s * s, 2.0 * (s * t), t * t]
}

/// One biquadratic piece: `points[row][column]`.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    points: [[Point; 3]; 3],
    /// Cuts along a row and along a column.
    cuts: [u32; 2],
    /// Cuts of the borders: first row, last row, first column, last column.
    borders: [u32; 4],
}

/// The power of two that is enough cuts for `needed` of them.
fn power_of_two(needed: f32) -> u32 {
    // NaN and infinite control points make no triangles that can be hit: any number will do.
    if needed.is_finite() {
        (needed.ceil().clamp(1.0, MOST_CUTS as f32) as u32).next_power_of_two()
    } else {
        1
    }
}

/// Cuts of a curve for half of the tolerance: its middle is a quarter of its second difference away from the chord. A
/// straight one has none, however its control points are spaced. The same bits come out when it runs the other way.
fn curve_cuts([a, b, c]: [Vec3; 3]) -> u32 {
    let (chord, offset) = (c - a, b - 0.5 * (a + c));
    let sideways = offset.cross(chord).length();
    let straight = sideways <= 0.01 * TOLERANCE * chord.length();
    if straight && offset.dot(chord).abs() <= 0.5 * chord.length_squared() {
        return 1;
    }
    power_of_two((0.5 * ((a + c) - 2.0 * b).length() / TOLERANCE).sqrt())
}

/// Whether all control points lie in a plane, and so the surface.
fn is_flat(p: &[[Vec3; 3]; 3]) -> bool {
    let offsets = || p.iter().flatten().map(|q| *q - p[0][0]);
    // The plane through the first point and the two that span the most with it.
    let normals = offsets().flat_map(|a| offsets().map(move |b| a.cross(b)));
    let normal =
        normals.fold(Vec3::ZERO, |best, n| if n.length_squared() > best.length_squared() { n } else { best });
    offsets().all(|offset| offset.dot(normal).abs() <= 0.05 * TOLERANCE * normal.length())
}

impl Piece {
    /// The piece with these control points.
    ///
    /// Half of the tolerance is for the borders, the rest for what bends inside. Triangles of cells 1/m × 1/n are no
    /// farther off than (S_uu/m² + 2 S_uv/mn + S_vv/n²) / 8, where S_uu ≤ 2 `rows` and S_uv ≤ 4 `twist`. Those at a border
    /// of b cuts span it more widely than their cells. The slopes at which the surface leaves it change along it, which
    /// adds no more than S_uv/8bn + 4/27 S_uuv/8b²n; S_uuv ≤ 4 times the change of the second difference.
    pub(super) fn new(points: [[Point; 3]; 3]) -> Self {
        let p = points.map(|row| row.map(|point| point.position));
        let column = |i: usize| [p[0][i], p[1][i], p[2][i]];
        let borders = [p[0], p[2], column(0), column(2)].map(curve_cuts);
        if is_flat(&p) {
            return Self::with_cuts(points, borders, [1, 1]);
        }
        let bend = |[a, b, c]: [Vec3; 3]| (a + c) - 2.0 * b;
        let largest = |values: [f32; 3]| values.into_iter().fold(0.0, f32::max);
        let rows = largest(p.map(|row| bend(row).length()));
        let columns = largest([0, 1, 2].map(|i| bend(column(i)).length()));
        let twist = (0..4)
            .map(|i| (i / 2, i % 2))
            .map(|(y, x)| ((p[y][x] + p[y + 1][x + 1]) - (p[y][x + 1] + p[y + 1][x])).length())
            .fold(0.0, f32::max);
        let terms = [rows, columns, twist, twist].iter().filter(|term| **term > 0.01 * TOLERANCE).count();
        let share = 0.5 * TOLERANCE / terms.max(1) as f32;
        let spread = |border: [Vec3; 3], inner: [Vec3; 3], cuts: u32| {
            let cuts = cuts as f32;
            let change = (bend(inner) - bend(border)).length();
            ((4.0 / 27.0 * change / cuts + twist) / (2.0 * cuts * share)).min(MOST_FOR_TWIST as f32)
        };
        let [top, bottom] = [spread(p[0], p[1], borders[0]), spread(p[2], p[1], borders[1])];
        let [left, right] =
            [spread(column(0), column(1), borders[2]), spread(column(2), column(1), borders[3])];
        let mut m = power_of_two((0.25 * rows / share).sqrt().max(left).max(right));
        let mut n = power_of_two((0.25 * columns / share).sqrt().max(top).max(bottom));
        while twist.is_finite() && twist / (m * n) as f32 > share && m.min(n) < MOST_FOR_TWIST {
            if m <= n { m *= 2 } else { n *= 2 }
        }
        Self::with_cuts(points, borders, [m, n])
    }

    /// Cut at least so often, and as often as the borders are.
    fn with_cuts(points: [[Point; 3]; 3], borders: [u32; 4], [m, n]: [u32; 2]) -> Self {
        let cuts = [m.max(borders[0]).max(borders[1]), n.max(borders[2]).max(borders[3])];
        Self { points, cuts, borders }
    }

    /// Vertices of the piece.
    pub(super) fn vertices(&self) -> usize {
        (self.cuts[0] as usize + 1) * (self.cuts[1] as usize + 1)
    }

    /// Triangles before those without area are left out.
    pub(super) fn triangles(&self) -> usize {
        2 * self.cuts[0] as usize * self.cuts[1] as usize
    }

    /// The surface at `column / cuts`, `row / cuts`.
    fn at(&self, [column, row]: [u32; 2]) -> Point {
        let (u, v) = (bernstein(column, self.cuts[0]), bernstein(row, self.cuts[1]));
        // Along a border only its own control points count, in its own order of sums.
        let [a, b, c] = &self.points;
        let along = |r: &[Point; 3]| Point::weighted([&r[0], &r[1], &r[2]], u);
        match row {
            0 => along(a),
            row if row == self.cuts[1] => along(c),
            _ => {
                let rows = [along(a), along(b), along(c)];
                Point::weighted([&rows[0], &rows[1], &rows[2]], v)
            }
        }
    }

    /// Where a vertex of the grid lies: those on a border that is cut less finely move to its nearest vertex.
    fn settled(&self, [column, row]: [u32; 2]) -> [u32; 2] {
        let [m, n] = self.cuts;
        let snap = |step: u32, cuts: u32, border: u32| {
            let stride = cuts / border;
            // Symmetric about the middle, and the ends stay.
            let down = step / stride * stride;
            if 2 * (step - down) > stride || (2 * (step - down) == stride && 2 * step > cuts) {
                down + stride
            } else {
                down
            }
        };
        let column = match row {
            0 => snap(column, m, self.borders[0]),
            row if row == n => snap(column, m, self.borders[1]),
            _ => column,
        };
        let row = match column {
            0 => snap(row, n, self.borders[2]),
            column if column == m => snap(row, n, self.borders[3]),
            _ => row,
        };
        [column, row]
    }

    /// Adds vertices and triangles. They run clockwise in front, as those of the game do.
    pub(super) fn triangulate(&self, points: &mut Vec<Point>, triangles: &mut Vec<[u32; 3]>) {
        let [m, n] = self.cuts;
        let first = points.len() as u32;
        for row in 0..=n {
            points.extend((0..=m).map(|column| self.at([column, row])));
        }
        let index = |column: u32, row: u32| {
            let [column, row] = self.settled([column, row]);
            first + row * (m + 1) + column
        };
        for row in 0..n {
            for column in 0..m {
                let [a, b] = [index(column, row), index(column + 1, row)];
                let [c, d] = [index(column, row + 1), index(column + 1, row + 1)];
                let cell = [[a, c, b], [b, c, d]];
                triangles.extend(cell.into_iter().filter(|[a, b, c]| a != b && b != c && c != a));
            }
        }
    }
}

/// The pieces of a patch of `columns × rows` control points, both odd and at least 3, in rows.
pub(super) fn pieces(control: &[Point], [columns, rows]: [usize; 2]) -> impl Iterator<Item = Piece> {
    let corners = (0..rows / 2).flat_map(move |y| (0..columns / 2).map(move |x| (2 * x, 2 * y)));
    corners.map(move |(x, y)| {
        Piece::new([0, 1, 2].map(|row| [0, 1, 2].map(|column| control[(y + row) * columns + x + column])))
    })
}

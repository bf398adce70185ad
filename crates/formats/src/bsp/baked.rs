//! The light that the map's compiler computed, as colours of vertices.
//!
//! Light maps are a second texture by which the first is multiplied, which our materials do not have. So faces are cut
//! until their edges are no longer than a texel of the map. An edge is cut by its own length alone, in its middle, so both
//! sides of it make the same vertices and no cracks open.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};

use super::lumps::LIGHTMAP_SIDE;
use super::patch::Point;
use crate::image::pixels::srgb_to_linear;

/// Longest edge, units: what a texel of a light map spans unless the map's author wanted otherwise.
pub(super) const EDGE: f32 = 16.0;
/// What the game multiplies light maps by before it shows them, on the screen.
const OVERBRIGHT: f32 = 2.0;
/// Edges longer than this lie outside of any map: they are left as they are.
const OUTSIDE: f32 = 32_768.0;
/// Halvings that make the longest edge short.
const MOST_CUTS: u32 = 12;

/// The light at a texel or a vertex as the game shows it, linear: brightened, and scaled back to 1 with its hue.
fn shown([r, g, b]: [u8; 3]) -> Vec3 {
    let bright = OVERBRIGHT * Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0;
    (bright / bright.max_element().max(1.0)).map(srgb_to_linear)
}

/// The light at a point of a light map, between texels.
pub(super) fn lookup(page: &[u8], at: Vec2) -> Vec3 {
    let side = LIGHTMAP_SIDE as f32;
    let at = (at * side - 0.5).clamp(Vec2::ZERO, Vec2::splat(side - 1.0));
    let at = if at.is_finite() { at } else { Vec2::ZERO };
    let (low, f) = (at.floor(), at - at.floor());
    let texel = |dx: usize, dy: usize| {
        let (x, y) = (low.x as usize + dx, low.y as usize + dy);
        let first = 3 * (y.min(LIGHTMAP_SIDE - 1) * LIGHTMAP_SIDE + x.min(LIGHTMAP_SIDE - 1));
        page.get(first..first + 3).map_or(Vec3::ZERO, |p| shown([p[0], p[1], p[2]]))
    };
    texel(0, 0).lerp(texel(1, 0), f.x).lerp(texel(0, 1).lerp(texel(1, 1), f.x), f.y)
}

/// The light in a vertex of the map.
pub(super) fn vertex_light([r, g, b, _]: [u8; 4]) -> Vec4 {
    shown([r, g, b]).extend(1.0)
}

/// Whether an edge is too long; the answer is the same from both ends.
fn is_long(a: &Point, b: &Point, edge: f32) -> bool {
    let squared = (a.position - b.position).length_squared();
    squared > edge * edge && squared <= OUTSIDE * OUTSIDE
}

fn middle(a: &Point, b: &Point) -> Point {
    Point {
        position: 0.5 * (a.position + b.position),
        normal: 0.5 * (a.normal + b.normal),
        uvs: [0, 1].map(|set| 0.5 * (a.uvs[set] + b.uvs[set])),
        color: 0.5 * (a.color + b.color),
    }
}

/// Cuts triangles until no edge is longer than `edge`, units. `room` is asked before vertices and triangles are added, and may refuse.
///
/// # Errors
/// Those of `room`.
pub(super) fn subdivide<E>(
    points: &mut Vec<Point>,
    triangles: &mut Vec<[u32; 3]>,
    edge: f32,
    mut room: impl FnMut(usize, usize) -> Result<(), E>,
) -> Result<(), E> {
    for _ in 0..MOST_CUTS {
        let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
        let long = |points: &[Point], a: u32, b: u32| is_long(&points[a as usize], &points[b as usize], edge);
        let mut added = 0;
        for &[a, b, c] in triangles.iter() {
            for (a, b) in [(a, b), (b, c), (c, a)] {
                added += usize::from(long(points, a, b));
            }
        }
        if added == 0 {
            break;
        }
        room(added, added)?;
        let mut cut = Vec::with_capacity(triangles.len() + added);
        for &[a, b, c] in triangles.iter() {
            let mut half = |a: u32, b: u32| {
                long(points, a, b).then(|| {
                    *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                        points.push(middle(&points[a as usize], &points[b as usize]));
                        points.len() as u32 - 1
                    })
                })
            };
            cut_triangle([a, b, c], [half(a, b), half(b, c), half(c, a)], &mut cut);
        }
        *triangles = cut;
    }
    Ok(())
}

/// A triangle with the middles of those of its edges that are cut.
fn cut_triangle([a, b, c]: [u32; 3], middles: [Option<u32>; 3], cut: &mut Vec<[u32; 3]>) {
    match middles {
        [None, None, None] => cut.push([a, b, c]),
        [Some(m), None, None] => cut.extend([[a, m, c], [m, b, c]]),
        [Some(m), Some(n), None] => cut.extend([[m, b, n], [a, m, n], [a, n, c]]),
        [Some(m), Some(n), Some(o)] => cut.extend([[a, m, o], [m, b, n], [o, n, c], [m, n, o]]),
        // Turned until the first edge is cut and, of two, the one after it.
        [m, n, o] => cut_triangle([b, c, a], [n, o, m], cut),
    }
}

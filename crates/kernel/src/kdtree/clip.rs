//! The part of a triangle that lies in a cell: its box decides which planes the sweep tries ("perfect splits").
use glam::Vec3;

use super::Corners;
use crate::aabb::Aabb;

/// A triangle cut by six planes has at most nine corners.
const MAX_CORNERS: usize = 9;

type Polygon = ([[f64; 3]; MAX_CORNERS], usize);

/// The box around the part of a triangle inside `cell`, rounded outward but not past the cell; `None` if there is no
/// such part. A part thinner than the rounding of double precision may be missed: traversal widens planes by far more.
///
/// # References
/// Sutherland and Hodgman 1974, "Reentrant polygon clipping"; Wald and Havran 2006, section 4.1.
pub(super) fn clipped_bounds(corners: &Corners, cell: &Aabb) -> Option<Aabb> {
    let mut polygon: Polygon = ([[0.0; 3]; MAX_CORNERS], 3);
    for (to, from) in polygon.0.iter_mut().zip(corners) {
        *to = from.map(f64::from);
    }
    for axis in 0..3 {
        let (lo, hi) = (f64::from(cell.min[axis]), f64::from(cell.max[axis]));
        let (least, most) = extent(&polygon, axis);
        if least > hi || most < lo {
            return None;
        }
        if least < lo {
            polygon = cut(&polygon, axis, lo, 1.0);
        }
        if most > hi {
            polygon = cut(&polygon, axis, hi, -1.0);
        }
        if polygon.1 == 0 {
            return None;
        }
    }
    let mut bounds = Aabb::EMPTY;
    for axis in 0..3 {
        let (least, most) = extent(&polygon, axis);
        bounds.min[axis] = round_down(least);
        bounds.max[axis] = -round_down(-most);
    }
    let clamp = |p: Vec3| p.clamp(cell.min, cell.max);
    Some(Aabb::new(clamp(bounds.min), clamp(bounds.max)))
}

fn extent((corners, count): &Polygon, axis: usize) -> (f64, f64) {
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for corner in &corners[..*count] {
        least = least.min(corner[axis]);
        most = most.max(corner[axis]);
    }
    (least, most)
}

/// Keeps what lies on the side of the plane that `side` (±1) points to, the plane itself included.
fn cut((corners, count): &Polygon, axis: usize, plane: f64, side: f64) -> Polygon {
    let mut kept: Polygon = ([[0.0; 3]; MAX_CORNERS], 0);
    let mut keep = |corner: [f64; 3]| {
        // Rounding can make a polygon slightly concave; a corner too many is then within rounding of another one.
        if kept.1 < MAX_CORNERS {
            kept.0[kept.1] = corner;
            kept.1 += 1;
        }
    };
    let Some(mut from) = corners[..*count].last() else { return kept };
    for to in &corners[..*count] {
        let (a, b) = ((from[axis] - plane) * side, (to[axis] - plane) * side);
        if (a < 0.0) != (b < 0.0) {
            let s = a / (a - b);
            let mut crossing = [0.0; 3];
            for k in 0..3 {
                crossing[k] = from[k] + (to[k] - from[k]) * s;
            }
            crossing[axis] = plane;
            keep(crossing);
        }
        if b >= 0.0 {
            keep(*to);
        }
        from = to;
    }
    kept
}

/// The largest single-precision number that is not above `x`.
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_of_parts_are_tight() {
        let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 1.0]];
        let inside = Aabb::new(Vec3::splat(-9.0), Vec3::splat(9.0));
        let whole = Aabb::new(Vec3::new(0.0, 0.0, 1.0), Vec3::new(4.0, 4.0, 1.0));
        assert_eq!(clipped_bounds(&corners, &inside), Some(whole));
        // Above y = 3 the triangle is one unit wide.
        let top = Aabb::new(Vec3::new(-1.0, 3.0, 0.0), Vec3::new(9.0, 9.0, 2.0));
        let part = Aabb::new(Vec3::new(0.0, 3.0, 1.0), Vec3::new(1.0, 4.0, 1.0));
        assert_eq!(clipped_bounds(&corners, &top), Some(part));
        // The boxes overlap, the triangle itself stays outside.
        let corner = Aabb::new(Vec3::splat(3.0), Vec3::splat(4.0));
        assert_eq!(clipped_bounds(&corners, &corner), None);
        let off = Aabb::new(Vec3::new(2.5, 2.5, 0.0), Vec3::new(4.0, 4.0, 2.0));
        assert_eq!(clipped_bounds(&corners, &off), None);
        // All six planes cut.
        let tilted = [[-10.0, -9.0, -12.0], [14.0, -3.0, 2.0], [-3.0, 13.0, 11.0]];
        let unit = Aabb::new(Vec3::splat(-1.0), Vec3::ONE);
        let part = clipped_bounds(&tilted, &unit).expect("passes through");
        assert!(unit.contains(part.min) && unit.contains(part.max) && !part.is_empty());
    }

    #[test]
    fn touching_counts_and_rounding_is_outward() {
        let third = 1.0 / 3.0_f32;
        let corners = [[0.0, 0.0, 0.0], [1.0, third, 0.0], [1.0, 0.7, 0.1]];
        let touching = Aabb::new(Vec3::new(1.0, 0.0, -1.0), Vec3::splat(2.0));
        let part = clipped_bounds(&corners, &touching).expect("an edge lies on the plane");
        assert_eq!((part.min.x, part.max.x), (1.0, 1.0));
        let cell = Aabb::new(Vec3::ZERO, Vec3::new(0.7, 1.0, 1.0));
        let part = clipped_bounds(&corners, &cell).expect("inside");
        let exact = 0.7_f32 as f64 * 0.7_f32 as f64;
        assert!(f64::from(part.max.y) >= exact && f64::from(part.max.y.next_down()) < exact);
        assert_eq!(part.max.x, 0.7);
    }
}

//! Cuts planar polygons into triangles: fans where that is right, ear clipping where it is not.
//!
//! # References
//! Meisters, "Polygons Have Ears", 1975. Normals by Newell's method (Sutherland, Sproull, Schumacker, 1974).

use glam::{Vec2, Vec3};

/// Polygons with more corners than this are cut as fans even if they are concave: clipping takes quadratic time.
pub(crate) const MAX_CLIPPED_CORNERS: usize = 1024;

/// Cuts polygons; keeps its buffers from one polygon to the next.
#[derive(Default)]
pub(crate) struct Triangulator {
    flat: Vec<Vec2>,
    left: Vec<u32>,
}

impl Triangulator {
    /// Calls `emit` with corner numbers for each of the `corners.len() − 2` triangles, which turn as the polygon does.
    pub(crate) fn triangulate(&mut self, corners: &[Vec3], mut emit: impl FnMut([u32; 3])) {
        let count = corners.len();
        if count < 3 {
            return;
        }
        if count == 3 {
            return emit([0, 1, 2]);
        }
        self.project(corners);
        if count > MAX_CLIPPED_CORNERS || self.is_fan(0) {
            (1..count as u32 - 1).for_each(|i| emit([0, i, i + 1]));
        } else if count == 4 && self.is_fan(1) {
            emit([1, 2, 3]);
            emit([1, 3, 0]);
        } else {
            self.clip_ears(emit);
        }
    }

    /// Drops the coordinate along which the polygon is thinnest, such that it turns counter-clockwise in the plane.
    fn project(&mut self, corners: &[Vec3]) {
        // Relative to a corner, so that small polygons far from the origin keep their precision.
        let origin = corners[0];
        let next = corners.iter().cycle().skip(1);
        let normal: Vec3 = corners.iter().zip(next).map(|(&a, &b)| (a - origin).cross(b - origin)).sum();
        let size = normal.abs();
        let flip = |positive: bool, p: Vec2| if positive { p } else { Vec2::new(p.y, p.x) };
        self.flat.clear();
        self.flat.extend(corners.iter().map(|&p| {
            let p = p - origin;
            if size.x >= size.y && size.x >= size.z {
                flip(normal.x >= 0.0, Vec2::new(p.y, p.z))
            } else if size.y >= size.z {
                flip(normal.y >= 0.0, Vec2::new(p.z, p.x))
            } else {
                flip(normal.z >= 0.0, Vec2::new(p.x, p.y))
            }
        }));
    }

    /// Whether all triangles of the fan around corner `apex` turn counter-clockwise.
    fn is_fan(&self, apex: usize) -> bool {
        let count = self.flat.len();
        let at = |i: usize| self.flat[(apex + i) % count];
        (1..count - 1).all(|i| turn(at(0), at(i), at(i + 1)) >= 0.0)
    }

    /// Cuts off convex corners whose triangle holds no other corner. A polygon without one (it crosses itself)
    /// loses its next corner all the same, so the number of triangles is always the same.
    fn clip_ears(&mut self, mut emit: impl FnMut([u32; 3])) {
        self.left.clear();
        self.left.extend(0..self.flat.len() as u32);
        let mut at = 0;
        let mut refused = 0;
        // Ordinary polygons need about two looks at every other corner per cut. Those made to need many more are
        // not worth the time: their last corners are cut off unseen.
        let mut looks = 8 * self.flat.len() * self.flat.len();
        while self.left.len() > 3 {
            let count = self.left.len();
            let corner = [at, (at + 1) % count, (at + 2) % count].map(|i| self.left[i]);
            if refused < count && looks >= count {
                looks -= count;
                if !self.is_ear(corner) {
                    at = (at + 1) % count;
                    refused += 1;
                    continue;
                }
            }
            emit(corner);
            let removed = (at + 1) % count;
            self.left.remove(removed);
            // Go on beside the cut: clipping one corner after another of the same ear makes slivers.
            let kept = if removed < at { at - 1 } else { at };
            at = (kept + 1) % (count - 1);
            refused = 0;
        }
        emit([self.left[0], self.left[1], self.left[2]]);
    }

    fn is_ear(&self, corner: [u32; 3]) -> bool {
        let [a, b, c] = corner.map(|i| self.flat[i as usize]);
        if turn(a, b, c) <= 0.0 {
            return false;
        }
        !self.left.iter().any(|&i| {
            let p = self.flat[i as usize];
            // A corner in the same place as one of the ear's does not block it: keyhole polygons have such pairs.
            !corner.contains(&i)
                && p != a
                && p != b
                && p != c
                && turn(a, b, p) >= 0.0
                && turn(b, c, p) >= 0.0
                && turn(c, a, p) >= 0.0
        })
    }
}

/// Twice the area of the triangle, positive if it turns counter-clockwise.
fn turn(a: Vec2, b: Vec2, c: Vec2) -> f32 {
    (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(corners: &[Vec3]) -> Vec<[u32; 3]> {
        let mut out = Vec::new();
        Triangulator::default().triangulate(corners, |t| out.push(t));
        out
    }

    /// Sum of the triangles' vector areas and of their unsigned areas: equal lengths mean that nothing overlaps.
    fn areas(corners: &[Vec3], triangles: &[[u32; 3]]) -> (Vec3, f32) {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| corners[i as usize]);
            0.5 * (b - a).cross(c - a)
        };
        (triangles.iter().map(area).sum(), triangles.iter().map(|t| area(t).length()).sum())
    }

    #[test]
    fn convex_polygons_become_fans() {
        let square = [Vec3::ZERO, Vec3::X, Vec3::X + Vec3::Y, Vec3::Y];
        assert_eq!(triangles(&square), [[0, 1, 2], [0, 2, 3]]);
        assert!(triangles(&square[..2]).is_empty());
    }

    #[test]
    fn a_concave_quad_is_cut_at_its_reflex_corner() {
        let dart = [(0., 0.), (2., 1.), (0., 2.), (0.5, 1.)].map(|(x, y)| Vec3::new(x, y, 0.0));
        let cut = triangles(&dart);
        let (sum, absolute) = areas(&dart, &cut);
        assert_eq!(cut.len(), 2);
        assert!((sum.z - absolute).abs() < 1e-6, "{cut:?}");
    }

    #[test]
    fn concave_polygons_in_any_plane_keep_their_area_and_direction() {
        // A comb, whose teeth no fan can cut.
        let comb = [
            (0., 0.),
            (7., 0.),
            (7., 3.),
            (6., 3.),
            (6., 1.),
            (5., 1.),
            (5., 3.),
            (4., 3.),
            (4., 1.),
            (3., 1.),
            (3., 3.),
            (2., 3.),
            (2., 1.),
            (1., 1.),
            (1., 3.),
            (0., 3.),
        ];
        for axes in [[Vec3::X, Vec3::Y], [Vec3::Y, Vec3::X], [Vec3::Z, Vec3::Y], [Vec3::X, Vec3::Z]] {
            let polygon = comb.map(|(x, y)| Vec3::splat(100.0) + axes[0] * x + axes[1] * y);
            let cut = triangles(&polygon);
            let (sum, absolute) = areas(&polygon, &cut);
            assert_eq!(cut.len(), 14);
            assert!((absolute - 15.0).abs() < 1e-3, "{absolute}");
            assert!((sum - axes[0].cross(axes[1]) * 15.0).length() < 1e-3, "{sum}");
        }
    }

    #[test]
    fn star_shaped_polygons_of_any_size_are_cut_without_overlap() {
        for count in 4..60 {
            let polygon: Vec<Vec3> = (0..count)
                .map(|i| {
                    let (sin, cos) = (i as f32 / count as f32 * std::f32::consts::TAU).sin_cos();
                    // Radii that jump up and down without a pattern.
                    let radius = 1.0 + ((i * 7919 + count * 104_729) % 17) as f32;
                    Vec3::new(cos * radius, sin * radius, 0.0)
                })
                .collect();
            let cut = triangles(&polygon);
            let (sum, absolute) = areas(&polygon, &cut);
            assert_eq!(cut.len(), count - 2);
            assert!((sum.z - absolute).abs() < 1e-3 * absolute, "{count} corners: {sum} {absolute}");
        }
    }

    #[test]
    fn degenerate_polygons_still_give_all_triangles() {
        let crossed = [(0., 0.), (2., 2.), (2., 0.), (0., 2.), (1., 5.)].map(|(x, y)| Vec3::new(x, y, 0.0));
        assert_eq!(triangles(&crossed).len(), 3);
        assert_eq!(triangles(&[Vec3::NAN; 6]).len(), 4);
        assert_eq!(triangles(&[Vec3::ONE; 5]).len(), 3);
        // No corner of this tangle is ever an ear; it must end soon all the same.
        let tangle: Vec<Vec3> = (0..MAX_CLIPPED_CORNERS)
            .map(|i| Vec3::new((i * 7919 % 1009) as f32, (i * 104_729 % 1013) as f32, 0.0))
            .collect();
        assert_eq!(triangles(&tangle).len(), MAX_CLIPPED_CORNERS - 2);
    }
}

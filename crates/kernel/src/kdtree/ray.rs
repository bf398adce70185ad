//! A ray set up for the kd-tree: planes, the bounds, and triangles one at a time.
use glam::Vec3A;

use super::{Corners, KdTree};

/// Directions this much smaller than the largest component count as this large: 1/d stays finite, and over the
/// length of any scene the ray moves by less than planes are widened.
pub(super) const SMALLEST_COMPONENT: f32 = 1.0e-15;
/// Half the thickness that planes are given, in units of the largest distance from the ray's origin to a vertex along
/// any axis. Rounding moves a vertex, as the triangle test sees it, by a few units in the last place of that distance
/// times the steepness of the shear (up to 4), and distances to planes by less; so a ray that passes the test of a
/// triangle also enters a leaf that lists it, and closed meshes stay closed.
pub(super) const PLANE_SLACK: f32 = 16.0 * f32::EPSILON;

/// One ray in the tree's space.
#[derive(Clone, Copy, Debug)]
pub(super) struct KdRay {
    pub origin: [f32; 3],
    /// 1 / direction, finite.
    pub inverse: [f32; 3],
    /// Half the thickness of planes in the ray's parameter.
    pub pad: [f32; 3],
    /// Bit k: the direction is negative along axis k, where the nearer child is then the upper one.
    pub negative: u32,
    /// Axis order of the shear: the last is the direction's largest component.
    axes: [usize; 3],
    /// Shear along the first two axes, and scale of the last.
    shear: [f32; 3],
    t_min: f32,
}

impl KdRay {
    #[inline(always)]
    pub(super) fn new(tree: &KdTree, origin: Vec3A, direction: Vec3A, t_min: f32) -> Self {
        let size = direction.abs();
        let largest = size.max_element();
        let z = if size.x == largest {
            0
        } else if size.y == largest {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let smallest = Vec3A::splat(largest * SMALLEST_COMPONENT);
        let inverse = size.max(smallest).copysign(direction).recip();
        let (lo, hi) = (Vec3A::from(tree.bounds.min) - origin, Vec3A::from(tree.bounds.max) - origin);
        let reach = lo.abs().max(hi.abs()).max_element();
        let negative = inverse.cmplt(Vec3A::ZERO).bitmask();
        let direction = direction.to_array();
        Self {
            origin: origin.to_array(),
            inverse: inverse.to_array(),
            pad: (inverse.abs() * (reach * PLANE_SLACK)).to_array(),
            negative,
            axes: [x, y, z],
            shear: [-direction[x] / direction[z], -direction[y] / direction[z], 1.0 / direction[z]],
            t_min,
        }
    }

    /// Where the ray is inside the tree's bounds, widened, up to `t_max`: empty if the first is larger.
    #[inline(always)]
    pub(super) fn span(&self, tree: &KdTree, t_max: f32) -> (f32, f32) {
        let (mut enter, mut leave) = (self.t_min, t_max);
        for axis in 0..3 {
            let a = (tree.bounds.min[axis] - self.origin[axis]) * self.inverse[axis];
            let b = (tree.bounds.max[axis] - self.origin[axis]) * self.inverse[axis];
            enter = enter.max(a.min(b) - self.pad[axis]);
            leave = leave.min(a.max(b) + self.pad[axis]);
        }
        (enter, leave)
    }

    /// Distance to a triangle if it is hit with `t_min < t <= limit`, which is finite: the test of `traverse/shear.rs`
    /// for one triangle.
    /// Vertices are sheared into a frame in which the ray is the z axis; a shared vertex lands on the same point for
    /// all its triangles, the signs of the edge functions are never wrong, and zero counts as inside [Woop, Benthin
    /// and Wald 2013].
    #[inline(always)]
    pub(super) fn test(&self, corners: &Corners, limit: f32) -> Option<f32> {
        let [ax, ay, az] = self.sheared(&corners[0]);
        let [bx, by, bz] = self.sheared(&corners[1]);
        let [cx, cy, cz] = self.sheared(&corners[2]);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        if u.min(v).min(w) < 0.0 && u.max(v).max(w) > 0.0 {
            return None;
        }
        // A zero determinant gives a NaN or an infinite t, which fail both comparisons together.
        let t = (u * az + v * bz + w * cz) * self.shear[2] / (u + v + w);
        (t > self.t_min && t <= limit).then_some(t)
    }

    #[inline(always)]
    fn sheared(&self, corner: &[f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.axes;
        let depth = corner[z % 3] - self.origin[z % 3];
        [
            corner[x % 3] - self.origin[x % 3] + self.shear[0] * depth,
            corner[y % 3] - self.origin[y % 3] + self.shear[1] * depth,
            depth,
        ]
    }
}

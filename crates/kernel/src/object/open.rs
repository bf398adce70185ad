//! Instances opened in the tree over them, where their boxes fit so badly that entering whole objects is costly.
//!
//! A leaf then stands for one subtree of an instance's triangle tree: below the root's children boxes fit better.
//!
//! # References
//! Benthin, Woop, Wald and Áfra 2017, "Improved two-level BVHs using partial re-braiding". Deviation: one level, and by a
//! choice that looks at nothing but the instance's object and how it is turned and scaled. So scenes that end up the same
//! are opened in the same places, whatever was moved on the way there.
use fearless_simd::Fallback;
use glam::{Mat3A, Vec3, Vec3A};

use super::{PlacedInstance, place::packed, tree::ENTRY_COST};
use crate::{
    aabb::Aabb,
    build::boxes::PackedBox,
    layout::{Child, Node},
    triangle_bvh::TriangleBvh,
    triangles::Triangles,
};

/// Opening must promise to bring the cost below this share: what it costs to enter an object several times is known
/// only roughly. (Measured: rings in a heap, at about 0.7, gain 26 to 54 %; flat pieces, at about 0.8, lose a little.)
const WORTH: f32 = 0.75;
/// Most instances that are opened, to eight leaves each: where some that are turned come to need more leaves, a new tree
/// over all of them must not take longer than a frame has for it.
const MAX_OPENED: usize = 1 << 10;
/// How far rounding may be stretched on the way into an instance and back, as a factor, for it to be opened.
const MAX_STRETCH: f32 = 8.0;
/// What boxes over opened instances are wider by, in units of the rounding errors of their tests, which are 3 ε of the
/// largest coordinate. A ray that passes between two parts of a mesh must not be lost, as nothing else catches it; but
/// where it passes is decided in the object's space, where its origin, direction and shear are off by 4, 4 and 3 ε for
/// either end of its way.
pub(super) const EXCESS: f32 = MAX_STRETCH * 5.0;

/// What a leaf of an opened tree stands for: a subtree of an instance's triangle tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Entry {
    pub instance: u32,
    pub child: Child,
}

/// A subtree at which an instance may be entered, with its box in the parent's space.
pub(super) type Place = (Child, PackedBox);

/// Whether instances may be opened where there are so many.
pub(super) fn may_open(instances: usize) -> bool {
    instances <= MAX_OPENED
}

/// Whether opening an instance pays.
pub(super) fn is_opened(placed: &PlacedInstance) -> bool {
    opened(placed).is_some()
}

/// Where an instance is entered: at the children of its triangle tree's root, if it is opened, else at the root, whose box
/// is `whole`.
pub(super) fn places(placed: &PlacedInstance, whole: PackedBox, mut take: impl FnMut(Place)) {
    let Some(bvh) = opened(placed) else {
        return take((Child::ROOT, whole));
    };
    let map = &placed.instance.parent_from_object;
    // What rounding owes to a translation that cancels the object's own coordinates.
    let pad = Vec3::splat(2.0 * MAX_STRETCH * 4.0 * f32::EPSILON * map.translation.abs().max_element());
    of_root(bvh, |child, bounds| {
        let bounds = bounds.transformed(map);
        take((child, packed(Aabb::new(bounds.min - pad, bounds.max + pad))));
    });
}

/// The tree that an instance is opened to: it has nothing else in it, does not move while the shutter is open, and opening
/// it pays.
fn opened(placed: &PlacedInstance) -> Option<&TriangleBvh> {
    let object = &placed.instance.object;
    let Some(Triangles::Bvh(bvh)) = &object.triangles else { return None };
    let alone = object.quadrics.is_none() && object.instances.is_empty();
    let still = placed.instance.motion.is_none() && !object.has_motion();
    (alone && still && bvh.tree.len() > 1 && pays(placed, bvh)).then_some(bvh)
}

/// Whether rays that come from anywhere save enough by meeting the boxes of the parts rather than that of the whole.
fn pays(placed: &PlacedInstance, bvh: &TriangleBvh) -> bool {
    let turn = absolute(&placed.instance.parent_from_object.matrix3);
    let back = absolute(&placed.object_from_parent.matrix3);
    let stretch = (turn * (back * Vec3A::ONE)).max_element();
    // Areas before and after turning, of all and of the parts together.
    let (mut all, mut before, mut after) = (Aabb::EMPTY, 0.0, 0.0);
    of_root(bvh, |_, bounds| {
        all = all.union(bounds);
        before += half_area(bounds.size().into());
        after += half_area(turn * Vec3A::from(bounds.size()));
    });
    // What is below the root costs the same wherever a ray enters it.
    let below = (bvh.tree.sah - 1.0).max(0.0) * half_area(all.size().into()) / before.max(f32::MIN_POSITIVE);
    let whole = half_area(turn * Vec3A::from(all.size())) * (ENTRY_COST + bvh.tree.sah);
    stretch <= MAX_STRETCH && after * (ENTRY_COST + below) < WORTH * whole
}

fn absolute(matrix: &Mat3A) -> Mat3A {
    Mat3A::from_cols(matrix.x_axis.abs(), matrix.y_axis.abs(), matrix.z_axis.abs())
}

fn half_area(size: Vec3A) -> f32 {
    size.x * size.y + (size.y * size.z + size.z * size.x)
}

/// The children of the tree's root.
fn of_root(bvh: &TriangleBvh, mut take: impl FnMut(Child, Aabb)) {
    let mut place = None;
    let root: &Node = bvh.tree.view().get(Fallback::new(), 0, &mut place);
    let [a, b, c, d, e, f] = root.bounds;
    for (lane, &child) in root.child.iter().enumerate().take_while(|(_, child)| **child != Child::NONE) {
        take(child, Aabb::new(Vec3::new(a[lane], b[lane], c[lane]), Vec3::new(d[lane], e[lane], f[lane])));
    }
}

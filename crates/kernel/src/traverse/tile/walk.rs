//! The walk of a tile through an 8-wide tree: 8 children against the tile, then each against its 16 groups.
//!
//! This is hierarchical rasterisation from the rays' origin [Davidovič et al. 2012, "3D rasterization: a bridge
//! between rasterization and ray casting"].
use fearless_simd::{f32x8, f32x16, prelude::*};

use super::{
    leaf::rays_in_box,
    work::{Face, GROUP, Work},
};
use crate::traverse::ahead::Leaves;
use crate::{
    build::wide::WideTree,
    layout::{Child, Node},
    prefetch::prefetch,
};

/// Widening of boxes in units of the largest coordinate, as for single rays.
const BOX_SLACK: f32 = 3.0 * f32::EPSILON;

/// So few groups are narrowed down to rays at inner nodes too: scattered ones meet boxes that none of their rays does.
const FEW_GROUPS: u32 = 5;

/// A subtree to visit, and the groups that meet its box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Visit {
    pub child: Child,
    pub mask: u16,
    pub range: BoxRange,
}

impl Visit {
    /// The whole tree.
    pub(super) const ROOT: Self = {
        // Finite, because a leaf is tested, and 0 · ∞ is NaN.
        let all = [-f32::MAX, f32::MAX];
        let range = BoxRange { near: 0.0, far: f32::MAX, u: all, v: all };
        Self { child: Child::ROOT, mask: u16::MAX, range }
    };
}

/// The projection of an object's space: axis order, sign and origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub face: Face,
    /// Common origin in the face's axis order.
    pub origin: [f32; 3],
    /// How far boxes are widened, world units.
    pub slack: f32,
    /// Which of a node's child orders suits the tile.
    octant: usize,
}

/// A box relative to the origin, in (u, v, k) order: all lanes of a node.
#[derive(Clone, Copy)]
struct Boxes<S: Simd> {
    near: f32x8<S>,
    far: f32x8<S>,
    u: [f32x8<S>; 2],
    v: [f32x8<S>; 2],
}

/// One such box.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoxRange {
    pub near: f32,
    pub far: f32,
    pub u: [f32; 2],
    pub v: [f32; 2],
}

impl Frame {
    #[inline(always)]
    pub(super) fn new(origin: [f32; 3], tree: &WideTree, work: &Work) -> Self {
        let face = work.face;
        let [u, v, k] = face.axes;
        let reach = tree.reach(origin.iter().fold(0.0, |m, o| o.abs().max(m)));
        let negative = |x: f32| usize::from(x < 0.0);
        let octant = negative(work.rect[0] + work.rect[1]) << u
            | negative(work.rect[2] + work.rect[3]) << v
            | negative(face.sign) << k;
        let origin = [origin[u % 3], origin[v % 3], origin[k % 3]];
        Self { face, origin, slack: reach * BOX_SLACK, octant: octant & 7 }
    }

    /// The boxes of all children. Subtraction is monotonic under rounding, so each still holds its vertices.
    #[inline(always)]
    fn boxes<S: Simd>(&self, simd: S, node: &Node) -> Boxes<S> {
        let [u, v, k] = self.face.axes;
        let (near, far) = if self.face.sign < 0.0 { (k + 3, k) } else { (k, k + 3) };
        let sign = self.face.sign;
        Boxes {
            near: (row(simd, node, near, self.origin[2]) * sign).max(f32x8::splat(simd, 0.0)),
            far: row(simd, node, far, self.origin[2]) * sign,
            u: [row(simd, node, u, self.origin[0]), row(simd, node, u + 3, self.origin[0])],
            v: [row(simd, node, v, self.origin[1]), row(simd, node, v + 3, self.origin[1])],
        }
    }

    /// The children that the tile's frustum meets.
    #[inline(always)]
    fn cull<S: Simd>(&self, simd: S, boxes: &Boxes<S>, rect: [f32; 4], far: f32) -> u32 {
        let [u0, u1, v0, v1] = rect;
        let slack = f32x8::splat(simd, self.slack);
        // The right edge of the frustum lies farthest right at the far depth if it leans right; and so on.
        let right = edge_depth(boxes, u1 > 0.0).mul_sub(f32x8::splat(simd, u1), boxes.u[0]);
        let left = edge_depth(boxes, u0 < 0.0).mul_sub(f32x8::splat(simd, u0), boxes.u[1]);
        let above = edge_depth(boxes, v1 > 0.0).mul_sub(f32x8::splat(simd, v1), boxes.v[0]);
        let below = edge_depth(boxes, v0 < 0.0).mul_sub(f32x8::splat(simd, v0), boxes.v[1]);
        let inside = right.min(above).simd_ge(-slack) & left.max(below).simd_le(slack);
        let reach = f32x8::splat(simd, far).min(boxes.far + slack);
        (inside & boxes.near.simd_le(reach)).to_bitmask() as u32
    }
}

#[inline(always)]
fn row<S: Simd>(simd: S, node: &Node, row: usize, origin: f32) -> f32x8<S> {
    f32x8::load_array_ref(simd, &node.bounds[row % 6]) - origin
}

#[inline(always)]
fn edge_depth<S: Simd>(boxes: &Boxes<S>, at_far: bool) -> f32x8<S> {
    if at_far { boxes.far } else { boxes.near }
}

/// The lanes whose (u, v) rectangle meets `range` between its depths: 16 groups, or 16 rays with equal corners.
#[inline(always)]
pub(super) fn meet<S: Simd>(
    simd: S,
    range: &BoxRange,
    slack: f32,
    u: [&[f32; GROUP]; 2],
    v: [&[f32; GROUP]; 2],
) -> fearless_simd::mask32x16<S> {
    let near = f32x16::splat(simd, range.near);
    let far = f32x16::splat(simd, range.far);
    let (u0, u1) = (f32x16::load_array_ref(simd, u[0]), f32x16::load_array_ref(simd, u[1]));
    let (v0, v1) = (f32x16::load_array_ref(simd, v[0]), f32x16::load_array_ref(simd, v[1]));
    let right = (u1 * near).max(u1 * far).simd_ge(f32x16::splat(simd, range.u[0] - slack));
    let left = (u0 * near).min(u0 * far).simd_le(f32x16::splat(simd, range.u[1] + slack));
    let above = (v1 * near).max(v1 * far).simd_ge(f32x16::splat(simd, range.v[0] - slack));
    let below = (v0 * near).min(v0 * far).simd_le(f32x16::splat(simd, range.v[1] + slack));
    (right & left) & (above & below)
}

/// Goes on to the next leaf that some group still wants, or `None` at the end. The caller has pushed the root.
#[inline(always)]
pub(super) fn next_leaf<S: Simd>(
    simd: S,
    tree: &WideTree,
    leaves: &(impl Leaves + ?Sized),
    frame: &Frame,
    work: &Work,
    stack: &mut Vec<Visit>,
    mark: usize,
) -> Option<Visit> {
    while stack.len() > mark {
        let mut visit = stack.pop()?;
        visit.mask &= work.reaching(simd, visit.range.near);
        if visit.mask == 0 {
            continue;
        }
        if visit.child.is_leaf() {
            return Some(visit);
        }
        open(simd, tree, leaves, frame, work, &visit, stack);
    }
    None
}

/// Pushes the children of an inner node that some group meets, far ones first.
#[inline(always)]
fn open<S: Simd>(
    simd: S,
    tree: &WideTree,
    leaves: &(impl Leaves + ?Sized),
    frame: &Frame,
    work: &Work,
    visit: &Visit,
    stack: &mut Vec<Visit>,
) {
    let mut place = None;
    let node = tree.view().get(simd, visit.child.0 as usize, &mut place);
    let boxes = frame.boxes(simd, node);
    let bits = frame.cull(simd, &boxes, work.rect_of(visit.mask), work.far);
    if bits == 0 {
        return;
    }
    let (near, far): ([f32; 8], [f32; 8]) = (boxes.near.into(), boxes.far.into());
    let [ul, uh]: [[f32; 8]; 2] = [boxes.u[0].into(), boxes.u[1].into()];
    let [vl, vh]: [[f32; 8]; 2] = [boxes.v[0].into(), boxes.v[1].into()];
    let order = node.order[frame.octant];
    for rank in (0..8).rev() {
        let lane = (order >> (3 * rank) & 7) as usize;
        if bits >> lane & 1 == 0 {
            continue;
        }
        let range =
            BoxRange { near: near[lane], far: far[lane], u: [ul[lane], uh[lane]], v: [vl[lane], vh[lane]] };
        let met = meet(simd, &range, frame.slack, [&work.u0, &work.u1], [&work.v0, &work.v1]);
        let mut mask = met.to_bitmask() as u16 & work.reaching(simd, range.near) & visit.mask;
        let child = node.child[lane];
        // A leaf does so by itself.
        if mask.count_ones() <= FEW_GROUPS && !child.is_leaf() {
            (mask, _) = rays_in_box(simd, work, mask, &range, frame.slack);
        }
        if mask != 0 {
            if child.is_leaf() {
                leaves.prefetch(child);
            } else {
                prefetch(&tree.nodes, child.0 as usize);
            }
            stack.push(Visit { child, mask, range });
        }
    }
}

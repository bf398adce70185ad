//! The two accelerators that an object's own triangles may lie in.
use std::sync::Arc;

use crate::{
    aabb::Aabb,
    kdtree::{Corners, KdTree},
    triangle_bvh::TriangleBvh,
};

/// A shared tree over the triangles of an object. A world may mix both kinds; hits differ by rounding at most.
#[derive(Clone, Debug)]
pub enum Triangles {
    /// A bounding volume hierarchy: the fast way.
    Bvh(Arc<TriangleBvh>),
    /// A kd-tree: the way of the 2003 report.
    KdTree(Arc<KdTree>),
}

impl Triangles {
    /// The box around all triangles that can be hit, object space.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Bvh(tree) => tree.bounds(),
            Self::KdTree(tree) => tree.bounds(),
        }
    }

    /// Whether vertices move while the shutter is open.
    #[must_use]
    pub fn has_motion(&self) -> bool {
        match self {
            Self::Bvh(tree) => tree.has_motion(),
            Self::KdTree(_) => false,
        }
    }

    /// Splits a running triangle number into (mesh, triangle of that mesh).
    pub(crate) fn locate(&self, number: u32) -> (u32, u32) {
        match self {
            Self::Bvh(tree) => tree.locate(number),
            Self::KdTree(tree) => tree.locate(number),
        }
    }

    /// Calls `visit` for every triangle that can be hit, with its corners at a time and its running number.
    pub(crate) fn for_each(&self, time: f32, visit: impl FnMut((Corners, u32))) {
        match self {
            Self::Bvh(tree) => tree.triangles(time).into_iter().for_each(visit),
            Self::KdTree(tree) => tree.triangles().for_each(visit),
        }
    }
}

impl From<Arc<TriangleBvh>> for Triangles {
    fn from(tree: Arc<TriangleBvh>) -> Self {
        Self::Bvh(tree)
    }
}

impl From<TriangleBvh> for Triangles {
    fn from(tree: TriangleBvh) -> Self {
        Self::Bvh(Arc::new(tree))
    }
}

impl From<Arc<KdTree>> for Triangles {
    fn from(tree: Arc<KdTree>) -> Self {
        Self::KdTree(tree)
    }
}

impl From<KdTree> for Triangles {
    fn from(tree: KdTree) -> Self {
        Self::KdTree(Arc::new(tree))
    }
}

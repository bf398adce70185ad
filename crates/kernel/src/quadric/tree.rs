//! A tree over the quadrics of an object.
use std::fmt;

use crate::{
    aabb::Aabb,
    build::{
        self, BuildOptions,
        binary::LeafRule,
        binned,
        boxes::PackedBox,
        watch::Watch,
        wide::{self, WideTree},
    },
    error::BuildError,
    layout::Child,
    quadric::Quadric,
    triangle_bvh::TriangleBvh,
};

/// An 8-wide bounding volume hierarchy over spheres and cones, one per leaf. Immutable; shared by `Arc`.
pub struct Quadrics {
    pub(crate) shapes: Vec<Quadric>,
    /// What hits call each shape: (geometry, primitive).
    pub(crate) names: Vec<(u32, u32)>,
    pub(crate) tree: WideTree,
    bounds: Aabb,
}

impl fmt::Debug for Quadrics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Quadrics")
            .field("shapes", &self.shapes.len())
            .field("bounds", &self.bounds)
            .finish_non_exhaustive()
    }
}

impl Quadrics {
    /// Builds a tree over lists of shapes; hits name them as (`geometry`, `primitive`) = (the number given with the
    /// list, index into it). An object that has meshes, too, leaves these numbers free by empty meshes.
    ///
    /// # Errors
    /// [`BuildError::TooManyQuadrics`] past [`TriangleBvh::MAX_TRIANGLES`].
    pub fn build<'a>(lists: impl IntoIterator<Item = (u32, &'a [Quadric])>) -> Result<Self, BuildError> {
        let (mut shapes, mut names) = (Vec::new(), Vec::new());
        for (geometry, list) in lists {
            let (count, limit) = ((shapes.len() + list.len()) as u64, TriangleBvh::MAX_TRIANGLES);
            if count > limit {
                return Err(BuildError::TooManyQuadrics { count, limit });
            }
            shapes.extend_from_slice(list);
            names.extend((0..list.len() as u32).map(|primitive| (geometry, primitive)));
        }
        let (mut prims, mut bounds) = (Vec::with_capacity(shapes.len()), Aabb::EMPTY);
        for (index, shape) in (0..).zip(&shapes) {
            let around = shape.bounds();
            if !around.is_empty() {
                prims.push(PackedBox::primitive(around.min, around.max, index));
                bounds = bounds.union(around);
            }
        }
        let tree = tree(&mut prims);
        Ok(Self { shapes, names, tree, bounds })
    }

    /// The box around everything that can be hit, object space.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Number of shapes, those that are never hit included.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shapes.len()
    }

    /// Whether there are no shapes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }
}

fn tree(prims: &mut [PackedBox]) -> WideTree {
    if prims.is_empty() {
        return WideTree::default();
    }
    // A quadratic in double precision costs a few box tests.
    let options = BuildOptions { intersection_cost: 2.0, ..BuildOptions::default() };
    let (level, watch) = (build::level(), Watch::new(&()));
    let rule = LeafRule { max: 1, block_shift: 0 };
    let nodes = binned::build(level, prims, rule, &options, &watch);
    let (mut tree, places) = wide::collapse(level, &nodes, rule, options.intersection_cost, &watch);
    // A block is one shape here, and the leaf names it.
    let leaves = tree.nodes.iter_mut().flat_map(|node| &mut node.child);
    for leaf in leaves.filter(|child| child.is_leaf() && **child != Child::NONE) {
        let (place, _) = places[leaf.block_range().0];
        *leaf = Child::leaf(prims[place as usize].id());
    }
    tree
}

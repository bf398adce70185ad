//! Repair: a new tree over the blocks of an old one, when the old one no longer suits where they are.
//!
//! Deformation moves neighbours together, so the triangles of a block stay neighbours long after the boxes above have
//! grown into each other. Sorting blocks instead of triangles takes an eighth of the work of a build, and vertices are
//! not read again.
use fearless_simd::Level;
use rayon::prelude::*;

use super::{
    BuildOptions,
    binary::LeafRule,
    binned,
    boxes::PackedBox,
    refit::{self, BlockLeaves},
    watch::Watch,
    wide::{self, WideTree},
};
use crate::layout::Child;

/// A tree over all blocks, by their boxes, with a leaf for each. Blocks with nothing to hit at present keep a place, as
/// their triangles may come back. `None` if there is nothing to hit at all.
pub(crate) fn over_blocks(level: Level, blocks: &[PackedBox], block_cost: f32) -> Option<WideTree> {
    let whole = blocks.par_iter().copied().reduce(|| PackedBox::EMPTY, |a, b| a.union(&b));
    if whole.is_empty() {
        return None;
    }
    let middle = (whole.lo() + whole.hi()) * 0.5;
    let nowhere = PackedBox::new(middle, middle, [0; 2]);
    let numbered = |(index, bounds): (usize, &PackedBox)| {
        let bounds = if bounds.is_empty() { &nowhere } else { bounds };
        bounds.with_tags([index as u32; 2])
    };
    let mut prims: Vec<PackedBox> = blocks.par_iter().enumerate().with_min_len(1024).map(numbered).collect();
    let options = BuildOptions { intersection_cost: block_cost, ..BuildOptions::default() };
    let (rule, watch) = (LeafRule { max: 1, block_shift: 0 }, Watch::new(&()));
    let binary = binned::build(level, &mut prims, rule, &options, &watch);
    let (mut tree, ranges) = wide::collapse(level, &binary, rule, block_cost, &watch);
    tree.nodes.par_iter_mut().with_min_len(256).for_each(|node| {
        for child in node.child.iter_mut().filter(|child| child.is_leaf() && **child != Child::NONE) {
            let (place, _) = ranges[child.block_range().0];
            *child = Child::blocks(prims[place as usize].id(), 1);
        }
    });
    // What has no box was given one.
    if blocks.iter().any(PackedBox::is_empty) {
        refit::nodes(level, &mut tree, &BlockLeaves { blocks, block_cost });
    }
    Some(tree)
}

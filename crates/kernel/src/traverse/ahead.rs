//! What leaves of trees stand for, fetched ahead: a visit on the stack tells what will be read soon.
use crate::{
    compact::Blocks,
    layout::{Block, Child},
    object::Object,
    prefetch::prefetch,
};

/// What the leaves of a tree stand for: asked for when a visit is put on the stack.
pub(super) trait Leaves {
    fn prefetch(&self, leaf: Child);
}

impl Leaves for [Block] {
    #[inline(always)]
    fn prefetch(&self, leaf: Child) {
        let (first, end) = leaf.block_range();
        prefetch(self, first);
        if end > first + 1 {
            prefetch(self, first + 1);
        }
    }
}

/// For packets, which are slower to come to the second block of a leaf than tiles are.
impl Leaves for Blocks<'_> {
    #[inline(always)]
    fn prefetch(&self, leaf: Child) {
        Blocks::prefetch(*self, leaf.block_range().0);
    }
}

/// The instances of an object.
impl Leaves for Object {
    #[inline(always)]
    fn prefetch(&self, leaf: Child) {
        let index = leaf.payload() as usize;
        let entry = self.instance_tree.entries.get(index);
        prefetch(&self.instances, entry.map_or(index, |entry| entry.instance as usize));
    }
}

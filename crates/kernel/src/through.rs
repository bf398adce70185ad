//! Any-hit queries past what lets light through: such triangles are noted and do not stop a ray.
use crate::{
    layout::{Block, Child},
    ray::PathId,
    triangle_bvh::TriangleBvh,
};

/// Which geometries let some light pass straight through: panes of thin glass, leaves cut out by a texture. Asked by
/// [`RayQuery::occluded_through`](crate::RayQuery::occluded_through).
///
/// It is told anew with every query and kept nowhere, so that another material leaves accelerators as they are.
pub trait SeeThrough: Sync {
    /// Those of the object at `path`: bit `g % 64` of word `g / 64` for geometry `g`. Geometries past the end stop light;
    /// where all do, the end is best at once.
    fn geometries(&self, path: PathId) -> &[u64];
}

/// An any-hit query and where its answers go.
pub(crate) struct Shadows<'a> {
    pub through: Option<&'a dyn SeeThrough>,
    pub occluded: &'a mut [bool],
    /// Not occluded, but not clear either; empty if nobody asks.
    pub filtered: &'a mut [bool],
}

impl<'a> Shadows<'a> {
    /// Past `through`; what only one of the slices has room for is not asked.
    pub(crate) fn past(
        through: &'a dyn SeeThrough,
        occluded: &'a mut [bool],
        filtered: &'a mut [bool],
    ) -> Self {
        let len = occluded.len().min(filtered.len());
        Self { through: Some(through), occluded: &mut occluded[..len], filtered: &mut filtered[..len] }
    }

    /// The answer for one ray of several.
    pub(crate) fn one(&mut self, index: usize) -> Shadows<'_> {
        let filtered = self.filtered.get_mut(index).map_or_else(Default::default, std::slice::from_mut);
        Shadows { through: self.through, occluded: &mut self.occluded[index..=index], filtered }
    }

    /// Some rays hit nothing until told otherwise.
    #[inline(always)]
    pub(crate) fn clear(&mut self, first: usize, count: usize) {
        self.occluded[first..first + count].fill(false);
        if let Some(filtered) = self.filtered.get_mut(first..first + count) {
            filtered.fill(false);
        }
    }

    /// Answers for ray `index`, which met what lets light through, or did not.
    #[inline(always)]
    pub(crate) fn set(&mut self, index: usize, occluded: bool, met: bool) {
        self.occluded[index] = occluded;
        if let Some(filtered) = self.filtered.get_mut(index) {
            *filtered = met && !occluded;
        }
    }
}

/// The geometries of one object that let light through.
#[derive(Clone, Copy)]
pub(crate) struct Panes<'a>(&'a [u64]);

impl<'a> Panes<'a> {
    pub(crate) const NONE: Self = Self(&[]);

    #[inline(always)]
    pub(crate) fn of(through: Option<&'a dyn SeeThrough>, path: PathId) -> Self {
        through.map_or(Self::NONE, |through| Self(through.geometries(path)))
    }

    #[inline(always)]
    pub(crate) fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    #[inline(always)]
    pub(crate) fn has(self, geometry: u32) -> bool {
        self.0.get(geometry as usize / 64).is_some_and(|word| word >> (geometry % 64) & 1 != 0)
    }
}

/// The triangles of an object as an any-hit query sees them.
#[derive(Clone, Copy)]
pub(crate) struct Screen<'a> {
    pub bvh: &'a TriangleBvh,
    /// The subtree that is asked.
    pub start: Child,
    pub panes: Panes<'a>,
}

impl Screen<'_> {
    /// Of the triangles in `bits` of a block, those that let light through. `numbers` are the block's.
    #[inline(never)]
    pub(crate) fn passed(&self, numbers: &[u32; 8], bits: u32) -> u32 {
        let (mut passed, mut rest) = (0, bits);
        // Neighbours are mostly of one mesh.
        let (mut start, mut end, mut passes) = (0, 0, false);
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 7) as usize;
            rest &= rest - 1;
            let number = numbers[lane];
            if !(start..end).contains(&number) {
                let (geometry, primitive) = self.bvh.locate(number);
                start = number - primitive;
                end = start + self.bvh.mesh_len(geometry);
                passes = self.panes.has(geometry);
            }
            passed |= u32::from(passes) << lane;
        }
        passed
    }

    /// As [`Screen::passed`], for all triangles of a block.
    #[inline(always)]
    pub(crate) fn passed_of(&self, numbers: &[u32; 8]) -> u32 {
        let used = numbers.iter().take_while(|&&number| number != Block::NO_TRIANGLE).count();
        self.passed(numbers, (1 << used) - 1)
    }

    /// Whether one of the triangles that a ray meets, in `bits` of a block, stops it; notes that others did not.
    #[inline(always)]
    pub(crate) fn stops(&self, numbers: &[u32; 8], bits: u32, met: &mut bool) -> bool {
        if bits == 0 {
            return false;
        }
        let passed = self.passed(numbers, bits);
        *met |= passed != 0;
        bits != passed
    }
}

/// One ray's any-hit query.
pub(crate) struct Sight<'a> {
    pub through: Option<&'a dyn SeeThrough>,
    /// Whether it met what lets light through.
    pub met: bool,
}

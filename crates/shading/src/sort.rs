//! Hits sorted by material, so that shaders run on full packets.
//!
//! # References
//! Áfra, Benthin, Wald, Munkberg, "Local Shading Coherence Extraction for SIMD-Efficient Path Tracing on CPUs", 2016.

use heliostat_kernel::Hit;

use crate::lanes::WIDTH;
use crate::scene::ShadingScene;

/// Sorts the hits of one wave of rays by material; keeps its memory from wave to wave.
#[derive(Debug, Default)]
pub struct HitSorter {
    /// Place in `runs` by material; [`NONE`] between waves.
    slots: Vec<u32>,
    /// Material, then end in `order`.
    runs: Vec<(u32, u32)>,
    /// Hits in a row on one part: material, first hit, number of hits.
    rows: Vec<(u32, u32, u32)>,
    order: Vec<u32>,
}

const NONE: u32 = u32::MAX;

/// Up to [`WIDTH`] hits of one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HitPacket<'a> {
    /// Index into the material table.
    pub material: u32,
    /// Which hits.
    pub hits: &'a [u32],
}

impl HitSorter {
    /// Sorts all that are hits, by material and then in their order. The order of two hits never depends on a third.
    pub fn sort(&mut self, scene: &ShadingScene, hits: &[Hit]) {
        self.slots.resize(scene.materials().len(), NONE);
        self.runs.clear();
        self.rows.clear();
        // Neighbours mostly hit the same part.
        let mut first = 0;
        for row in hits.chunk_by(Hit::is_on_part_of) {
            if row[0].is_hit() {
                let material = scene.material_of(&row[0]);
                let slot = &mut self.slots[material as usize];
                if *slot == NONE {
                    *slot = self.runs.len() as u32;
                    self.runs.push((material, 0));
                }
                self.runs[*slot as usize].1 += row.len() as u32;
                self.rows.push((material, first, row.len() as u32));
            }
            first += row.len() as u32;
        }
        self.place();
    }

    /// Puts the rows in the order of their materials.
    fn place(&mut self) {
        self.runs.sort_unstable_by_key(|&(material, _)| material);
        let mut start = 0;
        for (place, (material, count)) in self.runs.iter_mut().enumerate() {
            self.slots[*material as usize] = place as u32;
            (start, *count) = (start + *count, start);
        }
        self.order.clear();
        self.order.resize(start as usize, 0);
        for &(material, first, count) in &self.rows {
            let end = &mut self.runs[self.slots[material as usize] as usize].1;
            let order = &mut self.order[*end as usize..(*end + count) as usize];
            order.iter_mut().zip(first..).for_each(|(order, hit)| *order = hit);
            *end += count;
        }
        for (material, _) in &self.runs {
            self.slots[*material as usize] = NONE;
        }
    }

    /// The hits in packets.
    pub fn packets(&self) -> impl Iterator<Item = HitPacket<'_>> {
        let starts = std::iter::once(0).chain(self.runs.iter().map(|&(_, end)| end));
        starts.zip(&self.runs).flat_map(move |(start, &(material, end))| {
            let hits = &self.order[start as usize..end as usize];
            hits.chunks(WIDTH).map(move |hits| HitPacket { material, hits })
        })
    }
}

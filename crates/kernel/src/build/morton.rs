//! Boxes in the order of a Morton curve: codes of their centres, sorted digit by digit.
//!
//! Deterministic for any number of threads and any instruction set: keys are all different, so that there is one order.
use fearless_simd::{Level, Simd, dispatch, f32x4, i32x4, prelude::*, u32x4, u32x8};
use rayon::prelude::*;

use super::{
    binned,
    boxes::{PackedBox, doubled_center},
    parts::{self, Slots},
    watch::Watch,
};

/// Bits of a cell's number along each axis, and of a digit of its code. With 28 bits of a primitive's place they fill a
/// key.
const AXIS_BITS: u32 = 12;
const PLACE_BITS: u32 = 28;
const DIGITS: usize = 1 << AXIS_BITS;
/// A cell with more primitives than this is sorted by finer cells of its own …
const CROWD: usize = 64;
/// … down to this depth.
const MAX_DEPTH: u32 = 6;
/// Primitives per task.
const TASK: usize = 1 << 11;
/// Fewer keys than this are not worth tables of digits …
const FEW: usize = 1 << 11;
/// … and no more than this per thread not worth several threads.
const FEW_FOR_THREADS: usize = 1 << 16;

/// A primitive's code above its place in the list.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key(u64);

impl Key {
    #[inline(always)]
    pub(crate) fn place(self) -> usize {
        (self.0 & ((1 << PLACE_BITS) - 1)) as usize
    }

    #[inline(always)]
    fn cell(self) -> u64 {
        self.0 >> PLACE_BITS
    }

    /// A digit of the code, the lowest first.
    #[inline(always)]
    fn digit(self, number: u32) -> usize {
        (self.0 >> (PLACE_BITS + number * AXIS_BITS)) as usize % DIGITS
    }
}

/// The places of `prims` (not empty, up to 2²⁸) along the curve. If `watch` says that the work was cancelled, the result
/// is unfinished.
pub(crate) fn sorted(level: Level, prims: &[PackedBox], watch: &Watch<'_>) -> Vec<Key> {
    order(level, prims, 0, watch)
}

fn order(level: Level, prims: &[PackedBox], depth: u32, watch: &Watch<'_>) -> Vec<Key> {
    let (_, centers) = binned::bounds(level, prims, watch);
    let grid = Grid::new(&centers);
    let keys = parts::collect(prims.len(), TASK, |first, part| {
        let prims = &prims[first..first + part.len()];
        dispatch!(level, simd => grid.push_keys(simd, prims, first, part));
    });
    if watch.stopped() {
        return keys;
    }
    let mut keys = sort(keys);
    if depth < MAX_DEPTH {
        refine(level, prims, &mut keys, depth, watch);
    }
    keys
}

/// Sorts the keys of crowded cells by finer cells.
fn refine(level: Level, prims: &[PackedBox], keys: &mut [Key], depth: u32, watch: &Watch<'_>) {
    // A crowd has two keys so far apart, one of them at a multiple of that.
    let stride = CROWD / 2;
    let mut at = 0;
    while at + stride < keys.len() {
        let cell = keys[at].cell();
        if keys[at + stride].cell() != cell {
            at += stride;
            continue;
        }
        let begin = at - keys[..at].iter().rev().take_while(|key| key.cell() == cell).count();
        let end = at + keys[at..].iter().take_while(|key| key.cell() == cell).count();
        at = end.next_multiple_of(stride);
        // All in one cell after a whole round of refinement: the centres are equal.
        if end - begin > CROWD && end - begin < keys.len() {
            let crowd = &mut keys[begin..end];
            let boxes: Vec<PackedBox> = crowd.iter().map(|key| prims[key.place()]).collect();
            let finer = order(level, &boxes, depth + 1, watch);
            let sorted: Vec<Key> = finer.iter().map(|key| crowd[key.place()]).collect();
            crowd.copy_from_slice(&sorted);
        }
    }
}

/// In parallel where it pays: each thread takes a range of the highest digit.
fn sort(keys: Vec<Key>) -> Vec<Key> {
    let threads = rayon::current_num_threads();
    if threads == 1 || keys.len() < threads * FEW_FOR_THREADS {
        return radix_sort(keys);
    }
    let mut counts = vec![0_usize; DIGITS];
    for key in &keys {
        counts[key.digit(2)] += 1;
    }
    let share = keys.len().div_ceil(threads);
    let mut ranges = Vec::new();
    let (mut begin, mut held) = (0, 0);
    for (digit, &count) in counts.iter().enumerate() {
        held += count;
        if held >= share || digit == DIGITS - 1 {
            ranges.push((begin..digit + 1, held));
            (begin, held) = (digit + 1, 0);
        }
    }
    let part = |(range, count): &(std::ops::Range<usize>, usize)| {
        // One place more, to which what is not wanted is written.
        let mut mine = vec![Key(0); count + 1];
        let mut next = 0;
        for &key in &keys {
            mine[next] = key;
            next += usize::from(range.contains(&key.digit(2)));
        }
        mine.truncate(*count);
        radix_sort(mine)
    };
    let parts: Vec<Vec<Key>> = ranges.par_iter().map(part).collect();
    parts.concat()
}

/// Sorts by the three digits of the code, the lowest first; places are in order already, and stay so among equals.
fn radix_sort(mut keys: Vec<Key>) -> Vec<Key> {
    if keys.len() < FEW {
        keys.sort_unstable();
        return keys;
    }
    let mut starts = Box::new([[0_u32; DIGITS]; 3]);
    let [low, middle, high] = &mut *starts;
    for key in &keys {
        low[key.digit(0)] += 1;
        middle[key.digit(1)] += 1;
        high[key.digit(2)] += 1;
    }
    let mut other = vec![Key(0); keys.len()];
    for (number, starts) in (0..).zip(&mut *starts) {
        let mut next = 0;
        for start in starts.iter_mut() {
            (*start, next) = (next, next + *start);
        }
        for &key in &keys {
            let start = &mut starts[key.digit(number)];
            other[*start as usize] = key;
            *start += 1;
        }
        std::mem::swap(&mut keys, &mut other);
    }
    keys
}

/// A cube of cells around all centres.
struct Grid {
    offset: [f32; 4],
    scale: f32,
}

impl Grid {
    /// Around doubled centres.
    fn new(centers: &PackedBox) -> Self {
        let low = centers.lo();
        let scale = (1 << AXIS_BITS) as f32 * 0.999_99 / (centers.hi() - low).max_element();
        Self { offset: [low.x, low.y, low.z, 0.0], scale: if scale < f32::MAX { scale } else { 0.0 } }
    }

    /// The keys of primitives, the first of which has place `first`.
    #[inline(always)]
    fn push_keys<S: Simd>(&self, simd: S, prims: &[PackedBox], first: usize, keys: &mut Slots<'_, Key>) {
        let offset = f32x4::load_array(simd, self.offset);
        let axis = u32x8::load_array(simd, [0, 1, 2, 0, 0, 1, 2, 0]);
        for (place, prim) in (first..).zip(prims) {
            let cell = (doubled_center(prim.load(simd)) - offset) * self.scale;
            let cell: i32x4<S> = i32x4::truncate_from(cell);
            let [high, low]: [u32x4<S>; 2] = [(cell >> 6).bitcast(), (cell & 63).bitcast()];
            let bits = spread(simd, high.combine(low)) << axis;
            let [hx, hy, hz, _, lx, ly, lz, _] = bits.to_array();
            let (high, low) = (u64::from(hx | hy | hz), u64::from(lx | ly | lz));
            keys.push(Key((high << 18 | low) << PLACE_BITS | place as u64));
        }
    }
}

/// Moves bit k (of 6) to bit 3k.
#[inline(always)]
fn spread<S: Simd>(simd: S, x: u32x8<S>) -> u32x8<S> {
    let mask = |bits| u32x8::splat(simd, bits);
    let x = (x | x << 8) & mask(0x300f);
    let x = (x | x << 4) & mask(0x30c3);
    (x | x << 2) & mask(0x9249)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_sort_like_whole_keys() {
        let mut state = 1_u64;
        let mut keys = Vec::new();
        for place in 0..3 * FEW as u64 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Some codes many times over.
            let code = if place % 3 == 0 { state >> 62 } else { state >> 28 };
            keys.push(Key(code << PLACE_BITS | place));
        }
        let mut expected = keys.clone();
        expected.sort_unstable();
        assert!(radix_sort(keys) == expected);
    }

    #[test]
    fn codes_interleave_the_bits_of_cells() {
        let level = crate::build::level();
        let prims: Vec<PackedBox> = (0..4096_u32)
            .map(|i| {
                let [x, y, z] = [i, i * 1031 % 4096, i * 517 % 4096].map(|cell| cell as f32);
                PackedBox::primitive(glam::Vec3::new(x, y, z), glam::Vec3::new(x, y, z), i)
            })
            .collect();
        // Doubled centres up to 8190: a cell is just over two of them.
        let grid = Grid::new(&PackedBox::new(glam::Vec3::ZERO, glam::Vec3::splat(8190.0), [0; 2]));
        let keys = parts::collect(prims.len(), prims.len(), |first, part| {
            dispatch!(level, simd => grid.push_keys(simd, &prims, first, part));
        });
        for (place, key) in keys.iter().enumerate() {
            let cell = |axis| {
                let center = 2.0 * prims[place].0[axis];
                (center * grid.scale) as u64
            };
            let mut code = 0;
            for bit in 0..AXIS_BITS {
                for axis in 0..3 {
                    code |= (cell(axis) >> bit & 1) << (3 * bit + axis as u32);
                }
            }
            assert_eq!((key.place(), key.cell()), (place, code));
        }
    }
}

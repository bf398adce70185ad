//! Lists that threads fill in parts, each element written once and in place: memory of trees is large enough for its first
//! touch to count.
#![allow(
    unsafe_code,
    reason = "a vector of elements that are not there yet has no safe way to be filled by threads"
)]

use std::mem::MaybeUninit;

use rayon::prelude::*;

/// A part of a list, to be filled from its beginning.
pub(super) struct Slots<'a, T> {
    slots: &'a mut [MaybeUninit<T>],
    filled: usize,
}

impl<T: Copy> Slots<'_, T> {
    /// How many elements there are to be.
    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    /// The next element, in its place.
    ///
    /// # Panics
    /// When the part is full.
    #[inline(always)]
    pub(super) fn push(&mut self, element: T) -> &mut T {
        let slot = self.slots[self.filled].write(element);
        self.filled += 1;
        slot
    }
}

/// A list of `count` elements: `fill` is given the number of the first element of a part of up to `part` elements, and
/// the part.
///
/// # Panics
/// When a part is not filled.
pub(super) fn collect<T: Copy + Send>(
    count: usize,
    part: usize,
    fill: impl Fn(usize, &mut Slots<'_, T>) + Sync,
) -> Vec<T> {
    let mut list = Vec::with_capacity(count);
    list.spare_capacity_mut()[..count].par_chunks_mut(part).enumerate().for_each(|(number, slots)| {
        let mut slots = Slots { slots, filled: 0 };
        fill(number * part, &mut slots);
        assert_eq!(slots.filled, slots.slots.len(), "a part of a list was not filled");
    });
    // SAFETY: the first `count` elements are there: each lies in one of the parts, which were all found full.
    unsafe {
        list.set_len(count);
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_make_a_list_in_order() {
        let squares = collect(1000, 64, |first, part| {
            for i in first..first + part.len() {
                part.push(i * i);
            }
        });
        assert!(squares.into_iter().eq((0..1000).map(|i| i * i)));
        assert!(collect(0, 64, |_, _: &mut Slots<'_, u8>| ()).is_empty());
    }

    #[test]
    #[should_panic(expected = "not filled")]
    fn parts_must_be_filled() {
        collect(100, 64, |_, part| {
            part.push(1_u8);
        });
    }
}

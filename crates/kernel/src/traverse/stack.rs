//! The traversal stack: entries in one word each, shared by all levels of a query.
use crate::layout::Child;

/// (entry distance, child) packed so that integer order is distance order: distances are not negative, and the
/// bits of such floats sort like the floats.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Entry(u64);

impl Entry {
    #[inline(always)]
    pub(super) fn new(distance: f32, child: Child) -> Self {
        // The mask turns −0 into +0.
        Self(u64::from(distance.to_bits() & 0x7fff_ffff) << 32 | u64::from(child.0))
    }

    #[inline(always)]
    pub(super) fn child(self) -> Child {
        Child(self.0 as u32)
    }

    #[inline(always)]
    pub(super) fn distance(self) -> f32 {
        f32::from_bits((self.0 >> 32) as u32)
    }
}

/// Entries of all object levels in one growable array; a level pops only down to where it began.
#[derive(Debug)]
pub(super) struct Stack {
    entries: Vec<Entry>,
}

impl Stack {
    pub(super) fn new() -> Self {
        // Trees are at most about 64 levels deep and leave at most 7 entries per level; this rarely grows.
        Self { entries: Vec::with_capacity(256) }
    }

    #[inline(always)]
    pub(super) fn mark(&self) -> usize {
        self.entries.len()
    }

    #[inline(always)]
    pub(super) fn cut(&mut self, mark: usize) {
        self.entries.truncate(mark);
    }

    /// The next entry above `mark` that begins no farther than `t_max`.
    #[inline(always)]
    pub(super) fn pop(&mut self, mark: usize, t_max: f32) -> Option<Child> {
        while self.entries.len() > mark {
            let entry = self.entries.pop()?;
            if entry.distance() <= t_max {
                return Some(entry.child());
            }
        }
        None
    }

    /// Pushes the children in `bits` (at least two) except the nearest, which is returned.
    #[inline(always)]
    pub(super) fn push_sorted(&mut self, distances: &[f32; 8], children: &[Child; 8], bits: u32) -> Child {
        let mut bits = bits;
        let mut a = next(distances, children, &mut bits);
        let mut b = next(distances, children, &mut bits);
        order(&mut a, &mut b);
        if bits == 0 {
            self.entries.push(b);
            return a.child();
        }
        let mut c = next(distances, children, &mut bits);
        order(&mut b, &mut c);
        order(&mut a, &mut b);
        if bits == 0 {
            self.entries.push(c);
            self.entries.push(b);
            return a.child();
        }
        let start = self.entries.len();
        self.entries.extend_from_slice(&[c, b, a]);
        while bits != 0 {
            self.insert(start, next(distances, children, &mut bits));
        }
        self.entries.pop().unwrap_or(a).child()
    }

    /// Inserts into the part from `start` on, which runs from far to near.
    #[inline(always)]
    fn insert(&mut self, start: usize, entry: Entry) {
        let mut at = self.entries.len();
        self.entries.push(entry);
        while at > start && self.entries[at - 1] < entry {
            self.entries[at] = self.entries[at - 1];
            at -= 1;
        }
        self.entries[at] = entry;
    }
}

#[inline(always)]
fn next(distances: &[f32; 8], children: &[Child; 8], bits: &mut u32) -> Entry {
    let lane = (bits.trailing_zeros() & 7) as usize;
    *bits &= bits.wrapping_sub(1);
    Entry::new(distances[lane], children[lane])
}

/// Compare and exchange, without a branch.
#[inline(always)]
fn order(a: &mut Entry, b: &mut Entry) {
    (*a, *b) = ((*a).min(*b), (*a).max(*b));
}

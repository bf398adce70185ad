//! Events of the plane sweep: where along an axis a triangle begins, ends, or lies flat; one word each.
use crate::aabb::Aabb;

/// Position, kind and triangle packed so that integer order is sweep order: by position, and at one position ends
/// before flat ones before starts [Wald and Havran 2006, section 4.2].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Event(u64);

/// What happens at an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Kind {
    End = 0,
    Planar = 1,
    Start = 2,
}

const TRIANGLE_BITS: u32 = 30;
const TRIANGLE_MASK: u64 = (1 << TRIANGLE_BITS) - 1;

impl Event {
    /// `triangle` is its number in the cell at hand, below 2³⁰.
    #[inline(always)]
    pub(super) fn new(position: f32, kind: Kind, triangle: u32) -> Self {
        // Adding zero turns −0 into +0. Then flip so that unsigned order is numeric order.
        let bits = (position + 0.0).to_bits();
        let ordered = if bits >> 31 == 0 { bits | 1 << 31 } else { !bits };
        Self(u64::from(ordered) << 32 | (kind as u64) << TRIANGLE_BITS | u64::from(triangle))
    }

    /// The position in a form that compares equal for equal positions.
    #[inline(always)]
    pub(super) fn key(self) -> u32 {
        (self.0 >> 32) as u32
    }

    #[inline(always)]
    pub(super) fn position(self) -> f32 {
        let ordered = self.key();
        f32::from_bits(if ordered >> 31 == 1 { ordered & !(1 << 31) } else { !ordered })
    }

    #[inline(always)]
    pub(super) fn kind(self) -> Kind {
        match self.0 >> TRIANGLE_BITS & 3 {
            0 => Kind::End,
            1 => Kind::Planar,
            _ => Kind::Start,
        }
    }

    #[inline(always)]
    pub(super) fn triangle(self) -> usize {
        (self.0 & TRIANGLE_MASK) as usize
    }

    /// The same event of a triangle that has another number now.
    #[inline(always)]
    pub(super) fn renumbered(self, triangle: u32) -> Self {
        Self(self.0 & !TRIANGLE_MASK | u64::from(triangle))
    }
}

/// The events of one triangle with the given box along `axis`: one if it is flat there, otherwise two.
#[inline(always)]
pub(super) fn events_of(bounds: &Aabb, axis: usize, triangle: u32) -> (Event, Option<Event>) {
    let (lo, hi) = (bounds.min[axis], bounds.max[axis]);
    if lo == hi {
        (Event::new(lo, Kind::Planar, triangle), None)
    } else {
        (Event::new(lo, Kind::Start, triangle), Some(Event::new(hi, Kind::End, triangle)))
    }
}

/// Merges `fresh` into the sorted `list`, and empties it.
pub(super) fn merge(list: &mut Vec<Event>, fresh: &mut Vec<Event>) {
    fresh.sort_unstable();
    let mut from = list.len();
    list.resize(from + fresh.len(), Event::default());
    let mut to = list.len();
    // From the back, so that nothing is overwritten before it has moved.
    while let Some(&last) = fresh.last() {
        to -= 1;
        if from > 0 && list[from - 1] > last {
            from -= 1;
            list[to] = list[from];
        } else {
            list[to] = last;
            fresh.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integer_order_is_sweep_order() {
        let mut events = Vec::new();
        for position in [f32::MIN, -1.0e-40, -0.0, 0.0, 1.0e-40, 2.0, f32::MAX] {
            for kind in [Kind::Start, Kind::End, Kind::Planar] {
                for triangle in [0, 7, TRIANGLE_MASK as u32] {
                    let event = Event::new(position, kind, triangle);
                    assert_eq!((event.position(), event.kind()), (position, kind));
                    assert_eq!(event.triangle(), triangle as usize);
                    assert_eq!(event.renumbered(3), Event::new(position, kind, 3));
                    events.push(event);
                }
            }
        }
        let mut by_parts = events.clone();
        by_parts.sort_by(|a, b| {
            let numeric = a.position().partial_cmp(&b.position()).expect("no NaN");
            numeric.then((a.kind() as u8).cmp(&(b.kind() as u8))).then(a.triangle().cmp(&b.triangle()))
        });
        events.sort_unstable();
        assert_eq!(events, by_parts);
    }

    #[test]
    fn merging_keeps_order() {
        let all: Vec<Event> = (0..50).map(|i| Event::new((i * 37 % 50) as f32, Kind::Start, i)).collect();
        for cut in [0, 1, 13, 50] {
            let (mut list, mut fresh) = (all[..cut].to_vec(), all[cut..].to_vec());
            list.sort_unstable();
            merge(&mut list, &mut fresh);
            assert!(list.is_sorted() && list.len() == all.len() && fresh.is_empty());
        }
    }
}

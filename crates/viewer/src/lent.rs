//! Buffers that come back: pictures are made in ever other sizes, and an allocator that gets each one's buffers back keeps
//! holes between them that only grow.

use std::sync::Arc;

/// Values kept in sight at most; what is lent beyond that does not come back.
const MOST: usize = 8;

/// Values that others look at, taken back when all have let go of them.
#[derive(Debug)]
pub(crate) struct Lent<T>(Vec<Arc<T>>);

impl<T> Default for Lent<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Lent<T> {
    /// Lends a value.
    pub(crate) fn lend(&mut self, value: T) -> Arc<T> {
        let value = Arc::new(value);
        if self.0.len() == MOST {
            self.0.remove(0);
        }
        self.0.push(value.clone());
        value
    }

    /// A value that nobody looks at any more, if there is one.
    pub(crate) fn returned(&mut self) -> Option<T> {
        let index = self.0.iter().position(|value| Arc::strong_count(value) == 1)?;
        Arc::into_inner(self.0.remove(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_looks_at_comes_back() {
        let mut lent = Lent::default();
        let (one, two) = (lent.lend(1), lent.lend(2));
        assert_eq!(lent.returned(), None);
        drop(two);
        assert_eq!((lent.returned(), lent.returned()), (Some(2), None));
        drop(one);
        assert_eq!(lent.returned(), Some(1));
        let many: Vec<_> = (0..MOST + 1).map(|i| lent.lend(i)).collect();
        drop(many);
        assert_eq!(std::iter::from_fn(|| lent.returned()).count(), MOST);
    }
}

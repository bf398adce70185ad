//! Who watches, and who of them holds the controls.

use std::collections::BTreeMap;

use serde::Serialize;

use super::access::same;

/// Those who watch.
#[derive(Debug)]
pub(super) struct Viewers {
    most: usize,
    next: u64,
    /// Grows with every change.
    pub(super) number: u64,
    list: BTreeMap<u64, Viewer>,
    holder: Option<u64>,
}

#[derive(Debug)]
struct Viewer {
    /// Known to this viewer alone.
    key: String,
    /// Whether it asks for the controls.
    asks: bool,
}

/// What a viewer is told about all of them.
#[derive(Debug, Serialize)]
pub(super) struct Company {
    you: u64,
    holder: Option<u64>,
    all: Vec<u64>,
    /// Those who ask for the controls.
    asking: Vec<u64>,
}

impl Viewers {
    pub(super) fn new(most: usize) -> Self {
        Self { most, next: 1, number: 0, list: BTreeMap::new(), holder: None }
    }

    pub(super) fn count(&self) -> usize {
        self.list.len()
    }

    /// A new viewer's number; the first one gets the controls. `None` when there are too many.
    pub(super) fn join(&mut self, key: String) -> Option<u64> {
        if self.list.len() >= self.most {
            return None;
        }
        let id = self.next;
        self.next += 1;
        self.number += 1;
        self.list.insert(id, Viewer { key, asks: false });
        self.holder.get_or_insert(id);
        Some(id)
    }

    /// The controls of one who leaves go to whoever asked first, else to whoever came first.
    pub(super) fn leave(&mut self, id: u64) {
        self.list.remove(&id);
        self.number += 1;
        if self.holder == Some(id) {
            let asking = self.list.iter().find(|(_, viewer)| viewer.asks);
            let heir = asking.or(self.list.iter().next()).map(|(&id, _)| id);
            self.hand(heir);
        }
    }

    fn hand(&mut self, to: Option<u64>) {
        self.holder = to;
        if let Some(viewer) = to.and_then(|id| self.list.get_mut(&id)) {
            viewer.asks = false;
        }
    }

    pub(super) fn is_holder(&self, id: u64) -> bool {
        self.holder == Some(id)
    }

    /// Whether the one with this key holds the controls.
    pub(super) fn holds(&self, key: &str) -> bool {
        self.holder.and_then(|id| self.list.get(&id)).is_some_and(|viewer| same(&viewer.key, key))
    }

    /// Asks for the controls; whoever holds them decides.
    pub(super) fn ask(&mut self, id: u64) {
        self.number += 1;
        if self.holder != Some(id)
            && let Some(viewer) = self.list.get_mut(&id)
        {
            viewer.asks = true;
        }
    }

    /// Hands the controls over; `false` if `from` has none to give or there is no `to`.
    pub(super) fn give(&mut self, from: u64, to: u64) -> bool {
        let allowed = self.holder == Some(from) && self.list.contains_key(&to);
        if allowed {
            self.number += 1;
            self.hand(Some(to));
        }
        allowed
    }

    pub(super) fn company(&self, you: u64) -> Company {
        let asking = self.list.iter().filter(|(_, viewer)| viewer.asks).map(|(&id, _)| id).collect();
        Company { you, holder: self.holder, all: self.list.keys().copied().collect(), asking }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_are_handed_over_and_inherited() {
        let mut viewers = Viewers::new(3);
        let [a, b, c] = ["a", "b", "c"].map(|key| viewers.join(key.into()).expect("room"));
        assert_eq!(viewers.join("d".into()), None);
        assert!(viewers.holds("a") && !viewers.holds("b") && !viewers.holds(""));
        assert!(!viewers.give(b, b), "not its own to give");
        viewers.ask(c);
        assert_eq!(viewers.company(a).asking, [c]);
        assert!(viewers.give(a, b) && viewers.is_holder(b) && !viewers.give(b, 99));
        viewers.leave(b);
        assert!(viewers.is_holder(c), "who asked comes before who came first");
        assert!(viewers.company(a).asking.is_empty());
        viewers.leave(c);
        viewers.leave(a);
        assert_eq!((viewers.count(), viewers.holds("a")), (0, false));
        let d = viewers.join("d".into()).expect("room");
        assert!(viewers.is_holder(d));
    }
}

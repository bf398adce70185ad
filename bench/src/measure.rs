//! Clocks, medians and the interleaved comparison.

use std::time::Instant;

use rayon::ThreadPool;
use rayon::prelude::*;

/// Rays per work item and slots per work item in [`Answers`].
pub(crate) const ITEM: usize = 256;
/// Work items that a thread takes at a time.
const GRAIN: usize = 16;
/// Passes are repeated until a run takes this long, seconds: the clocks are no finer than microseconds.
const LEAST_RUN: f64 = 0.03;

/// What a pass stores: [`ITEM`] slots for each work item, filled from the front.
pub(crate) struct Answers {
    /// Closest hit: ray parameter, +∞ for a miss.
    pub(crate) t: Vec<f32>,
    /// Closest hit: the triangle, `u32::MAX` for a miss.
    pub(crate) primitive: Vec<u32>,
    /// Any hit.
    pub(crate) occluded: Vec<bool>,
}

impl Answers {
    /// Room for closest hits, or for any hits.
    pub(crate) fn new(items: usize, closest: bool) -> Self {
        let (near, any) = if closest { (items * ITEM, 0) } else { (0, items * ITEM) };
        Self { t: vec![0.0; near], primitive: vec![0; near], occluded: vec![false; any] }
    }

    fn slots(&mut self) -> Slots<'_> {
        Slots { t: &mut self.t, primitive: &mut self.primitive, occluded: &mut self.occluded }
    }
}

/// A part of [`Answers`].
pub(crate) struct Slots<'a> {
    pub(crate) t: &'a mut [f32],
    pub(crate) primitive: &'a mut [u32],
    pub(crate) occluded: &'a mut [bool],
}

impl<'a> Slots<'a> {
    /// The slots of the first `items` items and the rest.
    fn split(self, items: usize) -> (Self, Self) {
        let slots = items * ITEM;
        let (t, t_rest) = self.t.split_at_mut(slots.min(self.t.len()));
        let (primitive, primitive_rest) = self.primitive.split_at_mut(slots.min(self.primitive.len()));
        let (occluded, occluded_rest) = self.occluded.split_at_mut(slots.min(self.occluded.len()));
        (
            Self { t, primitive, occluded },
            Self { t: t_rest, primitive: primitive_rest, occluded: occluded_rest },
        )
    }
}

/// An engine with one set of rays to trace.
pub(crate) trait Tracer: Sync {
    /// Number of work items.
    fn items(&self) -> usize;

    /// Answers the rays of items `first..first + count`; `out` has the slots of just these.
    fn trace(&self, first: usize, count: usize, out: Slots<'_>);
}

/// Traces everything once on the calling thread, or on a pool.
pub(crate) fn pass(tracer: &dyn Tracer, answers: &mut Answers, pool: Option<&ThreadPool>) {
    let items = tracer.items();
    let Some(pool) = pool else { return tracer.trace(0, items, answers.slots()) };
    let mut rest = answers.slots();
    let mut parts = Vec::with_capacity(items.div_ceil(GRAIN));
    for first in (0..items).step_by(GRAIN) {
        let count = GRAIN.min(items - first);
        let (part, left) = rest.split(count);
        rest = left;
        parts.push((first, count, part));
    }
    pool.install(|| parts.into_par_iter().for_each(|(first, count, part)| tracer.trace(first, count, part)));
}

/// Traces every eighth run of items once on the calling thread: seconds per item, for choosing among variants.
pub(crate) fn sample(tracer: &dyn Tracer, answers: &mut Answers) -> f64 {
    let items = tracer.items();
    let (stride, run) = if items < 64 * GRAIN { (1, 1) } else { (8, GRAIN) };
    let mut traced = 0;
    let clock = Clock::start(false);
    for first in (0..items).step_by(stride * run) {
        let count = run.min(items - first);
        tracer.trace(first, count, answers.slots().split(count).0);
        traced += count;
    }
    clock.seconds() / traced.max(1) as f64
}

/// Seconds per pass: processor time of this thread, or wall time on a pool.
pub(crate) fn time(tracer: &dyn Tracer, answers: &mut Answers, pool: Option<&ThreadPool>) -> f64 {
    let clock = Clock::start(pool.is_some());
    let mut passes = 0;
    loop {
        pass(tracer, answers, pool);
        passes += 1;
        let seconds = clock.seconds();
        if seconds >= LEAST_RUN {
            return seconds / f64::from(passes);
        }
    }
}

/// Runs two measurements in turn, A B A B …, and returns the medians of their results.
///
/// # Errors
/// The first of either.
pub(crate) fn interleave(
    runs: usize,
    mut a: impl FnMut() -> Result<f64, String>,
    mut b: impl FnMut() -> Result<f64, String>,
) -> Result<(f64, f64), String> {
    let mut results = (Vec::with_capacity(runs), Vec::with_capacity(runs));
    for _ in 0..runs {
        results.0.push(a()?);
        results.1.push(b()?);
    }
    Ok((median(&mut results.0), median(&mut results.1)))
}

/// The middle value, or the mean of the two middle ones; NaN of nothing.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => f64::NAN,
        _ if n % 2 == 1 => values[n / 2],
        _ => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}

/// The geometric mean; NaN of nothing.
pub(crate) fn geometric_mean(values: &[f64]) -> f64 {
    (values.iter().map(|v| v.ln()).sum::<f64>() / values.len() as f64).exp()
}

/// Processor time of the calling thread, or wall time. On a machine with other work the former is disturbed less.
pub(crate) struct Clock {
    wall: bool,
    start: f64,
    epoch: Instant,
}

impl Clock {
    pub(crate) fn start(wall: bool) -> Self {
        let mut clock = Self { wall, start: 0.0, epoch: Instant::now() };
        clock.start = clock.now();
        clock
    }

    pub(crate) fn seconds(&self) -> f64 {
        self.now() - self.start
    }

    fn now(&self) -> f64 {
        if self.wall {
            return self.epoch.elapsed().as_secs_f64();
        }
        processor_seconds().unwrap_or_else(|| self.epoch.elapsed().as_secs_f64())
    }
}

/// Processor time of all threads, or wall time where the system does not tell.
pub(crate) fn process_seconds() -> f64 {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    }
    #[cfg(not(unix))]
    {
        use std::sync::LazyLock;
        static START: LazyLock<Instant> = LazyLock::new(Instant::now);
        START.elapsed().as_secs_f64()
    }
}

#[cfg(unix)]
fn processor_seconds() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
fn processor_seconds() -> Option<f64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn middles_and_means() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&mut []).is_nan());
        assert!((geometric_mean(&[1.0, 4.0, 2.0]) - 2.0).abs() < 1e-12);
        assert!(geometric_mean(&[]).is_nan());
    }

    /// Answers each ray with its item's number.
    struct Numbers(usize);

    impl Tracer for Numbers {
        fn items(&self) -> usize {
            self.0
        }

        fn trace(&self, first: usize, count: usize, out: Slots<'_>) {
            assert_eq!(out.primitive.len(), count * ITEM);
            for (i, item) in out.primitive.chunks_mut(ITEM).enumerate() {
                item.fill((first + i) as u32);
            }
        }
    }

    #[test]
    fn every_item_is_answered_in_its_place() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("a pool");
        for pool in [None, Some(&pool)] {
            let mut answers = Answers::new(37, true);
            pass(&Numbers(37), &mut answers, pool);
            let expected = (0..37).flat_map(|i| [i; ITEM]);
            assert!(answers.primitive.iter().copied().eq(expected));
        }
    }

    #[test]
    fn runs_alternate() {
        let order = std::cell::RefCell::new(String::new());
        let run = |name| {
            order.borrow_mut().push(name);
            Ok(1.0)
        };
        assert_eq!(interleave(3, || run('a'), || run('b')), Ok((1.0, 1.0)));
        assert_eq!(order.into_inner(), "ababab");
    }
}

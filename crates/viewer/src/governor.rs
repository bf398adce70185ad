//! Holds the frame time while something moves: how many pixels fit into it.

/// What the user asks of the governor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Goal {
    /// Frames per second while something moves; `None` always makes the whole picture.
    pub(crate) frames_per_second: Option<f32>,
}

/// Smallest share of the picture's width and height.
const SMALLEST: f32 = 0.2;
/// How much the scale changes from one step to the next: a picture that changes its size all the time is restless.
const STEP: f32 = 0.85;

/// Chooses the scale of moving pictures from what the last ones took.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Governor {
    scale: f32,
    /// Milliseconds per pixel, smoothed.
    cost: Option<f64>,
    /// By how much less light paths are followed, as a power of two: when the smallest picture is too dear as well.
    thrift: u32,
}

/// Most that [`Governor::paths`] halves.
const MAX_THRIFT: u32 = 3;

impl Default for Governor {
    /// Knows nothing yet: begins at a quarter of the size, so that the first picture of a costly scene comes soon.
    fn default() -> Self {
        Self { scale: 0.25, cost: None, thrift: 0 }
    }
}

impl Governor {
    /// Share of the full picture's width and height for the next moving picture.
    pub(crate) fn scale(&self, goal: Goal) -> f32 {
        if goal.frames_per_second.is_some() { self.scale } else { 1.0 }
    }

    /// Light paths for the next moving picture, of those that a whole one follows.
    pub(crate) fn paths(&self, goal: Goal, whole: u32) -> u32 {
        if goal.frames_per_second.is_some() { (whole >> self.thrift).max(1) } else { whole }
    }

    /// Learns from a finished moving picture of `pixels` that took so long; `full` are the pixels at scale 1.
    pub(crate) fn learn(&mut self, goal: Goal, full: u32, pixels: u32, milliseconds: f64) {
        let Some(rate) = goal.frames_per_second else { return };
        let cost = milliseconds.max(1e-3) / f64::from(pixels.max(1));
        let first = self.cost.is_none() && self.thrift == 0;
        // What is dearer than expected counts at once, what is cheaper only by and by.
        let cost = self
            .cost
            .map_or(cost, |old| if cost > old { 0.5 * (old + cost) } else { 0.8 * old + 0.2 * cost });
        self.cost = Some(cost);
        let budget = 1e3 / f64::from(rate.clamp(0.1, 1000.0));
        let ideal = (budget / (cost * f64::from(full.max(1)))).sqrt() as f32;
        if ideal < 0.8 * SMALLEST && self.thrift < MAX_THRIFT && self.scale <= SMALLEST {
            (self.thrift, self.cost) = (self.thrift + 1, None);
            return;
        }
        if ideal > 3.0 * SMALLEST && self.thrift > 0 {
            (self.thrift, self.cost) = (self.thrift - 1, None);
            return;
        }
        let ideal = ideal.clamp(SMALLEST, 1.0);
        if first {
            self.scale = ideal;
            return;
        }
        if ideal < self.scale * STEP.sqrt() {
            self.scale = (self.scale * STEP).max(ideal.min(self.scale)).max(SMALLEST);
            if ideal < self.scale * STEP {
                self.scale = ideal;
            }
        } else if ideal * STEP > self.scale || ideal == 1.0 {
            self.scale = (self.scale / STEP).min(1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of `cost` ms per full picture, half of it for light paths, plus 2 ms each; returns the last scale and paths
    /// of 8 with their frame time.
    fn settle(governor: &mut Governor, cost: f64) -> (f32, u32, f64) {
        let goal = Goal { frames_per_second: Some(20.0) };
        let mut last = (0.0, 0, 0.0);
        for _ in 0..100 {
            let (scale, paths) = (governor.scale(goal), governor.paths(goal, 8));
            let pixels = (f64::from(scale * scale) * 300_000.0) as u32;
            let share = 0.5 + 0.5 * f64::from(paths) / 8.0;
            let milliseconds = 2.0 + cost * share * f64::from(pixels) / 300_000.0;
            governor.learn(goal, 300_000, pixels, milliseconds);
            last = (scale, paths, milliseconds);
        }
        last
    }

    #[test]
    fn the_frame_time_is_held_and_nothing_is_wasted() {
        let mut governor = Governor::default();
        for cost in [20.0, 100.0, 400.0, 60.0] {
            let (scale, paths, time) = settle(&mut governor, cost);
            assert!(time < 50.0 * 1.2, "{cost}: {time} ms at {scale}");
            assert!(scale == 1.0 || time > 50.0 * 0.55, "{cost}: {time} ms at {scale}");
            assert_eq!(paths, 8);
        }
        // Half of this is too much for the smallest picture: then with less light, and back again.
        let (scale, paths, time) = settle(&mut governor, 2000.0);
        assert!(scale < 0.3 && paths < 8 && time < 50.0 * 1.25, "{scale} {paths} {time}");
        let (scale, paths, _) = settle(&mut governor, 1e5);
        assert_eq!((scale, paths), (SMALLEST, 1));
        let (_, paths, time) = settle(&mut governor, 60.0);
        assert!(paths == 8 && time < 60.0);
        assert_eq!(governor.scale(Goal { frames_per_second: None }), 1.0);
    }
}

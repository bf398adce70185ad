//! What pictures take, for the overlay.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use heliostat_scene::{ApplyReport, Frame};
use serde::Serialize;

/// Frames kept for the rate.
const WINDOW: usize = 64;
/// The rate is that of the last so many seconds.
const SPAN: Duration = Duration::from_millis(1500);

/// What a picture took. Times in milliseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Stats {
    /// Pictures per second, over the last second or so.
    pub fps: f64,
    /// Rays per second while rendering.
    pub rays_per_second: f64,
    /// Rays of the frame.
    pub rays: u64,
    /// Applying edits.
    pub apply: f64,
    /// Rendering, by the wall clock.
    pub render: f64,
    /// Share of the threads' time that was spent in ray queries, 0 to 1; the rest is shading and all else.
    pub query_share: f64,
    /// Tone mapping.
    pub tone: f64,
    /// Share of the full picture's width and height at which it was rendered.
    pub scale: f32,
    /// Light paths that started virtual point lights, of all sets together; 0 for other renderers.
    pub light_paths: u32,
    /// Where a heat map of counts is shown: their mean, and the count that is white.
    pub counts: Option<[f32; 2]>,
    /// What the latest edits rebuilt, and in how many milliseconds.
    pub rebuilt: Vec<(String, f64)>,
}

/// Keeps the rate and gathers the figures of a frame.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    shown: VecDeque<Instant>,
    apply: f64,
    rebuilt: Vec<(String, f64)>,
}

impl Meter {
    /// Notes what edits took.
    pub(crate) fn applied(&mut self, report: &ApplyReport) {
        self.apply += report.milliseconds;
        // A handful fits the overlay; the dearest are what one looks for.
        for rebuilt in &report.rebuilt {
            match self.rebuilt.iter_mut().find(|(what, _)| *what == rebuilt.what) {
                Some((_, milliseconds)) => *milliseconds += rebuilt.milliseconds,
                None => self.rebuilt.push((rebuilt.what.clone(), rebuilt.milliseconds)),
            }
        }
        self.rebuilt.sort_by(|a, b| b.1.total_cmp(&a.1));
        self.rebuilt.truncate(6);
    }

    /// The figures of a frame that is shown now; the stages not known here are left at 0.
    pub(crate) fn shown(&mut self, frame: &Frame, threads: usize) -> Stats {
        let now = Instant::now();
        self.shown.push_back(now);
        while self.shown.len() > WINDOW || self.shown.front().is_some_and(|first| now - *first > SPAN) {
            self.shown.pop_front();
        }
        let span = self.shown.front().map_or(0.0, |first| (now - *first).as_secs_f64());
        let fps = if span > 0.0 { (self.shown.len() - 1) as f64 / span } else { 0.0 };
        let milliseconds = frame.stats.milliseconds.max(1e-6);
        Stats {
            fps,
            rays_per_second: frame.stats.rays as f64 * 1e3 / milliseconds,
            rays: frame.stats.rays,
            apply: std::mem::take(&mut self.apply),
            render: frame.stats.milliseconds,
            query_share: (frame.stats.query_milliseconds / (milliseconds * threads.max(1) as f64)).min(1.0),
            rebuilt: std::mem::take(&mut self.rebuilt),
            ..Stats::default()
        }
    }
}

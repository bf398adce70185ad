//! Frames over time: which moments are shown, and what changes from one to the next.

use std::ops::Range;
use std::path::PathBuf;

use heliostat::scene::{Camera, Clip, Edit, Scene, Timeline};
use heliostat_viewer::Own;

use super::failure::Failure;
use super::playback::Playback;
use super::{console, values};

/// Frames per second where neither the command line nor the clip says anything.
const DEFAULT_RATE: f64 = 24.0;

#[derive(Debug, clap::Args)]
#[group(skip)]
pub(super) struct Arguments {
    /// Frames FIRST..END (END not included): frame N shows the clip at N / FPS seconds; several are numbered files
    #[arg(long, value_name = "A..B", value_parser = values::frames)]
    frames: Option<Range<u32>>,
    /// One picture of the scene at this time of the clip
    #[arg(long, value_name = "SECONDS", value_parser = values::seconds, conflicts_with = "frames")]
    time: Option<f64>,
    /// Which of the scene's clips plays, by name or by number from 0 [default: the first]
    #[arg(long, value_name = "NAME|INDEX")]
    clip: Option<String>,
    /// Frames per second [default: what the clip was made for, else 24]
    #[arg(long, value_name = "N", value_parser = values::rate)]
    fps: Option<f64>,
    /// How long the shutter stays open, as a share of the time between two frames
    #[arg(long, value_name = "FRACTION", value_parser = values::share, default_value = "0")]
    shutter: f64,
    /// Put all frames also into one animated picture, .png or .apng
    #[arg(long, value_name = "FILE", value_parser = values::animation)]
    pub(super) animate: Option<PathBuf>,
}

impl Arguments {
    /// Where nothing else is asked for, the frames and the clip of a replay.
    pub(super) fn adopt(&mut self, playback: &Playback) {
        let frames = playback.frames(self.fps.unwrap_or(DEFAULT_RATE));
        if self.frames.is_none() && self.time.is_none() && frames > 1 {
            self.frames = Some(0..frames);
        }
        self.clip = self.clip.take().or(playback.replay.clip.map(|clip| clip.to_string()));
        self.fps.get_or_insert(DEFAULT_RATE);
    }
}

/// The frames to be made and the motion they show.
pub(super) struct Sequence {
    timeline: Timeline,
    frames: Range<u32>,
    /// The time of a single frame.
    time: Option<f64>,
    /// Whether the scene is shown as its motion has it, and not at rest.
    plays: bool,
    pub(super) frames_per_second: f64,
    shutter: f64,
    playback: Option<Playback>,
}

impl Sequence {
    /// What the arguments ask for. Without any, one frame of the scene at rest.
    ///
    /// # Errors
    /// When there is no clip of the name or number asked for.
    pub(super) fn new(
        arguments: &Arguments,
        mut timeline: Timeline,
        playback: Option<Playback>,
    ) -> Result<Self, Failure> {
        if let Some(wanted) = &arguments.clip {
            timeline.play(find(wanted, timeline.clips())?);
        }
        let own_rate = timeline.playing().and_then(|clip| clip.frame_rate);
        let asked = arguments.frames.is_some() || arguments.time.is_some() || arguments.clip.is_some();
        let sequence = Self {
            plays: asked && !timeline.is_empty(),
            frames: arguments.frames.clone().unwrap_or(0..1),
            time: arguments.time,
            frames_per_second: arguments.fps.or(own_rate).unwrap_or(DEFAULT_RATE),
            shutter: arguments.shutter,
            timeline,
            playback,
        };
        if let Some(remark) = sequence.remark(arguments.time.is_some()) {
            console::message(&format!("note: {remark}"));
        }
        Ok(sequence)
    }

    /// What the user may not expect.
    fn remark(&self, timed: bool) -> Option<String> {
        let Some(clip) = self.timeline.playing() else {
            return match (self.frames.len(), timed) {
                (1, true) => Some("nothing in this scene moves: it looks the same at any time".into()),
                (1, false) => None,
                _ => Some("nothing in this scene moves: the frames differ in their noise alone".into()),
            };
        };
        let (end, last) = (self.timeline.duration(), self.time(self.frames.end - 1)?);
        (last > end + 1e-6).then(|| {
            let frame = (end * self.frames_per_second).floor();
            format!(
                "the clip `{}` ends after {end:.3} s, at frame {frame}; then it stays as it is",
                clip.name
            )
        })
    }

    pub(super) fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    pub(super) fn frames(&self) -> Range<u32> {
        self.frames.clone()
    }

    /// The time of a frame, in seconds from the clip's start; `None` for a scene at rest.
    pub(super) fn time(&self, frame: u32) -> Option<f64> {
        self.plays.then(|| {
            let at = self.moment(frame);
            self.playback.as_ref().map_or(at, |playback| playback.clip_time(at))
        })
    }

    /// Seconds from the first frame.
    fn moment(&self, frame: u32) -> f64 {
        self.time.unwrap_or(f64::from(frame) / self.frames_per_second)
    }

    /// The point of view that a replay asks for.
    pub(super) fn camera(&self, frame: u32) -> Option<Camera> {
        self.playback.as_ref()?.camera(self.moment(frame))
    }

    /// What a replay changes in the scene for a frame.
    ///
    /// # Errors
    /// When it does not fit the scene.
    pub(super) fn changes(&mut self, frame: u32, scene: &Scene, own: &Own) -> Result<Vec<Edit>, Failure> {
        let at = self.moment(frame);
        self.playback.as_mut().map_or(Ok(Vec::new()), |playback| playback.changes(at, scene, own))
    }

    /// The name of the clip that plays; `None` for a scene at rest.
    pub(super) fn clip(&self) -> Option<&str> {
        self.timeline.playing().filter(|_| self.plays).map(|clip| clip.name.as_str())
    }

    /// What changes for a frame, since the one asked for before.
    pub(super) fn edits(&mut self, frame: u32) -> Vec<Edit> {
        let Some(open) = self.time(frame) else { return Vec::new() };
        self.timeline.edits_over(open, open + self.shutter / self.frames_per_second)
    }
}

/// The number of a clip.
fn find(wanted: &str, clips: &[Clip]) -> Result<usize, Failure> {
    let by_name = clips.iter().position(|clip| clip.name == wanted);
    let by_index = || wanted.parse().ok().filter(|&index: &usize| index < clips.len());
    by_name.or_else(by_index).ok_or_else(|| {
        let list: Vec<_> = clips.iter().enumerate().map(|(i, clip)| format!("{i} `{}`", clip.name)).collect();
        let list = if list.is_empty() { "it has none".into() } else { format!("it has {}", list.join(", ")) };
        Failure::usage(format!("the scene has no clip `{wanted}`")).with_help(list)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments() -> Arguments {
        Arguments { frames: None, time: None, clip: None, fps: None, shutter: 0.0, animate: None }
    }

    fn sequence(arguments: &Arguments) -> Sequence {
        Sequence::new(arguments, heliostat::builtin::timeline("cornell"), None).expect("it has the clip")
    }

    #[test]
    fn frames_are_moments_of_the_clip() {
        assert_eq!(sequence(&arguments()).time(0), None);
        let mut frames = sequence(&Arguments { frames: Some(12..36), fps: Some(12.0), ..arguments() });
        assert_eq!((frames.time(12), frames.clip()), (Some(1.0), Some("turn")));
        assert_eq!((frames.edits(12).len(), frames.edits(12).len(), frames.edits(13).len()), (2, 0, 2));
        let still = sequence(&Arguments { time: Some(2.5), ..arguments() });
        assert_eq!((still.frames(), still.time(0)), (0..1, Some(2.5)));
        let named = sequence(&Arguments { clip: Some("turn".into()), ..arguments() });
        assert_eq!(named.time(0), Some(0.0));
    }

    #[test]
    fn an_open_shutter_sweeps() {
        let mut swept = sequence(&Arguments { time: Some(1.0), shutter: 0.5, ..arguments() });
        assert!(swept.edits(0).iter().all(|edit| matches!(edit, Edit::SweepInstance(..))));
    }

    #[test]
    fn the_end_is_remarked_on_and_so_is_stillness() {
        let remark = |arguments: &Arguments| sequence(arguments).remark(arguments.time.is_some());
        assert_eq!(remark(&Arguments { frames: Some(0..97), ..arguments() }), None);
        let late = remark(&Arguments { frames: Some(0..98), ..arguments() }).expect("a remark");
        assert!(late.contains("4.000 s, at frame 96"), "{late}");
        assert!(remark(&Arguments { time: Some(5.0), ..arguments() }).is_some());
        let still = Sequence::new(&arguments(), Timeline::default(), None).expect("no clip is asked for");
        assert!(still.remark(false).is_none() && still.remark(true).is_some());
        let none =
            Sequence::new(&Arguments { clip: Some("x".into()), ..arguments() }, Timeline::default(), None);
        assert!(none.is_err());
    }
}

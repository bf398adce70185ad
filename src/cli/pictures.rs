//! What becomes of finished frames: numbered files, an animated picture, one exposure for all of them.

use std::fs::File;
use std::path::{Path, PathBuf};

use heliostat::engine::tone;
use heliostat::formats::image::PngAnimation;
use heliostat::scene::Frame;
use heliostat::shading::pixel::BoundPixelShader;

use super::failure::Failure;
use super::output::{Format, Target, folder};
use super::values::{Exposure, Size};

/// Where the frames of a sequence go.
pub(super) struct Pictures {
    /// `None` when the animated picture is all there is.
    target: Option<Target>,
    animation: Option<Animation>,
    several: bool,
    /// The first frame decides for all: brightness that is chosen anew for each of them flickers.
    exposure: Exposure,
    /// The tone curve of 8-bit pictures.
    curve: BoundPixelShader,
}

/// How many frames of what kind are to come.
pub(super) struct Expected {
    pub(super) frames: u32,
    pub(super) frames_per_second: f64,
    pub(super) size: Size,
}

/// An animated picture on its way, under a temporary name.
struct Animation {
    path: PathBuf,
    temporary: PathBuf,
    writer: Option<PngAnimation<File>>,
}

impl Pictures {
    /// Makes ready for some frames.
    ///
    /// # Errors
    /// When a file cannot be put where it should go.
    pub(super) fn new(
        target: &Target,
        animate: Option<&Path>,
        exposure: Exposure,
        curve: BoundPixelShader,
        expected: &Expected,
    ) -> Result<Self, Failure> {
        target.check()?;
        let alone = (target.format == Format::Apng).then_some(target.path.as_path());
        let animation = match animate.or(alone) {
            Some(path) => Some(Animation::new(path, expected)?),
            None => None,
        };
        let target = alone.is_none().then(|| target.clone());
        Ok(Self { target, animation, several: expected.frames > 1, exposure, curve })
    }

    /// Writes a frame; returns the files written and the exposure used, if any.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(super) fn add(&mut self, number: u32, frame: &Frame) -> Result<(Vec<PathBuf>, Option<f32>), Failure> {
        let mapped = self.target.as_ref().is_none_or(|target| target.format == Format::Png);
        let ev = match self.exposure {
            Exposure::Auto => tone::auto_exposure(&frame.color),
            Exposure::Ev(ev) => ev,
        };
        self.exposure = Exposure::Ev(ev);
        let files = match &self.target {
            Some(target) if self.several => target.numbered(number).write(frame, &self.curve, ev)?,
            Some(target) => target.write(frame, &self.curve, ev)?,
            None => Vec::new(),
        };
        if let Some(animation) = &mut self.animation {
            animation.add(&tone::tone_map_by(&self.curve, &frame.color, frame.width, ev))?;
        }
        Ok((files, (mapped || self.animation.is_some()).then_some(ev)))
    }

    /// Ends the animated picture, if there is one, and returns its file.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(super) fn finish(self) -> Result<Option<PathBuf>, Failure> {
        self.animation.map(Animation::finish).transpose()
    }
}

impl Animation {
    fn new(path: &Path, expected: &Expected) -> Result<Self, Failure> {
        Target { path: path.to_path_buf(), format: Format::Apng }.check()?;
        let temporary = folder(path).join(format!(".heliostat-{}-animation.part", std::process::id()));
        let file = File::create(&temporary).map_err(|error| cannot_write(path, &error.to_string()))?;
        let mut animation = Self { path: path.to_path_buf(), temporary, writer: None };
        let Expected { frames, frames_per_second, size } = *expected;
        let writer = PngAnimation::new(file, size.width, size.height, frames, frames_per_second);
        animation.writer = Some(writer.map_err(|error| cannot_write(path, &error.to_string()))?);
        Ok(animation)
    }

    fn add(&mut self, rgb: &[u8]) -> Result<(), Failure> {
        let added = self.writer.as_mut().map_or(Ok(()), |writer| writer.frame(rgb));
        added.map_err(|error| cannot_write(&self.path, &error.to_string()))
    }

    fn finish(mut self) -> Result<PathBuf, Failure> {
        let finished = self.writer.take().map_or(Ok(()), PngAnimation::finish);
        finished.map_err(|error| cannot_write(&self.path, &error.to_string()))?;
        let renamed = std::fs::rename(&self.temporary, &self.path);
        renamed.map_err(|error| cannot_write(&self.path, &error.to_string()))?;
        Ok(self.path.clone())
    }
}

impl Drop for Animation {
    fn drop(&mut self) {
        // What is left of an unfinished picture is of no use; after a finished one there is nothing to remove.
        _ = std::fs::remove_file(&self.temporary);
    }
}

fn cannot_write(path: &Path, problem: &str) -> Failure {
    Failure::new(format!("`{}` cannot be written: {problem}", path.display()))
}

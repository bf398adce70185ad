//! The mean of successive frames of a scene that stands still.

use glam::Vec3;
use heliostat_scene::{Frame, Plane, PlaneData};

/// Sums up frames.
#[derive(Debug, Default)]
pub(crate) struct Refinement {
    size: [u32; 2],
    sum: Vec<Vec3>,
    /// Of the first frame: later ones are the same but for noise, and what is drawn from them would flicker.
    planes: Vec<PlaneData>,
    frames: u32,
}

impl Refinement {
    /// Forgets everything: something has changed.
    pub(crate) fn restart(&mut self) {
        self.frames = 0;
    }

    /// Frames in the mean.
    pub(crate) fn frames(&self) -> u32 {
        self.frames
    }

    /// The planes of the first frame.
    pub(crate) fn planes(&self) -> &[PlaneData] {
        &self.planes
    }

    /// Adds a frame, and starts again when its size is another one; makes its colours the mean of all so far.
    pub(crate) fn add(&mut self, frame: &mut Frame) {
        let size = [frame.width, frame.height];
        if self.frames == 0 || self.size != size {
            self.size = size;
            self.sum.clone_from(&frame.color);
            self.planes
                .resize_with(frame.planes.len(), || PlaneData { plane: Plane::Depth, values: Vec::new() });
            for (kept, new) in self.planes.iter_mut().zip(&frame.planes) {
                kept.plane = new.plane;
                kept.values.clone_from(&new.values);
            }
            self.frames = 1;
            return;
        }
        self.frames += 1;
        let share = 1.0 / self.frames as f32;
        for (sum, color) in self.sum.iter_mut().zip(&mut frame.color) {
            *sum += *color;
            *color = *sum * share;
        }
    }
}

#[cfg(test)]
mod tests {
    use heliostat_scene::FrameStats;

    use super::*;

    fn frame(size: u32, value: f32) -> Frame {
        let color = vec![Vec3::splat(value); (size * size) as usize];
        let (planes, problems) = (Vec::new(), Vec::new());
        Frame { width: size, height: size, color, planes, stats: FrameStats::default(), problems }
    }

    #[test]
    fn frames_are_averaged_until_something_changes() {
        let mut refinement = Refinement::default();
        let mut add = |size, value| {
            let mut frame = frame(size, value);
            refinement.add(&mut frame);
            (frame.color[0].x, refinement.frames())
        };
        assert_eq!(add(4, 1.0), (1.0, 1));
        assert_eq!(add(4, 3.0), (2.0, 2));
        assert_eq!(add(2, 5.0), (5.0, 1));
        refinement.restart();
        let mut last = frame(2, 7.0);
        refinement.add(&mut last);
        assert_eq!((last.color[0].x, refinement.frames()), (7.0, 1));
    }
}

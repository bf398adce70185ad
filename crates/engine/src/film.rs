//! The film: regions' sums become pixels of a frame as soon as they are finished.

use std::sync::Mutex;

use glam::Vec3;
use heliostat_scene::{Frame, FrameRequest, FrameStats, Plane, PlaneData};
use heliostat_transport::{PixelSum, Region};

/// A frame in the making, filled by many threads in any order.
pub(crate) struct Film {
    frame: Mutex<Frame>,
    per_sample: f32,
}

impl Film {
    /// A black frame of the requested size with some planes.
    pub(crate) fn new(request: &FrameRequest, planes: &[Plane]) -> Self {
        let (width, height) = (request.width, request.height);
        let pixels = width as usize * height as usize;
        let plane = |&plane: &Plane| PlaneData { plane, values: vec![0.0; pixels * plane.channels()] };
        let planes = planes.iter().map(plane).collect();
        let (color, stats) = (vec![Vec3::ZERO; pixels], FrameStats::default());
        Self {
            frame: Mutex::new(Frame { width, height, color, planes, stats, problems: Vec::new() }),
            per_sample: 1.0 / request.samples as f32,
        }
    }

    /// Columns and rows.
    pub(crate) fn size(&self) -> (u32, u32) {
        let frame = self.frame.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        (frame.width, frame.height)
    }

    /// All regions.
    pub(crate) fn regions(&self) -> impl Iterator<Item = Region> {
        let (width, height) = self.size();
        Region::cover(width, height)
    }

    /// Adds light to a row: the sum over all samples.
    pub(crate) fn add_row(&self, y: u32, row: &[Vec3]) {
        let mut frame = self.frame.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let start = y as usize * frame.width as usize;
        for (color, light) in frame.color[start..].iter_mut().zip(row) {
            *color += *light * self.per_sample;
        }
    }

    /// Stores a finished region; `sums` are in the order of [`Region::pixels`].
    pub(crate) fn store(&self, region: &Region, sums: &[PixelSum]) {
        // A thread that panicked while it held the lock left whole pixels behind: go on with them.
        let mut frame = self.frame.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let width = frame.width as usize;
        for ((x, y), sum) in region.pixels().zip(sums) {
            let index = y as usize * width + x as usize;
            frame.color[index] = (sum.color + sum.lit) * self.per_sample;
            for data in &mut frame.planes {
                let channels = data.plane.channels();
                write(data.plane, sum, self.per_sample, &mut data.values[index * channels..][..channels]);
            }
        }
    }

    /// The frame with what has been stored.
    pub(crate) fn finish(self) -> Frame {
        self.frame.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner())
    }
}

/// One pixel of one plane. Geometry is averaged over the samples that hit something, light over all.
fn write(plane: Plane, sum: &PixelSum, per_sample: f32, out: &mut [f32]) {
    let per_hit = if sum.hits > 0.0 { 1.0 / sum.hits } else { 0.0 };
    let id = |number: Option<u32>| number.map_or(0.0, |n| n as f32 + 1.0);
    match plane {
        Plane::Depth => out[0] = sum.depth * per_hit,
        Plane::Normal => sum.normal.normalize_or_zero().write_to_slice(out),
        Plane::Position => (sum.position * per_hit).write_to_slice(out),
        Plane::Albedo => (sum.albedo * per_sample).write_to_slice(out),
        Plane::Alpha => out[0] = sum.hits * per_sample,
        Plane::ObjectId => out[0] = id(sum.first.map(|f| f.object)),
        Plane::InstanceId => out[0] = id(sum.first.map(|f| f.instance)),
        Plane::MaterialId => out[0] = id(sum.first.map(|f| f.material)),
        Plane::Cost => out[0] = sum.shaded * per_sample,
        // Counted when the picture is done.
        Plane::Nodes | Plane::Triangles => {}
    }
}

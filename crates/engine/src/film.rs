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
    /// A black frame of the requested size with some planes, in the buffers of another one. Every pixel gets so many
    /// `samples`.
    pub(crate) fn new(request: &FrameRequest, samples: u32, planes: &[Plane], spare: Option<Frame>) -> Self {
        let (width, height) = (request.width, request.height);
        let pixels = width as usize * height as usize;
        let (mut color, spare) = spare.map_or_else(Default::default, |spare| (spare.color, spare.planes));
        renew(&mut color, pixels);
        let mut spare = spare.into_iter();
        let plane = |&plane: &Plane| {
            let mut values = spare.next().map_or_else(Vec::new, |spare| spare.values);
            renew(&mut values, pixels * plane.channels());
            PlaneData { plane, values }
        };
        let planes = planes.iter().map(plane).collect();
        let (stats, problems) = (FrameStats::default(), Vec::new());
        Self {
            frame: Mutex::new(Frame { width, height, color, planes, stats, problems }),
            per_sample: 1.0 / samples as f32,
        }
    }

    /// Columns and rows.
    pub(crate) fn size(&self) -> (u32, u32) {
        let frame = self.frame.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        (frame.width, frame.height)
    }

    /// Whether there is anything but light in it.
    pub(crate) fn has_planes(&self) -> bool {
        let frame = self.frame.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        !frame.planes.is_empty()
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
        for ((x, y), sum) in region.pixels().into_iter().zip(sums) {
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

/// Buffers of so many values stay, even if fewer are needed; larger ones go when less than a quarter of them is.
const KEPT: usize = 640 * 480;

/// Makes a buffer hold `count` default values. The largest picture so far decides its size: buffers of ever other sizes
/// would leave holes between them that are never given back.
pub(crate) fn renew<T: Clone + Default>(buffer: &mut Vec<T>, count: usize) {
    let wasted = buffer.capacity() > KEPT && buffer.capacity() / 4 > count;
    buffer.clear();
    if buffer.capacity() < count || wasted {
        // The old one goes before the new one comes.
        *buffer = Vec::new();
        buffer.reserve_exact(count);
    }
    buffer.resize(count, T::default());
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

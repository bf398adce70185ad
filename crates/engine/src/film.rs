//! From sums over samples to the planes of a frame.

use glam::Vec3;
use heliostat_scene::{Frame, FrameRequest, FrameStats, Plane, PlaneData};
use heliostat_transport::{PixelSum, Region};

/// Puts the regions' sums together; they come in the order of [`Region::cover`].
pub(crate) fn assemble(request: &FrameRequest, regions: &[Vec<PixelSum>]) -> Frame {
    let (width, height) = (request.width, request.height);
    let pixels = width as usize * height as usize;
    let mut color = vec![Vec3::ZERO; pixels];
    let mut planes: Vec<PlaneData> = request
        .planes
        .iter()
        .map(|&plane| PlaneData { plane, values: vec![0.0; pixels * plane.channels()] })
        .collect();
    let per_sample = 1.0 / request.samples as f32;
    for (region, sums) in Region::cover(width, height).zip(regions) {
        for ((x, y), sum) in region.pixels().zip(sums) {
            let index = y as usize * width as usize + x as usize;
            color[index] = sum.color * per_sample;
            for data in &mut planes {
                let channels = data.plane.channels();
                write(data.plane, sum, per_sample, &mut data.values[index * channels..][..channels]);
            }
        }
    }
    Frame { width, height, color, planes, stats: FrameStats::default() }
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
    }
}

//! Tiles: up to 256 coherent rays from one origin, the unit of work of the fast path.
use glam::Vec3;

use crate::ray::Ray;

/// Up to [`Tile::CAPACITY`] rays with one common origin: a camera, a light or a virtual point light.
///
/// Push rays in an order in which each run of 16 is compact (4×4 pixels, say): the kernel culls by runs of 16.
/// Any order gives the same answers. Directions need not be unit vectors; `t` is measured in their lengths.
// In this order and aligned, so that no group of 16 values straddles a cache line.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
pub struct Tile {
    pub(crate) direction: [[f32; Tile::CAPACITY]; 3],
    pub(crate) t_min: [f32; Tile::CAPACITY],
    pub(crate) t_max: [f32; Tile::CAPACITY],
    pub(crate) origin: Vec3,
    pub(crate) len: usize,
    /// Times of the rays, where any was set.
    times: Option<Box<[f32; Tile::CAPACITY]>>,
}

impl Tile {
    /// The largest number of rays.
    pub const CAPACITY: usize = 256;

    /// An empty tile whose rays will start at `origin` (space of the world asked).
    #[must_use]
    pub const fn new(origin: Vec3) -> Self {
        let zero = [0.0; Self::CAPACITY];
        Self { origin, direction: [zero; 3], t_min: zero, t_max: zero, len: 0, times: None }
    }

    /// Empties the tile and moves it to another origin: cheaper than a new tile.
    pub fn restart(&mut self, origin: Vec3) {
        self.origin = origin;
        self.clear();
    }

    /// Removes all rays and keeps the origin.
    pub fn clear(&mut self) {
        self.len = 0;
        self.times = None;
    }

    /// Adds a ray over `0 < t < t_max` and returns its index, or `None` if the tile is full.
    pub fn push(&mut self, direction: Vec3, t_max: f32) -> Option<usize> {
        self.push_interval(direction, 0.0, t_max)
    }

    /// Adds a ray over `t_min < t < t_max` and returns its index, or `None` if the tile is full.
    pub fn push_interval(&mut self, direction: Vec3, t_min: f32, t_max: f32) -> Option<usize> {
        let index = self.len;
        if index >= Self::CAPACITY {
            return None;
        }
        for (lane, value) in self.direction.iter_mut().zip(direction.to_array()) {
            lane[index] = value;
        }
        self.t_min[index] = t_min;
        self.t_max[index] = t_max;
        self.len = index + 1;
        Some(index)
    }

    /// Adds rays over `0 < t < t_max` side by side and returns the index of the first, or `None`, and adds none, if not all
    /// fit. `directions` are their components, of equal length.
    pub fn push_run(&mut self, directions: [&[f32]; 3], t_max: f32) -> Option<usize> {
        let start = self.len;
        let end = start + directions[0].len();
        if end > Self::CAPACITY || directions.iter().any(|lane| lane.len() != end - start) {
            return None;
        }
        for (lane, run) in self.direction.iter_mut().zip(directions) {
            lane[start..end].copy_from_slice(run);
        }
        self.t_min[start..end].fill(0.0);
        self.t_max[start..end].fill(t_max);
        self.len = end;
        Some(start)
    }

    /// Sets the moment in the shutter interval, 0 to 1, at which ray `index` sees the world; it is 0 before. Nothing
    /// happens past the end. Worlds in which something moves answer tiles ray by ray.
    pub fn set_time(&mut self, index: usize, time: f32) {
        if index < self.len {
            self.times.get_or_insert_with(|| Box::new([0.0; Self::CAPACITY]))[index] = time;
        }
    }

    /// Number of rays.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// True if there is no ray.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// True if no further ray fits.
    #[must_use]
    pub const fn is_full(&self) -> bool {
        self.len == Self::CAPACITY
    }

    /// The common origin.
    #[must_use]
    pub const fn origin(&self) -> Vec3 {
        self.origin
    }

    /// Ray `index` as a ray of its own, or `None` past the end.
    #[must_use]
    pub fn ray(&self, index: usize) -> Option<Ray> {
        (index < self.len).then(|| Ray {
            origin: self.origin,
            t_min: self.t_min[index],
            direction: Vec3::new(
                self.direction[0][index],
                self.direction[1][index],
                self.direction[2][index],
            ),
            t_max: self.t_max[index],
            time: self.times.as_ref().map_or(0.0, |times| times[index]),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_rays_side_by_side() {
        let ways = [1.0, 2.0, 3.0_f32];
        let (mut run, mut single) = (Tile::new(Vec3::ONE), Tile::new(Vec3::ONE));
        for start in 0..86 {
            let pushed = run.push_run([&ways, &ways, &[4.0; 3]], 5.0);
            assert_eq!(pushed, (start < 85).then_some(3 * start), "255 rays fit in whole runs");
            if pushed.is_some() {
                ways.iter().for_each(|&way| _ = single.push(Vec3::new(way, way, 4.0), 5.0));
            }
        }
        assert_eq!(run.push_run([&ways[..1], &ways[..2], &ways[..1]], 5.0), None, "of different lengths");
        assert_eq!(run.len(), 255);
        for i in 0..255 {
            assert_eq!(run.ray(i), single.ray(i));
        }
    }
}

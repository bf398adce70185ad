//! Time spent in ray queries.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use heliostat_kernel::{Aabb, Hit, Ray, RayQuery, SeeThrough, Tile, World};

/// A world that counts the time its answers take, over all threads.
pub(crate) struct Metered<'a> {
    world: &'a World,
    nanoseconds: AtomicU64,
}

impl<'a> Metered<'a> {
    /// Nothing asked yet.
    pub(crate) fn new(world: &'a World) -> Self {
        Self { world, nanoseconds: AtomicU64::new(0) }
    }

    /// Processor time of all queries so far, milliseconds; that of the clock, where threads have cores of their own.
    pub(crate) fn milliseconds(&self) -> f64 {
        self.nanoseconds.load(Ordering::Relaxed) as f64 * 1e-6
    }

    fn count(&self, start: Instant) {
        self.nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
    }
}

impl RayQuery for Metered<'_> {
    fn intersect_tile(&self, tile: &Tile, hits: &mut [Hit]) {
        let start = Instant::now();
        self.world.intersect_tile(tile, hits);
        self.count(start);
    }

    fn occluded_tile(&self, tile: &Tile, occluded: &mut [bool]) {
        let start = Instant::now();
        self.world.occluded_tile(tile, occluded);
        self.count(start);
    }

    fn intersect(&self, rays: &[Ray], hits: &mut [Hit]) {
        let start = Instant::now();
        self.world.intersect(rays, hits);
        self.count(start);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        let start = Instant::now();
        self.world.occluded(rays, occluded);
        self.count(start);
    }

    fn occluded_tile_through(
        &self,
        tile: &Tile,
        through: &dyn SeeThrough,
        occluded: &mut [bool],
        filtered: &mut [bool],
    ) {
        let start = Instant::now();
        self.world.occluded_tile_through(tile, through, occluded, filtered);
        self.count(start);
    }

    fn occluded_through(
        &self,
        rays: &[Ray],
        through: &dyn SeeThrough,
        occluded: &mut [bool],
        filtered: &mut [bool],
    ) {
        let start = Instant::now();
        self.world.occluded_through(rays, through, occluded, filtered);
        self.count(start);
    }

    fn bounds(&self) -> Aabb {
        self.world.bounds()
    }
}

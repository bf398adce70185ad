//! The one interface through which rays are asked, so that an oracle or a recorder can stand in.
use crate::{
    aabb::Aabb,
    ray::{Hit, Ray},
    through::SeeThrough,
    tile::Tile,
};

/// Something that can be asked with rays: a [`World`](crate::World) or an [`Oracle`](crate::Oracle).
///
/// A ray's answer is the same bit for bit in whatever call it comes, on one instruction set (a kd-tree's differ by rounding).
/// Output slices are as long as the input; if they differ, the common part is answered. Every slot of that part
/// is written. Queries run on the calling thread and may run on many threads at once.
pub trait RayQuery: Sync {
    /// Closest hits of a tile of rays with a common origin: `hits[i]` answers ray `i`.
    fn intersect_tile(&self, tile: &Tile, hits: &mut [Hit]);

    /// Whether anything lies in the interval of each ray of a tile.
    fn occluded_tile(&self, tile: &Tile, occluded: &mut [bool]);

    /// Closest hits of arbitrary rays, any number: those of neighbouring pixels in one call are answered faster.
    fn intersect(&self, rays: &[Ray], hits: &mut [Hit]);

    /// Whether anything lies in the interval of each ray.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]);

    /// As [`RayQuery::occluded_tile`], with some geometries no obstacle: `occluded` tells of the others alone, and `filtered`
    /// of each ray that is not occluded whether it met any of `through`.
    fn occluded_tile_through(
        &self,
        tile: &Tile,
        through: &dyn SeeThrough,
        occluded: &mut [bool],
        filtered: &mut [bool],
    );

    /// As [`RayQuery::occluded`], with some geometries no obstacle, as in [`RayQuery::occluded_tile_through`].
    fn occluded_through(
        &self,
        rays: &[Ray],
        through: &dyn SeeThrough,
        occluded: &mut [bool],
        filtered: &mut [bool],
    );

    /// The box around everything that can be hit, in world space; empty if there is nothing.
    fn bounds(&self) -> Aabb;
}

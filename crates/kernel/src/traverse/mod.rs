//! Traversal: the entry points, each of which chooses the instruction set once per tile or batch.
mod ahead;
mod batch;
mod descent;
mod instances;
mod local;
mod packet;
mod quadrics;
mod settle;
mod shear;
mod single;
mod slab;
mod stack;
mod tile;

use fearless_simd::{Level, Simd, dispatch};

use crate::{
    layout::Child,
    object::Object,
    ray::{Hit, Ray},
    through::Shadows,
    tile::Tile,
};

/// An object, and the child of its triangle tree at which it is entered. All else in it is met only from the root.
type Within<'a> = (&'a Object, Child);

/// Runs a tile or packet kernel and returns from the function, if the level has vectors worth it; goes on otherwise. (Without
/// vectors 16 lanes are 16 instructions: the single-ray kernel is then faster, and the others would only cost
/// build time.)
macro_rules! dispatch_wide {
    ($level:expr, $simd:ident => $call:expr) => {
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            if let Some($simd) = $level.as_avx512() {
                return $simd.vectorize(
                    #[inline(always)]
                    || $call,
                );
            }
            if let Some($simd) = $level.as_avx2() {
                return $simd.vectorize(
                    #[inline(always)]
                    || $call,
                );
            }
            if let Some($simd) = $level.as_sse4_2() {
                return $simd.vectorize(
                    #[inline(always)]
                    || $call,
                );
            }
        }
        #[cfg(target_arch = "aarch64")]
        if let Some($simd) = $level.as_neon() {
            return $simd.vectorize(
                #[inline(always)]
                || $call,
            );
        }
        #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
        if let Some($simd) = $level.as_wasm_simd128() {
            return $simd.vectorize(
                #[inline(always)]
                || $call,
            );
        }
    };
}

pub(crate) fn intersect(level: Level, root: &Object, rays: &[Ray], hits: &mut [Hit]) {
    if batch::in_packets(root, rays.len()) {
        dispatch_wide!(level, simd => batch::intersect(simd, root, rays, hits));
    }
    dispatch!(level, simd => batch::intersect_singly(simd, root, rays, hits));
}

pub(crate) fn occluded(level: Level, root: &Object, rays: &[Ray], shadows: Shadows<'_>) {
    if batch::in_packets(root, rays.len()) {
        dispatch_wide!(level, simd => batch::occluded(simd, root, rays, shadows));
    }
    dispatch!(level, simd => batch::occluded_singly(simd, root, rays, shadows));
}

pub(crate) fn intersect_tile(level: Level, root: &Object, tile: &Tile, hits: &mut [Hit]) {
    // Rays of different times have no frustum in the space of something that moves.
    if !root.has_motion() {
        dispatch_wide!(level, simd => tile::intersect(simd, root, tile, hits));
    }
    for (i, hit) in hits.iter_mut().enumerate().take(tile.len()) {
        intersect(level, root, tile.ray(i).as_slice(), std::slice::from_mut(hit));
    }
}

pub(crate) fn occluded_tile(level: Level, root: &Object, tile: &Tile, mut shadows: Shadows<'_>) {
    if !root.has_motion() {
        dispatch_wide!(level, simd => tile::occluded(simd, root, tile, shadows));
    }
    for i in 0..tile.len().min(shadows.occluded.len()) {
        occluded(level, root, tile.ray(i).as_slice(), shadows.one(i));
    }
}

//! Traversal: the entry points, each of which chooses the instruction set once per tile or batch.
mod batch;
mod finish;
mod instances;
mod local;
mod shear;
mod single;
mod slab;
mod stack;

use fearless_simd::{Level, Simd, dispatch};

use crate::{
    object::Object,
    ray::{Hit, Ray},
    tile::Tile,
};

pub(crate) fn intersect(level: Level, root: &Object, rays: &[Ray], hits: &mut [Hit]) {
    dispatch!(level, simd => batch::intersect(simd, root, rays, hits));
}

pub(crate) fn occluded(level: Level, root: &Object, rays: &[Ray], occluded: &mut [bool]) {
    dispatch!(level, simd => batch::occluded(simd, root, rays, occluded));
}

pub(crate) fn intersect_tile(level: Level, root: &Object, tile: &Tile, hits: &mut [Hit]) {
    dispatch!(level, simd => intersect_tile_with(simd, root, tile, hits));
}

pub(crate) fn occluded_tile(level: Level, root: &Object, tile: &Tile, occluded: &mut [bool]) {
    dispatch!(level, simd => occluded_tile_with(simd, root, tile, occluded));
}

#[inline(always)]
fn intersect_tile_with<S: Simd>(simd: S, root: &Object, tile: &Tile, hits: &mut [Hit]) {
    let mut stack = stack::Stack::new();
    for (i, hit) in hits.iter_mut().enumerate().take(tile.len()) {
        if let Some(ray) = tile.ray(i) {
            *hit = batch::closest(simd, root, &ray, &mut stack);
        }
    }
}

#[inline(always)]
fn occluded_tile_with<S: Simd>(simd: S, root: &Object, tile: &Tile, occluded: &mut [bool]) {
    let mut stack = stack::Stack::new();
    for (i, out) in occluded.iter_mut().enumerate().take(tile.len()) {
        if let Some(ray) = tile.ray(i) {
            *out = batch::any(simd, root, &ray, &mut stack);
        }
    }
}

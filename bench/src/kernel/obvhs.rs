//! The crate `obvhs` as the second peer: PLOC builds and single rays through its compressed 8-wide tree.

use std::time::Duration;

use heliostat::kernel::glam::Vec3A;
use heliostat::kernel::{Mesh, Ray};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use super::rays::{Kind, Query, RaySet};
use crate::measure::{ITEM, Slots, Tracer};

/// As in the results.
pub(super) const NAME: &str = "obvhs 0.4.0";
/// What it is measured on.
pub(super) const KINDS: [Kind; 3] = [Kind::Primary, Kind::Diffuse, Kind::Ao];
/// Larger scenes would take minutes.
pub(super) const MOST_TRIANGLES: usize = 2_000_000;

/// Its presets that are measured, by name.
pub(super) fn presets() -> [(&'static str, BvhBuildParams); 3] {
    [
        ("fastest", BvhBuildParams::fastest_build()),
        ("medium", BvhBuildParams::medium_build()),
        ("slow", BvhBuildParams::slow_build()),
    ]
}

/// A mesh as it takes it.
pub(super) fn triangles(mesh: &Mesh) -> Vec<Triangle> {
    let corners = (0..mesh.indices.len()).filter_map(|i| mesh.corners(i));
    corners.map(|[a, b, c]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() }).collect()
}

/// Whether it can be asked for this mesh: not too large, and all numbers finite.
pub(super) fn takes(mesh: &Mesh) -> bool {
    let count = mesh.indices.len();
    count > 0 && count <= MOST_TRIANGLES && mesh.positions.iter().all(|p| p.is_finite())
}

/// Builds the compressed tree: the part that is timed.
pub(super) fn build(triangles: &[Triangle], preset: BvhBuildParams) -> CwBvh {
    build_cwbvh_from_tris(triangles, preset, &mut Duration::default())
}

/// The bytes of a tree with the triangles that traversal reads.
pub(super) fn bytes(bvh: &CwBvh) -> usize {
    size_of_val(&bvh.nodes[..]) + bvh.primitive_indices.len() * (size_of::<u32>() + size_of::<RtTriangle>())
}

/// A tree with triangles in its order.
pub(super) struct Tree {
    pub(super) preset: &'static str,
    bvh: CwBvh,
    triangles: Vec<RtTriangle>,
}

impl Tree {
    pub(super) fn new(triangles: &[Triangle], (preset, parameters): (&'static str, BvhBuildParams)) -> Self {
        let bvh = build(triangles, parameters);
        let triangles =
            bvh.primitive_indices.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect();
        Self { preset, bvh, triangles }
    }
}

/// Rays in its form, made beforehand.
pub(super) struct Rays {
    query: Query,
    items: Vec<Vec<obvhs::ray::Ray>>,
}

impl Rays {
    pub(super) fn new(set: &RaySet) -> Self {
        let convert = |ray: &Ray| {
            let (origin, direction) = (Vec3A::from(ray.origin), Vec3A::from(ray.direction));
            obvhs::ray::Ray::new(origin, direction, ray.t_min, ray.t_max)
        };
        let items = set.items.iter().map(|item| item.rays().iter().map(convert).collect()).collect();
        Self { query: set.kind.query(), items }
    }
}

/// A tree and the rays to ask it with.
pub(super) struct ObvhsRays<'a> {
    pub(super) tree: &'a Tree,
    pub(super) rays: &'a Rays,
}

impl Tracer for ObvhsRays<'_> {
    fn items(&self) -> usize {
        self.rays.items.len()
    }

    fn trace(&self, first: usize, count: usize, out: Slots<'_>) {
        let Tree { bvh, triangles, .. } = self.tree;
        let items = &self.rays.items[first..first + count];
        match self.rays.query {
            Query::Closest => {
                let slots = out.t.chunks_mut(ITEM).zip(out.primitive.chunks_mut(ITEM));
                for (rays, (t, primitive)) in items.iter().zip(slots) {
                    for ((ray, t), primitive) in rays.iter().zip(t).zip(primitive) {
                        let mut hit = RayHit::none();
                        let found = bvh.ray_traverse(*ray, &mut hit, |ray, id| triangles[id].intersect(ray));
                        let index = hit.primitive_id as usize;
                        (*t, *primitive) = if found {
                            (hit.t, bvh.primitive_indices[index])
                        } else {
                            (f32::INFINITY, u32::MAX)
                        };
                    }
                }
            }
            Query::Any => {
                for (rays, occluded) in items.iter().zip(out.occluded.chunks_mut(ITEM)) {
                    for (ray, occluded) in rays.iter().zip(occluded) {
                        *occluded = !bvh.ray_traverse_miss(*ray, |ray, id| triangles[id].intersect(ray));
                    }
                }
            }
        }
    }
}

//! Batches of unrelated rays.
use fearless_simd::Simd;

use super::{instances, local::LocalRay, stack::Stack};
use crate::{
    object::Object,
    ray::{Hit, PathId, Ray},
};

#[inline(always)]
pub(super) fn intersect<S: Simd>(simd: S, root: &Object, rays: &[Ray], hits: &mut [Hit]) {
    let mut stack = Stack::new();
    for (ray, hit) in rays.iter().zip(hits) {
        *hit = closest(simd, root, ray, &mut stack);
    }
}

#[inline(always)]
pub(super) fn occluded<S: Simd>(simd: S, root: &Object, rays: &[Ray], occluded: &mut [bool]) {
    let mut stack = Stack::new();
    for (ray, out) in rays.iter().zip(occluded) {
        *out = any(simd, root, ray, &mut stack);
    }
}

#[inline(always)]
pub(super) fn closest<S: Simd>(simd: S, root: &Object, ray: &Ray, stack: &mut Stack) -> Hit {
    let mut hit = Hit::MISS;
    if let Some(local) = LocalRay::new(ray) {
        hit.t = ray.t_max;
        if !instances::closest(simd, root, &local, PathId::ROOT, &mut hit, stack) {
            hit = Hit::MISS;
        }
    }
    hit
}

#[inline(always)]
pub(super) fn any<S: Simd>(simd: S, root: &Object, ray: &Ray, stack: &mut Stack) -> bool {
    match LocalRay::new(ray) {
        Some(local) => instances::any(simd, root, &local, ray.t_max, stack),
        None => false,
    }
}

/// A local ray in an object, for callers that have a kernel of their own around them: a call, not inlined twice.
#[inline(never)]
pub(super) fn closest_local<S: Simd>(
    simd: S,
    object: &Object,
    ray: &LocalRay,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    simd.vectorize(
        #[inline(always)]
        || instances::closest(simd, object, ray, path, hit, stack),
    )
}

/// As [`closest_local`], for any hit.
#[inline(never)]
pub(super) fn any_local<S: Simd>(
    simd: S,
    object: &Object,
    ray: &LocalRay,
    t_max: f32,
    stack: &mut Stack,
) -> bool {
    simd.vectorize(
        #[inline(always)]
        || instances::any(simd, object, ray, t_max, stack),
    )
}

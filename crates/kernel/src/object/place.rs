//! Placements: inverses in double precision, and the boxes of what is placed.
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec3};
use rayon::prelude::*;

use super::Instance;
use crate::{aabb::Aabb, build::boxes::PackedBox, error::BuildError, triangle_bvh::MAX_COORDINATE};

/// Placements per task.
const CHUNK: usize = 512;

/// What follows from an instance's transform.
#[derive(Clone, Copy)]
pub(super) struct Placement {
    pub object_from_parent: Affine3A,
    /// Carries normals up: the inverse transpose of the placement, up to a positive factor.
    pub normal_from_object: Mat3A,
    /// The box of what is placed, in the parent's space; empty if there is nothing, or nothing in range.
    pub bounds: PackedBox,
}

impl Placement {
    const NONE: Self = Self {
        object_from_parent: Affine3A::IDENTITY,
        normal_from_object: Mat3A::IDENTITY,
        bounds: PackedBox::EMPTY,
    };

    /// # Errors
    /// [`BuildError::NonFiniteTransform`] and [`BuildError::SingularTransform`], which name the instance as `index`.
    pub(super) fn new(instance: &Instance, index: usize) -> Result<Self, BuildError> {
        let (object_from_parent, normal_from_object) = invert(&instance.parent_from_object, index)?;
        let mut bounds = instance.object.bounds().transformed(&instance.parent_from_object);
        if let Some(end) = &instance.motion {
            invert(end, index)?;
            // Entries move linearly, so each point does: what it sweeps lies between the boxes at both ends.
            bounds = bounds.union(instance.object.bounds().transformed(end));
        }
        Ok(Self { object_from_parent, normal_from_object, bounds: packed(bounds) })
    }

    /// Whether directions stay as they are.
    pub(super) fn only_moved(&self) -> bool {
        self.object_from_parent.matrix3 == Mat3A::IDENTITY
    }
}

/// The placements of `count` instances, each given with the index that names it in errors; in order, on all threads.
///
/// # Errors
/// Those of the first bad one.
pub(super) fn all<'a>(
    count: usize,
    instance: impl Fn(usize) -> (usize, &'a Instance) + Sync,
) -> Result<Vec<Placement>, BuildError> {
    let one = |position| {
        let (index, instance) = instance(position);
        Placement::new(instance, index)
    };
    if count <= CHUNK {
        return (0..count).map(one).collect();
    }
    // Which error a thread meets first is left to chance: after one, the first in order is looked for.
    let bad = AtomicBool::new(false);
    let or_none = |position| {
        one(position).unwrap_or_else(|_| {
            bad.store(true, Ordering::Relaxed);
            Placement::NONE
        })
    };
    let placements = (0..count).into_par_iter().with_min_len(CHUNK).map(or_none).collect();
    if bad.into_inner() { (0..count).map(one).collect() } else { Ok(placements) }
}

/// Each entry on its way from one placement to another, which are met exactly at 0 and 1.
pub(crate) fn between(from: &Affine3A, to: &Affine3A, time: f32) -> Affine3A {
    Affine3A {
        matrix3: from.matrix3 * (1.0 - time) + to.matrix3 * time,
        translation: from.translation * (1.0 - time) + to.translation * time,
    }
}

/// Keeps boxes within the range in which the box test's arithmetic is finite; far things stay approximately there.
pub(super) fn packed(bounds: Aabb) -> PackedBox {
    let limit = Vec3::splat(MAX_COORDINATE);
    if bounds.is_empty() || bounds.min.cmpgt(limit).any() || bounds.max.cmplt(-limit).any() {
        return PackedBox::EMPTY;
    }
    PackedBox::new(bounds.min.max(-limit), bounds.max.min(limit), [0; 2])
}

/// The inverse of a placement and the matrix that carries normals up through it.
pub(super) fn invert(
    parent_from_object: &Affine3A,
    instance: usize,
) -> Result<(Affine3A, Mat3A), BuildError> {
    let not_finite = BuildError::NonFiniteTransform { instance };
    if !parent_from_object.is_finite() {
        return Err(not_finite);
    }
    let forward = double(parent_from_object);
    let determinant = forward.matrix3.determinant();
    // Zero up to the rounding of a single-precision matrix: a flattened direction is noise, not a shape.
    let scale =
        forward.matrix3.x_axis.length() * forward.matrix3.y_axis.length() * forward.matrix3.z_axis.length();
    if determinant.abs() <= 1.0e-14 * scale || determinant == 0.0 {
        return Err(BuildError::SingularTransform { instance });
    }
    let inverse = forward.inverse();
    let single =
        Affine3A { matrix3: inverse.matrix3.as_mat3().into(), translation: inverse.translation.as_vec3a() };
    if !single.is_finite() {
        return Err(not_finite);
    }
    Ok((single, normal_matrix(&inverse.matrix3)))
}

/// The transpose of an inverse, scaled so that its largest entry is 1: normals are normalised later, and only the
/// direction counts.
fn normal_matrix(inverse: &DMat3) -> Mat3A {
    let transpose = inverse.transpose();
    let largest = [transpose.x_axis, transpose.y_axis, transpose.z_axis]
        .iter()
        .fold(0.0_f64, |m, axis| m.max(axis.abs().max_element()));
    (transpose * (1.0 / largest)).as_mat3().into()
}

/// The same map in double precision.
pub(crate) fn double(m: &Affine3A) -> DAffine3 {
    let axis = |v: glam::Vec3A| -> DVec3 { Vec3::from(v).as_dvec3() };
    DAffine3 {
        matrix3: DMat3::from_cols(axis(m.matrix3.x_axis), axis(m.matrix3.y_axis), axis(m.matrix3.z_axis)),
        translation: axis(m.translation),
    }
}

//! What stands where: the parts of objects and their placements in the world.

use std::sync::Arc;

use glam::{Affine3A, Mat3A};
use heliostat_kernel::Aabb;
use heliostat_scene::{Attributes, Geometry, GeometryId, InstanceId, ObjectId};

use crate::reflectors::shape_bounds;

/// A geometry of an object with its material, as the shader tables hold it.
#[derive(Clone, Debug)]
pub struct ShadedPart {
    /// The shape with its attributes.
    pub shape: Geometry,
    /// Index into the material table.
    pub material: u32,
    /// The handle.
    pub geometry: GeometryId,
    /// The geometry's attributes.
    pub attributes: Arc<Attributes>,
    /// Around the shape over the whole shutter interval, object space.
    pub bounds: Aabb,
}

impl ShadedPart {
    /// A part with its bounds.
    pub fn new(shape: Geometry, material: u32, geometry: GeometryId, attributes: Arc<Attributes>) -> Self {
        let bounds = shape_bounds(&shape);
        Self { shape, material, geometry, attributes, bounds }
    }
}

/// One object at one place in the expanded tree of instances.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Accumulated over all instances on the way.
    pub world_from_object: Affine3A,
    /// Inverse transpose of the linear part: takes normals to world space, front sides to front sides.
    pub world_from_object_normal: Mat3A,
    /// Sum of the translations of the nested instances on the way, in world units. Rays are carried through them one by
    /// one, so their size adds to rounding errors even where they cancel out.
    pub detour: f32,
    /// The object.
    pub object: ObjectId,
    /// Innermost instance.
    pub instance: InstanceId,
    /// The object's place in the table of parts.
    pub parts: u32,
    /// What moves while the shutter is open, if anything does.
    pub motion: Option<Arc<Sweep>>,
}

/// The placements on the way from the world to an object when the shutter opens and when it closes, outermost
/// first. Each level changes linearly by itself, as in the kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep(pub Vec<[Affine3A; 2]>);

impl Sweep {
    /// World from object at `time` in [0, 1] of the shutter interval.
    pub fn world_from_object(&self, time: f32) -> Affine3A {
        self.0.iter().fold(Affine3A::IDENTITY, |world, [open, close]| world * mix(open, close, time))
    }
}

/// Between two transforms, entry by entry.
pub(crate) fn mix(open: &Affine3A, close: &Affine3A, time: f32) -> Affine3A {
    Affine3A {
        matrix3: open.matrix3 * (1.0 - time) + close.matrix3 * time,
        translation: open.translation * (1.0 - time) + close.translation * time,
    }
}

impl Placement {
    /// A placement with its derived transforms.
    pub fn new(
        world_from_object: Affine3A,
        detour: f32,
        object: ObjectId,
        instance: InstanceId,
        parts: u32,
    ) -> Self {
        let world_from_object_normal = world_from_object.matrix3.inverse().transpose();
        Self { world_from_object, world_from_object_normal, detour, object, instance, parts, motion: None }
    }

    /// The placement at `time` in [0, 1] of the shutter interval, if it moves.
    pub(crate) fn at(&self, time: f32) -> Option<Self> {
        let world_from_object = self.motion.as_ref()?.world_from_object(time);
        let Self { detour, object, instance, parts, .. } = *self;
        Some(Self::new(world_from_object, detour, object, instance, parts))
    }
}

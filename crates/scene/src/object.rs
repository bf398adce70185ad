//! Objects and where they stand.

use glam::Affine3A;

use crate::{GeometryId, MaterialId, ObjectId};

/// A thing that can be placed many times: parts of one accelerator, and the parent of further instances.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Object {
    /// For people; need not be unique.
    pub name: String,
    /// What it is made of. May be empty: then it only groups the instances placed in it.
    pub parts: Vec<Part>,
}

/// One geometry of an object with its material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// The shape.
    pub geometry: GeometryId,
    /// What it looks like.
    pub material: MaterialId,
}

/// One placement of an object, in the world or inside another object (to any depth; no cycles).
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// For people; need not be unique.
    pub name: String,
    /// What is placed.
    pub object: ObjectId,
    /// The object in which it is placed; `None` is the world.
    pub parent: Option<ObjectId>,
    /// Affine; mirroring and shear are allowed. A singular transform makes the instance invisible.
    pub parent_from_object: Affine3A,
    /// `parent_from_object` when the shutter closes; in between its entries change linearly. `None` stands still.
    pub motion: Option<Affine3A>,
    /// Invisible instances are not hit by any ray and emit nothing.
    pub visible: bool,
}

//! Objects: triangles and placed copies of other objects, nested to any depth up to a stated limit.
mod edit;
mod open;
mod place;
mod tree;
mod update;

use std::{fmt, sync::Arc};

use glam::{Affine3A, Mat3A};

pub(crate) use self::place::double;
pub use self::update::{InstanceChange, Update, UpdateKind};
use self::{place::Placement, tree::InstanceTree};
use crate::{
    aabb::Aabb, error::BuildError, layout::Child, quadric::Quadrics, triangle_bvh::TriangleBvh,
    triangles::Triangles,
};

/// The deepest nesting of instances.
pub const MAX_INSTANCE_DEPTH: usize = 64;

/// A placed copy of an object inside another one. The object itself is shared.
#[derive(Clone, Debug)]
pub struct Instance {
    /// What is placed.
    pub object: Arc<Object>,
    /// The placement: any invertible affine map, mirrored, sheared or scaled as it may be.
    pub parent_from_object: Affine3A,
    /// The placement when the shutter closes; `parent_from_object` is then the one when it opens, and in between the
    /// entries of the matrix are interpolated linearly. `None`: it does not move.
    pub motion: Option<Affine3A>,
    /// The caller's tag, handed back by [`World::resolve`](crate::World::resolve).
    pub id: u32,
}

impl Instance {
    /// The placement at a moment in the shutter interval, from 0 to 1.
    #[must_use]
    pub fn parent_from_object_at(&self, time: f32) -> Affine3A {
        match &self.motion {
            None => self.parent_from_object,
            Some(end) => place::between(&self.parent_from_object, end, time),
        }
    }

    /// Whether it, or anything in its object, moves while the shutter is open.
    fn has_motion(&self) -> bool {
        self.motion.is_some() || self.object.has_motion()
    }

    /// Whether rays can be carried through the placement: finite, invertible, with a finite inverse, at both ends of the
    /// shutter interval.
    #[must_use]
    pub fn is_placeable(&self) -> bool {
        Placement::new(self, 0).is_ok()
    }
}

/// Triangles, spheres and cones, and instances of other objects, in one space, shared by `Arc`: making or updating an object never
/// touches the trees of its children, only a small tree over their bounds. Where the box of a
/// child fits so badly that it pays, the tree is made over boxes of its parts instead, at which rays then enter it.
#[derive(Clone)]
pub struct Object {
    pub(crate) triangles: Option<Triangles>,
    pub(crate) quadrics: Option<Arc<Quadrics>>,
    pub(crate) instances: Vec<PlacedInstance>,
    pub(crate) instance_tree: InstanceTree,
    bounds: Aabb,
    depth: usize,
    path_count: u64,
    moving: bool,
}

/// An instance with what traversal needs beside it.
#[derive(Clone, Debug)]
pub(crate) struct PlacedInstance {
    pub instance: Instance,
    pub object_from_parent: Affine3A,
    /// Whether it is neither turned nor scaled: directions stay as they are.
    pub only_moved: bool,
    /// Carries normals up: the inverse transpose of the placement, up to a positive factor.
    pub normal_from_object: Mat3A,
    /// What the path id grows by on the way down.
    pub path_offset: u64,
}

impl PlacedInstance {
    /// The inverse of the placement at a moment in the shutter interval, and the matrix for normals; `None` where it
    /// has no inverse on its way between two that have.
    #[inline(never)]
    pub(crate) fn at(&self, time: f32) -> Option<(Affine3A, Mat3A)> {
        place::invert(&self.instance.parent_from_object_at(time), 0).ok()
    }
}

impl fmt::Debug for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Object")
            .field("triangles", &self.triangles)
            .field("quadrics", &self.quadrics)
            .field("instances", &self.instances.len())
            .field("bounds", &self.bounds)
            .field("depth", &self.depth)
            .field("path_count", &self.path_count)
            .finish_non_exhaustive()
    }
}

impl Object {
    /// An object of a triangle tree and instances; both may be absent.
    ///
    /// # Errors
    /// [`BuildError::NonFiniteTransform`], [`BuildError::SingularTransform`], [`BuildError::TooDeep`] past
    /// [`MAX_INSTANCE_DEPTH`], [`BuildError::TooManyPaths`] or [`BuildError::TooManyInstances`]; each names the
    /// instance.
    pub fn new(triangles: Option<Triangles>, instances: Vec<Instance>) -> Result<Self, BuildError> {
        let (count, limit) = (instances.len() as u64, TriangleBvh::MAX_TRIANGLES);
        if count > limit {
            return Err(BuildError::TooManyInstances { count, limit });
        }
        let (depth, _) = path_totals(instances.iter().map(|instance| &*instance.object))?;
        let placements = place::all(instances.len(), |index| (index, &instances[index]))?;
        let boxes = placements.iter().map(|placement| placement.bounds).collect();
        let placed = instances.into_iter().zip(placements).map(|(instance, placement)| PlacedInstance {
            instance,
            object_from_parent: placement.object_from_parent,
            only_moved: placement.only_moved(),
            normal_from_object: placement.normal_from_object,
            path_offset: 0,
        });
        let instances: Vec<_> = placed.collect();
        let instance_tree = InstanceTree::build(&instances, boxes);
        let mut object = Self { triangles, instances, instance_tree, depth, ..Self::empty() };
        object.number_paths();
        object.unite_bounds();
        object.look_for_motion();
        Ok(object)
    }

    /// An object with nothing in it.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            triangles: None,
            quadrics: None,
            instances: Vec::new(),
            instance_tree: InstanceTree::default(),
            bounds: Aabb::EMPTY,
            depth: 0,
            path_count: 1,
            moving: false,
        }
    }

    /// The box around everything in the object, its own space.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The object's own triangles, without those of its instances.
    #[must_use]
    pub fn triangles(&self) -> Option<&Triangles> {
        self.triangles.as_ref()
    }

    /// The object's own spheres and cones.
    #[must_use]
    pub fn quadrics(&self) -> Option<&Arc<Quadrics>> {
        self.quadrics.as_ref()
    }

    /// The object's instances, in the order given.
    pub fn instances(&self) -> impl ExactSizeIterator<Item = &Instance> {
        self.instances.iter().map(|placed| &placed.instance)
    }

    /// Levels of instances below this object: 0 without instances.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// Number of nodes of the expanded instance tree, this object included.
    #[must_use]
    pub fn path_count(&self) -> u64 {
        self.path_count
    }

    /// Whether anything in the object moves while the shutter is open, so that the times of rays count.
    #[must_use]
    pub fn has_motion(&self) -> bool {
        self.moving
    }

    /// What a leaf of the tree over the instances stands for: an instance, and where its triangle tree is entered.
    #[inline(always)]
    pub(crate) fn behind(&self, leaf: Child) -> (&PlacedInstance, Child) {
        let index = leaf.payload() as usize;
        match self.instance_tree.entries.get(index) {
            Some(entry) => (&self.instances[entry.instance as usize], entry.child),
            None => (&self.instances[index], Child::ROOT),
        }
    }

    fn look_for_motion(&mut self) {
        self.moving = self.triangles.as_ref().is_some_and(Triangles::has_motion)
            || self.instances.iter().any(|placed| placed.instance.has_motion());
    }

    /// Gives each instance its place in the order of path ids; the total is known not to overflow.
    fn number_paths(&mut self) {
        self.path_count = 1;
        for placed in &mut self.instances {
            placed.path_offset = self.path_count;
            self.path_count += placed.instance.object.path_count;
        }
    }

    fn unite_bounds(&mut self) {
        let own = self.triangles.as_ref().map_or(Aabb::EMPTY, Triangles::bounds);
        let shapes = self.quadrics.as_ref().map_or(Aabb::EMPTY, |quadrics| quadrics.bounds());
        self.bounds = own.union(shapes).union(self.instance_tree.bounds());
    }
}

/// Depth and number of paths of an object with these children.
fn path_totals<'a>(children: impl Iterator<Item = &'a Object>) -> Result<(usize, u64), BuildError> {
    let (mut depth, mut paths) = (0, 1_u64);
    for (instance, child) in children.enumerate() {
        depth = depth.max(child.depth + 1);
        if child.depth >= MAX_INSTANCE_DEPTH {
            let limit = MAX_INSTANCE_DEPTH;
            return Err(BuildError::TooDeep { instance, depth: child.depth + 1, limit });
        }
        paths = paths.checked_add(child.path_count).ok_or(BuildError::TooManyPaths { instance })?;
    }
    Ok((depth, paths))
}

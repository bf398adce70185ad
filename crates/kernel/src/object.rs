//! Objects: triangles and placed copies of other objects, nested to any depth up to a stated limit.
use std::{fmt, sync::Arc};

use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec3};

use crate::{
    aabb::Aabb,
    build::{
        self, BuildOptions,
        binary::LeafRule,
        binned,
        boxes::PackedBox,
        watch::Watch,
        wide::{self, WideTree},
    },
    error::BuildError,
    layout::Child,
    triangle_bvh::{MAX_COORDINATE, TriangleBvh},
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
    /// Whether rays can be carried through the placement: finite, invertible, with a finite inverse.
    #[must_use]
    pub fn is_placeable(&self) -> bool {
        invert(&self.parent_from_object, 0).is_ok()
    }
}

/// Triangles, instances of other objects, or both, in one space. Immutable and shared by `Arc`: making an object
/// never rebuilds the trees of its children, only a small tree over their bounds.
pub struct Object {
    pub(crate) triangles: Option<Triangles>,
    pub(crate) instances: Vec<PlacedInstance>,
    pub(crate) instance_tree: WideTree,
    bounds: Aabb,
    depth: usize,
    path_count: u64,
}

/// An instance with what traversal needs beside it.
#[derive(Debug)]
pub(crate) struct PlacedInstance {
    pub instance: Instance,
    pub object_from_parent: Affine3A,
    /// Carries normals up: the inverse transpose of the placement, up to a positive factor.
    pub normal_from_object: Mat3A,
    /// What the path id grows by on the way down.
    pub path_offset: u64,
}

impl fmt::Debug for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Object")
            .field("triangles", &self.triangles)
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
        let mut placed = Vec::with_capacity(instances.len());
        let mut prims = Vec::with_capacity(instances.len());
        let mut bounds = triangles.as_ref().map_or(Aabb::EMPTY, Triangles::bounds);
        let (mut depth, mut path_count) = (0, 1_u64);
        for (index, instance) in instances.into_iter().enumerate() {
            let child = Arc::clone(&instance.object);
            depth = depth.max(child.depth + 1);
            if child.depth >= MAX_INSTANCE_DEPTH {
                let limit = MAX_INSTANCE_DEPTH;
                return Err(BuildError::TooDeep { instance: index, depth: child.depth + 1, limit });
            }
            let path_offset = path_count;
            path_count = path_count
                .checked_add(child.path_count)
                .ok_or(BuildError::TooManyPaths { instance: index })?;
            let (object_from_parent, normal_from_object) = invert(&instance.parent_from_object, index)?;
            let child_bounds = clamp(child.bounds.transformed(&instance.parent_from_object));
            if !child_bounds.is_empty() {
                prims.push(PackedBox::primitive(child_bounds.min, child_bounds.max, index as u32));
                bounds = bounds.union(child_bounds);
            }
            placed.push(PlacedInstance { instance, object_from_parent, normal_from_object, path_offset });
        }
        let instance_tree = instance_tree(&mut prims);
        Ok(Self { triangles, instances: placed, instance_tree, bounds, depth, path_count })
    }

    /// An object with nothing in it.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            triangles: None,
            instances: Vec::new(),
            instance_tree: WideTree::default(),
            bounds: Aabb::EMPTY,
            depth: 0,
            path_count: 1,
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
}

/// Keeps boxes within the range in which the box test's arithmetic is finite; far things stay approximately there.
fn clamp(bounds: Aabb) -> Aabb {
    let limit = Vec3::splat(MAX_COORDINATE);
    if bounds.is_empty() || bounds.min.cmpgt(limit).any() || bounds.max.cmplt(-limit).any() {
        return Aabb::EMPTY;
    }
    Aabb::new(bounds.min.max(-limit), bounds.max.min(limit))
}

fn instance_tree(prims: &mut [PackedBox]) -> WideTree {
    if prims.is_empty() {
        return WideTree::default();
    }
    // Entering an instance costs a transform and at least one node: far more than a step here.
    let options = BuildOptions { intersection_cost: 4.0, ..BuildOptions::default() };
    let (level, watch) = (build::level(), Watch::new(&()));
    let rule = LeafRule { max: 1, block_shift: 0 };
    let nodes = binned::build(level, prims, rule, &options, &watch);
    let (mut tree, places) = wide::collapse(level, &nodes, rule, options.intersection_cost, &watch);
    // A block is one instance here, and the leaf names it.
    let leaves = tree.nodes.iter_mut().flat_map(|node| &mut node.child);
    for leaf in leaves.filter(|child| child.is_leaf() && **child != Child::NONE) {
        let (place, _) = places[leaf.block_range().0];
        *leaf = Child::leaf(prims[place as usize].id());
    }
    tree
}

/// The inverse of a placement and the matrix that carries normals up through it.
fn invert(parent_from_object: &Affine3A, instance: usize) -> Result<(Affine3A, Mat3A), BuildError> {
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

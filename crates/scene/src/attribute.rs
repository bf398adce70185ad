//! Values over a geometry that parameters of shaders can take.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::Vec3;

use crate::Geometry;

/// The attributes of a geometry by name.
pub type Attributes = BTreeMap<String, Attribute>;

/// A quantity over a geometry: one value for all of it, one per primitive, or one per vertex. Shared by reference: cloning
/// is cheap.
///
/// It belongs to a [`GeometryId`](crate::GeometryId) and not to the mesh behind it. So it can change without the mesh, stays
/// when the mesh deforms, and two geometries that share a mesh can differ in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// What each value is for.
    pub scope: AttributeScope,
    /// The values, finite.
    pub values: AttributeValues,
}

/// What each value of an attribute is for; as many are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum AttributeScope {
    /// One value for the whole geometry.
    Object,
    /// One per triangle, sphere or cone, in the order of the geometry.
    Primitive,
    /// One per vertex of a mesh; triangles interpolate linearly.
    Vertex,
}

/// Values of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum AttributeValues {
    /// Numbers. Vectors and colours take them for all components.
    Floats(Arc<[f32]>),
    /// Vectors, or linear Rec. 709 RGB colours. Numbers take the first component.
    Vectors(Arc<[Vec3]>),
}

impl Attribute {
    /// Values of a scope.
    pub fn new(scope: AttributeScope, values: impl Into<AttributeValues>) -> Self {
        Self { scope, values: values.into() }
    }

    /// One number for the whole geometry.
    pub fn float(value: f32) -> Self {
        Self::new(AttributeScope::Object, vec![value])
    }

    /// One vector or colour for the whole geometry.
    pub fn vector(value: Vec3) -> Self {
        Self::new(AttributeScope::Object, vec![value])
    }

    /// What is wrong with the values, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        self.values.first_bad().map(|bad| format!("value {bad} is not finite; give finite numbers"))
    }

    /// Why it cannot be one of a geometry, if it cannot.
    pub(crate) fn misfit(&self, geometry: &Geometry) -> Option<String> {
        let (wanted, each) = match (self.scope, geometry) {
            (AttributeScope::Object, _) => (1, "one for the whole geometry"),
            (AttributeScope::Primitive, _) => (geometry.primitives(), "one per primitive"),
            (AttributeScope::Vertex, Geometry::Mesh(mesh)) => (mesh.positions.len(), "one per vertex"),
            (AttributeScope::Vertex, Geometry::Quadrics(_)) => {
                return Some("spheres and cones have no vertices; give one value per primitive".into());
            }
        };
        let len = self.values.len();
        (len != wanted).then(|| format!("{len} values for a geometry that takes {wanted}, {each}"))
    }
}

impl AttributeValues {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Floats(values) => values.len(),
            Self::Vectors(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether all are finite, as those of attributes must be.
    pub fn is_finite(&self) -> bool {
        self.first_bad().is_none()
    }

    /// The first that is not finite.
    fn first_bad(&self) -> Option<usize> {
        match self {
            Self::Floats(values) => values.iter().position(|value| !value.is_finite()),
            Self::Vectors(values) => values.iter().position(|value| !value.is_finite()),
        }
    }

    /// A value as a vector; numbers have three equal components.
    #[inline]
    pub fn get(&self, index: usize) -> Option<Vec3> {
        match self {
            Self::Floats(values) => values.get(index).copied().map(Vec3::splat),
            Self::Vectors(values) => values.get(index).copied(),
        }
    }
}

impl From<Vec<f32>> for AttributeValues {
    fn from(values: Vec<f32>) -> Self {
        Self::Floats(values.into())
    }
}

impl From<Vec<Vec3>> for AttributeValues {
    fn from(values: Vec<Vec3>) -> Self {
        Self::Vectors(values.into())
    }
}

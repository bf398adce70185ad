//! Shapes in object space.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};

use crate::Quadrics;

/// A shape in object space, shared by reference: cloning is cheap.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// Indexed triangles.
    Mesh(Arc<Mesh>),
    /// Spheres and cones.
    Quadrics(Arc<Quadrics>),
}

impl Geometry {
    /// The triangles, if it is made of them.
    pub fn as_mesh(&self) -> Option<&Arc<Mesh>> {
        match self {
            Self::Mesh(mesh) => Some(mesh),
            Self::Quadrics(_) => None,
        }
    }

    /// Number of triangles or shapes.
    pub fn primitives(&self) -> usize {
        match self {
            Self::Mesh(mesh) => mesh.indices.len(),
            Self::Quadrics(quadrics) => quadrics.shapes.len(),
        }
    }

    /// What is inconsistent in itself, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        match self {
            Self::Mesh(mesh) => mesh.inconsistency(),
            Self::Quadrics(quadrics) => quadrics.inconsistency(),
        }
    }
}

/// An indexed triangle mesh with optional attributes per vertex.
///
/// Front faces are those whose vertices appear counter-clockwise. Attribute arrays are either empty (absent) or
/// as long as `positions`. Positions are in metres, object space; triangles with a vertex that is not finite
/// are never hit.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, object space, metres.
    pub positions: Arc<[Vec3]>,
    /// Three vertex indices per triangle.
    pub indices: Arc<[[u32; 3]]>,
    /// Vertex positions when the shutter closes; in between they move linearly. Empty (absent) stands still.
    pub motion: Arc<[Vec3]>,
    /// Shading normals; they need not be unit length.
    pub normals: Vec<Vec3>,
    /// Tangents: xyz along increasing u of `uvs[0]`; w = ±1 gives the bitangent `w (n × t)`.
    pub tangents: Vec<Vec4>,
    /// Two sets of texture coordinates; (0, 0) is the image's top left corner.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA that multiplies the base colour.
    pub colors: Vec<Vec4>,
}

impl Mesh {
    /// A mesh of positions and triangles without further attributes.
    pub fn new(positions: Vec<Vec3>, indices: Vec<[u32; 3]>) -> Self {
        Self { positions: positions.into(), indices: indices.into(), ..Self::default() }
    }

    /// The parallelogram `corner + s·edge_u + t·edge_v`, s, t ∈ [0, 1], facing `edge_u × edge_v`, with texture
    /// coordinates whose v runs downwards as in images.
    pub fn quad(corner: Vec3, edge_u: Vec3, edge_v: Vec3) -> Self {
        let positions = vec![corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v];
        let mut mesh = Self::new(positions, vec![[0, 1, 2], [0, 2, 3]]);
        mesh.uvs[0] =
            vec![Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0), Vec2::new(0.0, 0.0)];
        mesh
    }

    /// This mesh, moving to the positions of `end` while the shutter is open. Shading normals stay.
    pub(crate) fn moving_to(&self, end: &Self) -> Self {
        Self { motion: end.positions.clone(), ..self.clone() }
    }

    /// What makes the arrays inconsistent with each other, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        let vertices = self.positions.len();
        let attributes = [
            ("motion", self.motion.len()),
            ("normals", self.normals.len()),
            ("tangents", self.tangents.len()),
            ("uvs[0]", self.uvs[0].len()),
            ("uvs[1]", self.uvs[1].len()),
            ("colors", self.colors.len()),
        ];
        for (name, len) in attributes {
            if len != 0 && len != vertices {
                return Some(format!(
                    "`{name}` has {len} entries for {vertices} positions; give one per position or none"
                ));
            }
        }
        if u32::try_from(vertices).is_err() || u32::try_from(self.indices.len()).is_err() {
            return Some("more than 2^32 vertices or triangles; split the mesh".into());
        }
        let bad = self.indices.iter().position(|t| t.iter().any(|&i| i as usize >= vertices))?;
        Some(format!("triangle {bad} uses indices {:?} of {vertices} vertices", self.indices[bad]))
    }
}

//! Collects polygons, spheres and cones into one geometry per material and kind of attributes.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
use heliostat_scene::{GeometryId, MaterialId, Mesh, Quadric, SceneBuilder};

use super::statement::Polygon;
use crate::triangulate::Triangulator;

/// What triangles of one mesh have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Kind {
    pub(crate) material: MaterialId,
    pub(crate) smooth: bool,
    pub(crate) textured: bool,
}

/// A mesh that grows.
#[derive(Default)]
pub(crate) struct Growing {
    pub(crate) positions: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) uvs: Vec<Vec2>,
    pub(crate) indices: Vec<[u32; 3]>,
}

/// The shapes of one object.
#[derive(Default)]
pub(crate) struct Shapes {
    meshes: Vec<(Kind, Growing)>,
    by_kind: HashMap<Kind, usize>,
    quadrics: Vec<(MaterialId, Vec<Quadric>)>,
    by_material: HashMap<MaterialId, usize>,
    triangulator: Triangulator,
}

impl Shapes {
    pub(crate) fn is_empty(&self) -> bool {
        self.meshes.is_empty() && self.quadrics.is_empty()
    }

    /// The mesh that takes triangles of this kind.
    pub(crate) fn mesh(&mut self, kind: Kind) -> &mut Growing {
        let index = *self.by_kind.entry(kind).or_insert_with(|| {
            self.meshes.push((kind, Growing::default()));
            self.meshes.len() - 1
        });
        &mut self.meshes[index].1
    }

    /// Adds a polygon; with normals it is shaded smoothly.
    pub(crate) fn polygon(&mut self, material: MaterialId, polygon: &Polygon) {
        let kind = Kind { material, smooth: !polygon.normals.is_empty(), textured: false };
        let mut triangulator = std::mem::take(&mut self.triangulator);
        let mesh = self.mesh(kind);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend_from_slice(&polygon.corners);
        mesh.normals.extend_from_slice(&polygon.normals);
        triangulator.triangulate(&polygon.corners, |t| mesh.indices.push(t.map(|i| first + i)));
        self.triangulator = triangulator;
    }

    /// Adds a sphere or cone.
    pub(crate) fn quadric(&mut self, material: MaterialId, shape: Quadric) {
        let index = *self.by_material.entry(material).or_insert_with(|| {
            self.quadrics.push((material, Vec::new()));
            self.quadrics.len() - 1
        });
        self.quadrics[index].1.push(shape);
    }

    /// The parts of an object.
    pub(crate) fn finish(self, builder: &mut SceneBuilder) -> Vec<(GeometryId, MaterialId)> {
        let mut parts = Vec::with_capacity(self.meshes.len() + self.quadrics.len());
        for (kind, mesh) in self.meshes {
            let geometry = builder.mesh(Mesh {
                normals: mesh.normals,
                uvs: [mesh.uvs, Vec::new()],
                ..Mesh::new(mesh.positions, mesh.indices)
            });
            parts.push((geometry, kind.material));
        }
        for (material, shapes) in self.quadrics {
            parts.push((builder.quadrics(shapes), material));
        }
        parts
    }
}

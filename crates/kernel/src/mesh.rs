//! The triangle mesh that the kernel reads; shared, never copied.
use std::sync::Arc;

use glam::Vec3;

/// An indexed triangle mesh in object space. Cloning shares the arrays.
///
/// Triangles with a vertex that is not finite or has a coordinate beyond ±1e10, and those with zero area, are kept in the numbering but never hit.
/// So are those of a moving mesh for which that holds when the shutter opens or when it closes.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions, object space.
    pub positions: Arc<[Vec3]>,
    /// Three vertex indices per triangle, counter-clockwise as seen from the front.
    pub indices: Arc<[[u32; 3]]>,
    /// Vertex positions when the shutter closes, object space, as many as `positions`, which then hold those when it
    /// opens; in between each vertex moves along a line at constant speed. `None`: nothing moves.
    pub motion: Option<Arc<[Vec3]>>,
}

impl Mesh {
    /// A mesh of the given arrays that does not move; nothing is checked until a tree is built over it.
    #[must_use]
    pub fn new(positions: impl Into<Arc<[Vec3]>>, indices: impl Into<Arc<[[u32; 3]]>>) -> Self {
        Self { positions: positions.into(), indices: indices.into(), motion: None }
    }

    /// The mesh when the shutter closes: it shares the arrays and does not move.
    #[must_use]
    pub fn closing(&self) -> Self {
        let positions = Arc::clone(self.motion.as_ref().unwrap_or(&self.positions));
        Self { positions, indices: Arc::clone(&self.indices), motion: None }
    }

    /// As [`Mesh::corners`], at a moment in the shutter interval from 0 to 1.
    #[must_use]
    pub fn corners_at(&self, index: usize, time: f32) -> Option<[Vec3; 3]> {
        let opening = self.corners(index)?;
        let closing =
            if self.motion.is_some() { self.closing().corners(index)? } else { return Some(opening) };
        let [a, b, c] = [0, 1, 2].map(|k| opening[k] * (1.0 - time) + closing[k] * time);
        Some([a, b, c])
    }

    /// The three corners of triangle `index` when the shutter opens, or `None` if it or one of its vertices does not exist.
    #[must_use]
    pub fn corners(&self, index: usize) -> Option<[Vec3; 3]> {
        let [a, b, c] = *self.indices.get(index)?;
        let vertex = |i: u32| self.positions.get(i as usize).copied();
        Some([vertex(a)?, vertex(b)?, vertex(c)?])
    }
}

//! Morph targets and skins, at rest: the pose that the document's nodes and weights describe.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", sections 3.7.2.2 (morph targets) and 3.7.3 (skins).

use glam::{Affine3A, Mat3A, Mat4, Vec3, Vec3A, Vec4};

use super::Loader;
use super::json;
use super::mesh::Vertices;
use super::nodes::Forest;
use crate::error::LoadError;

/// `world_from_bind` for each joint of a skin.
pub(super) struct Pose(Vec<Affine3A>);

impl Loader<'_, '_> {
    /// The matrices of a skin's joints where the nodes stand.
    pub(super) fn pose(&mut self, skin: usize, user: &str, forest: &Forest) -> Result<Pose, LoadError> {
        let definition = self.item(&self.root.skins, "skins", skin, user)?;
        let path = format!("skins[{skin}]");
        let inverse_bind = match definition.inverse_bind_matrices {
            Some(accessor) => {
                let user = format!("{path}.inverseBindMatrices");
                let matrices = self.read_floats(accessor, &user, &["MAT4"], [0.0; 16])?;
                if matrices.len() < definition.joints.len() {
                    let problem =
                        format!("{} matrices for {} joints", matrices.len(), definition.joints.len());
                    return Err(LoadError::input(self.place(&user), problem, "give one matrix per joint"));
                }
                matrices.iter().map(|m| Affine3A::from_mat4(Mat4::from_cols_array(m))).collect()
            }
            None => vec![Affine3A::IDENTITY; definition.joints.len()],
        };
        let mut joints = Vec::new();
        for (&joint, bind) in definition.joints.iter().zip(inverse_bind) {
            self.item(&self.root.nodes, "nodes", joint, &format!("{path}.joints"))?;
            joints.push(forest.world[joint] * bind);
        }
        Ok(Pose(joints))
    }

    /// Adds the weighted displacements of the morph targets.
    pub(super) fn morph(
        &mut self,
        primitive: &json::Primitive,
        path: &str,
        weights: &[f32],
        vertices: &mut Vertices,
    ) -> Result<(), LoadError> {
        let count = vertices.positions.len();
        for (number, (target, &weight)) in primitive.targets.iter().zip(weights).enumerate() {
            if weight == 0.0 {
                continue;
            }
            for (name, is_position) in [("POSITION", true), ("NORMAL", false)] {
                let Some(&accessor) = target.get(name) else { continue };
                let values = if is_position { &mut vertices.positions } else { &mut vertices.normals };
                if values.is_empty() {
                    continue;
                }
                let user = format!("{path}.targets[{number}].{name}");
                let moved = self.read_floats(accessor, &user, &["VEC3"], [0.0; 3])?;
                self.check_count(&user, moved.len(), count)?;
                for (value, delta) in values.iter_mut().zip(moved) {
                    *value += weight * Vec3::from_array(delta);
                }
            }
        }
        Ok(())
    }

    /// Moves vertices by the mean of their joints' matrices.
    pub(super) fn skin(
        &mut self,
        primitive: &json::Primitive,
        path: &str,
        pose: &Pose,
        vertices: &mut Vertices,
    ) -> Result<(), LoadError> {
        let count = vertices.positions.len();
        // Sums of matrices and of weights.
        self.context.charge_array(count, 80, &self.place(path))?;
        let mut matrices = vec![Affine3A::ZERO; count];
        let mut sums = vec![0.0f32; count];
        for set in 0.. {
            let name = format!("JOINTS_{set}");
            let Some(&accessor) = primitive.attributes.get(&name) else { break };
            let user = format!("{path}.attributes.{name}");
            let joints = self.read_integers::<4>(accessor, &user, &["VEC4"])?;
            self.check_count(&user, joints.len(), count)?;
            let name = format!("WEIGHTS_{set}");
            let to_vec = Vec4::from_array;
            let weights =
                self.attribute(&primitive.attributes, &name, path, &["VEC4"], [0.0; 4], count, to_vec)?;
            for (vertex, (joints, weights)) in joints.iter().zip(weights).enumerate() {
                for (&joint, weight) in joints.iter().zip(weights.to_array()) {
                    if weight == 0.0 {
                        continue;
                    }
                    let Some(matrix) = pose.0.get(joint as usize) else {
                        let problem = format!("joint {joint} of a skin with {}", pose.0.len());
                        return Err(LoadError::input(self.place(&user), problem, "joints count from 0"));
                    };
                    matrices[vertex].matrix3 += matrix.matrix3 * weight;
                    matrices[vertex].translation += matrix.translation * weight;
                    sums[vertex] += weight;
                }
            }
        }
        for (vertex, (matrix, sum)) in matrices.iter().zip(sums).enumerate() {
            // Weights should add up to one; a vertex without any stays where it is.
            if sum > 0.0 {
                let scale = 1.0 / sum;
                let mean =
                    Affine3A { matrix3: matrix.matrix3 * scale, translation: matrix.translation * scale };
                move_vertex(vertices, vertex, &mean);
            }
        }
        Ok(())
    }
}

fn move_vertex(vertices: &mut Vertices, vertex: usize, matrix: &Affine3A) {
    vertices.positions[vertex] = matrix.transform_point3(vertices.positions[vertex]);
    if let Some(normal) = vertices.normals.get_mut(vertex) {
        let moved = cofactors(&matrix.matrix3) * Vec3A::from(*normal);
        *normal = Vec3::from(moved).normalize_or_zero();
    }
    if let Some(tangent) = vertices.tangents.get_mut(vertex) {
        let moved = matrix.transform_vector3(tangent.truncate()).normalize_or_zero();
        *tangent = moved.extend(tangent.w);
    }
}

/// The matrix for normals: the inverse transpose times the absolute determinant, which exists for every matrix.
fn cofactors(m: &Mat3A) -> Mat3A {
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    Mat3A::from_cols(y.cross(z) * sign, z.cross(x) * sign, x.cross(y) * sign)
}

//! Morph targets and skins: a primitive as the file has it, and the mesh that weights and joints bend it into.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", sections 3.7.2.2 (morph targets) and 3.7.3 (skins).

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Mat4, Vec3, Vec3A, Vec4};
use heliostat_scene::Mesh;

use super::Loader;
use super::json;
use crate::error::LoadError;

/// A primitive before deformation, with what bends it.
pub(super) struct Shape {
    pub(super) base: Mesh,
    pub(super) targets: Vec<MorphTarget>,
    pub(super) influences: Option<Influences>,
}

/// Displacements per vertex; absent ones are empty.
#[derive(Default)]
pub(super) struct MorphTarget {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    tangents: Vec<Vec3>,
}

/// Which joints each vertex follows. Shares of a vertex add up to one.
pub(super) struct Influences {
    /// Where the joints of each vertex end in `shares`.
    ends: Vec<u32>,
    shares: Vec<(u32, f32)>,
}

/// A skin: what its matrices are made of.
pub(super) struct Skin {
    /// Nodes.
    pub(super) joints: Vec<usize>,
    pub(super) joint_from_bind: Vec<Affine3A>,
}

impl Skin {
    /// `world_from_bind` of each joint, from where the joints stand.
    pub(super) fn matrices(&self, world_from_joint: impl Iterator<Item = Affine3A>) -> Vec<Affine3A> {
        world_from_joint.zip(&self.joint_from_bind).map(|(joint, bind)| joint * *bind).collect()
    }
}

impl Shape {
    /// The mesh at these weights of its targets (missing ones are 0) and these matrices of its joints. Its triangles
    /// are the shape's own, shared.
    pub(super) fn deform(&self, weights: &[f32], joints: &[Affine3A]) -> Mesh {
        self.bend(self.base.clone(), weights, joints)
    }

    /// As [`Self::deform`], for a shape that is used once.
    pub(super) fn into_mesh(mut self, weights: &[f32], joints: &[Affine3A]) -> Mesh {
        let base = std::mem::take(&mut self.base);
        self.bend(base, weights, joints)
    }

    fn bend(&self, mut mesh: Mesh, weights: &[f32], joints: &[Affine3A]) -> Mesh {
        for (target, &weight) in self.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
            target.add(weight, &mut mesh);
        }
        if let Some(influences) = &self.influences {
            influences.bend(joints, &mut mesh);
        }
        mesh
    }
}

impl MorphTarget {
    fn add(&self, weight: f32, mesh: &mut Mesh) {
        let moved = |values: &mut [Vec3], deltas: &[Vec3]| {
            values.iter_mut().zip(deltas).for_each(|(value, delta)| *value += weight * *delta);
        };
        if !self.positions.is_empty() {
            moved(Arc::make_mut(&mut mesh.positions), &self.positions);
        }
        moved(&mut mesh.normals, &self.normals);
        for (tangent, delta) in mesh.tangents.iter_mut().zip(&self.tangents) {
            *tangent += weight * delta.extend(0.0);
        }
    }
}

impl Influences {
    /// Moves vertices by the mean of their joints' matrices. A vertex without joints stays where it is.
    fn bend(&self, joints: &[Affine3A], mesh: &mut Mesh) {
        let positions = Arc::make_mut(&mut mesh.positions);
        let mut start = 0;
        for (vertex, &end) in self.ends.iter().enumerate() {
            let shares = &self.shares[start..end as usize];
            start = end as usize;
            if shares.is_empty() {
                continue;
            }
            let mut mean = Affine3A::ZERO;
            for &(joint, share) in shares {
                let matrix = &joints[joint as usize];
                mean.matrix3 += matrix.matrix3 * share;
                mean.translation += matrix.translation * share;
            }
            positions[vertex] = mean.transform_point3(positions[vertex]);
            if let Some(normal) = mesh.normals.get_mut(vertex) {
                let moved = cofactors(&mean.matrix3) * Vec3A::from(*normal);
                *normal = Vec3::from(moved).normalize_or_zero();
            }
            if let Some(tangent) = mesh.tangents.get_mut(vertex) {
                let moved = mean.transform_vector3(tangent.truncate()).normalize_or_zero();
                *tangent = moved.extend(tangent.w);
            }
        }
    }
}

/// The matrix for normals: the inverse transpose times the absolute determinant, which exists for every matrix.
fn cofactors(m: &Mat3A) -> Mat3A {
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis];
    let first = y.cross(z);
    let sign = if x.dot(first) < 0.0 { -1.0 } else { 1.0 };
    Mat3A::from_cols(first * sign, z.cross(x) * sign, x.cross(y) * sign)
}

impl Loader<'_, '_> {
    /// A skin, read once however many nodes use it.
    pub(super) fn skin(&mut self, skin: usize, user: &str) -> Result<Arc<Skin>, LoadError> {
        if let Some(known) = self.skins.get(&skin) {
            return Ok(known.clone());
        }
        let definition = self.item(&self.root.skins, "skins", skin, user)?;
        let path = format!("skins[{skin}]");
        let joint_from_bind = match definition.inverse_bind_matrices {
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
        for &joint in &definition.joints {
            self.item(&self.root.nodes, "nodes", joint, &format!("{path}.joints"))?;
        }
        let skin_read = Arc::new(Skin { joints: definition.joints.clone(), joint_from_bind });
        self.skins.insert(skin, skin_read.clone());
        Ok(skin_read)
    }

    /// Reads the morph targets that `wanted` says; the others stay empty.
    pub(super) fn morph_targets(
        &mut self,
        primitive: &json::Primitive,
        path: &str,
        base: &Mesh,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Vec<MorphTarget>, LoadError> {
        let count = base.positions.len();
        let mut targets = Vec::new();
        for (number, target) in primitive.targets.iter().enumerate() {
            let mut read = MorphTarget::default();
            let attributes = [
                ("POSITION", &mut read.positions, false),
                ("NORMAL", &mut read.normals, base.normals.is_empty()),
                ("TANGENT", &mut read.tangents, base.tangents.is_empty()),
            ];
            for (name, deltas, useless) in attributes {
                if !wanted(number) || useless {
                    continue;
                }
                let path = format!("{path}.targets[{number}]");
                let Some(&accessor) = target.get(name) else { continue };
                let user = format!("{path}.{name}");
                let moved = self.read_floats(accessor, &user, &["VEC3"], [0.0; 3])?;
                self.check_count(&user, moved.len(), count)?;
                *deltas = moved.into_iter().map(Vec3::from_array).collect();
            }
            targets.push(read);
        }
        Ok(targets)
    }

    /// Reads which of a skin's `joints` each of the vertices follows.
    pub(super) fn influences(
        &mut self,
        primitive: &json::Primitive,
        path: &str,
        joints: usize,
        count: usize,
    ) -> Result<Influences, LoadError> {
        let mut sets = Vec::new();
        for set in 0.. {
            let name = format!("JOINTS_{set}");
            let Some(&accessor) = primitive.attributes.get(&name) else { break };
            let user = format!("{path}.attributes.{name}");
            let numbers = self.read_integers::<4>(accessor, &user, &["VEC4"])?;
            self.check_count(&user, numbers.len(), count)?;
            let name = format!("WEIGHTS_{set}");
            let weights = self.attribute(
                &primitive.attributes,
                &name,
                path,
                &["VEC4"],
                [0.0; 4],
                count,
                Vec4::from_array,
            )?;
            let used = numbers.iter().zip(&weights).flat_map(|(n, w)| n.iter().zip(w.to_array()));
            if let Some((bad, _)) = used.clone().find(|&(&n, weight)| weight != 0.0 && n as usize >= joints) {
                let problem = format!("joint {bad} of a skin with {joints}");
                return Err(LoadError::input(self.place(&user), problem, "joints count from 0"));
            }
            sets.push((numbers, weights));
        }
        let shares = count.saturating_mul(4 * sets.len());
        self.context.charge_array(count, 4, &self.place(path))?;
        self.context.charge_array(shares, 8, &self.place(path))?;
        let mut influences = Influences { ends: Vec::with_capacity(count), shares: Vec::new() };
        for vertex in 0..count {
            let of_set = |(numbers, weights): &(Vec<[u32; 4]>, Vec<Vec4>)| {
                // A set without weights moves nothing.
                let weights = weights.get(vertex).copied().unwrap_or(Vec4::ZERO).to_array();
                std::array::from_fn::<_, 4, _>(|i| (numbers[vertex][i], weights[i]))
            };
            let all = || sets.iter().flat_map(of_set).filter(|(_, weight)| *weight != 0.0);
            let sum: f32 = all().map(|(_, weight)| weight).sum();
            // Weights should add up to one; a vertex without any follows no joint.
            if sum > 0.0 {
                influences.shares.extend(all().map(|(joint, weight)| (joint, weight / sum)));
            }
            // The sum of all is below 2³²: it was counted as memory.
            influences.ends.push(influences.shares.len() as u32);
        }
        Ok(influences)
    }
}

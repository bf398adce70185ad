//! Meshes: primitives to parts of objects.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3, Vec4};
use heliostat_scene::{Attribute, AttributeScope, AttributeValues, Mesh, ObjectId};

use super::Loader;
use super::deform::{Shape, Skin};
use super::json;
use super::nodes::Forest;
use super::rig::BentMesh;
use crate::error::LoadError;

/// What bends the mesh at a node.
struct Bending<'a> {
    node: usize,
    /// Rest weights of the morph targets.
    weights: &'a [f32],
    skin: Option<(usize, Arc<Skin>)>,
    /// Matrices of the skin's joints at rest.
    joints: Vec<Affine3A>,
    /// Whether any of it changes.
    moves: bool,
}

impl Loader<'_, '_> {
    /// The object of a mesh without skin; shared between nodes unless the node has morph weights of its own.
    pub(super) fn mesh_object(&mut self, node: usize, mesh: usize) -> Result<Option<ObjectId>, LoadError> {
        let moves = self.animated.weights.contains(&node);
        let own_weights = self.root.nodes[node].weights.as_deref();
        let shared = own_weights.is_none() && !moves;
        if let (true, Some(&known)) = (shared, self.objects.get(&mesh)) {
            return Ok(known);
        }
        let user = format!("nodes[{node}].mesh");
        let definition = self.item(&self.root.meshes, "meshes", mesh, &user)?;
        let weights = own_weights.or(definition.weights.as_deref()).unwrap_or_default();
        let bending = Bending { node, weights, skin: None, joints: Vec::new(), moves };
        let object = self.object(mesh, definition, &bending)?;
        if shared {
            self.objects.insert(mesh, object);
        }
        Ok(object)
    }

    /// The object of a mesh as a skin bends it, in world space.
    pub(super) fn skinned_object(
        &mut self,
        node: usize,
        mesh: usize,
        skin: usize,
        forest: &Forest,
    ) -> Result<Option<ObjectId>, LoadError> {
        let user = format!("nodes[{node}]");
        let definition = self.item(&self.root.meshes, "meshes", mesh, &user)?;
        let own_weights = self.root.nodes[node].weights.as_deref();
        let weights = own_weights.or(definition.weights.as_deref()).unwrap_or_default();
        let read = self.skin(skin, &user)?;
        let joints = read.matrices(read.joints.iter().map(|&joint| forest.world[joint]));
        let moves = self.animated.weights.contains(&node)
            || read.joints.iter().any(|&joint| forest.moving[joint].is_some());
        self.object(mesh, definition, &Bending { node, weights, skin: Some((skin, read)), joints, moves })
    }

    fn object(
        &mut self,
        mesh: usize,
        definition: &json::Mesh,
        bending: &Bending<'_>,
    ) -> Result<Option<ObjectId>, LoadError> {
        let mut parts = Vec::new();
        for (number, primitive) in definition.primitives.iter().enumerate() {
            let path = format!("meshes[{mesh}].primitives[{number}]");
            let Some(shape) = self.shape(mesh, number, primitive, &path, bending)? else { continue };
            let material = self.material(primitive.material, &path)?;
            let attributes = self.own_attributes(primitive, &path, shape.base.positions.len())?;
            let geometry = match Arc::try_unwrap(shape) {
                Ok(shape) => self.builder.mesh(shape.into_mesh(bending.weights, &bending.joints)),
                Err(kept) => {
                    let geometry = self.builder.mesh(kept.deform(bending.weights, &bending.joints));
                    let skin = bending.skin.as_ref().map(|(skin, _)| *skin);
                    self.stage.meshes.push(BentMesh { geometry, shape: kept, skin, node: bending.node });
                    geometry
                }
            };
            for (name, attribute) in attributes {
                self.builder.attribute(geometry, name, attribute);
            }
            parts.push((geometry, material));
        }
        if parts.is_empty() {
            return Ok(None);
        }
        if bending.moves {
            let targets = self.targets_of(bending.node);
            self.context.charge_array(targets, 8, &self.place(&format!("nodes[{}]", bending.node)))?;
            let mut weights = bending.weights.to_vec();
            weights.resize(targets, 0.0);
            self.stage.weights.insert(bending.node, weights);
        }
        let name = definition.name.clone().unwrap_or_else(|| format!("mesh {mesh}"));
        Ok(Some(self.builder.object(name, parts)))
    }

    /// A primitive's shape. Those that change are kept, for nodes that share a mesh.
    fn shape(
        &mut self,
        mesh: usize,
        number: usize,
        primitive: &json::Primitive,
        path: &str,
        bending: &Bending<'_>,
    ) -> Result<Option<Arc<Shape>>, LoadError> {
        let key = (mesh, number, bending.skin.as_ref().map(|(skin, _)| *skin));
        if let Some(known) = self.shapes.get(&key).filter(|_| bending.moves) {
            let known = known.clone();
            let (vertices, triangles) = (known.base.positions.len(), known.base.indices.len());
            self.context.count_mesh(vertices, triangles, &self.place(path))?;
            // Attributes of the copy.
            self.context.charge_array(vertices, 60, &self.place(path))?;
            return Ok(Some(known));
        }
        let Some(base) = self.primitive(primitive, path)? else { return Ok(None) };
        let wanted = |target: usize| bending.moves || bending.weights.get(target).is_some_and(|&w| w != 0.0);
        let targets = self.morph_targets(primitive, path, &base, wanted)?;
        let influences = match &bending.skin {
            Some((_, skin)) => {
                Some(self.influences(primitive, path, skin.joints.len(), base.positions.len())?)
            }
            None => None,
        };
        let shape = Arc::new(Shape { base, targets, influences });
        if bending.moves {
            self.shapes.insert(key, shape.clone());
        }
        Ok(Some(shape))
    }

    /// A primitive as the file has it; `None` for what is not made of triangles.
    fn primitive(&mut self, primitive: &json::Primitive, path: &str) -> Result<Option<Mesh>, LoadError> {
        let mode = primitive.mode.unwrap_or(4);
        if mode < 4 {
            let message = "points and lines are not shown";
            self.context.warn(self.place(path), message, "give them a surface");
            return Ok(None);
        }
        let Some(&position) = primitive.attributes.get("POSITION") else {
            let message = "the primitive has no POSITION attribute and is not shown";
            self.context.warn(self.place(path), message, "add positions");
            return Ok(None);
        };
        let positions =
            self.read_floats(position, &format!("{path}.attributes.POSITION"), &["VEC3"], [0.0; 3])?;
        let count = positions.len();
        let attributes = &primitive.attributes;
        let normals =
            self.attribute(attributes, "NORMAL", path, &["VEC3"], [0.0; 3], count, Vec3::from_array)?;
        let mut tangents =
            self.attribute(attributes, "TANGENT", path, &["VEC4"], [0.0; 4], count, Vec4::from_array)?;
        if normals.is_empty() {
            // Tangents without normals are to be ignored.
            tangents = Vec::new();
        }
        let mut uv =
            |name| self.attribute(attributes, name, path, &["VEC2"], [0.0; 2], count, Vec2::from_array);
        let uvs = [uv("TEXCOORD_0")?, uv("TEXCOORD_1")?];
        let to_color =
            |c: [f32; 4]| Vec4::from_array(c.map(|v| if v.is_nan() { 1.0 } else { v.clamp(0.0, 1.0) }));
        let colors =
            self.attribute(attributes, "COLOR_0", path, &["VEC3", "VEC4"], [1.0; 4], count, to_color)?;
        let indices = self.triangles(primitive, path, mode, count)?;
        Ok(Some(Mesh {
            motion: [].into(),
            positions: positions.into_iter().map(Vec3::from_array).collect(),
            indices: indices.into(),
            normals,
            tangents,
            uvs,
            colors,
        }))
    }

    /// The attributes whose meaning is the application's own, which have names that begin with an underscore.
    fn own_attributes(
        &mut self,
        primitive: &json::Primitive,
        path: &str,
        count: usize,
    ) -> Result<Vec<(String, Attribute)>, LoadError> {
        let mut attributes = Vec::new();
        for (name, &accessor) in primitive.attributes.iter().filter(|(name, _)| name.starts_with('_')) {
            let user = format!("{path}.attributes.{name}");
            let values: AttributeValues = match self.accessor(accessor, &user)?.shape.as_str() {
                "SCALAR" => {
                    self.read_floats::<1>(accessor, &user, &["SCALAR"], [0.0])?.into_flattened().into()
                }
                "VEC3" => {
                    let values = self.read_floats(accessor, &user, &["VEC3"], [0.0; 3])?;
                    values.into_iter().map(Vec3::from_array).collect::<Vec<_>>().into()
                }
                other => {
                    let message = format!("the attribute is of type {other} and is not read");
                    self.context.warn(self.place(&user), message, "shaders take SCALAR and VEC3");
                    continue;
                }
            };
            self.check_count(&user, values.len(), count)?;
            if !values.is_finite() {
                let message = "the attribute has values that are not finite and is not read";
                self.context.warn(self.place(&user), message, "give finite numbers");
                continue;
            }
            attributes.push((name.clone(), Attribute::new(AttributeScope::Vertex, values)));
        }
        Ok(attributes)
    }

    /// An optional attribute with one element per vertex; empty if absent.
    #[expect(clippy::too_many_arguments, reason = "each names one thing about the attribute")]
    pub(super) fn attribute<const N: usize, T>(
        &mut self,
        attributes: &BTreeMap<String, usize>,
        name: &str,
        path: &str,
        shapes: &[&str],
        missing: [f32; N],
        count: usize,
        convert: impl Fn([f32; N]) -> T,
    ) -> Result<Vec<T>, LoadError> {
        let Some(&accessor) = attributes.get(name) else { return Ok(Vec::new()) };
        let user = format!("{path}.attributes.{name}");
        let values = self.read_floats(accessor, &user, shapes, missing)?;
        self.check_count(&user, values.len(), count)?;
        Ok(values.into_iter().map(convert).collect())
    }

    /// Refuses attributes that do not have one element per vertex.
    pub(super) fn check_count(&self, user: &str, found: usize, vertices: usize) -> Result<(), LoadError> {
        if found == vertices {
            return Ok(());
        }
        let problem = format!("{found} elements for {vertices} positions");
        let hint = "all attributes of a primitive have the same `count`";
        Err(LoadError::input(self.place(user), problem, hint))
    }

    fn triangles(
        &mut self,
        primitive: &json::Primitive,
        path: &str,
        mode: u32,
        vertices: usize,
    ) -> Result<Vec<[u32; 3]>, LoadError> {
        let given = match primitive.indices {
            Some(accessor) => {
                let user = format!("{path}.indices");
                let indices = self.read_integers::<1>(accessor, &user, &["SCALAR"])?.into_flattened();
                if let Some(bad) = indices.iter().find(|&&index| index as usize >= vertices) {
                    let problem = format!("index {bad} of {vertices} vertices");
                    return Err(LoadError::input(self.place(&user), problem, "indices count from 0"));
                }
                Some(indices)
            }
            None => None,
        };
        let count = given.as_ref().map_or(vertices, Vec::len);
        let triangles = if mode == 4 { count / 3 } else { count.saturating_sub(2) };
        self.context.count_mesh(vertices, triangles, &self.place(path))?;
        if mode == 4 && !count.is_multiple_of(3) {
            let message = format!("{count} indices are not a multiple of three");
            self.context.warn(self.place(path), message, "the last ones were ignored");
        }
        // There are fewer than 2^32 vertices: `Limits::vertices` and the accessor have been checked.
        let at = |i: usize| given.as_ref().map_or(i as u32, |indices| indices[i]);
        let triangles = (0..triangles).map(|i| match mode {
            4 => [at(3 * i), at(3 * i + 1), at(3 * i + 2)],
            5 if i.is_multiple_of(2) => [at(i), at(i + 1), at(i + 2)],
            5 => [at(i + 1), at(i), at(i + 2)],
            _ => [at(i + 1), at(i + 2), at(0)],
        });
        match mode {
            4 => Ok(triangles.collect()),
            // Strips repeat vertices in order to jump.
            5 | 6 => Ok(triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect()),
            _ => {
                let problem = format!("`mode` is {mode}");
                Err(LoadError::input(self.place(path), problem, "modes are 0 to 6; 4 is triangles"))
            }
        }
    }
}

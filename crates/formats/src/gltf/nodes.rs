//! The node hierarchy: from a forest of nodes to objects, groups and instances.

use glam::{Affine3A, Mat4, Quat, Vec3};
use heliostat_scene::ObjectId;

use super::Loader;
use super::json::Node;
use crate::error::LoadError;

/// Groups nest this deep; deeper ones are flattened. The kernel follows 64 levels of instances.
const MAX_GROUPS: usize = 48;

/// All nodes, checked to form a forest.
pub(super) struct Forest {
    /// Every node after its parent.
    order: Vec<usize>,
    has_parent: Vec<bool>,
    local: Vec<Affine3A>,
    pub(super) world: Vec<Affine3A>,
}

/// A node whose turn to be placed has come.
struct Pending {
    node: usize,
    parent: Option<ObjectId>,
    parent_from_above: Affine3A,
    groups: usize,
}

impl Loader<'_, '_> {
    /// Places everything that the document's scene shows.
    pub(super) fn scene(&mut self) -> Result<(), LoadError> {
        let forest = self.forest()?;
        let roots = self.roots(&forest)?;
        let mut shown = vec![false; self.root.nodes.len()];
        let mut stack = roots.clone();
        while let Some(node) = stack.pop() {
            if !std::mem::replace(&mut shown[node], true) {
                stack.extend(&self.root.nodes[node].children);
            }
        }
        let mut objects = vec![None; self.root.nodes.len()];
        for &node in forest.order.iter().filter(|&&node| shown[node]) {
            objects[node] = self.contents(node, &forest)?;
        }
        self.place_all(&forest, &roots, &objects)
    }

    /// Makes what stands at a node: cameras, lights and skinned meshes in the world, and the object of an
    /// ordinary mesh, which is returned.
    fn contents(&mut self, node: usize, forest: &Forest) -> Result<Option<ObjectId>, LoadError> {
        let Node { name, mesh, skin, camera, extensions, .. } = &self.root.nodes[node];
        let path = format!("nodes[{node}]");
        let world = forest.world[node];
        if let Some(camera) = camera {
            self.camera(*camera, name.as_deref(), world, &path)?;
        }
        if let Some(reference) = &extensions.light {
            self.light(reference.light, name.as_deref(), world, &path)?;
        }
        match (mesh, skin) {
            (Some(mesh), Some(skin)) => {
                // Skinned vertices are in world space; the node's own transform does not count.
                let object = self.skinned_object(node, *mesh, *skin, forest)?;
                if let Some(object) = object {
                    let name = name.clone().unwrap_or_default();
                    self.builder.place(name, object, None, Affine3A::IDENTITY);
                }
                Ok(None)
            }
            (Some(mesh), None) => self.mesh_object(node, *mesh),
            (None, _) => Ok(None),
        }
    }

    fn place_all(
        &mut self,
        forest: &Forest,
        roots: &[usize],
        objects: &[Option<ObjectId>],
    ) -> Result<(), LoadError> {
        let nodes = &self.root.nodes;
        let mut shows = vec![false; nodes.len()];
        for &node in forest.order.iter().rev() {
            shows[node] = objects[node].is_some() || nodes[node].children.iter().any(|&child| shows[child]);
        }
        let pending = |parent, parent_from_above, groups| {
            move |&node: &usize| Pending { node, parent, parent_from_above, groups }
        };
        let mut stack: Vec<Pending> = roots.iter().rev().map(pending(None, Affine3A::IDENTITY, 0)).collect();
        while let Some(Pending { node, parent, parent_from_above, groups }) = stack.pop() {
            let children = nodes[node].children.iter().filter(|&&child| shows[child]);
            let count = children.clone().count() + usize::from(objects[node].is_some());
            if count == 0 {
                continue;
            }
            let name = nodes[node].name.clone().unwrap_or_default();
            let transform = parent_from_above * forest.local[node];
            self.check_finite(node, &transform)?;
            let (inside, from_node, groups) = if count == 1 || groups >= MAX_GROUPS {
                (parent, transform, groups)
            } else {
                let group = self.builder.object(name.as_str(), []);
                self.builder.place(name.as_str(), group, parent, transform);
                (Some(group), Affine3A::IDENTITY, groups + 1)
            };
            if let Some(object) = objects[node] {
                self.builder.place(name, object, inside, from_node);
            }
            stack.extend(children.rev().map(pending(inside, from_node, groups)));
        }
        Ok(())
    }

    /// The nodes at the top of the scene.
    fn roots(&mut self, forest: &Forest) -> Result<Vec<usize>, LoadError> {
        let scene = match self.root.scene {
            Some(index) => Some((index, self.item(&self.root.scenes, "scenes", index, "scene")?)),
            None => self.root.scenes.first().map(|scene| (0, scene)),
        };
        let Some((index, scene)) = scene else {
            return Ok((0..self.root.nodes.len()).filter(|&node| !forest.has_parent[node]).collect());
        };
        let path = format!("scenes[{index}].nodes");
        let mut listed = vec![false; self.root.nodes.len()];
        let mut roots = Vec::new();
        for &node in &scene.nodes {
            self.item(&self.root.nodes, "nodes", node, &path)?;
            if forest.has_parent[node] || std::mem::replace(&mut listed[node], true) {
                let message = format!("nodes[{node}] is no root node or is listed twice");
                self.context.warn(self.place(&path), message, "this entry was ignored");
            } else {
                roots.push(node);
            }
        }
        Ok(roots)
    }

    /// Checks that every node has one parent at most and that there are no cycles, and multiplies transforms.
    fn forest(&mut self) -> Result<Forest, LoadError> {
        let nodes = &self.root.nodes;
        let limit = self.context.limits.nodes;
        if nodes.len() as u64 > limit {
            return Err(LoadError::limit(self.place("nodes"), "nodes", nodes.len() as u64, "nodes", limit));
        }
        self.context.charge_array(nodes.len(), 256, &self.place("nodes"))?;
        let mut parent = vec![None; nodes.len()];
        for (number, node) in nodes.iter().enumerate() {
            let path = format!("nodes[{number}].children");
            for &child in &node.children {
                self.item(nodes, "nodes", child, &path)?;
                if let Some(other) = parent[child].replace(number) {
                    let problem = format!("nodes[{child}] is already a child of nodes[{other}]");
                    let hint = "a node has one parent; copy the node, or share its mesh";
                    return Err(LoadError::input(self.place(&path), problem, hint));
                }
            }
        }
        let local = nodes.iter().enumerate().map(|(i, n)| self.local(i, n)).collect::<Result<Vec<_>, _>>()?;
        let mut order: Vec<usize> = (0..nodes.len()).filter(|&node| parent[node].is_none()).collect();
        let mut world = local.clone();
        let mut depth = vec![1u64; nodes.len()];
        let mut next = 0;
        while next < order.len() {
            let node = order[next];
            for &child in &nodes[node].children {
                world[child] = world[node] * local[child];
                self.check_finite(child, &world[child])?;
                depth[child] = depth[node] + 1;
                order.push(child);
            }
            next += 1;
        }
        let (deepest, limit) = (depth.iter().copied().max().unwrap_or(0), self.context.limits.nesting);
        if deepest > limit {
            return Err(LoadError::limit(self.place("nodes"), "levels of nodes", deepest, "nesting", limit));
        }
        if order.len() < nodes.len() {
            let mut reached = vec![false; nodes.len()];
            order.iter().for_each(|&node| reached[node] = true);
            let node = reached.iter().position(|r| !r).unwrap_or(0);
            let problem = "the node is its own ancestor";
            let hint = "remove one of the `children` entries that close the cycle";
            return Err(LoadError::input(self.place(&format!("nodes[{node}]")), problem, hint));
        }
        Ok(Forest { order, has_parent: parent.iter().map(Option::is_some).collect(), local, world })
    }

    fn local(&self, number: usize, node: &Node) -> Result<Affine3A, LoadError> {
        let transform = match &node.matrix {
            Some(matrix) => Affine3A::from_mat4(Mat4::from_cols_array(matrix)),
            None => {
                let rotation = Quat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
                let length = rotation.length();
                // A rotation of length 0 says nothing; the identity is what exporters that write it mean.
                let rotation = if length > 0.0 { rotation / length } else { Quat::IDENTITY };
                let scale = node.scale.map_or(Vec3::ONE, Vec3::from_array);
                let translation = node.translation.map_or(Vec3::ZERO, Vec3::from_array);
                Affine3A::from_scale_rotation_translation(scale, rotation, translation)
            }
        };
        self.check_finite(number, &transform)?;
        Ok(transform)
    }

    fn check_finite(&self, node: usize, transform: &Affine3A) -> Result<(), LoadError> {
        if transform.is_finite() {
            return Ok(());
        }
        let problem = "the node's transform is not finite";
        Err(LoadError::input(self.place(&format!("nodes[{node}]")), problem, "give smaller numbers"))
    }
}

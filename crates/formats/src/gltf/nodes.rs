//! The node hierarchy: from a forest of nodes to objects, groups and instances.

use glam::{Affine3A, Mat4, Quat, Vec3};
use heliostat_scene::{InstanceId, ObjectId};

use super::Loader;
use super::json::{Node, NodeExtras};
use super::track::unit;
use crate::error::LoadError;

/// Groups nest this deep; deeper ones are flattened. The kernel follows 64 levels of instances.
const MAX_GROUPS: usize = 48;

/// All nodes, checked to form a forest, at rest.
pub(super) struct Forest {
    /// Every node after its parent.
    pub(super) order: Vec<usize>,
    pub(super) parent: Vec<Option<usize>>,
    pub(super) local: Vec<Local>,
    pub(super) world: Vec<Affine3A>,
    /// Whether the node and all above it are shown.
    pub(super) visible: Vec<bool>,
    /// Nodes that some animation changes, in themselves or through a node above, numbered in `order`.
    pub(super) moving: Vec<Option<usize>>,
}

/// A node's own transform.
#[derive(Clone, Copy)]
pub(super) enum Local {
    Matrix(Affine3A),
    Parts { translation: Vec3, rotation: Quat, scale: Vec3 },
}

impl Local {
    fn of(node: &Node) -> Self {
        match &node.matrix {
            Some(matrix) => Self::Matrix(Affine3A::from_mat4(Mat4::from_cols_array(matrix))),
            None => Self::Parts {
                translation: node.translation.map_or(Vec3::ZERO, Vec3::from_array),
                // Exporters that write a rotation of length 0 mean none.
                rotation: node.rotation.map_or(Quat::IDENTITY, |q| unit(Quat::from_array(q))),
                scale: node.scale.map_or(Vec3::ONE, Vec3::from_array),
            },
        }
    }

    /// `parent_from_node`.
    pub(super) fn matrix(&self) -> Affine3A {
        match *self {
            Self::Matrix(matrix) => matrix,
            Self::Parts { translation, rotation, scale } => {
                Affine3A::from_scale_rotation_translation(scale, rotation, translation)
            }
        }
    }
}

/// Where a node stands in the object that holds its instance, and whether it is shown there.
#[derive(Clone, Copy)]
pub(super) struct InGroup {
    pub(super) transform: Affine3A,
    pub(super) visible: bool,
}

impl InGroup {
    /// Of what stands in the world or in a group right away.
    pub(super) const TOP: Self = Self { transform: Affine3A::IDENTITY, visible: true };

    /// That of a node in this one.
    pub(super) fn child(&self, parent_from_node: &Affine3A, visible: bool) -> Self {
        Self { transform: self.transform * *parent_from_node, visible: self.visible && visible }
    }
}

/// A node whose turn to be placed has come.
struct Pending {
    node: usize,
    parent: Option<ObjectId>,
    above: InGroup,
    groups: usize,
}

impl Loader<'_, '_> {
    /// Places everything that the document's scene shows; returns the nodes.
    pub(super) fn scene(&mut self) -> Result<Forest, LoadError> {
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
        self.place_all(&forest, &roots, &objects)?;
        Ok(forest)
    }

    /// Makes what stands at a node: cameras, lights and skinned meshes in the world, and the object of an
    /// ordinary mesh, which is returned.
    fn contents(&mut self, node: usize, forest: &Forest) -> Result<Option<ObjectId>, LoadError> {
        let Node { name, mesh, skin, camera, extensions, extras, .. } = &self.root.nodes[node];
        let path = format!("nodes[{node}]");
        if let Some(camera) = camera {
            self.camera(*camera, name.as_deref(), (node, forest), &path)?;
        }
        if let Some(reference) = &extensions.light {
            self.light(reference.light, name.as_deref(), (node, forest), &path)?;
        }
        if let Some(reference) = &extensions.light_profile {
            self.profile_light(reference, name.as_deref(), (node, forest), &path)?;
        }
        if let Some(NodeExtras::Ours { heliostat_projector, heliostat_light }) = extras.as_deref() {
            if let Some(projector) = heliostat_projector {
                self.projector(projector, name.as_deref(), (node, forest), &path)?;
            }
            if let Some(light) = heliostat_light {
                self.shaded_light(light, name.as_deref(), (node, forest), &path);
            }
        }
        match (mesh, skin) {
            (Some(mesh), Some(skin)) => {
                // Skinned vertices are in world space; the node's own transform does not count.
                let object = self.skinned_object(node, *mesh, *skin, forest)?;
                if let Some(object) = object {
                    let name = name.clone().unwrap_or_default();
                    let instance = self.builder.place(name, object, None, Affine3A::IDENTITY);
                    self.show(instance, forest.visible[node]);
                    self.stage.skinned.push((instance, node));
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
        let pending = |parent, above, groups| move |&node: &usize| Pending { node, parent, above, groups };
        let mut stack: Vec<Pending> = roots.iter().rev().map(pending(None, InGroup::TOP, 0)).collect();
        while let Some(Pending { node, parent, above, groups }) = stack.pop() {
            let children = nodes[node].children.iter().filter(|&&child| shows[child]);
            let count = children.clone().count() + usize::from(objects[node].is_some());
            if count == 0 {
                continue;
            }
            let name = nodes[node].name.clone().unwrap_or_default();
            let stands = above.child(&forest.local[node].matrix(), nodes[node].is_visible());
            self.check_finite(node, &stands.transform)?;
            let opens_group = count > 1 && groups < MAX_GROUPS;
            let (inside, here, groups) = if opens_group {
                let group = self.builder.object(name.as_str(), []);
                let instance = self.builder.place(name.as_str(), group, parent, stands.transform);
                self.show(instance, stands.visible);
                self.stage.stand(forest, node, above, Some(instance), true);
                (Some(group), InGroup::TOP, groups + 1)
            } else {
                (parent, stands, groups)
            };
            let mut instance = None;
            if let Some(object) = objects[node] {
                let placed = self.builder.place(name, object, inside, here.transform);
                self.show(placed, here.visible);
                instance = Some(placed);
            }
            if !opens_group {
                self.stage.stand(forest, node, above, instance, false);
            }
            stack.extend(children.rev().map(pending(inside, here, groups)));
        }
        Ok(())
    }

    /// Hides an instance that is just placed, if it is to be hidden.
    fn show(&mut self, instance: InstanceId, visible: bool) {
        if !visible {
            self.builder.show(instance, false);
        }
    }

    /// The nodes at the top of the scene.
    fn roots(&mut self, forest: &Forest) -> Result<Vec<usize>, LoadError> {
        let scene = match self.root.scene {
            Some(index) => Some((index, self.item(&self.root.scenes, "scenes", index, "scene")?)),
            None => self.root.scenes.first().map(|scene| (0, scene)),
        };
        let Some((index, scene)) = scene else {
            return Ok((0..self.root.nodes.len()).filter(|&node| forest.parent[node].is_none()).collect());
        };
        let path = format!("scenes[{index}].nodes");
        let mut listed = vec![false; self.root.nodes.len()];
        let mut roots = Vec::new();
        for &node in &scene.nodes {
            self.item(&self.root.nodes, "nodes", node, &path)?;
            if forest.parent[node].is_some() || std::mem::replace(&mut listed[node], true) {
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
        self.context.charge_array(nodes.len(), 320, &self.place("nodes"))?;
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
        let local: Vec<Local> = nodes.iter().map(Local::of).collect();
        let mut world: Vec<Affine3A> = local.iter().map(Local::matrix).collect();
        for (node, matrix) in world.iter().enumerate() {
            self.check_finite(node, matrix)?;
        }
        let mut visible: Vec<bool> = nodes.iter().map(Node::is_visible).collect();
        let mut moving = vec![None; nodes.len()];
        let mut moving_count = 0;
        let mut order: Vec<usize> = (0..nodes.len()).filter(|&node| parent[node].is_none()).collect();
        let mut depth = vec![1u64; nodes.len()];
        let mut next = 0;
        while next < order.len() {
            let node = order[next];
            let above_moves = parent[node].is_some_and(|above: usize| moving[above].is_some());
            if above_moves || self.animated.nodes.contains(&node) {
                moving[node] = Some(moving_count);
                moving_count += 1;
            }
            for &child in &nodes[node].children {
                world[child] = world[node] * world[child];
                visible[child] &= visible[node];
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
        Ok(Forest { order, parent, local, world, visible, moving })
    }

    fn check_finite(&self, node: usize, transform: &Affine3A) -> Result<(), LoadError> {
        if transform.is_finite() {
            return Ok(());
        }
        let problem = "the node's transform is not finite";
        Err(LoadError::input(self.place(&format!("nodes[{node}]")), problem, "give smaller numbers"))
    }
}

impl Node {
    pub(super) fn is_visible(&self) -> bool {
        self.extensions.visibility.as_ref().is_none_or(|visibility| visibility.visible)
    }
}

//! From nodes to objects and instances: few levels, and each moving thing one instance.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use glam::{Affine3A, DAffine3};
use heliostat_scene::{GeometryId, InstanceId, MaterialId, Mesh, ObjectId};

use super::mesh::{Deforming, DeformingMeshes};
use super::motion::{Chain, DeformingMesh, Step};
use super::reader::Reader;
use crate::error::LoadError;
use crate::nff::shapes::Shapes;
use crate::place::Place;

/// Levels of instances; the kernel follows 64.
const MAX_LEVELS: usize = 48;

/// A block or an included file.
#[derive(Default)]
pub(super) struct Node {
    pub(super) shapes: Shapes,
    pub(super) deforming: DeformingMeshes,
    pub(super) children: Vec<Child>,
}

/// A node inside another one.
pub(super) struct Child {
    pub(super) node: usize,
    pub(super) way: Way,
}

/// How a child stands in its parent.
pub(super) enum Way {
    Fixed(DAffine3),
    /// By the keyframes of this name.
    Named(String),
}

impl Node {
    /// Whether it has no shapes of its own.
    pub(super) fn is_empty(&self) -> bool {
        self.shapes.is_empty() && self.deforming.meshes.is_empty()
    }
}

/// What an object will be made of.
#[derive(Default)]
struct Contents {
    shapes: Vec<Shapes>,
    deforming: Vec<(MaterialId, Deforming)>,
    placed: Vec<(Chain, usize)>,
}

/// One pass over the graph.
struct Placing<'r, 'c, 'a> {
    reader: &'r mut Reader<'c, 'a>,
    file: &'r Arc<str>,
    /// How often each node stands in others.
    uses: Vec<u32>,
    /// Nodes with shapes in them or below.
    shown: Vec<bool>,
    objects: HashMap<usize, ObjectId>,
    /// Names without keyframes that were told of.
    told: BTreeSet<String>,
    hidden: Vec<InstanceId>,
}

impl Reader<'_, '_> {
    /// Makes all objects and instances; returns the instances that are hidden at the start.
    pub(super) fn place_all(&mut self, file: &Arc<str>) -> Result<Vec<InstanceId>, LoadError> {
        let mut uses = vec![0_u32; self.nodes.len()];
        for child in self.nodes.iter().flat_map(|node| &node.children) {
            uses[child.node] = uses[child.node].saturating_add(1);
        }
        let mut placing = Placing {
            shown: shown(&self.nodes),
            reader: self,
            file,
            uses,
            objects: HashMap::new(),
            told: BTreeSet::new(),
            hidden: Vec::new(),
        };
        let contents = placing.contents(0);
        let name = crate::stem(file).to_owned();
        let still = placing.still_parts(contents.shapes);
        if !still.is_empty() {
            let object = placing.reader.builder.object(name.as_str(), still);
            placing.reader.builder.place(name, object, None, Affine3A::IDENTITY);
        }
        placing.place(None, contents.deforming, contents.placed, 1)?;
        Ok(placing.hidden)
    }
}

/// Which nodes have shapes in them or below. The graph has no cycles: a file cannot include itself.
fn shown(nodes: &[Node]) -> Vec<bool> {
    let mut shown: Vec<bool> = nodes.iter().map(|node| !node.is_empty()).collect();
    let mut holders = vec![Vec::new(); nodes.len()];
    for (holder, node) in nodes.iter().enumerate() {
        node.children.iter().for_each(|child| holders[child.node].push(holder));
    }
    let mut open: Vec<usize> = (0..nodes.len()).filter(|&i| shown[i]).collect();
    while let Some(node) = open.pop() {
        for &holder in &holders[node] {
            if !std::mem::replace(&mut shown[holder], true) {
                open.push(holder);
            }
        }
    }
    shown
}

impl Placing<'_, '_, '_> {
    /// What stands in a node, with plain fixed children that stand nowhere else taken in. Takes the shapes away.
    fn contents(&mut self, node: usize) -> Contents {
        let mut contents = Contents::default();
        let mut joined = vec![node];
        let mut next = 0;
        while next < joined.len() {
            let children = std::mem::take(&mut self.reader.nodes[joined[next]].children);
            for child in &children {
                let (chain, target, shared) = self.follow(child);
                if !self.shown[target] {
                    continue;
                }
                let plain = chain.is_fixed() && chain.at(0.0) == Some(Affine3A::IDENTITY);
                if plain && !shared {
                    joined.push(target);
                } else {
                    contents.placed.push((chain, target));
                }
            }
            let taken = &mut self.reader.nodes[joined[next]];
            if !taken.shapes.is_empty() {
                contents.shapes.push(std::mem::take(&mut taken.shapes));
            }
            contents.deforming.append(&mut taken.deforming.meshes);
            next += 1;
        }
        contents
    }

    /// Down through nodes that hold nothing but one other: the transforms on the way, where it ends, and whether that is
    /// reached by other ways, too.
    fn follow(&mut self, child: &Child) -> (Chain, usize, bool) {
        let mut steps = vec![self.step(&child.way)];
        let (mut node, mut shared) = (child.node, self.uses[child.node] > 1);
        loop {
            let here = &mut self.reader.nodes[node];
            if !here.is_empty() || here.children.len() != 1 {
                return (Chain(steps), node, shared);
            }
            let only = here.children.remove(0);
            steps.push(self.step(&only.way));
            let below = only.node;
            // Put back: a shared node is passed again.
            self.reader.nodes[node].children.push(only);
            node = below;
            shared |= self.uses[node] > 1;
        }
    }

    fn step(&mut self, way: &Way) -> Step {
        match way {
            Way::Fixed(transform) => Step::Fixed(*transform),
            Way::Named(name) => match self.reader.animations.get(name) {
                Some(animation) => Step::Animated(animation.clone()),
                None => {
                    if self.told.insert(name.clone()) {
                        let message = format!("the transform `{name}` has no keyframes");
                        let hint = "it stands still; give it some with `k`";
                        self.reader.context.note(Place::whole(self.file), message, hint);
                    }
                    Step::Fixed(DAffine3::IDENTITY)
                }
            },
        }
    }

    fn still_parts(&mut self, shapes: Vec<Shapes>) -> Vec<(GeometryId, MaterialId)> {
        shapes.into_iter().flat_map(|shapes| shapes.finish(&mut self.reader.builder)).collect()
    }

    /// The object that a node becomes, made when it is first placed.
    fn object(&mut self, node: usize, level: usize) -> Result<ObjectId, LoadError> {
        if let Some(&known) = self.objects.get(&node) {
            return Ok(known);
        }
        if level > MAX_LEVELS {
            let problem = format!("blocks move within one another more than {MAX_LEVELS} levels deep");
            return Err(LoadError::unsupported(Place::whole(self.file), problem, "join some of them"));
        }
        let contents = self.contents(node);
        let parts = self.still_parts(contents.shapes);
        let id = self.reader.builder.object(format!("node {node}"), parts);
        self.objects.insert(node, id);
        self.place(Some(id), contents.deforming, contents.placed, level + 1)?;
        Ok(id)
    }

    /// Places children in an object, or in the world. Deforming meshes become objects of their own, so that nothing that
    /// keeps its shape is touched with them.
    fn place(
        &mut self,
        parent: Option<ObjectId>,
        deforming: Vec<(MaterialId, Deforming)>,
        placed: Vec<(Chain, usize)>,
        level: usize,
    ) -> Result<(), LoadError> {
        for (material, mesh) in deforming {
            let geometry = self.deforming_mesh(mesh);
            let object = self.reader.builder.object("animated triangles", [(geometry, material)]);
            self.reader.builder.place("animated triangles", object, parent, Affine3A::IDENTITY);
        }
        let start = self.reader.motion.start;
        for (chain, node) in placed {
            let object = self.object(node, level)?;
            let rest = chain.at(start).unwrap_or(Affine3A::IDENTITY);
            let id = self.reader.builder.place(String::new(), object, parent, rest);
            if !chain.visible(start) {
                self.hidden.push(id);
            }
            if !chain.is_fixed() {
                self.reader.motion.instances.push((id, chain));
            }
        }
        Ok(())
    }

    fn deforming_mesh(&mut self, mesh: Deforming) -> GeometryId {
        let count = mesh.frames.first().map_or(0, |(positions, _)| positions.len() as u32);
        let indices: Arc<[[u32; 3]]> = (0..count / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let frame = |(positions, normals): (Vec<_>, _)| {
            Arc::new(Mesh {
                positions: positions.into(),
                normals,
                indices: indices.clone(),
                ..Mesh::default()
            })
        };
        let mut shape = DeformingMesh {
            geometry: GeometryId(0),
            times: mesh.times,
            frames: mesh.frames.into_iter().map(frame).collect(),
        };
        let rest = shape.at(self.reader.motion.start);
        shape.geometry = self.reader.builder.mesh(rest.map_or_else(Mesh::default, |mesh| (*mesh).clone()));
        self.reader.motion.meshes.push(shape.clone());
        shape.geometry
    }
}

//! Animations as the document has them: channels that move nodes, checked and read.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", section 3.11; KHR_animation_pointer; KHR_node_visibility.

use std::collections::BTreeSet;

use super::Loader;
use super::json::{self, AnimationSampler};
use super::track::{Interpolation, Track};
use crate::error::LoadError;

/// What a channel changes about a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Property {
    Translation,
    Rotation,
    Scale,
    /// Weights of morph targets.
    Weights,
    Visibility,
}

/// One property of one node over time.
pub(super) struct Channel {
    pub(super) node: usize,
    pub(super) property: Property,
    pub(super) track: Track,
}

/// An animation with the channels that can be played.
pub(super) struct Animation {
    pub(super) name: String,
    pub(super) channels: Vec<Channel>,
}

/// Which nodes some animation changes.
#[derive(Default)]
pub(super) struct Animated {
    /// Nodes that move or are shown and hidden, in themselves.
    pub(super) nodes: BTreeSet<usize>,
    /// Nodes whose morph weights change.
    pub(super) weights: BTreeSet<usize>,
}

impl Animated {
    pub(super) fn new(animations: &[Animation]) -> Self {
        let mut animated = Self::default();
        for channel in animations.iter().flat_map(|animation| &animation.channels) {
            let set = match channel.property {
                Property::Weights => &mut animated.weights,
                _ => &mut animated.nodes,
            };
            set.insert(channel.node);
        }
        animated
    }
}

impl Property {
    /// By its name in a channel or at the end of a pointer.
    fn by_path(path: &str) -> Option<Self> {
        Some(match path {
            "translation" => Self::Translation,
            "rotation" => Self::Rotation,
            "scale" => Self::Scale,
            "weights" => Self::Weights,
            _ => return None,
        })
    }

    /// The node and the property that a JSON pointer names.
    fn by_pointer(pointer: &str) -> Option<(usize, Self)> {
        let (node, path) = pointer.strip_prefix("/nodes/")?.split_once('/')?;
        let property = match path {
            "extensions/KHR_node_visibility/visible" => Some(Self::Visibility),
            path => Self::by_path(path),
        };
        Some((node.parse().ok()?, property?))
    }
}

impl Loader<'_, '_> {
    /// Reads all animations. Channels that cannot be played are left out with a warning.
    pub(super) fn animations(&mut self) -> Result<Vec<Animation>, LoadError> {
        let mut animations = Vec::new();
        for (number, definition) in self.root.animations.iter().enumerate() {
            let path = format!("animations[{number}]");
            let mut channels = Vec::new();
            let mut taken = BTreeSet::new();
            for (index, channel) in definition.channels.iter().enumerate() {
                let path = format!("{path}.channels[{index}]");
                let read = self.channel(channel, &definition.samplers, &path)?.and_then(|channel| {
                    let free = taken.insert((channel.node, channel.property));
                    if free { Ok(channel) } else { Err("an earlier channel has the same target".into()) }
                });
                match read {
                    Ok(channel) => channels.push(channel),
                    Err(problem) => self.context.warn(self.place(&path), problem, "the channel was left out"),
                }
            }
            if channels.is_empty() {
                let message = "the animation has no channel that can be played";
                self.context.warn(self.place(&path), message, "it was left out");
                continue;
            }
            let name = definition.name.clone().unwrap_or_else(|| format!("animation {number}"));
            animations.push(Animation { name, channels });
        }
        Ok(animations)
    }

    /// A channel, or why it cannot be played. References that lead nowhere are errors, as everywhere.
    fn channel(
        &mut self,
        channel: &json::Channel,
        samplers: &[AnimationSampler],
        path: &str,
    ) -> Result<Result<Channel, String>, LoadError> {
        let (node, property) = match target(&channel.target) {
            Ok(target) => target,
            Err(problem) => return Ok(Err(problem)),
        };
        let definition = self.item(&self.root.nodes, "nodes", node, &format!("{path}.target"))?;
        let moves = matches!(property, Property::Translation | Property::Rotation | Property::Scale);
        if moves && definition.matrix.is_some() {
            return Ok(Err(format!("nodes[{node}] has a `matrix`, which cannot be animated")));
        }
        let Some(sampler) = channel.sampler else { return Ok(Err("it has no sampler".into())) };
        let AnimationSampler { input, output, interpolation } =
            self.item(samplers, "samplers", sampler, &format!("{path}.sampler"))?;
        let (Some(input), Some(output)) = (*input, *output) else {
            return Ok(Err(format!("samplers[{sampler}] has no input or no output")));
        };
        let interpolation = match interpolation.as_deref() {
            None | Some("LINEAR") => Interpolation::Linear,
            Some("STEP") => Interpolation::Step,
            Some("CUBICSPLINE") => Interpolation::CubicSpline,
            Some(other) => return Ok(Err(format!("the interpolation `{other}` is unknown"))),
        };
        // A truth value has nothing between its states.
        let interpolation =
            if property == Property::Visibility { Interpolation::Step } else { interpolation };
        let shape = match property {
            Property::Rotation => "VEC4",
            Property::Translation | Property::Scale => "VEC3",
            Property::Weights | Property::Visibility => "SCALAR",
        };
        let found = &self.accessor(output, path)?.shape;
        if found != shape {
            return Ok(Err(format!("accessors[{output}] has the type {found} instead of {shape}")));
        }
        let times = self.read_floats(input, &format!("{path}.sampler.input"), &["SCALAR"], [0.0])?;
        let user = format!("{path}.sampler.output");
        let (values, width) = match property {
            Property::Rotation => (self.read_floats(output, &user, &[shape], [0.0; 4])?.into_flattened(), 4),
            Property::Translation | Property::Scale => {
                (self.read_floats(output, &user, &[shape], [0.0; 3])?.into_flattened(), 3)
            }
            Property::Weights => {
                let width = self.targets_of(node);
                if width == 0 {
                    return Ok(Err(format!("nodes[{node}] has no mesh with morph targets")));
                }
                (self.read_floats(output, &user, &[shape], [0.0])?.into_flattened(), width)
            }
            Property::Visibility => (self.read_floats(output, &user, &[shape], [0.0])?.into_flattened(), 1),
        };
        let track = Track::new(times.into_flattened(), values, width, interpolation);
        Ok(track.map(|track| Channel { node, property, track }))
    }

    /// Morph targets of the mesh at a node.
    pub(super) fn targets_of(&self, node: usize) -> usize {
        let mesh = self.root.nodes[node].mesh.and_then(|mesh| self.root.meshes.get(mesh));
        mesh.and_then(|mesh| mesh.primitives.iter().map(|primitive| primitive.targets.len()).max())
            .unwrap_or(0)
    }
}

fn target(target: &json::ChannelTarget) -> Result<(usize, Property), String> {
    if let Some(json::AnimationPointer { pointer }) = &target.extensions.pointer {
        return Property::by_pointer(pointer).ok_or_else(|| format!("`{pointer}` cannot be animated"));
    }
    let node = target.node.ok_or("it has no target node")?;
    let property = Property::by_path(&target.path);
    property.map(|property| (node, property)).ok_or_else(|| format!("the path `{}` is unknown", target.path))
}

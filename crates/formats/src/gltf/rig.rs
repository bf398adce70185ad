//! What moves in a document, and its state at any time: first nodes, then what stands at them, then what they bend.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use glam::Affine3A;
use heliostat_scene::{
    Camera, CameraId, Clip, GeometryId, InstanceId, Light, LightId, LightKind, Mesh, Motion, Pose, Target,
    Timeline,
};

use super::animation::{Animation, Channel, Property};
use super::deform::{Shape, Skin};
use super::json;
use super::nodes::{Forest, InGroup, Local};
use super::punctual::{place_light, without_scale};

/// What was made of which node, noted while the scene is placed.
#[derive(Default)]
pub(super) struct Stage {
    pub(super) instances: Vec<(InstanceId, usize)>,
    /// Instances of skinned meshes: they stand in the world, but are shown with their node.
    pub(super) skinned: Vec<(InstanceId, usize)>,
    /// As it is at rest, and in the space of its node.
    pub(super) lights: Vec<(LightId, Light, LightKind, usize)>,
    pub(super) cameras: Vec<(CameraId, Camera, usize)>,
    pub(super) meshes: Vec<BentMesh>,
    /// Rest weights of the morph targets at nodes with meshes that change.
    pub(super) weights: BTreeMap<usize, Vec<f32>>,
    /// For moving nodes that are shown: what they stand in, and whether they are groups.
    groups: BTreeMap<usize, (InGroup, bool)>,
}

impl Stage {
    /// Notes a node that was placed in what is `above` it.
    pub(super) fn stand(
        &mut self,
        forest: &Forest,
        node: usize,
        above: InGroup,
        instance: Option<InstanceId>,
        opens_group: bool,
    ) {
        if forest.moving[node].is_some() {
            self.groups.insert(node, (above, opens_group));
            self.instances.extend(instance.map(|instance| (instance, node)));
        }
    }
}

/// A mesh that changes, with the number of its skin.
pub(super) struct BentMesh {
    pub(super) geometry: GeometryId,
    pub(super) shape: Arc<Shape>,
    pub(super) skin: Option<usize>,
    pub(super) node: usize,
}

/// A moving node.
struct RigNode {
    above: Above,
    local: Local,
    visible: bool,
    opens_group: bool,
}

/// What a moving node stands in.
enum Above {
    /// Another one.
    Node(usize),
    /// What never moves.
    Fixed(State),
}

/// Where a node stands.
#[derive(Clone, Copy)]
struct State {
    world: Affine3A,
    visible: bool,
    in_group: InGroup,
}

/// A joint of a skin: a moving node, or where one stands that does not move.
enum Joint {
    Node(usize),
    Fixed(Affine3A),
}

/// A skin with its joints.
struct RigSkin {
    skin: Arc<Skin>,
    joints: Vec<Joint>,
}

/// A mesh that changes. The last state is kept: what rests is not bent again.
struct RigMesh {
    geometry: GeometryId,
    shape: Arc<Shape>,
    skin: Option<usize>,
    /// Number of its weights.
    weights: usize,
    last: Mutex<Option<Bent>>,
}

struct Bent {
    weights: Vec<f32>,
    joints: Arc<[Affine3A]>,
    mesh: Arc<Mesh>,
}

/// Everything that some animation of a document moves, at rest. Nodes go by their number in `nodes`.
struct Rig {
    nodes: Vec<RigNode>,
    weights: Vec<Vec<f32>>,
    skins: Vec<RigSkin>,
    instances: Vec<(InstanceId, usize)>,
    shown: Vec<(InstanceId, usize)>,
    skinned: Vec<(InstanceId, usize)>,
    lights: Vec<(LightId, Light, LightKind, usize)>,
    cameras: Vec<(CameraId, Camera, usize)>,
    meshes: Vec<RigMesh>,
}

/// What a channel changes: a property of a moving node, or a set of weights.
struct RigChannel {
    number: usize,
    channel: Channel,
}

/// One animation.
struct Player {
    rig: Arc<Rig>,
    channels: Vec<RigChannel>,
}

/// The timeline of a document whose scene has been placed.
pub(super) fn timeline(
    stage: Stage,
    forest: &Forest,
    skins: &BTreeMap<usize, Arc<Skin>>,
    animations: Vec<Animation>,
    nodes: &[json::Node],
) -> Timeline {
    let slots: BTreeMap<usize, usize> = stage.weights.keys().copied().zip(0..).collect();
    let mut rig = Rig::new(stage, forest, skins, &slots, nodes);
    let clips: Vec<(String, Vec<RigChannel>)> = animations
        .into_iter()
        .map(|animation| {
            let number = |channel: &Channel| match channel.property {
                Property::Weights => slots.get(&channel.node).copied(),
                _ => forest.moving[channel.node],
            };
            let channels = animation.channels.into_iter();
            // Weights of meshes that the scene does not show have no number.
            let channels =
                channels.filter_map(|c| number(&c).map(|number| RigChannel { number, channel: c }));
            (animation.name, channels.collect())
        })
        .collect();
    rig.keep_what_moves(&Reach::new(&rig, clips.iter().flat_map(|(_, channels)| channels)));
    let rig = Arc::new(rig);
    let clip = |(name, channels)| {
        let motion = Arc::new(Player { rig: rig.clone(), channels });
        Clip { name, frame_rate: None, motion }
    };
    Timeline::new(clips.into_iter().map(clip).collect())
}

impl Rig {
    /// The rig of everything at moving nodes.
    fn new(
        stage: Stage,
        forest: &Forest,
        skins: &BTreeMap<usize, Arc<Skin>>,
        slots: &BTreeMap<usize, usize>,
        nodes: &[json::Node],
    ) -> Self {
        let number = |node: usize| forest.moving[node];
        let rig_node = |&node: &usize| {
            let (in_group, opens_group) = stage.groups.get(&node).copied().unwrap_or((InGroup::TOP, false));
            let fixed = |parent: Option<usize>| State {
                world: parent.map_or(Affine3A::IDENTITY, |parent| forest.world[parent]),
                visible: parent.is_none_or(|parent| forest.visible[parent]),
                in_group,
            };
            let parent = forest.parent[node];
            let above = parent.and_then(number).map_or_else(|| Above::Fixed(fixed(parent)), Above::Node);
            RigNode { above, local: forest.local[node], visible: nodes[node].is_visible(), opens_group }
        };
        let used: BTreeSet<usize> = stage.meshes.iter().filter_map(|mesh| mesh.skin).collect();
        let skin_numbers: BTreeMap<usize, usize> = used.iter().copied().zip(0..).collect();
        let joint = |&node: &usize| number(node).map_or(Joint::Fixed(forest.world[node]), Joint::Node);
        let rig_skin = |skin: &Arc<Skin>| RigSkin {
            joints: skin.joints.iter().map(joint).collect(),
            skin: skin.clone(),
        };
        let mesh = |BentMesh { geometry, shape, skin, node }| RigMesh {
            geometry,
            shape,
            skin: skin.map(|skin| skin_numbers[&skin]),
            weights: slots[&node],
            last: Mutex::default(),
        };
        let at = |(instance, node)| Some((instance, number(node)?));
        Self {
            nodes: forest.order.iter().filter(|&&node| number(node).is_some()).map(rig_node).collect(),
            skins: used.iter().map(|skin| rig_skin(&skins[skin])).collect(),
            meshes: stage.meshes.into_iter().map(mesh).collect(),
            weights: stage.weights.into_values().collect(),
            shown: stage.instances.iter().copied().filter_map(at).collect(),
            instances: stage.instances.into_iter().filter_map(at).collect(),
            skinned: stage.skinned.into_iter().filter_map(at).collect(),
            lights: stage
                .lights
                .into_iter()
                .filter_map(|(id, rest, kind, n)| Some((id, rest, kind, number(n)?)))
                .collect(),
            cameras: stage
                .cameras
                .into_iter()
                .filter_map(|(id, rest, n)| Some((id, rest, number(n)?)))
                .collect(),
        }
    }

    /// Drops what no channel reaches.
    fn keep_what_moves(&mut self, reach: &Reach) {
        self.instances.retain(|&(_, node)| reach.moves[node].in_group);
        self.shown.retain(|&(_, node)| reach.shows[node].in_group);
        self.skinned.retain(|&(_, node)| reach.shows[node].world);
        self.lights.retain(|&(.., node)| reach.moves[node].world || reach.shows[node].world);
        self.cameras.retain(|&(.., node)| reach.moves[node].world);
    }

    /// Where the nodes stand; a transform that is not finite does not count.
    fn states(&self, locals: &[(Local, bool)]) -> Vec<State> {
        let mut states: Vec<State> = Vec::with_capacity(self.nodes.len());
        for (node, (local, shown)) in self.nodes.iter().zip(locals) {
            let above = match node.above {
                Above::Fixed(state) => state,
                Above::Node(parent) if self.nodes[parent].opens_group => {
                    State { in_group: InGroup::TOP, ..states[parent] }
                }
                Above::Node(parent) => states[parent],
            };
            let below = |local: &Local| {
                let matrix = local.matrix();
                let world = above.world * matrix;
                let in_group = above.in_group.child(&matrix, *shown);
                let state = State { world, visible: above.visible && *shown, in_group };
                (world.is_finite() && in_group.transform.is_finite()).then_some(state)
            };
            states.push(below(local).or_else(|| below(&node.local)).unwrap_or(above));
        }
        states
    }

    /// `world_from_bind` of every skin's joints.
    fn joints(&self, states: &[State]) -> Vec<Arc<[Affine3A]>> {
        let place = |joint: &Joint| match *joint {
            Joint::Node(node) => states[node].world,
            Joint::Fixed(world) => world,
        };
        let of_skin = |RigSkin { skin, joints }: &RigSkin| -> Arc<[Affine3A]> {
            skin.matrices(joints.iter().map(place)).into()
        };
        self.skins.iter().map(of_skin).collect()
    }

    fn write(&self, states: &[State], weights: &[Vec<f32>], pose: &mut Pose) {
        for &(id, node) in &self.instances {
            pose.instance(id, states[node].in_group.transform);
        }
        for &(id, node) in &self.shown {
            pose.show(id, states[node].in_group.visible);
        }
        for &(id, node) in &self.skinned {
            pose.show(id, states[node].visible);
        }
        for (id, rest, at_node, node) in &self.lights {
            let State { world, visible, .. } = &states[*node];
            let kind = place_light(at_node, world, *visible).unwrap_or_else(|| rest.kind.clone());
            pose.light(*id, Light { name: rest.name.clone(), kind });
        }
        for (id, rest, node) in &self.cameras {
            let moved = without_scale(states[*node].world)
                .map(|world_from_camera| Camera { world_from_camera, ..rest.clone() })
                .filter(|camera| camera.problem().is_none());
            pose.camera(*id, moved.unwrap_or_else(|| rest.clone()));
        }
        let joints = self.joints(states);
        let none: Arc<[Affine3A]> = Arc::new([]);
        for mesh in &self.meshes {
            let joints = mesh.skin.map_or(&none, |skin| &joints[skin]);
            pose.mesh(mesh.geometry, mesh.bent(&weights[mesh.weights], joints));
        }
    }
}

impl RigMesh {
    fn bent(&self, weights: &[f32], joints: &Arc<[Affine3A]>) -> Arc<Mesh> {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        match &*last {
            Some(last) if last.weights == weights && last.joints == *joints => last.mesh.clone(),
            _ => {
                let mesh = Arc::new(self.shape.deform(weights, joints));
                let (weights, joints) = (weights.to_vec(), joints.clone());
                *last = Some(Bent { weights, joints, mesh: mesh.clone() });
                mesh
            }
        }
    }
}

/// Whether a node is changed by some channels, in its group and in the world.
#[derive(Clone, Copy)]
struct Reached {
    in_group: bool,
    world: bool,
}

/// What some channels change, by the numbers of nodes and weights.
struct Reach {
    moves: Vec<Reached>,
    shows: Vec<Reached>,
    weights: BTreeSet<usize>,
}

impl Reach {
    fn new<'a>(rig: &Rig, channels: impl IntoIterator<Item = &'a RigChannel>) -> Self {
        let (mut moved, mut shown) = (vec![false; rig.nodes.len()], vec![false; rig.nodes.len()]);
        let mut weights = BTreeSet::new();
        for RigChannel { number, channel } in channels {
            match channel.property {
                Property::Weights => _ = weights.insert(*number),
                Property::Visibility => shown[*number] = true,
                Property::Translation | Property::Rotation | Property::Scale => moved[*number] = true,
            }
        }
        Self { moves: rig.downwards(&moved), shows: rig.downwards(&shown), weights }
    }

    fn mesh(&self, rig: &Rig, mesh: &RigMesh) -> bool {
        let joint = |joint: &Joint| matches!(joint, Joint::Node(node) if self.moves[*node].world);
        self.weights.contains(&mesh.weights)
            || mesh.skin.is_some_and(|skin| rig.skins[skin].joints.iter().any(joint))
    }
}

impl Rig {
    /// Hands a change on to what stands below; in groups down to the next one.
    fn downwards(&self, changed: &[bool]) -> Vec<Reached> {
        let mut reached: Vec<Reached> = Vec::with_capacity(self.nodes.len());
        for (node, &here) in self.nodes.iter().zip(changed) {
            reached.push(match node.above {
                Above::Fixed(_) => Reached { in_group: here, world: here },
                Above::Node(parent) => Reached {
                    in_group: here || (reached[parent].in_group && !self.nodes[parent].opens_group),
                    world: here || reached[parent].world,
                },
            });
        }
        reached
    }
}

impl fmt::Debug for Player {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Player").field("channels", &self.channels.len()).finish_non_exhaustive()
    }
}

impl Motion for Player {
    fn duration(&self) -> f64 {
        self.channels.iter().map(|channel| channel.channel.track.end()).fold(0.0, f64::max)
    }

    fn sample(&self, time: f64, pose: &mut Pose) {
        let mut locals: Vec<(Local, bool)> =
            self.rig.nodes.iter().map(|node| (node.local, node.visible)).collect();
        let mut weights = self.rig.weights.clone();
        for RigChannel { number, channel: Channel { property, track, .. } } in &self.channels {
            if *property == Property::Weights {
                track.sample(time, &mut weights[*number]);
                continue;
            }
            let (local, visible) = &mut locals[*number];
            match (property, local) {
                (Property::Translation, Local::Parts { translation, .. }) => {
                    track.sample(time, translation.as_mut());
                }
                (Property::Scale, Local::Parts { scale, .. }) => track.sample(time, scale.as_mut()),
                (Property::Rotation, Local::Parts { rotation, .. }) => *rotation = track.rotation(time),
                (Property::Visibility, _) => {
                    let mut value = [0.0];
                    track.sample(time, &mut value);
                    *visible = value[0] != 0.0;
                }
                // Such channels have been left out.
                (_, Local::Matrix(_)) | (Property::Weights, _) => {}
            }
        }
        self.rig.write(&self.rig.states(&locals), &weights, pose);
    }

    fn moves(&self) -> BTreeSet<Target> {
        let rig = &self.rig;
        let reach = Reach::new(rig, &self.channels);
        let instances = rig.instances.iter().filter(|&&(_, node)| reach.moves[node].in_group);
        let shown = rig.shown.iter().filter(|&&(_, node)| reach.shows[node].in_group);
        let skinned = rig.skinned.iter().filter(|&&(_, node)| reach.shows[node].world);
        let instances = instances.chain(shown).chain(skinned).map(|&(id, _)| Target::Instance(id));
        let changed = |node: usize| reach.moves[node].world || reach.shows[node].world;
        let lights =
            rig.lights.iter().filter(|&&(.., node)| changed(node)).map(|(id, ..)| Target::Light(*id));
        let cameras = rig.cameras.iter().filter(|&&(.., node)| reach.moves[node].world);
        let cameras = cameras.map(|(id, ..)| Target::Camera(*id));
        let meshes = rig.meshes.iter().filter(|mesh| reach.mesh(rig, mesh));
        let meshes = meshes.map(|mesh| Target::Geometry(mesh.geometry));
        instances.chain(lights).chain(cameras).chain(meshes).collect()
    }
}

//! All that panels show, as one value that the faces read.

use heliostat_scene::{Environment, InstanceId, Light, LightId, MaterialId, Scene};
use serde::Serialize;

use crate::change::{Lamp, Look, Surroundings};
use crate::document::Document;
use crate::gizmo::GizmoMode;
use crate::input::Selection;
use crate::navigator::Mode;
use crate::style::{Effect, ShaderChoice};

/// Most lights and objects that are listed; the number of all of them is told beside.
const MAX_LISTED: usize = 200;

/// What a session is doing and showing.
#[derive(Clone, Debug, Default, Serialize)]
pub struct State {
    /// Grows with every change.
    pub number: u64,
    /// The scene's name.
    pub title: String,
    /// Whether a scene is being opened.
    pub loading: Option<Loading>,
    /// What the user should know, latest last.
    pub messages: Vec<Message>,
    /// What is known of the scene once there is one.
    pub scene: Option<SceneState>,
}

/// How far opening a scene is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Loading {
    /// The scene's name.
    pub title: String,
    /// Steps done in the current stage, and steps in all; 0 of 0 while that is unknown.
    pub done: u64,
    /// See [`Self::done`].
    pub total: u64,
    /// Seconds since it began.
    pub seconds: f64,
}

/// Something the user should know.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Message {
    /// Grows by one with every message of a session.
    pub number: u64,
    /// Whether something failed.
    pub error: bool,
    /// What.
    pub text: String,
}

/// The settings of a view and the parts of the scene that panels show.
#[derive(Clone, Debug, Serialize)]
pub struct SceneState {
    /// Names for `renderer`.
    pub renderers: Vec<String>,
    /// How light is computed.
    pub renderer: String,
    /// Names of the planes that can be shown instead.
    pub planes: Vec<String>,
    /// The plane that is.
    pub plane: Option<String>,
    /// Whether all surfaces are shown as diffuse.
    pub diffuse: bool,
    /// The shaders that show quantities in false colours.
    pub false_colors: Vec<ShaderChoice>,
    /// The shader that all surfaces have instead of their own.
    pub surfaces: Option<Effect>,
    /// The pixel shaders, tone curves among them.
    pub pixel_shaders: Vec<ShaderChoice>,
    /// What the picture goes through.
    pub effects: Vec<Effect>,
    /// The tone curve, where the user has chosen.
    pub tone: Option<Effect>,
    /// Stops, where the user has chosen.
    pub exposure: Option<f32>,
    /// Frames per second to hold while moving.
    pub goal: Option<f32>,
    /// Names.
    pub cameras: Vec<String>,
    /// The way to move.
    pub mode: Mode,
    /// Vertical field of view, degrees.
    pub field: f32,
    /// Some of the lights without surface.
    pub lights: Vec<LightState>,
    /// How many there are.
    pub light_count: usize,
    /// Some of the instances in the world.
    pub things: Vec<Thing>,
    /// How many there are.
    pub thing_count: usize,
    /// What surrounds the scene.
    pub surroundings: Surroundings,
    /// Whether the scene brings surroundings of its own.
    pub has_surroundings: bool,
    /// What is selected.
    pub selection: Option<Selected>,
    /// What its handles do.
    pub gizmo: GizmoMode,
    /// Names and lengths in seconds.
    pub clips: Vec<(String, f64)>,
    /// The one that plays.
    pub clip: usize,
    /// Whether time goes on.
    pub playing: bool,
    /// How fast; 1 is as made.
    pub rate: f64,
    /// What undoing would take back.
    pub undo: Option<&'static str>,
    /// What redoing would do again.
    pub redo: Option<&'static str>,
    /// Whether the path and changes are being recorded.
    pub recording: bool,
    /// Length of the recording, seconds, that goes on or has ended; `None` when there is none.
    pub recorded: Option<f64>,
}

/// A light without surface.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LightState {
    /// The handle's number.
    pub id: u32,
    /// For people.
    pub name: String,
    /// What it is.
    pub lamp: Lamp,
}

/// An instance in the world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Thing {
    /// The handle's number.
    pub id: u32,
    /// Its name, or its object's.
    pub name: String,
    /// Whether it is seen.
    pub visible: bool,
}

/// What is selected.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum Selected {
    /// An instance.
    Instance {
        /// The handle's number.
        instance: u32,
        /// Its name, or its object's.
        name: String,
        /// Whether it stands in something that can be selected instead.
        has_holder: bool,
        /// Whether it is seen.
        visible: bool,
        /// Where it stands: three columns, then the place.
        parent_from_object: [f32; 12],
        /// The handle's number of the material.
        material: Option<u32>,
        /// The material's name.
        material_name: String,
        /// The material's factors.
        look: Option<Look>,
        /// Whether the colour or the light comes from a texture as well.
        textured: bool,
    },
    /// A light without surface.
    Light {
        /// The handle's number.
        light: u32,
    },
}

/// The name of an instance, or its object's, or its number.
pub(crate) fn instance_name(scene: &Scene, id: InstanceId) -> String {
    let Some(instance) = scene.instances().get(&id) else { return id.to_string() };
    let object = scene.objects().get(&instance.object).map_or("", |object| &object.name);
    let names = [instance.name.as_str(), object];
    names.into_iter().find(|name| !name.is_empty()).map_or_else(|| id.to_string(), Into::into)
}

pub(crate) fn light_name(id: LightId, light: &Light) -> String {
    if light.name.is_empty() { id.to_string() } else { light.name.clone() }
}

/// The lights for the list.
pub(crate) fn lights(scene: &Scene) -> Vec<LightState> {
    let lights = scene.lights().iter().take(MAX_LISTED);
    lights
        .map(|(id, light)| LightState { id: id.0, name: light_name(*id, light), lamp: Lamp::of(&light.kind) })
        .collect()
}

/// The instances for the list.
pub(crate) fn things(scene: &Scene) -> Vec<Thing> {
    let ids = scene.placed_in(None).take(MAX_LISTED);
    ids.map(|id| Thing { id: id.0, name: instance_name(scene, id), visible: scene.instances()[&id].visible })
        .collect()
}

/// Whether the scene brings surroundings of its own.
pub(crate) fn has_surroundings(document: &Document) -> bool {
    document.own_environment() != &Environment::None
}

/// What the panels show of a selected thing; `None` when it is no longer there.
pub(crate) fn selected(scene: &Scene, selection: &Selection) -> Option<Selected> {
    match *selection {
        Selection::Light { light } => {
            scene.lights().contains_key(&LightId(light)).then_some(Selected::Light { light })
        }
        Selection::Instance { instance, material, .. } => {
            let id = InstanceId(instance);
            let placed = scene.instances().get(&id)?;
            let first = || scene.objects().get(&placed.object)?.parts.first().map(|part| part.material);
            let material = material.map(MaterialId).or_else(first);
            let data = material.and_then(|id| scene.materials().get(&id));
            Some(Selected::Instance {
                instance,
                name: instance_name(scene, id),
                has_holder: placed.parent.is_some(),
                visible: placed.visible,
                parent_from_object: placed.parent_from_object.to_cols_array(),
                material: material.map(|id| id.0),
                material_name: data.map_or(String::new(), |material| material.name.clone()),
                look: data.map(|material| Look::of(material)),
                textured: data.is_some_and(|material| {
                    material.base_color_texture.is_some()
                        || material.emissive_texture.is_some()
                        || material.shader.is_some()
                }),
            })
        }
    }
}

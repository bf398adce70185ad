//! glTF 2.0: `.gltf` with embedded or external data, and `.glb`.
//!
//! The document's scene (`scene`, else the first, else all root nodes) becomes instances: each mesh is one object,
//! however many nodes show it, with one part per primitive; a node with several things below it becomes a group
//! object, and chains of nodes in between are multiplied together. Groups nest up to 48 deep, further ones are
//! flattened into their parent. Cameras and lights are placed by their world transforms.
//!
//! All of the core material model is read except occlusion, which light transport computes, and KHR_lights_punctual
//! (candela count as W/sr and lux as W/m², one to one), KHR_materials_{clearcoat, emissive_strength, ior,
//! pbrSpecularGlossiness, specular, transmission, unlit, volume}, KHR_mesh_quantization and KHR_texture_transform.
//! A volume of thickness 0 is a thin sheet, as the extension has it. An unknown extension that the document
//! requires is an error, another one a warning.
//!
//! A material may name a surface shader in its `extras`: `{"heliostat_shader": {"name": "checker"}}` one of the engine's
//! own, `{"heliostat_shader": {"plugin": "FILE", "shader": "NAME"}}` one of a shared library in the document's folder.
//! `"parameters": {…}` beside it sets them to numbers, `[x, y, z]`, or textures: `{"index": 0, "factor": [r, g, b]}`, with
//! `"linear": true` for data and what else a reference to a texture may have; or to attributes of the meshes:
//! `{"attribute": "_NAME", "factor": [x, y, z]}`. Attributes whose names begin with `_`, numbers or vectors of three, are read
//! for that.
//!
//! EXT_lights_ies names measured lights (see [`ies`](mod@crate::ies)). A node's `extras` may make it a projector:
//! `{"heliostat_projector": {"image": 0, "intensity": [r, g, b], "vertical_fov": 0.8}}` throws an image of the document along
//! the node's −Z, its top towards +Y; W/sr where it is white, and radians over its height. Or a light by one of the engine's
//! light shaders: `{"heliostat_light": {"name": "barn-doors", "intensity": [r, g, b], "parameters": {"top": 0.1}}}`, in which
//! parameters are numbers or `[x, y, z]`; it aims along −Z, with +Y up.
//!
//! Triangles, strips and fans are shown; points and lines are skipped with a warning. Meshes without normals are
//! flat. KHR_node_visibility hides instances and darkens lights.
//!
//! Each animation becomes a clip of the timeline: nodes with what stands at them (lights and cameras included), skins
//! and morph targets, in all interpolations; of KHR_animation_pointer the properties of nodes. The edits have
//! everything at rest, as the nodes and their weights stand. Normals and tangents follow a deformation; every
//! deformed copy of a mesh has a geometry of its own, and shares its triangles with its other moments. Channels that
//! cannot be played are left out with a warning.
//!
//! # References
//! Khronos, "glTF 2.0 Specification", 2021, and the extensions' specifications.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use heliostat_scene::{
    ColorSpace, Edit, Image, MaterialId, ObjectId, Profile, SceneBuilder, TextureId, Timeline,
};

use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;
use animation::Animated;
use container::Glb;
use deform::{Shape, Skin};
use json::Root;
use rig::Stage;

mod accessor;
mod animation;
mod container;
mod deform;
mod json;
mod material;
mod mesh;
mod nodes;
mod photometric;
#[cfg(test)]
mod photometric_tests;
mod punctual;
mod rig;
mod shader;
mod texture;
mod track;

#[cfg(test)]
mod animation_tests;
#[cfg(test)]
mod material_tests;
#[cfg(test)]
mod shader_tests;
#[cfg(test)]
mod tests;

pub(crate) fn load_glb(
    context: &mut Context<'_>,
    file: &Arc<str>,
    bytes: &[u8],
) -> Result<(Vec<Edit>, Timeline), LoadError> {
    let glb = Glb::parse(file, bytes)?;
    let root = container::parse_document(context, file, glb.json, false)?;
    build(context, file, &root, glb.binary)
}

pub(crate) fn load_gltf(
    context: &mut Context<'_>,
    file: &Arc<str>,
    bytes: &[u8],
) -> Result<(Vec<Edit>, Timeline), LoadError> {
    let root = container::parse_document(context, file, bytes, true)?;
    build(context, file, &root, None)
}

fn build(
    context: &mut Context<'_>,
    file: &Arc<str>,
    root: &Root,
    binary: Option<&[u8]>,
) -> Result<(Vec<Edit>, Timeline), LoadError> {
    check_version(file, root)?;
    check_extensions(context, file, root)?;
    let buffers = container::read_buffers(context, file, root, binary)?;
    let mut loader = Loader {
        context,
        file,
        root,
        buffers: &buffers,
        builder: SceneBuilder::new(),
        objects: HashMap::new(),
        materials: HashMap::new(),
        textures: HashMap::new(),
        images: HashMap::new(),
        profiles: HashMap::new(),
        animated: Animated::default(),
        skins: BTreeMap::new(),
        shapes: HashMap::new(),
        stage: Stage::default(),
    };
    let animations = loader.animations()?;
    loader.animated = Animated::new(&animations);
    let forest = loader.scene()?;
    let timeline = rig::timeline(loader.stage, &forest, &loader.skins, animations, &root.nodes);
    Ok((loader.builder.finish(), timeline))
}

/// The state of one import. Its `impl` blocks are spread over this folder by subject.
struct Loader<'a, 'c> {
    context: &'a mut Context<'c>,
    file: &'a Arc<str>,
    root: &'a Root,
    buffers: &'a [Cow<'a, [u8]>],
    builder: SceneBuilder,
    /// Objects of meshes that are shown as they are; `None` for those without triangles.
    objects: HashMap<usize, Option<ObjectId>>,
    materials: HashMap<Option<usize>, MaterialId>,
    /// `None` for data textures that could not be read.
    textures: HashMap<(usize, ColorSpace), Option<TextureId>>,
    images: HashMap<usize, Option<Arc<Image>>>,
    /// `None` for light profiles that could not be read.
    profiles: HashMap<usize, Option<Arc<Profile>>>,
    animated: Animated,
    skins: BTreeMap<usize, Arc<Skin>>,
    /// Shapes that change, by mesh, primitive and skin.
    shapes: HashMap<(usize, usize, Option<usize>), Arc<Shape>>,
    stage: Stage,
}

impl<'a> Loader<'a, '_> {
    /// Element `index` of the document's array `name`, to which `user` (a JSON path) refers.
    fn item<T>(&self, items: &'a [T], name: &str, index: usize, user: &str) -> Result<&'a T, LoadError> {
        items.get(index).ok_or_else(|| {
            let problem = format!("it refers to {name}[{index}], but there are {}", items.len());
            LoadError::input(Place::json(self.file, user), problem, "correct the index")
        })
    }

    fn place(&self, path: &str) -> Place {
        Place::json(self.file, path)
    }
}

/// glTF 1.0 is another format.
fn check_version(file: &Arc<str>, root: &Root) -> Result<(), LoadError> {
    let wanted = root.asset.min_version.as_ref().unwrap_or(&root.asset.version);
    match wanted.split_once('.') {
        Some(("2", minor)) if root.asset.min_version.is_none() || minor == "0" => Ok(()),
        _ if wanted.is_empty() => {
            let hint = "add `\"asset\": {\"version\": \"2.0\"}` if this is a glTF file";
            Err(LoadError::input(
                Place::json(file, "asset.version"),
                "the document has no glTF version",
                hint,
            ))
        }
        _ => {
            let problem = format!("the document needs glTF version {wanted}");
            Err(LoadError::unsupported(Place::json(file, "asset"), problem, "convert it to glTF 2.0"))
        }
    }
}

const EXTENSIONS: [&str; 14] = [
    "KHR_animation_pointer",
    "EXT_lights_ies",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_transform",
];

fn check_extensions(context: &mut Context<'_>, file: &Arc<str>, root: &Root) -> Result<(), LoadError> {
    let unknown = |name: &&String| !EXTENSIONS.contains(&name.as_str());
    if let Some((number, name)) = root.extensions_required.iter().enumerate().find(|(_, name)| unknown(name))
    {
        let place = Place::json(file, format!("extensionsRequired[{number}]"));
        let hint = match name.as_str() {
            "KHR_draco_mesh_compression" | "EXT_meshopt_compression" => "export the file without compression",
            "KHR_texture_basisu" | "EXT_texture_webp" => "export the file with PNG or JPEG textures",
            _ => "export the file without it",
        };
        return Err(LoadError::unsupported(place, format!("the file requires the extension `{name}`"), hint));
    }
    let optional: Vec<_> = root.extensions_used.iter().filter(unknown).take(20).map(String::as_str).collect();
    if !optional.is_empty() {
        let message = format!("extensions not supported and ignored: {}", optional.join(", "));
        context.warn(Place::json(file, "extensionsUsed"), message, "");
    }
    Ok(())
}

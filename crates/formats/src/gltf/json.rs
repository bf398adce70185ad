//! The glTF 2.0 document as it is written, in the specification's words.
//!
//! Own structures rather than the `gltf` crate's: that crate refuses a whole document for one invalid item or an
//! extension it does not know (KHR_materials_clearcoat among them), and cannot say where. Here everything is
//! optional that a loader can do without, and references are checked where they are followed.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Root {
    pub(super) asset: Asset,
    pub(super) extensions_used: Vec<String>,
    pub(super) extensions_required: Vec<String>,
    pub(super) extensions: RootExtensions,
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<Scene>,
    pub(super) nodes: Vec<Node>,
    pub(super) meshes: Vec<Mesh>,
    pub(super) accessors: Vec<Accessor>,
    pub(super) buffer_views: Vec<BufferView>,
    pub(super) buffers: Vec<Buffer>,
    pub(super) materials: Vec<Material>,
    pub(super) textures: Vec<Texture>,
    pub(super) images: Vec<Image>,
    pub(super) samplers: Vec<Sampler>,
    pub(super) skins: Vec<Skin>,
    pub(super) cameras: Vec<Camera>,
    pub(super) animations: Vec<Animation>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Asset {
    pub(super) version: String,
    pub(super) min_version: Option<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct RootExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) lights: Lights,
    #[serde(rename = "EXT_lights_ies")]
    pub(super) light_profiles: LightProfiles,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct LightProfiles {
    pub(super) lights: Vec<LightProfile>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct LightProfile {
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Debug, Deserialize)]
pub(super) struct LightProfileReference {
    pub(super) light: usize,
    #[serde(default = "one")]
    pub(super) multiplier: f32,
    #[serde(default = "white")]
    pub(super) color: [f32; 3],
}

/// What other programs keep in a node, and our lights, which are read later: a mistake in one costs that light alone.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum NodeExtras {
    Ours {
        heliostat_projector: Option<serde_json::Value>,
        heliostat_light: Option<serde_json::Value>,
    },
    /// No object.
    Others(IgnoredAny),
}

/// A light by a shader that a node names.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShadedLight {
    pub(super) name: String,
    #[serde(default)]
    pub(super) parameters: BTreeMap<String, LightParameter>,
    #[serde(default = "white")]
    pub(super) intensity: [f32; 3],
}

/// The value of a light shader's parameter.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum LightParameter {
    Float(f32),
    Vector([f32; 3]),
}

/// A projector that a node names.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Projector {
    pub(super) image: usize,
    #[serde(default = "white")]
    pub(super) intensity: [f32; 3],
    #[serde(default = "super::photometric::default_fov")]
    pub(super) vertical_fov: f32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Lights {
    pub(super) lights: Vec<Light>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Light {
    pub(super) name: Option<String>,
    #[serde(rename = "type")]
    pub(super) kind: String,
    #[serde(default = "white")]
    pub(super) color: [f32; 3],
    #[serde(default = "one")]
    pub(super) intensity: f32,
    pub(super) range: Option<f32>,
    pub(super) spot: Option<Spot>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Spot {
    #[serde(default)]
    pub(super) inner_cone_angle: f32,
    #[serde(default = "quarter_pi")]
    pub(super) outer_cone_angle: f32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) nodes: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) name: Option<String>,
    pub(super) children: Vec<usize>,
    pub(super) matrix: Option<Box<[f32; 16]>>,
    pub(super) translation: Option<[f32; 3]>,
    pub(super) rotation: Option<[f32; 4]>,
    pub(super) scale: Option<[f32; 3]>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) weights: Option<Vec<f32>>,
    pub(super) camera: Option<usize>,
    pub(super) extensions: NodeExtensions,
    pub(super) extras: Option<Box<NodeExtras>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    pub(super) light: Option<LightReference>,
    #[serde(rename = "EXT_lights_ies")]
    pub(super) light_profile: Option<LightProfileReference>,
    #[serde(rename = "KHR_node_visibility")]
    pub(super) visibility: Option<Visibility>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Visibility {
    #[serde(default = "visible")]
    pub(super) visible: bool,
}

#[derive(Debug, Deserialize)]
pub(super) struct LightReference {
    pub(super) light: usize,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) name: Option<String>,
    pub(super) primitives: Vec<Primitive>,
    pub(super) weights: Option<Vec<f32>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: BTreeMap<String, usize>,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: Option<u32>,
    pub(super) targets: Vec<BTreeMap<String, usize>>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
    #[serde(default)]
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) sparse: Option<Box<Sparse>>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Sparse {
    pub(super) count: u64,
    pub(super) indices: SparseIndices,
    pub(super) values: SparseValues,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseIndices {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) component_type: u32,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SparseValues {
    pub(super) buffer_view: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct BufferView {
    pub(super) buffer: usize,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Material {
    pub(super) name: Option<String>,
    pub(super) pbr_metallic_roughness: PbrMetallicRoughness,
    pub(super) normal_texture: Option<TextureInfo>,
    pub(super) emissive_texture: Option<TextureInfo>,
    pub(super) emissive_factor: [f32; 3],
    pub(super) alpha_mode: Option<String>,
    pub(super) alpha_cutoff: Option<f32>,
    pub(super) double_sided: bool,
    pub(super) extensions: Option<Box<MaterialExtensions>>,
    pub(super) extras: Option<Box<MaterialExtras>>,
}

/// What other programs keep in a material, and our shader, which is read later: a mistake in it costs the shader alone.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum MaterialExtras {
    Ours { heliostat_shader: serde_json::Value },
    Others(IgnoredAny),
}

/// A material's shader: one of the engine by its `name`, or `shader` of the library `plugin`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialShader {
    pub(super) name: Option<String>,
    pub(super) plugin: Option<String>,
    pub(super) shader: Option<String>,
    #[serde(default)]
    pub(super) parameters: BTreeMap<String, ShaderParameter>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum ShaderParameter {
    Float(f32),
    Vector([f32; 3]),
    Attribute(ShaderAttribute),
    Texture(ShaderTexture),
}

/// The name of an attribute of meshes, with what it is multiplied by.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShaderAttribute {
    pub(super) attribute: String,
    #[serde(default = "white")]
    pub(super) factor: [f32; 3],
}

/// A reference to a texture, with what it is multiplied by.
#[derive(Debug, Deserialize)]
pub(super) struct ShaderTexture {
    #[serde(flatten)]
    pub(super) info: TextureInfo,
    #[serde(default = "white")]
    pub(super) factor: [f32; 3],
    /// Whether its values are data as they stand, and not colours in sRGB.
    #[serde(default)]
    pub(super) linear: bool,
}

#[derive(Debug, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct PbrMetallicRoughness {
    pub(super) base_color_factor: [f32; 4],
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: f32,
    pub(super) roughness_factor: f32,
    pub(super) metallic_roughness_texture: Option<TextureInfo>,
}

impl Default for PbrMetallicRoughness {
    fn default() -> Self {
        Self {
            base_color_factor: [1.0; 4],
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct MaterialExtensions {
    #[serde(rename = "KHR_materials_emissive_strength")]
    pub(super) emissive_strength: Option<EmissiveStrength>,
    #[serde(rename = "KHR_materials_ior")]
    pub(super) ior: Option<Ior>,
    #[serde(rename = "KHR_materials_transmission")]
    pub(super) transmission: Option<Transmission>,
    #[serde(rename = "KHR_materials_volume")]
    pub(super) volume: Option<Volume>,
    #[serde(rename = "KHR_materials_clearcoat")]
    pub(super) clearcoat: Option<Clearcoat>,
    #[serde(rename = "KHR_materials_specular")]
    pub(super) specular: Option<Specular>,
    #[serde(rename = "KHR_materials_unlit")]
    pub(super) unlit: Option<IgnoredAny>,
    #[serde(rename = "KHR_materials_pbrSpecularGlossiness")]
    pub(super) specular_glossiness: Option<SpecularGlossiness>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct EmissiveStrength {
    #[serde(default = "one")]
    pub(super) emissive_strength: f32,
}

#[derive(Debug, Deserialize)]
pub(super) struct Ior {
    #[serde(default = "glass")]
    pub(super) ior: f32,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Transmission {
    pub(super) transmission_factor: f32,
    pub(super) transmission_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Volume {
    #[serde(default)]
    pub(super) thickness_factor: f32,
    pub(super) attenuation_distance: Option<f32>,
    #[serde(default = "white")]
    pub(super) attenuation_color: [f32; 3],
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Clearcoat {
    pub(super) clearcoat_factor: f32,
    pub(super) clearcoat_texture: Option<TextureInfo>,
    pub(super) clearcoat_roughness_factor: f32,
    pub(super) clearcoat_roughness_texture: Option<TextureInfo>,
    pub(super) clearcoat_normal_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Specular {
    #[serde(default = "one")]
    pub(super) specular_factor: f32,
    pub(super) specular_texture: Option<TextureInfo>,
    #[serde(default = "white")]
    pub(super) specular_color_factor: [f32; 3],
    pub(super) specular_color_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct SpecularGlossiness {
    #[serde(default = "opaque_white")]
    pub(super) diffuse_factor: [f32; 4],
    pub(super) diffuse_texture: Option<TextureInfo>,
    #[serde(default = "white")]
    pub(super) specular_factor: [f32; 3],
    #[serde(default = "one")]
    pub(super) glossiness_factor: f32,
    pub(super) specular_glossiness_texture: Option<TextureInfo>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureInfo {
    pub(super) index: usize,
    #[serde(default)]
    pub(super) tex_coord: u32,
    /// Of normal textures only.
    #[serde(default = "one")]
    pub(super) scale: f32,
    #[serde(default)]
    pub(super) extensions: TextureInfoExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureInfoExtensions {
    #[serde(rename = "KHR_texture_transform")]
    pub(super) transform: Option<TextureTransform>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct TextureTransform {
    #[serde(default)]
    pub(super) offset: [f32; 2],
    #[serde(default)]
    pub(super) rotation: f32,
    #[serde(default = "unscaled")]
    pub(super) scale: [f32; 2],
    pub(super) tex_coord: Option<u32>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Texture {
    pub(super) name: Option<String>,
    pub(super) sampler: Option<usize>,
    pub(super) source: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Image {
    pub(super) name: Option<String>,
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
pub(super) struct Sampler {
    pub(super) mag_filter: Option<u32>,
    pub(super) wrap_s: Option<u32>,
    pub(super) wrap_t: Option<u32>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Skin {
    pub(super) inverse_bind_matrices: Option<usize>,
    pub(super) joints: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Animation {
    pub(super) name: Option<String>,
    pub(super) channels: Vec<Channel>,
    pub(super) samplers: Vec<AnimationSampler>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct Channel {
    pub(super) sampler: Option<usize>,
    pub(super) target: ChannelTarget,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct ChannelTarget {
    pub(super) node: Option<usize>,
    pub(super) path: String,
    pub(super) extensions: ChannelTargetExtensions,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct ChannelTargetExtensions {
    #[serde(rename = "KHR_animation_pointer")]
    pub(super) pointer: Option<AnimationPointer>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct AnimationPointer {
    pub(super) pointer: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct AnimationSampler {
    pub(super) input: Option<usize>,
    pub(super) output: Option<usize>,
    pub(super) interpolation: Option<String>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Camera {
    pub(super) name: Option<String>,
    pub(super) perspective: Option<Perspective>,
    pub(super) orthographic: Option<Orthographic>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Perspective {
    pub(super) yfov: f32,
    pub(super) aspect_ratio: Option<f32>,
}

#[derive(Debug, Deserialize)]
pub(super) struct Orthographic {
    pub(super) xmag: f32,
    pub(super) ymag: f32,
}

/// An upper bound on the memory that parsing `text` takes, from the punctuation in it: every structure starts with a
/// brace, every array with a bracket, and elements are separated by commas.
pub(super) fn parsed_size(text: &[u8]) -> u64 {
    /// The largest structure with the first node of its maps.
    const STRUCTURE: u64 = 1024;
    /// A string or a map entry.
    const ELEMENT: u64 = 64;
    const _: () = assert!(size_of::<Material>() <= 1024 && size_of::<Node>() <= 1024);
    const _: () = assert!(size_of::<MaterialExtensions>() <= 1024 && size_of::<Primitive>() <= 1024);
    text.iter().fold(text.len() as u64, |size, byte| match byte {
        b'{' => size + STRUCTURE,
        b'[' | b',' => size + ELEMENT,
        _ => size,
    })
}

fn visible() -> bool {
    true
}

fn one() -> f32 {
    1.0
}

fn glass() -> f32 {
    1.5
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

fn opaque_white() -> [f32; 4] {
    [1.0; 4]
}

fn unscaled() -> [f32; 2] {
    [1.0; 2]
}

fn quarter_pi() -> f32 {
    std::f32::consts::FRAC_PI_4
}

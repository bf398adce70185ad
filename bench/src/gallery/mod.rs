//! The gallery of shaders: a picture of each surface shader on a stand, of each light shader on a wall and of each pixel shader
//! on one view, and the pages that list their parameters.

mod page;
mod palette;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use heliostat::builtin::{self, stand};
use heliostat::engine::{Engine, EngineOptions, tone};
use heliostat::formats::image::encode_png;
use heliostat::kernel::glam::{Affine3A, Mat3, Vec3, Vec4};
use heliostat::scene::{
    Backend, Camera, Environment, FrameRequest, Light, LightKind, Material, Mesh, Progress, SceneBuilder,
    ShaderUse,
};
use heliostat::shading::ShaderRegistry;
use heliostat::shading::pixel::PixelRegistry;

/// Edge of a picture, pixels.
const SIZE: u32 = 200;
/// Stops by which all pictures are brightened.
const EXPOSURE: f32 = -0.4;
/// The same for the view of pixel shaders.
const VIEW_EXPOSURE: f32 = 0.5;
/// Largest file that goes into the repository.
const LARGEST_FILE: usize = 40_000;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The folder that gets `shaders.md`, `pixel-shaders.md` and `NAME.png` in folders of the same names
    #[arg(long, default_value = "docs")]
    docs: PathBuf,
    /// Samples per pixel
    #[arg(long, default_value_t = 256)]
    spp: u32,
    /// Render these shaders alone; all by default
    names: Vec<String>,
}

/// Renders the pictures and writes the page; a line per picture goes to stdout.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let registry = ShaderRegistry::built_in();
    let pixel_shaders = PixelRegistry::built_in();
    let lights: Vec<String> = registry.light_infos().map(|info| info.name).collect();
    let known = |name: &String| {
        let surface_or_light = registry.programs().contains_key(name) || lights.contains(name);
        surface_or_light || pixel_shaders.programs().contains_key(name)
    };
    if let Some(name) = arguments.names.iter().find(|name| !known(name)) {
        return Err(format!("there is no shader `{name}`"));
    }
    let spp = arguments.spp;
    pictures(arguments, "shaders", registry.programs().keys(), &|name| picture(name, spp))?;
    pictures(arguments, "shaders", lights.iter(), &|name| lit_wall(name, spp))?;
    pictures(arguments, "pixel-shaders", pixel_shaders.programs().keys(), &|name| view(name, spp))?;
    for (name, text) in
        [("shaders", page::surfaces(&registry)), ("pixel-shaders", page::pixels(&pixel_shaders))]
    {
        let page = arguments.docs.join(name).with_extension("md");
        std::fs::write(&page, text).map_err(|error| format!("{}: {error}", page.display()))?;
    }
    Ok(())
}

/// Renders the pictures of one kind of shaders into a folder of the documentation.
fn pictures<'a>(
    arguments: &Arguments,
    folder: &str,
    names: impl Iterator<Item = &'a String>,
    picture: &dyn Fn(&str) -> Result<Vec<u8>, String>,
) -> Result<(), String> {
    let folder = arguments.docs.join(folder);
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for name in names {
        if !arguments.names.is_empty() && !arguments.names.contains(name) {
            continue;
        }
        let start = Instant::now();
        let png = encode(&picture(name)?)?;
        if png.len() > LARGEST_FILE {
            return Err(format!("{name}: {} bytes are more than {LARGEST_FILE}: raise --spp", png.len()));
        }
        let path = folder.join(format!("{name}.png"));
        std::fs::write(&path, &png).map_err(|error| format!("{}: {error}", path.display()))?;
        crate::result(&format!("{name}: {} bytes, {:.1} s", png.len(), start.elapsed().as_secs_f64()));
    }
    Ok(())
}

/// A view of the office through a pixel shader: RGB bytes.
fn view(name: &str, spp: u32) -> Result<Vec<u8>, String> {
    let progress = Progress::new();
    let shaders = PixelRegistry::built_in();
    let curve = |name: &str| shaders.bind(&ShaderUse::named(name)).map_err(|problem| problem.0);
    let is_curve = curve(name)?.info().for_display;
    let mut engine = Engine::new(EngineOptions::default()).map_err(|error| error.to_string())?;
    let edits = builtin::build("office").ok_or("there is no scene `office`")?;
    engine.apply(&edits, &progress).map_err(|error| error.to_string())?;
    let camera = engine.scene().cameras().values().next().ok_or("the office has no camera")?.clone();
    let mut request = FrameRequest::new(camera, SIZE, SIZE);
    (request.renderer, request.samples) = ("igi".into(), spp.div_ceil(8));
    if !is_curve {
        request.pixel_shaders = vec![ShaderUse::named(name)];
    }
    let frame = engine.render(&request, &progress).map_err(|error| error.to_string())?;
    let shown = curve(if is_curve { name } else { "filmic" })?;
    Ok(tone::tone_map_by(&shown, &frame.color, SIZE, VIEW_EXPOSURE))
}

/// A wall and a floor under a light by a shader, 3 m from the wall: RGB bytes.
fn lit_wall(name: &str, spp: u32) -> Result<Vec<u8>, String> {
    let progress = Progress::new();
    let mut scene = SceneBuilder::new();
    let plaster = scene.material(Material::diffuse("plaster", Vec3::splat(0.7)));
    let wall = scene.mesh(Mesh::quad(Vec3::new(-4.0, 0.0, 0.0), Vec3::X * 8.0, Vec3::Y * 5.0));
    let floor = scene.mesh(Mesh::quad(Vec3::new(-4.0, 0.0, 6.0), Vec3::X * 8.0, Vec3::NEG_Z * 6.0));
    let object = scene.object("corner", [(wall, plaster), (floor, plaster)]);
    scene.instance(object, Affine3A::IDENTITY);
    let kind = LightKind::Shader {
        position: Vec3::new(0.0, 1.6, 3.0),
        world_from_light: Mat3::IDENTITY,
        scale: Vec3::new(50.0, 43.0, 32.0),
        shader: Arc::new(ShaderUse::named(name)),
        range: f32::INFINITY,
    };
    scene.light(Light { name: name.into(), kind });
    // Enough to see where the walls are.
    scene.environment(Environment::Constant(Vec3::splat(0.06)));
    let mut engine = Engine::new(EngineOptions::default()).map_err(|error| error.to_string())?;
    engine.apply(&scene.finish(), &progress).map_err(|error| error.to_string())?;
    let camera = Camera::look_at("", Vec3::new(1.2, 1.8, 5.0), Vec3::new(0.0, 1.5, 0.0), Vec3::Y, 0.8);
    let request = FrameRequest { samples: spp, ..FrameRequest::new(camera, SIZE, SIZE) };
    let frame = engine.render(&request, &progress).map_err(|error| error.to_string())?;
    Ok(tone::tone_map(&frame.color, EXPOSURE))
}

/// A PNG of all colours or, if that is too large, of 256.
fn encode(rgb: &[u8]) -> Result<Vec<u8>, String> {
    let whole = encode_png(SIZE, SIZE, rgb).map_err(|error| error.to_string())?;
    if whole.len() <= LARGEST_FILE { Ok(whole) } else { palette::encode(SIZE, SIZE, rgb) }
}

/// How a shader is shown: the material that it starts from, the ball's diameter in metres, and parameters that differ from
/// the defaults.
fn exhibit(name: &str) -> (Material, f32, ShaderUse) {
    let plain = Material { base_color: opaque(0.62, 0.60, 0.57), roughness: 0.35, ..Material::default() };
    let metal =
        Material { metallic: 1.0, base_color: opaque(0.91, 0.68, 0.42), roughness: 0.2, ..plain.clone() };
    let water = Material { base_color: opaque(0.02, 0.09, 0.12), roughness: 0.08, ..plain.clone() };
    let shader = ShaderUse::named(name);
    match name {
        "brick" => (plain, 1.0, shader),
        "checker" => (plain, 1.0, shader),
        "dents" => (metal, 0.24, shader),
        "foliage" => (plain, 0.24, shader.with("repeat", 9.0)),
        "glass" => (Material::glass("", 1.5), 0.24, shader),
        "ripples" => (water, 0.24, shader),
        "show-depth" => (plain, 0.24, shader.with("near", 2.5).with("far", 4.5)),
        "show-level" => (Material::metal("", Vec3::splat(0.9), 0.0), 0.24, shader.with("levels", 4.0)),
        "show-uv" => (plain, 0.24, shader.with("repeat", 4.0)),
        _ => (plain, 0.24, shader),
    }
}

fn opaque(red: f32, green: f32, blue: f32) -> Vec4 {
    Vec4::new(red, green, blue, 1.0)
}

/// RGB bytes.
fn picture(name: &str, spp: u32) -> Result<Vec<u8>, String> {
    let progress = Progress::new();
    let (material, diameter, shader) = exhibit(name);
    let shaded = Material { shader: Some(Arc::new(shader)), ..material.clone() };
    // Levels show where mirrors see them: on the floor around.
    let (on_stand, on_floor) = match name {
        "show-level" => (material, Some(shaded)),
        _ if name.starts_with("show-") => (shaded.clone(), Some(shaded)),
        _ => (shaded, None),
    };
    let mut engine = Engine::new(EngineOptions::default()).map_err(|error| error.to_string())?;
    engine.apply(&stand(&on_stand, on_floor, diameter), &progress).map_err(|error| error.to_string())?;
    let camera = engine.scene().cameras().values().next().ok_or("the stand has no camera")?.clone();
    let request = FrameRequest { samples: spp, ..FrameRequest::new(camera, SIZE, SIZE) };
    let frame = engine.render(&request, &progress).map_err(|error| error.to_string())?;
    // The same exposure for all, so that shaders can be compared.
    Ok(tone::tone_map(&frame.color, EXPOSURE))
}

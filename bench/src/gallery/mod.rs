//! The gallery of surface shaders: a picture of each on a stand, and the page that lists their parameters.

mod page;
mod palette;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use heliostat::builtin::stand;
use heliostat::engine::{Engine, EngineOptions, tone};
use heliostat::formats::image::encode_png;
use heliostat::kernel::glam::{Vec3, Vec4};
use heliostat::scene::{Backend, FrameRequest, Material, Progress, ShaderUse};
use heliostat::shading::ShaderRegistry;

/// Edge of a picture, pixels.
const SIZE: u32 = 200;
/// Stops by which all pictures are brightened.
const EXPOSURE: f32 = -0.4;
/// Largest file that goes into the repository.
const LARGEST_FILE: usize = 40_000;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The folder that gets `shaders.md` and `shaders/NAME.png`
    #[arg(long, default_value = "docs")]
    docs: PathBuf,
    /// Samples per pixel
    #[arg(long, default_value_t = 64)]
    spp: u32,
    /// Render these shaders alone; all by default
    names: Vec<String>,
}

/// Renders the pictures and writes the page; a line per picture goes to stdout.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let registry = ShaderRegistry::built_in();
    let unknown = arguments.names.iter().find(|name| !registry.programs().contains_key(*name));
    if let Some(name) = unknown {
        return Err(format!("there is no shader `{name}`"));
    }
    let folder = arguments.docs.join("shaders");
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for name in registry.programs().keys() {
        if !arguments.names.is_empty() && !arguments.names.contains(name) {
            continue;
        }
        let start = Instant::now();
        let png = encode(&picture(name, arguments.spp)?)?;
        if png.len() > LARGEST_FILE {
            return Err(format!("{name}: {} bytes are more than {LARGEST_FILE}: raise --spp", png.len()));
        }
        let path = folder.join(format!("{name}.png"));
        std::fs::write(&path, &png).map_err(|error| format!("{}: {error}", path.display()))?;
        crate::result(&format!("{name}: {} bytes, {:.1} s", png.len(), start.elapsed().as_secs_f64()));
    }
    let page = arguments.docs.join("shaders.md");
    std::fs::write(&page, page::markdown(&registry)).map_err(|error| format!("{}: {error}", page.display()))
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

//! File formats: bytes in, edits and diagnostics out.
//!
//! [`load`] reads a scene from a file, [`load_bytes`] from memory; [`image`] reads and writes pictures. The format is
//! recognised by content first and by extension second.
//!
//! | format | what is read |
//! |---|---|
//! | glTF 2.0 (`.gltf`, `.glb`) | see [`gltf`](mod@crate::gltf) |
//! | Wavefront OBJ with MTL (`.obj`) | see [`obj`](mod@crate::obj) |
//! | Stanford PLY (`.ply`) | see [`ply`](mod@crate::ply) |
//! | Animated File Format of BART (`.aff`) | see [`aff`](mod@crate::aff) |
//! | Neutral File Format of the SPD (`.nff`) | see [`nff`](mod@crate::nff) |
//! | Quake III Arena maps (`.bsp`) | see [`bsp`](mod@crate::bsp) |
//! | photometric files (`.ies`, Radiance's `.dat`) | see [`ies`](mod@crate::ies) |
//!
//! Text formats and PLY may be compressed (`.gz`). Scenes keep the up axis of the file, which is +Y by rule or custom;
//! NFF and BSP are turned to it.
//!
//! Nothing here panics on bad input or takes more than the [`Limits`] allow; the edits of a successful load are
//! accepted by an empty `Scene`.
//!
//! ```
//! use heliostat_formats::{Limits, NoFiles, load_bytes};
//!
//! let text = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
//! let loaded = load_bytes("triangle.obj", text, &NoFiles, &Limits::default())?;
//! assert_eq!(loaded.diagnostics, []);
//! let mut scene = heliostat_scene::Scene::default();
//! scene.apply(&loaded.edits).unwrap();
//! # Ok::<(), heliostat_formats::LoadError>(())
//! ```
#![forbid(unsafe_code)]

use std::path::Path;
use std::sync::Arc;

use heliostat_scene::{Edit, Material, Timeline};

pub mod aff;
pub mod bsp;
mod context;
mod diagnostic;
mod error;
pub mod gltf;
pub mod ies;
pub mod image;
mod limits;
pub mod nff;
mod normals;
pub mod obj;
mod place;
pub mod ply;
mod source;
mod text;
mod textures;
mod triangulate;

use context::Context;

pub use diagnostic::{Diagnostic, Severity};
pub use error::{Details, LoadError};
pub use limits::Limits;
pub use place::{Place, Snippet, Spot};
pub use source::{Directory, FileSource, Memory, NoFiles, SourceError};

/// A scene as read from a file.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// What to apply to an empty scene. Handles count from 0 in each kind.
    pub edits: Vec<Edit>,
    /// How the scene moves; empty for formats and files without motion.
    pub timeline: Timeline,
    /// What the user should know, in the order found.
    pub diagnostics: Vec<Diagnostic>,
}

/// Reads a scene file and the files it refers to.
///
/// # Errors
/// [`LoadError`] when the file cannot be read, is broken, exceeds a limit or needs something unsupported.
pub fn load(path: &Path, limits: &Limits) -> Result<Loaded, LoadError> {
    let name = path.display().to_string();
    let bytes = source::read_named(path, limits)?;
    let directory = Directory(path.parent().unwrap_or(Path::new("")).to_path_buf());
    load_bytes(&name, &bytes, &directory, limits)
}

/// Reads a scene from `bytes`; `name` serves to tell the format and to name the file in messages, `source` delivers
/// the files it refers to.
///
/// # Errors
/// As for [`load`].
pub fn load_bytes(
    name: &str,
    bytes: &[u8],
    source: &dyn FileSource,
    limits: &Limits,
) -> Result<Loaded, LoadError> {
    let file: Arc<str> = name.into();
    let mut context = Context::new(limits, source);
    if bytes.len() as u64 > limits.file_bytes {
        let size = bytes.len() as u64;
        return Err(LoadError::limit(Place::whole(&file), "bytes", size, "file_bytes", limits.file_bytes));
    }
    context.charge(bytes.len() as u64, &Place::whole(&file))?;
    let (bytes, name) = if bytes.starts_with(&[0x1F, 0x8B]) {
        let plain = context.gunzip(&file, bytes)?;
        (std::borrow::Cow::Owned(plain), name.strip_suffix(".gz").unwrap_or(name))
    } else {
        (std::borrow::Cow::Borrowed(bytes), name)
    };
    let still = |edits| (edits, Timeline::default());
    let (edits, timeline) = match Format::recognise(&file, name, &bytes)? {
        Format::Aff => aff::load(&mut context, &file, &bytes)?,
        Format::Bsp => still(bsp::load(&mut context, &file, &bytes)?),
        Format::Glb => gltf::load_glb(&mut context, &file, &bytes)?,
        Format::Gltf => gltf::load_gltf(&mut context, &file, &bytes)?,
        Format::Ies => still(ies::load(&mut context, &file, &bytes)?),
        Format::Nff => still(nff::load(&mut context, &file, &bytes)?),
        Format::Obj => still(obj::load(&mut context, &file, &bytes)?),
        Format::Ply => still(ply::load(&mut context, &file, &bytes)?),
    };
    Ok(Loaded { edits, timeline, diagnostics: context.finish(&file) })
}

/// The scene formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Aff,
    Bsp,
    Glb,
    Gltf,
    Ies,
    Nff,
    Obj,
    Ply,
}

impl Format {
    /// By content; OBJ, NFF and AFF, which have no signature, also by extension.
    fn recognise(file: &Arc<str>, name: &str, bytes: &[u8]) -> Result<Self, LoadError> {
        let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
        if bytes.starts_with(b"glTF") {
            return Ok(Self::Glb);
        }
        if bytes.starts_with(b"IBSP") {
            return Ok(Self::Bsp);
        }
        if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
            return Ok(Self::Ply);
        }
        if text.starts_with(b"IESNA") || text.starts_with(b"IES:LM-63") {
            return Ok(Self::Ies);
        }
        if text.starts_with(b"{") {
            return Ok(Self::Gltf);
        }
        let extension = name.rsplit_once('.').map_or("", |(_, e)| e).to_ascii_lowercase();
        let expected = match extension.as_str() {
            "gltf" => "a JSON document, which starts with `{`",
            "bsp" => "a map of Quake III Arena, which starts with `IBSP`",
            "glb" => "binary glTF, which starts with `glTF`",
            "ply" => "a PLY file, which starts with `ply`",
            "obj" => return Ok(Self::Obj),
            "nff" => return Ok(Self::Nff),
            "aff" => return Ok(Self::Aff),
            "ies" | "dat" => return Ok(Self::Ies),
            _ if looks_like_nff(text) => return Ok(Self::Nff),
            _ if looks_like_obj(text) => return Ok(Self::Obj),
            _ => {
                let problem =
                    if bytes.is_empty() { "the file is empty" } else { "this is no known scene format" };
                let hint = "give a glTF (.gltf, .glb), OBJ, PLY, NFF, AFF, BSP or IES file";
                return Err(LoadError::unsupported(Place::whole(file), problem, hint));
            }
        };
        let hint = "the file may be damaged or have the wrong extension";
        Err(LoadError::input(Place::whole(file), format!("this is not {expected}"), hint))
    }
}

/// Whether the first statement is one that OBJ files start with.
fn looks_like_obj(text: &[u8]) -> bool {
    let statement =
        text.split(|&b| b == b'\n').map(<[u8]>::trim_ascii).find(|l| !l.is_empty() && l[0] != b'#');
    let word = statement.and_then(|l| l.split(u8::is_ascii_whitespace).next());
    matches!(word, Some(b"v" | b"vt" | b"vn" | b"o" | b"g" | b"mtllib" | b"usemtl"))
}

/// Whether the file has a view as in NFF, in its first lines.
fn looks_like_nff(text: &[u8]) -> bool {
    let mut words = text.split(|&b| b == b'\n').map(<[u8]>::trim_ascii).take(100);
    words.any(|line| line == b"v") && words.next().is_some_and(|line| line.starts_with(b"from "))
}

/// The name of a file without directories and extensions: what an object is called that has no other name.
fn stem(file: &str) -> &str {
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let name = name.strip_suffix(".gz").unwrap_or(name);
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// What surfaces without a material look like: a Lambertian that reflects half of the light.
fn neutral_material(name: &str) -> Material {
    Material::diffuse(name, glam::Vec3::splat(0.5))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_content_first() {
        let load = |name: &str, bytes: &[u8]| load_bytes(name, bytes, &NoFiles, &Limits::default());
        let obj = b"# a comment\n\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3";
        assert!(load("upload", obj).is_ok());
        let gltf = br#" {"asset": {"version": "2.0"}}"#;
        assert!(load("wrong.obj", gltf).is_ok());
        let error = |name: &str, bytes: &[u8]| load(name, bytes).unwrap_err().to_string();
        assert!(error("a.ply", b"solid").starts_with("a.ply: this is not a PLY file"));
        assert!(error("a.glb", b"glTG").contains("not binary glTF"));
        assert!(error("a.gltf", b"").contains("not a JSON document"));
        assert!(error("a.stl", b"solid x").contains("no known scene format"));
        assert!(error("a", b"").contains("the file is empty"));
    }

    #[test]
    fn a_file_that_is_not_there_is_an_io_error() {
        let error = load(Path::new("no/such.obj"), &Limits::default()).unwrap_err();
        assert!(matches!(error, LoadError::Io { .. }));
        assert!(error.to_string().starts_with("no/such.obj: cannot be read"), "{error}");
        assert!(matches!(load(Path::new("."), &Limits::default()), Err(LoadError::Io { .. })));
    }

    #[test]
    fn long_lists_of_diagnostics_are_cut_and_counted() {
        let text: String = (0..20).map(|i| format!("usemtl m{i}\nf 1 2 3\n")).collect();
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{text}");
        let limits = Limits { diagnostics: 5, ..Limits::default() };
        let loaded = load_bytes("a.obj", text.as_bytes(), &NoFiles, &limits).unwrap();
        assert_eq!(loaded.diagnostics.len(), 6);
        assert!(loaded.diagnostics[5].message.starts_with("15 more diagnostics"));
    }
}

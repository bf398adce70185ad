//! Animated File Format: the scenes of BART, a benchmark for animated ray tracing.
//!
//! AFF is [NFF](crate::nff) with motion. Beside all of NFF this reads:
//!
//! | statement | what becomes of it |
//! |---|---|
//! | `fm` | a fill with ambient, diffuse and specular colours |
//! | `tt`, `ttp` | triangles with texture coordinates, and with normals |
//! | `m` | meshes: vertices, normals, texture coordinates, triangles |
//! | `tpa` | animated triangles: a deforming mesh, linear between its keys |
//! | `xs`, `x name` `{` … `}` | transforms, fixed or animated: instances nested in one another |
//! | `k name {` … `}` | keyframes of what has that name: `transl`, `rot`, `scale`, `visibility` |
//! | `la name` | a light that keyframes move; their translation takes the place of its position |
//! | `a start end frames` | the span of the animation, which becomes 0 to its duration, and the frame rate |
//! | `am` | ambient light, 1 where the file does not say: what it makes of the ambient colours is [`Material::ambient`] |
//! | `d level`, `i level file` | detail: files of a higher level than the current one are left out |
//!
//! Keyframes called `camera` move the view. What they do not animate keeps the value of `v`.
//!
//! Transforms apply their scale first, then the rotation, then the translation; around them stand those of the blocks
//! outside. Every block becomes an object, except that blocks that hold nothing but another one are one instance with it,
//! and that plain fixed blocks join what holds them. So a keyframed block is one instance, and moving it leaves everything
//! below it alone. A file that is included several times under the same fill is one object in several places. Fills are
//! not confined to blocks and files: they hold until the next one, as in the format's own programs.
//!
//! Interpolation is the format's: see the references of its splines below. At least four keys make a curve, of which the
//! outermost only give direction.
//!
//! Textures multiply the diffuse and the ambient colour and repeat; v runs downwards. They are looked for beside the file and in a folder
//! `TextureFiles` there or beside its folder. +Y is up. Colours, reflections and lights are as for NFF, except that all
//! lights bring their colour.
//!
//! [`Material::ambient`]: heliostat_scene::Material::ambient
//!
//! # References
//! Lext, Assarsson, Möller, "BART: A Benchmark for Animated Ray Tracing", 2000, and IEEE Computer Graphics and
//! Applications 21(2), 2001. Kochanek, Bartels, "Interpolating Splines with Local Tension, Continuity, and Bias Control",
//! 1984. Shoemake, "Quaternion Calculus and Fast Animation", 1987.

use std::sync::Arc;

use heliostat_scene::{Clip, Edit, Timeline};

use crate::context::Context;
use crate::error::LoadError;
use crate::nff::tokens::Tokens;

mod graph;
mod keyframes;
mod mesh;
mod motion;
mod reader;
mod spline;
mod textures;

#[cfg(test)]
mod tests;

pub(crate) fn load(
    context: &mut Context<'_>,
    file: &Arc<str>,
    bytes: &[u8],
) -> Result<(Vec<Edit>, Timeline), LoadError> {
    let mut reader = reader::Reader::new(context);
    reader.read(file, bytes)?;
    let (edits, motion, frame_rate) = reader.finish(file)?;
    if motion.is_empty() {
        return Ok((edits, Timeline::default()));
    }
    let clip = Clip { name: crate::stem(file).into(), frame_rate, motion: Arc::new(motion) };
    Ok((edits, Timeline::new(vec![clip])))
}

/// The `{` that must follow.
fn open_brace(tokens: &mut Tokens<'_>) -> Result<(), LoadError> {
    if tokens.take(b"{") {
        return Ok(());
    }
    tokens.word();
    Err(tokens.error("`{` should follow here", "what belongs to it stands between `{` and `}`"))
}

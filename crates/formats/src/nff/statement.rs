//! The statements that NFF and AFF share, from words to values.

use glam::Vec3;
use heliostat_scene::{Camera, Quadric};

use super::tokens::Tokens;
use crate::context::Context;
use crate::error::LoadError;

/// Corners of a polygon with their normals, if it has any; reused from polygon to polygon.
#[derive(Default)]
pub(crate) struct Polygon {
    pub(crate) corners: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
}

/// `v`: the point of view, in the file's space, and which way is up there.
pub(crate) fn view(context: &mut Context<'_>, tokens: &mut Tokens<'_>) -> Result<(Camera, Vec3), LoadError> {
    let place = tokens.place();
    let (mut from, mut at, mut up, mut angle) = (None, None, None, None);
    loop {
        match tokens.peek() {
            Some(b"from") => from = Some(after_word(tokens)?),
            Some(b"at") => at = Some(after_word(tokens)?),
            Some(b"up") => up = Some(after_word(tokens)?),
            Some(b"angle") => {
                tokens.word();
                angle = Some(tokens.float("the angle")?);
            }
            // Nothing is cut off near the eye.
            Some(b"hither") => {
                tokens.word();
                tokens.float("`hither`")?;
            }
            // The size of the picture is the user's choice.
            Some(b"resolution") => {
                tokens.word();
                tokens.float("the width")?;
                tokens.float("the height")?;
            }
            _ => break,
        }
    }
    let (Some(from), Some(at), Some(up), Some(angle)) = (from, at, up, angle) else {
        let hint = "a view has `from`, `at`, `up`, `angle`, `hither` and `resolution`";
        return Err(tokens.error("the view is incomplete before this word", hint));
    };
    let mut camera = Camera::look_at("view", from, at, up, angle.to_radians());
    if let Some(problem) = camera.problem() {
        context.warn(place, format!("the view is unusable: {problem}"), "a plain one took its place");
        camera = Camera::look_at("view", Vec3::Z, Vec3::ZERO, Vec3::Y, 0.8);
    }
    Ok((camera, up))
}

fn after_word(tokens: &mut Tokens<'_>) -> Result<Vec3, LoadError> {
    tokens.word();
    tokens.vector("a coordinate of the view")
}

/// `l` after the keyword: position, and colour if there is one.
pub(crate) fn light(tokens: &mut Tokens<'_>) -> Result<(Vec3, Option<Vec3>), LoadError> {
    let position = tokens.vector("the light's position")?;
    if !position.is_finite() {
        return Err(tokens.error(format!("the light's position is {position}"), "give finite numbers"));
    }
    let color = match tokens.number_follows() {
        true => Some(tokens.color("the light's colour")?),
        false => None,
    };
    Ok((position, color))
}

/// `s`.
pub(crate) fn sphere(tokens: &mut Tokens<'_>) -> Result<Quadric, LoadError> {
    Ok(Quadric::Sphere { center: tokens.vector("the centre")?, radius: tokens.float("the radius")? })
}

/// `c`. Radii of opposite signs, which would cross in the middle, are an error.
pub(crate) fn cone(tokens: &mut Tokens<'_>) -> Result<Quadric, LoadError> {
    let (base, base_radius) = (tokens.vector("the base")?, tokens.float("the base radius")?);
    let (apex, apex_radius) = (tokens.vector("the apex")?, tokens.float("the apex radius")?);
    if base_radius * apex_radius < 0.0 {
        let problem = format!("the radii {base_radius} and {apex_radius} have opposite signs");
        return Err(tokens.error(problem, "give both the same sign: negative ones show the inside"));
    }
    Ok(Quadric::Cone { base, base_radius, apex, apex_radius })
}

/// `p` and `pp` after the keyword.
pub(crate) fn polygon(
    context: &mut Context<'_>,
    tokens: &mut Tokens<'_>,
    polygon: &mut Polygon,
    has_normals: bool,
) -> Result<(), LoadError> {
    let count = tokens.count("the number of corners", 3)? as usize;
    let place = tokens.place();
    polygon.corners.clear();
    polygon.normals.clear();
    for i in 0..count {
        polygon.corners.push(tokens.vector("a coordinate")?);
        if has_normals {
            polygon.normals.push(tokens.vector("a normal")?);
        }
        // Now and then, so that nothing grows far beyond the limits before they are looked at.
        if i % 4096 == 4095 {
            context.charge(4096 * 24, &place)?;
        }
    }
    context.count_mesh(count, count - 2, &place)
}

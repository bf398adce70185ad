//! Keyframes: `k` with translations, rotations, scales and visibility.

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

use super::spline::{Key, Path, Turning};
use crate::context::Context;
use crate::error::LoadError;
use crate::nff::tokens::Tokens;

/// How something called by a name moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Animation {
    pub(super) translation: Option<Path>,
    pub(super) rotation: Option<Turning>,
    scale: Option<Path>,
    /// From these times on it is visible or not; before them it is.
    visibility: Vec<(f64, bool)>,
}

impl Animation {
    /// `k` after the keyword: a name and its keys.
    pub(super) fn parse(
        context: &mut Context<'_>,
        tokens: &mut Tokens<'_>,
    ) -> Result<(String, Self), LoadError> {
        let name = tokens.name("the name of what moves")?;
        super::open_brace(tokens)?;
        let mut animation = Self::default();
        while !tokens.take(b"}") {
            let kind = tokens.name("a kind of keys, or `}`,")?;
            let place = tokens.place();
            match kind.as_str() {
                "transl" => animation.translation = Some(Path::new(&keys(context, tokens, position)?)),
                "scale" => animation.scale = Some(Path::new(&keys(context, tokens, position)?)),
                "rot" => animation.rotation = Some(Turning::new(&keys(context, tokens, rotation)?)),
                "visibility" => {
                    let count = tokens.count("the number of keys", 1)?;
                    for _ in 0..count {
                        context.charge(16, &place)?;
                        let time = f64::from(tokens.float("the time")?);
                        animation.visibility.push((time, tokens.float("0 or 1")? != 0.0));
                    }
                }
                _ => {
                    let hint = "there are `transl`, `rot`, `scale` and `visibility`";
                    return Err(tokens.error(format!("`{kind}` is no kind of keys"), hint));
                }
            }
        }
        Ok((name, animation))
    }

    /// Scale first, then rotation, then translation; `None` where the numbers overflow.
    pub(super) fn matrix(&self, time: f64) -> Option<DAffine3> {
        let translation = self.translation.as_ref().map_or(Some(DVec3::ZERO), |path| path.at(time))?;
        let rotation = self.rotation.as_ref().map_or(Some(DQuat::IDENTITY), |turn| turn.at(time))?;
        let scale = self.scale.as_ref().map_or(Some(DVec3::ONE), |path| path.at(time))?;
        Some(DAffine3::from_scale_rotation_translation(scale, rotation, translation))
    }

    /// Where a camera stands and looks: what is not animated is kept.
    pub(super) fn camera(&self, time: f64, rest: DAffine3) -> Option<DAffine3> {
        let translation = self.translation.as_ref().map_or(Some(rest.translation), |path| path.at(time))?;
        let axes = match &self.rotation {
            Some(turn) => DMat3::from_quat(turn.at(time)?),
            None => rest.matrix3,
        };
        Some(DAffine3 { matrix3: axes, translation })
    }

    pub(super) fn visible(&self, time: f64) -> bool {
        let past = self.visibility.iter().take_while(|(from, _)| *from <= time);
        past.last().is_none_or(|(_, visible)| *visible)
    }

    pub(super) fn has_visibility(&self) -> bool {
        !self.visibility.is_empty()
    }

    /// First and last time at which anything changes.
    pub(super) fn span(&self) -> Option<(f64, f64)> {
        let shown = || Some((self.visibility.first()?.0, self.visibility.last()?.0));
        let spans = [
            self.translation.as_ref().and_then(Path::span),
            self.rotation.as_ref().and_then(Turning::span),
            self.scale.as_ref().and_then(Path::span),
            shown(),
        ];
        spans.into_iter().flatten().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }
}

/// Scale, rotation in degrees around an axis, translation.
pub(super) fn fixed(scale: Vec3, axis: Vec3, degrees: f32, translation: Vec3) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(scale.as_dvec3(), turn(axis, degrees), translation.as_dvec3())
}

/// No rotation where the axis has no direction.
fn turn(axis: Vec3, degrees: f32) -> DQuat {
    let axis = axis.as_dvec3().try_normalize();
    axis.map_or(DQuat::IDENTITY, |axis| DQuat::from_axis_angle(axis, f64::from(degrees).to_radians()))
}

fn rotation(tokens: &mut Tokens<'_>) -> Result<DQuat, LoadError> {
    let axis = tokens.vector("the axis")?;
    Ok(turn(axis, tokens.float("the angle")?))
}

/// At least four keys: time, value, tension, continuity, bias.
fn keys<T>(
    context: &mut Context<'_>,
    tokens: &mut Tokens<'_>,
    value: impl Fn(&mut Tokens<'_>) -> Result<T, LoadError>,
) -> Result<Vec<Key<T>>, LoadError> {
    let count = tokens.count("the number of keys", 4)?;
    let place = tokens.place();
    let mut keys: Vec<Key<T>> = Vec::new();
    let mut back = false;
    for _ in 0..count {
        // A key and the piece of the curve that it begins.
        context.charge(256, &place)?;
        let time = finite(tokens, "the time")?;
        if !back && keys.last().is_some_and(|last| last.time > time) {
            back = true;
            let message = format!("the time {time} lies before the last key's");
            context.warn(tokens.place(), message, "keys are passed over until their times go on");
        }
        keys.push(Key {
            time,
            value: value(tokens)?,
            tension: finite(tokens, "the tension")?,
            continuity: finite(tokens, "the continuity")?,
            bias: finite(tokens, "the bias")?,
        });
    }
    Ok(keys)
}

fn finite(tokens: &mut Tokens<'_>, what: &str) -> Result<f64, LoadError> {
    let value = tokens.float(what)?;
    if value.is_finite() {
        return Ok(f64::from(value));
    }
    Err(tokens.error(format!("{what} is {value}"), "give a finite number"))
}

fn position(tokens: &mut Tokens<'_>) -> Result<DVec3, LoadError> {
    Ok(tokens.vector("the value")?.as_dvec3())
}

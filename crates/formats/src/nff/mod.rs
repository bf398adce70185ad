//! Neutral File Format: the scenes of Haines' Standard Procedural Databases.
//!
//! All of it is read: the view `v`, lights `l` with or without a colour, the background `b`, fills `f`, spheres `s`,
//! cones and cylinders `c`, polygons `p`, patches `pp` with normals, and comments (`#`, and `%` as in
//! [AFF](crate::aff)). Spheres and cones stay [analytic](heliostat_scene::Quadric); negative radii turn them inside
//! out. What is no statement is ignored with a warning.
//!
//! A file becomes one object with one part per material and kind of shape. The axis nearest to the view's `up` decides
//! how it stands: where that is +Z, as in most files, everything is turned by −90° about X, so that +Y is up.
//!
//! The format says how surfaces and lights of a classical ray tracer look. Here that becomes:
//!
//! - Such programs showed the numbers they computed as they were. So colours, and with them `Kd`, `Ks` and `T`, are those
//!   of the screen: they are decoded from sRGB, as textures are, and a fully lit white wall of `Kd` 0.5 looks half as bright
//!   on the screen. Lights are linear, so that two of them light as much as their sum.
//! - `rgb · Kd` is the diffuse reflectance, at most 1.
//! - `Ks` is the reflectance of a coat over it, uncoloured and the same at all angles. Reflections are sharp whatever
//!   `Shine` says, as they were: the coat's perceptual roughness is that of the Phong exponent `Shine`, but at most 0.1,
//!   which leaves a highlight where a perfect mirror has none.
//! - `T` above 0 is glass of the index given, without `Ks`: it passes `rgb · T` and scatters `rgb · Kd`. With an index of
//!   at most 1 it is a thin sheet.
//! - A light without colour has one of 1/√n, n being the number of lights. Lights shine alike at any distance
//!   ([`LightKind::ConstantPoint`]); a colour of 1 shows a white surface that faces the light as 1, for which it takes an
//!   irradiance of π.
//! - The background is an environment of this radiance: it is seen, and it gives light.
//!
//! # References
//! Haines, "A Proposal for Standard Graphics Environments", 1987, and the format's description in the Standard
//! Procedural Databases, version 3. Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough
//! Surfaces", 2007, section 5 (Phong exponent and α).

use std::collections::HashMap;
use std::f32::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use glam::{Affine3A, Vec3};
use heliostat_scene::{Camera, Edit, Environment, Light, LightKind, MaterialId, SceneBuilder};

use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;
use fill::{Fill, FillKey, linear};
use shapes::Shapes;
use statement::Polygon;
use tokens::Tokens;

pub(crate) mod fill;
pub(crate) mod shapes;
pub(crate) mod statement;
pub(crate) mod tokens;

#[cfg(test)]
mod tests;

pub(crate) fn load(context: &mut Context<'_>, file: &Arc<str>, bytes: &[u8]) -> Result<Vec<Edit>, LoadError> {
    let mut reader = Reader {
        builder: SceneBuilder::new(),
        shapes: Shapes::default(),
        fill: Fill::NEUTRAL,
        materials: HashMap::new(),
        view: None,
        lights: Vec::new(),
        background: Vec3::ZERO,
        polygon: Polygon::default(),
    };
    let mut tokens = Tokens::new(file, bytes);
    let mut ignored = Ignored::default();
    while let Some(keyword) = tokens.word() {
        if !reader.statement(context, &mut tokens, keyword)? {
            ignored.tell(context, &mut tokens, keyword);
        }
    }
    reader.finish(context, file)
}

struct Reader {
    builder: SceneBuilder,
    shapes: Shapes,
    fill: Fill,
    materials: HashMap<FillKey, MaterialId>,
    /// With the direction that is up.
    view: Option<(Camera, Vec3)>,
    lights: Vec<(Vec3, Option<Vec3>)>,
    background: Vec3,
    polygon: Polygon,
}

impl Reader {
    /// Reads what follows a keyword; `false` if it is none.
    fn statement(
        &mut self,
        context: &mut Context<'_>,
        tokens: &mut Tokens<'_>,
        keyword: &[u8],
    ) -> Result<bool, LoadError> {
        match keyword {
            b"v" => self.view = Some(statement::view(context, tokens)?),
            b"b" => self.background = linear(tokens.color("the background")?),
            b"l" => {
                context.charge(64, &tokens.place())?;
                self.lights.push(statement::light(tokens)?);
            }
            b"f" => self.fill = Fill::parse(tokens)?,
            b"s" => {
                let shape = statement::sphere(tokens)?;
                context.charge(size_of_val(&shape) as u64, &tokens.place())?;
                let material = self.material(context, tokens)?;
                self.shapes.quadric(material, shape);
            }
            b"c" => {
                let shape = statement::cone(tokens)?;
                context.charge(size_of_val(&shape) as u64, &tokens.place())?;
                let material = self.material(context, tokens)?;
                self.shapes.quadric(material, shape);
            }
            b"p" | b"pp" => {
                statement::polygon(context, tokens, &mut self.polygon, keyword == b"pp")?;
                let material = self.material(context, tokens)?;
                self.shapes.polygon(material, &self.polygon);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn material(&mut self, context: &mut Context<'_>, tokens: &Tokens<'_>) -> Result<MaterialId, LoadError> {
        if let Some(&known) = self.materials.get(&self.fill.key()) {
            return Ok(known);
        }
        context.count_materials(1, &tokens.place())?;
        let id = self.builder.material(self.fill.material(format!("fill {}", self.materials.len())));
        self.materials.insert(self.fill.key(), id);
        Ok(id)
    }

    fn finish(mut self, context: &mut Context<'_>, file: &Arc<str>) -> Result<Vec<Edit>, LoadError> {
        if self.shapes.is_empty() && self.view.is_none() {
            let hint = "an NFF file has lines such as `v` with a view and `s 0 0 0 1`";
            return Err(LoadError::input(Place::whole(file), "the file has no view and no shapes", hint));
        }
        if self.shapes.is_empty() {
            context.warn(Place::whole(file), "the file has no shapes; nothing is shown", "");
        }
        let turn = upright(self.view.as_ref().map_or(Vec3::Y, |(_, up)| *up));
        if let Some((mut camera, _)) = self.view {
            camera.world_from_camera = turn * camera.world_from_camera;
            self.builder.camera(camera);
        }
        for light in lights(&self.lights, &turn) {
            self.builder.light(light);
        }
        if self.background != Vec3::ZERO {
            self.builder.environment(Environment::Constant(self.background));
        }
        let parts = self.shapes.finish(&mut self.builder);
        let object = self.builder.object(crate::stem(file), parts);
        self.builder.instance(object, turn);
        Ok(self.builder.finish())
    }
}

/// What brings a file whose view has this `up` to stand on the ground: the turn from +Z up to +Y up, or nothing.
fn upright(up: Vec3) -> Affine3A {
    let others = up.x.abs().max(up.y.abs());
    if up.z > others { Affine3A::from_rotation_x(-FRAC_PI_2) } else { Affine3A::IDENTITY }
}

/// The scene's lights: see the documentation of the format.
pub(crate) fn lights(lights: &[(Vec3, Option<Vec3>)], world_from_file: &Affine3A) -> Vec<Light> {
    let common = Vec3::splat(1.0 / (lights.len() as f32).sqrt());
    let light = |(index, (position, color)): (usize, &(Vec3, Option<Vec3>))| Light {
        name: format!("light {index}"),
        kind: LightKind::ConstantPoint {
            position: world_from_file.transform_point3(*position),
            irradiance: (PI * color.unwrap_or(common)).min(Vec3::splat(f32::MAX)),
        },
    };
    lights.iter().enumerate().map(light).collect()
}

/// Words that are no statements, of which each kind is told of once.
#[derive(Default)]
pub(crate) struct Ignored {
    known: Vec<Vec<u8>>,
    numbers: bool,
}

impl Ignored {
    /// Warns and passes over the rest of the line.
    pub(crate) fn tell(&mut self, context: &mut Context<'_>, tokens: &mut Tokens<'_>, word: &[u8]) {
        let place = tokens.place();
        tokens.skip_line();
        if crate::text::parse_f32(word).is_some() {
            if !std::mem::replace(&mut self.numbers, true) {
                let hint = "a statement before may have more numbers than it should";
                context.warn(place, "a number where a statement should begin; its line was ignored", hint);
            }
        } else if self.known.len() < 32 && self.known.iter().all(|known| known != word) {
            let shown = String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
            context.warn(place, format!("`{shown}` is no statement; its line was ignored"), "");
            self.known.push(word.to_vec());
        }
    }
}

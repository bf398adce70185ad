//! Maps of Quake III Arena and games made of it: BSP, version 46 (`IBSP`).
//!
//! All four kinds of faces are read: polygons, Bézier patches, meshes, and flares, which are sprites of the game and left
//! out. Patches are cut to 0.25 units (8 mm; coarser where straight borders bound a strong twist). The world is one
//! object, each moving part (`func_door` and the like) another with an instance where it rests: doors are closed, nothing
//! moves. Trees, brushes, visibility, fog and the light grid are what the game needs and a ray tracer does not.
//!
//! 32 units become a metre (players are 56 units tall), +Z up becomes +Y up.
//!
//! # Files
//! Images and `scripts/*.shader` lie in the folder above the map's, when that is called `maps`, otherwise in it; names that
//! lead out of that folder are refused. Images may end in `.tga`, `.jpg` or `.png` whatever the map says. What cannot be read
//! shows as a checkerboard, and one remark lists it.
//!
//! # Materials
//! Shaders of the game paint images over each other; here they become physical materials:
//!
//! - The image that covers the surface, with a light map or light in its vertices, or without a script, is a Lambertian
//!   reflectance. Where no light falls on it in the game, it is what the surface emits.
//! - Images that are added after the light map glow. `q3map_surfacelight` makes the image that glows, or else that of
//!   `q3map_lightimage`, shine as brightly as the compiler had it, in the mean over the image, and in the hue of the
//!   mean of its values on the screen. Each of few lamps is a mesh of its own, cut finely enough to show its picture,
//!   which renderers need to find the bright spots.
//! - `alphaFunc` makes holes, `blendFunc blend` covers by alpha, `add` alone only adds light, `filter` alone is coloured glass.
//! - `tcGen environment` shows a picture of surroundings; here they are mirrored: by metal of 80 % reflectance in the
//!   picture's hue, or by a gloss of 11 % where it is added to something.
//! - Surfaces that the game does not draw (clips, triggers, caulk) are left out.
//! - The clouds or far images of the sky become the environment, as bright as on the screen. The light of its
//!   `q3map_surfacelight` comes, as in the compiler, from the sky's faces: clear sheets that shine evenly, through which
//!   the environment is seen and the sun gets in.
//! - Motions (`tcMod scroll`, `deformVertexes` …) stand still, waves are at their mean, animations show their first image;
//!   `detail` stages are left out.
//!
//! # Light
//! The map's compiler (`q3map`) adds up light linearly until a white surface is at 255; here its radiance is 1 then. From
//! this follow, for what the compiler computes:
//!
//! | file | compiler | here |
//! |---|---|---|
//! | `light` of a light entity | 7500 `light` / d², d in units | radiant intensity 7500 π `light` / 255 / 32² W/sr, 0.09 per `light` |
//! | `q3map_surfacelight` | 3 × the share of the view that it fills | radiance 3/255 × the value |
//! | `q3map_sun` | the value where it falls straight on | irradiance π/255 × the value W/m² |
//! | `ambient` of the worldspawn | the value | [`Material::ambient`] 1/255 × the value × the reflectance |
//!
//! A light with a target is a spot: full within `radius` − 16 units at the target (default 64), nothing beyond + 16. Colours
//! are scaled to a maximum of 1, as the compiler does. Lights that fall off linearly are given the physical falloff.
//! With [`Limits::lightmaps`](crate::Limits::lightmaps) there are no lights: surfaces are
//! [unlit](heliostat_scene::Material::unlit) and show the light that is baked into the map.
//!
//! # References
//! id Software, "Quake III Arena Shader Manual", revision 12, 1999, and the sources of Quake III Arena and its tools, 2005
//! (the record layout, the compiler's constants). Proudfoot, "Unofficial Quake 3 Map Specs", 2000.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use glam::Vec3;
use heliostat_scene::{Edit, Environment, Material, MaterialId, SceneBuilder};

use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;
use entities::Entity;
use images::Images;
use lumps::{FaceKind, Lump, Lumps, ModelRecord, SURFACE_NOT_DRAWN, SURFACE_SKY, TextureRecord};
use materials::Materials;
use meshes::{Meshes, Tally, Use};
use script::Shader;

mod baked;
mod entities;
mod images;
mod lights;
mod look;
mod lumps;
mod materials;
mod meshes;
mod patch;
mod script;
mod sky;
mod units;
mod words;

#[cfg(test)]
mod sample;
#[cfg(test)]
mod tests;

pub(crate) fn load(context: &mut Context<'_>, file: &Arc<str>, bytes: &[u8]) -> Result<Vec<Edit>, LoadError> {
    let place = Place::whole(file);
    let lumps = Lumps::new(file, bytes)?;
    context.charge_array(lumps.count(Lump::Textures), 2 * size_of::<TextureRecord>(), &place)?;
    context.charge_array(lumps.count(Lump::Models), size_of::<ModelRecord>(), &place)?;
    let textures = lumps.textures();
    let models = lumps.models()?;
    let entities = entities::parse(context, file, lumps.lump(Lump::Entities))?;
    let root = images::root(context, file);
    let shaders = scripts(context, &place, root, &textures)?;
    let mut images = Images::new(root);
    let map = Map { place: &place, lumps: &lumps, textures: &textures, shaders: &shaders };
    let mut builder = SceneBuilder::new();
    map.sky_and_sun(context, &mut builder, &mut images, &models)?;
    let dressed = map.materials(context, &mut builder, &mut images, &models, &entities)?;
    let tally = map.objects(context, &mut builder, &dressed, (&models, &entities))?;
    map.lights(context, &mut builder, &entities);
    lights::cameras(&entities).into_iter().for_each(|camera| _ = builder.camera(camera));
    map.tell_faces(context, &tally);
    map.tell_images(context, &images);
    Ok(builder.finish())
}

/// The shaders of all scripts that the textures use, by name; of several with one name the first counts.
fn scripts(
    context: &mut Context<'_>,
    place: &Place,
    root: &str,
    textures: &[TextureRecord],
) -> Result<HashMap<String, Shader>, LoadError> {
    let used: HashSet<String> = textures.iter().map(|texture| script::normalised(&texture.name)).collect();
    let mut shaders: HashMap<String, Shader> = HashMap::new();
    for name in context.list(&format!("{root}scripts")) {
        if !name.to_ascii_lowercase().ends_with(".shader") {
            continue;
        }
        let path = format!("{root}scripts/{name}");
        let bytes = match context.read(&path) {
            Ok(bytes) => bytes,
            Err(error) => {
                context.warn(place.clone(), format!("script `{path}`: {error}"), "it was left out");
                continue;
            }
        };
        let text = String::from_utf8_lossy(&bytes);
        for shader in script::parse(context, &path.as_str().into(), &text)? {
            if used.contains(&shader.name) {
                shaders.entry(shader.name.clone()).or_insert(shader);
            }
        }
    }
    Ok(shaders)
}

/// The parts of a map that is being read.
struct Map<'a> {
    place: &'a Place,
    lumps: &'a Lumps<'a>,
    textures: &'a [TextureRecord],
    shaders: &'a HashMap<String, Shader>,
}

/// What the faces of each texture become.
struct Dressed {
    uses: Vec<Use>,
    materials: BTreeMap<usize, MaterialId>,
}

impl Map<'_> {
    fn shader(&self, texture: usize) -> Option<&Shader> {
        self.shaders.get(&script::normalised(&self.textures[texture].name))
    }

    fn is_sky(&self, texture: usize) -> bool {
        let by_script = self.shader(texture).is_some_and(|shader| shader.has("sky"));
        by_script || self.textures[texture].surface & SURFACE_SKY != 0
    }

    fn is_drawn(&self, texture: usize) -> bool {
        let by_script = self.shader(texture).is_some_and(|shader| {
            let fog_alone = shader.has("fog") && shader.stages.is_empty();
            fog_alone || shader.has("nodraw") || shader.has("hint") || shader.has("skip")
        });
        !by_script && self.textures[texture].surface & SURFACE_NOT_DRAWN == 0
    }

    /// The textures of all faces but flares, each once.
    fn textures_of_faces(&self, models: &[ModelRecord]) -> Result<Vec<usize>, LoadError> {
        let mut seen = vec![false; self.textures.len()];
        for model in models {
            for index in model.faces.clone() {
                let face = self.lumps.face(index)?;
                seen[face.texture] |= face.kind != FaceKind::Flare;
            }
        }
        Ok((0..seen.len()).filter(|&texture| seen[texture]).collect())
    }

    /// The environment and the sun of the first sky that is seen.
    fn sky_and_sun(
        &self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        images: &mut Images,
        models: &[ModelRecord],
    ) -> Result<(), LoadError> {
        let skies: Vec<usize> =
            self.textures_of_faces(models)?.into_iter().filter(|&texture| self.is_sky(texture)).collect();
        let Some(&first) = skies.first() else { return Ok(()) };
        if skies.len() > 1 {
            let message = format!(
                "the map has {} skies; all show the first, `{}`",
                skies.len(),
                self.textures[first].name
            );
            context.warn(self.place.clone(), message, "");
        }
        let baked = context.limits.lightmaps;
        let Some(shader) = self.shader(first) else {
            let message = format!("no script has the sky `{}`; it stays black", self.textures[first].name);
            context.warn(self.place.clone(), message, "put the game's scripts into the folder `scripts`");
            return Ok(());
        };
        let environment = sky::environment(context, images, self.place, shader)?;
        if environment != Environment::None {
            builder.environment(environment);
        }
        if let (Some(sun), false) = (shader.sun.as_ref().and_then(lights::sun), baked) {
            builder.light(sun);
        }
        Ok(())
    }

    fn materials(
        &self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        images: &mut Images,
        models: &[ModelRecord],
        entities: &[Entity],
    ) -> Result<Dressed, LoadError> {
        let baked = context.limits.lightmaps;
        let world = entities.iter().find(|entity| entity.class() == "worldspawn");
        let ambient = if baked { Vec3::ZERO } else { lights::ambient(world) };
        let mut maker = Materials { images, baked, ambient, left_out: 0, moving: 0 };
        let mut dressed =
            Dressed { uses: vec![Use::NotDrawn; self.textures.len()], materials: BTreeMap::new() };
        for texture in self.textures_of_faces(models)? {
            dressed.uses[texture] = if self.is_sky(texture) {
                let veil = self.shader(texture).filter(|_| !baked);
                let veil = veil.map(|shader| maker.veil(context, self.place, shader)).transpose()?.flatten();
                let veiled = veil.is_some();
                if let Some(veil) = veil {
                    context.count_materials(1, self.place)?;
                    dressed.materials.insert(texture, builder.material(veil));
                }
                Use::Sky { veiled }
            } else if self.is_drawn(texture) {
                context.count_materials(1, self.place)?;
                context.charge(size_of::<Material>() as u64, self.place)?;
                let named = (self.textures[texture].name.as_str(), self.shader(texture));
                let (material, lit) = maker.material(context, builder, self.place, named)?;
                dressed.materials.insert(texture, builder.material(material));
                let lamp = named.1.is_some_and(|shader| shader.surface_light > 0.0) && !baked;
                Use::Shown { lit, lamp }
            } else {
                Use::NotDrawn
            };
        }
        if maker.moving > 0 {
            let message = format!("{} materials move or change in the game; they stand still", maker.moving);
            context.note(self.place.clone(), message, "");
        }
        if maker.left_out > 0 {
            let message = format!(
                "{} stages of shaders are left out: details, and what has no place in a physical material",
                maker.left_out
            );
            context.note(self.place.clone(), message, "");
        }
        Ok(dressed)
    }

    /// The world, and for each entity with a model of its own an object and an instance.
    fn objects(
        &self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        dressed: &Dressed,
        (models, entities): (&[ModelRecord], &[Entity]),
    ) -> Result<Tally, LoadError> {
        let meshes = Meshes { lumps: self.lumps, uses: &dressed.uses, baked: context.limits.lightmaps };
        let mut tally = Tally::default();
        let mut objects = vec![None; models.len()];
        let mut object = |context: &mut Context<'_>, builder: &mut SceneBuilder, index: usize| {
            let model: &ModelRecord = &models[index];
            if let (None, false) = (objects[index], model.faces.is_empty()) {
                let name = if index == 0 { "world".to_owned() } else { format!("model {index}") };
                let parts = meshes.build(context, self.place, model.faces.clone(), &mut tally)?;
                let parts: Vec<_> = parts
                    .into_iter()
                    .map(|(texture, mesh)| (builder.mesh(mesh), dressed.materials[&texture]))
                    .collect();
                objects[index] = Some(builder.object(name, parts));
            }
            Ok::<_, LoadError>(objects[index])
        };
        if let Some(world) = object(context, builder, 0)? {
            builder.place("world", world, None, units::placement(Vec3::ZERO));
        }
        let mut moving: BTreeMap<&str, usize> = BTreeMap::new();
        for entity in entities {
            let Some(number) = entity.get("model").and_then(|name| name.strip_prefix('*')) else { continue };
            let index = number.parse().ok().filter(|&index: &usize| index > 0 && index < models.len());
            let Some(index) = index else {
                let message = format!("an entity `{}` has model `*{number}`", entity.class());
                let hint = format!("there are models 1 to {}; it was left out", models.len() - 1);
                context.warn(self.place.clone(), message, hint);
                continue;
            };
            let Some(id) = object(context, builder, index)? else { continue };
            let origin = entity.vector("origin").unwrap_or(Vec3::ZERO);
            let name = entity
                .get("targetname")
                .map_or_else(|| entity.class().to_owned(), |target| format!("{} {target}", entity.class()));
            context.charge(256 + name.len() as u64, self.place)?;
            builder.place(name, id, None, units::placement(origin));
            if !matches!(entity.class(), "func_static" | "func_group") {
                *moving.entry(entity.class()).or_default() += 1;
            }
        }
        for (class, count) in moving {
            let message = format!("{count} of `{class}` stand still where the map has them");
            context.note(self.place.clone(), message, "");
        }
        Ok(tally)
    }

    fn lights(&self, context: &mut Context<'_>, builder: &mut SceneBuilder, entities: &[Entity]) {
        if context.limits.lightmaps {
            let message = "the light that is baked into the map is shown; there are no lights";
            context.note(self.place.clone(), message, "");
            return;
        }
        let found = lights::lights(entities);
        if found.dark > 0 {
            let message = format!("{} lights that take light away or give none are left out", found.dark);
            context.note(self.place.clone(), message, "");
        }
        if found.linear > 0 {
            let message =
                format!("{} lights fall off linearly in the game; here as light does", found.linear);
            context.note(self.place.clone(), message, "");
        }
        found.lights.into_iter().for_each(|light| _ = builder.light(light));
    }

    fn tell_faces(&self, context: &mut Context<'_>, tally: &Tally) {
        let Tally { polygons, patches, meshes, flares, sky, not_drawn } = tally;
        let message = format!(
            "shown: {polygons} polygons, {patches} patches, {meshes} meshes; left out: {flares} flares, \
             {not_drawn} faces that are not drawn, {sky} of the sky"
        );
        context.note(self.place.clone(), message, "");
        let fogs = self.lumps.count(Lump::Effects);
        if fogs > 0 {
            context.note(self.place.clone(), format!("{fogs} volumes of fog are left out"), "");
        }
    }

    fn tell_images(&self, context: &mut Context<'_>, images: &Images) {
        let (found, missing) = images.found_and_missing();
        context.note(self.place.clone(), format!("{found} images found, {} missing", missing.len()), "");
        if !missing.is_empty() {
            let mut names: Vec<String> = missing.iter().map(|name| name.chars().take(64).collect()).collect();
            names.sort_unstable();
            let more = if names.len() > 8 { ", …" } else { "" };
            names.truncate(8);
            let message = format!("there is no image {}{more}", names.join(", "));
            let hint = "a checkerboard takes their place, or they are left out where they glow";
            context.warn(self.place.clone(), message, hint);
        }
        if images.refused > 0 {
            let message = format!("{} names of images lead out of the game's folder", images.refused);
            context.warn(self.place.clone(), message, "they are not read");
        }
    }
}

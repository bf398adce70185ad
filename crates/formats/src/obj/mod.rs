//! Wavefront OBJ with MTL materials.
//!
//! Read are `v` (with colours as `x y z r g b`, sRGB), `vt`, `vn`, `f` in all four forms with positive and negative
//! indices and any number of corners, `s`, `usemtl` and `mtllib`. Names may hold spaces and stand in quotes. Points,
//! lines and free-form curves and surfaces are ignored with a warning.
//!
//! A file becomes one object with one part per material, whatever its `o` and `g` say: one accelerator over
//! everything is what a renderer wants. Faces keep the material of the last `usemtl`; before the first, or when the
//! material is not defined, they are neutral grey.
//!
//! Vertices without `vn` are shaded flat, except in smoothing groups (`s` other than `off`), where normals are
//! means over the group weighted by angle. `vt` counts upwards and is flipped to the scene's downwards.
//!
//! MTL's empirical model becomes the scene's physical one:
//!
//! - `Kd` is the base colour, at most 1.
//! - `Ks` is the reflectance at normal incidence of a dielectric coat over it, `specular · 0.04 · specular_color`:
//!   nothing is lost however coloured or strong it is, and `Ks` 0 is exactly Lambertian. `Ns` becomes a GGX
//!   roughness of the same width, α = √(2 / (Ns + 2)).
//! - `illum` 3, 5 and 8 are mirrors: the same with roughness 0.
//! - `illum` 4, 6, 7 and 9 are glass: solid if `Ni` exceeds 1, a thin sheet otherwise. `Tf` tints it by hue: files
//!   use its strength as a filter, as opacity, and as transparency, so its largest channel counts as 1.
//! - `Tf` above 0 in a material without `illum`, `d` and `Tr` lets that share of light straight through
//!   (as `d` = 1 − Tf).
//! - `d` below 1, or `Tr` above 0 when `d` is absent, is coverage.
//! - `Ke` leaves the front side only.
//! - `Pr`, `Pm`, `Pc`, `Pcr` with their maps replace `Ks` and `Ns`.
//!
//! # References
//! Wavefront, "Advanced Visualizer Manual, Appendix B1: Object Files", 1995.
//! Wavefront, "Advanced Visualizer: MTL material format", 1995. Walter, Marschner, Li, Torrance, "Microfacet Models
//! for Refraction through Rough Surfaces", 2007, section 5 (Phong exponent and α).

use std::collections::HashMap;
use std::sync::Arc;

use glam::Affine3A;
use heliostat_scene::{Edit, MaterialId, SceneBuilder};

use crate::context::Context;
use crate::error::LoadError;
use crate::place::Place;
use maps::Maps;
use mtl::Mtl;
use parse::{MaterialUse, Obj};

mod maps;
mod material;
mod meshes;
mod mtl;
mod parse;

#[cfg(test)]
mod tests;

pub(crate) fn load(context: &mut Context<'_>, file: &Arc<str>, bytes: &[u8]) -> Result<Vec<Edit>, LoadError> {
    let obj = Obj::parse(context, file, bytes)?;
    if obj.polygons.is_empty() {
        if obj.positions.is_empty() {
            let hint = "an OBJ file has lines such as `v 0 0 0` and `f 1 2 3`";
            return Err(LoadError::input(Place::whole(file), "the file has no vertices and no faces", hint));
        }
        let message = format!("the file has {} vertices but no faces; nothing is shown", obj.positions.len());
        context.warn(Place::whole(file), message, "give a file with `f` lines");
        return Ok(Vec::new());
    }
    let mut builder = SceneBuilder::new();
    let mut materials = Materials::read(context, &obj.libraries)?;
    let mut parts = Vec::new();
    for (used, mesh) in meshes::build(context, file, bytes, &obj)? {
        let material = materials.get(context, &mut builder, &obj.uses[used])?;
        parts.push((builder.mesh(mesh), material));
    }
    let name = crate::stem(file);
    let object = builder.object(name, parts);
    builder.instance(object, Affine3A::IDENTITY);
    Ok(builder.finish())
}

/// Libraries that one file may name.
const MAX_LIBRARIES: usize = 1000;

/// The materials of all libraries by name, converted when they are first used.
struct Materials {
    definitions: HashMap<String, Mtl>,
    made: HashMap<Option<String>, MaterialId>,
    maps: Maps,
    /// A library could not be read, and a warning has said so.
    incomplete: bool,
}

impl Materials {
    fn read(context: &mut Context<'_>, libraries: &[(String, Place)]) -> Result<Self, LoadError> {
        let mut materials = Self {
            definitions: HashMap::new(),
            made: HashMap::new(),
            maps: Maps::default(),
            incomplete: false,
        };
        for (names, place) in libraries {
            materials.library(context, names, place)?;
        }
        Ok(materials)
    }

    /// `names` is one name with spaces or several names.
    fn library(&mut self, context: &mut Context<'_>, names: &str, place: &Place) -> Result<(), LoadError> {
        let whole = context.read(names);
        let (files, error) = match whole {
            Ok(bytes) => (vec![(names.to_owned(), bytes)], None),
            Err(error) => {
                let read = |name: &str| Some((name.to_owned(), context.read(name).ok()?));
                let several: Vec<&str> = names.split_whitespace().take(MAX_LIBRARIES).collect();
                let files: Vec<_> = if several.len() > 1 {
                    several.iter().copied().filter_map(read).collect()
                } else {
                    Vec::new()
                };
                let missing = files.len() < several.len();
                (files, missing.then_some(error))
            }
        };
        if let Some(error) = error {
            let hint = "its materials are neutral grey; put the file there or correct `mtllib`";
            context.warn(place.clone(), format!("material library `{names}`: {error}"), hint);
            self.incomplete = true;
        }
        for (name, bytes) in files {
            for mtl in mtl::parse(context, &name.as_str().into(), &bytes)? {
                self.definitions.entry(mtl.name.clone()).or_insert(mtl);
            }
        }
        Ok(())
    }

    fn get(
        &mut self,
        context: &mut Context<'_>,
        builder: &mut SceneBuilder,
        used: &MaterialUse,
    ) -> Result<MaterialId, LoadError> {
        if let Some(&known) = self.made.get(&used.name) {
            return Ok(known);
        }
        let definition = used.name.as_ref().and_then(|name| self.definitions.get(name));
        let material = match (definition, &used.name) {
            (Some(mtl), _) => material::convert(context, builder, &mut self.maps, mtl)?,
            (None, None) => crate::neutral_material("default"),
            (None, Some(name)) => {
                if !self.incomplete {
                    let hint = "it is neutral grey; define it with `newmtl` in the library of `mtllib`";
                    context.warn(used.place.clone(), format!("material `{name}` is not defined"), hint);
                }
                crate::neutral_material(name)
            }
        };
        context.count_materials(1, &used.place)?;
        let id = builder.material(material);
        self.made.insert(used.name.clone(), id);
        Ok(id)
    }
}

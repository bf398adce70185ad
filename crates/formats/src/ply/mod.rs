//! Stanford PLY: ASCII, binary little and big endian.
//!
//! Read are, of element `vertex`: `x y z`, `nx ny nz`, `red green blue alpha` (also `r g b a` and `diffuse_red` …)
//! and texture coordinates (`s t`, `u v`, `texture_u texture_v`, `texture_s texture_t`, v upwards); of element
//! `face`: the list `vertex_indices` or `vertex_index`, any polygons; of element `tristrips`: `vertex_indices` with
//! −1 between strips. Further scalar properties of these become attributes: those of vertices under their name, those of
//! faces and strips as `face_NAME`, with `red green blue` as the one vector `face_color`. Everything else is skipped.
//! Integer colours are sRGB and become linear; float colours are linear. A file with neither faces nor strips is a point
//! cloud, of which nothing is shown.
//!
//! Meshes without normals get smooth ones, weighted by angle: PLY files mostly hold scans.
//!
//! # References
//! Turk, "The PLY Polygon File Format", 1994.

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3, Vec4};
use heliostat_scene::{
    Attribute, AttributeScope, ColorSpace, Edit, Material, Mesh, SceneBuilder, Texture, TextureRef,
};

use crate::context::Context;
use crate::error::LoadError;
use crate::image::pixels::srgb_to_linear;
use crate::normals::smooth_normals;
use crate::place::Place;
use crate::textures::ImageFiles;
use crate::triangulate::Triangulator;
use columns::Columns;
use header::{Element, Encoding, Header, Kind, Property, Type};
use values::{Ascii, Binary, Values};

mod columns;
mod header;
mod values;

#[cfg(test)]
mod tests;

pub(crate) fn load(context: &mut Context<'_>, file: &Arc<str>, bytes: &[u8]) -> Result<Vec<Edit>, LoadError> {
    let header = Header::parse(file, bytes)?;
    let body = header.body;
    let (mesh, attributes) = match header.encoding {
        Encoding::Ascii => read_body(context, file, &header, Ascii::new(file, bytes, body, header.lines)),
        Encoding::LittleEndian => read_body(context, file, &header, Binary::<false>::new(file, bytes, body)),
        Encoding::BigEndian => read_body(context, file, &header, Binary::<true>::new(file, bytes, body)),
    }?;
    build(context, file, &header, mesh, attributes)
}

fn build(
    context: &mut Context<'_>,
    file: &Arc<str>,
    header: &Header,
    mesh: Mesh,
    attributes: Vec<(String, Attribute)>,
) -> Result<Vec<Edit>, LoadError> {
    if mesh.indices.is_empty() {
        let points = mesh.positions.len();
        let message =
            format!("the file is a point cloud: its {points} points have no faces and are not shown");
        context.warn(Place::whole(file), message, "give a file with faces or triangle strips");
        return Ok(Vec::new());
    }
    let mut builder = SceneBuilder::new();
    let name = crate::stem(file);
    let mut material = crate::neutral_material(name);
    if !mesh.colors.is_empty() {
        material.base_color = Vec4::ONE;
    }
    if let (Some((image, place)), false) = (&header.texture, mesh.uvs[0].is_empty()) {
        let read = ImageFiles::default().read(context, place, image)?;
        let texture = Texture::new(image.as_str(), crate::textures::or_placeholder(read), ColorSpace::Srgb);
        let texture = TextureRef::new(builder.texture(texture));
        material = Material { base_color: Vec4::ONE, base_color_texture: Some(texture), ..material };
    }
    let material = builder.material(material);
    let mesh = builder.mesh(mesh);
    for (name, attribute) in attributes {
        builder.attribute(mesh, name, attribute);
    }
    let object = builder.object(name, [(mesh, material)]);
    builder.instance(object, Affine3A::IDENTITY);
    Ok(builder.finish())
}

fn read_body(
    context: &mut Context<'_>,
    file: &Arc<str>,
    header: &Header,
    mut values: impl Values,
) -> Result<(Mesh, Vec<(String, Attribute)>), LoadError> {
    let mut vertices = Vertices::default();
    let mut faces = Faces::default();
    for element in &header.elements {
        check_count(element, header.encoding, values.bytes_left())?;
        match element.name.as_str() {
            "vertex" => vertices.read(context, element, &mut values)?,
            "face" | "tristrips" => faces.read(context, element, &vertices.positions, &mut values)?,
            _ => skip(element, &mut values)?,
        }
    }
    let (vertices_count, triangles) = (vertices.positions.len(), faces.triangles.len());
    context.count_mesh(vertices_count, triangles, &Place::whole(file))?;
    if vertices.normals.is_empty() && !faces.triangles.is_empty() {
        context.charge_array(vertices_count, size_of::<Vec3>(), &Place::whole(file))?;
        vertices.normals = smooth_normals(&vertices.positions, &faces.triangles);
    }
    let place = Place::whole(file);
    let of_vertices = vertices.columns;
    let mut attributes = of_vertices.attributes(context, AttributeScope::Vertex, vertices_count, &place);
    attributes.extend(faces.columns.attributes(context, AttributeScope::Primitive, triangles, &place));
    let mesh = Mesh {
        motion: [].into(),
        positions: vertices.positions.into(),
        indices: faces.triangles.into(),
        normals: vertices.normals,
        tangents: Vec::new(),
        uvs: [vertices.uvs, Vec::new()],
        colors: vertices.colors,
    };
    Ok((mesh, attributes))
}

/// Refuses counts that the rest of the file cannot hold, before anything is reserved for them.
fn check_count(element: &Element, encoding: Encoding, bytes_left: usize) -> Result<(), LoadError> {
    // The last number of a text needs no space after it.
    let needed = element.count.saturating_mul(element.min_bytes(encoding)).saturating_sub(1);
    if needed <= bytes_left as u64 {
        return Ok(());
    }
    let problem = format!(
        "{} elements `{}` need at least {needed} bytes, the file has {bytes_left} left",
        element.count, element.name
    );
    Err(LoadError::input(element.place.clone(), problem, "correct the count; the file may be truncated"))
}

/// What a vertex can have; the last slot takes what becomes an attribute or is of no interest.
const SLOTS: [&[&str]; 12] = [
    &["x"],
    &["y"],
    &["z"],
    &["nx", "normal_x"],
    &["ny", "normal_y"],
    &["nz", "normal_z"],
    &["red", "r", "diffuse_red"],
    &["green", "g", "diffuse_green"],
    &["blue", "b", "diffuse_blue"],
    &["alpha", "a", "diffuse_alpha"],
    &["s", "u", "texture_u", "texture_s"],
    &["t", "v", "texture_v", "texture_t"],
];

#[derive(Default)]
struct Vertices {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    colors: Vec<Vec4>,
    columns: Columns,
}

impl Vertices {
    fn read(
        &mut self,
        context: &mut Context<'_>,
        element: &Element,
        values: &mut impl Values,
    ) -> Result<(), LoadError> {
        let slot = |p: &Property| SLOTS.iter().position(|names| names.contains(&p.name.as_str()));
        let slots: Vec<_> = element.properties.iter().map(|p| slot(p).unwrap_or(SLOTS.len())).collect();
        let has = |wanted: std::ops::Range<usize>| wanted.into_iter().all(|s| slots.contains(&s));
        if !has(0..3) {
            let problem = "the vertices lack x, y or z";
            return Err(LoadError::input(element.place.clone(), problem, "add the property"));
        }
        let (normals, colors, uvs) = (has(3..6), has(6..9), has(10..12));
        let is_known = |name: &str| SLOTS.iter().any(|names| names.contains(&name));
        let mut layout = self.columns.layout(element, |name| !is_known(name));
        // `check_count` has shown that the file can hold this many.
        let count = element.count as usize;
        context.charge_array(count, 4 * layout.len(), &element.place)?;
        self.reserve(context, element, count, [normals, colors, uvs])?;
        let mut fields = [0.0f32; SLOTS.len() + 1];
        fields[9] = 1.0;
        for _ in 0..count {
            for (number, (property, &slot)) in element.properties.iter().zip(&slots).enumerate() {
                match property.kind {
                    Kind::Scalar(kind) if (6..10).contains(&slot) => {
                        fields[slot] = color_value(values.float(kind)?, kind, slot == 9);
                    }
                    Kind::Scalar(kind) => {
                        fields[slot] = values.float(kind)?;
                        layout.take(number, &property.name, kind, fields[slot]);
                    }
                    Kind::List { count, item } => skip_list(count, item, values)?,
                }
            }
            self.columns.push(&layout, 1);
            self.positions.push(Vec3::new(fields[0], fields[1], fields[2]));
            if normals {
                self.normals.push(Vec3::new(fields[3], fields[4], fields[5]));
            }
            if colors {
                self.colors.push(Vec4::new(fields[6], fields[7], fields[8], fields[9]));
            }
            if uvs {
                self.uvs.push(Vec2::new(fields[10], 1.0 - fields[11]));
            }
        }
        Ok(())
    }

    fn reserve(
        &mut self,
        context: &mut Context<'_>,
        element: &Element,
        count: usize,
        [normals, colors, uvs]: [bool; 3],
    ) -> Result<(), LoadError> {
        if !self.positions.is_empty() {
            let problem = "a second element `vertex`";
            return Err(LoadError::unsupported(element.place.clone(), problem, "merge the vertices"));
        }
        let bytes = 12 * usize::from(normals) + 16 * usize::from(colors) + 8 * usize::from(uvs);
        context.charge_array(count, bytes, &element.place)?;
        let limit = context.limits.vertices.min(context.memory_left() / 12);
        if element.count > limit {
            return Err(LoadError::limit(
                element.place.clone(),
                "vertices",
                element.count,
                "vertices",
                limit,
            ));
        }
        self.positions.reserve_exact(count);
        self.normals.reserve_exact(if normals { count } else { 0 });
        self.colors.reserve_exact(if colors { count } else { 0 });
        self.uvs.reserve_exact(if uvs { count } else { 0 });
        Ok(())
    }
}

/// Integers are fractions of their type's maximum, colours among them sRGB.
fn color_value(value: f32, kind: Type, is_alpha: bool) -> f32 {
    let maximum = match kind {
        Type::F32 | Type::F64 => return value,
        Type::U8 | Type::I8 => 255.0,
        Type::U16 | Type::I16 => 65535.0,
        Type::U32 | Type::I32 => 4_294_967_295.0,
    };
    let fraction = (value / maximum).clamp(0.0, 1.0);
    if is_alpha { fraction } else { srgb_to_linear(fraction) }
}

#[derive(Default)]
struct Faces {
    triangles: Vec<[u32; 3]>,
    corners: Vec<u32>,
    points: Vec<Vec3>,
    triangulator: Triangulator,
    columns: Columns,
}

impl Faces {
    fn read(
        &mut self,
        context: &mut Context<'_>,
        element: &Element,
        positions: &[Vec3],
        values: &mut impl Values,
    ) -> Result<(), LoadError> {
        let is_indices = |p: &Property| {
            matches!(p.kind, Kind::List { .. }) && (p.name == "vertex_indices" || p.name == "vertex_index")
        };
        let strips = element.name == "tristrips";
        if element.properties.iter().any(|p| p.name == "texcoord") {
            let message = "texture coordinates per face are not read";
            context.warn(element.place.clone(), message, "export them per vertex");
        }
        let mut layout = self.columns.layout(element, |_| true);
        let each = 12 + 4 * layout.len() as u64;
        let limit = context.limits.triangles.min(context.memory_left() / each);
        let first = self.triangles.len();
        self.triangles.reserve((element.count.min(limit) as usize).min(values.bytes_left()));
        for _ in 0..if element.properties.is_empty() { 0 } else { element.count } {
            let before = self.triangles.len();
            for (number, property) in element.properties.iter().enumerate() {
                match property.kind {
                    Kind::List { count, item } if is_indices(property) => {
                        let length = list_length(count, values)?;
                        if strips {
                            self.strip(length, item, positions.len(), values)?;
                        } else {
                            self.polygon(length, item, positions, values)?;
                        }
                    }
                    Kind::List { count, item } => skip_list(count, item, values)?,
                    Kind::Scalar(kind) => layout.take(number, &property.name, kind, values.float(kind)?),
                }
            }
            if self.triangles.len() as u64 > limit {
                let count = self.triangles.len() as u64;
                return Err(LoadError::limit(element.place.clone(), "triangles", count, "triangles", limit));
            }
            self.columns.push(&layout, self.triangles.len() - before);
        }
        context.charge_array(self.triangles.len() - first, 4 * layout.len(), &element.place)
    }

    fn polygon(
        &mut self,
        length: u64,
        item: Type,
        positions: &[Vec3],
        values: &mut impl Values,
    ) -> Result<(), LoadError> {
        if length == 3 {
            let mut next = || index(item, positions.len(), values);
            let triangle = [next()?, next()?, next()?];
            self.triangles.push(triangle);
            return Ok(());
        }
        self.corners.clear();
        for _ in 0..length {
            self.corners.push(index(item, positions.len(), values)?);
        }
        self.points.clear();
        self.points.extend(self.corners.iter().map(|&i| positions[i as usize]));
        let (corners, triangles) = (&self.corners, &mut self.triangles);
        self.triangulator.triangulate(&self.points, |t| triangles.push(t.map(|i| corners[i as usize])));
        Ok(())
    }

    /// Every second triangle of a strip turns the other way; −1 starts a new strip.
    fn strip(
        &mut self,
        length: u64,
        item: Type,
        vertices: usize,
        values: &mut impl Values,
    ) -> Result<(), LoadError> {
        let mut last = [0u32; 2];
        let mut seen = 0u64;
        for _ in 0..length {
            let raw = values.integer(item)?;
            if raw == -1 {
                seen = 0;
                continue;
            }
            let next = checked_index(raw, vertices, values)?;
            if seen >= 2 && last[0] != last[1] && last[0] != next && last[1] != next {
                let [a, b] = if seen.is_multiple_of(2) { last } else { [last[1], last[0]] };
                self.triangles.push([a, b, next]);
            }
            last = [last[1], next];
            seen += 1;
        }
        Ok(())
    }
}

fn index(item: Type, vertices: usize, values: &mut impl Values) -> Result<u32, LoadError> {
    let raw = values.integer(item)?;
    checked_index(raw, vertices, values)
}

fn checked_index(raw: i64, vertices: usize, values: &impl Values) -> Result<u32, LoadError> {
    match u32::try_from(raw) {
        Ok(index) if (index as usize) < vertices => Ok(index),
        _ => {
            let hint = "indices count from 0; `vertex` must come before what refers to it";
            Err(values.error(format!("index {raw} of {vertices} vertices"), hint))
        }
    }
}

fn list_length(count: Type, values: &mut impl Values) -> Result<u64, LoadError> {
    let length = values.integer(count)?;
    let bytes_left = values.bytes_left();
    // Every item takes at least a byte.
    u64::try_from(length).ok().filter(|&l| l <= bytes_left as u64).ok_or_else(|| {
        values.error(format!("a list of {length} items with {bytes_left} bytes left"), "correct the count")
    })
}

fn skip_list(count: Type, item: Type, values: &mut impl Values) -> Result<(), LoadError> {
    for _ in 0..list_length(count, values)? {
        values.float(item)?;
    }
    Ok(())
}

fn skip(element: &Element, values: &mut impl Values) -> Result<(), LoadError> {
    for _ in 0..if element.properties.is_empty() { 0 } else { element.count } {
        for property in &element.properties {
            match property.kind {
                Kind::Scalar(kind) => _ = values.float(kind)?,
                Kind::List { count, item } => skip_list(count, item, values)?,
            }
        }
    }
    Ok(())
}

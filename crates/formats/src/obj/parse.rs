//! OBJ statements into arrays, still polygons.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use crate::context::Context;
use crate::error::LoadError;
use crate::image::pixels::srgb_to_linear;
use crate::place::Place;
use crate::text::{Lines, Words};

/// Index of an attribute that a corner lacks.
pub(super) const NONE: u32 = u32::MAX;

/// One corner of a polygon: indices from 0, or [`NONE`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub(super) position: u32,
    pub(super) uv: u32,
    pub(super) normal: u32,
}

/// A polygon; its corners follow those of the polygons before it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polygon {
    pub(super) corners: u32,
    /// Index into [`Obj::uses`].
    pub(super) material: u32,
    /// Smoothing group; 0 is none.
    pub(super) smoothing: u32,
    pub(super) line: u32,
}

/// A material in use; `None` before the first `usemtl`.
#[derive(Clone, Debug)]
pub(super) struct MaterialUse {
    pub(super) name: Option<String>,
    pub(super) place: Place,
}

/// A file as it is written. Position indices are not checked against the number of positions, which may follow.
pub(super) struct Obj {
    pub(super) positions: Vec<Vec3>,
    /// Linear; empty or one per position.
    pub(super) colors: Vec<Vec3>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) corners: Vec<Corner>,
    pub(super) polygons: Vec<Polygon>,
    pub(super) uses: Vec<MaterialUse>,
    pub(super) libraries: Vec<(String, Place)>,
}

/// What statements change.
struct State {
    material: u32,
    smoothing: u32,
    uses: HashMap<String, u32>,
    ignored: Vec<Vec<u8>>,
}

impl Obj {
    pub(super) fn parse(context: &mut Context<'_>, file: &Arc<str>, bytes: &[u8]) -> Result<Self, LoadError> {
        let mut obj = Self {
            positions: Vec::new(),
            colors: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            corners: Vec::new(),
            polygons: Vec::new(),
            uses: vec![MaterialUse { name: None, place: Place::whole(file) }],
            libraries: Vec::new(),
        };
        let mut state = State { material: 0, smoothing: 0, uses: HashMap::new(), ignored: Vec::new() };
        let mut charged = 0;
        for line in Lines::new(bytes) {
            let mut words = Words::new(file, &line);
            obj.statement(context, &mut state, &mut words)?;
            // Now and then, so that the file cannot grow far beyond the limits before they are looked at.
            if line.number.is_multiple_of(4096) {
                charged = obj.charge(context, file, charged)?;
            }
        }
        obj.charge(context, file, charged)?;
        Ok(obj)
    }

    /// Charges what the arrays have grown by since they took `charged` bytes.
    fn charge(&self, context: &mut Context<'_>, file: &Arc<str>, charged: u64) -> Result<u64, LoadError> {
        let bytes = 12 * (self.positions.len() + self.colors.len() + self.normals.len() + self.corners.len())
            + 8 * self.uvs.len()
            + 16 * self.polygons.len();
        context.charge((bytes as u64).saturating_sub(charged), &Place::whole(file))?;
        Ok(bytes as u64)
    }

    fn statement(
        &mut self,
        context: &mut Context<'_>,
        state: &mut State,
        words: &mut Words<'_>,
    ) -> Result<(), LoadError> {
        let Some(keyword) = words.word() else { return Ok(()) };
        match keyword {
            b"v" => self.vertex(words)?,
            b"vt" => {
                let u = words.float("u")?;
                let v = words.float_if_any().unwrap_or(0.0);
                self.uvs.push(Vec2::new(u, 1.0 - v));
            }
            b"vn" => self.normals.push(vector(words)?),
            b"f" | b"fo" => self.face(state, words)?,
            b"s" => state.smoothing = smoothing(words.word()),
            b"usemtl" => {
                let place = words.place();
                state.material = self.material(context, state, words.rest(), place)?;
            }
            b"mtllib" => {
                let place = words.place();
                context.charge(size_of::<(String, Place)>() as u64, &place)?;
                let name = words.rest().replace('\\', "/");
                if self.libraries.iter().all(|(known, _)| *known != name)
                    && self.libraries.len() < super::MAX_LIBRARIES
                {
                    self.libraries.push((name, place));
                }
            }
            b"o" | b"g" => {}
            other => {
                if state.ignored.len() < 32 && state.ignored.iter().all(|known| known != other) {
                    let shown = String::from_utf8_lossy(&other[..other.len().min(40)]).into_owned();
                    let place = words.place();
                    context.warn(place, format!("`{shown}` is not supported and was ignored"), "");
                    state.ignored.push(other.to_vec());
                }
            }
        }
        Ok(())
    }

    /// `x y z`, `x y z w` or `x y z r g b`.
    fn vertex(&mut self, words: &mut Words<'_>) -> Result<(), LoadError> {
        let position = vector(words)?;
        let extra = [words.float_if_any(), words.float_if_any(), words.float_if_any()];
        if let [Some(r), Some(g), Some(b)] = extra {
            self.colors.resize(self.positions.len(), Vec3::ONE);
            self.colors.push(Vec3::new(r, g, b).map(|c| srgb_to_linear(c.clamp(0.0, 1.0))));
        } else if !self.colors.is_empty() {
            self.colors.push(Vec3::ONE);
        }
        self.positions.push(position);
        Ok(())
    }

    fn face(&mut self, state: &State, words: &mut Words<'_>) -> Result<(), LoadError> {
        let first = self.corners.len();
        while let Some(word) = words.word() {
            let corner = self.corner(word).map_err(|problem| {
                let hint = "indices count from 1, or from −1 backwards; write v, v/vt, v//vn or v/vt/vn";
                words.error(problem, hint)
            })?;
            self.corners.push(corner);
        }
        let count = self.corners.len() - first;
        if count < 3 {
            return Err(words.error(format!("a face of {count} corners"), "a face has at least three"));
        }
        if u32::try_from(self.corners.len()).is_err() {
            return Err(words.error("more than 2^32 corners", "split the file"));
        }
        let (material, smoothing) = (state.material, state.smoothing);
        let line = words.line_number();
        self.polygons.push(Polygon { corners: count as u32, material, smoothing, line });
        Ok(())
    }

    fn corner(&self, word: &[u8]) -> Result<Corner, String> {
        let mut fields = word.split(|&b| b == b'/');
        let position = resolve(fields.next().unwrap_or_default(), "vertex", self.positions.len())?;
        let mut optional = |what, count| match fields.next() {
            None | Some(b"") => Ok(NONE),
            Some(field) => resolve(field, what, count),
        };
        let uv = optional("texture coordinate", self.uvs.len())?;
        let normal = optional("normal", self.normals.len())?;
        if fields.next().is_some() {
            return Err(format!("`{}` has too many parts", String::from_utf8_lossy(word)));
        }
        Ok(Corner { position, uv, normal })
    }

    fn material(
        &mut self,
        context: &mut Context<'_>,
        state: &mut State,
        name: String,
        place: Place,
    ) -> Result<u32, LoadError> {
        if let Some(&known) = state.uses.get(&name) {
            return Ok(known);
        }
        context.count_materials(1, &place)?;
        context.charge(2 * (size_of::<MaterialUse>() + name.len()) as u64, &place)?;
        let number = u32::try_from(self.uses.len())
            .map_err(|_| LoadError::input(place.clone(), "more than 2^32 materials", "split the file"))?;
        state.uses.insert(name.clone(), number);
        self.uses.push(MaterialUse { name: Some(name), place });
        Ok(number)
    }
}

/// A number from 1, or from −1 backwards from the last element so far. Whether a positive one exists is checked
/// when all are known.
fn resolve(field: &[u8], what: &str, count: usize) -> Result<u32, String> {
    let shown = || String::from_utf8_lossy(&field[..field.len().min(40)]).into_owned();
    let value: i64 = std::str::from_utf8(field)
        .ok()
        .and_then(|f| f.parse().ok())
        .ok_or_else(|| format!("`{}` is not an index", shown()))?;
    let index = if value > 0 { value - 1 } else { count as i64 + value };
    match u32::try_from(index) {
        Ok(index) if value != 0 && index != NONE => Ok(index),
        _ => Err(format!("{what} {value} of {count} so far")),
    }
}

fn vector(words: &mut Words<'_>) -> Result<Vec3, LoadError> {
    Ok(Vec3::new(words.float("x")?, words.float("y")?, words.float("z")?))
}

fn smoothing(word: Option<&[u8]>) -> u32 {
    match word {
        None | Some(b"off") => 0,
        Some(b"on") => 1,
        Some(number) => std::str::from_utf8(number).ok().and_then(|n| n.parse().ok()).unwrap_or(0),
    }
}

//! The binary part of a BSP file: its directory of lumps and their records, every number checked before it is used.

use std::ops::Range;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use crate::error::LoadError;
use crate::place::Place;

/// Lumps of version 46 by their place in the directory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lump {
    Entities = 0,
    Textures = 1,
    Models = 7,
    Vertices = 10,
    MeshVertices = 11,
    Effects = 12,
    Faces = 13,
    Lightmaps = 14,
}

/// Lumps in the directory.
pub(super) const LUMPS: usize = 17;
/// Bytes before the first lump: signature, version, directory.
pub(super) const HEADER: usize = 8 + 8 * LUMPS;
/// Pixels along either side of a light map.
pub(super) const LIGHTMAP_SIDE: usize = 128;

impl Lump {
    fn name(self) -> &'static str {
        match self {
            Self::Entities => "entities",
            Self::Textures => "textures",
            Self::Models => "models",
            Self::Vertices => "vertices",
            Self::MeshVertices => "mesh vertices",
            Self::Effects => "effects",
            Self::Faces => "faces",
            Self::Lightmaps => "light maps",
        }
    }

    /// Bytes of one record.
    fn record(self) -> usize {
        match self {
            Self::Entities => 1,
            Self::Textures | Self::Effects => 72,
            Self::Models => 40,
            Self::Vertices => 44,
            Self::MeshVertices => 4,
            Self::Faces => 104,
            Self::Lightmaps => 3 * LIGHTMAP_SIDE * LIGHTMAP_SIDE,
        }
    }
}

/// A file whose directory is in order: every lump lies within it and holds whole records.
pub(super) struct Lumps<'a> {
    file: &'a Arc<str>,
    bytes: &'a [u8],
    ranges: [Range<usize>; LUMPS],
}

/// A record of the lump of textures: a shader's name and what the map's compiler knew of it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextureRecord {
    pub(super) name: String,
    pub(super) surface: u32,
}

/// Bits of [`TextureRecord::surface`].
pub(super) const SURFACE_SKY: u32 = 0x4;
/// No draw, hint and skip.
pub(super) const SURFACE_NOT_DRAWN: u32 = 0x80 | 0x100 | 0x200;

/// A range of faces: the world (the first) or the moving part of an entity.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ModelRecord {
    pub(super) faces: Range<usize>,
}

/// A vertex in units of the game, +Z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vertex {
    pub(super) position: Vec3,
    pub(super) texture: Vec2,
    pub(super) lightmap: Vec2,
    pub(super) normal: Vec3,
    /// Light baked into the vertex, as on the screen, with alpha.
    pub(super) color: [u8; 4],
}

/// What a face is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FaceKind {
    Polygon,
    /// Control points: so many in a row, so many rows; both odd and at least 3.
    Patch([usize; 2]),
    Mesh,
    /// A sprite that faces the viewer, at a light.
    Flare,
}

/// A face whose ranges are checked.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Face {
    pub(super) kind: FaceKind,
    pub(super) texture: usize,
    /// Of the lump of vertices.
    pub(super) vertices: Range<usize>,
    /// Of the lump of mesh vertices; three for each triangle.
    pub(super) mesh_vertices: Range<usize>,
    /// Page, if any.
    pub(super) lightmap: Option<usize>,
    /// Where in the file, for messages.
    pub(super) offset: usize,
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn i32_at(bytes: &[u8], at: usize) -> i32 {
    u32_at(bytes, at) as i32
}

fn f32_at(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(u32_at(bytes, at))
}

fn vec3_at(bytes: &[u8], at: usize) -> Vec3 {
    Vec3::new(f32_at(bytes, at), f32_at(bytes, at + 4), f32_at(bytes, at + 8))
}

fn vec2_at(bytes: &[u8], at: usize) -> Vec2 {
    let value = Vec2::new(f32_at(bytes, at), f32_at(bytes, at + 4));
    if value.is_finite() { value } else { Vec2::ZERO }
}

/// Text up to the first zero byte.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// `first .. first + count` if both are at least 0 and it ends within `len`.
fn range(first: i32, count: i32, len: usize) -> Option<Range<usize>> {
    let (first, count) = (usize::try_from(first).ok()?, usize::try_from(count).ok()?);
    let end = first.checked_add(count).filter(|&end| end <= len)?;
    Some(first..end)
}

const DAMAGED: &str = "the file may be truncated or damaged; fetch it again";

impl<'a> Lumps<'a> {
    /// Checks signature, version and directory.
    pub(super) fn new(file: &'a Arc<str>, bytes: &'a [u8]) -> Result<Self, LoadError> {
        if bytes.len() < HEADER {
            let problem = format!("the file has {} bytes; the header alone takes {HEADER}", bytes.len());
            return Err(LoadError::input(Place::byte(file, bytes.len()), problem, DAMAGED));
        }
        let version = u32_at(bytes, 4);
        if version != 46 {
            let problem = format!("this is version {version} of the BSP format");
            let hint = "only version 46, that of Quake III Arena and OpenArena, is read";
            return Err(LoadError::unsupported(Place::byte(file, 4), problem, hint));
        }
        let mut ranges = [const { 0..0 }; LUMPS];
        for (index, slot) in ranges.iter_mut().enumerate() {
            let at = 8 + 8 * index;
            let (offset, length) = (i32_at(bytes, at), i32_at(bytes, at + 4));
            *slot = range(offset, length, bytes.len()).ok_or_else(|| {
                let size = bytes.len();
                let problem =
                    format!("lump {index} is said to have {length} bytes from byte {offset} of {size}");
                LoadError::input(Place::byte(file, at), problem, DAMAGED)
            })?;
        }
        let lumps = Self { file, bytes, ranges };
        for lump in [
            Lump::Textures,
            Lump::Models,
            Lump::Vertices,
            Lump::MeshVertices,
            Lump::Effects,
            Lump::Faces,
            Lump::Lightmaps,
        ] {
            let length = lumps.lump(lump).len();
            if !length.is_multiple_of(lump.record()) {
                let (name, record) = (lump.name(), lump.record());
                let problem =
                    format!("the lump of {name} has {length} bytes, which are no whole records of {record}");
                return Err(LoadError::input(lumps.place(lump, 0), problem, DAMAGED));
            }
        }
        Ok(lumps)
    }

    /// The bytes of a lump.
    pub(super) fn lump(&self, lump: Lump) -> &'a [u8] {
        &self.bytes[self.ranges[lump as usize].clone()]
    }

    /// Records in a lump.
    pub(super) fn count(&self, lump: Lump) -> usize {
        self.lump(lump).len() / lump.record()
    }

    /// Where a record begins.
    fn place(&self, lump: Lump, index: usize) -> Place {
        Place::byte(self.file, self.ranges[lump as usize].start + index * lump.record())
    }

    fn record(&self, lump: Lump, index: usize) -> &'a [u8] {
        &self.lump(lump)[index * lump.record()..][..lump.record()]
    }

    /// All textures.
    pub(super) fn textures(&self) -> Vec<TextureRecord> {
        let record = |index| {
            let bytes = self.record(Lump::Textures, index);
            TextureRecord { name: text(&bytes[..64]), surface: u32_at(bytes, 64) }
        };
        (0..self.count(Lump::Textures)).map(record).collect()
    }

    /// All models; the first is the world.
    ///
    /// # Errors
    /// When there is none, one has faces that are not there, or several have the same.
    pub(super) fn models(&self) -> Result<Vec<ModelRecord>, LoadError> {
        if self.count(Lump::Models) == 0 {
            let place = self.place(Lump::Models, 0);
            return Err(LoadError::input(place, "there is no model, not even the world", DAMAGED));
        }
        let faces = self.count(Lump::Faces);
        let record = |index| {
            let bytes = self.record(Lump::Models, index);
            let (first, count) = (i32_at(bytes, 24), i32_at(bytes, 28));
            let faces = range(first, count, faces).ok_or_else(|| {
                let problem = format!("model {index} has {count} faces from {first} of {faces}");
                LoadError::input(self.place(Lump::Models, index), problem, DAMAGED)
            })?;
            Ok(ModelRecord { faces })
        };
        let models: Vec<ModelRecord> = (0..self.count(Lump::Models)).map(record).collect::<Result<_, _>>()?;
        let sum: usize = models.iter().map(|model| model.faces.len()).sum();
        if sum > faces {
            let problem = format!("the models share faces: they have {sum} in all of {faces}");
            return Err(LoadError::input(self.place(Lump::Models, 0), problem, DAMAGED));
        }
        Ok(models)
    }

    /// The face of this number, which is in range.
    ///
    /// # Errors
    /// When its kind is unknown, or it refers to what is not there.
    pub(super) fn face(&self, index: usize) -> Result<Face, LoadError> {
        let bytes = self.record(Lump::Faces, index);
        let place = self.place(Lump::Faces, index);
        let field = |i: usize| i32_at(bytes, 4 * i);
        let wrong =
            |problem: String| LoadError::input(place.clone(), format!("face {index} {problem}"), DAMAGED);
        let part = |name: &str, lump: Lump, first: i32, count: i32| {
            let all = self.count(lump);
            range(first, count, all).ok_or_else(|| wrong(format!("has {count} {name} from {first} of {all}")))
        };
        let textures = self.count(Lump::Textures);
        let texture = usize::try_from(field(0)).ok().filter(|&t| t < textures);
        let texture = texture.ok_or_else(|| wrong(format!("has texture {} of {textures}", field(0))))?;
        let vertices = part("vertices", Lump::Vertices, field(3), field(4))?;
        let mesh_vertices = part("mesh vertices", Lump::MeshVertices, field(5), field(6))?;
        let kind = match field(2) {
            1 => FaceKind::Polygon,
            2 => FaceKind::Patch(patch_size(field(24), field(25), vertices.len()).map_err(wrong)?),
            3 => FaceKind::Mesh,
            4 => FaceKind::Flare,
            other => return Err(wrong(format!("is of kind {other}; there are kinds 1 to 4"))),
        };
        if matches!(kind, FaceKind::Polygon | FaceKind::Mesh) && !mesh_vertices.len().is_multiple_of(3) {
            let count = mesh_vertices.len();
            return Err(wrong(format!("has {count} mesh vertices, which are no whole triangles")));
        }
        // Negative numbers say how light comes to a face without a map; broken ones have no light to show.
        let pages = self.count(Lump::Lightmaps);
        let lightmap = usize::try_from(field(7)).ok().filter(|&page| page < pages);
        let Place { spot: crate::place::Spot::Byte(offset), .. } = place else { unreachable!() };
        Ok(Face { kind, texture, vertices, mesh_vertices, lightmap, offset: offset as usize })
    }

    /// The vertex of this number, which is in range.
    pub(super) fn vertex(&self, index: usize) -> Vertex {
        let bytes = self.record(Lump::Vertices, index);
        Vertex {
            position: vec3_at(bytes, 0),
            texture: vec2_at(bytes, 12),
            lightmap: vec2_at(bytes, 20),
            normal: vec3_at(bytes, 28),
            color: [bytes[40], bytes[41], bytes[42], bytes[43]],
        }
    }

    /// The triangle that begins at a mesh vertex of a face: numbers among the face's own vertices.
    ///
    /// # Errors
    /// When a number is not one of the face's vertices.
    pub(super) fn triangle(&self, face: &Face, first: usize) -> Result<[u32; 3], LoadError> {
        let mut corners = [0; 3];
        for (corner, index) in corners.iter_mut().zip(first..) {
            let bytes = self.record(Lump::MeshVertices, index);
            *corner = u32_at(bytes, 0);
            if *corner as usize >= face.vertices.len() {
                let (value, count) = (i32_at(bytes, 0), face.vertices.len());
                let problem = format!("mesh vertex {index} is vertex {value} of a face of {count}");
                return Err(LoadError::input(self.place(Lump::MeshVertices, index), problem, DAMAGED));
            }
        }
        Ok(corners)
    }

    /// The pixels of a light map, which is in range: RGB in rows.
    pub(super) fn lightmap(&self, page: usize) -> &'a [u8] {
        self.record(Lump::Lightmaps, page)
    }
}

/// The size of a patch, which must be odd, at least 3, and as large as the face.
fn patch_size(width: i32, height: i32, vertices: usize) -> Result<[usize; 2], String> {
    let odd = |side: i32| usize::try_from(side).ok().filter(|side| *side >= 3 && side % 2 == 1);
    match (odd(width), odd(height)) {
        (Some(w), Some(h)) if w.checked_mul(h) == Some(vertices) => Ok([w, h]),
        (Some(_), Some(_)) => {
            Err(format!("is a patch of {width}×{height} control points but has {vertices} vertices"))
        }
        _ => Err(format!("is a patch of {width}×{height} control points; both must be odd and at least 3")),
    }
}

//! The header of a PLY file: which elements follow, and of what they are made.

use std::sync::Arc;

use crate::error::LoadError;
use crate::place::Place;
use crate::text::{Lines, Words};

/// How the body is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Scalar types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    fn parse(word: &[u8]) -> Option<Self> {
        Some(match word {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    /// In binary bodies.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

/// A scalar or a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(Type),
    List { count: Type, item: Type },
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    pub(super) place: Place,
}

impl Element {
    /// The fewest bytes that one element can take in the body.
    pub(super) fn min_bytes(&self, encoding: Encoding) -> u64 {
        let bytes = |property: &Property| match (encoding, property.kind) {
            (Encoding::Ascii, _) => 2,
            (_, Kind::Scalar(kind)) => kind.bytes() as u64,
            (_, Kind::List { count, .. }) => count.bytes() as u64,
        };
        self.properties.iter().map(bytes).sum()
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// The image named by a comment `TextureFile NAME`, as MeshLab writes it.
    pub(super) texture: Option<(String, Place)>,
    /// Where the body starts: bytes, and lines before it.
    pub(super) body: usize,
    pub(super) lines: u32,
}

/// Headers end within this many bytes.
const MAX_HEADER_BYTES: usize = 1 << 20;

impl Header {
    pub(super) fn parse(file: &Arc<str>, bytes: &[u8]) -> Result<Self, LoadError> {
        let mut header =
            Self { encoding: Encoding::Ascii, elements: Vec::new(), texture: None, body: 0, lines: 0 };
        let mut has_format = false;
        for line in Lines::new(&bytes[..bytes.len().min(MAX_HEADER_BYTES)]) {
            let mut words = Words::new(file, &line);
            match words.word() {
                None | Some(b"ply" | b"obj_info") => {}
                Some(b"comment") => header.comment(&mut words),
                Some(b"format") => {
                    header.encoding = format(&mut words)?;
                    has_format = true;
                }
                Some(b"element") => header.elements.push(element(&mut words)?),
                Some(b"property") => match header.elements.last_mut() {
                    Some(element) => element.properties.push(property(&mut words)?),
                    None => return Err(words.error("a property without an element", "put `element` first")),
                },
                Some(b"end_header") if has_format => {
                    header.lines = line.number;
                    header.body = body_start(bytes);
                    return Ok(header);
                }
                Some(b"end_header") => {
                    return Err(words.error("the header has no `format` line", "add `format ascii 1.0`"));
                }
                Some(other) => {
                    let shown = String::from_utf8_lossy(other).into_owned();
                    let hint = "header lines start with format, comment, element, property or end_header";
                    return Err(words.error(format!("`{shown}` in the header"), hint));
                }
            }
        }
        let hint = "the file may be truncated";
        Err(LoadError::input(Place::whole(file), "the header has no `end_header` line", hint))
    }

    fn comment(&mut self, words: &mut Words<'_>) {
        if words.peek() == Some(b"TextureFile") {
            words.word();
            let place = words.place();
            self.texture = Some((words.rest().replace('\\', "/"), place));
        }
    }
}

/// After the first line that says `end_header`.
fn body_start(bytes: &[u8]) -> usize {
    let mut start = 0;
    while let Some(length) = memchr::memchr(b'\n', &bytes[start..]) {
        let line = &bytes[start..start + length];
        start += length + 1;
        if line.trim_ascii().starts_with(b"end_header") {
            return start;
        }
    }
    bytes.len()
}

fn format(words: &mut Words<'_>) -> Result<Encoding, LoadError> {
    match words.word() {
        Some(b"ascii") => Ok(Encoding::Ascii),
        Some(b"binary_little_endian") => Ok(Encoding::LittleEndian),
        Some(b"binary_big_endian") => Ok(Encoding::BigEndian),
        _ => Err(words.error("unknown format", "use ascii, binary_little_endian or binary_big_endian")),
    }
}

fn element(words: &mut Words<'_>) -> Result<Element, LoadError> {
    let place = words.place();
    let name = words.word().map(|w| String::from_utf8_lossy(w).into_owned());
    let count = words.word().and_then(|w| std::str::from_utf8(w).ok()?.parse().ok());
    match (name, count) {
        (Some(name), Some(count)) => Ok(Element { name, count, properties: Vec::new(), place }),
        _ => Err(words.error("an element needs a name and a count", "write for example `element vertex 8`")),
    }
}

fn property(words: &mut Words<'_>) -> Result<Property, LoadError> {
    let hint = "types are char, uchar, short, ushort, int, uint, float and double";
    let kind = |words: &mut Words<'_>| {
        let kind = words.word().and_then(Type::parse);
        kind.ok_or_else(|| words.error("unknown type", hint))
    };
    let kind = if words.peek() == Some(b"list") {
        words.word();
        let count = kind(words)?;
        if !count.is_integer() {
            return Err(words.error("a list's count is not an integer type", "use uchar, ushort or uint"));
        }
        Kind::List { count, item: kind(words)? }
    } else {
        Kind::Scalar(kind(words)?)
    };
    let name = words.word().map(|w| String::from_utf8_lossy(w).into_owned());
    let name = name.ok_or_else(|| words.error("the property has no name", "write `property TYPE NAME`"))?;
    Ok(Property { name, kind })
}

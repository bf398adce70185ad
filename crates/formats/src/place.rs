//! Places in files: what errors and diagnostics point at.

use std::fmt;
use std::sync::Arc;

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file's name, as the caller or the referring file wrote it.
    pub file: Arc<str>,
    /// Where in it.
    pub spot: Spot,
}

/// Where in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Spot {
    /// The file as a whole.
    Whole,
    /// In a text.
    Text {
        /// Counted from 1.
        line: u32,
        /// In bytes, counted from 1.
        column: u32,
    },
    /// An element of a JSON document, such as `meshes[2].primitives[0].indices`.
    Json(String),
    /// In binary data (after decompression): the number of bytes before it.
    Byte(u64),
}

/// A line of text around a [`Place`], for display.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snippet {
    /// The line, or the part of a long line around the place.
    pub text: String,
    /// First byte of the offending part of `text`.
    pub start: usize,
    /// Bytes in the offending part, at least 1 unless the text ends there.
    pub length: usize,
}

impl Place {
    /// The whole of `file`.
    pub fn whole(file: &Arc<str>) -> Self {
        Self { file: file.clone(), spot: Spot::Whole }
    }

    pub(crate) fn json(file: &Arc<str>, path: impl Into<String>) -> Self {
        Self { file: file.clone(), spot: Spot::Json(path.into()) }
    }

    pub(crate) fn byte(file: &Arc<str>, offset: usize) -> Self {
        Self { file: file.clone(), spot: Spot::Byte(offset as u64) }
    }

    pub(crate) fn text(file: &Arc<str>, line: u32, column: u32) -> Self {
        Self { file: file.clone(), spot: Spot::Text { line, column } }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.spot {
            Spot::Whole => f.write_str(&self.file),
            Spot::Text { line, column } => write!(f, "{}:{line}:{column}", self.file),
            Spot::Json(path) => write!(f, "{}: {path}", self.file),
            Spot::Byte(offset) => write!(f, "{}: byte {offset}", self.file),
        }
    }
}

impl Snippet {
    /// Bytes of context kept on each side of the place in long lines.
    const CONTEXT: usize = 60;

    /// The part of `line` around the `length` bytes from `start`; bytes that are not UTF-8 become `\u{FFFD}`.
    pub(crate) fn new(line: &[u8], start: usize, length: usize) -> Self {
        let start = start.min(line.len());
        let end = start.saturating_add(length.clamp(1, Self::CONTEXT)).min(line.len());
        let first = start.saturating_sub(Self::CONTEXT);
        let last = end.saturating_add(Self::CONTEXT).min(line.len());
        let before = String::from_utf8_lossy(&line[first..start]);
        let inside = String::from_utf8_lossy(&line[start..end]);
        let after = String::from_utf8_lossy(&line[end..last]);
        Self { start: before.len(), length: inside.len(), text: format!("{before}{inside}{after}") }
    }
}

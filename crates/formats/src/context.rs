//! What every importer carries along: limits with what is left of them, the files it may read, and diagnostics.

use std::io::Read;
use std::path::PathBuf;
use std::sync::Arc;

use crate::diagnostic::{Diagnostic, Severity};
use crate::error::LoadError;
use crate::limits::Limits;
use crate::place::Place;
use crate::source::{FileSource, SourceError};

/// The state of one load.
pub(crate) struct Context<'a> {
    pub(crate) limits: &'a Limits,
    source: &'a dyn FileSource,
    memory: u64,
    vertices: u64,
    triangles: u64,
    materials: u64,
    diagnostics: Vec<Diagnostic>,
    suppressed: usize,
}

impl<'a> Context<'a> {
    pub(crate) fn new(limits: &'a Limits, source: &'a dyn FileSource) -> Self {
        Self {
            limits,
            source,
            memory: 0,
            vertices: 0,
            triangles: 0,
            materials: 0,
            diagnostics: Vec::new(),
            suppressed: 0,
        }
    }

    pub(crate) fn warn(&mut self, place: Place, message: impl Into<String>, hint: impl Into<String>) {
        self.tell(Severity::Warning, place, message.into(), hint.into());
    }

    pub(crate) fn note(&mut self, place: Place, message: impl Into<String>, hint: impl Into<String>) {
        self.tell(Severity::Note, place, message.into(), hint.into());
    }

    fn tell(&mut self, severity: Severity, place: Place, message: String, hint: String) {
        if self.diagnostics.len() < self.limits.diagnostics {
            self.diagnostics.push(Diagnostic { severity, place, message, hint });
        } else {
            self.suppressed += 1;
        }
    }

    /// The diagnostics, with a last note about those that were left out.
    pub(crate) fn finish(mut self, file: &Arc<str>) -> Vec<Diagnostic> {
        if self.suppressed > 0 {
            self.diagnostics.push(Diagnostic {
                severity: Severity::Note,
                place: Place::whole(file),
                message: format!("{} more diagnostics are not listed", self.suppressed),
                hint: "raise `Limits::diagnostics` to see them".into(),
            });
        }
        self.diagnostics
    }

    /// Counts memory that is about to be used.
    pub(crate) fn charge(&mut self, bytes: u64, place: &Place) -> Result<(), LoadError> {
        self.memory = self.memory.saturating_add(bytes);
        let limit = self.limits.memory_bytes;
        within(self.memory, limit, || {
            LoadError::limit(place.clone(), "bytes decoded", self.memory, "memory_bytes", limit)
        })
    }

    /// Memory that may still be used.
    pub(crate) fn memory_left(&self) -> u64 {
        self.limits.memory_bytes - self.memory.min(self.limits.memory_bytes)
    }

    /// Counts `count` elements of `size` bytes each.
    pub(crate) fn charge_array(&mut self, count: usize, size: usize, place: &Place) -> Result<(), LoadError> {
        self.charge((count as u64).saturating_mul(size as u64), place)
    }

    /// Counts vertices and triangles of a mesh that is about to be made, and the memory of its positions and indices.
    pub(crate) fn count_mesh(
        &mut self,
        vertices: usize,
        triangles: usize,
        place: &Place,
    ) -> Result<(), LoadError> {
        self.vertices = self.vertices.saturating_add(vertices as u64);
        self.triangles = self.triangles.saturating_add(triangles as u64);
        let (v, t) = (self.limits.vertices, self.limits.triangles);
        within(self.vertices, v, || {
            LoadError::limit(place.clone(), "vertices", self.vertices, "vertices", v)
        })?;
        within(self.triangles, t, || {
            LoadError::limit(place.clone(), "triangles", self.triangles, "triangles", t)
        })?;
        self.charge_array(vertices, 12, place)?;
        self.charge_array(triangles, 12, place)
    }

    /// Counts materials and textures.
    pub(crate) fn count_materials(&mut self, count: usize, place: &Place) -> Result<(), LoadError> {
        self.materials = self.materials.saturating_add(count as u64);
        let limit = self.limits.materials;
        within(self.materials, limit, || {
            LoadError::limit(place.clone(), "materials and textures", self.materials, "materials", limit)
        })
    }

    /// Reads a file that the loaded one refers to; the name has forward slashes and no percent escapes.
    pub(crate) fn read(&mut self, name: &str) -> Result<Vec<u8>, SourceError> {
        let bytes = self.source.read(name, self.limits.file_bytes.min(self.memory_left()))?;
        self.memory = self.memory.saturating_add(bytes.len() as u64);
        Ok(bytes)
    }

    /// The names of the files in a folder beside the loaded one.
    pub(crate) fn list(&self, folder: &str) -> Vec<String> {
        self.source.list(folder)
    }

    /// Where a file lies that the system is to load; see [`FileSource::locate`].
    pub(crate) fn locate(&self, name: &str) -> Result<PathBuf, SourceError> {
        self.source.locate(name)
    }

    /// Decompresses gzip data, bounded by the limits.
    pub(crate) fn gunzip(&mut self, file: &Arc<str>, bytes: &[u8]) -> Result<Vec<u8>, LoadError> {
        let limit = self.limits.file_bytes.min(self.memory_left());
        let mut plain = Vec::new();
        let mut decoder = flate2::read::MultiGzDecoder::new(bytes).take(limit.saturating_add(1));
        decoder.read_to_end(&mut plain).map_err(|error| {
            LoadError::input(
                Place::byte(file, bytes.len() - decoder.get_ref().get_ref().len()),
                format!("the gzip data is broken: {error}"),
                "the file may be truncated; fetch it again",
            )
        })?;
        let size = plain.len() as u64;
        within(size, limit, || {
            LoadError::limit(
                Place::whole(file),
                "or more bytes after decompression",
                size,
                "file_bytes",
                limit,
            )
        })?;
        self.charge(size, &Place::whole(file))?;
        Ok(plain)
    }
}

fn within(value: u64, limit: u64, error: impl FnOnce() -> LoadError) -> Result<(), LoadError> {
    if value <= limit { Ok(()) } else { Err(error()) }
}

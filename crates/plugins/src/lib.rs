//! Surface shaders from shared libraries, behind a versioned C interface.
//!
//! A plug-in is a shared library that exports one function, `heliostat_plugin`, as `include/heliostat_shader.h` declares
//! it; `docs/plugins.md` is the guide for authors. [`Plugins`] loads them. Materials may name them
//! ([`ShaderRef::Plugin`](heliostat_scene::ShaderRef)) once a registry of shaders was given a [`Plugins`]:
//!
//! ```
//! use std::sync::Arc;
//!
//! let mut shaders = heliostat_shading::ShaderRegistry::built_in();
//! shaders.allow_plugins(Arc::new(heliostat_plugins::Plugins::default()));
//! ```
//!
//! A plug-in is part of the program that loads it and may do whatever that may: this is why nothing is loaded unless
//! allowed. What is caught are honest mistakes: another version of the interface, tables that make no sense, constructors
//! that fail, answers that are not numbers. A plug-in that writes where it should not takes the program down.
//!
//! This crate is one of the few homes of `unsafe`: every call into a plug-in and every look at its tables is one.

pub mod abi;
mod callbacks;
mod error;
mod library;
mod program;
mod table;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use heliostat_shading::{PluginSource, SurfaceProgram};

pub use error::PluginError;

/// The plug-ins that are loaded. A library stays loaded as long as this or one of its shaders is in use; a file that
/// changes meanwhile is not looked at again.
#[derive(Debug, Default)]
pub struct Plugins {
    loaded: Mutex<BTreeMap<PathBuf, Vec<Arc<dyn SurfaceProgram>>>>,
}

impl Plugins {
    /// The shaders of a shared library, which is loaded unless it already is. Paths are relative to the working
    /// directory; the system's folders of libraries are not searched.
    ///
    /// # Errors
    /// [`PluginError`] if there is no such file or it is no plug-in for this engine.
    pub fn load(&self, file: &Path) -> Result<Vec<Arc<dyn SurfaceProgram>>, PluginError> {
        let path =
            file.canonicalize().map_err(|source| PluginError::File { file: file.to_path_buf(), source })?;
        // No code that could panic runs while the lock is held but the plug-in's, and that may be tried again.
        let mut loaded = self.loaded.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = loaded.get(&path) {
            return Ok(known.clone());
        }
        let shaders = table::read(&Arc::new(library::open(&path)?))?;
        let programs: Vec<_> = shaders.into_iter().map(program::program).collect();
        loaded.insert(path, programs.clone());
        Ok(programs)
    }
}

impl PluginSource for Plugins {
    fn shader(&self, file: &Path, shader: &str) -> Result<Arc<dyn SurfaceProgram>, String> {
        let programs = self.load(file).map_err(|error| error.to_string())?;
        let found = programs.iter().find(|program| program.info().name == shader).cloned();
        found.ok_or_else(|| {
            let known: Vec<String> = programs.iter().map(|program| program.info().name).collect();
            let (file, shader, known) = (file.to_path_buf(), shader.to_owned(), known.join(", "));
            PluginError::NoShader { file, shader, known }.to_string()
        })
    }
}

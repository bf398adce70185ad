//! Loads shared libraries and asks them for their table.

use std::error::Error;
use std::path::{Path, PathBuf};

use libloading::Library;

use crate::abi::{HELIOSTAT_ABI_VERSION, HeliostatEntry, HeliostatPlugin};
use crate::error::PluginError;

/// A library that is loaded.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub(crate) file: PathBuf,
    library: Library,
}

/// Loads a library by its absolute path.
pub(crate) fn open(path: &Path) -> Result<Loaded, PluginError> {
    let file = path.to_path_buf();
    // On a thread of its own, since start-up code of libraries that were compiled for fast mathematics changes the rounding
    // of the thread that loads them, and pictures with it.
    let opened = std::thread::scope(|scope| {
        let loader = std::thread::Builder::new().name("heliostat-plugin".into());
        loader.spawn_scoped(scope, || open_here(path)).map(|thread| thread.join())
    });
    match opened.map_err(|source| PluginError::File { file: file.clone(), source })? {
        Ok(Ok(library)) => Ok(Loaded { file, library }),
        Ok(Err(error)) => {
            // The system's own words are the cause of the loader's.
            let problem = error.source().map_or_else(|| error.to_string(), ToString::to_string);
            Err(PluginError::Library { file, problem })
        }
        Err(_) => Err(PluginError::Library { file, problem: "its start-up code panicked".into() }),
    }
}

#[cfg(unix)]
fn open_here(path: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // All symbols at once: one that is missing is an error here, and not the end of the process when it is first called.
    // SAFETY: this runs the library's start-up code, which can do anything; the caller of this crate vouches for it.
    unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(Into::into)
}

#[cfg(not(unix))]
fn open_here(path: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: this runs the library's start-up code, which can do anything; the caller of this crate vouches for it.
    unsafe { Library::new(path) }
}

/// The oldest version of the interface that this engine still speaks.
const OLDEST_VERSION: u32 = 1;

impl Loaded {
    /// The plug-in's table, of a version of the interface that this engine speaks.
    pub(crate) fn table(&self) -> Result<&HeliostatPlugin, PluginError> {
        // SAFETY: the header declares the function of this name so; a plug-in that defines another one breaks its contract.
        let entry = unsafe { self.library.get::<HeliostatEntry>(b"heliostat_plugin\0") };
        let entry = entry.ok().and_then(|symbol| *symbol);
        let Some(entry) = entry else { return Err(PluginError::NoEntry { file: self.file.clone() }) };
        // Plug-ins of earlier versions know no later ones.
        let versions = (OLDEST_VERSION..=HELIOSTAT_ABI_VERSION).rev();
        // SAFETY: the function takes any number.
        let table = versions.map(|version| unsafe { entry(version) }).find(|table| !table.is_null());
        let Some(table) = table else {
            return Err(PluginError::Version { file: self.file.clone(), found: None });
        };
        if !table.is_aligned() {
            return Err(self.invalid("its table is not aligned"));
        }
        // SAFETY: the pointer is neither null nor askew, and every version of the table begins with its number.
        let found = unsafe { table.cast::<u32>().read() };
        if !(OLDEST_VERSION..=HELIOSTAT_ABI_VERSION).contains(&found) {
            return Err(PluginError::Version { file: self.file.clone(), found: Some(found) });
        }
        // SAFETY: all versions that this engine speaks have the same table, and it stays as it is while the library is loaded:
        // as long as `self` is there.
        Ok(unsafe { &*table })
    }

    pub(crate) fn invalid(&self, problem: impl Into<String>) -> PluginError {
        PluginError::Invalid { file: self.file.clone(), problem: problem.into() }
    }
}

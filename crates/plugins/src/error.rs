//! Why a plug-in could not be used: who is at fault and what to do.

use std::path::PathBuf;

use crate::abi::HELIOSTAT_ABI_VERSION;

/// Why a plug-in could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PluginError {
    /// The file is missing or cannot be reached.
    #[error("plug-in {}: {source}; check the path", file.display())]
    File {
        /// As named.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The system could not load it.
    #[error(
        "plug-in {}: the system cannot load it: {problem}; it must be a shared library for this machine, with all that \
         it needs",
        file.display()
    )]
    Library {
        /// Which.
        file: PathBuf,
        /// The system's reason.
        problem: String,
    },
    /// It is a library, but not a plug-in.
    #[error(
        "plug-in {}: it exports no function `heliostat_plugin`; the plug-in must define it as its header declares it",
        file.display()
    )]
    NoEntry {
        /// Which.
        file: PathBuf,
    },
    /// It was made for another version of the interface.
    #[error(
        "plug-in {}: it {}; this engine speaks versions up to {HELIOSTAT_ABI_VERSION}: compile the plug-in with this engine's \
         header",
        file.display(),
        found.map_or("does not know the engine's interface".into(), |v| format!("was made for version {v} of the interface"))
    )]
    Version {
        /// Which.
        file: PathBuf,
        /// The plug-in's version, if it told one.
        found: Option<u32>,
    },
    /// What it says of itself makes no sense.
    #[error("plug-in {}: {problem}; this is a fault of the plug-in", file.display())]
    Invalid {
        /// Which.
        file: PathBuf,
        /// What is wrong, and where.
        problem: String,
    },
    /// There is no such shader in it.
    #[error("plug-in {}: there is no shader `{shader}` in it; it has: {known}", file.display())]
    NoShader {
        /// Which.
        file: PathBuf,
        /// As asked for.
        shader: String,
        /// Those that there are.
        known: String,
    },
}

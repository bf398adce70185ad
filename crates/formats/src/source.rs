//! Where the files come from that a scene file refers to.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::error::LoadError;
use crate::limits::Limits;
use crate::place::Place;

/// Delivers the files that a scene file refers to: buffers, images, material libraries.
pub trait FileSource {
    /// Reads the file called `relative`: a path relative to the scene file, with forward slashes and without
    /// percent escapes. At most `max_bytes` bytes may be returned.
    ///
    /// # Errors
    /// [`SourceError`] when there is no such file, it is too large or cannot be read.
    fn read(&self, relative: &str, max_bytes: u64) -> Result<Vec<u8>, SourceError>;

    /// The names of the files in the folder called `relative`, sorted; none where there is no such folder or the
    /// source cannot tell. For formats that take what lies in a folder without naming it.
    fn list(&self, relative: &str) -> Vec<String> {
        let _ = relative;
        Vec::new()
    }

    /// Where the file called `relative` lies or would lie, for files that are not read but loaded by the system. Other than
    /// for [`Self::read`], it must lie below the scene file's own folder.
    ///
    /// # Errors
    /// [`SourceError::Outside`] for a name that leads out of the folder, [`SourceError::NoFiles`] where there is none.
    fn locate(&self, _relative: &str) -> Result<PathBuf, SourceError> {
        Err(SourceError::NoFiles)
    }
}

/// Why a [`FileSource`] did not deliver.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SourceError {
    /// There is no such file.
    #[error("there is no such file")]
    NotFound,
    /// This source has no files at all.
    #[error("other files cannot be read from here")]
    NoFiles,
    /// The file is larger than asked for.
    #[error("the file has more than {limit} bytes, which is what the limits leave")]
    TooLarge {
        /// In bytes.
        limit: u64,
    },
    /// The name leads out of the scene file's folder.
    #[error("it must be a relative path that stays in the scene file's folder")]
    Outside,
    /// The operating system's reason.
    #[error("{0}")]
    Io(#[from] io::Error),
}

/// The directory a scene file lies in. References may leave it by `..`, as they do in files from the wild;
/// absolute paths are looked up by their last component only. A name that does not exist is tried again without
/// regard to case, then by its last component in the directory itself.
#[derive(Clone, Debug)]
pub struct Directory(pub PathBuf);

/// Files in memory by relative path: for uploads, archives and tests.
#[derive(Clone, Debug, Default)]
pub struct Memory(pub BTreeMap<String, Vec<u8>>);

/// No files: everything must be embedded.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoFiles;

impl FileSource for NoFiles {
    fn read(&self, _: &str, _: u64) -> Result<Vec<u8>, SourceError> {
        Err(SourceError::NoFiles)
    }
}

impl FileSource for Memory {
    fn read(&self, relative: &str, max_bytes: u64) -> Result<Vec<u8>, SourceError> {
        let wanted = relative.trim_start_matches("./");
        let same = |name: &&String| name.eq_ignore_ascii_case(wanted);
        let exact = self.0.get(relative).or_else(|| self.0.get(wanted));
        let bytes = exact.or_else(|| self.0.get(self.0.keys().find(same)?)).ok_or(SourceError::NotFound)?;
        if bytes.len() as u64 > max_bytes {
            return Err(SourceError::TooLarge { limit: max_bytes });
        }
        Ok(bytes.clone())
    }

    fn list(&self, relative: &str) -> Vec<String> {
        let inside = |name: &String| {
            let (folder, file) = name.rsplit_once('/')?;
            folder.eq_ignore_ascii_case(relative).then(|| file.to_owned())
        };
        self.0.keys().filter_map(inside).collect()
    }
}

impl FileSource for Directory {
    fn read(&self, relative: &str, max_bytes: u64) -> Result<Vec<u8>, SourceError> {
        let path = self.find(relative).ok_or(SourceError::NotFound)?;
        read_file(&path, max_bytes)
    }

    fn list(&self, relative: &str) -> Vec<String> {
        let Some(folder) = self.follow(relative) else { return Vec::new() };
        let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
        let is_file = |entry: &std::fs::DirEntry| entry.path().is_file();
        let mut names: Vec<String> = entries
            .filter_map(|entry| entry.ok().filter(is_file)?.file_name().into_string().ok())
            .take(MOST_LISTED)
            .collect();
        names.sort_unstable();
        names
    }

    fn locate(&self, relative: &str) -> Result<PathBuf, SourceError> {
        // By its words first: on every system, backslashes and drives are not part of names here.
        let plain = |part: &str| !part.is_empty() && part != ".." && !part.contains(['\\', ':', '\0']);
        if !relative.split('/').all(plain) {
            return Err(SourceError::Outside);
        }
        // Links are followed then. What is not there leads nowhere; whoever loads it says so.
        let folder = if self.0.as_os_str().is_empty() { Path::new(".") } else { &self.0 };
        let path = folder.join(relative);
        match (path.canonicalize(), folder.canonicalize()) {
            (Ok(real), Ok(folder)) if !real.starts_with(&folder) => Err(SourceError::Outside),
            (Ok(real), _) => Ok(real),
            (Err(_), _) => Ok(path),
        }
    }
}

/// Most files that [`Directory`] lists of a folder.
const MOST_LISTED: usize = 100_000;

impl Directory {
    fn find(&self, relative: &str) -> Option<PathBuf> {
        let absolute = relative.starts_with('/') || relative.as_bytes().get(1) == Some(&b':');
        let as_written = if absolute { None } else { self.find_below(relative) };
        as_written.or_else(|| self.find_below(relative.rsplit('/').next()?))
    }

    /// The file that `relative` leads to from the directory.
    fn find_below(&self, relative: &str) -> Option<PathBuf> {
        let exact = self.0.join(relative);
        if exact.is_file() {
            return Some(exact);
        }
        self.follow(relative).filter(|path| path.is_file())
    }

    /// A file or folder below the directory, each component exactly or else without regard to case.
    fn follow(&self, relative: &str) -> Option<PathBuf> {
        let mut path = self.0.clone();
        for component in relative.split('/').filter(|c| !c.is_empty() && *c != ".") {
            let next = path.join(component);
            path = if next.exists() { next } else { entry_ignoring_case(&path, component)? };
        }
        Some(path)
    }
}

/// The entry of `directory` whose name differs from `wanted` in case only; the first by name, if there are several.
fn entry_ignoring_case(directory: &Path, wanted: &str) -> Option<PathBuf> {
    let listable = if directory.as_os_str().is_empty() { Path::new(".") } else { directory };
    let same = |path: &PathBuf| {
        path.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.to_lowercase() == wanted.to_lowercase())
    };
    std::fs::read_dir(listable).ok()?.filter_map(|entry| Some(entry.ok()?.path())).filter(same).min()
}

/// Reads a file that the user named, within the limits.
pub(crate) fn read_named(path: &Path, limits: &Limits) -> Result<Vec<u8>, LoadError> {
    let place = Place::whole(&path.display().to_string().as_str().into());
    let io_error = |source| LoadError::Io { place: Box::new(place.clone()), source };
    read_file(path, limits.file_bytes).map_err(|error| match error {
        SourceError::TooLarge { limit } => {
            let size = std::fs::metadata(path).map_or(limit, |m| m.len());
            LoadError::limit(place.clone(), "bytes", size, "file_bytes", limit)
        }
        SourceError::Io(source) => io_error(source),
        SourceError::NotFound | SourceError::NoFiles | SourceError::Outside => {
            io_error(io::ErrorKind::NotFound.into())
        }
    })
}

/// Reads a regular file of at most `max_bytes` bytes.
pub(crate) fn read_file(path: &Path, max_bytes: u64) -> Result<Vec<u8>, SourceError> {
    let missing = |error: io::Error| match error.kind() {
        io::ErrorKind::NotFound => SourceError::NotFound,
        _ => SourceError::Io(error),
    };
    // Asked before opening: to open a pipe is to wait for its writer.
    if !std::fs::metadata(path).map_err(missing)?.is_file() {
        return Err(io::Error::other("this is not a regular file").into());
    }
    let file = File::open(path).map_err(missing)?;
    let metadata = file.metadata()?;
    if metadata.len() > max_bytes {
        return Err(SourceError::TooLarge { limit: max_bytes });
    }
    let mut bytes = Vec::with_capacity(usize::try_from(metadata.len()).unwrap_or(0).saturating_add(1));
    file.take(max_bytes.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > max_bytes {
        return Err(SourceError::TooLarge { limit: max_bytes });
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_finds_files_as_importers_name_them() {
        let folder = std::env::temp_dir().join(format!("heliostat-source-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("scene/Textures")).unwrap();
        std::fs::write(folder.join("scene/Textures/Wood.PNG"), b"wood").unwrap();
        std::fs::write(folder.join("shared.bin"), b"shared").unwrap();
        std::fs::write(folder.join("scene/flat.png"), b"flat").unwrap();
        let source = Directory(folder.join("scene"));
        let read = |name: &str| source.read(name, 100).map(|bytes| String::from_utf8(bytes).unwrap());
        assert_eq!(read("Textures/Wood.PNG").unwrap(), "wood");
        assert_eq!(read("./textures/wood.png").unwrap(), "wood");
        assert_eq!(read("../shared.bin").unwrap(), "shared");
        // A path from another machine.
        assert_eq!(read("C:/work/flat.png").unwrap(), "flat");
        assert_eq!(read("/work/FLAT.png").unwrap(), "flat");
        assert!(matches!(read("none.png"), Err(SourceError::NotFound)));
        assert!(matches!(read("Textures"), Err(SourceError::NotFound)));
        assert!(matches!(source.read("flat.png", 3), Err(SourceError::TooLarge { limit: 3 })));
        assert_eq!(source.list("textures"), ["Wood.PNG"]);
        assert_eq!(source.list(".."), ["shared.bin"]);
        assert_eq!(source.list("none"), [""; 0]);
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn libraries_lie_in_the_folder() {
        let folder = std::env::temp_dir().join(format!("heliostat-locate-{}", std::process::id()));
        std::fs::create_dir_all(folder.join("scene/shaders")).unwrap();
        std::fs::write(folder.join("scene/shaders/wood.so"), b"").unwrap();
        std::fs::write(folder.join("out.so"), b"").unwrap();
        let source = Directory(folder.join("scene"));
        assert!(source.locate("shaders/wood.so").unwrap().ends_with("scene/shaders/wood.so"));
        assert!(source.locate("./shaders/wood.so").is_ok());
        assert!(source.locate("none.so").unwrap().ends_with("none.so"));
        for outside in ["../out.so", "shaders/../../out.so", "/out.so", "C:/out.so", "a\\..\\..\\out.so", ""]
        {
            assert!(matches!(source.locate(outside), Err(SourceError::Outside)), "{outside}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(folder.join("out.so"), folder.join("scene/link.so")).unwrap();
            assert!(matches!(source.locate("link.so"), Err(SourceError::Outside)));
        }
        assert!(matches!(NoFiles.locate("a.so"), Err(SourceError::NoFiles)));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn memory_finds_files_without_regard_to_case() {
        let memory = Memory([("a/B.bin".to_owned(), vec![1, 2])].into());
        assert_eq!(memory.read("./A/b.BIN", 2).unwrap(), [1, 2]);
        assert!(matches!(memory.read("a/B.bin", 1), Err(SourceError::TooLarge { .. })));
        assert!(matches!(memory.read("b.bin", 9), Err(SourceError::NotFound)));
    }
}

//! Where the files of a scene come from: a directory of one's own disk or a pack.
//!
//! The readers see file names as the scene writes them, relative to one directory, with `/` between
//! the parts. A name is normalized before it is looked up: `.` and `a/..` vanish and `\` (models
//! made on Windows write it) counts as `/`. So a scene means the same on disk and in a pack.

mod large;
mod pack;
mod scan;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

pub use large::{LargeFile, OpenFile};
pub use pack::{Gathered, InvalidPack, PACK_FILES_MAX, Pack};
pub use scan::Scan;

/// Largest file that is read: no model of this size fits a machine that this program is for, and a
/// mistaken name (a disk image, a film) is refused before memory runs out.
pub const FILE_BYTES_MAX: u64 = 1 << 33;

/// The scene file of a directory that is named instead of it.
pub const SCENE_FILE: &str = "scene.json";

/// Where the readers get files from.
pub trait FileSource {
    /// The bytes of the file called `path`.
    ///
    /// # Errors
    /// If there is none, or it cannot be read.
    fn read(&self, path: &str) -> Result<Vec<u8>, ReadError>;

    /// The file called `path`, to be read piece by piece, however large it is.
    ///
    /// # Errors
    /// If there is none.
    fn large(&self, path: &str) -> Result<LargeFile, ReadError>;
}

/// A file that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// There is no such file.
    #[error("{name}: no such file{}", extra(.hint))]
    Missing {
        /// Its name.
        name: String,
        /// Where it was looked for; may be empty.
        hint: String,
    },
    /// A directory, a device, a pipe.
    #[error("{name}: is a directory or the like, not a file; name a file")]
    NotAFile {
        /// Its name.
        name: String,
    },
    /// A directory in which no scene lies.
    #[error("{name}: is a directory without a {SCENE_FILE}; name a scene file or a model")]
    NoScene {
        /// Its name.
        name: String,
    },
    /// The name leads out of what may be read.
    #[error("{name}: lies outside of the directory that may be read")]
    Outside {
        /// The name.
        name: String,
    },
    /// A name that cannot be written in a scene.
    #[error("{name}: the name is not valid UTF-8; rename the file")]
    NotUtf8 {
        /// The name, with replacements.
        name: String,
    },
    /// Larger than [`FILE_BYTES_MAX`].
    #[error("{name}: has {bytes} bytes; at most {FILE_BYTES_MAX} are read")]
    TooLarge {
        /// Its name.
        name: String,
        /// Its size.
        bytes: u64,
    },
    /// Written to while it was read, or between two readings.
    #[error("{name}: has changed while it was being read; start again once it is complete")]
    Changed {
        /// Its name.
        name: String,
    },
    /// The operating system said no.
    #[error("{name}: cannot be read: {cause}")]
    Failed {
        /// Its name.
        name: String,
        /// Why.
        cause: io::Error,
    },
}

impl ReadError {
    /// What the file is called.
    pub const fn name_mut(&mut self) -> &mut String {
        match self {
            Self::Missing { name, .. }
            | Self::NotAFile { name }
            | Self::NoScene { name }
            | Self::Outside { name }
            | Self::NotUtf8 { name }
            | Self::TooLarge { name, .. }
            | Self::Changed { name }
            | Self::Failed { name, .. } => name,
        }
    }
}

fn extra(hint: &str) -> String {
    if hint.is_empty() { String::new() } else { format!(" ({hint})") }
}

/// Files below, or anywhere relative to, a directory of this machine.
#[derive(Clone, Debug)]
pub struct Directory {
    base: PathBuf,
    is_confined: bool,
}

impl Directory {
    /// The directory of a scene file, and the scene file's name in it; `scene` may also be the
    /// directory, whose scene file is then called [`SCENE_FILE`]. The scene may refer to files
    /// anywhere on this machine: it is the user's own.
    ///
    /// # Errors
    /// If there is no such file, or the directory has no scene file.
    pub fn of(scene: &Path) -> Result<(Self, String), ReadError> {
        if !scene.is_dir() {
            return Self::of_file(scene);
        }
        let file = scene.join(SCENE_FILE);
        if !file.is_file() {
            return Err(ReadError::NoScene { name: scene.display().to_string() });
        }
        Self::of_file(&file)
    }

    fn of_file(scene: &Path) -> Result<(Self, String), ReadError> {
        let shown = scene.display().to_string();
        let metadata = std::fs::metadata(scene).map_err(|cause| read_error(&shown, cause))?;
        let (Some(name), true) = (scene.file_name(), metadata.is_file()) else {
            return Err(ReadError::NotAFile { name: shown });
        };
        let Some(name) = name.to_str() else { return Err(ReadError::NotUtf8 { name: shown }) };
        let parent = scene.parent().filter(|parent| !parent.as_os_str().is_empty());
        let base = std::fs::canonicalize(parent.unwrap_or_else(|| Path::new(".")))
            .map_err(|cause| read_error(&shown, cause))?;
        Ok((Self { base, is_confined: false }, name.to_owned()))
    }

    /// A directory out of which nothing is read, not by `..`, an absolute name or a link: for
    /// scenes that others name.
    ///
    /// # Errors
    /// If there is no such directory.
    pub fn confined(root: &Path) -> Result<Self, ReadError> {
        let shown = root.display().to_string();
        let base = std::fs::canonicalize(root).map_err(|cause| read_error(&shown, cause))?;
        Ok(Self { base, is_confined: true })
    }

    /// The directory that names are relative to.
    #[must_use]
    pub fn base(&self) -> &Path {
        &self.base
    }

    /// The scene file that `path` means: itself, or that of a directory.
    ///
    /// # Errors
    /// If there is nothing, nothing that may be read, or a directory without a scene file.
    pub fn scene_file(&self, path: &str) -> Result<String, ReadError> {
        if !self.has_directory(path)? {
            return Ok(normalize(path));
        }
        let file = within(path, SCENE_FILE);
        if self.has_file(&file)? { Ok(file) } else { Err(ReadError::NoScene { name: path.into() }) }
    }

    /// Whether `path` is a directory.
    ///
    /// # Errors
    /// If it may not be read, or there is nothing.
    pub fn has_directory(&self, path: &str) -> Result<bool, ReadError> {
        let metadata = std::fs::metadata(self.locate(path)?);
        Ok(metadata.map_err(|cause| read_error(path, cause))?.is_dir())
    }

    /// Whether `path` is a file.
    ///
    /// # Errors
    /// If it may not be read.
    pub fn has_file(&self, path: &str) -> Result<bool, ReadError> {
        match self.large(path) {
            Ok(_) => Ok(true),
            Err(ReadError::Missing { .. } | ReadError::NotAFile { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Where on this machine the file called `path` is. Where names are confined, this is the file
    /// itself, behind all links.
    ///
    /// # Errors
    /// Where names are confined: if it lies outside, or there is none.
    pub fn locate(&self, path: &str) -> Result<PathBuf, ReadError> {
        let normal = normalize(path);
        let located = self.base.join(&normal);
        if !self.is_confined {
            return Ok(located);
        }
        let outside = || ReadError::Outside { name: path.to_owned() };
        if is_absolute(&normal) || normal.split('/').any(|part| part == "..") {
            return Err(outside());
        }
        let real = std::fs::canonicalize(&located).map_err(|cause| read_error(path, cause))?;
        if real.starts_with(&self.base) { Ok(real) } else { Err(outside()) }
    }

    /// Says where a missing file was looked for, unless that is nobody's business.
    fn hinted(&self, error: ReadError, located: &Path) -> ReadError {
        match error {
            ReadError::Missing { name, .. } if !self.is_confined => {
                ReadError::Missing { name, hint: format!("looked for {}", located.display()) }
            }
            error => error,
        }
    }
}

impl FileSource for Directory {
    fn read(&self, path: &str) -> Result<Vec<u8>, ReadError> {
        let located = self.locate(path)?;
        let failed = |cause| self.hinted(read_error(path, cause), &located);
        let metadata = std::fs::metadata(&located).map_err(failed)?;
        if !metadata.is_file() {
            return Err(ReadError::NotAFile { name: path.to_owned() });
        }
        let mut bytes = Vec::new();
        let file = File::open(&located).map_err(failed)?;
        file.take(FILE_BYTES_MAX + 1).read_to_end(&mut bytes).map_err(failed)?;
        if bytes.len() as u64 > FILE_BYTES_MAX {
            return Err(ReadError::TooLarge { name: path.to_owned(), bytes: metadata.len() });
        }
        Ok(bytes)
    }

    fn large(&self, path: &str) -> Result<LargeFile, ReadError> {
        let located = self.locate(path)?;
        LargeFile::on_disk(path, &located).map_err(|error| self.hinted(error, &located))
    }
}

/// A source that remembers what was read from another.
pub struct Recording<'a> {
    source: &'a dyn FileSource,
    files: RefCell<BTreeMap<String, Vec<u8>>>,
}

impl<'a> Recording<'a> {
    /// Nothing read yet.
    #[must_use]
    pub fn new(source: &'a dyn FileSource) -> Self {
        Self { source, files: RefCell::default() }
    }

    /// Every file that was read, by its normalized name.
    #[must_use]
    pub fn into_files(self) -> BTreeMap<String, Vec<u8>> {
        self.files.into_inner()
    }
}

impl FileSource for Recording<'_> {
    fn read(&self, path: &str) -> Result<Vec<u8>, ReadError> {
        let bytes = self.source.read(path)?;
        self.files.borrow_mut().insert(normalize(path), bytes.clone());
        Ok(bytes)
    }

    /// What is to be remembered must fit memory anyway.
    fn large(&self, path: &str) -> Result<LargeFile, ReadError> {
        Ok(LargeFile::in_memory(path, self.read(path)?.into()))
    }
}

/// `name` as a file that lies in the same directory as `referrer` would be named; absolute names
/// stay what they are.
#[must_use]
pub fn beside(referrer: &str, name: &str) -> String {
    let name = name.replace('\\', "/");
    let referrer = referrer.replace('\\', "/");
    match referrer.rsplit_once('/') {
        Some((directory, _)) if !is_absolute(&name) => normalize(&format!("{directory}/{name}")),
        _ => normalize(&name),
    }
}

/// The file called `name` in the directory called `directory`.
#[must_use]
pub fn within(directory: &str, name: &str) -> String {
    let directory = normalize(directory);
    if directory.is_empty() { normalize(name) } else { normalize(&format!("{directory}/{name}")) }
}

/// The name without `.`, `a/..`, doubled or backward slashes. A leading `/`, and `..` that lead
/// out, stay.
#[must_use]
pub fn normalize(name: &str) -> String {
    let name = name.replace('\\', "/");
    let is_rooted = name.starts_with('/');
    let mut parts: Vec<&str> = Vec::new();
    for part in name.split('/') {
        match (part, parts.last()) {
            ("" | ".", _) => {}
            ("..", Some(&last)) if last != ".." => drop(parts.pop()),
            ("..", None) if is_rooted => {}
            _ => parts.push(part),
        }
    }
    let joined = parts.join("/");
    if is_rooted { format!("/{joined}") } else { joined }
}

/// Whether a name starts at the root of a disk, in the way of Unix or of Windows.
#[must_use]
pub fn is_absolute(name: &str) -> bool {
    let bytes = name.as_bytes();
    let has_drive = bytes.len() > 1 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':';
    has_drive || name.starts_with(['/', '\\'])
}

fn read_error(name: &str, cause: io::Error) -> ReadError {
    let name = name.to_owned();
    match cause.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory | io::ErrorKind::InvalidInput => {
            ReadError::Missing { name, hint: String::new() }
        }
        _ => ReadError::Failed { name, cause },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_normalized() {
        for (written, normal) in [
            ("a.obj", "a.obj"),
            ("./a//b.png", "a/b.png"),
            ("models/../tex\\b.png", "tex/b.png"),
            ("../../x", "../../x"),
            ("/a/../../b", "/b"),
        ] {
            assert_eq!(normalize(written), normal, "{written}");
        }
        assert_eq!(beside("models/a.obj", "..\\tex\\b.png"), "tex/b.png");
        assert_eq!(beside("a.obj", "b.mtl"), "b.mtl");
        assert_eq!(beside("models/a.obj", "/b.mtl"), "/b.mtl");
        for (directory, file) in [(".", "b"), ("a/", "a/b"), ("/", "/b"), ("a\\c/..", "a/b")] {
            assert_eq!(within(directory, "b"), file, "{directory}");
        }
    }

    #[test]
    fn a_missing_file_and_a_directory_are_told_apart() {
        let here = tempfile::tempdir().unwrap();
        assert!(matches!(Directory::of(here.path()), Err(ReadError::NoScene { .. })));
        let absent = here.path().join("absent.json");
        assert!(matches!(Directory::of(&absent), Err(ReadError::Missing { .. })));
        std::fs::write(&absent, "{}").unwrap();
        let (directory, entry) = Directory::of(&absent).unwrap();
        assert_eq!(directory.read(&entry).unwrap(), b"{}");
        assert!(matches!(directory.read("."), Err(ReadError::NotAFile { .. })));
        std::fs::write(here.path().join(SCENE_FILE), "[]").unwrap();
        let (directory, entry) = Directory::of(here.path()).unwrap();
        assert_eq!((directory.read(&entry).unwrap(), entry.as_str()), (b"[]".into(), SCENE_FILE));
        assert!(matches!(directory.read("a\0b"), Err(ReadError::Missing { .. })));
    }

    #[cfg(unix)]
    #[test]
    fn nothing_leads_out_of_a_confined_directory() {
        let here = tempfile::tempdir().unwrap();
        let root = here.path().join("root");
        std::fs::create_dir(&root).unwrap();
        std::fs::write(here.path().join("secret"), "s").unwrap();
        std::fs::write(root.join("open"), "o").unwrap();
        std::os::unix::fs::symlink(here.path().join("secret"), root.join("link")).unwrap();
        let directory = Directory::confined(&root).unwrap();
        assert_eq!(directory.read("x/../open").unwrap(), b"o");
        let absolute = here.path().join("secret").display().to_string();
        for name in ["../secret", "link", absolute.as_str()] {
            assert!(matches!(directory.read(name), Err(ReadError::Outside { .. })), "{name}");
            assert!(matches!(directory.has_file(name), Err(ReadError::Outside { .. })), "{name}");
            assert!(matches!(directory.scene_file(name), Err(ReadError::Outside { .. })), "{name}");
        }
    }

    #[test]
    fn the_scene_file_of_a_directory_is_found() {
        let root = tempfile::tempdir().unwrap();
        for directory in ["office", "empty"] {
            std::fs::create_dir(root.path().join(directory)).unwrap();
        }
        std::fs::write(root.path().join("office").join(SCENE_FILE), "{}").unwrap();
        let directory = Directory::confined(root.path()).unwrap();
        for name in ["office", "./office/", "office/scene.json"] {
            assert_eq!(directory.scene_file(name).unwrap(), "office/scene.json", "{name}");
        }
        for name in ["empty", "", "."] {
            assert!(matches!(directory.scene_file(name), Err(ReadError::NoScene { .. })), "{name}");
        }
        assert!(matches!(directory.scene_file("absent"), Err(ReadError::Missing { .. })));
        let located = directory.locate("office/scene.json").unwrap();
        assert!(located.ends_with("office/scene.json") && located.is_absolute());
    }
}

//! A pack: all files of one scene, in memory, named by what they hold.
//!
//! Workers share no file system, so a scene travels as a pack. Its bytes are a tar archive in one
//! canonical form (sorted, no dates, no owners): the same files give the same bytes and the same
//! hash on every machine, and any tar program can look inside.

use std::collections::BTreeMap;
use std::io::Read;
use std::sync::Arc;

use super::{
    Directory, FileSource, LargeFile, ReadError, Recording, beside, is_absolute, normalize,
};
use crate::scene::error::SceneError;
use crate::scene::load::{Loaded, load};

/// Most files in a pack: far more than a scene has, far fewer than would choke a service.
pub const PACK_FILES_MAX: usize = 65_536;

/// Longest name in a pack: the longest path of common systems.
const NAME_BYTES_MAX: usize = 4096;

/// Mode of the files in the archive: anyone may read them.
const FILE_MODE: u32 = 0o644;

/// The files of one scene by relative name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pack {
    files: BTreeMap<String, Arc<[u8]>>,
}

/// A scene that was loaded from disk, with the pack of the files that it took.
#[derive(Debug)]
pub struct Gathered {
    /// Every file that the scene refers to.
    pub pack: Pack,
    /// The scene file's name in the pack.
    pub entry: String,
    /// The scene.
    pub loaded: Loaded,
}

/// Files that make no pack.
#[derive(Debug, thiserror::Error)]
pub enum InvalidPack {
    /// A file without a name, or with one that no file system takes.
    #[error("\"{name}\" cannot be the name of a file in a pack")]
    BadName {
        /// The name.
        name: String,
    },
    /// An absolute name.
    #[error("\"{name}\" is an absolute name; archive the scene with relative names")]
    Absolute {
        /// The name.
        name: String,
    },
    /// A name that leads out of the pack.
    #[error("\"{name}\" leads out of the archive by \"..\"; archive the scene's top directory")]
    Outside {
        /// The name.
        name: String,
    },
    /// Two files of one name.
    #[error("\"{name}\" is in the archive twice")]
    Duplicate {
        /// The name.
        name: String,
    },
    /// A link, a device or anything else that is no file.
    #[error("\"{name}\" is not a plain file; archive the file itself")]
    NotAFile {
        /// Its name.
        name: String,
    },
    /// More than [`PACK_FILES_MAX`].
    #[error("more than {PACK_FILES_MAX} files")]
    TooManyFiles,
    /// Bytes that are no whole tar archive.
    #[error("not a whole tar archive: {problem}")]
    Malformed {
        /// What is wrong.
        problem: String,
    },
    /// An absolute name in a scene that would mean another file in the pack.
    #[error("\"{name}\" is ambiguous once packed; refer to the file by a relative name")]
    Ambiguous {
        /// The name.
        name: String,
    },
    /// No file that could be the scene, or several.
    #[error("{}", which(.candidates))]
    NoEntry {
        /// The files that could be meant, if any.
        candidates: Vec<String>,
    },
}

fn which(candidates: &[String]) -> String {
    const WANTED: &str = "name the one to render scene.json";
    match candidates {
        [] => format!("the archive holds no scene: {WANTED}, or add one .obj or .ply file"),
        _ => format!("which file is the scene? {WANTED}: {}", candidates.join(", ")),
    }
}

impl Pack {
    /// Loads the scene at `scene` and packs every file that was read.
    ///
    /// # Errors
    /// If the scene cannot be loaded or its files have no names relative to one directory.
    pub fn gather(scene: &std::path::Path) -> Result<Gathered, SceneError> {
        let (directory, entry) = Directory::of(scene)?;
        Self::gather_from(&directory, &entry)
    }

    /// Loads the scene called `entry` in `directory` and packs every file that was read.
    ///
    /// # Errors
    /// As [`Pack::gather`].
    pub fn gather_from(directory: &Directory, entry: &str) -> Result<Gathered, SceneError> {
        let recording = Recording::new(directory);
        let loaded = load(&recording, entry)?;
        let names = PackNames::new(directory, recording.into_files())?;
        let entry = names.rename(&normalize(entry))?;
        let mut files = BTreeMap::new();
        let mut absolute = Vec::new();
        for (name, bytes) in &names.files {
            let packed = names.rename(name)?;
            if is_absolute(name) {
                absolute.push((name.clone(), packed.clone()));
            }
            files.insert(check_name(&packed)?, Arc::from(bytes.as_slice()));
        }
        let pack = Self { files };
        for (name, packed) in absolute {
            if pack.find(&name).is_none_or(|(found, _)| found != packed) {
                return Err(InvalidPack::Ambiguous { name }.into());
            }
        }
        Ok(Gathered { pack, entry, loaded })
    }

    /// A pack of these files.
    ///
    /// # Errors
    /// If a name is empty, absolute, leads out or comes twice.
    pub fn from_files(
        files: impl IntoIterator<Item = (String, Vec<u8>)>,
    ) -> Result<Self, InvalidPack> {
        let mut pack = Self::default();
        for (name, bytes) in files {
            pack.insert(&name, bytes)?;
        }
        Ok(pack)
    }

    fn insert(&mut self, name: &str, bytes: Vec<u8>) -> Result<(), InvalidPack> {
        if self.files.len() >= PACK_FILES_MAX {
            return Err(InvalidPack::TooManyFiles);
        }
        match self.files.insert(check_name(name)?, bytes.into()) {
            None => Ok(()),
            Some(_) => Err(InvalidPack::Duplicate { name: name.to_owned() }),
        }
    }

    /// The pack as a canonical tar archive.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        const IN_MEMORY: &str = "writing to memory does not fail, and names were checked";
        let mut archive = tar::Builder::new(Vec::new());
        for (name, bytes) in &self.files {
            let mut header = tar::Header::new_gnu();
            header.set_size(bytes.len() as u64);
            header.set_mode(FILE_MODE);
            header.set_uid(0);
            header.set_gid(0);
            header.set_mtime(0);
            archive.append_data(&mut header, name, bytes.as_ref()).expect(IN_MEMORY);
        }
        archive.into_inner().expect(IN_MEMORY)
    }

    /// Reads a tar archive.
    ///
    /// # Errors
    /// If it is truncated, or holds links, devices, absolute names and the like.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, InvalidPack> {
        let malformed =
            |cause: std::io::Error| InvalidPack::Malformed { problem: cause.to_string() };
        let mut pack = Self::default();
        for entry in tar::Archive::new(bytes).entries().map_err(malformed)? {
            let mut entry = entry.map_err(malformed)?;
            let kind = entry.header().entry_type();
            let name = String::from_utf8(entry.path_bytes().into_owned()).map_err(|error| {
                InvalidPack::BadName { name: String::from_utf8_lossy(error.as_bytes()).into() }
            })?;
            if kind.is_dir() || kind.is_pax_global_extensions() {
                continue;
            }
            if !kind.is_file() {
                return Err(InvalidPack::NotAFile { name });
            }
            let mut content = Vec::new();
            entry.read_to_end(&mut content).map_err(malformed)?;
            if content.len() as u64 != entry.size() {
                return Err(InvalidPack::Malformed { problem: format!("{name} is cut short") });
            }
            pack.insert(&name, content)?;
        }
        Ok(pack)
    }

    /// BLAKE3 hash of [`Pack::to_bytes`]: the pack's name.
    #[must_use]
    pub fn hash(&self) -> [u8; 32] {
        blake3::hash(&self.to_bytes()).into()
    }

    /// The files by ascending name.
    pub fn files(&self) -> impl Iterator<Item = (&str, &[u8])> {
        self.files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_ref()))
    }

    /// Which file is the scene: a `scene.json` that has the key `equilux`, else another such
    /// JSON file, else the OBJ or PLY file, else any `scene.json`: the one least deep in
    /// directories.
    ///
    /// # Errors
    /// If there is none, or several are equally good.
    pub fn entry_of_archive(&self) -> Result<String, InvalidPack> {
        let is_described = |name: &str| has_extension(name, ".json") && self.is_described(name);
        let is_scene = |name: &str| name.rsplit('/').next() == Some("scene.json");
        let rules: [&dyn Fn(&str) -> bool; 4] = [
            &|name| is_scene(name) && is_described(name),
            &is_described,
            &|name| has_extension(name, ".obj") || has_extension(name, ".ply"),
            &is_scene,
        ];
        for rule in rules {
            let candidates: Vec<&String> =
                self.files.keys().filter(|name| !is_litter(name) && rule(name)).collect();
            let depth = |name: &str| name.matches('/').count();
            let least = candidates.iter().map(|name| depth(name)).min();
            let best: Vec<&&String> =
                candidates.iter().filter(|name| Some(depth(name)) == least).collect();
            match best[..] {
                [] => {}
                [name] => return Ok((*name).clone()),
                _ => return Err(InvalidPack::NoEntry { candidates: owned(&best) }),
            }
        }
        Err(InvalidPack::NoEntry { candidates: Vec::new() })
    }

    fn is_described(&self, name: &str) -> bool {
        type Keys = BTreeMap<String, serde::de::IgnoredAny>;
        let bytes = &self.files[name];
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        serde_json::from_slice::<Keys>(text).is_ok_and(|keys| keys.contains_key("equilux"))
    }

    /// A file by its name. An absolute name, which a scene on somebody's own disk may use, means
    /// the file with the longest name that it ends in.
    fn find(&self, path: &str) -> Option<(&str, &Arc<[u8]>)> {
        let mut name = normalize(path);
        if is_absolute(&name) {
            name = name
                .match_indices('/')
                .map(|(at, _)| &name[at + 1..])
                .find(|&tail| self.files.contains_key(tail))?
                .to_owned();
        }
        let (name, bytes) = self.files.get_key_value(&name)?;
        Some((name, bytes))
    }

    fn bytes_of(&self, path: &str) -> Result<&Arc<[u8]>, ReadError> {
        match self.find(path) {
            Some((_, bytes)) => Ok(bytes),
            None if normalize(path).starts_with("..") => {
                Err(ReadError::Outside { name: path.to_owned() })
            }
            None => Err(ReadError::Missing {
                name: path.to_owned(),
                hint: "not among the files that were sent".to_owned(),
            }),
        }
    }
}

impl FileSource for Pack {
    fn read(&self, path: &str) -> Result<Vec<u8>, ReadError> {
        Ok(self.bytes_of(path)?.to_vec())
    }

    fn large(&self, path: &str) -> Result<LargeFile, ReadError> {
        Ok(LargeFile::in_memory(path, Arc::clone(self.bytes_of(path)?)))
    }
}

/// Finds names below one directory for files read relative to another.
struct PackNames {
    files: BTreeMap<String, Vec<u8>>,
    /// The directory that names are relative to, if some leave it; else empty.
    base: String,
    /// The directory that all files have in common, with a slash at its end, or empty.
    ancestor: String,
}

impl PackNames {
    fn new(directory: &Directory, files: BTreeMap<String, Vec<u8>>) -> Result<Self, ReadError> {
        let leaves = |name: &String| is_absolute(name) || name.starts_with("..");
        let mut names = Self { files, base: String::new(), ancestor: String::new() };
        if names.files.keys().any(leaves) {
            let base = directory.base();
            let not_utf8 = || ReadError::NotUtf8 { name: base.display().to_string() };
            names.base = format!("{}/", base.to_str().ok_or_else(not_utf8)?);
        }
        let located: Vec<String> = names.files.keys().map(|name| names.locate(name)).collect();
        names.ancestor = common_directory(&located);
        Ok(names)
    }

    fn locate(&self, name: &str) -> String {
        beside(&self.base, name)
    }

    fn rename(&self, name: &str) -> Result<String, InvalidPack> {
        let located = self.locate(name);
        let packed = located.strip_prefix(&self.ancestor);
        packed.map(str::to_owned).ok_or(InvalidPack::Outside { name: located })
    }
}

fn common_directory(names: &[String]) -> String {
    let directory = |name: &str| name.rfind('/').map_or(0, |slash| slash + 1);
    let Some(first) = names.first() else { return String::new() };
    let mut common = &first[..directory(first)];
    for name in names {
        while !name.starts_with(common) {
            common = &common[..directory(&common[..common.len() - 1])];
        }
    }
    common.to_owned()
}

fn check_name(name: &str) -> Result<String, InvalidPack> {
    let owned = || name.to_owned();
    if is_absolute(name) {
        return Err(InvalidPack::Absolute { name: owned() });
    }
    if name.split(['/', '\\']).any(|part| part == "..") {
        return Err(InvalidPack::Outside { name: owned() });
    }
    let normal = normalize(name);
    let is_bad = normal.is_empty() || name.ends_with('/') || name.contains('\0');
    if is_bad || name.len() > NAME_BYTES_MAX {
        return Err(InvalidPack::BadName { name: owned() });
    }
    Ok(normal)
}

fn has_extension(name: &str, extension: &str) -> bool {
    name.to_lowercase().ends_with(extension)
}

/// Whether a file is one that desktops leave in archives.
fn is_litter(name: &str) -> bool {
    name.split('/').any(|part| part == "__MACOSX" || part.starts_with("._"))
}

fn owned(names: &[&&String]) -> Vec<String> {
    names.iter().map(|name| (**name).clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pack(names: &[&str]) -> Result<Pack, InvalidPack> {
        let content = |name: &str| if name.ends_with("json") { "{\"equilux\": 1}" } else { "" };
        Pack::from_files(names.iter().map(|&name| (name.to_owned(), content(name).into())))
    }

    #[test]
    fn names_that_lead_out_are_refused() {
        assert!(matches!(pack(&["a/../../b"]), Err(InvalidPack::Outside { .. })));
        assert!(matches!(pack(&["a\\..\\b"]), Err(InvalidPack::Outside { .. })));
        assert!(matches!(pack(&["/etc/passwd"]), Err(InvalidPack::Absolute { .. })));
        assert!(matches!(pack(&["C:\\x"]), Err(InvalidPack::Absolute { .. })));
        assert!(matches!(pack(&["a", "./a"]), Err(InvalidPack::Duplicate { .. })));
        assert!(matches!(pack(&[""]), Err(InvalidPack::BadName { .. })));
        assert!(matches!(pack(&["."]), Err(InvalidPack::BadName { .. })));
        assert!(matches!(pack(&["a\0b"]), Err(InvalidPack::BadName { .. })));
        assert!(matches!(pack(&["b"]).unwrap().read("../b"), Err(ReadError::Outside { .. })));
    }

    #[test]
    fn bytes_are_canonical_and_round_trip() {
        let long = "d/".repeat(100) + "long.obj";
        let one = pack(&["b.mtl", "a.obj", &long]).unwrap();
        let other = pack(&[&long, "./a.obj", "b.mtl"]).unwrap();
        assert_eq!(one.to_bytes(), other.to_bytes());
        assert_eq!(one.hash(), other.hash());
        assert_eq!(Pack::from_bytes(&one.to_bytes()).unwrap(), one);
        assert_ne!(one.hash(), pack(&["a.obj"]).unwrap().hash());
    }

    #[test]
    fn a_cut_archive_and_a_link_are_refused() {
        let whole = Pack::from_files([("a".into(), vec![7; 2000])]).unwrap().to_bytes();
        assert!(matches!(Pack::from_bytes(&whole[..1500]), Err(InvalidPack::Malformed { .. })));
        let mut archive = tar::Builder::new(Vec::new());
        let mut header = tar::Header::new_gnu();
        header.set_entry_type(tar::EntryType::Symlink);
        header.set_size(0);
        archive.append_link(&mut header, "a", "/etc/passwd").unwrap();
        let linked = archive.into_inner().unwrap();
        assert!(matches!(Pack::from_bytes(&linked), Err(InvalidPack::NotAFile { .. })));
    }

    #[test]
    fn the_scene_of_an_archive_is_found() {
        let entry = |names: &[&str]| pack(names).unwrap().entry_of_archive();
        assert_eq!(entry(&["x/scene.json", "a.json", "b.obj"]).unwrap(), "x/scene.json");
        assert_eq!(entry(&["x/office.json", "b.obj"]).unwrap(), "x/office.json");
        assert_eq!(entry(&["x/c.obj", "b.obj", "b.mtl"]).unwrap(), "b.obj");
        assert_eq!(entry(&["x/c.obj", "b.PLY", "b.mtl"]).unwrap(), "b.PLY");
        assert_eq!(entry(&["scene.json", "__MACOSX/._scene.json"]).unwrap(), "scene.json");
        let error = entry(&["a.obj", "b.obj"]).unwrap_err().to_string();
        assert!(error.contains("a.obj, b.obj"), "{error}");
        assert!(entry(&["readme.txt"]).unwrap_err().to_string().contains("no scene"));
    }

    #[test]
    fn a_scene_of_another_program_is_passed_over() {
        let files = [("scene.json", "{\"name\": 1}"), ("equilux.json", "{\"equilux\": 1}")];
        let files = files.map(|(name, text)| (name.to_owned(), text.into()));
        assert_eq!(Pack::from_files(files).unwrap().entry_of_archive().unwrap(), "equilux.json");
    }

    #[test]
    fn an_absolute_name_means_the_file_that_it_ends_in() {
        let pack = pack(&["tex/a.png", "a.obj"]).unwrap();
        assert!(pack.read("/home/me/tex/a.png").is_ok());
        assert!(pack.read("/home/me/b.png").is_err());
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let _ = Pack::from_bytes(&bytes);
        }

        #[test]
        fn changed_archives_never_panic(
            changes in prop::collection::vec((0usize..4096, any::<u8>()), 1..20)
        ) {
            let mut bytes = pack(&["a.obj", "t/b.png"]).unwrap().to_bytes();
            for (at, value) in changes {
                let length = bytes.len();
                bytes[at % length] = value;
            }
            let _ = Pack::from_bytes(&bytes);
        }
    }
}

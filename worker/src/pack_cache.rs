//! Packs of scenes on this machine: those that were fetched once need not be fetched again.
//!
//! A pack lies in the cache directory under its hash. Several workers may share a directory: a file
//! appears there whole or not at all, and is believed only if its content has the hash. What is
//! spoilt is fetched again. A file was last modified when it was last used: those that have not
//! been for the longest time make room for others.
//!
//! What lies elsewhere on this machine may be linked instead of copied. A link takes no room, so it
//! stays; its file belongs to somebody else, and not even its date is changed.

use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use tempfile::Builder;

use crate::log::Log;

/// Most bytes of packs that are kept unless another limit is set.
pub(crate) const CACHE_BYTES_MAX: u64 = 16 << 30;

/// Beginning of the names of files that are being written.
const PART_PREFIX: &str = ".part-";

/// What is still being written after this long is left over from a process that died.
const PART_AGE_MAX: Duration = Duration::from_secs(24 * 60 * 60);

/// End of the names of packs.
const PACK_SUFFIX: &str = ".pack";

/// End of the names of links to packs that lie elsewhere.
const LINK_SUFFIX: &str = ".link";

/// Links files on this machine into the cache in `directory`, each under the hash of what it holds,
/// so that no worker with that cache has to copy them. What cannot be linked is fetched.
///
/// # Errors
/// If some file cannot be linked; those before it are.
pub fn link_into_cache<'a>(
    directory: &Path,
    files: impl IntoIterator<Item = ([u8; 32], &'a Path)>,
) -> io::Result<()> {
    let directory = packs_in(directory);
    fs::create_dir_all(&directory)?;
    files.into_iter().try_for_each(|(hash, file)| {
        let link = path_in(&directory, hash, LINK_SUFFIX);
        // Other file systems than its own know the file only by its path.
        fs::hard_link(file, &link).or_else(|_| symlink(fs::canonicalize(file)?, &link))
    })
}

/// A directory of packs.
#[derive(Clone, Debug)]
pub(crate) struct PackCache {
    directory: PathBuf,
    bytes_max: u64,
    log: Log,
}

impl PackCache {
    /// The cache in `directory`, which is made if there is none. It is to hold no more bytes than
    /// these, unless a single pack has more.
    ///
    /// # Errors
    /// If files cannot be written there.
    pub(crate) fn open(directory: &Path, bytes_max: u64, log: Log) -> io::Result<Self> {
        let directory = packs_in(directory);
        fs::create_dir_all(&directory)?;
        Builder::new().prefix(PART_PREFIX).tempfile_in(&directory)?;
        Ok(Self { directory, bytes_max, log })
    }

    /// Where the packs are.
    pub(crate) fn directory(&self) -> &Path {
        &self.directory
    }

    /// The pack of that hash and length, if it is here and whole. What is longer is not read.
    pub(crate) fn find(&self, hash: [u8; 32], pack_bytes: u64) -> Option<Vec<u8>> {
        let (path, file) = self.locate(hash)?;
        let bytes = if file.byte_count() == pack_bytes {
            file.read_range(0..pack_bytes).ok()
        } else {
            None
        };
        let is_the_one = |bytes: &Vec<u8>| *blake3::hash(bytes).as_bytes() == hash;
        if let Some(bytes) = bytes.filter(is_the_one) {
            return Some(bytes);
        }
        self.log.warn(format_args!("{} is damaged and is fetched again", path.display()));
        // If it cannot be removed, it will be written over.
        let _still_there = fs::remove_file(&path);
        None
    }

    /// The file of the pack of that hash, if there is one. What is in it may be damaged.
    pub(crate) fn open_pack(&self, hash: [u8; 32]) -> Option<PackFile> {
        self.locate(hash).map(|(_, file)| file)
    }

    /// The same, and where it is: a pack of the cache's own if it has one, or else a link.
    fn locate(&self, hash: [u8; 32]) -> Option<(PathBuf, PackFile)> {
        let own = self.path(hash);
        let (path, file) = match File::open(&own) {
            Ok(file) => {
                mark_used(&file);
                (own, file)
            }
            Err(_) => {
                let link = path_in(&self.directory, hash, LINK_SUFFIX);
                let file = File::open(&link).ok()?;
                (link, file)
            }
        };
        let bytes = file.metadata().ok()?.len();
        Some((path, PackFile { file, bytes }))
    }

    /// Writes a pack under its name, whole or not at all.
    pub(crate) fn keep(&self, hash: [u8; 32], bytes: &[u8]) -> io::Result<()> {
        let mut part = Builder::new().prefix(PART_PREFIX).tempfile_in(&self.directory)?;
        part.write_all(bytes)?;
        part.as_file().sync_data()?;
        part.persist(self.path(hash)).map_err(|error| error.error)?;
        self.trim(hash)
    }

    /// Removes the packs beyond the limit that have not been used for the longest time, but not the
    /// one just written, and what dead processes have left.
    fn trim(&self, newest: [u8; 32]) -> io::Result<()> {
        let mut packs: Vec<(SystemTime, u64, PathBuf)> = Vec::new();
        for entry in fs::read_dir(&self.directory)? {
            // What is gone by now, another worker has removed.
            let Ok(entry) = entry else { continue };
            let (path, Ok(metadata)) = (entry.path(), entry.metadata()) else { continue };
            let modified = metadata.modified()?;
            let name = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
            if name.ends_with(PACK_SUFFIX) {
                packs.push((modified, metadata.len(), path));
            } else if name.starts_with(PART_PREFIX) && is_old(modified) {
                let _removed_by_another = fs::remove_file(&path);
            }
        }
        packs.sort_unstable();
        let mut total: u64 = packs.iter().map(|(_, bytes, _)| bytes).sum();
        for (_, bytes, path) in packs.iter().filter(|pack| pack.2 != self.path(newest)) {
            if total <= self.bytes_max {
                break;
            }
            let _removed_by_another = fs::remove_file(path);
            total -= bytes;
        }
        Ok(())
    }

    fn path(&self, hash: [u8; 32]) -> PathBuf {
        path_in(&self.directory, hash, PACK_SUFFIX)
    }
}

/// The packs of a cache.
fn packs_in(directory: &Path) -> PathBuf {
    directory.join("packs")
}

fn path_in(packs: &Path, hash: [u8; 32], suffix: &str) -> PathBuf {
    let name = blake3::Hash::from_bytes(hash).to_hex();
    packs.join(format!("{name}{suffix}"))
}

/// A pack in the cache, of which parts are read. It stays readable when the cache drops it.
#[derive(Debug)]
pub(crate) struct PackFile {
    file: File,
    bytes: u64,
}

impl PackFile {
    /// How many bytes the pack has.
    pub(crate) const fn byte_count(&self) -> u64 {
        self.bytes
    }

    /// Some of them, by one reader at a time.
    pub(crate) fn read_range(&self, range: Range<u64>) -> io::Result<Vec<u8>> {
        let mut file = &self.file;
        file.seek(SeekFrom::Start(range.start))?;
        let mut bytes = Vec::new();
        let wanted = range.end - range.start;
        file.take(wanted).read_to_end(&mut bytes)?;
        if bytes.len() as u64 == wanted {
            Ok(bytes)
        } else {
            Err(io::ErrorKind::UnexpectedEof.into())
        }
    }
}

impl Read for PackFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.file.read(buffer)
    }
}

/// Notes that a pack is being used. Where that cannot be noted, it looks older than it is.
#[expect(clippy::disallowed_methods, reason = "files have a date; no image depends on it")]
fn mark_used(pack: &File) {
    let _not_noted = pack.set_modified(SystemTime::now());
}

fn is_old(modified: SystemTime) -> bool {
    modified.elapsed().is_ok_and(|age| age > PART_AGE_MAX)
}

/// The directory for caches of this user.
#[must_use]
pub fn default_cache_directory() -> PathBuf {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
    let home = || variable("HOME").map(|home| Path::new(&home).join(".cache"));
    match variable("XDG_CACHE_HOME").map(PathBuf::from).or_else(home) {
        Some(caches) => caches.join("equilux"),
        None => temporary_cache_directory(),
    }
}

/// Where a cache can be if the user has no place for caches.
pub(crate) fn temporary_cache_directory() -> PathBuf {
    let user = std::env::var("USER").unwrap_or_default();
    let user: String = user.chars().filter(char::is_ascii_alphanumeric).collect();
    std::env::temp_dir().join(format!("equilux-cache-{user}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_used_for_the_longest_time_goes_and_dead_parts_do() {
        let directory = tempfile::tempdir().unwrap();
        let cache = PackCache::open(directory.path(), 25, Log::silent()).unwrap();
        let packs = directory.path().join("packs");
        let aged = |name: &str, days: u64| {
            fs::write(packs.join(name), [0; 10]).unwrap();
            let file = File::options().write(true).open(packs.join(name)).unwrap();
            let now = file.metadata().unwrap().modified().unwrap();
            file.set_modified(now - Duration::from_secs(days * 24 * 60 * 60)).unwrap();
        };
        let used = format!("{}.pack", "08".repeat(32));
        aged(&used, 4);
        aged("older.pack", 3);
        aged("newer.pack", 2);
        aged(".part-dead", 3);
        aged(".part-alive", 0);
        assert!(cache.open_pack([8; 32]).is_some());
        cache.keep([9; 32], &[0; 10]).unwrap();
        let name = |entry: io::Result<fs::DirEntry>| {
            entry.unwrap().file_name().to_string_lossy().into_owned()
        };
        let mut files: Vec<String> = fs::read_dir(packs).unwrap().map(name).collect();
        files.sort();
        let newest = format!("{}.pack", "09".repeat(32));
        assert_eq!(files, [".part-alive", &used, &newest]);
    }

    #[test]
    fn parts_of_a_pack_are_read_and_only_what_is_there() {
        let directory = tempfile::tempdir().unwrap();
        let cache = PackCache::open(directory.path(), CACHE_BYTES_MAX, Log::silent()).unwrap();
        let bytes: Vec<u8> = (0..100).collect();
        cache.keep([9; 32], &bytes).unwrap();
        assert!(cache.open_pack([8; 32]).is_none());
        let file = cache.open_pack([9; 32]).expect("it is kept");
        assert_eq!(file.byte_count(), 100);
        for range in [90..100, 0..100, 10..10] {
            let wanted = &bytes[range.start as usize..range.end as usize];
            assert_eq!(file.read_range(range).unwrap(), wanted);
        }
        assert!(file.read_range(95..101).is_err());
    }

    /// A file beside a cache of 25 bytes, its hash, and the cache.
    fn lender() -> (tempfile::TempDir, PathBuf, [u8; 32], PackCache) {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("00000.part");
        fs::write(&file, [7; 100]).unwrap();
        let long_ago = SystemTime::UNIX_EPOCH + Duration::from_secs(1 << 30);
        File::options().write(true).open(&file).unwrap().set_modified(long_ago).unwrap();
        let cache = PackCache::open(directory.path(), 25, Log::silent()).unwrap();
        (directory, file, *blake3::hash(&[7; 100]).as_bytes(), cache)
    }

    fn state(file: &Path) -> (Vec<u8>, SystemTime) {
        (fs::read(file).unwrap(), fs::metadata(file).unwrap().modified().unwrap())
    }

    #[test]
    fn what_is_linked_is_served_and_kept_as_it_is() {
        let (directory, file, hash, cache) = lender();
        let before = state(&file);
        link_into_cache(directory.path(), [(hash, &*file)]).unwrap();
        let serve = || {
            assert_eq!(cache.find(hash, 100).unwrap(), [7; 100]);
            let mut opened = cache.open_pack(hash).unwrap();
            let mut bytes = Vec::new();
            opened.read_to_end(&mut bytes).unwrap();
            assert_eq!((opened.byte_count(), bytes), (100, vec![7; 100]));
        };
        serve();
        // It takes no room, so it stays.
        (0..10).for_each(|byte| cache.keep([byte; 32], &[byte; 10]).unwrap());
        assert!(cache.open_pack([1; 32]).is_none());
        serve();
        assert_eq!(state(&file), before);
        // Here, where both are on one file system, whatever becomes of its name.
        fs::remove_file(&file).unwrap();
        serve();
    }

    #[test]
    fn what_can_only_be_linked_by_its_path_is_served_too() {
        let (directory, file, hash, cache) = lender();
        let before = state(&file);
        symlink(&file, path_in(&packs_in(directory.path()), hash, LINK_SUFFIX)).unwrap();
        assert_eq!(cache.find(hash, 100).unwrap(), [7; 100]);
        assert_eq!(state(&file), before);
        fs::remove_file(&file).unwrap();
        assert!(cache.open_pack(hash).is_none());
    }

    #[test]
    fn a_damaged_link_goes_and_its_file_stays_as_it_is() {
        let (directory, file, hash, cache) = lender();
        fs::write(&file, [8; 100]).unwrap();
        link_into_cache(directory.path(), [(hash, &*file)]).unwrap();
        let damaged = state(&file);
        assert!(cache.find(hash, 100).is_none());
        assert!(cache.open_pack(hash).is_none());
        cache.keep(hash, &[7; 100]).unwrap();
        assert_eq!(cache.find(hash, 100).unwrap(), [7; 100]);
        assert_eq!(state(&file), damaged);
    }

    #[test]
    fn what_is_not_there_is_not_linked() {
        let (directory, file, hash, cache) = lender();
        fs::remove_file(&file).unwrap();
        assert!(link_into_cache(directory.path(), [(hash, &*file)]).is_err());
        assert!(cache.open_pack(hash).is_none());
    }

    #[test]
    fn what_is_no_directory_is_no_cache() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(PackCache::open(file.path(), CACHE_BYTES_MAX, Log::silent()).is_err());
    }
}

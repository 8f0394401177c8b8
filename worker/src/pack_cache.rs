//! Packs of scenes on this machine: those that were fetched once need not be fetched again.
//!
//! A pack lies in the cache directory under its hash. Several workers may share a directory: a file
//! appears there whole or not at all, and is believed only if its content has the hash. What is
//! spoilt is fetched again.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use equilux_common::job::SceneRef;
use equilux_proto::limits::SESSION_MESSAGE_BYTES_MAX;
use equilux_proto::pack;
use equilux_proto::v1::PackChunk;
use equilux_proto::v1::coordinator_client::CoordinatorClient;
use tempfile::Builder;
use tonic::transport::Channel;
use tonic::{Code, Response, Status, Streaming};

use crate::backoff::Backoff;
use crate::log::Log;

/// Most bytes of packs that are kept; beyond it those not fetched for the longest time go.
pub(crate) const CACHE_BYTES_MAX: u64 = 16 << 30;

/// Beginning of the names of files that are being written.
const PART_PREFIX: &str = ".part-";

/// What is still being written after this long is left over from a process that died.
const PART_AGE_MAX: Duration = Duration::from_secs(24 * 60 * 60);

/// End of the names of packs.
const PACK_SUFFIX: &str = ".pack";

/// How long after a coordinator that is busy is asked again at first, and at most.
const AGAIN_AFTER: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(2));

/// How often a busy coordinator is asked.
const TRIES_MAX: usize = 30;

/// A pack that cannot be had.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum PackError {
    /// The coordinator has none, or does not give it.
    #[error("the coordinator does not hand out the scene: {0}; submit the job again")]
    Refused(String),
    /// It gave another one.
    #[error(
        "the coordinator handed out {got} bytes that are not the scene of {wanted} bytes it named; \
         submit the job again"
    )]
    Other {
        /// Bytes that came.
        got: u64,
        /// Bytes that should have come.
        wanted: u64,
    },
}

impl From<Status> for PackError {
    fn from(status: Status) -> Self {
        match status.code() {
            Code::NotFound => Self::Refused("it does not have it any more".into()),
            _ => Self::Refused(status.message().to_owned()),
        }
    }
}

/// A directory of packs.
#[derive(Clone, Debug)]
pub(crate) struct PackCache {
    directory: PathBuf,
    bytes_max: u64,
    log: Log,
}

impl PackCache {
    /// The cache in `directory`, which is made if there is none.
    ///
    /// # Errors
    /// If files cannot be written there.
    pub(crate) fn open(directory: &Path, log: Log) -> io::Result<Self> {
        let directory = directory.join("packs");
        fs::create_dir_all(&directory)?;
        Builder::new().prefix(PART_PREFIX).tempfile_in(&directory)?;
        Ok(Self { directory, bytes_max: CACHE_BYTES_MAX, log })
    }

    /// The bytes of a scene's pack, fetched from the coordinator unless they are here.
    pub(crate) async fn pack(
        &self,
        scene: &SceneRef,
        client: CoordinatorClient<Channel>,
    ) -> Result<Vec<u8>, PackError> {
        let (cache, hash) = (self.clone(), scene.hash);
        if let Ok(Some(bytes)) = tokio::task::spawn_blocking(move || cache.find(hash)).await {
            return Ok(bytes);
        }
        let bytes = fetch(scene, client).await?;
        let cache = self.clone();
        let kept = tokio::task::spawn_blocking(move || (cache.keep(hash, &bytes), bytes)).await;
        let (kept, bytes) = kept.map_err(|error| PackError::Refused(error.to_string()))?;
        if let Err(error) = kept {
            let directory = self.directory.display();
            self.log.say(format_args!("the scene is not cached in {directory}: {error}"));
        }
        Ok(bytes)
    }

    /// The pack of that hash, if it is here and whole.
    fn find(&self, hash: [u8; 32]) -> Option<Vec<u8>> {
        let path = self.path(hash);
        let bytes = fs::read(&path).ok()?;
        if *blake3::hash(&bytes).as_bytes() == hash {
            return Some(bytes);
        }
        self.log.say(format_args!("{} is damaged and is fetched again", path.display()));
        // If it cannot be removed, it will be written over.
        let _still_there = fs::remove_file(&path);
        None
    }

    /// Writes a pack under its name, whole or not at all.
    fn keep(&self, hash: [u8; 32], bytes: &[u8]) -> io::Result<()> {
        let mut part = Builder::new().prefix(PART_PREFIX).tempfile_in(&self.directory)?;
        part.write_all(bytes)?;
        part.as_file().sync_data()?;
        part.persist(self.path(hash)).map_err(|error| error.error)?;
        self.trim(hash)
    }

    /// Removes the oldest packs beyond the limit, but not the one just written, and what dead
    /// processes have left.
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
        let name = blake3::Hash::from_bytes(hash).to_hex();
        self.directory.join(format!("{name}{PACK_SUFFIX}"))
    }
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

/// Asks for a pack; again, if the coordinator is busy with others.
async fn ask(
    scene: &SceneRef,
    client: &mut CoordinatorClient<Channel>,
) -> Result<Streaming<PackChunk>, Status> {
    let mut backoff = Backoff::new(AGAIN_AFTER.0, AGAIN_AFTER.1);
    for _ in 1..TRIES_MAX {
        match client.fetch_pack(pack::request(scene.hash)).await {
            Err(status) if status.code() == Code::ResourceExhausted => {
                tokio::time::sleep(backoff.next()).await;
            }
            answer => return answer.map(Response::into_inner),
        }
    }
    client.fetch_pack(pack::request(scene.hash)).await.map(Response::into_inner)
}

/// Fetches a pack and makes sure that it is the one.
async fn fetch(scene: &SceneRef, client: CoordinatorClient<Channel>) -> Result<Vec<u8>, PackError> {
    let mut client = client
        .max_decoding_message_size(SESSION_MESSAGE_BYTES_MAX)
        .max_encoding_message_size(SESSION_MESSAGE_BYTES_MAX);
    let mut chunks = ask(scene, &mut client).await?;
    let mut bytes = Vec::new();
    while let Some(wire) = chunks.message().await? {
        let chunk = pack::chunk(wire).map_err(|error| PackError::Refused(error.to_string()))?;
        bytes.extend(chunk);
        if bytes.len() as u64 > scene.pack_bytes {
            break;
        }
    }
    let (got, wanted) = (bytes.len() as u64, scene.pack_bytes);
    let is_the_one = got == wanted && *blake3::hash(&bytes).as_bytes() == scene.hash;
    if is_the_one { Ok(bytes) } else { Err(PackError::Other { got, wanted }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dial;
    use crate::testing::{FakeCoordinator, pack, spec};

    struct Bench {
        coordinator: FakeCoordinator,
        client: CoordinatorClient<Channel>,
        directory: tempfile::TempDir,
        cache: PackCache,
    }

    async fn bench() -> Bench {
        let coordinator = FakeCoordinator::listen("127.0.0.1:0").await;
        let channel = dial::connect(&coordinator.address).await.unwrap();
        let directory = tempfile::tempdir().unwrap();
        let cache = PackCache::open(directory.path(), Log::silent()).unwrap();
        Bench { coordinator, client: CoordinatorClient::new(channel), directory, cache }
    }

    impl Bench {
        async fn get(&self) -> Result<Vec<u8>, PackError> {
            self.cache.pack(&spec(1).scene, self.client.clone()).await
        }

        fn files(&self) -> Vec<String> {
            let name = |entry: io::Result<fs::DirEntry>| {
                entry.unwrap().file_name().to_string_lossy().into_owned()
            };
            fs::read_dir(self.directory.path().join("packs")).unwrap().map(name).collect()
        }
    }

    #[tokio::test]
    async fn a_pack_is_fetched_once() {
        let bench = bench().await;
        assert_eq!(bench.get().await.unwrap(), pack().to_bytes());
        assert_eq!(bench.get().await.unwrap(), pack().to_bytes());
        assert_eq!(bench.coordinator.fetch_count(), 1);
        assert_eq!(bench.files().len(), 1, "{:?}", bench.files());
    }

    #[tokio::test]
    async fn a_busy_coordinator_is_asked_again() {
        let bench = bench().await;
        *bench.coordinator.busy.lock().unwrap() = 2;
        assert_eq!(bench.get().await.unwrap(), pack().to_bytes());
    }

    #[tokio::test]
    async fn a_damaged_pack_is_fetched_again_and_mended() {
        let bench = bench().await;
        bench.get().await.unwrap();
        let path = bench.cache.path(spec(1).scene.hash);
        let mut bytes = fs::read(&path).unwrap();
        bytes[100] ^= 1;
        for damaged in [&bytes[..], &bytes[..10], &[]] {
            fs::write(&path, damaged).unwrap();
            let fetched = bench.coordinator.fetch_count();
            assert_eq!(bench.get().await.unwrap(), pack().to_bytes());
            assert_eq!(bench.coordinator.fetch_count(), fetched + 1);
            assert_eq!(fs::read(&path).unwrap(), pack().to_bytes());
        }
    }

    #[tokio::test]
    async fn what_is_not_the_pack_is_refused_and_leaves_no_file() {
        let bench = bench().await;
        let mut other = pack().to_bytes();
        other[700] ^= 1;
        for wrong in [other.clone(), other[..600].to_vec(), vec![7; 3 << 20], vec![]] {
            *bench.coordinator.handed_out.lock().unwrap() = wrong;
            let refusal = bench.get().await.unwrap_err();
            assert!(matches!(refusal, PackError::Other { .. }), "{refusal}");
            assert_eq!(bench.files(), Vec::<String>::new());
        }
    }

    #[tokio::test]
    async fn the_oldest_packs_and_dead_parts_go() {
        let mut bench = bench().await;
        bench.cache.bytes_max = 25;
        let packs = bench.directory.path().join("packs");
        let aged = |name: &str, days: u64| {
            fs::write(packs.join(name), [0; 10]).unwrap();
            let file = fs::File::options().write(true).open(packs.join(name)).unwrap();
            let now = file.metadata().unwrap().modified().unwrap();
            file.set_modified(now - Duration::from_secs(days * 24 * 60 * 60)).unwrap();
        };
        aged("older.pack", 3);
        aged("newer.pack", 2);
        aged(".part-dead", 3);
        aged(".part-alive", 0);
        bench.cache.keep([9; 32], &[0; 10]).unwrap();
        let mut files = bench.files();
        files.sort();
        let newest = format!("{}.pack", "09".repeat(32));
        assert_eq!(files, [".part-alive", &newest, "newer.pack"]);
    }

    #[tokio::test]
    async fn a_cache_that_cannot_be_written_is_done_without() {
        let bench = bench().await;
        fs::remove_dir_all(bench.directory.path()).unwrap();
        assert_eq!(bench.get().await.unwrap(), pack().to_bytes());
        let file = tempfile::NamedTempFile::new().unwrap();
        assert!(PackCache::open(file.path(), Log::silent()).is_err());
    }
}

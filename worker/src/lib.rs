//! The edges of a worker: its driver, its compute threads, its links to peers and to the
//! coordinator, and the cache of scenes.
//!
//! Thin on purpose: what a worker decides is in `equilux-worker-core`, what it computes in
//! `equilux-render`.

pub mod affinity;
mod backoff;
mod clock;
mod compute;
mod dial;
mod driver;
mod identity;
mod loading;
mod log;
mod pack_cache;
mod packs;
mod peers;
mod recording;
mod residence;
mod residents;
mod run;
mod scenes;
mod session;
mod speed;
mod stored;
#[cfg(test)]
mod testing;

pub use compute::Tracer;
pub use driver::{CoordinatorLink, Partitions, Prepared, SceneSource, drive_local};
pub use log::Log;
pub use pack_cache::{default_cache_directory, link_into_cache};
pub use recording::RecordedScene;
pub use residence::peak_rss_bytes;
pub use run::{Options, WorkerError, run};
pub use scenes::{LoadedScene, StoredScene};

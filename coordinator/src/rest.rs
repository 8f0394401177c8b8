//! REST: the coordinator over HTTP, for people, scripts and browsers (`rest/openapi.json`).

mod events;
mod guard;
mod image;
mod jobs;
mod lingering;
mod metrics;
mod page;
mod problem;
mod served;
mod submission;
mod upload;
mod view;
mod wishes;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware;
use axum::routing::get;
use tokio::sync::{Semaphore, watch};

use crate::archive::ArchiveLimits;
use crate::handle::Handle;
use crate::scene::StoreReader;

pub use problem::Problem;

/// Most bytes of a submission in JSON.
pub const JSON_BYTES_MAX: usize = 64 << 10;

/// Submissions that are unpacked and read at a time: each may take the archive's size in memory.
const SUBMISSIONS_MAX: usize = 8;

/// Images that are encoded at a time.
const ENCODINGS_MAX: usize = 1;

/// Streams of events that are open at a time.
const EVENT_STREAMS_MAX: usize = 256;

/// How the REST service is set up.
#[derive(Clone, Debug)]
pub struct RestOptions {
    /// Below this directory lie the scenes that are submitted by path; none: upload alone.
    pub scenes: Option<PathBuf>,
    /// Reads those of them that are in partitions; none: there are no such.
    pub store_reader: Option<StoreReader>,
    /// Guards what changes state; none: everybody may.
    pub token: Option<String>,
    /// Most bytes of an uploaded archive.
    pub upload_bytes_max: u64,
    /// What an archive may hold.
    pub archive: ArchiveLimits,
    /// Where uploads lie while they are read; none: the system's place for temporary files.
    pub temporary: Option<PathBuf>,
}

impl Default for RestOptions {
    /// No served scenes, no token; uploads of up to 1 GiB.
    fn default() -> Self {
        Self {
            scenes: None,
            store_reader: None,
            token: None,
            upload_bytes_max: 1 << 30,
            archive: ArchiveLimits::default(),
            temporary: None,
        }
    }
}

/// What the handlers share.
#[derive(Clone)]
pub(crate) struct Rest {
    handle: Handle,
    options: Arc<RestOptions>,
    guard: guard::Guard,
    submissions: Arc<Semaphore>,
    encodings: Arc<Semaphore>,
    event_streams: Arc<Semaphore>,
    stopping: watch::Receiver<bool>,
}

impl Rest {
    /// Handlers on `handle` for a listener at `address`.
    pub(crate) fn new(
        handle: Handle,
        options: RestOptions,
        address: SocketAddr,
        stopping: watch::Receiver<bool>,
    ) -> Self {
        let guard = guard::Guard::new(options.token.as_deref(), address);
        Self {
            handle,
            options: Arc::new(options),
            guard,
            submissions: Arc::new(Semaphore::new(SUBMISSIONS_MAX)),
            encodings: Arc::new(Semaphore::new(ENCODINGS_MAX)),
            event_streams: Arc::new(Semaphore::new(EVENT_STREAMS_MAX)),
            stopping,
        }
    }

    /// All routes.
    pub(crate) fn router(self) -> Router {
        let upload_bytes_max = usize::try_from(self.options.upload_bytes_max);
        let body_bytes_max = upload_bytes_max.unwrap_or(usize::MAX);
        let api = Router::new()
            .route("/jobs", get(jobs::list).post(submission::submit))
            .route("/jobs/{id}", get(jobs::show).delete(jobs::cancel))
            .route("/jobs/{id}/events", get(events::stream))
            .route("/jobs/{id}/image.exr", get(image::exr))
            .route("/jobs/{id}/image.png", get(image::png))
            .route("/workers", get(jobs::workers));
        Router::new()
            .nest("/api/v1", api)
            .route("/", get(page::page))
            .route("/healthz", get(page::healthz))
            .route("/metrics", get(metrics::metrics))
            .route("/openapi.json", get(page::openapi))
            .fallback(problem::no_such_path)
            .method_not_allowed_fallback(problem::no_such_method)
            .layer(DefaultBodyLimit::max(body_bytes_max))
            .layer(middleware::from_fn_with_state(self.clone(), guard::check))
            .layer(middleware::from_fn(problem::with_instance))
            .layer(middleware::map_request(async |request| lingering::lingering(request)))
            .with_state(self)
    }
}

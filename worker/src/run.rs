//! A worker process: finds its coordinator, takes part until told to stop, and comes back whenever
//! the session breaks.
//!
//! Each session is a life of its own: core, threads and links are made for it and go with it, so
//! nothing of one life can reach the next, but for scenes, which never change.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use equilux_proto::hello::{Hello, PeerHello};
use equilux_proto::limits::{GREETING_TIMEOUT, THREADS_MAX};
use equilux_proto::roster::is_address;
use equilux_worker_core::Config;
use tokio::net::TcpStream;
use tokio::time::{sleep, timeout};
use tonic::transport::Uri;

use crate::backoff::Backoff;
use crate::driver::{self, Driver, Parts};
use crate::identity::Identity;
use crate::log::Log;
use crate::pack_cache::{
    CACHE_BYTES_MAX, PackCache, default_cache_directory, temporary_cache_directory,
};
use crate::packs::Packs;
use crate::peers::{Door, Entrance, Peers, Ways};
use crate::residents::Residents;
use crate::scenes::FetchedScenes;
use crate::session::{self, Session, SessionError};
use crate::speed::{self, Measurement};

/// How long after a session broke the next is tried at first, and at most.
const AGAIN_AFTER: (Duration, Duration) = (Duration::from_millis(100), Duration::from_secs(5));

/// How a worker is run.
#[derive(Clone, Debug)]
pub struct Options {
    /// The coordinator, `http://host:port` or `host:port`.
    pub coordinator: String,
    /// Compute threads.
    pub threads: u32,
    /// Bytes of memory for partitions and for rays that wait for them; none: as many as needed.
    pub memory: Option<u64>,
    /// Directory of the cache; none: that of the user.
    pub cache: Option<PathBuf>,
    /// Most bytes that are kept there.
    pub cache_bytes_max: u64,
    /// Where peers are let in; none: any port of the interface that leads to the coordinator.
    pub listen: Option<SocketAddr>,
    /// `host` or `host:port` at which peers find this worker; none: where it listens.
    pub advertise: Option<String>,
    /// Where the user is told of what goes wrong meanwhile.
    pub log: Log,
}

impl Options {
    /// A thread per core, and defaults for the rest.
    #[must_use]
    pub fn new(coordinator: impl Into<String>) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            coordinator: coordinator.into(),
            threads: u32::try_from(cores).unwrap_or(1),
            memory: None,
            cache: None,
            cache_bytes_max: CACHE_BYTES_MAX,
            listen: None,
            advertise: None,
            log: Log::to_stderr(),
        }
    }
}

/// A worker that cannot work.
#[derive(Debug, thiserror::Error)]
pub enum WorkerError {
    /// No address of a coordinator.
    #[error(
        "--coordinator {given}: {problem}; give it as http://HOST:PORT, the port being the one \
         after --grpc"
    )]
    Coordinator {
        /// As given.
        given: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// No threads, or too many.
    #[error("--threads {0}: must be from 1 to {THREADS_MAX}")]
    ThreadCount(u32),
    /// The system gives no more threads.
    #[error("cannot start {count} compute threads: {cause}; use fewer with --threads")]
    Threads {
        /// How many were asked for.
        count: u32,
        /// What the system says.
        cause: io::Error,
    },
    /// The cache cannot be used.
    #[error(
        "cannot write to the cache directory {}: {cause}; name another one with --cache",
        path.display()
    )]
    Cache {
        /// Which directory.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// Peers cannot be let in.
    #[error("cannot listen for peers on {address}: {cause}; {}", remedy(cause))]
    Listen {
        /// Where.
        address: SocketAddr,
        /// What the system says.
        cause: io::Error,
    },
    /// No address for peers.
    #[error("--advertise {0}: is not HOST or HOST:PORT")]
    Advertise(String),
    /// The coordinator does not let this worker in, and never will.
    #[error("the coordinator at {coordinator} refuses this worker: {reason}")]
    Refused {
        /// Where it is.
        coordinator: String,
        /// Why, with both versions.
        reason: String,
    },
}

fn remedy(cause: &io::Error) -> &'static str {
    match cause.kind() {
        io::ErrorKind::AddrInUse => {
            "another program uses that port: choose another with --listen, or port 0 for any"
        }
        io::ErrorKind::AddrNotAvailable => {
            "it is no address of this machine: choose one of its own"
        }
        io::ErrorKind::PermissionDenied => "choose a port above 1023 with --listen",
        _ => "choose another address with --listen",
    }
}

/// Runs a worker until `shutdown` is ready. A coordinator that is not there is waited for.
///
/// # Errors
/// If the options are wrong, or the coordinator is of another version.
pub async fn run(options: Options, shutdown: impl Future<Output = ()>) -> Result<(), WorkerError> {
    let worker = Worker::prepare(options)?;
    tokio::select! {
        error = worker.serve() => Err(error),
        () = shutdown => Ok(()),
    }
}

/// A worker between its lives.
struct Worker {
    options: Options,
    authority: String,
    cache: PackCache,
    residents: Residents,
    identity: Identity,
    listener: Option<(IpAddr, TcpListener)>,
    backoff: Backoff,
}

/// Why a life ended.
enum End {
    /// The next one may be better.
    Session(SessionError),
    /// There will be no other.
    Final(WorkerError),
}

impl From<SessionError> for End {
    fn from(error: SessionError) -> Self {
        Self::Session(error)
    }
}

impl From<WorkerError> for End {
    fn from(error: WorkerError) -> Self {
        Self::Final(error)
    }
}

impl Worker {
    /// Checks the options, as far as that can be done alone.
    fn prepare(options: Options) -> Result<Self, WorkerError> {
        let authority = authority(&options.coordinator)?;
        if !(1..=THREADS_MAX).contains(&options.threads) {
            return Err(WorkerError::ThreadCount(options.threads));
        }
        if let Some(advertise) = options.advertise.as_ref().filter(|given| !is_findable(given)) {
            return Err(WorkerError::Advertise(advertise.clone()));
        }
        let (directory, cache) = open_cache(&options)?;
        let identity = Identity::claim(&directory);
        let listener = match options.listen {
            Some(address) => Some((address.ip(), bind(address)?)),
            None => None,
        };
        let backoff = Backoff::new(AGAIN_AFTER.0, AGAIN_AFTER.1);
        let residents = Residents::new(options.log.clone());
        Ok(Self { options, authority, cache, residents, identity, listener, backoff })
    }

    /// One life after another.
    async fn serve(mut self) -> WorkerError {
        let speed = speed::measure(self.options.threads);
        loop {
            let why = match self.live(&speed).await {
                Err(End::Final(error)) => return error,
                Err(End::Session(SessionError::Refused(reason))) => {
                    let coordinator = self.options.coordinator;
                    return WorkerError::Refused { coordinator, reason };
                }
                Err(End::Session(why)) | Ok(why) => why,
            };
            let wait = self.backoff.next();
            self.options.log.say(format_args!(
                "the coordinator at {} {why}; trying again in {} s",
                self.authority,
                wait.as_secs_f32()
            ));
            sleep(wait).await;
        }
    }

    /// From the first word to the end of a session; says why it ended.
    async fn live(&mut self, speed: &Measurement) -> Result<SessionError, End> {
        let local = self.local_address().await?;
        let speed = speed.clone().await;
        let (listener, bound) = self.listen(local)?;
        let hello = Hello {
            name: self.identity.name().to_owned(),
            address: advertised(self.options.advertise.as_deref(), bound, local),
            threads: self.options.threads,
            speed,
            memory: self.options.memory,
        };
        let Session { welcome, link, client, end } = session::open(&self.authority, hello).await?;
        self.backoff.reset();
        let (worker, incarnation) = (welcome.worker, welcome.incarnation);
        let own = PeerHello { worker, incarnation };
        let door = Arc::new(Door::new());
        let failed = |cause| WorkerError::Listen { address: bound, cause };
        let packs = Packs::new(self.cache.clone(), client, self.options.log.clone());
        let entrance = Entrance::open(listener, own, &door, packs.passing());
        let _entrance = entrance.map_err(failed)?;
        let inputs = driver::inputs();
        let ways = Ways { door, inputs: inputs.0.clone(), log: self.options.log.clone() };
        let threads = self.options.threads;
        let residents = self.residents.clone();
        let parts = Parts {
            config: Config { worker, incarnation, threads, speed, memory: self.options.memory },
            scenes: Arc::new(FetchedScenes::new(residents, packs)),
            peers: Peers::new(own, ways),
            inputs,
        };
        let failed = |cause| WorkerError::Threads { count: threads, cause };
        Driver::start(parts, link).map_err(failed)?.run().await;
        Ok(end.await.unwrap_or_else(|_| SessionError::Ended("the connection broke".into())))
    }

    /// This machine's address on the way to the coordinator: the one at which peers that share the
    /// coordinator's network find it.
    async fn local_address(&self) -> Result<IpAddr, SessionError> {
        let unreachable = |error: io::Error| SessionError::Unreachable(error.to_string());
        let probe = timeout(GREETING_TIMEOUT, TcpStream::connect(&self.authority)).await;
        let probe = probe.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()));
        let stream = probe.map_err(unreachable)?;
        Ok(stream.local_addr().map_err(unreachable)?.ip())
    }

    /// The socket for peers, which is kept from life to life, and where it is.
    fn listen(&mut self, local: IpAddr) -> Result<(TcpListener, SocketAddr), WorkerError> {
        let is_kept =
            |&(ip, _): &(IpAddr, TcpListener)| self.options.listen.is_some() || ip == local;
        let any_port = SocketAddr::new(local, 0);
        let listener = match self.listener.take().filter(is_kept) {
            Some((_, listener)) => listener,
            None => bind(any_port)?,
        };
        let failed = |cause| WorkerError::Listen { address: any_port, cause };
        let bound = listener.local_addr().map_err(failed)?;
        let copy = listener.try_clone().map_err(failed)?;
        self.listener = Some((local, listener));
        Ok((copy, bound))
    }
}

/// Opens the cache that was asked for, or any that can be written to if none was.
fn open_cache(options: &Options) -> Result<(PathBuf, PackCache), WorkerError> {
    let path = options.cache.clone().unwrap_or_else(default_cache_directory);
    match PackCache::open(&path, options.cache_bytes_max, options.log.clone()) {
        Ok(cache) => Ok((path, cache)),
        Err(cause) if options.cache.is_some() => Err(WorkerError::Cache { path, cause }),
        Err(_) => {
            let path = temporary_cache_directory();
            match PackCache::open(&path, options.cache_bytes_max, options.log.clone()) {
                Ok(cache) => Ok((path, cache)),
                Err(cause) => Err(WorkerError::Cache { path, cause }),
            }
        }
    }
}

fn bind(address: SocketAddr) -> Result<TcpListener, WorkerError> {
    let bind = std::net::TcpListener::bind(address);
    bind.map_err(|cause| WorkerError::Listen { address, cause })
}

/// The `host:port` of a URL.
fn authority(given: &str) -> Result<String, WorkerError> {
    let invalid = |problem| WorkerError::Coordinator { given: given.to_owned(), problem };
    let url = if given.contains("://") { given.to_owned() } else { format!("http://{given}") };
    let uri: Uri = url.parse().map_err(|_| invalid("is not a URL"))?;
    if uri.scheme_str() != Some("http") {
        return Err(invalid("only http is spoken"));
    }
    if !matches!(uri.path(), "" | "/") || uri.query().is_some() {
        return Err(invalid("has more than a host and a port"));
    }
    let authority = uri.authority().ok_or_else(|| invalid("has no host"))?;
    if authority.as_str().contains('@') {
        return Err(invalid("has more than a host and a port"));
    }
    match authority.port_u16() {
        None | Some(0) => Err(invalid("has no port")),
        Some(_) => Ok(authority.as_str().to_owned()),
    }
}

/// Whether peers could be told this.
fn is_findable(advertise: &str) -> bool {
    let any = SocketAddr::from(([127, 0, 0, 1], 1));
    is_address(&advertised(Some(advertise), any, any.ip()))
}

/// Where peers find this worker.
fn advertised(advertise: Option<&str>, bound: SocketAddr, local: IpAddr) -> String {
    let port = bound.port();
    match advertise {
        Some(host) if host.starts_with('[') && host.ends_with(']') => format!("{host}:{port}"),
        Some(address) if address.contains(':') => address.to_owned(),
        Some(host) => format!("{host}:{port}"),
        None if bound.ip().is_unspecified() => SocketAddr::new(local, port).to_string(),
        None => bound.to_string(),
    }
}

#[cfg(test)]
mod tests;

//! A coordinator as a service: both listeners bound, then served until it is told to stop.

use std::io;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::sync::watch;

use crate::handle::Handle;
use crate::listener::LimitedListener;
use crate::rest::{Rest, RestOptions};
use crate::service::{serve_workers, stopped};
use crate::store::{Store, StoreError};

/// Where workers connect unless told otherwise.
pub const GRPC_ADDRESS: &str = "127.0.0.1:7878";

/// Where REST is served unless told otherwise.
pub const HTTP_ADDRESS: &str = "127.0.0.1:8080";

/// Connections that the REST service holds at a time; more wait at the door.
const HTTP_CONNECTIONS_MAX: usize = 1024;

/// How long open requests may take to end when the coordinator stops.
const STOP_TIMEOUT: Duration = Duration::from_secs(5);

/// How a coordinator is set up.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// `host:port` for workers. Whoever reaches it can take part: keep it in a trusted network.
    pub grpc: String,
    /// `host:port` for REST.
    pub http: String,
    /// Where images of jobs that have ended are kept.
    pub data: PathBuf,
    /// REST is served to other machines although there is no token.
    pub allow_open: bool,
    /// The rest of REST. Uploads lie in the data directory unless it says otherwise.
    pub rest: RestOptions,
}

/// A coordinator that does not start or does not go on.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// Somebody listens there already.
    #[error("{address}: the port is in use; stop what uses it, or choose another one by {flag}")]
    PortInUse {
        /// Where.
        address: String,
        /// The flag that says where.
        flag: &'static str,
    },
    /// One cannot listen there.
    #[error("{address}: cannot listen there: {cause}; give HOST:PORT of this machine by {flag}")]
    Listen {
        /// Where.
        address: String,
        /// The flag that says where.
        flag: &'static str,
        /// Why.
        cause: io::Error,
    },
    /// Everybody could change everything.
    #[error(
        "{address}: other machines could submit and cancel jobs; set a token by --token or \
         EQUILUX_TOKEN, or say --allow-open if everybody there is trusted"
    )]
    Open {
        /// Where.
        address: SocketAddr,
    },
    /// The served root is none.
    #[error("{}: {cause}; name a directory with scenes by --scenes", .path.display())]
    Scenes {
        /// The directory.
        path: PathBuf,
        /// What is wrong.
        cause: io::Error,
    },
    /// The data directory cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// gRPC failed as a whole.
    #[error("serving workers failed: {0}")]
    Grpc(#[from] tonic::transport::Error),
    /// REST failed as a whole.
    #[error("serving REST failed: {0}")]
    Http(#[source] io::Error),
}

/// A coordinator whose listeners are bound.
#[derive(Debug)]
pub struct Server {
    handle: Handle,
    grpc: TcpListener,
    http: TcpListener,
    grpc_address: SocketAddr,
    http_address: SocketAddr,
    rest: RestOptions,
}

impl Server {
    /// Binds both listeners, opens the data directory and starts the coordinator.
    ///
    /// # Errors
    /// If something of that cannot be had, with what to do about it.
    pub async fn bind(options: ServeOptions) -> Result<Self, ServeError> {
        let ServeOptions { grpc, http, data, allow_open, mut rest } = options;
        check_scenes(&rest)?;
        let (grpc, grpc_address) = listen(grpc, "--grpc").await?;
        let (http, http_address) = listen(http, "--http").await?;
        if !(http_address.ip().is_loopback() || rest.token.is_some() || allow_open) {
            return Err(ServeError::Open { address: http_address });
        }
        let store = Store::open(&data)?;
        rest.temporary.get_or_insert(data);
        let handle = Handle::start(Some(store));
        Ok(Self { handle, grpc, http, grpc_address, http_address, rest })
    }

    /// Where workers connect.
    #[must_use]
    pub const fn grpc_address(&self) -> SocketAddr {
        self.grpc_address
    }

    /// Where REST is served.
    #[must_use]
    pub const fn http_address(&self) -> SocketAddr {
        self.http_address
    }

    /// The way in to the coordinator.
    #[must_use]
    pub fn handle(&self) -> Handle {
        self.handle.clone()
    }

    /// Serves until `shutdown` comes; sessions and streams of events end then, and other requests
    /// have a moment to do so.
    ///
    /// # Errors
    /// If a listener fails.
    pub async fn run(self, shutdown: impl Future<Output = ()>) -> Result<(), ServeError> {
        let (stop, stopping) = watch::channel(false);
        let rest = Rest::new(self.handle.clone(), self.rest, self.http_address, stopping.clone());
        let http = LimitedListener::new(self.http, HTTP_CONNECTIONS_MAX);
        let http = axum::serve(http, rest.router()).with_graceful_shutdown(stopped(&stopping));
        let grpc = serve_workers(self.handle, self.grpc, stopping.clone());
        let served = async {
            tokio::try_join!(async { grpc.await.map_err(ServeError::Grpc) }, async {
                http.await.map_err(ServeError::Http)
            },)
        };
        tokio::pin!(served);
        tokio::select! {
            ended = &mut served => return ended.map(|_| ()),
            () = shutdown => (),
        }
        stop.send_replace(true);
        // Who has not ended by then is cut off: nobody waits for a client that does not read.
        tokio::time::timeout(STOP_TIMEOUT, served).await.map_or(Ok(()), |ended| ended.map(|_| ()))
    }
}

async fn listen(
    address: String,
    flag: &'static str,
) -> Result<(TcpListener, SocketAddr), ServeError> {
    let bound = async {
        let listener = TcpListener::bind(&address).await?;
        let bound = listener.local_addr()?;
        Ok((listener, bound))
    };
    bound.await.map_err(|cause: io::Error| match cause.kind() {
        io::ErrorKind::AddrInUse => ServeError::PortInUse { address: address.clone(), flag },
        _ => ServeError::Listen { address: address.clone(), flag, cause },
    })
}

fn check_scenes(rest: &RestOptions) -> Result<(), ServeError> {
    let Some(path) = &rest.scenes else { return Ok(()) };
    let listed = std::fs::read_dir(path);
    listed.map(|_| ()).map_err(|cause| ServeError::Scenes { path: path.clone(), cause })
}

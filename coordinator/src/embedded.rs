//! A coordinator for workers of this machine alone: no REST, no store, any free port on loopback.

use std::io;
use std::net::{Ipv4Addr, SocketAddr};

use tokio::net::TcpListener;
use tokio::sync::watch;

use crate::handle::Handle;
use crate::service::serve_workers;

/// Lets workers in until it is dropped.
#[derive(Debug)]
pub struct EmbeddedServer {
    address: SocketAddr,
    _stop: watch::Sender<bool>,
}

impl EmbeddedServer {
    /// Listens on loopback for the workers of a coordinator.
    ///
    /// # Errors
    /// If the system gives no port.
    pub async fn start(handle: Handle) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let address = listener.local_addr()?;
        let (stop, stopping) = watch::channel(false);
        tokio::spawn(serve_workers(handle, listener, stopping));
        Ok(Self { address, _stop: stop })
    }

    /// Where workers connect.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }
}

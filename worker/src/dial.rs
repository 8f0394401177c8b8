//! How connections are opened: the same way to the coordinator and to peers.

use std::error::Error;

use equilux_proto::limits::{GREETING_TIMEOUT, KEEPALIVE_INTERVAL, KEEPALIVE_TIMEOUT};
use tonic::transport::{Channel, Endpoint};

/// Bytes that may be on the way before the reader must have read some: packs and film values fill
/// a fast network with these.
const WINDOW_BYTES: u32 = 4 << 20;

/// Opens a connection to `authority` (`host:port`), or says in words why not.
pub(crate) async fn connect(authority: &str) -> Result<Channel, String> {
    let endpoint = Endpoint::from_shared(format!("http://{authority}"))
        .map_err(|error| chain(&error))?
        .tcp_nodelay(true)
        .connect_timeout(GREETING_TIMEOUT)
        .initial_stream_window_size(WINDOW_BYTES)
        .initial_connection_window_size(WINDOW_BYTES)
        .http2_keep_alive_interval(KEEPALIVE_INTERVAL)
        .keep_alive_timeout(KEEPALIVE_TIMEOUT)
        .keep_alive_while_idle(true);
    endpoint.connect().await.map_err(|error| chain(&error))
}

/// An error with all its causes.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(deeper) = cause {
        text = format!("{text}: {deeper}");
        cause = deeper.source();
    }
    text
}

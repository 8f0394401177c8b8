//! Loading that goes on in a task or on a thread of its own: a panic there is a bug, but no reason
//! to wait for ever.

use tokio::task::JoinHandle;

/// What loading came to, a panic being one of its errors.
pub(crate) async fn outcome<T>(loading: JoinHandle<Result<T, String>>) -> Result<T, String> {
    loading.await.unwrap_or_else(|error| {
        Err(format!(
            "loading the scene failed: {error}; this is a bug in equilux, please report it"
        ))
    })
}

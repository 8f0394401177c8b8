//! Bodies that are refused while they are still being sent.
//!
//! Many clients send all of a body before they read a word of the answer. If the connection were
//! closed on them, they would report a broken pipe instead of what was wrong. So what comes after
//! a refusal is read and thrown away for a while.

use std::time::Duration;

use axum::body::{Body, BodyDataStream, HttpBody};
use axum::extract::Request;
use futures::StreamExt;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

/// How long a refused body is read on.
const LINGER_MAX: Duration = Duration::from_secs(10);

/// Pieces of a body that wait for the handler.
const PIECES_MAX: usize = 4;

/// The request with a body that may be dropped at any time.
pub(crate) fn lingering(request: Request) -> Request {
    if request.body().is_end_stream() {
        return request;
    }
    request.map(|body| {
        let (pieces, wanted) = mpsc::channel(PIECES_MAX);
        tokio::spawn(pump(body.into_data_stream(), pieces));
        Body::from_stream(ReceiverStream::new(wanted))
    })
}

/// Hands the pieces on as long as they are wanted, then throws them away.
async fn pump(mut body: BodyDataStream, pieces: mpsc::Sender<Result<bytes::Bytes, axum::Error>>) {
    loop {
        tokio::select! {
            () = pieces.closed() => break,
            piece = body.next() => {
                let Some(piece) = piece else { return };
                if pieces.send(piece).await.is_err() {
                    break;
                }
            }
        }
    }
    let thrown_away = async { while let Some(Ok(_)) = body.next().await {} };
    // Who has not sent it all by then is cut off.
    let _cut_off = tokio::time::timeout(LINGER_MAX, thrown_away).await;
}

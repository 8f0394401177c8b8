//! A job's events: its status, sent whenever it changes (server-sent events, HTML § 9.2).

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::{Path, State};
use axum::response::sse::{Event, KeepAlive, Sse};
use equilux_common::ids::JobId;
use futures::stream::{self, Stream};
use tokio::sync::{OwnedSemaphorePermit, watch};

use super::problem::Problem;
use super::{Rest, jobs, view};
use crate::handle::Handle;
use crate::status::JobStatus;

/// Least time between two events of one stream: units are committed by the thousand.
const EVENT_INTERVAL: Duration = Duration::from_millis(250);

/// An event is sent at least so often while nothing changes but the time.
const SILENCE_MAX: Duration = Duration::from_secs(2);

/// `GET /jobs/{id}/events`: one event `job` at once, one per change, and the last when the job has
/// ended.
pub(crate) async fn stream(
    State(rest): State<Rest>,
    Path(id): Path<String>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, Problem> {
    let job = jobs::found(&rest, &id)?.id;
    let Ok(permit) = Arc::clone(&rest.event_streams).try_acquire_owned() else {
        return Err(Problem::busy("too many event streams are open; poll the job instead"));
    };
    let changes = rest.handle.watch(job).ok_or_else(|| Problem::not_found("the job is gone"))?;
    let watcher =
        Watcher { handle: rest.handle, job, changes, stopping: rest.stopping, _permit: permit };
    let events = stream::unfold(Some((watcher, true)), next_event);
    Ok(Sse::new(events).keep_alive(KeepAlive::default()))
}

/// Somebody who watches a job.
struct Watcher {
    handle: Handle,
    job: JobId,
    changes: watch::Receiver<JobStatus>,
    stopping: watch::Receiver<bool>,
    /// One of the streams that may be open.
    _permit: OwnedSemaphorePermit,
}

/// The next event and the watcher who waits for the one after it, if there is one. The first comes
/// at once.
async fn next_event(
    state: Option<(Watcher, bool)>,
) -> Option<(Result<Event, Infallible>, Option<(Watcher, bool)>)> {
    let (mut watcher, is_first) = state?;
    if !is_first {
        tokio::select! {
            _ = watcher.stopping.wait_for(|is_stopping| *is_stopping) => return None,
            () = next_change(&mut watcher.changes) => (),
        }
    }
    watcher.changes.mark_unchanged();
    let status = watcher.handle.job(watcher.job)?;
    let event = Event::default().event("job").data(view::job(&status).to_string());
    let goes_on = !status.has_ended();
    Some((Ok(event), goes_on.then_some((watcher, false))))
}

/// Waits for a change, but neither too short nor too long.
async fn next_change(changes: &mut watch::Receiver<JobStatus>) {
    tokio::time::sleep(EVENT_INTERVAL).await;
    // A job that is forgotten while it is watched is found out by the next look at it.
    let _changed_or_late = tokio::time::timeout(SILENCE_MAX, changes.changed()).await;
}

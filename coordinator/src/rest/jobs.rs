//! Jobs and workers: listed, shown, cancelled.

use axum::Json;
use axum::extract::{Path, State};
use equilux_common::ids::JobId;
use serde_json::Value;

use super::Rest;
use super::problem::Problem;
use super::view;
use crate::status::JobStatus;

/// `GET /jobs`
pub(crate) async fn list(State(rest): State<Rest>) -> Json<Value> {
    Json(rest.handle.jobs().iter().map(view::job).collect())
}

/// `GET /jobs/{id}`
pub(crate) async fn show(
    State(rest): State<Rest>,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    Ok(Json(view::job(&found(&rest, &id)?)))
}

/// `DELETE /jobs/{id}`: cancels a job that has not ended, and shows it. Again makes no difference.
pub(crate) async fn cancel(
    State(rest): State<Rest>,
    Path(id): Path<String>,
) -> Result<Json<Value>, Problem> {
    let job = found(&rest, &id)?.id;
    rest.handle.cancel(job).await;
    Ok(Json(view::job(&found(&rest, &id)?)))
}

/// `GET /workers`
pub(crate) async fn workers(State(rest): State<Rest>) -> Json<Value> {
    let now = rest.handle.now();
    let workers = rest.handle.workers();
    let views = workers.iter().map(|status| view::worker(status, now.since(status.since)));
    Json(views.collect())
}

/// The job that a path names.
pub(crate) fn found(rest: &Rest, id: &str) -> Result<JobStatus, Problem> {
    let number = id.parse().ok().map(JobId);
    number.and_then(|job| rest.handle.job(job)).ok_or_else(|| {
        let id = super::wishes::shortened(id);
        Problem::not_found(format!("there is no job {id}; GET /api/v1/jobs lists those there are"))
    })
}

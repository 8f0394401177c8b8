//! Jobs and workers as the REST service shows them.

use std::time::Duration;

use equilux_common::balancing::Word;
use equilux_common::ids::WorkerId;
use equilux_common::job::Settings;
use equilux_common::message::WorkerFigures;
use equilux_coordinator_core::action::JobState;
use serde_json::{Map, Value, json};

use crate::status::{JobPlan, JobStatus, WorkerStatus};

/// A job in full.
pub(crate) fn job(status: &JobStatus) -> Value {
    let plan = &status.plan;
    let mut view = Map::new();
    view.insert("id".into(), status.id.0.into());
    view.insert("name".into(), plan.name.as_str().into());
    view.insert("scene".into(), plan.scene.as_str().into());
    view.insert("state".into(), status.state.name().into());
    view.insert("progress".into(), status.progress().into());
    view.insert("units".into(), status.units.into());
    view.insert("units_committed".into(), status.units_committed.into());
    view.insert("elapsed_s".into(), status.elapsed.as_secs_f64().into());
    view.insert("startup_s".into(), status.startup.as_secs_f64().into());
    view.insert("remaining_s".into(), status.remaining().map(|left| left.as_secs_f64()).into());
    view.insert("settings".into(), settings(plan));
    if let Some(error) = error(status) {
        view.insert("error".into(), error.into());
    }
    view.insert("warnings".into(), plan.warnings.clone().into());
    view.insert("workers".into(), status.workers.iter().map(figures).collect());
    Value::Object(view)
}

/// What went wrong, if anything did.
fn error(status: &JobStatus) -> Option<String> {
    match (&status.state, &status.store_error) {
        (JobState::Failed { reason }, _) => Some(reason.clone()),
        (_, store_error) => store_error.clone(),
    }
}

fn settings(plan: &JobPlan) -> Value {
    let Settings { width, height, crop, samples_per_pixel, max_depth, seed, .. } = plan.settings;
    json!({
        "spp": samples_per_pixel,
        "width": width,
        "height": height,
        "max_depth": max_depth,
        "seed": seed,
        "crop": crop.map(|crop| [crop.x0, crop.y0, crop.x1, crop.y1]),
        "camera": plan.camera,
        "light_samples": plan.settings.light_samples.as_slice(),
        "indirect_samples": plan.settings.indirect_samples.as_slice(),
        "balance": plan.balancing.balance.name(),
        "diffusion_step": plan.balancing.step.name(),
        "give_first": plan.balancing.give_first.name(),
        "exchange": plan.balancing.exchange.name(),
        "mapping": plan.balancing.mapping.name(),
        "topology": plan.topology.name(),
        "workers_min": plan.workers_min,
    })
}

fn figures((worker, figures): &(WorkerId, WorkerFigures)) -> Value {
    let rays = figures.rays;
    json!({
        "id": worker.0,
        "busy_s": figures.busy.as_secs_f64(),
        "idle_s": figures.idle.as_secs_f64(),
        "finish_s": figures.finish.as_secs_f64(),
        "rays": {
            "camera": rays.camera,
            "indirect": rays.indirect,
            "specular": rays.specular,
            "shadow": rays.shadow,
        },
        "bundles_in": figures.bundles_in,
        "bundles_out": figures.bundles_out,
        "rays_in": figures.rays_in,
        "rays_out": figures.rays_out,
        "forwards": figures.forwards,
        "bytes_in": figures.bytes_in,
        "bytes_out": figures.bytes_out,
        "balance_requests": figures.balance_requests,
        "partition_loads": figures.partition_loads,
        "peak_rss_bytes": figures.peak_rss_bytes,
    })
}

/// A connected worker; `connected` is the time since it was let in.
pub(crate) fn worker(status: &WorkerStatus, connected: Duration) -> Value {
    json!({
        "id": status.worker.0,
        "incarnation": status.incarnation.0,
        "name": status.name,
        "address": status.address,
        "threads": status.threads,
        "connected_s": connected.as_secs_f64(),
    })
}

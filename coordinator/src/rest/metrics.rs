//! Figures for Prometheus, in its text format (version 0.0.4).

use std::fmt::Write;

use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;

use super::Rest;
use crate::status::{JobStatus, Totals};

/// States of jobs, so that each is there even when no job is in it.
const STATES: [&str; 6] = ["queued", "preparing", "rendering", "done", "failed", "cancelled"];

/// `GET /metrics`
pub(crate) async fn metrics(State(rest): State<Rest>) -> impl IntoResponse {
    let workers = rest.handle.workers();
    let threads = workers.iter().map(|worker| u64::from(worker.threads)).sum();
    let text = text(&rest.handle.jobs(), rest.handle.totals(), workers.len() as u64, threads);
    ([(header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8")], text)
}

fn text(jobs: &[JobStatus], totals: Totals, workers: u64, threads: u64) -> String {
    let mut page = Page::default();
    page.metric("equilux_workers", "gauge", "Workers that are connected.", workers);
    page.metric("equilux_threads", "gauge", "Compute threads of connected workers.", threads);
    page.head("equilux_jobs", "gauge", "Jobs that are known, by state.");
    for state in STATES {
        let count = jobs.iter().filter(|job| job.state.name() == state).count();
        page.line(&format!("equilux_jobs{{state=\"{state}\"}}"), count as u64);
    }
    page.metric("equilux_jobs_total", "counter", "Jobs submitted.", totals.jobs);
    let units = totals.units_committed;
    page.metric("equilux_units_committed_total", "counter", "Units committed.", units);
    page.metric("equilux_rays_total", "counter", "Rays of every kind cast.", totals.rays);
    let help = "Bytes that workers sent to one another.";
    page.metric("equilux_peer_bytes_total", "counter", help, totals.bytes);
    page.text
}

#[derive(Default)]
struct Page {
    text: String,
}

impl Page {
    fn metric(&mut self, name: &str, kind: &str, help: &str, value: u64) {
        self.head(name, kind, help);
        self.line(name, value);
    }

    fn head(&mut self, name: &str, kind: &str, help: &str) {
        self.push(format_args!("# HELP {name} {help}\n# TYPE {name} {kind}\n"));
    }

    fn line(&mut self, name: &str, value: u64) {
        self.push(format_args!("{name} {value}\n"));
    }

    fn push(&mut self, text: std::fmt::Arguments<'_>) {
        self.text.write_fmt(text).expect("a string takes any text");
    }
}

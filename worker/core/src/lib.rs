//! The protocol side of a worker: a state machine that moves work in bulk and never looks inside a
//! ray.
//!
//! A driver feeds it events and the time and carries out its actions; it does no I/O and cannot
//! fail (`ARCHITECTURE.md`, "Cores and drivers").

mod accounts;
pub mod action;
mod allowance;
mod balance;
mod cost;
mod early;
pub mod event;
mod forwarding;
mod holding;
mod homes;
mod job;
mod ledger;
mod links;
mod pieces;
mod queue;
mod residency;
mod routing;
mod tally;
mod violation;
mod worker_core;

pub use pieces::PieceId;
pub use residency::memory_for;
pub use worker_core::{Config, WINDOW_GIFTS, WorkerCore};

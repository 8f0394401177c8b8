//! The protocol side of the coordinator: who takes part, who renders what, and when an image is
//! whole.
//!
//! A driver feeds it events and the time and carries out its actions; it does no I/O and cannot
//! fail (`ARCHITECTURE.md`, "Cores and drivers"). It is thin: after start-up it hands out no work,
//! unless a worker is lost.

pub mod action;
mod closing;
mod coordinator_core;
pub mod event;
mod gathering;
mod issue;
mod job;
mod pace;
mod roster;
mod violation;

pub use coordinator_core::{Config, CoordinatorCore};

//! The protocol side of a worker: a state machine that moves work in bulk and never looks inside a
//! ray.
//!
//! A driver feeds it events and the time and carries out its actions; it does no I/O and cannot
//! fail (`ARCHITECTURE.md`, "Cores and drivers").

pub mod action;
pub mod event;

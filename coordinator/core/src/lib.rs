//! The protocol side of the coordinator: who takes part, who renders what, and when an image is
//! whole.
//!
//! A driver feeds it events and the time and carries out its actions; it does no I/O and cannot
//! fail (`ARCHITECTURE.md`, "Cores and drivers"). It is thin: after start-up it hands out no work.

pub mod action;
pub mod event;

//! The edges of the coordinator.

pub mod archive;

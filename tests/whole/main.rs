//! The whole program as a user runs it: real processes, real sockets, real signals.

mod bad_input;
mod cache;
mod cluster;
mod costs;
mod extremes;
mod full_disk;
mod images;
mod kernel;
mod partitions;
mod served;
mod service;
mod signals;
mod simulate;
mod support;

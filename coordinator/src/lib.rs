//! The edges of the coordinator: the driver around its core, workers' sessions over gRPC, REST for
//! people, and the store of images.
//!
//! ```text
//! workers ──gRPC── service, session ──┐
//! this process ────── connection ─────┤── handle ── driver ── core
//! people ──HTTP── rest ───────────────┘               │
//!                   └──────────── board ◄─────────────┘
//! ```
//!
//! The [`handle::Handle`] is the only way in. The driver alone owns the core and writes the board;
//! everybody reads the board without waiting for the driver.

pub mod archive;
pub mod attachments;
mod board;
mod clock;
pub mod connection;
mod driver;
pub mod embedded;
pub mod film;
pub mod handle;
mod listener;
pub mod order;
mod picture;
pub mod rest;
pub mod scene;
pub mod serve;
mod service;
mod session;
pub mod status;
pub mod store;

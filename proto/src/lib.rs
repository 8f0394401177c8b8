//! The wire: what is sent between processes, generated from `proto/`, and its conversion to and
//! from the vocabulary of `equilux-common`.
//!
//! This is the door. Whatever arrives is checked here once, and what passes is a type of
//! `equilux-common` that cannot be wrong; each conversion has its own `Invalid…` error that names
//! the field. No type of [`v1`] goes further than the edges that hold the sockets.
//!
//! The layouts that are not protobuf (bundles, film values) are described in `docs/wire.md`.

pub mod balancing;
pub mod bundle;
mod cursor;
pub mod hello;
pub mod job;
pub mod limits;
pub mod pack;
pub mod peer;
pub mod roster;
pub mod session;
pub mod share;
pub mod tile;
pub mod units;

#[cfg(test)]
mod arbitrary;

/// The generated types, clients and servers.
#[expect(
    missing_docs,
    clippy::too_many_lines,
    clippy::large_enum_variant,
    reason = "the generator's style is its own; what proto/ has a comment for is documented"
)]
pub mod v1 {
    tonic::include_proto!("equilux.v1");
}

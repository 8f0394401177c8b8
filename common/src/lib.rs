//! The vocabulary that every part of Equilux speaks: ids, rays, bundles, credit, units, the film,
//! the scene and the messages between the cores.
//!
//! A type belongs here only if both sides of a boundary use it (coordinator and worker, or protocol
//! and light). Nothing here opens a socket or reads a clock; files are touched only where scenes
//! are read and images written, and what is in them does not depend on how many threads do it.

pub mod balancing;
pub mod bundle;
pub mod costs;
pub mod credit;
pub mod film;
mod hilbert;
pub mod ids;
pub mod image;
pub mod itinerary;
pub mod job;
pub mod message;
pub mod ray;
pub mod scene;
pub mod spread;
pub mod time;
pub mod topology;
pub mod unit;
pub mod work;

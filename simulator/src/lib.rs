//! The simulator: the real cores of coordinator and workers in virtual time.
//!
//! It owns the clock, the network, the compute threads and the faults, all drawn from one seed, so
//! that a schedule that shows a bug can be replayed at will. After every step it checks what must
//! hold at any moment ([`checks`]); at the end it compares the film to the bit.

mod agenda;
pub mod checks;
pub mod counts;
pub mod film;
mod happening;
mod host;
pub mod light;
mod network;
pub mod plan;
pub mod random;
pub mod simulation;
pub mod spread;
pub mod stub;
pub mod tracer;
pub mod view;

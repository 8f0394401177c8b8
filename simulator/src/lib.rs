//! The simulator: the real cores of coordinator and workers in virtual time.
//!
//! It owns the clock, the network, the compute threads and the faults, all drawn from one seed, so
//! that a run can be replayed at will. It has two uses. *Schedules* ([`plan`]) are hostile: late
//! and lost messages, deaths, and after every step a check of what must hold at any moment
//! ([`checks`]); at the end the film is compared to the bit. *Forecasts* ([`forecast`]) are
//! faithful: paths cost what was recorded of a scene ([`costs`]), messages what their bytes and the
//! network say ([`wire`], [`network`]), for up to thousands of workers.

mod agenda;
mod alarm;
pub mod case;
mod cells;
pub mod checks;
mod coordination;
pub mod costs;
pub mod counts;
mod crew;
mod delivery;
mod faults;
pub mod film;
pub mod forecast;
mod happening;
mod host;
pub mod itineraries;
pub mod light;
mod links;
mod load_map;
mod mail;
pub mod network;
pub mod plan;
pub mod random;
mod recorded;
mod scenario;
pub mod simulation;
pub mod spread;
pub mod stub;
mod threads;
mod trace;
pub mod tracer;
pub mod view;
pub mod wire;
mod world;

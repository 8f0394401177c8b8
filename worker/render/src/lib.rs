//! Light: pure computation of radiance.
//!
//! [`renderer::Renderer`] is the door: it takes a [`model::Model`] and a job, then turns work into
//! outcomes, bundle by bundle. [`mod@reference`] makes the same image in a plain loop and is the
//! definition of it.
//! Nothing here starts a thread, opens a file, reads a clock or knows of other machines; apart from
//! the tracing itself, everything is a function of its arguments.

pub mod bsdf;
pub mod camera;
#[cfg(test)]
mod chi_square;
#[cfg(test)]
mod closed_forms;
pub mod frame;
pub mod geometry;
pub mod home;
pub mod itinerary;
pub mod light;
pub mod model;
pub mod observer;
pub mod reference;
pub mod renderer;
pub mod sampler;
#[cfg(test)]
mod scene_builder;
pub mod scratch;
mod stage;
pub mod texture;
mod trace;
mod visits;
pub mod warp;

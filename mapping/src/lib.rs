//! Which worker is home to which part of the model.
//!
//! Objects (partitions, or other clusters of triangles) have bytes, a place in the model, and ties
//! to others: rays that pass between them. Workers have capacities. A mapping gives every object a
//! home, such that ties are within workers as far as possible and no worker has more than its share
//! and [`TOLERANCE_PERCENT`]. Heirich & Arvo (1996), section 5.1, name two ways, and both are here:
//!
//! - [`bisect`], the static one, which looks at nothing but sizes and the order of numbers;
//! - [`diffuse`], which moves objects and the boundaries of regions bit by bit, each looking only
//!   at its neighbors, and goes on from a present mapping when something has changed.
//!
//! The same input has the same mapping on every machine: all that is compared is in integers, or in
//! additions, multiplications, divisions of `f64`, in an order that is fixed. `docs/mapping.md` has
//! figures.

mod bisection;
mod clusters;
mod diffusion;
mod exchange;
mod guest;
mod host;
mod mapping;
mod regions;
mod settling;
mod space;
mod sweep;

#[cfg(test)]
mod properties;

pub use bisection::bisect;
pub use diffusion::{Diffusion, STEPS_MAX, diffuse};
pub use guest::{GUEST_BYTES_MAX, GUEST_OBJECTS_MAX, Guest, InvalidGuest, Object, Tie};
pub use host::{HOST_BYTES_MAX, Host, InvalidHost, Seat, TOLERANCE_PERCENT};
pub use mapping::{Figures, Mapping};

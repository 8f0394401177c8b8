//! The model as rays see it: triangles under a tree of boxes, closest hits, visibility, and what is
//! known of the surface at a hit.
//!
//! Three ideas keep hits exact, whatever the tree:
//!
//! 1. One triangle test ([`triangle`]), watertight on shared edges and vertices.
//! 2. A hit counts only within the interval that the ray spends in the triangle's own box, and its
//!    distance is clamped into it. The interval comes from a chain of monotone operations
//!    ([`slab`]), so the interval of any box around the triangle contains that of the triangle.
//!    A walk through boxes, in any order and of any tree, hence never culls a hit that counts.
//! 3. The closest hit is the least (distance, primitive id), so ties do not depend on the order
//!    either.
//!
//! Uncertainty is the ray's, not the boxes': boxes are the exact bounds of what they hold, and the
//! slab test makes the ray as thick as the triangle test can err.
//!
//! So whatever culls may be as fast and as rough as it likes, as long as it never culls too much:
//! eight boxes are tested at a time by the instructions that the machine has ([`lanes`],
//! [`thick_ray`]), one ray after another or many together ([`company`]). Only what decides is the
//! same on all machines, to the bit.

pub mod surface_point;

mod block;
mod bounds;
mod company;
mod hierarchy;
mod lanes;
mod partition;
mod partition_set;
mod placed;
mod ready;
mod routes;
mod slab;
mod table;
mod thick_ray;
mod tree;
mod triangle;

pub use self::bounds::Bounds;
pub use self::company::Traversal;
pub use self::hierarchy::{InvalidTree, Stack};
pub use self::lanes::{Instructions, UnknownInstructions};
pub use self::partition::{
    InvalidPartition, ModelLimits, Partition, PartitionBuilder, PartitionImage, PartitionPress,
    SECTION_COUNT, Slot,
};
pub use self::partition_set::PartitionSet;
pub use self::routes::{PARTITION_BOXES_MAX, Routes};
pub(crate) use self::triangle::Probe;

/// Largest magnitude of a coordinate in a model: with it, no product in the triangle test leaves
/// the range of single precision.
pub const COORDINATE_MAX: f32 = 1e11;

/// Most triangles that are kept of a model: the numbers of the tree's nodes take 32 bits.
pub const TRIANGLES_MAX: usize = 1 << 30;

#[cfg(test)]
pub(crate) mod tests;

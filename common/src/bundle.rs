//! Bundles: the grain of scheduling, tracing and messages.

use crate::credit::Credit;
use crate::ids::{Attempt, PartitionId, UnitId};
use crate::ray::Ray;

/// Most rays in one bundle. The paper used 16 or 32 (section 3).
pub const BUNDLE_RAYS_MAX: usize = 64;

/// What is to be done to a bundle next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Find the closest hit in the bundle's partition.
    Intersect,
    /// Add emission, spawn shadow, indirect and specular rays at the hits.
    Shade,
    /// Find out whether anything in the bundle's partition lies before the light.
    Shadow,
}

/// A unit's identity together with a share of its wholeness.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Share {
    /// The unit.
    pub unit: UnitId,
    /// The try at it.
    pub attempt: Attempt,
    /// How much of the unit's wholeness travels here; never zero in a message.
    pub credit: Credit,
}

/// Up to [`BUNDLE_RAYS_MAX`] rays that await the same stage at the same place.
#[derive(Clone, Debug, PartialEq)]
pub struct Bundle {
    /// What is to be done next.
    pub stage: Stage,
    /// Where: the part of the model that the rays must visit.
    pub partition: PartitionId,
    /// The units that the rays belong to, each with its share of credit; at most 255.
    pub shares: Vec<Share>,
    /// The rays; each names its share by index.
    pub rays: Vec<Ray>,
}

//! Work, as the protocol hands it to light and as light hands it back.

use crate::bundle::{Bundle, Share};
use crate::film::TileSums;

/// Camera samples of one unit that have not been started: the cheapest work to move.
///
/// Paths of a unit are numbered pixel by pixel (in the tile's order, see
/// [`crate::unit::Unit::path`]), all samples of a pixel after one another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Samples {
    /// The unit and the share of its credit that these samples hold.
    pub share: Share,
    /// Number of the first path.
    pub first_path: u32,
    /// How many paths; at least 1.
    pub path_count: u32,
}

/// Something to trace.
#[derive(Clone, Debug, PartialEq)]
pub enum Work {
    /// Camera samples to start.
    Samples(Samples),
    /// Rays in the middle of their paths.
    Rays(Bundle),
}

/// What tracing one piece of [`Work`] came to.
///
/// Credit is conserved: the shares that came in equal those of `retired` plus those of
/// `successors`.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// For each unit touched: the credit that stays here and the film values it vouches for.
    pub retired: Vec<(Share, TileSums)>,
    /// Rays that must go on elsewhere, or that were given up when an interrupt was asked for.
    pub successors: Vec<Bundle>,
    /// What was done, for the ledger and the stats.
    pub counts: RayCounts,
}

/// Rays by kind; the ledger requires that what came in and was spawned equals what retired and
/// what goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Camera rays spawned: paths begun.
    pub camera: u64,
    /// Indirect rays spawned.
    pub indirect: u64,
    /// Specular rays spawned.
    pub specular: u64,
    /// Shadow rays spawned.
    pub shadow: u64,
    /// Rays of any kind that ceased.
    pub retired: u64,
}

impl RayCounts {
    /// Rays of every kind spawned.
    #[must_use]
    pub const fn spawned(&self) -> u64 {
        self.camera + self.indirect + self.specular + self.shadow
    }

    /// Adds `other` to `self`.
    pub const fn add(&mut self, other: &Self) {
        self.camera += other.camera;
        self.indirect += other.indirect;
        self.specular += other.specular;
        self.shadow += other.shadow;
        self.retired += other.retired;
    }
}

impl Work {
    /// The shares of credit that this work carries.
    #[must_use]
    pub fn shares(&self) -> &[Share] {
        match self {
            Self::Samples(samples) => std::slice::from_ref(&samples.share),
            Self::Rays(bundle) => &bundle.shares,
        }
    }
}

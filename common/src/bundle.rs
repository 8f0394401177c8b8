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

impl Bundle {
    /// Depth of the deepest ray, by which bundles are put in order.
    #[must_use]
    pub fn depth(&self) -> u16 {
        self.rays.iter().map(|ray| ray.depth).max().unwrap_or(0)
    }

    /// Drops the shares that `keep` refuses, and their rays; says how many rays went.
    pub fn retain_shares(&mut self, keep: impl Fn(&Share) -> bool) -> usize {
        let kept: Vec<bool> = self.shares.iter().map(keep).collect();
        let moved: Vec<u8> = kept
            .iter()
            .scan(0, |next, &is_kept| Some(std::mem::replace(next, *next + u8::from(is_kept))))
            .collect();
        let before = self.rays.len();
        self.rays.retain(|ray| kept.get(usize::from(ray.share)) == Some(&true));
        for ray in &mut self.rays {
            ray.share = moved[usize::from(ray.share)];
        }
        let mut index = 0;
        self.shares.retain(|_| {
            index += 1;
            kept[index - 1]
        });
        before - self.rays.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    #[test]
    fn a_dropped_share_takes_its_rays_along_and_no_others() {
        let share =
            |unit| Share { unit: UnitId(unit), attempt: Attempt(0), credit: Credit::whole() };
        let ray = |share, pixel| Ray { share, pixel, ..Ray::zeroed() };
        let mut bundle = Bundle {
            stage: Stage::Intersect,
            partition: PartitionId(0),
            shares: vec![share(7), share(8), share(9)],
            rays: vec![ray(2, 90), ray(1, 80), ray(0, 70), ray(2, 91)],
        };
        assert_eq!(bundle.retain_shares(|share| share.unit != UnitId(8)), 1);
        assert_eq!(bundle.shares, [share(7), share(9)]);
        assert_eq!(bundle.rays, [ray(1, 90), ray(0, 70), ray(1, 91)]);
    }
}

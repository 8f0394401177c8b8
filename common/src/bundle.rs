//! Bundles: the grain of scheduling, tracing and messages.

use std::collections::BTreeMap;

use crate::credit::Credit;
use crate::ids::{Attempt, PartitionId, UnitId};
use crate::ray::Ray;

/// Most rays in one bundle. The paper used 16 or 32 (section 3).
pub const BUNDLE_RAYS_MAX: usize = 64;

/// Most shares in a bundle: a ray names its share by one byte, and one value is kept free.
pub const SHARES_MAX: usize = 255;

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

/// Rays that await the same stage at the same place: up to [`BUNDLE_RAYS_MAX`] of them where they
/// wait and travel. What is handed to a thread as one piece may have been joined from several.
#[derive(Clone, Debug, PartialEq)]
pub struct Bundle {
    /// What is to be done next.
    pub stage: Stage,
    /// Where: the part of the model that the rays must visit.
    pub partition: PartitionId,
    /// The units that the rays belong to, each with its share of credit; at most [`SHARES_MAX`].
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

    /// Bytes that the bundle takes in a message (`docs/wire.md` has the layout).
    #[must_use]
    pub fn wire_bytes(&self) -> u64 {
        let share = |share: &Share| 12 + 8 * share.credit.words().len();
        let shares = self.shares.iter().map(share).sum::<usize>();
        (8 + shares + size_of::<Ray>() * self.rays.len()) as u64
    }

    /// Takes the last `ray_count` rays away into a bundle of their own. The credit of a share whose
    /// rays part is split.
    ///
    /// # Panics
    /// If there are not more rays than that.
    #[must_use]
    pub fn split_off(&mut self, ray_count: usize) -> Self {
        let kept_count =
            self.rays.len().checked_sub(ray_count).filter(|&kept| kept > 0).expect("more rays");
        let mut parted =
            Self { shares: Vec::new(), rays: self.rays.split_off(kept_count), ..*self };
        for (index, share) in self.shares.iter_mut().enumerate() {
            let is_of_share = |ray: &Ray| usize::from(ray.share) == index;
            if !parted.rays.iter().any(is_of_share) {
                parted.shares.push(Share { credit: Credit::zero(), ..share.clone() });
                continue;
            }
            let credit = if !self.rays.iter().any(is_of_share) {
                std::mem::take(&mut share.credit)
            } else {
                share.credit.split(2)
            };
            parted.shares.push(Share { credit, ..share.clone() });
        }
        parted.retain_shares(|share| !share.credit.is_zero());
        self.retain_shares(|share| !share.credit.is_zero());
        parted
    }

    /// Takes in the rays of another bundle for the same stage and partition. Where both have a
    /// share of the same attempt at a unit, there will be one.
    ///
    /// # Panics
    /// If there would be more shares than rays can name, or more credit than there is.
    pub fn join(&mut self, other: Self) {
        let known: BTreeMap<(UnitId, Attempt), usize> =
            self.shares.iter().map(name).zip(0..).collect();
        let mut places = Vec::with_capacity(other.shares.len());
        for share in other.shares {
            let place = known.get(&name(&share)).copied();
            if let Some(place) = place {
                self.shares[place].credit.merge(&share.credit).expect("parts of the whole");
            } else {
                self.shares.push(share);
            }
            let place = place.unwrap_or(self.shares.len() - 1);
            places.push(u8::try_from(place).expect("as many shares as rays can name"));
        }
        let renamed = other.rays.into_iter();
        let renamed = renamed.map(|ray| Ray { share: places[usize::from(ray.share)], ..ray });
        self.rays.extend(renamed);
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

fn name(share: &Share) -> (UnitId, Attempt) {
    (share.unit, share.attempt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn splitting_keeps_every_ray_with_its_unit_and_all_credit(
            owners in prop::collection::vec(0u8..4, 2..64), cut in any::<prop::sample::Index>(),
        ) {
            let shares = (0..4).map(|unit| Share {
                unit: UnitId(unit), attempt: Attempt(0), credit: Credit::whole(),
            });
            let rays = (0..).zip(&owners).map(|(pixel, &share)| Ray { share, pixel, ..Ray::zeroed() });
            let mut kept = Bundle {
                stage: Stage::Intersect,
                partition: PartitionId(0),
                shares: shares.collect(),
                rays: rays.collect(),
            };
            let parted = kept.split_off(1 + cut.index(owners.len() - 1));
            let mut credit = vec![Credit::zero(); 4];
            for bundle in [&kept, &parted] {
                prop_assert!(!bundle.rays.is_empty());
                for share in &bundle.shares {
                    prop_assert!(!share.credit.is_zero());
                    credit[share.unit.0 as usize].merge(&share.credit).expect("at most the whole");
                }
                for ray in &bundle.rays {
                    let unit = bundle.shares[usize::from(ray.share)].unit;
                    prop_assert_eq!(unit, UnitId(u32::from(owners[ray.pixel as usize])));
                }
            }
            prop_assert!(credit.iter().all(Credit::is_whole));
            prop_assert_eq!(kept.rays.len() + parted.rays.len(), owners.len());
        }
    }

    #[test]
    fn joined_bundles_have_one_share_for_each_unit() {
        let mut credit = Credit::whole();
        let part = credit.split(2);
        let share = |unit, credit| Share { unit: UnitId(unit), attempt: Attempt(0), credit };
        let bundle =
            |shares, rays| Bundle { stage: Stage::Shadow, partition: PartitionId(3), shares, rays };
        let ray = |share, pixel| Ray { share, pixel, ..Ray::zeroed() };
        let mut joined =
            bundle(vec![share(7, Credit::whole()), share(8, credit)], vec![ray(1, 80), ray(0, 70)]);
        joined.join(bundle(
            vec![share(9, Credit::whole()), share(8, part)],
            vec![ray(1, 81), ray(0, 90), ray(1, 82)],
        ));
        assert_eq!(joined.shares, [7, 8, 9].map(|unit| share(unit, Credit::whole())));
        let rays = [ray(1, 80), ray(0, 70), ray(1, 81), ray(2, 90), ray(1, 82)];
        assert_eq!(joined.rays, rays);
    }

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

//! The diffusive mapping: objects diffuse until related ones are together and loads are even.
//!
//! From nothing, it starts with the runs of bisection and lets objects and regions move in the
//! space of the model. Then come cycles, until one brings little: objects are joined in clusters,
//! larger and larger, and regions exchange with their neighbors first the largest, then ever
//! smaller ones, the objects last. From a present mapping, it starts with the cycles, and every
//! object is tied to the home that it has.

use std::num::NonZeroU64;

use crate::bisection::runs;
use crate::clusters::{Clusters, Homes, scattered};
use crate::guest::Guest;
use crate::host::Host;
use crate::mapping::Mapping;
use crate::regions::Regions;
use crate::settling::settle;
use crate::space::{ITERATIONS, diffuse_space};
use crate::sweep::sweep;

/// The largest cluster is one part of so many of its region's share.
const COARSEST: u64 = 12;

/// A cycle that lowers the cut by less than one part of so many is the last, and does not count.
const WORTHWHILE: i64 = 100;

/// Objects move from where they are only if the cut could be lower by one part of so many, or loads
/// are not even. It is more than [`WORTHWHILE`]: what diffusion has made stays as it is.
const MOVING: i64 = 20;

/// Affinity of an object to its present home: one part of so many of what an object of its size has
/// in ties, on average.
const ANCHOR: u128 = 4;

/// What came of diffusion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diffusion {
    /// Where objects are at home in the end.
    pub mapping: Mapping,
    /// Iterations, in each of which every region and object looks at its neighbors once.
    pub steps: u32,
}

/// Maps objects to workers, from scratch or from where they are.
///
/// # Panics
/// If `present` is not a mapping of these objects.
#[must_use]
pub fn diffuse(guest: &Guest, host: &Host, present: Option<&Mapping>) -> Diffusion {
    let shares = host.shares(guest.bytes());
    let objects = Clusters::of(guest, shares.len());
    let mut course = Course { objects, shares, steps: 0 };
    let homes = match present {
        None => course.begin(guest, host),
        Some(present) => course.resume(guest, host, present),
    };
    let mapping = Mapping::from_positions(host, homes.of_first(guest.objects().len()));
    Diffusion { mapping, steps: course.steps }
}

/// A diffusion under way.
struct Course {
    objects: Clusters,
    /// What each region should have, in bytes.
    shares: Vec<u64>,
    steps: u32,
}

/// What a mapping is judged by: bytes beyond limits, then the cut.
type Worth = (u64, i64);

impl Course {
    /// From the runs of bisection.
    fn begin(&mut self, guest: &Guest, host: &Host) -> Homes {
        let homes = Homes::new(runs(guest, host), self.shares.len());
        let homes = diffuse_space(guest, &self.objects, &self.shares, homes);
        self.steps += ITERATIONS;
        let objects = self.objects.clone();
        let homes = self.cycle(&objects, homes);
        self.cycles(&objects, homes)
    }

    /// Stays with the present homes if they are as even as they can be, and a cycle without any
    /// regard for them brings little. Objects whose home is gone begin where bisection has them.
    fn resume(&mut self, guest: &Guest, host: &Host, present: &Mapping) -> Homes {
        let present = present.positions(host).into_iter().zip(runs(guest, host));
        let homes: Vec<_> = present.map(|(home, run)| home.unwrap_or(run)).collect();
        let homes = Homes::new(homes, self.shares.len());
        let objects = self.objects.clone();
        let next = self.cycle(&objects, homes.clone());
        let [before, after] = [&homes, &next].map(|homes| self.worth(&objects, homes));
        if !is_better(MOVING, before, after) {
            return homes;
        }
        let pinned = self.pinned(guest, &homes);
        let homes = self.cycle(&pinned, homes);
        self.cycles(&pinned, homes)
    }

    /// The objects, tied to their present homes.
    fn pinned(&self, guest: &Guest, homes: &Homes) -> Clusters {
        let affinity = u128::try_from(self.objects.affinity()).expect("not negative");
        let mean = |bytes: u64| 2 * affinity * u128::from(bytes) / u128::from(guest.bytes());
        let homes = homes.of_first(guest.objects().len());
        let anchors = guest.objects().iter().zip(homes).map(|(object, &home)| {
            let anchor = i64::try_from(mean(object.bytes) / ANCHOR);
            (home, anchor.expect("no more than all affinity"))
        });
        self.objects.pinned(anchors)
    }

    /// Cycles as long as they bring something.
    fn cycles(&mut self, objects: &Clusters, mut homes: Homes) -> Homes {
        loop {
            let next = self.cycle(objects, homes.clone());
            let [before, after] = [&homes, &next].map(|homes| self.worth(objects, homes));
            if !is_better(WORTHWHILE, before, after) {
                return homes;
            }
            homes = next;
        }
    }

    fn worth(&self, objects: &Clusters, homes: &Homes) -> Worth {
        let regions = Regions::new(objects, homes.clone(), &self.shares, None);
        (regions.total_excess(), objects.cut(homes))
    }

    /// Joins clusters within regions, down to few for each region, and exchanges them between
    /// regions, from the coarsest to the finest.
    fn cycle(&mut self, clusters: &Clusters, homes: Homes) -> Homes {
        let seed = scattered(clusters.cut(&homes).unsigned_abs());
        let bytes_max: Vec<_> = self.shares.iter().map(|share| share / COARSEST).collect();
        let (coarse, parents) = clusters.joined(&homes, &bytes_max, seed);
        if coarse.count() * 20 > clusters.count() * 19 {
            return self.exchanged(clusters, homes);
        }
        let mut joined = vec![0; coarse.count()];
        for (cluster, &parent) in parents.iter().enumerate() {
            joined[parent as usize] = homes.of(cluster);
        }
        let joined = self.cycle(&coarse, Homes::new(joined, self.shares.len()));
        let homes = parents.iter().map(|&parent| joined.of(parent as usize)).collect();
        self.exchanged(clusters, Homes::new(homes, self.shares.len()))
    }

    /// Sweeps over these clusters. The finest ones must be within the tolerance then, coarser ones,
    /// which may be larger than it, within the size of the largest.
    fn exchanged(&mut self, clusters: &Clusters, homes: Homes) -> Homes {
        let is_finest = clusters.count() == self.objects.count();
        let slack = if is_finest { None } else { NonZeroU64::new(COARSEST) };
        let mut regions = Regions::new(clusters, homes, &self.shares, slack);
        self.steps += sweep(&mut regions);
        if is_finest && regions.total_excess() > 0 {
            settle(&mut regions);
            self.steps += sweep(&mut regions);
        }
        regions.homes
    }
}

/// Whether the second is better, by one part of `part` of the cut at least, or by a tenth of the
/// bytes beyond limits.
fn is_better(part: i64, before: Worth, after: Worth) -> bool {
    let is_evener = before.0 - after.0.min(before.0) > before.0 / 10;
    is_evener || (after.0 <= before.0 && before.1 - after.1 > before.1 / part)
}

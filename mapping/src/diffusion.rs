//! The diffusive mapping: objects diffuse until related ones are together and loads are even.
//!
//! From nothing, it starts with the runs of bisection and lets objects and regions move in the
//! space of the model. Then come cycles: objects are joined in clusters, larger and larger, and
//! regions exchange with their neighbors first the largest, then ever smaller ones, the objects
//! last. From a present mapping, it starts with the cycles, and every object is tied to the home
//! that it has.
//!
//! All of it is a schedule that knows nothing of how many regions there are: [`STEPS_MAX`]. Many
//! short cycles make smaller cuts than few in which regions exchange until nothing changes: what
//! must go far goes as large clusters, and those are only there at the beginning of a cycle.

use std::num::NonZeroU64;

use crate::bisection::runs;
use crate::clusters::{Clusters, Homes, scattered};
use crate::guest::Guest;
use crate::host::Host;
use crate::mapping::Mapping;
use crate::regions::Regions;
use crate::settling::{SETTLING_STEPS_MAX, settle};
use crate::space::{ITERATIONS, diffuse_space};
use crate::sweep::sweep;

/// The largest cluster is one part of so many of its region's share.
const COARSEST: u64 = 12;

/// How often clusters are joined in pairs, at most. Eight are enough for a few thousand objects a
/// worker; where it has more, the largest clusters are smaller parts of its share.
const JOINS_MAX: u32 = 8;

/// Cycles from nothing. With five, cuts are 1% larger; with ten, they are the same.
const CYCLES: u32 = 7;

/// Cycles from a present mapping. With seven, up to a third more moves, for cuts 1%
/// smaller.
const RESUMING_CYCLES: u32 = 4;

/// Sweeps over the largest clusters, and over those of each smaller size.
const COARSE_SWEEPS: u32 = 1;

/// Sweeps over the objects in a cycle. The second brings loads near their limits, after clusters
/// that were larger than the tolerance.
const FINE_SWEEPS: u32 = 2;

/// Sweeps over the objects after the last cycle, for the loads; hardly anything is left to settle.
const LAST_SWEEPS: u32 = 3;

/// Steps of a cycle.
const CYCLE_STEPS_MAX: u32 = JOINS_MAX * COARSE_SWEEPS + FINE_SWEEPS;

/// Steps after the last cycle: settling, and a sweep about what that has moved.
const FINISH_STEPS_MAX: u32 = LAST_SWEEPS + SETTLING_STEPS_MAX + 1;

/// Trials after the cycles from nothing: of 1,500 random graphs eight moved again in the first,
/// none in a second.
const TRIALS_MAX: u32 = 3;

/// Steps of [`diffuse`] at most, for any objects and any workers.
pub const STEPS_MAX: u32 = ITERATIONS
    + CYCLES * CYCLE_STEPS_MAX
    + FINISH_STEPS_MAX
    + TRIALS_MAX * (CYCLE_STEPS_MAX + FINISH_STEPS_MAX);

/// Objects move from where they are only if the cut could be lower by one part of so many, or loads
/// are not even. Diffusion from scratch tries it, too: so what it has made stays as it is.
const MOVING: i64 = 20;

/// Affinity of an object to its present home: one part of so many of what an object of its size has
/// in ties, on average.
const ANCHOR: u128 = 4;

/// What came of diffusion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diffusion {
    /// Where objects are at home in the end.
    pub mapping: Mapping,
    /// Iterations, in each of which every region and object looks at its neighbors once; at most
    /// [`STEPS_MAX`].
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
        let mut homes = self.cycles(&objects, homes, CYCLES);
        for _ in 0..TRIALS_MAX {
            match self.tried(&objects, &homes) {
                Some(better) => homes = better,
                None => break,
            }
        }
        homes
    }

    /// Stays with the present homes if they are as even as they can be, and a cycle without any
    /// regard for them brings little. Objects whose home is gone begin where bisection has them.
    fn resume(&mut self, guest: &Guest, host: &Host, present: &Mapping) -> Homes {
        let present = present.positions(host).into_iter().zip(runs(guest, host));
        let homes: Vec<_> = present.map(|(home, run)| home.unwrap_or(run)).collect();
        let homes = Homes::new(homes, self.shares.len());
        let objects = self.objects.clone();
        if self.tried(&objects, &homes).is_none() {
            return homes;
        }
        let pinned = self.pinned(guest, &homes);
        self.cycles(&pinned, homes, RESUMING_CYCLES)
    }

    /// What a cycle from these homes leads to, if that is worth moving for.
    fn tried(&mut self, objects: &Clusters, homes: &Homes) -> Option<Homes> {
        let next = self.cycle(objects, homes.clone(), self.joins(), CYCLES);
        let next = self.finished(objects, next);
        let [before, after] = [homes, &next].map(|homes| self.worth(objects, homes));
        is_better(before, after).then_some(next)
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

    /// So many cycles, and what brings loads within their limits.
    fn cycles(&mut self, objects: &Clusters, mut homes: Homes, cycles: u32) -> Homes {
        for turn in 0..cycles {
            homes = self.cycle(objects, homes, self.joins(), turn);
        }
        self.finished(objects, homes)
    }

    /// How often clusters are joined: until the largest are about the part of a share that they
    /// may be.
    fn joins(&self) -> u32 {
        let workers = self.shares.iter().filter(|&&share| share > 0).count() as u64;
        let sizes = self.objects.count() as u64 / (workers * COARSEST).max(1);
        sizes.max(1).ilog2().min(JOINS_MAX)
    }

    /// Brings loads within their limits, as far as objects are small enough for that.
    fn finished(&mut self, objects: &Clusters, homes: Homes) -> Homes {
        let mut regions = Regions::new(objects, homes, &self.shares, None);
        self.steps += sweep(&mut regions, LAST_SWEEPS);
        if regions.total_excess() > 0 {
            self.steps += settle(&mut regions);
            self.steps += sweep(&mut regions, 1);
        }
        regions.homes
    }

    fn worth(&self, objects: &Clusters, homes: &Homes) -> Worth {
        let regions = Regions::new(objects, homes.clone(), &self.shares, None);
        (regions.total_excess(), objects.cut(homes))
    }

    /// Joins clusters within regions so often, and exchanges them between regions, from the
    /// coarsest to the finest.
    fn cycle(&mut self, clusters: &Clusters, homes: Homes, joins: u32, turn: u32) -> Homes {
        if joins == 0 {
            return self.exchanged(clusters, homes);
        }
        // Each turn has its own, or a cycle that changes nothing would be followed by its like.
        let seed = scattered(clusters.cut(&homes).unsigned_abs() + u64::from(turn));
        let bytes_max: Vec<_> = self.shares.iter().map(|share| share / COARSEST).collect();
        let (coarse, parents) = clusters.joined(&homes, &bytes_max, seed);
        if coarse.count() == clusters.count() {
            return self.exchanged(clusters, homes);
        }
        let mut joined = vec![0; coarse.count()];
        for (cluster, &parent) in parents.iter().enumerate() {
            joined[parent as usize] = homes.of(cluster);
        }
        let joined = self.cycle(&coarse, Homes::new(joined, self.shares.len()), joins - 1, turn);
        let homes = parents.iter().map(|&parent| joined.of(parent as usize)).collect();
        self.exchanged(clusters, Homes::new(homes, self.shares.len()))
    }

    /// Sweeps over these clusters. The finest ones should be within the tolerance then, coarser
    /// ones, which may be larger than it, within the size of the largest.
    fn exchanged(&mut self, clusters: &Clusters, homes: Homes) -> Homes {
        let is_finest = clusters.count() == self.objects.count();
        let (slack, sweeps) = match is_finest {
            true => (None, FINE_SWEEPS),
            false => (NonZeroU64::new(COARSEST), COARSE_SWEEPS),
        };
        let mut regions = Regions::new(clusters, homes, &self.shares, slack);
        self.steps += sweep(&mut regions, sweeps);
        regions.homes
    }
}

/// Whether the second is worth moving for.
fn is_better(before: Worth, after: Worth) -> bool {
    let is_evener = before.0 - after.0.min(before.0) > before.0 / 10;
    is_evener || (after.0 <= before.0 && before.1 - after.1 > before.1 / MOVING)
}

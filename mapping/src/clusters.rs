//! Clusters of objects, and what ties them: the guest, finer or coarser.
//!
//! The finest clusters are the objects. Coarser ones join two that have much to do with each other
//! for their size (heavy-edge matching, Karypis & Kumar 1995), but only within a region: so a
//! mapping of the fine clusters is one of the coarse ones, too, and what is gained by moving a
//! coarse one is kept.
//!
//! Behind the clusters that can move come **pins**, one for each region: clusters without bytes
//! that stay where they are. A tie to one holds an object back at a home that it has already.

use crate::guest::Guest;

/// Sum of all affinities here, at most: gains and their sums stay far from the end of 64 bits.
const AFFINITY_MAX: u128 = 1 << 58;

/// A graph of clusters.
#[derive(Clone, Debug)]
pub(crate) struct Clusters {
    /// Of each cluster that can move.
    bytes: Vec<u64>,
    /// Where the ties of each cluster and pin begin, and where the last ones end.
    offsets: Vec<usize>,
    /// The other end of each tie, ascending, and its affinity.
    ties: Vec<(u32, i64)>,
}

/// A tie from one end, to the other, and its affinity.
type End = (u32, u32, i64);

impl Clusters {
    /// The objects of `guest`, and a pin for each of so many regions. Affinities are halved until
    /// they fit.
    pub(crate) fn of(guest: &Guest, regions: usize) -> Self {
        let total = guest.affinity();
        let scale = (0..u128::BITS).find(|&scale| total >> scale <= AFFINITY_MAX).unwrap_or(0);
        let ends = guest.ties().iter().filter(|tie| tie.objects[0] != tie.objects[1]);
        let ends = ends.flat_map(|tie| {
            let affinity = u128::from(tie.affinity) >> scale;
            let affinity = i64::try_from(affinity).expect("within the scaled total");
            let [a, b] = tie.objects.map(number);
            [(a, b, affinity), (b, a, affinity)]
        });
        let bytes: Vec<_> = guest.objects().iter().map(|object| object.bytes).collect();
        Self::new(bytes, regions, ends.collect())
    }

    /// The same, each cluster tied to the pin of a region besides, with this affinity.
    pub(crate) fn pinned(&self, anchors: impl Iterator<Item = (u32, i64)>) -> Self {
        let own = (0..self.count()).flat_map(|cluster| {
            let ties = self.ties(cluster).iter();
            ties.map(move |&(other, affinity)| (number(cluster), other, affinity))
        });
        let anchors = anchors.enumerate().flat_map(|(cluster, (region, affinity))| {
            let (cluster, pin) = (number(cluster), number(self.count()) + region);
            [(cluster, pin, affinity), (pin, cluster, affinity)]
        });
        Self::new(self.bytes.clone(), self.pins(), own.chain(anchors).collect())
    }

    /// Adds up ties between the same two, and leaves out those without affinity.
    fn new(bytes: Vec<u64>, pins: usize, mut ends: Vec<End>) -> Self {
        ends.retain(|end| end.2 > 0);
        ends.sort_unstable();
        let mut ties = Vec::with_capacity(ends.len());
        let mut offsets = vec![0; bytes.len() + pins + 1];
        for group in ends.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            ties.push((group[0].1, group.iter().map(|end| end.2).sum()));
            offsets[group[0].0 as usize + 1] += 1;
        }
        for index in 1..offsets.len() {
            offsets[index] += offsets[index - 1];
        }
        Self { bytes, offsets, ties }
    }

    /// How many can move. Their numbers come first, then those of the pins.
    pub(crate) const fn count(&self) -> usize {
        self.bytes.len()
    }

    const fn pins(&self) -> usize {
        self.offsets.len() - 1 - self.bytes.len()
    }

    /// Bytes of a cluster that can move.
    pub(crate) fn bytes(&self, cluster: usize) -> u64 {
        self.bytes[cluster]
    }

    /// Ties of a cluster or pin: the other ends, ascending, and their affinities, above zero.
    pub(crate) fn ties(&self, cluster: usize) -> &[(u32, i64)] {
        &self.ties[self.offsets[cluster]..self.offsets[cluster + 1]]
    }

    /// Affinity of all ties, those to pins included.
    pub(crate) fn affinity(&self) -> i64 {
        self.ties.iter().map(|tie| tie.1).sum::<i64>() / 2
    }

    /// Affinity of the ties between clusters with different homes.
    pub(crate) fn cut(&self, homes: &Homes) -> i64 {
        let of_one = |cluster| {
            let home = homes.of(cluster);
            let ties = self.ties(cluster).iter();
            ties.filter(|tie| homes.of(tie.0 as usize) != home).map(|tie| tie.1).sum::<i64>()
        };
        (0..self.count() + self.pins()).map(of_one).sum::<i64>() / 2
    }

    /// Joins clusters with the same home in pairs that have at most `bytes_max` of that home
    /// together. Also gives the number that each cluster, or the one that it is part of, has then.
    pub(crate) fn joined(&self, homes: &Homes, bytes_max: &[u64], seed: u64) -> (Self, Vec<u32>) {
        let partners = self.partners(homes, bytes_max, seed);
        let mut parents = vec![0; self.count() + self.pins()];
        let mut bytes = Vec::new();
        for cluster in 0..self.count() {
            let partner = partners[cluster] as usize;
            if partner < cluster {
                parents[cluster] = parents[partner];
                bytes[parents[partner] as usize] += self.bytes[cluster];
            } else {
                parents[cluster] = number(bytes.len());
                bytes.push(self.bytes[cluster]);
            }
        }
        for pin in 0..self.pins() {
            parents[self.count() + pin] = number(bytes.len() + pin);
        }
        let ends = (0..parents.len()).flat_map(|cluster| {
            let parents = &parents;
            let ties = self.ties(cluster).iter();
            ties.map(move |&(other, affinity)| {
                (parents[cluster], parents[other as usize], affinity)
            })
        });
        let coarse = Self::new(bytes, self.pins(), ends.filter(|end| end.0 != end.1).collect());
        parents.truncate(self.count());
        (coarse, parents)
    }

    /// The cluster that each is joined with; itself for one that stays alone. Clusters choose in
    /// an order that is scattered by `seed`, the partner with the most affinity for its bytes.
    fn partners(&self, homes: &Homes, bytes_max: &[u64], seed: u64) -> Vec<u32> {
        let mut order: Vec<_> = (0..number(self.count())).collect();
        order.sort_by_key(|&cluster| (scattered(seed ^ u64::from(cluster)), cluster));
        let mut partners: Vec<_> = (0..number(self.count())).collect();
        for &cluster in &order {
            if partners[cluster as usize] != cluster {
                continue;
            }
            let home = homes.of(cluster as usize);
            let room = bytes_max[home as usize].saturating_sub(self.bytes(cluster as usize));
            let ties = self.ties(cluster as usize).iter();
            let fits = |&&(other, _): &&(u32, i64)| {
                (other as usize) < self.count()
                    && partners[other as usize] == other
                    && homes.of(other as usize) == home
                    && self.bytes(other as usize) <= room
            };
            let density = |&(other, affinity): &(u32, i64)| {
                (affinity as f64 / self.bytes(other as usize) as f64, other)
            };
            let rated = ties.filter(fits).map(density);
            let best = rated.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            if let Some((_, other)) = best {
                partners[cluster as usize] = other;
                partners[other as usize] = cluster;
            }
        }
        partners
    }
}

/// The region that each cluster belongs to; a pin belongs to that of its number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Homes(Vec<u32>);

impl Homes {
    /// With these clusters in these regions, and pins of so many regions.
    pub(crate) fn new(mut homes: Vec<u32>, regions: usize) -> Self {
        homes.extend(0..number(regions));
        Self(homes)
    }

    /// The home of a cluster or pin.
    pub(crate) fn of(&self, cluster: usize) -> u32 {
        self.0[cluster]
    }

    pub(crate) fn set(&mut self, cluster: usize, home: u32) {
        self.0[cluster] = home;
    }

    /// Those of the clusters that can move, the first so many.
    pub(crate) fn of_first(&self, count: usize) -> &[u32] {
        &self.0[..count]
    }
}

/// A number of a cluster or region; there are fewer than 2³².
pub(crate) fn number(index: usize) -> u32 {
    u32::try_from(index).expect("a guest and a host have fewer than 2³² members together")
}

/// A permutation of 64-bit numbers that leaves no order in them: the finalizer of SplitMix64
/// (Steele, Lea & Flood 2014).
pub(crate) const fn scattered(number: u64) -> u64 {
    let number = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let number = (number ^ (number >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    number ^ (number >> 31)
}

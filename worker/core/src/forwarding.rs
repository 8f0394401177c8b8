//! Forwarding: rays on their way to the homes of the partitions that they have to visit next.
//!
//! Rays for the same home fill up a parcel, whose bundles are joined where they are for the same
//! partition. A parcel goes out when it is full, when a thread here would otherwise wait, or when
//! its first rays have waited long enough.
//!
//! How much may be on its way to a home is bounded by a window, whose size both sides know: the
//! homes' memory is shared among all who may send. A home acknowledges as long as few rays wait
//! there *to be traced there*; rays that are on their way to others do not count, so that two who
//! wait for each other cannot stop one another.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use equilux_common::bundle::{BUNDLE_RAYS_MAX, Bundle, SHARES_MAX, Share, Stage};
use equilux_common::ids::{PartitionId, WorkerId};
use equilux_common::time::Time;

/// Most messages with rays that a home has not acknowledged.
pub(crate) const WINDOW_FORWARDS: usize = 64;

/// A parcel of so many rays is full: tracing them takes some hundred times as long as their message
/// takes a processor.
const PARCEL_RAYS: u64 = 1024;

/// Most bytes of one message, but for a single bundle that is larger: no frame may be too large.
const MESSAGE_BYTES_MAX: u64 = 192 << 10;

/// So long rays wait for a parcel to fill: short against what their paths take, and long against
/// what it takes a busy worker to fill one.
const PARCEL_DELAY: Duration = Duration::from_millis(5);

/// So long rays wait for a link to a home: the coordinator should have found out by then if that is
/// lost.
const UNREACHABLE: Duration = Duration::from_secs(30);

/// One part in so many of a window is acknowledged at once, so that it stays open while the receipt
/// travels.
const RECEIPT_PART: u64 = 4;

/// So long a receipt is put off for more messages to come.
const RECEIPT_DELAY: Duration = Duration::from_millis(20);

/// Rays that leave, those on their way, and those that have come.
#[derive(Debug, Default)]
pub(crate) struct Forwarding {
    parcels: BTreeMap<WorkerId, Parcel>,
    ray_count: u64,
    /// Rays in each message that is not acknowledged, the oldest first.
    under_way: BTreeMap<WorkerId, VecDeque<u64>>,
    arrived: BTreeMap<WorkerId, Arrived>,
}

/// Rays for one home.
#[derive(Debug)]
struct Parcel {
    /// Being filled.
    open: BTreeMap<(PartitionId, Stage), Bundle>,
    full: Vec<Bundle>,
    ray_count: u64,
    /// By partition.
    waiting: BTreeMap<PartitionId, u64>,
    /// When the first of them came.
    since: Time,
}

/// Messages of one sender, and the rays in them.
#[derive(Debug)]
struct Arrived {
    count: u32,
    rays: u64,
    since: Time,
}

/// Messages for homes.
pub(crate) type Parcels = Vec<(WorkerId, Vec<Bundle>)>;

impl Forwarding {
    /// Rays that wait here for their way.
    pub(crate) const fn ray_count(&self) -> u64 {
        self.ray_count
    }

    /// Rays have to go to a home.
    pub(crate) fn push(&mut self, now: Time, home: WorkerId, bundle: Bundle) {
        let rays = bundle.rays.len() as u64;
        self.ray_count += rays;
        let parcel = self.parcels.entry(home).or_insert_with(|| Parcel::new(now));
        parcel.push(bundle);
    }

    /// What goes out now to those who can be reached, within the windows of rays that `window`
    /// gives. With idle threads here, that is all.
    pub(crate) fn take(
        &mut self,
        now: Time,
        is_idle: bool,
        window: impl Fn(WorkerId) -> Option<u64>,
    ) -> Parcels {
        let mut taken = Parcels::new();
        for (&home, parcel) in &mut self.parcels {
            let Some(window) = window(home) else { continue };
            let under_way = self.under_way.entry(home).or_default();
            while parcel.is_due(now, is_idle) && is_open(under_way, window) {
                let bundles = parcel.take(now, window);
                let rays = bundles.iter().map(|bundle| bundle.rays.len() as u64).sum();
                under_way.push_back(rays);
                self.ray_count -= rays;
                taken.push((home, bundles));
            }
        }
        self.parcels.retain(|_, parcel| parcel.ray_count > 0);
        taken
    }

    /// A home has taken so many messages.
    pub(crate) fn acknowledge(&mut self, home: WorkerId, count: u32) {
        if let Some(under_way) = self.under_way.get_mut(&home) {
            under_way.drain(..under_way.len().min(count as usize));
        }
    }

    /// A message with so many rays has come.
    pub(crate) fn receive(&mut self, now: Time, peer: WorkerId, rays: u64) {
        let none = Arrived { count: 0, rays: 0, since: now };
        let arrived = self.arrived.entry(peer).or_insert(none);
        arrived.count += 1;
        arrived.rays += rays;
    }

    /// How many messages to acknowledge to whom now, if there is room for more in `window`, which
    /// is that of each sender.
    pub(crate) fn receipts(&mut self, now: Time, window: Option<u64>) -> Vec<(WorkerId, u32)> {
        let Some(window) = window else { return Vec::new() };
        let is_due = |arrived: &Arrived| {
            arrived.rays * RECEIPT_PART >= window
                || arrived.count as usize >= WINDOW_FORWARDS / RECEIPT_PART as usize
                || now >= arrived.since + RECEIPT_DELAY
        };
        let due = self.arrived.iter().filter(|(_, arrived)| is_due(arrived));
        let due = due.map(|(&peer, arrived)| (peer, arrived.count)).collect();
        self.arrived.retain(|_, arrived| !is_due(arrived));
        due
    }

    /// A peer is gone; says whether rays were on their way to it.
    pub(crate) fn forget(&mut self, peer: WorkerId) -> bool {
        self.arrived.remove(&peer);
        self.under_way.remove(&peer).is_some_and(|under_way| !under_way.is_empty())
    }

    /// When something is due without an event: of what goes out, by the `window` of each that can
    /// be reached, and of receipts, if there is room for more in the `own` window. A home that
    /// cannot be reached is given up in the end.
    pub(crate) fn deadline(
        &self,
        own: Option<u64>,
        window: impl Fn(WorkerId) -> Option<u64>,
    ) -> Option<Time> {
        let due = |(&home, parcel): (&WorkerId, &Parcel)| {
            let Some(window) = window(home) else { return Some(parcel.since + UNREACHABLE) };
            let under_way = self.under_way.get(&home);
            let can_go = under_way.is_none_or(|under_way| is_open(under_way, window));
            can_go.then_some(parcel.since + PARCEL_DELAY)
        };
        let parcels = self.parcels.iter().filter_map(due);
        let receipts = self.arrived.values().filter(|_| own.is_some());
        parcels.chain(receipts.map(|arrived| arrived.since + RECEIPT_DELAY)).min()
    }

    /// A home to which rays have waited for too long, because there is no link.
    pub(crate) fn unreachable(
        &self,
        now: Time,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> Option<WorkerId> {
        let is_overdue = |parcel: &Parcel| now >= parcel.since + UNREACHABLE;
        let overdue = self.parcels.iter().filter(|(_, parcel)| is_overdue(parcel));
        let mut homes = overdue.map(|(&home, _)| home);
        homes.find(|&home| !is_linked(home))
    }

    /// Whether nothing is on its way.
    pub(crate) fn is_quiet(&self) -> bool {
        self.ray_count == 0 && self.under_way.values().all(VecDeque::is_empty)
    }

    /// Drops what `keep` refuses; says how many rays went.
    pub(crate) fn retain(&mut self, keep: impl Fn(&Share) -> bool) -> u64 {
        let before = self.ray_count;
        for parcel in self.parcels.values_mut() {
            parcel.retain(&keep);
        }
        self.parcels.retain(|_, parcel| parcel.ray_count > 0);
        self.ray_count = self.parcels.values().map(|parcel| parcel.ray_count).sum();
        before - self.ray_count
    }

    /// Rays that cannot go now, by partition: so many are on their way to their home that its
    /// window is closed.
    pub(crate) fn stuck(
        &self,
        window: impl Fn(WorkerId) -> Option<u64>,
    ) -> BTreeMap<PartitionId, u64> {
        let is_stuck = |home: &WorkerId| {
            let under_way = self.under_way.get(home);
            under_way.zip(window(*home)).is_some_and(|(rays, window)| !is_open(rays, window))
        };
        let stuck = self.parcels.iter().filter(|(home, _)| is_stuck(home));
        let mut counts = BTreeMap::new();
        for (&partition, &rays) in stuck.flat_map(|(_, parcel)| &parcel.waiting) {
            *counts.entry(partition).or_default() += rays;
        }
        counts
    }

    /// Takes out all rays of a partition that have not gone.
    pub(crate) fn take_rays_of(&mut self, partition: PartitionId) -> Vec<Bundle> {
        let parcels = self.parcels.values_mut();
        let taken: Vec<Bundle> =
            parcels.flat_map(|parcel| parcel.take_rays_of(partition)).collect();
        self.parcels.retain(|_, parcel| parcel.ray_count > 0);
        self.ray_count -= taken.iter().map(|bundle| bundle.rays.len() as u64).sum::<u64>();
        taken
    }

    /// Takes out all rays that have not gone: their homes are others now.
    pub(crate) fn take_back(&mut self) -> Vec<Bundle> {
        self.ray_count = 0;
        let parcels = std::mem::take(&mut self.parcels).into_values();
        parcels
            .flat_map(|parcel| parcel.full.into_iter().chain(parcel.open.into_values()))
            .collect()
    }
}

impl Parcel {
    const fn new(now: Time) -> Self {
        Self {
            open: BTreeMap::new(),
            full: Vec::new(),
            ray_count: 0,
            waiting: BTreeMap::new(),
            since: now,
        }
    }

    fn push(&mut self, bundle: Bundle) {
        let rays = bundle.rays.len() as u64;
        self.ray_count += rays;
        *self.waiting.entry(bundle.partition).or_default() += rays;
        let place = (bundle.partition, bundle.stage);
        let Some(open) = self.open.get_mut(&place) else {
            self.open.insert(place, bundle);
            return;
        };
        let fits = open.rays.len() + bundle.rays.len() <= BUNDLE_RAYS_MAX
            && open.shares.len() + bundle.shares.len() <= SHARES_MAX;
        if fits {
            open.join(bundle);
            return;
        }
        // The fuller one is done.
        let is_fuller = bundle.rays.len() > open.rays.len();
        let full = if is_fuller { bundle } else { std::mem::replace(open, bundle) };
        self.full.push(full);
    }

    fn is_due(&self, now: Time, is_idle: bool) -> bool {
        let is_old = now >= self.since + PARCEL_DELAY;
        self.ray_count >= PARCEL_RAYS || self.ray_count > 0 && (is_idle || is_old)
    }

    /// As much as goes into one message, and through a window.
    fn take(&mut self, now: Time, window: u64) -> Vec<Bundle> {
        let (mut taken, mut rays, mut bytes) = (Vec::new(), 0, 0);
        while let Some(bundle) = self.next() {
            let size = bundle.wire_bytes();
            if !taken.is_empty() && bytes + size > MESSAGE_BYTES_MAX {
                self.full.push(bundle);
                break;
            }
            rays += bundle.rays.len() as u64;
            bytes += size;
            self.leave(&bundle);
            taken.push(bundle);
            if rays >= PARCEL_RAYS.min(window / RECEIPT_PART) {
                break;
            }
        }
        self.since = now;
        taken
    }

    /// Rays are taken out.
    fn leave(&mut self, bundle: &Bundle) {
        let rays = bundle.rays.len() as u64;
        self.ray_count -= rays;
        let Some(waiting) = self.waiting.get_mut(&bundle.partition) else { return };
        *waiting -= rays;
        if *waiting == 0 {
            self.waiting.remove(&bundle.partition);
        }
    }

    fn take_rays_of(&mut self, partition: PartitionId) -> Vec<Bundle> {
        if !self.waiting.contains_key(&partition) {
            return Vec::new();
        }
        let is_of_it = |bundle: &mut Bundle| bundle.partition == partition;
        let mut taken: Vec<Bundle> = self.full.extract_if(.., is_of_it).collect();
        for stage in [Stage::Intersect, Stage::Shade, Stage::Shadow] {
            taken.extend(self.open.remove(&(partition, stage)));
        }
        taken.iter().for_each(|bundle| self.leave(bundle));
        taken
    }

    /// Full bundles first.
    fn next(&mut self) -> Option<Bundle> {
        self.full.pop().or_else(|| self.open.pop_first().map(|(_, bundle)| bundle))
    }

    fn retain(&mut self, keep: impl Fn(&Share) -> bool) {
        let mut waiting: BTreeMap<PartitionId, u64> = BTreeMap::new();
        let mut is_kept = |bundle: &mut Bundle| {
            bundle.retain_shares(&keep);
            if !bundle.rays.is_empty() {
                *waiting.entry(bundle.partition).or_default() += bundle.rays.len() as u64;
            }
            !bundle.rays.is_empty()
        };
        self.full.retain_mut(&mut is_kept);
        self.open.retain(|_, bundle| is_kept(bundle));
        self.ray_count = waiting.values().sum();
        self.waiting = waiting;
    }
}

/// Whether a window of so many rays is open: the last message may be larger than what was left.
fn is_open(under_way: &VecDeque<u64>, window: u64) -> bool {
    under_way.len() < WINDOW_FORWARDS && under_way.iter().sum::<u64>() < window
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use equilux_common::credit::Credit;
    use equilux_common::ids::{Attempt, UnitId};
    use equilux_common::ray::Ray;

    const HOME: WorkerId = WorkerId(3);
    const WINDOW: u64 = 4 * PARCEL_RAYS;

    fn bundle(partition: u32, unit: u32, rays: usize) -> Bundle {
        let credit = Credit::whole().split(16);
        let share = Share { unit: UnitId(unit), attempt: Attempt(0), credit };
        Bundle {
            stage: Stage::Intersect,
            partition: PartitionId(partition),
            shares: vec![share],
            rays: vec![Ray::zeroed(); rays],
        }
    }

    fn take(forwarding: &mut Forwarding, now: Time, is_idle: bool) -> Parcels {
        forwarding.take(now, is_idle, |_| Some(WINDOW))
    }

    fn rays(parcels: &Parcels) -> Vec<usize> {
        let rays = |bundles: &Vec<Bundle>| bundles.iter().map(|bundle| bundle.rays.len()).sum();
        parcels.iter().map(|(_, bundles)| rays(bundles)).collect()
    }

    /// Enough rays for so many full parcels.
    fn fill(forwarding: &mut Forwarding, parcels: u64) {
        for unit in 0..parcels * PARCEL_RAYS / BUNDLE_RAYS_MAX as u64 {
            forwarding.push(Time::ZERO, HOME, bundle(1, unit as u32, BUNDLE_RAYS_MAX));
        }
    }

    #[test]
    fn a_parcel_goes_when_it_is_full_or_old_or_a_thread_waits() {
        let mut forwarding = Forwarding::default();
        fill(&mut forwarding, 2);
        forwarding.push(Time::ZERO, HOME, bundle(1, 7, 3));
        let full = PARCEL_RAYS as usize;
        assert_eq!(rays(&take(&mut forwarding, Time::ZERO, false)), [full, full]);
        assert_eq!(forwarding.ray_count(), 3);
        let later = Time::ZERO + PARCEL_DELAY;
        assert_eq!(forwarding.deadline(None, |_| Some(WINDOW)), Some(later));
        assert_eq!(forwarding.deadline(None, |_| None), Some(Time::ZERO + UNREACHABLE));
        let unreachable = |now| forwarding.unreachable(now, |_| false);
        assert_eq!((unreachable(later), unreachable(Time::ZERO + UNREACHABLE)), (None, Some(HOME)));
        assert_eq!(forwarding.unreachable(Time::ZERO + UNREACHABLE, |_| true), None);
        assert_eq!(rays(&take(&mut forwarding, later, false)), [3]);
        forwarding.push(later, HOME, bundle(2, 7, 5));
        assert!(take(&mut forwarding, later, false).is_empty());
        assert_eq!(rays(&take(&mut forwarding, later, true)), [5]);
    }

    #[test]
    fn rays_for_one_partition_share_bundles() {
        let mut forwarding = Forwarding::default();
        for (partition, unit, rays) in [(1, 7, 30), (2, 7, 9), (1, 8, 30), (1, 7, 30), (1, 7, 4)] {
            forwarding.push(Time::ZERO, HOME, bundle(partition, unit, rays));
        }
        let taken = take(&mut forwarding, Time::ZERO, true);
        let shape = |bundle: &Bundle| (bundle.partition.0, bundle.shares.len(), bundle.rays.len());
        let shapes: Vec<_> = taken[0].1.iter().map(shape).collect();
        assert_eq!(shapes, [(1, 2, 60), (1, 1, 34), (2, 1, 9)]);
    }

    #[test]
    fn a_window_closes_until_the_home_has_taken_what_is_on_its_way() {
        let mut forwarding = Forwarding::default();
        fill(&mut forwarding, 6);
        assert_eq!(take(&mut forwarding, Time::ZERO, true).len(), 4);
        assert!(take(&mut forwarding, Time::ZERO, true).is_empty());
        assert_eq!(forwarding.deadline(None, |_| Some(WINDOW)), None, "nothing can go");
        forwarding.acknowledge(HOME, 1);
        assert_eq!(take(&mut forwarding, Time::ZERO, true).len(), 1);
        assert!(!forwarding.is_quiet() && forwarding.forget(HOME), "rays were on their way");
        assert_eq!(forwarding.take_back().len() as u64, PARCEL_RAYS / BUNDLE_RAYS_MAX as u64);
        assert!(forwarding.is_quiet() && !forwarding.forget(HOME));
    }

    #[test]
    fn rays_behind_a_closed_window_are_stuck_until_they_are_taken_out() {
        let mut forwarding = Forwarding::default();
        fill(&mut forwarding, 5);
        forwarding.push(Time::ZERO, HOME, bundle(2, 99, 7));
        assert!(forwarding.stuck(|_| Some(WINDOW)).is_empty(), "nothing is on its way yet");
        assert_eq!(take(&mut forwarding, Time::ZERO, false).len(), 4);
        let stuck = [(PartitionId(1), PARCEL_RAYS), (PartitionId(2), 7)];
        assert_eq!(forwarding.stuck(|_| Some(WINDOW)), BTreeMap::from(stuck));
        assert!(forwarding.stuck(|_| None).is_empty(), "nobody is there who could be busy");
        let taken = forwarding.take_rays_of(PartitionId(1));
        assert_eq!(taken.iter().map(|bundle| bundle.rays.len() as u64).sum::<u64>(), PARCEL_RAYS);
        assert_eq!(forwarding.ray_count(), 7);
        forwarding.retain(|share| share.unit != UnitId(99));
        assert!(forwarding.stuck(|_| Some(WINDOW)).is_empty());
    }

    #[test]
    fn what_came_is_acknowledged_in_parts_of_the_window_while_there_is_room() {
        let mut forwarding = Forwarding::default();
        forwarding.receive(Time::ZERO, HOME, WINDOW / RECEIPT_PART - 1);
        assert!(forwarding.receipts(Time::ZERO, Some(WINDOW)).is_empty());
        let late = Time::ZERO + RECEIPT_DELAY;
        assert_eq!(forwarding.deadline(Some(WINDOW), |_| None), Some(late));
        assert_eq!(forwarding.deadline(None, |_| None), None, "there is no room");
        forwarding.receive(Time::ZERO, HOME, 1);
        assert!(forwarding.receipts(late, None).is_empty(), "there is no room");
        assert_eq!(forwarding.receipts(Time::ZERO, Some(WINDOW)), [(HOME, 2)]);
        forwarding.receive(Time::ZERO, HOME, 1);
        assert_eq!(forwarding.receipts(late, Some(WINDOW)), [(HOME, 1)]);
    }

    #[test]
    fn old_attempts_are_dropped_from_parcels() {
        let mut forwarding = Forwarding::default();
        fill(&mut forwarding, 1);
        forwarding.push(Time::ZERO, HOME, bundle(5, 99, 7));
        assert_eq!(forwarding.retain(|share| share.unit == UnitId(99)), PARCEL_RAYS);
        assert_eq!(rays(&take(&mut forwarding, Time::ZERO, true)), [7]);
    }
}

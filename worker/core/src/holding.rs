//! The work of a job that is on this worker: what waits, what is traced, and the credit of both.
//!
//! Queue, forwarding, accounts and ledger know nothing of each other; here is where a piece of work
//! that moves is moved in all of them.

mod exchange;

use std::collections::BTreeSet;
use std::time::Duration;

use equilux_common::balancing::GiveFirst;
use equilux_common::bundle::{Bundle, Share};
use equilux_common::credit::Credit;
use equilux_common::film::{PixelSums, TileSums};
use equilux_common::ids::{Attempt, PartitionId, UnitId, WorkerId};
use equilux_common::message::{Home, JobStart, PeerMessage};
use equilux_common::time::Time;
use equilux_common::work::{Outcome, Samples, Work};

use equilux_mapping::Guest;

use crate::accounts::Accounts;
use crate::cost::Kind;
use crate::forwarding::Forwarding;
use crate::ledger::Ledger;
use crate::pieces::{Content, PieceId, Pieces};
use crate::queue::Queue;
use crate::residency::{Order, Outlook, Residency};
use crate::routing::Routing;
use crate::violation::Violation;
use crate::worker_core::Config;

/// Of a memory budget, film values of units that are under way take one part in so many. While they
/// keep new units from being begun, few rays wait, and a partition is loaded for few.
const FILM_PART: u64 = 8;

/// And so many bytes if memory is not limited.
const FILM_BYTES: u64 = 256 << 20;

/// Fewest units that are under way: some for each of many threads.
const OPEN_UNITS_MIN: usize = 256;

/// Where rays are forwarded, so long what has retired of a unit waits for more: many times as long
/// as a ray is away, and too short for anybody to notice at the end of a job.
const DELIVERY_PATIENCE: Duration = Duration::from_millis(20);

/// The work of a job that is here.
#[derive(Debug)]
pub(crate) struct Holding {
    queue: Queue,
    routing: Routing,
    forwarding: Forwarding,
    accounts: Accounts,
    ledger: Ledger,
    /// On compute threads.
    pieces: Pieces,
    residency: Residency,
    /// Most units of a model that is cut that are begun here and under way. Where rays are
    /// forwarded, as many of others have room beside them before film values go home early.
    open_units_max: usize,
}

impl Holding {
    /// Nothing of the job is here yet.
    pub(crate) fn new(config: &Config, start: &JobStart) -> Self {
        let spec = &start.spec;
        Self {
            routing: Routing::new(config, start),
            forwarding: Forwarding::default(),
            queue: Queue::new(spec.grid(), spec.settings.region()),
            accounts: Accounts::default(),
            ledger: Ledger::default(),
            pieces: Pieces::new(config.threads),
            residency: Residency::replicated(),
            open_units_max: usize::MAX,
        }
    }

    /// The model is ready to be traced, or will be, partition by partition.
    pub(crate) fn equip(
        &mut self,
        now: Time,
        partitions: Guest,
        memory: Option<u64>,
    ) -> Result<(), Violation> {
        let sizes: Vec<u64> = partitions.objects().iter().map(|object| object.bytes).collect();
        self.residency = Residency::new(&sizes, memory)?;
        self.queue.be_partitioned();
        self.open_units_max = self.open_units_within(memory);
        self.routing.equip(partitions);
        self.sort_rays(now)
    }

    /// These are home to the partitions from now on.
    pub(crate) fn change_homes(&mut self, now: Time, homes: Vec<Home>) -> Result<(), Violation> {
        self.routing.change_homes(homes);
        self.sort_rays(now)
    }

    /// Puts all rays that wait to where they belong by now.
    fn sort_rays(&mut self, now: Time) -> Result<(), Violation> {
        let mut bundles = self.forwarding.take_back();
        bundles.append(&mut self.queue.take_all_rays());
        // Whatever is wrong with one, all are kept: what is here stays accounted for.
        let outcome = bundles.iter().try_for_each(|bundle| self.routing.check(bundle.partition));
        bundles.into_iter().for_each(|bundle| self.put_rays(now, bundle));
        outcome
    }

    /// How many units of a model that is cut may be under way: each keeps the film values of a tile
    /// until the last of its rays has ended, wherever that waits.
    fn open_units_within(&self, memory: Option<u64>) -> usize {
        let tile = self.queue.grid().unit(UnitId(0)).map_or(1, |unit| unit.tile.pixel_count());
        let tile_bytes = (tile * size_of::<PixelSums>()) as u64;
        let bytes = memory.map_or(FILM_BYTES, |memory| memory / FILM_PART);
        usize::try_from(bytes / tile_bytes).unwrap_or(usize::MAX).max(OPEN_UNITS_MIN)
    }

    /// Whether rays can be traced by anybody.
    pub(crate) fn are_rays_free(&self) -> bool {
        self.routing.are_rays_free()
    }

    /// How long what has retired of a unit waits for more.
    fn patience(&self) -> Duration {
        let is_full = self.accounts.open_count() >= self.open_units_max.saturating_mul(2);
        if self.routing.are_rays_free() || is_full { Duration::ZERO } else { DELIVERY_PATIENCE }
    }

    /// Rays wait for a thread here, or for their way to another home.
    fn put_rays(&mut self, now: Time, bundle: Bundle) {
        match self.routing.destination(bundle.partition) {
            Some(home) => self.forwarding.push(now, home, bundle),
            None => self.queue.push_bundle(bundle),
        }
    }

    /// Rays that wait, and how many may.
    pub(crate) const fn waiting_rays(&self) -> (u64, u64) {
        (self.ray_count(), self.routing.allowance().rays())
    }

    /// Rays that wait.
    const fn ray_count(&self) -> u64 {
        self.queue.ray_count() + self.forwarding.ray_count()
    }

    /// A partition that was asked for is in memory.
    pub(crate) fn partition_loaded(&mut self, now: Time, partition: PartitionId) {
        self.residency.loaded(now, partition);
    }

    /// Which partitions are to be loaded or dropped now.
    pub(crate) fn arrange(
        &mut self,
        now: Time,
        threads: u32,
        is_linked: impl Fn(WorkerId) -> bool,
    ) -> Vec<Order> {
        let stuck = self.stuck_rays(is_linked);
        let stuck_at = |partition| stuck.get(&partition).copied().unwrap_or(0);
        let outlook = Outlook {
            rays_at: &|partition| self.queue.rays_at(partition) + stuck_at(partition),
            ray_nanos: self.queue.stock().costs().of(Kind::Rays),
            path_nanos: self.path_nanos(),
            oldest_piece: self.pieces.oldest(),
            next_piece: self.pieces.next(),
            threads,
        };
        let orders = self.residency.arrange(now, &outlook);
        for order in &orders {
            match *order {
                Order::Drop(partition) => self.drop_copy(now, partition),
                Order::Load(partition) => self.copy_for_stuck(partition),
            }
        }
        self.drop_idle_copies();
        orders
    }

    /// Whole units came in.
    pub(crate) fn issue(&mut self, units: &[(UnitId, Attempt)]) -> Result<(), Violation> {
        self.raise(units);
        for &(unit, attempt) in units {
            self.check_unit(unit)?;
            if attempt == self.accounts.attempt(unit) {
                self.enter_whole(unit, attempt)?;
            }
        }
        Ok(())
    }

    /// Drops all work of older attempts at these units.
    pub(crate) fn raise(&mut self, units: &[(UnitId, Attempt)]) {
        let mut is_any_newer = false;
        for &(unit, attempt) in units {
            is_any_newer |= self.accounts.raise(unit, attempt);
        }
        if is_any_newer {
            let keep = |share: &Share| self.accounts.is_current(share);
            let dropped = self.queue.retain(keep) + self.forwarding.retain(keep);
            self.ledger.drop_rays(dropped);
        }
    }

    /// Whether a message has work of an attempt of which the coordinator has not told yet. With
    /// that it tells of the lost worker that the attempt is for: who knew only of the attempt might
    /// send work there, where nobody would miss it any more.
    pub(crate) fn is_ahead(&self, message: &PeerMessage) -> bool {
        let mut is_ahead = false;
        message.for_each_share(|share| {
            is_ahead |= share.attempt > self.accounts.attempt(share.unit);
        });
        is_ahead
    }

    /// Work came from a peer.
    pub(crate) fn receive(&mut self, now: Time, work: Work) -> Result<(), Violation> {
        self.check_work(&work)?;
        self.ledger.receive(rays_in(&work));
        match work {
            Work::Samples(samples) => self.receive_samples(samples),
            Work::Rays(bundle) => self.receive_bundle(now, bundle),
        }
    }

    /// The next piece for a compute thread, of about `grain` nanoseconds. New units of a replicated
    /// model are begun only while fewer than `open_units_max` are under way.
    pub(crate) fn dispatch(
        &mut self,
        now: Time,
        grain: u64,
        open_units_max: usize,
    ) -> Option<(PieceId, Work)> {
        let rays = self.queue.pop_rays(grain, &self.residency).map(Work::Rays);
        let work = match rays {
            Some(rays) => rays,
            None => Work::Samples(self.next_samples(grain, open_units_max)?),
        };
        work.shares().iter().for_each(|share| self.accounts.trace(share));
        self.ledger.dispatch(rays_in(&work));
        let (kind, count) = self.queue.kind(&work);
        let nanos = self.queue.stock().costs().of(kind).saturating_mul(count);
        let content = Content { kind, count, expected: Duration::from_nanos(nanos) };
        Some((self.pieces.begin(now, content), work))
    }

    /// A piece was traced.
    pub(crate) fn trace(&mut self, now: Time, id: PieceId, outcome: Outcome, elapsed: Duration) {
        let returned = ray_count(&outcome.successors);
        let (Content { kind, count, .. }, is_interrupted) = self.pieces.end(now, id);
        self.ledger.trace(&outcome.counts, returned);
        let ended = if self.residency.is_replicated() {
            // What comes back was not traced.
            count.saturating_sub(path_count(&outcome.successors))
        } else if is_interrupted {
            // What comes back was not traced, or has gone as far as it could: nobody can tell.
            0
        } else {
            count
        };
        if ended > 0 {
            self.queue.stock_mut().learn(kind, elapsed, ended);
        }
        for (share, sums) in &outcome.retired {
            if self.accounts.is_current(share) {
                self.accounts.retire(share, sums, self.queue.grid());
            }
        }
        for bundle in outcome.successors {
            self.resume(now, bundle);
        }
        if self.pieces.count() == 0 {
            self.accounts.assert_nothing_traced();
        }
    }

    /// Takes out something to give away, of about `budget` nanoseconds of one thread; if it cannot
    /// be split as finely, of no more than `most`. Who cannot trace any ray is given those of the
    /// partition of which it has a `copy`: others it would only send back.
    pub(crate) fn give(
        &mut self,
        budget: u64,
        most: u64,
        first: GiveFirst,
        copy: Option<PartitionId>,
    ) -> Option<Work> {
        let gift = if self.are_rays_free() {
            self.queue.pop_gift(budget, most, first)?
        } else {
            let samples = self.queue.give_samples(budget, most);
            samples.or_else(|| self.queue.give_rays(copy?, budget, most))?
        };
        if let Some(share) = &gift.begun {
            self.accounts.enter(share).expect("nobody else has credit of a whole unit");
        }
        gift.work.shares().iter().for_each(|share| self.accounts.leave(share));
        self.ledger.send(rays_in(&gift.work));
        Some(gift.work)
    }

    /// Credit that goes home, with its film values.
    pub(crate) fn take_complete(&mut self, now: Time) -> Vec<(Share, TileSums)> {
        let patience = self.patience();
        self.accounts.take_complete(now, patience)
    }

    /// Pieces on compute threads.
    pub(crate) const fn pieces(&self) -> &Pieces {
        &self.pieces
    }

    /// All threads are told to give up what they have not begun.
    pub(crate) fn interrupt(&mut self) {
        self.pieces.interrupt();
    }

    /// Nanoseconds that what waits would take one thread.
    pub(crate) fn waiting_nanos(&self) -> u64 {
        self.queue.stock().nanos()
    }

    /// Whether nothing waits.
    pub(crate) fn is_drained(&self) -> bool {
        self.queue.is_empty()
    }

    /// Whether no thread traces and nothing waits.
    pub(crate) fn is_idle(&self) -> bool {
        self.pieces.count() == 0 && self.is_drained() && self.forwarding.ray_count() == 0
    }

    /// Whether moreover all credit has gone home.
    pub(crate) fn is_quiet(&self) -> bool {
        self.is_idle() && self.accounts.open_count() == 0 && self.forwarding.is_quiet()
    }

    /// Shows every share of credit that is here.
    pub(crate) fn for_each_share(&self, visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
        let whole = Credit::whole();
        self.queue.for_each_unit(|unit, attempt| visit(unit, attempt, &whole));
        self.accounts.for_each_share(visit);
    }

    /// Checks that no ray was lost or doubled.
    pub(crate) fn check(&self) {
        self.ledger.check(self.ray_count(), self.pieces.count());
    }

    /// Paths to begin: of units that are under way, then of the next one.
    fn next_samples(&mut self, grain: u64, open_units_max: usize) -> Option<Samples> {
        if !self.can_begin_paths() {
            return None;
        }
        if let Some(samples) = self.queue.pop_samples(grain) {
            return Some(samples);
        }
        let open_units_max =
            if self.residency.is_replicated() { open_units_max } else { self.open_units_max };
        if self.accounts.begun_count() >= open_units_max {
            return None;
        }
        let share = self.queue.begin_first()?;
        self.accounts.begin(&share).expect("nobody else has credit of a whole unit");
        self.queue.pop_samples(grain)
    }

    /// Whether there are paths to begin, and room for the rays that will come of them.
    fn can_begin_paths(&self) -> bool {
        let has_room = self.accounts.begun_count() < self.open_units_max || self.queue.has_begun();
        self.queue.has_paths() && has_room && self.room() > 0
    }

    /// How many more rays may wait when paths are begun.
    fn room(&self) -> u64 {
        if self.residency.is_replicated() {
            return u64::MAX;
        }
        self.routing.allowance().begun_rays().saturating_sub(self.ray_count())
    }

    /// Whether as many rays wait as may.
    fn is_full(&self) -> bool {
        !self.residency.is_replicated() && self.ray_count() >= self.routing.allowance().rays()
    }

    /// Nanoseconds that a thread has to do with paths that may be begun.
    fn path_nanos(&self) -> u64 {
        if !self.can_begin_paths() {
            return 0;
        }
        let paths = self.room().min(self.queue.path_count());
        paths.saturating_mul(self.queue.stock().costs().path())
    }

    fn receive_samples(&mut self, samples: Samples) -> Result<(), Violation> {
        if !self.accounts.is_current(&samples.share) {
            return Ok(());
        }
        if samples.share.credit.is_whole() {
            return self.enter_whole(samples.share.unit, samples.share.attempt);
        }
        self.enter(&samples.share)?;
        self.queue.push_samples(samples);
        Ok(())
    }

    fn receive_bundle(&mut self, now: Time, mut bundle: Bundle) -> Result<(), Violation> {
        self.drop_stale(&mut bundle);
        for share in &bundle.shares {
            self.enter(share)?;
        }
        if !bundle.shares.is_empty() {
            self.put_rays(now, bundle);
        }
        Ok(())
    }

    /// Rays came back from a compute thread.
    fn resume(&mut self, now: Time, mut bundle: Bundle) {
        self.drop_stale(&mut bundle);
        bundle.shares.iter().for_each(|share| self.accounts.resume(share));
        if !bundle.shares.is_empty() {
            self.put_rays(now, bundle);
        }
    }

    fn drop_stale(&mut self, bundle: &mut Bundle) {
        let dropped = bundle.retain_shares(|share| self.accounts.is_current(share));
        self.ledger.drop_rays(dropped as u64);
    }

    /// A whole unit came in: nobody has begun it, so nothing else of it can be here.
    fn enter_whole(&mut self, unit: UnitId, attempt: Attempt) -> Result<(), Violation> {
        if self.accounts.is_open(unit) || self.queue.has_unit(unit, attempt) {
            return Err(Violation::TooMuchCredit(unit));
        }
        self.queue.push_unit(unit, attempt);
        Ok(())
    }

    fn enter(&mut self, share: &Share) -> Result<(), Violation> {
        if self.queue.has_unit(share.unit, share.attempt) {
            return Err(Violation::TooMuchCredit(share.unit));
        }
        self.accounts.enter(share).map_err(|_| Violation::TooMuchCredit(share.unit))
    }

    fn check_work(&self, work: &Work) -> Result<(), Violation> {
        for share in work.shares() {
            self.check_unit(share.unit)?;
        }
        let samples = match work {
            Work::Samples(samples) => samples,
            Work::Rays(bundle) => return self.routing.check(bundle.partition),
        };
        let unit = samples.share.unit;
        let path_count = self.queue.grid().unit(unit).map_or(0, |unit| unit.path_count());
        let first = samples.first_path;
        let end = u64::from(first) + u64::from(samples.path_count);
        if end > u64::from(path_count) {
            return Err(Violation::UnknownPaths { unit, first, end, path_count });
        }
        Ok(())
    }

    fn check_unit(&self, unit: UnitId) -> Result<(), Violation> {
        let is_known = self.queue.grid().unit(unit).is_some();
        if is_known { Ok(()) } else { Err(Violation::UnknownUnit(unit)) }
    }
}

/// Rays in the middle of their paths.
pub(crate) fn rays_in(work: &Work) -> u64 {
    match work {
        Work::Samples(_) => 0,
        Work::Rays(bundle) => bundle.rays.len() as u64,
    }
}

/// The paths that rays belong to: what comes of one path are several rays.
fn path_count(bundles: &[Bundle]) -> u64 {
    let rays = bundles.iter().flat_map(|bundle| &bundle.rays);
    rays.map(|ray| (ray.pixel, ray.sample_index)).collect::<BTreeSet<_>>().len() as u64
}

fn ray_count(bundles: &[Bundle]) -> u64 {
    bundles.iter().map(|bundle| bundle.rays.len() as u64).sum()
}

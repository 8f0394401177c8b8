//! Balancing: work spreads from busy workers to idle ones along the edges of the topology.
//!
//! It is receiver-initiated. By diffusion, a worker whose queue falls under the low-water mark
//! ([`marks`]) asks its neighbors for their load ([`asking`]), takes a diffusion step
//! ([`diffusion`]) and asks each for its part; the neighbor gives that much ([`giving`]), but never
//! what keeps its own threads busy. Beside it there is work stealing ([`stealing`]), to compare.
//!
//! Where partitions are at home with several workers, rays are of use only to who has the partition
//! that they wait for. Who has nothing else to give offers a copy of it (the paper's section 5.2),
//! with as much work as the diffusion step asks for; the neighbor takes it if it has the copy
//! already, or if that work lasts longer than the copy takes to come.

mod asking;
mod diffusion;
mod giving;
mod marks;
mod receipts;
mod stealing;

use std::time::Duration;

use equilux_common::balancing::{Balance, Balancing, Exchange, GiveFirst};
use equilux_common::ids::{PartitionId, WorkerId};
use equilux_common::message::{Load, PeerMessage};
use equilux_common::time::Time;
use equilux_common::work::Work;

use crate::balance::asking::Asking;
use crate::balance::diffusion::Vertex;
use crate::balance::giving::Giving;
use crate::balance::receipts::Receipts;
use crate::balance::stealing::Stealing;
use crate::holding::Holding;
use crate::worker_core::Config;

pub(crate) use crate::balance::giving::WINDOW_GIFTS;

/// A piece for a compute thread takes no longer: others may have to wait for what is in it.
const GRAIN_MAX: Duration = Duration::from_millis(16);

/// Nor is it shorter than this, so that the core's part in it stays small.
const GRAIN_MIN: Duration = Duration::from_micros(200);

/// In between it is such a part of what waits here for its thread: near the end of the job pieces
/// become small, and nobody sits on a large one that others wait for.
const GRAIN_PART: u64 = 8;

/// A flow is at least so much time of a reference thread: less is not worth its messages (some four
/// of 10 µs each, and the film values that come home separately), nor would anybody notice it.
const GIFT_MIN: Duration = Duration::from_micros(300);

/// The balancing of one job on one worker.
#[derive(Debug)]
pub(crate) struct Balancer {
    policy: Policy,
    giving: Giving,
    receipts: Receipts,
    give_first: GiveFirst,
    exchange: Exchange,
    threads: u32,
    speed: u32,
    /// When threads are to be interrupted, as things stood at the last look.
    interrupt_time: Option<Time>,
}

/// How a worker comes by more work.
#[derive(Debug)]
enum Policy {
    Diffusion(Asking),
    Stealing(Stealing),
    None,
}

/// What is given now, and what is said to those who get nothing.
#[derive(Debug, Default)]
pub(crate) struct Given {
    /// Work.
    pub(crate) gifts: Vec<(WorkerId, Work)>,
    /// Copies of partitions, with the time that the rays would take that come with them.
    pub(crate) offers: Vec<(WorkerId, PartitionId, Load)>,
    /// Those who get nothing and do not wait for it.
    pub(crate) declined: Vec<WorkerId>,
}

/// What a worker says to its neighbors to come by more work.
pub(crate) type Questions = Vec<(WorkerId, PeerMessage)>;

impl Balancer {
    /// For a worker of that kind.
    pub(crate) fn new(config: &Config, balancing: Balancing) -> Self {
        let policy = match balancing.balance {
            Balance::Diffusion => Policy::Diffusion(Asking::new(balancing.step)),
            Balance::Stealing => Policy::Stealing(Stealing::new(config.worker)),
            Balance::None => Policy::None,
        };
        Self {
            policy,
            giving: Giving::default(),
            receipts: Receipts::default(),
            give_first: balancing.give_first,
            exchange: match balancing.balance {
                Balance::Diffusion => balancing.exchange,
                Balance::Stealing | Balance::None => Exchange::Off,
            },
            threads: config.threads,
            speed: config.speed,
            interrupt_time: None,
        }
    }

    /// Something has changed for which it is worth asking (again).
    pub(crate) const fn encourage(&mut self) {
        if let Policy::Diffusion(asking) = &mut self.policy {
            asking.encourage();
        }
    }

    /// A neighbor said something about load; gives the answer if it wants one.
    pub(crate) fn hear(
        &mut self,
        now: Time,
        peer: WorkerId,
        message: &PeerMessage,
        holding: &Holding,
    ) -> Option<PeerMessage> {
        match *message {
            PeerMessage::LoadAsked { round } => {
                if let Policy::Diffusion(asking) = &mut self.policy {
                    asking.hear_want(now, peer);
                }
                let Vertex { load, capacity } = self.vertex(holding);
                return Some(PeerMessage::Load { round, load, capacity });
            }
            PeerMessage::Load { round, load, capacity } => {
                if let Policy::Diffusion(asking) = &mut self.policy {
                    asking.answer(now, peer, round, Vertex { load, capacity });
                }
            }
            PeerMessage::WorkAsked { amount } => {
                if let Policy::Diffusion(asking) = &mut self.policy {
                    asking.hear_want(now, peer);
                }
                self.consider(peer, amount, holding);
            }
            PeerMessage::Declined => {
                if let Policy::Stealing(stealing) = &mut self.policy {
                    stealing.fail(now, peer);
                }
            }
            PeerMessage::Given { .. } => self.receive(now, peer),
            PeerMessage::Acknowledged { count } => self.giving.acknowledge(peer, count),
            PeerMessage::OfferTaken { partition } => self.giving.take_offer(peer, partition),
            PeerMessage::OfferRefused { .. } => self.giving.refuse_offer(peer),
            PeerMessage::Offered { .. }
            | PeerMessage::Forwarded { .. }
            | PeerMessage::ForwardsAcknowledged { .. } => {}
        }
        None
    }

    /// A peer is gone; says whether gifts were on their way to it.
    pub(crate) fn forget(&mut self, peer: WorkerId) -> bool {
        match &mut self.policy {
            Policy::Diffusion(asking) => asking.forget(peer),
            Policy::Stealing(stealing) => stealing.forget(peer),
            Policy::None => {}
        }
        self.receipts.forget(peer);
        self.giving.forget(peer)
    }

    /// Takes out of the holding what is to be given now.
    pub(crate) fn give(&mut self, now: Time, holding: &mut Holding) -> Given {
        let mut given = Given::default();
        let kept = self.kept_nanos().saturating_sub(self.delay(now, holding));
        let excess = holding.waiting_nanos().saturating_sub(kept);
        for (peer, wanted) in self.giving.takers(excess, kept) {
            let already = given.gifts.len();
            let rest = self.give_to(peer, wanted, kept, holding, &mut given.gifts);
            if given.gifts.len() > already {
                self.giving.settle(peer, rest);
                self.note_gift(peer);
            } else if matches!(self.policy, Policy::Stealing(_)) {
                self.giving.withdraw(peer);
                given.declined.push(peer);
            } else {
                self.giving.keep_waiting(peer);
                given.offers.extend(self.offer(peer, wanted, kept, holding));
            }
        }
        given
    }

    /// Offers a peer a copy of the partition that most rays wait for, with as many of the rays as
    /// are to be given: when there is nothing else to give, and they are worth a message.
    fn offer(
        &mut self,
        peer: WorkerId,
        wanted: u64,
        kept: u64,
        holding: &Holding,
    ) -> Option<(WorkerId, PartitionId, Load)> {
        if self.exchange == Exchange::Off || holding.are_rays_free() {
            return None;
        }
        let least = self.giving.offer_min(peer)?.max(nanos(gift_min(self.low_water())));
        let most = holding.waiting_nanos().saturating_sub(kept).min(wanted);
        if most < least {
            return None;
        }
        let (partition, waiting) = holding.offer()?;
        let nanos_given = waiting.min(most);
        if nanos_given < least {
            return None;
        }
        self.giving.offer(peer, nanos_given);
        let load = scale(nanos_given, u64::from(self.speed), 1000);
        Some((peer, partition, Duration::from_nanos(load)))
    }

    /// Whether a copy of a partition pays that would take so long to come: the work that comes with
    /// it lasts longer, and nothing else is here to do meanwhile.
    pub(crate) fn is_copy_worth(&self, load: Load, transfer: Duration, holding: &Holding) -> bool {
        let own = scale(nanos(load), 1000, self.capacity());
        self.load(holding) < self.low_water().max(transfer) && own > nanos(transfer)
    }

    /// What to ask of the neighbors now, and whether this begins a round.
    pub(crate) fn questions(
        &mut self,
        now: Time,
        holding: &Holding,
        neighbors: &[WorkerId],
    ) -> (Questions, bool) {
        let (own, enough) = (self.vertex(holding), self.enough());
        let ask = |amount: Load| PeerMessage::WorkAsked { amount };
        match &mut self.policy {
            Policy::Diffusion(asking) => {
                let mut said = Questions::new();
                if own.load < asking.marks().low_water() {
                    let (round, asked) = asking.begin(now, neighbors);
                    let message = PeerMessage::LoadAsked { round };
                    said.extend(asked.into_iter().map(|peer| (peer, message.clone())));
                } else {
                    asking.encourage();
                }
                let is_round = !said.is_empty();
                let requests = asking.conclude(now, own).into_iter();
                said.extend(requests.map(|(peer, amount)| (peer, ask(amount))));
                let has_idle_thread = holding.pieces().count() < self.threads;
                if holding.is_drained() && has_idle_thread {
                    let untold = asking.leave_word(neighbors).into_iter();
                    said.extend(untold.map(|peer| (peer, ask(enough))));
                }
                (said, is_round)
            }
            Policy::Stealing(stealing) => {
                stealing.wake(now);
                let is_drained = holding.is_drained();
                let victim = is_drained.then(|| stealing.victim(now, neighbors)).flatten();
                let is_attempt = victim.is_some();
                (victim.map(|peer| (peer, ask(Load::ZERO))).into_iter().collect(), is_attempt)
            }
            Policy::None => (Vec::new(), false),
        }
    }

    /// What to acknowledge to whom now.
    pub(crate) fn receipts(&mut self, now: Time) -> Vec<(WorkerId, u32)> {
        self.receipts.take(now)
    }

    /// Whether to interrupt the pieces on compute threads now: somebody waits, nothing else is here
    /// to give, and some piece goes on for longer than it takes to share it. If not now, that may
    /// be so later: a deadline.
    pub(crate) fn interrupts(&mut self, now: Time, holding: &mut Holding) -> bool {
        self.interrupt_time = self.find_interrupt_time(now, holding);
        let is_time = self.interrupt_time.take_if(|time| *time <= now).is_some();
        if is_time {
            self.giving.interrupt(now);
            holding.interrupt();
        }
        is_time
    }

    /// When something is due without an event.
    pub(crate) fn deadline(&self) -> Option<Time> {
        let pause = match &self.policy {
            Policy::Stealing(stealing) => stealing.deadline(),
            Policy::Diffusion(_) | Policy::None => None,
        };
        [self.interrupt_time, pause, self.receipts.deadline()].into_iter().flatten().min()
    }

    /// Nanoseconds of one thread that the next piece for it should take.
    pub(crate) fn grain(&self, holding: &Holding) -> u64 {
        let part = holding.waiting_nanos() / u64::from(self.threads) / GRAIN_PART;
        part.clamp(nanos(GRAIN_MIN), nanos(GRAIN_MAX))
    }

    /// The fullest window.
    pub(crate) fn unacknowledged_max(&self) -> u32 {
        self.giving.unacknowledged_max()
    }

    /// Whether no answer is awaited and nothing given is on its way.
    pub(crate) fn is_quiet(&self) -> bool {
        let is_quiet = match &self.policy {
            Policy::Diffusion(asking) => asking.is_quiet(),
            Policy::Stealing(stealing) => stealing.is_quiet(),
            Policy::None => true,
        };
        is_quiet && self.unacknowledged_max() == 0
    }

    /// How long what waits keeps this worker's threads busy.
    pub(crate) fn load(&self, holding: &Holding) -> Load {
        Duration::from_nanos(holding.waiting_nanos() / u64::from(self.threads))
    }

    fn vertex(&self, holding: &Holding) -> Vertex {
        Vertex { load: self.load(holding), capacity: self.capacity() }
    }

    /// What this worker computes at a time, in thousandths of a reference thread.
    fn capacity(&self) -> u64 {
        u64::from(self.threads) * u64::from(self.speed)
    }

    /// Somebody wants work.
    fn consider(&mut self, peer: WorkerId, amount: Load, holding: &Holding) {
        let wanted = match self.policy {
            Policy::Diffusion(_) => scale(nanos(amount), 1000, u64::from(self.speed)),
            Policy::Stealing(_) => holding.waiting_nanos() / 2,
            Policy::None => return,
        };
        self.giving.ask(peer, wanted);
    }

    /// A gift came in.
    fn receive(&mut self, now: Time, peer: WorkerId) {
        self.receipts.add(now, peer);
        // Who gives has work.
        self.giving.withdraw(peer);
        match &mut self.policy {
            Policy::Diffusion(asking) => asking.receive(now, peer),
            Policy::Stealing(stealing) => stealing.succeed(now, peer),
            Policy::None => {}
        }
    }

    /// A peer was given something: it takes this worker for busy now.
    fn note_gift(&mut self, peer: WorkerId) {
        if let Policy::Diffusion(asking) = &mut self.policy {
            asking.give(peer);
        }
    }

    /// Gives a peer what it wants as far as it can be had without going below `kept`; says what is
    /// left of that. Where single paths take so long that what is to be given is less than one, one
    /// goes.
    fn give_to(
        &mut self,
        peer: WorkerId,
        mut wanted: u64,
        kept: u64,
        holding: &mut Holding,
        gifts: &mut Vec<(WorkerId, Work)>,
    ) -> u64 {
        let least = match self.policy {
            Policy::Diffusion(_) => nanos(gift_min(self.low_water())),
            Policy::Stealing(_) | Policy::None => nanos(GRAIN_MIN),
        };
        while wanted > 0 && self.giving.has_room(peer) {
            let before = holding.waiting_nanos();
            let excess = before.saturating_sub(kept);
            if excess < least {
                break;
            }
            let budget = excess.min(wanted.max(least));
            let copy = self.giving.copy_at(peer);
            let Some(work) = holding.give(budget, before, self.give_first, copy) else { break };
            self.giving.give(peer);
            gifts.push((peer, work));
            wanted = wanted.saturating_sub(before.saturating_sub(holding.waiting_nanos()));
        }
        wanted
    }

    fn find_interrupt_time(&self, now: Time, holding: &Holding) -> Option<Time> {
        // What an interrupt brings are rays.
        if !holding.are_rays_free() {
            return None;
        }
        let (soonest, is_news) = self.giving.interrupt_time(self.low_water())?;
        let time = holding.pieces().interrupt_time(now, self.low_water(), is_news)?;
        Some(time.max(soonest))
    }

    /// How long what waits must last before a worker asks for more or gives some away.
    pub(crate) fn low_water(&self) -> Duration {
        match &self.policy {
            Policy::Diffusion(asking) => asking.marks().low_water(),
            Policy::Stealing(_) | Policy::None => Duration::ZERO,
        }
    }

    /// What this worker keeps for itself, in nanoseconds of one thread.
    fn kept_nanos(&self) -> u64 {
        nanos(self.low_water()).saturating_mul(u64::from(self.threads))
    }

    /// How much of what is usually kept is not needed, in nanoseconds of one thread, because
    /// threads are busy for long with what is out.
    fn delay(&self, now: Time, holding: &Holding) -> u64 {
        nanos(holding.pieces().delay(now, GRAIN_MAX, self.low_water()))
    }

    /// What lifts this worker to its mark, as time of a reference thread.
    fn enough(&self) -> Load {
        Duration::from_nanos(scale(self.kept_nanos(), u64::from(self.speed), 1000))
    }
}

/// The least flow between workers with such a low-water mark: what is used up while it travels is
/// not worth the way either.
fn gift_min(low_water: Duration) -> Duration {
    GIFT_MIN.max(low_water * 2)
}

fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

fn scale(nanos: u64, numerator: u64, denominator: u64) -> u64 {
    let scaled = u128::from(nanos) * u128::from(numerator) / u128::from(denominator.max(1));
    u64::try_from(scaled).unwrap_or(u64::MAX)
}

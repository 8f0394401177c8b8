//! Balancing: work spreads from busy workers to idle ones along the edges of the topology.
//!
//! It is receiver-initiated. A worker whose queue falls under the low-water mark asks its neighbors
//! for their load ([`asking`]), takes a diffusion step ([`diffusion`]) and asks each for its part;
//! the neighbor gives that much ([`giving`]), but never what keeps its own threads busy. Where the
//! model is partitioned, whether a gift is worth the partition it needs will be decided here too.

mod asking;
pub(crate) mod cost;
mod diffusion;
mod giving;

use std::time::Duration;

use equilux_common::balancing::Balancing;
use equilux_common::ids::WorkerId;
use equilux_common::message::{Load, PeerMessage};
use equilux_common::time::Time;
use equilux_common::work::RayCounts;

use crate::balance::asking::Asking;
use crate::balance::cost::Costs;
use crate::balance::giving::Giving;
use crate::queue::{Gift, PIECE_MIN, Queue};
use crate::worker_core::Config;

pub(crate) use crate::balance::giving::WINDOW_GIFTS;

/// A queue that lasts for less than this is low: enough to hide two round trips of asking and one
/// of giving on a slow network, and a small part of a second's work.
const LOW_WATER: Duration = Duration::from_millis(5);

/// The balancing of one job on one worker.
#[derive(Debug)]
pub(crate) struct Balancer {
    asking: Asking,
    giving: Giving,
    costs: Costs,
    threads: u32,
    /// What this worker computes at a time, in thousandths of a reference thread.
    capacity: u64,
}

impl Balancer {
    /// For a worker of that kind.
    pub(crate) fn new(config: &Config, _balancing: Balancing) -> Self {
        let (asking, giving, costs) = (Asking::default(), Giving::default(), Costs::default());
        let capacity = u64::from(config.threads) * u64::from(config.speed);
        Self { asking, giving, costs, threads: config.threads, capacity }
    }

    /// A piece was traced, and `returned` of its rays came back unfinished.
    pub(crate) fn learn(&mut self, elapsed: Duration, counts: &RayCounts, returned: u64) {
        self.costs.learn(elapsed, counts, returned);
    }

    /// What work costs here.
    pub(crate) const fn costs(&self) -> &Costs {
        &self.costs
    }

    /// Something has changed for which it is worth asking (again).
    pub(crate) const fn encourage(&mut self) {
        self.asking.encourage();
    }

    /// A neighbor said something about load; gives the answer if it wants one.
    pub(crate) fn hear(
        &mut self,
        peer: WorkerId,
        message: &PeerMessage,
        queue: &Queue,
    ) -> Option<PeerMessage> {
        match *message {
            PeerMessage::LoadAsked { round } => {
                let (load, capacity) = (self.load(queue), self.capacity);
                return Some(PeerMessage::Load { round, load, capacity });
            }
            PeerMessage::Load { round, load, .. } => self.asking.answer(peer, round, load),
            PeerMessage::WorkAsked { amount } => self.giving.ask(peer, amount),
            PeerMessage::Acknowledged { count } => self.giving.acknowledge(peer, count),
            PeerMessage::Given { .. } => self.asking.encourage(),
            PeerMessage::Declined => {}
        }
        None
    }

    /// A peer is gone; says whether gifts were on their way to it.
    pub(crate) fn forget(&mut self, peer: WorkerId) -> bool {
        self.asking.forget(peer);
        self.giving.forget(peer)
    }

    /// Takes out of the queue what is to be given now.
    pub(crate) fn gifts(&mut self, queue: &mut Queue) -> Vec<(WorkerId, Gift)> {
        let mut gifts = Vec::new();
        for (peer, mut wanted) in self.giving.takers() {
            let already = gifts.len();
            while wanted > 0 && self.giving.has_room(peer) {
                let Some((gift, cost)) = self.gift(wanted, queue) else { break };
                self.giving.give(peer);
                wanted = wanted.saturating_sub(cost);
                gifts.push((peer, gift));
            }
            if gifts.len() > already {
                self.giving.settle(peer, wanted);
            }
        }
        gifts
    }

    /// What to ask of the neighbors now, and whether this begins a round.
    pub(crate) fn questions(
        &mut self,
        queue: &Queue,
        neighbors: &[WorkerId],
    ) -> (Vec<(WorkerId, PeerMessage)>, bool) {
        let own = self.load(queue);
        if own < LOW_WATER
            && let Some(round) = self.asking.begin(neighbors)
        {
            let ask = |&neighbor: &WorkerId| (neighbor, PeerMessage::LoadAsked { round });
            return (neighbors.iter().map(ask).collect(), true);
        }
        let parts = self.asking.conclude(own, LOW_WATER);
        // Flows are time of a queue that all threads empty; amounts are time of one thread.
        let ask = |(neighbor, part): (WorkerId, Load)| {
            (neighbor, PeerMessage::WorkAsked { amount: part.saturating_mul(self.threads) })
        };
        (parts.into_iter().map(ask).collect(), false)
    }

    /// Whether to interrupt the `traces` pieces on compute threads now: somebody waits, nothing
    /// else is here to give, and they hold more than keeps this worker busy.
    pub(crate) fn interrupts(&mut self, now: Time, queue: &Queue, traces: u32) -> bool {
        let is_time = self.interrupt_deadline(queue, traces).is_some_and(|time| time <= now);
        if is_time {
            self.giving.interrupt(now);
        }
        is_time
    }

    /// When [`Self::interrupts`] would say so.
    pub(crate) fn interrupt_deadline(&self, queue: &Queue, traces: u32) -> Option<Time> {
        let is_worth_it = self.costs.pieces(u64::from(traces)) > self.kept_nanos();
        if queue.is_empty() && is_worth_it { self.giving.interrupt_deadline() } else { None }
    }

    /// The fullest window.
    pub(crate) fn unacknowledged_max(&self) -> u32 {
        self.giving.unacknowledged_max()
    }

    /// Whether no answer is awaited and nothing given is on its way.
    pub(crate) fn is_quiet(&self) -> bool {
        self.asking.is_quiet() && self.unacknowledged_max() == 0
    }

    /// How long the queue keeps this worker's threads busy.
    pub(crate) fn load(&self, queue: &Queue) -> Load {
        Duration::from_nanos(queue.cost(&self.costs) / u64::from(self.threads))
    }

    fn gift(&self, wanted: u64, queue: &mut Queue) -> Option<(Gift, u64)> {
        let before = queue.cost(&self.costs);
        let excess = before.checked_sub(self.kept_nanos())?;
        let least = self.costs.paths(PIECE_MIN);
        let gift = queue.pop_gift(excess.min(wanted.max(least)), &self.costs)?;
        Some((gift, before - queue.cost(&self.costs)))
    }

    /// What this worker keeps for itself, in nanoseconds of one thread.
    const fn kept_nanos(&self) -> u64 {
        LOW_WATER.as_nanos() as u64 * self.threads as u64
    }
}

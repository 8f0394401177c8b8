//! The receiving side of diffusion: rounds of asking the neighbors.
//!
//! One round at a time: find out everybody's load, ask each for its part. Loads are remembered, for
//! they are used up at a known speed: who had much a moment ago has much still, and who wanted work
//! has none. Only those of whom nothing is known are asked for their load, and nobody, if work can
//! be had of the others. After a round nobody is asked again before something has come of it: work
//! has arrived, or the neighbors are others. Who falls idle nevertheless leaves word with those
//! that do not know yet, once (a lifeline: Saraswat et al., *Lifeline-based global load balancing*,
//! 2011), and is silent.

use std::collections::{BTreeMap, BTreeSet};

use equilux_common::balancing::DiffusionStep;
use equilux_common::ids::WorkerId;
use equilux_common::message::Load;
use equilux_common::time::Time;

use crate::balance::diffusion::{self, Vertex};
use crate::balance::gift_min;
use crate::balance::marks::Marks;

/// What is known of a load is forgotten after so many low-water marks, that is, about as many
/// cycles: meanwhile the neighbor may have got work. But not if it had twice as much as it can have
/// used up since.
const MEMORY_MARKS: u32 = 24;

/// Capacity of a neighbor that has not said it: one thread of reference speed.
const CAPACITY_UNKNOWN: u64 = 1000;

/// Rounds of asking.
#[derive(Debug)]
pub(crate) struct Asking {
    step: DiffusionStep,
    marks: Marks,
    /// What neighbors had, and when.
    known: BTreeMap<WorkerId, (Time, Vertex)>,
    open: Option<Round>,
    round: u32,
    may_ask: bool,
    /// Who knows that work is wanted here, and has given none since.
    told: BTreeSet<WorkerId>,
}

/// A round that is not over.
#[derive(Debug)]
struct Round {
    /// Those whose load matters, with what is known of it so far.
    answers: BTreeMap<WorkerId, Option<Vertex>>,
    /// How many of them were asked for it.
    asked: usize,
}

impl Round {
    fn is_complete(&self) -> bool {
        self.answers.values().all(Option::is_some)
    }

    /// Whether half of those who were asked have answered: the others are late, and may not even
    /// have heard of the job.
    fn is_half_answered(&self) -> bool {
        let missing = self.answers.values().filter(|answer| answer.is_none()).count();
        missing * 2 <= self.asked
    }
}

impl Asking {
    /// Nobody has been asked yet.
    pub(crate) fn new(step: DiffusionStep) -> Self {
        Self {
            step,
            marks: Marks::default(),
            known: BTreeMap::new(),
            open: None,
            round: 0,
            may_ask: false,
            told: BTreeSet::new(),
        }
    }

    /// Something has changed for which it is worth asking (again).
    pub(crate) const fn encourage(&mut self) {
        self.may_ask = true;
    }

    /// How cycles of asking went.
    pub(crate) const fn marks(&self) -> &Marks {
        &self.marks
    }

    /// Begins a round if that may be; gives its number and who is to be asked for its load.
    pub(crate) fn begin(&mut self, now: Time, neighbors: &[WorkerId]) -> (u32, Vec<WorkerId>) {
        if !self.may_ask || self.open.is_some() || neighbors.is_empty() {
            return (self.round, Vec::new());
        }
        self.may_ask = false;
        self.round = self.round.wrapping_add(1);
        let known = neighbors.iter().map(|&neighbor| (neighbor, self.recall(now, neighbor)));
        let mut answers: BTreeMap<WorkerId, Option<Vertex>> = known.collect();
        if answers.values().flatten().any(|vertex| self.can_give(vertex)) {
            answers.retain(|_, vertex| vertex.is_some());
        }
        let unknown = answers.iter().filter(|(_, vertex)| vertex.is_none());
        let asked: Vec<WorkerId> = unknown.map(|(&neighbor, _)| neighbor).collect();
        if !asked.is_empty() {
            self.marks.ask(now);
        }
        self.open = Some(Round { answers, asked: asked.len() });
        (self.round, asked)
    }

    /// A neighbor wants work: it has none.
    pub(crate) fn hear_want(&mut self, now: Time, peer: WorkerId) {
        let capacity = self.known.get(&peer).map_or(CAPACITY_UNKNOWN, |(_, known)| known.capacity);
        self.known.insert(peer, (now, Vertex { load: Load::ZERO, capacity }));
    }

    /// A neighbor answered.
    pub(crate) fn answer(&mut self, now: Time, peer: WorkerId, round: u32, vertex: Vertex) {
        self.known.insert(peer, (now, vertex));
        let Some(open) = self.open.as_mut().filter(|_| round == self.round) else { return };
        if let Some(answer) = open.answers.get_mut(&peer) {
            *answer = Some(vertex);
        }
        if open.is_half_answered() {
            self.marks.answer(now);
        }
    }

    /// A neighbor gave something.
    pub(crate) fn receive(&mut self, now: Time, peer: WorkerId) {
        self.marks.receive(now);
        self.told.remove(&peer);
        // Who had nothing and gives has got work since; nobody knows how much.
        if self.known.get(&peer).is_some_and(|(_, vertex)| vertex.load.is_zero()) {
            self.known.remove(&peer);
        }
    }

    /// A neighbor was given something, and forgets what was wanted here.
    pub(crate) fn give(&mut self, peer: WorkerId) {
        self.told.remove(&peer);
    }

    /// A neighbor will not answer any more.
    pub(crate) fn forget(&mut self, peer: WorkerId) {
        self.known.remove(&peer);
        self.told.remove(&peer);
        if let Some(open) = &mut self.open {
            open.answers.remove(&peer);
        }
    }

    /// Ends the round if all have answered, or half have and this worker has nothing left to do
    /// while it waits for the others: how much to ask of whom, as time of a reference thread.
    pub(crate) fn conclude(&mut self, now: Time, own: Vertex) -> Vec<(WorkerId, Load)> {
        let is_over = |open: &Round| {
            let can_give = || open.answers.values().flatten().any(|vertex| self.can_give(vertex));
            let is_urgent = own.load.is_zero();
            open.is_complete() || is_urgent && open.is_half_answered() && can_give()
        };
        if !self.open.as_ref().is_some_and(is_over) {
            return Vec::new();
        }
        let answers = self.open.take().map_or_else(BTreeMap::new, |open| open.answers);
        let part = |vertex: Vertex| {
            if self.can_give(&vertex) { vertex } else { Vertex { load: Load::ZERO, ..vertex } }
        };
        let (neighbors, vertices): (Vec<WorkerId>, Vec<Vertex>) =
            answers.into_iter().filter_map(|(peer, vertex)| Some((peer, part(vertex?)))).unzip();
        let flows = diffusion::flows(self.step, own, &vertices);
        let least = gift_min(self.marks.low_water());
        let flows = diffusion::consolidate(own, &vertices, &flows, least);
        let amounts = neighbors.into_iter().zip(flows);
        let amounts: Vec<_> = amounts.filter(|(_, amount)| !amount.is_zero()).collect();
        for &(peer, amount) in &amounts {
            self.expect(peer, amount);
        }
        if !amounts.is_empty() {
            self.marks.request(now);
        }
        amounts
    }

    /// Who of the neighbors does not know yet that this worker is idle; from now on they do.
    /// While a round is open that is only as soon as half have answered, and only those who have: a
    /// neighbor that is silent must not keep this worker from the others.
    pub(crate) fn leave_word(&mut self, neighbors: &[WorkerId]) -> Vec<WorkerId> {
        let has_answered = |neighbor: &WorkerId| match &self.open {
            None => true,
            Some(open) => {
                open.is_half_answered() && matches!(open.answers.get(neighbor), Some(Some(_)))
            }
        };
        let mut untold: Vec<_> = neighbors.iter().copied().filter(has_answered).collect();
        untold.retain(|&neighbor| self.told.insert(neighbor));
        untold
    }

    /// Whether no answer is awaited.
    pub(crate) const fn is_quiet(&self) -> bool {
        self.open.is_none()
    }

    /// What a neighbor should have by now, if that can be told: what it had, less what it has done
    /// since.
    fn recall(&self, now: Time, neighbor: WorkerId) -> Option<Vertex> {
        let &(since, vertex) = self.known.get(&neighbor)?;
        let age = now.since(since);
        let load = vertex.load.saturating_sub(age);
        let is_certain = age <= self.marks.low_water() * MEMORY_MARKS || load >= age;
        is_certain.then_some(Vertex { load, ..vertex })
    }

    /// Whether somebody has something left beyond what it needs until its own next cycle, which
    /// will be about as long as those here.
    fn can_give(&self, vertex: &Vertex) -> bool {
        let low_water = self.marks.low_water();
        vertex.load > low_water + gift_min(low_water)
    }

    /// So much is asked of a neighbor; it will not have that any more.
    fn expect(&mut self, peer: WorkerId, amount: Load) {
        self.told.insert(peer);
        if let Some((_, vertex)) = self.known.get_mut(&peer) {
            let part = amount.mul_f64(1000.0 / vertex.capacity.max(1) as f64);
            vertex.load = vertex.load.saturating_sub(part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    const NEIGHBORS: [WorkerId; 2] = [WorkerId(4), WorkerId(7)];

    fn seconds(seconds: u64) -> Load {
        Load::from_secs(seconds)
    }

    fn has(load: u64) -> Vertex {
        Vertex { load: seconds(load), capacity: 1000 }
    }

    fn asks(asking: &mut Asking, now: Time) -> Vec<WorkerId> {
        asking.encourage();
        asking.begin(now, &NEIGHBORS).1
    }

    #[test]
    fn each_is_asked_for_its_part_once_all_have_answered() {
        let mut asking = Asking::new(DiffusionStep::Explicit);
        let (now, nothing, little) = (Time::ZERO, has(0), has(3));
        assert!(asking.begin(now, &NEIGHBORS).1.is_empty(), "nothing has happened yet");
        asking.encourage();
        let (round, asked) = asking.begin(now, &NEIGHBORS);
        assert_eq!(asked, NEIGHBORS);
        asking.answer(now, WorkerId(4), round, has(30));
        asking.answer(now, WorkerId(7), round + 1, has(90));
        assert!(asking.conclude(now, little).is_empty(), "one answer is of another round");
        asking.answer(now, WorkerId(7), round, nothing);
        assert_eq!(asking.conclude(now, nothing), [(WorkerId(4), seconds(15))]);
        assert!(asking.begin(now, &NEIGHBORS).1.is_empty(), "nothing has come of it yet");
        assert_eq!(asking.leave_word(&NEIGHBORS), [WorkerId(7)], "the other one knows");
        assert!(asking.leave_word(&NEIGHBORS).is_empty(), "now both do");
        asking.receive(now, WorkerId(4));
        assert_eq!(asking.leave_word(&NEIGHBORS), [WorkerId(4)], "it has forgotten");
    }

    #[test]
    fn who_has_nothing_left_does_not_wait_for_the_last_answers() {
        let mut asking = Asking::new(DiffusionStep::Explicit);
        let (start, late) = (Time::ZERO, Time::ZERO + seconds(1));
        asks(&mut asking, start);
        asking.answer(start + Duration::from_micros(160), WorkerId(4), 1, has(30));
        assert!(asking.conclude(late, has(1)).is_empty(), "there is time");
        assert_eq!(asking.conclude(late, has(0))[0].0, WorkerId(4));
        asking.answer(late, WorkerId(7), 1, has(90));
        assert!(asking.conclude(late, has(0)).is_empty(), "the round is over");
        assert_eq!(asking.marks().low_water(), Duration::from_micros(400), "5 ∕ 4 of two trips");
        assert!(asks(&mut asking, late).is_empty(), "what came late is known all the same");
        assert_eq!(asking.conclude(late, has(0))[0].0, WorkerId(7));
    }

    #[test]
    fn loads_are_remembered_while_they_can_be_relied_on() {
        let mut asking = Asking::new(DiffusionStep::Explicit);
        let (start, nothing) = (Time::ZERO, has(0));
        assert_eq!(asks(&mut asking, start), NEIGHBORS);
        asking.answer(start, WorkerId(4), 1, has(90));
        asking.hear_want(start, WorkerId(7));
        asking.answer(start, WorkerId(7), 1, nothing);
        assert_eq!(asking.conclude(start, nothing), [(WorkerId(4), seconds(45))]);
        let later = start + seconds(20);
        assert!(asks(&mut asking, later).is_empty(), "one still has much, and that is enough");
        let half = (90 - 45 - 20) * seconds(1) / 2;
        assert_eq!(asking.conclude(later, nothing), [(WorkerId(4), half)]);
        let soon = later + Duration::from_micros(1);
        asking.hear_want(soon, WorkerId(4));
        asking.hear_want(soon, WorkerId(7));
        assert!(asks(&mut asking, soon).is_empty(), "both have just said that they have nothing");
        assert!(asking.conclude(soon, nothing).is_empty());
        assert_eq!(asks(&mut asking, soon + seconds(1)), NEIGHBORS, "they may have got some");
    }

    #[test]
    fn who_comes_away_empty_leaves_word_with_all_and_is_silent() {
        let mut asking = Asking::new(DiffusionStep::Implicit);
        asking.encourage();
        let (round, _) = asking.begin(Time::ZERO, &NEIGHBORS);
        assert!(asking.leave_word(&NEIGHBORS).is_empty(), "answers are awaited");
        asking.answer(Time::ZERO, WorkerId(4), round, has(0));
        asking.forget(WorkerId(7));
        assert!(asking.conclude(Time::ZERO, has(0)).is_empty());
        assert!(asking.is_quiet() && asking.begin(Time::ZERO, &NEIGHBORS).1.is_empty());
        assert_eq!(asking.leave_word(&NEIGHBORS), NEIGHBORS);
        assert!(asking.leave_word(&NEIGHBORS).is_empty());
    }
}

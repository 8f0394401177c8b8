//! The pieces that are out: handed to compute threads and not come back.
//!
//! Of a piece it is known what it was expected to take, by the means of what is in it, and since
//! when a thread has been at it, for threads take pieces in the order in which they are handed out.
//! One that takes longer than expected is of an unknown kind, and the best guess is that it goes on
//! for as long again as it has already: so durations without a scale behave, and the guess grows
//! with what is seen. So nobody has to wait for a long piece because all before were short.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::time::Time;

use crate::cost::Kind;

/// A piece on a compute thread, numbered in the order of handing out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct PieceId(pub u64);

/// So many times what was expected a piece may take before threads are interrupted for it: paths
/// differ, and what is only their noise would soon be over.
const SURPRISE: u32 = 2;

/// What is in a piece.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Content {
    /// Of what kind its paths or rays are.
    pub(crate) kind: Kind,
    /// How many they are.
    pub(crate) count: u64,
    /// How long they should take a thread.
    pub(crate) expected: Duration,
}

#[derive(Debug)]
struct Piece {
    content: Content,
    /// When a thread began it.
    since: Option<Time>,
    /// Whether its thread has been told to give up the rest of it.
    is_interrupted: bool,
}

/// The pieces that are out.
#[derive(Debug)]
pub(crate) struct Pieces {
    threads: u32,
    next: u64,
    out: BTreeMap<PieceId, Piece>,
}

impl Pieces {
    /// None is out; so many threads will take them.
    pub(crate) const fn new(threads: u32) -> Self {
        Self { threads, next: 0, out: BTreeMap::new() }
    }

    /// A piece is handed out.
    pub(crate) fn begin(&mut self, now: Time, content: Content) -> PieceId {
        let id = PieceId(self.next);
        self.next += 1;
        let since = (self.count() < self.threads).then_some(now);
        self.out.insert(id, Piece { content, since, is_interrupted: false });
        id
    }

    /// A piece has come back, and its thread takes up the next one; says what it was, and whether
    /// its thread had been told to give up the rest of it.
    pub(crate) fn end(&mut self, now: Time, id: PieceId) -> (Content, bool) {
        let piece = self.out.remove(&id).expect("a piece was handed out before");
        if let Some(next) = self.out.values_mut().find(|piece| piece.since.is_none()) {
            next.since = Some(now);
        }
        (piece.content, piece.is_interrupted)
    }

    /// The oldest one that is out.
    pub(crate) fn oldest(&self) -> Option<PieceId> {
        self.out.first_key_value().map(|(&id, _)| id)
    }

    /// What the next one will be.
    pub(crate) const fn next(&self) -> PieceId {
        PieceId(self.next)
    }

    /// How many threads take them.
    pub(crate) const fn thread_count(&self) -> u32 {
        self.threads
    }

    /// How many are out.
    pub(crate) fn count(&self) -> u32 {
        u32::try_from(self.out.len()).expect("a few for each thread")
    }

    /// How long all together were expected to take, each of them counted up to `most`: one that is
    /// long keeps one thread busy, not all.
    pub(crate) fn expected(&self, most: Duration) -> Duration {
        self.out.values().map(|piece| piece.content.expected.min(most)).sum()
    }

    /// How long threads will be busy beyond what is `usual`, each counted up to `most`.
    pub(crate) fn delay(&self, now: Time, usual: Duration, most: Duration) -> Duration {
        self.out.values().map(|piece| piece.left(now).saturating_sub(usual).min(most)).sum()
    }

    /// When interrupting the threads becomes worthwhile: when some piece that has not been
    /// interrupted yet turns out to go on for longer than `least`. Those that take what was
    /// expected count only if it is news that somebody waits.
    pub(crate) fn interrupt_time(&self, now: Time, least: Duration, is_news: bool) -> Option<Time> {
        let pieces = self.out.values().filter(|piece| !piece.is_interrupted);
        pieces.filter_map(|piece| piece.interrupt_time(now, least, is_news)).min()
    }

    /// Threads are told to give up what they have not begun of all that is out.
    pub(crate) fn interrupt(&mut self) {
        self.out.values_mut().for_each(|piece| piece.is_interrupted = true);
    }
}

impl Piece {
    /// How long it will still take, as far as can be told.
    fn left(&self, now: Time) -> Duration {
        let expected = self.content.expected;
        let Some(since) = self.since else { return expected };
        let elapsed = now.since(since);
        expected.checked_sub(elapsed).unwrap_or(elapsed)
    }

    fn interrupt_time(&self, now: Time, least: Duration, is_news: bool) -> Option<Time> {
        let since = self.since?;
        let expected = self.content.expected;
        let is_long = now.since(since) < expected && self.left(now) > least;
        if is_news && is_long && self.content.count > 1 {
            return Some(now);
        }
        Some(since + (expected * SURPRISE).max(least))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn content(count: u64, millis: u32) -> Content {
        Content { kind: Kind::Rays, count, expected: MS * millis }
    }

    fn left(pieces: &Pieces, millis: u32) -> Duration {
        pieces.delay(at(millis), Duration::ZERO, Duration::MAX)
    }

    fn at(millis: u32) -> Time {
        Time::ZERO + MS * millis
    }

    #[test]
    fn a_piece_that_overruns_is_taken_to_go_on_for_as_long_again() {
        let mut pieces = Pieces::new(1);
        pieces.begin(at(0), content(8, 4));
        let left = [0, 3, 5, 20].map(|millis| left(&pieces, millis));
        assert_eq!(left, [4, 1, 5, 20].map(|millis| MS * millis));
    }

    #[test]
    fn threads_take_pieces_up_in_order() {
        let mut pieces = Pieces::new(2);
        let ids = [3, 5, 7].map(|millis| pieces.begin(at(0), content(8, millis)));
        assert_eq!((pieces.count(), pieces.expected(Duration::MAX)), (3, MS * 15));
        assert_eq!(pieces.end(at(2), ids[1]).0.expected, MS * 5);
        assert_eq!(pieces.expected(MS * 2), MS * 4, "each up to two");
        assert_eq!(pieces.delay(at(4), MS, MS * 3), MS * 6, "two threads, each up to three");
        assert_eq!(left(&pieces, 4), (4 + 5) * MS, "one overruns, the third runs for 2 ms");
        pieces.end(at(4), ids[0]);
        assert_eq!(left(&pieces, 4), 5 * MS);
    }

    #[test]
    fn threads_are_interrupted_for_what_is_known_to_last_or_found_to() {
        let mut pieces = Pieces::new(1);
        let first = pieces.begin(at(0), content(8, 4));
        let second = pieces.begin(at(0), content(8, 90));
        assert_eq!(pieces.interrupt_time(at(1), MS, true), Some(at(1)));
        assert_eq!(pieces.interrupt_time(at(1), MS, false), Some(at(8)), "twice its time");
        assert_eq!(pieces.interrupt_time(at(1), MS * 3, true), Some(at(8)), "little is left");
        assert_eq!(pieces.interrupt_time(at(1), MS * 20, true), Some(at(20)));
        pieces.interrupt();
        assert_eq!(pieces.interrupt_time(at(9), MS, true), None, "it has been told");
        pieces.end(at(9), first);
        assert_eq!(pieces.interrupt_time(at(9), MS, true), None, "the next one has been told too");
        pieces.begin(at(9), content(8, 90));
        pieces.end(at(9), second);
        assert_eq!(pieces.interrupt_time(at(9), MS, true), Some(at(9)), "the last one has not");
        let mut pieces = Pieces::new(1);
        pieces.begin(at(0), content(1, 4));
        assert_eq!(pieces.interrupt_time(at(1), MS, true), Some(at(8)), "one path is not shared");
    }
}

//! How a scene's pack spreads: in pieces, along two trees of workers.
//!
//! Pieces with even numbers go down one binary tree over all workers, those with odd numbers down
//! another, in which the inner workers of the first are leaves. So every worker's link brings the
//! pack once and takes it away at most once, the coordinator's takes it away once, and what many
//! workers add to the time is a piece or three for each level of a tree:
//! Sanders, Speck, Träff, *Two-tree algorithms for full bandwidth broadcast, reduction and scan*,
//! 2009.
//!
//! Here is the plan alone; who fetches, passes on and believes what is up to the worker's edge.

use std::ops::Range;

use crate::message::PeerAddress;

/// Most bytes of a piece: some hundred times what a message costs in time, yet far less than a pack
/// that takes long.
pub const PIECE_BYTES_MAX: u64 = 256 << 10;

/// Fewest bytes of a piece, but for the last: smaller ones cost more in messages than they win.
pub const PIECE_BYTES_MIN: u64 = 8 << 10;

/// Pieces that keep all levels of the trees of a thousand workers busy.
const PIECES_WANTED: u64 = 128;

/// One of the two trees, named for the numbers of the pieces that go down it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tree {
    /// Pieces 0, 2, 4, ….
    Even,
    /// Pieces 1, 3, 5, ….
    Odd,
}

/// Whom a worker asks for the pieces of each tree, in the order of [`Tree::ALL`]; none: the
/// coordinator.
pub type PackSources = [Option<PeerAddress>; 2];

impl Tree {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Even, Self::Odd];

    /// Its place in [`Self::ALL`], and the number of its first piece.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// From whom the worker in place `position` of `count` has the pieces of this tree; none for
    /// the root, which has them from the coordinator.
    #[must_use]
    pub const fn parent(self, position: usize, count: usize) -> Option<usize> {
        let place = self.place(position, count);
        let root = 1 << count.ilog2();
        if place == root {
            return None;
        }
        let mut above = above(place);
        while above > count {
            above = self::above(above);
        }
        Some(self.position(above, count))
    }

    /// The place in the tree, counted from 1 from left to right, of a worker. Odd places are
    /// leaves, so the other tree is this one turned round, or moved by one where turning round
    /// leaves odd places odd.
    const fn place(self, position: usize, count: usize) -> usize {
        match self {
            Self::Even => position + 1,
            Self::Odd if count.is_multiple_of(2) => count - position,
            Self::Odd => (position + 1) % count + 1,
        }
    }

    /// The worker in a place.
    const fn position(self, place: usize, count: usize) -> usize {
        match self {
            Self::Even => place - 1,
            Self::Odd if count.is_multiple_of(2) => count - place,
            Self::Odd => (place + count - 2) % count,
        }
    }
}

/// The place above, in a tree without end: on each level, places are odd multiples of a power of
/// two, and above a pair of neighbors is what lies between them.
const fn above(place: usize) -> usize {
    let level = place & place.wrapping_neg();
    (place ^ level) | (level << 1)
}

/// How a pack is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pieces {
    pack_bytes: u64,
    piece_bytes: u64,
}

impl Pieces {
    /// The pieces of a pack of that size: the same wherever it is.
    #[must_use]
    pub fn of(pack_bytes: u64) -> Self {
        let piece_bytes = (pack_bytes / PIECES_WANTED).clamp(PIECE_BYTES_MIN, PIECE_BYTES_MAX);
        Self { pack_bytes, piece_bytes }
    }

    /// Bytes of the pack.
    #[must_use]
    pub const fn pack_bytes(&self) -> u64 {
        self.pack_bytes
    }

    /// How many go down a tree.
    #[must_use]
    pub const fn count(&self, tree: Tree) -> u64 {
        let all = self.pack_bytes.div_ceil(self.piece_bytes);
        (all + 1 - tree.index() as u64) / 2
    }

    /// Where in the pack the `index`-th piece of a tree lies; none beyond the last.
    #[must_use]
    pub fn range(&self, tree: Tree, index: u64) -> Option<Range<u64>> {
        let number = index.checked_mul(2)?.checked_add(tree.index() as u64)?;
        let start = number.checked_mul(self.piece_bytes).filter(|&at| at < self.pack_bytes)?;
        Some(start..self.pack_bytes.min(start + self.piece_bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn children(tree: Tree, count: usize) -> Vec<usize> {
        let mut children = vec![0; count];
        for parent in (0..count).filter_map(|position| tree.parent(position, count)) {
            children[parent] += 1;
        }
        children
    }

    fn depth(tree: Tree, position: usize, count: usize) -> u32 {
        let up = |&at: &usize| tree.parent(at, count);
        std::iter::successors(Some(position), up).take(count + 1).count() as u32 - 1
    }

    fn check(count: usize) {
        for tree in Tree::ALL {
            let roots = (0..count).filter(|&position| tree.parent(position, count).is_none());
            assert_eq!(roots.count(), 1, "{tree:?} of {count}");
            for position in 0..count {
                assert!(depth(tree, position, count) <= count.ilog2(), "{position} of {count}");
            }
        }
        let [even, odd] = Tree::ALL.map(|tree| children(tree, count));
        for (even, odd) in even.into_iter().zip(odd) {
            assert!(even.max(odd) <= 2 && even.min(odd) == 0, "{even} and {odd} of {count}");
        }
    }

    #[test]
    fn trees_reach_everybody_in_few_steps_and_who_passes_on_in_one_is_a_leaf_of_the_other() {
        (1..300).chain([511, 512, 513, 1023, 1024, 1025, 4096]).for_each(check);
    }

    proptest! {
        #[test]
        fn of_any_number_of_workers(count in 1usize..5000) {
            check(count);
        }

        #[test]
        fn pieces_cover_a_pack_once(pack_bytes in prop_oneof![0..70_000u64, 0..1u64 << 30]) {
            let pieces = Pieces::of(pack_bytes);
            let of_tree = |tree| {
                (0..pieces.count(tree)).map(move |index| pieces.range(tree, index).expect("there"))
            };
            let mut ranges: Vec<_> = Tree::ALL.into_iter().flat_map(of_tree).collect();
            ranges.sort_unstable_by_key(|range| range.start);
            let mut end = 0;
            for range in ranges {
                prop_assert_eq!(range.start, end);
                prop_assert!(range.end > end && range.end - end <= PIECE_BYTES_MAX);
                end = range.end;
            }
            prop_assert_eq!(end, pack_bytes);
            for tree in Tree::ALL {
                for beyond in [pieces.count(tree), u64::MAX] {
                    prop_assert_eq!(pieces.range(tree, beyond), None);
                }
            }
        }
    }
}

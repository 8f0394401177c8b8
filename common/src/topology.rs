//! Who exchanges load with whom.

use std::str::FromStr;

/// The graph along whose edges load flows. Workers are its vertices, numbered from 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Topology {
    /// Everybody with everybody.
    Complete,
    /// Each with its predecessor and successor.
    Ring,
    /// A grid of two dimensions that wraps around, as square as the number allows.
    Torus2d,
    /// A grid of three dimensions that wraps around, as cubic as the number allows.
    Torus3d,
    /// Numbers that differ in one bit. For other counts than powers of two, the edges that exist,
    /// which still connect everybody (clearing bits from the top leads to 0).
    #[default]
    Hypercube,
}

/// A word that names no topology.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown topology `{0}`; one of complete, ring, torus2d, torus3d, hypercube is expected")]
pub struct UnknownTopology(String);

impl Topology {
    /// The word for it, on the command line and in messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Ring => "ring",
            Self::Torus2d => "torus2d",
            Self::Torus3d => "torus3d",
            Self::Hypercube => "hypercube",
        }
    }

    /// The neighbors of vertex `index` among `count`, ascending, without itself.
    #[must_use]
    pub fn neighbors(self, index: usize, count: usize) -> Vec<usize> {
        let mut found = match self {
            Self::Complete => (0..count).collect(),
            Self::Ring => torus(index, &[count]),
            Self::Torus2d => torus(index, &most_even_factors::<2>(count)),
            Self::Torus3d => torus(index, &most_even_factors::<3>(count)),
            Self::Hypercube => (0..usize::BITS)
                .map(|bit| index ^ (1 << bit))
                .filter(|&other| other < count)
                .collect(),
        };
        found.sort_unstable();
        found.dedup();
        found.retain(|&other| other != index);
        found
    }
}

impl FromStr for Topology {
    type Err = UnknownTopology;

    fn from_str(word: &str) -> Result<Self, Self::Err> {
        [Self::Complete, Self::Ring, Self::Torus2d, Self::Torus3d, Self::Hypercube]
            .into_iter()
            .find(|topology| topology.name() == word)
            .ok_or_else(|| UnknownTopology(word.into()))
    }
}

/// One step forth and one back along each dimension of a grid that wraps around.
fn torus(index: usize, sizes: &[usize]) -> Vec<usize> {
    let mut stride = 1;
    let mut found = Vec::new();
    for &size in sizes {
        let position = index / stride % size;
        for moved in [(position + 1) % size, (position + size - 1) % size] {
            found.push(index - position * stride + moved * stride);
        }
        stride *= size;
    }
    found
}

/// `count` as a product of `N` factors, as near to one another as it goes.
fn most_even_factors<const N: usize>(count: usize) -> [usize; N] {
    let mut factors = [1; N];
    let mut rest = count.max(1);
    for (position, factor) in factors.iter_mut().enumerate() {
        let dimensions = u32::try_from(N - position).expect("few dimensions");
        *factor = (1..=rest)
            .take_while(|side| side.saturating_pow(dimensions) <= rest)
            .filter(|side| rest.is_multiple_of(*side))
            .last()
            .unwrap_or(1);
        rest /= *factor;
    }
    factors[N - 1] *= rest;
    factors
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ALL: [Topology; 5] = [
        Topology::Complete,
        Topology::Ring,
        Topology::Torus2d,
        Topology::Torus3d,
        Topology::Hypercube,
    ];

    proptest! {
        #[test]
        fn edges_go_both_ways_and_connect_everybody(count in 1usize..200, which in 0..ALL.len()) {
            let topology = ALL[which];
            let mut reached = vec![false; count];
            let mut pending = vec![0];
            while let Some(index) = pending.pop() {
                if std::mem::replace(&mut reached[index], true) {
                    continue;
                }
                for other in topology.neighbors(index, count) {
                    prop_assert!(topology.neighbors(other, count).contains(&index));
                    pending.push(other);
                }
            }
            prop_assert!(reached.iter().all(|&is_reached| is_reached));
        }
    }

    #[test]
    fn a_torus_of_twelve_is_three_by_four() {
        assert_eq!(most_even_factors::<2>(12), [3, 4]);
        assert_eq!(most_even_factors::<3>(8), [2, 2, 2]);
        assert_eq!(Topology::Torus2d.neighbors(0, 12), [1, 2, 3, 9]);
        assert_eq!(Topology::Hypercube.neighbors(5, 8), [1, 4, 7]);
    }
}

//! Who exchanges load with whom.

use std::str::FromStr;
use std::sync::Arc;

/// The graph along whose edges load flows. Workers are its vertices, numbered from 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
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
    /// Any other.
    Graph(Arc<Graph>),
}

/// A graph of the user's own. Workers beyond its vertices hang on to them one after another, so
/// that whoever joins later finds a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Graph {
    /// Of each vertex, ascending.
    neighbors: Vec<Vec<usize>>,
}

/// Most vertices of a graph.
pub const GRAPH_VERTICES_MAX: usize = 1 << 16;

/// Most edges of a graph.
pub const GRAPH_EDGES_MAX: usize = 1 << 20;

/// Edges that make no graph along which work can reach everybody.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidGraph {
    /// Not two numbers.
    #[error("line {line}: `{text}` is not an edge; write the numbers of two workers, as in `0 1`")]
    Line {
        /// Which, from 1.
        line: usize,
        /// What it says.
        text: String,
    },
    /// Too large a number.
    #[error("vertex {0} is beyond the largest, {max}", max = GRAPH_VERTICES_MAX - 1)]
    Vertex(usize),
    /// Too many.
    #[error("there are {0} edges; at most {GRAPH_EDGES_MAX} are allowed")]
    TooMany(usize),
    /// None.
    #[error("there are no edges; write one a line, as in `0 1`")]
    Empty,
    /// Nobody could bring work there.
    #[error("no way leads from vertex 0 to vertex {0}; add an edge")]
    Unconnected(usize),
}

impl Graph {
    /// The graph of these edges between vertices that are numbered from 0.
    ///
    /// # Errors
    /// If there are none or too many, or some vertex cannot be reached from another.
    pub fn new(edges: &[[usize; 2]]) -> Result<Self, InvalidGraph> {
        if edges.len() > GRAPH_EDGES_MAX {
            return Err(InvalidGraph::TooMany(edges.len()));
        }
        let last = edges.iter().flatten().copied().max().ok_or(InvalidGraph::Empty)?;
        if last >= GRAPH_VERTICES_MAX {
            return Err(InvalidGraph::Vertex(last));
        }
        let mut neighbors = vec![Vec::new(); last + 1];
        for &[a, b] in edges {
            neighbors[a].push(b);
            neighbors[b].push(a);
        }
        let graph = Self { neighbors };
        match graph.unreached() {
            Some(vertex) => Err(InvalidGraph::Unconnected(vertex)),
            None => Ok(graph),
        }
    }

    /// Reads an edge a line, as two numbers; what follows a `#` is a comment.
    ///
    /// # Errors
    /// Names the first line that is no edge; otherwise as for [`Self::new`].
    pub fn parse(text: &str) -> Result<Self, InvalidGraph> {
        let mut edges = Vec::new();
        for (index, line) in text.lines().enumerate() {
            let edge = line.split('#').next().unwrap_or_default().trim();
            if !edge.is_empty() {
                let invalid = || InvalidGraph::Line { line: index + 1, text: line.into() };
                edges.push(parse_edge(edge).ok_or_else(invalid)?);
            }
        }
        Self::new(&edges)
    }

    /// Every edge once, the smaller vertex first.
    #[must_use]
    pub fn edges(&self) -> Vec<[usize; 2]> {
        let mut edges = Vec::new();
        for (a, neighbors) in self.neighbors.iter().enumerate() {
            edges.extend(neighbors.iter().filter(|&&b| b >= a).map(|&b| [a, b]));
        }
        edges.sort_unstable();
        edges.dedup();
        edges
    }

    fn neighbors(&self, index: usize, count: usize) -> Vec<usize> {
        let vertices = self.neighbors.len();
        let own = self.neighbors.get(index).into_iter().flatten().copied();
        let before = index.checked_sub(vertices);
        let after = Some(index + vertices);
        // Where workers are missing in the middle of the graph, a ring keeps the others together.
        let ring = if count < vertices { torus(index, &[count]) } else { Vec::new() };
        own.chain(before).chain(after).chain(ring).filter(|&other| other < count).collect()
    }

    fn unreached(&self) -> Option<usize> {
        let mut is_reached = vec![false; self.neighbors.len()];
        let mut pending = vec![0];
        while let Some(vertex) = pending.pop() {
            if !std::mem::replace(&mut is_reached[vertex], true) {
                pending.extend(&self.neighbors[vertex]);
            }
        }
        is_reached.iter().position(|is_reached| !is_reached)
    }
}

fn parse_edge(text: &str) -> Option<[usize; 2]> {
    let mut numbers = text.split_whitespace().map(str::parse);
    match (numbers.next(), numbers.next(), numbers.next()) {
        (Some(Ok(a)), Some(Ok(b)), None) => Some([a, b]),
        _ => None,
    }
}

/// A word that names no topology.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown topology `{0}`; one of complete, ring, torus2d, torus3d, hypercube is expected")]
pub struct UnknownTopology(String);

impl Topology {
    /// The word for it, on the command line and in messages.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Ring => "ring",
            Self::Torus2d => "torus2d",
            Self::Torus3d => "torus3d",
            Self::Hypercube => "hypercube",
            Self::Graph(_) => "graph",
        }
    }

    /// The neighbors of vertex `index` among `count`, ascending, without itself.
    #[must_use]
    pub fn neighbors(&self, index: usize, count: usize) -> Vec<usize> {
        let mut found = match self {
            Self::Complete => (0..count).collect(),
            Self::Ring => torus(index, &[count]),
            Self::Torus2d => torus(index, &most_even_factors::<2>(count)),
            Self::Torus3d => torus(index, &most_even_factors::<3>(count)),
            Self::Hypercube => (0..usize::BITS)
                .map(|bit| index ^ (1 << bit))
                .filter(|&other| other < count)
                .collect(),
            Self::Graph(graph) => graph.neighbors(index, count),
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

    /// How many a way leads to from the first, all edges being there from both ends.
    fn reached(topology: &Topology, count: usize) -> usize {
        let mut is_reached = vec![false; count];
        let mut pending = vec![0];
        while let Some(index) = pending.pop() {
            if std::mem::replace(&mut is_reached[index], true) {
                continue;
            }
            for other in topology.neighbors(index, count) {
                assert!(topology.neighbors(other, count).contains(&index), "{index} to {other}");
                pending.push(other);
            }
        }
        is_reached.into_iter().filter(|&is_reached| is_reached).count()
    }

    proptest! {
        #[test]
        fn edges_go_both_ways_and_connect_everybody(count in 1usize..200, which in 0..ALL.len()) {
            let topology = &ALL[which];
            prop_assert_eq!(reached(topology, count), count);
        }
    }

    proptest! {
        #[test]
        fn on_a_graph_of_the_user_too(
            count in 1usize..40, parents in prop::collection::vec(any::<prop::sample::Index>(), 1..30),
        ) {
            let tree = |(index, parent): (usize, &prop::sample::Index)| {
                [parent.index(index + 1), index + 1]
            };
            let edges: Vec<_> = parents.iter().enumerate().map(tree).collect();
            let graph = Graph::new(&edges).expect("a tree");
            prop_assert_eq!(Graph::new(&graph.edges()).expect("the same"), graph.clone());
            let topology = Topology::Graph(Arc::new(graph));
            prop_assert_eq!(reached(&topology, count), count);
        }
    }

    #[test]
    fn a_file_of_edges_is_read_and_its_mistakes_are_named() {
        let graph = Graph::parse("0 1 # a comment\n\n 2 1\n").expect("a chain");
        assert_eq!(graph.edges(), [[0, 1], [1, 2]]);
        let mistake = |text| Graph::parse(text).expect_err("a mistake").to_string();
        assert!(mistake("0 1\n1 x").starts_with("line 2: `1 x` is not an edge"));
        assert!(mistake("0 1\n2 3").contains("from vertex 0 to vertex 2"));
        assert!(mistake("# nothing").contains("no edges"));
        assert!(mistake("0 99999999").contains("beyond the largest, 65535"));
    }

    #[test]
    fn a_torus_of_twelve_is_three_by_four() {
        assert_eq!(most_even_factors::<2>(12), [3, 4]);
        assert_eq!(most_even_factors::<3>(8), [2, 2, 2]);
        assert_eq!(Topology::Torus2d.neighbors(0, 12), [1, 2, 3, 9]);
        assert_eq!(Topology::Hypercube.neighbors(5, 8), [1, 4, 7]);
    }
}

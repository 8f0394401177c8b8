//! The diffusion step: how much work should flow to a worker along each of its edges.
//!
//! Loads are temperatures, workers the vertices of a graph, their capacities its heat capacities,
//! and work flows along an edge from the hotter end to the colder one. The receiver solves the step
//! on the star of itself and its neighbors, and takes its part of it: what flows in.
//!
//! - *Explicit*, of first order (Cybenko, *Dynamic load balancing for distributed memory
//!   multiprocessors*, 1989; for unequal vertices Elsässer, Monien & Preis, *Diffusion schemes for
//!   load balancing on heterogeneous networks*, 2002). On a complete graph one step reaches the
//!   common load; on a regular one it is that with diffusivity 1/(d + 1) at degree d.
//! - *Implicit*, u′ − α∇²u′ = u (Heirich & Taylor, *A parabolic load balancing method*, 1995),
//!   stable for every diffusivity.

use std::time::Duration;

use equilux_common::balancing::DiffusionStep;
use equilux_common::message::Load;

/// α of the implicit step: an edge carries in one step what would even out its ends halfway, were
/// there no others.
const DIFFUSIVITY: f64 = 1.0;

/// A worker as balancing sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Vertex {
    /// How long what waits keeps it busy.
    pub(crate) load: Load,
    /// What it computes at a time, in thousandths of a reference thread.
    pub(crate) capacity: u64,
}

impl Vertex {
    fn seconds(&self) -> f64 {
        self.load.as_secs_f64()
    }

    /// In reference threads.
    fn threads(&self) -> f64 {
        self.capacity.max(1) as f64 / 1000.0
    }

    /// What would have to flow in from another vertex to even the two out.
    fn evening_out(&self, other: &Self) -> Load {
        let joint = self.threads() * other.threads() / (self.threads() + other.threads());
        Duration::from_secs_f64(joint * (other.seconds() - self.seconds()).max(0.0))
    }

    /// Waiting work, as time of a reference thread.
    fn work(&self) -> f64 {
        self.seconds() * self.threads()
    }
}

/// What each neighbor should give, as time of a reference thread, in the neighbors' order. Never
/// more than the neighbor has; never so much in all that the receiver ends above the highest of
/// them.
#[must_use]
pub(crate) fn flows(step: DiffusionStep, own: Vertex, neighbors: &[Vertex]) -> Vec<Load> {
    let flows = match step {
        DiffusionStep::Explicit => explicit(own, neighbors),
        DiffusionStep::Implicit => implicit(DIFFUSIVITY, own, neighbors),
    };
    let within = |(flow, neighbor): (f64, &Vertex)| {
        let flow = flow.min(neighbor.work()).max(0.0) * 1e9;
        Duration::from_nanos(flow as u64)
    };
    flows.into_iter().zip(neighbors).map(within).collect()
}

/// The same amount in as few parts as possible, each at least `least`: all that the flows would
/// bring is asked of those with the largest, but of none more than what evens it out with the
/// receiver; of the first just that, even if it is more than all flows, so that the next step is
/// the farther off. For every part is a message, and tears a unit whose film values then come home
/// in parts, too.
#[must_use]
pub(crate) fn consolidate(
    own: Vertex,
    neighbors: &[Vertex],
    flows: &[Load],
    least: Load,
) -> Vec<Load> {
    let mut largest_first: Vec<usize> = (0..flows.len()).collect();
    largest_first.sort_by_key(|&index| std::cmp::Reverse(flows[index]));
    let first = largest_first.first().map(|&index| own.evening_out(&neighbors[index]));
    let mut wanted = flows.iter().sum::<Load>().max(first.unwrap_or_default());
    let mut parts = vec![Load::ZERO; flows.len()];
    for index in largest_first {
        let part = wanted.min(own.evening_out(&neighbors[index]));
        if !flows[index].is_zero() && part >= least {
            parts[index] = part;
            wanted -= part;
        }
    }
    parts
}

/// cᵢ cⱼ (Lⱼ − Lᵢ)⁺ ∕ Σ c, the sum over the receiver i and all its neighbors.
fn explicit(own: Vertex, neighbors: &[Vertex]) -> Vec<f64> {
    let sum = own.threads() + neighbors.iter().map(Vertex::threads).sum::<f64>();
    let excess = |other: &Vertex| other.threads() * (other.seconds() - own.seconds()).max(0.0);
    neighbors.iter().map(|other| excess(other) * (own.threads() / sum)).collect()
}

/// The exact solution on the star, of whose edges those count that carry something inward.
///
/// Over an edge of conductance κ flows κ (u′ⱼ − u′ᵢ) = cⱼ (uⱼ − u′ⱼ), that is, g (uⱼ − u′ᵢ) with
/// g = κ cⱼ ∕ (κ + cⱼ). So cᵢ (u′ᵢ − uᵢ) = Σ g (uⱼ − u′ᵢ), which gives u′ᵢ.
fn implicit(diffusivity: f64, own: Vertex, neighbors: &[Vertex]) -> Vec<f64> {
    let edge = |other: &Vertex| {
        let ends = own.threads() + other.threads();
        let conductance = diffusivity * 2.0 * own.threads() * other.threads() / ends;
        conductance * other.threads() / (conductance + other.threads())
    };
    let mut hottest_first: Vec<&Vertex> = neighbors.iter().collect();
    hottest_first.sort_by_key(|vertex| std::cmp::Reverse(vertex.load));
    let (mut heat, mut capacity) = (own.work(), own.threads());
    for other in hottest_first {
        // Who is colder than what the hotter ones bring would take something away.
        if other.seconds() > heat / capacity {
            heat += edge(other) * other.seconds();
            capacity += edge(other);
        }
    }
    let after = heat / capacity;
    neighbors.iter().map(|other| edge(other) * (other.seconds() - after).max(0.0)).collect()
}

#[cfg(test)]
mod tests;

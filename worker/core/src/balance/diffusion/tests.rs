//! The step against what must hold on any graph, and against its closed form on regular ones.
//!
//! A mode is an eigenvector of the graph's Laplacian. Of a mode of eigenvalue λ the explicit step
//! leaves the part 1 − αλ, the implicit one 1 ∕ (1 + αλ): Cybenko 1989, Heirich & Taylor 1995.

use equilux_common::topology::{Graph, Topology};
use proptest::prelude::*;

use super::*;

/// Load far above and below which modes swing.
const MEAN: f64 = 1000.0;

/// Rounding to nanoseconds, on each edge of a worker.
const SLACK: f64 = 1e-7;

fn vertex() -> impl Strategy<Value = Vertex> {
    (0u64..1 << 45, 1u64..1 << 20)
        .prop_map(|(nanos, capacity)| Vertex { load: Duration::from_nanos(nanos), capacity })
}

fn step() -> impl Strategy<Value = DiffusionStep> {
    prop_oneof![Just(DiffusionStep::Explicit), Just(DiffusionStep::Implicit)]
}

/// A graph of the user's own: a tree and some more edges.
fn graph() -> impl Strategy<Value = (Topology, usize)> {
    let ends = prop::collection::vec(any::<(prop::sample::Index, prop::sample::Index)>(), 1..40);
    ends.prop_map(|ends| {
        let count = ends.len() / 2 + 2;
        let tree = |(index, (parent, _)): (usize, &(prop::sample::Index, _))| {
            [parent.index(index + 1), index + 1]
        };
        let mut edges: Vec<_> = ends.iter().enumerate().take(count - 1).map(tree).collect();
        edges.extend(ends.iter().map(|(a, b)| [a.index(count), b.index(count)]));
        (Topology::Graph(Graph::new(&edges).expect("a tree is connected").into()), count)
    })
}

/// Everybody takes its part at once of what the step gives; nobody gives more than it has.
fn receive(kind: DiffusionStep, topology: &Topology, before: &[Vertex]) -> Vec<f64> {
    let mut left: Vec<f64> = before.iter().map(Vertex::work).collect();
    let mut after = left.clone();
    for (index, &own) in before.iter().enumerate() {
        let neighbors = topology.neighbors(index, before.len());
        let theirs: Vec<Vertex> = neighbors.iter().map(|&other| before[other]).collect();
        for (&other, flow) in neighbors.iter().zip(flows(kind, own, &theirs)) {
            let flow = flow.as_secs_f64().min(left[other]);
            after[index] += flow;
            after[other] -= flow;
            left[other] -= flow;
        }
    }
    after
}

/// The whole graph's implicit step, (1 + αλ) u′ = u, by Jacobi iterations; capacities are equal.
fn implicit_by_jacobi(topology: &Topology, diffusivity: f64, before: &[f64]) -> Vec<f64> {
    let mut after = before.to_vec();
    for _ in 0..2000 {
        let last = after.clone();
        for (index, value) in after.iter_mut().enumerate() {
            let neighbors = topology.neighbors(index, before.len());
            let sum: f64 = neighbors.iter().map(|&other| last[other]).sum();
            let degree = neighbors.len() as f64;
            *value = (before[index] + diffusivity * sum) / (1.0 + diffusivity * degree);
        }
    }
    after
}

/// Regular graphs with a mode each and its eigenvalue: ring, torus, hypercube.
fn modes() -> Vec<(Topology, Vec<f64>, f64)> {
    // Cosines of twelfths of a circle.
    let root = 0.75f64.sqrt();
    let cosines = [1.0, root, 0.5, 0.0, -0.5, -root, -1.0, -root, -0.5, 0.0, 0.5, root];
    let wave = |turns: usize, of: usize, at: usize| cosines[turns * at * (12 / of) % 12];
    let ring = |turns: usize, of: usize| 2.0 - 2.0 * wave(turns, of, 1);
    let mut modes = Vec::new();
    for turns in 1..=6 {
        let shape = (0..12).map(|at| wave(turns, 12, at)).collect();
        modes.push((Topology::Ring, shape, ring(turns, 12)));
    }
    for (across, down) in [(1, 0), (1, 2), (2, 3)] {
        let shape = (0..36).map(|at| wave(across, 6, at % 6) * wave(down, 6, at / 6)).collect();
        modes.push((Topology::Torus2d, shape, ring(across, 6) + ring(down, 6)));
    }
    for mask in [1usize, 0b101, 0b1_1111] {
        let sign = |at: usize| if (at & mask).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        let lambda = 2.0 * f64::from(mask.count_ones());
        modes.push((Topology::Hypercube, (0..32).map(sign).collect(), lambda));
    }
    modes
}

fn assert_near(found: &[f64], expected: impl Iterator<Item = f64>, tolerance: f64, what: &str) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < tolerance, "{what}: {found}, not {expected}");
    }
}

proptest! {
    #[test]
    fn no_flow_exceeds_what_the_neighbor_has_or_lifts_the_receiver_above_them_all(
        kind in step(), own in vertex(), neighbors in prop::collection::vec(vertex(), 0..40),
    ) {
        let flows = flows(kind, own, &neighbors);
        prop_assert_eq!(flows.len(), neighbors.len());
        let mut work = own.work();
        for (flow, neighbor) in flows.iter().zip(&neighbors) {
            prop_assert!(flow.as_secs_f64() <= neighbor.work() + SLACK);
            prop_assert!(neighbor.load > own.load || flow.is_zero());
            // Nor does the flow turn the edge around.
            let left = (neighbor.work() - flow.as_secs_f64()) / neighbor.threads();
            prop_assert!(left >= own.seconds().min(neighbor.seconds()) - SLACK);
            work += flow.as_secs_f64();
        }
        let top = neighbors.iter().map(|neighbor| neighbor.load).max().unwrap_or_default();
        let top = top.max(own.load).as_secs_f64();
        prop_assert!(work / own.threads() <= top * (1.0 + 1e-12) + SLACK);
    }

    #[test]
    fn on_any_graph_work_is_conserved_and_nobody_falls_below_nothing(
        kind in step(), (topology, count) in graph(), pool in prop::collection::vec(vertex(), 22),
    ) {
        let before = &pool[..count];
        let after = receive(kind, &topology, before);
        let sum: f64 = before.iter().map(Vertex::work).sum();
        prop_assert!((after.iter().sum::<f64>() - sum).abs() <= sum * 1e-12);
        prop_assert!(after.iter().all(|&work| work >= -SLACK));
    }

    #[test]
    fn on_a_regular_graph_the_extremes_close_in(
        pool in prop::collection::vec(0u64..1 << 45, 3..40), is_complete in any::<bool>(),
    ) {
        let topology = if is_complete { Topology::Complete } else { Topology::Ring };
        let vertices = pool.iter().map(|&nanos| Vertex {
            load: Duration::from_nanos(nanos),
            capacity: 1000,
        });
        let before: Vec<Vertex> = vertices.collect();
        let (low, high) = before.iter().fold((f64::MAX, 0.0f64), |(low, high), vertex| {
            (low.min(vertex.work()), high.max(vertex.work()))
        });
        for work in receive(DiffusionStep::Explicit, &topology, &before) {
            prop_assert!((low - 1e-6..=high + 1e-6).contains(&work));
        }
    }

    #[test]
    fn on_a_star_the_implicit_step_is_what_iterations_converge_to(
        loads in prop::collection::vec(1u64..1 << 45, 1..12), tenths in 1u32..1000,
    ) {
        // An empty receiver in the middle: everything flows inward.
        let center = Vertex { load: Load::ZERO, capacity: 1000 };
        let leaf = |&nanos: &u64| Vertex { load: Duration::from_nanos(nanos), capacity: 1000 };
        let leaves: Vec<Vertex> = loads.iter().map(leaf).collect();
        let edges: Vec<_> = (1..=leaves.len()).map(|index| [0, index]).collect();
        let star = Topology::Graph(Graph::new(&edges).expect("a star").into());
        let before: Vec<f64> =
            std::iter::once(&center).chain(&leaves).map(Vertex::seconds).collect();
        // Little enough for Jacobi's iterations to converge.
        let diffusivity = f64::from(tenths) / 1000.0;
        let after = implicit_by_jacobi(&star, diffusivity, &before);
        let flows = implicit(diffusivity, center, &leaves);
        let is_inward = after[1..].iter().all(|&load| load >= after[0]);
        for ((before, after), flow) in before[1..].iter().zip(&after[1..]).zip(&flows) {
            prop_assert!(!is_inward || (before - after - flow).abs() < 1e-6 * (1.0 + before));
        }
    }

    #[test]
    fn the_implicit_step_overshoots_at_no_diffusivity(
        diffusivity in 1e-3..1e9, own in vertex(),
        neighbors in prop::collection::vec(vertex(), 1..20),
    ) {
        let flows = implicit(diffusivity, own, &neighbors);
        let after = (own.work() + flows.iter().sum::<f64>()) / own.threads();
        for (flow, neighbor) in flows.iter().zip(&neighbors) {
            prop_assert!(*flow >= 0.0);
            let left = (neighbor.work() - flow) / neighbor.threads();
            let slack = 1e-9 * (1.0 + after);
            prop_assert!(*flow == 0.0 || left >= after - slack, "{left} < {after}");
        }
    }
}

proptest! {
    #[test]
    fn consolidated_flows_are_fewer_and_turn_no_edge_around(
        own in vertex(), neighbors in prop::collection::vec(vertex(), 1..40), micros in 1u64..1 << 30,
    ) {
        let (least, flows) = (
            Duration::from_micros(micros),
            flows(DiffusionStep::Explicit, own, &neighbors),
        );
        let parts = consolidate(own, &neighbors, &flows, least);
        let largest = flows.iter().zip(&neighbors).max_by_key(|(flow, _)| **flow);
        let (_, richest) = largest.expect("at least one neighbor");
        let most = flows.iter().sum::<Load>().max(own.evening_out(richest));
        prop_assert!(parts.iter().sum::<Load>() <= most);
        for ((part, neighbor), flow) in parts.iter().zip(&neighbors).zip(&flows) {
            prop_assert!(part.is_zero() || *part >= least);
            prop_assert!(*part <= own.evening_out(neighbor));
            prop_assert!(part.is_zero() || !flow.is_zero());
        }
    }
}

#[test]
fn every_mode_decays_as_its_eigenvalue_says() {
    for (topology, shape, lambda) in modes() {
        let what = format!("{}, λ = {lambda}", topology.name());
        let load = |swing: f64| Duration::from_secs_f64(MEAN + swing);
        let before: Vec<Vertex> =
            shape.iter().map(|&swing| Vertex { load: load(swing), capacity: 1000 }).collect();
        let degree = topology.neighbors(0, shape.len()).len() as f64;
        let explicit = receive(DiffusionStep::Explicit, &topology, &before);
        let decay = 1.0 - lambda / (degree + 1.0);
        assert_near(&explicit, shape.iter().map(|swing| MEAN + swing * decay), 1e-6, &what);
        for diffusivity in [0.1, 1.0] {
            let decay = 1.0 / (1.0 + diffusivity * lambda);
            let implicit = implicit_by_jacobi(&topology, diffusivity, &shape);
            assert_near(&implicit, shape.iter().map(|swing| swing * decay), 1e-9, &what);
        }
    }
}

#[test]
fn one_step_on_a_complete_graph_reaches_the_common_load() {
    let vertex = |seconds, capacity| Vertex { load: Duration::from_secs(seconds), capacity };
    let own = vertex(0, 2000);
    let neighbors = [vertex(10, 1000), vertex(20, 4000), vertex(50, 1000)];
    // (10 + 80 + 50) ∕ (2 + 1 + 4 + 1) s is common, twice that for two threads.
    let sum: Load = flows(DiffusionStep::Explicit, own, &neighbors).iter().sum();
    assert!(sum.abs_diff(Duration::from_secs(35)) < Duration::from_nanos(9), "{sum:?}");
}

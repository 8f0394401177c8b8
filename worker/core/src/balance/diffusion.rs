//! The diffusion step: how much work should flow to an idle worker along each of its edges.
//!
//! Loads are temperatures, workers the vertices of a graph, and work flows along an edge in
//! proportion to the difference of its ends (Cybenko, *Dynamic load balancing for distributed
//! memory multiprocessors*, 1989; section 3 of Heirich & Arvo 1996). This is the explicit step of
//! first order, of which the receiving end takes its part. With the diffusivity α = 1/(d + 1) at
//! degree d it is stable on every regular graph, and on a complete graph one step reaches the mean.

use std::iter::once;

use equilux_common::message::Load;

/// What each neighbor should give: α (Lⱼ − L) where that is positive, in the neighbors' order.
/// Never more than the neighbor has; never so much in all that the receiver ends above the largest
/// of them.
#[must_use]
pub(crate) fn flows(own: Load, neighbors: &[Load]) -> Vec<Load> {
    let parts = u32::try_from(neighbors.iter().chain(once(&own)).count()).unwrap_or(u32::MAX);
    neighbors.iter().map(|load| load.saturating_sub(own) / parts).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::topology::Topology;
    use proptest::prelude::*;
    use std::time::Duration;

    fn loads() -> impl Strategy<Value = Vec<Load>> {
        prop::collection::vec((0u64..1 << 50).prop_map(Duration::from_nanos), 1..40)
    }

    /// Everybody takes a step at once: what one end of an edge takes, the other gives.
    fn step(topology: Topology, loads: &[Load]) -> Vec<Load> {
        let mut after = loads.to_vec();
        for (index, &own) in loads.iter().enumerate() {
            let neighbors = topology.neighbors(index, loads.len());
            let theirs: Vec<Load> = neighbors.iter().map(|&other| loads[other]).collect();
            for (&other, flow) in neighbors.iter().zip(flows(own, &theirs)) {
                after[index] += flow;
                after[other] -= flow;
            }
        }
        after
    }

    proptest! {
        #[test]
        fn no_flow_exceeds_what_the_neighbor_has_or_lifts_the_receiver_above_them_all(
            own in (0u64..1 << 50).prop_map(Duration::from_nanos), neighbors in loads(),
        ) {
            let flows = flows(own, &neighbors);
            prop_assert_eq!(flows.len(), neighbors.len());
            for (flow, load) in flows.iter().zip(&neighbors) {
                prop_assert!(flow <= load);
                prop_assert!(load > &own || flow.is_zero());
            }
            let top = neighbors.iter().copied().max().unwrap_or_default().max(own);
            prop_assert!(own + flows.iter().sum::<Load>() <= top);
        }

        #[test]
        fn on_a_regular_graph_work_is_conserved_and_the_extremes_close_in(
            loads in loads(), is_complete in any::<bool>(),
        ) {
            let topology = if is_complete { Topology::Complete } else { Topology::Ring };
            let after = step(topology, &loads);
            prop_assert_eq!(after.iter().sum::<Load>(), loads.iter().sum::<Load>());
            prop_assert!(after.iter().max() <= loads.iter().max());
            prop_assert!(after.iter().min() >= loads.iter().min());
        }
    }

    #[test]
    fn one_step_on_a_complete_graph_reaches_the_mean() {
        let loads = [0, 10, 20, 50].map(Duration::from_secs);
        for load in step(Topology::Complete, &loads) {
            assert!(load.abs_diff(Duration::from_secs(20)) < Duration::from_nanos(9), "{load:?}");
        }
    }
}

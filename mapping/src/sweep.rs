//! Sweeps: in each, every region has an exchange with each of its neighbors.
//!
//! What a region has beyond its limit flows to its neighbors like heat, downhill, and from those
//! on in the next sweep (Cybenko 1989; exchanges in pairs are the *dimension exchange* there). A
//! region knows its own load and its neighbors'; nobody knows all. Pairs are scheduled in rounds in
//! which no region comes twice: what happens in a round may happen at once, everywhere.
//!
//! Regions that have not changed since they last met need not meet. When none must, it is over.

use std::collections::BTreeMap;

use crate::exchange::{Note, exchange};
use crate::regions::Regions;

/// Lets regions exchange clusters until none changes any more, but in so many sweeps at most;
/// gives their number.
pub(crate) fn sweep(regions: &mut Regions<'_>, sweeps_max: u32) -> u32 {
    let mut changed: Vec<u32> = vec![1; regions.loads.len()];
    let mut notes = vec![Note::Blank; regions.clusters.count()];
    for now in 1..=sweeps_max {
        let pairs = regions.pairs();
        let flows = flows(regions, &pairs);
        let mut has_changed = false;
        for pair in rounds(&pairs, regions.loads.len()) {
            let backward = flows.get(&[pair[1], pair[0]]);
            let forward = flows.get(&pair);
            let is_settled = pair.iter().all(|&region| changed[region] + 1 < now);
            if is_settled && forward.is_none() && backward.is_none() {
                continue;
            }
            let (pair, flow) = match backward {
                Some(&flow) => ([pair[1], pair[0]], flow),
                None => (pair, forward.copied().unwrap_or(0)),
            };
            if exchange(regions, pair, flow, &mut notes) {
                pair.iter().for_each(|&region| changed[region] = now);
                has_changed = true;
            }
        }
        if !has_changed {
            return now;
        }
    }
    sweeps_max
}

/// The pairs in an order in which those of a round come together: an edge coloring, each pair in
/// the first round that both its regions are free in.
fn rounds(pairs: &[[usize; 2]], regions: usize) -> Vec<[usize; 2]> {
    let mut busy: Vec<Vec<bool>> = vec![Vec::new(); regions];
    let mut rounds: Vec<Vec<[usize; 2]>> = Vec::new();
    for &pair in pairs {
        let is_busy = |region: usize, round: usize| busy[region].get(round) == Some(&true);
        let is_free = |&round: &usize| !pair.iter().any(|&region| is_busy(region, round));
        let round = (0..).find(is_free).expect("some round is free");
        for region in pair {
            let length = busy[region].len().max(round + 1);
            busy[region].resize(length, false);
            busy[region][round] = true;
        }
        rounds.resize(rounds.len().max(round + 1), Vec::new());
        rounds[round].push(pair);
    }
    rounds.concat()
}

/// Bytes that are to flow between neighbors, from the first to the second.
fn flows(regions: &Regions<'_>, pairs: &[[usize; 2]]) -> BTreeMap<[usize; 2], u64> {
    let mut lower: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for &[a, b] in pairs {
        for (from, to) in [(a, b), (b, a)] {
            if regions.excess(from) > 0 && regions.is_fuller(from, to) {
                lower.entry(from).or_default().push(to);
            }
        }
    }
    lower.iter().flat_map(|(&from, lower)| outflow(regions, from, lower)).collect()
}

/// What a region beyond its limit gives to those that are less full: to the emptiest first what
/// fills it to the mean of them all, or an object if that is more, but no more than levels the two.
fn outflow(regions: &Regions<'_>, from: usize, lower: &[usize]) -> Vec<([usize; 2], u64)> {
    let wide = |bytes: u64| u128::from(bytes);
    let sum = |of: &[u64]| lower.iter().chain([&from]).map(|&it| wide(of[it])).sum::<u128>();
    let (load, share) = (sum(&regions.loads), sum(regions.shares));
    let grain = wide(regions.loads[from]) / (regions.members[from].len().max(1) as u128);
    let mut emptiest = lower.to_vec();
    emptiest.sort_by(|&a, &b| {
        let fuller = (regions.is_fuller(a, b), regions.is_fuller(b, a));
        fuller.cmp(&(fuller.1, fuller.0)).then(a.cmp(&b))
    });
    let mut left = wide(regions.excess(from));
    let mut flows = Vec::new();
    for to in emptiest {
        let [have, got] = [from, to].map(|it| wide(regions.loads[it]));
        let [own, other] = [from, to].map(|it| wide(regions.shares[it]));
        let level = (have * other - got * own) / (own + other);
        let mean = (other * load / share.max(1)).saturating_sub(got);
        let flow = level.min(mean.max(grain)).min(left);
        left -= flow;
        if flow > 0 {
            flows.push(([from, to], u64::try_from(flow).expect("no more than the load")));
        }
    }
    flows
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clusters::{Clusters, Homes};
    use crate::guest::{Guest, Object, Tie};
    use crate::settling::settle;

    #[test]
    fn no_region_comes_twice_in_a_round() {
        let pairs: Vec<_> = (0..6).flat_map(|a| (a + 1..6).map(move |b| [a, b])).collect();
        let mut scheduled = rounds(&pairs, 6);
        assert_eq!(scheduled[..3], [[0, 1], [2, 3], [4, 5]]);
        scheduled.sort_unstable();
        assert_eq!(scheduled, pairs);
    }

    #[test]
    fn objects_that_no_limit_has_room_for_change_places() {
        let object = |x: u16| Object { bytes: 1000, position: [f32::from(x), 0.0, 0.0] };
        let tie = |a: usize, b: usize| Tie { objects: [a, b], affinity: 1 };
        let guest = Guest::new((0..4).map(object).collect(), vec![tie(0, 2), tie(1, 3)]);
        let clusters = Clusters::of(&guest.expect("a valid guest"), 2);
        let homes = Homes::new(vec![0, 0, 1, 1], 2);
        let mut regions = Regions::new(&clusters, homes, &[2000; 2], None);
        sweep(&mut regions, 5);
        assert_eq!(clusters.cut(&regions.homes), 0);
        assert_eq!(regions.loads, [2000, 2000]);
    }

    #[test]
    fn what_is_too_much_flows_away_over_several_regions() {
        let object = |x: u16| Object { bytes: 1, position: [f32::from(x), 0.0, 0.0] };
        let tie = |x: usize| Tie { objects: [x, x + 1], affinity: 1 };
        let guest = Guest::new((0..400).map(object).collect(), (0..399).map(tie).collect());
        let clusters = Clusters::of(&guest.expect("a valid guest"), 4);
        // The first has three quarters.
        let homes = (0..400u32).map(|object| object.saturating_sub(300).div_ceil(33).min(3));
        let homes = Homes::new(homes.collect(), 4);
        let mut regions = Regions::new(&clusters, homes, &[100; 4], None);
        assert_eq!(regions.loads[0], 301);
        assert!(sweep(&mut regions, 50) <= 50);
        // A slope of an object from one to the next stays, for settling.
        assert!(regions.loads.iter().all(|&load| load <= 106), "{:?}", regions.loads);
        settle(&mut regions);
        assert!(regions.loads.iter().all(|&load| load <= 103), "{:?}", regions.loads);
        assert_eq!(clusters.cut(&regions.homes), 3);
    }
}

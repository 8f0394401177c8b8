//! Settling: the last objects that are too many somewhere find room.
//!
//! Where loads differ by less than an object from one region to the next, diffusion of indivisible
//! objects stands still, though the slope may be long. Then room is passed on instead: from the
//! nearest region that has some, along the way to the one that has too much, each region on it
//! giving of its own to the next. Ways without a region in common are one round. What is still too
//! much after the rounds, or lies too far from any room, is handed over to whoever has most,
//! wherever that is. So the number of steps has a bound.

use std::cmp::Reverse;
use std::collections::VecDeque;

use crate::clusters::number;
use crate::regions::Regions;

/// Regions on a way, less one, at most.
const HOPS_MAX: u32 = 4;

/// Rounds in which room is passed on.
const ROUNDS_MAX: u32 = 2;

/// Steps of a round at most: the word of room goes from neighbor to neighbor, then all pass on at
/// once.
const ROUND_STEPS_MAX: u32 = HOPS_MAX + 1;

/// Steps of handing over: all hear what room there is, then the objects move.
const HAND_OVER_STEPS: u32 = 2;

/// Steps of [`settle`] at most.
pub(crate) const SETTLING_STEPS_MAX: u32 = ROUNDS_MAX * ROUND_STEPS_MAX + HAND_OVER_STEPS;

/// Moves objects out of regions beyond their limits as long as that lowers the sum of what is
/// beyond; gives the number of steps. What stays is within an object of the limit, or in regions
/// all others of which are full.
pub(crate) fn settle(regions: &mut Regions<'_>) -> u32 {
    let mut steps = 0;
    for _ in 0..ROUNDS_MAX {
        if regions.total_excess() == 0 {
            return steps;
        }
        steps += pass_round(regions);
    }
    if regions.total_excess() == 0 {
        return steps;
    }
    for region in 0..regions.loads.len() {
        while regions.excess(region) > 0 && hand_over(regions, region) {}
    }
    steps + HAND_OVER_STEPS
}

/// Passes room on along ways that have no region in common; gives the number of steps.
fn pass_round(regions: &mut Regions<'_>) -> u32 {
    let mut hops = 0;
    let mut is_busy = vec![false; regions.loads.len()];
    for region in 0..regions.loads.len() {
        if regions.excess(region) == 0 || is_busy[region] {
            continue;
        }
        let Some(way) = way_to_room(regions, region, &is_busy) else {
            hops = HOPS_MAX;
            continue;
        };
        way.iter().for_each(|&on_way| is_busy[on_way] = true);
        hops = hops.max(number(way.len() - 1));
        while regions.excess(region) > 0 && pass_along(regions, &way) {}
    }
    hops + 1
}

/// Passes an object from each region of the way to the next, if that lowers what is beyond limits.
fn pass_along(regions: &mut Regions<'_>, way: &[usize]) -> bool {
    let excess = |regions: &Regions<'_>| -> u64 { way.iter().map(|&it| regions.excess(it)).sum() };
    let before = excess(regions);
    let mut moves = Vec::new();
    for step in way.windows(2).rev() {
        let Some(object) = choice(regions, [step[0], step[1]]) else { continue };
        relocate(regions, object, step[1]);
        moves.push((object, step[0]));
    }
    let is_better = excess(regions) < before;
    if !is_better {
        moves.into_iter().rev().for_each(|(object, back)| relocate(regions, object, back));
    }
    is_better
}

/// Hands an object over to whoever has most room, wherever that is.
fn hand_over(regions: &mut Regions<'_>, from: usize) -> bool {
    let room = |region: usize| regions.limits[region].saturating_sub(regions.loads[region]);
    let roomiest = (0..regions.loads.len()).max_by_key(|&region| (room(region), Reverse(region)));
    let Some(to) = roomiest.filter(|&region| room(region) > 0) else { return false };
    let before = regions.total_excess();
    let Some(object) = choice(regions, [from, to]) else { return false };
    relocate(regions, object, to);
    let is_better = regions.total_excess() < before;
    if !is_better {
        relocate(regions, object, from);
    }
    is_better
}

/// Regions from this one to the nearest that has room for its smallest object, both included, by
/// no busy one.
fn way_to_room(regions: &Regions<'_>, from: usize, is_busy: &[bool]) -> Option<Vec<usize>> {
    let bytes = |member: &u32| regions.clusters.bytes(*member as usize);
    let smallest = regions.members[from].iter().map(bytes).min()?;
    let mut is_known = is_busy.to_vec();
    is_known[from] = true;
    let mut waiting = VecDeque::from([vec![from]]);
    while let Some(way) = waiting.pop_front() {
        let end = way[way.len() - 1];
        if end != from && regions.loads[end] + smallest <= regions.limits[end] {
            return Some(way);
        }
        if way.len() > HOPS_MAX as usize {
            continue;
        }
        for next in regions.neighbors(end) {
            if !std::mem::replace(&mut is_known[next], true) {
                waiting.push_back(way.iter().copied().chain([next]).collect());
            }
        }
    }
    None
}

/// The object of the first region that costs the least cut in the second, among those that fit;
/// where none fits, the smallest.
fn choice(regions: &Regions<'_>, [from, to]: [usize; 2]) -> Option<u32> {
    let room = regions.limits[to].saturating_sub(regions.loads[to]);
    let rank = |&member: &u32| {
        let bytes = regions.clusters.bytes(member as usize);
        let overflow = bytes.saturating_sub(room);
        let ties = regions.clusters.ties(member as usize).iter();
        let loss = ties.map(|&(other, affinity)| match regions.homes.of(other as usize) as usize {
            home if home == from => affinity,
            home if home == to => -affinity,
            _ => 0,
        });
        (overflow, loss.sum::<i64>(), member)
    };
    regions.members[from].iter().copied().min_by_key(rank)
}

fn relocate(regions: &mut Regions<'_>, object: u32, to: usize) {
    let from = regions.homes.of(object as usize) as usize;
    regions.members[from].retain(|&member| member != object);
    let place = regions.members[to].partition_point(|&member| member < object);
    regions.members[to].insert(place, object);
    regions.rehome(object, to);
}

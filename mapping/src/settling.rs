//! Settling: the last objects that are too many somewhere find room.
//!
//! Where loads differ by less than an object from one region to the next, diffusion of indivisible
//! objects stands still, though the slope may be long. Then room is passed on instead: from the
//! nearest region that has some, along the way to the one that has too much, an object a step.

use std::cmp::Reverse;
use std::collections::VecDeque;

use crate::regions::Regions;

/// Moves objects out of regions beyond their limits as long as that lowers the sum of what is
/// beyond. What stays is within an object of the limit, or in regions all others of which are full.
pub(crate) fn settle(regions: &mut Regions<'_>) {
    for region in 0..regions.loads.len() {
        while regions.excess(region) > 0
            && (pass_along(regions, region) || hand_over(regions, region))
        {}
    }
}

/// Passes an object a step along the way to the nearest region with room.
fn pass_along(regions: &mut Regions<'_>, from: usize) -> bool {
    let Some(way) = way_to_room(regions, from) else { return false };
    let before = regions.total_excess();
    let mut moves = Vec::new();
    for step in way.windows(2).rev() {
        let Some(object) = choice(regions, [step[0], step[1]]) else { continue };
        relocate(regions, object, step[1]);
        moves.push((object, step[0]));
    }
    let is_better = regions.total_excess() < before;
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

/// Regions from this one to the nearest that has room for its smallest object, both included.
fn way_to_room(regions: &Regions<'_>, from: usize) -> Option<Vec<usize>> {
    let bytes = |member: &u32| regions.clusters.bytes(*member as usize);
    let smallest = regions.members[from].iter().map(bytes).min()?;
    let mut come_from = vec![None; regions.loads.len()];
    let mut waiting = VecDeque::from([from]);
    while let Some(region) = waiting.pop_front() {
        if region != from && regions.loads[region] + smallest <= regions.limits[region] {
            let mut way = vec![region];
            while let Some(before) =
                come_from[way[way.len() - 1]].filter(|_| way[way.len() - 1] != from)
            {
                way.push(before);
            }
            way.reverse();
            return Some(way);
        }
        for next in regions.neighbors(region) {
            if next != from && come_from[next].is_none() {
                come_from[next] = Some(region);
                waiting.push_back(next);
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

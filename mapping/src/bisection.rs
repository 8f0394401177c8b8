//! The static mapping: contiguous runs of objects, in proportion to capacities.
//!
//! Partitions are numbered in the order of the recursive bisection, by area × bytes, that made
//! them. So a run of numbers is a part of that bisection's tree and its neighbors, and dealing out
//! runs is the recursive subdivision of Heirich & Arvo (1996), section 5.1, for any number of
//! workers and any capacities.

use crate::guest::Guest;
use crate::host::Host;
use crate::mapping::Mapping;

/// Maps objects to workers by runs of their numbers. A worker gets its share, give or take half of
/// an object at each end of its run. One without capacity gets nothing.
#[must_use]
pub fn bisect(guest: &Guest, host: &Host) -> Mapping {
    Mapping::from_positions(host, &runs(guest, host))
}

/// Position in `host` of each object's home. An object belongs to the run in which its middle byte
/// lies.
pub(crate) fn runs(guest: &Guest, host: &Host) -> Vec<u32> {
    let mut ends = Vec::with_capacity(host.seats().len());
    let mut end = 0u128;
    for (seat, position) in host.seats().iter().zip(0u32..) {
        end += u128::from(seat.capacity);
        if seat.capacity > 0 {
            ends.push((2 * u128::from(guest.bytes()) * end, position));
        }
    }
    let mut before = 0u128;
    let mut run = 0;
    let homes = guest.objects().iter().map(|object| {
        let middle = (2 * before + u128::from(object.bytes)) * u128::from(host.capacity());
        before += u128::from(object.bytes);
        while middle >= ends[run].0 {
            run += 1;
        }
        ends[run].1
    });
    homes.collect()
}

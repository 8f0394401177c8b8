//! What a worker does that has no room for more rays.

use super::*;

/// So many rays of one unit, whose credit is shared out of `credit`.
fn some_rays(count: usize, credit: &mut Credit) -> Bundle {
    let share = Share { unit: UnitId(3), attempt: Attempt(0), credit: credit.split(2) };
    Bundle { shares: vec![share], rays: vec![Ray::zeroed(); count], ..rays(0, 0) }
}

#[test]
fn who_has_no_room_for_rays_takes_no_more_and_traces_what_is_stuck_by_a_copy() {
    let balancing = Balancing { exchange: Exchange::Off, ..Balancing::default() };
    let mut bench = at_home(balancing);
    let (job, mut credit) = (JobId(1), Credit::whole());
    let is_receipt =
        |message: &PeerMessage| matches!(message, PeerMessage::ForwardsAcknowledged { .. });
    let (mut loaded, mut pending) = (Vec::new(), Vec::new());
    let come = |bench: &mut Bench, credit: &mut Credit| {
        let bundles = vec![some_rays(64, credit), some_rays(64, credit)];
        bench.peer_says(1, PeerMessage::Forwarded { bundles })
    };
    // What comes is traced, and goes on to the peer as far as its window is open.
    come(&mut bench, &mut credit);
    let here = PartitionId(0);
    let actions = bench.after(Event::PartitionLoaded { job, partition: here });
    pending.extend(pieces(&actions));
    while loaded.is_empty() {
        let (rays, rays_max) = bench.core.waiting_rays();
        assert!(rays < rays_max + 128, "what is stuck is not traced");
        let actions = if let Some((piece, Work::Rays(bundle))) = pending.pop() {
            let onward = Bundle { partition: PartitionId(1), ..bundle };
            let outcome = Box::new(Outcome { successors: vec![onward], ..Outcome::default() });
            bench.after(Event::Traced { job, piece, outcome, elapsed: SECOND })
        } else {
            come(&mut bench, &mut credit)
        };
        loaded.extend(loads(&actions));
        pending.extend(pieces(&actions));
    }
    let (rays, rays_max) = bench.core.waiting_rays();
    assert!(rays >= rays_max && loaded == [1], "{loaded:?} with {rays} of {rays_max}");
    let mut actions = come(&mut bench, &mut credit);
    bench.now = bench.now + SECOND;
    actions.extend(bench.peer_says(1, PeerMessage::Declined));
    assert!(!said(&actions).iter().any(is_receipt), "there is no room");
    // What is stuck is traced here, and there is room again.
    let partition = PartitionId(1);
    let mut pending = pieces(&bench.after(Event::PartitionLoaded { job, partition }));
    let mut receipts = 0;
    while let Some((piece, Work::Rays(bundle))) = pending.pop() {
        let tile = spec(1).grid().unit(UnitId(3)).expect("16 units").tile;
        let retired = bundle.shares.into_iter().map(|share| (share, TileSums::new(tile)));
        let counts = RayCounts { retired: bundle.rays.len() as u64, ..RayCounts::default() };
        let outcome = Outcome { retired: retired.collect(), counts, successors: Vec::new() };
        let outcome = Box::new(outcome);
        let actions = bench.after(Event::Traced { job, piece, outcome, elapsed: SECOND });
        receipts += said(&actions).iter().filter(|message| is_receipt(message)).count();
        pending.extend(pieces(&actions));
    }
    assert!(receipts > 0 && bench.core.waiting_rays().0 < rays_max);
}

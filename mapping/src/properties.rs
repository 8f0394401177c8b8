//! What holds of every mapping, whatever the guest and the host.

use equilux_common::ids::WorkerId;
use proptest::prelude::*;
use proptest::sample::Index;

use crate::guest::{Guest, Object, Tie};
use crate::host::{Host, Seat};
use crate::{Mapping, STEPS_MAX, bisect, diffuse};

/// Objects at random places, of sizes that differ up to `bytes` times, with ties at random.
fn guests(count: usize, bytes: u64) -> impl Strategy<Value = Guest> {
    let place = prop_oneof![3 => -100.0f32..100.0, 1 => Just(0.0)];
    let object = (1..=bytes, [place.clone(), place.clone(), place]);
    let tie = (any::<[Index; 2]>(), prop_oneof![8 => 0u64..100, 1 => Just(u64::MAX)]);
    let ties = prop::collection::vec(tie, 0..3 * count);
    (prop::collection::vec(object, 1..count), ties).prop_map(|(objects, ties)| {
        let count = objects.len();
        let objects = objects.into_iter().map(|(bytes, position)| Object { bytes, position });
        let ties = ties.into_iter().map(|(ends, affinity)| {
            let objects = ends.map(|end| end.index(count));
            Tie { objects, affinity }
        });
        Guest::new(objects.collect(), ties.collect()).expect("a valid guest")
    })
}

/// Workers of which some have no capacity, but not all.
fn hosts() -> impl Strategy<Value = Host> {
    let capacity = prop_oneof![6 => 1u64..1000, 1 => Just(0), 1 => Just(1u64 << 50)];
    prop::collection::vec(capacity, 1..12).prop_map(|mut capacities| {
        capacities[0] = capacities[0].max(1);
        host(&capacities)
    })
}

/// Workers with numbers that are not their positions.
fn host(capacities: &[u64]) -> Host {
    let seat = |(&capacity, worker)| Seat { worker: WorkerId(worker), capacity };
    Host::new(capacities.iter().zip(7..).map(seat).collect()).expect("a valid host")
}

/// Objects in a cube, side by side, each tied to its neighbors.
fn cube(side: usize) -> Guest {
    let at = |x: usize, y: usize, z: usize| (z * side + y) * side + x;
    let mut objects = Vec::new();
    let mut ties = Vec::new();
    for index in 0..side * side * side {
        let (x, y, z) = (index % side, index / side % side, index / side / side);
        objects.push(Object { bytes: 10, position: [x, y, z].map(|it| it as f32) });
        let next = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
        for (x, y, z) in next.into_iter().filter(|&(x, y, z)| x.max(y).max(z) < side) {
            ties.push(Tie { objects: [index, at(x, y, z)], affinity: 5 });
        }
    }
    Guest::new(objects, ties).expect("a valid guest")
}

/// Every object has a home that is there and takes something, and no worker has more than its
/// share, three percent, and an object.
fn check(mapping: &Mapping, guest: &Guest, host: &Host) -> Result<(), TestCaseError> {
    prop_assert_eq!(mapping.homes().len(), guest.objects().len());
    let largest = guest.objects().iter().map(|object| object.bytes).max().unwrap_or(0);
    let loads = mapping.loads(guest);
    prop_assert_eq!(loads.values().sum::<u64>(), guest.bytes());
    for (worker, load) in loads {
        let seat = host.seats().iter().find(|seat| seat.worker == worker);
        let capacity = seat.expect("a worker that is there").capacity;
        prop_assert!(capacity > 0, "{} takes nothing, but has {} bytes", worker, load);
        let share = guest.bytes() as f64 * (capacity as f64 / host.capacity() as f64);
        // Shares are rounded up.
        let most = 1.03 * (share + 1.0) + largest as f64;
        prop_assert!(load as f64 <= most, "{} has {} bytes of {}", worker, load, most);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn every_worker_gets_what_it_should(guest in guests(150, 1), host in hosts()) {
        check(&bisect(&guest, &host), &guest, &host)?;
        check(&diffuse(&guest, &host, None).mapping, &guest, &host)?;
    }

    #[test]
    fn also_of_objects_of_unequal_sizes(guest in guests(150, 1000), host in hosts()) {
        check(&bisect(&guest, &host), &guest, &host)?;
        check(&diffuse(&guest, &host, None).mapping, &guest, &host)?;
    }

    #[test]
    fn also_if_there_are_hardly_any_objects(guest in guests(5, 1 << 40), host in hosts()) {
        check(&diffuse(&guest, &host, None).mapping, &guest, &host)?;
    }

    #[test]
    fn also_from_any_mapping(
        guest in guests(150, 20),
        host in hosts(),
        homes in prop::collection::vec(0u32..20, 150),
    ) {
        let homes = homes[..guest.objects().len()].iter().map(|&home| WorkerId(home)).collect();
        let present = Mapping::new(homes);
        check(&diffuse(&guest, &host, Some(&present)).mapping, &guest, &host)?;
    }

    #[test]
    fn where_nothing_has_changed_nothing_moves(guest in guests(150, 20), host in hosts()) {
        let mapping = diffuse(&guest, &host, None).mapping;
        prop_assert_eq!(&diffuse(&guest, &host, Some(&mapping)).mapping, &mapping);
    }

    #[test]
    fn no_number_of_workers_needs_more_steps(
        guest in guests(600, 20),
        workers in 1usize..300,
        homes in prop::collection::vec(0u32..400, 600),
    ) {
        let host = host(&vec![1; workers]);
        let homes = homes[..guest.objects().len()].iter().map(|&home| WorkerId(home)).collect();
        for present in [None, Some(Mapping::new(homes))] {
            let steps = diffuse(&guest, &host, present.as_ref()).steps;
            prop_assert!(steps <= STEPS_MAX, "{} steps", steps);
        }
    }

    #[test]
    fn the_same_input_has_the_same_mapping(guest in guests(150, 20), host in hosts()) {
        prop_assert_eq!(diffuse(&guest, &host, None), diffuse(&guest.clone(), &host.clone(), None));
    }

    #[test]
    fn where_objects_lie_matters_less_than_what_they_have_to_do(seed in 0usize..64) {
        // The same cube, but all in one point, and numbered in an order without meaning.
        let cube = cube(8);
        let number = |object: usize| (object * 173 + seed) % 512;
        let mut objects = cube.objects().to_vec();
        objects.iter_mut().for_each(|object| object.position = [1.0; 3]);
        let ties = cube.ties().iter().map(|tie| Tie { objects: tie.objects.map(number), ..*tie });
        let guest = Guest::new(objects, ties.collect()).expect("a valid guest");
        let host = host(&[1; 4]);
        let mapping = diffuse(&guest, &host, None).mapping;
        check(&mapping, &guest, &host)?;
        let cuts = [bisect(&guest, &host), mapping].map(|it| it.figures(&guest, &host).edge_cut);
        prop_assert!(2 * cuts[1] < cuts[0], "{:?}", cuts);
    }
}

#[test]
fn a_cube_is_cut_in_eight() {
    let guest = cube(8);
    let host = host(&[3; 8]);
    let figures = diffuse(&guest, &host, None).mapping.figures(&guest, &host);
    // Three planes of 64 ties.
    assert!(figures.edge_cut <= 3 * 64 * 5 * 11 / 10, "{figures:?}");
    assert!(figures.imbalance <= 0.03, "{figures:?}");
}

#[test]
fn capacities_are_met_within_three_percent() {
    let guest = cube(12);
    let host = host(&[1, 2, 3, 4, 0, 5, 1, 1]);
    let figures = diffuse(&guest, &host, None).mapping.figures(&guest, &host);
    assert!(figures.imbalance <= 0.03, "{figures:?}");
    assert!(figures.edge_cut < bisect(&guest, &host).figures(&guest, &host).edge_cut);
}

#[test]
fn of_what_one_worker_loses_little_more_than_that_moves() {
    let guest = cube(12);
    let before = host(&[10; 16]);
    let mut capacities = [10; 16];
    capacities[5] = 5;
    let after = host(&capacities);
    let present = diffuse(&guest, &before, None).mapping;
    let mapping = diffuse(&guest, &after, Some(&present)).mapping;
    assert!(mapping.figures(&guest, &after).imbalance <= 0.03);
    let moved = mapping.moved_bytes(&present, &guest);
    // Half of a share of a sixteenth must go, less what there was to spare.
    let least = guest.bytes() / 16 / 2 * 9 / 10;
    assert!((least..3 * least).contains(&moved), "{moved} of {}", guest.bytes());
}

#[test]
fn the_homes_of_a_worker_that_is_gone_are_given_away() {
    let guest = cube(6);
    let present = diffuse(&guest, &host(&[1; 4]), None).mapping;
    let fewer = Host::new(host(&[1; 4]).seats()[1..].to_vec()).expect("a valid host");
    let mapping = diffuse(&guest, &fewer, Some(&present)).mapping;
    assert!(!mapping.homes().contains(&WorkerId(7)));
    assert!(mapping.figures(&guest, &fewer).imbalance <= 0.03);
}

#[test]
fn affinities_may_be_as_large_as_numbers_are() {
    let small = cube(6);
    let ties = small.ties().iter().map(|tie| Tie { affinity: u64::MAX / 5 * tie.affinity, ..*tie });
    let large = Guest::new(small.objects().to_vec(), ties.collect()).expect("a valid guest");
    let host = host(&[1; 6]);
    let cut = |guest| diffuse(guest, &host, None).mapping.figures(guest, &host).edge_cut;
    let [small, large] = [cut(&small), cut(&large) / u128::from(u64::MAX / 5)];
    assert!(large.abs_diff(small) <= small / 5, "{large} against {small}");
}

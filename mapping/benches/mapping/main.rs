//! Diffusive mapping against bisection and METIS.
//!
//! `cargo bench -p equilux-mapping` maps about a hundred objects for each of 8 to 1,024 workers, of
//! equal and of unequal memory, and prints edge cuts, imbalances, steps and times; then what moves
//! when something changes. `-- 64 city` prints that for 64 workers and one kind of graph alone.
//!
//! METIS is no dependency: where its program `gpmetis` is on the path, it is run beside. Debian has
//! it in the package `metis`.

#![expect(clippy::print_stdout, reason = "a benchmark's figures are its output")]

mod guests;
mod metis;

use std::time::{Duration, Instant};

use equilux_common::ids::WorkerId;
use equilux_mapping::{Figures, Guest, Host, Mapping, Seat, Tie, bisect, diffuse};

use guests::{KINDS, Random};

/// Numbers of workers, and of graphs that each is measured with: small ones differ much.
const CASES: [(u32, u64); 4] = [(8, 16), (64, 4), (256, 2), (1024, 1)];

/// Objects for each worker.
const GRAIN: usize = 100;

/// Capacities of unequal workers: 1 to this many times the least.
const UNEQUAL: u64 = 4;

fn main() {
    let only: Vec<_> = std::env::args().skip(1).filter(|it| !it.starts_with('-')).collect();
    let words = |kind: &str, workers: u32| [kind.to_owned(), workers.to_string()];
    let is_asked =
        |kind: &str, workers: u32| only.iter().all(|word| words(kind, workers).contains(word));
    let cases = || {
        let all = KINDS.iter().flat_map(|&kind| CASES.map(|case| (kind, case)));
        all.filter(|((kind, _), (workers, _))| is_asked(kind, *workers))
    };
    if !metis::is_there() {
        println!("gpmetis is not on the path; Debian has it in the package metis");
    }
    println!(
        "| guest | memory | P | cut: bisection | METIS | diffusion | diffusion/METIS | worst \
         | imbalance: METIS | diffusion | steps | time: METIS | diffusion |"
    );
    for ((kind, make), (workers, count)) in cases() {
        for (memory, most) in [("equal", 1), ("unequal", UNEQUAL)] {
            let seeds = (1..=count).map(|seed| (make(GRAIN * workers as usize, seed), seed));
            let rows = seeds.map(|(guest, seed)| compare(&guest, &host(workers, most, seed)));
            println!("| {kind} | {memory} | {workers} | {} |", summary(&rows.collect::<Vec<_>>()));
        }
    }
    println!(
        "\n| guest | P | change | bytes that move at least | bisection | diffusion | from scratch \
              | cut/scratch | imbalance | steps |"
    );
    for ((kind, make), (workers, _)) in cases() {
        remap(kind, workers, &make(GRAIN * workers as usize, 1));
    }
}

/// What the three make of one graph.
struct Row {
    figures: [Figures; 3],
    steps: u32,
    times: [Duration; 2],
}

fn compare(guest: &Guest, host: &Host) -> Row {
    let bisection = bisect(guest, host).figures(guest, host);
    let started = now();
    let diffusion = diffuse(guest, host, None);
    let diffusion_time = started.elapsed();
    let started = now();
    let metis = if metis::is_there() { metis::map(guest, host) } else { bisect(guest, host) };
    let metis_time = started.elapsed();
    let figures = [metis, diffusion.mapping].map(|mapping| mapping.figures(guest, host));
    let [metis, own] = figures;
    Row {
        figures: [bisection, metis, own],
        steps: diffusion.steps,
        times: [metis_time, diffusion_time],
    }
}

/// Means over the graphs; of imbalances and ratios also the worst.
fn summary(rows: &[Row]) -> String {
    let count = rows.len() as f64;
    let mean = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let worst = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).fold(0.0, f64::max);
    let cut = |which: usize| move |row: &Row| row.figures[which].edge_cut as f64;
    let ratio = |row: &Row| cut(2)(row) / cut(1)(row);
    let imbalance = |which: usize| move |row: &Row| row.figures[which].imbalance;
    let time = |which: usize| move |row: &Row| row.times[which].as_secs_f64();
    format!(
        "{:.0} | {:.0} | {:.0} | {:.3} | {:.3} | {:.4} | {:.4} | {:.0} | {:.2} | {:.2}",
        mean(&cut(0)),
        mean(&cut(1)),
        mean(&cut(2)),
        mean(&cut(2)) / mean(&cut(1)),
        worst(&ratio),
        worst(&imbalance(1)),
        worst(&imbalance(2)),
        mean(&|row| f64::from(row.steps)),
        mean(&time(0)),
        mean(&time(1)),
    )
}

/// Prints what moves when something changes after a mapping.
fn remap(kind: &str, workers: u32, guest: &Guest) {
    let before = host(workers, 1, 1);
    let present = diffuse(guest, &before, None).mapping;
    let first = |capacity| {
        let mut seats = before.seats().to_vec();
        seats[workers as usize / 2].capacity = capacity;
        Host::new(seats).expect("a valid host")
    };
    let changes = [
        ("none", before.clone(), guest.clone()),
        ("one worker has half the memory", first(500), guest.clone()),
        ("one worker leaves", first(0), guest.clone()),
        ("ties of one object in eight are ten times stronger", before.clone(), stronger(guest)),
    ];
    for (change, host, guest) in changes {
        let diffusion = diffuse(&guest, &host, Some(&present));
        let scratch = diffuse(&guest, &host, None).mapping;
        let part = |mapping: &Mapping| {
            let moved = mapping.moved_bytes(&present, &guest) as f64;
            format!("{:.2}%", 100.0 * moved / guest.bytes() as f64)
        };
        let least = 100.0 * least_moved(&present, &guest, &host) as f64 / guest.bytes() as f64;
        let bisected = bisect(&guest, &host).moved_bytes(&bisect(&guest, &before), &guest);
        let [own, other] = [&diffusion.mapping, &scratch].map(|it| it.figures(&guest, &host));
        println!(
            "| {kind} | {workers} | {change} | {least:.2}% | {:.2}% | {} | {} | {:.3} | {:.4} | {} |",
            100.0 * bisected as f64 / guest.bytes() as f64,
            part(&diffusion.mapping),
            part(&scratch),
            own.edge_cut as f64 / other.edge_cut as f64,
            own.imbalance,
            diffusion.steps,
        );
    }
}

/// Bytes that must leave workers that have more than their share and three percent.
fn least_moved(present: &Mapping, guest: &Guest, host: &Host) -> u64 {
    let loads = present.loads(guest);
    let excess = host.seats().iter().map(|seat| {
        let share = guest.bytes() as f64 * seat.capacity as f64 / host.capacity() as f64;
        let load = loads.get(&seat.worker).copied().unwrap_or(0) as f64;
        (load - 1.03 * share).max(0.0)
    });
    excess.sum::<f64>() as u64
}

/// The same, but what is in one corner has ten times as much to do with what is around it.
fn stronger(guest: &Guest) -> Guest {
    let corner = guest.objects().len() / 8;
    let ties = guest.ties().iter().map(|&tie| {
        let is_in_corner = tie.objects.iter().all(|&object| object < corner);
        Tie { affinity: tie.affinity * if is_in_corner { 10 } else { 1 }, ..tie }
    });
    Guest::new(guest.objects().to_vec(), ties.collect()).expect("a valid guest")
}

fn host(workers: u32, most: u64, seed: u64) -> Host {
    let mut random = Random(seed);
    let seat = |worker| {
        let capacity = 1000 * random.integer(1, most);
        Seat { worker: WorkerId(worker), capacity }
    };
    Host::new((0..workers).map(seat).collect()).expect("a valid host")
}

#[expect(clippy::disallowed_methods, reason = "a benchmark is an edge")]
fn now() -> Instant {
    Instant::now()
}

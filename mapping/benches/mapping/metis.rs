//! METIS (Karypis & Kumar 1998), run as a program beside this one, if it is there.

use std::fmt::Write as _;
use std::fs;
use std::process::{Command, Stdio};

use equilux_mapping::{Guest, Host, Mapping};

/// What METIS may exceed a share by, in thousandths.
const UNEVENNESS: u32 = 30;

/// Whether the program is there.
pub(crate) fn is_there() -> bool {
    Command::new("gpmetis").arg("-help").stdout(Stdio::null()).status().is_ok()
}

/// Its mapping, by direct k-way partitioning.
pub(crate) fn map(guest: &Guest, host: &Host) -> Mapping {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = |name: &str| folder.path().join(name);
    fs::write(path("guest"), graph(guest)).expect("room for a file");
    fs::write(path("capacities"), capacities(host)).expect("room for a file");
    let count = host.seats().len().to_string();
    let status = Command::new("gpmetis")
        .arg(format!("-ufactor={UNEVENNESS}"))
        .arg(format!("-tpwgts={}", path("capacities").display()))
        .arg(path("guest"))
        .arg(&count)
        .stdout(Stdio::null())
        .status();
    assert!(status.expect("it can be started").success(), "METIS has failed");
    let homes = fs::read_to_string(path(&format!("guest.part.{count}"))).expect("its answer");
    let home = |line: &str| host.seats()[line.parse::<usize>().expect("a number")].worker;
    Mapping::new(homes.lines().map(home).collect())
}

/// The format of its manual: a line of counts, then for each object its bytes and its ties.
fn graph(guest: &Guest) -> String {
    let mut ends = vec![std::collections::BTreeMap::new(); guest.objects().len()];
    for tie in guest.ties().iter().filter(|tie| tie.objects[0] != tie.objects[1]) {
        for [from, to] in [tie.objects, [tie.objects[1], tie.objects[0]]] {
            *ends[from].entry(to + 1).or_insert(0) += tie.affinity;
        }
    }
    let count: usize = ends.iter().map(|ends| ends.len()).sum();
    let mut text = format!("{} {} 011\n", guest.objects().len(), count / 2);
    for (object, ends) in guest.objects().iter().zip(ends) {
        write!(text, "{}", object.bytes).expect("a string takes all");
        for (to, affinity) in ends {
            write!(text, " {to} {}", affinity.max(1)).expect("a string takes all");
        }
        text.push('\n');
    }
    text
}

fn capacities(host: &Host) -> String {
    let part = |capacity: u64| capacity as f64 / host.capacity() as f64;
    let lines = host.seats().iter().zip(0..);
    lines.map(|(seat, worker)| format!("{worker} = {}\n", part(seat.capacity))).collect()
}

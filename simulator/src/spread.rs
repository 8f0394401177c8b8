//! How long a scene takes to reach all workers, by the very plan of [`equilux_common::spread`].
//!
//! Every link out and every link in carries one piece at a time. A piece is on its way for the
//! latency, and the receiver's link takes it up as it leaves the sender's; whoever has the whole of
//! it passes it on. Children are served in turn. What the machines themselves do takes no time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

use equilux_common::spread::{Pieces, Tree};
use equilux_common::time::Time;

/// The time from the coordinator's first byte until the last of `workers` has a pack of `bytes`,
/// over links of that latency and bandwidth.
///
/// # Panics
/// If the bandwidth is zero.
#[must_use]
pub fn spread_time(
    workers: usize,
    bytes: u64,
    latency: Duration,
    bandwidth_bytes_per_second: u64,
) -> Duration {
    let network = Network { latency, bytes_per_second: bandwidth_bytes_per_second };
    Spreading::new(workers, Pieces::of(bytes), network).run()
}

#[derive(Clone, Copy, Debug)]
struct Network {
    latency: Duration,
    bytes_per_second: u64,
}

impl Network {
    /// How long a link is busy with so many bytes.
    fn duration(&self, bytes: u64) -> Duration {
        let nanos = u128::from(bytes) * 1_000_000_000 / u128::from(self.bytes_per_second);
        Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
    }
}

/// What comes next, the order of equals being fixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    /// A host has another piece of a tree.
    Arrived { host: usize, tree: Tree },
    /// A host's link out is free.
    Freed { host: usize },
}

/// A worker in one tree, as its parent sees it.
#[derive(Clone, Copy, Debug)]
struct Child {
    host: usize,
    tree: Tree,
    sent: u64,
}

/// A machine; the coordinator's is the last.
#[derive(Clone, Debug, Default)]
struct Host {
    /// Pieces of each tree that are whole here.
    arrived: [u64; 2],
    /// The one to be served next is the first.
    children: Vec<Child>,
    is_sending: bool,
    /// When the link in is free.
    receives_from: Time,
}

struct Spreading {
    pieces: Pieces,
    network: Network,
    hosts: Vec<Host>,
    agenda: BinaryHeap<Reverse<(Time, Event)>>,
}

impl Spreading {
    fn new(workers: usize, pieces: Pieces, network: Network) -> Self {
        let mut hosts = vec![Host::default(); workers + 1];
        hosts[workers].arrived = Tree::ALL.map(|tree| pieces.count(tree));
        for host in 0..workers {
            for tree in Tree::ALL {
                let parent = tree.parent(host, workers).unwrap_or(workers);
                hosts[parent].children.push(Child { host, tree, sent: 0 });
            }
        }
        let first = Reverse((Time::ZERO, Event::Freed { host: workers }));
        Self { pieces, network, hosts, agenda: BinaryHeap::from([first]) }
    }

    /// Until nothing is on its way; gives the time of the last arrival.
    fn run(mut self) -> Duration {
        let mut last = Time::ZERO;
        while let Some(Reverse((now, event))) = self.agenda.pop() {
            match event {
                Event::Arrived { host, tree } => {
                    last = now;
                    self.hosts[host].arrived[tree.index()] += 1;
                    self.send(now, host);
                }
                Event::Freed { host } => {
                    self.hosts[host].is_sending = false;
                    self.send(now, host);
                }
            }
        }
        for host in &self.hosts {
            assert_eq!(host.arrived, Tree::ALL.map(|tree| self.pieces.count(tree)));
        }
        last.since(Time::ZERO)
    }

    /// Passes a piece on if the link is free and a child lacks what is here.
    fn send(&mut self, now: Time, from: usize) {
        let host = &mut self.hosts[from];
        let lacks = |child: &Child| child.sent < host.arrived[child.tree.index()];
        let Some(next) = host.children.iter().position(lacks).filter(|_| !host.is_sending) else {
            return;
        };
        let mut child = host.children.remove(next);
        let range = self.pieces.range(child.tree, child.sent).expect("a piece that is here");
        let duration = self.network.duration(range.end - range.start);
        child.sent += 1;
        host.children.push(child);
        host.is_sending = true;
        let receiver = &mut self.hosts[child.host];
        receiver.receives_from = receiver.receives_from.max(now + self.network.latency) + duration;
        let arrived = Event::Arrived { host: child.host, tree: child.tree };
        self.agenda.push(Reverse((receiver.receives_from, arrived)));
        self.agenda.push(Reverse((now + duration, Event::Freed { host: from })));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLUSTER: Network =
        Network { latency: Duration::from_micros(10), bytes_per_second: 12_500_000_000 };
    const ETHERNET: Network =
        Network { latency: Duration::from_micros(200), bytes_per_second: 125_000_000 };
    const MIB: u64 = 1 << 20;

    fn once(bytes: u64, network: Network) -> Duration {
        network.latency + network.duration(bytes)
    }

    fn spread(workers: usize, bytes: u64, network: Network) -> Duration {
        spread_time(workers, bytes, network.latency, network.bytes_per_second)
    }

    /// How many times as long as to send it once.
    fn ratio(workers: usize, bytes: u64, network: Network) -> f64 {
        spread(workers, bytes, network).as_secs_f64() / once(bytes, network).as_secs_f64()
    }

    #[test]
    fn a_thousand_workers_have_a_scene_in_twice_the_time_to_send_it_once() {
        let cases =
            [(64 * MIB, CLUSTER), (MIB, ETHERNET), (20 * MIB, ETHERNET), (1024 * MIB, ETHERNET)];
        for (bytes, network) in cases {
            let ratio = ratio(1024, bytes, network);
            assert!(ratio <= 2.0, "{bytes} bytes, {network:?}: {ratio}");
        }
    }

    /// Ten times the latency is more than twice the time of a pack that takes less than that.
    #[test]
    fn so_it_is_from_the_smallest_pack_that_hides_the_latency() {
        for (bytes, network) in [(448 << 10, ETHERNET), (1408 << 10, CLUSTER)] {
            let ratio = ratio(1024, bytes, network);
            assert!((1.8..=2.0).contains(&ratio), "{bytes} bytes, {network:?}: {ratio}");
        }
    }

    #[test]
    fn one_worker_has_it_as_soon_as_it_is_sent() {
        for bytes in [0, 1, 8 << 10, 300_000, 20 * MIB] {
            let (once, one) = (once(bytes, ETHERNET), spread(1, bytes, ETHERNET));
            let rounding = Duration::from_nanos(Pieces::of(bytes).count(Tree::Even) * 2);
            let expected = if bytes == 0 { Duration::ZERO } else { once };
            assert!(one <= expected && expected <= one + rounding, "{bytes} bytes: {one:?}");
        }
    }

    /// A level of the trees costs a latency, and the time of a few pieces: the one that comes in,
    /// and those that the sender's and the receiver's links are busy with meanwhile.
    #[test]
    fn beyond_that_time_grows_with_the_depth_of_the_trees() {
        for (bytes, network) in [(MIB, ETHERNET), (20 * MIB, ETHERNET), (64 * MIB, CLUSTER)] {
            let piece = Pieces::of(bytes).range(Tree::Even, 0).expect("a piece").end;
            let level = network.latency + 4 * network.duration(piece);
            for workers in [1usize, 2, 3, 8, 37, 64, 100, 512, 1000] {
                let depth = workers.ilog2() + 1;
                let most = once(bytes, network) + depth * level;
                let time = spread(workers, bytes, network);
                assert!(time <= most, "{workers} workers, {bytes} bytes: {time:?}, {most:?}");
            }
        }
    }
}

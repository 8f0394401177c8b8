//! The network: links that carry one message after another, and processors that handle them.
//!
//! A message takes its sender's link out and its receiver's link in for as long as its bytes need,
//! and reaches the latter a latency after it entered the former; on the way nothing waits. So
//! messages of many to one take turns at the one, and overlap elsewhere. Between two ends they
//! arrive in the order in which they were sent, whatever happens to each: a message that is lost is
//! sent again, and holds up those behind it.
//!
//! Handling takes processor time at both ends. A core takes one message after another, while the
//! tasks of its connections read and write them beside one another.

use std::collections::BTreeMap;
use std::str::FromStr;
use std::time::Duration;

use equilux_common::time::Time;

use crate::random::Random;
use crate::wire;

/// Bandwidth of links on which messages take no time.
pub const BANDWIDTH_UNLIMITED: u64 = u64::MAX;

/// One-way trips until a new connection can be used: the handshakes of TCP and HTTP/2, greetings.
const GREETING_TRIPS: u32 = 4;

/// How messages travel, and what they cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NetworkModel {
    /// How long the first byte of a message is under way, at least.
    pub latency: Duration,
    /// Up to so much more.
    pub jitter: Duration,
    /// Bytes per second of every link, each way.
    pub bandwidth: u64,
    /// Whether all links are one cable, on which one message travels at a time.
    pub is_shared: bool,
    /// Time of each end's core for each message; a core takes one after another.
    pub core: Duration,
    /// Processor time of each end for each message besides: system calls, streams, tasks.
    pub message_processor: Duration,
    /// Processor time of each end for each thousand bytes of a message.
    pub kilobyte_processor: Duration,
    /// Bytes per second at which a machine reads partitions from its disk, with one of its
    /// processors.
    pub disk: u64,
    /// Of a million messages, how many are lost and sent again.
    pub loss: u32,
    /// Lost messages are late by up to so much.
    pub resend: Duration,
}

/// A word that names no network.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown network `{0}`; one of cluster, ethernet, 1996 is expected")]
pub struct UnknownNetwork(String);

impl NetworkModel {
    /// A cluster's interconnect: 10 µs, 100 Gbit/s.
    #[must_use]
    pub const fn cluster() -> Self {
        Self {
            latency: Duration::from_micros(10),
            jitter: Duration::from_micros(1),
            bandwidth: 12_500_000_000,
            is_shared: false,
            // Measured (`cargo bench --bench cores`): 0.1 to 0.4 µs, and 0.15 µs for deliveries of
            // the small tiles that a job on thousands of workers has.
            core: Duration::from_nanos(300),
            // Measured (`cargo bench --bench messages`): 6 to 10 µs, and about 0.5 µs.
            message_processor: Duration::from_micros(8),
            kilobyte_processor: Duration::from_nanos(500),
            // A guess: `cargo bench -p equilux-store --bench build` came to 0.6 GB/s, from the
            // system's cache, while others used the machine.
            disk: 1_000_000_000,
            loss: 0,
            resend: Duration::ZERO,
        }
    }

    /// Computers on a switch: 200 µs, 1 Gbit/s; a message in a million is lost.
    #[must_use]
    pub const fn ethernet() -> Self {
        Self {
            latency: Duration::from_micros(200),
            jitter: Duration::from_micros(20),
            bandwidth: 125_000_000,
            disk: 500_000_000,
            loss: 1,
            // Linux sends again after 200 ms at the latest.
            resend: Duration::from_millis(200),
            ..Self::cluster()
        }
    }

    /// The workstations of the paper: one cable of 10 Mbit/s for all. Heirich & Arvo 1996, section
    /// 4, lose 2 to 10% of the processor in polling for messages; here nobody polls, but each
    /// message costs what it took the kernels and message libraries of that time.
    #[must_use]
    pub const fn workstations() -> Self {
        Self {
            latency: Duration::from_millis(1),
            jitter: Duration::from_micros(200),
            bandwidth: 1_250_000,
            is_shared: true,
            core: Duration::from_micros(100),
            message_processor: Duration::from_micros(400),
            kilobyte_processor: Duration::from_micros(100),
            disk: 2_000_000,
            loss: 10,
            resend: Duration::from_secs(1),
        }
    }

    /// How long a message of so many bytes takes a link.
    #[must_use]
    pub fn transfer(&self, bytes: u64) -> Duration {
        time_for(wire::line_bytes(bytes), self.bandwidth)
    }

    /// How long a machine takes to read so many bytes from its disk.
    #[must_use]
    pub fn disk_read(&self, bytes: u64) -> Duration {
        time_for(bytes, self.disk)
    }

    /// Processor time of reading or writing so many bytes.
    fn reading(&self, bytes: u64) -> Duration {
        let nanos = self.kilobyte_processor.as_nanos() * u128::from(bytes) / 1000;
        self.message_processor + Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
    }

    /// Processor time that a message of so many bytes costs each end.
    #[must_use]
    pub fn processor(&self, bytes: u64) -> Duration {
        self.core + self.reading(bytes)
    }
}

/// How long so many bytes take at so many per second.
fn time_for(bytes: u64, bandwidth: u64) -> Duration {
    if bandwidth == BANDWIDTH_UNLIMITED {
        return Duration::ZERO;
    }
    let nanos = u128::from(bytes) * 1_000_000_000 / u128::from(bandwidth.max(1));
    Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
}

impl FromStr for NetworkModel {
    type Err = UnknownNetwork;

    fn from_str(word: &str) -> Result<Self, UnknownNetwork> {
        match word {
            "cluster" => Ok(Self::cluster()),
            "ethernet" => Ok(Self::ethernet()),
            "1996" => Ok(Self::workstations()),
            _ => Err(UnknownNetwork(word.into())),
        }
    }
}

/// One end of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum End {
    Coordinator,
    /// A host, by its position among all that ever were.
    Host(usize),
}

impl End {
    const fn index(self) -> usize {
        match self {
            Self::Coordinator => 0,
            Self::Host(host) => host + 1,
        }
    }
}

/// A message as the network sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trip {
    pub(crate) from: End,
    pub(crate) to: End,
    pub(crate) bytes: u64,
    /// How many ordinary messages' time the sender's core takes for it.
    pub(crate) toil: u32,
}

/// When the resources of an end are free, and what came from whom last.
#[derive(Clone, Debug, Default)]
struct Station {
    outward: Time,
    inward: Time,
    core: Time,
    orders: BTreeMap<End, Order>,
}

/// When the last message from one end to another reached it, and was in its hands.
#[derive(Clone, Copy, Debug, Default)]
struct Order {
    reached: Time,
    arrived: Time,
}

/// All links.
#[derive(Debug)]
pub(crate) struct Network {
    model: NetworkModel,
    random: Random,
    stations: Vec<Station>,
}

impl Network {
    pub(crate) const fn new(model: NetworkModel, random: Random) -> Self {
        Self { model, random, stations: Vec::new() }
    }

    /// A message is sent now: when its first byte reaches the receiver's link.
    pub(crate) fn depart(&mut self, now: Time, trip: Trip) -> Time {
        let model = self.model;
        let station = self.station(trip.from);
        station.core = station.core.max(now) + model.core * trip.toil;
        let written = station.core + model.reading(trip.bytes);
        // The coordinator's link out stands for the one cable where there is just one.
        let line = if model.is_shared { End::Coordinator } else { trip.from };
        let outward = &mut self.station(line).outward;
        let start = written.max(*outward);
        *outward = start + model.transfer(trip.bytes);
        let soonest = start + self.delay();
        let order = self.station(trip.to).orders.entry(trip.from).or_default();
        order.reached = soonest.max(order.reached + Duration::from_nanos(1));
        order.reached
    }

    /// The first byte of a message has reached the receiver's link: when it is in its hands.
    pub(crate) fn arrive(&mut self, now: Time, trip: Trip) -> Time {
        let model = self.model;
        let station = self.station(trip.to);
        let start = if model.is_shared { now } else { now.max(station.inward) };
        station.inward = start + model.transfer(trip.bytes);
        let read = station.inward + model.reading(trip.bytes);
        station.core = station.core.max(station.inward) + model.core;
        let handled = station.core.max(read + model.core);
        let order = station.orders.entry(trip.from).or_default();
        order.arrived = handled.max(order.arrived + Duration::from_nanos(1));
        order.arrived
    }

    /// A delay like that of a small message, for things that are bound to no link.
    pub(crate) fn delay(&mut self) -> Duration {
        let NetworkModel { latency, jitter, loss, resend, .. } = self.model;
        let is_lost = self.random.within(1..=1_000_000) <= u64::from(loss);
        let late = if is_lost { resend } else { Duration::ZERO };
        latency + self.random.duration(Duration::ZERO..=jitter + late)
    }

    /// How long it takes until a new connection can be used.
    pub(crate) fn greeting(&mut self) -> Duration {
        (0..GREETING_TRIPS).map(|_| self.delay()).sum()
    }

    fn station(&mut self, end: End) -> &mut Station {
        if self.stations.len() <= end.index() {
            self.stations.resize_with(end.index() + 1, Station::default);
        }
        &mut self.stations[end.index()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Only links take time: 1 GB/s, 100 µs.
    fn plain() -> NetworkModel {
        NetworkModel {
            latency: Duration::from_micros(100),
            jitter: Duration::ZERO,
            bandwidth: 1_000_000_000,
            is_shared: false,
            core: Duration::ZERO,
            message_processor: Duration::ZERO,
            kilobyte_processor: Duration::ZERO,
            disk: BANDWIDTH_UNLIMITED,
            loss: 0,
            resend: Duration::ZERO,
        }
    }

    /// Sends messages at the given times; gives when each is in its receiver's hands.
    fn arrivals(model: NetworkModel, trips: &[(Time, Trip)]) -> Vec<Time> {
        let mut network = Network::new(model, Random::new(3));
        let mut reached: Vec<(Time, usize)> = Vec::new();
        for (index, &(time, trip)) in trips.iter().enumerate() {
            reached.push((network.depart(time, trip), index));
        }
        reached.sort_unstable();
        let mut arrived = vec![Time::ZERO; trips.len()];
        for (time, index) in reached {
            arrived[index] = network.arrive(time, trips[index].1);
        }
        arrived
    }

    fn trip(from: usize, to: usize, bytes: u64) -> Trip {
        Trip { from: End::Host(from), to: End::Host(to), bytes, toil: 1 }
    }

    const MEGABYTE: u64 = 1_000_000;

    #[test]
    fn a_message_takes_the_latency_and_its_bytes_over_the_bandwidth() {
        let transfer = plain().transfer(MEGABYTE);
        let expected = Duration::from_nanos(wire::line_bytes(MEGABYTE));
        assert_eq!(transfer, expected);
        let arrived = arrivals(plain(), &[(Time::ZERO, trip(0, 1, MEGABYTE))]);
        assert_eq!(arrived, [Time::ZERO + Duration::from_micros(100) + transfer]);
    }

    #[test]
    fn two_senders_to_one_receiver_take_turns_and_others_do_not_wait() {
        let trips = [trip(0, 2, MEGABYTE), trip(1, 2, MEGABYTE), trip(3, 4, MEGABYTE)];
        let arrived = arrivals(plain(), &trips.map(|trip| (Time::ZERO, trip)));
        let (latency, transfer) = (Duration::from_micros(100), plain().transfer(MEGABYTE));
        let once = Time::ZERO + latency + transfer;
        assert_eq!(arrived, [once, once + transfer, once]);
        let shared = NetworkModel { is_shared: true, ..plain() };
        let arrived = arrivals(shared, &trips.map(|trip| (Time::ZERO, trip)));
        assert_eq!(arrived, [once, once + transfer, once + 2 * transfer]);
    }

    #[test]
    fn a_core_takes_one_message_after_another_while_others_are_read() {
        let us = Duration::from_micros;
        let bandwidth = BANDWIDTH_UNLIMITED;
        let model = NetworkModel { core: us(2), message_processor: us(10), bandwidth, ..plain() };
        let trips = [0, 1, 3].map(|from| (Time::ZERO, trip(from, 2, 10)));
        let first = Time::ZERO + us(2 + 10 + 100 + 10 + 2);
        assert_eq!(arrivals(model, &trips), [first, first, first]);
        assert_eq!(model.processor(0), us(12));
    }

    #[test]
    fn networks_have_names() {
        assert_eq!("ethernet".parse(), Ok(NetworkModel::ethernet()));
        assert_eq!("1996".parse(), Ok(NetworkModel::workstations()));
        let unknown = "token ring".parse::<NetworkModel>().expect_err("no such network");
        assert!(unknown.to_string().contains("cluster, ethernet, 1996"));
    }

    proptest! {
        #[test]
        fn loss_only_delays_and_keeps_the_order_of_each_pair(
            messages in prop::collection::vec((0usize..3, 3usize..5, 1u64..100_000), 1..60),
        ) {
            let at = |index: usize| Time::ZERO + Duration::from_micros(10 * index as u64);
            let trips: Vec<_> = messages.iter().enumerate()
                .map(|(index, &(from, to, bytes))| (at(index), trip(from, to, bytes))).collect();
            let lossy = NetworkModel { loss: 300_000, resend: Duration::from_millis(3), ..plain() };
            let (calm, late) = (arrivals(plain(), &trips), arrivals(lossy, &trips));
            for (index, &(from, to, _)) in messages.iter().enumerate() {
                let least = at(index) + Duration::from_micros(100);
                prop_assert!(late[index] > least && calm[index] > least);
                for earlier in 0..index {
                    if (messages[earlier].0, messages[earlier].1) == (from, to) {
                        prop_assert!(late[earlier] < late[index]);
                    }
                }
            }
        }
    }
}

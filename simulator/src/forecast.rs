//! Forecasts: how long a cluster would take for a job, what limits it, and who does what when.
//!
//! The cores are the real ones; paths cost what was measured ([`crate::costs`]), messages what the
//! network says ([`crate::network`]). Times count from the submission of a job whose scene every
//! worker has in its cache, when all workers that are there from the start have been let in.

use std::time::Duration;

use equilux_common::balancing::Balancing;
use equilux_common::costs::SceneCosts;
use equilux_common::ids::JobId;
use equilux_common::time::Time;
use equilux_common::topology::Topology;
use equilux_coordinator_core::action::JobState;
use equilux_coordinator_core::event::JobOrder;

use crate::counts::Counts;
use crate::host::HostRecord;
pub use crate::load_map::LoadMap;
use crate::network::NetworkModel;
use crate::recorded::RecordedTracer;
use crate::scenario;
use crate::simulation::Simulation;
use crate::view::JobEnd;

/// Loads are looked at so many times in the shortest time that the work can take.
const INSTANTS: u32 = 200;

/// A cluster and what it is to render.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// Names everything that is random.
    pub seed: u64,
    /// The network.
    pub network: NetworkModel,
    /// The workers.
    pub workers: Vec<SimulatedWorker>,
    /// Which of them are neighbors.
    pub topology: Topology,
    /// How work is spread.
    pub balancing: Balancing,
    /// How much there is to do.
    pub amount: Amount,
}

/// A worker of a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SimulatedWorker {
    /// Compute threads.
    pub threads: u32,
    /// Speed of each; 1000 is that of the machine that recorded the costs.
    pub speed: u32,
    /// Bytes of memory for a model that is cut into partitions; if nobody is limited, all have all
    /// of it in memory from the start.
    pub memory: Option<u64>,
    /// When it comes, from the submission on; zero: it is there before.
    pub joins: Duration,
    /// Its speed from then on, from the submission on.
    pub changes: Vec<(Duration, u32)>,
}

/// How much there is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Amount {
    /// The recorded image and samples with so many times as many pixels: 9 is three times as wide
    /// and high.
    Size(u32),
    /// So much work of one thread of speed 1000: at 640 × 480, as many samples as that takes, and
    /// costs scaled by the little that makes it exact.
    Work(Duration),
}

/// What is to be expected.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// From the submission to the image being whole.
    pub elapsed: Duration,
    /// Compute time of all rays on one thread of speed 1000.
    pub work: Duration,
    /// When the last ray ended.
    pub last_ray: Duration,
    /// The workers, in the scenario's order.
    pub workers: Vec<WorkerForecast>,
    /// Everybody's load over time.
    pub loads: LoadMap,
    /// Messages of all, greetings before the submission included.
    pub counts: Counts,
    /// Camera samples.
    pub paths: u64,
    /// Messages that were sent from the end of the last ray until the image was whole.
    pub messages_after_last: u64,
    /// What the threads that were there could have computed, in time of one of speed 1000.
    pub capacity: Duration,
}

/// One worker's part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WorkerForecast {
    /// When its last ray ended; zero if it traced none.
    pub finish: Duration,
    /// Time that its threads spent on work, added over threads.
    pub busy: Duration,
    /// Processor time that its messages took.
    pub messages_processor: Duration,
    /// Messages that it sent.
    pub messages_out: u64,
    /// Messages that it received.
    pub messages_in: u64,
    /// Bytes that it sent.
    pub bytes_out: u64,
    /// Bytes that it received.
    pub bytes_in: u64,
    /// Partitions that it read.
    pub loads: u64,
    /// Deadlines of its core that came.
    pub wakes: u64,
    /// Events other than messages that its core handled while its threads had nothing to do.
    pub idle_wakes: u64,
    /// Whether it came before the end.
    pub took_part: bool,
}

impl Forecast {
    /// The largest difference of finishing times among those who took part.
    #[must_use]
    pub fn spread(&self) -> Duration {
        let part = self.workers.iter().filter(|worker| worker.took_part);
        let finishes = part.map(|worker| worker.finish);
        let latest = finishes.clone().max().unwrap_or_default();
        latest - finishes.min().unwrap_or_default()
    }

    /// The part of what the workers could have computed that was needed.
    #[must_use]
    pub fn efficiency(&self) -> f64 {
        self.work.as_secs_f64() / self.capacity.as_secs_f64()
    }

    /// How many times faster than one thread of speed 1000.
    #[must_use]
    pub fn speedup(&self) -> f64 {
        self.work.as_secs_f64() / self.elapsed.as_secs_f64()
    }
}

/// Plays a scenario. The same one always comes to the same.
///
/// # Panics
/// If the cores break one of their own rules.
#[must_use]
pub fn forecast(costs: &SceneCosts, scenario: &Scenario) -> Forecast {
    let (spec, factor) = scenario::job(costs, scenario);
    let job = spec.id;
    let paths =
        spec.settings.region().pixel_count() as u64 * u64::from(spec.settings.samples_per_pixel);
    let tracer = RecordedTracer::new(scenario, costs, &spec.settings, factor);
    let mut simulation = Simulation::new(scenario::plan(costs, scenario), tracer);
    simulation.run();
    let submitted = simulation.now();
    schedule_changes(&mut simulation, scenario);
    let present = scenario::present(scenario).count();
    simulation.submit(JobOrder {
        spec,
        balancing: scenario.balancing,
        topology: scenario.topology.clone(),
        workers_min: u32::try_from(present).unwrap_or(u32::MAX).max(1),
        is_partitioned: scenario::cut(costs, scenario).is_some(),
    });
    let mut loads = LoadMap::new(shortest(costs, scenario) / INSTANTS);
    let end = run(&mut simulation, job, submitted, &mut loads);
    Forecast { paths, ..describe(&simulation, scenario, submitted, end, loads) }
}

/// What is to happen after the submission.
fn schedule_changes(simulation: &mut Simulation<RecordedTracer>, scenario: &Scenario) {
    for (machine, worker) in scenario.workers.iter().enumerate() {
        if !worker.joins.is_zero() {
            simulation.turn_in(worker.joins, machine);
        }
        for &(when, speed) in &worker.changes {
            simulation.change_speed_in(when, machine, speed);
        }
    }
}

/// The shortest time that the work can take with all workers from the start.
pub(crate) fn shortest(costs: &SceneCosts, scenario: &Scenario) -> Duration {
    let (spec, factor) = scenario::job(costs, scenario);
    let (width, height) = (spec.settings.width, spec.settings.height);
    let pass = crate::cells::pass_cost(costs, width, height).as_secs_f64() * factor;
    let speed = |worker: &SimulatedWorker| {
        f64::from(worker.threads.max(1)) * f64::from(worker.speed.max(1)) / 1000.0
    };
    let speeds: f64 = scenario.workers.iter().map(speed).sum();
    Duration::from_secs_f64(pass * f64::from(spec.settings.samples_per_pixel) / speeds.max(1e-3))
        .max(Duration::from_micros(1))
}

/// Runs until the job is over, and looks at everybody's load now and then.
fn run(
    simulation: &mut Simulation<RecordedTracer>,
    job: JobId,
    submitted: Time,
    loads: &mut LoadMap,
) -> JobEnd {
    loop {
        let view = &simulation.jobs()[&job];
        if let (Some(end), Some(report)) = (view.end, &view.report) {
            assert_eq!(report.state, JobState::Done, "a job that nothing keeps from its end");
            return end;
        }
        let next = simulation.next_time().expect("a job that has not ended goes on");
        while next > submitted + loads.next() {
            loads.push(simulation.loads());
        }
        let _ = simulation.step();
    }
}

fn describe(
    simulation: &Simulation<RecordedTracer>,
    scenario: &Scenario,
    submitted: Time,
    end: JobEnd,
    loads: LoadMap,
) -> Forecast {
    let elapsed = end.time.since(submitted);
    let workers = scenario.workers.iter().enumerate();
    let worker = |(machine, worker): (usize, &SimulatedWorker)| {
        let record = simulation.record(machine).unwrap_or_default();
        worker_forecast(&record, submitted, worker.joins < elapsed)
    };
    Forecast {
        elapsed,
        work: simulation.work(),
        last_ray: end.last_ray.since(submitted),
        workers: workers.map(worker).collect(),
        loads,
        counts: simulation.counts(),
        paths: 0,
        messages_after_last: end.messages_after,
        capacity: scenario.workers.iter().map(|worker| capacity(worker, elapsed)).sum(),
    }
}

fn worker_forecast(record: &HostRecord, submitted: Time, took_part: bool) -> WorkerForecast {
    WorkerForecast {
        finish: record.last_ray.since(submitted),
        busy: record.busy,
        messages_processor: record.messages_processor,
        messages_out: record.messages_out,
        messages_in: record.messages_in,
        bytes_out: record.bytes_out,
        bytes_in: record.bytes_in,
        loads: record.loads,
        wakes: record.wakes,
        idle_wakes: record.idle_wakes,
        took_part,
    }
}

/// What a worker could have computed until the end, in time of one thread of speed 1000.
fn capacity(worker: &SimulatedWorker, end: Duration) -> Duration {
    let mut changes = worker.changes.clone();
    changes.sort_by_key(|&(when, _)| when);
    let (mut from, mut speed, mut sum) = (Duration::ZERO, worker.speed, Duration::ZERO);
    for (when, next) in changes.into_iter().chain([(end, 0)]) {
        let span = when.min(end).saturating_sub(from.max(worker.joins));
        sum += span * speed * worker.threads / 1000;
        (from, speed) = (when, next);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::tests::{costs, scenario};

    fn cluster(count: usize, work: Duration) -> Scenario {
        let mut scenario = scenario(Amount::Work(work));
        scenario.workers = vec![scenario.workers[0].clone(); count];
        scenario
    }

    fn ratio(part: Duration, whole: Duration) -> f64 {
        part.as_secs_f64() / whole.as_secs_f64()
    }

    #[test]
    fn one_worker_takes_as_long_as_the_work_and_the_start() {
        let work = Duration::from_secs(20);
        let forecast = forecast(&costs(), &cluster(1, work));
        assert!((ratio(forecast.work, work) - 1.0).abs() < 1e-3, "{:?}", forecast.work);
        let expected = forecast.work + Duration::from_secs_f64(costs().prepare_s);
        let late = ratio(forecast.elapsed, expected) - 1.0;
        assert!((0.0..2e-3).contains(&late), "{:?}", forecast.elapsed);
        assert!((1..=2).contains(&forecast.messages_after_last));
        assert!(forecast.loads.seconds.len() >= 200);
        // What the core takes for half of the work, by what paths have cost of late.
        let half = forecast.loads.seconds[100][0];
        assert!((1.0..20.0).contains(&half), "{half} s of work are left at half time");
    }

    #[test]
    fn a_scenario_is_played_the_same_each_time() {
        let mut scenario = cluster(9, Duration::from_secs(2));
        scenario.network = NetworkModel { loss: 1000, ..NetworkModel::ethernet() };
        assert_eq!(forecast(&costs(), &scenario), forecast(&costs(), &scenario));
        let other = forecast(&costs(), &Scenario { seed: 2, ..scenario.clone() });
        assert_ne!(other.elapsed, forecast(&costs(), &scenario).elapsed);
    }

    #[test]
    fn balancing_evens_out_what_the_start_did_not() {
        let mut scenario = cluster(8, Duration::from_secs(8));
        let balanced = forecast(&costs(), &scenario);
        scenario.balancing.balance = equilux_common::balancing::Balance::None;
        let unbalanced = forecast(&costs(), &scenario);
        assert!(balanced.efficiency() > 0.9 && unbalanced.efficiency() < 0.8);
        assert!(balanced.spread() < unbalanced.spread() / 4);
        assert!(balanced.speedup() > 7.2 && balanced.speedup() <= 8.0);
        let idle: u64 = balanced.workers.iter().map(|worker| worker.idle_wakes).sum();
        assert!(idle <= 8 * 8, "{idle} wakes of idle workers");
    }

    #[test]
    fn a_speed_that_changes_in_the_middle_of_a_piece_counts_from_then_on() {
        let mut scenario = cluster(1, Duration::from_secs(4));
        scenario.workers[0].changes = vec![(Duration::from_secs(2), 500)];
        let (core, message_processor, kilobyte_processor) = Default::default();
        scenario.network =
            NetworkModel { core, message_processor, kilobyte_processor, ..scenario.network };
        let forecast = forecast(&costs(), &scenario);
        let expected = forecast.work * 2 - Duration::from_secs(2);
        assert!((ratio(forecast.elapsed, expected) - 1.0).abs() < 2e-3, "{:?}", forecast.elapsed);
        assert!(forecast.efficiency() > 0.995, "{}", forecast.efficiency());
    }

    #[test]
    fn who_joins_later_takes_part_from_then_on() {
        let mut scenario = cluster(8, Duration::from_secs(8));
        for worker in &mut scenario.workers[1..] {
            worker.joins = Duration::from_millis(1);
        }
        let forecast = forecast(&costs(), &scenario);
        assert!(forecast.efficiency() > 0.8, "{}", forecast.efficiency());
        assert!(forecast.workers.iter().all(|worker| worker.took_part && worker.messages_in > 0));
    }

    #[test]
    fn capacity_is_that_of_the_time_in_which_a_worker_is_there() {
        let worker = SimulatedWorker {
            threads: 2,
            speed: 1000,
            memory: None,
            joins: Duration::from_secs(1),
            changes: vec![(Duration::from_secs(3), 500), (Duration::from_secs(90), 1)],
        };
        assert_eq!(capacity(&worker, Duration::from_secs(5)), Duration::from_secs(4 + 2));
        assert_eq!(capacity(&worker, Duration::from_millis(500)), Duration::ZERO);
    }
}

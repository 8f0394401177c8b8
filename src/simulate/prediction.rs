//! Forecasts of every model, extent and number of workers, as many at a time as there are cores.

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use equilux_common::balancing::{Balance, Word};
use equilux_common::costs::SceneCosts;
use equilux_common::itinerary::PartitionedCosts;
use equilux_simulator::case::Case;
use equilux_simulator::forecast::{Amount, Forecast, Scenario, SimulatedWorker, forecast};
use futures::{StreamExt, TryStreamExt, stream};

use super::model::Model;
use crate::args::SimulateArgs;
use crate::comparison::{Comparison, Outcome};
use crate::overrides;
use crate::subject::{Extent, Subject};
use crate::table::time;

/// Speed of a worker: that of the machine that recorded the costs.
const SPEED: u32 = 1000;

/// A number of workers for a model.
pub(crate) struct Prediction {
    /// How work was spread in the run with balancing.
    pub(crate) balance: Balance,
    /// What is compared.
    pub(crate) compared: Comparison,
    /// Everything that is known of the run without balancing.
    pub(crate) without: Arc<Forecast>,
    /// Everything that is known of the run with balancing.
    pub(crate) with: Arc<Forecast>,
}

/// What is to be forecast.
struct Trial {
    subject: Subject,
    costs: Arc<SceneCosts>,
    workers: u32,
}

/// Everything that the command line asks for: by model, extent and number of workers.
pub(crate) async fn all(args: &SimulateArgs, models: &[Model]) -> anyhow::Result<Vec<Prediction>> {
    let trials = trials(args, models);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let pairs = trials.iter().map(|trial| pair(args, trial));
    let forecasts: Vec<[Arc<Forecast>; 2]> =
        stream::iter(pairs).buffered(threads.div_ceil(2)).try_collect().await?;
    let mut alone = Duration::ZERO;
    let predictions = trials.into_iter().zip(forecasts).map(|(trial, [without, with])| {
        // One worker comes first, and its time is what the others are compared with.
        alone = if trial.workers == 1 { with.elapsed } else { alone };
        let Trial { subject, workers, .. } = trial;
        let [first, second] = [&without, &with].map(|forecast| outcome(forecast));
        let compared = Comparison { subject, workers, alone, without: first, with: second };
        Prediction { balance: args.balance, compared, without, with }
    });
    Ok(predictions.collect())
}

/// A single worker, of which there is but one case, comes before all others of its kind.
fn trials(args: &SimulateArgs, models: &[Model]) -> Vec<Trial> {
    let extents: Vec<Extent> = match args.work {
        Some(seconds) => vec![Extent::Work(seconds)],
        None => args.sizes.0.iter().map(|&size| Extent::Size(size)).collect(),
    };
    let counts = args.workers.with_one();
    let mut trials = Vec::new();
    for model in models {
        for &extent in &extents {
            let trial = |case, workers| Trial {
                subject: Subject { model: model.name.clone(), extent, case },
                costs: model.costs.clone(),
                workers,
            };
            trials.push(trial(Case::Even, 1));
            for case in args.cases() {
                let many = counts.iter().filter(|&&workers| workers > 1);
                trials.extend(many.map(|&workers| trial(case, workers)));
            }
        }
    }
    trials
}

/// Without and with balancing; one worker has nobody to exchange work with.
async fn pair(args: &SimulateArgs, trial: &Trial) -> anyhow::Result<[Arc<Forecast>; 2]> {
    if trial.workers == 1 {
        let only = one(args, trial, args.balance).await?;
        return Ok([only.clone(), only]);
    }
    let (without, with) =
        futures::try_join!(one(args, trial, Balance::None), one(args, trial, args.balance))?;
    Ok([without, with])
}

async fn one(
    args: &SimulateArgs,
    trial: &Trial,
    balance: Balance,
) -> anyhow::Result<Arc<Forecast>> {
    let scenario = scenario(args, trial, balance);
    let costs = trial.costs.clone();
    let played = tokio::task::spawn_blocking(move || forecast(&costs, &scenario));
    let forecast = played.await.context("the simulation failed")?;
    let (label, workers) = (trial.subject.label(), trial.workers);
    let elapsed = time(forecast.elapsed.as_secs_f64());
    eprintln!("{label}, {workers} workers, balance {}: {elapsed}", balance.name());
    Ok(Arc::new(forecast))
}

fn scenario(args: &SimulateArgs, trial: &Trial, balance: Balance) -> Scenario {
    let even = Scenario {
        seed: args.seed,
        network: args.network.model,
        workers: vec![worker_of(args, trial); trial.workers as usize],
        topology: args.spread.topology.0.clone(),
        balancing: overrides::balancing(balance, &args.spread),
        amount: match trial.subject.extent {
            Extent::Size(size) => Amount::Size(size),
            Extent::Work(seconds) => Amount::Work(Duration::from_secs_f64(seconds)),
        },
    };
    trial.subject.case.of(&trial.costs, even)
}

/// A worker as the command line describes it. One alone is what others are compared with: it has
/// one thread, and all of the model in memory.
fn worker_of(args: &SimulateArgs, trial: &Trial) -> SimulatedWorker {
    let model = trial.costs.partitioned.as_ref().map_or(0, PartitionedCosts::bytes);
    let memory = args.memory.filter(|_| trial.workers > 1).map(|room| room.bytes(model));
    let threads = if trial.workers > 1 { args.threads } else { 1 };
    SimulatedWorker { threads, memory, ..worker() }
}

/// A worker of one thread that is there from the start.
pub(crate) const fn worker() -> SimulatedWorker {
    SimulatedWorker {
        threads: 1,
        speed: SPEED,
        memory: None,
        joins: Duration::ZERO,
        changes: Vec::new(),
    }
}

/// What of a forecast goes into the table.
pub(crate) fn outcome(forecast: &Forecast) -> Outcome {
    let part = forecast.workers.iter().filter(|worker| worker.took_part);
    Outcome {
        elapsed: forecast.elapsed,
        finishes: part.map(|worker| worker.finish).collect(),
        capacity: forecast.capacity,
    }
}

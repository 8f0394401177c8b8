//! Forecasts of every model, extent and number of workers, as many at a time as there are cores.

use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use equilux_common::balancing::{Balance, Word};
use equilux_common::costs::SceneCosts;
use equilux_simulator::forecast::{Amount, Forecast, Scenario, SimulatedWorker, forecast};
use futures::{StreamExt, TryStreamExt, stream};

use super::model::Model;
use crate::args::SimulateArgs;
use crate::comparison::{Comparison, Outcome};
use crate::overrides;
use crate::table::{Extent, Subject, time};

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
#[derive(Clone)]
struct Case {
    subject: Subject,
    costs: Arc<SceneCosts>,
    workers: u32,
}

/// Everything that the command line asks for: by model, extent and number of workers.
pub(crate) async fn all(args: &SimulateArgs, models: &[Model]) -> anyhow::Result<Vec<Prediction>> {
    let cases = cases(args, models);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let pairs = cases.iter().map(|case| pair(args, case));
    let forecasts: Vec<[Arc<Forecast>; 2]> =
        stream::iter(pairs).buffered(threads.div_ceil(2)).try_collect().await?;
    let mut alone = Duration::ZERO;
    let predictions = cases.into_iter().zip(forecasts).map(|(case, [without, with])| {
        // One worker comes first, and its time is what the others are compared with.
        alone = if case.workers == 1 { with.elapsed } else { alone };
        let Case { subject, workers, .. } = case;
        let [first, second] = [&without, &with].map(|forecast| outcome(forecast));
        let compared = Comparison { subject, workers, alone, without: first, with: second };
        Prediction { balance: args.balance, compared, without, with }
    });
    Ok(predictions.collect())
}

fn cases(args: &SimulateArgs, models: &[Model]) -> Vec<Case> {
    let extents: Vec<Extent> = match args.work {
        Some(seconds) => vec![Extent::Work(seconds)],
        None => args.sizes.0.iter().map(|&size| Extent::Size(size)).collect(),
    };
    let mut cases = Vec::new();
    for model in models {
        for &extent in &extents {
            let subject = Subject { model: model.name.clone(), extent };
            cases.extend(args.workers.with_one().into_iter().map(|workers| Case {
                subject: subject.clone(),
                costs: model.costs.clone(),
                workers,
            }));
        }
    }
    cases
}

/// Without and with balancing; one worker has nobody to exchange work with.
async fn pair(args: &SimulateArgs, case: &Case) -> anyhow::Result<[Arc<Forecast>; 2]> {
    if case.workers == 1 {
        let only = one(args, case, args.balance).await?;
        return Ok([only.clone(), only]);
    }
    let (without, with) =
        futures::try_join!(one(args, case, Balance::None), one(args, case, args.balance))?;
    Ok([without, with])
}

async fn one(args: &SimulateArgs, case: &Case, balance: Balance) -> anyhow::Result<Arc<Forecast>> {
    let scenario = scenario(args, case, balance);
    let costs = case.costs.clone();
    let played = tokio::task::spawn_blocking(move || forecast(&costs, &scenario));
    let forecast = played.await.context("the simulation failed")?;
    let (label, workers) = (case.subject.label(), case.workers);
    let elapsed = time(forecast.elapsed.as_secs_f64());
    eprintln!("{label}, {workers} workers, balance {}: {elapsed}", balance.name());
    Ok(Arc::new(forecast))
}

fn scenario(args: &SimulateArgs, case: &Case, balance: Balance) -> Scenario {
    Scenario {
        seed: args.seed,
        network: args.network.model,
        workers: vec![worker(); case.workers as usize],
        topology: args.spread.topology.0.clone(),
        balancing: overrides::balancing(balance, &args.spread),
        amount: match case.subject.extent {
            Extent::Size(size) => Amount::Size(size),
            Extent::Work(seconds) => Amount::Work(Duration::from_secs_f64(seconds)),
        },
    }
}

/// A worker of one thread that is there from the start.
pub(crate) const fn worker() -> SimulatedWorker {
    SimulatedWorker { threads: 1, speed: SPEED, joins: Duration::ZERO, changes: Vec::new() }
}

/// What of a forecast goes into the table.
pub(crate) fn outcome(forecast: &Forecast) -> Outcome {
    let finishes = forecast.workers.iter().map(|worker| worker.finish).collect();
    Outcome { elapsed: forecast.elapsed, finishes }
}

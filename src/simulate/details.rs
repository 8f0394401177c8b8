//! What the table does not tell: messages, bytes, and how often a worker is woken for nothing.

use equilux_common::balancing::{Balance, Word};
use equilux_simulator::forecast::{Forecast, WorkerForecast};
use serde::Serialize;

use super::prediction::Prediction;
use crate::subject::Subject;
use crate::table::aligned;

/// One run; what workers do is the average over them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Detail {
    p: u32,
    #[serde(flatten)]
    subject: Subject,
    balance: &'static str,
    /// Messages that a worker sent.
    messages_per_worker: f64,
    /// Bytes that a worker sent.
    bytes_per_worker: f64,
    /// Processor time of a worker's messages, as a part of the elapsed time.
    messages_processor: f64,
    /// The part of what the workers could have computed that was needed.
    efficiency: f64,
    /// Rays that were forwarded to homes of partitions, for each path.
    forwards_per_path: f64,
    /// Partitions that a worker read.
    loads_per_worker: f64,
    /// Copies of partitions of other homes among them.
    copies_per_worker: f64,
    /// How often a worker's deadlines came.
    wakes_per_worker: f64,
    /// How often a worker with nothing to do was woken by anything but a message.
    idle_wakes_per_worker: f64,
    /// Messages that were sent after the last ray had ended.
    messages_after_last: u64,
    /// From the end of the last ray to the image being whole.
    end_after_last_s: f64,
}

impl Detail {
    /// The details of both runs of a prediction.
    pub(crate) fn of(prediction: &Prediction) -> [Self; 2] {
        let subject = &prediction.compared.subject;
        [
            Self::new(subject, Balance::None.name(), &prediction.without),
            Self::new(subject, prediction.balance.name(), &prediction.with),
        ]
    }

    fn new(subject: &Subject, balance: &'static str, forecast: &Forecast) -> Self {
        let workers = forecast.workers.len();
        let mean = |of: fn(&WorkerForecast) -> u64| {
            forecast.workers.iter().map(of).sum::<u64>() as f64 / workers as f64
        };
        let processor: f64 =
            forecast.workers.iter().map(|worker| worker.messages_processor.as_secs_f64()).sum();
        Self {
            p: u32::try_from(workers).unwrap_or(u32::MAX),
            subject: subject.clone(),
            balance,
            messages_per_worker: mean(|worker| worker.messages_out),
            bytes_per_worker: mean(|worker| worker.bytes_out),
            messages_processor: processor / workers as f64 / forecast.elapsed.as_secs_f64(),
            efficiency: forecast.efficiency(),
            forwards_per_path: forecast.counts.rays_forwarded as f64 / forecast.paths as f64,
            loads_per_worker: mean(|worker| worker.loads),
            copies_per_worker: forecast.counts.copies_loaded as f64 / workers as f64,
            wakes_per_worker: mean(|worker| worker.wakes),
            idle_wakes_per_worker: mean(|worker| worker.idle_wakes),
            messages_after_last: forecast.messages_after_last,
            end_after_last_s: (forecast.elapsed - forecast.last_ray).as_secs_f64(),
        }
    }

    fn cells(&self) -> [String; 15] {
        [
            self.p.to_string(),
            self.subject.model_cell(),
            self.subject.extent.cell(),
            self.balance.into(),
            format!("{:.1}", self.messages_per_worker),
            format!("{:.0}", self.bytes_per_worker),
            format!("{:.4}", self.messages_processor),
            format!("{:.3}", self.efficiency),
            format!("{:.2}", self.forwards_per_path),
            format!("{:.1}", self.loads_per_worker),
            format!("{:.1}", self.copies_per_worker),
            format!("{:.1}", self.wakes_per_worker),
            format!("{:.1}", self.idle_wakes_per_worker),
            self.messages_after_last.to_string(),
            format!("{:.6}", self.end_after_last_s),
        ]
    }
}

/// The details as text.
pub(crate) fn text(details: &[Detail]) -> String {
    let extent = details.first().map_or("Size", |detail| detail.subject.extent.column());
    let names = [
        "P",
        "Model",
        extent,
        "Balance",
        "Messages/worker",
        "Bytes/worker",
        "Processor",
        "E",
        "Forwards/path",
        "Loads/worker",
        "Copies/worker",
        "Wakes/worker",
        "idle",
        "after the last ray",
        "end after it",
    ];
    aligned(&names, &details.iter().map(Detail::cells).collect::<Vec<_>>(), 1)
}

//! What a cluster costs besides tracing: processor time of messages and balancing in each measured
//! run, and how often a worker is woken while there is no job at all.

use std::time::Duration;

use equilux_common::balancing::{Balance, Word};
use serde::Serialize;
use tokio::time::sleep;

use super::measurement::Measurement;
use super::processor::{self, ProcessorTime};
use super::subjects::MeasuredScene;
use crate::args::MeasuredArgs;
use crate::subject::Subject;
use crate::table::{aligned, time};

/// After a job, until its last messages have been handled.
const SETTLING: Duration = Duration::from_secs(1);

/// How long wakes are counted: two rounds of keep-alive.
const IDLE: Duration = Duration::from_secs(10);

/// The processor time of one run; nothing where the system does not tell.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Overhead {
    p: u32,
    #[serde(flatten)]
    subject: Subject,
    balance: &'static str,
    /// Of all processes.
    processor_s: Option<f64>,
    /// The part of it that workers spent on messages and balancing.
    messages: Option<f64>,
    /// The part of it that the coordinator spent.
    coordinator: Option<f64>,
}

/// Wakes of a worker while there is no job, by the second; nothing where the system does not tell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct IdleWakes {
    p: u32,
    /// Of its compute threads.
    compute_per_s: Option<f64>,
    /// Of its other threads.
    others_per_s: Option<f64>,
}

impl Overhead {
    /// What a run cost.
    pub(crate) fn new(
        subject: Subject,
        workers: u32,
        balance: Balance,
        spent: Option<ProcessorTime>,
    ) -> Self {
        let all = spent.map(|spent| spent.total().as_secs_f64());
        let part = |of: fn(&ProcessorTime) -> Duration| {
            let all = all.filter(|&all| all > 0.0)?;
            Some(of(&spent?).as_secs_f64() / all)
        };
        Self {
            p: workers,
            subject,
            balance: balance.name(),
            processor_s: all,
            messages: part(|spent| spent.messages),
            coordinator: part(|spent| spent.coordinator),
        }
    }

    fn cells(&self) -> [String; 7] {
        let percent = |part: f64| format!("{:.2}%", part * 100.0);
        [
            self.p.to_string(),
            self.subject.model_cell(),
            self.subject.extent.cell(),
            self.balance.into(),
            known(self.processor_s.map(time)),
            known(self.messages.map(percent)),
            known(self.coordinator.map(percent)),
        ]
    }
}

impl IdleWakes {
    /// Counts them, with so many workers that have a scene at hand and all links.
    pub(crate) async fn count(
        scene: &MeasuredScene,
        args: &MeasuredArgs,
        workers: u32,
    ) -> anyhow::Result<Self> {
        let measurement = Measurement::start(scene, args, workers).await?;
        let processes = measurement.process_ids();
        sleep(SETTLING).await;
        let before = processor::wakes(&processes);
        sleep(IDLE).await;
        let after = processor::wakes(&processes);
        measurement.end().await;
        let wakes = after.zip(before).map(|(after, before)| after.since(&before));
        let per_second = |count: u64| count as f64 / IDLE.as_secs_f64() / f64::from(workers);
        Ok(Self {
            p: workers,
            compute_per_s: wakes.map(|[compute, _]| per_second(compute)),
            others_per_s: wakes.map(|[_, others]| per_second(others)),
        })
    }

    fn text(&self) -> String {
        let rate = |per_second: Option<f64>| known(per_second.map(|rate| format!("{rate:.1}")));
        let (compute, others) = (rate(self.compute_per_s), rate(self.others_per_s));
        format!(
            "Wakes a second of each of {} workers without a job: compute threads {compute}, \
             others {others}\n",
            self.p
        )
    }
}

/// All that is to be said below the table.
pub(crate) fn text(overheads: &[Overhead], idle: &IdleWakes) -> String {
    let names = ["P", "Model", "Size", "Balance", "Processor", "Messages", "Coordinator"];
    let rows: Vec<_> = overheads.iter().map(Overhead::cells).collect();
    format!("{}\n{}", aligned(&names, &rows, 1), idle.text())
}

fn known(text: Option<String>) -> String {
    text.unwrap_or_else(|| "unknown".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subject::Extent;
    use equilux_simulator::case::Case;

    fn overhead(spent: Option<ProcessorTime>) -> Overhead {
        let subject = Subject { model: "Office".into(), extent: Extent::Size(1), case: Case::Even };
        Overhead::new(subject, 2, Balance::Diffusion, spent)
    }

    #[test]
    fn parts_are_of_the_processor_time_of_all() {
        let seconds = Duration::from_secs;
        let spent =
            ProcessorTime { compute: seconds(97), messages: seconds(2), coordinator: seconds(1) };
        let idle = IdleWakes { p: 2, compute_per_s: Some(0.0), others_per_s: Some(0.75) };
        let text = text(&[overhead(Some(spent))], &idle);
        let lines: Vec<_> = text.lines().collect();
        assert!(lines[1].ends_with("diffusion       1:40     2.00%        1.00%"), "{text}");
        assert!(lines[3].ends_with("compute threads 0.0, others 0.8"), "{text}");
    }

    #[test]
    fn what_the_system_does_not_tell_is_unknown() {
        let idle = IdleWakes { p: 2, compute_per_s: None, others_per_s: None };
        assert_eq!(text(&[overhead(None)], &idle).matches("unknown").count(), 5);
        let value = serde_json::to_value(overhead(None)).unwrap();
        assert!(value["messages"].is_null() && value["size"] == 1, "{value}");
        let none = overhead(Some(ProcessorTime::default()));
        assert_eq!((none.processor_s, none.messages), (Some(0.0), None), "too short to be counted");
    }
}

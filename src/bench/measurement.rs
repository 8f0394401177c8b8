//! A scene on a number of workers: a cluster that is warm, and jobs whose time is taken.

use anyhow::{Context, bail};
use equilux_common::balancing::{Balance, Word};
use equilux_common::job::Settings;
use equilux_coordinator::attachments::Attachments;
use equilux_coordinator::order::Order;
use equilux_coordinator::status::JobStatus;
use equilux_coordinator_core::action::JobState;

use super::processor::{ProcessorTime, processor_time};
use super::subjects::MeasuredScene;
use crate::args::MeasuredArgs;
use crate::cluster::Cluster;
use crate::comparison::Outcome;
use crate::overrides;
use crate::render::final_status;
use crate::table::time;

/// The image that warms a cluster up: large enough for every worker to get some of it.
const WARM_UP_SIDES: (u32, u32) = (128, 96);
const WARM_UP_SAMPLES: u32 = 4;

/// How often that is tried until every worker has traced rays.
const WARM_UPS_MAX: u32 = 10;

/// A cluster that has a scene at hand.
pub(crate) struct Measurement<'a> {
    scene: &'a MeasuredScene,
    args: &'a MeasuredArgs,
    workers: u32,
    cluster: Cluster,
}

/// What comes of a job.
pub(crate) struct Run {
    /// How work was spread.
    pub(crate) balance: Balance,
    /// Its times.
    pub(crate) outcome: Outcome,
    /// Processor time, if the system tells.
    pub(crate) spent: Option<ProcessorTime>,
}

/// What comes of a size.
pub(crate) struct Runs {
    /// With balancing.
    pub(crate) with: Run,
    /// Without; none if there is but one worker.
    pub(crate) without: Option<Run>,
}

impl<'a> Measurement<'a> {
    /// Starts so many workers, and lets all of them trace some rays of the scene.
    pub(crate) async fn start(
        scene: &'a MeasuredScene,
        args: &'a MeasuredArgs,
        workers: u32,
    ) -> anyhow::Result<Self> {
        let cache = tempfile::tempdir().context("cannot make a directory for temporary files")?;
        let cluster = Cluster::of_processes(workers, Some(1), None, cache).await?;
        let mut measurement = Self { scene, args, workers, cluster };
        measurement.warm_up().await?;
        Ok(measurement)
    }

    /// Renders one size with balancing, and also without if there is anybody to exchange work with.
    pub(crate) async fn runs(&mut self, size: u32) -> anyhow::Result<Runs> {
        let with = self.run(size, Balance::Diffusion).await?;
        let without = match self.workers {
            1 => None,
            _ => Some(self.run(size, Balance::None).await?),
        };
        Ok(Runs { with, without })
    }

    /// The processes of the workers.
    pub(crate) fn process_ids(&self) -> Vec<u32> {
        self.cluster.process_ids()
    }

    /// Lets the workers end.
    pub(crate) async fn end(self) {
        self.cluster.end().await;
    }

    async fn warm_up(&mut self) -> anyhow::Result<()> {
        let (width, height) = WARM_UP_SIDES;
        let settings = Settings { width, height, ..self.scene.settings(1, WARM_UP_SAMPLES) };
        for _ in 0..WARM_UPS_MAX {
            let status = self.render(settings.clone(), Balance::None).await?;
            let warm = status.workers.iter().filter(|(_, figures)| figures.rays.camera > 0);
            if warm.count() == self.workers as usize {
                return Ok(());
            }
        }
        bail!("not all of {} workers take part; try fewer with --workers", self.workers)
    }

    async fn run(&mut self, size: u32, balance: Balance) -> anyhow::Result<Run> {
        let settings = self.scene.settings(size, self.args.spp);
        let processes = self.process_ids();
        let before = processor_time(&processes);
        let status = self.render(settings, balance).await?;
        let after = processor_time(&processes);
        let finishes = status.workers.iter().map(|(_, figures)| figures.finish).collect();
        let (label, workers) = (self.scene.subject(size).label(), self.workers);
        let elapsed = time(status.elapsed.as_secs_f64());
        eprintln!("{label}, {workers} workers, balance {}: {elapsed}", balance.name());
        Ok(Run {
            balance,
            outcome: Outcome {
                elapsed: status.elapsed,
                finishes,
                capacity: status.elapsed * workers,
            },
            spent: after.zip(before).map(|(after, before)| after.since(&before)),
        })
    }

    /// Renders an image to its end, and waits for all figures.
    async fn render(&mut self, settings: Settings, balance: Balance) -> anyhow::Result<JobStatus> {
        let job = self.cluster.handle.submit(self.order(settings, balance)).await?;
        let updates = self.cluster.handle.watch(job).context("the job was just submitted")?;
        let mut news = updates.clone();
        let state = tokio::select! {
            ended = news.wait_for(JobStatus::has_ended) => {
                ended.context("the coordinator is gone")?.state.clone()
            }
            died = self.cluster.all_workers_ended() => bail!("no worker is left: {died}"),
        };
        match state {
            JobState::Done => Ok(final_status(updates).await),
            JobState::Failed { reason } => bail!("{}: {reason}", self.scene.path.display()),
            _ => bail!("{}: the job was {}", self.scene.path.display(), state.name()),
        }
    }

    fn order(&self, settings: Settings, balance: Balance) -> Order {
        Order {
            attachments: Attachments::default(),
            pack: self.scene.pack.clone(),
            entry: self.scene.entry.clone(),
            camera_name: None,
            camera: self.scene.camera,
            settings,
            balancing: overrides::balancing(balance, &self.args.spread),
            topology: self.args.spread.topology.0.clone(),
            workers_min: self.workers,
            name: String::new(),
            warnings: Vec::new(),
        }
    }
}

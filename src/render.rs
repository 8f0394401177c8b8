//! `equilux render`: one image on an embedded cluster, from the scene file to the image files.

mod input;

use std::pin::pin;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, bail};
use equilux_common::costs::SceneCosts;
use equilux_common::ids::JobId;
use equilux_common::image::{Image, write_atomically};
use equilux_coordinator::order::Order;
use equilux_coordinator::scene::JobScene;
use equilux_coordinator::status::JobStatus;
use equilux_coordinator_core::action::JobState;
use equilux_worker::{LoadedScene, RecordedScene, SceneSource};
use tempfile::TempDir;
use tokio::sync::watch;
use tokio::time::{Interval, MissedTickBehavior, interval, timeout};

use self::input::{Body, Input};
use crate::args::{RenderArgs, ServiceArgs};
use crate::cluster::Cluster;
use crate::interrupt::{INTERRUPTED, Interrupt};
use crate::outputs::{self, Output};
use crate::progress::{Moment, Progress};
use crate::stats::{Rays, Stats, Worker};
use crate::{jobs, overrides, record, spool};

/// Time between two looks at the job, for the bar's clock to move.
const LOOK_INTERVAL: Duration = Duration::from_millis(200);

/// Time between two partial images.
const PARTIAL_INTERVAL: Duration = Duration::from_secs(10);

/// How long the workers' last figures are waited for when the image is whole.
const FIGURES_TIMEOUT: Duration = Duration::from_secs(2);

/// How long what is being prepared may take to end after an interrupt.
const TIDYING_TIMEOUT: Duration = Duration::from_secs(2);

/// `equilux render`.
pub(crate) async fn run(args: RenderArgs) -> anyhow::Result<ExitCode> {
    let outputs = Output::of_arguments(&args.outfiles, &args.scene)?;
    let others = args.stats.iter().chain(&args.record_costs);
    others.into_iter().try_for_each(|path| outputs::check_file(path))?;
    if let Some(coordinator) = args.coordinator {
        let service = ServiceArgs { coordinator, token: args.token };
        return jobs::render(&service, &args.scene, &args.settings, &outputs, args.quiet).await;
    }
    let is_recorded = args.record_costs.is_some();
    let mut interrupt = Interrupt::listen()?;
    let listening = interrupt.clone();
    let mut start = pin!(Run::start(args, outputs, is_recorded, Some(&listening)));
    let run = tokio::select! {
        run = &mut start => run?,
        () = interrupt.asked() => {
            // Files that are being made for the job alone are removed meanwhile.
            let _in_time = timeout(TIDYING_TIMEOUT, start).await.is_ok();
            return Ok(ExitCode::from(INTERRUPTED));
        }
    };
    run.end(&mut interrupt).await
}

/// A job on its embedded cluster.
pub(crate) struct Run {
    args: RenderArgs,
    outputs: Vec<Output>,
    started: Instant,
    submitted: Instant,
    /// The scene, if what its paths cost is recorded.
    recorded: Option<RecordedScene>,
    /// Parts of the geometry.
    partitions: u32,
    cluster: Cluster,
    job: JobId,
    updates: watch::Receiver<JobStatus>,
    /// The store that was made for this job alone.
    _made: Option<TempDir>,
}

/// How a job ended.
enum End {
    Done,
    Failed(String),
    Interrupted,
}

impl Run {
    /// Reads the scene and sends it to a new cluster; recording is for one in this process.
    pub(crate) async fn start(
        args: RenderArgs,
        outputs: Vec<Output>,
        is_recorded: bool,
        interrupt: Option<&Interrupt>,
    ) -> anyhow::Result<Self> {
        let started = now();
        let (scene, cut, is_quiet) = (args.scene.clone(), args.cut.clone(), args.quiet);
        let interrupt = interrupt.cloned();
        let read = move || Input::read(&scene, &cut, is_quiet, interrupt.as_ref());
        let input = tokio::task::spawn_blocking(read).await??;
        input.scene.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        let (camera, settings) = overrides::apply(&args.settings, &input.defaults())?;
        let partitions = input.partitions();
        let Input { scene: JobScene { pack, entry, attachments, warnings, .. }, body } = input;
        let order = Order {
            pack,
            entry,
            attachments,
            camera_name: args.settings.camera.clone(),
            camera,
            settings,
            balancing: overrides::balancing(args.settings.balance, &args.settings.spread),
            topology: args.settings.spread.topology.0.clone(),
            workers_min: args.workers.unwrap_or(1),
            name: String::new(),
            warnings,
        };
        let mut recorded = None;
        let memory = args.cut.memory.map(|bytes| bytes.0);
        let (scenes, made): (Arc<dyn SceneSource>, _) = match body {
            Body::Whole(scene) if is_recorded => {
                (Arc::new(recorded.insert(RecordedScene::new(scene)).clone()), None)
            }
            Body::Whole(scene) => (Arc::new(LoadedScene::new(scene)), None),
            Body::Stored { scene, made, .. } if is_recorded => {
                (Arc::new(recorded.insert(RecordedScene::of_store(scene)).clone()), made)
            }
            Body::Stored { scene, made, .. } => (Arc::new(scene), made),
        };
        let cluster = match args.workers {
            None => Cluster::here(args.threads, memory, scenes).await?,
            Some(workers) => {
                let cache = spool::make_cache(args.cut.spool.as_deref(), &order.attachments)?;
                Cluster::of_processes(workers, args.threads, memory, cache).await?
            }
        };
        let submitted = now();
        let job = cluster.handle.submit(order).await?;
        let updates = cluster.handle.watch(job).context("the job was just submitted")?;
        let run = Self {
            args,
            outputs,
            started,
            submitted,
            recorded,
            partitions,
            cluster,
            job,
            updates,
            _made: made,
        };
        Ok(run)
    }

    /// Shows progress until the job has ended, and gives what its paths cost.
    pub(crate) async fn into_costs(mut self) -> anyhow::Result<SceneCosts> {
        let mut progress = Progress::new(self.args.quiet);
        let end = self.follow(&mut progress).await;
        progress.end();
        let costs = match end {
            Ok(End::Done) => self.costs().await,
            Ok(End::Failed(reason)) => Err(anyhow!(reason)),
            Ok(End::Interrupted) => Err(anyhow!("the job was interrupted")),
            Err(error) => Err(error),
        };
        self.cluster.end().await;
        costs
    }

    /// Shows progress until the job has ended, and writes what is there.
    async fn end(mut self, interrupt: &mut Interrupt) -> anyhow::Result<ExitCode> {
        let mut progress = Progress::new(self.args.quiet);
        let end = tokio::select! {
            end = self.follow(&mut progress) => end?,
            () = interrupt.asked() => End::Interrupted,
        };
        let elapsed = self.started.elapsed();
        progress.end();
        let code = self.write_end(end, &progress, elapsed).await;
        self.cluster.end().await;
        code
    }

    async fn write_end(
        &self,
        end: End,
        progress: &Progress,
        elapsed: Duration,
    ) -> anyhow::Result<ExitCode> {
        match end {
            End::Done => {
                self.finish(progress, elapsed).await?;
                Ok(ExitCode::SUCCESS)
            }
            // Other processes know the scene's files by their names in it.
            End::Failed(reason) if self.args.workers.is_some() => {
                bail!("{}: {reason}", self.args.scene.display())
            }
            End::Failed(reason) => bail!("{reason}"),
            End::Interrupted => {
                self.cluster.handle.cancel(self.job).await;
                self.write_partial(progress).await?;
                Ok(ExitCode::from(INTERRUPTED))
            }
        }
    }

    async fn follow(&mut self, progress: &mut Progress) -> anyhow::Result<End> {
        let mut looks = every(LOOK_INTERVAL);
        let mut partials = every(PARTIAL_INTERVAL);
        partials.tick().await;
        loop {
            let status = self.updates.borrow_and_update().clone();
            let status = status.at(self.cluster.handle.now());
            progress.show(&moment(&status));
            match status.state {
                JobState::Done => return Ok(End::Done),
                JobState::Failed { reason } => return Ok(End::Failed(reason)),
                JobState::Cancelled => bail!("the job was cancelled"),
                JobState::Queued | JobState::Preparing | JobState::Rendering => {}
            }
            tokio::select! {
                changed = self.updates.changed() => changed.context("the coordinator is gone")?,
                _ = looks.tick() => {}
                _ = partials.tick(), if self.args.write_partial_images => {
                    // The image is what matters: it may find room later.
                    if let Err(error) = self.write_partial(progress).await {
                        eprintln!("warning: {error:#}");
                    }
                }
                died = self.cluster.all_workers_ended() => bail!("no worker is left: {died}"),
            }
        }
    }

    async fn finish(&self, progress: &Progress, elapsed: Duration) -> anyhow::Result<()> {
        let image = self.image().await?;
        let written = self.write(&image, &self.outputs, progress);
        let (saturated, invalid) = self.flaws();
        if saturated > 0 || invalid > 0 {
            eprintln!(
                "warning: {saturated} values exceeded the film's range, {invalid} were no numbers"
            );
        }
        if let Some(path) = &self.args.stats {
            let stats = self.stats(&image, elapsed).await;
            write_atomically(path, serde_json::to_string_pretty(&stats)?.as_bytes())?;
        }
        if let Some(path) = &self.args.record_costs {
            record::write(&self.costs().await?, path)?;
            progress.say(&format!("wrote {}", path.display()));
        }
        written
    }

    /// What the paths of the finished job cost.
    async fn costs(&self) -> anyhow::Result<SceneCosts> {
        let recorded = self.recorded.as_ref().context("the costs of paths were not recorded")?;
        let (film, _) = self.cluster.handle.film(self.job).context("the job has no film")?;
        record::costs_of(recorded, &self.args.scene, &film.assemble()).await
    }

    /// Writes an image to all files that can be written; says of each what came of it.
    fn write(&self, image: &Image, outputs: &[Output], progress: &Progress) -> anyhow::Result<()> {
        let mut first_error = None;
        for output in outputs {
            match output.write(image) {
                Ok(()) => progress.say(&format!("wrote {}", output.path.display())),
                Err(error) if first_error.is_none() => first_error = Some(error),
                Err(error) => eprintln!("error: {error:#}"),
            }
        }
        first_error.map_or(Ok(()), Err)
    }

    async fn write_partial(&self, progress: &Progress) -> anyhow::Result<()> {
        let image = self.image().await?;
        let partials: Vec<Output> = self.outputs.iter().map(Output::partial).collect();
        self.write(&image, &partials, progress)
    }

    /// The image of all units that are committed.
    async fn image(&self) -> anyhow::Result<Image> {
        let (film, settings) = self.cluster.handle.film(self.job).context("the job has no film")?;
        let develop = move || Image::develop(&film.assemble(), &settings);
        Ok(tokio::task::spawn_blocking(develop).await?)
    }

    fn flaws(&self) -> (u64, u64) {
        self.cluster.handle.film(self.job).map_or((0, 0), |(film, _)| film.flaws())
    }

    async fn stats(&self, image: &Image, elapsed: Duration) -> Stats {
        let status = final_status(self.updates.clone()).await;
        let rays = Rays::of(&status.workers);
        let (saturated, invalid) = self.flaws();
        let until_submitted = self.submitted.duration_since(self.started);
        Stats {
            elapsed_s: elapsed.as_secs_f64(),
            startup_s: (until_submitted + status.startup).as_secs_f64(),
            paths: rays.paths(),
            rays,
            units: status.units,
            partitions: self.partitions,
            saturated,
            invalid,
            noise: image.noise(),
            workers: status.workers.iter().map(|(id, figures)| Worker::new(*id, figures)).collect(),
        }
    }
}

/// The status with the workers' last figures, which arrive after the image is whole: they are
/// complete when they account for every camera sample.
pub(crate) async fn final_status(mut updates: watch::Receiver<JobStatus>) -> JobStatus {
    let is_complete = |status: &JobStatus| {
        let settings = &status.plan.settings;
        let pixels = settings.region().pixel_count() as u64;
        Rays::of(&status.workers).paths() >= pixels * u64::from(settings.samples_per_pixel)
    };
    // Figures that do not come are shown as far as they came.
    let _came_in_time = timeout(FIGURES_TIMEOUT, updates.wait_for(is_complete)).await.is_ok();
    updates.borrow().clone()
}

fn moment(status: &JobStatus) -> Moment<'static> {
    Moment {
        state: status.state.name(),
        progress: status.progress(),
        elapsed: status.elapsed,
        remaining: status.remaining(),
        detail: "",
    }
}

fn every(period: Duration) -> Interval {
    let mut interval = interval(period);
    interval.set_missed_tick_behavior(MissedTickBehavior::Delay);
    interval
}

#[expect(clippy::disallowed_methods, reason = "an edge: the stats file tells elapsed time")]
fn now() -> Instant {
    Instant::now()
}

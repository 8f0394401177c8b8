//! The driver: the loop that owns the core, feeds it events and the time, and carries out its
//! actions. It never waits for anybody but its inputs.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use bytes::Bytes;
use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_common::job::{JobSpec, SceneRef};
use equilux_common::message::{ToCoordinator, ToWorker};
use equilux_common::unit::Granularity;
use equilux_coordinator_core::action::{Action, JobReport};
use equilux_coordinator_core::event::{Event, Hello, JobOrder, LinkId};
use equilux_coordinator_core::{Config, CoordinatorCore};
use tokio::sync::{mpsc, oneshot};

use crate::attachments::BlobHash;
use crate::board::Board;
use crate::clock::Clock;
use crate::connection::{ConnectError, Connection, Link};
use crate::order::{Order, SubmitError};
use crate::picture;
use crate::status::{JobPlan, JobStatus, WorkerStatus};
use crate::store::{JOBS_ENDED_MAX, Store};

/// Most inputs that wait for the driver; whoever has another one waits.
pub(crate) const INPUTS_MAX: usize = 256;

/// Most workers that are connected at a time.
pub(crate) const WORKERS_MAX: usize = 4096;

/// A job that has passed the door.
#[derive(Debug)]
pub(crate) struct Admitted {
    /// As it was ordered.
    pub(crate) order: Order,
    /// The pack in the form of the wire.
    pub(crate) pack: Bytes,
    /// Its hash.
    pub(crate) hash: BlobHash,
}

/// A worker that wants to be let in.
#[derive(Debug)]
pub(crate) struct Knock {
    /// How it introduces itself.
    pub(crate) hello: Hello,
    /// Where it gets its connection; not taken up, it drops it, and the worker is lost.
    pub(crate) reply: oneshot::Sender<Result<Connection, ConnectError>>,
}

/// The closed list of what reaches the driver.
#[derive(Debug)]
pub(crate) enum Input {
    /// A worker wants to take part.
    Knocked(Knock),
    /// A worker said something.
    Said { worker: WorkerId, incarnation: Incarnation, message: ToCoordinator },
    /// A worker's connection is gone.
    Lost { worker: WorkerId, incarnation: Incarnation },
    /// A job was submitted.
    Submitted { admitted: Box<Admitted>, reply: oneshot::Sender<Result<JobId, SubmitError>> },
    /// A job is not wanted any more.
    Cancelled { job: JobId, reply: oneshot::Sender<()> },
    /// A job's image was stored, or could not be.
    Stored { job: JobId, outcome: Result<(), String> },
}

/// The loop and all that it owns.
pub(crate) struct Driver {
    core: CoordinatorCore,
    clock: Clock,
    board: Board,
    store: Option<Arc<Store>>,
    inputs: mpsc::Receiver<Input>,
    /// For those who store images, so that they can say when they are done.
    own_inputs: mpsc::WeakSender<Input>,
    next_job: JobId,
    next_link: LinkId,
    /// Who is not let in yet, while the core decides.
    knocking: BTreeMap<LinkId, Knock>,
    links: BTreeMap<(WorkerId, Incarnation), Link>,
    /// Workers found to be lost while an event was handled.
    lost: VecDeque<(WorkerId, Incarnation)>,
}

impl Driver {
    pub(crate) fn new(
        clock: Clock,
        board: Board,
        store: Option<Arc<Store>>,
        channel: (mpsc::WeakSender<Input>, mpsc::Receiver<Input>),
    ) -> Self {
        let (own_inputs, inputs) = channel;
        let newest = store.as_ref().map_or(JobId(0), |store| store.newest_job());
        Self {
            core: CoordinatorCore::new(Config::default()),
            clock,
            board,
            store,
            inputs,
            own_inputs,
            next_job: JobId(newest.0 + 1),
            next_link: LinkId(0),
            knocking: BTreeMap::new(),
            links: BTreeMap::new(),
            lost: VecDeque::new(),
        }
    }

    /// Runs until nobody can reach it any more.
    pub(crate) async fn run(mut self) {
        loop {
            let deadline = self.core.next_deadline().map(|time| self.clock.instant(time));
            tokio::select! {
                biased;
                () = sleep_until(deadline) => self.core.wake(self.clock.now()),
                input = self.inputs.recv() => match input {
                    Some(input) => self.take(input),
                    None => return,
                },
            }
            self.carry_out();
            while let Some((worker, incarnation)) = self.lost.pop_front() {
                self.handle(Event::WorkerLost { worker, incarnation });
                self.carry_out();
            }
        }
    }

    fn handle(&mut self, event: Event) {
        self.core.handle(self.clock.now(), event);
    }

    /// Turns an input into an event; the one place that matches inputs.
    fn take(&mut self, input: Input) {
        match input {
            Input::Knocked(knock) => self.knock(knock),
            Input::Said { worker, incarnation, message } => {
                if self.links.contains_key(&(worker, incarnation)) {
                    self.handle(Event::WorkerSaid { worker, incarnation, message });
                }
            }
            Input::Lost { worker, incarnation } => self.lose(worker, incarnation),
            Input::Submitted { admitted, reply } => {
                // Who does not wait for the answer any more still has submitted the job.
                let _nobody_waits = reply.send(self.submit(*admitted));
            }
            Input::Cancelled { job, reply } => {
                if self.board.job(job).is_some_and(|status| !status.has_ended()) {
                    self.handle(Event::Cancelled { job });
                    self.carry_out();
                }
                let _nobody_waits = reply.send(());
            }
            Input::Stored { job, outcome } => {
                self.board.stored(job, outcome);
                self.forget_old_jobs();
            }
        }
    }

    fn knock(&mut self, knock: Knock) {
        if self.links.len() >= WORKERS_MAX {
            let _nobody_waits = knock.reply.send(Err(ConnectError::TooMany(WORKERS_MAX)));
            return;
        }
        let link = self.next_link;
        self.next_link = LinkId(link.0 + 1);
        let hello = knock.hello.clone();
        self.knocking.insert(link, knock);
        self.handle(Event::Knocked { link, hello });
        self.carry_out();
        if let Some(knock) = self.knocking.remove(&link) {
            let _nobody_waits = knock.reply.send(Err(ConnectError::Refused));
        }
    }

    fn submit(&mut self, admitted: Admitted) -> Result<JobId, SubmitError> {
        let Admitted { order, pack, hash } = admitted;
        let pack_bytes = pack.len() as u64;
        self.board.check_room(hash, pack_bytes)?;
        let id = self.next_job;
        self.next_job = JobId(id.0 + 1);
        let threads = self.core.thread_count().max(order.workers_min);
        let (region, samples) = (order.settings.region(), order.settings.samples_per_pixel);
        let granularity = Granularity::for_job(region, samples, threads);
        let scene = SceneRef { hash, pack_bytes, entry: order.entry.clone() };
        let settings = order.settings.clone();
        let spec = JobSpec { id, scene, camera: order.camera, settings, granularity };
        let attachments = order.attachments.clone();
        let plan = JobPlan::from(order);
        let job = JobOrder {
            balancing: plan.balancing,
            topology: plan.topology.clone(),
            workers_min: plan.workers_min,
            is_partitioned: !attachments.files.is_empty(),
            spec,
        };
        let status = JobStatus::queued(id, Arc::new(plan), self.clock.now());
        self.board.add_job(status, hash, pack, attachments);
        self.handle(Event::Submitted(Box::new(job)));
        self.note_number(id);
        Ok(id)
    }

    /// Makes the job's directory at once, so that its number is not given again after a restart,
    /// whatever becomes of the job.
    fn note_number(&self, job: JobId) {
        if let Some(store) = self.store.clone() {
            // A directory that cannot be made is reported when the image is to be stored.
            tokio::task::spawn_blocking(move || store.prepare(job));
        }
    }

    /// Does what the core wants done; the one place that matches actions.
    fn carry_out(&mut self) {
        while let Some(action) = self.core.poll_action() {
            match action {
                Action::Admit { link, worker, incarnation } => {
                    self.admit(link, worker, incarnation);
                }
                Action::Expel { worker, incarnation, reason } => {
                    self.expel(worker, incarnation, reason);
                }
                Action::Tell { worker, incarnation, message } => {
                    self.tell(worker, incarnation, message);
                }
                Action::Commit { job, sums, .. } => self.board.commit(job, sums),
                Action::Report(report) => self.report(report),
            }
        }
    }

    fn admit(&mut self, link: LinkId, worker: WorkerId, incarnation: Incarnation) {
        let Some(Knock { hello, reply }) = self.knocking.remove(&link) else { return };
        let Some(inputs) = self.own_inputs.upgrade() else { return };
        let (connection, open_link) = Connection::open(worker, incarnation, inputs);
        self.links.insert((worker, incarnation), open_link);
        let Hello { name, address, threads, .. } = hello;
        let since = self.clock.now();
        let status = WorkerStatus {
            worker,
            incarnation,
            name,
            address: address.to_string(),
            threads,
            since,
        };
        self.board.add_worker(status);
        // Not taken up, the connection is dropped here, and the loss comes as an input.
        let _gone_again = reply.send(Ok(connection));
    }

    fn tell(&mut self, worker: WorkerId, incarnation: Incarnation, message: ToWorker) {
        let Some(link) = self.links.get(&(worker, incarnation)) else { return };
        if link.to_worker.try_send(message).is_err() {
            self.lost_now(worker, incarnation);
        }
    }

    fn report(&mut self, report: JobReport) {
        let job = report.job;
        let has_just_ended = self.board.report(report, self.clock.now());
        if !has_just_ended {
            return;
        }
        match (&self.store, self.own_inputs.upgrade()) {
            (Some(store), Some(inputs)) => self.keep_image(job, Arc::clone(store), inputs),
            _ => self.forget_old_jobs(),
        }
    }

    /// Stores the image of a job that has ended, and says so.
    fn keep_image(&self, job: JobId, store: Arc<Store>, inputs: mpsc::Sender<Input>) {
        let (Some(film), Some(status)) = (self.board.film(job), self.board.job(job)) else {
            return;
        };
        tokio::spawn(async move {
            let outcome = picture::store(&store, film, &status).await;
            let outcome = outcome.map_err(|error| error.to_string());
            // The driver is there as long as this sender is.
            let _driver_is_gone = inputs.send(Input::Stored { job, outcome }).await;
        });
    }

    fn forget_old_jobs(&self) {
        for job in self.board.forget_old_jobs(JOBS_ENDED_MAX) {
            if let Some(store) = self.store.clone() {
                tokio::task::spawn_blocking(move || store.forget(job));
            }
        }
    }

    fn expel(&mut self, worker: WorkerId, incarnation: Incarnation, reason: String) {
        if let Some(link) = self.close(worker, incarnation) {
            // Who has hung up already need not know why.
            let _hung_up = link.expel.send(reason);
        }
    }

    fn close(&mut self, worker: WorkerId, incarnation: Incarnation) -> Option<Link> {
        self.board.remove_worker(worker, incarnation);
        self.links.remove(&(worker, incarnation))
    }

    /// A worker's connection is gone; the core hears of it once.
    fn lose(&mut self, worker: WorkerId, incarnation: Incarnation) {
        if self.close(worker, incarnation).is_some() {
            self.handle(Event::WorkerLost { worker, incarnation });
        }
    }

    /// The same in the middle of the core's actions: the core hears of it when they are done.
    fn lost_now(&mut self, worker: WorkerId, incarnation: Incarnation) {
        if self.close(worker, incarnation).is_some() {
            self.lost.push_back((worker, incarnation));
        }
    }
}

impl From<Order> for JobPlan {
    fn from(order: Order) -> Self {
        Self {
            name: order.name,
            scene: order.entry,
            camera: order.camera_name,
            settings: order.settings,
            balancing: order.balancing,
            topology: order.topology,
            workers_min: order.workers_min,
            warnings: order.warnings,
        }
    }
}

/// Waits for the instant, or for ever if there is none.
async fn sleep_until(deadline: Option<tokio::time::Instant>) {
    match deadline {
        Some(instant) => tokio::time::sleep_until(instant).await,
        None => std::future::pending().await,
    }
}

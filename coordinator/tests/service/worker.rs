//! Workers that deliver values made up from the numbers of their units, as many as they are let.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use equilux_common::bundle::Share;
use equilux_common::credit::Credit;
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, JobId, UnitId};
use equilux_common::job::Settings;
use equilux_common::message::{JobStart, ToCoordinator, ToWorker};
use equilux_common::unit::{Granularity, UnitGrid};
use equilux_coordinator::connection::Connection;
use equilux_coordinator::handle::Handle;
use equilux_coordinator_core::event::Hello;
use tokio::sync::{Semaphore, mpsc};
use tokio::task::{JoinHandle, JoinSet};

/// A name that no other worker has.
pub(crate) fn new_name() -> String {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    format!("worker {}", NUMBER.fetch_add(1, Ordering::Relaxed))
}

pub(crate) fn hello(name: &str) -> Hello {
    let address = "127.0.0.1:1".into();
    Hello { name: name.into(), address, threads: 2, speed: 1000, memory: None }
}

/// A worker in this process. It takes a permit for every unit that it delivers.
pub(crate) struct Worker {
    pub(crate) permits: Arc<Semaphore>,
    task: JoinHandle<()>,
}

impl Worker {
    /// A worker that delivers this many units, and more when it gets more permits.
    pub(crate) async fn start(handle: &Handle, unit_count: usize) -> Self {
        let connection = handle.connect(hello(&new_name())).await.expect("let in");
        let permits = Arc::new(Semaphore::new(unit_count));
        let task = tokio::spawn(work(connection, Arc::clone(&permits)));
        Self { permits, task }
    }

    /// A worker that holds nothing up.
    pub(crate) async fn willing(handle: &Handle) -> Self {
        Self::start(handle, Semaphore::MAX_PERMITS / 2).await
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn work(connection: Connection, permits: Arc<Semaphore>) {
    let Connection { mut incoming, outgoing, .. } = connection;
    // What it holds is aborted when it is dropped, so that nothing keeps a lost worker connected.
    let mut running = JoinSet::new();
    let mut grid = None;
    while let Some(message) = incoming.recv().await {
        match message {
            ToWorker::JobStarted(start) => {
                grid = Some(start.spec.grid());
                running.spawn(say(answers(&start), outgoing.clone(), Arc::clone(&permits)));
            }
            ToWorker::UnitsIssued { job, units } => {
                let grid = grid.as_ref().expect("a job is started first");
                let messages = deliveries(job, &units, grid).collect();
                running.spawn(say(messages, outgoing.clone(), Arc::clone(&permits)));
            }
            ToWorker::JobEnded { .. } => running.abort_all(),
            _ => (),
        }
    }
}

/// All that a worker says about a job, in order. Scenes of ten samples are found to be bad.
pub(crate) fn answers(start: &JobStart) -> Vec<ToCoordinator> {
    let job = start.spec.id;
    if start.spec.settings.samples_per_pixel == 10 {
        return vec![ToCoordinator::Failed { job, reason: "the moon is in the way".into() }];
    }
    let grid = start.spec.grid();
    std::iter::once(ToCoordinator::Ready { job })
        .chain(deliveries(job, &start.units, &grid))
        .collect()
}

fn deliveries(
    job: JobId,
    units: &[(UnitId, Attempt)],
    grid: &UnitGrid,
) -> impl Iterator<Item = ToCoordinator> {
    units.iter().map(move |&(unit, attempt)| {
        let share = Share { unit, attempt, credit: Credit::whole() };
        ToCoordinator::Delivered { job, share, sums: values(grid, unit.0) }
    })
}

/// Says these things, deliveries as far as there are permits.
async fn say(
    messages: Vec<ToCoordinator>,
    outgoing: mpsc::Sender<ToCoordinator>,
    permits: Arc<Semaphore>,
) {
    for message in messages {
        if matches!(message, ToCoordinator::Delivered { .. }) {
            permits.acquire().await.expect("open").forget();
        }
        outgoing.send(message).await.expect("a coordinator");
    }
}

/// The values of a unit: its number everywhere.
pub(crate) fn values(grid: &UnitGrid, unit: u32) -> TileSums {
    let unit = grid.unit(UnitId(unit)).expect("within the job");
    let mut sums = TileSums::new(unit.tile);
    for index in 0..unit.tile.pixel_count() {
        for sample_index in 0..unit.sample_count {
            sums.add_sample(index, sample_index);
            let number = u16::try_from(unit.id.0 + 1).expect("few units");
            sums.add_radiance(index, sample_index, [f32::from(number); 3]);
        }
    }
    sums
}

/// The units of a job of these settings.
pub(crate) fn grid(settings: &Settings) -> UnitGrid {
    let samples = settings.samples_per_pixel;
    let granularity = Granularity::for_job(settings.region(), samples, 2);
    UnitGrid::new(settings.width, settings.region(), samples, granularity)
}

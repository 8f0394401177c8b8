//! The job that is running: what it is, how far it has come, and who is to be told what about it.

use std::collections::BTreeMap;
use std::time::Duration;

use equilux_common::ids::{Attempt, Incarnation, UnitId, WorkerId};
use equilux_common::message::{Home, JobStart, PeerAddress, ToWorker, WorkerFigures};
use equilux_common::spread::PackSources;
use equilux_common::time::Time;

use crate::action::{JobReport, JobState};
use crate::closing::put;
use crate::event::JobOrder;
use crate::gathering::Gathering;
use crate::issue;
use crate::roster::Roster;

/// The job that is running.
#[derive(Debug)]
pub(crate) struct Job {
    order: JobOrder,
    gathering: Gathering,
    started: Time,
    /// From the start until the first worker cast rays.
    startup: Option<Duration>,
    /// The neighbors that each worker was told of last.
    neighbors: BTreeMap<WorkerId, Vec<(WorkerId, Incarnation)>>,
    /// Those who were there when partitions were given homes, the lost ones too, then those who
    /// came later and live; nobody if the model is replicated.
    homes: Vec<Home>,
    /// By worker.
    figures: Vec<(WorkerId, WorkerFigures)>,
    /// Whether nobody has the units that are not committed: all workers are lost.
    is_orphaned: bool,
}

/// Units for each worker, by its number.
pub(crate) type Shares = Vec<(WorkerId, Vec<(UnitId, Attempt)>)>;

impl Job {
    /// The job starts now; its units are to be issued.
    pub(crate) fn new(now: Time, order: JobOrder) -> Self {
        let gathering = Gathering::new(order.spec.grid());
        Self {
            order,
            gathering,
            started: now,
            startup: None,
            neighbors: BTreeMap::new(),
            homes: Vec::new(),
            figures: Vec::new(),
            is_orphaned: true,
        }
    }

    /// What was ordered.
    pub(crate) const fn order(&self) -> &JobOrder {
        &self.order
    }

    /// What has come home.
    pub(crate) const fn gathering(&self) -> &Gathering {
        &self.gathering
    }

    /// What has come home, to be added to.
    pub(crate) const fn gathering_mut(&mut self) -> &mut Gathering {
        &mut self.gathering
    }

    /// Whether nobody has the units that are not committed.
    pub(crate) const fn is_orphaned(&self) -> bool {
        self.is_orphaned
    }

    /// Deals out all units that are not committed.
    pub(crate) fn issue(&mut self, roster: &Roster) -> Shares {
        self.is_orphaned = roster.len() == 0;
        let units: Vec<(UnitId, Attempt)> = self.gathering.uncommitted().collect();
        let ids: Vec<UnitId> = units.iter().map(|&(unit, _)| unit).collect();
        let members: Vec<_> =
            roster.members().map(|(worker, member)| (worker, member.capacity())).collect();
        let scattered = issue::scattered(members.len()).map(|index| members[index]);
        let (workers, capacities): (Vec<_>, Vec<_>) = scattered.unzip();
        let shares = issue::shares(self.gathering.grid(), &ids, &capacities);
        // Shares are consecutive runs of the units, so their attempts follow in step.
        let mut rest = units.into_iter();
        let with_attempts =
            |share: Vec<UnitId>| rest.by_ref().take(share.len()).collect::<Vec<_>>();
        workers.into_iter().zip(shares.into_iter().map(with_attempts)).collect()
    }

    /// A worker is to know these neighbors; says whether that is news to it.
    pub(crate) fn meet(&mut self, worker: WorkerId, neighbors: &[PeerAddress]) -> bool {
        let lives: Vec<_> = neighbors.iter().map(|peer| (peer.worker, peer.incarnation)).collect();
        self.neighbors.insert(worker, lives.clone()) != Some(lives)
    }

    /// The job as a worker is told of it.
    pub(crate) fn start(
        &self,
        neighbors: Vec<PeerAddress>,
        pack_from: PackSources,
        units: Vec<(UnitId, Attempt)>,
    ) -> JobStart {
        let (spec, balancing) = (self.order.spec.clone(), self.order.balancing);
        JobStart { spec, neighbors, homes: self.homes.clone(), balancing, units, pack_from }
    }

    /// Those who take part are home to the partitions; nobody has been so far, or nobody is left.
    pub(crate) fn settle_homes(&mut self, roster: &Roster) {
        if self.order.is_partitioned {
            self.homes = roster.members().filter_map(|(worker, _)| roster.home(worker)).collect();
        }
    }

    /// A worker came that may be home to partitions of others who are lost.
    pub(crate) fn add_home(&mut self, home: Home) {
        if self.order.is_partitioned {
            self.homes.push(Home { is_late: true, ..home });
        }
    }

    /// A life is lost, and its partitions with it.
    pub(crate) fn lose_home(&mut self, worker: WorkerId, incarnation: Incarnation) {
        let is_it =
            |home: &&mut Home| (home.peer.worker, home.peer.incarnation) == (worker, incarnation);
        if let Some(home) = self.homes.iter_mut().find(is_it) {
            home.is_lost = true;
        }
        // Those who came later were home to nothing that others do not find without them.
        self.homes.retain(|home| !(home.is_late && home.is_lost));
    }

    /// What all workers are to know of homes, if there are any.
    pub(crate) fn homes(&self) -> Option<ToWorker> {
        let message =
            || ToWorker::HomesChanged { job: self.order.spec.id, homes: self.homes.clone() };
        (!self.homes.is_empty()).then(message)
    }

    /// A worker casts rays; says whether it is the first.
    pub(crate) fn begin(&mut self, now: Time) -> bool {
        let is_first = self.startup.is_none();
        self.startup.get_or_insert(now.since(self.started));
        is_first
    }

    /// A worker reported its figures.
    pub(crate) fn hear(&mut self, worker: WorkerId, figures: WorkerFigures) {
        put(&mut self.figures, worker, figures);
    }

    /// Preparing or rendering.
    pub(crate) const fn state(&self) -> JobState {
        if self.startup.is_some() { JobState::Rendering } else { JobState::Preparing }
    }

    /// How far the job has come.
    pub(crate) fn report(&self, now: Time, state: JobState) -> JobReport {
        JobReport {
            job: self.order.spec.id,
            state,
            units_committed: self.gathering.committed_count(),
            units: self.gathering.grid().unit_count(),
            elapsed: now.since(self.started),
            startup: self.startup.unwrap_or_default(),
            workers: self.figures.clone(),
        }
    }
}

/// A job that is not running.
pub(crate) fn report_idle(order: &JobOrder, state: JobState) -> JobReport {
    JobReport {
        job: order.spec.id,
        state,
        units_committed: 0,
        units: order.spec.unit_count(),
        elapsed: Duration::ZERO,
        startup: Duration::ZERO,
        workers: Vec::new(),
    }
}

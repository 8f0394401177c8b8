//! The board: what everybody may read of the coordinator at any time. The driver alone writes it.
//!
//! Reading never waits for the driver, and the driver waits for a reader only as long as it takes
//! to clone a few pointers.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};

use bytes::Bytes;
use equilux_common::film::TileSums;
use equilux_common::ids::{Incarnation, JobId, WorkerId};
use equilux_coordinator_core::action::JobReport;
use tokio::sync::watch;

use equilux_common::time::Time;

use crate::attachments::{Attachments, Blob, BlobHash};
use crate::film::GatheredFilm;
use crate::order::{JOBS_QUEUED_MAX, PACKS_BYTES_MAX, SubmitError};
use crate::status::{JobStatus, Totals, WorkerStatus};

/// What everybody may read.
#[derive(Clone, Debug, Default)]
pub(crate) struct Board {
    lists: Arc<Mutex<Lists>>,
}

#[derive(Debug, Default)]
struct Lists {
    jobs: BTreeMap<JobId, Entry>,
    workers: BTreeMap<(WorkerId, Incarnation), WorkerStatus>,
    totals: Totals,
}

/// A job on the board.
#[derive(Debug)]
struct Entry {
    status: watch::Sender<JobStatus>,
    pack: Option<(BlobHash, Bytes)>,
    attachments: Attachments,
    film: Option<GatheredFilm>,
}

impl Board {
    /// Whether one more job with a pack of `pack_bytes` has room.
    pub(crate) fn check_room(&self, hash: BlobHash, pack_bytes: u64) -> Result<(), SubmitError> {
        let lists = self.lists();
        let waiting = lists.jobs.values().filter(|entry| !entry.status.borrow().has_ended());
        if waiting.count() > JOBS_QUEUED_MAX {
            return Err(SubmitError::QueueFull);
        }
        let mut packs: BTreeMap<BlobHash, u64> = lists.packs().collect();
        packs.insert(hash, pack_bytes);
        let held = packs.values().fold(0u64, |sum, bytes| sum.saturating_add(*bytes));
        // A pack alone is let in whatever its size, else it never would be.
        if packs.len() > 1 && held > PACKS_BYTES_MAX {
            return Err(SubmitError::PacksFull);
        }
        Ok(())
    }

    /// Puts a new job on the board; packs of the same content share memory.
    pub(crate) fn add_job(
        &self,
        status: JobStatus,
        hash: BlobHash,
        pack: Bytes,
        attachments: Attachments,
    ) {
        let mut lists = self.lists();
        let pack = lists.pack(&hash).unwrap_or(pack);
        let film = Some(GatheredFilm::new(status.plan.settings.region()));
        let (sender, pack) = (watch::Sender::new(status.clone()), Some((hash, pack)));
        let entry = Entry { status: sender, pack, attachments, film };
        lists.jobs.insert(status.id, entry);
        lists.totals.jobs += 1;
    }

    /// Takes over what the core reports; says whether the job has just ended.
    pub(crate) fn report(&self, report: JobReport, now: Time) -> bool {
        let mut guard = self.lists();
        let lists = &mut *guard;
        let Some(entry) = lists.jobs.get_mut(&report.job) else { return false };
        let had_ended = entry.status.borrow().has_ended();
        lists.totals.count(&entry.status.borrow(), &report);
        entry.status.send_modify(|status| status.update(report, now));
        let has_ended = entry.status.borrow().has_ended();
        if has_ended {
            entry.pack = None;
            entry.attachments = Attachments::default();
        }
        has_ended && !had_ended
    }

    /// Adds a unit's values to the job's film.
    pub(crate) fn commit(&self, job: JobId, sums: TileSums) {
        if let Some(film) = self.lists().jobs.get_mut(&job).and_then(|entry| entry.film.as_mut()) {
            film.add(sums);
        }
    }

    /// The job's image is in the store now, or could not be put there; then the film stays.
    pub(crate) fn stored(&self, job: JobId, outcome: Result<(), String>) {
        let mut lists = self.lists();
        let Some(entry) = lists.jobs.get_mut(&job) else { return };
        match outcome {
            Ok(()) => entry.film = None,
            Err(problem) => {
                entry.status.send_modify(|status| status.store_error = Some(problem));
            }
        }
    }

    /// Takes the oldest jobs that have ended off the board, all but `kept_max`.
    pub(crate) fn forget_old_jobs(&self, kept_max: usize) -> Vec<JobId> {
        let mut lists = self.lists();
        let ended = lists.jobs.iter().filter(|(_, entry)| entry.status.borrow().has_ended());
        let ended: Vec<JobId> = ended.map(|(&job, _)| job).collect();
        let forgotten = ended[..ended.len().saturating_sub(kept_max)].to_vec();
        lists.jobs.retain(|job, _| !forgotten.contains(job));
        forgotten
    }

    pub(crate) fn add_worker(&self, status: WorkerStatus) {
        self.lists().workers.insert((status.worker, status.incarnation), status);
    }

    pub(crate) fn remove_worker(&self, worker: WorkerId, incarnation: Incarnation) {
        self.lists().workers.remove(&(worker, incarnation));
    }

    pub(crate) fn watch(&self, job: JobId) -> Option<watch::Receiver<JobStatus>> {
        self.lists().jobs.get(&job).map(|entry| entry.status.subscribe())
    }

    pub(crate) fn job(&self, job: JobId) -> Option<JobStatus> {
        self.lists().jobs.get(&job).map(|entry| entry.status.borrow().clone())
    }

    pub(crate) fn jobs(&self) -> Vec<JobStatus> {
        self.lists().jobs.values().map(|entry| entry.status.borrow().clone()).collect()
    }

    pub(crate) fn film(&self, job: JobId) -> Option<GatheredFilm> {
        self.lists().jobs.get(&job)?.film.clone()
    }

    /// What has this hash of all that workers may fetch.
    pub(crate) fn blob(&self, hash: &BlobHash) -> Option<Blob> {
        let lists = self.lists();
        let attached = || {
            let mut jobs = lists.jobs.values();
            let (path, bytes) = jobs.find_map(|entry| entry.attachments.files.get(hash))?;
            Some(Blob::File(path.clone(), *bytes))
        };
        lists.pack(hash).map(Blob::Memory).or_else(attached)
    }

    pub(crate) fn workers(&self) -> Vec<WorkerStatus> {
        self.lists().workers.values().cloned().collect()
    }

    pub(crate) fn totals(&self) -> Totals {
        self.lists().totals
    }

    fn lists(&self) -> MutexGuard<'_, Lists> {
        self.lists.lock().expect("nobody panics while holding the board")
    }
}

impl Lists {
    fn pack(&self, hash: &BlobHash) -> Option<Bytes> {
        let held = self.jobs.values().filter_map(|entry| entry.pack.as_ref());
        held.into_iter().find(|(known, _)| known == hash).map(|(_, pack)| pack.clone())
    }

    fn packs(&self) -> impl Iterator<Item = (BlobHash, u64)> {
        let held = self.jobs.values().filter_map(|entry| entry.pack.as_ref());
        held.map(|(hash, pack)| (*hash, pack.len() as u64))
    }
}

//! From parts to partitions: triangles come from spool files, trees are built, files written.
//!
//! Two threads work on a part each, and a third one waits for the disk to have what they wrote.
//! What they make has a name of its own until all is made, and is then numbered in the order of the
//! parts, so it does not matter who was faster.

use std::fs::File;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded, unbounded};
use equilux_render::geometry::{
    Bounds, PARTITION_BOXES_MAX, PartitionBuilder, PartitionImage, PartitionPress,
};

use super::bisection::bisect;
use super::error::BuildError;
use super::pass::{self, PartPass, Pass};
use super::prototypes::{PlacedAt, place_bytes};
use super::spool::{PARTS_MAX, SpooledPart};
use super::{CountedPart, Cut, Observer, PARTITIONS_DIRECTORY, Phase, Progress};
use crate::manifest::{FileEntry, PartitionEntry};
use crate::partition_file;

/// Threads that make partitions. Each holds one in memory, with what building its tree takes.
const THREADS: usize = 2;

/// Most files that are written and wait to be on the disk.
const UNSETTLED_MAX: usize = 4;

/// How often the observer is told even if nothing is done: so often an interrupt is noticed.
const OBSERVED_EVERY: Duration = Duration::from_millis(100);

/// Makes partitions of a model.
pub(super) struct Parts<'a> {
    /// How large partitions may be.
    pub(super) cut: Cut,
    /// Where the triangles are, with the first primitive id at each place, if they are a
    /// prototype's.
    pub(super) places: &'a [PlacedAt],
    /// What the names of files begin with until they are numbered.
    pub(super) prefix: &'a str,
    /// Triangles that are in partitions already, and how many will be.
    pub(super) before: u64,
    pub(super) total: u64,
    /// Where their files go.
    pub(super) store: &'a Path,
    /// Where spool files go.
    pub(super) spool: &'a Path,
}

/// The partitions of the part at a position, in order, under names for the time being.
type Made = (usize, Result<Vec<PartitionEntry>, BuildError>);

/// A file all of which has been written.
pub(super) struct Written {
    path: PathBuf,
    file: File,
}

impl Written {
    /// Waits until it is on the disk, in case of a power cut.
    pub(super) fn settle(&self) -> Result<(), BuildError> {
        self.file.sync_all().map_err(|cause| BuildError::unwritable(&self.path, cause))
    }
}

impl Parts<'_> {
    /// Makes the partitions of all parts, in order.
    pub(super) fn make_all(
        &self,
        parts: Vec<CountedPart>,
        observer: &mut Observer<'_>,
    ) -> Result<Vec<PartitionEntry>, BuildError> {
        let is_interrupted = AtomicBool::new(false);
        let part_count = parts.len();
        let (giver, taker) = unbounded();
        for job in parts.into_iter().enumerate() {
            giver.send(job).expect("the other end is here");
        }
        drop(giver);
        let made = std::thread::scope(|scope| -> Result<_, BuildError> {
            let ((sender, made), (written, unsettled)) = (unbounded(), bounded(UNSETTLED_MAX));
            for _ in 0..THREADS {
                let (taker, sender) = (taker.clone(), sender.clone());
                let (is_interrupted, written) = (&is_interrupted, written.clone());
                let press = PartitionPress::default();
                let mut maker = Maker { parts: self, is_interrupted, written, press };
                scope.spawn(move || alone(|| maker.work(&taker, &sender)));
            }
            drop((sender, written));
            let settle = move || unsettled.iter().try_for_each(|written: Written| written.settle());
            let settled = scope.spawn(settle);
            let gathered = gather(&made, part_count, (self.before, self.total), observer);
            is_interrupted.store(gathered.is_err(), Ordering::Relaxed);
            // What the disk refuses stops all others: it is to be told first.
            settled.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            gathered
        })?;
        Ok(made.into_iter().flatten().collect())
    }
}

/// Writes the file of a partition, under a name for the time being. It may not be on the disk yet.
pub(super) fn write(
    store: &Path,
    name: &str,
    partition: PartitionImage<'_>,
) -> Result<(PartitionEntry, Written), BuildError> {
    let name = format!("{PARTITIONS_DIRECTORY}/{name}.unnumbered");
    let path = store.join(&name);
    let (file, hash, bytes) = partition_file::write(&path, partition)
        .map_err(|cause| BuildError::unwritable(&path, cause))?;
    let entry = PartitionEntry {
        triangle_count: partition.triangle_count() as u64,
        placed_count: partition.primitive_count(),
        memory_bytes: partition.bytes() as u64,
        file: FileEntry { name, hash, bytes },
        boxes: partition.boxes(PARTITION_BOXES_MAX),
    };
    Ok((entry, Written { path, file }))
}

/// Gives partitions their names, by their order.
pub(super) fn number(store: &Path, entries: &mut [PartitionEntry]) -> Result<(), BuildError> {
    for (number, entry) in entries.iter_mut().enumerate() {
        let name = format!("{PARTITIONS_DIRECTORY}/{number:05}.part");
        let path: PathBuf = store.join(&name);
        std::fs::rename(store.join(&entry.file.name), &path)
            .map_err(|cause| BuildError::unwritable(&path, cause))?;
        entry.file.name = name;
    }
    Ok(())
}

/// A thread that makes partitions.
struct Maker<'a> {
    parts: &'a Parts<'a>,
    is_interrupted: &'a AtomicBool,
    written: Sender<Written>,
    press: PartitionPress,
}

impl Maker<'_> {
    fn work(&mut self, parts: &Receiver<(usize, CountedPart)>, made: &Sender<Made>) {
        for (position, (part, count)) in parts {
            if self.is_interrupted.load(Ordering::Relaxed) {
                return;
            }
            let name = format!("{}{position:05}", self.parts.prefix);
            let entries = self.make(part, count, &name);
            if made.send((position, entries)).is_err() {
                return;
            }
        }
    }

    /// Makes `count` partitions of a part, or as many as it takes for none to be too large.
    fn make(
        &mut self,
        part: SpooledPart,
        count: u32,
        name: &str,
    ) -> Result<Vec<PartitionEntry>, BuildError> {
        if count > 1 {
            return self.divide(part, count, name);
        }
        if !self.parts.places.is_empty() {
            return self.make_placed(part, name);
        }
        let count = usize::try_from(part.triangle_count).unwrap_or(usize::MAX);
        self.press.begin(count);
        let mut pass = PartPass { part: &part, is_interrupted: self.is_interrupted };
        pass.for_each(&mut |primitive, triangle| {
            self.press.push(primitive, triangle);
            Ok(())
        })?;
        let partition = self.press.press();
        let bytes = partition.bytes() as u64;
        let pieces = match self.parts.cut {
            Cut::Size(most) if part.triangle_count > 1 => bytes.div_ceil(most),
            Cut::Size(_) | Cut::Count(_) => 1,
        };
        if pieces > 1 {
            // It may be much larger than those to come.
            self.press = PartitionPress::default();
            let count = u32::try_from(pieces.min(part.triangle_count)).unwrap_or(u32::MAX);
            return self.divide(part, count, name);
        }
        drop(part);
        let (entry, written) = write(self.parts.store, name, partition)?;
        self.settle_later(written)?;
        Ok(vec![entry])
    }

    /// Makes the partition of a part of a prototype.
    fn make_placed(
        &mut self,
        part: SpooledPart,
        name: &str,
    ) -> Result<Vec<PartitionEntry>, BuildError> {
        let mut builder = PartitionBuilder::default();
        builder.begin_object(self.parts.places.to_vec());
        let mut pass = PartPass { part: &part, is_interrupted: self.is_interrupted };
        pass.for_each(&mut |primitive, triangle| {
            builder.push(primitive, triangle);
            Ok(())
        })?;
        // Bounds matter to those who trace rays only.
        let partition = builder.build(&Bounds::EMPTY.or_origin());
        let (bytes, places) = (partition.bytes() as u64, place_bytes(self.parts.places.len()));
        let pieces = match self.parts.cut {
            Cut::Size(most) if part.triangle_count > 1 => {
                bytes.saturating_sub(places).div_ceil(most.saturating_sub(places).max(most / 4))
            }
            Cut::Size(_) | Cut::Count(_) => 1,
        };
        if pieces > 1 {
            drop(partition);
            let count = u32::try_from(pieces.min(part.triangle_count)).unwrap_or(u32::MAX);
            return self.divide(part, count, name);
        }
        drop(part);
        let (entry, written) = write(self.parts.store, name, partition.image())?;
        self.settle_later(written)?;
        Ok(vec![entry])
    }

    fn settle_later(&self, written: Written) -> Result<(), BuildError> {
        // Nobody listens once another file is known not to be on the disk.
        self.written.send(written).map_err(|_| BuildError::Interrupted)
    }

    /// Takes a part for a model of its own.
    fn divide(
        &mut self,
        part: SpooledPart,
        count: u32,
        name: &str,
    ) -> Result<Vec<PartitionEntry>, BuildError> {
        let mut pass = PartPass { part: &part, is_interrupted: self.is_interrupted };
        let mut survey = pass::survey(&mut pass)?;
        let count = match self.parts.cut {
            Cut::Size(most) => count.max(survey.parts_within(most)),
            Cut::Count(_) => count,
        };
        let prefix = format!("{name}-");
        let files = (self.parts.spool, prefix.as_str());
        let parts = match survey.cells.as_slice() {
            [] | [_] => pass::distribute_evenly(&mut pass, survey.triangle_count, count, files)?,
            cells => {
                let regions = bisect(cells, count, PARTS_MAX);
                pass::distribute(&mut pass, &mut survey, &regions, &mut |_, _| Ok(()), files)?
            }
        };
        drop(survey);
        drop(part);
        let mut entries = Vec::new();
        for (number, (part, count)) in parts.into_iter().enumerate() {
            let name = format!("{prefix}{number:05}");
            entries.extend(self.make(part, count, &name)?);
        }
        Ok(entries)
    }
}

/// Does something with a thread pool of its own, of a single thread: others have work of their own,
/// and would only get in each other's way where a library shares out loops.
fn alone<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("a thread can be started").install(work)
}

/// Waits for the partitions of all parts and tells the observer.
fn gather(
    made: &Receiver<Made>,
    part_count: usize,
    (before, total): (u64, u64),
    observer: &mut Observer<'_>,
) -> Result<Vec<Vec<PartitionEntry>>, BuildError> {
    let mut gathered = vec![Vec::new(); part_count];
    let mut triangles = before;
    loop {
        match made.recv_timeout(OBSERVED_EVERY) {
            Ok((position, entries)) => {
                gathered[position] = entries?;
                let counts = gathered[position].iter().map(|entry| entry.triangle_count);
                triangles += counts.sum::<u64>();
            }
            Err(RecvTimeoutError::Timeout) => {}
            // Threads end when all is made; if one panicked, its panic goes on when it is joined.
            Err(RecvTimeoutError::Disconnected) => return Ok(gathered),
        }
        let progress = Progress { phase: Phase::Partitions, triangles, total: Some(total) };
        if let ControlFlow::Break(()) = observer(progress) {
            return Err(BuildError::Interrupted);
        }
    }
}

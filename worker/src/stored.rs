//! Jobs on stores: what all partitions share is in memory, the partitions come and go.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use equilux_common::ids::PartitionId;
use equilux_common::job::SceneRef;
use equilux_common::message::PeerAddress;
use equilux_common::work::{Outcome, Work};
use equilux_mapping::Guest;
use equilux_render::geometry::{Partition, PartitionSet};
use equilux_render::home::InvalidWork;
use equilux_render::model::{Model, ModelParts};
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;
use equilux_store::partition_file::read_partition_from;
use equilux_store::{Manifest, Store, StoreError, read_partition};
use futures::future::BoxFuture;
use tokio::task::spawn_blocking;

use crate::affinity;
use crate::compute::Tracer;
use crate::driver::{Partitions, Prepared};
use crate::loading;
use crate::packs::{PackError, Packs};
use crate::residents::Hold;

/// Where partitions are read from.
#[derive(Clone, Debug)]
pub(crate) enum Shelf {
    /// The directory of the manifest.
    Here(PathBuf),
    /// The cache, and where that gets it from.
    Fetched(Box<Packs>),
}

/// The model of a store without its partitions, and what is said of these.
pub(crate) type Opened = (Arc<Model>, Arc<Manifest>);

/// A job on a store, with those partitions that are in memory.
struct Tenant {
    shelf: Shelf,
    manifest: Arc<Manifest>,
    guest: Option<Guest>,
    state: Mutex<State>,
    /// If others may have the model too.
    _hold: Option<Hold>,
}

struct State {
    partitions: Vec<Option<Arc<Partition>>>,
    renderer: Arc<Renderer>,
}

/// What a store says of its model, and the model without its partitions.
pub(crate) fn model(store: Store) -> Result<Opened, String> {
    let (manifest, tables, luminaires) = store.into_parts();
    let parts = ModelParts {
        bounds: manifest.bounds,
        triangle_count: manifest.triangle_count,
        boxes: manifest.partitions.iter().map(|entry| entry.boxes.clone()).collect(),
        tables,
        luminaires,
    };
    let model = Model::of_parts(parts).map_err(|error| error.to_string())?;
    Ok((Arc::new(model), Arc::new(manifest)))
}

/// Reads all partitions of a store.
pub(crate) fn all(directory: &Path, manifest: &Manifest) -> Result<Vec<Arc<Partition>>, String> {
    let read = |number: usize| {
        let path = directory.join(&manifest.partitions[number].file.name);
        read_partition(&path, manifest, number).map(Arc::new).map_err(|error| error.to_string())
    };
    (0..manifest.partitions.len()).map(read).collect()
}

/// A job on a store, ready to have partitions brought into memory.
pub(crate) fn prepare(
    renderer: Renderer,
    manifest: Arc<Manifest>,
    shelf: Shelf,
    hold: Option<Hold>,
) -> Result<Prepared, String> {
    let guest = affinity::guest(&manifest).map_err(|error| format!("the manifest: {error}"))?;
    let partitions = vec![None; manifest.partitions.len()];
    let state = Mutex::new(State { partitions, renderer: Arc::new(renderer) });
    let tenant = Arc::new(Tenant { shelf, manifest, guest, state, _hold: hold });
    let partitions = Arc::new(Lease(Arc::clone(&tenant)));
    Ok(Prepared { tracer: tenant, partitions: Some(partitions) })
}

impl Shelf {
    /// Reads a partition; if it is not on this shelf, that peer passes it on.
    async fn read(
        &self,
        manifest: &Arc<Manifest>,
        number: usize,
        from: Option<PeerAddress>,
    ) -> Result<Partition, String> {
        match self {
            Self::Here(directory) => {
                let path = directory.join(&manifest.partitions[number].file.name);
                let manifest = Arc::clone(manifest);
                let read = move || {
                    read_partition(&path, &manifest, number).map_err(|error| error.to_string())
                };
                loading::outcome(spawn_blocking(read)).await
            }
            Self::Fetched(packs) => fetch(packs, manifest, number, from).await,
        }
    }
}

/// Reads a partition from the cache; one that is not there, or damaged, is fetched.
async fn fetch(
    packs: &Packs,
    manifest: &Arc<Manifest>,
    number: usize,
    from: Option<PeerAddress>,
) -> Result<Partition, String> {
    let file = &manifest.partitions[number].file;
    let scene = SceneRef { hash: file.hash.into(), pack_bytes: file.bytes, entry: String::new() };
    if let Some(cached) = packs.cached(&scene) {
        // Straight into place, for it is read often and there may be little memory.
        let read = read_on_own_thread(cached, manifest, number).await?;
        if let Ok(partition) = read {
            return Ok(partition);
        }
    }
    let fetched = packs.pack(&scene, &[from.clone(), from]).await;
    let bytes = fetched.map_err(|error| unfetched(&file.name, &error))?;
    let bytes = std::io::Cursor::new(ArcBytes(bytes));
    read_on_own_thread(bytes, manifest, number).await?.map_err(|error| error.to_string())
}

/// Why a partition cannot be had.
fn unfetched(file: &str, error: &PackError) -> String {
    match error {
        // The coordinator sends it as it is on its disk.
        PackError::Other(_) => StoreError::Damaged { file: file.to_owned() }.to_string(),
        _ => format!("{file}: {error}"),
    }
}

/// Shared bytes as a slice.
struct ArcBytes(Arc<Vec<u8>>);

impl AsRef<[u8]> for ArcBytes {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

async fn read_on_own_thread(
    reader: impl std::io::Read + Send + 'static,
    manifest: &Arc<Manifest>,
    number: usize,
) -> Result<Result<Partition, StoreError>, String> {
    let manifest = Arc::clone(manifest);
    let read = move || {
        let name = &manifest.partitions[number].file.name;
        Ok(read_partition_from(reader, name, &manifest, number))
    };
    loading::outcome(spawn_blocking(read)).await
}

impl Tenant {
    /// Puts a partition into its place, or empties the place; what was there is gone when the last
    /// thread has let go of it.
    fn place(&self, PartitionId(number): PartitionId, partition: Option<Partition>) {
        let mut state = lock(&self.state);
        state.partitions[number as usize] = partition.map(Arc::new);
        let set = PartitionSet::new(state.partitions.clone());
        state.renderer = Arc::new(state.renderer.with_partitions(set));
    }
}

impl Tracer for Tenant {
    fn trace(
        &self,
        work: Work,
        interrupt: &AtomicBool,
        scratch: &mut Scratch,
    ) -> Result<Outcome, InvalidWork> {
        let renderer = Arc::clone(&lock(&self.state).renderer);
        renderer.trace(work, interrupt, scratch)
    }
}

/// The partitions of a job on a store.
struct Lease(Arc<Tenant>);

impl Partitions for Lease {
    fn guest(&self) -> Option<Guest> {
        self.0.guest.clone()
    }

    fn load(
        &self,
        partition: PartitionId,
        from: Option<PeerAddress>,
    ) -> BoxFuture<'static, Result<(), String>> {
        let tenant = Arc::clone(&self.0);
        Box::pin(async move {
            let read = tenant.shelf.read(&tenant.manifest, partition.0 as usize, from).await?;
            tenant.place(partition, Some(read));
            Ok(())
        })
    }

    fn release(&self, partition: PartitionId) {
        self.0.place(partition, None);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

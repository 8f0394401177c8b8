//! Where the scenes of jobs come from: memory, or a pack that is fetched and read.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use equilux_common::job::JobSpec;
use equilux_common::scene::Scene;
use equilux_common::scene::files::Pack;
use equilux_common::scene::load::load;
use equilux_common::spread::PackSources;
use equilux_common::work::{Outcome, Work};
use equilux_render::geometry::Partition;
use equilux_render::home::InvalidWork;
use equilux_render::model::Model;
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;
use equilux_store::{Manifest, Store};
use futures::future::BoxFuture;
use tokio::task::spawn_blocking;

use crate::compute::Tracer;
use crate::driver::{Prepared, SceneSource};
use crate::loading;
use crate::packs::Packs;
use crate::residents::{Hold, Residents, Word};
use crate::stored::{self, Opened, Shelf};

/// A scene that is in memory already, for a process that renders by itself. Every job gets it,
/// whatever it asks for. Clones share it.
#[derive(Clone, Debug)]
pub struct LoadedScene(Arc<Loaded>);

#[derive(Debug)]
struct Loaded {
    /// Taken when the model is made.
    scene: Mutex<Option<Scene>>,
    model: OnceLock<Result<Arc<Model>, String>>,
}

impl LoadedScene {
    /// The first job has the model made.
    #[must_use]
    pub fn new(scene: Scene) -> Self {
        Self(Arc::new(Loaded { scene: Mutex::new(Some(scene)), model: OnceLock::new() }))
    }

    /// A job on this scene, ready to be traced.
    pub(crate) async fn renderer(&self, spec: &JobSpec) -> Result<Renderer, String> {
        let model = match self.0.model.get() {
            Some(model) => model.clone(),
            None => {
                let loaded = Arc::clone(&self.0);
                on_own_thread(move || loaded.model()).await
            }
        };
        renderer(model?, spec)
    }
}

impl Loaded {
    fn model(&self) -> Result<Arc<Model>, String> {
        let make = || {
            let scene = self.scene.lock().unwrap_or_else(PoisonError::into_inner).take();
            model(scene.expect("a model is made once"))
        };
        self.model.get_or_init(make).clone()
    }
}

impl SceneSource for LoadedScene {
    fn load(&self, spec: JobSpec, _: PackSources) -> BoxFuture<'static, Result<Prepared, String>> {
        let scene = self.clone();
        Box::pin(async move { Ok(Prepared::replicated(Arc::new(scene.renderer(&spec).await?))) })
    }
}

/// A store on a disk of this machine, for a process that renders by itself. Every job gets it,
/// whatever it asks for. Clones share it.
#[derive(Clone, Debug)]
pub struct StoredScene(Arc<OpenedStore>);

#[derive(Debug)]
struct OpenedStore {
    directory: PathBuf,
    /// Taken when the model is made.
    store: Mutex<Option<Store>>,
    model: OnceLock<Result<Opened, String>>,
}

impl StoredScene {
    /// The store whose manifest lies in `directory`.
    #[must_use]
    pub fn new(store: Store, directory: &Path) -> Self {
        let (store, model) = (Mutex::new(Some(store)), OnceLock::new());
        Self(Arc::new(OpenedStore { directory: directory.to_owned(), store, model }))
    }
}

impl StoredScene {
    /// A job on the store, and all of its partitions.
    pub(crate) async fn whole(&self, spec: &JobSpec) -> Result<Whole, String> {
        let (opened, spec) = (Arc::clone(&self.0), spec.clone());
        on_own_thread(move || {
            let (model, manifest) = opened.model()?;
            let partitions = stored::all(&opened.directory, &manifest)?;
            Ok(Whole { renderer: renderer(model, &spec)?, manifest, partitions })
        })
        .await
    }
}

/// A job on a store all of which is in memory.
pub(crate) struct Whole {
    /// Without any partition.
    pub(crate) renderer: Renderer,
    pub(crate) manifest: Arc<Manifest>,
    pub(crate) partitions: Vec<Arc<Partition>>,
}

impl OpenedStore {
    fn model(&self) -> Result<Opened, String> {
        let make = || {
            let store = self.store.lock().unwrap_or_else(PoisonError::into_inner).take();
            stored::model(store.expect("a model is made once"))
        };
        self.model.get_or_init(make).clone()
    }
}

impl SceneSource for StoredScene {
    fn load(&self, spec: JobSpec, _: PackSources) -> BoxFuture<'static, Result<Prepared, String>> {
        let opened = Arc::clone(&self.0);
        Box::pin(async move {
            let shared = Arc::clone(&opened);
            let (model, manifest) = on_own_thread(move || shared.model()).await?;
            let shelf = Shelf::Here(opened.directory.clone());
            stored::prepare(renderer(model, &spec)?, manifest, shelf, None)
        })
    }
}

/// Scenes from packs that come from peers and the coordinator, unless they are in memory.
pub(crate) struct FetchedScenes {
    residents: Residents,
    packs: Packs,
}

impl FetchedScenes {
    pub(crate) const fn new(residents: Residents, packs: Packs) -> Self {
        Self { residents, packs }
    }
}

impl SceneSource for FetchedScenes {
    fn load(
        &self,
        spec: JobSpec,
        from: PackSources,
    ) -> BoxFuture<'static, Result<Prepared, String>> {
        let packs = self.packs.clone();
        // Here already, for this is called in the order of the jobs.
        let claim = self.residents.claim(&spec.scene);
        Box::pin(async move {
            let scene = &spec.scene;
            let make = async |word: Word| {
                let bytes = packs.pack(scene, &from).await.map_err(|error| error.to_string())?;
                let entry = scene.entry.clone();
                on_own_thread(move || hold(bytes, &entry, word)).await
            };
            let hold = claim.model(make).await?;
            let renderer = renderer(Arc::clone(hold.model()), &spec)?;
            if let Some(manifest) = hold.manifest().cloned() {
                let shelf = Shelf::Fetched(Box::new(packs));
                return stored::prepare(renderer, manifest, shelf, Some(hold));
            }
            Ok(Prepared::replicated(Arc::new(Tenant { renderer, _hold: hold })))
        })
    }
}

/// A job on a model that others may have too.
struct Tenant {
    // Fields are dropped in this order.
    renderer: Renderer,
    _hold: Hold,
}

impl Tracer for Tenant {
    fn trace(
        &self,
        work: Work,
        interrupt: &AtomicBool,
        scratch: &mut Scratch,
    ) -> Result<Outcome, InvalidWork> {
        self.renderer.trace(work, interrupt, scratch)
    }
}

/// Makes the model of a scene, or of a store without its partitions, out of a pack.
fn hold(bytes: Arc<Vec<u8>>, entry: &str, word: Word) -> Result<Hold, String> {
    let pack = Pack::from_bytes(&bytes).map_err(|error| error.to_string())?;
    drop(bytes);
    if Store::is_in(&pack, entry) {
        let store = Store::open(&pack, entry).map_err(|error| error.to_string())?;
        let (model, manifest) = stored::model(store)?;
        return Ok(Hold::new(model, word).with_manifest(manifest));
    }
    let loaded = load(&pack, entry).map_err(|error| error.to_string())?;
    Ok(Hold::new(model(loaded.scene)?, word))
}

/// Makes a scene ready for any job.
fn model(scene: Scene) -> Result<Arc<Model>, String> {
    Model::new(scene).map(Arc::new).map_err(|error| error.to_string())
}

/// Makes a job on a model ready to be traced.
fn renderer(model: Arc<Model>, spec: &JobSpec) -> Result<Renderer, String> {
    let renderer = Renderer::of_model(model, &spec.camera, &spec.settings, spec.grid());
    renderer.map_err(|error| error.to_string())
}

/// Does what takes long away from the messages.
async fn on_own_thread<T: Send + 'static>(
    load: impl FnOnce() -> Result<T, String> + Send + 'static,
) -> Result<T, String> {
    loading::outcome(spawn_blocking(load)).await
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Log;
    use crate::pack_cache::{CACHE_BYTES_MAX, PackCache};
    use crate::testing::{no_coordinator, pack, settle, soon, spec};
    use equilux_common::job::SceneRef;
    use futures::poll;
    use std::pin::pin;

    #[tokio::test]
    async fn a_job_has_its_model_until_its_tracer_is_dropped() {
        let directory = tempfile::tempdir().unwrap();
        let cache = PackCache::open(directory.path(), CACHE_BYTES_MAX, Log::silent()).unwrap();
        cache.keep(pack().hash(), &pack().to_bytes()).unwrap();
        let packs = Packs::new(cache, no_coordinator(), Log::silent());
        let residents = Residents::within(0, Log::silent());
        let scenes = FetchedScenes::new(residents.clone(), packs);
        let spec = spec(1);
        let tracer = soon(scenes.load(spec.clone(), [None, None])).await.ok().unwrap();
        let known = residents.claim(&spec.scene).model(async |_| Err("it is known".to_owned()));
        let model = Arc::downgrade(known.await.unwrap().model());
        assert_eq!(model.strong_count(), 3, "the residents, the renderer and its hold have it");

        let other = SceneRef { hash: [0; 32], ..spec.scene };
        let next = residents.claim(&other).model(async |_| Err(model.strong_count().to_string()));
        let mut next = pin!(next);
        soon(async {
            while model.strong_count() > 2 {
                tokio::task::yield_now().await;
            }
        })
        .await;
        settle().await;
        assert!(poll!(&mut next).is_pending(), "the tracer has it");
        drop(tracer);
        assert_eq!(soon(next).await.map(|_| ()), Err("0".to_owned()));
    }
}

//! Where the scenes of jobs come from: memory, or a pack that is fetched and read.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use equilux_common::job::JobSpec;
use equilux_common::scene::Scene;
use equilux_common::scene::files::Pack;
use equilux_common::scene::load::load;
use equilux_common::spread::PackSources;
use equilux_render::model::Model;
use equilux_render::renderer::Renderer;
use futures::future::BoxFuture;

use crate::compute::Tracer;
use crate::driver::SceneSource;
use crate::packs::Packs;
use crate::residents::Residents;

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
    fn load(
        &self,
        spec: JobSpec,
        _: PackSources,
    ) -> BoxFuture<'static, Result<Arc<dyn Tracer>, String>> {
        let scene = self.clone();
        Box::pin(async move { Ok(Arc::new(scene.renderer(&spec).await?) as Arc<dyn Tracer>) })
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
    ) -> BoxFuture<'static, Result<Arc<dyn Tracer>, String>> {
        let (packs, residents) = (self.packs.clone(), self.residents.clone());
        Box::pin(async move {
            let scene = &spec.scene;
            let make = async {
                let bytes = packs.pack(scene, &from).await.map_err(|error| error.to_string())?;
                let entry = scene.entry.clone();
                on_own_thread(move || model(read(bytes, &entry)?)).await
            };
            let model = residents.model(scene, make).await?;
            Ok(Arc::new(renderer(model, &spec)?) as Arc<dyn Tracer>)
        })
    }
}

/// Reads a scene out of a pack.
fn read(bytes: Arc<Vec<u8>>, entry: &str) -> Result<Scene, String> {
    let pack = Pack::from_bytes(&bytes).map_err(|error| error.to_string())?;
    drop(bytes);
    let loaded = load(&pack, entry).map_err(|error| error.to_string())?;
    Ok(loaded.scene)
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

/// Does what takes long away from the messages; a panic there is a bug, but no reason to hang.
async fn on_own_thread(
    load: impl FnOnce() -> Result<Arc<Model>, String> + Send + 'static,
) -> Result<Arc<Model>, String> {
    let loaded = tokio::task::spawn_blocking(load).await;
    loaded.unwrap_or_else(|error| {
        Err(format!(
            "loading the scene failed: {error}; this is a bug in equilux, please report it"
        ))
    })
}

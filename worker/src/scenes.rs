//! Where the scenes of jobs come from: memory, or a pack that is fetched and read.

use std::sync::{Arc, Mutex, PoisonError};

use equilux_common::job::JobSpec;
use equilux_common::scene::Scene;
use equilux_common::scene::files::Pack;
use equilux_common::scene::load::load;
use equilux_common::spread::PackSources;
use equilux_render::renderer::Renderer;
use futures::future::BoxFuture;

use crate::compute::Tracer;
use crate::driver::SceneSource;
use crate::packs::Packs;

/// A scene that is in memory already, for the one job of a process that renders by itself.
#[derive(Debug)]
pub struct LoadedScene(Mutex<Option<Scene>>);

impl LoadedScene {
    /// The first job gets this scene, whatever it asks for.
    #[must_use]
    pub const fn new(scene: Scene) -> Self {
        Self(Mutex::new(Some(scene)))
    }
}

impl SceneSource for LoadedScene {
    fn load(
        &self,
        spec: JobSpec,
        _: PackSources,
    ) -> BoxFuture<'static, Result<Arc<dyn Tracer>, String>> {
        let scene = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        Box::pin(async move {
            let scene = scene.ok_or("the scene was for another job; load it again")?;
            on_own_thread(move || build(scene, &spec)).await
        })
    }
}

/// Scenes from packs that come from peers and the coordinator.
pub(crate) struct FetchedScenes {
    packs: Packs,
}

impl FetchedScenes {
    pub(crate) const fn new(packs: Packs) -> Self {
        Self { packs }
    }
}

impl SceneSource for FetchedScenes {
    fn load(
        &self,
        spec: JobSpec,
        from: PackSources,
    ) -> BoxFuture<'static, Result<Arc<dyn Tracer>, String>> {
        let packs = self.packs.clone();
        Box::pin(async move {
            let bytes = packs.pack(&spec.scene, &from).await.map_err(|error| error.to_string())?;
            on_own_thread(move || build(read(bytes, &spec)?, &spec)).await
        })
    }
}

/// Reads the scene of a job out of a pack.
fn read(bytes: Arc<Vec<u8>>, spec: &JobSpec) -> Result<Scene, String> {
    let pack = Pack::from_bytes(&bytes).map_err(|error| error.to_string())?;
    drop(bytes);
    let loaded = load(&pack, &spec.scene.entry).map_err(|error| error.to_string())?;
    Ok(loaded.scene)
}

/// Makes a scene ready to be traced.
fn build(scene: Scene, spec: &JobSpec) -> Result<Arc<dyn Tracer>, String> {
    match Renderer::new(scene, &spec.camera, &spec.settings, spec.grid()) {
        Ok(renderer) => Ok(Arc::new(renderer)),
        Err(error) => Err(error.to_string()),
    }
}

/// Does what takes long away from the messages; a panic there is a bug, but no reason to hang.
async fn on_own_thread(
    load: impl FnOnce() -> Result<Arc<dyn Tracer>, String> + Send + 'static,
) -> Result<Arc<dyn Tracer>, String> {
    let loaded = tokio::task::spawn_blocking(load).await;
    loaded.unwrap_or_else(|error| {
        Err(format!(
            "loading the scene failed: {error}; this is a bug in equilux, please report it"
        ))
    })
}

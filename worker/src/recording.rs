//! Recording what the paths of a scene cost while it is rendered, to be spent again in simulated
//! clusters ([`SceneCosts`]).
//!
//! A [`Stopwatch`] laps after every bundle, so that all time between taking up a piece of work and
//! handing it back is counted somewhere: what is recorded adds up to what the threads were busy.
//! Nothing of it can change the image, for light only tells what it does.

mod itineraries;
mod preparation;
mod stopwatch;
mod table;

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use equilux_common::costs::{COSTS_VERSION, SceneCosts};
use equilux_common::film::TileSums;
use equilux_common::itinerary::PartitionedCosts;
use equilux_common::job::JobSpec;
use equilux_common::scene::Scene;
use equilux_common::spread::PackSources;
use equilux_common::unit::Rect;
use equilux_common::work::{Outcome, Work};
use equilux_proto::tile;
use equilux_render::geometry::PartitionSet;
use equilux_render::home::InvalidWork;
use equilux_render::renderer::Renderer;
use equilux_render::scratch::Scratch;
use futures::future::BoxFuture;
use tokio::task::spawn_blocking;

use self::preparation::preparation;
use self::stopwatch::Stopwatch;
use self::table::{CELL_SIDE_PIXELS, Cells, CostTable};
use crate::compute::Tracer;
use crate::driver::{Prepared, SceneSource};
use crate::loading;
use crate::scenes::{LoadedScene, StoredScene, Whole};

/// A scene or all of a store in memory, for a process that renders by itself and records what that
/// costs.
#[derive(Clone, Debug)]
pub struct RecordedScene {
    scene: Subject,
    /// The latest job and what has been measured of it.
    recording: Arc<Mutex<Option<Recording>>>,
}

#[derive(Clone, Debug)]
enum Subject {
    Scene(LoadedScene),
    Store(StoredScene),
}

#[derive(Debug)]
struct Recording {
    spec: JobSpec,
    table: Arc<Mutex<CostTable>>,
}

impl RecordedScene {
    /// Every job gets this scene, whatever it asks for.
    #[must_use]
    pub fn new(scene: Scene) -> Self {
        Self { scene: Subject::Scene(LoadedScene::new(scene)), recording: Arc::default() }
    }

    /// Every job gets this store, whatever it asks for.
    #[must_use]
    pub fn of_store(store: StoredScene) -> Self {
        Self { scene: Subject::Store(store), recording: Arc::default() }
    }

    /// What the latest job cost, given its finished film. `name` is what tables call the scene.
    ///
    /// # Errors
    /// If not all of it was rendered here, or too much would have to be written down.
    pub async fn costs(&self, name: String, film: &TileSums) -> Result<SceneCosts, String> {
        const PARTLY: &str =
            "what paths cost was not recorded of all of the image; record it again";
        let (spec, table) = {
            let recording = lock(&self.recording);
            let Recording { spec, table } = recording.as_ref().ok_or(PARTLY)?;
            (spec.clone(), Arc::clone(table))
        };
        let region = spec.settings.region();
        let samples_per_pixel = spec.settings.samples_per_pixel;
        let tile_side = spec.granularity.tile_side_pixels;
        let cells = lock(&table).cells(&Cells::of(&spec), samples_per_pixel).ok_or(PARTLY)?;
        let shadow_part = lock(&table).shadow_part();
        let partitioned = self.scene.partitioned(&spec, shadow_part).await?;
        let prepare = preparation(self.scene.source(), spec).await.ok_or(PARTLY)?;
        Ok(SceneCosts {
            equilux_costs: COSTS_VERSION,
            scene: name,
            width: region.width(),
            height: region.height(),
            samples_per_pixel,
            cell_side_pixels: CELL_SIDE_PIXELS,
            prepare_s: prepare.as_secs_f64(),
            bytes_per_pixel: bytes_per_pixel(film, tile_side),
            cells,
            partitioned,
        })
    }
}

impl Subject {
    /// A job on it, with all of it in memory.
    async fn renderer(&self, spec: &JobSpec) -> Result<Renderer, String> {
        match self {
            Self::Scene(scene) => scene.renderer(spec).await,
            Self::Store(store) => {
                let Whole { renderer, partitions, .. } = store.whole(spec).await?;
                Ok(renderer
                    .with_partitions(PartitionSet::new(partitions.into_iter().map(Some).collect())))
            }
        }
    }

    /// Where paths of a job go, if it is cut into partitions.
    async fn partitioned(
        &self,
        spec: &JobSpec,
        shadow_part: f64,
    ) -> Result<Option<PartitionedCosts>, String> {
        let Self::Store(store) = self else { return Ok(None) };
        let (whole, spec) = (store.whole(spec).await?, spec.clone());
        let record = move || itineraries::record(&whole, &spec, shadow_part);
        loading::outcome(spawn_blocking(record)).await.map(Some)
    }

    fn source(&self) -> Arc<dyn SceneSource> {
        match self {
            Self::Scene(scene) => Arc::new(scene.clone()),
            Self::Store(store) => Arc::new(store.clone()),
        }
    }
}

impl SceneSource for RecordedScene {
    fn load(&self, spec: JobSpec, _: PackSources) -> BoxFuture<'static, Result<Prepared, String>> {
        let table: Arc<Mutex<CostTable>> = Arc::default();
        let recording = Recording { spec: spec.clone(), table: Arc::clone(&table) };
        *lock(&self.recording) = Some(recording);
        let scene = self.scene.clone();
        Box::pin(async move {
            let renderer = scene.renderer(&spec).await?;
            let tracer = RecordingTracer { renderer, cells: Cells::of(&spec), table };
            Ok(Prepared::replicated(Arc::new(tracer)))
        })
    }
}

/// Traces a job, clock in hand.
#[derive(Debug)]
struct RecordingTracer {
    renderer: Renderer,
    cells: Cells,
    table: Arc<Mutex<CostTable>>,
}

impl Tracer for RecordingTracer {
    fn trace(
        &self,
        work: Work,
        interrupt: &AtomicBool,
        scratch: &mut Scratch,
    ) -> Result<Outcome, InvalidWork> {
        let start = now();
        let mut stopwatch = Stopwatch::start(&self.cells, || start.elapsed());
        let outcome = self.renderer.trace_observed(work, interrupt, scratch, &mut stopwatch)?;
        lock(&self.table).merge(stopwatch.stop());
        Ok(outcome)
    }
}

/// Mean length of a touched pixel of the film on the wire, its part of the headers of tiles
/// included.
fn bytes_per_pixel(film: &TileSums, tile_side: u32) -> f64 {
    let Rect { x0, y0, x1, y1 } = film.tile;
    let corners = (y0..y1)
        .step_by(tile_side as usize)
        .flat_map(|top| (x0..x1).step_by(tile_side as usize).map(move |left| (left, top)));
    let tiles = corners.map(|(left, top)| Rect {
        x0: left,
        y0: top,
        x1: x1.min(left + tile_side),
        y1: y1.min(top + tile_side),
    });
    let bytes: usize = tiles.map(|tile| tile::encode(&cut(film, tile)).len()).sum();
    bytes as f64 / film.tile.pixel_count() as f64
}

/// The part of a film that a tile shows.
fn cut(film: &TileSums, tile: Rect) -> TileSums {
    let rows = (tile.y0..tile.y1).map(|y| film.tile.index_of(tile.x0, y));
    let pixels = rows.flat_map(|start| &film.pixels[start..start + tile.width() as usize]);
    TileSums { pixels: pixels.copied().collect(), ..TileSums::new(tile) }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[expect(clippy::disallowed_methods, reason = "the edge measures what light does")]
fn now() -> Instant {
    Instant::now()
}

#[cfg(test)]
mod tests;

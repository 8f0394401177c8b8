//! Models that stay in memory when their job is over, and over a broken session: the next job on
//! the same scene starts at once, without fetching, reading or building anything.
//!
//! The scene of the last job stays whatever its size, since the next job is most likely on it;
//! others stay beside it within a limit. Before another scene is loaded, all must be within the
//! limit: two large scenes are never in memory at once because of what is kept here.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use equilux_common::job::SceneRef;
use equilux_render::model::Model;
use tokio::sync::OnceCell;

/// Most bytes of models that are kept beside one another: few machines are short of a gigabyte, and
/// it holds some millions of triangles.
const RESIDENT_BYTES_MAX: u64 = 1 << 30;

/// Most models that are kept, however small: jobs do not alternate between more scenes.
const RESIDENT_MODELS_MAX: usize = 8;

/// The models in memory. Clones share them.
#[derive(Clone, Debug)]
pub(crate) struct Residents {
    /// The most recent one first.
    list: Arc<Mutex<Vec<Resident>>>,
    bytes_max: u64,
}

/// A model, or the place for one that is being made.
#[derive(Clone, Debug)]
struct Resident {
    scene: SceneRef,
    model: Arc<OnceCell<Arc<Model>>>,
}

impl Residents {
    /// None so far.
    pub(crate) fn new() -> Self {
        Self { list: Arc::default(), bytes_max: RESIDENT_BYTES_MAX }
    }

    /// The model of `scene`: that in memory, or what `make` makes. Whoever asks for one that is
    /// being made waits for it.
    pub(crate) async fn model<E>(
        &self,
        scene: &SceneRef,
        make: impl Future<Output = Result<Arc<Model>, E>>,
    ) -> Result<Arc<Model>, E> {
        let place = self.place(scene);
        let model = Arc::clone(place.get_or_try_init(|| make).await?);
        let surplus = self.surplus(&mut self.lock(), 1);
        free(surplus);
        Ok(model)
    }

    /// The place of a scene, which becomes the most recent one.
    fn place(&self, scene: &SceneRef) -> Arc<OnceCell<Arc<Model>>> {
        let mut residents = self.lock();
        let known = residents.iter().position(|resident| resident.scene == *scene);
        let resident = match known {
            Some(index) => residents.remove(index),
            None => {
                free(self.surplus(&mut residents, 0));
                Resident { scene: scene.clone(), model: Arc::default() }
            }
        };
        let place = Arc::clone(&resident.model);
        residents.insert(0, resident);
        place
    }

    /// Takes out what is beyond the limits, the least recent ones; the first `spared` stay anyway.
    fn surplus(&self, residents: &mut Vec<Resident>, spared: usize) -> Vec<Resident> {
        let mut bytes = 0;
        let stays = |(index, resident): &(usize, &Resident)| {
            bytes += resident.bytes();
            *index < spared || (*index < RESIDENT_MODELS_MAX && bytes <= self.bytes_max)
        };
        let kept = residents.iter().enumerate().take_while(stays).count();
        residents.split_off(kept)
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Resident>> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Resident {
    fn bytes(&self) -> u64 {
        self.model.get().map_or(0, |model| model.bytes())
    }
}

/// Freeing a large model takes long, so it is not done where messages wait.
fn free(residents: Vec<Resident>) {
    if !residents.is_empty() {
        tokio::task::spawn_blocking(move || drop(residents));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{pack, soon};
    use equilux_common::scene::load::load;
    use std::convert::Infallible;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn scene(number: u8) -> SceneRef {
        SceneRef { hash: [number; 32], pack_bytes: 1, entry: "scene.json".into() }
    }

    /// A model of more bytes than `bytes`.
    fn model(bytes: u64) -> Arc<Model> {
        let mut scene = load(&pack(), "model.obj").unwrap().scene;
        let normal_bytes = size_of::<[f32; 3]>() as u64;
        scene.geometry.normals = vec![[0.0; 3]; usize::try_from(bytes / normal_bytes).unwrap()];
        Arc::new(Model::new(scene).unwrap())
    }

    const BYTES_MAX: u64 = 1 << 20;

    /// Counts how often models are made.
    struct Bench {
        residents: Residents,
        made: AtomicUsize,
    }

    fn bench() -> Bench {
        let residents = Residents { bytes_max: BYTES_MAX, ..Residents::new() };
        Bench { residents, made: AtomicUsize::new(0) }
    }

    impl Bench {
        /// Whether the model of a scene had to be made.
        async fn makes(&self, number: u8, bytes: u64) -> bool {
            let mut is_made = false;
            let make = async {
                is_made = true;
                self.made.fetch_add(1, Ordering::SeqCst);
                tokio::task::yield_now().await;
                Ok::<_, Infallible>(model(bytes))
            };
            let Ok(_) = self.residents.model(&scene(number), make).await;
            is_made
        }

        fn kept(&self) -> Vec<u8> {
            self.residents.lock().iter().map(|resident| resident.scene.hash[0]).collect()
        }
    }

    #[tokio::test]
    async fn the_second_job_on_a_scene_finds_it() {
        let bench = bench();
        assert!(bench.makes(1, 0).await);
        assert!(!bench.makes(1, 0).await);
        assert!(bench.makes(2, 0).await);
        assert!(!bench.makes(1, 0).await && !bench.makes(2, 0).await);
        for number in 3..12 {
            assert!(bench.makes(number, 0).await);
        }
        assert_eq!(bench.kept(), [11, 10, 9, 8, 7, 6, 5, 4]);
        assert!(bench.makes(1, 0).await, "the least recent ones have gone");
    }

    #[tokio::test]
    async fn a_large_scene_stays_alone_and_goes_before_another_is_loaded() {
        let bench = bench();
        assert!(bench.makes(1, 0).await);
        assert!(bench.makes(2, BYTES_MAX).await);
        assert_eq!(bench.kept(), [2]);
        assert!(!bench.makes(2, 0).await, "the latest stays, whatever its size");
        let large = Arc::downgrade(bench.residents.lock()[0].model.get().unwrap());
        let make = async {
            assert_eq!(bench.kept(), [3], "all has gone before the next is made");
            Ok::<_, Infallible>(model(0))
        };
        let Ok(_) = bench.residents.model(&scene(3), make).await;
        soon(async {
            while large.strong_count() > 0 {
                tokio::task::yield_now().await;
            }
        })
        .await;
    }

    #[tokio::test]
    async fn a_scene_that_is_being_made_is_waited_for_and_one_that_failed_is_made_again() {
        let bench = bench();
        let fail = async { Err("no such file") };
        let failed = bench.residents.model(&scene(1), fail).await;
        assert_eq!(failed.map(|_| ()), Err("no such file"));
        let (first, second) = tokio::join!(bench.makes(1, 0), bench.makes(1, 0));
        assert_eq!((first, second, bench.made.load(Ordering::SeqCst)), (true, false, 1));
    }
}

//! Models that stay in memory when their job is over, and over a broken session: the next job on
//! the same scene starts at once, without fetching, reading or building anything.
//!
//! The scene of the last job stays whatever its size, since the next job is most likely on it;
//! others stay beside it within a limit. A worker has one job at a time, so a scene that is asked
//! for takes the place of one that is still being loaded: that is given up.
//!
//! Before another scene is loaded, all that stay are within the limit, and what does not stay is
//! waited for until it is out of memory: freed by the last thread that traced it, or by the one
//! that was just building it. So two large scenes are never in memory at once. The one exception is
//! a thread that keeps its scene for longer than [`LETTING_GO_MAX`]: a job must not hang for it,
//! nor fail for want of memory that may well be there, so the next scene is loaded beside it, and
//! the user is told.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use equilux_common::job::SceneRef;
use equilux_render::model::Model;
use equilux_store::Manifest;
use tokio::sync::{OnceCell, watch};
use tokio::time::timeout;

use crate::log::Log;

/// Most bytes of models that are kept beside one another: few machines are short of a gigabyte, and
/// it holds some millions of triangles.
const RESIDENT_BYTES_MAX: u64 = 1 << 30;

/// Most models that are kept, however small: jobs do not alternate between more scenes.
const RESIDENT_MODELS_MAX: usize = 8;

/// How long the next scene waits for memory. Threads that trace let go within milliseconds of being
/// interrupted; the tree of a large scene, which nothing interrupts, takes less than a minute.
const LETTING_GO_MAX: Duration = Duration::from_secs(60);

/// The models in memory. Clones share them.
#[derive(Clone, Debug)]
pub(crate) struct Residents {
    state: Arc<Mutex<State>>,
    /// The number of the resident that was asked for last.
    latest: Arc<watch::Sender<u64>>,
    bytes_max: u64,
    patience: Duration,
    log: Log,
}

#[derive(Debug, Default)]
struct State {
    /// That of the newest resident.
    number: u64,
    /// Those that stay, the most recent one first.
    staying: Vec<Resident>,
    /// Those that do not stay, as long as somebody has them. They are out of memory when these are
    /// closed.
    leaving: Vec<Arc<watch::Sender<()>>>,
}

/// A model, or the place for one that is being made.
#[derive(Clone, Debug)]
struct Resident {
    number: u64,
    scene: SceneRef,
    model: Arc<OnceCell<Hold>>,
    /// Watched by all that have the model or make it, so that it is closed when the last of them
    /// has let go. Nothing is ever sent.
    holders: Arc<watch::Sender<()>>,
}

/// The word that somebody has a model, or makes it.
#[derive(Clone, Debug)]
pub(crate) struct Word {
    _holder: watch::Receiver<()>,
}

/// A model in memory. Whoever has it, in whatever form, is to let go of it before this.
#[derive(Clone, Debug)]
pub(crate) struct Hold {
    // Fields are dropped in this order.
    model: Arc<Model>,
    manifest: Option<Arc<Manifest>>,
    _word: Word,
}

/// A claim to the model of a scene.
#[derive(Debug)]
pub(crate) struct Claim {
    residents: Residents,
    resident: Resident,
    word: Word,
}

/// Another scene was asked for while this one was being loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("another scene has been asked for meanwhile")]
pub(crate) struct Superseded;

impl From<Superseded> for String {
    fn from(error: Superseded) -> Self {
        error.to_string()
    }
}

impl Hold {
    /// A model that was made with this word.
    pub(crate) const fn new(model: Arc<Model>, word: Word) -> Self {
        Self { model, manifest: None, _word: word }
    }

    /// The model is that of a store, of which this is said.
    pub(crate) fn with_manifest(self, manifest: Arc<Manifest>) -> Self {
        Self { manifest: Some(manifest), ..self }
    }

    /// What is said of the store that the model is of, if it is of one.
    pub(crate) const fn manifest(&self) -> Option<&Arc<Manifest>> {
        self.manifest.as_ref()
    }

    /// The model.
    pub(crate) const fn model(&self) -> &Arc<Model> {
        &self.model
    }
}

impl Residents {
    /// None so far.
    pub(crate) fn new(log: Log) -> Self {
        Self::within(RESIDENT_BYTES_MAX, log)
    }

    /// None so far, and few later: beside one another, they stay within so many bytes.
    pub(crate) fn within(bytes_max: u64, log: Log) -> Self {
        let (state, latest) = (Arc::default(), Arc::new(watch::Sender::new(0)));
        Self { state, latest, bytes_max, patience: LETTING_GO_MAX, log }
    }

    /// Claims the model of `scene` for the next job; loading any other one is given up. To be
    /// called in the order of the jobs.
    pub(crate) fn claim(&self, scene: &SceneRef) -> Claim {
        let mut state = self.lock();
        let known = state.staying.iter().position(|resident| resident.scene == *scene);
        let known = known.map(|index| state.staying.remove(index));
        let unmade = state.staying.extract_if(.., |resident| !resident.model.initialized());
        let mut leaving: Vec<Resident> = unmade.collect();
        let resident = known.unwrap_or_else(|| {
            leaving.extend(self.surplus(&mut state.staying, 0));
            state.number += 1;
            Resident::new(state.number, scene)
        });
        state.staying.insert(0, resident.clone());
        state.leave(leaving);
        self.latest.send_replace(resident.number);
        let word = Word { _holder: resident.holders.subscribe() };
        Claim { residents: self.clone(), resident, word }
    }

    /// Takes out what is beyond the limits, the least recent ones; the first `spared` stay anyway.
    fn surplus(&self, staying: &mut Vec<Resident>, spared: usize) -> Vec<Resident> {
        let mut bytes = 0;
        let stays = |(index, resident): &(usize, &Resident)| {
            bytes += resident.bytes();
            *index < spared || (*index < RESIDENT_MODELS_MAX && bytes <= self.bytes_max)
        };
        let kept = staying.iter().enumerate().take_while(stays).count();
        staying.split_off(kept)
    }

    /// What was just made may leave no room for others.
    fn trim(&self) {
        let mut state = self.lock();
        let surplus = self.surplus(&mut state.staying, 1);
        state.leave(surplus);
    }

    /// Waits until all that does not stay is out of memory, or for as long as one may.
    async fn wait_for_memory(&self) {
        let leaving = self.lock().leaving.clone();
        let all_gone = async {
            for holders in leaving {
                holders.closed().await;
            }
        };
        if timeout(self.patience, all_gone).await.is_err() {
            let waited = self.patience.as_secs();
            self.log.say(format_args!(
                "the scene of an earlier job is still in memory after {waited} s; the next one is \
                 loaded beside it"
            ));
        }
    }

    /// Comes when another resident than this is asked for.
    async fn supersession(&self, number: u64) {
        let mut latest = self.latest.subscribe();
        // The channel lives as long as this.
        drop(latest.wait_for(|latest| *latest != number).await);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Lets these go. Freeing a large model takes long, so it is not done where messages wait.
    fn leave(&mut self, residents: Vec<Resident>) {
        self.leaving.retain(|holders| !holders.is_closed());
        if !residents.is_empty() {
            self.leaving.extend(residents.iter().map(|resident| Arc::clone(&resident.holders)));
            tokio::task::spawn_blocking(move || drop(residents));
        }
    }
}

impl Resident {
    fn new(number: u64, scene: &SceneRef) -> Self {
        let (model, holders) = (Arc::default(), Arc::default());
        Self { number, scene: scene.clone(), model, holders }
    }

    fn bytes(&self) -> u64 {
        self.model.get().map_or(0, |hold| hold.model.bytes())
    }
}

impl Claim {
    /// The model: that in memory, or what `make` makes. Whoever asks for one that is being made
    /// waits for it. What `make` is given is to be kept by whatever goes on making the model when
    /// its future is dropped, and to become part of the hold.
    ///
    /// # Errors
    /// That of `make`, or that another scene is wanted by now.
    pub(crate) async fn model<E, M>(self, make: impl FnOnce(Word) -> M) -> Result<Hold, E>
    where
        E: From<Superseded>,
        M: Future<Output = Result<Hold, E>>,
    {
        let Self { residents, resident, word } = self;
        let load = async {
            residents.wait_for_memory().await;
            make(word).await
        };
        tokio::select! {
            biased;
            hold = resident.model.get_or_try_init(|| load) => {
                let hold = hold?.clone();
                residents.trim();
                Ok(hold)
            }
            () = residents.supersession(resident.number) => Err(Superseded.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Lines, pack, settle, soon};
    use equilux_common::scene::load::load;
    use futures::poll;
    use std::pin::pin;
    use std::sync::Weak;
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
        lines: Lines,
    }

    fn bench() -> Bench {
        let lines = Lines::default();
        let residents = Residents::within(BYTES_MAX, lines.log());
        Bench { residents, made: AtomicUsize::new(0), lines }
    }

    impl Bench {
        /// The model of a scene, and whether it had to be made.
        async fn get(&self, number: u8, bytes: u64) -> (Hold, bool) {
            let mut is_made = false;
            let make = async |word| {
                is_made = true;
                self.made.fetch_add(1, Ordering::SeqCst);
                tokio::task::yield_now().await;
                Ok::<_, String>(Hold::new(model(bytes), word))
            };
            let hold = self.residents.claim(&scene(number)).model(make).await;
            (hold.unwrap(), is_made)
        }

        async fn makes(&self, number: u8, bytes: u64) -> bool {
            self.get(number, bytes).await.1
        }

        fn kept(&self) -> Vec<u8> {
            let state = self.residents.lock();
            state.staying.iter().map(|resident| resident.scene.hash[0]).collect()
        }

        /// A large scene that nobody but a thread of its job has any more, since another one is
        /// claimed.
        async fn held_beyond_its_job(&self) -> (Hold, Claim) {
            let (hold, _) = self.get(1, BYTES_MAX).await;
            let next = self.residents.claim(&scene(2));
            soon(async {
                while Arc::strong_count(&hold.model) > 1 {
                    tokio::task::yield_now().await;
                }
            })
            .await;
            (hold, next)
        }
    }

    /// Makes a small model once that one is out of memory.
    async fn make_after(gone: &Weak<Model>, word: Word) -> Result<Hold, String> {
        assert_eq!(gone.strong_count(), 0, "two at once");
        Ok(Hold::new(model(0), word))
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
        let (hold, is_made) = bench.get(2, 0).await;
        assert!(!is_made, "the latest stays, whatever its size");
        let large = Arc::downgrade(&hold.model);
        drop(hold);
        let next = bench.residents.claim(&scene(3));
        soon(next.model(|word| make_after(&large, word))).await.unwrap();
        assert_eq!(bench.kept(), [3]);
    }

    #[tokio::test]
    async fn the_next_scene_waits_until_the_last_thread_has_let_go_of_a_large_one() {
        let bench = bench();
        let (hold, next) = bench.held_beyond_its_job().await;
        let large = Arc::downgrade(&hold.model);
        let mut loading = pin!(next.model(|word| make_after(&large, word)));
        settle().await;
        assert!(poll!(&mut loading).is_pending());
        let (second_thread, first_thread) = (hold.clone(), hold);
        drop(first_thread);
        settle().await;
        assert!(poll!(&mut loading).is_pending(), "one has it yet");
        drop(second_thread);
        soon(loading).await.unwrap();
        assert!(bench.residents.lock().leaving.iter().all(|holders| holders.is_closed()));
        assert!(!bench.lines.contain("still in memory"));
    }

    #[tokio::test]
    async fn a_thread_that_does_not_let_go_is_not_waited_for_without_end() {
        let mut bench = bench();
        bench.residents.patience = Duration::from_millis(1);
        let (_hold, next) = bench.held_beyond_its_job().await;
        let make = async |word| Ok::<_, String>(Hold::new(model(0), word));
        soon(next.model(make)).await.unwrap();
        assert!(bench.lines.contain("still in memory"));
    }

    #[tokio::test]
    async fn a_scene_that_is_not_wanted_any_more_is_given_up_and_waited_for() {
        let bench = bench();
        let large = model(BYTES_MAX);
        let (is_building, mut building) = tokio::sync::oneshot::channel();
        let unwanted = bench.residents.claim(&scene(1)).model(async |word| {
            // Goes on though nobody waits for it, as a thread does that builds a tree.
            assert!(is_building.send(word).is_ok());
            std::future::pending().await
        });
        let mut unwanted = pin!(unwanted);
        assert!(poll!(&mut unwanted).is_pending());
        let word = building.try_recv().unwrap();
        let (gone, built) = (Arc::downgrade(&large), Hold::new(large, word));
        let given_up = bench.residents.claim(&scene(2));
        let given_up = given_up.model(async |word| Ok::<_, String>(Hold::new(model(0), word)));
        let mut given_up = pin!(given_up);
        assert_eq!(soon(unwanted).await.map(|_| ()), Err(Superseded.to_string()));
        assert!(poll!(&mut given_up).is_pending());
        // Whoever comes third waits for the first one too.
        let mut wanted =
            pin!(bench.residents.claim(&scene(3)).model(|word| make_after(&gone, word)));
        assert_eq!(soon(given_up).await.map(|_| ()), Err(Superseded.to_string()));
        settle().await;
        assert!(poll!(&mut wanted).is_pending());
        drop(built);
        soon(wanted).await.unwrap();
        assert_eq!(bench.kept(), [3]);
    }

    #[tokio::test]
    async fn a_scene_that_is_being_made_is_waited_for_and_one_that_failed_is_made_again() {
        let bench = bench();
        let fail = async |_| Err("no such file".to_owned());
        let failed = bench.residents.claim(&scene(1)).model(fail).await;
        assert_eq!(failed.map(|_| ()), Err("no such file".to_owned()));
        let (first, second) = tokio::join!(bench.makes(1, 0), bench.makes(1, 0));
        assert_eq!((first, second, bench.made.load(Ordering::SeqCst)), (true, false, 1));
    }
}

//! The command line: what can be asked, and the help that teaches it.

mod bytes;
mod reports;

use std::io::ErrorKind;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

use clap::builder::{PossibleValuesParser, RangedI64ValueParser, TypedValueParser};
use clap::{Parser, Subcommand, ValueEnum};
use equilux_common::balancing::{
    Balance, DiffusionStep, Exchange, GiveFirst, Mapping, UnknownWord, Word,
};
use equilux_common::job::{DEPTH_MAX, SAMPLES_MAX};
use equilux_common::topology::{Graph, Topology};
use equilux_common::unit::Rect;
use equilux_coordinator::serve::{GRPC_ADDRESS, HTTP_ADDRESS};
use equilux_render::geometry::Instructions;
use equilux_store::{PARTITION_BYTES_MIN, PARTITIONS_MAX};

pub(crate) use bytes::Bytes;
pub(crate) use reports::{
    BenchArgs, BenchCommand, Figure2Args, KernelArgs, MeasuredArgs, SimulateArgs, Table1Args,
};

/// Most worker processes of an embedded cluster: more do not make one machine faster.
pub(crate) const WORKERS_MAX: u32 = 256;

/// Most compute threads of a worker: more than any machine has processors.
const THREADS_MAX: u32 = 1024;

/// A distributed path tracer whose image is the same to the bit on any cluster.
#[derive(Debug, Parser)]
#[command(
    name = "equilux",
    version,
    after_help = "Examples:\n  \
        equilux render scenes/office/scene.json --workers 2 -o office.png\n  \
        equilux scene check model.obj\n  \
        equilux simulate scenes/office/scene.json --workers 1,8,64\n  \
        equilux coordinator --scenes scenes\n  \
        equilux worker --coordinator http://127.0.0.1:7878\n  \
        equilux submit scenes/cornell-box/scene.json --watch -o box.exr"
)]
pub(crate) struct Args {
    /// Trace by these instructions (portable, avx2) instead of the best that the machine has; the
    /// image is the same
    #[arg(long, global = true, value_name = "SET", env = "EQUILUX_INSTRUCTIONS")]
    #[arg(hide_short_help = true, hide_env = true, value_parser = Instructions::by_name)]
    pub(crate) instructions: Option<Instructions>,

    #[command(subcommand)]
    pub(crate) command: Command,
}

/// A file of `src/` each.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Render a scene on an embedded cluster: in this process, or as worker processes
    Render(RenderArgs),
    /// Run the service that workers join and jobs are sent to
    Coordinator(CoordinatorArgs),
    /// Lend this machine's processors to a coordinator
    Worker(WorkerArgs),
    /// Send a scene, with every file that it refers to, to a running service, or name one there
    Submit(SubmitArgs),
    /// List the jobs of a running service
    Jobs(ServiceArgs),
    /// Follow a job until it ends
    Watch(WatchArgs),
    /// Get a job's image, finished or not
    Fetch(FetchArgs),
    /// Stop a job; what it has rendered stays
    Cancel(JobArgs),
    /// Look into scenes, or make some
    Scene(SceneArgs),
    /// Predict how fast clusters of any size would render: the paper's table 1 and figure 2
    Simulate(SimulateArgs),
    /// Measure the same for real on this machine, or how fast rays are traced
    Bench(BenchArgs),
}

/// What of a scene's settings the command line replaces.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Settings (in place of the scene file's)")]
pub(crate) struct SettingsArgs {
    /// Camera samples per pixel
    #[arg(long, value_name = "N", value_parser = from_1_to(SAMPLES_MAX))]
    pub(crate) spp: Option<u32>,
    /// Size of the image in pixels
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<Size>,
    /// Most path segments: 1 shows emitters only, 2 adds direct light, and so on
    #[arg(long, value_name = "D", value_parser = from_1_to(DEPTH_MAX))]
    pub(crate) max_depth: Option<u32>,
    /// Name of the random numbers: another seed gives other noise
    #[arg(long, value_name = "S")]
    pub(crate) seed: Option<u64>,
    /// Render only the pixels X0 ≤ x < X1, Y0 ≤ y < Y1
    #[arg(long, value_name = "X0,Y0,X1,Y1")]
    pub(crate) crop: Option<Crop>,
    /// A fast preview: half the size, a quarter of the samples
    #[arg(long)]
    pub(crate) quick: bool,
    /// One of the scene file's `cameras`, by name
    #[arg(long, value_name = "NAME")]
    pub(crate) camera: Option<String>,
    /// How work is spread while the job runs
    #[arg(long, value_name = "NAME", default_value = "diffusion", value_parser = word::<Balance>())]
    pub(crate) balance: Balance,
    #[command(flatten)]
    pub(crate) spread: SpreadArgs,
}

/// How diffusion goes, and along which edges.
#[derive(Debug, Default, Clone, clap::Args)]
pub(crate) struct SpreadArgs {
    /// With --balance diffusion: the form of the step
    #[arg(
        long, value_name = "NAME", default_value = DiffusionStep::default().name(),
        value_parser = word::<DiffusionStep>()
    )]
    pub(crate) diffusion_step: DiffusionStep,
    /// What a worker gives away first: samples nobody has started, or rays near their end
    #[arg(
        long, value_name = "NAME", default_value = GiveFirst::default().name(),
        value_parser = word::<GiveFirst>()
    )]
    pub(crate) give_first: GiveFirst,
    /// With --balance diffusion and partitions at home with several workers: whether who has no
    /// work takes copies of its neighbors' partitions, and who has rays for a busy home copies
    /// of what they need
    #[arg(
        long, value_name = "on|off", default_value = Exchange::default().name(),
        value_parser = word::<Exchange>()
    )]
    pub(crate) exchange: Exchange,
    /// How partitions are given homes with several workers: in runs, or by diffusion
    #[arg(
        long, value_name = "NAME", default_value = Mapping::default().name(),
        value_parser = word::<Mapping>()
    )]
    pub(crate) mapping: Mapping,
    /// Which workers exchange work: complete, ring, torus2d, torus3d, hypercube, or a file with an
    /// edge a line, as two numbers counted from 0
    #[arg(long, value_name = "NAME|FILE", default_value = "hypercube")]
    pub(crate) topology: TopologyArg,
}

/// Arguments of `equilux render`.
#[derive(Debug, Default, clap::Args)]
pub(crate) struct RenderArgs {
    /// Scene file (.json), a directory with a scene.json, a model (.obj, .ply) alone, or a store
    /// (see `equilux scene build`)
    pub(crate) scene: PathBuf,
    /// Where the image goes, .exr (all layers) or .png; may be given several times
    #[arg(short, long = "outfile", value_name = "FILE")]
    pub(crate) outfiles: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) cut: CutArgs,
    /// Worker processes on this machine that talk gRPC; without it, everything runs in this process
    #[arg(long, value_name = "N", value_parser = from_1_to(WORKERS_MAX))]
    pub(crate) workers: Option<u32>,
    /// Compute threads per worker [default: this machine's cores, shared out among the workers]
    #[arg(long, value_name = "T", value_parser = from_1_to(THREADS_MAX))]
    pub(crate) threads: Option<u32>,
    #[command(flatten)]
    pub(crate) settings: SettingsArgs,
    /// Write the run in figures to this file
    #[arg(long, value_name = "FILE.json")]
    pub(crate) stats: Option<PathBuf>,
    /// Write to this file what the paths of the scene cost on this machine, for `equilux simulate`.
    /// Threads that share a core slow each other: use --threads 1. 16 samples per pixel will do
    #[arg(long, value_name = "FILE.json", conflicts_with_all = ["workers", "coordinator", "partitions", "memory"])]
    pub(crate) record_costs: Option<PathBuf>,
    /// Render on the service at this address instead (its REST address)
    #[arg(long, value_name = "URL", conflicts_with_all = ["workers", "threads", "stats", "partitions", "memory"])]
    pub(crate) coordinator: Option<String>,
    /// The service's token
    #[arg(long, env = "EQUILUX_TOKEN", hide_env_values = true, requires = "coordinator")]
    pub(crate) token: Option<String>,
    /// Say nothing but errors and warnings
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// Write the image as far as it is to NAME.partial.* every ten seconds
    #[arg(long)]
    pub(crate) write_partial_images: bool,
}

/// What becomes of geometry that is too large for memory.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct CutArgs {
    /// Cut the geometry into so many partitions, each with its own tree; 1: do not cut it
    #[arg(long, value_name = "K", value_parser = from_1_to(PARTITIONS_MAX))]
    pub(crate) partitions: Option<u32>,
    /// Memory for geometry and for rays that wait for it, such as 1GiB: partitions are read from
    /// disk when rays wait for them, and dropped when others are wanted more
    #[arg(long, value_name = "SIZE")]
    pub(crate) memory: Option<Bytes>,
    /// A directory for what this image alone needs: the partitions of a scene that is cut for it,
    /// which take about as much room as the models, and what worker processes keep (partitions on
    /// this machine are not copied) [default: that for temporary files]
    #[arg(long, value_name = "DIR")]
    pub(crate) spool: Option<PathBuf>,
}

/// Arguments of `equilux coordinator`.
#[derive(Debug, clap::Args)]
pub(crate) struct CoordinatorArgs {
    /// Where workers connect
    #[arg(long, value_name = "ADDR", default_value = GRPC_ADDRESS)]
    pub(crate) grpc: String,
    /// Where jobs are sent: REST, and a page to look at
    #[arg(long, value_name = "ADDR", default_value = HTTP_ADDRESS)]
    pub(crate) http: String,
    /// Where the images of jobs are kept
    #[arg(long, value_name = "DIR", default_value = "equilux-data")]
    pub(crate) data: PathBuf,
    /// Scenes and stores that may be submitted by their path below this directory
    #[arg(long, value_name = "DIR")]
    pub(crate) scenes: Option<PathBuf>,
    /// Whoever changes something over REST must show this token
    #[arg(long, env = "EQUILUX_TOKEN", hide_env_values = true)]
    pub(crate) token: Option<String>,
    /// Listen for REST beyond this machine without a token: everybody who reaches it may use it
    #[arg(long)]
    pub(crate) allow_open: bool,
}

/// Arguments of `equilux worker`.
#[derive(Debug, clap::Args)]
pub(crate) struct WorkerArgs {
    /// The coordinator's gRPC address
    #[arg(long, value_name = "URL")]
    pub(crate) coordinator: String,
    /// Compute threads [default: one per core]
    #[arg(long, value_name = "T", value_parser = from_1_to(THREADS_MAX))]
    pub(crate) threads: Option<u32>,
    /// Memory for geometry and for rays that wait for it, such as 1GiB, where a scene is cut into
    /// partitions [default: as much as is needed]
    #[arg(long, value_name = "SIZE")]
    pub(crate) memory: Option<Bytes>,
    /// Where scenes and partitions are kept between jobs; several workers may share it
    /// [default: the user's cache directory]
    #[arg(long, value_name = "DIR")]
    pub(crate) cache: Option<PathBuf>,
    /// Most that is kept there, such as 100GiB: what has not been used for the longest time goes
    #[arg(long, value_name = "SIZE", default_value = "16GiB")]
    pub(crate) cache_size: Bytes,
    /// Where other workers connect [default: the address that reaches the coordinator, any port]
    #[arg(long, value_name = "ADDR")]
    pub(crate) listen: Option<SocketAddr>,
    /// What other workers are told to connect to, HOST:PORT [default: where it listens]
    #[arg(long, value_name = "ADDR")]
    pub(crate) advertise: Option<String>,
    /// Say nothing but errors and warnings
    #[arg(short, long)]
    pub(crate) quiet: bool,
    /// End when standard input ends: so no worker outlives the process that started it
    #[arg(long, hide = true)]
    pub(crate) until_stdin_closes: bool,
}

/// How to reach a running service.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct ServiceArgs {
    /// The service's REST address
    #[arg(
        long,
        value_name = "URL",
        env = "EQUILUX_COORDINATOR",
        default_value_t = format!("http://{HTTP_ADDRESS}")
    )]
    pub(crate) coordinator: String,
    /// The service's token
    #[arg(long, env = "EQUILUX_TOKEN", hide_env_values = true)]
    pub(crate) token: Option<String>,
}

/// Arguments of `equilux submit`.
#[derive(Debug, clap::Args)]
pub(crate) struct SubmitArgs {
    /// Scene file (.json), a directory with a scene.json, or a model (.obj, .ply) alone; with
    /// --served, also a store
    pub(crate) scene: PathBuf,
    /// Upload nothing: SCENE is a path below the directory that the service was given by --scenes
    #[arg(long, conflicts_with = "quick")]
    pub(crate) served: bool,
    #[command(flatten)]
    pub(crate) settings: SettingsArgs,
    #[command(flatten)]
    pub(crate) service: ServiceArgs,
    /// Follow the job until it ends
    #[arg(long)]
    pub(crate) watch: bool,
    /// With --watch: where the image goes, .exr or .png; may be given several times
    #[arg(short, long = "outfile", value_name = "FILE", requires = "watch")]
    pub(crate) outfiles: Vec<PathBuf>,
}

/// A job of a running service.
#[derive(Debug, clap::Args)]
pub(crate) struct JobArgs {
    /// The job's number
    pub(crate) id: u64,
    #[command(flatten)]
    pub(crate) service: ServiceArgs,
}

/// Arguments of `equilux watch`.
#[derive(Debug, clap::Args)]
pub(crate) struct WatchArgs {
    #[command(flatten)]
    pub(crate) job: JobArgs,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// Arguments of `equilux fetch`.
#[derive(Debug, clap::Args)]
pub(crate) struct FetchArgs {
    #[command(flatten)]
    pub(crate) job: JobArgs,
    /// Where the image goes, .exr (all layers) or .png; may be given several times
    #[arg(short, long = "outfile", value_name = "FILE", required = true)]
    pub(crate) outfiles: Vec<PathBuf>,
}

/// Arguments of `equilux scene`.
#[derive(Debug, clap::Args)]
pub(crate) struct SceneArgs {
    #[command(subcommand)]
    pub(crate) command: SceneCommand,
}

/// What can be done with scenes.
#[derive(Debug, Subcommand)]
pub(crate) enum SceneCommand {
    /// Validate a scene and describe it
    Check {
        /// Scene file (.json), a directory with a scene.json, a model (.obj, .ply) alone, or a
        /// store
        scene: PathBuf,
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Cut a scene into partitions on disk, in bounded memory: a store, which is a scene as well
    Build(SceneBuildArgs),
    /// Make one of the shipped scenes, or a larger one
    Generate(GenerateArgs),
}

/// Arguments of `equilux scene generate`.
#[derive(Debug, clap::Args)]
pub(crate) struct GenerateArgs {
    /// Which scene
    pub(crate) name: GeneratedScene,
    /// How many times as large as the shipped one [default: 1]
    #[arg(long, value_name = "N")]
    pub(crate) size: Option<u32>,
    /// Of a city, in place of --size: how many triangles it has at most [default: 1000000]
    #[arg(long, value_name = "N", conflicts_with = "size")]
    pub(crate) triangles: Option<u64>,
    /// Where it goes [default: a directory of the scene's name]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) outdir: Option<PathBuf>,
    /// Say nothing but errors
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// Arguments of `equilux scene build`.
#[derive(Debug, clap::Args)]
pub(crate) struct SceneBuildArgs {
    /// Scene file (.json), a directory with a scene.json, or a model (.obj, .ply) alone
    pub(crate) scene: PathBuf,
    /// The directory that becomes the store, in place of one that is there [default: NAME.store]
    #[arg(short, long, value_name = "STORE")]
    pub(crate) outdir: Option<PathBuf>,
    /// Most memory that a partition takes [default: 64MiB]
    #[arg(long, value_name = "SIZE", value_parser = partition_size)]
    pub(crate) partition_size: Option<Bytes>,
    /// Cut into about so many partitions of equal size instead
    #[arg(
        long, value_name = "K", value_parser = from_1_to(PARTITIONS_MAX),
        conflicts_with = "partition_size"
    )]
    pub(crate) partitions: Option<u32>,
    /// Where to put intermediate files, about as large as the store [default: beside the store]
    #[arg(long, value_name = "DIR")]
    pub(crate) spool: Option<PathBuf>,
    /// Say nothing but errors and the result
    #[arg(short, long)]
    pub(crate) quiet: bool,
}

/// The scenes that can be made.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum GeneratedScene {
    /// The paper's office: 3,256 objects and 3 light sources
    Office,
    /// The paper's bathroom: 18,012 objects and 4 light sources
    Bathroom,
    /// Cornell's box, as measured
    CornellBox,
    /// A downtown late on a sunny day, of any number of triangles
    City,
}

/// A topology by its word, or by a file of edges.
#[derive(Clone, Debug, Default)]
pub(crate) struct TopologyArg(pub(crate) Topology);

impl FromStr for TopologyArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let unknown = match text.parse() {
            Ok(topology) => return Ok(Self(topology)),
            Err(unknown) => unknown,
        };
        match std::fs::read_to_string(text) {
            Ok(edges) => match Graph::parse(&edges) {
                Ok(graph) => Ok(Self(Topology::Graph(Arc::new(graph)))),
                Err(error) => Err(format!("{text}: {error}")),
            },
            Err(error) if error.kind() == ErrorKind::NotFound => {
                Err(format!("{unknown}, or a file of edges"))
            }
            Err(error) => Err(format!("cannot read {text}: {error}")),
        }
    }
}

/// Width and height as `640x480`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parsed = text.split_once(['x', 'X']).and_then(|(width, height)| {
            Some(Self { width: width.trim().parse().ok()?, height: height.trim().parse().ok()? })
        });
        parsed.ok_or_else(|| "expected WIDTHxHEIGHT in pixels, such as 640x480".into())
    }
}

/// A rectangle of pixels as `X0,Y0,X1,Y1`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crop(pub(crate) Rect);

impl FromStr for Crop {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers: Option<Vec<u32>> =
            text.split(',').map(|number| number.trim().parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 => Ok(Self(Rect { x0, y0, x1, y1 })),
            _ => Err("expected X0,Y0,X1,Y1 in pixels with X0 < X1 and Y0 < Y1".into()),
        }
    }
}

fn partition_size(text: &str) -> Result<Bytes, String> {
    let size: Bytes = text.parse()?;
    let is_enough = size.0 >= PARTITION_BYTES_MIN;
    is_enough.then_some(size).ok_or_else(|| format!("at least {}KiB", PARTITION_BYTES_MIN >> 10))
}

/// A count within its limit, which the message names.
fn from_1_to(most: u32) -> RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(1..=i64::from(most))
}

/// One of the words for the values of a setting.
fn word<T>() -> impl TypedValueParser<Value = T>
where
    T: Word + FromStr<Err = UnknownWord> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(T::words()).try_map(|word| word.parse())
}

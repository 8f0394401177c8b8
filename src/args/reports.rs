//! The command line of `equilux simulate` and `equilux bench`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use equilux_common::balancing::{Balance, Word};
use equilux_common::job::SAMPLES_MAX;
use equilux_simulator::case::Case;
use equilux_simulator::network::NetworkModel;

use super::bytes::Room;
use super::{SpreadArgs, THREADS_MAX, WORKERS_MAX, from_1_to};

/// Most simulated workers.
const SIMULATED_WORKERS_MAX: u32 = 1 << 16;

/// Largest size: an image's sides are at most as many times as long as its square root.
const SIZE_MAX: u32 = 10_000;

/// Most work of one worker in seconds: a month.
const WORK_SECONDS_MAX: f64 = 30.0 * 86400.0;

/// Most rounds of a measurement: more than anybody waits for.
const ROUNDS_MAX: u32 = 10_000;

/// Most camera rays of a measurement: with all that follow from them they take 1.5 GB.
const RAYS_MAX: u32 = 1 << 22;

/// Arguments of `equilux simulate`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    equilux simulate scenes/office/scene.json --workers 1,8,64\n  \
    equilux simulate scenes/office/scene.json scenes/bathroom/scene.json \\\n    \
        --workers 1,8,16,32,64,256,1024,4096 --sizes 1,9 -o simulation\n  \
    equilux render scenes/office/scene.json --threads 1 --spp 16 --record-costs office.json\n  \
    equilux simulate --costs office.json --workers 64,1024 --work 60 --network cluster\n  \
    equilux simulate --costs office.json --workers 64 --work 60 \\\n    \
        --case straggler,latecomers,point\n  \
    equilux render city.store --threads 1 --spp 4 --record-costs city.json\n  \
    equilux simulate --costs city.json --workers 64 --memory 1/16 --work 60 --details\n\n\
    Prints the table of Heirich & Arvo 1996 and draws pictures of it. T₁ and Δ₁ are the elapsed\n\
    time and the largest difference of finishing times without balancing, T₂ and Δ₂ with it;\n\
    S = T(1) / T₂, E = S / P, T_P = T₂ − T(1) / P, and % = T_P / T₂. Where workers are slow, come late\n\
    (--case) or have several threads, P stands for the sum of the speeds of all threads that are\n\
    there, averaged over the run, so that E is the part of what they could have computed. Where no costs are given, the\n\
    scene is rendered first, on one thread, to record what its paths cost.")]
pub(crate) struct SimulateArgs {
    /// Scene files (.json), models (.obj, .ply) alone, or stores
    #[arg(value_name = "SCENE", required_unless_present = "costs")]
    pub(crate) scenes: Vec<PathBuf>,
    /// How many workers, one number after another; a single one is always added to compare with
    #[arg(long, value_name = "P,P,...", default_value = "1,8,16,32,64,256,1024,4096")]
    pub(crate) workers: Counts<SIMULATED_WORKERS_MAX>,
    /// How many times as many pixels as the scene says: 9 is three times as wide and high
    #[arg(long, value_name = "N,N,...", default_value = "1", conflicts_with = "work")]
    pub(crate) sizes: Counts<SIZE_MAX>,
    /// So much work of one worker, instead of a size
    #[arg(long, value_name = "SECONDS", value_parser = work_seconds)]
    pub(crate) work: Option<f64>,
    /// Camera samples per pixel [default: the scene's]
    #[arg(long, value_name = "N", value_parser = from_1_to(SAMPLES_MAX), conflicts_with = "work")]
    pub(crate) spp: Option<u32>,
    /// What connects the workers: cluster (10 µs, 100 Gbit/s), ethernet (200 µs, 1 Gbit/s), 1996
    /// (the paper's workstations: 1 ms, 10 Mbit/s for all together)
    #[arg(long, value_name = "NAME", default_value = "ethernet", value_parser = network())]
    pub(crate) network: SimulatedNetwork,
    /// What a scene's paths cost, as `equilux render --record-costs` wrote it; may be given several
    /// times. For the scene of that name, or for itself if no scene is given
    #[arg(long, value_name = "FILE")]
    pub(crate) costs: Vec<PathBuf>,
    /// How work is spread, to compare with none at all
    #[arg(long, value_name = "NAME", default_value = "diffusion", value_parser = moving())]
    pub(crate) balance: Balance,
    #[command(flatten)]
    pub(crate) spread: SpreadArgs,
    /// What is the matter with the cluster; some one after another, separated by commas. Workers
    /// are not told, and claim to be equal. All but `even` are hard for whoever spreads work, and
    /// their pictures go to a directory of that name in --outdir
    #[arg(
        long = "case", value_name = "NAME,NAME,...", default_value = Case::Even.name(),
        value_delimiter = ',', value_parser = case()
    )]
    pub(crate) cases: Vec<Case>,
    /// Compute threads of each worker
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = from_1_to(THREADS_MAX))]
    pub(crate) threads: u32,
    /// Memory that each worker may use of a model that is a store: bytes (40MiB), or a part of what
    /// the model takes (1/16); a single worker to compare with has all of it in memory
    #[arg(long, value_name = "SIZE")]
    pub(crate) memory: Option<Room>,
    /// Names everything that is random: the same one always comes to the same
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Also tell of messages, bytes and wakes
    #[arg(long)]
    pub(crate) details: bool,
    /// Print JSON: the rows; with --details, an object of `rows` and `details`
    #[arg(long)]
    pub(crate) json: bool,
    /// Where the pictures go; made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = "simulation")]
    pub(crate) outdir: PathBuf,
}

impl SimulateArgs {
    /// The cases, each once and in their order.
    pub(crate) fn cases(&self) -> Vec<Case> {
        let mut cases = self.cases.clone();
        cases.sort_unstable();
        cases.dedup();
        cases
    }
}

/// Arguments of `equilux bench`.
#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    #[command(subcommand)]
    pub(crate) command: BenchCommand,
}

/// What can be measured.
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// The paper's table 1: elapsed times without and with balancing, and what follows from them
    Table1(Table1Args),
    /// The paper's figure 2: when each worker finishes, without and with balancing
    Figure2(Figure2Args),
    /// How many rays a second one thread traces, kind by kind, and what the crate `obvhs` would
    Kernel(KernelArgs),
}

/// Arguments of `equilux bench table1`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    equilux bench table1\n  \
    equilux bench table1 --sizes 1 --spp 4\n  \
    equilux bench table1 scenes/office/scene.json --workers 1,2 --json\n\n\
    Workers are processes of one thread each that talk gRPC over loopback. Times count from the\n\
    submission of a job whose scene every worker has at hand. Below the table stand how well\n\
    `equilux simulate` would have predicted the times of 1 and 2 workers; the processor time of\n\
    each run, what part of it the workers spent on messages and balancing (all their threads that\n\
    do not trace) and what part the coordinator; and how often a worker's threads are woken while\n\
    there is no job.")]
pub(crate) struct Table1Args {
    #[command(flatten)]
    pub(crate) measured: MeasuredArgs,
    /// How many times as many pixels as the scene says: 9 is three times as wide and high
    #[arg(long, value_name = "N,N,...", default_value = "1,9")]
    pub(crate) sizes: Counts<SIZE_MAX>,
    /// Print the rows as JSON, and everything else to standard error
    #[arg(long)]
    pub(crate) json: bool,
    /// With --json: print an object of `rows`, `calibration`, `overhead` and `idle_wakes`
    #[arg(long, requires = "json")]
    pub(crate) details: bool,
    /// Where pictures go, if any are wanted; made if it is not there
    #[arg(short, long, value_name = "DIR")]
    pub(crate) outdir: Option<PathBuf>,
}

/// Arguments of `equilux bench figure2`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    equilux bench figure2\n  \
    equilux bench figure2 scenes/office/scene.json --workers 2 --spp 4 -o pictures\n\n\
    Draws the finishing times of the largest number of workers.")]
pub(crate) struct Figure2Args {
    #[command(flatten)]
    pub(crate) measured: MeasuredArgs,
    /// Where the picture goes; made if it is not there
    #[arg(short, long, value_name = "DIR", default_value = "bench")]
    pub(crate) outdir: PathBuf,
}

/// Arguments of `equilux bench kernel`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    equilux bench kernel scenes/office/scene.json\n  \
    equilux bench kernel model.obj --rounds 3 --json\n  \
    RAYON_NUM_THREADS=1 equilux bench kernel scenes/office   # the tree is built on one thread\n\n\
    Kinds of rays: primary ones come from the camera; diffuse1 and diffuse2 leave the first and the\n\
    second hits, cosine-distributed; shadow1 and shadow2 go from the first and the second hits to\n\
    random points of the area lights (or of the top of the model), and it is only asked whether\n\
    anything is in their way. All kernels trace the same rays, in turn, round after round, and\n\
    of each 1,024 rays the best round counts. `single` is the renderer's own kernel, one ray after another; obvhs-bvh2 and obvhs-cwbvh\n\
    are the traversals of the crate that also builds our trees: yardsticks, whose hits may differ\n\
    in a few places, for they are not watertight. docs/kernel.md tells more.")]
pub(crate) struct KernelArgs {
    /// Scene file (.json), a directory with a scene.json, or a model (.obj, .ply) alone
    pub(crate) scene: PathBuf,
    /// How often each kernel traces all rays [default: as often as 18 seconds have room for, at
    /// least 3 times]
    #[arg(long, value_name = "N", value_parser = from_1_to(ROUNDS_MAX))]
    pub(crate) rounds: Option<u32>,
    /// About how many camera rays; there are at most as many of each other kind
    #[arg(long, value_name = "N", default_value_t = 1 << 19, value_parser = from_1_to(RAYS_MAX))]
    pub(crate) rays: u32,
    /// Print JSON, speeds in millions of rays per second
    #[arg(long)]
    pub(crate) json: bool,
}

/// What is measured.
#[derive(Debug, Args)]
pub(crate) struct MeasuredArgs {
    /// Scene files (.json), or models (.obj, .ply) alone [default: the office and the bathroom]
    #[arg(value_name = "SCENE")]
    pub(crate) scenes: Vec<PathBuf>,
    /// How many workers, one number after another [default: 1, 2, 4 and so on up to this machine's
    /// cores]
    #[arg(long, value_name = "P,P,...")]
    pub(crate) workers: Option<Counts<WORKERS_MAX>>,
    /// Camera samples per pixel; as they are, one worker takes half a minute for size 1
    #[arg(long, value_name = "N", default_value_t = 14, value_parser = from_1_to(SAMPLES_MAX))]
    pub(crate) spp: u32,
    #[command(flatten)]
    pub(crate) spread: SpreadArgs,
}

/// Numbers from 1 to `MOST`, ascending, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Counts<const MOST: u32>(pub(crate) Vec<u32>);

impl<const MOST: u32> Counts<MOST> {
    /// The same with a 1, which everything is compared with.
    pub(crate) fn with_one(&self) -> Vec<u32> {
        let others = self.0.iter().copied().filter(|&count| count != 1);
        std::iter::once(1).chain(others).collect()
    }
}

impl<const MOST: u32> FromStr for Counts<MOST> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let count = |word: &str| match word.trim().parse() {
            Ok(count) if (1..=MOST).contains(&count) => Ok(count),
            _ => {
                Err(format!("`{word}` is not a number from 1 to {MOST}; write some, as in 1,8,64"))
            }
        };
        let mut counts = text.split(',').map(count).collect::<Result<Vec<u32>, _>>()?;
        counts.sort_unstable();
        counts.dedup();
        Ok(Self(counts))
    }
}

/// A network preset with its name.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SimulatedNetwork {
    /// As the command line has it.
    pub(crate) name: &'static str,
    /// How messages travel.
    pub(crate) model: NetworkModel,
}

/// The words for networks, and how pictures name them.
const NETWORKS: [(&str, &str); 3] =
    [("cluster", "cluster network"), ("ethernet", "Ethernet"), ("1996", "network of 1996")];

fn network() -> impl TypedValueParser<Value = SimulatedNetwork> {
    let words = NETWORKS.iter().map(|&(word, _)| word);
    PossibleValuesParser::new(words).try_map(|word| {
        let model = word.parse()?;
        let named = NETWORKS.iter().find(|(other, _)| *other == word);
        Ok::<_, <NetworkModel as FromStr>::Err>(SimulatedNetwork {
            name: named.map_or("network", |&(_, name)| name),
            model,
        })
    })
}

/// Ways of spreading work that move some.
fn moving() -> impl TypedValueParser<Value = Balance> {
    PossibleValuesParser::new(["diffusion", "stealing"]).try_map(|word| word.parse::<Balance>())
}

fn case() -> impl TypedValueParser<Value = Case> {
    let values = Case::ALL.iter().map(|case| PossibleValue::new(case.name()).help(meaning(*case)));
    PossibleValuesParser::new(values).map(|word| {
        let named = Case::ALL.iter().copied().find(|case| case.name() == word);
        named.expect("one of the possible values")
    })
}

const fn meaning(case: Case) -> &'static str {
    match case {
        Case::Even => "nothing: all workers are equal and there from the start",
        Case::Straggler => "one worker is ten times slower than the others",
        Case::Latecomers => "half of the workers come when half of the elapsed time is over",
        Case::Point => {
            "one worker is issued everything, since the others come right after the submission"
        }
    }
}

fn work_seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if seconds > 0.0 && seconds <= WORK_SECONDS_MAX => Ok(seconds),
        _ => Err(format!("expected seconds, more than 0 and at most {WORK_SECONDS_MAX}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_sorted_and_told_once() {
        let counts: Counts<4096> = "64, 8,8,16".parse().unwrap();
        assert_eq!(counts.0, [8, 16, 64]);
        assert_eq!(counts.with_one(), [1, 8, 16, 64]);
        assert_eq!(Counts::<8>(vec![1, 2]).with_one(), [1, 2]);
        for bad in ["", "0", "1,,2", "4097", "-1", "x"] {
            assert!(bad.parse::<Counts<4096>>().is_err(), "{bad}");
        }
    }

    #[test]
    fn work_is_a_positive_time() {
        assert_eq!(work_seconds("0.5"), Ok(0.5));
        for bad in ["0", "-1", "nan", "inf", "1e9", "a"] {
            assert!(work_seconds(bad).is_err(), "{bad}");
        }
    }
}

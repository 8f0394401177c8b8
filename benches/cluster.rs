//! The cluster against one worker, and what it costs besides tracing: ratios within one run.
//!
//! `cargo bench --bench cluster [-- SPP [ROUNDS]]` renders the office with 1 worker of 1 thread and
//! with 2 workers of 1 thread in turn, ROUNDS times each, and prints the median of each ratio. SPP
//! should make one worker busy for 30 s or more.

#![expect(clippy::print_stdout, reason = "a benchmark's figures are its output")]

use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

/// Samples per pixel that keep one thread busy for more than half a minute.
const SPP: &str = "14";

/// How often each side is measured.
const ROUNDS: usize = 3;

/// One run in figures.
struct Run {
    render_s: f64,
    startup_s: f64,
    busy_s: f64,
    processor_s: f64,
    spread: f64,
}

fn main() {
    let mut args = std::env::args().skip(1).filter(|arg| !arg.starts_with("--"));
    let spp = args.next().unwrap_or_else(|| SPP.into());
    let rounds = args.next().and_then(|rounds| rounds.parse().ok()).unwrap_or(ROUNDS);
    let mut pairs = Vec::new();
    for round in 1..=rounds {
        let one = run("office", 1, &spp);
        let two = run("office", 2, &spp);
        eprintln!("round {round}: 1 worker {:.2} s, 2 workers {:.2} s", one.render_s, two.render_s);
        pairs.push((one, two));
    }
    let starts = (0..rounds.max(3)).map(|_| run("cornell-box", 0, "1").startup_s).collect();
    let ratio = |of: fn(&(Run, Run)) -> f64| median(pairs.iter().map(of).collect());
    println!("office, {spp} samples per pixel, median of {rounds} interleaved runs");
    println!("elapsed, 1 worker of 1 thread            {:.2} s", ratio(|(one, _)| one.render_s));
    println!(
        "speed-up of 2 workers of 1 thread        {:.3}",
        ratio(|(a, b)| a.render_s / b.render_s)
    );
    println!("spread of finishing times, 2 workers     {:.4}", ratio(|(_, two)| two.spread));
    println!("processor time besides tracing, 1 worker {:.4}", ratio(|(one, _)| one.besides()));
    println!("processor time besides tracing, 2 workers {:.4}", ratio(|(_, two)| two.besides()));
    println!("start to first ray, Cornell box          {:.3} s", median(starts));
}

impl Run {
    /// Share of the processor time of all processes that was not spent tracing and shading.
    fn besides(&self) -> f64 {
        1.0 - self.busy_s / self.processor_s
    }
}

/// Renders a shipped scene with `workers` processes of one thread, or in one process if 0.
fn run(scene: &str, workers: u32, spp: &str) -> Run {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let directory = tempfile::tempdir().expect("a temporary directory");
    let stats = directory.path().join("stats.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_equilux"));
    command.arg("render").arg(root.join("scenes").join(scene).join("scene.json"));
    if workers > 0 {
        command.args(["--workers", &workers.to_string(), "--threads", "1"]);
    }
    command.args(["--quiet", "--spp", spp, "-o"]).arg(directory.path().join("image.exr"));
    command.arg("--stats").arg(&stats).stdout(Stdio::null());
    let before = processor_seconds_of_children();
    assert!(command.status().expect("the program starts").success());
    let processor_s = processor_seconds_of_children() - before;
    let stats = std::fs::read(stats).expect("the stats file");
    Run::new(&serde_json::from_slice(&stats).expect("JSON"), processor_s)
}

impl Run {
    fn new(stats: &Value, processor_s: f64) -> Self {
        let number = |value: &Value| value.as_f64().expect("a number");
        let workers = stats["workers"].as_array().expect("a list");
        let finishes: Vec<f64> = workers.iter().map(|w| number(&w["finish_s"])).collect();
        let last = finishes.iter().copied().fold(0.0, f64::max);
        let first = finishes.iter().copied().fold(f64::INFINITY, f64::min);
        let (elapsed_s, startup_s) = (number(&stats["elapsed_s"]), number(&stats["startup_s"]));
        Self {
            render_s: elapsed_s - startup_s,
            startup_s,
            busy_s: workers.iter().map(|w| number(&w["busy_s"])).sum(),
            processor_s,
            spread: (last - first) / (elapsed_s - startup_s),
        }
    }
}

/// Processor time of all children that have ended, and of theirs.
#[cfg(target_os = "linux")]
fn processor_seconds_of_children() -> f64 {
    let own = procfs::process::Process::myself().and_then(|own| own.stat()).expect("a /proc");
    (own.cutime + own.cstime) as f64 / procfs::ticks_per_second() as f64
}

/// Not a number: only Linux tells.
#[cfg(not(target_os = "linux"))]
const fn processor_seconds_of_children() -> f64 {
    f64::NAN
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

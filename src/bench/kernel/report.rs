//! What was measured, as text and as JSON.

use std::fmt::Write;

use serde::Serialize;

use super::agreement::Difference;
use super::kind::{ByKind, Kind};
use super::yardstick::CWBVH;
use crate::table::{aligned, time};

/// A kernel and its speeds.
#[derive(Clone, Debug, Serialize)]
pub(super) struct KernelRow {
    pub(super) name: &'static str,
    /// Millions of rays per second; none where there are no rays.
    #[serde(flatten)]
    pub(super) mrays: ByKind<Option<f64>>,
}

/// A tree of another crate.
#[derive(Clone, Debug, Serialize)]
pub(super) struct YardstickBuild {
    pub(super) name: &'static str,
    pub(super) build_s: f64,
}

/// All that was measured, by the keys of the JSON.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Report {
    pub(super) scene: String,
    /// Those of prototypes counted at each place.
    pub(super) triangles: u64,
    /// Seconds from the scene in memory to the renderer's model, with all threads.
    pub(super) build_s: f64,
    /// Nodes and triangles, over the triangles that are kept: those of prototypes once.
    pub(super) bytes_per_triangle: f64,
    pub(super) kernels: Vec<KernelRow>,
    /// How often each kernel traced all rays; the best time of each 1,024 of them counts.
    pub(super) rounds: u32,
    pub(super) rays: ByKind<usize>,
    /// How many of them hit something.
    pub(super) hits: ByKind<usize>,
    pub(super) yardsticks: Vec<YardstickBuild>,
    pub(super) differences: Vec<Difference>,
    /// Whether shadow rays go to lights, not to the top of the model.
    pub(super) has_lights: bool,
}

impl Report {
    /// As people read it.
    pub(super) fn text(&self) -> String {
        let Self { scene, triangles, build_s, bytes_per_triangle, rounds, .. } = self;
        let build_time = time(*build_s);
        let mut text = format!(
            "{scene}: {triangles} triangles, built in {build_time} s, \
             {bytes_per_triangle:.1} bytes a triangle"
        );
        for YardstickBuild { name, build_s } in &self.yardsticks {
            write!(text, "; {name} in {} s", time(*build_s)).expect("text takes all");
        }
        let rows = self.kernels.iter().map(|row| cells(row.name, &row.mrays, "", number));
        let counts = |name, counts: &ByKind<usize>| {
            cells(name, &counts.map(|&count| Some(count as f64)), "", |count| format!("{count}"))
        };
        let rows: Vec<_> =
            rows.chain([counts("rays", &self.rays), counts("hits", &self.hits)]).collect();
        let table = table("kernel", &rows);
        let plural = if *rounds == 1 { "" } else { "s" };
        write!(text, "\n\nMrays/s on one thread, best of {rounds} round{plural}:\n{table}")
            .expect("text takes all");
        if !self.has_lights {
            text += "\nThere are no area lights: shadow rays go to the top of the model.\n";
        }
        text + &self.ratios() + &self.difference_lines()
    }

    /// Speeds over those of the yardstick, if it was measured.
    fn ratios(&self) -> String {
        let Some(yardstick) = self.kernels.iter().find(|row| row.name == CWBVH) else {
            return String::new();
        };
        let ratio = |at: usize, row: &KernelRow| Some(row.mrays.0[at]? / yardstick.mrays.0[at]?);
        let rows: Vec<_> = self
            .kernels
            .iter()
            .filter(|row| row.name != CWBVH)
            .map(|row| {
                cells(row.name, &ByKind(std::array::from_fn(|at| ratio(at, row))), "×", number)
            })
            .collect();
        format!("\n{}", table(&format!("over {CWBVH}"), &rows))
    }

    fn difference_lines(&self) -> String {
        let line = |Difference { kernel, kind, missed, extra }: &Difference| {
            format!("of {kind} rays, {kernel} misses {missed} hits and has {extra} that are none\n")
        };
        let lines: String = self.differences.iter().map(line).collect();
        if lines.is_empty() { lines } else { format!("\n{lines}") }
    }
}

fn table(first: &str, rows: &[[String; 6]]) -> String {
    let [a, b, c, d, e] = Kind::ALL.map(Kind::name);
    aligned(&[first, a, b, c, d, e], rows, 0)
}

fn cells(
    name: &str,
    values: &ByKind<Option<f64>>,
    unit: &str,
    text: impl Fn(f64) -> String,
) -> [String; 6] {
    let cell = |value: Option<f64>| value.map_or_else(|| "·".into(), |it| text(it) + unit);
    let [a, b, c, d, e] = values.0.map(cell);
    [name.into(), a, b, c, d, e]
}

fn number(value: f64) -> String {
    format!("{value:.2}")
}

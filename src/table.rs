//! The paper's table 1: how fast a job was with more and more workers, without and with balancing.
//!
//! The columns are those of Heirich & Arvo 1996, table 1; times in seconds, and as people read them
//! in the text. One worker has nobody to exchange work with, so both of its times are the same one.
//! Where workers are unequal or come late, P stands for what they amount to: the sum of the speeds
//! of those that are there, averaged over the run.

use serde::Serialize;

use crate::comparison::Comparison;
use crate::subject::Subject;

/// A dot where one worker has nothing to tell, as in the paper.
const NOTHING: &str = "·";

/// A row, in seconds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Workers.
    pub(crate) p: u32,
    /// What was rendered: `model`, `size`, and what else tells rows apart.
    #[serde(flatten)]
    pub(crate) subject: Subject,
    /// T₁: elapsed time without balancing.
    pub(crate) t1_s: f64,
    /// Δ₁: largest difference of finishing times without balancing.
    pub(crate) delta1_s: f64,
    /// T₂: elapsed time with balancing.
    pub(crate) t2_s: f64,
    /// Δ₂: largest difference of finishing times with balancing.
    pub(crate) delta2_s: f64,
    /// S = T(1) / T₂, where T(1) is the time of one worker.
    pub(crate) s: f64,
    /// E = S / P: the part of what the workers could have computed that was needed.
    pub(crate) e: f64,
    /// T_P = T₂ − T(1) / P: time lost to being parallel.
    pub(crate) tp_s: f64,
    /// T_P / T₂, a fraction in spite of its name, which is the paper's.
    pub(crate) percent: f64,
}

impl Row {
    /// The row of two runs with as many workers.
    pub(crate) fn new(compared: &Comparison) -> Self {
        let Comparison { subject, workers, alone, without, with } = compared;
        let t2_s = with.elapsed.as_secs_f64();
        let tp_s = t2_s - compared.ideal().as_secs_f64();
        Self {
            p: *workers,
            subject: subject.clone(),
            t1_s: without.elapsed.as_secs_f64(),
            delta1_s: without.spread().as_secs_f64(),
            t2_s,
            delta2_s: with.spread().as_secs_f64(),
            s: alone.as_secs_f64() / t2_s,
            e: compared.efficiency(with),
            tp_s,
            percent: tp_s / t2_s,
        }
    }

    fn cells(&self) -> [String; 11] {
        let many = |text: String| if self.p == 1 { NOTHING.into() } else { text };
        [
            self.p.to_string(),
            self.subject.model_cell(),
            self.subject.extent.cell(),
            time(self.t1_s),
            many(time(self.delta1_s)),
            many(time(self.t2_s)),
            many(time(self.delta2_s)),
            format!("{:.1}", self.s),
            format!("{:.3}", self.e),
            many(time(self.tp_s)),
            many(format!("{:.3}", self.percent)),
        ]
    }
}

/// The whole table as text.
pub(crate) fn text(rows: &[Row]) -> String {
    let extent = rows.first().map_or("Size", |row| row.subject.extent.column());
    let names = ["P", "Model", extent, "T₁", "Δ₁", "T₂", "Δ₂", "S", "E", "T_P", "%"];
    aligned(&names, &rows.iter().map(Row::cells).collect::<Vec<_>>(), 1)
}

/// A table with its columns as wide as they must be, ragged on the right in column `left`.
pub(crate) fn aligned<const N: usize>(
    names: &[&str; N],
    rows: &[[String; N]],
    left: usize,
) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.chain([names[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: [usize; N] = std::array::from_fn(width);
    let line = |cells: [&str; N]| {
        let padded = cells.iter().zip(widths).enumerate().map(|(column, (cell, width))| {
            if column == left { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
    };
    let body = rows.iter().map(|row| line(std::array::from_fn(|column| row[column].as_str())));
    std::iter::once(line(*names)).chain(body).collect()
}

/// Seconds as people read them: 1:05:43, 9:00, 12.3, 1.23, 0.123.
pub(crate) fn time(seconds: f64) -> String {
    let sign = if seconds < 0.0 { "-" } else { "" };
    let seconds = seconds.abs();
    // Just below a limit, rounding reaches it: 59.97 is 1:00, and 9.996 is 10.0.
    if seconds < 9.995 {
        let digits = if seconds < 0.9995 { 3 } else { 2 };
        return format!("{sign}{seconds:.digits$}");
    }
    if seconds < 59.95 {
        return format!("{sign}{seconds:.1}");
    }
    let whole = seconds.round() as u64;
    let (hours, minutes, seconds) = (whole / 3600, whole / 60 % 60, whole % 60);
    if hours > 0 {
        format!("{sign}{hours}:{minutes:02}:{seconds:02}")
    } else {
        format!("{sign}{minutes}:{seconds:02}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::Outcome;
    use crate::subject::Extent;
    use equilux_simulator::case::Case;
    use std::time::Duration;

    fn outcome(workers: u32, elapsed: u64, spread: u64) -> Outcome {
        let (first, last) = (Duration::from_secs(elapsed - spread), Duration::from_secs(elapsed));
        Outcome { elapsed: last, finishes: vec![first, last], capacity: last * workers }
    }

    /// The row of the office, given T₁, Δ₁, T₂ and Δ₂ in seconds.
    fn row(workers: u32, alone: u64, [t1, delta1, t2, delta2]: [u64; 4]) -> Row {
        let subject = Subject { model: "Office".into(), extent: Extent::Size(1), case: Case::Even };
        let (without, with) = (outcome(workers, t1, delta1), outcome(workers, t2, delta2));
        let alone = Duration::from_secs(alone);
        Row::new(&Comparison { subject, workers, alone, without, with })
    }

    /// Rows of the paper: P, T(1), T₁, Δ₁, T₂ and Δ₂ in seconds; S, E, T_P in seconds, and %.
    const PAPER: [(u32, u64, [u64; 4], [f64; 4]); 6] = [
        (8, 3943, [646, 323, 540, 54], [7.3, 0.91, 47.0, 0.087]),
        (16, 3943, [337, 194, 301, 106], [13.1, 0.82, 55.0, 0.183]),
        (32, 3943, [174, 107, 165, 68], [23.9, 0.75, 42.0, 0.253]),
        (16, 35487, [3033, 1752, 2542, 530], [14.0, 0.88, 324.0, 0.127]),
        (16, 4834, [471, 314, 342, 95], [14.1, 0.88, 40.0, 0.117]),
        (32, 4834, [236, 161, 231, 144], [20.9, 0.65, 80.0, 0.346]),
    ];

    #[test]
    fn the_columns_are_those_of_the_paper() {
        for (workers, alone, times, [s, e, tp, percent]) in PAPER {
            let row = row(workers, alone, times);
            let own = [row.t1_s, row.delta1_s, row.t2_s, row.delta2_s];
            assert_eq!(own, times.map(|seconds| seconds as f64));
            // The paper rounds, and not always to nearest.
            let near = |value: f64, told: f64, last_digit: f64| (value - told).abs() < last_digit;
            assert!(near(row.s, s, 0.1) && near(row.e, e, 0.01), "{row:?} {s} {e}");
            assert!(near(row.tp_s, tp, 1.0) && near(row.percent, percent, 0.002), "{row:?}");
        }
    }

    #[test]
    fn what_unequal_workers_amount_to_takes_the_place_of_their_number() {
        let mut outcome = outcome(4, 40, 0);
        outcome.capacity = Duration::from_secs(100);
        let subject =
            Subject { model: "Office".into(), extent: Extent::Size(1), case: Case::Straggler };
        let alone = Duration::from_secs(90);
        let (without, with) = (outcome.clone(), outcome);
        let row = Row::new(&Comparison { subject, workers: 4, alone, without, with });
        assert_eq!([row.s, row.e, row.tp_s, row.percent], [2.25, 0.9, 4.0, 0.1]);
    }

    #[test]
    fn times_are_written_as_people_read_them() {
        let written = [3943.0, 540.0, 60.0, 59.96, 12.34, 9.996, 1.234, 0.1234, 0.0, -0.05];
        let read = ["1:05:43", "9:00", "1:00", "1:00", "12.3", "10.0", "1.23", "0.123", "0.000"];
        assert_eq!(written.map(time)[..9], read);
        assert_eq!(time(-0.05), "-0.050");
    }

    #[test]
    fn rows_have_exactly_the_columns_as_keys() {
        let row = row(8, 3943, [646, 323, 540, 54]);
        let keys = |row: &Row| {
            let value = serde_json::to_value(row).unwrap();
            value.as_object().unwrap().keys().cloned().collect::<Vec<_>>()
        };
        let expected = [
            "p", "model", "size", "t1_s", "delta1_s", "t2_s", "delta2_s", "s", "e", "tp_s",
            "percent",
        ];
        assert_eq!(keys(&row), expected);
        let subject = Subject { extent: Extent::Work(60.0), case: Case::Point, ..row.subject };
        let value = serde_json::to_value(Row { subject, ..row }).unwrap();
        assert!(value["size"].is_null() && value["work_s"] == 60.0, "{value}");
        assert_eq!(value["case"], "point");
    }

    #[test]
    fn text_is_aligned_and_one_worker_tells_only_its_time() {
        let one = row(1, 3943, [3943, 0, 3943, 0]);
        let text = text(&[one, row(8, 3943, [646, 323, 540, 54])]);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[0].starts_with("P  Model   Size       T₁    Δ₁"), "{text}");
        assert!(lines[1].starts_with("1  Office     1  1:05:43     ·"), "{text}");
        assert!(lines[2].ends_with("7.3  0.913  47.1  0.087"), "{text}");
    }
}

//! Two runs of the same job on as many workers, without and with balancing: what a row of the table
//! is made of, and a point of its pictures. It does not matter here whether they were measured or
//! predicted.

use std::path::Path;
use std::time::Duration;

use anyhow::Context;

use crate::plot::{Efficiencies, EfficiencyLine, Figure2, Finishes, Picture};
use crate::subject::Subject;

/// The paper's figure 2 shows as many workers.
const FIGURE_WORKERS: u32 = 8;

/// What of a run is compared.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outcome {
    /// From the submission to the image being whole.
    pub(crate) elapsed: Duration,
    /// When each worker's last ray ended.
    pub(crate) finishes: Vec<Duration>,
    /// What all of them could have computed meanwhile, in time of the one that was alone.
    pub(crate) capacity: Duration,
}

/// Two runs of the same job.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Comparison {
    /// What was rendered.
    pub(crate) subject: Subject,
    /// By how many.
    pub(crate) workers: u32,
    /// What one worker takes for it.
    pub(crate) alone: Duration,
    /// Everybody kept what the start gave.
    pub(crate) without: Outcome,
    /// Work was spread.
    pub(crate) with: Outcome,
}

impl Outcome {
    /// The largest difference of finishing times.
    pub(crate) fn spread(&self) -> Duration {
        let latest = self.finishes.iter().max().copied().unwrap_or_default();
        latest - self.finishes.iter().min().copied().unwrap_or_default()
    }
}

impl Comparison {
    /// The part of what the workers could have computed in a run that was needed.
    pub(crate) fn efficiency(&self, of: &Outcome) -> f64 {
        self.alone.as_secs_f64() / of.capacity.as_secs_f64()
    }

    /// What the run with balancing would have taken if nothing had been lost: T(1) / P, where P is
    /// how many workers like that one there were on average.
    pub(crate) fn ideal(&self) -> Duration {
        self.with.elapsed.mul_f64(self.efficiency(&self.with))
    }

    fn finishes(&self) -> Finishes {
        let seconds = |of: &Outcome| of.finishes.iter().map(Duration::as_secs_f64).collect();
        Finishes {
            model: self.subject.label(),
            ideal: self.ideal().as_secs_f64(),
            without: seconds(&self.without),
            with: seconds(&self.with),
        }
    }
}

/// Figure 2 of so many workers: for each model, that of which the least was rendered.
pub(crate) fn figure2(compared: &[Comparison], workers: u32) -> Figure2 {
    let chosen = first_of_models(compared.iter().filter(|it| it.workers == workers));
    Figure2 { rows: chosen.into_iter().map(Comparison::finishes).collect() }
}

/// The count of workers that is nearest to the paper's in figure 2.
pub(crate) fn figure_workers(compared: &[Comparison]) -> u32 {
    let counts = compared.iter().map(|it| it.workers);
    let factor =
        |count: u32| f64::from(count.max(FIGURE_WORKERS)) / f64::from(count.min(FIGURE_WORKERS));
    counts.min_by(|&a, &b| factor(a).total_cmp(&factor(b))).unwrap_or(FIGURE_WORKERS)
}

/// Efficiency by number of workers; `what` says of which runs.
pub(crate) fn efficiencies(compared: &[Comparison], what: &str) -> Efficiencies {
    let points = |runs: &[Comparison], of: fn(&Comparison) -> &Outcome| {
        runs.iter().map(|run| (run.workers, run.efficiency(of(run)))).collect()
    };
    let line = |runs: &[Comparison]| EfficiencyLine {
        label: runs[0].subject.label(),
        without: points(runs, |run| &run.without),
        with: points(runs, |run| &run.with),
    };
    let lines = compared.chunk_by(|a, b| a.subject == b.subject).map(line).collect();
    Efficiencies { what: what.into(), lines }
}

/// Of each model the first, in order.
fn first_of_models<'a>(compared: impl Iterator<Item = &'a Comparison>) -> Vec<&'a Comparison> {
    let mut chosen: Vec<&Comparison> = Vec::new();
    for run in compared {
        if chosen.iter().all(|other| other.subject.model != run.subject.model) {
            chosen.push(run);
        }
    }
    chosen
}

/// Writes a picture into a directory and says so.
pub(crate) fn write_picture(picture: &impl Picture, directory: &Path) -> anyhow::Result<()> {
    let [svg, png] = crate::plot::write(picture, directory)?;
    eprintln!("wrote {} and {}", svg.display(), png.display());
    Ok(())
}

/// Makes a directory for pictures, before the work begins.
pub(crate) fn make_directory(directory: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(directory).with_context(|| {
        format!("{}: cannot be made; name another with --outdir", directory.display())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subject::Extent;
    use equilux_simulator::case::Case;

    fn compared(model: &str, size: u32, workers: u32) -> Comparison {
        let outcome = |seconds: &[u64]| Outcome {
            elapsed: Duration::from_secs(*seconds.iter().max().unwrap()),
            finishes: seconds.iter().map(|&it| Duration::from_secs(it)).collect(),
            capacity: Duration::from_secs(*seconds.iter().max().unwrap()) * workers,
        };
        Comparison {
            subject: Subject { model: model.into(), extent: Extent::Size(size), case: Case::Even },
            workers,
            alone: Duration::from_secs(80),
            without: outcome(&[5, 20]),
            with: outcome(&[15, 16]),
        }
    }

    #[test]
    fn figure_2_shows_the_paper_s_count_or_the_nearest() {
        let of = |counts: &[u32]| {
            figure_workers(&counts.iter().map(|&p| compared("a", 1, p)).collect::<Vec<_>>())
        };
        assert_eq!([of(&[1, 8, 16]), of(&[1, 2]), of(&[1, 16, 64]), of(&[1])], [8, 2, 16, 1]);
    }

    #[test]
    fn figure_2_has_a_row_for_each_model() {
        let runs =
            [compared("a", 1, 8), compared("a", 9, 8), compared("b", 1, 8), compared("b", 1, 16)];
        let figure = figure2(&runs, 8);
        let models: Vec<_> = figure.rows.iter().map(|row| row.model.as_str()).collect();
        assert_eq!(models, ["a, size 1", "b, size 1"]);
        assert_eq!((figure.rows[0].ideal, figure.rows[0].with[1]), (10.0, 16.0));
    }

    #[test]
    fn a_line_of_efficiency_has_a_point_for_each_count() {
        let runs = [compared("a", 1, 4), compared("a", 1, 8), compared("a", 9, 4)];
        let lines = efficiencies(&runs, "predicted").lines;
        assert_eq!(lines.len(), 2);
        assert_eq!(lines[0].with, [(4, 1.25), (8, 0.625)]);
        assert_eq!(lines[0].without, [(4, 1.0), (8, 0.5)]);
        assert_eq!(runs[0].without.spread(), Duration::from_secs(15));
    }
}

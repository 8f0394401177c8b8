//! How far a job is: a bar on a terminal, plain lines otherwise, nothing when told to be quiet.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};

/// Steps of the bar.
const STEPS: u64 = 1000;

/// A plain line is printed each time the progress has grown by this much.
const PLAIN_STEP: f64 = 0.1;

/// What there is to tell about a job at one moment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment<'a> {
    /// The state's word.
    pub(crate) state: &'a str,
    /// From 0 to 1.
    pub(crate) progress: f64,
    /// Since the job began.
    pub(crate) elapsed: Duration,
    /// Until it is done, if that can be told.
    pub(crate) remaining: Option<Duration>,
    /// More figures; may be empty.
    pub(crate) detail: &'a str,
}

/// Shows moments of one job.
#[derive(Debug)]
pub(crate) enum Progress {
    /// On a terminal.
    Bar(ProgressBar),
    /// To a file or a pipe.
    Plain {
        /// Progress and state of the last line.
        last: Option<(f64, String)>,
    },
    /// Nowhere.
    Quiet,
}

impl Progress {
    /// Chooses how to show progress.
    pub(crate) fn new(is_quiet: bool) -> Self {
        if is_quiet {
            Self::Quiet
        } else if std::io::stderr().is_terminal() {
            let style = ProgressStyle::with_template("{msg:10} [{bar:40}] {percent:>3}%  {prefix}");
            let bar = ProgressBar::new(STEPS);
            Self::Bar(match style {
                Ok(style) => bar.with_style(style.progress_chars("=> ")),
                Err(_) => bar,
            })
        } else {
            Self::Plain { last: None }
        }
    }

    /// Shows a moment, if it is worth showing.
    pub(crate) fn show(&mut self, moment: &Moment<'_>) {
        match self {
            Self::Bar(bar) => {
                bar.set_message(moment.state.to_owned());
                bar.set_prefix(times(moment));
                bar.set_position(steps(moment.progress));
            }
            Self::Plain { last } => {
                let is_news = last.as_ref().is_none_or(|(progress, state)| {
                    state != moment.state || moment.progress >= progress + PLAIN_STEP
                });
                if is_news {
                    eprintln!(
                        "{} {:.0}%  {}",
                        moment.state,
                        moment.progress * 100.0,
                        times(moment)
                    );
                    *last = Some((moment.progress, moment.state.to_owned()));
                }
            }
            Self::Quiet => {}
        }
    }

    /// Takes the bar away.
    pub(crate) fn end(&self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }

    /// Prints a line for the user without tearing the bar.
    pub(crate) fn say(&self, line: &str) {
        match self {
            Self::Bar(bar) => bar.suspend(|| eprintln!("{line}")),
            Self::Plain { .. } => eprintln!("{line}"),
            Self::Quiet => {}
        }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to STEPS")]
const fn steps(progress: f64) -> u64 {
    (progress.clamp(0.0, 1.0) * STEPS as f64) as u64
}

fn times(moment: &Moment<'_>) -> String {
    let elapsed = format!("{:.1} s", moment.elapsed.as_secs_f64());
    let times = match moment.remaining {
        Some(remaining) if moment.progress < 1.0 => {
            format!("{elapsed} elapsed, {} left", HumanDuration(remaining))
        }
        _ => format!("{elapsed} elapsed"),
    };
    if moment.detail.is_empty() { times } else { format!("{times}, {}", moment.detail) }
}

//! The pictures of a simulation.

use std::path::Path;
use std::sync::Arc;

use equilux_common::balancing::Word;
use equilux_simulator::case::Case;
use equilux_simulator::forecast::Forecast;

use super::prediction::Prediction;
use crate::args::SimulateArgs;
use crate::comparison::{self, Comparison, make_directory, write_picture};
use crate::plot::{HeatMaps, Loads, LoadsOverTime, MessageLine, Messages, Sent};

/// Draws everything that there is to see. Cases other than the even one have directories of their
/// own, where pictures have the same names.
pub(crate) fn draw(args: &SimulateArgs, predictions: &[Prediction]) -> anyhow::Result<()> {
    for case in args.cases() {
        let of_case = |it: &&Prediction| it.compared.subject.case == case;
        let predictions: Vec<&Prediction> = predictions.iter().filter(of_case).collect();
        match case {
            Case::Even => draw_case(args, &predictions, &args.outdir)?,
            other => draw_case(args, &predictions, &args.outdir.join(other.name()))?,
        }
    }
    Ok(())
}

fn draw_case(
    args: &SimulateArgs,
    predictions: &[&Prediction],
    directory: &Path,
) -> anyhow::Result<()> {
    make_directory(directory)?;
    let what = format!("predicted, {}", args.network.name);
    let compared: Vec<Comparison> = predictions.iter().map(|it| it.compared.clone()).collect();
    let workers = comparison::figure_workers(&compared);
    write_picture(&comparison::figure2(&compared, workers), directory)?;
    write_picture(&comparison::efficiencies(&compared, &what), directory)?;
    write_picture(&messages(predictions, &what), directory)?;
    for workers in args.workers.with_one().into_iter().filter(|&workers| workers > 1) {
        write_picture(&heat_maps(predictions, workers), directory)?;
    }
    Ok(())
}

fn messages(predictions: &[&Prediction], what: &str) -> Messages {
    let same = |a: &&Prediction, b: &&Prediction| a.compared.subject == b.compared.subject;
    let sent = |of: fn(&Prediction) -> &Arc<Forecast>, line: &[&Prediction]| {
        line.iter().map(|prediction| mean_sent(of(prediction))).collect()
    };
    let line = |line: &[&Prediction]| MessageLine {
        label: line[0].compared.subject.label(),
        without: sent(|prediction| &prediction.without, line),
        with: sent(|prediction| &prediction.with, line),
    };
    Messages { what: what.into(), lines: predictions.chunk_by(same).map(line).collect() }
}

fn mean_sent(forecast: &Forecast) -> Sent {
    let count = forecast.workers.len();
    let messages: u64 = forecast.workers.iter().map(|worker| worker.messages_out).sum();
    let bytes: u64 = forecast.workers.iter().map(|worker| worker.bytes_out).sum();
    Sent {
        workers: u32::try_from(count).unwrap_or(u32::MAX),
        messages: messages as f64 / count as f64,
        bytes: bytes as f64 / count as f64,
    }
}

/// A map for each model, of that of which the least was rendered.
fn heat_maps(predictions: &[&Prediction], workers: u32) -> HeatMaps {
    let mut rows: Vec<(&str, Loads)> = Vec::new();
    for prediction in predictions.iter().filter(|it| it.compared.workers == workers) {
        let subject = &prediction.compared.subject;
        if rows.iter().all(|(model, _)| *model != subject.model) {
            let without = loads(&prediction.without);
            let loads = Loads { model: subject.label(), without, with: loads(&prediction.with) };
            rows.push((&subject.model, loads));
        }
    }
    HeatMaps { workers, rows: rows.into_iter().map(|(_, loads)| loads).collect() }
}

fn loads(forecast: &Forecast) -> LoadsOverTime {
    let map = &forecast.loads;
    LoadsOverTime::new(forecast.elapsed.as_secs_f64(), map.interval.as_secs_f64(), &map.seconds)
}

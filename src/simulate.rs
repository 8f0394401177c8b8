//! `equilux simulate`: how fast clusters of any size would render a scene, as the paper's table and
//! pictures. The cluster is simulated; what its paths cost was measured.

mod details;
mod model;
mod pictures;
mod prediction;

use std::process::ExitCode;

use anyhow::bail;
use equilux_simulator::case::Case;
use serde_json::json;

use crate::args::SimulateArgs;
use crate::comparison::make_directory;
use crate::jobs::print_line;
use crate::simulate::details::Detail;
use crate::simulate::prediction::Prediction;
pub(crate) use crate::simulate::prediction::worker;
use crate::table::{self, Row};

/// `equilux simulate`.
pub(crate) async fn run(args: SimulateArgs) -> anyhow::Result<ExitCode> {
    if args.cases() != [Case::Even] && args.workers.with_one() == [1] {
        bail!("--case: one worker has nobody to differ from; name more with --workers");
    }
    make_directory(&args.outdir)?;
    let models = model::all(&args).await?;
    let predictions = prediction::all(&args, &models).await?;
    let rows: Vec<Row> = predictions.iter().map(|it| Row::new(&it.compared)).collect();
    print(&args, &rows, &predictions)?;
    pictures::draw(&args, &predictions)?;
    Ok(ExitCode::SUCCESS)
}

fn print(args: &SimulateArgs, rows: &[Row], predictions: &[Prediction]) -> anyhow::Result<()> {
    let details: Vec<Detail> = predictions.iter().flat_map(Detail::of).collect();
    let text = match (args.json, args.details) {
        (true, true) => serde_json::to_string_pretty(&json!({ "rows": rows, "details": details }))?,
        (true, false) => serde_json::to_string_pretty(rows)?,
        (false, true) => format!("{}\n{}", table::text(rows), details::text(&details)),
        (false, false) => table::text(rows),
    };
    Ok(print_line(text.trim_end())?)
}

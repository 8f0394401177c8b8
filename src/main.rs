//! The one binary: a subcommand per file, no logic of its own.

mod allocator;
mod args;
mod bench;
mod client;
mod cluster;
mod comparison;
mod coordinator;
mod interrupt;
mod jobs;
mod outputs;
mod overrides;
mod plot;
mod progress;
mod record;
mod render;
mod scene;
mod simulate;
mod spool;
mod stats;
mod store_build;
mod stores;
mod subject;
mod table;
mod worker;

use std::process::ExitCode;

use clap::Parser;
use equilux_render::geometry::Instructions;

use crate::args::{Args, Command};

fn main() -> ExitCode {
    allocator::give_back_large_blocks();
    let args = Args::parse();
    args.instructions.into_iter().for_each(Instructions::choose);
    match run(args) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: Args) -> anyhow::Result<ExitCode> {
    let runtime =
        tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let code = runtime.block_on(async {
        match args.command {
            Command::Render(args) => render::run(args).await,
            Command::Coordinator(args) => coordinator::run(args).await,
            Command::Worker(args) => worker::run(args).await,
            Command::Submit(args) => jobs::submit(args).await,
            Command::Jobs(args) => jobs::list(args).await,
            Command::Watch(args) => jobs::watch(args).await,
            Command::Fetch(args) => jobs::fetch(args).await,
            Command::Cancel(args) => jobs::cancel(args).await,
            Command::Scene(args) => scene::run(args).await,
            Command::Simulate(args) => simulate::run(args).await,
            Command::Bench(args) => bench::run(args).await,
        }
    });
    // A scene that is still being read or built is nobody's any more: do not wait for it.
    runtime.shutdown_background();
    code
}

//! `equilux worker`: lends this machine's processors to a coordinator.

use std::process::ExitCode;

use equilux_worker::{Log, Options};
use tokio::io::AsyncReadExt;

use crate::args::WorkerArgs;
use crate::interrupt::Interrupt;

/// `equilux worker`.
pub(crate) async fn run(args: WorkerArgs) -> anyhow::Result<ExitCode> {
    let mut interrupt = Interrupt::listen()?;
    let defaults = Options::new(args.coordinator);
    let options = Options {
        threads: args.threads.unwrap_or(defaults.threads),
        memory: args.memory.map(|bytes| bytes.0),
        cache: args.cache,
        cache_bytes_max: args.cache_size.0,
        listen: args.listen,
        advertise: args.advertise,
        log: if args.quiet { Log::to_stderr().quiet() } else { Log::to_stderr() },
        ..defaults
    };
    let until_stdin_closes = args.until_stdin_closes;
    let shutdown = async move {
        tokio::select! {
            () = interrupt.asked() => {}
            () = stdin_closed(), if until_stdin_closes => {}
        }
    };
    equilux_worker::run(options, shutdown).await?;
    Ok(ExitCode::SUCCESS)
}

/// Waits for the end of standard input, which is the end of whoever holds its other end.
async fn stdin_closed() {
    let mut stdin = tokio::io::stdin();
    let mut byte = [0];
    while let Ok(1..) = stdin.read(&mut byte).await {}
}

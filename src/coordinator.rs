//! `equilux coordinator`: the service that workers join and jobs are sent to.

use std::process::ExitCode;

use equilux_coordinator::rest::RestOptions;
use equilux_coordinator::serve::{ServeOptions, Server};

use crate::args::CoordinatorArgs;
use crate::interrupt::Interrupt;
use crate::stores;

/// `equilux coordinator`.
pub(crate) async fn run(args: CoordinatorArgs) -> anyhow::Result<ExitCode> {
    let mut interrupt = Interrupt::listen()?;
    let server = Server::bind(ServeOptions {
        grpc: args.grpc,
        http: args.http,
        data: args.data,
        allow_open: args.allow_open,
        rest: RestOptions {
            scenes: args.scenes,
            store_reader: Some(stores::open_served),
            token: args.token,
            ..RestOptions::default()
        },
    })
    .await?;
    eprintln!("workers: http://{}", server.grpc_address());
    eprintln!("jobs: http://{}", server.http_address());
    server.run(async move { interrupt.asked().await }).await?;
    Ok(ExitCode::SUCCESS)
}

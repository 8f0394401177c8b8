//! Generates the wire's types from `proto/`, without `protoc`.

use std::error::Error;

const FILES: [&str; 2] = ["proto/equilux/v1/coordinator.proto", "proto/equilux/v1/peer.proto"];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=proto");
    println!("cargo:rerun-if-changed=build.rs");
    let descriptors = protox::compile(FILES, ["proto"])?;
    tonic_prost_build::configure().compile_fds(descriptors)?;
    Ok(())
}

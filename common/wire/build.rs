//! Turns `proto/` into Rust without the protobuf compiler: a Rust one reads the files.

use std::error::Error;
use std::path::Path;

const FILES: [&str; 4] = [
    "flyby/v1/common.proto",
    "flyby/v1/joining.proto",
    "flyby/v1/user.proto",
    "flyby/v1/worker.proto",
];

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../proto");
    for file in FILES {
        println!("cargo:rerun-if-changed={}", root.join(file).display());
    }
    println!("cargo:rerun-if-changed=build.rs");
    let descriptors = protox::compile(FILES.map(|file| root.join(file)), [&root])?;
    tonic_prost_build::configure()
        .emit_rerun_if_changed(false)
        .bytes(".flyby.v1.Delivery.record")
        .bytes(".flyby.v1.FetchChunk.data")
        .client_mod_attribute(".", "#[cfg(feature = \"grpc\")]")
        .server_mod_attribute(".", "#[cfg(feature = \"grpc\")]")
        .compile_fds(descriptors)?;
    Ok(())
}

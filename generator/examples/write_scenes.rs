//! Writes the shipped scenes afresh: `cargo run --release -p equilux-generator --example
//! write_scenes`.

use std::path::Path;

use equilux_generator::{Files, bathroom, cornell_box, office};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    write(&scenes.join("cornell-box"), &cornell_box())?;
    write(&scenes.join("office"), &office(1)?)?;
    write(&scenes.join("bathroom"), &bathroom(1)?)?;
    Ok(())
}

fn write(directory: &Path, files: &Files) -> std::io::Result<()> {
    std::fs::create_dir_all(directory)?;
    for file in files {
        std::fs::write(directory.join(&file.name), &file.text)?;
    }
    Ok(())
}

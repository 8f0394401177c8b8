//! The scenes in the repository are what the programs make.

use std::path::Path;

use equilux_generator::{Files, bathroom, cornell_box, office};

#[test]
fn the_shipped_files_are_what_the_programs_make() {
    is_what_is_made("office", &office(1).expect("the shipped size"));
    is_what_is_made("bathroom", &bathroom(1).expect("the shipped size"));
    is_what_is_made("cornell-box", &cornell_box());
}

fn is_what_is_made(scene: &str, made: &Files) {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(scene);
    for file in made.iter() {
        let path = directory.join(&file.name);
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let path = path.display();
        assert!(text == file.text, "{path} is out of date; run `equilux scene generate {scene}`");
    }
}

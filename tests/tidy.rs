//! The rules of `STYLE.md` and `ARCHITECTURE.md` that a program can check, held against this
//! repository. A rule that matters is a test.
//!
//! Each rule is a function from text to complaints, beside bad examples that it must complain of;
//! here they meet the real files.

#[path = "tidy/edges.rs"]
mod edges;
#[path = "tidy/files.rs"]
mod files;
#[path = "tidy/lexer.rs"]
mod lexer;
#[path = "tidy/names.rs"]
mod names;
#[path = "tidy/purity.rs"]
mod purity;
#[path = "tidy/tree.rs"]
mod tree;
#[path = "tidy/wire.rs"]
mod wire;

use tree::{File, Tree};

/// Packages of pure computation and pure state machines.
const PURE: [&str; 5] = [
    "coordinator/core/src/",
    "generator/src/",
    "mapping/src/",
    "worker/core/src/",
    "worker/render/src/",
];

#[test]
fn every_source_file_says_why_it_exists() {
    hold_for_sources(|file| files::header(&file.text));
}

#[test]
fn no_source_file_is_too_long_or_too_wide() {
    hold_for_sources(|file| files::size(&file.text));
}

#[test]
fn no_lint_is_silenced_without_a_reason() {
    hold_for_sources(|file| files::silenced(&file.text));
}

#[test]
fn nothing_is_left_for_later() {
    hold_for_sources(|file| files::unfinished(&file.text));
}

#[test]
fn names_say_what_things_are() {
    hold_for_sources(|file| [names::stem(&file.path), names::declared(&file.text)].concat());
}

#[test]
fn cores_and_light_do_no_io() {
    let tree = Tree::read();
    let tests = tree.test_modules();
    let is_pure = |path: &String| PURE.iter().any(|package| path.starts_with(package));
    let pure = |file: &&File| is_pure(&file.path) && !tests.contains(&file.path);
    hold(tree.ending(".rs").filter(pure), |file| purity::impure(&file.text));
}

#[test]
fn dependencies_point_the_allowed_way() {
    let tree = Tree::read();
    hold(tree.ending("Cargo.toml"), |file| edges::forbidden(&file.text));
    let names: Vec<_> = tree.ending("Cargo.toml").map(|file| edges::package(&file.text)).collect();
    assert_eq!(names.len(), edges::ALLOWED.len(), "{names:?} against the table of allowed edges");
}

#[test]
fn every_package_obeys_the_one_table_of_lints() {
    let tree = Tree::read();
    hold(tree.ending("Cargo.toml"), |file| edges::lints(&file.text));
    let configs: Vec<_> = tree.ending("clippy.toml").map(|file| file.path.as_str()).collect();
    assert_eq!(configs, ["clippy.toml"], "another would replace the root's, not add to it");
}

#[test]
fn every_message_is_converted() {
    let tree = Tree::read();
    let sources = tree.ending(".rs").filter(|file| file.path.starts_with("proto/src/"));
    let sources: String = sources.map(|file| file.text.as_str()).collect();
    let mut definitions = tree.ending(".proto").peekable();
    assert!(definitions.peek().is_some(), "no .proto file was found");
    hold(definitions, |file| wire::unconverted(&file.text, &sources));
}

#[test]
fn every_scene_names_its_source_and_licence() {
    let tree = Tree::read();
    let scenes = tree.directories_in("scenes");
    assert!(!scenes.is_empty(), "no scene is shipped in scenes/");
    for scene in scenes {
        let readme = format!("scenes/{scene}/README.md");
        let text = tree.ending(".md").find(|file| file.path == readme).map(|file| &file.text);
        let text = text.unwrap_or_else(|| panic!("{readme}: missing; name source and licence"));
        assert_eq!(files::unsourced(text), Vec::<String>::new(), "{readme}");
    }
}

#[test]
fn no_blob_hides_outside_the_scenes() {
    let complaints: Vec<_> = tree::tracked()
        .into_iter()
        .filter(|(path, bytes)| files::is_blob(path, *bytes))
        .map(|(path, bytes)| format!("{path}: {bytes} bytes; 262144 are allowed"))
        .collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

fn hold_for_sources(rule: impl Fn(&File) -> Vec<String>) {
    let tree = Tree::read();
    hold(tree.ending(".rs"), rule);
}

/// Holds `rule` against every file and fails with all complaints at once.
fn hold<'a>(files: impl Iterator<Item = &'a File>, rule: impl Fn(&File) -> Vec<String>) {
    let named = |file: &File| {
        let path = file.path.clone();
        rule(file).into_iter().map(move |complaint| format!("{path}: {complaint}"))
    };
    let complaints: Vec<_> = files.flat_map(named).collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

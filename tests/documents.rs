//! The pages show commands; every subcommand and flag in them is one that the program has.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How a command line of the program begins, from the shell and from the repository.
const PROGRAMS: [&str; 3] = ["equilux ", "cargo run --release -- ", "/usr/local/bin/equilux "];

#[test]
fn commands_in_the_pages_are_those_of_the_program() {
    let mut help = Help::default();
    let mut command_count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page");
        for line in commands(&text) {
            command_count += 1;
            let subcommand: Vec<_> = subcommand(&line).collect();
            let help = help.of(&subcommand);
            for flag in flags(&line) {
                assert!(has_flag(help, flag), "{}: `{line}`: no flag {flag}", page.display());
            }
        }
    }
    assert!(command_count > 0, "the pages show no command at all");
}

#[test]
fn links_in_the_pages_lead_to_files_of_the_repository() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut link_count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page");
        for target in targets(&text) {
            link_count += 1;
            let file = page.parent().unwrap_or(root).join(target);
            assert!(file.exists(), "{}: there is no {target}", page.display());
        }
    }
    assert!(link_count > 5, "the pages show only {link_count} links");
}

/// Files that a page links to or shows, without those elsewhere on the web and within the page.
fn targets(text: &str) -> impl Iterator<Item = &str> {
    let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let local = links.filter(|link| !link.contains("://") && !link.starts_with('#'));
    local.map(|link| link.split('#').next().unwrap_or(link))
}

/// The README and all of `docs/`.
fn pages() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let docs = fs::read_dir(root.join("docs")).into_iter().flatten().flatten();
    let docs = docs.map(|entry| entry.path()).filter(|it| it.extension() == Some("md".as_ref()));
    let mut pages: Vec<_> = docs.chain([root.join("README.md")]).collect();
    pages.sort();
    pages
}

/// What follows the program's name in the lines of fenced blocks that call it.
fn commands(page: &str) -> Vec<String> {
    let joined = page.replace("\\\n", " ");
    let fenced = joined.split("```").skip(1).step_by(2).flat_map(str::lines);
    let called = fenced.filter_map(|line| {
        let line = line.trim_start().trim_start_matches("ExecStart=");
        PROGRAMS.iter().find_map(|program| line.strip_prefix(program))
    });
    called.map(str::to_owned).collect()
}

/// The words before the first flag that name a subcommand, one level or two.
fn subcommand(command: &str) -> impl Iterator<Item = &str> {
    let is_group = ["scene ", "bench "].iter().any(|group| command.starts_with(group));
    let depth = if is_group { 2 } else { 1 };
    command.split_whitespace().take(depth).filter(|word| !word.starts_with('-'))
}

/// Flags without their values.
fn flags(command: &str) -> impl Iterator<Item = &str> {
    let words = command.split_whitespace().take_while(|word| !word.starts_with('#'));
    let bare = words.map(|word| word.trim_start_matches('['));
    bare.filter(|word| word.starts_with('-'))
        .map(|word| word.split(['=', ']']).next().unwrap_or(word))
}

/// Whether `flag` is a word of the help.
fn has_flag(help: &str, flag: &str) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || c == '-';
    help.split(|c| !is_part(c)).any(|word| word == flag)
}

/// What `--help` says, by subcommand.
#[derive(Default)]
struct Help {
    texts: BTreeMap<Vec<String>, String>,
}

impl Help {
    fn of(&mut self, subcommand: &[&str]) -> &str {
        let key = subcommand.iter().map(|&word| word.to_owned()).collect();
        self.texts.entry(key).or_insert_with(|| {
            let mut program = Command::new(env!("CARGO_BIN_EXE_equilux"));
            let output = program.args(subcommand).arg("--help").output().expect("the program");
            assert!(output.status.success(), "there is no command `equilux {subcommand:?}`");
            String::from_utf8(output.stdout).expect("help is UTF-8")
        })
    }
}

mod tests {
    use super::*;

    #[test]
    fn commands_are_found() {
        let page = "a `equilux x`\n```sh\nequilux render a.json \\\n  --spp=4 -o b.png\nls\n```\n\
                    ```\ncargo run --release -- scene check a\n```\nequilux y\n";
        let found = commands(page);
        assert_eq!(found, ["render a.json    --spp=4 -o b.png", "scene check a"]);
        assert_eq!(flags(&found[0]).collect::<Vec<_>>(), ["--spp", "-o"]);
        assert_eq!(subcommand(&found[0]).collect::<Vec<_>>(), ["render"]);
        assert_eq!(subcommand(&found[1]).collect::<Vec<_>>(), ["scene", "check"]);
    }

    #[test]
    fn an_unknown_flag_is_found() {
        let help = "  -o, --outfile <FILE>\n      --spp <N>";
        assert!(has_flag(help, "--spp") && has_flag(help, "-o"));
        assert!(!has_flag(help, "--sp") && !has_flag(help, "--out") && !has_flag(help, "-x"));
    }
}

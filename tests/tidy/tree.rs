//! The repository as the rules see it: paths relative to its root, with `/`, sorted.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::lexer::{code, test_modules};

/// Texts that some rule looks at.
const SUFFIXES: [&str; 4] = [".rs", ".toml", ".proto", ".md"];

/// A text file.
pub(crate) struct File {
    /// Relative to the root.
    pub(crate) path: String,
    /// What it says.
    pub(crate) text: String,
}

/// All text files that some rule looks at, committed or not yet.
pub(crate) struct Tree {
    files: Vec<File>,
}

impl Tree {
    /// Reads them; build output and hidden directories are left out.
    pub(crate) fn read() -> Self {
        let is_text = |path: &String| SUFFIXES.iter().any(|suffix| path.ends_with(suffix));
        let files = walk().into_iter().filter(is_text).map(|path| {
            let text = fs::read_to_string(root().join(&path)).expect(&path);
            File { path, text }
        });
        Self { files: files.collect() }
    }

    /// Files whose path ends with `suffix`.
    pub(crate) fn ending(&self, suffix: &str) -> impl Iterator<Item = &File> {
        self.files.iter().filter(move |file| file.path.ends_with(suffix))
    }

    /// Paths of modules that are there for tests alone.
    pub(crate) fn test_modules(&self) -> Vec<String> {
        let modules = |file: &File| {
            let code = code(&file.text);
            let directory = module_directory(&file.path);
            let paths = test_modules(&code).map(|name| format!("{directory}/{name}.rs"));
            paths.collect::<Vec<_>>()
        };
        self.ending(".rs").flat_map(modules).collect()
    }

    /// Names of the directories that lie directly in `parent`.
    pub(crate) fn directories_in(&self, parent: &str) -> Vec<String> {
        let entries = fs::read_dir(root().join(parent)).into_iter().flatten().flatten();
        let directories = entries.filter(|entry| entry.path().is_dir());
        let mut names: Vec<_> =
            directories.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }
}

/// Every file that is committed or staged, with its size in bytes. Where there is no git, every
/// file there is.
pub(crate) fn tracked() -> Vec<(String, u64)> {
    let listed = Command::new("git").args(["ls-files", "-z"]).current_dir(root()).output();
    let paths = match listed {
        Ok(output) if output.status.success() => {
            let names = String::from_utf8(output.stdout).expect("paths are UTF-8");
            names.split_terminator('\0').map(str::to_owned).collect()
        }
        _ => walk(),
    };
    let sized = |path: String| {
        let bytes = fs::metadata(root().join(&path)).ok()?.len();
        Some((path, bytes))
    };
    paths.into_iter().filter_map(sized).collect()
}

/// Where the modules that a file declares lie.
fn module_directory(path: &str) -> &str {
    let stem = path.strip_suffix(".rs").unwrap_or(path);
    let roots = ["/lib", "/main", "/mod"];
    roots.iter().find_map(|root| stem.strip_suffix(root)).unwrap_or(stem)
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn walk() -> Vec<String> {
    let mut found = Vec::new();
    let mut waiting = vec![PathBuf::new()];
    while let Some(directory) = waiting.pop() {
        for entry in fs::read_dir(root().join(&directory)).expect("a directory").flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            let path = directory.join(&name);
            let kind = entry.file_type().expect("the kind of a file");
            if kind.is_dir() && !name.starts_with('.') && name != "target" {
                waiting.push(path);
            } else if kind.is_file() {
                found.push(path.to_string_lossy().replace('\\', "/"));
            }
        }
    }
    found.sort();
    found
}

mod tests {
    use super::*;

    #[test]
    fn modules_lie_beside_a_root_and_below_others() {
        assert_eq!(module_directory("worker/src/lib.rs"), "worker/src");
        assert_eq!(module_directory("worker/src/peers.rs"), "worker/src/peers");
    }
}

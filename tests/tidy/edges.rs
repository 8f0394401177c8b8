//! Which package may know which: the table of `ARCHITECTURE.md`, and what a manifest must say.

/// A package and the packages of this workspace that it may depend on.
type Edges = (&'static str, &'static [&'static str]);

/// All packages. What is not listed is forbidden.
pub(crate) const ALLOWED: [Edges; 12] = [
    ("equilux", &ALL),
    ("equilux-common", &[]),
    ("equilux-coordinator", &["equilux-coordinator-core", "equilux-proto", "equilux-common"]),
    ("equilux-coordinator-core", &["equilux-common"]),
    ("equilux-generator", &[]),
    ("equilux-mapping", &["equilux-common"]),
    ("equilux-proto", &["equilux-common"]),
    ("equilux-render", &["equilux-common"]),
    (
        "equilux-simulator",
        &[
            "equilux-coordinator-core",
            "equilux-worker-core",
            "equilux-mapping",
            "equilux-render",
            "equilux-common",
        ],
    ),
    ("equilux-store", &["equilux-render", "equilux-common"]),
    (
        "equilux-worker",
        &[
            "equilux-worker-core",
            "equilux-mapping",
            "equilux-render",
            "equilux-store",
            "equilux-proto",
            "equilux-common",
        ],
    ),
    ("equilux-worker-core", &["equilux-mapping", "equilux-common"]),
];

const ALL: [&str; 11] = [
    "equilux-common",
    "equilux-coordinator",
    "equilux-coordinator-core",
    "equilux-generator",
    "equilux-mapping",
    "equilux-proto",
    "equilux-render",
    "equilux-simulator",
    "equilux-store",
    "equilux-worker",
    "equilux-worker-core",
];

/// Packages that do no I/O and start no thread.
const PURE: [&str; 5] = [
    "equilux-coordinator-core",
    "equilux-generator",
    "equilux-mapping",
    "equilux-render",
    "equilux-worker-core",
];

/// First words of crates that do.
const IMPURE_CRATES: [&str; 16] = [
    "async",
    "axum",
    "crossbeam",
    "futures",
    "hyper",
    "indicatif",
    "mio",
    "parking",
    "prost",
    "protox",
    "rayon",
    "reqwest",
    "tempfile",
    "tokio",
    "tonic",
    "tower",
];

/// Dependencies of the manifest that its package must not have.
pub(crate) fn forbidden(manifest: &str) -> Vec<String> {
    let package = package(manifest);
    let Some((_, allowed)) = ALLOWED.iter().find(|(name, _)| *name == package) else {
        return vec![format!("package {package} is not in the table of allowed edges")];
    };
    let is_forbidden = |kind: &str, name: &str| match name.starts_with("equilux") {
        true => !allowed.contains(&name),
        false => !kind.starts_with("dev-") && PURE.contains(&package) && is_impure(name),
    };
    let found = dependencies(manifest).into_iter().filter(|(kind, name)| is_forbidden(kind, name));
    found.map(|(_, name)| format!("{package} must not depend on {name}")).collect()
}

/// A package takes its lints from the workspace.
pub(crate) fn lints(manifest: &str) -> Vec<String> {
    let inherits = entries(manifest).any(|entry| entry == ("lints", "workspace", "true"));
    if inherits { Vec::new() } else { vec!["write `[lints]` `workspace = true`".into()] }
}

/// The name of the manifest's package.
pub(crate) fn package(manifest: &str) -> &str {
    let name = entries(manifest).find(|(section, key, _)| (*section, *key) == ("package", "name"));
    name.map_or("", |(_, _, value)| value.trim_matches('"'))
}

fn is_impure(name: &str) -> bool {
    let first = name.split(['-', '_']).next().unwrap_or(name);
    IMPURE_CRATES.contains(&first)
}

/// Kind and name of each dependency.
fn dependencies(manifest: &str) -> Vec<(&str, &str)> {
    let from_table = entries(manifest).filter(|(section, _, _)| is_table(section));
    let from_table = from_table.map(|(section, key, _)| (kind(section), named(key)));
    let from_header = headers(manifest).filter_map(|header| {
        let (section, name) = header.rsplit_once('.')?;
        is_table(section).then_some((kind(section), named(name)))
    });
    from_table.chain(from_header).collect()
}

/// `dependencies`, `dev-dependencies`, …, also of one target; not the workspace's list of versions.
fn is_table(section: &str) -> bool {
    section.ends_with("dependencies") && !section.starts_with("workspace")
}

fn kind(section: &str) -> &str {
    section.rsplit('.').next().unwrap_or(section)
}

fn named(key: &str) -> &str {
    key.split('.').next().unwrap_or(key).trim_matches('"')
}

/// Section, key and value of each line. The manifests keep to one entry a line.
fn entries(manifest: &str) -> impl Iterator<Item = (&str, &str, &str)> {
    let mut section = "";
    manifest.lines().filter_map(move |line| {
        if let Some(header) = header(line) {
            section = header;
            return None;
        }
        let (key, value) = line.split('#').next()?.split_once('=')?;
        Some((section, key.trim(), value.trim()))
    })
}

fn headers(manifest: &str) -> impl Iterator<Item = &str> {
    manifest.lines().filter_map(header)
}

fn header(line: &str) -> Option<&str> {
    let inside = line.trim().strip_prefix('[')?.split(']').next()?;
    Some(inside.trim_start_matches('['))
}

mod tests {
    use super::*;

    fn manifest(package: &str, rest: &str) -> String {
        format!("[package]\nname = \"{package}\"\n{rest}")
    }

    #[test]
    fn a_forbidden_edge_is_found() {
        for rest in [
            "[dependencies]\nequilux-render.workspace = true\n",
            "[dependencies]\nequilux-render = { path = \"../render\" }\n",
            "[dependencies.equilux-render]\npath = \"../render\"\n",
            "[dev-dependencies]\nequilux-render.workspace = true\n",
            "[target.'cfg(unix)'.dependencies]\nequilux-render.workspace = true\n",
        ] {
            let found = forbidden(&manifest("equilux-worker-core", rest));
            assert_eq!(found, ["equilux-worker-core must not depend on equilux-render"], "{rest}");
        }
        assert_eq!(forbidden(&manifest("equilux-new", "")).len(), 1);
    }

    #[test]
    fn an_impure_crate_is_found() {
        let rest = "[dependencies]\ntokio-stream.workspace = true\nlibm.workspace = true\n";
        let found = forbidden(&manifest("equilux-render", rest));
        assert_eq!(found, ["equilux-render must not depend on tokio-stream"]);
        assert!(forbidden(&manifest("equilux-worker", rest)).is_empty());
    }

    #[test]
    fn allowed_edges_pass() {
        let rest = "[dependencies]\nequilux-common.workspace = true # the vocabulary\n\
                    [dev-dependencies]\ntempfile.workspace = true\n\
                    [workspace.dependencies]\nequilux-proto = { path = \"proto\" }\n";
        assert_eq!(forbidden(&manifest("equilux-render", rest)), Vec::<String>::new());
    }

    #[test]
    fn a_package_with_lints_of_its_own_is_found() {
        assert!(lints("[lints]\nworkspace = true\n").is_empty());
        assert_eq!(lints("[lints.rust]\nunsafe_code = \"allow\"\n").len(), 1);
    }
}

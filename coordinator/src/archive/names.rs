//! Names in archives: only those that stay below the archive's root, in one spelling.

use super::ArchiveError;

/// Longest name accepted, in bytes; the limit of common file systems.
const NAME_BYTES_MAX: usize = 4096;

/// The name in its one spelling: relative, `/` between parts, no `.`.
pub(super) fn checked(entry: &str) -> Result<String, ArchiveError> {
    match problem(entry) {
        Some(problem) => Err(ArchiveError::BadName { entry: shortened(entry), problem }),
        None => Ok(parts(entry).collect::<Vec<_>>().join("/")),
    }
}

fn parts(entry: &str) -> impl Iterator<Item = &str> {
    entry.split('/').filter(|part| !part.is_empty() && *part != ".")
}

fn problem(entry: &str) -> Option<&'static str> {
    if entry.len() > NAME_BYTES_MAX {
        return Some("has a name of more than 4096 bytes");
    }
    if entry.contains('\\') {
        return Some("has a backslash in its name");
    }
    if entry.contains(|character: char| character.is_control()) {
        return Some("has a control character in its name");
    }
    if entry.starts_with('/') || entry.as_bytes().get(1) == Some(&b':') {
        return Some("has an absolute name");
    }
    if entry.split('/').any(|part| part == "..") {
        return Some("leads out of the archive by `..`");
    }
    parts(entry).next().is_none().then_some("has no name")
}

/// A name short enough for a message.
fn shortened(entry: &str) -> String {
    entry.chars().take(200).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_come_out_in_one_spelling() {
        assert_eq!(checked("./a//b/./c.obj").expect("a fine name"), "a/b/c.obj");
        assert_eq!(checked("a..b/..c").expect("dots within a name"), "a..b/..c");
    }

    #[test]
    fn names_that_lead_out_are_refused() {
        for name in ["/etc/passwd", "../a", "a/../../b", "a/..", "C:/a", "C:\\a", "\\\\host\\a"] {
            assert!(matches!(checked(name), Err(ArchiveError::BadName { .. })), "{name}");
        }
        for name in ["", ".", "./", "a\0b", "a\nb"] {
            assert!(matches!(checked(name), Err(ArchiveError::BadName { .. })), "{name:?}");
        }
        assert!(checked(&"a".repeat(5000)).is_err());
    }
}

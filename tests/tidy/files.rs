//! Rules that hold for a file as a whole.

use super::lexer::{above_tests, code, line_of};

/// Most lines of a source file, not counting the tests at its end.
const LINES_MAX: usize = 500;

/// Most characters of a line of comment. In code, `rustfmt` knows best what can be broken.
const COLUMNS_MAX: usize = 100;

/// Largest file outside `scenes/`.
const BLOB_BYTES_MAX: u64 = 256 * 1024;

/// A file opens with why it exists.
pub(crate) fn header(text: &str) -> Vec<String> {
    let opens = text.strip_prefix("//! ").is_some_and(|rest| !rest.starts_with("Placeholder"));
    complain(!opens, "1: open it with `//!` and why it exists")
}

/// A file is short and narrow enough to be read. Lines inside of a string may be as they must.
pub(crate) fn size(text: &str) -> Vec<String> {
    let lines = above_tests(text).lines().count();
    let long = complain(lines > LINES_MAX, format!("{lines} lines; split it by idea"));
    let is_wide = |line: &str| line.chars().count() > COLUMNS_MAX;
    let comments = text.lines().zip(1..).filter(|(line, _)| line.trim_start().starts_with("//"));
    let wide = comments.filter(|(line, _)| is_wide(line));
    let wide = wide.map(|(_, number)| format!("{number}: more than {COLUMNS_MAX} columns"));
    long.into_iter().chain(wide).collect()
}

/// A lint is silenced by `expect`, with its reason.
pub(crate) fn silenced(text: &str) -> Vec<String> {
    let code = code(text);
    let allows = ["#[allow(", "#![allow("].into_iter().flat_map(|mark| code.match_indices(mark));
    let allows = allows.map(|(at, _)| (at, "`allow` outlives its cause; write `expect`"));
    let expects = ["#[expect(", "#![expect("].into_iter().flat_map(|mark| code.match_indices(mark));
    let expects = expects
        .filter(|(at, _)| !code[*at..].split(']').next().is_some_and(|it| it.contains("reason =")))
        .map(|(at, _)| (at, "`expect` without a reason"));
    allows.chain(expects).map(|(at, what)| format!("{}: {what}", line_of(&code, at))).collect()
}

/// Nothing is left for later: neither code nor a note of it.
pub(crate) fn unfinished(text: &str) -> Vec<String> {
    let code = code(text);
    let in_code = ["todo!", "unimplemented!"].map(|mark| (code.as_str(), mark));
    let in_text = [concat!("FIX", "ME"), concat!("TO", "DO"), concat!("XX", "X")];
    let marks = in_code.into_iter().chain(in_text.map(|mark| (text, mark)));
    let found = marks.flat_map(|(text, mark)| {
        text.match_indices(mark).map(move |(at, _)| format!("{}: {mark}", line_of(text, at)))
    });
    found.collect()
}

/// A scene's page says where it is from and what one may do with it.
pub(crate) fn unsourced(text: &str) -> Vec<String> {
    let text = text.to_lowercase();
    let source = complain(!text.contains("source"), "name the scene's source");
    let licence = ["licence", "license"].iter().any(|word| text.contains(word));
    [source, complain(!licence, "name the scene's licence")].concat()
}

/// A file that is too large for a place where people read.
pub(crate) fn is_blob(path: &str, bytes: u64) -> bool {
    bytes > BLOB_BYTES_MAX && !path.starts_with("scenes/")
}

fn complain(is_wrong: bool, complaint: impl Into<String>) -> Vec<String> {
    if is_wrong { vec![complaint.into()] } else { Vec::new() }
}

mod tests {
    use super::*;

    #[test]
    fn a_file_without_a_header_is_found() {
        assert!(header("//! Why.\n\nuse a;\n").is_empty());
        for text in ["use a;\n", "// Why.\n", "/// Why.\n", "//!\n", "//! Placeholder.\n", ""] {
            assert_eq!(header(text).len(), 1, "{text}");
        }
    }

    #[test]
    fn a_long_or_wide_file_is_found() {
        let tests = format!("#[cfg(test)]\nmod tests {{\n{}}}\n", "t;\n".repeat(600));
        assert!(size(&format!("{}{tests}", "x;\n".repeat(500))).is_empty());
        assert_eq!(size(&"x;\n".repeat(501)), ["501 lines; split it by idea"]);
        assert!(size(&format!("//{}", "é".repeat(98))).is_empty());
        let wide = format!("a\n  //{}", "é".repeat(97));
        assert_eq!(size(&wide), ["2: more than 100 columns"]);
    }

    #[test]
    fn a_silenced_lint_is_found() {
        assert!(silenced("#[expect(\n    a,\n    reason = \"b\"\n)]\nfn c() {}").is_empty());
        assert!(silenced("// #[allow(a)]\n").is_empty());
        assert_eq!(silenced("\n#[allow(a)]\n").len(), 1);
        assert_eq!(silenced("#![allow(a, reason = \"b\")]").len(), 1);
        assert_eq!(silenced("\n#[expect(a)]\nfn b() {}"), ["2: `expect` without a reason"]);
    }

    #[test]
    fn unfinished_code_is_found() {
        assert!(unfinished("// Every way ends in \"todo!\".").is_empty());
        assert_eq!(unfinished("fn a() {\n    todo!()\n}"), ["2: todo!"]);
        assert_eq!(unfinished("unimplemented!()").len(), 1);
        assert_eq!(unfinished(concat!("// FIX", "ME later")).len(), 1);
    }

    #[test]
    fn a_scene_of_unknown_origin_is_found() {
        assert!(unsourced("## Source\nus\n## Licence\nCC0").is_empty());
        assert_eq!(unsourced("A nice scene.").len(), 2);
    }

    #[test]
    fn a_blob_is_found() {
        assert!(!is_blob("src/a.rs", BLOB_BYTES_MAX));
        assert!(!is_blob("scenes/office/office.obj", BLOB_BYTES_MAX + 1));
        assert!(is_blob("docs/a.png", BLOB_BYTES_MAX + 1));
    }
}

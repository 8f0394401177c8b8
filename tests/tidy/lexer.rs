//! Just enough of Rust's lexical rules to tell code from comments and strings.

/// `source` with the insides of comments, strings and characters turned into spaces. Lines keep
/// their numbers.
pub(crate) fn code(source: &str) -> String {
    let chars: Vec<char> = source.chars().collect();
    let mut code = String::with_capacity(source.len());
    let mut position = 0;
    while position < chars.len() {
        let length = skipped(&chars[position..], chars[..position].last().copied());
        match length {
            0 => code.push(chars[position]),
            _ => code.extend(chars[position..position + length].iter().map(|&c| blank(c))),
        }
        position += length.max(1);
    }
    code
}

/// The part of `code` above the tests at the end of a file.
pub(crate) fn above_tests(code: &str) -> &str {
    let tail = code.match_indices("#[cfg(test)]").find(|(at, mark)| {
        let rest = code[at + mark.len()..].trim_start();
        rest.starts_with("mod ") || rest.starts_with("#[")
    });
    tail.map_or(code, |(at, _)| &code[..at])
}

/// Modules of `code` that are there for tests alone and lie in files of their own.
pub(crate) fn test_modules(code: &str) -> impl Iterator<Item = &str> {
    code.split("#[cfg(test)]").skip(1).filter_map(|rest| {
        let declared = rest.trim_start().strip_prefix("mod ")?;
        let (name, _) = declared.split_once(';')?;
        name.chars().all(is_identifier).then_some(name)
    })
}

/// Identifiers of `code`, each with the text that follows it.
pub(crate) fn identifiers(code: &str) -> impl Iterator<Item = (&str, &str)> {
    let mut rest = code;
    std::iter::from_fn(move || {
        rest = rest.trim_start_matches(|c| !is_identifier(c));
        let end = rest.find(|c| !is_identifier(c)).unwrap_or(rest.len());
        let (identifier, after) = rest.split_at(end);
        rest = after;
        (end > 0).then_some((identifier, after))
    })
}

/// The line of `text`, from 1, at byte `at`.
pub(crate) fn line_of(text: &str, at: usize) -> usize {
    text[..at].matches('\n').count() + 1
}

fn is_identifier(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn blank(c: char) -> char {
    if c == '\n' { '\n' } else { ' ' }
}

/// How many characters at the start of `rest` are no code; `before` is the one before it.
fn skipped(rest: &[char], before: Option<char>) -> usize {
    match rest {
        ['/', '/', ..] => rest.iter().position(|&c| c == '\n').unwrap_or(rest.len()),
        ['/', '*', ..] => block_comment(rest),
        ['"', ..] => quoted(rest, '"'),
        ['r', '"' | '#', ..] if !before.is_some_and(|c| is_identifier(c) && c != 'b') => raw(rest),
        ['\'', '\\', ..] | ['\'', _, '\'', ..] => quoted(rest, '\''),
        _ => 0,
    }
}

fn block_comment(rest: &[char]) -> usize {
    let (mut depth, mut position) = (0, 0);
    while position < rest.len() {
        match rest[position..] {
            ['/', '*', ..] => (depth, position) = (depth + 1, position + 2),
            ['*', '/', ..] => (depth, position) = (depth - 1, position + 2),
            _ => position += 1,
        }
        if depth == 0 {
            break;
        }
    }
    position
}

fn quoted(rest: &[char], quote: char) -> usize {
    let mut position = 1;
    while position < rest.len() && rest[position] != quote {
        position += if rest[position] == '\\' { 2 } else { 1 };
    }
    (position + 1).min(rest.len())
}

/// A raw string; 0 if it is a raw identifier.
fn raw(rest: &[char]) -> usize {
    let hashes = rest[1..].iter().take_while(|&&c| c == '#').count();
    if rest.get(1 + hashes) != Some(&'"') {
        return 0;
    }
    let is_end = |tail: &[char]| tail[0] == '"' && tail[1..].iter().all(|&c| c == '#');
    let inside = &rest[2 + hashes..];
    let end = inside.windows(1 + hashes).position(is_end);
    end.map_or(rest.len(), |end| 3 + 2 * hashes + end)
}

mod tests {
    use super::*;

    #[test]
    fn comments_and_strings_are_no_code() {
        for (source, expected) in [
            ("a // b\nc", "a     \nc"),
            ("a /* b /* c */ d */ e", "a                   e"),
            (r#"f("x \" y") + z"#, "f(        ) + z"),
            ("r#\"a \" b\"# + c", "           + c"),
            ("br\"x\" + r#type", "b     + r#type"),
            ("'x' + '\\'' + 'a: b", "    +      + 'a: b"),
            ("for_r\"\"", "for_r  "),
        ] {
            assert_eq!(code(source), expected, "{source}");
        }
    }

    #[test]
    fn tests_at_the_end_are_found() {
        assert_eq!(above_tests("a\n#[cfg(test)]\nmod tests {}"), "a\n");
        assert_eq!(above_tests("a\n#[cfg(test)]\nuse b;\nc"), "a\n#[cfg(test)]\nuse b;\nc");
    }

    #[test]
    fn modules_for_tests_are_found() {
        let code = "mod a;\n#[cfg(test)]\nmod b;\n#[cfg(test)]\nmod c {\n    d;\n}\nmod e;";
        assert_eq!(test_modules(code).collect::<Vec<_>>(), ["b"]);
    }

    #[test]
    fn identifiers_come_with_what_follows() {
        let found: Vec<_> = identifiers("std::fs(x_1)").collect();
        assert_eq!(found, [("std", "::fs(x_1)"), ("fs", "(x_1)"), ("x_1", ")")]);
    }
}

//! Cores and light see no file, socket, thread, process or clock, and nothing whose order differs
//! from run to run.

use super::lexer::{above_tests, code, identifiers, line_of};

/// Modules of `std` that reach outside.
const MODULES: [&str; 5] = ["env", "fs", "net", "process", "thread"];

/// Types and macros that reach outside, or that differ from run to run.
const ITEMS: [&str; 8] =
    ["HashMap", "HashSet", "Instant", "RandomState", "SystemTime", "eprintln", "println", "stdout"];

/// What a pure file must not mention, its tests aside.
pub(crate) fn impure(text: &str) -> Vec<String> {
    let code = code(text);
    let code = above_tests(&code);
    let reaching = identifiers(code).filter(|(name, after)| {
        ITEMS.contains(name) || (MODULES.contains(name) && is_module(code, name, after))
    });
    let complaint = |(name, after): (&str, &str)| {
        format!("{}: `{name}` belongs to the edges", line_of(code, code.len() - after.len()))
    };
    reaching.map(complaint).collect()
}

/// Whether `name` is a module here, and no field or variable of that name.
fn is_module(code: &str, name: &str, after: &str) -> bool {
    let before = &code[..code.len() - after.len() - name.len()];
    after.starts_with("::") || before.ends_with("std::")
}

mod tests {
    use super::*;

    #[test]
    fn impure_code_is_found() {
        for text in [
            "use std::fs;",
            "fn a() { fs::read(b) }",
            "use std::time::Instant;",
            "std::thread::spawn(a);",
            "let a: HashMap<B, C>;",
            "println!()",
        ] {
            assert_eq!(impure(text).len(), 1, "{text}");
        }
        assert_eq!(impure("\nuse std::net::IpAddr;"), ["2: `net` belongs to the edges"]);
    }

    #[test]
    fn pure_code_passes() {
        for text in [
            "use std::time::Duration;",
            "let process = self.thread + net;",
            "// std::fs is for edges",
            "a();\n#[cfg(test)]\nmod tests {\n    use std::fs;\n}",
        ] {
            assert!(impure(text).is_empty(), "{text}");
        }
    }
}

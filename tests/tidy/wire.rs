//! Every message on the wire is converted to a type of our own, and so checked, by proto's sources.

use super::lexer::{code, identifiers};

/// Messages defined in `definition` that `sources` never mention.
pub(crate) fn unconverted(definition: &str, sources: &str) -> Vec<String> {
    let sources = code(sources);
    let mentioned = |message: &str| identifiers(&sources).any(|(name, _)| name == message);
    let missing = messages(definition).into_iter().filter(|message| !mentioned(message));
    missing.map(|message| format!("message {message} is converted nowhere")).collect()
}

fn messages(definition: &str) -> Vec<String> {
    let code = code(definition);
    let mut names = Vec::new();
    let mut declares = false;
    for (word, after) in identifiers(&code) {
        if declares && after.trim_start().starts_with('{') {
            names.push(word.to_owned());
        }
        declares = word == "message";
    }
    names
}

mod tests {
    use super::*;

    #[test]
    fn a_message_that_nobody_reads_is_found() {
        let definition = "// message Old {}\nmessage Hello { string message = 1; }\nmessage Bye {}";
        assert_eq!(messages(definition), ["Hello", "Bye"]);
        let sources = "impl TryFrom<wire::Hello> for Hello {} // Bye";
        assert_eq!(unconverted(definition, sources), ["message Bye is converted nowhere"]);
    }
}

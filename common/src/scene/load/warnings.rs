//! What is odd about a scene but does not keep it from being rendered.

/// Most warnings that are kept; a broken exporter repeats itself a million times.
const WARNINGS_MAX: usize = 100;

/// Messages for the user, in the order in which they arose, each once.
#[derive(Debug, Default)]
pub(super) struct Warnings {
    messages: Vec<String>,
    omitted: usize,
}

impl Warnings {
    /// Notes a message, unless it has been noted already.
    pub(super) fn push(&mut self, message: String) {
        if self.messages.contains(&message) {
            return;
        }
        if self.messages.len() < WARNINGS_MAX {
            self.messages.push(message);
        } else {
            self.omitted += 1;
        }
    }

    /// All messages; the last one tells how many there was no room for.
    pub(super) fn into_messages(mut self) -> Vec<String> {
        if self.omitted > 0 {
            self.messages.push(format!("… and {} more warnings", self.omitted));
        }
        self.messages
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repetitions_and_floods_are_cut() {
        let mut warnings = Warnings::default();
        for number in 0..150 {
            warnings.push(format!("warning {number}"));
            warnings.push("again".into());
        }
        let messages = warnings.into_messages();
        assert_eq!(messages.len(), WARNINGS_MAX + 1);
        assert_eq!(messages.last().unwrap(), "… and 51 more warnings");
    }
}

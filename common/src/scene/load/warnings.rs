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

    /// Notes these messages.
    pub(super) fn extend(&mut self, messages: impl IntoIterator<Item = String>) {
        messages.into_iter().for_each(|message| self.push(message));
    }

    /// All messages; the last one tells how many there was no room for.
    pub(super) fn into_messages(mut self) -> Vec<String> {
        if self.omitted > 0 {
            self.messages.push(format!("… and {} more warnings", self.omitted));
        }
        self.messages
    }
}

/// Says that triangles of an object are left out, if some are.
pub(super) fn bad_vertices(file: &str, object: &str, count: u64) -> Option<String> {
    let problem = "triangles with infinite, NaN or huge vertices are left out";
    (count > 0).then(|| format!("{file}: object \"{object}\": {count} {problem}"))
}

/// Says that texture coordinates are replaced, if some are.
pub(super) fn lost_texcoords(file: &str, count: u64) -> Option<String> {
    let problem = "texture coordinates that are infinite, NaN or huge count as 0 0";
    (count > 0).then(|| format!("{file}: {count} {problem}"))
}

/// Says that triangles without area are left out, if some are.
pub(super) fn degenerate(count: u64) -> Option<String> {
    (count > 0).then(|| format!("{count} degenerate triangles are left out"))
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

//! Where a worker says what its user should know: lines of text, few and far between.

use std::fmt;
use std::sync::Arc;

/// Takes one line at a time. Cheap to clone; all clones write to the same place.
#[derive(Clone)]
pub struct Log(Arc<dyn Fn(&str) + Send + Sync>);

impl Log {
    /// Hands every line to `write`, from any thread.
    pub fn new(write: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self(Arc::new(write))
    }

    /// Writes to the standard error output.
    #[must_use]
    pub fn to_stderr() -> Self {
        Self::new(|line| eprintln!("equilux worker: {line}"))
    }

    /// Says nothing.
    #[must_use]
    pub fn silent() -> Self {
        Self::new(|_| {})
    }

    pub(crate) fn say(&self, line: impl fmt::Display) {
        (self.0)(&line.to_string());
    }
}

impl fmt::Debug for Log {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Log")
    }
}

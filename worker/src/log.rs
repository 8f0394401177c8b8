//! Where a worker says what its user should know: lines of text, few and far between.

use std::fmt;
use std::io::{self, Write};
use std::sync::Arc;

/// Takes one line at a time. Cheap to clone; all clones write to the same place.
#[derive(Clone)]
pub struct Log {
    write: Arc<dyn Fn(&str) + Send + Sync>,
    /// Whether it takes warnings alone.
    is_quiet: bool,
}

impl Log {
    /// Hands every line to `write`, from any thread.
    pub fn new(write: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self { write: Arc::new(write), is_quiet: false }
    }

    /// Writes to the standard error output.
    #[must_use]
    pub fn to_stderr() -> Self {
        Self::new(|line| write(io::stderr().lock(), line))
    }

    /// Says nothing.
    #[must_use]
    pub fn silent() -> Self {
        Self::new(|_| {})
    }

    /// Takes warnings alone from now on.
    #[must_use]
    pub fn quiet(self) -> Self {
        Self { is_quiet: true, ..self }
    }

    /// What is good to know, and comes right by itself.
    pub(crate) fn say(&self, line: impl fmt::Display) {
        if !self.is_quiet {
            self.warn(line);
        }
    }

    /// What the user should see to.
    pub(crate) fn warn(&self, line: impl fmt::Display) {
        (self.write)(&line.to_string());
    }
}

impl fmt::Debug for Log {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Log")
    }
}

/// Writes a line. Where nobody reads any more, the work goes on without.
fn write(mut output: impl Write, line: &str) {
    let _not_read = writeln!(output, "equilux worker: {line}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Lines;

    struct Closed;

    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::BrokenPipe.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn lines_that_nobody_reads_are_lost_and_nothing_else() {
        let mut output = Vec::new();
        write(&mut output, "it goes on");
        assert_eq!(output, b"equilux worker: it goes on\n");
        write(Closed, "it goes on");
    }

    #[test]
    fn who_is_quiet_still_warns() {
        let lines = Lines::default();
        for log in [lines.log(), lines.log().quiet()] {
            log.say("news");
            log.warn("a warning");
        }
        assert_eq!(lines.all(), ["news", "a warning", "a warning"]);
    }
}

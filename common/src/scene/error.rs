//! What can be wrong with a scene: always a place in a file, what is wrong there, and what to do.

use std::fmt;

use super::files::{InvalidPack, ReadError};

/// Where something was found: a file, and a line of it where one is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file's name as the user would write it.
    pub file: String,
    /// Counted from 1.
    pub line: Option<usize>,
}

impl Place {
    /// A whole file.
    #[must_use]
    pub fn file(file: &str) -> Self {
        Self { file: file.to_owned(), line: None }
    }

    /// A line of a file, counted from 1.
    #[must_use]
    pub fn line(file: &str, line: usize) -> Self {
        Self { file: file.to_owned(), line: Some(line) }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            Some(line) => write!(f, "{}:{line}", self.file),
            None => f.write_str(&self.file),
        }
    }
}

/// A scene that cannot be rendered.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene file itself cannot be read.
    #[error(transparent)]
    Unreadable(#[from] ReadError),
    /// A file that the scene refers to cannot be read.
    #[error("{place}: {cause}")]
    Unreachable {
        /// What refers to it.
        place: Place,
        /// Why it cannot be read.
        cause: ReadError,
    },
    /// The name says nothing that a reader understands.
    #[error("{place}: \"{file}\" is neither a scene (.json) nor a model (.obj, .ply)")]
    UnknownFormat {
        /// What names the file.
        place: Place,
        /// The file.
        file: String,
    },
    /// Text that breaks the rules of its format.
    #[error("{place}: {problem}")]
    Malformed {
        /// Where.
        place: Place,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A key that means nothing.
    #[error("{place}: unknown key \"{key}\"{}", suggestion(.nearest.as_deref()))]
    UnknownKey {
        /// Where.
        place: Place,
        /// The key with the path to it.
        key: String,
        /// The known key that is most like it.
        nearest: Option<String>,
    },
    /// A key that must be there is not.
    #[error("{place}: \"{key}\" is missing; {remedy}")]
    MissingKey {
        /// Where.
        place: Place,
        /// The key with the path to it.
        key: String,
        /// What to write.
        remedy: &'static str,
    },
    /// A value of the wrong type or out of its range.
    #[error("{place}: {field}: {problem}")]
    InvalidValue {
        /// Where.
        place: Place,
        /// The field with the path to it.
        field: String,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A name that refers to nothing.
    #[error("{place}: there is no {kind} \"{name}\"{}", suggestion(.nearest.as_deref()))]
    UnknownName {
        /// Where.
        place: Place,
        /// What kind of thing it should name.
        kind: &'static str,
        /// The name.
        name: String,
        /// The known name that is most like it.
        nearest: Option<String>,
    },
    /// An image that cannot be used.
    #[error("{place}: texture \"{file}\": {problem}")]
    InvalidTexture {
        /// What refers to it.
        place: Place,
        /// The image.
        file: String,
        /// What is wrong and what to do.
        problem: String,
    },
    /// Nothing to render.
    #[error("{place}: {problem}")]
    Empty {
        /// The file.
        place: Place,
        /// What it lacks and what to do.
        problem: String,
    },
    /// More than this program takes on.
    #[error("{place}: {problem}")]
    TooLarge {
        /// The file.
        place: Place,
        /// Which limit is exceeded and what to do.
        problem: String,
    },
    /// A temporary file that cannot be written.
    #[error("{path}: cannot be written: {cause}; make room there, or name another directory")]
    Unwritable {
        /// The file.
        path: String,
        /// Why.
        cause: std::io::Error,
    },
    /// The files cannot be put together into a pack.
    #[error("cannot pack the scene: {0}")]
    Unpackable(#[from] InvalidPack),
}

fn suggestion(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |name| format!("; did you mean \"{name}\"?"))
}

/// Of `known` the name most like `name`, unless none is like it at all.
#[must_use]
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    const ALIKE: f64 = 0.6;
    let wanted = name.to_lowercase();
    let mut best: Option<(f64, &str)> = None;
    for candidate in known {
        let likeness = strsim::jaro_winkler(&wanted, &candidate.to_lowercase());
        if likeness >= ALIKE && best.is_none_or(|(most, _)| likeness > most) {
            best = Some((likeness, candidate));
        }
    }
    best.map(|(_, candidate)| candidate.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_finger_is_recognized_and_nonsense_is_not() {
        let known = ["camera", "film", "integrator"];
        assert_eq!(nearest("camrea", known).as_deref(), Some("camera"));
        assert_eq!(nearest("Film", known).as_deref(), Some("film"));
        assert_eq!(nearest("xyzzy", known), None);
    }

    #[test]
    fn messages_name_file_line_and_remedy() {
        let error = SceneError::UnknownKey {
            place: Place::line("a.json", 3),
            key: "film.widht".into(),
            nearest: Some("width".into()),
        };
        assert_eq!(
            error.to_string(),
            "a.json:3: unknown key \"film.widht\"; did you mean \"width\"?"
        );
    }
}

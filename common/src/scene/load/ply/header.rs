//! The header of a PLY file: what its body holds, line by line.

use super::scalar::{ByteOrder, Scalar};
use crate::scene::error::{Place, SceneError, nearest};
use crate::scene::files::{OpenFile, Scan};

/// Longest line; comments are the longest, and no program writes ones like this.
const LINE_BYTES_MAX: usize = 65_536;

/// Most lines, elements and properties together.
const LINES_MAX: usize = 65_536;

/// What a PLY file says about itself.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    /// In the order in which they follow.
    pub(super) elements: Vec<Element>,
    /// Where in the file the first of them begins.
    pub(super) body_offset: u64,
}

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary(ByteOrder),
}

/// Things of one kind.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
    /// The line of the header that begins it.
    pub(super) line: usize,
}

/// What each thing of a kind has.
#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) line: usize,
}

/// One number, or a number of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Single(Scalar),
    List { length: Scalar, item: Scalar },
}

impl Header {
    /// Reads the header of the file called `file`.
    pub(super) fn read(file: &str, opened: &OpenFile<'_>) -> Result<Self, SceneError> {
        let mut lines = Lines { file, scan: Scan::new(opened, 0), line: 0 };
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        lines.check_magic()?;
        loop {
            let text = lines.next()?;
            let mut words = text.split_whitespace();
            let key = words.next().unwrap_or("");
            let words: Vec<&str> = words.collect();
            match (key, &words[..]) {
                ("" | "comment" | "obj_info", _) => {}
                ("end_header", []) => break,
                ("format", words) => encoding = Some(lines.encoding(words)?),
                ("element", words) => {
                    let element = lines.element(words, &elements)?;
                    elements.push(element);
                }
                ("property", words) => lines.property(words, elements.last_mut())?,
                _ => {
                    let problem = format!("\"{text}\" means nothing in the header of a PLY file");
                    return Err(lines.malformed(problem));
                }
            }
        }
        let encoding = encoding.ok_or_else(|| lines.malformed("no line \"format …\"".into()))?;
        let header = Self { encoding, elements, body_offset: lines.scan.offset() };
        header.check_counts(file, lines.scan.remaining())?;
        Ok(header)
    }

    /// Whether as much as is claimed can be there at all.
    fn check_counts(&self, file: &str, body_bytes: u64) -> Result<(), SceneError> {
        let mut left = u128::from(body_bytes);
        for element in &self.elements {
            let row = element.least_bytes(self.encoding);
            // The last number of a text needs no space behind it.
            let needed = u128::from(element.count) * u128::from(row);
            let slack = u128::from(self.encoding == Encoding::Ascii);
            if needed > left + slack {
                return Err(SceneError::Malformed {
                    place: Place::line(file, element.line),
                    problem: format!(
                        "{} × \"{}\" take {needed} bytes or more, and {left} are there: the file \
                         is cut short, or the count is wrong; get the whole file",
                        element.count, element.name
                    ),
                });
            }
            left = left.saturating_sub(needed);
        }
        Ok(())
    }
}

impl Element {
    /// The length of each in a binary file, unless it varies.
    pub(super) fn fixed_bytes(&self) -> Option<u64> {
        let bytes = self.properties.iter().map(|property| match property.kind {
            Kind::Single(scalar) => Some(scalar.byte_count() as u64),
            Kind::List { .. } => None,
        });
        bytes.sum()
    }

    /// The least length that each can have.
    pub(super) fn least_bytes(&self, encoding: Encoding) -> u64 {
        let least = |property: &Property| match (encoding, property.kind) {
            // A digit and a space.
            (Encoding::Ascii, _) => 2,
            (_, Kind::Single(scalar) | Kind::List { length: scalar, .. }) => {
                scalar.byte_count() as u64
            }
        };
        self.properties.iter().map(least).sum()
    }
}

/// Goes over the lines of a header.
struct Lines<'a> {
    file: &'a str,
    scan: Scan<'a>,
    line: usize,
}

impl Lines<'_> {
    fn malformed(&self, problem: String) -> SceneError {
        SceneError::Malformed { place: Place::line(self.file, self.line), problem }
    }

    fn check_magic(&mut self) -> Result<(), SceneError> {
        let first = self.scan.line(LINE_BYTES_MAX)?;
        if first.map(<[u8]>::trim_ascii_end) == Some(b"ply") {
            self.line = 1;
            return Ok(());
        }
        Err(SceneError::Malformed {
            place: Place::file(self.file),
            problem: "is not a PLY file: it does not begin with the line \"ply\"".into(),
        })
    }

    fn next(&mut self) -> Result<String, SceneError> {
        self.line += 1;
        let line = self.scan.line(LINE_BYTES_MAX)?;
        let Some(line) = line.filter(|line| line.len() <= LINE_BYTES_MAX) else {
            return Err(self.malformed("the header does not end; get the whole file".into()));
        };
        let text = String::from_utf8_lossy(line).trim().to_owned();
        if self.line > LINES_MAX {
            return Err(self.malformed(format!("the header has more than {LINES_MAX} lines")));
        }
        Ok(text)
    }

    fn encoding(&self, words: &[&str]) -> Result<Encoding, SceneError> {
        const FORMATS: &str = "\"ascii\", \"binary_little_endian\" or \"binary_big_endian\"";
        match words {
            ["ascii", "1.0"] => Ok(Encoding::Ascii),
            ["binary_little_endian", "1.0"] => Ok(Encoding::Binary(ByteOrder::Little)),
            ["binary_big_endian", "1.0"] => Ok(Encoding::Binary(ByteOrder::Big)),
            _ => {
                let format = words.join(" ");
                Err(self.malformed(format!("format \"{format}\" is none of {FORMATS}, each 1.0")))
            }
        }
    }

    fn element(&self, words: &[&str], others: &[Element]) -> Result<Element, SceneError> {
        let [name, count] = words else {
            return Err(self.malformed("write \"element NAME COUNT\"".into()));
        };
        let Ok(count) = count.parse() else {
            return Err(self.malformed(format!("\"{count}\" is not a count of elements")));
        };
        if others.iter().any(|other| other.name == *name) {
            return Err(self.malformed(format!("element \"{name}\" is there twice")));
        }
        let name = (*name).to_owned();
        Ok(Element { name, count, properties: Vec::new(), line: self.line })
    }

    fn property(&self, words: &[&str], element: Option<&mut Element>) -> Result<(), SceneError> {
        let Some(element) = element else {
            return Err(self.malformed("a property before the first element".into()));
        };
        let (kind, name) = match words {
            ["list", length, item, name] => {
                let (length, item) = (self.scalar(length)?, self.scalar(item)?);
                if !length.is_whole() {
                    return Err(self.malformed("the length of a list must be a whole type".into()));
                }
                (Kind::List { length, item }, name)
            }
            [scalar, name] => (Kind::Single(self.scalar(scalar)?), name),
            _ => {
                let problem = "write \"property TYPE NAME\" or \"property list TYPE TYPE NAME\"";
                return Err(self.malformed(problem.into()));
            }
        };
        if element.properties.iter().any(|other| other.name == *name) {
            return Err(self.malformed(format!("property \"{name}\" is there twice")));
        }
        element.properties.push(Property { name: (*name).to_owned(), kind, line: self.line });
        Ok(())
    }

    fn scalar(&self, name: &str) -> Result<Scalar, SceneError> {
        Scalar::named(name).ok_or_else(|| SceneError::UnknownName {
            place: Place::line(self.file, self.line),
            kind: "type of numbers",
            name: name.to_owned(),
            nearest: nearest(name, Scalar::names()),
        })
    }
}

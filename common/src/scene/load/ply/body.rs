//! The body of a PLY file: elements one after another, each number as its property says.

use super::header::{Element, Encoding, Header, Kind};
use super::scalar::Scalar;
use crate::scene::error::{Place, SceneError};
use crate::scene::files::{OpenFile, Scan};

/// Longest number in a text.
const WORD_BYTES_MAX: usize = 64;

/// Most bytes of white space that are taken for the end of the last line.
const TAIL_BYTES_MAX: usize = 64;

/// What is wrong with a file that is shorter than its header says.
const ENDS: &str = "the file ends here: it was cut short, or its header counts too many; get the \
                    whole file, or make it anew";

/// What is wrong where something cannot be what the header says.
const MISFIT: &str = "the header does not fit what follows, or the file is damaged; make it anew";

/// A place in the body.
#[derive(Debug)]
pub(super) struct Body<'a> {
    file: &'a str,
    header: &'a Header,
    opened: &'a OpenFile<'a>,
    pub(super) scan: Scan<'a>,
    /// Where in the file the element begins that is being read.
    begun: u64,
    /// The element that is next.
    element: usize,
    /// How many of its kind have been read.
    pub(super) number: u64,
}

impl<'a> Body<'a> {
    /// Stands at the first element of the file called `file`.
    pub(super) fn new(file: &'a str, header: &'a Header, opened: &'a OpenFile<'a>) -> Self {
        let scan = Scan::new(opened, header.body_offset);
        Self { file, header, opened, scan, begun: header.body_offset, element: 0, number: 0 }
    }

    /// Notes that an element begins here.
    #[inline]
    pub(super) const fn begin(&mut self) {
        self.begun = self.scan.offset();
    }

    /// How numbers are written.
    pub(super) const fn encoding(&self) -> Encoding {
        self.header.encoding
    }

    /// Goes to the first of a kind of elements.
    pub(super) fn enter(&mut self, element: usize) -> Result<&'a Element, SceneError> {
        if (element, 0) < (self.element, self.number) {
            self.scan.go_to(self.header.body_offset);
            (self.element, self.number) = (0, 0);
        }
        let elements = &self.header.elements;
        while self.element < element {
            self.pass(&elements[self.element])?;
            (self.element, self.number) = (self.element + 1, 0);
        }
        Ok(&elements[element])
    }

    /// Passes over what is left and checks that nothing follows it.
    pub(super) fn finish(mut self) -> Result<(), SceneError> {
        while let Some(element) = self.header.elements.get(self.element) {
            self.pass(element)?;
            (self.element, self.number) = (self.element + 1, 0);
        }
        if self.header.encoding == Encoding::Ascii {
            self.skip_space()?;
        }
        let left = self.scan.remaining();
        if left == 0 {
            return Ok(());
        }
        let tail = self.scan.peek(TAIL_BYTES_MAX)?;
        let is_tail = left <= TAIL_BYTES_MAX as u64;
        if is_tail && tail.trim_ascii().is_empty() {
            return Ok(());
        }
        let problem = format!(
            "{left} bytes follow the last element, from byte {} on: the counts in the header are \
             too small, or the file was damaged on its way; make it anew",
            self.scan.offset()
        );
        Err(SceneError::Malformed { place: self.place(), problem })
    }

    /// Passes over the rest of a kind of elements.
    fn pass(&mut self, element: &Element) -> Result<(), SceneError> {
        let left = element.count - self.number;
        self.begin();
        if let (Encoding::Binary(_), Some(bytes)) = (self.header.encoding, element.fixed_bytes()) {
            let is_there = bytes.checked_mul(left).is_some_and(|all| self.scan.skip(all));
            return if is_there { Ok(()) } else { Err(self.malformed(ENDS)) };
        }
        while self.number < element.count && !element.properties.is_empty() {
            self.begin();
            for property in &element.properties {
                self.skip(property.kind)?;
            }
            self.number += 1;
        }
        Ok(())
    }

    /// Passes over what one property has.
    pub(super) fn skip(&mut self, kind: Kind) -> Result<(), SceneError> {
        let (item, count) = match kind {
            Kind::Single(scalar) => (scalar, 1),
            Kind::List { length, item } => (item, self.length(length)?),
        };
        if let Encoding::Binary(_) = self.header.encoding {
            let bytes = count.checked_mul(item.byte_count() as u64);
            let is_there = bytes.is_some_and(|bytes| self.scan.skip(bytes));
            return if is_there { Ok(()) } else { Err(self.malformed(ENDS)) };
        }
        for _ in 0..count {
            self.scalar(item)?;
        }
        Ok(())
    }

    /// Reads the length of a list.
    pub(super) fn length(&mut self, scalar: Scalar) -> Result<u64, SceneError> {
        let length = self.whole(scalar)?;
        u64::try_from(length)
            .map_err(|_| self.malformed(&format!("a list of {length} items cannot be: {MISFIT}")))
    }

    /// Reads a number.
    pub(super) fn scalar(&mut self, scalar: Scalar) -> Result<f64, SceneError> {
        if let Encoding::Binary(order) = self.header.encoding {
            return match self.scan.take(scalar.byte_count())? {
                Some(bytes) => Ok(scalar.decode(order, bytes)),
                None => Err(self.malformed(ENDS)),
            };
        }
        self.word()
    }

    /// Reads a whole number.
    pub(super) fn whole(&mut self, scalar: Scalar) -> Result<i64, SceneError> {
        if let Encoding::Binary(order) = self.header.encoding {
            return match self.scan.take(scalar.byte_count())? {
                Some(bytes) => Ok(scalar.decode_whole(order, bytes)),
                None => Err(self.malformed(ENDS)),
            };
        }
        let number = self.word()?;
        if number.fract() != 0.0 || number.abs() >= i64::MAX as f64 {
            return Err(self.malformed(&format!("{number} is not a whole number: {MISFIT}")));
        }
        Ok(number as i64)
    }

    /// Goes on to what is no white space.
    fn skip_space(&mut self) -> Result<(), SceneError> {
        loop {
            let ahead = self.scan.peek(WORD_BYTES_MAX)?;
            let space = ahead.iter().take_while(|byte| byte.is_ascii_whitespace()).count();
            if space == 0 {
                return Ok(());
            }
            self.scan.skip(space as u64);
        }
    }

    /// Reads a number of a text.
    fn word(&mut self) -> Result<f64, SceneError> {
        self.skip_space()?;
        let ahead = self.scan.peek(WORD_BYTES_MAX)?;
        if ahead.is_empty() {
            return Err(self.malformed(ENDS));
        }
        let ahead = &ahead[..ahead.len().min(WORD_BYTES_MAX)];
        let end = ahead.iter().position(u8::is_ascii_whitespace).unwrap_or(ahead.len());
        if end == WORD_BYTES_MAX {
            return Err(self.malformed("a number has too many digits; write it with fewer"));
        }
        let word = String::from_utf8_lossy(&ahead[..end]);
        match word.parse() {
            Ok(number) => {
                self.scan.skip(end as u64);
                Ok(number)
            }
            Err(_) => {
                let problem = format!("\"{word}\" is not a number: {MISFIT}");
                Err(self.malformed(&problem))
            }
        }
    }

    /// Says what is wrong with the element that is being read.
    pub(super) fn malformed(&self, problem: &str) -> SceneError {
        let element = self.header.elements.get(self.element);
        let name = element.map_or("end", |element| &element.name);
        let at = match self.header.encoding {
            Encoding::Ascii => String::new(),
            Encoding::Binary(_) => format!(" at byte {}", self.begun),
        };
        let problem = format!("{name} {} (counted from 0){at}: {problem}", self.number);
        SceneError::Malformed { place: self.place(), problem }
    }

    /// Says that the file ends within the element that is being read.
    pub(super) fn ends(&self) -> SceneError {
        self.malformed(ENDS)
    }

    /// Where this stands: of a text, the line.
    fn place(&self) -> Place {
        let line = match self.header.encoding {
            Encoding::Ascii => line_at(self.opened, self.scan.offset()),
            Encoding::Binary(_) => None,
        };
        line.map_or_else(|| Place::file(self.file), |line| Place::line(self.file, line))
    }
}

/// The line of a text that goes on at `offset`, unless the file cannot be read again.
fn line_at(opened: &OpenFile<'_>, offset: u64) -> Option<usize> {
    let mut scan = Scan::new(opened, 0);
    let mut line = 1;
    while scan.offset() < offset {
        let left = usize::try_from(offset - scan.offset()).unwrap_or(usize::MAX);
        let ahead = scan.peek(1).ok()?;
        let ahead = &ahead[..ahead.len().min(left)];
        line += ahead.iter().filter(|&&byte| byte == b'\n').count();
        let passed = ahead.len() as u64;
        if passed == 0 {
            return None;
        }
        scan.skip(passed);
    }
    Some(line)
}

//! Going through a large file from front to back, with a piece of it in memory.

use super::ReadError;
use super::large::OpenFile;

/// How much is read at once: enough that the system's share in the cost does not count.
const BUFFER_BYTES: usize = 1 << 20;

/// A place in a file, moving forward.
#[derive(Debug)]
pub struct Scan<'a> {
    file: &'a OpenFile<'a>,
    buffer: Vec<u8>,
    /// The part of the buffer that is still ahead.
    at: usize,
    filled: usize,
    /// Where in the file the filled part of the buffer ends.
    read_offset: u64,
}

impl<'a> Scan<'a> {
    /// Stands at `offset`.
    #[must_use]
    pub fn new(file: &'a OpenFile<'a>, offset: u64) -> Self {
        Self { file, buffer: Vec::new(), at: 0, filled: 0, read_offset: offset }
    }

    /// Where it stands.
    #[must_use]
    pub const fn offset(&self) -> u64 {
        self.read_offset - (self.filled - self.at) as u64
    }

    /// How many bytes are ahead.
    #[must_use]
    pub const fn remaining(&self) -> u64 {
        self.file.byte_count().saturating_sub(self.offset())
    }

    /// Moves to `offset`.
    pub fn go_to(&mut self, offset: u64) {
        (self.at, self.filled, self.read_offset) = (0, 0, offset);
    }

    /// Moves on by `count` bytes and shows them; none, without moving, if fewer are ahead.
    ///
    /// # Errors
    /// If the file cannot be read.
    #[inline]
    pub fn take(&mut self, count: usize) -> Result<Option<&[u8]>, ReadError> {
        if self.filled - self.at < count && self.peek(count)?.len() < count {
            return Ok(None);
        }
        let start = self.at;
        self.at += count;
        Ok(Some(&self.buffer[start..self.at]))
    }

    /// What comes next: `count` bytes or more, fewer only at the end of the file.
    ///
    /// # Errors
    /// If the file cannot be read.
    #[inline]
    pub fn peek(&mut self, count: usize) -> Result<&[u8], ReadError> {
        if self.filled - self.at < count {
            self.fill(count)?;
        }
        Ok(&self.buffer[self.at..self.filled])
    }

    /// Moves on by `count` bytes; false, without moving, if fewer are ahead.
    #[inline]
    pub fn skip(&mut self, count: u64) -> bool {
        let buffered = self.filled - self.at;
        match usize::try_from(count) {
            Ok(count) if count <= buffered => self.at += count,
            _ if count <= self.remaining() => {
                self.read_offset += count - buffered as u64;
                (self.at, self.filled) = (0, 0);
            }
            _ => return false,
        }
        true
    }

    /// Moves past the next line and shows it without its end, `\n` or `\r\n`; none at the end of
    /// the file. A line of more than `bytes_max` is shown only as far as that, and then is not
    /// moved past.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn line(&mut self, bytes_max: usize) -> Result<Option<&[u8]>, ReadError> {
        let mut searched = 0;
        let (shown, taken) = loop {
            let ahead = self.peek(searched + 1)?;
            if let Some(found) = ahead[searched..].iter().position(|&byte| byte == b'\n') {
                break (searched + found, searched + found + 1);
            }
            let is_last = ahead.len() == searched;
            searched = ahead.len();
            match searched {
                0 => return Ok(None),
                _ if is_last => break (searched, searched),
                _ if searched > bytes_max => break (searched, 0),
                _ => {}
            }
        };
        let start = self.at;
        self.at += taken;
        let line = &self.buffer[start..start + shown];
        Ok(Some(line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// Brings `count` bytes into the buffer, or all that are left.
    #[cold]
    fn fill(&mut self, count: usize) -> Result<(), ReadError> {
        self.buffer.copy_within(self.at..self.filled, 0);
        (self.at, self.filled) = (0, self.filled - self.at);
        if self.buffer.len() < count.max(BUFFER_BYTES) {
            self.buffer.resize(count.max(BUFFER_BYTES).max(2 * self.buffer.len()), 0);
        }
        let left = self.file.byte_count().saturating_sub(self.read_offset);
        let room = self.buffer.len() - self.filled;
        let fresh = usize::try_from(left).map_or(room, |left| left.min(room));
        let end = self.filled + fresh;
        self.file.read_at(self.read_offset, &mut self.buffer[self.filled..end])?;
        self.filled = end;
        self.read_offset += fresh as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::files::LargeFile;
    use proptest::prelude::*;

    #[test]
    fn long_files_are_seen_whole() {
        let bytes: Vec<u8> = (0..3_000_000u32).map(|number| (number % 251) as u8).collect();
        let file = LargeFile::in_memory("a", bytes.as_slice().into());
        let opened = file.open().unwrap();
        let mut scan = Scan::new(&opened, 7);
        let mut seen = Vec::new();
        while let Some(piece) = scan.take(999).unwrap() {
            seen.extend_from_slice(piece);
        }
        seen.extend_from_slice(scan.peek(999).unwrap());
        assert_eq!(seen, bytes[7..]);
        assert!(scan.remaining() < 999 && !scan.skip(999));
        assert!(scan.skip(scan.remaining()));
        assert_eq!((scan.offset(), scan.remaining()), (3_000_000, 0));
        let mut scan = Scan::new(&opened, 0);
        assert!(scan.take(1).unwrap().is_some() && scan.skip(2_000_000));
        assert_eq!(scan.take(3).unwrap(), Some(&bytes[2_000_001..2_000_004]));
    }

    proptest! {
        #[test]
        fn lines_are_those_of_the_text(text in "[ab\r\n]{0,40}", pad in 0usize..3) {
            let text = format!("{}{text}", "x".repeat(pad * (BUFFER_BYTES - 5)));
            let file = LargeFile::in_memory("a", text.as_bytes().into());
            let opened = file.open().unwrap();
            let mut scan = Scan::new(&opened, 0);
            let mut lines = Vec::new();
            while let Some(line) = scan.line(usize::MAX).unwrap() {
                lines.push(String::from_utf8(line.to_vec()).unwrap());
            }
            // A lone carriage return at the very end is no line's end to `str::lines`.
            let expected: Vec<&str> =
                text.split_inclusive('\n').map(|line| line.strip_suffix('\n').unwrap_or(line))
                .map(|line| line.strip_suffix('\r').unwrap_or(line)).collect();
            prop_assert_eq!(lines, expected);
        }
    }
}

//! Rows of numbers in a binary file, all of one length.

use super::scalar::{ByteOrder, Scalar};
use crate::scene::load::json::single;

/// Which numbers of a row are used, and where they go.
#[derive(Clone, Debug)]
pub(in crate::scene::load) struct RowFormat {
    order: ByteOrder,
    byte_count: usize,
    /// Offset, type and place of each number that is used.
    numbers: Vec<(usize, Scalar, usize)>,
}

impl RowFormat {
    /// Rows of nothing yet.
    pub(super) const fn new(order: ByteOrder) -> Self {
        Self { order, byte_count: 0, numbers: Vec::new() }
    }

    /// Rows of this many numbers of single precision, little end first.
    pub(in crate::scene::load) fn packed(number_count: usize) -> Self {
        let mut format = Self::new(ByteOrder::Little);
        (0..number_count).for_each(|place| format.push(Scalar::Float32, Some(place)));
        format
    }

    /// Adds a number that goes to this place, if it is used.
    pub(super) fn push(&mut self, scalar: Scalar, place: Option<usize>) {
        self.numbers.extend(place.map(|place| (self.byte_count, scalar, place)));
        self.byte_count += scalar.byte_count();
    }

    /// How long a row is in the file.
    pub(in crate::scene::load) const fn byte_count(&self) -> usize {
        self.byte_count
    }

    /// How many of its numbers are used.
    pub(in crate::scene::load) const fn number_count(&self) -> usize {
        self.numbers.len()
    }

    /// Reads rows one after another, as many as `rows` has room for.
    pub(in crate::scene::load) fn decode_all(&self, bytes: &[u8], rows: &mut [f32]) {
        if self.is_packed() {
            for (number, bytes) in rows.iter_mut().zip(bytes.as_chunks().0) {
                *number = f32::from_le_bytes(*bytes);
            }
            return;
        }
        let rows = rows.chunks_exact_mut(self.number_count());
        rows.zip(bytes.chunks_exact(self.byte_count)).for_each(|(row, bytes)| {
            self.decode(bytes, row);
        });
    }

    /// Whether rows are what [`Self::packed`] says, as those of most files are.
    fn is_packed(&self) -> bool {
        let mut numbers = self.numbers.iter().enumerate();
        self.order == ByteOrder::Little
            && self.byte_count == 4 * self.numbers.len()
            && numbers.all(|(at, &number)| number == (4 * at, Scalar::Float32, at))
    }

    /// Reads one row.
    #[inline]
    pub(in crate::scene::load) fn decode(&self, bytes: &[u8], row: &mut [f32]) {
        for &(offset, scalar, place) in &self.numbers {
            row[place] = single(scalar.decode(self.order, &bytes[offset..]));
        }
    }
}

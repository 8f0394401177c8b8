//! How a manifest is spelled: its layout, its numbers, its hashes.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::Formatter;

/// Lists and objects are spread over lines down to this depth: the manifest's keys, and the entries
/// of its tables.
const SPREAD_DEPTH: usize = 2;

/// Writes JSON, in a form that is always the same.
pub(super) fn write(value: &impl Serialize) -> serde_json::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    value.serialize(&mut Serializer::with_formatter(&mut bytes, Layout::default()))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// A line per key of the manifest and per entry of its tables.
#[derive(Default)]
struct Layout {
    depth: usize,
    has_entries: bool,
}

impl Layout {
    fn open<W: ?Sized + Write>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth += 1;
        self.has_entries = false;
        writer.write_all(bracket)
    }

    fn close<W: ?Sized + Write>(&mut self, writer: &mut W, bracket: &[u8]) -> io::Result<()> {
        self.depth -= 1;
        if self.has_entries && self.depth < SPREAD_DEPTH {
            self.break_line(writer)?;
        }
        // What is around has at least what was closed.
        self.has_entries = true;
        writer.write_all(bracket)
    }

    fn separate<W: ?Sized + Write>(&mut self, writer: &mut W, is_first: bool) -> io::Result<()> {
        if !is_first {
            writer.write_all(b",")?;
        }
        match self.depth {
            0..=SPREAD_DEPTH => self.break_line(writer),
            _ if is_first => Ok(()),
            _ => writer.write_all(b" "),
        }
    }

    fn break_line<W: ?Sized + Write>(&self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b"\n")?;
        (0..self.depth).try_for_each(|_| writer.write_all(b"  "))
    }
}

impl Formatter for Layout {
    /// In double precision: whichever way a reader rounds the decimals, and ours may be an ulp off,
    /// what is nearest in single precision is the number that was written.
    fn write_f32<W: ?Sized + Write>(&mut self, writer: &mut W, value: f32) -> io::Result<()> {
        self.write_f64(writer, f64::from(value))
    }

    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.open(writer, b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.close(writer, b"]")
    }

    fn begin_array_value<W: ?Sized + Write>(
        &mut self,
        writer: &mut W,
        is_first: bool,
    ) -> io::Result<()> {
        self.separate(writer, is_first)
    }

    fn end_array_value<W: ?Sized + Write>(&mut self, _writer: &mut W) -> io::Result<()> {
        self.has_entries = true;
        Ok(())
    }

    fn begin_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.open(writer, b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.close(writer, b"}")
    }

    fn begin_object_key<W: ?Sized + Write>(
        &mut self,
        writer: &mut W,
        is_first: bool,
    ) -> io::Result<()> {
        self.separate(writer, is_first)
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b": ")
    }

    fn end_object_value<W: ?Sized + Write>(&mut self, _writer: &mut W) -> io::Result<()> {
        self.has_entries = true;
        Ok(())
    }
}

/// A hash in 64 hexadecimal digits.
pub(super) mod hex {
    use blake3::Hash;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(hash: &Hash, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&hash.to_hex())
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Hash, D::Error> {
        let digits = String::deserialize(from)?;
        Hash::from_hex(digits).map_err(|error| D::Error::custom(format!("hash: {error}")))
    }
}

/// A box as its least and its greatest corner.
pub(super) mod corners {
    use equilux_render::geometry::Bounds;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Least and greatest corner.
    pub(super) type Corners = [[f32; 3]; 2];

    pub(super) fn of(bounds: &Bounds) -> Corners {
        [bounds.lower.to_array(), bounds.upper.to_array()]
    }

    pub(super) fn bounds([lower, upper]: Corners) -> Bounds {
        Bounds { lower: lower.into(), upper: upper.into() }
    }

    pub(crate) fn serialize<S: Serializer>(it: &Bounds, serializer: S) -> Result<S::Ok, S::Error> {
        of(it).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Bounds, D::Error> {
        Corners::deserialize(from).map(bounds)
    }
}

/// Some of them.
pub(super) mod boxes {
    use equilux_render::geometry::Bounds;
    use serde::{Deserialize, Deserializer, Serializer};

    use super::corners::{self, Corners};

    pub(crate) fn serialize<S: Serializer>(
        it: &[Bounds],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(it.iter().map(corners::of))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Bounds>, D::Error> {
        let boxes = Vec::<Corners>::deserialize(from)?;
        Ok(boxes.into_iter().map(corners::bounds).collect())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde::Deserialize;

    use super::*;

    #[derive(Serialize, Deserialize)]
    struct Numbers {
        list: Vec<f32>,
        named: f32,
    }

    proptest! {
        #[test]
        fn every_number_comes_back_to_the_bit(
            bits in proptest::collection::vec(any::<u32>(), 500),
        ) {
            let all = bits.into_iter().map(f32::from_bits);
            // Whole numbers, short decimals and the ends of the range are where rounding is odd.
            let odd = [-0.0, f32::MIN_POSITIVE, 1e-45, f32::MAX, 16_777_217.0, 0.1, 8.5e-44];
            let list: Vec<f32> = all.filter(|number| number.is_finite()).chain(odd).collect();
            let numbers = Numbers { named: list[0], list };
            let read: Numbers = serde_json::from_slice(&write(&numbers).unwrap()).unwrap();
            let bits = |list: &[f32]| list.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(&read.list), bits(&numbers.list));
            prop_assert_eq!(read.named.to_bits(), numbers.named.to_bits());
        }
    }

    #[test]
    fn an_entry_has_a_line() {
        let value =
            serde_json::json!({"a": 1, "b": [{"c": [1, 2], "d": []}, {}], "e": [], "f": {}});
        let text = String::from_utf8(write(&value).unwrap()).unwrap();
        let expected = "{\n  \"a\": 1,\n  \"b\": [\n    {\"c\": [1, 2], \"d\": []},\n    {}\n  ],\n  \
                        \"e\": [],\n  \"f\": {}\n}\n";
        assert_eq!(text, expected);
    }
}

//! The types of numbers in a PLY file.

/// A type of number; its name is that of the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Int8,
    Uint8,
    Int16,
    Uint16,
    Int32,
    Uint32,
    Float32,
    Float64,
}

/// Names by type, those that are written today and those of 1994.
const NAMES: [(&str, &str, Scalar); 8] = [
    ("int8", "char", Scalar::Int8),
    ("uint8", "uchar", Scalar::Uint8),
    ("int16", "short", Scalar::Int16),
    ("uint16", "ushort", Scalar::Uint16),
    ("int32", "int", Scalar::Int32),
    ("uint32", "uint", Scalar::Uint32),
    ("float32", "float", Scalar::Float32),
    ("float64", "double", Scalar::Float64),
];

/// The order of a number's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    Little,
    Big,
}

impl Scalar {
    /// The type of that name.
    pub(super) fn named(name: &str) -> Option<Self> {
        let found = NAMES.iter().find(|(today, before, _)| name == *today || name == *before);
        found.map(|(_, _, scalar)| *scalar)
    }

    /// All names, for suggestions.
    pub(super) fn names() -> impl Iterator<Item = &'static str> {
        NAMES.iter().flat_map(|(today, before, _)| [*today, *before])
    }

    /// How many bytes such a number has.
    pub(super) const fn byte_count(self) -> usize {
        match self {
            Self::Int8 | Self::Uint8 => 1,
            Self::Int16 | Self::Uint16 => 2,
            Self::Int32 | Self::Uint32 | Self::Float32 => 4,
            Self::Float64 => 8,
        }
    }

    /// Whether such numbers are whole.
    pub(super) const fn is_whole(self) -> bool {
        !matches!(self, Self::Float32 | Self::Float64)
    }

    /// The number in the first bytes; all types fit double precision exactly.
    #[inline]
    pub(super) fn decode(self, order: ByteOrder, bytes: &[u8]) -> f64 {
        match self {
            Self::Float32 => f64::from(f32::from_bits(u32::from_ne_bytes(first(order, bytes)))),
            Self::Float64 => f64::from_bits(u64::from_ne_bytes(first(order, bytes))),
            _ => self.decode_whole(order, bytes) as f64,
        }
    }

    /// The whole number in the first bytes; of a type that is not whole, its bits.
    #[inline]
    pub(super) fn decode_whole(self, order: ByteOrder, bytes: &[u8]) -> i64 {
        match self {
            Self::Int8 => i64::from(i8::from_ne_bytes(first(order, bytes))),
            Self::Uint8 => i64::from(u8::from_ne_bytes(first(order, bytes))),
            Self::Int16 => i64::from(i16::from_ne_bytes(first(order, bytes))),
            Self::Uint16 => i64::from(u16::from_ne_bytes(first(order, bytes))),
            Self::Int32 => i64::from(i32::from_ne_bytes(first(order, bytes))),
            Self::Uint32 | Self::Float32 => i64::from(u32::from_ne_bytes(first(order, bytes))),
            Self::Float64 => i64::from_ne_bytes(first(order, bytes)),
        }
    }
}

/// The first bytes in the order of this machine.
#[inline]
fn first<const N: usize>(order: ByteOrder, bytes: &[u8]) -> [u8; N] {
    let mut number = [0; N];
    number.copy_from_slice(&bytes[..N]);
    if (order == ByteOrder::Big) != cfg!(target_endian = "big") {
        number.reverse();
    }
    number
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_all_types_are_read_in_both_orders() {
        for (name, bytes, number) in [
            ("char", (-5i8).to_le_bytes().to_vec(), -5.0),
            ("uchar", 200u8.to_le_bytes().to_vec(), 200.0),
            ("short", (-300i16).to_le_bytes().to_vec(), -300.0),
            ("ushort", 60_000u16.to_le_bytes().to_vec(), 60_000.0),
            ("int", (-70_000i32).to_le_bytes().to_vec(), -70_000.0),
            ("uint", 4_000_000_000u32.to_le_bytes().to_vec(), 4e9),
            ("float", 1.5f32.to_le_bytes().to_vec(), 1.5),
            ("double", (-1e300f64).to_le_bytes().to_vec(), -1e300),
        ] {
            let scalar = Scalar::named(name).unwrap();
            assert_eq!(scalar.byte_count(), bytes.len());
            let reversed: Vec<u8> = bytes.iter().rev().copied().collect();
            assert_eq!(scalar.decode(ByteOrder::Little, &bytes), number, "{name}");
            assert_eq!(scalar.decode(ByteOrder::Big, &reversed), number, "{name}");
        }
        assert_eq!(Scalar::named("float32"), Scalar::named("float"));
        assert_eq!(Scalar::named("quad"), None);
    }
}

//! Amounts of memory as people write them.

use std::fmt;
use std::str::FromStr;

/// A number of bytes, written as `64MiB`, `1.5GiB`, `500MB` or plain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bytes(pub(crate) u64);

/// What a unit stands for.
const UNITS: [(&str, u64); 9] = [
    ("kib", 1 << 10),
    ("mib", 1 << 20),
    ("gib", 1 << 30),
    ("tib", 1 << 40),
    ("kb", 1_000),
    ("mb", 1_000_000),
    ("gb", 1_000_000_000),
    ("tb", 1_000_000_000_000),
    ("b", 1),
];

impl FromStr for Bytes {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let lower = text.trim().to_lowercase();
        let unit =
            UNITS.iter().find_map(|(unit, factor)| Some((lower.strip_suffix(unit)?, factor)));
        let (number, factor) = unit.unwrap_or((&lower, &1));
        let number: Option<f64> = number.trim().parse().ok();
        let bytes = number.map(|number| number * *factor as f64);
        match bytes {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
            Some(bytes) if bytes >= 1.0 && bytes < 2f64.powi(60) => Ok(Self(bytes as u64)),
            _ => Err("expected an amount of memory, such as 64MiB or 1.5GiB".into()),
        }
    }
}

/// An amount of memory, or a part of what a model takes, written as `1/16`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Room {
    /// So many bytes.
    Bytes(Bytes),
    /// So many parts out of so many.
    Part(u32, u32),
}

impl Room {
    /// Bytes, where the model takes so many.
    pub(crate) fn bytes(self, model: u64) -> u64 {
        match self {
            Self::Bytes(Bytes(bytes)) => bytes,
            Self::Part(parts, of) => {
                let bytes = u128::from(model) * u128::from(parts) / u128::from(of);
                u64::try_from(bytes).unwrap_or(u64::MAX)
            }
        }
    }
}

impl FromStr for Room {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let Some((parts, of)) = text.split_once('/') else {
            return text.parse().map(Self::Bytes);
        };
        match (parts.trim().parse(), of.trim().parse()) {
            (Ok(parts), Ok(of)) if parts > 0 && of > 0 => Ok(Self::Part(parts, of)),
            _ => Err("expected a part such as 1/16".into()),
        }
    }
}

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        equilux_common::scene::describe::Bytes(self.0).fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_is_an_amount_or_a_part() {
        let room = |text: &str| text.parse::<Room>().map(|room| room.bytes(3200)).ok();
        assert_eq!((room("1/16"), room("1KiB")), (Some(200), Some(1024)));
        assert_eq!((room("1/0"), room("x/2"), room("0/2")), (None, None, None));
    }

    #[test]
    fn amounts_have_units_or_none() {
        let bytes = |text: &str| text.parse::<Bytes>().map(|bytes| bytes.0).ok();
        assert_eq!(bytes("64MiB"), Some(64 << 20));
        assert_eq!(bytes("1.5 GiB"), Some(3 << 29));
        assert_eq!(bytes("500mb"), Some(500_000_000));
        assert_eq!(bytes("4096"), Some(4096));
        assert_eq!(bytes("7B"), Some(7));
        for wrong in ["", "MiB", "-1GiB", "1e99", "nan", "0", "1PiB"] {
            assert_eq!(bytes(wrong), None, "{wrong}");
        }
    }
}

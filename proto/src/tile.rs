//! Film values as one run of bytes: untouched pixels are skipped, untouched layers too, and numbers
//! take as many bytes as they need.
//!
//! `docs/wire.md` has the layout.

use equilux_common::film::{PIXEL_SUMS, PixelSums, TileSums};
use equilux_common::job::SIDE_PIXELS_MAX;
use equilux_common::unit::Rect;

use crate::cursor::{Cursor, Malformed, put_varint, put_zigzag};
use crate::limits::TILE_PIXELS_MAX;

/// The layout that is written and read here.
pub const TILE_LAYOUT_VERSION: u8 = 1;

/// Bytes that are no film values.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidTile {
    /// The bytes end too early, or a number is longer than 64 bits.
    #[error("has {got} bytes, which end too early or hold a number of more than 64 bits")]
    Malformed {
        /// How many there are.
        got: usize,
    },
    /// More bytes than pixels.
    #[error("has {0} bytes too many")]
    Surplus(usize),
    /// Another layout.
    #[error("layout version {0}; this program reads {TILE_LAYOUT_VERSION}")]
    Version(u8),
    /// No tile of an image.
    #[error("tile: {x}, {y} with {width} × {height} pixels is empty, too large or off any image")]
    Tile {
        /// Leftmost column.
        x: u64,
        /// Topmost row.
        y: u64,
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
    },
    /// Runs that lead beyond the last pixel or nowhere.
    #[error("pixels: a run does not end within the tile, or is empty")]
    Run,
    /// A pixel without a layer counts as touched, or a layer without a value.
    #[error("pixels[{index}]: is not in the shortest form")]
    NotShortest {
        /// Which.
        index: usize,
    },
    /// Fewer than no samples.
    #[error("pixels[{index}]: a count is negative")]
    NegativeCount {
        /// Which.
        index: usize,
    },
}

/// The bytes of some film values.
///
/// # Panics
/// If there are not as many pixels as the tile has: only a bug can cause that.
#[must_use]
pub fn encode(sums: &TileSums) -> Vec<u8> {
    assert_eq!(sums.pixels.len(), sums.tile.pixel_count(), "pixels of {:?}", sums.tile);
    let tile = sums.tile;
    let mut bytes = vec![TILE_LAYOUT_VERSION];
    for number in [tile.x0, tile.y0, tile.width(), tile.height()] {
        put_varint(&mut bytes, u64::from(number));
    }
    put_varint(&mut bytes, sums.saturated);
    put_varint(&mut bytes, sums.invalid);
    let is_touched = |pixel: &PixelSums| pixel.as_array().iter().any(|&sum| sum != 0);
    for run in sums.pixels.chunk_by(|a, b| is_touched(a) == is_touched(b)) {
        put_run(&mut bytes, run, is_touched(&run[0]));
    }
    bytes
}

/// The film values in some bytes.
///
/// # Errors
/// If the bytes are not exactly the values of one tile within the limits.
pub fn decode(bytes: &[u8]) -> Result<TileSums, InvalidTile> {
    let mut cursor = Cursor::new(bytes);
    decode_from(&mut cursor).map_err(|problem| problem.of(bytes.len()))
}

/// A number that tells an untouched run (even) from a touched one (odd) and how long it is, and the
/// pixels of a touched one.
fn put_run(bytes: &mut Vec<u8>, run: &[PixelSums], is_touched: bool) {
    put_varint(bytes, (run.len() as u64) << 1 | u64::from(is_touched));
    for pixel in run.iter().filter(|_| is_touched) {
        put_pixel(bytes, pixel.as_array());
    }
}

/// A bit for each sum that is not zero, then these sums.
fn put_pixel(bytes: &mut Vec<u8>, sums: &[i64; PIXEL_SUMS]) {
    let present = (0..PIXEL_SUMS).filter(|&position| sums[position] != 0);
    let mask = present.clone().fold(0_u16, |mask, position| mask | 1 << position);
    bytes.extend(mask.to_le_bytes());
    present.for_each(|position| put_zigzag(bytes, sums[position]));
}

/// What went wrong, before the length is known.
enum Problem {
    Malformed,
    Invalid(InvalidTile),
}

impl Problem {
    fn of(self, got: usize) -> InvalidTile {
        match self {
            Self::Malformed => InvalidTile::Malformed { got },
            Self::Invalid(invalid) => invalid,
        }
    }
}

impl From<Malformed> for Problem {
    fn from(_: Malformed) -> Self {
        Self::Malformed
    }
}

impl From<InvalidTile> for Problem {
    fn from(invalid: InvalidTile) -> Self {
        Self::Invalid(invalid)
    }
}

fn decode_from(cursor: &mut Cursor<'_>) -> Result<TileSums, Problem> {
    let version = cursor.u8()?;
    if version != TILE_LAYOUT_VERSION {
        return Err(InvalidTile::Version(version).into());
    }
    let tile = take_tile(cursor)?;
    let (saturated, invalid) = (cursor.varint()?, cursor.varint()?);
    let count = tile.pixel_count();
    let mut pixels = Vec::with_capacity(count);
    while pixels.len() < count {
        take_run(cursor, count, &mut pixels)?;
    }
    match cursor.rest().len() {
        0 => Ok(TileSums { tile, pixels, saturated, invalid }),
        surplus => Err(InvalidTile::Surplus(surplus).into()),
    }
}

fn take_tile(cursor: &mut Cursor<'_>) -> Result<Rect, Problem> {
    let [x, y] = [cursor.varint()?, cursor.varint()?];
    let [width, height] = [cursor.varint()?, cursor.varint()?];
    rect(x, y, width, height).ok_or_else(|| InvalidTile::Tile { x, y, width, height }.into())
}

fn rect(x: u64, y: u64, width: u64, height: u64) -> Option<Rect> {
    let side = |start: u64, length: u64| {
        let end = start.checked_add(length)?;
        let is_within = length > 0 && end <= u64::from(SIDE_PIXELS_MAX);
        is_within.then_some((u32::try_from(start).ok()?, u32::try_from(end).ok()?))
    };
    let ((x0, x1), (y0, y1)) = (side(x, width)?, side(y, height)?);
    let tile = Rect { x0, y0, x1, y1 };
    (tile.pixel_count() <= TILE_PIXELS_MAX).then_some(tile)
}

fn take_run(
    cursor: &mut Cursor<'_>,
    count: usize,
    pixels: &mut Vec<PixelSums>,
) -> Result<(), Problem> {
    let head = cursor.varint()?;
    let end = usize::try_from(head >> 1).ok().and_then(|run| pixels.len().checked_add(run));
    let end = end.filter(|&end| pixels.len() < end && end <= count).ok_or(InvalidTile::Run)?;
    if head & 1 == 0 {
        pixels.resize(end, PixelSums::default());
        return Ok(());
    }
    while pixels.len() < end {
        pixels.push(take_pixel(cursor, pixels.len())?);
    }
    Ok(())
}

fn take_pixel(cursor: &mut Cursor<'_>, index: usize) -> Result<PixelSums, Problem> {
    let mask = cursor.u16()?;
    let mut sums = [0; PIXEL_SUMS];
    for (position, sum) in sums.iter_mut().enumerate() {
        if mask >> position & 1 == 0 {
            continue;
        }
        *sum = cursor.zigzag()?;
        if *sum == 0 {
            return Err(InvalidTile::NotShortest { index }.into());
        }
    }
    if mask == 0 {
        return Err(InvalidTile::NotShortest { index }.into());
    }
    let pixel = PixelSums::from_array(sums);
    if pixel.even_samples < 0 || pixel.odd_samples < 0 || pixel.hits < 0 {
        return Err(InvalidTile::NegativeCount { index }.into());
    }
    Ok(pixel)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use proptest::prelude::*;

    const TILE: Rect = Rect { x0: 16, y0: 32, x1: 32, y1: 48 };

    proptest! {
        #[test]
        fn film_values_round_trip(sums in arbitrary::tile_sums()) {
            prop_assert_eq!(decode(&encode(&sums)), Ok(sums));
        }

        #[test]
        fn arbitrary_bytes_never_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = decode(&bytes);
            // Further in, behind a header that is right.
            bytes.splice(0..0, [TILE_LAYOUT_VERSION, 0, 0, 16, 16, 0, 0]);
            let _ = decode(&bytes);
        }

        #[test]
        fn a_cut_or_longer_tile_is_refused(
            sums in arbitrary::tile_sums(), cut in any::<prop::sample::Index>(),
        ) {
            let mut bytes = encode(&sums);
            prop_assert!(decode(&bytes[..cut.index(bytes.len())]).is_err());
            bytes.push(0);
            prop_assert_eq!(decode(&bytes), Err(InvalidTile::Surplus(1)));
        }
    }

    #[test]
    fn an_untouched_tile_takes_a_few_bytes() {
        assert_eq!(encode(&TileSums::new(TILE)).len(), 9);
    }

    #[test]
    fn tiles_off_the_limits_are_refused_before_memory_is_taken() {
        let header = |x, y, width, height| {
            let mut bytes = vec![TILE_LAYOUT_VERSION];
            [x, y, width, height].into_iter().for_each(|number| put_varint(&mut bytes, number));
            decode(&bytes)
        };
        let refused = |result| matches!(result, Err(InvalidTile::Tile { .. }));
        assert!(refused(header(0, 0, 65, 64)));
        assert!(refused(header(0, 0, 0, 1)));
        assert!(refused(header(u64::MAX, 0, 1, 1)));
        assert!(refused(header(0, 65_530, 16, 16)));
        assert!(!refused(header(0, 0, 64, 64)));
    }

    #[test]
    fn runs_and_counts_are_checked() {
        let with = |tail: &[u8]| {
            let mut bytes = vec![TILE_LAYOUT_VERSION, 0, 0, 1, 1, 0, 0];
            bytes.extend(tail);
            decode(&bytes)
        };
        assert_eq!(with(&[4]), Err(InvalidTile::Run));
        assert_eq!(with(&[0]), Err(InvalidTile::Run));
        assert_eq!(with(&[3, 0, 0]), Err(InvalidTile::NotShortest { index: 0 }));
        assert_eq!(with(&[3, 1, 0, 0]), Err(InvalidTile::NotShortest { index: 0 }));
        assert_eq!(with(&[3, 0, 0x80, 1]), Err(InvalidTile::NegativeCount { index: 0 }));
        assert_eq!(with(&[3, 0, 0x80, 2]).map(|sums| sums.pixels[0].hits), Ok(1));
        assert_eq!(decode(&[9]), Err(InvalidTile::Version(9)));
    }
}

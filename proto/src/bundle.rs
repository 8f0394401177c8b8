//! A bundle as one run of bytes, so that handing rays on costs a copy and no parsing per ray.
//!
//! `docs/wire.md` has the layout. Everything is little-endian and rays are in the order of
//! [`Ray`]'s fields, which is why this crate builds on little-endian machines alone.

use bytemuck::{Zeroable, cast_slice, cast_slice_mut};
use equilux_common::bundle::{BUNDLE_RAYS_MAX, Bundle, SHARES_MAX, Share, Stage};
use equilux_common::credit::CREDIT_WORDS_MAX;
use equilux_common::ids::{Attempt, PartitionId, UnitId};
use equilux_common::ray::Ray;

use crate::cursor::{Cursor, Malformed};
use crate::share::{self, InvalidShare};

const _: () = assert!(cfg!(target_endian = "little"), "rays travel in the memory's own order");

/// The layout that is written and read here.
pub const BUNDLE_LAYOUT_VERSION: u8 = 2;

const HEADER_BYTES: usize = 8;

/// Bytes that are no bundle.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidBundle {
    /// The bytes end too early or too late.
    #[error("has {got} bytes, which do not hold what its header says")]
    Length {
        /// How many there are.
        got: usize,
    },
    /// Another layout.
    #[error("layout version {0}; this program reads {BUNDLE_LAYOUT_VERSION}")]
    Version(u8),
    /// No such stage.
    #[error("stage: {0} is unknown")]
    Stage(u8),
    /// Too many rays, or none.
    #[error("ray_count: {0} is not from 1 to {BUNDLE_RAYS_MAX}")]
    RayCount(u8),
    /// Nobody's rays.
    #[error("share_count: is zero")]
    NoShares,
    /// Credit of an impossible length.
    #[error("shares[{index}].word_count: {count} is more than {CREDIT_WORDS_MAX}")]
    WordCount {
        /// Which share.
        index: usize,
        /// What it says.
        count: u32,
    },
    /// A bad share.
    #[error("shares[{index}].{problem}")]
    Share {
        /// Which.
        index: usize,
        /// What is wrong with it.
        problem: InvalidShare,
    },
    /// A bad ray.
    #[error("rays[{index}].{problem}")]
    Ray {
        /// Which.
        index: usize,
        /// What is wrong with it.
        problem: InvalidRay,
    },
}

/// A ray that nothing can be computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidRay {
    /// NaN or infinite.
    #[error("{0}: is not finite")]
    NotFinite(&'static str),
    /// NaN or negative.
    #[error("distance: is NaN or negative")]
    Distance,
    /// Drawn with a negative density.
    #[error("pdf: is negative")]
    Pdf,
    /// It belongs to nobody.
    #[error("share: {0} is out of range")]
    Share(u8),
}

/// The bytes of a bundle.
///
/// # Panics
/// If the bundle exceeds its limits: only a bug makes such a one.
#[must_use]
pub fn encode(bundle: &Bundle) -> Vec<u8> {
    let (shares, rays) = (bundle.shares.len(), bundle.rays.len());
    assert!((1..=SHARES_MAX).contains(&shares), "a bundle of {shares} shares");
    assert!((1..=BUNDLE_RAYS_MAX).contains(&rays), "a bundle of {rays} rays");
    let mut bytes = Vec::with_capacity(HEADER_BYTES + 20 * shares + size_of::<Ray>() * rays);
    bytes.push(BUNDLE_LAYOUT_VERSION);
    bytes.push(stage_number(bundle.stage));
    bytes.push(shares as u8);
    bytes.push(rays as u8);
    bytes.extend(bundle.partition.0.to_le_bytes());
    bundle.shares.iter().for_each(|share| put_share(&mut bytes, share));
    bytes.extend_from_slice(cast_slice(&bundle.rays));
    bytes
}

/// The bundle in some bytes.
///
/// # Errors
/// If the bytes are not exactly one bundle that can be traced.
pub fn decode(bytes: &[u8]) -> Result<Bundle, InvalidBundle> {
    let length = |_| InvalidBundle::Length { got: bytes.len() };
    let mut cursor = Cursor::new(bytes);
    let [version, stage, share_count, ray_count] = cursor.array().map_err(length)?;
    if version != BUNDLE_LAYOUT_VERSION {
        return Err(InvalidBundle::Version(version));
    }
    if !(1..=BUNDLE_RAYS_MAX).contains(&usize::from(ray_count)) {
        return Err(InvalidBundle::RayCount(ray_count));
    }
    let partition = PartitionId(cursor.u32().map_err(length)?);
    let stage = stage_of(stage)?;
    let shares = (0..usize::from(share_count))
        .map(|index| take_share(&mut cursor, index, bytes.len()))
        .collect::<Result<Vec<_>, _>>()?;
    if shares.is_empty() {
        return Err(InvalidBundle::NoShares);
    }
    let rays = take_rays(cursor.rest(), ray_count).ok_or_else(|| length(Malformed))?;
    check_rays(&rays, share_count)?;
    Ok(Bundle { stage, partition, shares, rays })
}

/// Makes sure that everything can be computed from the rays.
fn check_rays(rays: &[Ray], share_count: u8) -> Result<(), InvalidBundle> {
    for (index, ray) in rays.iter().enumerate() {
        check_ray(ray, share_count).map_err(|problem| InvalidBundle::Ray { index, problem })?;
    }
    Ok(())
}

fn check_ray(ray: &Ray, share_count: u8) -> Result<(), InvalidRay> {
    let vectors = [
        ("origin", ray.origin),
        ("direction", ray.direction),
        ("throughput", ray.throughput),
        ("pdf", [ray.pdf; 3]),
    ];
    for (field, vector) in vectors {
        if !vector.iter().all(|number| number.is_finite()) {
            return Err(InvalidRay::NotFinite(field));
        }
    }
    if ray.distance.is_nan() || ray.distance < 0.0 {
        return Err(InvalidRay::Distance);
    }
    if ray.pdf < 0.0 {
        return Err(InvalidRay::Pdf);
    }
    if ray.share >= share_count { Err(InvalidRay::Share(ray.share)) } else { Ok(()) }
}

fn put_share(bytes: &mut Vec<u8>, share: &Share) {
    let words = share.credit.words();
    assert!((1..=CREDIT_WORDS_MAX).contains(&words.len()), "credit of {} words", words.len());
    bytes.extend(share.unit.0.to_le_bytes());
    bytes.extend(share.attempt.0.to_le_bytes());
    bytes.extend((words.len() as u32).to_le_bytes());
    bytes.extend_from_slice(cast_slice(words));
}

fn take_share(cursor: &mut Cursor<'_>, index: usize, got: usize) -> Result<Share, InvalidBundle> {
    let length = |_| InvalidBundle::Length { got };
    let unit = UnitId(cursor.u32().map_err(length)?);
    let attempt = Attempt(cursor.u32().map_err(length)?);
    let count = cursor.u32().map_err(length)?;
    if count as usize > CREDIT_WORDS_MAX {
        return Err(InvalidBundle::WordCount { index, count });
    }
    let words = (0..count).map(|_| cursor.u64()).collect::<Result<Vec<_>, _>>().map_err(length)?;
    let credit =
        share::credit(&words).map_err(|problem| InvalidBundle::Share { index, problem })?;
    Ok(Share { unit, attempt, credit })
}

/// The rays, which take all that is left.
fn take_rays(bytes: &[u8], count: u8) -> Option<Vec<Ray>> {
    let mut rays = vec![Ray::zeroed(); usize::from(count)];
    let target: &mut [u8] = cast_slice_mut(&mut rays);
    if bytes.len() != target.len() {
        return None;
    }
    target.copy_from_slice(bytes);
    Some(rays)
}

const fn stage_number(stage: Stage) -> u8 {
    match stage {
        Stage::Intersect => 0,
        Stage::Shade => 1,
        Stage::Shadow => 2,
    }
}

const fn stage_of(number: u8) -> Result<Stage, InvalidBundle> {
    match number {
        0 => Ok(Stage::Intersect),
        1 => Ok(Stage::Shade),
        2 => Ok(Stage::Shadow),
        _ => Err(InvalidBundle::Stage(number)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arbitrary;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bundles_round_trip(bundle in arbitrary::bundle()) {
            prop_assert_eq!(decode(&encode(&bundle)), Ok(bundle));
        }

        #[test]
        fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = decode(&bytes);
        }

        #[test]
        fn a_changed_byte_is_another_bundle_or_none(
            bundle in arbitrary::bundle(), position in any::<prop::sample::Index>(), byte in any::<u8>(),
        ) {
            let mut bytes = encode(&bundle);
            let position = position.index(bytes.len());
            bytes[position] = byte;
            if let Ok(changed) = decode(&bytes) {
                prop_assert_eq!(encode(&changed), bytes);
            }
        }

        #[test]
        fn a_cut_or_longer_bundle_is_refused(
            bundle in arbitrary::bundle(), cut in any::<prop::sample::Index>(),
        ) {
            let mut bytes = encode(&bundle);
            let cut = cut.index(bytes.len());
            prop_assert!(decode(&bytes[..cut]).is_err());
            bytes.push(0);
            let refused = matches!(decode(&bytes), Err(InvalidBundle::Length { .. }));
            prop_assert!(refused);
        }
    }

    fn refusal(spoil: impl Fn(&mut Ray)) -> InvalidRay {
        let mut bundle = arbitrary::plain_bundle();
        spoil(&mut bundle.rays[1]);
        match decode(&encode(&bundle)) {
            Err(InvalidBundle::Ray { index: 1, problem }) => problem,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn rays_that_nothing_can_be_computed_from_are_refused_by_field() {
        assert_eq!(refusal(|ray| ray.origin[2] = f32::NAN), InvalidRay::NotFinite("origin"));
        let infinite = |ray: &mut Ray| ray.direction[0] = f32::INFINITY;
        assert_eq!(refusal(infinite), InvalidRay::NotFinite("direction"));
        assert_eq!(
            refusal(|ray| ray.throughput[1] = f32::NAN),
            InvalidRay::NotFinite("throughput")
        );
        assert_eq!(refusal(|ray| ray.pdf = f32::INFINITY), InvalidRay::NotFinite("pdf"));
        assert_eq!(refusal(|ray| ray.pdf = -1.0), InvalidRay::Pdf);
        assert_eq!(refusal(|ray| ray.distance = f32::NAN), InvalidRay::Distance);
        assert_eq!(refusal(|ray| ray.distance = -1.0), InvalidRay::Distance);
        assert_eq!(refusal(|ray| ray.share = 1), InvalidRay::Share(1));
    }

    #[test]
    fn headers_are_checked() {
        let good = encode(&arbitrary::plain_bundle());
        let with = |position: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[position] = byte;
            decode(&bytes)
        };
        let other = BUNDLE_LAYOUT_VERSION + 1;
        assert_eq!(with(0, other), Err(InvalidBundle::Version(other)));
        assert_eq!(with(1, 3), Err(InvalidBundle::Stage(3)));
        assert_eq!(with(3, 0), Err(InvalidBundle::RayCount(0)));
        assert_eq!(with(3, 65), Err(InvalidBundle::RayCount(65)));
        assert_eq!(with(18, 1), Err(InvalidBundle::WordCount { index: 0, count: 65_537 }));
        assert_eq!(decode(&[]), Err(InvalidBundle::Length { got: 0 }));
    }
}

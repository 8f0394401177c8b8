//! Lanes of AVX2.
//!
//! Two things are unsafe here. To use instructions that the machine may not have: an [`Avx2`] is
//! proof that it has them, for there is no other way to one than [`Avx2::detect`]. And to load and
//! store where a slice tells: never more than it has.

#![expect(unsafe_code, reason = "instructions that not every machine has")]

use std::arch::x86_64::{
    __m256, __m256i, _CMP_EQ_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm_cvtsi64_si128, _mm256_add_epi32,
    _mm256_add_ps, _mm256_and_ps, _mm256_and_si256, _mm256_andnot_ps, _mm256_blend_epi32,
    _mm256_blendv_ps, _mm256_castps_si256, _mm256_castsi256_ps, _mm256_cmp_ps,
    _mm256_cvtepu8_epi32, _mm256_div_ps, _mm256_fmsub_ps, _mm256_loadu_ps, _mm256_loadu_si256,
    _mm256_maskload_ps, _mm256_max_epi32, _mm256_max_ps, _mm256_min_epi32, _mm256_min_ps,
    _mm256_movemask_epi8, _mm256_movemask_ps, _mm256_mul_ps, _mm256_or_ps, _mm256_or_si256,
    _mm256_permute2f128_ps, _mm256_permute2x128_si256, _mm256_permutevar8x32_epi32,
    _mm256_permutevar8x32_ps, _mm256_set1_epi32, _mm256_set1_ps, _mm256_setr_epi32,
    _mm256_shuffle_epi32, _mm256_shuffle_ps, _mm256_slli_epi16, _mm256_slli_epi32,
    _mm256_srli_epi32, _mm256_storeu_ps, _mm256_storeu_si256, _mm256_sub_epi32, _mm256_sub_ps,
    _mm256_unpackhi_ps, _mm256_unpacklo_ps, _mm256_xor_si256,
};

use super::{Axis, FIRST, Lanes, Task};

/// Proof that this machine has AVX2, FMA and BMI.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx2(());

/// Two units in the last place of a number, over the number.
const SHIFT: f32 = 1.0 / 4_194_304.0;

/// Eight set lanes, then eight clear ones: from `8 - n` on, the mask of the first n lanes.
const MASKS: [i32; 16] = [-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0];

impl Avx2 {
    /// The proof, if it can be had.
    #[inline]
    pub(super) fn detect() -> Option<Self> {
        let is_there = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2");
        is_there.then_some(Self(()))
    }

    /// Does a task, compiled for this instruction set.
    #[inline]
    pub(super) fn run<T: Task>(self, task: T) -> T::Output {
        // SAFETY: `self` proves that the machine has the instructions.
        unsafe { run_here(self, task) }
    }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2")]
fn run_here<T: Task>(lanes: Avx2, task: T) -> T::Output {
    task.run(lanes)
}

/// Calls an intrinsic.
macro_rules! intrinsic {
    ($call:expr) => {
        // SAFETY: an `Avx2` proves that the machine has the instruction.
        unsafe { $call }
    };
}

impl Lanes for Avx2 {
    type Floats = __m256;
    type Order = __m256i;

    #[inline(always)]
    fn splat(self, number: f32) -> __m256 {
        intrinsic!(_mm256_set1_ps(number))
    }

    #[inline(always)]
    fn load(self, numbers: &[f32; 8]) -> __m256 {
        // SAFETY: as above; and there are eight numbers.
        unsafe { _mm256_loadu_ps(numbers.as_ptr()) }
    }

    #[inline(always)]
    fn load_some(self, numbers: &[f32]) -> __m256 {
        let count = numbers.len().min(8);
        let mask = &MASKS[8 - count..][..8];
        // SAFETY: as above; the mask has eight entries, and what it masks is not read: the first
        // `count` numbers are.
        unsafe {
            let mask = _mm256_loadu_si256(mask.as_ptr().cast());
            _mm256_maskload_ps(numbers.as_ptr(), mask)
        }
    }

    #[inline(always)]
    fn store(self, numbers: __m256) -> [f32; 8] {
        let mut stored = [0.0; 8];
        // SAFETY: as above; and there is room for eight numbers.
        unsafe { _mm256_storeu_ps(stored.as_mut_ptr(), numbers) };
        stored
    }

    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_sub_ps(a, b))
    }

    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_mul_ps(a, b))
    }

    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_min_ps(a, b))
    }

    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_max_ps(a, b))
    }

    #[inline(always)]
    fn at_most(self, a: __m256, b: __m256) -> u32 {
        intrinsic!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))).cast_unsigned()
    }

    #[inline(always)]
    fn less(self, a: __m256, b: __m256) -> u32 {
        intrinsic!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b))).cast_unsigned()
    }

    #[inline(always)]
    fn equal(self, a: __m256, b: __m256) -> u32 {
        intrinsic!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(a, b))).cast_unsigned()
    }

    /// The product of plane and scale is not rounded, that of origin and scale is: by less than
    /// moving the origin would do, which is why it may be moved.
    #[inline(always)]
    fn axis(self, origin: f32, scale: f32, away: f32) -> Axis {
        let origin = origin + away * (origin.abs() * SHIFT + f32::MIN_POSITIVE);
        let start = origin * scale;
        debug_assert!(start.is_finite(), "{origin} {scale}");
        Axis { scale, start }
    }

    #[inline(always)]
    fn distances(self, planes: __m256, Axis { scale, start }: Axis) -> __m256 {
        intrinsic!(_mm256_fmsub_ps(planes, self.splat(scale), self.splat(start)))
    }

    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_add_ps(a, b))
    }

    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_div_ps(a, b))
    }

    #[inline(always)]
    fn abs(self, a: __m256) -> __m256 {
        intrinsic!(_mm256_andnot_ps(self.splat(-0.0), a))
    }

    #[inline(always)]
    fn copy_sign(self, a: __m256, signs: __m256) -> __m256 {
        intrinsic!(_mm256_or_ps(a, _mm256_and_ps(self.splat(-0.0), signs)))
    }

    #[inline(always)]
    fn next_up(self, a: __m256) -> __m256 {
        intrinsic!({
            // Makes a negative zero a positive one.
            let bits = _mm256_castps_si256(_mm256_add_ps(a, self.splat(0.0)));
            let downward = _mm256_slli_epi32::<1>(_mm256_srli_epi32::<31>(bits));
            let upward = _mm256_add_epi32(bits, _mm256_set1_epi32(1));
            _mm256_castsi256_ps(_mm256_sub_epi32(upward, downward))
        })
    }

    #[inline(always)]
    fn select_at_most(self, a: __m256, b: __m256, then: __m256, otherwise: __m256) -> __m256 {
        intrinsic!(_mm256_blendv_ps(otherwise, then, _mm256_cmp_ps::<_CMP_LE_OQ>(a, b)))
    }

    /// Pairs of rows, then pairs of pairs, then halves.
    #[inline(always)]
    fn turn(self, [a, b, c, d, e, f, g, h]: [__m256; 8]) -> [__m256; 8] {
        let ([a, b, c, d], [e, f, g, h]) = (turned([a, b, c, d]), turned([e, f, g, h]));
        intrinsic!([
            _mm256_permute2f128_ps::<0x20>(a, e),
            _mm256_permute2f128_ps::<0x20>(b, f),
            _mm256_permute2f128_ps::<0x20>(c, g),
            _mm256_permute2f128_ps::<0x20>(d, h),
            _mm256_permute2f128_ps::<0x31>(a, e),
            _mm256_permute2f128_ps::<0x31>(b, f),
            _mm256_permute2f128_ps::<0x31>(c, g),
            _mm256_permute2f128_ps::<0x31>(d, h),
        ])
    }

    #[inline(always)]
    fn starts(self, origins: __m256, scales: __m256, aways: __m256) -> __m256 {
        let shifts = self.mul(self.abs(origins), self.splat(SHIFT));
        let shifts = self.add(shifts, self.splat(f32::MIN_POSITIVE));
        self.mul(self.add(origins, self.mul(aways, shifts)), scales)
    }

    /// By Batcher's bitonic network, of keys whose last bits are the lane: the bits of numbers that
    /// are not negative are in the order of the numbers.
    #[inline(always)]
    fn farthest_first(self, a: __m256, b: __m256) -> __m256i {
        intrinsic!({
            let is_chosen = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b));
            let high = _mm256_and_si256(_mm256_castps_si256(a), _mm256_set1_epi32(0x7fff_fff8));
            let keys = _mm256_or_si256(high, _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
            // Less than all others.
            let keys = _mm256_or_si256(keys, _mm256_xor_si256(is_chosen, _mm256_set1_epi32(-1)));
            let keys = exchanged::<0b1010_1010>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
            let keys = exchanged::<0b1100_1100>(keys, _mm256_shuffle_epi32::<0b00_01_10_11>(keys));
            let keys = exchanged::<0b1010_1010>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
            let turned = _mm256_shuffle_epi32::<0b00_01_10_11>(keys);
            let turned = _mm256_permute2x128_si256::<1>(turned, turned);
            let keys = exchanged::<0b1111_0000>(keys, turned);
            let keys = exchanged::<0b1100_1100>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
            exchanged::<0b1010_1010>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys))
        })
    }

    #[inline(always)]
    fn chosen_first(self, lanes: u32) -> __m256i {
        let lanes = i64::from_le_bytes(FIRST[(lanes & 0xff) as usize]);
        intrinsic!(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(lanes)))
    }

    /// Of an order only the last three bits of each lane are looked at.
    #[inline(always)]
    fn arrange(self, numbers: &[u32; 8], order: __m256i) -> [u32; 8] {
        let mut arranged = [0; 8];
        // SAFETY: as above; and there are eight numbers, and room for eight.
        unsafe {
            let numbers = _mm256_loadu_si256(numbers.as_ptr().cast());
            let numbers = _mm256_permutevar8x32_epi32(numbers, order);
            _mm256_storeu_si256(arranged.as_mut_ptr().cast(), numbers);
        }
        arranged
    }

    #[inline(always)]
    fn arrange_floats(self, numbers: __m256, order: __m256i) -> __m256 {
        intrinsic!(_mm256_permutevar8x32_ps(numbers, order))
    }

    #[inline(always)]
    fn columns(self, bytes: &[u8; 32]) -> [u32; 8] {
        // SAFETY: as above; and there are 32 bytes.
        let bytes = unsafe { _mm256_loadu_si256(bytes.as_ptr().cast()) };
        [
            self.column::<7>(bytes),
            self.column::<6>(bytes),
            self.column::<5>(bytes),
            self.column::<4>(bytes),
            self.column::<3>(bytes),
            self.column::<2>(bytes),
            self.column::<1>(bytes),
            self.column::<0>(bytes),
        ]
    }
}

/// Rows and columns of each half exchanged.
#[inline(always)]
fn turned([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    // SAFETY: only called by those who have an `Avx2`.
    unsafe {
        let (low, high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (low_too, high_too) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0b01_00_01_00>(low, low_too),
            _mm256_shuffle_ps::<0b11_10_11_10>(low, low_too),
            _mm256_shuffle_ps::<0b01_00_01_00>(high, high_too),
            _mm256_shuffle_ps::<0b11_10_11_10>(high, high_too),
        ]
    }
}

/// Of two keys each, the greater one for lanes whose bit is 0, the lesser one for the others.
#[inline(always)]
fn exchanged<const LESSER: i32>(keys: __m256i, others: __m256i) -> __m256i {
    // SAFETY: only called by those who have an `Avx2`.
    unsafe {
        let (greater, lesser) = (_mm256_max_epi32(keys, others), _mm256_min_epi32(keys, others));
        _mm256_blend_epi32::<LESSER>(greater, lesser)
    }
}

impl Avx2 {
    /// The bits that are the highest ones of bytes after a shift to the left.
    #[inline(always)]
    fn column<const SHIFT: i32>(self, bytes: __m256i) -> u32 {
        let mask = intrinsic!(_mm256_movemask_epi8(_mm256_slli_epi16::<SHIFT>(bytes)));
        mask.cast_unsigned()
    }
}

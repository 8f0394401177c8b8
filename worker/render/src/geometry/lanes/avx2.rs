//! Lanes of AVX2.
//!
//! Two things are unsafe here. To use instructions that the machine may not have: an [`Avx2`] is
//! proof that it has them, for there is no other way to one than [`Avx2::detect`]. And to load and
//! store where a slice tells: never more than it has.

#![expect(unsafe_code, reason = "instructions that not every machine has")]

use std::arch::x86_64::{
    __m256, __m256i, _CMP_EQ_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm256_blendv_ps, _mm256_cmp_ps,
    _mm256_fmsub_ps, _mm256_loadu_ps, _mm256_loadu_si256, _mm256_maskload_ps, _mm256_max_ps,
    _mm256_min_ps, _mm256_movemask_epi8, _mm256_movemask_ps, _mm256_mul_ps, _mm256_set1_ps,
    _mm256_slli_epi16, _mm256_storeu_ps, _mm256_sub_ps,
};

use super::{Axis, Lanes, Task};

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
    fn where_at_most(self, a: __m256, b: __m256) -> __m256 {
        intrinsic!(_mm256_blendv_ps(
            self.splat(f32::INFINITY),
            a,
            _mm256_cmp_ps::<_CMP_LE_OQ>(a, b)
        ))
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

impl Avx2 {
    /// The bits that are the highest ones of bytes after a shift to the left.
    #[inline(always)]
    fn column<const SHIFT: i32>(self, bytes: __m256i) -> u32 {
        let mask = intrinsic!(_mm256_movemask_epi8(_mm256_slli_epi16::<SHIFT>(bytes)));
        mask.cast_unsigned()
    }
}

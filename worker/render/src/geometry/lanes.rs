//! Eight numbers at a time, by the instruction set that the machine has.
//!
//! What is to run on several instruction sets is written once, as a [`Task`] over any [`Lanes`],
//! and compiled for each of them; [`Instructions::run`] takes the one that was chosen. All of it
//! must be inlined into `Task::run`, hence `#[inline(always)]` wherever `Lanes` appear: a function
//! that is not is compiled for the least of all machines.
//!
//! Every operation gives the same bits on all machines, but for [`Lanes::axis`] and
//! [`Lanes::distances`]: these may be off as their descriptions allow.

#[cfg(target_arch = "x86_64")]
mod avx2;

use std::sync::OnceLock;

/// An instruction set that there is code for, and that this machine has.
#[derive(Clone, Copy, Debug)]
pub struct Instructions(Choice);

#[derive(Clone, Copy, Debug)]
enum Choice {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2(avx2::Avx2),
}

/// What was chosen, or found to be the best.
static CHOSEN: OnceLock<Instructions> = OnceLock::new();

/// No instructions that could be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("this machine has no instructions `{name}`; there are {}", known())]
pub struct UnknownInstructions {
    name: String,
}

fn known() -> String {
    let names: Vec<_> = Instructions::all().into_iter().map(Instructions::name).collect();
    names.join(" and ")
}

/// Eight numbers, and what is done with them.
pub(super) trait Lanes: Copy {
    /// Eight numbers of single precision.
    type Floats: Copy;

    /// The same number eight times.
    fn splat(self, number: f32) -> Self::Floats;
    fn load(self, numbers: &[f32; 8]) -> Self::Floats;
    /// The first eight, or as many as there are; then zeros.
    fn load_some(self, numbers: &[f32]) -> Self::Floats;
    fn store(self, numbers: Self::Floats) -> [f32; 8];
    fn sub(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn mul(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn min(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn max(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// A bit for each lane, from the lowest on: whether a ≤ b.
    fn at_most(self, a: Self::Floats, b: Self::Floats) -> u32;
    /// A bit for each lane: whether a < b.
    fn less(self, a: Self::Floats, b: Self::Floats) -> u32;
    /// A bit for each lane: whether a = b.
    fn equal(self, a: Self::Floats, b: Self::Floats) -> u32;
    /// A ray as planes across one axis see it: it starts at `origin` and goes `1 / scale` in each
    /// unit of distance. `away` is 1 if the origin may be taken for a greater one by two units in
    /// the last place, −1 if for a lesser one. Origin times scale must be finite.
    fn axis(self, origin: f32, scale: f32, away: f32) -> Axis;
    /// The distances at which a ray meets planes: (planes − origin) · scale. Monotone in the
    /// planes, and never beyond what the origins that [`Self::axis`] allows give, but for three
    /// roundings.
    fn distances(self, planes: Self::Floats, axis: Axis) -> Self::Floats;
    /// Each a where a ≤ b, infinity elsewhere.
    fn where_at_most(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// Bit by bit, from the lowest on: those that 32 bytes have there, as bits in their order.
    fn columns(self, bytes: &[u8; 32]) -> [u32; 8];
}

/// A ray as planes across one axis see it, for the lanes that made it so.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    scale: f32,
    /// Where the ray starts, as those lanes know it.
    start: f32,
}

/// What is done with the lanes of any machine.
pub(super) trait Task {
    /// What comes of it.
    type Output;

    /// Does it. To be inlined always.
    fn run(self, lanes: impl Lanes) -> Self::Output;
}

impl Instructions {
    /// All that this machine has, the best last.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let mut all = vec![Self(Choice::Portable)];
        #[cfg(target_arch = "x86_64")]
        all.extend(avx2::Avx2::detect().map(|proof| Self(Choice::Avx2(proof))));
        all
    }

    /// Those that are to be used: the best that this machine has, unless others were chosen.
    #[must_use]
    pub fn chosen() -> Self {
        *CHOSEN.get_or_init(|| Self::all().pop().unwrap_or(Self(Choice::Portable)))
    }

    /// Uses these from now on. Too late once tracing has begun; then, as ever, it does not matter
    /// for the image.
    pub fn choose(self) {
        CHOSEN.get_or_init(|| self);
    }

    /// Those with this name.
    ///
    /// # Errors
    /// If there are none, or the machine does not have them.
    pub fn by_name(name: &str) -> Result<Self, UnknownInstructions> {
        let mut all = Self::all().into_iter();
        all.find(|it| it.name() == name).ok_or_else(|| UnknownInstructions { name: name.into() })
    }

    /// What they are called: `portable`, or `avx2` for AVX2, FMA and BMI of x86-64.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self.0 {
            Choice::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Choice::Avx2(_) => "avx2",
        }
    }

    /// Does a task by these instructions.
    #[inline]
    pub(super) fn run<T: Task>(self, task: T) -> T::Output {
        match self.0 {
            Choice::Portable => task.run(Portable),
            #[cfg(target_arch = "x86_64")]
            Choice::Avx2(lanes) => lanes.run(task),
        }
    }
}

/// Lanes of plain numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Portable;

#[inline(always)]
fn map2(a: [f32; 8], b: [f32; 8], each: impl Fn(f32, f32) -> f32) -> [f32; 8] {
    std::array::from_fn(|lane| each(a[lane], b[lane]))
}

#[inline(always)]
fn mask(a: [f32; 8], b: [f32; 8], is_set: impl Fn(f32, f32) -> bool) -> u32 {
    (0..8).fold(0, |mask, lane| mask | u32::from(is_set(a[lane], b[lane])) << lane)
}

impl Lanes for Portable {
    type Floats = [f32; 8];

    #[inline(always)]
    fn splat(self, number: f32) -> [f32; 8] {
        [number; 8]
    }

    #[inline(always)]
    fn load(self, numbers: &[f32; 8]) -> [f32; 8] {
        *numbers
    }

    #[inline(always)]
    fn load_some(self, numbers: &[f32]) -> [f32; 8] {
        let mut all = [0.0; 8];
        all.iter_mut().zip(numbers).for_each(|(to, &from)| *to = from);
        all
    }

    #[inline(always)]
    fn store(self, numbers: [f32; 8]) -> [f32; 8] {
        numbers
    }

    #[inline(always)]
    fn sub(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map2(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map2(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn min(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map2(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map2(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn at_most(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        mask(a, b, |a, b| a <= b)
    }

    #[inline(always)]
    fn less(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        mask(a, b, |a, b| a < b)
    }

    #[inline(always)]
    #[expect(clippy::float_cmp, reason = "what is asked for")]
    fn equal(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        mask(a, b, |a, b| a == b)
    }

    #[inline(always)]
    fn axis(self, origin: f32, scale: f32, _away: f32) -> Axis {
        Axis { scale, start: origin }
    }

    #[inline(always)]
    fn distances(self, planes: [f32; 8], Axis { scale, start }: Axis) -> [f32; 8] {
        map2(planes, [0.0; 8], |plane, _| (plane - start) * scale)
    }

    #[inline(always)]
    fn where_at_most(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map2(a, b, |a, b| if a <= b { a } else { f32::INFINITY })
    }

    #[inline(always)]
    fn columns(self, bytes: &[u8; 32]) -> [u32; 8] {
        let mut columns = [0; 8];
        for (place, &byte) in bytes.iter().enumerate() {
            for (bit, column) in columns.iter_mut().enumerate() {
                *column |= (u32::from(byte) >> bit & 1) << place;
            }
        }
        columns
    }
}

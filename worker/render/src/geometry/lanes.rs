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

use bytemuck::{Pod, Zeroable};

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
    /// An order of lanes, as far as it was asked for: which lane is first, second, …
    type Order: Copy;

    /// The same number eight times.
    fn splat(self, number: f32) -> Self::Floats;
    fn load(self, numbers: &[f32; 8]) -> Self::Floats;
    /// The first eight, or as many as there are; then zeros.
    fn load_some(self, numbers: &[f32]) -> Self::Floats;
    fn store(self, numbers: Self::Floats) -> [f32; 8];
    fn sub(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn add(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn mul(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn div(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    fn abs(self, a: Self::Floats) -> Self::Floats;
    /// Numbers that are not negative, with the signs of others.
    fn copy_sign(self, a: Self::Floats, signs: Self::Floats) -> Self::Floats;
    /// [`f32::next_up`] of finite numbers.
    fn next_up(self, a: Self::Floats) -> Self::Floats;
    /// Each `then` where a ≤ b, `otherwise` elsewhere.
    fn select_at_most(
        self,
        a: Self::Floats,
        b: Self::Floats,
        then: Self::Floats,
        otherwise: Self::Floats,
    ) -> Self::Floats;
    /// Rows and columns exchanged.
    fn turn(self, rows: [Self::Floats; 8]) -> [Self::Floats; 8];
    /// [`Self::axis`] of eight rays: only where they start.
    fn starts(
        self,
        origins: Self::Floats,
        scales: Self::Floats,
        aways: Self::Floats,
    ) -> Self::Floats;
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
    /// The lanes where a ≤ b first, those with the greatest a before the others. No a is less than
    /// zero; those that differ by less than a millionth may be in any order.
    fn farthest_first(self, a: Self::Floats, b: Self::Floats) -> Self::Order;
    /// The lanes of these bits first.
    fn chosen_first(self, lanes: u32) -> Self::Order;
    /// Numbers in this order.
    fn arrange(self, numbers: &[u32; 8], order: Self::Order) -> [u32; 8];
    /// Numbers in this order.
    fn arrange_floats(self, numbers: Self::Floats, order: Self::Order) -> Self::Floats;
    /// Bit by bit, from the lowest on: those that 32 bytes have there, as bits in their order.
    fn columns(self, bytes: &[u8; 32]) -> [u32; 8];
}

/// A ray as planes across one axis see it, for the lanes that made it so.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
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

/// By bits, the lanes of these.
static FIRST: [[u8; 8]; 256] = {
    let mut orders = [[0; 8]; 256];
    let mut bits = 0;
    while bits < 256 {
        let (mut lane, mut place) = (0, 0);
        while lane < 8 {
            if bits >> lane & 1 == 1 {
                orders[bits][place] = lane;
                place += 1;
            }
            lane += 1;
        }
        bits += 1;
    }
    orders
};

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
    type Order = [u8; 8];

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
    fn add(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map2(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn div(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map2(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn abs(self, a: [f32; 8]) -> [f32; 8] {
        a.map(f32::abs)
    }

    #[inline(always)]
    fn copy_sign(self, a: [f32; 8], signs: [f32; 8]) -> [f32; 8] {
        map2(a, signs, f32::copysign)
    }

    #[inline(always)]
    fn next_up(self, a: [f32; 8]) -> [f32; 8] {
        a.map(f32::next_up)
    }

    #[inline(always)]
    fn select_at_most(
        self,
        a: [f32; 8],
        b: [f32; 8],
        then: [f32; 8],
        otherwise: [f32; 8],
    ) -> [f32; 8] {
        std::array::from_fn(|lane| if a[lane] <= b[lane] { then[lane] } else { otherwise[lane] })
    }

    #[inline(always)]
    fn turn(self, rows: [[f32; 8]; 8]) -> [[f32; 8]; 8] {
        std::array::from_fn(|column| rows.map(|row| row[column]))
    }

    #[inline(always)]
    fn starts(self, origins: [f32; 8], _scales: [f32; 8], _aways: [f32; 8]) -> [f32; 8] {
        origins
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
    fn farthest_first(self, a: [f32; 8], b: [f32; 8]) -> [u8; 8] {
        let (mut order, mut count) = ([0; 8], 0);
        for lane in (0u8..8).filter(|&lane| a[usize::from(lane)] <= b[usize::from(lane)]) {
            let mut place = count;
            while place > 0 && a[usize::from(order[place - 1])] < a[usize::from(lane)] {
                order[place] = order[place - 1];
                place -= 1;
            }
            order[place] = lane;
            count += 1;
        }
        order
    }

    #[inline(always)]
    fn chosen_first(self, lanes: u32) -> [u8; 8] {
        FIRST[(lanes & 0xff) as usize]
    }

    #[inline(always)]
    fn arrange(self, numbers: &[u32; 8], order: [u8; 8]) -> [u32; 8] {
        order.map(|lane| numbers[usize::from(lane)])
    }

    #[inline(always)]
    fn arrange_floats(self, numbers: [f32; 8], order: [u8; 8]) -> [f32; 8] {
        order.map(|lane| numbers[usize::from(lane)])
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Puts numbers in both orders: those that are at most others, and those of bits.
    struct Orders<'a>(&'a [f32; 8], &'a [f32; 8], u32);

    impl Task for Orders<'_> {
        type Output = ([f32; 8], [u32; 8]);

        fn run(self, lanes: impl Lanes) -> Self::Output {
            let Self(a, b, bits) = self;
            let (a, b) = (lanes.load(a), lanes.load(b));
            let sorted = lanes.arrange_floats(a, lanes.farthest_first(a, b));
            let numbers = [0, 1, 2, 3, 4, 5, 6, 7];
            (lanes.store(sorted), lanes.arrange(&numbers, lanes.chosen_first(bits)))
        }
    }

    fn distances() -> impl Strategy<Value = [f32; 8]> {
        let distance = prop_oneof![
            (0u8..4).prop_map(f32::from),
            0f32..1e3,
            Just(f32::INFINITY),
            Just(-0.0f32)
        ];
        prop::array::uniform8(distance)
    }

    proptest! {
        #[test]
        fn orders_begin_with_the_lanes_that_were_asked_for(
            a in distances(), b in distances(), bits in 0u32..256,
        ) {
            let mut expected: Vec<f32> =
                (0..8).filter(|&lane| a[lane] <= b[lane]).map(|lane| a[lane]).collect();
            expected.sort_by(|a, b| b.total_cmp(a));
            for instructions in Instructions::all() {
                let (sorted, chosen) = instructions.run(Orders(&a, &b, bits));
                for (found, expected) in sorted.iter().zip(&expected) {
                    prop_assert!((found - expected).abs() <= expected * 1e-5 || found == expected);
                }
                let met = &chosen[..bits.count_ones() as usize];
                prop_assert_eq!(met.iter().fold(0, |bits, lane| bits | 1 << lane), bits);
            }
        }
    }
}

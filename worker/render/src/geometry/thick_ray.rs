//! A ray as eight boxes at a time see it.
//!
//! Its interval within a box contains the one that [`Slab`] finds for that box and for any box
//! within it, whatever the instruction set. So walks cull no hit that counts, and which hits count
//! is only up to [`Slab`]. Both ends of intervals are moved apart by twice as much as there, which
//! is more than all roundings here.

use super::lanes::{Axis, Lanes};
use super::slab::Slab;

/// Factor on the scale of near planes: 1 − 2⁻¹⁹.
const NEAR_FACTOR: f32 = 1.0 - 1.0 / 524_288.0;

/// Factor on the scale of far planes: 1 + 2⁻¹⁹.
const FAR_FACTOR: f32 = 1.0 + 1.0 / 524_288.0;

/// Eight boxes: the lower bounds on each axis, then the upper ones.
pub(super) type EightBoxes = [[f32; 8]; 6];

/// A ray as eight boxes at a time see it, for the lanes that it was made for.
#[derive(Clone, Copy, Debug)]
pub(super) struct ThickRay {
    near: [Axis; 3],
    far: [Axis; 3],
    /// Which rows of [`EightBoxes`] have the planes that the ray meets first.
    near_rows: [u8; 3],
}

/// The bounds of eight boxes, row by row as in [`EightBoxes`].
trait Rows<L: Lanes> {
    fn row(&self, lanes: L, number: usize) -> L::Floats;
}

impl<L: Lanes> Rows<L> for EightBoxes {
    #[inline(always)]
    fn row(&self, lanes: L, number: usize) -> L::Floats {
        lanes.load(&self[number])
    }
}

/// Bounds that are loaded already.
struct Loaded<'a, F>(&'a [F; 6]);

impl<L: Lanes> Rows<L> for Loaded<'_, L::Floats> {
    #[inline(always)]
    fn row(&self, _lanes: L, number: usize) -> L::Floats {
        self.0[number]
    }
}

// No closures here, and no `map`: they would not be inlined before it is too late.
impl ThickRay {
    #[inline(always)]
    pub(super) fn new<L: Lanes>(lanes: L, slab: &Slab) -> Self {
        Self {
            near: [near(lanes, slab, 0), near(lanes, slab, 1), near(lanes, slab, 2)],
            far: [far(lanes, slab, 0), far(lanes, slab, 1), far(lanes, slab, 2)],
            near_rows: [near_row(slab, 0), near_row(slab, 1), near_row(slab, 2)],
        }
    }

    /// Which boxes the ray meets at `farthest` or nearer, as a bit for each. Bounds as in
    /// [`EightBoxes`].
    #[inline(always)]
    pub(super) fn meets<L: Lanes>(&self, lanes: L, bounds: &[L::Floats; 6], farthest: f32) -> u32 {
        let (near, far) = self.interval(lanes, &Loaded(bounds), farthest);
        lanes.at_most(near, far)
    }

    /// The interval that the ray spends in each box, up to `farthest`; it misses a box that it
    /// leaves before it enters it.
    #[inline(always)]
    pub(super) fn interval_in<L: Lanes>(
        &self,
        lanes: L,
        boxes: &EightBoxes,
        farthest: f32,
    ) -> (L::Floats, L::Floats) {
        self.interval(lanes, boxes, farthest)
    }

    #[inline(always)]
    fn interval<L: Lanes>(
        &self,
        lanes: L,
        rows: &impl Rows<L>,
        farthest: f32,
    ) -> (L::Floats, L::Floats) {
        let (x, y, z) = (
            usize::from(self.near_rows[0]),
            usize::from(self.near_rows[1]),
            usize::from(self.near_rows[2]),
        );
        let near_x = lanes.distances(rows.row(lanes, x), self.near[0]);
        let near_y = lanes.distances(rows.row(lanes, y), self.near[1]);
        let near_z = lanes.distances(rows.row(lanes, z), self.near[2]);
        // The rows of far planes are the other ones of the six.
        let far_x = lanes.distances(rows.row(lanes, 3 - x), self.far[0]);
        let far_y = lanes.distances(rows.row(lanes, 5 - y), self.far[1]);
        let far_z = lanes.distances(rows.row(lanes, 7 - z), self.far[2]);
        let near = lanes.max(lanes.max(near_x, near_y), lanes.max(near_z, lanes.splat(0.0)));
        let far = lanes.min(lanes.min(far_x, far_y), lanes.min(far_z, lanes.splat(farthest)));
        (near, far)
    }
}

/// Whether a ray goes up along an axis.
#[inline(always)]
fn is_up(slab: &Slab, axis: usize) -> bool {
    slab.inverse(axis) > 0.0
}

#[inline(always)]
fn near_row(slab: &Slab, axis: u8) -> u8 {
    if is_up(slab, usize::from(axis)) { axis } else { axis + 3 }
}

/// How the planes that the ray meets first see it.
#[inline(always)]
fn near<L: Lanes>(lanes: L, slab: &Slab, axis: usize) -> Axis {
    planes(lanes, slab, (axis, is_up(slab, axis)), NEAR_FACTOR)
}

#[inline(always)]
fn far<L: Lanes>(lanes: L, slab: &Slab, axis: usize) -> Axis {
    planes(lanes, slab, (axis, !is_up(slab, axis)), FAR_FACTOR)
}

#[inline(always)]
fn planes<L: Lanes>(lanes: L, slab: &Slab, (axis, is_lower): (usize, bool), factor: f32) -> Axis {
    let away = if is_lower { 1.0 } else { -1.0 };
    lanes.axis(slab.origin(axis, is_lower), slab.inverse(axis) * factor, away)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::Bounds;
    use crate::geometry::lanes::{Instructions, Task};

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => -10f32..10.0,
            1 => (-3i8..=3).prop_map(f32::from),
            1 => Just(-0.0f32),
            1 => -1e11f32..1e11,
            1 => -1e-18f32..1e-18,
            1 => -1e-38f32..1e-38,
        ]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from)
    }

    /// Where a ray enters eight boxes and leaves them.
    struct Intervals<'a>(&'a Slab, &'a EightBoxes);

    impl Task for Intervals<'_> {
        type Output = ([f32; 8], [f32; 8]);

        fn run(self, lanes: impl Lanes) -> Self::Output {
            let ray = ThickRay::new(lanes, self.0);
            let (near, far) = ray.interval_in(lanes, self.1, f32::INFINITY);
            (lanes.store(near), lanes.store(far))
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn no_interval_that_counts_is_cut(
            corners in prop::array::uniform8(prop::array::uniform2(point())),
            origin in point(), direction in point(),
            length in prop_oneof![Just(1f32), Just(1e6), Just(1e-6)],
        ) {
            let direction = direction.normalize_or_zero() * length;
            prop_assume!(direction != Vec3::ZERO);
            let model = Bounds::around(corners.into_iter().flatten());
            let slab = Slab::new(origin, direction, &model);
            let boxes = corners.map(Bounds::around);
            let rows = std::array::from_fn(|row| boxes.map(|it| {
                if row < 3 { it.lower[row] } else { it.upper[row - 3] }
            }));
            for instructions in Instructions::all() {
                let (near, far) = instructions.run(Intervals(&slab, &rows));
                for (lane, bounds) in boxes.iter().enumerate() {
                    let counts = slab.interval(bounds);
                    let is_met = counts.0 <= counts.1;
                    let holds = near[lane] <= counts.0 && counts.1 <= far[lane];
                    prop_assert!(holds || !is_met, "{counts:?} {} {}", near[lane], far[lane]);
                }
            }
        }
    }
}

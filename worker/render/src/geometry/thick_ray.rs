//! A ray as eight boxes at a time see it.
//!
//! Its interval within a box contains the one that [`Slab`] finds for that box and for any box
//! within it, whatever the instruction set. So walks cull no hit that counts, and which hits count
//! is only up to [`Slab`]. Both ends of intervals are moved apart by twice as much as there, which
//! is more than all roundings here.

use bytemuck::{Pod, Zeroable};

use super::lanes::{Axis, Lanes};
use super::slab::Slab;

/// Factor on the scale of near planes: 1 − 2⁻¹⁹.
pub(super) const NEAR_FACTOR: f32 = 1.0 - 1.0 / 524_288.0;

/// Factor on the scale of far planes: 1 + 2⁻¹⁹.
pub(super) const FAR_FACTOR: f32 = 1.0 + 1.0 / 524_288.0;

/// Eight boxes: the lower bounds on each axis, then the upper ones.
pub(super) type EightBoxes = [[[f32; 8]; 3]; 2];

/// A ray as eight boxes at a time see it, for the lanes that it was made for.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct ThickRay {
    near: [Axis; 3],
    /// On x and y, which bounds of [`EightBoxes`] the ray meets first: 0 the lower ones, or 1.
    near_sides: [u32; 2],
    far: [Axis; 3],
    /// The same on z.
    near_side_z: u32,
    unused: u32,
}

/// The bounds of eight boxes, row by row as in [`EightBoxes`].
trait Rows<L: Lanes> {
    /// Bounds on this axis (0 to 2) of this side: the last bit of the number counts.
    fn row(&self, lanes: L, side: u32, axis: usize) -> L::Floats;
}

impl<L: Lanes> Rows<L> for EightBoxes {
    #[inline(always)]
    fn row(&self, lanes: L, side: u32, axis: usize) -> L::Floats {
        lanes.load(&self[(side & 1) as usize][axis])
    }
}

/// Bounds that are loaded already.
struct Loaded<'a, F>(&'a [[F; 3]; 2]);

impl<L: Lanes> Rows<L> for Loaded<'_, L::Floats> {
    #[inline(always)]
    fn row(&self, _lanes: L, side: u32, axis: usize) -> L::Floats {
        self.0[(side & 1) as usize][axis]
    }
}

// No closures here, and no `map`: they would not be inlined before it is too late.
impl ThickRay {
    #[inline(always)]
    pub(super) fn new<L: Lanes>(lanes: L, slab: &Slab) -> Self {
        Self {
            near: [near(lanes, slab, 0), near(lanes, slab, 1), near(lanes, slab, 2)],
            far: [far(lanes, slab, 0), far(lanes, slab, 1), far(lanes, slab, 2)],
            near_sides: [near_side(slab, 0), near_side(slab, 1)],
            near_side_z: near_side(slab, 2),
            unused: 0,
        }
    }

    /// Which boxes the ray meets at `farthest` or nearer, as a bit for each. Bounds as in
    /// [`EightBoxes`].
    #[inline(always)]
    pub(super) fn meets<L: Lanes>(
        &self,
        lanes: L,
        bounds: &[[L::Floats; 3]; 2],
        farthest: f32,
    ) -> u32 {
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
        let ([x, y], z) = (self.near_sides, self.near_side_z);
        let near_x = lanes.distances(rows.row(lanes, x, 0), self.near[0]);
        let near_y = lanes.distances(rows.row(lanes, y, 1), self.near[1]);
        let near_z = lanes.distances(rows.row(lanes, z, 2), self.near[2]);
        let far_x = lanes.distances(rows.row(lanes, x ^ 1, 0), self.far[0]);
        let far_y = lanes.distances(rows.row(lanes, y ^ 1, 1), self.far[1]);
        let far_z = lanes.distances(rows.row(lanes, z ^ 1, 2), self.far[2]);
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
fn near_side(slab: &Slab, axis: usize) -> u32 {
    u32::from(!is_up(slab, axis))
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
            let rows = [
                std::array::from_fn(|axis| boxes.map(|it| it.lower[axis])),
                std::array::from_fn(|axis| boxes.map(|it| it.upper[axis])),
            ];
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

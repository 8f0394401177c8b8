//! Rays made ready for tests against boxes and triangles, eight at a time.
//!
//! The same operations in the same order as [`Probe::new`] and [`ThickRay::new`], and so the same
//! bits; what takes a division or a choice there takes an eighth of one here.

use equilux_common::ray::Ray;

use super::Bounds;
use super::hierarchy::SHARED_RAYS_MAX;
use super::lanes::Lanes;
use super::slab::{COMPONENT_MIN, SIDEWAYS_ERROR};
use super::thick_ray::{self, ThickRay};
use super::triangle::Probe;

/// A row of a record: eight of its numbers.
type Row = [f32; 8];

/// Rows of a [`Probe`].
const PROBE_ROWS: usize = size_of::<Probe>() / size_of::<Row>();

/// Rows of a [`ThickRay`].
const THICK_ROWS: usize = size_of::<ThickRay>() / size_of::<Row>();

/// Rays that have been made ready; reuse it.
#[derive(Debug, Default)]
pub(super) struct Ready {
    probes: Vec<Probe>,
    thick: Vec<ThickRay>,
}

impl Ready {
    /// Makes rays ready, at most [`SHARED_RAYS_MAX`], in a model within `bounds`. Gives them as
    /// triangles see them, and as boxes do; there may be more of both than rays.
    #[inline(always)]
    pub(super) fn make<L: Lanes>(
        &mut self,
        lanes: L,
        rays: &[Ray],
        bounds: &Bounds,
    ) -> (&[Probe], &[ThickRay]) {
        self.probes.resize(SHARED_RAYS_MAX, Probe::default());
        self.thick.resize(SHARED_RAYS_MAX, ThickRay::default());
        let probe_rows: &mut [Row] = bytemuck::cast_slice_mut(&mut self.probes);
        let thick_rows: &mut [Row] = bytemuck::cast_slice_mut(&mut self.thick);
        let places =
            probe_rows.chunks_mut(8 * PROBE_ROWS).zip(thick_rows.chunks_mut(8 * THICK_ROWS));
        for (rays, (probe_rows, thick_rows)) in rays.chunks(8).zip(places) {
            make_eight(lanes, rays, bounds, probe_rows, thick_rows);
        }
        (&self.probes, &self.thick)
    }
}

/// Three numbers of each ray, one for each axis.
type Three<L> = [<L as Lanes>::Floats; 3];

/// Rays as lower and upper planes of boxes see them.
struct Slabs<L: Lanes> {
    above: Three<L>,
    below: Three<L>,
    inverse: Three<L>,
}

/// Makes up to eight rays ready.
#[inline(always)]
fn make_eight<L: Lanes>(
    lanes: L,
    rays: &[Ray],
    bounds: &Bounds,
    probe_rows: &mut [Row],
    thick_rows: &mut [Row],
) {
    let mut rows = [[0.0; 8]; 8];
    for (row, Ray { origin: [x, y, z], direction: [dx, dy, dz], .. }) in rows.iter_mut().zip(rays) {
        *row = [*x, *y, *z, *dx, *dy, *dz, 0.0, 0.0];
    }
    let [x, y, z, dx, dy, dz, _, zero] = lanes.turn([
        lanes.load(&rows[0]),
        lanes.load(&rows[1]),
        lanes.load(&rows[2]),
        lanes.load(&rows[3]),
        lanes.load(&rows[4]),
        lanes.load(&rows[5]),
        lanes.load(&rows[6]),
        lanes.load(&rows[7]),
    ]);
    let (origin, direction) = ([x, y, z], [dx, dy, dz]);
    let (shear, axes) = shear(lanes, direction);
    let slabs = Slabs::new(lanes, origin, direction, bounds);
    let Slabs { above, below, inverse } = &slabs;

    put(lanes, [x, y, z, dx, dy, dz, shear[0], shear[1]], probe_rows, (0, PROBE_ROWS));
    let seen = [above[0], above[1], above[2], zero, below[0], below[1], below[2], zero];
    put(lanes, seen, probe_rows, (1, PROBE_ROWS));
    let last = [inverse[0], inverse[1], inverse[2], zero, axes[0], axes[1], axes[2], zero];
    put(lanes, last, probe_rows, (2, PROBE_ROWS));

    let (x, y, z) = (slabs.axis(lanes, 0), slabs.axis(lanes, 1), slabs.axis(lanes, 2));
    let near = [x.near.0, x.near.1, y.near.0, y.near.1, z.near.0, z.near.1, x.side, y.side];
    put(lanes, near, thick_rows, (0, THICK_ROWS));
    let far = [x.far.0, x.far.1, y.far.0, y.far.1, z.far.0, z.far.1, z.side, zero];
    put(lanes, far, thick_rows, (1, THICK_ROWS));
}

/// Puts eight numbers of each ray into a row of its record, which has `stride` of them.
#[inline(always)]
fn put<L: Lanes>(
    lanes: L,
    numbers: [L::Floats; 8],
    rows: &mut [Row],
    (row, stride): (usize, usize),
) {
    let numbers = lanes.turn(numbers);
    for (record, numbers) in rows.chunks_exact_mut(stride).zip(numbers) {
        record[row] = lanes.store(numbers);
    }
}

/// See [`Probe::new`]: also the axes that become x, y and z, as bits.
#[inline(always)]
fn shear<L: Lanes>(lanes: L, [dx, dy, dz]: Three<L>) -> ([L::Floats; 2], Three<L>) {
    let sizes = [lanes.abs(dx), lanes.abs(dy), lanes.abs(dz)];
    let along = by_largest(lanes, sizes, [dx, dy, dz]);
    let shear = [
        lanes.div(by_largest(lanes, sizes, [dy, dz, dx]), along),
        lanes.div(by_largest(lanes, sizes, [dz, dx, dy]), along),
    ];
    let [x, y, z] = [
        lanes.splat(f32::from_bits(0)),
        lanes.splat(f32::from_bits(1)),
        lanes.splat(f32::from_bits(2)),
    ];
    let axes = [
        by_largest(lanes, sizes, [y, z, x]),
        by_largest(lanes, sizes, [z, x, y]),
        by_largest(lanes, sizes, [x, y, z]),
    ];
    (shear, axes)
}

/// The number for the axis on which the size is largest.
#[inline(always)]
fn by_largest<L: Lanes>(lanes: L, [sx, sy, sz]: Three<L>, [x, y, z]: Three<L>) -> L::Floats {
    let of_others = lanes.select_at_most(sz, sy, y, z);
    let x = lanes.select_at_most(sz, sx, x, of_others);
    lanes.select_at_most(sy, sx, x, of_others)
}

/// A ray along one axis, as in [`ThickRay`]: scale and start.
struct AxisLanes<L: Lanes> {
    near: (L::Floats, L::Floats),
    far: (L::Floats, L::Floats),
    side: L::Floats,
}

impl<L: Lanes> Slabs<L> {
    #[inline(always)]
    fn new(lanes: L, origin: Three<L>, direction: Three<L>, bounds: &Bounds) -> Self {
        let reach = [
            reach(lanes, origin[0], (bounds.lower.x, bounds.upper.x)),
            reach(lanes, origin[1], (bounds.lower.y, bounds.upper.y)),
            reach(lanes, origin[2], (bounds.lower.z, bounds.upper.z)),
        ];
        let most = lanes.max(reach[0], lanes.max(reach[1], reach[2]));
        let x = seen(lanes, origin[0], lanes.add(reach[0], most));
        let y = seen(lanes, origin[1], lanes.add(reach[1], most));
        let z = seen(lanes, origin[2], lanes.add(reach[2], most));
        let inverse = [
            inverse(lanes, direction[0]),
            inverse(lanes, direction[1]),
            inverse(lanes, direction[2]),
        ];
        Self { above: [x.0, y.0, z.0], below: [x.1, y.1, z.1], inverse }
    }

    #[inline(always)]
    fn axis(&self, lanes: L, axis: usize) -> AxisLanes<L> {
        let (above, below) = (self.above[axis], self.below[axis]);
        let inverse = self.inverse[axis];
        let least = lanes.splat(f32::from_bits(1));
        let (up, down) = (lanes.splat(1.0), lanes.splat(-1.0));
        let near_origin = lanes.select_at_most(least, inverse, above, below);
        let far_origin = lanes.select_at_most(least, inverse, below, above);
        let near_away = lanes.select_at_most(least, inverse, up, down);
        let far_away = lanes.select_at_most(least, inverse, down, up);
        let near_scale = lanes.mul(inverse, lanes.splat(thick_ray::NEAR_FACTOR));
        let far_scale = lanes.mul(inverse, lanes.splat(thick_ray::FAR_FACTOR));
        let lower = lanes.splat(f32::from_bits(0));
        AxisLanes {
            near: (near_scale, lanes.starts(near_origin, near_scale, near_away)),
            far: (far_scale, lanes.starts(far_origin, far_scale, far_away)),
            side: lanes.select_at_most(least, inverse, lower, lanes.splat(f32::from_bits(1))),
        }
    }
}

/// How far the model reaches from an origin along an axis.
#[inline(always)]
fn reach<L: Lanes>(lanes: L, origin: L::Floats, (lower, upper): (f32, f32)) -> L::Floats {
    let below = lanes.abs(lanes.sub(lanes.splat(lower), origin));
    let above = lanes.abs(lanes.sub(lanes.splat(upper), origin));
    lanes.max(below, above)
}

/// Where rays begin as lower and as upper planes see them.
#[inline(always)]
fn seen<L: Lanes>(lanes: L, origin: L::Floats, reach: L::Floats) -> (L::Floats, L::Floats) {
    let thickness = lanes.mul(reach, lanes.splat(SIDEWAYS_ERROR));
    let zero = lanes.splat(0.0);
    let below = lanes.sub(zero, lanes.sub(origin, thickness));
    (lanes.next_up(lanes.add(origin, thickness)), lanes.sub(zero, lanes.next_up(below)))
}

/// The reciprocal of a direction's component: never zero or infinite.
#[inline(always)]
fn inverse<L: Lanes>(lanes: L, component: L::Floats) -> L::Floats {
    let (least, below) = (lanes.splat(COMPONENT_MIN), lanes.splat(COMPONENT_MIN.next_down()));
    let least = lanes.copy_sign(least, component);
    let component = lanes.select_at_most(lanes.abs(component), below, least, component);
    lanes.div(lanes.splat(1.0), component)
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::lanes::{Instructions, Task};

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => -10f32..10.0,
            1 => (-3i8..=3).prop_map(f32::from),
            1 => Just(-0.0f32),
            1 => -1e11f32..1e11,
            1 => -1e-18f32..1e-18,
            1 => -1e-38f32..1e-38,
        ]
    }

    fn point() -> impl Strategy<Value = [f32; 3]> {
        [number(), number(), number()]
    }

    /// Makes rays ready both ways, as bits.
    struct BothWays<'a>(&'a [Ray], &'a Bounds);

    impl Task for BothWays<'_> {
        type Output = [Vec<Vec<u32>>; 2];

        fn run(self, lanes: impl Lanes) -> Self::Output {
            let Self(rays, bounds) = self;
            let bits = |probe: &Probe, thick: &ThickRay| {
                let words = [bytemuck::bytes_of(probe), bytemuck::bytes_of(thick)].concat();
                bytemuck::pod_collect_to_vec::<u8, u32>(&words)
            };
            let mut ready = Ready::default();
            let (probes, thick) = ready.make(lanes, rays, bounds);
            let many = probes.iter().zip(thick).map(|(probe, thick)| bits(probe, thick));
            let single = |ray| {
                let probe = Probe::new(ray, bounds);
                bits(&probe, &ThickRay::new(lanes, &probe.slab))
            };
            [many.take(rays.len()).collect(), rays.iter().map(single).collect()]
        }
    }

    proptest! {
        #[test]
        fn rays_are_the_same_however_many_are_made_ready(
            lines in prop::collection::vec((point(), point()), 1..=SHARED_RAYS_MAX),
            corners in prop::array::uniform2(point()),
        ) {
            let bounds = Bounds::around(corners.map(Vec3::from));
            let ray = |(origin, direction): ([f32; 3], [f32; 3])| {
                let direction = Vec3::from(direction).normalize_or(Vec3::Y).into();
                Ray { origin, direction, ..Ray::zeroed() }
            };
            let rays: Vec<Ray> = lines.into_iter().map(ray).collect();
            for instructions in Instructions::all() {
                let [many, single] = instructions.run(BothWays(&rays, &bounds));
                prop_assert_eq!(many, single);
            }
        }
    }
}

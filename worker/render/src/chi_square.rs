//! For tests alone: Pearson's χ² of directions that were drawn against the density that they claim.
//!
//! The sphere is cut into cells around an axis. The rings grow by a constant factor, so that a lobe
//! around the axis is resolved whatever its width.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

/// Rings per sphere and cells per ring.
const RINGS: usize = 20;
const SECTORS: usize = 12;

/// Points per side of a cell at which the density is evaluated.
const POINTS: usize = 16;

/// Least expected count of a cell; smaller ones are pooled.
const EXPECTED_MIN: f64 = 5.0;

/// A counter-based source of numbers for tests (SplitMix64).
pub(crate) struct Numbers(u64);

impl Numbers {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// From 0 to below 1, with 24 bits.
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / 16_777_216.0
    }

    pub(crate) fn next3(&mut self) -> [f32; 3] {
        std::array::from_fn(|_| self.next())
    }
}

/// The sphere in cells around an axis.
pub(crate) struct SphereGrid {
    axes: [DVec3; 3],
    /// Polar angles between the rings: 0, `finest`, … π.
    edges: Vec<f64>,
}

impl SphereGrid {
    /// Cells around `axis` whose innermost ring has the radius `finest` (radians).
    pub(crate) fn new(axis: Vec3, finest: f64) -> Self {
        let z = axis.as_dvec3().normalize();
        let x = z.any_orthonormal_vector();
        let growth = libm::pow(PI / finest, 1.0 / (RINGS - 1) as f64);
        let rings = (0..RINGS).map(|ring| finest * libm::pow(growth, ring as f64));
        let mut edges: Vec<f64> = std::iter::once(0.0).chain(rings).collect();
        edges[RINGS] = PI;
        Self { axes: [x, z.cross(x), z], edges }
    }

    /// The integral of `f` over each cell, by the midpoint rule.
    pub(crate) fn integrals(&self, f: impl Fn(Vec3) -> f64) -> Vec<f64> {
        let cell = |index: usize| {
            let (ring, sector) = (index / SECTORS, index % SECTORS);
            let (inner, outer) = (self.edges[ring], self.edges[ring + 1]);
            let (width, turn) =
                ((outer - inner) / POINTS as f64, 2.0 * PI / (SECTORS * POINTS) as f64);
            let mut sum = 0.0;
            for point in 0..POINTS * POINTS {
                let polar = inner + ((point / POINTS) as f64 + 0.5) * width;
                let azimuth = ((sector * POINTS + point % POINTS) as f64 + 0.5) * turn;
                sum += f(self.direction(polar, azimuth)) * libm::sin(polar);
            }
            sum * width * turn
        };
        (0..RINGS * SECTORS).map(cell).collect()
    }

    /// The cell in which a direction lies.
    fn cell(&self, direction: Vec3) -> usize {
        let [x, y, z] = self.axes.map(|axis| axis.dot(direction.as_dvec3()));
        let polar = libm::atan2(libm::hypot(x, y), z);
        let ring = self.edges.partition_point(|&edge| edge <= polar).clamp(1, RINGS) - 1;
        let turn = libm::atan2(y, x) / (2.0 * PI);
        let sector = ((turn - turn.floor()) * SECTORS as f64) as usize;
        ring * SECTORS + sector.min(SECTORS - 1)
    }

    fn direction(&self, polar: f64, azimuth: f64) -> Vec3 {
        let [x, y, z] = self.axes;
        let around = x * libm::cos(azimuth) + y * libm::sin(azimuth);
        (around * libm::sin(polar) + z * libm::cos(polar)).as_vec3()
    }
}

/// The probability that draws from `pdf` differ from it as much as `count` draws of `sample` do.
/// A draw of none belongs to what the density lacks of 1.
pub(crate) fn p_value(
    grid: &SphereGrid,
    count: u32,
    mut sample: impl FnMut() -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f64,
) -> f64 {
    let mut probabilities = grid.integrals(pdf);
    probabilities.push((1.0 - probabilities.iter().sum::<f64>()).max(0.0));
    let mut counts = vec![0.0; probabilities.len()];
    let none = counts.len() - 1;
    for _ in 0..count {
        counts[sample().map_or(none, |direction| grid.cell(direction))] += 1.0;
    }
    let cells = counts.into_iter().zip(probabilities.iter().map(|p| p * f64::from(count)));
    pearson(cells.collect())
}

/// The p-value of observed and expected counts, neighbors in the order of expectation pooled.
pub(crate) fn pearson(mut cells: Vec<(f64, f64)>) -> f64 {
    cells.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut statistic, mut pools) = (0.0, 0_u32);
    let (mut observed, mut expected) = (0.0, 0.0);
    for (position, &(seen, due)) in cells.iter().enumerate() {
        observed += seen;
        expected += due;
        if expected >= EXPECTED_MIN || (position + 1 == cells.len() && expected > 0.0) {
            statistic += (observed - expected) * (observed - expected) / expected;
            pools += 1;
            (observed, expected) = (0.0, 0.0);
        }
    }
    assert!(observed == 0.0, "{observed} draws where the density is zero");
    if pools < 2 { 1.0 } else { upper_gamma(0.5 * f64::from(pools - 1), 0.5 * statistic) }
}

/// The regularized upper incomplete gamma function Q(a, x): the series of P below a + 1, Lentz's
/// continued fraction above (Abramowitz & Stegun 6.5.29 and 6.5.31).
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let scale = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for n in 1..1000 {
            term *= x / (a + f64::from(n));
            sum += term;
        }
        return 1.0 - scale * sum;
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut fraction = d;
    for n in 1..1000 {
        let term = f64::from(n) * (a - f64::from(n));
        b += 2.0;
        d = 1.0 / (term * d + b);
        c = b + term / c;
        fraction *= c * d;
    }
    scale * fraction
}

mod tests {
    use super::*;
    use crate::warp;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, quantile, p) in
            [(1.0, 3.841_459, 0.05), (10.0, 18.307_04, 0.05), (100.0, 70.064_89, 0.99)]
        {
            assert!((upper_gamma(0.5 * freedom, 0.5 * quantile) - p).abs() < 1e-6);
        }
    }

    #[test]
    fn it_tells_a_right_density_from_a_wrong_one() {
        let mut numbers = Numbers::new(1);
        let grid = SphereGrid::new(Vec3::new(0.3, 0.5, 0.8), 0.2);
        let mut test = |density: fn(Vec3) -> f64| {
            let sample = || Some(warp::cosine_hemisphere([numbers.next(), numbers.next()]));
            p_value(&grid, 100_000, sample, density)
        };
        assert!(test(|w| f64::from(w.z.max(0.0)) / PI) > 0.001);
        assert!(test(|w| if w.z > 0.0 { 0.5 / PI } else { 0.0 }) < 1e-9);
    }
}

//! What shadow rays go to: the scene's area lights, or the top of the model where it has none.

use equilux_common::ray::NO_PRIMITIVE;
use equilux_common::scene::Luminaire;
use equilux_render::geometry::Bounds;
use equilux_render::warp;
use glam::Vec3;

/// Triangles, chosen by their areas.
pub(super) struct Targets {
    triangles: Vec<TargetTriangle>,
    /// Sum of the areas up to and including each triangle's.
    area_sums: Vec<f64>,
    is_light: bool,
}

struct TargetTriangle {
    corners: [Vec3; 3],
    primitive: u32,
}

/// A point that a shadow ray goes to.
pub(super) struct Target {
    pub(super) point: Vec3,
    /// Of the side that shines; not of unit length.
    pub(super) normal: Vec3,
    /// The light's primitive id, or [`NO_PRIMITIVE`].
    pub(super) primitive: u32,
}

impl Targets {
    /// All luminaires, or the top of the bounds if there are none.
    pub(super) fn new(luminaires: &[Luminaire], bounds: &Bounds) -> Self {
        let is_light = !luminaires.is_empty();
        let triangles: Vec<TargetTriangle> = if is_light {
            let triangle = |it: &Luminaire| TargetTriangle {
                corners: it.corners.map(Vec3::from),
                primitive: it.primitive,
            };
            luminaires.iter().map(triangle).collect()
        } else {
            top(bounds).map(|corners| TargetTriangle { corners, primitive: NO_PRIMITIVE }).into()
        };
        let area_sums = triangles.iter().scan(0.0, |sum, triangle| {
            *sum += f64::from(triangle.normal().length());
            Some(*sum)
        });
        Self { area_sums: area_sums.collect(), triangles, is_light }
    }

    /// Whether they are lights.
    pub(super) const fn is_light(&self) -> bool {
        self.is_light
    }

    /// A point, uniform by area; none if there is no area.
    pub(super) fn pick(&self, [u0, u1, u2]: [f32; 3]) -> Option<Target> {
        let sum = f64::from(u0) * self.area_sums.last()?;
        let chosen = self.area_sums.partition_point(|&it| it <= sum);
        let triangle = self.triangles.get(chosen)?;
        let [a, b, c] = triangle.corners;
        let weights = warp::triangle([u1, u2]);
        let point = a * weights[0] + b * weights[1] + c * weights[2];
        Some(Target { point, normal: triangle.normal(), primitive: triangle.primitive })
    }
}

impl TargetTriangle {
    /// Twice as long as the triangle is large.
    fn normal(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }
}

/// The upper side of a box as triangles that look down.
fn top(Bounds { lower, upper }: &Bounds) -> [[Vec3; 3]; 2] {
    let corner = |x, z| Vec3::new(x, upper.y, z);
    let (first, last) = (corner(lower.x, lower.z), corner(upper.x, upper.z));
    [[first, corner(upper.x, lower.z), last], [first, last, corner(lower.x, upper.z)]]
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds =
        Bounds { lower: Vec3::new(-1.0, -2.0, -3.0), upper: Vec3::new(3.0, 2.0, 1.0) };

    #[test]
    fn without_lights_the_top_shines_down() {
        let targets = Targets::new(&[], &BOUNDS);
        assert!(!targets.is_light());
        let mut sum = Vec3::ZERO;
        for index in 0..64u8 {
            let u = [index % 4, index / 4 % 4, index / 16].map(|at| (f32::from(at) + 0.5) / 4.0);
            let Target { point, normal, primitive } = targets.pick(u).expect("a point");
            assert!(point.y == 2.0 && normal.y < 0.0 && primitive == NO_PRIMITIVE);
            sum += point / 64.0;
        }
        assert!(sum.distance(Vec3::new(1.0, 2.0, -1.0)) < 0.2, "{sum}");
    }

    #[test]
    fn lights_are_chosen_by_their_areas() {
        let light = |primitive: u8, side: f32| Luminaire {
            primitive: u32::from(primitive),
            material: 0,
            corners: [[0.0; 3], [side, 0.0, 0.0], [0.0, side, 0.0]],
        };
        let targets = Targets::new(&[light(7, 1.0), light(8, 0.0), light(9, 3.0)], &BOUNDS);
        assert!(targets.is_light());
        let primitive = |u| targets.pick([u, 0.5, 0.5]).expect("a point").primitive;
        assert_eq!([0.0, 0.09, 0.11, 0.99].map(primitive), [7, 7, 9, 9]);
    }

    #[test]
    fn nothing_is_picked_where_there_is_no_area() {
        assert!(
            Targets::new(&[], &Bounds { upper: BOUNDS.lower, ..BOUNDS }).pick([0.5; 3]).is_none()
        );
    }
}

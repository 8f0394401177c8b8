//! What the kernel is measured against: the trees of the crate `obvhs`, traced as the crate itself
//! does it.
//!
//! Its triangle test is not watertight, so its hits differ from ours here and there. A ray is made
//! ready for it (the inverse of its direction) while time is taken, as ours are.

use std::time::Duration;

use equilux_common::ray::Ray;
use equilux_common::scene::{Geometry, Scene};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use super::timing::{Kernel, now};

/// The yardstick that ratios are taken to.
pub(super) const CWBVH: &str = "obvhs-cwbvh";

/// Without splitting triangles beforehand, as trees of ours are.
const QUALITY: BvhBuildParams = BvhBuildParams::medium_build();

/// A tree of `obvhs` over triangles, in the order of its leaves.
struct Yardstick<T> {
    name: &'static str,
    tree: T,
    triangles: Vec<RtTriangle>,
}

/// A yardstick, and how long it took to build with all threads.
pub(super) struct Built {
    pub(super) kernel: Box<dyn Kernel>,
    pub(super) elapsed: Duration,
}

/// What the two trees have in common.
trait Tree {
    /// The position in the model of each triangle, in the order of the leaves.
    fn order(&self) -> &[u32];

    /// Finds the closest hit.
    fn closest(&self, ray: obvhs::ray::Ray, hit: &mut RayHit, triangles: &[RtTriangle]);

    /// Whether nothing is hit but the light.
    fn is_missed(&self, ray: obvhs::ray::Ray, light: u32, triangles: &[RtTriangle]) -> bool;
}

/// Both trees have these functions by the same names, but no trait for them.
macro_rules! tree {
    ($name:ty) => {
        impl Tree for $name {
            fn order(&self) -> &[u32] {
                &self.primitive_indices
            }

            fn closest(&self, ray: obvhs::ray::Ray, hit: &mut RayHit, triangles: &[RtTriangle]) {
                self.ray_traverse(ray, hit, |ray, slot| triangles[slot].intersect(ray));
            }

            fn is_missed(
                &self,
                ray: obvhs::ray::Ray,
                light: u32,
                triangles: &[RtTriangle],
            ) -> bool {
                self.ray_traverse_miss(ray, |ray, slot| {
                    let distance = triangles[slot].intersect(ray);
                    let is_light = distance < ray.tmax && self.primitive_indices[slot] == light;
                    if is_light { f32::INFINITY } else { distance }
                })
            }
        }
    };
}

tree!(Bvh2);
tree!(CwBvh);

/// The triangles of a scene by their primitive ids, those of prototypes at each of their places.
pub(super) fn triangles(scene: &Scene) -> Vec<Triangle> {
    let corners = |geometry: &Geometry, triangle| geometry.world_triangle(triangle).corners;
    let loose = scene.geometry.triangles.iter().map(|it| corners(&scene.geometry, it));
    let placed = scene.placements().flat_map(|placement| {
        let geometry = &scene.prototypes[placement.prototype].geometry;
        geometry.triangles.iter().map(move |triangle| {
            let placing = placement.placing;
            placing.order(corners(geometry, triangle).map(|corner| placing.corner(corner)))
        })
    });
    let triangle = |corners: [[f32; 3]; 3]| {
        let [v0, v1, v2] = corners.map(Vec3A::from);
        Triangle { v0, v1, v2 }
    };
    loose.chain(placed).map(triangle).collect()
}

/// Builds all yardsticks.
pub(super) fn build(triangles: &[Triangle]) -> [Built; 2] {
    // How long the trees alone take is not asked: leaves without triangles are of no use.
    let ignored = || Duration::ZERO;
    [
        build_one("obvhs-bvh2", triangles, || {
            build_bvh2_from_tris(triangles, QUALITY, &mut ignored())
        }),
        build_one(CWBVH, triangles, || build_cwbvh_from_tris(triangles, QUALITY, &mut ignored())),
    ]
}

fn build_one<T: Tree + 'static>(
    name: &'static str,
    triangles: &[Triangle],
    tree: impl FnOnce() -> T,
) -> Built {
    let started = now();
    let tree = tree();
    let in_leaves = tree.order().iter().map(|&at| RtTriangle::from(&triangles[at as usize]));
    let triangles = in_leaves.collect();
    Built { kernel: Box::new(Yardstick { name, tree, triangles }), elapsed: started.elapsed() }
}

impl<T: Tree> Kernel for Yardstick<T> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn closest(&mut self, rays: &mut [Ray]) {
        for ray in rays {
            let mut hit = RayHit::none();
            self.tree.closest(ready(ray), &mut hit, &self.triangles);
            if let Some(&primitive) = self.tree.order().get(hit.primitive_id as usize) {
                (ray.distance, ray.hit_primitive) = (hit.t, primitive);
            }
        }
    }

    fn any(&mut self, rays: &[Ray], are_hit: &mut [bool]) {
        for (ray, is_hit) in rays.iter().zip(are_hit) {
            *is_hit = !self.tree.is_missed(ready(ray), ray.hit_primitive, &self.triangles);
        }
    }
}

fn ready(ray: &Ray) -> obvhs::ray::Ray {
    obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), 0.0, ray.distance)
}

//! The stages that a ray goes through: the loop of the paper's section 2, one ray at a time.
//!
//! *Intersect* is [`crate::geometry::Partition::intersect`]; *shade* is [`shade()`]; *shadow* is
//! [`crate::geometry::Partition::is_occluded`], after which the contribution that the shadow ray
//! carries counts or not. Bundles and the reference renderer call these very functions, which is
//! why they agree to the bit.

mod scatter;
mod shade;
mod weight;

use equilux_common::film::Features;
use equilux_common::ray::Ray;
use glam::Vec3;

pub(crate) use self::shade::shade;

/// What shading a ray came to.
#[derive(Debug, Default)]
pub(crate) struct Shaded {
    /// The contribution of what the ray met; zero if none.
    pub(crate) radiance: Vec3,
    /// What a camera ray saw.
    pub(crate) features: Option<Features>,
    /// Shadow rays that were spawned.
    pub(crate) shadow_rays: Vec<Ray>,
    /// Indirect rays that were spawned.
    pub(crate) indirect_rays: Vec<Ray>,
    /// The specular ray, if one was spawned.
    pub(crate) specular_ray: Option<Ray>,
}

impl Shaded {
    fn clear(&mut self) {
        self.radiance = Vec3::ZERO;
        self.features = None;
        self.shadow_rays.clear();
        self.indirect_rays.clear();
        self.specular_ray = None;
    }
}

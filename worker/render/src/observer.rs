//! Who watches rays being traced: a door for measuring, since light reads no clock itself.
//!
//! Tracing is compiled anew for each observer, so that the one that looks away, `()`, costs
//! nothing.

use equilux_common::bundle::Stage;
use equilux_common::ray::Ray;

/// Is told what has been done, in the order in which one thread does it.
pub trait Observer {
    /// Camera rays have been spawned.
    fn started(&mut self, rays: &[Ray]);

    /// Some rays that awaited `stage` went through it and, after `Intersect`, were shaded. A shadow
    /// ray has the depth of the ray at whose hit it was cast.
    fn advanced(&mut self, stage: Stage, rays: &[Ray]);
}

impl Observer for () {
    #[inline]
    fn started(&mut self, _: &[Ray]) {}

    #[inline]
    fn advanced(&mut self, _: Stage, _: &[Ray]) {}
}

//! The camera as the scene file describes it.

use serde::{Deserialize, Serialize};

/// A pinhole or thin-lens camera. Right-handed world, square pixels, row 0 at the top.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Where it stands.
    pub eye: [f32; 3],
    /// What it looks at; not `eye`.
    pub target: [f32; 3],
    /// Roughly up; not parallel to the view.
    pub up: [f32; 3],
    /// Full vertical angle of view in degrees, between 0 and 180.
    pub vfov: f32,
    /// Diameter of the lens in scene units; 0 is a pinhole.
    pub aperture: f32,
    /// Distance of the plane in focus, along the view.
    pub focus_distance: f32,
}

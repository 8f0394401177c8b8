//! What the paths of a scene cost: measured in a real render, spent again in simulated ones.
//!
//! The image is divided into square cells; of each it is known how many rays of each depth a path
//! through it has, and how long a ray of that depth takes. So a simulated cluster is as unevenly
//! loaded as a real one would be by the same scene.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::itinerary::PartitionedCosts;
use crate::job::{SAMPLES_MAX, SIDE_PIXELS_MAX};

/// The layout that is written and read here.
pub const COSTS_VERSION: u32 = 2;

/// Most path segments that are told apart; deeper ones count with the last.
pub const COST_DEPTHS_MAX: usize = 32;

/// The longest start, a day: longer ones are mistakes.
const PREPARE_S_MAX: f64 = 86_400.0;

/// The most bytes of a pixel's film values; none has as many.
const PIXEL_BYTES_MAX: f64 = 1e6;

/// Most rays of one depth per path: more than paths may branch into is a mistake.
const RAYS_PER_PATH_MAX: f32 = 1e9;

/// No path takes less.
const PATH_NANOS_MIN: f64 = 1.0;

/// The longest mean path, a quarter of an hour, so that no sum of paths overflows.
const PATH_NANOS_MAX: f64 = 1e12;

/// What the paths of a scene cost on one thread of the machine that measured it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneCosts {
    /// Layout: [`COSTS_VERSION`].
    pub equilux_costs: u32,
    /// The scene, as tables name it.
    pub scene: String,
    /// Columns of the image that was rendered.
    pub width: u32,
    /// Rows of it.
    pub height: u32,
    /// Samples per pixel of it.
    pub samples_per_pixel: u32,
    /// Side of a cell in its pixels.
    pub cell_side_pixels: u32,
    /// From being told of a job whose scene is at hand to the first ray, in seconds.
    pub prepare_s: f64,
    /// Bytes on the wire of the film values of one touched pixel, on average.
    pub bytes_per_pixel: f64,
    /// The cells, row by row.
    pub cells: Vec<CellCosts>,
    /// Where paths go in a model that is cut into partitions.
    pub partitioned: Option<PartitionedCosts>,
}

/// A cell, by depth: camera rays first. Shadow rays count with the ray at whose hit they are cast.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CellCosts {
    /// Rays of this depth per camera path.
    pub rays_per_path: Vec<f32>,
    /// Compute time of a ray of this depth, its shading and its shadow rays included.
    pub nanos_per_ray: Vec<f32>,
}

/// A file that holds no costs.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}; record it again with `equilux render SCENE --record-costs FILE`")]
pub struct InvalidCosts(String);

impl SceneCosts {
    /// Reads what [`Self::to_json`] wrote.
    ///
    /// # Errors
    /// If it is something else, or its parts contradict each other.
    pub fn from_json(text: &str) -> Result<Self, InvalidCosts> {
        let costs: Self =
            serde_json::from_str(text).map_err(|error| InvalidCosts(error.to_string()))?;
        costs.check().map_err(InvalidCosts)?;
        Ok(costs)
    }

    /// The file's text.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("numbers and names")
    }

    /// Columns and rows of cells.
    #[must_use]
    pub const fn cell_counts(&self) -> (u32, u32) {
        (self.width.div_ceil(self.cell_side_pixels), self.height.div_ceil(self.cell_side_pixels))
    }

    /// The mean compute time of a path over the whole image.
    #[must_use]
    pub fn path_cost(&self) -> Duration {
        let total: f64 = self.cells.iter().map(CellCosts::path_nanos).sum();
        Duration::from_secs_f64(total / self.cells.len() as f64 / 1e9)
    }

    fn check(&self) -> Result<(), String> {
        if self.equilux_costs != COSTS_VERSION {
            return Err(format!(
                "layout {}; this program reads {COSTS_VERSION}",
                self.equilux_costs
            ));
        }
        let sides = [self.width, self.height, self.cell_side_pixels];
        if !sides.iter().all(|side| (1..=SIDE_PIXELS_MAX).contains(side)) {
            return Err(format!(
                "`width`, `height` and `cell_side_pixels` must be from 1 to {SIDE_PIXELS_MAX}"
            ));
        }
        if !(1..=SAMPLES_MAX).contains(&self.samples_per_pixel) {
            return Err(format!("`samples_per_pixel` must be from 1 to {SAMPLES_MAX}"));
        }
        let (columns, rows) = self.cell_counts();
        if self.cells.len() as u64 != u64::from(columns) * u64::from(rows) {
            return Err(format!("{} cells, not {columns} × {rows}", self.cells.len()));
        }
        if !(0.0..=PREPARE_S_MAX).contains(&self.prepare_s) {
            return Err(format!("`prepare_s` must be from 0 to {PREPARE_S_MAX}"));
        }
        if !(0.0..=PIXEL_BYTES_MAX).contains(&self.bytes_per_pixel) {
            return Err(format!("`bytes_per_pixel` must be from 0 to {PIXEL_BYTES_MAX}"));
        }
        if let Some(index) = self.cells.iter().position(|cell| !cell.is_consistent()) {
            return Err(format!("cells[{index}]: lists of another length, or bad numbers"));
        }
        self.partitioned.as_ref().map_or(Ok(()), |partitioned| partitioned.check(self.cells.len()))
    }
}

impl CellCosts {
    /// The mean compute time of a path through the cell in nanoseconds.
    #[must_use]
    pub fn path_nanos(&self) -> f64 {
        let depths = self.rays_per_path.iter().zip(&self.nanos_per_ray);
        depths.map(|(&rays, &nanos)| f64::from(rays) * f64::from(nanos)).sum()
    }

    fn is_consistent(&self) -> bool {
        let numbers = || self.rays_per_path.iter().chain(&self.nanos_per_ray);
        (1..=COST_DEPTHS_MAX).contains(&self.rays_per_path.len())
            && self.rays_per_path.len() == self.nanos_per_ray.len()
            && numbers().all(|number| number.is_finite() && *number >= 0.0)
            && self.rays_per_path.iter().all(|&rays| rays <= RAYS_PER_PATH_MAX)
            && (PATH_NANOS_MIN..=PATH_NANOS_MAX).contains(&self.path_nanos())
            && self.rays_per_path[0] > 0.0
            && self.nanos_per_ray[0] > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn costs() -> SceneCosts {
        let cell = CellCosts { rays_per_path: vec![1.0, 0.5], nanos_per_ray: vec![2e3, 4e3] };
        SceneCosts {
            equilux_costs: COSTS_VERSION,
            scene: "box".into(),
            width: 10,
            height: 4,
            samples_per_pixel: 3,
            cell_side_pixels: 4,
            prepare_s: 0.01,
            bytes_per_pixel: 70.0,
            cells: vec![cell; 3],
            partitioned: None,
        }
    }

    #[test]
    fn a_file_comes_back_as_it_was_written() {
        let costs = costs();
        assert_eq!(SceneCosts::from_json(&costs.to_json()), Ok(costs.clone()));
        assert_eq!(costs.path_cost(), Duration::from_nanos(4000));
        let partitioned = crate::itinerary::tests::partitioned();
        let mut costs = SceneCosts { partitioned: Some(partitioned), ..costs };
        let refused = SceneCosts::from_json(&costs.to_json()).expect_err("of two cells");
        assert!(refused.to_string().starts_with("itineraries of 2 cells, not 3"), "{refused}");
        (costs.width, costs.cells) = (8, costs.cells[..2].to_vec());
        assert_eq!(SceneCosts::from_json(&costs.to_json()), Ok(costs.clone()));
    }

    #[test]
    fn what_contradicts_itself_is_refused_with_its_place() {
        let refused = |spoil: fn(&mut SceneCosts)| {
            let mut costs = costs();
            spoil(&mut costs);
            SceneCosts::from_json(&costs.to_json()).expect_err("spoilt").to_string()
        };
        assert!(refused(|costs| costs.equilux_costs = 7).starts_with("layout 7;"));
        assert!(refused(|costs| costs.width = 40).starts_with("3 cells, not 10 × 1"));
        assert!(refused(|costs| costs.cell_side_pixels = 0).contains("from 1 to"));
        assert!(refused(|costs| costs.samples_per_pixel = 0).contains("samples_per_pixel"));
        assert!(refused(|costs| costs.prepare_s = -1.0).contains("prepare_s"));
        assert!(refused(|costs| costs.prepare_s = 1e300).contains("prepare_s"));
        assert!(refused(|costs| costs.cells[0].nanos_per_ray = vec![3e38; 2]).contains("cells[0]"));
        assert!(
            refused(|costs| costs.cells[0].nanos_per_ray = vec![1e-30; 2]).contains("cells[0]")
        );
        assert!(refused(|costs| costs.cells[1].rays_per_path.clear()).starts_with("cells[1]"));
        assert!(refused(|costs| costs.cells[2].nanos_per_ray[0] = 0.0).starts_with("cells[2]"));
    }
}

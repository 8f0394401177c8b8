//! Itineraries: which partitions of a model the rays of a path visit, to be visited again in
//! simulated clusters.
//!
//! A *stay* is what a ray does in one partition together with all rays that it spawns there and
//! that end there: nothing of it can be done where that partition is not in memory. What goes on
//! from there, the ray itself or rays that it has spawned, are further stays. So the stays of a
//! path are a tree, whatever is in memory where; it is written down in preorder.

use serde::{Deserialize, Serialize};

use crate::bundle::Stage;

/// Most stays of one path: a path of more branches than can be simulated in numbers.
pub const ITINERARY_STAYS_MAX: usize = 1 << 16;

/// Most partitions of a recorded model.
const PARTITIONS_MAX: usize = 1 << 20;

/// Most bytes of one partition, so that no sum overflows.
const PARTITION_BYTES_MAX: u64 = 1 << 40;

/// A visit of a shadow ray costs at most so many times as much as one of another ray, or so many
/// times less.
const SHADOW_WEIGHT_MAX: f64 = 1e3;

/// What a ray does in a partition, and all that it spawns there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "[u32; 5]", into = "[u32; 5]")]
pub struct Stay {
    /// The partition.
    pub partition: u32,
    /// What the ray comes for.
    pub stage: Stage,
    /// Rays that set out here to be shaded where they hit something.
    pub onward: u32,
    /// Shadow rays that set out here.
    pub shadow: u32,
    /// How many of all these rays go on elsewhere: stays that follow this one, each with its own
    /// followers.
    pub follower_count: u32,
}

/// The stays of a path in preorder; none if its camera ray meets no partition.
pub type Itinerary = Vec<Stay>;

/// What is known of the partitions of a recorded model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartitionedCosts {
    /// The partitions, by their number.
    pub partitions: Vec<PartitionCosts>,
    /// How much partitions have to do with one another: both, and the affinity.
    pub ties: Vec<(u32, u32, u64)>,
    /// What a visit of a shadow ray takes over one of another ray, its shading included.
    pub shadow_weight: f64,
    /// Of some paths of each cell of the image.
    pub itineraries: Vec<Vec<Itinerary>>,
}

/// A partition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartitionCosts {
    /// Bytes that it takes in memory.
    pub memory_bytes: u64,
    /// The middle of its box.
    pub position: [f32; 3],
}

impl Stay {
    /// Rays that are here at one time or another.
    #[must_use]
    pub fn ray_count(&self) -> u64 {
        1 + u64::from(self.onward) + u64::from(self.shadow)
    }

    /// What is done here, where a visit of a ray that is no shadow ray weighs 1.
    #[must_use]
    pub fn weight(&self, shadow_weight: f64) -> f64 {
        let arrival = if self.stage == Stage::Shadow { shadow_weight } else { 1.0 };
        arrival + f64::from(self.onward) + f64::from(self.shadow) * shadow_weight
    }
}

impl TryFrom<[u32; 5]> for Stay {
    type Error = String;

    fn try_from(
        [partition, stage, onward, shadow, follower_count]: [u32; 5],
    ) -> Result<Self, String> {
        let stages = [Stage::Intersect, Stage::Shade, Stage::Shadow];
        let stage = stages.get(stage as usize).copied();
        let stage = stage.ok_or("the second number of a stay must be from 0 to 2")?;
        Ok(Self { partition, stage, onward, shadow, follower_count })
    }
}

impl From<Stay> for [u32; 5] {
    fn from(stay: Stay) -> Self {
        let Stay { partition, stage, onward, shadow, follower_count } = stay;
        let stage = match stage {
            Stage::Intersect => 0,
            Stage::Shade => 1,
            Stage::Shadow => 2,
        };
        [partition, stage, onward, shadow, follower_count]
    }
}

/// What an itinerary weighs, the camera's ray included.
#[must_use]
pub fn weight(itinerary: &[Stay], shadow_weight: f64) -> f64 {
    1.0 + itinerary.iter().map(|stay| stay.weight(shadow_weight)).sum::<f64>()
}

impl PartitionedCosts {
    /// Bytes that all partitions take in memory.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.partitions.iter().map(|partition| partition.memory_bytes).sum()
    }

    /// Checks that the parts are of one model, and of so many cells.
    pub(crate) fn check(&self, cell_count: usize) -> Result<(), String> {
        let count = self.partitions.len();
        if !(1..=PARTITIONS_MAX).contains(&count) {
            return Err(format!("{count} partitions; from 1 to {PARTITIONS_MAX} are possible"));
        }
        let is_sound = |partition: &PartitionCosts| {
            (1..=PARTITION_BYTES_MAX).contains(&partition.memory_bytes)
                && partition.position.iter().all(|coordinate| coordinate.is_finite())
        };
        if let Some(index) = self.partitions.iter().position(|partition| !is_sound(partition)) {
            return Err(format!("partitions[{index}]: no size, or no place"));
        }
        let is_known = |partition: u32| (partition as usize) < count;
        if let Some(index) = self.ties.iter().position(|tie| !is_known(tie.0) || !is_known(tie.1)) {
            return Err(format!("ties[{index}]: a partition that is not there"));
        }
        if !(1.0 / SHADOW_WEIGHT_MAX..=SHADOW_WEIGHT_MAX).contains(&self.shadow_weight) {
            return Err(format!("`shadow_weight` must be from 1/1000 to {SHADOW_WEIGHT_MAX}"));
        }
        if self.itineraries.len() != cell_count {
            return Err(format!(
                "itineraries of {} cells, not {cell_count}",
                self.itineraries.len()
            ));
        }
        let is_sound = |itinerary: &Itinerary| {
            itinerary.iter().all(|stay| is_known(stay.partition)) && is_tree(itinerary)
        };
        let is_sound = |cell: &Vec<Itinerary>| !cell.is_empty() && cell.iter().all(is_sound);
        match self.itineraries.iter().position(|cell| !is_sound(cell)) {
            Some(cell) => Err(format!("itineraries[{cell}]: none, or not of this model")),
            None => Ok(()),
        }
    }
}

/// Whether stays follow one another as their counts say, from one first stay on.
fn is_tree(itinerary: &[Stay]) -> bool {
    let mut open: u64 = 1;
    for stay in itinerary {
        if open == 0 || u64::from(stay.follower_count) > stay.ray_count() {
            return false;
        }
        open = open - 1 + u64::from(stay.follower_count);
    }
    itinerary.len() <= ITINERARY_STAYS_MAX && (open == 0 || itinerary.is_empty())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn stay(partition: u32, onward: u32, follower_count: u32) -> Stay {
        Stay { partition, stage: Stage::Intersect, onward, shadow: 1, follower_count }
    }

    /// Two partitions and two cells.
    pub(crate) fn partitioned() -> PartitionedCosts {
        let partition = PartitionCosts { memory_bytes: 100, position: [1.0, 0.0, 0.0] };
        let path = vec![stay(0, 1, 2), stay(1, 0, 0), stay(1, 2, 1), stay(0, 0, 0)];
        PartitionedCosts {
            partitions: vec![partition; 2],
            ties: vec![(0, 1, 7)],
            shadow_weight: 0.5,
            itineraries: vec![vec![path, Vec::new()], vec![vec![stay(1, 0, 0)]]],
        }
    }

    #[test]
    fn stays_are_read_as_they_were_written() {
        let text = serde_json::to_string(&partitioned()).expect("numbers");
        assert!(text.contains("[0,0,1,1,2]"), "{text}");
        let read: PartitionedCosts = serde_json::from_str(&text).expect("as it was written");
        assert_eq!(read, partitioned());
        assert!(serde_json::from_str::<Stay>("[0,3,0,0,0]").is_err(), "no such stage");
    }

    #[test]
    fn a_path_weighs_its_visits() {
        let path = &partitioned().itineraries[0][0];
        assert!((weight(path, 0.5) - (1.0 + 4.0 + 3.0 + 4.0 * 0.5)).abs() < 1e-12);
        assert!((weight(&[], 0.5) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_of_no_model_is_refused_with_its_place() {
        let refused = |spoil: fn(&mut PartitionedCosts)| {
            let mut costs = partitioned();
            spoil(&mut costs);
            costs.check(2).expect_err("spoilt")
        };
        assert_eq!(partitioned().check(2), Ok(()));
        assert!(partitioned().check(3).is_err());
        assert!(refused(|costs| costs.partitions.clear()).starts_with("0 partitions"));
        assert!(refused(|costs| costs.partitions[1].memory_bytes = 0).contains("partitions[1]"));
        assert!(refused(|costs| costs.ties[0].1 = 2).contains("ties[0]"));
        assert!(refused(|costs| costs.shadow_weight = f64::NAN).contains("shadow_weight"));
        assert!(refused(|costs| costs.itineraries[1].clear()).contains("itineraries[1]"));
        assert!(refused(|costs| costs.itineraries[0][0][3].partition = 2).contains("[0]"));
        assert!(refused(|costs| costs.itineraries[0][0].truncate(3)).contains("[0]"), "cut short");
        assert!(refused(|costs| costs.itineraries[0][0].push(stay(0, 0, 0))).contains("[0]"));
        assert!(refused(|costs| costs.itineraries[1][0][0].follower_count = 9).contains("[1]"));
    }
}

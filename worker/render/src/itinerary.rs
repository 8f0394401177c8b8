//! Where the rays of a path go in a model that is cut into partitions: found by tracing the path
//! with one partition in memory at a time, so that every ray comes back wherever it has to go on.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use equilux_common::bundle::{Bundle, Share, Stage};
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, PartitionId, UnitId};
use equilux_common::itinerary::{ITINERARY_STAYS_MAX, Itinerary, Stay};
use equilux_common::ray::Ray;
use equilux_common::work::{Outcome, Samples, Work};

use crate::geometry::{Partition, PartitionSet};
use crate::renderer::Renderer;
use crate::scratch::Scratch;

/// Follows paths of a job from partition to partition.
#[derive(Debug)]
pub struct Guide {
    /// Without any partition.
    outside: Renderer,
    /// By partition: with that one alone.
    within: Vec<Renderer>,
    scratch: Scratch,
}

impl Guide {
    /// For a job on a model whose partitions these are, all of them.
    #[must_use]
    pub fn new(job: &Renderer, partitions: &[Arc<Partition>]) -> Self {
        let with = |resident: Option<usize>| {
            let is_in = |(number, partition): (usize, &Arc<Partition>)| {
                (resident == Some(number)).then(|| Arc::clone(partition))
            };
            let set = partitions.iter().enumerate().map(is_in).collect();
            job.with_partitions(PartitionSet::new(set))
        };
        let within = (0..partitions.len()).map(|number| with(Some(number))).collect();
        Self { outside: with(None), within, scratch: Scratch::default() }
    }

    /// The stays of a path of a unit; nothing if there are too many.
    ///
    /// # Panics
    /// If the job has no such path.
    pub fn itinerary(&mut self, unit: UnitId, path: u32) -> Option<Itinerary> {
        let share = Share { unit, attempt: Attempt(0), credit: Credit::whole() };
        let samples = Samples { share: share.clone(), first_path: path, path_count: 1 };
        let outcome = trace(&self.outside, Work::Samples(samples), &mut self.scratch);
        let (mut itinerary, mut waiting) = (Itinerary::new(), rays(outcome));
        while let Some((partition, stage, ray)) = waiting.pop() {
            if itinerary.len() == ITINERARY_STAYS_MAX {
                return None;
            }
            let (shares, rays_in) = (vec![share.clone()], vec![Ray { share: 0, ..ray }]);
            let bundle = Bundle { stage, partition, shares, rays: rays_in };
            let renderer = &self.within[partition.0 as usize];
            let outcome = trace(renderer, Work::Rays(bundle), &mut self.scratch);
            let counts = outcome.counts;
            let mut followers = rays(outcome);
            itinerary.push(Stay {
                partition: partition.0,
                stage,
                onward: narrow(counts.indirect + counts.specular),
                shadow: narrow(counts.shadow),
                follower_count: narrow(followers.len() as u64),
            });
            waiting.append(&mut followers);
        }
        Some(itinerary)
    }
}

fn trace(renderer: &Renderer, work: Work, scratch: &mut Scratch) -> Outcome {
    let never = AtomicBool::new(false);
    renderer.trace(work, &never, scratch).expect("work of this job")
}

/// What goes on elsewhere; the last one is next.
fn rays(outcome: Outcome) -> Vec<(PartitionId, Stage, Ray)> {
    let bundles = outcome.successors.into_iter();
    let rays = bundles.flat_map(|Bundle { stage, partition, rays, .. }| {
        rays.into_iter().map(move |ray| (partition, stage, ray))
    });
    rays.collect()
}

fn narrow(count: u64) -> u32 {
    u32::try_from(count).expect("a ray spawns a few")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene_builder::{SceneBuilder, camera, partitioned, settings};
    use equilux_common::work::RayCounts;
    use glam::Vec3;

    /// A corner of three walls and a light, a triangle here and a triangle there.
    fn scene() -> (Renderer, Renderer, Vec<Arc<Partition>>) {
        let mut scene = SceneBuilder::new();
        let (wall, light) = (scene.diffuse(0.7), scene.light(9.0));
        let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
        scene.quad(Vec3::splat(-1.0), z, x, wall);
        scene.quad(Vec3::splat(-1.0), x, y, wall);
        scene.quad(Vec3::splat(-1.0), y, z, wall);
        scene.quad(Vec3::new(-0.5, 0.9, -0.5), Vec3::X * 0.5, Vec3::Z * 0.5, light);
        let view = camera(Vec3::new(0.3, 0.2, 3.0), Vec3::ZERO, 45.0);
        let model = scene.scene().clone();
        let whole = scene.renderer(&view, &settings(13, 3, 5));
        let (cut, partitions) = partitioned(&model, &[0, 1, 2], &whole);
        (whole, cut, partitions)
    }

    #[test]
    fn stays_are_a_tree_of_all_rays_that_a_path_has() {
        let (whole, cut, partitions) = scene();
        let (mut guide, mut scratch) = (Guide::new(&cut, &partitions), Scratch::default());
        let (mut stay_count, mut path_count) = (0, 0);
        for unit in (0..whole.grid.unit_count()).map(UnitId) {
            for path in 0..whole.grid.unit(unit).expect("below the count").path_count() {
                let itinerary = guide.itinerary(unit, path).expect("a few stays");
                let share = Share { unit, attempt: Attempt(0), credit: Credit::whole() };
                let samples = Samples { share, first_path: path, path_count: 1 };
                let counts = trace(&whole, Work::Samples(samples), &mut scratch).counts;
                check(&itinerary, &counts);
                stay_count += itinerary.len();
                path_count += 1;
            }
        }
        assert!(stay_count > 2 * path_count, "{stay_count} stays of {path_count} paths");
    }

    /// Each ray is spawned in one stay, and each stay but the first follows one before.
    fn check(itinerary: &Itinerary, counts: &RayCounts) {
        let sum = |of: fn(&Stay) -> u32| itinerary.iter().map(|it| u64::from(of(it))).sum::<u64>();
        assert_eq!(sum(|stay| stay.onward), counts.indirect + counts.specular, "{itinerary:?}");
        assert_eq!(sum(|stay| stay.shadow), counts.shadow, "{itinerary:?}");
        let Some((first, _)) = itinerary.split_first() else { return };
        assert_eq!(sum(|stay| stay.follower_count) + 1, itinerary.len() as u64, "{itinerary:?}");
        assert_eq!(first.stage, Stage::Intersect, "{itinerary:?}");
        // Whoever stays is followed, right after, by somebody who is elsewhere.
        for pair in itinerary.windows(2).filter(|pair| pair[0].follower_count > 0) {
            assert_ne!(pair[0].partition, pair[1].partition, "{itinerary:?}");
        }
    }
}

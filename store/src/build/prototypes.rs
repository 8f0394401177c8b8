//! Models that are placed several times: kept once, with all their places.
//!
//! Small ones share a partition, in the order in which they come. One that is too large for a
//! partition is cut like a model of its own, in its own coordinates, and each part is at all its
//! places. Only where these are so many that they would fill a partition are they cut as well, by
//! where they are, and the model is kept several times.

use equilux_common::scene::placing::Placing;
use equilux_common::scene::triangles::{Placement, TRIANGLES_MAX, placements};
use equilux_common::scene::{Luminaire, WorldTriangle};
use equilux_render::geometry::{Bounds, PartitionBuilder};

use super::bisection::bisect;
use super::emitters::Emitters;
use super::error::BuildError;
use super::parts::{self, Parts};
use super::pass::{self, Pass, ScenePass};
use super::spool::PARTS_MAX;
use super::staging::Staging;
use super::{CountedPart, Cut};
use crate::manifest::PartitionEntry;

/// A place of a prototype, and the primitive id of its first triangle there.
pub(super) type PlacedAt = (Placing, u32);

/// Memory that a place takes in a partition: itself and a node.
const PLACE_BYTES: u64 = 144 + 64;

/// Of what partitions are to take, one part in so many may be places.
const PLACES_PART: u64 = 2;

/// So many places are never cut, however small partitions are to be.
const PLACES_MIN: u64 = 64;

/// Memory that so many places take in a partition, about.
pub(super) const fn place_bytes(count: usize) -> u64 {
    count as u64 * PLACE_BYTES
}

/// What is known of all prototypes of a scene.
pub(super) struct Prototypes {
    surveyed: Vec<Surveyed>,
    /// Triangles that are where they are: their ids come first.
    loose_count: u64,
    /// Triangles in all, counted at each place.
    placed_end: u64,
}

/// What is known of a prototype.
struct Surveyed {
    placings: Vec<Placing>,
    triangle_count: u64,
    /// Memory that its triangles take.
    bytes: u64,
    /// In its own coordinates.
    bounds: Bounds,
}

impl Prototypes {
    /// Looks at all of them.
    pub(super) fn survey(
        pass: &mut ScenePass<'_, '_>,
        loose_count: u64,
    ) -> Result<Self, BuildError> {
        let all = pass.source.placings().to_vec();
        let mut surveyed = Vec::with_capacity(all.len());
        pass.before = loose_count;
        for (number, placings) in all.into_iter().enumerate() {
            pass.prototype = Some(number);
            let survey = pass::survey(pass)?;
            pass.before += survey.triangle_count;
            let (triangle_count, bytes) = (survey.triangle_count, survey.bytes);
            surveyed.push(Surveyed { placings, triangle_count, bytes, bounds: survey.bounds() });
        }
        pass.before = 0;
        let placed = surveyed.iter().map(Surveyed::placed_count);
        let placed_end = placed.fold(loose_count, u64::saturating_add);
        if placed_end > TRIANGLES_MAX {
            return Err(BuildError::TooManyPlaced(placed_end));
        }
        Ok(Self { surveyed, loose_count, placed_end })
    }

    /// Whether there is nothing to be placed.
    pub(super) fn is_empty(&self) -> bool {
        self.surveyed.iter().all(|it| it.triangle_count == 0)
    }

    /// Bounds of all of them at all their places; those of nothing if there is none.
    pub(super) fn bounds(&self) -> Bounds {
        let there = self.surveyed.iter().filter(|it| it.triangle_count > 0);
        let boxes = there.flat_map(|it| {
            let Bounds { lower, upper } = it.bounds;
            it.placings.iter().map(move |placing| placing.around([lower.into(), upper.into()]))
        });
        let boxes = boxes.map(|[lower, upper]| Bounds { lower: lower.into(), upper: upper.into() });
        boxes.fold(Bounds::EMPTY, |around, it| around.joined(&it))
    }

    /// Memory that all of them take.
    pub(super) fn bytes(&self) -> u64 {
        self.surveyed.iter().map(|it| it.bytes + place_bytes(it.placings.len())).sum()
    }

    /// How many triangles there will be in partitions that take so many bytes on average: each is
    /// counted as often as it is kept.
    pub(super) fn kept_count(&self, mean: u64) -> u64 {
        let most = places_max(mean);
        let copies = |it: &Surveyed| piece_count(it.placings.len(), most) * it.triangle_count;
        self.surveyed.iter().map(copies).sum()
    }

    /// How many triangles the scene has in all, counted at each place.
    pub(super) const fn placed_end(&self) -> u64 {
        self.placed_end
    }

    fn placements(&self) -> impl Iterator<Item = Placement> {
        let all = self.surveyed.iter();
        placements(self.loose_count, all.map(|it| (it.triangle_count, it.placings.as_slice())))
    }
}

impl Surveyed {
    const fn placed_count(&self) -> u64 {
        self.triangle_count.saturating_mul(self.placings.len() as u64)
    }
}

/// Makes partitions of prototypes.
pub(super) struct Making<'a> {
    pub(super) cut: Cut,
    /// Bytes that a partition is to take on average.
    pub(super) mean: u64,
    pub(super) staging: &'a Staging,
}

/// Prototypes that will share a partition.
#[derive(Default)]
struct Shared {
    builder: PartitionBuilder,
    bytes: u64,
}

impl Making<'_> {
    /// Makes the partitions of all of them, and takes down what emits.
    pub(super) fn make_all(
        &self,
        prototypes: &Prototypes,
        pass: &mut ScenePass<'_, '_>,
        emitters: &mut Emitters<'_>,
    ) -> Result<Vec<PartitionEntry>, BuildError> {
        let mut entries = Vec::new();
        let mut shared = Shared::default();
        let store = self.staging.store();
        let mut placements = prototypes.placements().peekable();
        for (number, prototype) in prototypes.surveyed.iter().enumerate() {
            if prototype.triangle_count == 0 {
                continue;
            }
            pass.prototype = Some(number);
            pass.expected = Some(prototype.triangle_count);
            // They come prototype by prototype.
            let own = std::iter::from_fn(|| placements.next_if(|it| it.prototype <= number));
            let own: Vec<Placement> = own.filter(|it| it.prototype == number).collect();
            let places = own.iter().map(|it| (it.placing, it.first_primitive)).collect();
            let mut luminaires = Vec::new();
            for places in by_place(places, &prototype.bounds, places_max(self.mean)) {
                luminaires.clear();
                let bytes = prototype.bytes + place_bytes(places.len());
                if bytes > self.mean {
                    let prefix = format!("placed-{:05}-{number:05}-", entries.len());
                    let parts = self.distribute(pass, &prefix, emitters, &mut luminaires)?;
                    let makes = Parts {
                        cut: self.cut,
                        places: &places,
                        prefix: &prefix,
                        before: pass.before,
                        total: pass.total.unwrap_or_default(),
                        store: &store,
                        spool: self.staging.spool(),
                    };
                    entries.extend(makes.make_all(parts, pass.observer)?);
                    pass.before += prototype.triangle_count;
                    continue;
                }
                if shared.bytes > 0 && shared.bytes + bytes > self.mean {
                    entries.push(self.write(std::mem::take(&mut shared), entries.len())?);
                }
                shared.bytes += bytes;
                shared.builder.begin_object(places);
                pass.for_each(&mut |local, triangle| {
                    luminaires.extend(emitters.luminaire(local, triangle)?);
                    shared.builder.push(local, triangle);
                    Ok(())
                })?;
                pass.before += prototype.triangle_count;
            }
            emitters.gather_placed(&luminaires, own.into_iter())?;
        }
        if shared.bytes > 0 {
            entries.push(self.write(shared, entries.len())?);
        }
        Ok(entries)
    }

    /// Sorts the triangles of a large prototype into parts on disk.
    fn distribute(
        &self,
        pass: &mut ScenePass<'_, '_>,
        prefix: &str,
        emitters: &Emitters<'_>,
        luminaires: &mut Vec<Luminaire>,
    ) -> Result<Vec<CountedPart>, BuildError> {
        pass.is_preliminary = true;
        let mut survey = pass::survey(pass)?;
        let count = u32::try_from(survey.bytes.div_ceil(self.mean)).unwrap_or(u32::MAX);
        let regions = bisect(survey.cells.as_slice(), count, PARTS_MAX);
        let mut gather = |local, triangle: &WorldTriangle| {
            luminaires.extend(emitters.luminaire(local, triangle)?);
            Ok(())
        };
        let files = (self.staging.spool(), prefix);
        let parts = pass::distribute(pass, &mut survey, &regions, &mut gather, files);
        pass.is_preliminary = false;
        parts
    }

    fn write(&self, shared: Shared, number: usize) -> Result<PartitionEntry, BuildError> {
        // Bounds matter to those who trace rays only.
        let partition = shared.builder.build(&Bounds::EMPTY.or_origin());
        let name = format!("placed-{number:05}");
        let (entry, written) = parts::write(&self.staging.store(), &name, partition.image())?;
        written.settle()?;
        Ok(entry)
    }
}

/// Most places in a partition that is to take so many bytes on average.
fn places_max(mean: u64) -> usize {
    let most = (mean / PLACES_PART / PLACE_BYTES).max(PLACES_MIN);
    usize::try_from(most).unwrap_or(usize::MAX)
}

/// Into how many so many places are cut.
fn piece_count(places: usize, most: usize) -> u64 {
    if places <= most {
        return 1;
    }
    let second = places - places / 2;
    piece_count(places / 2, most) + piece_count(second, most)
}

/// Places of what lies within `bounds` that lie together, at most so many each.
fn by_place(mut places: Vec<PlacedAt>, bounds: &Bounds, most: usize) -> Vec<Vec<PlacedAt>> {
    if places.len() <= most {
        return vec![places];
    }
    let middle = ((bounds.lower + bounds.upper) * 0.5).to_array().map(f64::from);
    let at = |place: &PlacedAt, axis: usize| place.0.transform().point(middle)[axis];
    let extent = |axis: usize| {
        let along = places.iter().map(|place| at(place, axis));
        let (least, greatest) =
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        greatest - least
    };
    let widest = |a: &usize, b: &usize| extent(*a).total_cmp(&extent(*b));
    let axis = (0..3).max_by(widest).unwrap_or_default();
    // By id where they lie in one plane, so that it is the same each time.
    places.sort_by(|a, b| at(a, axis).total_cmp(&at(b, axis)).then(a.1.cmp(&b.1)));
    let second = places.split_off(places.len() / 2);
    [by_place(places, bounds, most), by_place(second, bounds, most)].concat()
}

#[cfg(test)]
mod tests {
    use equilux_common::scene::placing::Transform;

    use super::*;

    #[test]
    fn places_that_lie_together_stay_together() {
        let place = |number: u32| {
            let x = f64::from(number * 7 % 10);
            let transform = Transform { translation: [x, 1.0, 0.0], ..Transform::IDENTITY };
            (Placing::new(transform), number)
        };
        let cut = by_place((0..10).map(place).collect(), &Bounds::EMPTY.or_origin(), 3);
        let numbers: Vec<Vec<u32>> =
            cut.iter().map(|some| some.iter().map(|place| place.1).collect()).collect();
        assert_eq!(numbers, [vec![0, 3], vec![6, 9, 2], vec![5, 8], vec![1, 4, 7]]);
        assert_eq!(piece_count(10, 3), 4);
    }
}

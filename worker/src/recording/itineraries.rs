//! Where paths go in a store: of a few paths of each cell, which partitions they visit.

use std::collections::BTreeMap;

use equilux_common::bundle::Stage;
use equilux_common::ids::UnitId;
use equilux_common::itinerary::{Itinerary, PartitionCosts, PartitionedCosts, Stay};
use equilux_common::job::JobSpec;
use equilux_common::unit::UnitGrid;
use equilux_mapping::Object;
use equilux_render::itinerary::Guide;

use super::table::Cells;
use crate::affinity;
use crate::scenes::Whole;

/// Paths of each cell that are followed: an image has thousands of cells, and what is asked of the
/// sample is how much is done in which partition.
const PATHS_PER_CELL: u64 = 4;

/// Most stays that are recorded: some hundred megabytes.
const STAYS_MAX: usize = 1 << 23;

/// Spreads the paths of a cell over it: the golden ratio, as a part of 2³².
const GOLDEN: u32 = 0x9e37_79b9;

/// Follows some paths of a job whose shadow rays took this part of the time.
pub(super) fn record(
    job: &Whole,
    spec: &JobSpec,
    shadow_part: f64,
) -> Result<PartitionedCosts, String> {
    let cells = Cells::of(spec);
    let grid = cells.units(spec.settings.samples_per_pixel);
    let renderer = job.renderer.with_grid(grid.clone());
    let mut guide = Guide::new(&renderer, &job.partitions);
    let mut itineraries: BTreeMap<u32, Vec<Itinerary>> = BTreeMap::new();
    let mut stays = 0;
    for unit in (0..grid.unit_count()).map(UnitId) {
        let (cell, followed) = follow(&mut guide, &grid, &cells, unit)?;
        stays += followed.iter().map(Vec::len).sum::<usize>();
        if stays > STAYS_MAX {
            return Err(
                "the image is too large to record where its paths go; make it smaller".into()
            );
        }
        itineraries.insert(cell, followed);
    }
    let itineraries: Vec<Vec<Itinerary>> = itineraries.into_values().collect();
    let guest = affinity::guest(&job.manifest).map_err(|error| error.to_string())?;
    let guest = guest.ok_or("the store has no partitions")?;
    let partitions = guest.objects().iter();
    let partitions = partitions
        .map(|&Object { bytes, position }| PartitionCosts { memory_bytes: bytes, position });
    let narrow = |index: usize| u32::try_from(index).expect("few partitions");
    let ties = guest.ties().iter().map(|tie| {
        let [first, second] = tie.objects.map(narrow);
        (first, second, tie.affinity)
    });
    Ok(PartitionedCosts {
        partitions: partitions.collect(),
        ties: ties.collect(),
        shadow_weight: shadow_weight(&itineraries, shadow_part),
        itineraries,
    })
}

/// The cell that is a unit, and where some of its paths go.
fn follow(
    guide: &mut Guide,
    grid: &UnitGrid,
    cells: &Cells,
    unit: UnitId,
) -> Result<(u32, Vec<Itinerary>), String> {
    let whole = grid.unit(unit).expect("a unit of this grid");
    let count = u64::from(whole.path_count());
    let start = u64::from(unit.0.wrapping_mul(GOLDEN));
    let path = |number: u64| {
        let place = (start + (number << 32)) / PATHS_PER_CELL.min(count);
        u32::try_from((place * count) >> 32).expect("below the count")
    };
    let (x, y, _) = whole.path(0);
    let cell = cells.of_pixel(x + y * grid.image_width());
    let followed = (0..PATHS_PER_CELL.min(count)).map(|number| guide.itinerary(unit, path(number)));
    let followed = followed.collect::<Option<Vec<_>>>();
    Ok((cell, followed.ok_or("paths branch too much to record where they go")?))
}

/// What a visit of a shadow ray takes over one of another ray, where shadow rays took this part of
/// all time.
fn shadow_weight(itineraries: &[Vec<Itinerary>], shadow_part: f64) -> f64 {
    let (mut shadow, mut other) = (0, 0);
    for path in itineraries.iter().flatten() {
        other += 1;
        for Stay { stage, onward, shadow: spawned, .. } in path {
            let is_shadow = u64::from(*stage == Stage::Shadow);
            shadow += u64::from(*spawned) + is_shadow;
            other += u64::from(*onward) + 1 - is_shadow;
        }
    }
    if shadow == 0 {
        return 1.0;
    }
    let ratio = shadow_part / (1.0 - shadow_part) * other as f64 / shadow as f64;
    if ratio.is_finite() { ratio.clamp(0.01, 100.0) } else { 1.0 }
}

//! Gathering: the credit of each unit that has come home, and the film values that it vouches for.
//!
//! Termination and gathering are one thing: a unit is whole when its credit is, and the job when
//! all its units are. Values of a unit whose attempt was raised are dropped with its credit.

use equilux_common::bundle::Share;
use equilux_common::credit::{Credit, CreditOverflow};
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, UnitId};
use equilux_common::unit::{Rect, UnitGrid};

use crate::violation::Violation;

/// What has come home of a job.
#[derive(Debug)]
pub(crate) struct Gathering {
    grid: UnitGrid,
    /// By unit.
    standings: Vec<Standing>,
    committed_count: u32,
}

#[derive(Clone, Debug, Default)]
struct Standing {
    attempt: Attempt,
    progress: Progress,
}

/// How much of a unit has come home.
#[derive(Clone, Debug, Default)]
enum Progress {
    #[default]
    Nothing,
    Part(Box<Part>),
    All,
}

/// Something of a unit, but not all.
#[derive(Clone, Debug)]
struct Part {
    credit: Credit,
    sums: TileSums,
}

impl Gathering {
    /// Nothing has come home yet.
    pub(crate) fn new(grid: UnitGrid) -> Self {
        let standings = vec![Standing::default(); grid.unit_count() as usize];
        Self { grid, standings, committed_count: 0 }
    }

    /// The units of the job.
    pub(crate) const fn grid(&self) -> &UnitGrid {
        &self.grid
    }

    /// Units that are whole.
    pub(crate) const fn committed_count(&self) -> u32 {
        self.committed_count
    }

    /// Whether all units are whole.
    pub(crate) fn is_complete(&self) -> bool {
        self.committed_count as usize == self.standings.len()
    }

    /// Credit came home. Gives the unit's values when that makes it whole; what belongs to an older
    /// attempt is dropped.
    pub(crate) fn deliver(
        &mut self,
        share: &Share,
        sums: TileSums,
    ) -> Result<Option<(UnitId, TileSums)>, Violation> {
        let unit = share.unit;
        let tile = self.grid.unit(unit).ok_or(Violation::UnknownUnit(unit))?.tile;
        let standing = &mut self.standings[unit.0 as usize];
        if share.attempt < standing.attempt {
            return Ok(None);
        }
        if share.attempt > standing.attempt {
            return Err(Violation::UnknownAttempt(unit, share.attempt));
        }
        if !tile.contains(&sums.tile) || sums.pixels.len() != sums.tile.pixel_count() {
            return Err(Violation::WrongTile(unit));
        }
        let whole = standing.progress.add(&share.credit, tile, sums);
        let whole = whole.map_err(|_| Violation::TooMuchCredit(unit))?;
        self.committed_count += u32::from(whole.is_some());
        Ok(whole.map(|sums| (unit, sums)))
    }

    /// Raises the attempts of all units that are not whole, and drops what has come home of them.
    pub(crate) fn raise(&mut self) -> Vec<(UnitId, Attempt)> {
        for standing in self.standings.iter_mut().filter(|standing| !standing.is_committed()) {
            standing.attempt = Attempt(standing.attempt.0 + 1);
            standing.progress = Progress::Nothing;
        }
        self.uncommitted().collect()
    }

    /// The units that are not whole, ascending, and the attempts they are at.
    pub(crate) fn uncommitted(&self) -> impl Iterator<Item = (UnitId, Attempt)> {
        (0..).map(UnitId).zip(&self.standings).filter_map(|(unit, standing)| {
            (!standing.is_committed()).then_some((unit, standing.attempt))
        })
    }

    /// Shows the credit that has come home of units that are not whole.
    pub(crate) fn for_each_share(&self, visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
        for (unit, standing) in (0..).map(UnitId).zip(&self.standings) {
            if let Progress::Part(part) = &standing.progress {
                visit(unit, standing.attempt, &part.credit);
            }
        }
    }
}

impl Standing {
    const fn is_committed(&self) -> bool {
        matches!(self.progress, Progress::All)
    }
}

impl Progress {
    /// More of the unit came home; gives all of its values if that makes it whole.
    fn add(
        &mut self,
        credit: &Credit,
        tile: Rect,
        sums: TileSums,
    ) -> Result<Option<TileSums>, CreditOverflow> {
        match self {
            Self::All => return Err(CreditOverflow),
            Self::Nothing if credit.is_whole() => {
                *self = Self::All;
                return Ok(Some(sums.widened(tile)));
            }
            Self::Nothing => {
                let part = Part { credit: credit.clone(), sums: sums.widened(tile) };
                *self = Self::Part(Box::new(part));
                return Ok(None);
            }
            Self::Part(part) => {
                part.credit.merge(credit)?;
                part.sums.merge(&sums);
                if !part.credit.is_whole() {
                    return Ok(None);
                }
            }
        }
        match std::mem::replace(self, Self::All) {
            Self::Part(part) => Ok(Some(part.sums)),
            Self::Nothing | Self::All => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::unit::Granularity;

    fn gathering() -> Gathering {
        let region = Rect { x0: 0, y0: 0, x1: 2, y1: 1 };
        let granularity = Granularity { tile_side_pixels: 1, samples_per_unit: 1 };
        Gathering::new(UnitGrid::new(2, region, 1, granularity))
    }

    fn sums(gathering: &Gathering, unit: u32, depth: i64) -> TileSums {
        let tile = gathering.grid.unit(UnitId(unit)).expect("two units").tile;
        let mut sums = TileSums::new(tile);
        sums.pixels[0].depth = depth;
        sums
    }

    fn share(unit: u32, attempt: u32, credit: &Credit) -> Share {
        Share { unit: UnitId(unit), attempt: Attempt(attempt), credit: credit.clone() }
    }

    #[test]
    fn a_unit_is_committed_when_its_credit_is_whole_and_not_before() {
        let mut gathering = gathering();
        let mut kept = Credit::whole();
        let half = kept.split(2);
        let part = sums(&gathering, 1, 3);
        assert_eq!(gathering.deliver(&share(1, 0, &half), part.clone()), Ok(None));
        let beyond = TileSums::new(Rect { x0: 0, y0: 0, x1: 2, y1: 1 });
        let wide = gathering.deliver(&share(1, 0, &kept), beyond);
        assert_eq!(wide, Err(Violation::WrongTile(UnitId(1))));
        let (unit, whole) =
            gathering.deliver(&share(1, 0, &kept), part.clone()).expect("valid").expect("whole");
        assert_eq!((unit, whole.pixels[0].depth), (UnitId(1), 6));
        assert_eq!((gathering.committed_count(), gathering.is_complete()), (1, false));
        let again = gathering.deliver(&share(1, 0, &half), part);
        assert_eq!(again, Err(Violation::TooMuchCredit(UnitId(1))));
    }

    #[test]
    fn a_raised_unit_starts_over_and_a_committed_one_never_does() {
        let mut gathering = gathering();
        let whole = Credit::whole();
        let (zero, one) = (sums(&gathering, 0, 5), sums(&gathering, 1, 7));
        gathering.deliver(&share(1, 0, &whole), one).expect("valid").expect("whole");
        assert_eq!(gathering.raise(), [(UnitId(0), Attempt(1))]);
        assert_eq!(gathering.deliver(&share(0, 0, &whole), zero.clone()), Ok(None));
        let (_, sums) =
            gathering.deliver(&share(0, 1, &whole), zero).expect("valid").expect("whole");
        assert_eq!(sums.pixels[0].depth, 5);
        assert!(gathering.is_complete());
    }

    #[test]
    fn what_no_worker_was_asked_for_is_a_violation() {
        let mut gathering = gathering();
        let (whole, sums) = (Credit::whole(), sums(&gathering, 0, 1));
        let deliver = |gathering: &mut Gathering, unit, attempt| {
            gathering.deliver(&share(unit, attempt, &whole), sums.clone()).expect_err("a violation")
        };
        assert_eq!(deliver(&mut gathering, 2, 0), Violation::UnknownUnit(UnitId(2)));
        assert_eq!(deliver(&mut gathering, 0, 1), Violation::UnknownAttempt(UnitId(0), Attempt(1)));
        assert_eq!(deliver(&mut gathering, 1, 0), Violation::WrongTile(UnitId(1)));
    }
}

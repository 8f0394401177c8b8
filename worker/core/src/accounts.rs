//! Accounts: what this worker knows about each unit that it has work of.
//!
//! An account adds up the credit that is *live* here (waiting in the queue or being traced), and
//! the credit that has *retired* together with the film values it vouches for. When nothing is
//! live, all that has retired goes home in one delivery. Whole units that nobody has begun need no
//! account. Shares of an older attempt than the newest one seen are dropped wherever they turn up.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use equilux_common::bundle::Share;
use equilux_common::credit::{Credit, CreditOverflow};
use equilux_common::film::TileSums;
use equilux_common::ids::{Attempt, UnitId};
use equilux_common::time::Time;
use equilux_common::unit::UnitGrid;

/// The open accounts of a job.
#[derive(Debug, Default)]
pub(crate) struct Accounts {
    /// The newest attempts seen, where they are not 0.
    attempts: BTreeMap<UnitId, Attempt>,
    open: BTreeMap<UnitId, Account>,
    /// How many of them were begun here.
    begun_count: usize,
    /// Units whose live credit has shrunk since completeness was last looked at.
    touched: Vec<UnitId>,
    /// Units of which nothing was live when they were last looked at, and since when.
    settled: BTreeMap<UnitId, Time>,
    /// The same in the order of time, with some that do not count any more.
    settling: VecDeque<(Time, UnitId)>,
}

#[derive(Debug, Default)]
struct Account {
    /// Whether all of the unit was here when nobody had begun it.
    is_begun: bool,
    live: Credit,
    /// The part of `live` that compute threads hold.
    tracing: Credit,
    retired: Credit,
    sums: Option<TileSums>,
}

impl Accounts {
    /// Units of which something is live here.
    pub(crate) fn open_count(&self) -> usize {
        self.open.len()
    }

    /// Units of which something is live here and that were begun here.
    pub(crate) const fn begun_count(&self) -> usize {
        self.begun_count
    }

    /// The newest attempt seen of a unit.
    pub(crate) fn attempt(&self, unit: UnitId) -> Attempt {
        self.attempts.get(&unit).copied().unwrap_or_default()
    }

    /// Whether something of a unit is live here.
    pub(crate) fn is_open(&self, unit: UnitId) -> bool {
        self.open.contains_key(&unit)
    }

    /// Whether a share still counts.
    pub(crate) fn is_current(&self, share: &Share) -> bool {
        share.attempt == self.attempt(share.unit)
    }

    /// Notes an attempt; says whether it is newer than all seen before, so that older work of the
    /// unit must be dropped. The older account is dropped here.
    pub(crate) fn raise(&mut self, unit: UnitId, attempt: Attempt) -> bool {
        let is_newer = attempt > self.attempt(unit);
        if is_newer {
            self.attempts.insert(unit, attempt);
            self.remove(unit);
            self.settled.remove(&unit);
        }
        is_newer
    }

    /// A piece of work came in. Its share is current.
    ///
    /// # Errors
    /// If there would be more credit here than there is; nothing has changed then.
    pub(crate) fn enter(&mut self, share: &Share) -> Result<(), CreditOverflow> {
        let account = self.open.entry(share.unit).or_default();
        let mut live = account.live.clone();
        live.merge(&share.credit)?;
        let mut total = live.clone();
        total.merge(&account.retired)?;
        account.live = live;
        self.settled.remove(&share.unit);
        Ok(())
    }

    /// A whole unit is begun here. Its share is current.
    ///
    /// # Errors
    /// If somebody else has credit of it; nothing has changed then.
    pub(crate) fn begin(&mut self, share: &Share) -> Result<(), CreditOverflow> {
        self.enter(share)?;
        let account = self.open.get_mut(&share.unit).expect("it has just been opened");
        self.begun_count += usize::from(!std::mem::replace(&mut account.is_begun, true));
        Ok(())
    }

    /// A piece of work went to a peer.
    pub(crate) fn leave(&mut self, share: &Share) {
        let account = self.open.get_mut(&share.unit).expect("what is here has an account");
        account.live.withdraw(&share.credit).expect("what leaves was here");
        self.touched.push(share.unit);
    }

    /// A piece of work went to a compute thread.
    pub(crate) fn trace(&mut self, share: &Share) {
        let account = self.open.get_mut(&share.unit).expect("what is here has an account");
        account.tracing.merge(&share.credit).expect("a part of what is live");
    }

    /// Rays came back from a compute thread and wait in the queue. Their share is current.
    pub(crate) fn resume(&mut self, share: &Share) {
        let account = self.open.get_mut(&share.unit).expect("what is traced has an account");
        account.tracing.withdraw(&share.credit).expect("light conserves credit");
    }

    /// Rays ended in a compute thread. Their share is current.
    pub(crate) fn retire(&mut self, share: &Share, sums: &TileSums, grid: &UnitGrid) {
        let account = self.open.get_mut(&share.unit).expect("what is traced has an account");
        account.tracing.withdraw(&share.credit).expect("light conserves credit");
        account.live.withdraw(&share.credit).expect("what is traced is live");
        account.retired.merge(&share.credit).expect("a part of what was live");
        let tile = grid.unit(share.unit).expect("units are checked when they come in").tile;
        account.sums.get_or_insert_with(|| TileSums::new(tile)).merge(sums);
        self.touched.push(share.unit);
    }

    /// Closes the accounts in which nothing has been live for as long as `patience`, and gives what
    /// they vouch for. Those of which all credit has retired need no patience.
    pub(crate) fn take_complete(
        &mut self,
        now: Time,
        patience: Duration,
    ) -> Vec<(Share, TileSums)> {
        let mut touched = std::mem::take(&mut self.touched);
        touched.sort_unstable();
        touched.dedup();
        let mut complete = Vec::new();
        for unit in touched {
            self.settled.remove(&unit);
            let Some(account) = self.open.get(&unit).filter(|account| account.live.is_zero())
            else {
                continue;
            };
            if patience.is_zero() || account.is_final() {
                complete.extend(self.close(unit));
            } else {
                self.settled.insert(unit, now);
                self.settling.push_back((now, unit));
            }
        }
        while let Some(&(since, unit)) = self.settling.front()
            && (since + patience <= now || self.settled.get(&unit) != Some(&since))
        {
            self.settling.pop_front();
            if self.settled.get(&unit) == Some(&since) {
                self.settled.remove(&unit);
                complete.extend(self.close(unit));
            }
        }
        complete
    }

    /// When the next account closes, if nothing happens.
    pub(crate) fn deadline(&self, patience: Duration) -> Option<Time> {
        self.settling.front().map(|&(since, _)| since + patience)
    }

    /// Shows every share of credit that is here.
    pub(crate) fn for_each_share(&self, visit: &mut dyn FnMut(UnitId, Attempt, &Credit)) {
        for (&unit, account) in &self.open {
            visit(unit, self.attempt(unit), &account.live);
            visit(unit, self.attempt(unit), &account.retired);
        }
    }

    /// Makes sure that no account claims to have something traced.
    pub(crate) fn assert_nothing_traced(&self) {
        for (unit, account) in &self.open {
            assert!(account.tracing.is_zero(), "{unit}: no thread traces, but credit is out");
        }
    }

    fn remove(&mut self, unit: UnitId) -> Option<Account> {
        let account = self.open.remove(&unit)?;
        self.begun_count -= usize::from(account.is_begun);
        Some(account)
    }

    /// Closes an account in which nothing is live.
    fn close(&mut self, unit: UnitId) -> Option<(Share, TileSums)> {
        let account = self.remove(unit)?;
        let share = Share { unit, attempt: self.attempt(unit), credit: account.retired };
        // Without film values nothing has retired: all of it went to peers.
        Some((share, account.sums?.cropped()))
    }
}

impl Account {
    /// Whether nothing will be added while nothing is live: all has retired, or has gone to peers.
    fn is_final(&self) -> bool {
        self.retired.is_whole() || self.retired.is_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use equilux_common::unit::{Granularity, Rect};

    fn grid() -> UnitGrid {
        let region = Rect { x0: 0, y0: 0, x1: 4, y1: 4 };
        UnitGrid::new(4, region, 1, Granularity { tile_side_pixels: 4, samples_per_unit: 1 })
    }

    fn share(credit: Credit) -> Share {
        Share { unit: UnitId(0), attempt: Attempt(0), credit }
    }

    fn sums(value: i64) -> TileSums {
        let mut sums = TileSums::new(grid().unit(UnitId(0)).expect("the only unit").tile);
        sums.pixels[3].depth = value;
        sums
    }

    #[test]
    fn retired_credit_goes_home_together_once_nothing_is_live() {
        let (mut accounts, mut kept) = (Accounts::default(), Credit::whole());
        let (first, second) = (share(kept.split(3)), share(kept.split(2)));
        for share in [&share(kept), &first, &second] {
            accounts.enter(share).expect("parts of the whole");
        }
        accounts.trace(&first);
        accounts.retire(&first, &sums(5), &grid());
        assert!(
            accounts.take_complete(Time::ZERO, Duration::ZERO).is_empty(),
            "two pieces are still live"
        );
        accounts.trace(&second);
        accounts.retire(&second, &sums(6), &grid());
        let mut rest = Credit::whole();
        rest.withdraw(&first.credit).expect("a part");
        rest.withdraw(&second.credit).expect("a part");
        accounts.leave(&share(rest.clone()));
        let delivered = accounts.take_complete(Time::ZERO, Duration::ZERO);
        assert_eq!(delivered.len(), 1);
        let mut sum = delivered[0].0.credit.clone();
        sum.merge(&rest).expect("parts of the whole");
        assert!(sum.is_whole());
        assert_eq!(delivered[0].1, sums(11).cropped());
        assert_eq!(accounts.open_count(), 0);
    }

    #[test]
    fn where_rays_come_and_go_what_has_retired_waits_for_more() {
        let mut accounts = Accounts::default();
        let (now, patience) = (Time::ZERO, Duration::from_millis(20));
        let mut kept = Credit::whole();
        let parts = [share(kept.split(3)), share(kept.split(2))];
        for part in &parts {
            accounts.enter(part).expect("a part");
            accounts.trace(part);
            accounts.retire(part, &sums(1), &grid());
            assert!(accounts.take_complete(now, patience).is_empty());
        }
        assert_eq!(accounts.deadline(patience), Some(now + patience));
        let delivered = accounts.take_complete(now + patience, patience);
        assert_eq!(delivered.len(), 1, "both at once");
        assert_eq!(delivered[0].1, sums(2).cropped());
        assert_eq!((accounts.open_count(), accounts.deadline(patience)), (0, None));

        accounts.enter(&share(Credit::whole())).expect("the whole");
        accounts.trace(&share(Credit::whole()));
        accounts.retire(&share(Credit::whole()), &sums(1), &grid());
        assert_eq!(accounts.take_complete(now, patience).len(), 1, "more there is not");
    }

    #[test]
    fn a_newer_attempt_drops_the_older_account() {
        let mut accounts = Accounts::default();
        accounts.enter(&share(Credit::whole())).expect("the whole");
        assert!(accounts.raise(UnitId(0), Attempt(2)));
        assert!(!accounts.raise(UnitId(0), Attempt(1)));
        assert!(!accounts.is_current(&share(Credit::whole())));
        assert_eq!(accounts.open_count(), 0);
    }

    #[test]
    fn more_credit_than_there_is_is_refused() {
        let mut accounts = Accounts::default();
        accounts.enter(&share(Credit::whole())).expect("the whole");
        assert_eq!(accounts.enter(&share(Credit::whole())), Err(CreditOverflow));
    }
}

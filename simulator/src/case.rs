//! Cases: a cluster of equals, and the three disturbances of it that are hardest for whoever
//! spreads work. Nobody is told of them beforehand; balancing finds out, or does not.

use std::time::Duration;

use equilux_common::balancing::Word;
use equilux_common::costs::SceneCosts;

use crate::forecast::{Scenario, shortest};

/// How many times slower than the others a straggler is.
const STRAGGLER_FACTOR: u32 = 10;

/// When the others come, if one is to be issued everything: before the answer to the submission has
/// reached anybody.
const AT_ONCE: Duration = Duration::from_micros(1);

/// What is the matter with a cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Case {
    /// Nothing: all are there from the start, and as fast as they say.
    #[default]
    Even,
    /// One worker is ten times slower than the others, and than it says.
    Straggler,
    /// Half of the workers come halfway through the job.
    Latecomers,
    /// All work is issued to one worker, since the others come right after the submission; the
    /// point disturbance of Heirich & Taylor, *A parabolic load balancing method*, 1995.
    Point,
}

impl Word for Case {
    const ALL: &'static [Self] = &[Self::Even, Self::Straggler, Self::Latecomers, Self::Point];

    fn name(self) -> &'static str {
        match self {
            Self::Even => "even",
            Self::Straggler => "straggler",
            Self::Latecomers => "latecomers",
            Self::Point => "point",
        }
    }
}

impl Case {
    /// This case of a scenario in which all workers are equal and there from the start.
    #[must_use]
    pub fn of(self, costs: &SceneCosts, even: Scenario) -> Scenario {
        let mut scenario = even;
        match self {
            Self::Even => {}
            Self::Straggler => {
                for worker in scenario.workers.iter_mut().take(1) {
                    worker.speed /= STRAGGLER_FACTOR;
                }
            }
            Self::Latecomers => {
                let (all, late) = (scenario.workers.len(), scenario.workers.len() / 2);
                let joins = halfway(costs, &scenario, late);
                scenario.workers.iter_mut().skip(all - late).for_each(|it| it.joins = joins);
            }
            Self::Point => scenario.workers.iter_mut().skip(1).for_each(|it| it.joins = AT_ONCE),
        }
        scenario
    }
}

/// Half of the shortest time T that the work can take if the last `late` of P workers come then:
/// (P − late) T + late T/2 is what all P would do in the shortest time for them.
fn halfway(costs: &SceneCosts, scenario: &Scenario, late: usize) -> Duration {
    let (all, late) = (scenario.workers.len() as f64, late as f64);
    shortest(costs, scenario).mul_f64(all / (2.0 * all - late).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::forecast::{Amount, Forecast, forecast};
    use crate::network::NetworkModel;
    use crate::scenario::tests::{costs, scenario};

    fn case(case: Case, count: usize, work: Duration) -> Scenario {
        let mut even = scenario(Amount::Work(work));
        even.workers = vec![even.workers[0].clone(); count];
        even.network = NetworkModel::ethernet();
        case.of(&costs(), even)
    }

    fn play(of: Case) -> Forecast {
        forecast(&costs(), &case(of, 64, Duration::from_secs(60)))
    }

    #[test]
    fn a_straggler_is_slow_and_its_speed_counts_as_what_it_is() {
        let scenario = case(Case::Straggler, 4, Duration::from_secs(4));
        assert_eq!(scenario.workers.iter().map(|it| it.speed).sum::<u32>(), 3100);
        let forecast = play(Case::Straggler);
        let sum = forecast.elapsed.mul_f64(63.1);
        let off = forecast.capacity.as_secs_f64() / sum.as_secs_f64() - 1.0;
        assert!(off.abs() < 1e-6, "{:?} {sum:?}", forecast.capacity);
    }

    #[test]
    fn latecomers_come_when_half_of_the_time_is_over() {
        // Two do 2 s each until T = 2 s, and the third does 1 s from half of that on.
        let odd = case(Case::Latecomers, 3, Duration::from_secs(5));
        let late: Vec<_> = odd.workers.iter().map(|it| it.joins.as_secs_f64()).collect();
        assert!(late[..2] == [0.0; 2] && (late[2] - 1.0).abs() < 1e-6, "{late:?}");
        let forecast = play(Case::Latecomers);
        let joins = case(Case::Latecomers, 64, Duration::from_secs(60)).workers[63].joins;
        let share = joins.as_secs_f64() / forecast.elapsed.as_secs_f64();
        assert!((0.45..=0.5).contains(&share), "{joins:?} of {:?}", forecast.elapsed);
    }

    #[test]
    fn at_a_point_one_worker_is_issued_everything() {
        let mut scenario = case(Case::Point, 8, Duration::from_secs(1));
        scenario.balancing.balance = equilux_common::balancing::Balance::None;
        let busy =
            forecast(&costs(), &scenario).workers.iter().filter(|it| !it.busy.is_zero()).count();
        assert_eq!(busy, 1);
    }

    #[test]
    fn the_worst_cases_keep_nine_tenths_of_64_workers_busy() {
        for case in [Case::Straggler, Case::Latecomers, Case::Point] {
            let efficiency = play(case).efficiency();
            assert!((0.90..=1.0).contains(&efficiency), "{}: {efficiency}", case.name());
        }
    }

    #[test]
    fn a_single_worker_is_there_from_the_start() {
        for &of in Case::ALL {
            let scenario = case(of, 1, Duration::from_secs(1));
            assert!(scenario.workers[0].joins.is_zero(), "{}", of.name());
        }
    }
}

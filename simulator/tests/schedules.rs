//! A thousand schedules of delay, disorder, late comers and deaths, each from its seed.
//!
//! A seed that fails is printed first and last; `EQUILUX_SEED=… cargo test --release -p
//! equilux-simulator` replays it alone.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use equilux_coordinator_core::action::JobState;
use equilux_simulator::plan::Plan;
use equilux_simulator::simulation::Simulation;

fn seeds(default: std::ops::Range<u64>) -> Vec<u64> {
    match std::env::var("EQUILUX_SEED") {
        Ok(seed) => vec![seed.parse().expect("EQUILUX_SEED is a number")],
        Err(_) => default.collect(),
    }
}

fn for_each_seed(default: std::ops::Range<u64>, run: impl Fn(u64)) {
    for seed in seeds(default) {
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| run(seed))) {
            eprintln!("the schedule that failed: EQUILUX_SEED={seed}");
            resume_unwind(panic);
        }
    }
}

fn run(plan: Plan) {
    let stub = plan.stub();
    let cancelled = plan.cancelled.map(|(_, job)| job);
    let mut simulation = Simulation::new(plan, stub);
    simulation.run();
    assert!(simulation.is_quiet(), "something is left to do");
    for (id, view) in simulation.jobs() {
        let state = view.report.as_ref().map(|report| report.state.clone());
        if Some(*id) == cancelled && state == Some(JobState::Cancelled) {
            continue;
        }
        assert_eq!(state, Some(JobState::Done), "{id}");
        assert!(view.film.sums == stub.expected(&view.task), "{id} has another film");
    }
}

#[test]
fn calm_schedules_end_in_the_expected_film() {
    for_each_seed(0..1000, |seed| run(Plan::calm(seed)));
}

#[test]
fn stormy_schedules_end_in_the_expected_film() {
    for_each_seed(0..1000, |seed| run(Plan::stormy(seed)));
}

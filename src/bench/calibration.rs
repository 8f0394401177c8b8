//! How well the simulator would have told what was measured: the same job with 1 and 2 workers, its
//! paths costing what they cost in a run of one thread.

use std::time::Duration;

use equilux_common::balancing::Balance;
use equilux_common::costs::SceneCosts;
use equilux_simulator::forecast::{Amount, Scenario, forecast};
use equilux_simulator::network::NetworkModel;
use serde::Serialize;

use super::subjects::MeasuredScene;
use crate::args::{MeasuredArgs, SettingsArgs};
use crate::comparison::Comparison;
use crate::simulate::worker;
use crate::subject::{Extent, Subject};
use crate::table::{aligned, time};
use crate::{overrides, record};

/// Numbers of workers of which the prediction is checked.
const WORKERS: [u32; 2] = [1, 2];

/// Most samples per pixel that are rendered to know the costs of paths.
const SAMPLES_MAX: u32 = 16;

/// What the paths of a scene cost.
pub(crate) struct Calibration {
    model: String,
    /// With the samples per pixel that are measured.
    costs: SceneCosts,
}

/// A measured time, and what would have been predicted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Calibrated {
    p: u32,
    #[serde(flatten)]
    subject: Subject,
    measured_s: f64,
    predicted_s: f64,
    /// Of the prediction, as a part of what was measured.
    difference: f64,
}

impl Calibration {
    /// Renders a scene in one thread of this process.
    pub(crate) async fn record(scene: &MeasuredScene, spp: u32) -> anyhow::Result<Self> {
        let settings = SettingsArgs { spp: Some(spp.min(SAMPLES_MAX)), ..SettingsArgs::default() };
        let costs = record::record(&scene.path, settings, true).await?;
        let costs = SceneCosts { samples_per_pixel: spp, ..costs };
        Ok(Self { model: scene.name.clone(), costs })
    }

    /// The compute time of size 1.
    pub(crate) fn work(&self) -> Duration {
        let pixels = f64::from(self.costs.width) * f64::from(self.costs.height);
        self.costs.path_cost().mul_f64(pixels * f64::from(self.costs.samples_per_pixel))
    }

    /// What the simulator says that a measured run with balancing would take.
    fn predicted(&self, size: u32, workers: u32, args: &MeasuredArgs) -> Duration {
        let scenario = Scenario {
            seed: 1,
            // Of the networks that are simulated, this one is nearest to loopback.
            network: NetworkModel::cluster(),
            workers: vec![worker(); workers as usize],
            topology: args.spread.topology.0.clone(),
            balancing: overrides::balancing(Balance::Diffusion, &args.spread),
            amount: Amount::Size(size),
        };
        forecast(&self.costs, &scenario).elapsed
    }

    /// Beside a measured run with balancing, if it is one of this model with few workers.
    fn check(&self, run: &Comparison, args: &MeasuredArgs) -> Option<Calibrated> {
        let Extent::Size(size) = run.subject.extent else { return None };
        if run.subject.model != self.model || !WORKERS.contains(&run.workers) {
            return None;
        }
        let measured_s = run.with.elapsed.as_secs_f64();
        let predicted_s = self.predicted(size, run.workers, args).as_secs_f64();
        let difference = predicted_s / measured_s - 1.0;
        let (p, subject) = (run.workers, run.subject.clone());
        Some(Calibrated { p, subject, measured_s, predicted_s, difference })
    }
}

impl Calibrated {
    /// All measured runs of which a prediction is checked.
    pub(crate) fn all(
        calibrations: &[Calibration],
        compared: &[Comparison],
        args: &MeasuredArgs,
    ) -> Vec<Self> {
        let checked = |calibration: &Calibration| -> Vec<_> {
            compared.iter().filter_map(|run| calibration.check(run, args)).collect()
        };
        calibrations.iter().flat_map(checked).collect()
    }

    fn cells(&self) -> [String; 6] {
        [
            self.p.to_string(),
            self.subject.model_cell(),
            self.subject.extent.cell(),
            time(self.measured_s),
            time(self.predicted_s),
            format!("{:+.1}%", self.difference * 100.0),
        ]
    }
}

/// Measured and predicted times beside each other.
pub(crate) fn text(calibrated: &[Calibrated]) -> String {
    let rows: Vec<_> = calibrated.iter().map(Calibrated::cells).collect();
    aligned(&["P", "Model", "Size", "Measured", "Predicted", "Difference"], &rows, 1)
}

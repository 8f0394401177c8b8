//! How well the simulator would have told what was measured: the same job with 1 and 2 workers, its
//! paths costing what they cost in a run of one thread.

use std::time::Duration;

use equilux_common::balancing::Balance;
use equilux_common::costs::SceneCosts;
use equilux_simulator::forecast::{Amount, Scenario, forecast};
use equilux_simulator::network::NetworkModel;

use super::subjects::MeasuredScene;
use crate::args::{MeasuredArgs, SettingsArgs};
use crate::comparison::Comparison;
use crate::simulate::worker;
use crate::table::{Extent, aligned, time};
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

    fn line(&self, run: &Comparison, args: &MeasuredArgs) -> Option<[String; 6]> {
        let Extent::Size(size) = run.subject.extent else { return None };
        if run.subject.model != self.model || !WORKERS.contains(&run.workers) {
            return None;
        }
        let real = run.with.elapsed.as_secs_f64();
        let predicted = self.predicted(size, run.workers, args).as_secs_f64();
        Some([
            run.workers.to_string(),
            self.model.clone(),
            size.to_string(),
            time(real),
            time(predicted),
            format!("{:+.1}%", (predicted / real - 1.0) * 100.0),
        ])
    }
}

/// Measured and predicted times beside each other.
pub(crate) fn text(
    calibrations: &[Calibration],
    compared: &[Comparison],
    args: &MeasuredArgs,
) -> String {
    let lines = |calibration: &Calibration| -> Vec<_> {
        compared.iter().filter_map(|run| calibration.line(run, args)).collect()
    };
    let rows: Vec<_> = calibrations.iter().flat_map(lines).collect();
    aligned(&["P", "Model", "Size", "Measured", "Predicted", "Difference"], &rows, 1)
}

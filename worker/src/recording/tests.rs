//! What is recorded of real jobs, with a clock that is not.

use std::time::Duration;

use bytemuck::Zeroable;
use equilux_common::bundle::{Share, Stage};
use equilux_common::credit::Credit;
use equilux_common::ids::{Attempt, Incarnation, UnitId, WorkerId};
use equilux_common::message::{ToCoordinator, ToWorker};
use equilux_common::ray::Ray;
use equilux_common::scene::load::load;
use equilux_common::work::{RayCounts, Samples};
use equilux_render::observer::Observer;
use equilux_worker_core::Config;
use tokio::sync::mpsc;

use super::table::Cost;
use super::*;
use crate::driver::{CoordinatorLink, drive_local};
use crate::testing::{Home, pack, soon, spec, start};

fn scene() -> Scene {
    load(&pack(), "model.obj").unwrap().scene
}

fn renderer(spec: &JobSpec) -> Renderer {
    Renderer::new(scene(), &spec.camera, &spec.settings, spec.grid()).unwrap()
}

/// All of a unit.
fn work(spec: &JobSpec, unit: u32) -> Work {
    let unit = UnitId(unit);
    let path_count = spec.grid().unit(unit).unwrap().path_count();
    let share = Share { unit, attempt: Attempt(0), credit: Credit::whole() };
    Work::Samples(Samples { share, first_path: 0, path_count })
}

#[test]
fn every_ray_and_every_nanosecond_is_counted_once() {
    let spec = spec(1);
    let (renderer, cells) = (renderer(&spec), Cells::of(&spec));
    let (mut table, mut counts) = (CostTable::default(), RayCounts::default());
    let mut elapsed = Duration::ZERO;
    for unit in 0..spec.grid().unit_count() {
        // A clock that goes on by another step at every look.
        let mut looks = vec![Duration::from_secs(7)];
        let mut stopwatch = Stopwatch::start(&cells, || {
            let step = Duration::from_nanos(7 + looks.len() as u64 % 1000);
            looks.push(looks[looks.len() - 1] + step);
            looks[looks.len() - 1]
        });
        let (interrupt, mut scratch) = (AtomicBool::new(false), Scratch::default());
        let outcome =
            renderer.trace_observed(work(&spec, unit), &interrupt, &mut scratch, &mut stopwatch);
        counts.add(&outcome.unwrap().counts);
        table.merge(stopwatch.stop());
        elapsed += looks[looks.len() - 1] - looks[1];
    }
    let RayCounts { camera, indirect, specular, .. } = counts;
    let Cost { rays, nanos } = table.total();
    assert_eq!(rays, camera + indirect + specular);
    assert!(rays > camera, "some went on");
    assert!((nanos - elapsed.as_nanos() as f64).abs() < 1e-3, "{nanos} of {elapsed:?}");
    let cells = table.cells(&cells, spec.settings.samples_per_pixel).expect("all is recorded");
    assert_eq!(cells.len(), 6 * 4);
}

#[test]
fn the_rays_of_a_bundle_bear_its_time_in_equal_parts() {
    let cells = Cells::of(&spec(1));
    let mut looks = (0..).map(|look| Duration::from_nanos(look * 400));
    let mut stopwatch = Stopwatch::start(&cells, || looks.next().unwrap());
    let ray = |pixel, depth| Ray { pixel, depth, ..Ray::zeroed() };
    let rays = [ray(7, 0), ray(7, 0), ray(7, 0), ray(8, 0)];
    stopwatch.started(&rays);
    stopwatch.advanced(Stage::Intersect, &rays);
    stopwatch.advanced(Stage::Shadow, &[ray(8, 0)]);
    stopwatch.advanced(Stage::Intersect, &[ray(7, 1)]);
    let table = stopwatch.stop();
    let cost = |rays, nanos| Cost { rays, nanos };
    assert_eq!(table.of_cell(0), [cost(3, 300.0 + 300.0 + 400.0), cost(1, 400.0)]);
    assert_eq!(table.of_cell(1), [cost(1, 100.0 + 100.0 + 400.0)]);
}

#[tokio::test]
async fn a_recorded_job_gives_the_same_film_and_a_file_that_can_be_read() {
    let recorded = RecordedScene::new(scene());
    let none = TileSums::new(spec(1).settings.region());
    assert!(recorded.costs("none".into(), &none).await.is_err());
    let plain = film(Arc::new(LoadedScene::new(scene()))).await;
    let film = film(Arc::new(recorded.clone())).await;
    assert!(film == plain, "another film");
    let costs = recorded.costs("triangle".into(), &film).await.expect("all was rendered");
    assert_eq!(SceneCosts::from_json(&costs.to_json()), Ok(costs.clone()));
    assert_eq!((costs.cells.len(), costs.samples_per_pixel), (6 * 4, 4));
    assert!(costs.prepare_s > 0.0 && costs.path_cost() > Duration::ZERO);
    assert!((10.0..120.0).contains(&costs.bytes_per_pixel), "{}", costs.bytes_per_pixel);
}

/// Renders the test's job on a worker of two threads.
async fn film(scenes: Arc<dyn SceneSource>) -> TileSums {
    let (told, incoming) = mpsc::channel(1);
    let (outgoing, mut said) = mpsc::channel(1);
    let config = Config {
        worker: WorkerId(0),
        incarnation: Incarnation(1),
        threads: 2,
        speed: 1000,
        memory: None,
    };
    let link = CoordinatorLink { incoming, outgoing };
    let worker = tokio::spawn(drive_local(config, link, scenes));
    told.send(ToWorker::JobStarted(Box::new(start(1, vec![])))).await.unwrap();
    let (mut home, spec) = (Home::default(), spec(1));
    let mut film = TileSums::new(spec.settings.region());
    while !home.is_whole(&spec) {
        let message = soon(said.recv()).await.expect("the worker goes on");
        if let ToCoordinator::Delivered { sums, .. } = &message {
            film.merge(sums);
        }
        home.take(message);
    }
    drop(told);
    soon(worker).await.unwrap().unwrap();
    film
}

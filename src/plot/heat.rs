//! Everybody's load over time as a map of heat: time to the right, workers upward, and how much
//! waits with whom as color. Diffusion shows as color that spreads.

use plotters::prelude::{ChartBuilder, DrawingBackend, Rectangle};
use plotters::style::{Color, RGBColor};

use super::{Area, Drawn, Picture, axis, style};

/// Sides of one of the two maps of a row.
const PANEL_PIXELS: (u32, u32) = (600, 400);

/// Width of the scale of colors on the right.
const SCALE_PIXELS: u32 = 110;

/// Workers that get a row each; of more, several are averaged into one.
pub(crate) const HEAT_ROWS_MAX: usize = 256;

/// Steps of color; equal neighbors are drawn as one.
const SHADES: u32 = 40;

/// Where nothing waits.
const EMPTY: RGBColor = RGBColor(236, 236, 236);

/// From little to much.
const HEAT: [RGBColor; 6] = [
    RGBColor(198, 219, 239),
    RGBColor(107, 174, 214),
    RGBColor(33, 113, 181),
    RGBColor(120, 60, 140),
    RGBColor(200, 50, 60),
    RGBColor(250, 170, 40),
];

/// Maps of a number of workers, a row for each model.
pub(crate) struct HeatMaps {
    /// How many workers.
    pub(crate) workers: u32,
    /// Models.
    pub(crate) rows: Vec<Loads>,
}

/// Loads of the workers of one model.
pub(crate) struct Loads {
    /// The model, as in `Office`.
    pub(crate) model: String,
    /// Without balancing.
    pub(crate) without: LoadsOverTime,
    /// With balancing.
    pub(crate) with: LoadsOverTime,
}

/// Loads in one run.
pub(crate) struct LoadsOverTime {
    /// When the image was whole, in seconds.
    pub(crate) elapsed: f64,
    /// Time between two columns in seconds.
    pub(crate) interval: f64,
    /// By column and row: seconds of work that wait.
    pub(crate) columns: Vec<Vec<f32>>,
}

impl LoadsOverTime {
    /// Averages neighboring workers where there are too many for a row each.
    pub(crate) fn new(elapsed: f64, interval: f64, columns: &[Vec<f32>]) -> Self {
        Self { elapsed, interval, columns: columns.iter().map(|loads| averaged(loads)).collect() }
    }

    fn most(&self) -> f32 {
        self.columns.iter().flatten().copied().fold(0.0, f32::max)
    }
}

fn averaged(loads: &[f32]) -> Vec<f32> {
    let group = loads.len().div_ceil(HEAT_ROWS_MAX).max(1);
    loads.chunks(group).map(|group| group.iter().sum::<f32>() / group.len() as f32).collect()
}

impl Picture for HeatMaps {
    fn name(&self) -> String {
        format!("heat-{}", self.workers)
    }

    fn sides(&self) -> (u32, u32) {
        let (width, height) = PANEL_PIXELS;
        let rows = u32::try_from(self.rows.len()).unwrap_or(u32::MAX).max(1);
        (2 * width + SCALE_PIXELS, style::TITLE_PIXELS + rows * height)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> Drawn<B> {
        let title = format!("Work that waits with each of {} workers", self.workers);
        let rows = area.titled(&title, style::title())?.split_evenly((self.rows.len().max(1), 1));
        for (row, area) in self.rows.iter().zip(&rows) {
            let (width, _) = PANEL_PIXELS;
            let (maps, scale) = area.split_horizontally(2 * width);
            let maps = maps.split_evenly((1, 2));
            let frame = Frame {
                workers: self.workers,
                elapsed: row.without.elapsed.max(row.with.elapsed),
                most: row.without.most().max(row.with.most()).max(f32::MIN_POSITIVE),
            };
            frame.map(&maps[0], &format!("{}, without balancing", row.model), &row.without)?;
            frame.map(&maps[1], &format!("{}, with balancing", row.model), &row.with)?;
            frame.scale(&scale)?;
        }
        Ok(())
    }
}

/// What both maps of a row share.
struct Frame {
    workers: u32,
    elapsed: f64,
    most: f32,
}

impl Frame {
    fn map<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        name: &str,
        loads: &LoadsOverTime,
    ) -> Drawn<B> {
        let mut chart = ChartBuilder::on(area)
            .caption(name, style::heading())
            .margin(10)
            .x_label_area_size(style::BELOW_PIXELS)
            .y_label_area_size(style::LEFT_PIXELS)
            .build_cartesian_2d(0.0..self.elapsed, 0.0..f64::from(self.workers))?;
        chart.draw_series(self.stripes(loads))?;
        chart
            .configure_mesh()
            .disable_mesh()
            .axis_style(style::INK)
            .label_style(style::label())
            .x_labels(6)
            .x_label_formatter(&axis::time_label(self.elapsed))
            .y_labels(8)
            .y_label_formatter(&axis::count)
            .x_desc(format!("time ({})", axis::time_unit(self.elapsed)))
            .y_desc("worker")
            .draw()
    }

    /// Rectangles of one color each, row by row.
    fn stripes(&self, loads: &LoadsOverTime) -> Vec<Rectangle<(f64, f64)>> {
        let row_count = loads.columns.first().map_or(0, Vec::len);
        let height = f64::from(self.workers) / row_count.max(1) as f64;
        let mut stripes = Vec::new();
        for row in 0..row_count {
            let shades: Vec<u32> =
                loads.columns.iter().map(|column| self.shade(column[row])).collect();
            let mut from = 0;
            for run in shades.chunk_by(|a, b| a == b) {
                let time = |column: usize| (column as f64 * loads.interval).min(loads.elapsed);
                let corners = [
                    (time(from), row as f64 * height),
                    (time(from + run.len()), (row + 1) as f64 * height),
                ];
                stripes.push(Rectangle::new(corners, color(run[0]).filled()));
                from += run.len();
            }
        }
        stripes
    }

    /// 0 for nothing, otherwise from 1 to [`SHADES`].
    fn shade(&self, load: f32) -> u32 {
        (load / self.most * SHADES as f32).ceil() as u32
    }

    /// The scale of colors.
    fn scale<B: DrawingBackend>(&self, area: &Area<B>) -> Drawn<B> {
        let most = f64::from(self.most);
        let mut chart = ChartBuilder::on(area)
            .caption("seconds", style::heading())
            .margin(10)
            .margin_bottom(10 + style::BELOW_PIXELS)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..1.0, 0.0..most)?;
        let step = most / f64::from(SHADES);
        chart.draw_series((1..=SHADES).map(|shade| {
            let top = f64::from(shade) * step;
            Rectangle::new([(0.0, top - step), (1.0, top)], color(shade).filled())
        }))?;
        chart
            .configure_mesh()
            .disable_mesh()
            .disable_x_axis()
            .axis_style(style::INK)
            .label_style(style::label())
            .y_labels(8)
            .y_label_formatter(&axis::time_label(most))
            .draw()
    }
}

/// The color of a shade.
fn color(shade: u32) -> RGBColor {
    if shade == 0 {
        return EMPTY;
    }
    let place = f64::from(shade) / f64::from(SHADES) * (HEAT.len() - 1) as f64;
    let below = (place as usize).min(HEAT.len() - 2);
    let (from, to) = (HEAT[below], HEAT[below + 1]);
    let part = place - below as f64;
    let between = |a: u8, b: u8| (f64::from(a) * (1.0 - part) + f64::from(b) * part).round() as u8;
    RGBColor(between(from.0, to.0), between(from.1, to.1), between(from.2, to.2))
}

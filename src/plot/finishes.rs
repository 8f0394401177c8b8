//! The paper's figure 2: when each worker finished, without and with balancing, side by side.

use plotters::prelude::{ChartBuilder, DashedLineSeries, DrawingBackend, Rectangle};
use plotters::style::{Color, RGBColor};

use super::{Area, Drawn, Picture, axis, style};
use crate::table::time;

/// Sides of one of the two panels of a row.
const PANEL_PIXELS: (u32, u32) = (560, 360);

/// Workers that get a number each below their bars.
const NUMBERED_MAX: usize = 16;

/// Figure 2, a row for each model.
pub(crate) struct Figure2 {
    /// Models.
    pub(crate) rows: Vec<Finishes>,
}

/// Finishing times of one job, in seconds.
pub(crate) struct Finishes {
    /// The model, as in `Office`.
    pub(crate) model: String,
    /// What each would take if all had the same share of the time of one alone.
    pub(crate) ideal: f64,
    /// Each worker's time without balancing.
    pub(crate) without: Vec<f64>,
    /// Each worker's time with balancing.
    pub(crate) with: Vec<f64>,
}

impl Picture for Figure2 {
    fn name(&self) -> String {
        "figure2".into()
    }

    fn sides(&self) -> (u32, u32) {
        let (width, height) = PANEL_PIXELS;
        let rows = u32::try_from(self.rows.len()).unwrap_or(u32::MAX).max(1);
        (2 * width, style::TITLE_PIXELS + rows * height)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> Drawn<B> {
        let workers = self.rows.first().map_or(0, |row| row.with.len());
        let title = format!("When each of {workers} workers finished; dashed: an even share");
        let panels = area.titled(&title, style::title())?.split_evenly((self.rows.len().max(1), 2));
        for (row, sides) in self.rows.iter().zip(panels.chunks(2)) {
            let most = row.without.iter().chain(&row.with).copied().fold(row.ideal, f64::max);
            let panel = |what: &'static str, finishes, color| Panel { what, finishes, color, most };
            row.draw(&sides[0], &panel("without balancing", &row.without, style::WITHOUT))?;
            row.draw(&sides[1], &panel("with balancing", &row.with, style::WITH))?;
        }
        Ok(())
    }
}

/// One half of a row.
struct Panel<'a> {
    what: &'static str,
    finishes: &'a [f64],
    color: RGBColor,
    /// The top of both halves.
    most: f64,
}

impl Finishes {
    fn draw<B: DrawingBackend>(&self, area: &Area<B>, panel: &Panel<'_>) -> Drawn<B> {
        let count = panel.finishes.len();
        let x = 0.4..count as f64 + 0.6;
        let heading = format!("{}, {}", self.model, told(panel));
        let mut chart = ChartBuilder::on(area)
            .caption(heading, style::heading())
            .margin(10)
            .x_label_area_size(style::BELOW_PIXELS)
            .y_label_area_size(style::LEFT_PIXELS)
            .build_cartesian_2d(x.clone(), 0.0..panel.most * 1.08)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .bold_line_style(style::GRID)
            .light_line_style(style::GRID.mix(0.0))
            .axis_style(style::INK)
            .label_style(style::label())
            .x_labels(count.min(NUMBERED_MAX) + 1)
            .x_label_formatter(&axis::count)
            .y_labels(6)
            .y_label_formatter(&axis::time_label(panel.most))
            .x_desc("worker")
            .y_desc(format!("finished after ({})", axis::time_unit(panel.most)))
            .draw()?;
        chart.draw_series(panel.finishes.iter().zip(1..).map(|(&finish, number)| {
            let middle = f64::from(number);
            Rectangle::new([(middle - 0.38, 0.0), (middle + 0.38, finish)], panel.color.filled())
        }))?;
        let ideal = [(x.start, self.ideal), (x.end, self.ideal)];
        chart.draw_series(DashedLineSeries::new(ideal, 6, 4, style::INK.into()))?;
        Ok(())
    }
}

/// What a panel shows, in words.
fn told(panel: &Panel<'_>) -> String {
    let last = panel.finishes.iter().copied().fold(0.0, f64::max);
    let first = panel.finishes.iter().copied().fold(last, f64::min);
    format!("{}: {} to {}", panel.what, time(first), time(last))
}

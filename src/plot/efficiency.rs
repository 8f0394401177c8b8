//! Efficiency against the number of workers, beside that of the paper.

use plotters::prelude::{ChartBuilder, Cross, DrawingBackend, IntoLogRange, SeriesLabelPosition};
use plotters::style::Color;

use super::{Area, Drawn, Picture, axis, series, style};

/// What Heirich & Arvo 1996, table 1, report: workers and efficiency, of all models and sizes.
const PAPER: [(f64, f64); 10] = [
    (1.0, 1.0),
    (8.0, 0.91),
    (16.0, 0.82),
    (32.0, 0.75),
    (64.0, 0.80),
    (16.0, 0.88),
    (32.0, 0.80),
    (8.0, 0.83),
    (16.0, 0.88),
    (32.0, 0.65),
];

/// Efficiencies of all models and sizes.
pub(crate) struct Efficiencies {
    /// What of, as in `predicted, Ethernet`.
    pub(crate) what: String,
    /// A line for each model and size.
    pub(crate) lines: Vec<EfficiencyLine>,
}

/// Efficiencies of a model.
pub(crate) struct EfficiencyLine {
    /// The model and how large it was rendered.
    pub(crate) label: String,
    /// Workers and efficiency without balancing.
    pub(crate) without: Vec<(u32, f64)>,
    /// Workers and efficiency with balancing.
    pub(crate) with: Vec<(u32, f64)>,
}

impl Picture for Efficiencies {
    fn name(&self) -> String {
        "efficiency".into()
    }

    fn sides(&self) -> (u32, u32) {
        (960, 560)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> Drawn<B> {
        let area = area.titled(
            &format!("Efficiency: {}; dashed: without balancing", self.what),
            style::title(),
        )?;
        let points = || self.lines.iter().flat_map(|line| &line.with);
        let most_workers = points().map(|point| point.0).max().unwrap_or(1);
        let top = points().map(|point| point.1).fold(1.0, f64::max) * 1.04;
        let workers = axis::workers(most_workers).log_scale().base(2.0);
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(style::BELOW_PIXELS)
            .y_label_area_size(style::LEFT_PIXELS)
            .build_cartesian_2d(workers, 0.0..top)?;
        chart
            .configure_mesh()
            .bold_line_style(style::GRID)
            .light_line_style(style::GRID.mix(0.0))
            .axis_style(style::INK)
            .label_style(style::label())
            .x_labels(axis::powers(most_workers))
            .x_label_formatter(&axis::count)
            .y_labels(11)
            .y_label_formatter(&|e| format!("{e:.1}"))
            .x_desc("workers")
            .y_desc("efficiency E = T(1) / (P · T)")
            .draw()?;
        let paper = PAPER.iter().map(|&point| Cross::new(point, 4, style::FAINT.stroke_width(2)));
        chart
            .draw_series(paper)?
            .label("the paper's, 1996")
            .legend(|(x, y)| Cross::new((x + 12, y), 4, style::FAINT.stroke_width(2)));
        for (number, line) in self.lines.iter().enumerate() {
            let points = |line: &[(u32, f64)]| line.iter().map(|&(p, e)| (p.into(), e)).collect();
            let (without, with) = (points(&line.without), points(&line.with));
            series::draw(&mut chart, number, &line.label, without, with)?;
        }
        series::draw_key(&mut chart, SeriesLabelPosition::LowerLeft)
    }
}

//! How many messages and bytes a worker sends, against the number of workers.

use plotters::prelude::{ChartBuilder, DrawingBackend, IntoLogRange, SeriesLabelPosition};
use plotters::style::Color;

use super::{Area, Drawn, Picture, axis, series, style};

/// Messages and bytes of all models and sizes.
pub(crate) struct Messages {
    /// What of, as in `predicted, Ethernet`.
    pub(crate) what: String,
    /// A line for each model and size.
    pub(crate) lines: Vec<MessageLine>,
}

/// Messages of a model: by number of workers, what a worker sends on average.
pub(crate) struct MessageLine {
    /// The model and how large it was rendered.
    pub(crate) label: String,
    /// Messages and bytes without balancing.
    pub(crate) without: Vec<Sent>,
    /// Messages and bytes with balancing.
    pub(crate) with: Vec<Sent>,
}

/// What a worker sends on average.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sent {
    /// Among how many.
    pub(crate) workers: u32,
    /// Messages.
    pub(crate) messages: f64,
    /// Bytes.
    pub(crate) bytes: f64,
}

impl Picture for Messages {
    fn name(&self) -> String {
        "messages".into()
    }

    fn sides(&self) -> (u32, u32) {
        (1120, 520)
    }

    fn draw<B: DrawingBackend>(&self, area: &Area<B>) -> Drawn<B> {
        let title = format!("What a worker sends: {}; dashed: without balancing", self.what);
        let halves = area.titled(&title, style::title())?.split_evenly((1, 2));
        self.half(&halves[0], "messages per worker", |sent| sent.messages)?;
        self.half(&halves[1], "bytes per worker", |sent| sent.bytes)
    }
}

impl Messages {
    fn half<B: DrawingBackend>(
        &self,
        area: &Area<B>,
        name: &str,
        of: impl Fn(&Sent) -> f64 + Copy,
    ) -> Drawn<B> {
        let sent = || self.lines.iter().flat_map(|line| line.without.iter().chain(&line.with));
        let most_workers = sent().map(|sent| sent.workers).max().unwrap_or(1);
        let workers = axis::workers(most_workers).log_scale().base(2.0);
        let (least, most) = decades(sent().map(of));
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .x_label_area_size(style::BELOW_PIXELS)
            .y_label_area_size(style::LEFT_PIXELS)
            .build_cartesian_2d(workers, (least..most).log_scale())?;
        chart
            .configure_mesh()
            .bold_line_style(style::GRID)
            .light_line_style(style::GRID.mix(0.0))
            .axis_style(style::INK)
            .label_style(style::label())
            .x_labels(axis::powers(most_workers))
            .x_label_formatter(&axis::count)
            .y_label_formatter(&axis::short)
            .x_desc("workers")
            .y_desc(name)
            .draw()?;
        for (number, line) in self.lines.iter().enumerate() {
            let point = |sent: &Sent| (sent.workers.into(), of(sent).max(least));
            let points = |line: &[Sent]| line.iter().map(point).collect();
            let (without, with) = (points(&line.without), points(&line.with));
            series::draw(&mut chart, number, &line.label, without, with)?;
        }
        series::draw_key(&mut chart, SeriesLabelPosition::UpperRight)
    }
}

/// The powers of ten around some values.
fn decades(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let positive = values.filter(|&value| value > 0.0);
    let most = positive.clone().fold(1.0, f64::max);
    let least = positive.fold(most, f64::min);
    let mut range = (1.0, 10.0);
    while range.0 > least {
        range.0 /= 10.0;
    }
    while range.0 * 10.0 <= least {
        range.0 *= 10.0;
    }
    while range.1 < most * 1.1 {
        range.1 *= 10.0;
    }
    range
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_all_its_values_between_powers_of_ten() {
        assert_eq!(decades([30.0, 2000.0].into_iter()), (10.0, 10_000.0));
        assert_eq!(decades([0.0].into_iter()), (1.0, 10.0));
    }
}

//! What the charts against the number of workers share: a line for each model, its dashed twin
//! without balancing, and the key to both.

use plotters::chart::ChartContext;
use plotters::coord::CoordTranslate;
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::{
    Cartesian2d, Circle, DashedLineSeries, DrawingBackend, LineSeries, LogCoord, PathElement,
    SeriesLabelPosition,
};
use plotters::style::{Color, WHITE};

use super::{Drawn, style};

/// A chart whose horizontal axis is the number of workers.
pub(super) type Chart<'a, B, Y> = ChartContext<'a, B, Cartesian2d<LogCoord<f64>, Y>>;

/// Workers, and what is drawn against them.
pub(super) type Points = Vec<(f64, f64)>;

/// Draws the `number`-th line and its twin.
pub(super) fn draw<'a, B: DrawingBackend + 'a, Y: Ranged<ValueType = f64>>(
    chart: &mut Chart<'a, B, Y>,
    number: usize,
    label: &str,
    without: Points,
    with: Points,
) -> Drawn<B> {
    let (color, faint) = (style::series(number), style::twin(number));
    chart.draw_series(DashedLineSeries::new(without, 5, 4, faint.stroke_width(2)))?;
    chart
        .draw_series(LineSeries::new(with.iter().copied(), color.stroke_width(2)))?
        .label(label)
        .legend(move |(x, y)| PathElement::new([(x, y), (x + 24, y)], color.stroke_width(2)));
    chart.draw_series(with.into_iter().map(|point| Circle::new(point, 4, color.filled())))?;
    Ok(())
}

/// Draws the key to the lines.
pub(super) fn draw_key<'a, B: DrawingBackend + 'a, C: CoordTranslate>(
    chart: &mut ChartContext<'a, B, C>,
    position: SeriesLabelPosition,
) -> Drawn<B> {
    chart
        .configure_series_labels()
        .position(position)
        .margin(14)
        .legend_area_size(34)
        .background_style(WHITE.mix(0.85))
        .border_style(style::GRID)
        .label_font(style::label())
        .draw()
}

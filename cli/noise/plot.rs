//! Plots as SVG. Every axis says its unit: wavenumbers in cycles per lattice cell, power in decibels
//! relative to a white noise of unit density (the thesis's axes have no such unit, ERRATA rows 1442, 1513).

use std::ops::Range;

use plotters::coord::ranged1d::ValueFormatter;
use plotters::prelude::*;

use super::measure::{Covariance, Plane};
use super::rings::decibels;
use super::source::whole;
use crate::plot::{Cannot, Drawn, LABELS, TITLE, draw};

/// Pixels of a plot of curves.
const CURVES: (u32, u32) = (900, 560);

/// Pixels of a map.
const MAP: (u32, u32) = (760, 680);

/// Cells of a map along a side, at most.
const MAP_SIDE: usize = 128;

/// Shades of a map.
const SHADES: f64 = 48.0;

/// Decibels that the map of a spectrum covers, down from its greatest.
const MAP_DECIBELS: f64 = 60.0;

/// Wavenumbers that the map of a spectrum shows, cycles per cell: the thesis's figures end there too.
const MAP_WAVENUMBER: f64 = 4.0;

/// One curve.
pub(crate) struct Curve {
    /// Its name in the legend.
    pub(crate) label: String,
    /// Its points.
    pub(crate) points: Vec<(f64, f64)>,
}

/// What a plot of curves says about itself.
#[derive(Clone, Copy)]
pub(crate) struct Words {
    pub(crate) title: &'static str,
    pub(crate) x: &'static str,
    pub(crate) y: &'static str,
}

/// How wavenumbers are laid out.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Axis {
    Even,
    Logarithmic,
}

/// Draws curves over wavenumbers.
pub(crate) fn curves(words: Words, axis: Axis, curves: &[Curve]) -> Drawn {
    let all = || {
        let points = curves.iter().flat_map(|curve| &curve.points);
        points.filter(|(x, y)| x.is_finite() && y.is_finite())
    };
    let x = span(all().map(|point| point.0), 0.0);
    let y = span(all().map(|point| point.1), 0.04);
    draw(CURVES, |area| {
        let mut builder = ChartBuilder::on(area);
        builder
            .caption(words.title, TITLE)
            .margin(14)
            .x_label_area_size(48)
            .y_label_area_size(72);
        match axis {
            Axis::Even => {
                let mut chart = builder.build_cartesian_2d(0.0..x.end, y.clone())?;
                lines(&mut chart, words, curves)?;
            }
            Axis::Logarithmic => {
                let mut chart =
                    builder.build_cartesian_2d((x.start..x.end).log_scale(), y.clone())?;
                lines(&mut chart, words, curves)?;
            }
        }
        Ok(())
    })
}

fn style(number: usize) -> ShapeStyle {
    Palette99::pick(number).stroke_width(2)
}

/// The axes' words, the curves and their legend, whatever the axes' scales.
fn lines<'a, 'b: 'a, X, Y>(
    chart: &mut ChartContext<'a, SVGBackend<'b>, Cartesian2d<X, Y>>,
    words: Words,
    curves: &[Curve],
) -> Result<(), Cannot>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    chart
        .configure_mesh()
        .label_style(LABELS)
        .axis_desc_style(LABELS)
        .x_desc(words.x)
        .y_desc(words.y)
        .draw()?;
    for (number, curve) in curves.iter().enumerate() {
        let style = style(number);
        let points = curve.points.iter().copied();
        chart
            .draw_series(LineSeries::new(points, style))?
            .label(&curve.label)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
    }
    chart
        .configure_series_labels()
        .label_font(LABELS)
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    Ok(())
}

/// Draws an autocovariance matrix; dark is the least.
pub(crate) fn covariance(name: &str, matrix: &Covariance) -> Drawn {
    let length = whole(matrix.side) * matrix.spacing;
    let range = span(matrix.values.iter().copied(), 0.0);
    let map = Map {
        title: format!("Autocovariance of {name}"),
        words: ["x (lattice cells)", "x' (lattice cells)", "R(x, x')"],
        ends: 0.0..length,
        side: matrix.side,
        shades: range,
    };
    map.draw(|x, y| matrix.values[y * matrix.side + x])
}

/// Draws a power spectrum, wavenumber 0 in the middle; dark is weak.
pub(crate) fn spectrum(name: &str, plane: &Plane) -> Drawn {
    let half = plane.side / 2;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count of bins, not negative and no more than half of them"
    )]
    let reach = half.min((MAP_WAVENUMBER / plane.step) as usize).max(1);
    let group = (2 * reach).div_ceil(MAP_SIDE);
    let side = 2 * reach / group;
    // Mean power of a group of neighbours, whose first is `reach` steps below 0.
    let at = |x: usize, y: usize| {
        let mut sum = 0.0;
        for j in 0..group {
            for i in 0..group {
                let bin =
                    |k: usize, part: usize| (k * group + part + plane.side - reach) % plane.side;
                sum += plane.density[bin(y, j) * plane.side + bin(x, i)];
            }
        }
        decibels(sum / whole(group * group))
    };
    let most = (0..side * side)
        .map(|i| at(i % side, i / side))
        .fold(f64::NEG_INFINITY, f64::max);
    let end = whole(reach) * plane.step;
    let map = Map {
        title: format!("Power spectrum of {name}"),
        words: ["kx (cycles per cell)", "ky (cycles per cell)", "dB"],
        ends: -end..end,
        side,
        shades: most - MAP_DECIBELS..most,
    };
    map.draw(at)
}

struct Map {
    title: String,
    /// What stands along x, along y and at the bar of shades.
    words: [&'static str; 3],
    /// Both axes.
    ends: Range<f64>,
    side: usize,
    /// The values that are black and white.
    shades: Range<f64>,
}

impl Map {
    fn draw(&self, at: impl Fn(usize, usize) -> f64) -> Drawn {
        let [x_words, y_words, bar_words] = self.words;
        let cell = (self.ends.end - self.ends.start) / whole(self.side);
        let place = |i: usize| self.ends.start + whole(i) * cell;
        let shades = self.shades.end - self.shades.start;
        let shade = |value: f64| libm::round((value - self.shades.start) / shades * SHADES);
        draw(MAP, |area| {
            let (map, bar) = area.split_horizontally(MAP.0 - 110);
            let mut chart = ChartBuilder::on(&map)
                .caption(&self.title, TITLE)
                .margin(14)
                .x_label_area_size(48)
                .y_label_area_size(64)
                .build_cartesian_2d(self.ends.clone(), self.ends.clone())?;
            chart
                .configure_mesh()
                .disable_mesh()
                .label_style(LABELS)
                .axis_desc_style(LABELS)
                .x_desc(x_words)
                .y_desc(y_words)
                .draw()?;
            let mut runs = Vec::new();
            for y in 0..self.side {
                let mut x = 0;
                while x < self.side {
                    let tone = shade(at(x, y));
                    let end = (x..self.side)
                        .find(|&other| shade(at(other, y)) != tone)
                        .unwrap_or(self.side);
                    runs.push(Rectangle::new(
                        [(place(x), place(y)), (place(end), place(y + 1))],
                        grey(tone / SHADES).filled(),
                    ));
                    x = end;
                }
            }
            chart.draw_series(runs)?;
            let mut scale = ChartBuilder::on(&bar)
                .margin_top(48)
                .margin_bottom(62)
                .margin_right(14)
                .y_label_area_size(64)
                .build_cartesian_2d(0.0..1.0, self.shades.clone())?;
            scale
                .configure_mesh()
                .disable_mesh()
                .label_style(LABELS)
                .axis_desc_style(LABELS)
                .disable_x_axis()
                .y_desc(bar_words)
                .draw()?;
            let step = shades / SHADES;
            let bars = (0..48u32).map(|i| {
                let low = self.shades.start + f64::from(i) * step;
                let tone = (f64::from(i) + 0.5) / SHADES;
                Rectangle::new([(0.0, low), (1.0, low + step)], grey(tone).filled())
            });
            scale.draw_series(bars)?;
            Ok(())
        })
    }
}

fn grey(part: f64) -> RGBColor {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "held between 0 and 255; of no number it is 0"
    )]
    let tone = (part * 255.0).clamp(0.0, 255.0) as u8;
    RGBColor(tone, tone, tone)
}

/// The range of numbers, with room at its ends; never empty.
fn span(numbers: impl Iterator<Item = f64>, room: f64) -> Range<f64> {
    let mut span = f64::INFINITY..f64::NEG_INFINITY;
    for number in numbers {
        span.start = span.start.min(number);
        span.end = span.end.max(number);
    }
    if span.start < span.end {
        let room = room * (span.end - span.start);
        span.start - room..span.end + room
    } else if span.start.is_finite() {
        span.start - 1.0..span.start + 1.0
    } else {
        0.0..1.0
    }
}

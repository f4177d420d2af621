//! Plots as SVG: what all of them have in common.

use std::error::Error as StdError;

use plotters::coord::Shift;
use plotters::prelude::*;

/// Why a plot cannot be drawn.
pub(crate) type Cannot = Box<dyn StdError + Send + Sync>;

/// The text of an SVG file.
pub(crate) type Drawn = Result<String, Cannot>;

/// Where a plot is drawn.
pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// How axes and curves are lettered, and how large.
pub(crate) const LABELS: (&str, u32) = ("sans-serif", 13);

/// The same of a plot's title.
pub(crate) const TITLE: (&str, u32) = ("sans-serif", 22);

/// Draws on a white ground of so many pixels, width and height.
pub(crate) fn draw(size: (u32, u32), onto: impl FnOnce(&Area<'_>) -> Result<(), Cannot>) -> Drawn {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE)?;
        onto(&area)?;
        area.present()?;
    }
    Ok(svg)
}

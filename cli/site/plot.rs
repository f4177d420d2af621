//! `flyby site plot`: how busy sites were, and for how long a slot was free while nothing of the farm's waited.

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

use cluster::busy::{Free, Look};
use plotters::prelude::*;
use serde::Serialize;
use wire::proto::{SiteLook, SiteLooks};

use crate::output::{Report, columns};
use crate::plot::{Area, Cannot, Drawn, LABELS, draw};
use crate::progress::duration;

/// Pixels of the plot along x, and of each site along y.
const SIZE: (u32, u32) = (960, 230);

/// Pixels of what stands below, and its words.
const LEGEND: u32 = 28;
const WORDS: &str = "blue: slots busy; grey line: tasks waiting in the queue; red: looks between which a slot was free and nothing waited";

const BUSY: RGBColor = RGBColor(86, 140, 196);
const FREE: RGBColor = RGBColor(214, 60, 50);
const WAITING: RGBColor = RGBColor(90, 90, 90);

/// `site plot`.
#[derive(Serialize)]
pub(crate) struct Plotted {
    /// Each site.
    pub(crate) sites: Vec<Busy>,
    /// The plot; null where none was asked for.
    pub(crate) plot: Option<PathBuf>,
}

/// How busy a site was.
#[derive(Serialize)]
pub(crate) struct Busy {
    /// Its name.
    site: String,
    /// What should wait there beyond what runs, by the site's word.
    ahead: u32,
    /// Tasks that may run at a time; null where nobody says.
    slots: Option<u32>,
    /// The time in which the farm had more for the site than it held, milliseconds.
    counted_ms: Option<u64>,
    /// Of that, the share in which a slot was free while nothing of the farm's waited, 0 to 1; null where nobody can tell.
    free_share: Option<f64>,
    /// What each look at the queue saw, oldest first.
    looks: Vec<LookView>,
    #[serde(skip)]
    seen: Vec<Look>,
}

#[derive(Serialize)]
struct LookView {
    at_unix_ms: u64,
    running: u32,
    waiting: u32,
    submitted: u32,
    has_more: bool,
}

impl Busy {
    pub(crate) fn new(site: String, answer: SiteLooks) -> Self {
        let seen: Vec<Look> = answer.looks.iter().map(look).collect();
        let slots = Some(answer.slots).filter(|&slots| slots > 0);
        let free = slots.map(|slots| Free::of(&seen, slots));
        Self {
            site,
            ahead: answer.ahead,
            slots,
            counted_ms: free.map(|free| free.counted_ms),
            free_share: free.and_then(|free| free.share()),
            looks: answer.looks.iter().map(LookView::from).collect(),
            seen,
        }
    }

    /// In one line.
    fn line(&self) -> String {
        let (site, ahead) = (&self.site, self.ahead);
        match (self.free_share, self.counted_ms) {
            (Some(share), Some(counted)) => format!(
                "{site}, ahead {ahead}: a slot free while nothing waited {:.1} % of {}",
                100.0 * share,
                duration(Duration::from_millis(counted))
            ),
            _ => format!("{site}, ahead {ahead}"),
        }
    }

    fn minutes(&self, at_unix_ms: u64) -> f64 {
        let first = self.seen.first().map_or(0, |look| look.at_unix_ms);
        let since = Duration::from_millis(at_unix_ms.saturating_sub(first));
        since.as_secs_f64() / 60.0
    }

    /// Minutes from the first look to the last.
    fn length(&self) -> f64 {
        self.seen
            .last()
            .map_or(0.0, |look| self.minutes(look.at_unix_ms))
    }

    /// What ran, from look to look; what waited; and where a slot was free with nothing to run in it.
    fn panel(&self, area: &Area<'_>, length: f64) -> Result<(), Cannot> {
        let most = |of: &dyn Fn(&Look) -> u32| self.seen.iter().map(of).max().unwrap_or(0);
        let slots = self.slots.unwrap_or(0);
        let top = f64::from(slots.max(most(&|look| look.running)).max(1)) * 1.15;
        let queue = f64::from(most(&|look| look.waiting).max(1)) * 1.15;
        let mut chart = ChartBuilder::on(area)
            .caption(self.line(), ("sans-serif", 17))
            .margin(8)
            .x_label_area_size(42)
            .y_label_area_size(58)
            .right_y_label_area_size(58)
            .build_cartesian_2d(0.0..length, 0.0..top)?
            .set_secondary_coord(0.0..length, 0.0..queue);
        chart
            .configure_mesh()
            .label_style(LABELS)
            .axis_desc_style(LABELS)
            .light_line_style(TRANSPARENT)
            .x_desc("minutes since the first look")
            .y_desc("slots busy")
            .y_labels(5)
            .y_label_formatter(&whole)
            .draw()?;
        chart
            .configure_secondary_axes()
            .label_style(LABELS)
            .axis_desc_style(LABELS)
            .y_desc("tasks waiting")
            .y_labels(5)
            .y_label_formatter(&whole)
            .draw()?;
        let points = |of: &dyn Fn(&Look) -> u32| -> Vec<(f64, f64)> {
            let looks = self.seen.iter();
            looks
                .map(|look| (self.minutes(look.at_unix_ms), f64::from(of(look))))
                .collect()
        };
        let running = points(&|look| look.running);
        let mut ground = running.clone();
        ground.extend([(self.length(), 0.0), (0.0, 0.0)]);
        chart.draw_series([Polygon::new(ground, BUSY.mix(0.55).filled())])?;
        chart.draw_series(LineSeries::new(running, BUSY))?;
        let free = self.seen.windows(2).filter(|pair| {
            let free = Free::of(pair, slots);
            free.free_ms > 0
        });
        let free = free.map(|pair| {
            let [from, to] = [pair[0], pair[1]].map(|look| self.minutes(look.at_unix_ms));
            Rectangle::new([(from, 0.0), (to, top)], FREE.mix(0.35).filled())
        });
        chart.draw_series(free)?;
        if slots > 0 {
            let all = f64::from(slots);
            chart.draw_series(LineSeries::new([(0.0, all), (length, all)], BLACK.mix(0.4)))?;
        }
        let waiting = points(&|look| look.waiting);
        chart.draw_secondary_series(LineSeries::new(waiting, WAITING))?;
        Ok(())
    }
}

impl Plotted {
    /// Draws a panel for each site, one below the other, over the same time: busy slots in blue, waiting tasks as a grey line,
    /// and red where a slot was free with nothing of the farm's to run in it.
    pub(crate) fn draw(&self) -> Drawn {
        let length = self.sites.iter().map(Busy::length).fold(0.0, f64::max);
        let panels = u32::try_from(self.sites.len().max(1)).unwrap_or(1);
        draw((SIZE.0, SIZE.1 * panels + LEGEND), |area| {
            let (area, legend) = area.split_vertically(SIZE.1 * panels);
            legend.draw_text(WORDS, &LABELS.into_text_style(&legend), (70, 2))?;
            let panels = area.split_evenly((self.sites.len().max(1), 1));
            for (site, panel) in self.sites.iter().zip(&panels) {
                // A plot without a look is empty, and has axes.
                site.panel(panel, length.max(1.0 / 60.0))?;
            }
            Ok(())
        })
    }
}

/// A number of slots or tasks at an axis.
fn whole(number: &f64) -> String {
    format!("{number:.0}")
}

fn look(look: &SiteLook) -> Look {
    Look {
        at_unix_ms: look.at_unix_ms,
        running: look.running,
        waiting: look.waiting,
        submitted: look.submitted,
        has_more: look.has_more,
    }
}

impl From<&SiteLook> for LookView {
    fn from(look: &SiteLook) -> Self {
        Self {
            at_unix_ms: look.at_unix_ms,
            running: look.running,
            waiting: look.waiting,
            submitted: look.submitted,
            has_more: look.has_more,
        }
    }
}

impl Report for Plotted {
    fn table(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut table = columns(["site", "ahead", "slots", "looks", "time", "slot free"]);
        for site in &self.sites {
            let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
            let counted = site.counted_ms.map(Duration::from_millis);
            table.add_row([
                site.site.clone(),
                site.ahead.to_string(),
                or_dash(site.slots.map(|slots| slots.to_string())),
                site.looks.len().to_string(),
                or_dash(counted.map(duration)),
                or_dash(
                    site.free_share
                        .map(|share| format!("{:.1} %", 100.0 * share)),
                ),
            ]);
        }
        writeln!(out, "{}", table.trim_fmt())?;
        if let Some(plot) = &self.plot {
            writeln!(out, "The plot is {}.", plot.display())?;
        }
        Ok(())
    }

    fn quiet(&self, out: &mut dyn Write) -> io::Result<()> {
        let mut plot = self.plot.iter();
        plot.try_for_each(|plot| writeln!(out, "{}", plot.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn busy(looks: &[[u32; 3]]) -> Busy {
        let look = |(at, &[running, waiting, submitted]): (u64, &[u32; 3])| SiteLook {
            at_unix_ms: 1_000_000 + at * 30_000,
            running,
            waiting,
            submitted,
            has_more: true,
        };
        let looks = (0..).zip(looks).map(look).collect();
        Busy::new(
            "snowdon".into(),
            SiteLooks {
                slots: 4,
                ahead: 0,
                looks,
            },
        )
    }

    #[test]
    fn a_free_slot_is_told_and_drawn() {
        let (full, empty) = ([4, 8, 0], [1, 0, 12]);
        let plotted = Plotted {
            sites: vec![busy(&[full, full]), busy(&[full, empty, full])],
            plot: None,
        };
        let mut table = Vec::new();
        plotted.table(&mut table).unwrap();
        let table = String::from_utf8(table).unwrap();
        assert!(
            table.contains("0.0 %") && table.contains("25.0 %"),
            "{table}"
        );
        let svg = plotted.draw().unwrap();
        let red = svg.matches("#D63C32").count();
        assert_eq!(red, 1, "{svg}");
        assert!(
            svg.contains("slot free while nothing waited 25.0 % of 1 min 0 s"),
            "{svg}"
        );
    }

    #[test]
    fn a_site_that_was_never_looked_at_has_a_plot_too() {
        let plotted = Plotted {
            sites: vec![busy(&[])],
            plot: None,
        };
        assert!(plotted.draw().unwrap().contains("snowdon, ahead 0"));
    }
}

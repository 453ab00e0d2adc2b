//! Curves as CSV (long form: series, x, y) and SVG.

use miette::{IntoDiagnostic, WrapErr, miette};
use plotters::prelude::*;
use runs::report::plots::{COLOURS, ends};
use std::path::Path;

/// Room for the legend, in pixels.
const LEGEND_WIDTH: i32 = 190;
/// One curve.
pub struct Series {
    /// Its name in the legend and in the CSV.
    pub name: String,
    /// Its points.
    pub points: Vec<(f64, f64)>,
    /// Marks instead of a line.
    pub marks: bool,
    /// Uncertainty of the curve, where it has one: x, low, high.
    pub band: Vec<(f64, f64, f64)>,
}

/// What the paper states of a figure without a curve for it.
pub enum PaperMark {
    /// Something happens between two values of x: which, and what the paper says.
    Span([f64; 2], &'static str),
    /// A value of y, and what the paper says.
    Level(f64, &'static str),
}

impl Series {
    /// A line.
    pub fn line(name: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
        Series { name: name.into(), points, marks: false, band: Vec::new() }
    }

    /// Marks.
    pub fn marks(name: impl Into<String>, points: Vec<(f64, f64)>) -> Series {
        Series { name: name.into(), points, marks: true, band: Vec::new() }
    }
}

/// A chart: names of its axes are the CSV's columns, with their units.
pub struct Chart {
    /// File name without its end.
    pub name: String,
    /// Title.
    pub title: String,
    /// Name of x with unit.
    pub x: String,
    /// Name of y with unit.
    pub y: String,
    /// Curves.
    pub series: Vec<Series>,
    /// What the paper states.
    pub stated: Vec<PaperMark>,
}

impl Chart {
    /// A chart of which the paper states nothing but its curves. `axes` are the names of x and y.
    pub fn new(
        name: impl Into<String>,
        title: impl Into<String>,
        axes: [&str; 2],
        series: Vec<Series>,
    ) -> Chart {
        let [x, y] = axes.map(String::from);
        Chart { name: name.into(), title: title.into(), x, y, series, stated: Vec::new() }
    }

    /// Writes `NAME.csv` into `out`.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn write_table(&self, out: &Path) -> miette::Result<()> {
        let mut csv = csv::Writer::from_path(out.join(format!("{}.csv", self.name)))
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write into {}", out.display()))?;
        csv.write_record(["series", &self.x, &self.y]).into_diagnostic()?;
        for series in &self.series {
            for (x, y) in &series.points {
                csv.write_record([&series.name, &format!("{x:e}"), &format!("{y:e}")]).into_diagnostic()?;
            }
        }
        csv.flush().into_diagnostic()
    }

    /// Writes `NAME.svg` into `out`, for a screen.
    ///
    /// # Errors
    /// Whatever the drawing library says.
    pub fn write_picture(&self, out: &Path) -> miette::Result<()> {
        self.draw(&out.join(format!("{}.svg", self.name))).map_err(|why| miette!("{}: {why}", self.name))
    }

    fn draw(&self, path: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let points =
            || self.series.iter().flat_map(|s| &s.points).filter(|p| p.0.is_finite() && p.1.is_finite());
        let range = |pick: fn(&(f64, f64)) -> f64| {
            let [low, high] = ends(points().map(pick));
            let margin = 0.04 * (high - low).max(1e-12);
            low - margin..high + margin
        };
        let root = SVGBackend::new(path, (860, 560)).into_drawing_area();
        root.fill(&WHITE)?;
        // The legend stands beside the curves, never on them.
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .margin_right(LEGEND_WIDTH)
            .x_label_area_size(44)
            .y_label_area_size(72)
            .build_cartesian_2d(range(|p| p.0), range(|p| p.1))?;
        chart.configure_mesh().x_desc(&self.x).y_desc(&self.y).light_line_style(BLACK.mix(0.06)).draw()?;
        for (k, series) in self.series.iter().enumerate() {
            let colour = COLOURS[k % COLOURS.len()];
            if series.marks {
                chart.draw_series(series.points.iter().map(|p| Circle::new(*p, 3, colour.filled())))?;
            } else {
                chart.draw_series(LineSeries::new(series.points.iter().copied(), colour.stroke_width(2)))?;
            }
            let (x, y) = (860 - LEGEND_WIDTH + 8, 60 + 20 * k as i32);
            root.draw(&Rectangle::new([(x, y - 3), (x + 14, y + 3)], colour.filled()))?;
            root.draw(&Text::new(series.name.as_str(), (x + 20, y - 7), ("sans-serif", 12)))?;
        }
        root.present()?;
        Ok(())
    }
}

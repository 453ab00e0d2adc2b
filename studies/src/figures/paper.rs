//! A figure as a journal prints it: the charts as lettered panels of one sheet of 85 or 174 mm (one or two columns), letters of 7 to 8
//! points, axis titles with units, no title and no grid within; series distinguished by dash and mark as well
//! as by colour. As SVG, and as PDF; both are drawn by the same strokes.

use super::pdf::PdfBackend;
use super::plot::{Chart, PaperMark, Series};
use miette::miette;
use plotters::coord::Shift;
use plotters::prelude::*;
use runs::report::plots::{COLOURS, ends, mark};
use std::path::Path;

/// Widths of one and of two columns, mm.
const COLUMNS_MM: [f64; 2] = [85.0, 174.0];
/// Height of the axes of a panel with all that belongs to them but the legend, mm.
const PANEL_MM: f64 = 58.0;
/// Units of the drawing in a point: the drawing library counts in whole numbers.
pub const PER_POINT: i32 = 10;
/// Letters of ticks and legend, and of the axes' titles, in those units.
const SMALL: i32 = 7 * PER_POINT;
const LARGE: i32 = 8 * PER_POINT;
/// A line of the legend.
const LINE: i32 = 95;
const GREY: RGBColor = RGBColor(110, 110, 110);

fn units(mm: f64) -> i32 {
    (mm / 25.4 * 72.0 * f64::from(PER_POINT)).round() as i32
}

/// What a column of the charts is called on an axis, with its unit; none for a name that no figure has.
pub fn axis_title(column: &str) -> Option<&'static str> {
    Some(match column {
        "amplitude_pp_um" => "Amplitude w, peak-to-peak (\u{b5}m)",
        "sine_amplitude_um" => "Amplitude w, of the sine (\u{b5}m)",
        "cycle" => "Cycle",
        "force_n" => "Force (N)",
        "mu_relative" => "Relative friction \u{b5}'",
        "phase_shift_deg" => "Contact phase shift (deg)",
        "psi_eq17" => "\u{3a8} (Eq. 17)",
        "reaction_force_n" => "Reaction force (N)",
        "share" => "Share of the final value",
        "time_periods" => "Time (periods)",
        "time_us" => "Time (\u{b5}s)",
        "velocity_m_s" => "Velocity (m/s)",
        _ => return None,
    })
}

/// Writes `NAME.svg` and `NAME.pdf` into `out`.
///
/// # Errors
/// An axis without a title, or whatever the drawing library and the file system say.
pub fn write(name: &str, charts: &[Chart], out: &Path) -> miette::Result<()> {
    let columns = charts.len().min(2);
    let rows = charts.len().div_ceil(columns.max(1));
    let width = COLUMNS_MM[columns.saturating_sub(1)];
    // A legend has two columns.
    let lines = |chart: &Chart| (chart.series.len() + chart.stated.len()).div_ceil(2) as i32;
    let legend = charts.iter().map(lines).max().unwrap_or(0) * LINE;
    let size = (units(width) as u32, (rows as i32 * (units(PANEL_MM) + legend)) as u32);
    let mut svg = String::new();
    draw(SVGBackend::with_string(&mut svg, size), charts, (rows, columns), legend)?;
    let height = f64::from(size.1) / f64::from(72 * PER_POINT) * 25.4;
    let in_units = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
    let svg = svg.replacen(&in_units, &format!("width=\"{width:.2}mm\" height=\"{height:.2}mm\""), 1);
    runs::files::write_whole(&out.join(format!("{name}.svg")), svg)?;
    let mut pdf = Vec::new();
    draw(PdfBackend::new(&mut pdf, size), charts, (rows, columns), legend)?;
    runs::files::write_whole(&out.join(format!("{name}.pdf")), pdf)
}

fn draw<DB: DrawingBackend>(
    backend: DB,
    charts: &[Chart],
    grid: (usize, usize),
    legend: i32,
) -> miette::Result<()>
where
    DB::ErrorType: 'static,
{
    let area = backend.into_drawing_area();
    for (k, (panel, chart)) in area.split_evenly(grid).iter().zip(charts).enumerate() {
        let letter = (charts.len() > 1).then(|| char::from(b'a' + k as u8));
        draw_panel(panel, chart, letter, legend).map_err(|why| miette!("{}: {why}", chart.name))?;
    }
    area.present().map_err(|why| miette!("{why}"))
}

/// Over all that is drawn, with a margin; a ratio begins at zero.
fn range(chart: &Chart, y: bool) -> std::ops::Range<f64> {
    let of = |p: &(f64, f64)| if y { p.1 } else { p.0 };
    let drawn = chart.series.iter().flat_map(|s| s.points.iter().map(of));
    let bands = chart.series.iter().flat_map(|s| s.band.iter().flat_map(|b| [b.1, b.2])).filter(|_| y);
    let stated = chart.stated.iter().flat_map(|s| match s {
        PaperMark::Span(range, _) if !y => range.to_vec(),
        PaperMark::Level(value, _) if y => vec![*value],
        _ => Vec::new(),
    });
    let all = drawn.chain(bands).chain(stated).filter(|v| v.is_finite());
    let [low, high] = ends(all);
    let low = if low > 0.0 && low < 0.3 * high { 0.0 } else { low };
    let margin = 0.04 * (high - low).max(1e-12);
    if low == 0.0 { low..high + margin } else { low - margin..high + margin }
}

fn draw_panel<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    chart: &Chart,
    letter: Option<char>,
    legend: i32,
) -> Result<(), Box<dyn std::error::Error>>
where
    DB::ErrorType: 'static,
{
    let title = |column: &str| axis_title(column).ok_or_else(|| format!("'{column}' has no title"));
    let (x_title, y_title) = (title(&chart.x)?, title(&chart.y)?);
    let mut axes = ChartBuilder::on(area)
        .margin_top(legend + LINE)
        .margin_right(units(3.0))
        .x_label_area_size(units(10.0))
        .y_label_area_size(units(14.0))
        .build_cartesian_2d(range(chart, false), range(chart, true))?;
    for stated in &chart.stated {
        let (x, y) = (range(chart, false), range(chart, true));
        match stated {
            PaperMark::Span([low, high], _) => {
                let corners = [(*low, y.start), (*high, y.end)];
                axes.draw_series([Rectangle::new(corners, GREY.mix(0.2).filled())])?;
            }
            PaperMark::Level(value, _) => {
                let ends = [(x.start, *value), (x.end, *value)];
                axes.draw_series(DashedLineSeries::new(ends, 12, 24, GREY.stroke_width(8)))?;
            }
        }
    }
    for (k, series) in chart.series.iter().enumerate() {
        draw_series(&mut axes, k, series)?;
    }
    // After the curves: what leaves the axes is cut by their frame, and the frame stays whole.
    axes.configure_mesh()
        .disable_mesh()
        .x_labels(6)
        .y_labels(6)
        .x_label_formatter(&|v| tick(*v))
        .y_label_formatter(&|v| tick(*v))
        .x_desc(x_title)
        .y_desc(y_title)
        .label_style(("sans-serif", SMALL))
        .axis_desc_style(("sans-serif", LARGE))
        .axis_style(BLACK.stroke_width(5))
        .set_all_tick_mark_size(20)
        .draw()?;
    if let Some(letter) = letter {
        area.draw(&Text::new(format!("({letter})"), (units(1.0), units(1.0)), ("sans-serif", LARGE)))?;
    }
    draw_legend(area, chart)
}

/// A tick's number without zeros that say nothing.
fn tick(value: f64) -> String {
    let text = format!("{value:.6}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}

/// A name of a legend: columns of the study in words, with the units in which people say them.
fn legend(name: &str) -> String {
    let (column, value) = name.split_once(' ').map_or((name, None), |(c, v)| (c, v.parse::<f64>().ok()));
    let (words, symbol, factor, unit) = match column {
        "frequency_hz" => ("frequency", "f", 1e-3, " kHz"),
        "speed_m_s" => ("speed", "U", 1e3, " mm/s"),
        "normal_force_n" => ("normal force", "F", 1.0, " N"),
        "mu0" => ("\u{b5}0", "\u{b5}0", 1.0, ""),
        "young_modulus_pa" => ("Young's modulus", "E", 1e-6, " MPa"),
        _ => return name.to_string(),
    };
    value.map_or_else(|| words.to_string(), |v| format!("{symbol} = {}{unit}", tick(v * factor)))
}

/// The dash of a series in units; none for a whole line.
fn dash(k: usize) -> Option<i32> {
    [None, Some(40), Some(16), Some(80)][k % 4]
}

fn draw_series<DB: DrawingBackend>(
    axes: &mut ChartContext<
        '_,
        DB,
        Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
    >,
    k: usize,
    series: &Series,
) -> Result<(), Box<dyn std::error::Error>>
where
    DB::ErrorType: 'static,
{
    let colour = COLOURS[k % COLOURS.len()];
    let points: Vec<(f64, f64)> =
        series.points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite()).collect();
    if !series.band.is_empty() {
        let high = series.band.iter().map(|b| (b.0, b.2));
        let low = series.band.iter().rev().map(|b| (b.0, b.1));
        axes.draw_series([Polygon::new(high.chain(low).collect::<Vec<_>>(), colour.mix(0.2))])?;
    }
    if series.marks {
        axes.draw_series(points.iter().map(|p| mark(k, *p, 14, colour, true)))?;
        return Ok(());
    }
    let stroke = colour.stroke_width(9);
    let along = points.iter().copied();
    if let Some(dash) = dash(k) {
        axes.draw_series(DashedLineSeries::new(along, dash, dash / 2 + 10, stroke))?;
    } else {
        axes.draw_series(LineSeries::new(along, stroke))?;
    }
    // Some of the places along the curve carry the series' mark, others for each series.
    let every = points.len().div_ceil(7).max(1);
    let marked = points.iter().skip((k * every / 5) % every).step_by(every);
    axes.draw_series(marked.map(|p| mark(k, *p, 16, colour, true)))?;
    Ok(())
}

/// The legend, above the axes and never on the curves.
fn draw_legend<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    chart: &Chart,
) -> Result<(), Box<dyn std::error::Error>>
where
    DB::ErrorType: 'static,
{
    let (left, half) = (units(14.0), (area.dim_in_pixel().0 as i32 - units(16.0)) / 2);
    let place = |n: usize| (left + (n % 2) as i32 * half, LINE * (n / 2) as i32 + LINE / 2 + units(1.0));
    let words = |n: usize, text: &str| {
        Text::new(text.to_string(), (place(n).0 + 200, place(n).1 - SMALL / 2), ("sans-serif", SMALL))
    };
    for (k, series) in chart.series.iter().enumerate() {
        let (x, y) = place(k);
        let colour = COLOURS[k % COLOURS.len()];
        if !series.marks {
            let dash = dash(k).unwrap_or(160);
            let mut from = x;
            while from < x + 160 {
                let to = (from + dash).min(x + 160);
                area.draw(&PathElement::new(vec![(from, y), (to, y)], colour.stroke_width(9)))?;
                from = to + dash / 2 + 10;
            }
        }
        let at = mark(k, (x + 80, y), 16, colour, true);
        area.draw(&at)?;
        area.draw(&words(k, &legend(&series.name)))?;
    }
    for (n, stated) in (chart.series.len()..).zip(&chart.stated) {
        let (x, y) = place(n);
        let (PaperMark::Span(_, text) | PaperMark::Level(_, text)) = stated;
        match stated {
            PaperMark::Span(..) => {
                area.draw(&Rectangle::new([(x, y - 30), (x + 160, y + 30)], GREY.mix(0.2).filled()))?
            }
            PaperMark::Level(..) => {
                for from in (x..x + 160).step_by(36) {
                    area.draw(&PathElement::new(vec![(from, y), (from + 12, y)], GREY.stroke_width(8)))?;
                }
            }
        }
        area.draw(&words(n, text))?;
    }
    Ok(())
}

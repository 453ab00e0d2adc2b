//! The figures, as SVG text: what all of them share. Each is drawn twice, wide for a page and narrow for a
//! telephone, with its own letters in both; the page shows one of them. Series differ by mark and dash as
//! well as by colour. An error of a figure is one of the drawing library.

pub mod campaign;
pub mod comparison;
pub mod fidelity;
pub mod published;
pub mod run;
pub mod verdict;

use super::html::escape;
use models::psi::{self, PsiEq17};
use plotters::coord::combinators::LogCoord;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::element::{Drawable, PointCollection};
use plotters::prelude::*;
use plotters_backend::{BackendCoord, DrawingErrorKind};
use std::borrow::Borrow;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::ops::Range;

/// Colours that stay apart on white, also for colour-blind readers (after Okabe and Ito, the yellow
/// darkened).
pub const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(190, 130, 0),
    RGBColor(0, 0, 0),
    RGBColor(130, 130, 130),
];
const GREY: RGBColor = RGBColor(90, 90, 90);
/// Width and height of a figure across the page, and of one on a telephone, px.
const WIDE: (u32, u32) = (900, 460);
const NARROW: (u32, u32) = (360, 320);
/// The same for one of several side by side.
const PANEL: (u32, u32) = (400, 280);
/// Title of an axis of amplitudes.
const AMPLITUDE: &str = "amplitude w, \u{b5}m peak to peak";

fn wrong(e: impl std::fmt::Display) -> miette::Report {
    miette::miette!("a figure: {e}")
}

/// The least and the greatest of some values.
pub fn ends(values: impl IntoIterator<Item: Borrow<f64>>) -> [f64; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    values.into_iter().fold(none, |[low, high], v| [low.min(*v.borrow()), high.max(*v.borrow())])
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

/// One axis from end to end.
#[derive(Clone, Copy, Debug)]
pub struct AxisRange {
    low: f64,
    high: f64,
    logarithmic: bool,
}

impl AxisRange {
    fn linear(range: Range<f64>) -> Self {
        AxisRange { low: range.start, high: range.end, logarithmic: false }
    }

    fn logarithmic(range: Range<f64>) -> Self {
        AxisRange { low: range.start, high: range.end, logarithmic: true }
    }

    /// From zero on, over all of these values.
    pub fn from_zero(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values.fold((0.0f64, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        AxisRange::linear(low..high + 0.05 * (high - low).max(1e-300))
    }

    /// Over all of these values with a margin, logarithmic where it may be and they span more than a decade:
    /// within one such an axis has a single label.
    pub fn over(values: impl Iterator<Item = f64>, logarithmic: bool) -> Self {
        let [low, high] = ends(values);
        if logarithmic && low > 0.0 && high > 10.0 * low {
            let margin = (high / low).powf(0.04);
            return AxisRange::logarithmic(low / margin..high * margin);
        }
        let margin = 0.04 * (high - low).max(1e-12 * high.abs().max(1e-300));
        AxisRange::linear(low - margin..high + margin)
    }

    /// So many places along it, the lower end left out.
    pub fn places(&self, n: u32) -> impl Iterator<Item = f64> + use<> {
        let AxisRange { low, high, logarithmic } = *self;
        (1..=n).map(move |k| {
            let share = f64::from(k) / f64::from(n);
            if logarithmic { low * (high / low).powf(share) } else { low + share * (high - low) }
        })
    }

    fn axis(&self) -> Axis {
        let range = self.low..self.high;
        if self.logarithmic {
            Axis::Logarithmic(range.log_scale().into())
        } else {
            Axis::Linear(range.into())
        }
    }
}

/// The same as the drawing library has it.
enum Axis {
    Linear(RangedCoordf64),
    Logarithmic(LogCoord<f64>),
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        match self {
            Axis::Linear(axis) => axis.map(value, limit),
            Axis::Logarithmic(axis) => axis.map(value, limit),
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        match self {
            Axis::Linear(axis) => axis.key_points(hint),
            // Two powers of ten are no scale.
            Axis::Logarithmic(axis) => {
                Some(axis.key_points(hint)).filter(|p| p.len() > 2).unwrap_or_else(|| {
                    let steps = (-30..30).flat_map(|n| [1.0, 2.0, 5.0].map(|k| k * 10f64.powi(n)));
                    steps.filter(|at| axis.range().contains(at)).collect()
                })
            }
        }
    }

    fn range(&self) -> Range<f64> {
        match self {
            Axis::Linear(axis) => axis.range(),
            Axis::Logarithmic(axis) => axis.range(),
        }
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        let text = match self {
            Axis::Linear(axis) => axis.format_ext(value),
            Axis::Logarithmic(axis) => axis.format_ext(value),
        };
        // A zero that rounding made negative has no sign.
        match text.strip_prefix('-').filter(|rest| rest.bytes().all(|b| matches!(b, b'0' | b'.'))) {
            Some(zero) => zero.to_string(),
            None => text,
        }
    }
}

type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<Axis, Axis>>;

/// A figure as SVG, wide and narrow: its wide size, its axes with their titles, and what it shows in one
/// sentence for who cannot see it. `draw` puts the curves in and gets the size of a mark.
fn figure(
    wide: (u32, u32),
    x: (AxisRange, &str),
    y: (AxisRange, &str),
    alt: &str,
    draw: impl for<'a> Fn(&mut Chart<'a>, u32) -> miette::Result<()>,
) -> miette::Result<String> {
    let mut text = String::new();
    for (class, size) in [("wide", wide), ("narrow", NARROW)] {
        let mut svg = String::new();
        {
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            let letters = if size.0 < WIDE.0 / 2 { 13 } else { 15 };
            let mut chart = ChartBuilder::on(&area)
                .margin(10)
                .x_label_area_size(3 * letters)
                .y_label_area_size(4 * letters)
                .build_cartesian_2d(x.0.axis(), y.0.axis())
                .map_err(wrong)?;
            chart
                .configure_mesh()
                .max_light_lines(0)
                .bold_line_style(BLACK.mix(0.12))
                .x_labels((size.0 / 75) as usize)
                .y_labels((size.1 / 45) as usize)
                .x_desc(x.1)
                .y_desc(y.1)
                .label_style(("sans-serif", letters))
                .draw()
                .map_err(wrong)?;
            draw(&mut chart, if size.0 < WIDE.0 { 3 } else { 4 })?;
            area.present().map_err(wrong)?;
        }
        // Attributes that say what holds without them are a third of a mark.
        for default in [" opacity=\"1\"", " stroke=\"none\"", " stroke-width=\"1\""] {
            svg = svg.replace(default, "");
        }
        let labelled = format!("<svg role=\"img\" aria-label=\"{}\" ", escape(alt));
        let svg = marks_joined(&svg).replacen("<svg ", &labelled, 1);
        text.push_str(&format!("<div class=\"{class}\">{svg}</div>"));
    }
    Ok(text)
}

/// The number of marks that are distinguished by their shape alone.
const MARKS: usize = 5;

/// A mark whose shape is the series': disc, square, triangle, diamond, cross; hollow where it is not filled.
pub fn mark<C>(series: usize, at: C, size: u32, colour: RGBColor, filled: bool) -> Mark<C> {
    Mark {
        series: series % MARKS,
        at,
        size: size as i32,
        style: colour.stroke_width(if filled { 2 } else { 1 }),
        filled,
    }
}

/// A mark of a series, drawn so that series differ without colour.
pub struct Mark<C> {
    series: usize,
    at: C,
    size: i32,
    style: ShapeStyle,
    filled: bool,
}

impl<'a, C> PointCollection<'a, C> for &'a Mark<C> {
    type Point = &'a C;
    type IntoIter = std::iter::Once<&'a C>;

    fn point_iter(self) -> Self::IntoIter {
        std::iter::once(&self.at)
    }
}

impl<C, DB: DrawingBackend> Drawable<DB> for Mark<C> {
    fn draw<I: Iterator<Item = BackendCoord>>(
        &self,
        mut places: I,
        backend: &mut DB,
        _: (u32, u32),
    ) -> Result<(), DrawingErrorKind<DB::ErrorType>> {
        let Some((x, y)) = places.next() else { return Ok(()) };
        let r = self.size;
        let corners: &[(i32, i32)] = match self.series {
            0 => return backend.draw_circle((x, y), r as u32, &self.style, self.filled),
            1 => &[(-r, -r), (r, -r), (r, r), (-r, r), (-r, -r)],
            2 => &[(0, -r - 1), (r + 1, r), (-r - 1, r), (0, -r - 1)],
            3 => &[(0, -r - 1), (r + 1, 0), (0, r + 1), (-r - 1, 0), (0, -r - 1)],
            _ => {
                backend.draw_line((x - r, y - r), (x + r, y + r), &self.style)?;
                return backend.draw_line((x - r, y + r), (x + r, y - r), &self.style);
            }
        };
        let outline = corners.iter().map(|(dx, dy)| (x + dx, y + dy));
        if self.filled {
            backend.fill_polygon(outline, &self.style)
        } else {
            backend.draw_path(outline, &self.style)
        }
    }
}

/// Dots and strokes of one look that follow one another become one path: a point of a line with round ends is
/// a dot. Equal ones cover each other and are drawn once. Else 10,000 passes make a page of 27 MB.
fn marks_joined(svg: &str) -> String {
    let mark = |line: &str| {
        let parts: Vec<&str> = line.split('"').collect();
        match parts[..] {
            ["<circle cx=", x, " cy=", y, " r=", radius, " fill=", colour, " stroke-width=", "2", "/>"] => {
                let width = 2 * radius.parse::<u32>().ok()?;
                let look = format!("stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linecap=\"round\"");
                Some((look, format!("M{x},{y}h0")))
            }
            ["<polyline fill=", "none", " stroke=", colour, " points=", points, "/>"] => {
                Some((format!("fill=\"none\" stroke=\"{colour}\""), format!("M{}", points.trim_end())))
            }
            _ => None,
        }
    };
    let mut text = String::new();
    let lines: Vec<_> = svg.lines().map(|line| (line, mark(line))).collect();
    let look = |line: &(&str, Option<(String, String)>)| line.1.as_ref().map(|mark| mark.0.clone());
    for alike in lines.chunk_by(|a, b| look(a).is_some() && look(a) == look(b)) {
        let paths: BTreeSet<&str> =
            alike.iter().flat_map(|(_, mark)| mark).map(|(_, path)| &path[..]).collect();
        let _ = match look(&alike[0]) {
            None => writeln!(text, "{}", alike[0].0),
            Some(look) => writeln!(text, "<path {look} d=\"{}\"/>", Vec::from_iter(paths).concat()),
        };
    }
    text
}

/// Draws elements one after another.
fn draw<'a, E>(chart: &mut Chart<'a>, elements: impl IntoIterator<Item = E>) -> miette::Result<()>
where
    for<'b> &'b E: PointCollection<'b, (f64, f64)>,
    E: Drawable<SVGBackend<'a>>,
{
    chart.draw_series(elements).map(|_| ()).map_err(wrong)
}

/// A line, whole or in dashes of so many pixels.
fn line(
    chart: &mut Chart<'_>,
    points: Vec<(f64, f64)>,
    colour: RGBColor,
    dash: Option<i32>,
) -> miette::Result<()> {
    match dash {
        None => draw(chart, LineSeries::new(points, colour.stroke_width(2))),
        Some(dash) => draw(chart, DashedLineSeries::new(points, dash, dash, colour.stroke_width(2))),
    }
}

/// The edge of a band: a curve of places, values and standard deviations, moved by `k` of them and cut at the
/// ends of the axis.
fn edge_of(curve: &[(f64, f64, f64)], k: f64, [low, high]: [f64; 2]) -> Vec<(f64, f64)> {
    curve.iter().map(|(x, y, sd)| (*x, (y + k * sd).clamp(low, high))).collect()
}

/// Eq. 20 with this `Psi*` between two `Psi`.
fn eq_20(low: f64, high: f64, star: f64) -> Vec<(f64, f64)> {
    let grid = (0..=200).map(|k| low * (high / low).powf(f64::from(k) / 200.0));
    grid.map(|p| (p, psi::relative_friction(PsiEq17(p), star))).collect()
}

/// A band between two lines of points.
fn band(
    chart: &mut Chart<'_>,
    low: &[(f64, f64)],
    high: &[(f64, f64)],
    colour: RGBColor,
) -> miette::Result<()> {
    let around: Vec<(f64, f64)> = high.iter().chain(low.iter().rev()).copied().collect();
    if around.len() > 2 { draw(chart, [Polygon::new(around, colour.mix(0.16))]) } else { Ok(()) }
}

/// The axis of `mu'` between two ends.
fn mu_on([low, high]: [f64; 2]) -> (AxisRange, &'static str) {
    (AxisRange::linear(low..high), "relative friction \u{3bc}'")
}

/// The axis of `mu'` over measured values: a mark is drawn where it was measured, but for a few that would
/// flatten all others.
pub(crate) fn mu_axis(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values.fold([0.0f64, 1.1], |[low, high], v| [low.min(1.05 * v), high.max(1.05 * v)]);
    [low.max(-0.5), high.min(2.2)]
}

/// What a caption says where a value lies beyond the ends of an axis.
pub(crate) fn beyond(values: impl Iterator<Item = f64>, [low, high]: [f64; 2]) -> String {
    match values.filter(|v| *v < low || *v > high).count() {
        0 => String::new(),
        n => format!(" Marks beyond the axis ({n}) are drawn at its end."),
    }
}

/// A mark with its error bar, cut at the ends of the axis.
fn measured(
    chart: &mut Chart<'_>,
    series: usize,
    size: u32,
    colour: RGBColor,
    points: &[(f64, f64, f64)],
    [low, high]: [f64; 2],
) -> miette::Result<()> {
    let bars = points.iter().map(|(x, y, sd)| {
        let ends = [(y - sd).clamp(low, high), (y + sd).clamp(low, high)];
        PathElement::new(vec![(*x, ends[0]), (*x, ends[1])], colour.stroke_width(1))
    });
    draw(chart, bars)?;
    let series = series.min(SERIES - 1);
    let filled = filled(series);
    draw(chart, points.iter().map(|(x, y, _)| mark(series, (*x, y.clamp(low, high)), size, colour, filled)))
}

/// How many series a figure can tell apart: the marks, and those that are not crosses once more, hollow.
pub(crate) const SERIES: usize = 2 * MARKS - 1;

/// Whether the marks of a series are filled.
pub(crate) fn filled(series: usize) -> bool {
    series < MARKS
}

/// Which mark stands for which value, for a caption: values beyond the last mark share it, and all of them
/// are named.
pub(crate) fn series_key(values: &[String], unit: &str) -> String {
    let of = |series: usize| match series + 1 {
        SERIES => values[series..].join(", "),
        _ => values[series].clone(),
    };
    let marks = (0..values.len().min(SERIES))
        .map(|i| format!("{}: {} {unit}", mark_name(i), of(i)).trim_end().to_string());
    marks.collect::<Vec<_>>().join("; ")
}

/// The shape of a series in a caption, as text; those beyond the last one share it.
pub fn mark_name(series: usize) -> &'static str {
    const NAMES: [&str; SERIES] = [
        "discs",
        "squares",
        "triangles",
        "diamonds",
        "crosses",
        "hollow discs",
        "hollow squares",
        "hollow triangles",
        "hollow diamonds",
    ];
    NAMES[series.min(SERIES - 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_on_an_axis_has_no_sign() {
        let axis = AxisRange::linear(-0.1..0.1).axis();
        assert_eq!([-1e-18, -0.05].map(|v| axis.format_ext(&v)), ["0.0", "-0.05"]);
    }

    #[test]
    fn a_mark_is_where_it_was_measured_or_the_caption_says_that_it_is_not() {
        let caption = |values: &[f64]| beyond(values.iter().copied(), mu_axis(values.iter().copied()));
        assert_eq!(caption(&[-0.1, 0.4, 1.4]), "");
        assert!(caption(&[0.4, 9.0, 8.0]).contains("beyond the axis (2)"));
    }

    /// 5 to 50 mm/s had one label, 10.
    #[test]
    fn a_logarithmic_axis_of_one_decade_has_a_scale() {
        let ticks = |low, high| AxisRange::over([low, high].into_iter(), true).axis().key_points(5);
        assert_eq!(ticks(4.99, 50.01), [5.0, 10.0, 20.0, 50.0]);
        assert_eq!(ticks(0.01, 20.0), [0.01, 0.1, 1.0, 10.0]);
    }

    #[test]
    fn marks_of_one_look_are_one_path_and_the_others_stay() {
        let dot = |x: u32, colour: &str| {
            format!("<circle cx=\"{x}\" cy=\"7\" r=\"2\" fill=\"#{colour}\" stroke-width=\"2\"/>\n")
        };
        let ring =
            "<circle cx=\"1\" cy=\"7\" r=\"2\" fill=\"none\" stroke=\"#111111\" stroke-width=\"2\"/>\n";
        let svg =
            [dot(3, "0072B2"), dot(1, "0072B2"), dot(3, "0072B2"), dot(3, "D55E00"), ring.into()].concat();
        let bar = "<polyline fill=\"none\" stroke=\"#000000\" points=\"3,4 3,9 \"/>\n";
        let svg = [svg, bar.into(), bar.replace("3,9", "3,8")].concat();
        let path = |colour: &str, d: &str| {
            format!("<path stroke=\"#{colour}\" stroke-width=\"4\" stroke-linecap=\"round\" d=\"{d}\"/>\n")
        };
        let bars = "<path fill=\"none\" stroke=\"#000000\" d=\"M3,4 3,8M3,4 3,9\"/>\n";
        let wanted =
            [path("0072B2", "M1,7h0M3,7h0"), path("D55E00", "M3,7h0"), ring.into(), bars.into()].concat();
        assert_eq!(marks_joined(&svg), wanted);
    }
}

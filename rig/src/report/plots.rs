//! The figures, as SVG text.

use super::RunData;
use crate::sequence::MeasuredPass;
use models::condition::Condition;
use models::prediction::{FrictionModel, SpringSlider};
use models::psi::{self, PsiEq17};
use models::quantity::PeakToPeak;
use plotters::coord::combinators::LogCoord;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use realtime::pacing::LoopReport;
use std::ops::Range;

const SIZE: (u32, u32) = (900, 480);
/// Colours that stay apart on white, also for colour-blind readers (after Okabe and Ito, the yellow darkened).
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

fn wrong(e: impl std::fmt::Display) -> miette::Report {
    miette::miette!("a figure: {e}")
}

/// One axis of a figure.
enum Axis {
    Linear(RangedCoordf64),
    Logarithmic(LogCoord<f64>),
}

impl Axis {
    fn linear(range: Range<f64>) -> Axis {
        Axis::Linear(range.into())
    }

    fn logarithmic(range: Range<f64>) -> Axis {
        Axis::Logarithmic(range.log_scale().into())
    }
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
            Axis::Logarithmic(axis) => axis.key_points(hint),
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
        match self {
            Axis::Linear(axis) => axis.format_ext(value),
            Axis::Logarithmic(axis) => axis.format_ext(value),
        }
    }
}

type Chart<'a> = ChartContext<'a, SVGBackend<'a>, Cartesian2d<Axis, Axis>>;

/// A figure with named axes as SVG; `draw` puts the curves in.
fn figure(
    size: (u32, u32),
    (x, x_name): (Axis, &str),
    (y, y_name): (Axis, &str),
    draw: impl for<'a> FnOnce(&mut Chart<'a>) -> miette::Result<()>,
) -> miette::Result<String> {
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        area.fill(&WHITE).map_err(wrong)?;
        let letters = if size.0 < SIZE.0 / 2 { 11 } else { 14 };
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(3 * letters)
            .y_label_area_size(4 * letters)
            .build_cartesian_2d(x, y)
            .map_err(wrong)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .x_labels((size.0 / 75) as usize)
            .x_desc(x_name)
            .y_desc(y_name)
            .label_style(("sans-serif", letters))
            .draw()
            .map_err(wrong)?;
        draw(&mut chart)?;
        area.present().map_err(wrong)?;
    }
    Ok(svg)
}

/// A measured `mu'` of a pass with vibration: amplitude in um, value, sd.
fn measured(p: &MeasuredPass) -> Option<(f64, f64, f64)> {
    let c = p.comparison?;
    (p.pass.amplitude > PeakToPeak::ZERO).then_some(())?;
    Some((p.pass.amplitude.micrometres(), c.mu_relative?, c.mu_relative_sd?))
}

/// A number with so many significant digits.
fn round(v: f64, digits: i32) -> String {
    let scale = 10f64.powi(digits - 1 - v.abs().max(1e-12).log10().floor() as i32);
    format!("{}", (v * scale).round() / scale)
}

/// Nominal conditions, rounded so that passes of one setting fall together.
fn setting(p: &MeasuredPass) -> (String, String, String) {
    (round(p.pass.speed_m_s * 1e3, 2), round(p.pass.frequency_hz / 1e3, 3), round(p.pass.normal_force_n, 1))
}

/// The most common frequency and load: the base condition of the figure by speed.
fn base(passes: &[MeasuredPass]) -> Option<(String, String)> {
    let mut counts = std::collections::BTreeMap::<(String, String), usize>::new();
    for p in passes.iter().filter(|p| p.pass.amplitude > PeakToPeak::ZERO) {
        let (_, f, n) = setting(p);
        *counts.entry((f, n)).or_default() += 1;
    }
    counts.into_iter().max_by_key(|(_, n)| *n).map(|(key, _)| key)
}

/// Relative friction against amplitude, a colour a speed, with prediction bands.
///
/// # Errors
/// Only if the drawing library fails.
pub fn mu_against_amplitude(run: &RunData) -> miette::Result<String> {
    let Some((f, n)) = base(&run.passes) else { return Ok("<p>No pass with vibration.</p>".into()) };
    let chosen: Vec<&MeasuredPass> = run
        .passes
        .iter()
        .filter(|p| {
            let (_, pf, pn) = setting(p);
            p.pass.amplitude > PeakToPeak::ZERO && pf == f && pn == n
        })
        .collect();
    let mut speeds: Vec<String> = chosen.iter().map(|p| setting(p).0).collect();
    speeds.sort_by(|a, b| a.parse::<f64>().unwrap_or(0.0).total_cmp(&b.parse().unwrap_or(0.0)));
    speeds.dedup();
    let widest = chosen.iter().map(|p| p.pass.amplitude.micrometres()).fold(1.0, f64::max) * 1.05;
    let model = SpringSlider::new(run.finger).map_err(wrong)?;
    let mu0 =
        models::record::coulomb_coefficient(&run.passes.iter().map(|p| p.pass.clone()).collect::<Vec<_>>());
    let svg = figure(
        SIZE,
        (Axis::linear(0.0..widest), "amplitude w, um peak-to-peak"),
        (Axis::linear(0.0..1.1), "relative friction mu'"),
        |chart| {
            for (i, speed) in speeds.iter().enumerate() {
                let colour = COLOURS[i % COLOURS.len()];
                let of_speed: Vec<&&MeasuredPass> =
                    chosen.iter().filter(|p| setting(p).0 == *speed).collect();
                if let (Some(mu0), Some(first)) = (mu0, of_speed.first()) {
                    let at = |w: f64| {
                        let c = Condition {
                            amplitude: PeakToPeak::from_metres(w * 1e-6),
                            ..first.pass.condition(mu0)
                        };
                        model.predict(&c).ok()
                    };
                    let grid: Vec<f64> = (1..=200).map(|k| widest * f64::from(k) / 200.0).collect();
                    let line: Vec<(f64, f64, f64)> = grid
                        .iter()
                        .filter_map(|w| at(*w).map(|p| (*w, p.mu_relative, p.mu_relative_sd)))
                        .collect();
                    let upper = line.iter().map(|(w, m, s)| (*w, (m + 2.0 * s).min(1.1)));
                    let lower = line.iter().rev().map(|(w, m, s)| (*w, (m - 2.0 * s).max(0.0)));
                    let band: Vec<(f64, f64)> = upper.chain(lower).collect();
                    chart.draw_series([Polygon::new(band, colour.mix(0.18))]).map_err(wrong)?;
                    chart
                        .draw_series(LineSeries::new(
                            line.iter().map(|(w, m, _)| (*w, *m)),
                            colour.stroke_width(2),
                        ))
                        .map_err(wrong)?
                        .label(format!("{speed} mm/s"))
                        .legend(move |(x, y)| {
                            PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(3))
                        });
                }
                let points = of_speed.iter().filter_map(|p| measured(p));
                chart
                    .draw_series(points.map(|(w, m, s)| {
                        ErrorBar::new_vertical(w, m - s, m.min(1.09), m + s, colour.filled(), 6)
                    }))
                    .map_err(wrong)?;
            }
            chart
                .configure_series_labels()
                .position(SeriesLabelPosition::UpperRight)
                .label_font(("sans-serif", 14))
                .background_style(WHITE.mix(0.8))
                .draw()
                .map_err(wrong)?;
            Ok(())
        },
    )?;
    // Loads fall together by one digit, which is no word on what the load was.
    let load_n = chosen.iter().map(|p| p.pass.normal_force_n).sum::<f64>() / chosen.len() as f64;
    let load = round(load_n, 2);
    Ok(format!("<figure>{svg}<figcaption>at {f} kHz and {load} N</figcaption></figure>"))
}

/// Relative friction against Psi (Eq. 17) with Eq. 20 and its stated uncertainty.
///
/// # Errors
/// Only if the drawing library fails.
pub fn mu_against_psi(run: &RunData) -> miette::Result<String> {
    let points: Vec<(f64, f64, f64)> =
        run.passes.iter().filter_map(|p| Some((p.psi_eq17?, measured(p)?.1, measured(p)?.2))).collect();
    if points.is_empty() {
        return Ok("<p>No pass with a Psi.</p>".into());
    }
    let lowest = points.iter().map(|p| p.0).fold(0.1, f64::min) * 0.8;
    let highest = points.iter().map(|p| p.0).fold(10.0, f64::max) * 1.2;
    let svg = figure(
        SIZE,
        (Axis::logarithmic(lowest..highest), "Psi of Eq. 17"),
        (Axis::linear(0.0..1.1), "relative friction mu'"),
        |chart| {
            let grid: Vec<f64> =
                (0..=200).map(|k| lowest * (highest / lowest).powf(f64::from(k) / 200.0)).collect();
            let law = |star: f64| grid.iter().map(move |p| (*p, psi::relative_friction(PsiEq17(*p), star)));
            let (star, sd) = (psi::PSI_STAR, psi::PSI_STAR_UNCERTAINTY);
            let mut band: Vec<(f64, f64)> = law(star - sd).collect();
            band.extend(law(star + sd).collect::<Vec<_>>().into_iter().rev());
            chart.draw_series([Polygon::new(band, GREY.mix(0.2))]).map_err(wrong)?;
            chart.draw_series(LineSeries::new(law(star), GREY.stroke_width(2))).map_err(wrong)?;
            chart
                .draw_series(points.iter().map(|(p, m, s)| {
                    ErrorBar::new_vertical(*p, m - s, m.min(1.09), m + s, COLOURS[0].filled(), 6)
                }))
                .map_err(wrong)?;
            Ok(())
        },
    )?;
    Ok(format!("<figure>{svg}</figure>"))
}

/// Standardised residuals in the order of measurement.
///
/// # Errors
/// Only if the drawing library fails.
pub fn residuals(run: &RunData) -> miette::Result<String> {
    let points: Vec<(f64, f64, bool)> = run
        .passes
        .iter()
        .filter_map(|p| Some((p.pass.time_s, p.comparison?.z, p.reference)))
        .filter(|(_, z, _)| z.is_finite())
        .collect();
    if points.is_empty() {
        return Ok("<p>No residual.</p>".into());
    }
    let end = points.iter().map(|p| p.0).fold(1.0, f64::max) * 1.02;
    let most = points.iter().map(|p| p.1.abs()).fold(3.0, f64::max).min(40.0) * 1.1;
    let svg = figure(
        (900, 360),
        (Axis::linear(0.0..end), "time, s"),
        (Axis::linear(-most..most), "residual, standard deviations"),
        |chart| {
            for level in [-1.96, 1.96] {
                let dashes = DashedLineSeries::new([(0.0, level), (end, level)], 6, 5, GREY.stroke_width(1));
                chart.draw_series(dashes).map_err(wrong)?;
            }
            chart
                .draw_series(points.iter().map(|(t, z, reference)| {
                    let colour = if *reference { GREY } else { COLOURS[1] };
                    Circle::new((*t, z.clamp(-most, most)), 3, colour.filled())
                }))
                .map_err(wrong)?;
            Ok(())
        },
    )?;
    Ok(format!("<figure>{svg}<figcaption>grey: references without vibration</figcaption></figure>"))
}

/// Histogram of the loop's lateness.
///
/// # Errors
/// Only if the drawing library fails.
pub fn lateness(report: &LoopReport) -> miette::Result<String> {
    let bars: Vec<(f64, f64)> = report
        .histogram
        .iter()
        .filter(|(_, n)| *n > 0)
        .map(|(ns, n)| (*ns as f64 / 1e3, *n as f64))
        .collect();
    if bars.is_empty() {
        return Ok("<p>No cycle was timed.</p>".into());
    }
    let highest = bars.iter().map(|b| b.0).fold(10.0, f64::max) * 2.0;
    let most = bars.iter().map(|b| b.1).fold(10.0, f64::max) * 2.0;
    let svg = figure(
        (900, 300),
        (Axis::logarithmic(0.5..highest), "lateness, us"),
        (Axis::logarithmic(0.7..most), "deadlines"),
        |chart| {
            let bar = |(upper, n): &(f64, f64)| {
                Rectangle::new([(upper / 2.0, 0.7), (*upper, *n)], COLOURS[0].mix(0.6).filled())
            };
            chart.draw_series(bars.iter().map(bar)).map_err(wrong)?;
            Ok(())
        },
    )?;
    Ok(format!("<figure>{svg}</figure>"))
}

/// Errors of passes in standard deviations against one covariate, before and after a cause was added.
///
/// # Errors
/// Only if the drawing library fails.
pub fn errors_against(
    name: &str,
    logarithmic: bool,
    limit: f64,
    before: &[(f64, f64)],
    after: &[(f64, f64)],
) -> miette::Result<String> {
    let (low, high) =
        before.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.0), h.max(p.0)));
    // Within a decade a logarithmic axis has a single label.
    let x = if logarithmic && high > 10.0 * low {
        let margin = (high / low).powf(0.03);
        Axis::logarithmic(low / margin..high * margin)
    } else {
        let margin = 0.03 * (high - low);
        Axis::linear(low - margin..high + margin)
    };
    let svg = figure((430, 240), (x, name), (Axis::linear(-limit..limit), "error, sd"), |chart| {
        for (points, colour) in [(before, COLOURS[1]), (after, COLOURS[0])] {
            let dot =
                |(x, e): &(f64, f64)| Circle::new((*x, e.clamp(-limit, limit)), 2, colour.mix(0.55).filled());
            chart.draw_series(points.iter().map(dot)).map_err(wrong)?;
        }
        Ok(())
    })?;
    Ok(format!("<figure>{svg}</figure>"))
}

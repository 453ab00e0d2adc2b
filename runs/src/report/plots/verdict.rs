//! The figures of a verdict.

use super::{
    AxisRange, COLOURS, Chart, GREY, PANEL, band, beyond, draw, edge_of, figure, line, mark, measured,
    mu_axis, mu_on,
};
use crate::format::titled;
use crate::report::html::escape;
use models::covariate::{Covariate, Scale};
use plotters::prelude::*;

/// A pass in a figure of the verdict.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Abscissa.
    pub x: f64,
    /// Measured, or the error before.
    pub before: f64,
    /// Standard deviation of a pass, or the error after.
    pub after: f64,
    /// Whether the pass is a suspect.
    pub suspect: bool,
}

/// A model's curve: abscissa, value, standard deviation.
pub type Curve = Vec<(f64, f64, f64)>;

/// One panel of measured `mu'` under the two models: points (with the standard deviation of a pass), the recalibrated baseline in
/// dashes, the verdict's model with its band of two standard deviations; suspects are ringed.
pub fn overlay(
    title: &str,
    (x_name, span): (&str, AxisRange),
    points: &[Seen],
    baseline: &Curve,
    corrected: &Curve,
    axis: [f64; 2],
) -> miette::Result<String> {
    let alt = format!(
        "{title}: {} measured passes, the recalibrated baseline and the verdict's model.",
        points.len()
    );
    let cut = |v: f64| v.clamp(axis[0], axis[1]);
    let svg = figure(PANEL, (span, x_name), mu_on(axis), &alt, |chart, size| {
        let edge = |k: f64| edge_of(corrected, k, axis);
        band(chart, &edge(-2.0), &edge(2.0), COLOURS[0])?;
        line(chart, baseline.iter().map(|(x, m, _)| (*x, cut(*m))).collect(), COLOURS[1], Some(6))?;
        line(chart, edge(0.0), COLOURS[0], None)?;
        let seen: Vec<_> = points.iter().map(|p| (p.x, p.before, p.after)).collect();
        measured(chart, 0, size - 1, BLACK, &seen, axis)?;
        rings(chart, points.iter().filter(|p| p.suspect).map(|p| (p.x, cut(p.before))), size)
    })?;
    let cut = beyond(points.iter().map(|p| p.before), axis);
    Ok(format!("<figure>{svg}<figcaption>{}.{cut}</figcaption></figure>", escape(title)))
}

/// Rings around suspects.
fn rings(chart: &mut Chart<'_>, at: impl Iterator<Item = (f64, f64)>, size: u32) -> miette::Result<()> {
    draw(chart, at.map(|p| Circle::new(p, size + 4, COLOURS[3].stroke_width(2))))
}

/// A pass in the figure of a law.
#[derive(Clone, Copy, Debug)]
pub struct LawPass {
    /// Abscissa.
    pub x: f64,
    /// The model there plus what the pass deviates from it.
    pub y: f64,
    /// Whether the pass is a suspect.
    pub suspect: bool,
}

/// What a cause does, over the passes: the curve with a band of two standard deviations, and the library's
/// law alone.
pub fn law(
    name: &str,
    (x_name, span): (&str, AxisRange),
    passes: &[LawPass],
    curve: &Curve,
    alone: &[(f64, f64)],
) -> miette::Result<String> {
    let alt = format!("The law of {name} against {x_name}, with its band, over {} passes.", passes.len());
    let all = || passes.iter().map(|p| p.y).chain(curve.iter().map(|(_, y, _)| *y));
    let all = || all().chain(alone.iter().map(|(_, y)| *y)).chain([0.0]);
    let [low, high] = all().fold([0.0f64; 2], |[l, h], v| [l.min(v), h.max(v)]);
    let margin = 0.06 * (high - low);
    let axis = [(low - margin).max(-1.5), (high + margin).min(1.5)];
    let y = (AxisRange::linear(axis[0]..axis[1]), "change of \u{3bc}'");
    let cut = |v: f64| v.clamp(axis[0], axis[1]);
    let svg = figure(PANEL, (span, x_name), y, &alt, |chart, size| {
        let edge = |k: f64| edge_of(curve, k, axis);
        band(chart, &edge(-2.0), &edge(2.0), COLOURS[0])?;
        let ends = [curve.first(), curve.last()].into_iter().flatten().map(|(x, ..)| (*x, 0.0));
        line(chart, ends.collect(), GREY, Some(6))?;
        draw(chart, passes.iter().map(|p| mark(0, (p.x, cut(p.y)), size - 1, BLACK, true)))?;
        line(chart, alone.iter().map(|(x, y)| (*x, cut(*y))).collect(), COLOURS[1], Some(3))?;
        line(chart, edge(0.0), COLOURS[0], None)?;
        rings(chart, passes.iter().filter(|p| p.suspect).map(|p| (p.x, cut(p.y))), size)
    })?;
    let beyond = beyond(passes.iter().map(|p| p.y), axis);
    Ok(format!(
        "<figure>{svg}<figcaption>Grey, dashed: no change of the baseline.{beyond}</figcaption></figure>"
    ))
}

/// Measured against predicted `mu'` of every pass: left the recalibrated baseline, right the verdict's model.
pub fn parity(points: &[(f64, f64, f64, bool)]) -> miette::Result<String> {
    let all = || points.iter().flat_map(|(m, a, b, _)| [*m, *a, *b]);
    let [bottom, top] = mu_axis(all());
    let panels = [("recalibrated baseline", 0), ("verdict's model", 1)].map(|(name, which)| {
        let alt =
            format!("Measured relative friction of {} passes against that of the {name}.", points.len());
        let x_name = format!("\u{3bc}' of the {name}");
        let span = AxisRange::linear(bottom..top);
        let cut = |v: f64| v.clamp(bottom, top);
        let place = |p: &(f64, f64, f64, bool)| (cut(if which == 0 { p.1 } else { p.2 }), cut(p.0));
        let svg = figure(PANEL, (span, &x_name), (span, "measured \u{3bc}'"), &alt, |chart, size| {
            line(chart, vec![(bottom, bottom), (top, top)], GREY, None)?;
            let colour = COLOURS[1 - which];
            draw(chart, points.iter().map(|p| mark(which, place(p), size - 1, colour, which == 1)))?;
            rings(chart, points.iter().filter(|p| p.3).map(place), size)
        })?;
        Ok(format!("<figure>{svg}</figure>"))
    });
    let panels: miette::Result<Vec<String>> = panels.into_iter().collect();
    let furthest = |m, v: &f64| if (bottom..=top).contains(m) { *v } else { *m };
    let cut = beyond(points.iter().flat_map(|(m, a, b, _)| [a, b].map(|v| furthest(m, v))), [bottom, top]);
    Ok(format!("<div class=\"panels\">{}</div>{}", panels?.concat(), crate::report::html::note(&cut)))
}

/// Errors of passes in standard deviations against one covariate: hollow before a cause was added, filled after.
pub fn errors_against(c: &Covariate, limit: f64, points: &[Seen]) -> miette::Result<String> {
    let name = titled(c);
    let alt = format!("Errors of {} passes against {}, before and after.", points.len(), c.words);
    let x = AxisRange::over(points.iter().map(|p| p.x), c.scale == Scale::Log);
    let y = (AxisRange::linear(-limit..limit), "error, sd");
    let svg = figure(PANEL, (x, &name), y, &alt, |chart, size| {
        let cut = |e: f64| e.clamp(-limit, limit);
        draw(chart, points.iter().map(|p| mark(1, (p.x, cut(p.before)), size - 1, COLOURS[1], false)))?;
        draw(chart, points.iter().map(|p| mark(0, (p.x, cut(p.after)), size - 1, COLOURS[0], true)))?;
        rings(chart, points.iter().filter(|p| p.suspect).map(|p| (p.x, cut(p.after))), size)
    })?;
    Ok(format!("<figure>{svg}</figure>"))
}

/// The mean edge of a record: time, s, and the shares of its change that were measured, expected in time,
/// and found.
pub fn edge(title: &str, mean: &[[f64; 4]]) -> miette::Result<String> {
    let alt = format!("{title}: the mean edge as measured, as expected in time, and with what was found.");
    let shown = |from: &[f64; 4]| (-0.02..0.2).contains(&from[0]);
    let x = (AxisRange::linear(-20.0..200.0), "time from the command, ms");
    let y = (AxisRange::linear(-0.2..1.25), "share of the change");
    let svg = figure(PANEL, x, y, &alt, |chart, size| {
        let of = |which: usize| -> Vec<(f64, f64)> {
            mean.iter().filter(|m| shown(m)).map(|m| (1e3 * m[0], m[which].clamp(-0.2, 1.25))).collect()
        };
        line(chart, of(2), COLOURS[1], Some(6))?;
        line(chart, of(3), COLOURS[0], None)?;
        draw(chart, of(1).into_iter().map(|p| mark(0, p, size - 1, BLACK, true)))
    })?;
    Ok(format!("<figure>{svg}<figcaption>{}.</figcaption></figure>", escape(title)))
}

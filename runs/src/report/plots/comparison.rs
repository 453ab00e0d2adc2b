//! The figures of two runs.

use super::{COLOURS, Frame, GREY, NARROW, Span, WIDE, band, figure, line, mark_name, measured};
use crate::compare::{Comparison, Mean, Paired};

/// Both runs' `mu'` against amplitude, at the conditions that they have in common.
///
/// # Errors
/// Only if the drawing library fails.
pub fn overlay(result: &Comparison) -> miette::Result<String> {
    let widest = widest(result);
    let highest =
        result.pairs.iter().flat_map(|p| [p.a, p.b]).map(|m| m.mu_relative + m.sd).fold(1.0, f64::max);
    let mu = [0.0, 1.05 * highest];
    let alt = format!(
        "Relative friction of two runs against amplitude, {} conditions in common: {} the first, {} the second.",
        result.pairs.len(),
        mark_name(0),
        mark_name(1)
    );
    let frame = Frame {
        sizes: [WIDE, NARROW],
        x: (Span::linear(0.0..widest), "amplitude w, um peak to peak"),
        y: (Span::linear(mu[0]..mu[1]), "relative friction \u{3bc}'"),
        alt: &alt,
    };
    let of = |side: fn(&Paired) -> Mean, aside: f64| -> Vec<(f64, f64, f64)> {
        // A little beside each other, so that no mark hides the other one.
        let place = |p: &Paired| (p.amplitude_pp_m * 1e6 + aside * widest, side(p).mu_relative, side(p).sd);
        result.pairs.iter().map(place).collect()
    };
    let svg = figure(&frame, |chart, size| {
        measured(chart, 0, size, COLOURS[0], &of(|p| p.a, -0.003), mu)?;
        measured(chart, 1, size, COLOURS[1], &of(|p| p.b, 0.003), mu)
    })?;
    Ok(format!(
        "<figure>{svg}<figcaption>{}: the first run; {}: the second, a hair beside it. Bars: one standard uncertainty from pass \
         to pass. All speeds, frequencies and loads that both have.</figcaption></figure>",
        capital(mark_name(0)),
        mark_name(1)
    ))
}

/// The differences against amplitude, with the shift that they have in common.
///
/// # Errors
/// Only if the drawing library fails.
pub fn differences(result: &Comparison) -> miette::Result<String> {
    let widest = widest(result);
    let ends =
        result.pairs.iter().flat_map(|p| [p.difference - p.difference_sd, p.difference + p.difference_sd]);
    let most = 1.1 * ends.fold(0.01, |m: f64, v| m.max(v.abs()));
    let alt = format!(
        "Difference of relative friction, second run less first, against amplitude: {} conditions.",
        result.pairs.len()
    );
    let frame = Frame {
        sizes: [WIDE, NARROW],
        x: (Span::linear(0.0..widest), "amplitude w, um peak to peak"),
        y: (Span::linear(-most..most), "difference of \u{3bc}', second less first"),
        alt: &alt,
    };
    let points: Vec<(f64, f64, f64)> =
        result.pairs.iter().map(|p| (p.amplitude_pp_m * 1e6, p.difference, p.difference_sd)).collect();
    let level = |value: f64| vec![(0.0, value), (widest, value)];
    let svg = figure(&frame, |chart, size| {
        if let Some(judged) = &result.judged {
            let [low, high] = judged.shift_interval_95.map(|v| v.clamp(-most, most));
            band(chart, &level(low), &level(high), COLOURS[2])?;
            line(chart, level(judged.shift.clamp(-most, most)), COLOURS[2], None)?;
        }
        line(chart, level(0.0), GREY, Some(4))?;
        measured(chart, 3, size, COLOURS[3], &points, [-most, most])
    })?;
    Ok(format!(
        "<figure>{svg}<figcaption>{}: each condition, with one standard uncertainty, the references' included. Line and band: the \
         shift that all have in common, with its interval of 95 %. Dashed: no difference.</figcaption></figure>",
        capital(mark_name(3))
    ))
}

fn widest(result: &Comparison) -> f64 {
    1.05 * result.pairs.iter().map(|p| p.amplitude_pp_m * 1e6).fold(0.1, f64::max)
}

fn capital(word: &str) -> String {
    let mut all = word.chars();
    all.next().map_or_else(String::new, |first| first.to_uppercase().chain(all).collect())
}

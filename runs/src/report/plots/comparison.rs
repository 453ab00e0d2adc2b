//! The figures of two runs and of more.

use super::{
    AMPLITUDE, AxisRange, COLOURS, GREY, SERIES, WIDE, band, beyond, capital, figure, line, mark_name,
    measured, mu_axis, mu_on, series_key,
};
use crate::compare::groups::{GroupDifference, Grouped};
use crate::compare::{Mean, Paired, RunComparison};
use crate::report::levels::{FORCE, FREQUENCY, Levels, SPEED};

/// Both runs' `mu'` against amplitude, at the conditions that they have in common; a line joins the two of each condition.
pub fn overlay(result: &RunComparison) -> miette::Result<String> {
    let widest = widest(result);
    let means = || result.pairs.iter().flat_map(|p| [p.a, p.b]);
    let mu = mu_axis(means().flat_map(|m| [m.mu_relative - m.sd, m.mu_relative + m.sd]));
    let [one, other] = [0, 1].map(mark_name);
    let alt = format!(
        "Relative friction of two runs against amplitude, {} conditions in common: {one} the first, {other} the second.",
        result.pairs.len()
    );
    let x = (AxisRange::linear(0.0..widest), AMPLITUDE);
    // A little beside each other, so that no mark hides the other one.
    let place =
        |p: &Paired, m: Mean, aside: f64| (p.amplitude_pp_m * 1e6 + aside * widest, m.mu_relative, m.sd);
    let (first, second) = (|p: &Paired| place(p, p.a, -0.003), |p: &Paired| place(p, p.b, 0.003));
    let svg = figure(WIDE, x, mu_on(mu), &alt, |chart, size| {
        for p in &result.pairs {
            let ends = [first(p), second(p)].map(|(x, y, _)| (x, y));
            line(chart, ends.to_vec(), GREY, None)?;
        }
        measured(chart, 0, size, COLOURS[0], &result.pairs.iter().map(first).collect::<Vec<_>>(), mu)?;
        measured(chart, 1, size, COLOURS[1], &result.pairs.iter().map(second).collect::<Vec<_>>(), mu)
    })?;
    Ok(format!(
        "<figure>{svg}<figcaption>{}: the first run; {other}: the second, joined to the first at the same condition. Bars: one standard \
         uncertainty from pass to pass. All speeds, frequencies and loads that both have.{}</figcaption></figure>",
        capital(one),
        beyond(means().map(|m| m.mu_relative), mu)
    ))
}

/// What conditions can differ in besides the amplitude: name, unit, value, and how far the values of one setting lie apart.
type Factor = (&'static str, &'static str, fn(&Paired) -> f64, f64);

const FACTORS: [Factor; 3] = [
    ("speed", "mm/s", |p| p.speed_m_s * 1e3, SPEED),
    ("frequency", "kHz", |p| p.frequency_hz / 1e3, FREQUENCY),
    ("normal force", "N", |p| p.normal_force_n, FORCE),
];

/// The differences against amplitude, a mark a level of the factor that varies most, with the shift that they
/// have in common unless they vary by more than their uncertainty.
pub fn differences(result: &RunComparison) -> miette::Result<String> {
    let widest = widest(result);
    let [low, high] = about_zero(
        result.pairs.iter().flat_map(|p| [p.difference - p.difference_sd, p.difference + p.difference_sd]),
    );
    let by = |(.., of, within): &Factor| Levels::of(result.pairs.iter().map(of), *within);
    let factor = FACTORS.iter().rev().max_by_key(|factor| by(factor).count()).unwrap_or(&FACTORS[0]);
    let (levels, (name, unit, of, _)) = (by(factor), factor);
    let alt = format!(
        "Difference of relative friction, second run less first, against amplitude: {} conditions, by {name}.",
        result.pairs.len()
    );
    let (x, y) = (AxisRange::linear(0.0..widest), AxisRange::linear(low..high));
    let (x, y) = ((x, AMPLITUDE), (y, "difference of \u{3bc}', second less first"));
    let level_of = |p: &Paired| levels.index(of(p)).min(SERIES - 1);
    let along = |value: f64| vec![(0.0, value), (widest, value)];
    let shift = result.judged.as_ref().filter(|judged| !judged.varies());
    let svg = figure(WIDE, x, y, &alt, |chart, size| {
        if let Some(judged) = &shift {
            let [from, to] = judged.shift_interval_95.map(|v| v.clamp(low, high));
            band(chart, &along(from), &along(to), COLOURS[2])?;
            line(chart, along(judged.shift.clamp(low, high)), COLOURS[2], None)?;
        }
        line(chart, along(0.0), GREY, Some(4))?;
        for series in 0..levels.count().min(SERIES) {
            let of_level = result.pairs.iter().filter(|p| level_of(p) == series);
            let points: Vec<(f64, f64, f64)> =
                of_level.map(|p| (p.amplitude_pp_m * 1e6, p.difference, p.difference_sd)).collect();
            measured(chart, series, size, COLOURS[series % COLOURS.len()], &points, [low, high])?;
        }
        Ok(())
    })?;
    let common = match shift {
        Some(_) => "Line and band: the shift that all have in common, with its interval of 95 %.",
        None => "No shift is drawn: the differences vary by more than their uncertainty.",
    };
    let key = series_key(&levels.names(), unit);
    Ok(format!(
        "<figure>{svg}<figcaption>By {name}. {}, each condition with one standard uncertainty, the references' included. {common} \
         Dashed: no difference.</figcaption></figure>",
        capital(&key)
    ))
}

/// An axis of differences with a margin.
fn about_zero(ends: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = ends.fold([-0.01, 0.01], |[l, h]: [f64; 2], v| [l.min(v), h.max(v)]);
    [low - 0.05 * (high - low), high + 0.05 * (high - low)]
}

fn widest(result: &RunComparison) -> f64 {
    1.05 * result.pairs.iter().map(|p| p.amplitude_pp_m * 1e6).fold(0.1, f64::max)
}

/// The mean `mu'` of each group against amplitude, a mark a group, a little beside each other.
pub fn group_overlay(grouped: &Grouped) -> miette::Result<String> {
    let of = |g: usize| grouped.conditions.iter().filter_map(move |c| Some((c, c.means[g]?)));
    let all = |g: usize| of(g).map(|(c, m)| (c.amplitude_pp_m * 1e6, m.mu_relative, m.sd)).collect();
    by_group(grouped, 0, all, ("relative friction \u{3bc}'", "Relative friction", "one standard uncertainty"))
}

/// The differences of each later group from the first, with intervals of 95 %.
pub fn group_differences(grouped: &Grouped) -> miette::Result<String> {
    let of = |g: usize| grouped.conditions.iter().filter_map(move |c| Some((c, c.differences[g - 1]?)));
    let half = |d: &GroupDifference| 0.5 * (d.interval_95[1] - d.interval_95[0]);
    let all = |g: usize| of(g).map(|(c, d)| (c.amplitude_pp_m * 1e6, d.difference, half(&d))).collect();
    let words = (
        "difference of \u{3bc}' from the first",
        "Difference of relative friction from the first",
        "the interval of 95 %",
    );
    by_group(grouped, 1, all, words)
}

/// Marks of the groups from this one on; the words are the axis, what is shown, and what the bars are.
fn by_group(
    grouped: &Grouped,
    from: usize,
    of: impl Fn(usize) -> Vec<(f64, f64, f64)>,
    (axis, shown, bars): (&str, &str, &str),
) -> miette::Result<String> {
    let points: Vec<Vec<(f64, f64, f64)>> =
        (0..grouped.groups.len()).map(|g| if g < from { Vec::new() } else { of(g) }).collect();
    let all = || points.iter().flatten();
    if all().count() == 0 {
        return Ok("<p>No condition is in common.</p>".into());
    }
    let widest = 1.05 * all().map(|p| p.0).fold(0.1, f64::max);
    let ends = all().flat_map(|p| [p.1 - p.2, p.1 + p.2]);
    let span = if from == 0 { mu_axis(ends) } else { about_zero(ends) };
    let alt =
        format!("{shown} against amplitude, {} marks of {} groups.", all().count(), points.len() - from);
    let (x, y) = ((AxisRange::linear(0.0..widest), AMPLITUDE), (AxisRange::linear(span[0]..span[1]), axis));
    let svg = figure(WIDE, x, y, &alt, |chart, size| {
        if from > 0 {
            line(chart, vec![(0.0, 0.0), (widest, 0.0)], GREY, Some(4))?;
        }
        for (g, of) in points.iter().enumerate() {
            let aside = 0.003 * widest * (g as f64 - 0.5 * (points.len() - 1) as f64);
            let moved: Vec<_> = of.iter().map(|(x, y, sd)| (x + aside, *y, *sd)).collect();
            measured(chart, g, size, COLOURS[g % COLOURS.len()], &moved, span)?;
        }
        Ok(())
    })?;
    let names: Vec<String> = grouped.groups.iter().map(|g| g.name.clone()).collect();
    let key = series_key(&names, "");
    Ok(format!(
        "<figure>{svg}<figcaption>{}. Bars: {bars}. All speeds, frequencies and loads.{}</figcaption></figure>",
        crate::report::html::escape(&capital(&key)),
        beyond(all().map(|p| p.1), span)
    ))
}

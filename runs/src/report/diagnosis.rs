//! One self-contained HTML page of a verdict: what was measured and what the models say, where the gap lies,
//! which cause, how far it shrinks, what is uncertain, what to do next.

mod causes;
mod gap_map;
mod law;
mod mechanism;
mod next;
mod overlay;
mod passes;
mod timing;

use super::html::{bar, cell, columns, escape, glossary, head, list, note, numeric, row, shell, table};
use super::plots::verdict::{Seen, errors_against};
use super::plots::{beyond, ends};
use crate::format::number;
use crate::verdict_text::{listed, looks_like, name};
use diagnosis::report::format::{plain, probability};
use diagnosis::scatter::Suspect;
use diagnosis::verdict::left_out::Errors;
use diagnosis::{Diagnosis, Forecast, Table, Verdict};
use miette::IntoDiagnostic;
use models::covariate;

/// Parts of the operating space that the page lists, the largest first.
const LISTED_REGIONS: usize = 3;

/// The page; `about` is what is known of the table's run, and stands first.
pub fn page(result: &Diagnosis, table: &Table, about: &[(&str, String)]) -> miette::Result<String> {
    let r = &result.report;
    let forecasts = result.predict(table).into_diagnostic()?;
    let overlay = overlay::Overlay::new(result, table, &forecasts);
    let departed = r.verdict != Verdict::NoGap;
    let body = [
        "<h1>Diagnosis</h1>".into(),
        head(about),
        format!("<p class=\"verdict{}\">{}</p>", if departed { " departed" } else { "" }, escape(&r.text)),
        described(result),
        how_far(result),
        overlay.section()?,
        causes::section(result, &overlay)?,
        location(result, table, &overlay.errors()),
        timing::section(result)?,
        next::section(result),
        uncertain(result),
        residuals(result, table, &forecasts)?,
        passes::section(table, &overlay, &forecasts),
        glossary(),
        format!("<p class=\"note\">{} passes, SHA-256 {}</p>", r.data.points, escape(&r.data.sha256)),
    ];
    Ok(shell("Diagnosis", &body.concat()))
}

/// What an unknown departure looks like, and what is sure under an open verdict; nothing else.
fn described(result: &Diagnosis) -> String {
    let r = &result.report;
    let sure = (!r.at_least.is_empty())
        .then(|| format!("At least {}, beside what is open.", plain(&r.at_least.join(", "))));
    let all: Vec<String> = looks_like(result).chain(sure).collect();
    if all.is_empty() {
        String::new()
    } else {
        format!("<h2>What the departure looks like</h2>{}", list(all, ""))
    }
}

fn how_far(result: &Diagnosis) -> String {
    let g = &result.report.gap;
    let stages = [
        ("nominal baseline", g.before_rmse),
        ("recalibrated baseline", g.recalibrated_rmse),
        ("verdict's model", g.after_rmse),
        ("repeatability", g.noise_floor_rmse),
    ];
    let largest = stages.iter().filter_map(|(_, v)| *v).fold(1e-12, f64::max);
    let row = |(name, value): (&str, Option<f64>)| {
        let value = value?;
        Some(row(name, [numeric(number(value)), cell(bar(260.0 * value / largest))]))
    };
    let words = match g.change() {
        Some((verb, percent, Some([low, high]))) => {
            format!("The removable gap {verb} by {percent:.0} % (95 % interval {low:.0} to {high:.0} %).")
        }
        _ if g.before_rmse.is_none() => "The table is too short to hold passes out.".to_string(),
        _ => "The recalibrated baseline is within its own sampling error of repeatability: no gap to shrink."
            .to_string(),
    };
    let head = columns("left by|#error|");
    format!(
        "<h2>How far the gap shrinks</h2><p>{words}</p>{}{}",
        table("Errors on held-out passes", &head, stages.into_iter().filter_map(row)),
        note("Root mean square error on held-out passes, in units of full friction \u{3bc}0 Fn.")
    )
}

fn location(result: &Diagnosis, table: &Table, errors: &[(f64, f64)]) -> String {
    let r = &result.report;
    let (listed, rest) = listed(&r.location.regions, LISTED_REGIONS);
    let more = rest.map_or_else(String::new, |rest| note(&format!("{rest} (in the JSON document).")));
    let likely = r.location.place.iter().filter(|(_, p)| **p >= 0.005);
    let places: Vec<String> = likely.map(|(place, p)| format!("{place} {}", probability(*p))).collect();
    // Errors with their passes: a share of the gap would be without an interval.
    let left = |e: &Errors| {
        let [before, after] = [e.recalibrated, e.after].map(|square| number(square.sqrt()));
        format!("{before} by the recalibrated baseline, {after} by the model ({} passes)", e.passes)
    };
    let closed = result.decision.regions.iter().map(|region| match region.errors.closed() {
        Some(_) if region.judges => format!("{}: {}", region.name, left(&region.errors)),
        _ => format!("{}: no gap there, or nothing that judges", region.name),
    });
    format!(
        "<h2>Where the gap lies</h2>{}{}{more}<p>In which part of the rig, by probability: {}.</p>\
         <details><summary>Errors in regions that were left out of the fit, in standard deviations of a pass</summary>{}</details>",
        gap_map::section(table, errors),
        list(listed, "No part stands out."),
        escape(&places.join(", ")),
        list(closed, "No region was left out.")
    )
}

/// Suspects, what cannot be seen, what would have been seen, and the remarks.
fn uncertain(result: &Diagnosis) -> String {
    let r = &result.report;
    let mut text = String::from("<h2>What is uncertain</h2>");
    if !r.scatter.suspects.is_empty() {
        let row = |s: &Suspect| {
            let off_by = number(1e3 * s.residual_n) + " mN";
            row(s.point, [off_by, format!("{:+.1}", s.deviations), probability(s.probability)].map(numeric))
        };
        let head = columns("point|#off by|#deviations|#probability not to belong");
        let rows = r.scatter.suspects.iter().map(row);
        text += &format!("<h3>Suspect passes</h3>{}", table("Suspect passes", &head, rows));
        if let Some(with) = &r.with_suspects {
            text += &format!(
                "<p>With them counted as any other the leading answer is {} (probability {}).</p>",
                escape(&name(&with.effects)),
                probability(with.probability)
            );
        }
    }
    text += &list(&r.remarks, "There is nothing to remark.");
    let unseen = r.not_testable.iter().map(|n| format!("{}: {}", plain(&n.effect), n.because));
    let unseen = list(unseen, "Every effect of the library can be seen on this table.");
    text += &format!(
        "<details><summary>Not testable on this table ({})</summary>{unseen}</details>",
        r.not_testable.len()
    );
    text
}

/// Scatter of the error in deviations against each covariate, before and after.
fn residuals(result: &Diagnosis, table: &Table, forecasts: &[Forecast]) -> miette::Result<String> {
    let problem = &result.fitted.problem;
    let suspects: Vec<usize> = result.report.scatter.suspects.iter().map(|s| s.row).collect();
    let z = |(i, f): (usize, &Forecast)| {
        let sd = (problem.whole_variance(i) / result.fitted.scatter.inflation[i]).sqrt();
        let d = table.passes[i].direction.sign();
        (d * (table.lateral[i] - f.recalibrated) / sd, d * (table.lateral[i] - f.corrected) / sd)
    };
    let z: Vec<(f64, f64)> = forecasts.iter().enumerate().map(z).collect();
    let limit = 1.1 * z.iter().fold(4.0f64, |a, (b, _)| a.max(b.abs())).min(40.0);
    let mut figures = String::new();
    for c in covariate::COVARIATES {
        let all: Option<Vec<f64>> = table.passes.iter().map(|p| c.of(p).map(|v| c.shown.0 * v)).collect();
        let Some(x) = all else { continue };
        let [low, high] = ends(x.iter().copied());
        if high - low <= 1e-12 * high.abs().max(1e-12) {
            continue;
        }
        let seen = |i: usize| Seen { x: x[i], before: z[i].0, after: z[i].1, suspect: suspects.contains(&i) };
        let points: Vec<Seen> = (0..x.len()).map(seen).collect();
        figures += &errors_against(c, limit, &points)?;
    }
    let cut = beyond(z.iter().flat_map(|(before, after)| [*before, *after]), [-limit, limit]);
    Ok(format!(
        "<h2>Residuals</h2>{}<div class=\"panels\">{figures}</div>",
        note(&format!(
            "Error along the motion in standard deviations of a pass. Hollow squares: recalibrated baseline. Discs: verdict's model. \
             Suspect passes are ringed.{cut}"
        ))
    ))
}

//! One self-contained HTML page of a verdict: ranking, residual maps before and after, regions, next experiment.

use super::page::{escape, shell};
use super::plots;
use diagnosis::data::Table;
use diagnosis::verdict::Diagnosis;
use models::covariate::{self, Scale};

/// Parts of the operating space that are told in words, the largest first.
const TOLD: usize = 12;

/// The page.
///
/// # Errors
/// Only if the drawing library fails.
pub fn page(result: &Diagnosis, table: &Table) -> miette::Result<String> {
    let r = &result.report;
    let body = [
        format!("<h1>Diagnosis</h1><p class=\"verdict\">{}</p>", escape(&r.text)),
        ranking(result),
        gap(result),
        maps(result, table)?,
        lists(result),
        format!("<p><small>{} passes, SHA-256 {}</small></p>", r.data.points, escape(&r.data.sha256)),
    ];
    Ok(shell("Diagnosis", &body.concat()))
}

fn ranking(result: &Diagnosis) -> String {
    let mut rows = String::new();
    for h in result.report.hypotheses.iter().filter(|h| h.probability > 0.002).take(12) {
        let name = if h.effects.is_empty() { "no gap".to_string() } else { h.effects.join(" + ") };
        let parameters: Vec<String> = h
            .parameters
            .iter()
            .map(|p| {
                format!("{} = {:.3e} [{:.3e}, {:.3e}] {}", p.name, p.value, p.ci95[0], p.ci95[1], p.unit)
            })
            .collect();
        let alias = if h.alias_class.len() > 1 {
            format!("<br><small>not told from {}</small>", escape(&h.alias_class[1..].join(", ")))
        } else {
            String::new()
        };
        rows.push_str(&format!(
            "<tr><td>{}{alias}</td><td class=\"n\">{:.3}</td><td><span class=\"bar\" style=\"width:{:.0}px\"></span></td><td><small>{}</small></td></tr>",
            escape(&name),
            h.probability,
            160.0 * h.probability,
            escape(&parameters.join("; "))
        ));
    }
    format!(
        "<h2>Which</h2><table><tr><th>hypothesis</th><th class=\"n\">probability</th><th></th><th>parameters, 95 % intervals</th></tr>{rows}</table>"
    )
}

fn gap(result: &Diagnosis) -> String {
    let g = &result.report.gap;
    let largest = [g.before_rmse, g.recalibrated_rmse, g.after_rmse, g.noise_floor_rmse]
        .into_iter()
        .flatten()
        .fold(1e-12, f64::max);
    let mut rows = String::new();
    for (name, value) in [
        ("nominal baseline", g.before_rmse),
        ("recalibrated baseline", g.recalibrated_rmse),
        ("verdict's model", g.after_rmse),
        ("repeatability", g.noise_floor_rmse),
    ] {
        let Some(value) = value else { continue };
        rows.push_str(&format!(
            "<tr><td>{name}</td><td class=\"n\">{value:.4}</td><td><span class=\"bar\" style=\"width:{:.0}px\"></span></td></tr>",
            260.0 * value / largest
        ));
    }
    let words = match (g.shrinkage, g.shrinkage_ci95) {
        (Some(s), Some([low, high])) => format!(
            "The removable gap {} by {:.0} % (95 % interval {:.0} to {:.0} %).",
            if s < 0.0 { "grows" } else { "shrinks" },
            100.0 * s.abs(),
            100.0 * if s < 0.0 { -high } else { low },
            100.0 * if s < 0.0 { -low } else { high }
        ),
        _ if g.before_rmse.is_none() => "The table is too short to hold passes out.".to_string(),
        _ => "The recalibrated baseline is within its own sampling error of repeatability: no gap to shrink."
            .to_string(),
    };
    format!(
        "<h2>How far</h2><p>Root mean square error on held-out passes, in units of full friction.</p><table>{rows}</table><p>{words}</p>"
    )
}

/// Scatter of the error in deviations against each covariate, before and after.
fn maps(result: &Diagnosis, table: &Table) -> miette::Result<String> {
    let problem = &result.fitted.problem;
    let forecasts = result.predict(table);
    let z: Vec<(f64, f64)> = forecasts
        .iter()
        .enumerate()
        .map(|(i, f)| {
            let sd = (problem.whole_variance(i) / result.fitted.scatter.inflation[i]).sqrt();
            let d = table.passes[i].direction.sign();
            (d * (table.lateral[i] - f.recalibrated) / sd, d * (table.lateral[i] - f.corrected) / sd)
        })
        .collect();
    let limit = z.iter().fold(4.0f64, |a, (b, _)| a.max(b.abs())).min(40.0);
    let mut figures = String::new();
    for c in covariate::TOLD {
        let (factor, unit) = c.shown;
        let logarithmic = c.scale == Scale::Log;
        let all: Option<Vec<f64>> = table.passes.iter().map(|p| c.of(p).map(|v| factor * v)).collect();
        let Some(x) = all else { continue };
        // A direction has no unit.
        let name = if unit.is_empty() { c.words.to_string() } else { format!("{}, {unit}", c.words) };
        let (low, high) =
            x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
        if high - low <= 1e-12 * high.abs().max(1e-12) {
            continue;
        }
        let before: Vec<(f64, f64)> = x.iter().zip(&z).map(|(x, z)| (*x, z.0)).collect();
        let after: Vec<(f64, f64)> = x.iter().zip(&z).map(|(x, z)| (*x, z.1)).collect();
        figures.push_str(&plots::errors_against(&name, logarithmic, limit, &before, &after)?);
    }
    Ok(format!(
        "<h2>Residuals</h2><p>Error along the motion in standard deviations of a pass: <span style=\"color:#d55e00\">recalibrated baseline</span>, <span style=\"color:#0072b2\">verdict's model</span>.</p><div class=\"maps\">{figures}</div>"
    ))
}

fn lists(result: &Diagnosis) -> String {
    let r = &result.report;
    let mut text = String::from("<h2>Where</h2>");
    let items = |list: Vec<String>| -> String {
        if list.is_empty() {
            "<p>Nothing to report.</p>".to_string()
        } else {
            format!("<ul>{}</ul>", list.iter().map(|l| format!("<li>{}</li>", escape(l))).collect::<String>())
        }
    };
    let told: Vec<String> = r
        .location
        .regions
        .iter()
        .filter(|g| g.share_of_gap >= 0.01)
        .take(TOLD)
        .map(|g| g.text.clone())
        .collect();
    let rest = r.location.regions.len() - told.len();
    text.push_str(&items(told));
    if rest > 0 {
        text.push_str(&format!("<p>And {rest} further parts, in the JSON document.</p>"));
    }
    let places: Vec<String> = r.location.place.iter().map(|(k, v)| format!("{k}: {v:.3}")).collect();
    text.push_str(&format!("<p>By place: {}.</p>", escape(&places.join(", "))));
    text.push_str("<h2>What to do next</h2>");
    text.push_str(&items(
        r.next_experiment
            .iter()
            .map(|e| {
                let [a, b] = &e.separates;
                if e.conditions.is_empty() {
                    format!("{} Parts {a} from {b}; {:.1} nats expected.", e.text, e.expected_nats)
                } else {
                    e.text.clone()
                }
            })
            .collect(),
    ));
    text.push_str("<h2>Left-out regions</h2>");
    text.push_str(&items(
        r.left_out
            .regions
            .iter()
            .map(|(name, closed)| match closed {
                Some(c) => format!("{name}: {:.0} % of the gap closed", 100.0 * c),
                None => format!("{name}: no gap there"),
            })
            .collect(),
    ));
    text.push_str("<h2>Not testable on this table</h2>");
    text.push_str(&items(r.not_testable.iter().map(|n| format!("{}: {}", n.effect, n.because)).collect()));
    if !r.remarks.is_empty() {
        text.push_str("<h2>Remarks</h2>");
        text.push_str(&items(r.remarks.clone()));
    }
    text
}

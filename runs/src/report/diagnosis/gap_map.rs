//! The gap over the operating space as tables of cells: read without colour, by a screen reader and in print.

use crate::report::html::{escape, note, table};
use crate::report::human::number;
use diagnosis::data::Table;
use models::covariate::{self, Covariate};

/// Cells along an axis at most.
const CELLS: usize = 6;
/// Share of a setting's range within which values are one level.
const LEVEL: f64 = 0.04;
/// Shares of full friction from which a cell has a deeper shade.
const SHADES: [f64; 3] = [0.01, 0.03, 0.08];

/// Mean error of `mu'` in every part of the operating space, before and after: `errors` are measured less predicted over full friction,
/// positive where more friction was measured.
pub fn section(points: &Table, errors: &[(f64, f64)]) -> String {
    let varied: Vec<&Covariate> =
        [&covariate::SPEED, &covariate::FREQUENCY, &covariate::NORMAL_FORCE, &covariate::TIME]
            .into_iter()
            .filter(|c| edges(points, c).is_some_and(|e| e.len() > 2))
            .collect();
    let rows = if edges(points, &covariate::AMPLITUDE).is_some_and(|e| e.len() > 2) {
        &covariate::AMPLITUDE
    } else {
        &covariate::NORMAL_FORCE
    };
    let maps: String = varied
        .into_iter()
        .filter(|c| c.name != rows.name)
        .take(3)
        .filter_map(|columns| {
            Some(
                [map(points, errors, rows, columns, false)?, map(points, errors, rows, columns, true)?]
                    .concat(),
            )
        })
        .map(|pair| format!("<div class=\"maps\">{pair}</div>"))
        .collect();
    if maps.is_empty() {
        return note("The table varies no two settings: there is no map to draw.");
    }
    maps + &note(
        "Mean of measured less predicted relative friction in each part, with the number of its passes below. Positive (warm): more \
         friction was measured than the model says; negative (cool): less. A cell without passes says nothing.",
    )
}

/// Edges of at most [`CELLS`] parts with about as many passes each; levels that are few stay apart.
fn edges(points: &Table, c: &Covariate) -> Option<Vec<f64>> {
    let mut values: Vec<f64> = points.passes.iter().map(|p| c.of(p)).collect::<Option<_>>()?;
    values.sort_by(f64::total_cmp);
    let (low, high) = (*values.first()?, *values.last()?);
    if high - low <= 1e-3 * high.abs() {
        return None;
    }
    // Values that are regulated to within some hundredths of the range are one level.
    let mut levels: Vec<f64> = Vec::new();
    for v in &values {
        if levels.last().is_none_or(|l| v - l > LEVEL * (high - low)) {
            levels.push(*v);
        }
    }
    let mut inner: Vec<f64> = if levels.len() <= CELLS {
        levels.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect()
    } else {
        // Between two levels: a bound on one would part what its setting scatters.
        let after = |v: f64| levels.partition_point(|l| *l <= v);
        (1..CELLS)
            .filter_map(|k| levels.get(after(values[k * values.len() / CELLS])))
            .map(|next| 0.5 * (values[values.partition_point(|v| v < next) - 1] + next))
            .collect()
    };
    inner.dedup();
    Some([vec![low], inner, vec![high]].concat())
}

fn part(edges: &[f64], value: f64) -> usize {
    edges[1..edges.len() - 1].iter().filter(|e| value > **e).count()
}

fn named(c: &Covariate, edges: &[f64], points: &Table, k: usize) -> String {
    let inside = points.passes.iter().filter_map(|p| c.of(p)).filter(|v| part(edges, *v) == k);
    let (low, high) = inside.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let [low, high] = [low, high].map(|v| number(c.shown.0 * v));
    if low == high { low } else { format!("{low} to {high}") }
}

fn map(
    points: &Table,
    errors: &[(f64, f64)],
    rows: &Covariate,
    columns: &Covariate,
    after: bool,
) -> Option<String> {
    let (across, down) = (edges(points, columns)?, edges(points, rows)?);
    let mut cells = vec![vec![(0.0, 0usize); across.len() - 1]; down.len() - 1];
    for (pass, (first, last)) in points.passes.iter().zip(errors) {
        let cell = &mut cells[part(&down, rows.of(pass)?)][part(&across, columns.of(pass)?)];
        cell.0 += if after { last } else { first };
        cell.1 += 1;
    }
    let which = if after { "verdict's model" } else { "recalibrated baseline" };
    let unit = |c: &Covariate| escape(&format!("{}, {}", c.words, c.shown.1));
    let titles: String = (0..across.len() - 1)
        .map(|k| format!("<th scope=\"col\">{}</th>", named(columns, &across, points, k)))
        .collect();
    let head = format!("<th scope=\"col\">{} \\ {}</th>{titles}", unit(rows), unit(columns));
    let body: String = cells
        .iter()
        .enumerate()
        .map(|(k, row)| {
            let cells: String = row.iter().map(|cell| shaded(*cell)).collect();
            format!("<tr><th scope=\"row\">{}</th>{cells}</tr>", named(rows, &down, points, k))
        })
        .collect();
    let label = format!("Gap of the {which} by {} and {}", rows.words, columns.words);
    let text = table(&label, &head, &body);
    Some(text.replacen("<table>", &format!("<table class=\"map\"><caption>Left by the {which}</caption>"), 1))
}

fn shaded((sum, n): (f64, usize)) -> String {
    if n == 0 {
        return "<td class=\"none\">&ndash;</td>".into();
    }
    let mean = sum / n as f64;
    let shade = SHADES.iter().filter(|s| mean.abs() >= **s).count();
    let class = match (shade, mean > 0.0) {
        (0, _) => String::new(),
        (k, true) => format!(" class=\"u{k}\""),
        (k, false) => format!(" class=\"d{k}\""),
    };
    format!("<td{class}>{mean:+.3}<br><small>{n}</small></td>")
}

//! The gap over the operating space as tables of cells: read without colour, by a screen reader and in print.
//! Every pass is a mark in its cell, and leads to the numbers of the pass.

use crate::format::{number, titled};
use crate::report::html::{column, escape, note, row, table};
use crate::report::plots::ends;
use diagnosis::Table;
use models::covariate::{self, Covariate};

/// Cells along an axis at most.
const CELLS: usize = 6;
/// Marks in a cell at most: of more passes each mark is the mean of some that follow one another.
const MARKS: usize = 60;
/// Share of a setting's range within which values are one level.
const LEVEL: f64 = 0.04;
/// Shades on either side of zero.
const SHADES: i32 = 8;
/// Least end of the colour scale, in full friction: a gap that is smaller is pale.
const LEAST_END: f64 = 0.005;
/// The deepest shades, of less friction than the model says and of more: black letters are read on both.
const DEEPEST: [[f64; 3]; 2] = [[58.0, 148.0, 207.0], [213.0, 94.0, 0.0]];

/// Mean error of `mu'` in every part of the operating space, before and after, on one scale: `errors` are
/// measured less predicted over full friction, positive where more friction was measured.
pub fn section(points: &Table, errors: &[(f64, f64)]) -> String {
    let varies = |c: &&Covariate| edges(points, c).is_some_and(|e| e.len() > 2);
    let rows = Some(&covariate::AMPLITUDE).filter(varies).unwrap_or(&covariate::NORMAL_FORCE);
    let columns = [&covariate::SPEED, &covariate::FREQUENCY, &covariate::NORMAL_FORCE, &covariate::TIME];
    let columns = columns.into_iter().filter(varies).filter(|c| c.name != rows.name).take(3);
    let maps: Vec<Map<'_>> = columns.filter_map(|c| Map::of(points, errors, rows, c)).collect();
    if maps.is_empty() {
        return note("The table varies no two settings: there is no map to draw.");
    }
    let end = maps.iter().flat_map(Map::means).fold(LEAST_END, |end, mean| end.max(mean.abs()));
    let pair =
        |map: &Map<'_>| format!("<div class=\"maps\">{}{}</div>", map.html(false, end), map.html(true, end));
    let pairs: String = maps.iter().map(pair).collect();
    let text = note(&format!(
        "Number: mean of measured less predicted relative friction in the part, positive (warm) where more \
         friction was measured than the model says, negative (cool) where less. Marks: its passes in the order \
         of measurement, each in the colour of its own gap (of more than {MARKS} passes the mean of some in a \
         row); click one for its numbers. A part without passes says nothing."
    ));
    format!("{}{pairs}{text}", scale(end))
}

/// The colours, and the scale that all maps share.
fn scale(end: f64) -> String {
    let colour = |k: i32| {
        let deepest = DEEPEST[usize::from(k > 0)];
        let share = f64::from(k.abs()) / f64::from(SHADES);
        let [r, g, b] = deepest.map(|full| (255.0 + share * (full - 255.0)).round());
        format!(".{}{{background:rgb({r},{g},{b});color:#000}}", shade_class(k))
    };
    let all = || -SHADES..=SHADES;
    let style: String = all().map(colour).collect();
    let steps: String = all().map(|k| format!("<i class=\"{}\"></i>", shade_class(k))).collect();
    let [low, high] = [number(-end), number(end)];
    format!(
        "<style>{style}</style><p class=\"scale\">{low}<span aria-hidden=\"true\">{steps}</span>+{high} \
         <small>of full friction, the same in every map</small></p>"
    )
}

fn shade_class(k: i32) -> String {
    format!("k{}{}", if k < 0 { "m" } else { "" }, k.abs())
}

/// The shade of an error on a scale that ends there; beyond it lies the deepest.
fn shade(error: f64, end: f64) -> String {
    shade_class((error / end * f64::from(SHADES)).round().clamp(-f64::from(SHADES), f64::from(SHADES)) as i32)
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
    let [low, high] = ends(inside);
    let [low, high] = [low, high].map(|v| number(c.shown.0 * v));
    if low == high { low } else { format!("{low} to {high}") }
}

/// The passes by their cells: a row of cells each part of one covariate, a column each of another's.
struct Map<'a> {
    points: &'a Table,
    errors: &'a [(f64, f64)],
    covariates: [&'a Covariate; 2],
    titles: [Vec<String>; 2],
    cells: Vec<Vec<Vec<usize>>>,
}

impl<'a> Map<'a> {
    fn of(
        points: &'a Table,
        errors: &'a [(f64, f64)],
        rows: &'a Covariate,
        columns: &'a Covariate,
    ) -> Option<Self> {
        let (across, down) = (edges(points, columns)?, edges(points, rows)?);
        let mut cells = vec![vec![Vec::new(); across.len() - 1]; down.len() - 1];
        for (i, pass) in points.passes.iter().enumerate() {
            cells[part(&down, rows.of(pass)?)][part(&across, columns.of(pass)?)].push(i);
        }
        let titles = [(rows, &down), (columns, &across)]
            .map(|(c, edges)| (0..edges.len() - 1).map(|k| named(c, edges, points, k)).collect());
        Some(Map { points, errors, covariates: [rows, columns], titles, cells })
    }

    fn error(&self, pass: usize, after: bool) -> f64 {
        if after { self.errors[pass].1 } else { self.errors[pass].0 }
    }

    fn mean(&self, cell: &[usize], after: bool) -> f64 {
        cell.iter().map(|&i| self.error(i, after)).sum::<f64>() / cell.len() as f64
    }

    /// The means of all cells with passes, before and after.
    fn means(&self) -> impl Iterator<Item = f64> {
        let filled = self.cells.iter().flatten().filter(|cell| !cell.is_empty());
        filled.flat_map(|cell| [false, true].map(|after| self.mean(cell, after)))
    }

    fn html(&self, after: bool, end: f64) -> String {
        let [rows, columns] = self.covariates;
        let (name, which) =
            if after { ("after", "verdict's model") } else { ("before", "recalibrated baseline") };
        let titles: String = self.titles[1].iter().map(|title| column(title)).collect();
        let head = column(&escape(&format!("{} \\ {}", titled(rows), titled(columns)))) + &titles;
        let body = self.cells.iter().zip(&self.titles[0]);
        let body =
            body.map(|(cells, title)| row(title, cells.iter().map(|cell| self.cell(cell, after, end))));
        let label = format!("Gap {name}, left by the {which}, by {} and {}", rows.words, columns.words);
        let text = table(&label, &head, body);
        let caption = format!("<table class=\"map\"><caption>Gap {name}: left by the {which}</caption>");
        text.replacen("<table>", &caption, 1)
    }

    fn cell(&self, cell: &[usize], after: bool, end: f64) -> String {
        if cell.is_empty() {
            return "<td class=\"none\">&ndash;</td>".into();
        }
        let mean = self.mean(cell, after);
        let mark = |passes: &[usize]| {
            let error = self.mean(passes, after);
            let point = self.points.points[passes[0]];
            let more =
                if passes.len() == 1 { String::new() } else { format!(" and {} more", passes.len() - 1) };
            let (shade, error) = (shade(error, end), signed(error));
            // Out of the keyboard's way: the table of all passes has the same numbers.
            format!(
                "<a class=\"{shade}\" href=\"#pass-{point}\" tabindex=\"-1\" title=\"pass {point}{more}: {error}\"></a>"
            )
        };
        let marks: String = cell.chunks(cell.len().div_ceil(MARKS)).map(mark).collect();
        format!("<td class=\"{}\">{}<div>{marks}</div></td>", shade(mean, end), signed(mean))
    }
}

/// An error with its sign, where it has one with these digits.
fn signed(error: f64) -> String {
    let text = format!("{error:+.3}");
    if text.ends_with("0.000") { "0.000".into() } else { text }
}

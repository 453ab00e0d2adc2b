//! The single problems of a refusal, each with its place in the file if it is known, and a remedy.

use super::{KINDS, text_of};
use runs::input::Problems;
use serde::Serialize;

/// One problem, for programs.
#[derive(Clone, Debug, Serialize)]
pub struct InputProblem {
    /// What is wrong.
    pub problem: String,
    /// Line and column of the place, from 1; none where the file has none.
    pub line: Option<usize>,
    /// Column.
    pub column: Option<usize>,
    /// What to do.
    pub help: Option<String>,
}

/// The single problems of a refusal.
pub fn problems_of(report: &miette::Report) -> Vec<InputProblem> {
    let mut all: Vec<InputProblem> = report.related().into_iter().flatten().map(one).collect();
    if all.is_empty() {
        let mut problem = one(report.as_ref());
        for cause in report.chain().skip(1) {
            problem.problem = format!("{}: {cause}", problem.problem);
        }
        all.push(problem);
    }
    all
}

/// Line and column of a problem from 1, and the file that it is in.
fn place_of(of: &dyn miette::Diagnostic) -> Option<(usize, usize, Option<String>)> {
    let label = of.labels()?.next()?;
    let span = of.source_code()?.read_span(label.inner(), 0, 0).ok()?;
    Some((span.line() + 1, span.column() + 1, span.name().map(str::to_string)))
}

fn one(of: &dyn miette::Diagnostic) -> InputProblem {
    let (line, column) = place_of(of).map(|(line, column, _)| (line, column)).unzip();
    InputProblem { problem: of.to_string(), line, column, help: of.help().map(|h| h.to_string()) }
}

/// A refusal whose every problem has a place in the file, where the file has such a key, and a remedy.
pub fn with_place_and_help(report: miette::Report, name: &str, kind: Option<&str>) -> miette::Report {
    let found = problems_of(&report);
    // A place in a file that this one names stays there.
    let other = place_of(report.as_ref()).and_then(|(.., file)| file).is_some_and(|file| file != name);
    if other || found.iter().all(|p| p.line.is_some() && p.help.is_some()) {
        return report;
    }
    let Ok(text) = text_of(name) else {
        // What is not text has no place; it may lack the remedy.
        let help = found[0].help.clone().unwrap_or_else(|| remedy(kind));
        return if report.help().is_some() {
            report
        } else {
            miette::miette!(help = help, "{}", found[0].problem)
        };
    };
    let elsewhere = |p: &InputProblem| p.line.is_none() && kind == Some("plan");
    if found.iter().any(elsewhere) {
        return report;
    }
    let mut all = Problems::of(name, &text);
    for p in found {
        let place = match (p.line, p.column) {
            (Some(line), Some(column)) => Some(offset(&text, line, column)),
            _ => place_named(&text, &p.problem).or_else(|| {
                // What a certificate says of itself as a whole stands at its seal.
                (kind == Some("certificate")).then(|| text.find("content_sha256")).flatten()
            }),
        };
        all.add_at(place.map(|at| at..at), p.problem, Some(p.help.unwrap_or_else(|| remedy(kind))));
    }
    all.end().err().unwrap_or(report)
}

/// Adds the single problems of another refusal, at their lines in `text`.
pub(super) fn put_all(report: &miette::Report, text: &str, problems: &mut Problems<'_>) {
    for p in problems_of(report) {
        let at = p.line.zip(p.column).map(|(line, column)| offset(text, line, column));
        problems.add_at(at.map(|at| at..at), p.problem, p.help);
    }
}

fn offset(text: &str, line: usize, column: usize) -> usize {
    let before: usize = text.split_inclusive('\n').take(line - 1).map(str::len).sum();
    (before + column - 1).min(text.len())
}

/// Where the key stands that a problem names, or the line that it gives.
fn place_named(text: &str, problem: &str) -> Option<usize> {
    let line = problem.split_once("line ").or_else(|| problem.split_once("line: ")).and_then(|(_, rest)| {
        rest.chars().take_while(char::is_ascii_digit).collect::<String>().parse::<usize>().ok()
    });
    if let Some(line) = line {
        let column = problem.split_once(", column ").map_or("", |(_, rest)| rest);
        let column = column.chars().take_while(char::is_ascii_digit).collect::<String>().parse().unwrap_or(1);
        return Some(offset(text, line.max(1), column));
    }
    let words: Vec<&str> = problem
        .split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '-'))
        .filter(|w| w.len() > 2)
        .collect();
    let table = toml::de::DeTable::parse(text).ok()?;
    let mut found: Vec<(usize, usize)> = Vec::new();
    named(table.get_ref(), &words, &mut found);
    found.into_iter().max_by_key(|(length, at)| (*length, usize::MAX - *at)).map(|(_, at)| at)
}

fn named(table: &toml::de::DeTable<'_>, words: &[&str], found: &mut Vec<(usize, usize)>) {
    use toml::de::DeValue;
    for (key, value) in table {
        if words.contains(&key.get_ref().as_ref()) {
            found.push((key.get_ref().len(), value.span().start));
        }
        match value.get_ref() {
            DeValue::Table(inner) => named(inner, words, found),
            DeValue::Array(list) => {
                for item in list.iter() {
                    if let DeValue::Table(inner) = item.get_ref() {
                        named(inner, words, found);
                    }
                }
            }
            DeValue::String(text) if text.len() > 2 && words.contains(&text.as_ref()) => {
                found.push((text.len(), value.span().start));
            }
            _ => {}
        }
    }
}

/// A kind of file with its article, for a sentence.
pub(super) fn with_article(kind: &str) -> String {
    match kind {
        "identity" => "the run.toml of a run".into(),
        "import log" => "the log of an import".into(),
        "run" => "the folder of a run".into(),
        "annotations" => "a file of tags and a note".into(),
        "fidelity" => "the fidelity of a run that rendered".into(),
        "signals of an export" | "claims of a campaign" | "tips of a campaign" => {
            format!("a file with {kind}")
        }
        kind if kind.starts_with(['A', 'e']) => format!("an {kind}"),
        kind => format!("a {kind}"),
    }
}

/// What helps with a kind of file, where nothing better is known.
pub(super) fn remedy(kind: Option<&str>) -> String {
    match kind {
        Some(kind @ ("plan" | "setup" | "fingertip" | "profile")) => {
            format!(
                "docs/reference.md lists the keys of a {kind} with their ranges; `muprime init {kind}` prints one that holds"
            )
        }
        Some("campaign") => {
            "docs/reference.md lists the keys of a campaign; `muprime show part2-campaign` prints one".into()
        }
        Some("rig.toml") => "`muprime run` and `muprime import` write one (docs/contract.md); it needs at least [finger] with \
            `normal_stiffness_n_per_m` and `lateral_stiffness_n_per_m`"
            .into(),
        Some("certificate") => "a certificate is not edited: make a new one with `muprime calibrate`".into(),
        Some("model") => "write a new one with `muprime diagnose --save-model`".into(),
        Some("defects file") => "docs/reference.md lists the defects with their parameters".into(),
        Some("table") => {
            "`muprime import` makes a point table of a foreign one; docs/contract.md lists the columns".into()
        }
        Some("law table") => {
            "docs/own-law.md lists the columns of a law table; `muprime model tabulate` makes one".into()
        }
        Some("effect table") => {
            "docs/own-law.md, 'An effect of your own', says what the table of an effect has".into()
        }
        Some("record") => {
            "`muprime recover FILE` makes what is whole readable again, and keeps the original".into()
        }
        Some("verdict" | "summary" | "import log" | "journal" | "identity" | "run") => {
            "it was cut or changed after it was written: let the program write it again".into()
        }
        _ => KINDS.into(),
    }
}

//! Published values beside the passes of a run: the numbers that the paper's text states, or those of a
//! user's file, each with its source.

use super::html::{cell, columns, escape, note, numeric, row, table};
use super::plots::published::panels;
use crate::format::number;
use crate::input::{MAX_TABLE_BYTES, bytes_of};
use crate::run_data::RunData;
use miette::WrapErr;
use serde::Deserialize;
use std::path::Path;

/// What the paper's text states.
const PAPER: &str = include_str!("../../published/paper.csv");
/// The name under which that is found.
pub const PAPER_NAME: &str = "paper";

/// A published number: a value of `mu'`, `Psi*` of Eq. 20, or an amplitude at which something happens. SI.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Where it is published: a section, a reference.
    pub source: String,
    /// What it is, in words.
    #[serde(default)]
    pub what: String,
    /// Amplitude peak to peak, m.
    pub amplitude_pp_m: Option<f64>,
    /// The end of a range of amplitudes that begins at `amplitude_pp_m`, m.
    pub amplitude_to_m: Option<f64>,
    /// Frequency, Hz.
    pub frequency_hz: Option<f64>,
    /// Sliding speed, m/s.
    pub speed_m_s: Option<f64>,
    /// Normal force, N.
    pub normal_force_n: Option<f64>,
    /// Relative friction.
    pub mu_relative: Option<f64>,
    /// Its standard uncertainty.
    pub mu_relative_sd: Option<f64>,
    /// `Psi*` of Eq. 20, with w peak to peak.
    pub psi_star: Option<f64>,
    /// Its standard uncertainty.
    pub psi_star_sd: Option<f64>,
    /// Whether the paper's text states it.
    #[serde(skip)]
    pub of_paper: bool,
}

impl Published {
    /// Its source for a reader.
    pub fn named(&self) -> String {
        if self.of_paper { format!("the paper, {}", self.source) } else { self.source.clone() }
    }

    /// What keeps it from being drawn.
    fn wrong(&self) -> Option<String> {
        let positive = [
            ("frequency_hz", self.frequency_hz),
            ("speed_m_s", self.speed_m_s),
            ("normal_force_n", self.normal_force_n),
            ("mu_relative_sd", self.mu_relative_sd),
            ("psi_star", self.psi_star),
            ("psi_star_sd", self.psi_star_sd),
        ];
        let bad = positive
            .into_iter()
            .find_map(|(name, v)| Some((name, v.filter(|v| !(v.is_finite() && *v > 0.0))?)));
        if let Some((name, v)) = bad {
            return Some(format!("{name} = {v}; a positive number is needed"));
        }
        let amplitudes = [self.amplitude_pp_m, self.amplitude_to_m];
        if let Some(w) = amplitudes.into_iter().flatten().find(|w| !(0.0..=1e-3).contains(w)) {
            return Some(format!("an amplitude of {w} m; 0 to 1e-3 m is needed (peak to peak)"));
        }
        if self.amplitude_to_m.is_some_and(|to| self.amplitude_pp_m.is_none_or(|from| from >= to)) {
            return Some("amplitude_to_m ends a range; amplitude_pp_m must begin it below".into());
        }
        if self.mu_relative.is_some_and(|mu| !mu.is_finite()) {
            return Some("mu_relative is not a number".into());
        }
        let placed = [self.amplitude_pp_m, self.frequency_hz, self.speed_m_s].iter().any(Option::is_some);
        if self.source.is_empty() {
            return Some("source is empty; write where the value is published".into());
        }
        let drawn = self.psi_star.is_some()
            || self.amplitude_pp_m.is_some()
            || (self.mu_relative.is_some() && placed);
        (!drawn).then(|| "nothing to draw: mu_relative with amplitude_pp_m, frequency_hz or speed_m_s, or psi_star is needed".into())
    }
}

/// The values of `paper`, or of a CSV file.
///
/// # Errors
/// A file that cannot be read, or a row of it, with the line.
pub fn of(name: &str) -> miette::Result<Vec<Published>> {
    if name == PAPER_NAME {
        let mut all = parse(PAPER.as_bytes(), "paper.csv")?;
        all.iter_mut().for_each(|one| one.of_paper = true);
        return Ok(all);
    }
    let path = Path::new(name);
    let bytes = bytes_of(path, MAX_TABLE_BYTES).wrap_err_with(|| {
        format!("--overlay {name}: `paper`, or a CSV file of published values, is needed")
    })?;
    parse(&bytes, name)
}

fn parse(bytes: &[u8], name: &str) -> miette::Result<Vec<Published>> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let mut all = Vec::new();
    let help = "columns: source, mu_relative, mu_relative_sd, amplitude_pp_m, amplitude_to_m, frequency_hz, speed_m_s, normal_force_n, \
                psi_star, psi_star_sd, what; only `source` must be there, and a column may be left out or a cell empty";
    let head = reader.headers().map_err(|why| miette::miette!(help = help, "{name}: {why}"))?.clone();
    let mut row = csv::StringRecord::new();
    while reader.read_record(&mut row).map_err(|why| miette::miette!(help = help, "{name}: {why}"))? {
        let line = row.position().map_or(0, csv::Position::line);
        let one: Published = row
            .deserialize(Some(&head))
            .map_err(|why| miette::miette!(help = help, "{name}, line {line}: {why}"))?;
        if let Some(wrong) = one.wrong() {
            miette::bail!(help = help, "{name}, line {line}: {wrong}");
        }
        all.push(one);
    }
    if all.is_empty() {
        miette::bail!(help = help, "{name} holds no value");
    }
    Ok(all)
}

/// The section: the run's passes with the published values against amplitude, frequency and speed, and all of
/// them in a table.
pub fn section(run: &RunData, all: &[Published]) -> miette::Result<String> {
    if all.is_empty() {
        return Ok(String::new());
    }
    let scaled = |value: Option<f64>, scale: f64| value.map_or("&ndash;".into(), |v| number(v * scale));
    let with_sd = |value: Option<f64>, sd: Option<f64>| match (value, sd) {
        (Some(v), Some(sd)) => format!("{} &plusmn; {}", number(v), number(sd)),
        (value, _) => scaled(value, 1.0),
    };
    let row = |one: &Published| {
        let amplitude = match (one.amplitude_pp_m, one.amplitude_to_m) {
            (Some(from), Some(to)) => format!("{} to {}", number(from * 1e6), number(to * 1e6)),
            (from, _) => scaled(from, 1e6),
        };
        let numbers = [
            amplitude,
            scaled(one.frequency_hz, 1e-3),
            scaled(one.speed_m_s, 1e3),
            scaled(one.normal_force_n, 1.0),
            with_sd(one.mu_relative, one.mu_relative_sd),
            with_sd(one.psi_star, one.psi_star_sd),
        ];
        let cells = std::iter::once(cell(escape(&one.what))).chain(numbers.map(numeric));
        row(escape(&one.named()), cells) + "\n"
    };
    let head = columns("source|what|#w, \u{b5}m|#f, kHz|#U, mm/s|#load, N|#\u{3bc}'|#\u{3a8}*");
    let text = if all.iter().any(|one| one.of_paper) {
        note(
            "From the paper: what its text states (Vezzoli et al., part 1), each number with its section. Its figures were not digitised, \
             and the text states no single measured value of &mu;'.",
        )
    } else {
        String::new()
    };
    Ok(format!(
        "<h2>Published values</h2>{}{text}{}",
        panels(run, all)?,
        table("Published values", &head, all.iter().map(row))
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_values_have_their_sections_and_its_psi_star() {
        let all = of(PAPER_NAME).unwrap();
        assert!(all.iter().all(|one| one.source.starts_with("section ") && one.of_paper));
        let law = all.iter().find_map(|one| one.psi_star.zip(one.psi_star_sd)).unwrap();
        assert_eq!(law, (models::psi::PSI_STAR, models::psi::PSI_STAR_UNCERTAINTY));
    }

    #[test]
    fn a_row_that_cannot_be_drawn_is_refused_with_its_line() {
        for (rows, wrong) in [
            ("source,mu_relative\nA,0.4\n", "line 2: nothing to draw"),
            ("source,mu_relative,speed_m_s\nA,0.4,0.02\n,0.4,0.02\n", "line 3: source is empty"),
            ("source,mu_relative,speed_m_s\nA,0.4,-0.02\n", "line 2: speed_m_s = -0.02"),
            ("source,mu,speed_m_s\nA,0.4,0.02\n", "line 2"),
            ("source,mu_relative,amplitude_pp_m\nA,0.4,2.0\n", "an amplitude of 2 m"),
            ("source,mu_relative,amplitude_pp_m\n", "holds no value"),
        ] {
            let why = parse(rows.as_bytes(), "own.csv").unwrap_err();
            assert!(why.to_string().contains(wrong), "{rows}: {why}");
        }
        let good =
            parse(b"source,mu_relative,mu_relative_sd,frequency_hz\nA,0.4,0.02,30000\n", "own.csv").unwrap();
        assert_eq!(
            (good[0].mu_relative, good[0].frequency_hz, good[0].psi_star),
            (Some(0.4), Some(3e4), None)
        );
    }
}

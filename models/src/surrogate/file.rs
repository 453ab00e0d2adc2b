//! The table's text form: axes, hash of the inputs, error, and three fields as integers.

use super::spline::Dense;
use super::{GridAxis, GridPoint, InterpolationError, Surrogate, SurrogateGrid};
use std::fmt::Write;

const FIRST_LINE: &str = "muprime ridge table 2";
/// Field name, and how many steps of the integers make one unit.
const FIELDS: [(&str, f64); 3] = [("mu_relative", 1e4), ("phase_shift_deg", 10.0), ("contact_fraction", 1e4)];

/// Why a table could not be read or made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum TableError {
    /// A line that is not what it should be.
    #[error("line {line} of the ridge table: {problem}")]
    Line { line: usize, problem: String },
    /// A result is missing: the study is not complete.
    #[error("{missing} of {of} results are missing: let the study finish first")]
    Incomplete { missing: usize, of: usize },
}

/// What the table keeps of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableResult {
    /// mu'.
    pub mu_relative: f64,
    /// Phase shift in degrees.
    pub phase_shift_deg: f64,
    /// Share of the cycle in contact.
    pub contact_fraction: f64,
}

impl TableResult {
    /// Phase continued below zero: a lead of some degrees stands as such, not as nearly a full turn.
    fn phase_around_zero(&self) -> f64 {
        if self.phase_shift_deg > 270.0 { self.phase_shift_deg - 360.0 } else { self.phase_shift_deg }
    }
}

impl Surrogate {
    /// Makes the table's text from the results of `grid`'s cases; `error` once it is known.
    ///
    /// # Errors
    /// Results that are missing.
    pub fn table_text(
        grid: &SurrogateGrid,
        result: impl Fn(&GridPoint) -> Option<TableResult>,
        error: InterpolationError,
    ) -> Result<String, TableError> {
        let points = grid.points();
        let results: Vec<_> = points.iter().map(|p| result(p).map(|r| (p.at_rest, r))).collect();
        let missing = results.iter().filter(|r| r.is_none()).count();
        if missing > 0 {
            return Err(TableError::Incomplete { missing, of: points.len() });
        }
        let results: Vec<_> = results.into_iter().flatten().collect();
        let mut text = format!("{FIRST_LINE}\ninputs {}\n", grid.inputs_hash());
        for (name, axis) in grid.axes() {
            let _ = writeln!(text, "axis {name} {:e} {:e} {}", axis.low, axis.high, axis.count);
        }
        let _ = writeln!(text, "amplitudes {}", grid.amplitudes);
        let _ = writeln!(
            text,
            "error {:.5} {:.5} {:.3} {}",
            error.mu_rms, error.mu_max, error.phase_rms_deg, error.cases
        );
        for (field, (name, scale)) in FIELDS.into_iter().enumerate() {
            let _ = writeln!(text, "{name}");
            let values: Vec<String> = results
                .iter()
                .filter(|(at_rest, _)| *at_rest == (field > 0))
                .map(|(_, r)| [r.mu_relative, r.phase_around_zero(), r.contact_fraction][field])
                .map(|v| format!("{}", (v * scale).round() as i64))
                .collect();
            for row in values.chunks(grid.amplitudes) {
                let _ = writeln!(text, "{}", row.join(" "));
            }
        }
        Ok(text)
    }

    /// Reads a table.
    ///
    /// # Errors
    /// The line that is not what it should be.
    pub fn from_text(text: &str) -> Result<Surrogate, TableError> {
        let mut lines = text.lines().enumerate();
        let mut next = |what: &str| {
            lines.next().map(|(n, l)| (n + 1, l)).ok_or_else(|| TableError::Line {
                line: text.lines().count() + 1,
                problem: format!("the file ends where {what} should stand"),
            })
        };
        let bad = |line: usize, problem: String| TableError::Line { line, problem };
        let (n, first) = next("its name")?;
        if first != FIRST_LINE {
            return Err(bad(n, format!("'{FIRST_LINE}' is needed, not '{first}'")));
        }
        let (n, inputs) = next("the hash of its inputs")?;
        let inputs_hash = inputs
            .strip_prefix("inputs ")
            .ok_or_else(|| bad(n, "'inputs HASH' is needed".into()))?
            .to_string();
        let mut axes = [GridAxis { low: 1.0, high: 2.0, count: 2 }; 4];
        for (axis, (name, _)) in axes.iter_mut().zip(SurrogateGrid::SHIPPED.axes()) {
            let (n, line) = next(name)?;
            let words: Vec<&str> = line.split_whitespace().collect();
            let parsed = match words[..] {
                ["axis", given, low, high, count] if given == name => {
                    low.parse().ok().zip(high.parse().ok()).zip(count.parse().ok())
                }
                _ => None,
            };
            *axis = match parsed {
                Some(((low, high), count)) if 0.0 < low && low < high && (2..=1000).contains(&count) => {
                    GridAxis { low, high, count }
                }
                _ => return Err(bad(n, format!("'axis {name} LOW HIGH COUNT' is needed, not '{line}'"))),
            };
        }
        let mut count = |name: &str| {
            let (n, line) = next(name)?;
            let given = line.strip_prefix(name).and_then(|v| v.trim().parse::<usize>().ok());
            given
                .filter(|c| (2..=1000).contains(c))
                .ok_or_else(|| bad(n, format!("'{name} COUNT' is needed")))
        };
        let amplitudes = count("amplitudes")?;
        let (n, line) = next("the interpolation error")?;
        let error: Vec<f64> =
            line.strip_prefix("error ").unwrap_or("").split_whitespace().flat_map(str::parse).collect();
        let [mu_rms, mu_max, phase_rms_deg, cases] = error[..] else {
            return Err(bad(n, "'error MU_RMS MU_MAX PHASE_RMS_DEG CASES' is needed".into()));
        };
        let [young_modulus_pa, normal_force_n, frequency_hz, speed_over_mu0_m_s] = axes;
        let grid =
            SurrogateGrid { young_modulus_pa, normal_force_n, frequency_hz, speed_over_mu0_m_s, amplitudes };
        let mut dense = Vec::new();
        for (field, (name, scale)) in FIELDS.into_iter().enumerate() {
            let (n, line) = next(name)?;
            if line != name {
                return Err(bad(n, format!("'{name}' is needed, not '{line}'")));
            }
            let shape = grid.shape(field > 0);
            let mut values = Vec::new();
            for _ in 0..shape[..4].iter().product() {
                let (n, line) = next(name)?;
                let row: Result<Vec<i64>, _> = line.split_whitespace().map(str::parse).collect();
                match row {
                    Ok(row) if row.len() == amplitudes => {
                        values.extend(row.iter().map(|v| *v as f64 / scale))
                    }
                    _ => return Err(bad(n, format!("{amplitudes} whole numbers are needed, not '{line}'"))),
                }
            }
            dense.push(Dense::refined(shape, &values));
        }
        let [mu, phase, contact] =
            dense.try_into().unwrap_or_else(|_| unreachable!("three fields were read"));
        Ok(Surrogate {
            grid,
            mu,
            phase,
            contact,
            error: InterpolationError { mu_rms, mu_max, phase_rms_deg, cases: cases as usize },
            inputs_hash,
            young_modulus_pa: 28.3e6,
        })
    }

    /// The interpolation error against results at held-out cases.
    pub fn measure_error<'a>(
        &self,
        results: impl IntoIterator<Item = (&'a GridPoint, TableResult)>,
    ) -> InterpolationError {
        let (mut mu, mut phase, mut cases) = (Vec::new(), Vec::new(), 0);
        for (point, result) in results {
            let c = &point.case;
            let s = c.speed_m_s / c.mu0;
            let got = self.at(c.amplitude, c.frequency_hz, s, c.normal_force_n, c.young_modulus_pa);
            cases += 1;
            if !point.at_rest {
                mu.push((got.mu_relative - result.mu_relative).abs());
            } else if result.contact_fraction < 0.95 {
                phase.push(
                    (got.phase_shift_deg - result.phase_around_zero() + 180.0).rem_euclid(360.0) - 180.0,
                );
            }
        }
        let rms = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len().max(1) as f64).sqrt();
        InterpolationError {
            mu_rms: rms(&mu),
            mu_max: mu.iter().fold(0.0, |a: f64, b| a.max(*b)),
            phase_rms_deg: rms(&phase),
            cases,
        }
    }
}

//! What was measured, and what the models say of it.

use crate::format::{settings, titled};
use crate::report::html::note;
use crate::report::levels::{FORCE, FREQUENCY, Levels, PRESSURE, SPEED};
use crate::report::plots::verdict::{Seen, overlay, parity};
use crate::report::plots::{AxisRange, mu_axis};
use diagnosis::{Diagnosis, Forecast, Table};
use models::Condition;
use models::covariate::{self, Covariate};

/// Panels that stand side by side.
const PANELS: usize = 4;
/// Share of the passes with vibration at one pressure that the panels must hold: fewer show too little.
const COVERED: f64 = 0.4;
const PLACES: u32 = 60;
/// The abscissa, what may part the panels, the air; and as how large a share values of one level differ.
static SETTINGS: [(&Covariate, f64); 5] = [
    (&covariate::AMPLITUDE, 0.02),
    (&covariate::SPEED, SPEED),
    (&covariate::FREQUENCY, FREQUENCY),
    (&covariate::NORMAL_FORCE, FORCE),
    (&covariate::AMBIENT_PRESSURE, PRESSURE),
];

/// The table as the figures need it: `mu'` of every pass, measured and under both models, and who is suspect.
pub struct Overlay<'a> {
    /// What the table came to.
    pub result: &'a Diagnosis,
    /// The table.
    pub table: &'a Table,
    forecasts: &'a [Forecast],
    mu0: f64,
    /// Rows of the suspect passes.
    pub suspects: Vec<usize>,
}

impl<'a> Overlay<'a> {
    /// Over a diagnosed table with its forecasts. Every `mu'` is over one `mu_0`, that of the recalibrated baseline.
    pub fn new(result: &'a Diagnosis, table: &'a Table, forecasts: &'a [Forecast]) -> Self {
        let mu0 = result.fitted.problem.baseline(&result.fitted.baseline.u).mu0;
        let suspects = result.report.scatter.suspects.iter().map(|s| s.row).collect();
        Overlay { result, table, forecasts, mu0, suspects }
    }

    /// Full friction of a pass along its motion, N, with the sign of the direction.
    pub fn full(&self, pass: &Condition) -> f64 {
        pass.direction.sign() * self.mu0 * pass.normal_force_n
    }

    /// Measured less predicted over full friction, of every pass: by the recalibrated baseline and by the verdict's model.
    pub fn errors(&self) -> Vec<(f64, f64)> {
        let of = |(i, f): (usize, &Forecast)| {
            let (measured, full) = (self.table.lateral[i], self.full(&self.table.passes[i]));
            ((measured - f.recalibrated) / full, (measured - f.corrected) / full)
        };
        self.forecasts.iter().enumerate().map(of).collect()
    }

    /// The section: panels where enough passes share a base, else every pass against its predictions.
    pub fn section(&self) -> miette::Result<String> {
        let figures = self.panels()?.map_or_else(|| self.parity(), Ok)?;
        Ok(format!("<h2>Measured, and what the models say</h2>{figures}"))
    }

    fn parity(&self) -> miette::Result<String> {
        let point = |i: usize| {
            let (full, f) = (self.full(&self.table.passes[i]), &self.forecasts[i]);
            let [m, a, b] = [self.table.lateral[i], f.recalibrated, f.corrected].map(|n| n / full);
            (m, a, b, self.suspects.contains(&i))
        };
        let points: Vec<(f64, f64, f64, bool)> = (0..self.table.len()).map(point).collect();
        let text = note(
            "Each mark is a pass: on the line the model says what was measured. Left the recalibrated baseline, right the verdict's \
             model. Suspect passes are ringed.",
        );
        Ok(parity(&points)? + &text)
    }

    /// Panels by the setting that varies most besides the amplitude, at the commonest levels of the others.
    fn panels(&self) -> miette::Result<Option<String>> {
        let all: Vec<usize> =
            (0..self.table.len()).filter(|&i| self.table.passes[i].amplitude.metres() > 0.0).collect();
        let [amplitude, others @ .., pressure] = &SETTINGS;
        let driven = commonest(self.levels(&all, pressure));
        if self.levels(&driven, amplitude).len() < 3 {
            return Ok(None);
        }
        let Some(by) = others.iter().max_by_key(|c| self.levels(&driven, c).len()) else {
            return Ok(None);
        };
        let mut base = driven.clone();
        for c in others.iter().filter(|c| c.0.name != by.0.name) {
            base = commonest(self.levels(&base, c));
        }
        let mut panels: Vec<Vec<usize>> = self.levels(&base, by);
        panels.sort_by_key(|rows| std::cmp::Reverse(rows.len()));
        panels.truncate(PANELS);
        panels.retain(|rows| rows.len() >= 3);
        let shown: usize = panels.iter().map(Vec::len).sum();
        if (shown as f64) < COVERED * driven.len() as f64 {
            return Ok(None);
        }
        panels.sort_by(|a, b| {
            let of = |rows: &[usize]| by.0.of(&self.table.passes[rows[0]]).unwrap_or(0.0);
            of(a).total_cmp(&of(b))
        });
        let seen = panels.iter().flatten();
        let axis = mu_axis(seen.map(|&i| self.table.lateral[i] / self.full(&self.table.passes[i])));
        let figures: miette::Result<Vec<String>> = panels.iter().map(|rows| self.panel(rows, axis)).collect();
        let left = Some(all.len() - driven.len()).filter(|n| *n > 0);
        let left = left.map_or_else(String::new, |n| format!("; {n} at other pressures are left out"));
        let text = note(&format!(
            "{shown} of {} passes with vibration, those at the conditions that are most common{left}. Discs with bars: measured, with the standard \
             deviation of a pass. Dashes: the recalibrated baseline. Line and band: the verdict's model with twice its standard deviation. \
             Suspect passes are ringed. Both directions are shown alike.",
            all.len()
        ));
        Ok(Some(format!("<div class=\"panels\">{}</div>{text}", figures?.concat())))
    }

    /// Rows by the level of a setting, rising; those without a value share one.
    fn levels(&self, rows: &[usize], (c, within): &(&Covariate, f64)) -> Vec<Vec<usize>> {
        let of = |i: &usize| c.of(&self.table.passes[*i]).unwrap_or(0.0);
        let levels = Levels::of(rows.iter().map(of), *within);
        let mut all = vec![Vec::new(); levels.count()];
        rows.iter().for_each(|i| all[levels.index(of(i))].push(*i));
        all
    }

    fn panel(&self, rows: &[usize], axis: [f64; 2]) -> miette::Result<String> {
        let x = &covariate::AMPLITUDE;
        let passes = &self.table.passes;
        let shown = |i: usize| x.shown.0 * x.of(&passes[i]).unwrap_or(0.0);
        let span = AxisRange::from_zero(rows.iter().map(|&i| shown(i)));
        let typical = passes[rows[rows.len() / 2]];
        let places: Vec<f64> = span.places(PLACES).collect();
        let at = |place: &f64| {
            let mut condition = typical;
            x.put(&mut condition, place / x.shown.0);
            condition
        };
        let curve = self.result.curve(&places.iter().map(at).collect::<Vec<_>>());
        let full = self.full(&typical);
        let of = |value: fn(&Forecast) -> f64| {
            let values = curve.iter().map(|f| (value(f) / full, f.corrected_sd / full.abs()));
            // A base law that cannot tell leaves the curve out.
            places.iter().zip(values).map(|(x, (v, sd))| (*x, v, sd)).filter(|p| p.1.is_finite()).collect()
        };
        let point = |&i: &usize| Seen {
            x: shown(i),
            before: self.table.lateral[i] / self.full(&passes[i]),
            after: self.result.fitted.problem.whole_variance(i).sqrt() / self.full(&passes[i]).abs(),
            suspect: self.suspects.contains(&i),
        };
        let points: Vec<Seen> = rows.iter().map(point).collect();
        overlay(
            &settings(SETTINGS[1..].iter().map(|c| c.0), &typical),
            (&titled(x), span),
            &points,
            &of(|f| f.recalibrated),
            &of(|f| f.corrected),
            axis,
        )
    }
}

fn commonest(levels: Vec<Vec<usize>>) -> Vec<usize> {
    levels.into_iter().max_by_key(Vec::len).unwrap_or_default()
}

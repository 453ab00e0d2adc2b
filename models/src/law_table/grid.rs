//! The grid on which a foreign law is tabulated, and the check of the table against fresh calls.

use super::{ANSWERS, LawTable, Variable};
use crate::condition::Condition;
use std::fmt::Write;

/// Nodes that are evaluated a second time: a law that answers differently then is not a function of its
/// variables.
const AGAIN: usize = 16;

/// Nodes of each variable, in the order of [`super::VARIABLES`].
#[derive(Clone, Debug)]
pub struct LawGrid {
    axes: Vec<(&'static Variable, Vec<f64>)>,
}

/// A table that was made of answers.
#[derive(Clone, Debug)]
pub struct Tabulated {
    /// CSV with its header row, the root mean square interpolation error in the uncertainty.
    pub csv: String,
    /// Greatest difference of table and fresh calls in mu'.
    pub greatest: f64,
    /// Where it is, in words.
    pub place: String,
    /// Root mean square of the differences.
    pub rms: f64,
    /// Number of fresh calls.
    pub checks: usize,
}

impl LawGrid {
    /// A grid from `NAME=LOW..HIGH:COUNT`, with `:log` for equal ratios, one word a variable.
    ///
    /// # Errors
    /// The word that is none, with what is needed.
    pub fn parse<'a>(words: impl IntoIterator<Item = &'a str>) -> Result<LawGrid, String> {
        let one = |word: &'a str| {
            let parsed = || {
                let (name, rest) = word.split_once('=')?;
                let (rest, log) = rest.strip_suffix(":log").map_or((rest, false), |rest| (rest, true));
                let (ends, count) = rest.rsplit_once(':')?;
                let (low, high) = ends.split_once("..")?;
                let (low, high, count): (f64, f64, usize) =
                    (low.trim().parse().ok()?, high.trim().parse().ok()?, count.trim().parse().ok()?);
                let node = |i: usize| match (i, i as f64 / (count.max(2) - 1) as f64) {
                    (i, _) if i + 1 == count => high,
                    (_, share) if log => low * (high / low).powf(share),
                    (_, share) => low + share * (high - low),
                };
                Some((name.trim(), (0..count.min(super::MOST_ROWS + 1)).map(node).collect()))
            };
            parsed().ok_or_else(|| {
                format!("grid '{word}': NAME=LOW..HIGH:COUNT or NAME=LOW..HIGH:COUNT:log is needed")
            })
        };
        Self::of(&words.into_iter().map(one).collect::<Result<Vec<_>, _>>()?)
    }

    /// A grid from the nodes of each variable.
    ///
    /// # Errors
    /// A name that is no variable, nodes that do not rise or are out of range, too many nodes.
    pub fn of(axes: &[(&str, Vec<f64>)]) -> Result<LawGrid, String> {
        let mut sorted = Vec::new();
        for variable in &super::VARIABLES {
            let mut own = axes.iter().filter(|a| a.0 == variable.name);
            let (Some((name, nodes)), twice) = (own.next(), own.next()) else { continue };
            if twice.is_some() {
                return Err(format!("grid: '{name}' is given twice"));
            }
            if nodes.len() < 2 || !nodes.windows(2).all(|w| w[0] < w[1]) {
                return Err(format!("grid: '{name}' needs two or more values that rise"));
            }
            if let Some(value) = nodes.iter().find(|v| !variable.admits(**v)) {
                return Err(format!("grid: {name} = {value}: {} is needed", variable.needed));
            }
            sorted.push((variable, nodes.clone()));
        }
        if let Some((name, _)) = axes.iter().find(|a| Variable::by_name(a.0).is_none()) {
            let names: Vec<_> = super::VARIABLES[..super::OF_LAWS].iter().map(|v| v.name).collect();
            return Err(format!("grid: no variable '{name}'; there are {}", names.join(", ")));
        }
        let size = sorted.iter().map(|a| a.1.len()).fold(1, usize::saturating_mul);
        if sorted.is_empty() || size > super::MOST_ROWS {
            let most = super::MOST_ROWS;
            return Err(format!("grid: {size} nodes; one variable at least, and {most} nodes at most"));
        }
        Ok(LawGrid { axes: sorted })
    }

    /// Columns of the conditions.
    pub fn columns(&self) -> Vec<&'static str> {
        self.axes.iter().map(|a| a.0.name).collect()
    }

    fn size(&self) -> usize {
        self.axes.iter().map(|a| a.1.len()).product()
    }

    fn node(&self, index: usize) -> Vec<f64> {
        let mut rest = index;
        let value = |(_, nodes): &(&Variable, Vec<f64>)| {
            let at = rest % nodes.len();
            rest /= nodes.len();
            nodes[at]
        };
        let mut row: Vec<f64> = self.axes.iter().rev().map(value).collect();
        row.reverse();
        row
    }

    /// A place between nodes: a Kronecker sequence over the grid. Of four, one is moved to the middle of its
    /// cell and one to the middle along one axis, at nodes of the others: a multilinear table errs most
    /// there, where the axes' errors may cancel.
    fn between(&self, number: usize) -> Vec<f64> {
        let power = 1.0 / (self.axes.len() + 1) as f64;
        let root = (0..60).fold(2.0_f64, |x, _| (1.0 + x).powf(power));
        let place = |(d, (_, nodes)): (usize, &(&Variable, Vec<f64>))| {
            let last = (nodes.len() - 1) as f64;
            let at = (0.5 + (number + 1) as f64 / root.powi(d as i32 + 1)).fract() * last;
            let cell = (at as usize).min(nodes.len() - 2);
            let share = match number % 4 {
                1 => 0.5,
                3 if number / 4 % self.axes.len() == d => 0.5,
                3 => (at - cell as f64).round(),
                _ => at - cell as f64,
            };
            nodes[cell] + share * (nodes[cell + 1] - nodes[cell])
        };
        self.axes.iter().enumerate().map(place).collect()
    }

    /// All conditions in the order of the wanted answers: the nodes, `checks` places between them, some nodes
    /// again.
    pub fn conditions(&self, checks: usize) -> Vec<Vec<f64>> {
        let again = (0..AGAIN.min(self.size())).map(|i| self.node(i * self.size() / AGAIN.min(self.size())));
        let nodes = (0..self.size()).map(|i| self.node(i));
        nodes.chain((0..checks).map(|n| self.between(n))).chain(again).collect()
    }

    /// The table from the answers to [`LawGrid::conditions`]: mu' and its standard uncertainty of each.
    ///
    /// # Errors
    /// Answers that are too few, or that no law table may have: the condition and what is needed.
    pub fn table(&self, checks: usize, answers: &[[f64; 2]]) -> Result<Tabulated, String> {
        let conditions = self.conditions(checks);
        if answers.len() != conditions.len() {
            return Err(format!("{} answers to {} conditions", answers.len(), conditions.len()));
        }
        for (row, answer) in conditions.iter().zip(answers) {
            for ((name, [low, high]), value) in ANSWERS.iter().zip(answer) {
                if !(value >= low && value <= high) {
                    let place = self.words(row);
                    return Err(format!("{name} is {value} at {place}: {low} to {high} is needed"));
                }
            }
        }
        let (nodes, fresh) = answers.split_at(self.size());
        let csv = |extra: f64| {
            let mut text = format!("{},mu_relative,mu_relative_sd\n", self.columns().join(","));
            for (row, [mu, sd]) in conditions.iter().zip(nodes) {
                for value in row {
                    let _ = write!(text, "{value:e},");
                }
                let _ = writeln!(text, "{mu:e},{:e}", sd.hypot(extra).min(ANSWERS[1].1[1]));
            }
            text
        };
        let law = LawTable::from_csv(&csv(0.0)).map_err(|e| format!("the answers make no law table: {e}"))?;
        let (mut greatest, mut place, mut square) = (0.0, String::new(), 0.0);
        for (row, [mu, _]) in conditions[self.size()..].iter().zip(fresh) {
            let mut condition = Condition::paper();
            self.axes.iter().zip(row).for_each(|((variable, _), v)| variable.put(&mut condition, *v));
            let error = law.at(&condition).map_err(|e| e.to_string())?[0] - mu;
            square += error * error;
            if error.abs() >= greatest {
                (greatest, place) = (error.abs(), self.words(row));
            }
        }
        let rms = (square / fresh.len().max(1) as f64).sqrt();
        Ok(Tabulated { csv: csv(rms), greatest, place, rms, checks: fresh.len() })
    }

    fn words(&self, row: &[f64]) -> String {
        let one = |((v, _), x): (&(&Variable, Vec<f64>), &f64)| format!("{} = {x:.4e}", v.name);
        self.axes.iter().zip(row).map(one).collect::<Vec<_>>().join(", ")
    }
}

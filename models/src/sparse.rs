//! The surrogate of `muprime model adapt` as a law: a sparse grid of the ridge model over the variables that
//! it spans.
//!
//! A condition's variable that the surrogate does not span is fixed; the law answers near that value only.

use crate::condition::{Condition, OutOfDomain};
use crate::finger::Finger;
use crate::law_table::{OF_LAWS, VARIABLES, prediction};
use crate::prediction::{FrictionModel, Prediction};
use crate::quantity::PeakToPeak;
use crate::surrogate::MESH_ERROR;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Most nodes: each prediction reads them all, and a cycle of the loop waits for it.
const MOST_NODES: usize = 20_000;
/// Share by which a fixed variable may differ.
const FIXED_WITHIN: f64 = 0.05;
const MODULUS: &str = "young_modulus_pa";

#[derive(Deserialize)]
struct Span {
    low: f64,
    high: f64,
    #[serde(default)]
    log: bool,
}

#[derive(Deserialize)]
struct Node {
    steps: Vec<(u8, u32)>,
    surplus: f64,
}

#[derive(Deserialize)]
struct Nodes {
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Round {
    rms: f64,
}

/// `surrogate.json`, schema `muprime.adaptive/1`.
#[derive(Deserialize)]
struct Document {
    schema: String,
    variables: BTreeMap<String, Span>,
    set: BTreeMap<String, f64>,
    rounds: Vec<Round>,
    grid: Nodes,
}

/// Where the value along an axis comes from.
enum Source {
    Variable(usize),
    Fixed(f64),
}

/// The law.
pub struct Sparse {
    axes: Vec<(Source, Span)>,
    /// Variables that are not spanned, by their place among [`VARIABLES`], with their value.
    fixed: Vec<(usize, f64)>,
    /// Level and index of each node along each axis, node by node.
    steps: Vec<(u8, u32)>,
    surplus: Vec<f64>,
    sd: f64,
}

/// Pflueger's modified linear basis of a sparse grid at a place between 0 and 1, by level and index.
pub fn basis((level, index): (u8, u32), x: f64) -> f64 {
    let scaled = f64::from(1_u32 << level);
    if level == 1 {
        1.0
    } else if index == 1 {
        (2.0 - scaled * x).max(0.0)
    } else if index == (1 << level) - 1 {
        (2.0 - scaled * (1.0 - x)).max(0.0)
    } else {
        (1.0 - (scaled * x - f64::from(index)).abs()).max(0.0)
    }
}

impl Sparse {
    /// Reads `surrogate.json` for a finger.
    ///
    /// # Errors
    /// Text that is none, a variable that neither a pass nor the finger states, too many nodes: with the
    /// remedy.
    pub fn from_json(text: &str, finger: &Finger) -> Result<Sparse, String> {
        let document: Document = serde_json::from_str(text).map_err(|e| format!("no surrogate.json: {e}"))?;
        if document.schema != "muprime.adaptive/1" {
            return Err(format!("schema '{}'; this version reads 'muprime.adaptive/1'", document.schema));
        }
        let last = document.rounds.last();
        let error = last.ok_or("no round has measured its error; run `muprime model adapt` again")?.rms;
        let (count, dimensions) = (document.grid.nodes.len(), document.variables.len());
        if count == 0 || count > MOST_NODES {
            let why = "are read, as the loop waits for each (--nodes)";
            return Err(format!("{count} nodes; 1 to {MOST_NODES} {why}"));
        }
        let place = |name: &str| VARIABLES[..OF_LAWS].iter().position(|v| v.name == name);
        let mut axes = Vec::new();
        for (name, span) in document.variables {
            let source = match (place(&name), finger.young_modulus_pa) {
                (Some(variable), _) => Source::Variable(variable),
                (None, Some(modulus)) if name == MODULUS && modulus >= span.low && modulus <= span.high => {
                    Source::Fixed(modulus)
                }
                _ if name == MODULUS => {
                    return Err(format!(
                        "{MODULUS} spans {:e} to {:e}, and the finger states none in it; state it in rig.toml or setup",
                        span.low, span.high
                    ));
                }
                _ => {
                    let remedy = format!("fix it: `muprime model adapt --set {name}=VALUE`");
                    return Err(format!("no pass states '{name}'; {remedy}"));
                }
            };
            if !(span.low < span.high && (!span.log || span.low > 0.0)) {
                return Err(format!("variable '{name}' has no range"));
            }
            axes.push((source, span));
        }
        let nominal = Condition::paper();
        let spanned = |k: usize| axes.iter().any(|(s, _)| matches!(s, Source::Variable(v) if *v == k));
        let value =
            |k: usize| document.set.get(VARIABLES[k].name).copied().unwrap_or(VARIABLES[k].of(&nominal));
        let fixed = (0..OF_LAWS).filter(|k| !spanned(*k)).map(|k| (k, value(k))).collect();
        let (mut steps, mut surplus) = (Vec::new(), Vec::new());
        for node in document.grid.nodes {
            let odd = |s: &(u8, u32)| (1..=20).contains(&s.0) && s.1 % 2 == 1 && s.1 < 1 << s.0;
            if node.steps.len() != dimensions || !node.surplus.is_finite() || !node.steps.iter().all(odd) {
                return Err(format!("node {}: no node of {dimensions} variables", surplus.len() + 1));
            }
            steps.extend(node.steps);
            surplus.push(node.surplus);
        }
        Ok(Sparse { axes, fixed, steps, surplus, sd: error.hypot(MESH_ERROR) })
    }

    /// mu' at a condition. Allocates nothing.
    ///
    /// # Errors
    /// A condition outside what the surrogate spans, by the first variable that is.
    pub fn at(&self, condition: &Condition) -> Result<f64, OutOfDomain> {
        for (k, value) in &self.fixed {
            let found = VARIABLES[*k].of(condition);
            let needed = "a value within 5 % of the one at which the surrogate was made";
            let far = (found / value - 1.0).abs() > FIXED_WITHIN;
            OutOfDomain::unless(!far, VARIABLES[*k].name, found, needed)?;
        }
        let mut place = [0.0; OF_LAWS + 1];
        for ((source, span), place) in self.axes.iter().zip(&mut place) {
            let (value, name) = match source {
                Source::Variable(k) => (VARIABLES[*k].of(condition), VARIABLES[*k].name),
                Source::Fixed(value) => (*value, MODULUS),
            };
            let share = if span.log {
                (value / span.low).ln() / (span.high / span.low).ln()
            } else {
                (value - span.low) / (span.high - span.low)
            };
            let spanned = (-1e-9..=1.0 + 1e-9).contains(&share);
            OutOfDomain::unless(spanned, name, value, "a value that the surrogate spans")?;
            *place = share.clamp(0.0, 1.0);
        }
        let mut sum = 0.0;
        for (steps, surplus) in self.steps.chunks_exact(self.axes.len().max(1)).zip(&self.surplus) {
            let mut product = *surplus;
            for (step, x) in steps.iter().zip(&place) {
                product *= basis(*step, *x);
                if product == 0.0 {
                    break;
                }
            }
            sum += product;
        }
        Ok(sum.clamp(0.0, 1.0))
    }
}

impl FrictionModel for Sparse {
    fn name(&self) -> &str {
        "adaptive surrogate"
    }

    fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain> {
        condition.check()?;
        let still = condition.amplitude == PeakToPeak::ZERO;
        Ok(prediction(condition, if still { [1.0, 0.0] } else { [self.at(condition)?, self.sd] }))
    }

    fn form_sd(&self, of: &Prediction) -> f64 {
        of.mu_relative_sd
    }
}

//! What the edges in a run's record say of time: how late the lateral force comes, as a lag or as a delay.
//!
//! An edge is a change of the amplitude, or a turn of the stage, while the finger slides. The contact's own
//! response is known: friction follows the amplitude by the law, and the finger on its compliant holder
//! sticks until it is stretched. What the channel shows later than that, behind its stated filter, is the
//! sensor's or the clock's. Each edge has its own level, size and drift, so a cause which changes friction
//! changes no time.

mod fit;
mod response;
#[cfg(test)]
mod tests;

use fit::{ResponseFit, TimingRegression};
use models::{Condition, FrictionModel};
use response::Prepared;
pub use response::{ResponseForm, mean_delay_s};
use serde::Serialize;

/// Edges below which nothing is judged: their scatter is part of the answer.
const FEWEST: usize = 4;
/// Error of a delay that is none of noise, s: the form of the ring-up, steps of the clocks.
const FORM_SD_S: f64 = 1.5e-4;
/// The same of a lag as a share of it: an edge begins before the one before it has died away.
const LAG_SHARE: f64 = 0.01;
/// How much friction near standstill may differ from that while the finger slides. At a turn this moves the
/// time at which the contact slides again.
const STANDSTILL: f64 = 0.1;
/// Prior of a delay's size: median, s, and standard deviation of the logarithm; as in the library of effects.
const PRIOR: [f64; 2] = [0.01, 1.0];
/// Logarithm to the base 10 of the odds from which a delay is claimed.
const CLAIMED: f64 = 2.0;
/// Probability from which lag or delay is named.
const NAMED: f64 = 0.9;

/// What the lateral force is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// The plate's amplitude as read back, at steps of the drive.
    Amplitude,
    /// The stage's motion, at turns.
    Position,
}

/// One edge of a record.
#[derive(Debug, Clone)]
pub struct Edge {
    /// What it is a change of.
    pub against: Against,
    /// The condition; its amplitude plays no part.
    pub condition: Condition,
    /// Times from the command, s, and lateral forces along the motion before the edge, N.
    pub lateral: Vec<(f64, f64)>,
    /// Times and amplitudes as read back, m peak-to-peak.
    pub amplitude: Vec<(f64, f64)>,
    /// Times and velocities along the motion before the edge, m/s.
    pub velocity: Vec<(f64, f64)>,
}

/// What the edges of one kind say.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct TimingComparison {
    /// What the lateral force is compared with.
    pub against: Against,
    /// Edges that it rests on.
    pub edges: usize,
    /// How much later than the channel's stated filter the lateral force comes, s: the mean delay. None
    /// where nothing could be judged.
    pub late_s: Option<f64>,
    /// 95 % interval of it, s.
    pub ci95_s: Option<[f64; 2]>,
    /// Odds against no lateness, as a logarithm to the base 10.
    pub log10_odds_vs_none: Option<f64>,
    /// `sensor_lag`, `time_misalignment`, both where the edges cannot separate them; empty where no
    /// lateness is shown.
    pub causes: Vec<&'static str>,
    /// Each form with its probability among the three, and its own mean delay, s.
    pub forms: Vec<FormNote>,
    /// Why nothing could be judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub because: Option<String>,
    /// In words.
    pub text: String,
    /// Mean over the edges, for a figure: time, s, and the share of the change that was measured, expected
    /// in time, and found.
    #[serde(skip)]
    pub mean: Vec<[f64; 4]>,
}

/// A form of lateness.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FormNote {
    /// Which.
    pub form: ResponseForm,
    /// Probability among the forms.
    pub probability: f64,
    /// Mean delay, s.
    pub late_s: f64,
    /// Its standard deviation, s.
    pub sd_s: f64,
}

/// What a record's edges say.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct RecordPart {
    /// Bandwidth of the lateral channel's filter by its profile, Hz; none: nothing is stated, and all
    /// lateness is found.
    pub stated_passband_hz: Option<f64>,
    /// Against the amplitude, then against the position.
    pub comparisons: Vec<TimingComparison>,
}

impl RecordPart {
    /// Whether any comparison could be made.
    pub fn is_judged(&self) -> bool {
        self.comparisons.iter().any(|c| c.late_s.is_some())
    }
}

/// Judges the edges of a record under a law and the stated bandwidth of the lateral channel.
pub fn judge(edges: &[Edge], law: &dyn FrictionModel, stated_passband_hz: Option<f64>) -> RecordPart {
    let stated_s = stated_passband_hz.map_or(0.0, mean_delay_s);
    let one = |against: Against| {
        let own: Vec<&Edge> = edges.iter().filter(|e| e.against == against).collect();
        let prepared: Vec<Prepared> = own.iter().filter_map(|e| Prepared::of(e, law)).collect();
        if prepared.len() >= FEWEST {
            compared(against, &prepared, stated_s)
        } else {
            none(against, own.len(), prepared.len())
        }
    };
    RecordPart { stated_passband_hz, comparisons: [Against::Amplitude, Against::Position].map(one).to_vec() }
}

fn none(against: Against, all: usize, visible: usize) -> TimingComparison {
    let what = match against {
        Against::Amplitude => "steps of the amplitude while the finger slides",
        Against::Position => "turns of the stage under load",
    };
    let because = match all {
        0 => format!("the record holds no {what}; a series of the plan with `edges = 3` makes them"),
        _ => format!("{visible} of {all} {what} show a change of friction; at least {FEWEST} are needed"),
    };
    let text = format!("{}: not judged. {because}", title(against));
    TimingComparison {
        against,
        edges: visible,
        late_s: None,
        ci95_s: None,
        log10_odds_vs_none: None,
        causes: Vec::new(),
        forms: Vec::new(),
        because: Some(because),
        text,
        mean: Vec::new(),
    }
}

/// What is compared, in words.
pub fn title(against: Against) -> &'static str {
    match against {
        Against::Amplitude => "lateral force against the plate's amplitude",
        Against::Position => "lateral force against the stage's motion",
    }
}

fn compared(against: Against, edges: &[Prepared], stated_s: f64) -> TimingComparison {
    let problem = TimingRegression { edges, stated_s };
    let fits = ResponseForm::ALL.map(|form| (form, problem.fit(form, false)));
    let best = fits.iter().min_by(|a, b| a.1.squares.total_cmp(&b.1.squares)).expect("three forms");
    let variance = best.1.squares / problem.freedom();
    // Residuals within an edge are no independent witnesses: they count as far as edges repeat.
    let weight = |fit: &ResponseFit| (-0.5 * best.1.counts * (fit.squares - best.1.squares) / variance).exp();
    let total: f64 = fits.iter().map(|(_, fit)| weight(fit)).sum();
    let turned = |fit: &ResponseFit| match against {
        Against::Amplitude => 0.0,
        Against::Position => STANDSTILL * edges[0].stretching_s(fit.stiffness),
    };
    let forms: Vec<FormNote> = fits
        .iter()
        .map(|(form, fit)| FormNote {
            form: *form,
            probability: weight(fit) / total,
            late_s: fit.late_s,
            sd_s: match form {
                ResponseForm::Delay => fit.sd_s.hypot(FORM_SD_S),
                _ => fit.sd_s.hypot(FORM_SD_S).hypot(LAG_SHARE * fit.late_s),
            }
            .hypot(turned(fit)),
        })
        .collect();
    let late_s: f64 = forms.iter().map(|f| f.probability * f.late_s).sum();
    let between: f64 =
        forms.iter().map(|f| f.probability * (f.sd_s.powi(2) + (f.late_s - late_s).powi(2))).sum();
    let sd_s = between.sqrt();
    let odds = log_odds(late_s, sd_s) / std::f64::consts::LN_10;
    let lag: f64 = forms.iter().filter(|f| f.form != ResponseForm::Delay).map(|f| f.probability).sum();
    let causes = match (odds >= CLAIMED, lag) {
        (false, _) => Vec::new(),
        (true, lag) if lag >= NAMED => vec!["sensor_lag"],
        (true, lag) if 1.0 - lag >= NAMED => vec!["time_misalignment"],
        _ => vec!["sensor_lag", "time_misalignment"],
    };
    let ci95_s = [late_s - 1.96 * sd_s, late_s + 1.96 * sd_s];
    let text = text(against, edges.len(), late_s, ci95_s, odds, &causes);
    TimingComparison {
        against,
        edges: edges.len(),
        late_s: Some(late_s),
        ci95_s: Some(ci95_s),
        log10_odds_vs_none: Some(odds),
        causes,
        forms,
        because: None,
        text,
        mean: mean_edge(&problem, best.0, &best.1),
    }
}

/// Log odds of a delay with a log-normal size against none, for a normal estimate.
fn log_odds(late_s: f64, sd_s: f64) -> f64 {
    let density = |t: f64| {
        let z = (t.abs() / PRIOR[0]).ln() / PRIOR[1];
        (-0.5 * z * z).exp() / (t.abs() * PRIOR[1] * (2.0 * std::f64::consts::PI).sqrt())
    };
    // The prior hardly varies within an estimate that tells anything; below that its mass near zero counts.
    let wide = (2.0 * std::f64::consts::PI).sqrt() * sd_s;
    0.5 * (late_s / sd_s).powi(2) + (0.5 * density(late_s.abs().max(sd_s)) * wide).ln()
}

fn text(
    against: Against,
    edges: usize,
    late: f64,
    [low, high]: [f64; 2],
    odds: f64,
    causes: &[&str],
) -> String {
    let title = title(against);
    let [late, low, high] = [late, low, high].map(|s| 1e3 * s);
    if causes.is_empty() {
        return format!(
            "{title}: no lag or shift in time is shown by {edges} edges (95 %: {low:.2} to {high:.2} ms beyond the stated filter)"
        );
    }
    let odds = if odds > 6.0 { "above 10^6".into() } else { format!("{:.0}", 10f64.powf(odds)) };
    let causes = causes.join(" or ").replace('_', " ");
    format!(
        "{title}: {late:.2} ms late (95 %: {low:.2} to {high:.2}), {causes}; odds {odds} to 1 against none, from {edges} edges"
    )
}

/// The mean edge in shares of its change, in bins of 2 ms.
fn mean_edge(problem: &TimingRegression<'_>, form: ResponseForm, fit: &ResponseFit) -> Vec<[f64; 4]> {
    const BIN_S: f64 = 2e-3;
    let expected = problem.fit(ResponseForm::Delay, true);
    let mut bins: std::collections::BTreeMap<i64, [f64; 4]> = std::collections::BTreeMap::new();
    for edge in problem.edges {
        let [before, behind] = edge.levels;
        let share = |f: f64| (f - before) / (behind - before);
        let in_time = edge.shown(expected.stiffness, problem.stated_s, ResponseForm::Delay, 0.0);
        let found = edge.shown(fit.stiffness, problem.stated_s, form, fit.late_s);
        for ((sample, a), b) in edge.lateral.iter().zip(in_time).zip(found) {
            let bin = bins.entry((sample.0 / BIN_S).floor() as i64).or_default();
            for (sum, value) in bin.iter_mut().zip([share(sample.1), share(a), share(b), 1.0]) {
                *sum += value;
            }
        }
    }
    let mean = |(bin, [measured, in_time, found, n]): (i64, [f64; 4])| {
        [(bin as f64 + 0.5) * BIN_S, measured / n, in_time / n, found / n]
    };
    bins.into_iter().map(mean).collect()
}

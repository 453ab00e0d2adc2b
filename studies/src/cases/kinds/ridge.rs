//! One case of the finite element model a case: listed, or drawn evenly from a box of up to ten variables.

use super::{Case, CaseKind, Cell, Column, count, flag, number};
use crate::cases::file::Header;
use miette::IntoDiagnostic;
use models::PeakToPeak;
use models::ridge::{self, RidgeCase, RunSettings, Steady, case, study};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The kind.
pub const KIND: CaseKind = CaseKind {
    name: "ridge",
    words: "a case of the finite element model, as `muprime model ridge` runs it",
    model: study::MODEL_VERSION,
    columns: &COLUMNS,
    prepare,
};

/// What can be varied: the first ten columns, each with how it is set. The force comes first, as the mean pressure goes with it.
pub const VARIABLES: [&str; 10] = [
    "normal_force_n",
    "mean_pressure_pa",
    "amplitude_pp_m",
    "frequency_hz",
    "speed_m_s",
    "mu0",
    "young_modulus_pa",
    "retardation_time_s",
    "penalty_ratio",
    "mass_damping_per_s",
];

const COLUMNS: [Column; 18] = [
    number(VARIABLES[0], "normal force on the whole finger"),
    number(VARIABLES[1], "mean pressure of the gross contact"),
    number(VARIABLES[2], "peak-to-peak amplitude of the plate"),
    number(VARIABLES[3], "frequency of the vibration"),
    number(VARIABLES[4], "sliding speed"),
    number(VARIABLES[5], "coefficient of friction without vibration"),
    number(VARIABLES[6], "modulus of the stratum corneum"),
    number(VARIABLES[7], "retardation time of the tissue"),
    number(VARIABLES[8], "contact penalty over the modulus"),
    number(VARIABLES[9], "mass damping, 1/s"),
    number("mu_relative", "mu'"),
    number("mu_relative_sd", "its standard error over the cycles"),
    number("reaction_over_load", "mean reaction force over the applied one"),
    number("contact_fraction", "share of the time in contact"),
    number("phase_shift_deg", "phase shift of Eq. 1; missing without vibration"),
    flag("period_doubled", "whether the contact repeats every second cycle only"),
    flag("steady", "whether the cycles became steady"),
    count("cycles", "cycles run at full amplitude"),
];

/// From where to where a variable is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValueRange {
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// Whether evenly in the logarithm.
    #[serde(default)]
    pub log: bool,
}

impl ValueRange {
    /// The value at a place, 0 to 1.
    pub fn at(&self, place: f64) -> f64 {
        if self.log {
            self.low * (self.high / self.low).powf(place)
        } else {
            self.low + place * (self.high - self.low)
        }
    }
}

/// What all cases share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RidgeSettings {
    /// Elements of the mesh, about.
    pub elements: usize,
    /// When a case ends.
    pub steady: Steady,
    /// Variables that differ from the paper's nominal case in all cases.
    pub base: BTreeMap<String, f64>,
    /// Variables that are drawn; none where the cases are listed.
    pub spans: BTreeMap<String, ValueRange>,
    /// Number of the first draw, from 1: other draws are other cases of the same box.
    pub first: u64,
    /// What all cases start from where that is not the paper's nominal case; `elements` is then of it too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub case: Option<RidgeCase>,
}

impl Default for RidgeSettings {
    fn default() -> Self {
        let (base, spans) = Default::default();
        Self { elements: case::ELEMENTS, steady: Steady::default(), base, spans, first: 1, case: None }
    }
}

impl RidgeSettings {
    /// Refuses a variable that is both shared and drawn, and a span beyond what a ridge can have.
    pub fn check_spans(&self) -> miette::Result<()> {
        for (name, ValueRange { low, high, .. }) in &self.spans {
            let shared = self.base.contains_key(name);
            miette::ensure!(!shared, help = "leave out one of the two", "{name} is in --set and in --span");
            for end in [low, high] {
                let case = set(set(RidgeCase::paper(), &self.base)?, &[(name.clone(), *end)].into())?;
                let help = "state SI units: an amplitude of 2 um is 2e-6, in m peak-to-peak";
                case.check().map_err(|why| miette::miette!(help = help, "--span {name}: {why}"))?;
            }
        }
        Ok(())
    }
}

/// Sets variables in the order of [`VARIABLES`].
///
/// # Errors
/// A name that is none of them.
pub fn set(mut case: RidgeCase, values: &BTreeMap<String, f64>) -> miette::Result<RidgeCase> {
    if let Some(unknown) = values.keys().find(|name| !VARIABLES.contains(&name.as_str())) {
        miette::bail!("no variable '{unknown}' of a ridge: there are {}", VARIABLES.join(", "));
    }
    for name in VARIABLES {
        let Some(value) = values.get(name).copied() else { continue };
        match name {
            "normal_force_n" => case = case.with_normal_force_n(value),
            "mean_pressure_pa" => case.mean_pressure_pa = value,
            "amplitude_pp_m" => case.amplitude = PeakToPeak::from_metres(value),
            "frequency_hz" => case.frequency_hz = value,
            "speed_m_s" => case.speed_m_s = value,
            "mu0" => case.mu0 = value,
            "young_modulus_pa" => case.young_modulus_pa = value,
            "retardation_time_s" => case.retardation_time_s = value,
            "penalty_ratio" => case.penalty_ratio = value,
            _ => case.mass_damping_per_s = value,
        }
    }
    Ok(case)
}

/// What a line states of a case: each of [`VARIABLES`].
pub fn line_of(case: &RidgeCase) -> serde_json::Value {
    let entry = |(name, value): (&str, f64)| (name.to_string(), serde_json::Value::from(value));
    VARIABLES.into_iter().zip(values(case)).map(entry).collect()
}

/// The values of [`VARIABLES`] in a case.
fn values(c: &RidgeCase) -> [f64; 10] {
    [
        c.normal_force_n,
        c.mean_pressure_pa,
        c.amplitude.metres(),
        c.frequency_hz,
        c.speed_m_s,
        c.mu0,
        c.young_modulus_pa,
        c.retardation_time_s,
        c.penalty_ratio,
        c.mass_damping_per_s,
    ]
}

/// All that a run depends on.
pub fn inputs_of(case: &RidgeCase, settings: &RunSettings) -> String {
    let case = serde_json::to_string(case).unwrap_or_default();
    let steady = serde_json::to_string(&settings.steady).unwrap_or_default();
    format!("{case} {steady} {:?}", settings.step_s.map(f64::to_bits))
}

/// The `n`th place of a low-discrepancy sequence (Kronecker's, with powers of the root of x^(d+1) = x + 1), from 1.
pub fn kronecker(n: u64, dimensions: usize) -> Vec<f64> {
    let d = dimensions as i32;
    let mut root = 1.5_f64;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / f64::from(d + 1));
    }
    (1..=d).map(|k| (0.5 + n as f64 * root.powi(-k)).fract()).collect()
}

fn prepare(header: &Header, _: &std::path::Path) -> miette::Result<super::Make> {
    let settings: RidgeSettings = super::settings(header)?;
    let start = settings.case.unwrap_or(RidgeCase { elements: settings.elements, ..RidgeCase::paper() });
    let base = set(start, &settings.base)?;
    if header.listed != settings.spans.is_empty() {
        miette::bail!("ridge cases are either listed or drawn from `spans`");
    }
    base.check().into_diagnostic()?;
    base.geometry.mesh(base.materials(), base.elements).into_diagnostic()?;
    for (name, &ValueRange { low, high, log }) in &settings.spans {
        if !(low < high && (!log || low > 0.0)) {
            miette::bail!(
                "span of {name}: {low} to {high}: from a lower to a higher value, above 0 in the logarithm"
            );
        }
    }
    let run_settings = RunSettings { steady: settings.steady, energy: false, ..RunSettings::default() };
    Ok(Box::new(move |index, given| {
        let changed: BTreeMap<String, f64> = match given {
            Some(_) => super::line(index, given)?,
            None => {
                let places = kronecker(settings.first + index, settings.spans.len());
                let drawn = settings.spans.iter().zip(places);
                drawn.map(|((name, span), place)| (name.clone(), span.at(place))).collect()
            }
        };
        let case = set(base, &changed)?;
        let run = move || {
            let run = ridge::run(&case, &run_settings).map_err(|why| why.to_string())?;
            let mut cells: Vec<Cell> = values(&case).into_iter().map(Cell::Number).collect();
            cells.extend([
                run.mu_relative.into(),
                run.mu_relative_sd.into(),
                (run.mean_reaction_force_n / case.normal_force_n).into(),
                run.contact_fraction.into(),
                run.phase_shift_deg.into(),
                run.period_doubled.into(),
                run.steady.into(),
                Cell::Count(run.cycles as u64),
            ]);
            Ok(cells)
        };
        Ok(Case { inputs: inputs_of(&case, &run_settings), run: Box::new(run) })
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_fill_the_box_evenly() {
        // Star discrepancy over boxes from the corner, of 4096 draws in 8 dimensions: far below the 1/sqrt(n) of chance at the median.
        let draws: Vec<Vec<f64>> = (1..=4096).map(|n| kronecker(n, 8)).collect();
        let mut worst = 0.0_f64;
        for corner in (1..200).map(|n| kronecker(10_000 + n, 8)) {
            let inside = draws.iter().filter(|p| p.iter().zip(&corner).all(|(a, b)| a < b)).count();
            let volume: f64 = corner.iter().product();
            worst = worst.max((inside as f64 / 4096.0 - volume).abs());
        }
        assert!(worst < 0.6 / 64.0, "{worst}");
    }

    #[test]
    fn the_force_carries_its_pressure_unless_that_is_given() {
        let both = |list: &[(&str, f64)]| {
            let values = list.iter().map(|(n, v)| (n.to_string(), *v)).collect();
            set(RidgeCase::paper(), &values).unwrap()
        };
        assert_eq!(both(&[("normal_force_n", 2.0)]), RidgeCase::paper().with_normal_force_n(2.0));
        assert_eq!(both(&[("mean_pressure_pa", 5e3), ("normal_force_n", 2.0)]).mean_pressure_pa, 5e3);
        assert!(set(RidgeCase::paper(), &BTreeMap::from([("mu".into(), 0.5)])).is_err());
    }

    /// Micrometres that were meant made a study in which every case failed; a shared value was ignored.
    #[test]
    fn a_span_beyond_what_a_ridge_can_have_or_of_a_shared_variable_is_refused() {
        let check = |name: &str, low, high| {
            let spans = BTreeMap::from([(name.to_string(), ValueRange { low, high, log: false })]);
            let base = BTreeMap::from([("mu0".to_string(), 0.4)]);
            RidgeSettings { base, spans, ..RidgeSettings::default() }.check_spans()
        };
        check("amplitude_pp_m", 0.3e-6, 5e-6).unwrap();
        check("normal_force_n", 0.1, 2.0).unwrap();
        let why = check("amplitude_pp_m", 0.3, 5.0).unwrap_err();
        let help = why.help().map(|help| help.to_string()).unwrap_or_default();
        assert!(format!("{why:?}").contains("must be 0 to") && help.contains("2e-6"), "{why:?}");
        assert!(check("amplitude_pp_m", 1e-6, 5e-3).is_err());
        let why = check("mu0", 0.3, 0.6).unwrap_err();
        assert!(why.to_string().contains("--set") && why.help().is_some(), "{why:?}");
    }
}

//! What is remarked of a table: ranges in SI, units that look slipped, signs that look wrong. Nothing is repaired.

use super::values::{all_differ, middle, sorted};
use diagnosis::data::{DataError, Table};
use models::covariate::{self, Covariate};
use models::{Condition, Finger, Pass};
use runs::format::number;
use serde::Serialize;

/// A column's range, in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Range {
    /// Column of the point table.
    pub column: &'static str,
    /// Smallest, median and largest value.
    pub low_median_high: [f64; 3],
}

/// What tribometers do, from rock friction at nanometres a second to pin on disk: values beyond are another
/// unit more often than another machine. Air in kPa or hPa is below, and a humidity as a ratio.
const USUAL: [(&Covariate, [f64; 2]); 7] = [
    (&covariate::AMPLITUDE, [1e-8, 1e-4]),
    (&covariate::FREQUENCY, [1e3, 1e6]),
    (&covariate::SPEED, [1e-8, 2.0]),
    (&covariate::NORMAL_FORCE, [1e-4, 1e3]),
    (&covariate::POSITION, [1e-9, 1.0]),
    (&covariate::AMBIENT_PRESSURE, [2e3, 1e6]),
    (&covariate::RELATIVE_HUMIDITY, [1.01, 100.0]),
];
/// Lateral over normal force: from well lubricated to soft rubber.
const RATIO: [f64; 2] = [2e-3, 20.0];
/// A standard deviation within a pass over its mean from which on the mean may be that of both directions.
const HIDDEN: f64 = 3.0;
/// Largest speed of a vibrating plate in m/s, `pi f w`.
const PLATE_SPEED: f64 = 10.0;

/// Whether values are those of a tribometer, as far as a range is known for the column.
pub fn usual(column: &str, values: &[f64]) -> bool {
    let of = USUAL.iter().find(|(c, _)| c.name == column);
    of.and_then(|(c, range)| slip(typical(c, values.iter().copied())?, *range)).is_none()
}

/// The size that a column is judged by: the middle one; the largest of places and of the air, some near zero.
fn typical(column: &Covariate, values: impl Iterator<Item = f64>) -> Option<f64> {
    let sizes = sorted(values.map(f64::abs).filter(|v| *v > 0.0));
    let of_air = || covariate::OPTIONAL.iter().any(|air| air.name == column.name);
    let largest = column.name == covariate::POSITION.name || of_air();
    if largest { sizes.last().copied() } else { middle(&sizes) }
}

/// The range of every column that the table has.
pub fn ranges(passes: &[Pass], columns: &[&'static str]) -> Vec<Range> {
    let of = |c: &Covariate| sorted(passes.iter().filter_map(|p| c.of(&p.condition(1.0))));
    let lists = covariate::REQUIRED.iter().chain(covariate::OPTIONAL.iter()).map(|c| (c.name, of(c)));
    let all = lists.chain([("lateral_force_n", sorted(passes.iter().filter_map(|p| p.lateral_force_n)))]);
    all.filter(|(name, v)| columns.contains(name) && !v.is_empty())
        .map(|(column, v)| Range { column, low_median_high: [v[0], v[v.len() / 2], v[v.len() - 1]] })
        .collect()
}

/// How a value is not among the usual ones: by a factor of a thousand, a million or a hundred, or otherwise.
fn slip(value: f64, [low, high]: [f64; 2]) -> Option<&'static str> {
    let within = |v: f64| v >= low && v <= high;
    if value <= 0.0 || within(value) {
        return None;
    }
    [
        (1e-3, "a thousand times too large"),
        (1e-6, "a million times too large"),
        (1e3, "a thousand times too small"),
        (1e6, "a million times too small"),
        (1e2, "a hundred times too small"),
    ]
    .into_iter()
    .find_map(|(factor, words)| within(value * factor).then_some(words))
    .or(Some("unusual"))
}

/// The first points of those passes, and how many more there are; `None` of none.
pub(crate) fn points(passes: &[Pass], is: impl Fn(&Pass) -> bool) -> Option<(usize, String)> {
    let all: Vec<String> = passes.iter().filter(|p| is(p)).map(|p| p.point.to_string()).collect();
    let more = if all.len() > 5 { ", ..." } else { "" };
    (!all.is_empty()).then(|| (all.len(), format!("{}{more}", all[..all.len().min(5)].join(", "))))
}

/// Passes whose lateral force scatters as it does where the sliding turns within them, or where a sample is
/// wrong.
fn scattered(passes: &[Pass]) -> Option<String> {
    let hidden =
        |p: &Pass| p.lateral_force_sd_n.zip(p.lateral_force_n).is_some_and(|(sd, f)| sd > HIDDEN * f.abs());
    let (count, points) = points(passes, hidden)?;
    let scatters = format!("the lateral force scatters by more than {HIDDEN} times its mean in");
    Some(if 2 * count > passes.len() {
        format!(
            "{scatters} {count} of {} passes: are reversals hidden in them? A position that counts the way up, or a speed without a sign, \
             does not show them: map a position or a velocity with a sign",
            passes.len()
        )
    } else {
        format!("{scatters} point {points}: a bad sample, or hardly any friction?")
    })
}

/// What looks wrong with the forces where no vibration loses contact with a finger, as in mN under N.
pub fn never_lifts(passes: &[Pass], finger: &Finger) -> Option<String> {
    let k_n = finger.normal_stiffness_n_per_m;
    let most = passes.iter().map(|p| p.amplitude.metres() * k_n / (2.0 * p.normal_force_n));
    let most = most.fold(0.0, f64::max);
    let why = "by the stiffness of rig.toml no vibration loses contact: w is at most";
    (0.0 < most && most < 1.0)
        .then(|| format!("normal_force_n: {why} {} of 2 F / k_n. Are the forces in mN?", number(most)))
}

/// Everything that looks wrong in a point table, in sentences.
pub fn of_table(passes: &[Pass]) -> Vec<String> {
    let all = covariate::REQUIRED.iter().chain(covariate::OPTIONAL.iter());
    remarks(passes, &all.map(|c| c.name).collect::<Vec<_>>())
}

/// Everything that looks wrong, in sentences.
pub fn remarks(passes: &[Pass], columns: &[&'static str]) -> Vec<String> {
    let mut list = Vec::new();
    let conditions: Vec<Condition> = passes.iter().map(|p| p.condition(1.0)).collect();
    for (c, usual) in USUAL.iter().filter(|(c, _)| columns.contains(&c.name)) {
        let typical = typical(c, conditions.iter().filter_map(|q| c.of(q)));
        if let Some((typical, words)) = typical.and_then(|v| Some((v, slip(v, *usual)?))) {
            let (factor, unit) = c.shown;
            let [typical, low, high] = [typical, usual[0], usual[1]].map(|v| number(v * factor));
            list.push(format!(
                "{}: {typical} {unit} is {words} for a tribometer ({low} to {high} {unit}): is its unit right?",
                c.name
            ));
        }
    }
    let ratios = sorted(passes.iter().filter_map(|p| Some((p.lateral_force_n? / p.normal_force_n).abs())));
    if let Some((ratio, words)) = middle(&ratios).and_then(|r| Some((number(r), slip(r, RATIO)?))) {
        list.push(format!(
            "lateral over normal force is {ratio}, {words} for friction: is the unit of one of them wrong?"
        ));
    } else if let Some((_, points)) =
        points(passes, |p| p.lateral_force_n.is_some_and(|f| f.abs() > RATIO[1] * p.normal_force_n))
    {
        list.push(format!(
            "lateral over normal force is more than {} in point {points}: a bad reading?",
            RATIO[1]
        ));
    }
    let fastest = conditions.iter().map(|c| std::f64::consts::PI * c.frequency_hz * c.amplitude.metres());
    let fastest = fastest.fold(0.0, f64::max);
    if fastest > PLATE_SPEED {
        list.push(format!(
            "the plate would move at {} m/s (pi f w); no actuator does: is the unit of the amplitude or of the frequency right?",
            number(fastest)
        ));
    }
    list.extend(scattered(passes));
    let runs: Vec<&str> = passes.iter().filter_map(|p| p.run.as_deref()).collect();
    if runs.len() == passes.len() && all_differ(runs) {
        list.push("every pass is a run of its own: if the column 'run' counts the rows, leave it out".into());
    }
    match Table::measured(passes) {
        Err(DataError::Unsigned) => list.push(
            "the lateral force has one sign in both directions, and the same size: friction turns with the direction. If the column \
             holds magnitudes, map it as friction_force in place of lateral_force; if it was mapped as friction_force or \
             friction_coefficient, its values have a sign already: map the signed force as lateral_force. As it is, diagnose refuses \
             the table"
                .into(),
        ),
        Err(error) => list.push(format!("diagnose will refuse the table: {error}")),
        Ok(_) => {
            let against = passes.iter().filter(|p| p.friction_force_n().is_some_and(|f| f < 0.0)).count();
            if 2 * against > passes.len() {
                list.push(format!(
                    "friction pushes along the sliding in {against} of {} passes: does the sensor's axis or the sign of the direction point \
                     the other way? A minus before the unit turns a column (lateral_force:-N)",
                    passes.len()
                ));
            }
        }
    }
    list
}

//! The unit of a column, read off its name: the house ends every name of a quantity with it.

use runs::input::{UNITS, unit_of};

/// The unit in SI symbols; `1` for ratios, counts and standard deviations' own scale.
///
/// ```
/// use muprime_tables::export::unit::of;
/// assert_eq!(of("lateral_force_n"), "N");
/// assert_eq!(of("speed_m_s"), "m/s");
/// assert_eq!(of("mu_relative_sd"), "1");
/// assert_eq!(of("point"), "1");
/// ```
pub fn of(name: &str) -> &'static str {
    match unit_of(name) {
        "" => "1",
        "deg C" => "degC",
        unit => unit,
    }
}

/// The name of a topic by the rules of OpenMetrics, and its unit, which ends the name; none for a plain
/// number.
///
/// ```
/// use muprime_tables::export::unit::open_metrics;
/// assert_eq!(open_metrics("/force/age_s"), ("force_age_seconds".into(), Some("seconds")));
/// assert_eq!(open_metrics("/friction/mu_relative_sd"), ("friction_mu_relative_sd".into(), None));
/// ```
pub fn open_metrics(topic: &str) -> (String, Option<&'static str>) {
    let name = topic.trim_start_matches('/').replace('/', "_");
    match UNITS.into_iter().find(|(ending, ..)| name.ends_with(ending)) {
        Some((ending, _, word)) => (format!("{}_{word}", &name[..name.len() - ending.len()]), Some(word)),
        None => (name, None),
    }
}

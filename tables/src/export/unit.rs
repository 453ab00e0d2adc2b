//! The unit of a column, read off its name: the house ends every name of a quantity with it.

/// Endings of names with their units, as symbols and as OpenMetrics spells them; the longer ones first.
const ENDINGS: [(&str, &str, &str); 11] = [
    ("_n_per_m", "N/m", "newtons_per_meter"),
    ("_m_s", "m/s", "meters_per_second"),
    ("_deg", "deg", "degrees"),
    ("_pct", "%", "percent"),
    ("_hz", "Hz", "hertz"),
    ("_pa", "Pa", "pascals"),
    ("_n", "N", "newtons"),
    ("_m", "m", "meters"),
    ("_s", "s", "seconds"),
    ("_c", "degC", "celsius"),
    ("_sd", "", ""),
];

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
    ending(name).map(|(_, unit, _)| unit).filter(|unit| !unit.is_empty()).unwrap_or("1")
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
    match ending(&name).filter(|(_, _, word)| !word.is_empty()) {
        Some((ending, _, word)) => (format!("{}_{word}", &name[..name.len() - ending.len()]), Some(word)),
        None => (name, None),
    }
}

fn ending(name: &str) -> Option<(&'static str, &'static str, &'static str)> {
    ENDINGS.into_iter().find(|(ending, ..)| name.ends_with(ending))
}

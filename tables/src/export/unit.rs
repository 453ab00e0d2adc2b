//! The unit of a column, read off its name: the house ends every name of a quantity with it.

/// Endings of names and their units, the longer ones first.
const ENDINGS: [(&str, &str); 12] = [
    ("_n_per_m", "N/m"),
    ("_m_s", "m/s"),
    ("_pp_m", "m"),
    ("_deg", "deg"),
    ("_pct", "%"),
    ("_hz", "Hz"),
    ("_pa", "Pa"),
    ("_n", "N"),
    ("_m", "m"),
    ("_s", "s"),
    ("_c", "degC"),
    ("_sd", ""),
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
    let ending = ENDINGS.iter().find(|(ending, _)| name.ends_with(ending));
    ending.map(|(_, unit)| *unit).filter(|unit| !unit.is_empty()).unwrap_or("1")
}

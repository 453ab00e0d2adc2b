//! What a profile says twice must agree: a unit and its factor, a set-point and its echo, 'off' and zero.

use super::compile::Compiler;
use super::{CompiledSet, Frame};
use crate::codec::pattern::Form;
use crate::codec::text;
use crate::error::ProfileError;
use crate::schema::{Role, Set, Si};
use crate::units::Dimension::{Force, Frequency, Length, Pressure, Speed, Time};
use crate::units::{Unit, power_of};
use toml::Spanned;

/// SI units that take a prefix.
const UNITS: [&str; 8] = ["N", "m", "m/s", "Hz", "s", "Pa", "V", "A"];

/// What a role takes its signals and set-points of these names for, in SI.
const QUANTITIES: &[(Role, &str, &str)] = &[
    (Role::DriveUltrasonic, "amplitude", "m"),
    (Role::DriveUltrasonic, "echo_amplitude", "m"),
    (Role::DriveUltrasonic, "frequency", "Hz"),
    (Role::DriveUltrasonic, "echo_frequency", "Hz"),
    (Role::MotionSlide, "position", "m"),
    (Role::MotionSlide, "velocity", "m/s"),
    (Role::MotionLoad, "load", "N"),
    (Role::AmbientChamber, "pressure", "Pa"),
];

/// Set-points whose zero is no 'off'.
const NO_OFF: [&str; 4] = ["frequency", "pressure", "temperature", "humidity"];

/// The power of ten that `written`, such as `mm/s`, has over the SI unit, such as `m/s`.
pub fn power_of_ten(written: &str, unit: &str) -> Option<i32> {
    let one = |written: &str, unit: &str| power_of(written.strip_suffix(unit)?);
    match (written.split_once('/'), unit.split_once('/')) {
        (Some((above, below)), Some((of, per))) => Some(one(above, of)? - one(below, per)?),
        (None, None) => one(written, unit),
        _ => None,
    }
}

/// Whether the SI value of one `unit` can be `factor`; the value that it must have where it cannot. The sign is
/// the mounting's, the weight of a mass is the place's, and factors that are no power of ten are rounded.
fn contradicts(unit: &str, factor: f64, si_unit: &str) -> Option<f64> {
    let all = [Force, Frequency, Length, Pressure, Speed, Time];
    let dimension = all.into_iter().find(|dimension| dimension.si() == si_unit);
    let known = || Some((Unit::parse(dimension?, unit)?.factor().abs(), 0.01));
    let power = power_of_ten(unit, si_unit).map(|power| (10_f64.powi(power), 1e-6));
    let (expected, within) = power.or_else(known)?;
    ((factor.abs() / expected - 1.0).abs() > within).then_some(expected)
}

/// A word that stands for two numbers in two lists of words.
fn elsewhere<'a>(one: &'a [String], other: &[String]) -> Option<&'a String> {
    let differs = |(at, word): &(usize, &String)| {
        other.iter().position(|o| o.eq_ignore_ascii_case(word)).is_some_and(|there| there != *at)
    };
    one.iter().enumerate().find(differs).map(|(_, word)| word)
}

impl Compiler<'_> {
    /// Whether a unit fits its factor, and the quantity that the roles take it for.
    pub(super) fn check_unit(
        &self,
        named: &Spanned<String>,
        unit: &str,
        factor: f64,
        si: &Si,
    ) -> Result<(), ProfileError> {
        let (name, si_unit) = (named.as_ref(), si.unit.as_str());
        let wrong = |why: String| Err(self.at_name(named, format!("`{name}`: {why}")));
        if UNITS.iter().any(|base| power_of_ten(si_unit, base).is_some_and(|power| power != 0)) {
            return wrong(format!("`si.unit` is an SI unit without a prefix, and not `{si_unit}`"));
        }
        if let Some(expected) = contradicts(unit, factor, si_unit) {
            return wrong(format!("1 {unit} is {expected:e} {si_unit}, and not {factor:e} {si_unit}"));
        }
        let taken = QUANTITIES
            .iter()
            .find(|(role, of, _)| of == name && self.description.profile.roles.contains(role))
            .filter(|(.., needed)| *needed != si_unit);
        taken.map_or(Ok(()), |(.., needed)| {
            wrong(format!("it needs `si = {{ factor = ..., unit = \"{needed}\" }}`, not `{si_unit}`"))
        })
    }

    /// Whether a set-point can be scaled, and its `safe` value is one: zero is off.
    pub(super) fn check_set(&self, s: &Set) -> Result<(), ProfileError> {
        let name = s.name.as_ref().as_str();
        let wrong = |why: String| Err(self.at_name(&s.name, why));
        // Only a stage goes both ways.
        let usable = |x: f64| x.is_finite() && (x > 0.0 || (x < 0.0 && name == "velocity"));
        if !usable(s.scale) || !usable(s.si.factor) {
            return wrong(format!("`scale` and `si.factor` of set-point `{name}` must be above zero"));
        }
        let (low, high) = s.range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        if low > high || low.is_nan() || high.is_nan() {
            return wrong(format!("the range of set-point `{name}` is empty"));
        }
        if s.safe.is_some_and(|safe| !(low..=high).contains(&safe)) {
            return wrong(format!("the safe value of set-point `{name}` lies outside its range"));
        }
        if let Some(safe) = s.safe.filter(|safe| *safe != 0.0 && !NO_OFF.contains(&name)) {
            return wrong(format!("`safe` of set-point `{name}` is {safe}: off is 0"));
        }
        self.check_unit(&s.name, &s.unit, s.si.factor, &s.si)
    }

    /// Whether a set-point and its echo, a signal of `frame`, speak of one quantity with the same words.
    pub(super) fn check_echo(
        &self,
        s: &Set,
        compiled: &CompiledSet,
        echo: Option<usize>,
        frame: Option<&Frame>,
    ) -> Result<(), ProfileError> {
        let (name, unit) = (s.name.as_ref().as_str(), &s.si.unit);
        let wrong = |why: String| self.at_name(&s.name, why);
        let mut lists = vec![["off", "on"].map(String::from).to_vec()];
        if let Some(named) = &s.echo {
            let missing = || wrong(format!("the echo of set-point `{name}`, `{named}`, is not a signal"));
            let other = &self.description.signal[echo.ok_or_else(missing)?].si.unit;
            if other != unit {
                let why = format!("set-point `{name}` is in `{unit}`, its echo `{named}` in `{other}`");
                return Err(wrong(why));
            }
            if let Some(text::Form::Pattern(pattern)) = frame.and_then(|frame| frame.text.as_ref())
                && let Some((_, Form::Words(words))) = pattern.fields().find(|(field, _)| field == named)
            {
                lists.push(words.clone());
            }
        }
        let mut own = compiled.line.iter().flat_map(|(pattern, owners)| pattern.fields().zip(owners));
        let own = own.find(|(_, owner)| owner.is_none()).filter(|_| !NO_OFF.contains(&name));
        let Some(((_, Form::Words(words)), _)) = own else { return Ok(()) };
        let Some(word) = lists.iter().find_map(|list| elsewhere(words, list)) else { return Ok(()) };
        let why = format!("set-point `{name}`: `{word}` has another place than in its echo or in `OFF|ON`");
        let help =
            "the first word is 0, off; a word that means its opposite goes into `send` and `send_zero`";
        Err(wrong(why).with_help(help))
    }
}

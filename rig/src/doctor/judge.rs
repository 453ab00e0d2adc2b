//! What was found, against what a run needs.

use super::{ChannelReport, Inspection, InstrumentFound, LinkCounts};
use drivers::OpenError;
use realtime::ports::{AmplifierState, Contacts, NoData, SafetyContact, Sample, StageState};
use realtime::safety::RULES;
use runs::Plan;
use runs::format::quantity;
use runs::setup::{Setup, THERMOMETER};
use serde::Serialize;

/// The judgement of one subject.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Finding {
    /// Of what.
    pub subject: String,
    /// Whether a sweep would run with it.
    pub good: bool,
    /// What was found.
    pub found: String,
    /// What to do, where it is not good.
    pub advice: String,
    /// Of an instrument: its channels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<ChannelReport>,
    /// Of an instrument: share of its answers that were none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bad_answers_share: Option<f64>,
}

impl Finding {
    /// A finding without channels.
    pub fn new(
        subject: impl Into<String>,
        good: bool,
        found: impl Into<String>,
        advice: impl Into<String>,
    ) -> Self {
        let (subject, found, advice) = (subject.into(), found.into(), advice.into());
        Finding { subject, good, found, advice, ..Finding::default() }
    }
}

/// What the inspection is judged for.
pub struct InspectionScope<'a> {
    /// The rig.
    pub setup: &'a Setup,
    /// The plan that is to run, where one is named.
    pub plan: Option<&'a Plan>,
}

/// More answers than this that are none are a fault of the link: a run goes on over single ones.
const BAD_SHARE: f64 = 0.01;
/// A channel that shows fewer of its samples than this will not pass here. A run remarks below 0.85 and
/// trips below 0.25 (`realtime::safety::rules`).
const CAME_SHARE: f64 = 0.5;
/// Looks that may find nothing valid, and samples at the range's ends.
const INVALID_SHARE: f64 = 0.01;
/// Samples that must have been seen before a channel counts as standing still.
const SAMPLES_MIN: u64 = 20;
/// Noise so many times what profile and setup state is not that channel's noise.
const NOISE_TIMES: f64 = 10.0;
/// N that may stand on the normal axis of a lifted finger (SR-43), and below zero.
const LOAD_ZERO_N: f64 = 0.3;
/// m/s and m that a rig at rest may show.
const AT_REST_M_S: f64 = 0.5e-3;
const OFF_AMPLITUDE_PP_M: f64 = 0.3e-6;

/// A problem and what to do about it.
type Advice = (String, &'static str);

const LINK: &str = "check cable and power, and what else talks on this line";
const UNIT: &str = "check unit, factor, type and byte order of the signal in its profile, and `gain`";

/// Judges what was found: one finding an instrument, one of the sweep, one of the plan.
pub fn judge(inspected: &Inspection, target: &InspectionScope<'_>) -> Vec<Finding> {
    let mut instruments: Vec<Finding> =
        inspected.found.iter().map(|found| instrument(found, inspected, target)).collect();
    let mended = instruments.iter().all(|f| f.good);
    let mut findings: Vec<Finding> = stalled(inspected).into_iter().collect();
    if !findings.is_empty() {
        // Beside stalls an inspection cannot tell an instrument's fault from the computer's.
        for finding in instruments.iter_mut().filter(|f| !f.good) {
            finding.advice = format!("first this computer (above); if it stays so: {}", finding.advice);
        }
    }
    findings.append(&mut instruments);
    if inspected.found.iter().all(|f| f.answers.is_ok()) {
        findings.push(arming(inspected));
    }
    if let Some(plan) = target.plan {
        findings.push(planned(inspected, target.setup, plan, mended));
    }
    findings
}

/// Samples came late or not at all beside stalls of this computer: the fault may be with either.
fn stalled(inspected: &Inspection) -> Option<Finding> {
    let late = |found: &InstrumentFound| {
        let mut problems = Vec::new();
        found.channels.iter().for_each(|channel| timely(channel, &mut problems));
        found.answers.iter().for_each(|answers| linked(answers, &mut problems));
        !problems.is_empty()
    };
    let stalls = &inspected.stalls;
    (stalls.count > 0 && inspected.found.iter().any(late)).then(|| {
        let found = format!(
            "did not run its threads {} times for 3 ms and more during the look, {:.0} ms at most: low rates, old samples and \
             missing answers may be its doing",
            stalls.count,
            stalls.worst.seconds() * 1e3
        );
        let advice = "end what else runs on it and look again; `muprime doctor` judges it";
        Finding::new("this computer", false, found, advice)
    })
}

fn instrument(found: &InstrumentFound, inspected: &Inspection, target: &InspectionScope<'_>) -> Finding {
    let subject = format!("{} `{}` at {}", found.role, found.id, found.address);
    let answers = match &found.answers {
        Ok(answers) => answers,
        Err(error) => {
            let problem = match error {
                // The subject names the instrument already.
                OpenError::Mismatch { problem, .. } => problem.to_string(),
                OpenError::Link { problem, .. } => problem.to_string(),
                other => other.to_string(),
            };
            let advice = drivers::remedy::advice(&problem);
            return Finding::new(subject, false, problem, advice);
        }
    };
    let mut problems: Vec<Advice> = Vec::new();
    let mut states = Vec::new();
    // What an amplifier says without its supply is not valid by its own word, and its fault is not its own.
    let unsupplied = found.role == "amplifier" && inspected.supply_is_open();
    for channel in &found.channels {
        if !(unsupplied && channel.missing == Some(NoData::Invalid)) {
            timely(channel, &mut problems);
            saturated(channel, &mut problems);
        }
        if found.role == "force" {
            states.push(match (channel.mean, channel.missing) {
                (Some(mean), None) => format!("{} {}", channel.name, quantity(mean, "N")),
                (_, None) => format!("{} missing: nothing came", channel.name),
                (_, Some(why)) => format!("{} missing: {why}", channel.name),
            });
            force(channel, target, &mut problems);
        }
    }
    let no_state = |why: NoData| format!("no state: {why}");
    match found.role {
        "amplifier" => {
            let shown = |s| amplifier(s, target.setup, unsupplied, &mut problems);
            states.push(inspected.seen.amplifier.map_or_else(no_state, shown));
        }
        "stage" => {
            let shown = |s| stage(s, target.setup, &mut problems);
            states.push(inspected.seen.stage.map_or_else(no_state, shown));
        }
        "supply_relay" => {
            let shown = |cut: bool| if cut { "open" } else { "closed" };
            states.push(inspected.seen.supply.map_or("no state", |supply| shown(supply.cut)).into());
        }
        "safety_inputs" => contacts(&inspected.seen.contacts, &mut states, &mut problems),
        _ => {}
    }
    linked(answers, &mut problems);
    if !answers.fault.is_empty() && !unsupplied {
        let advice = "look it up in its manual, and reset it at the instrument";
        problems.push((format!("it reports: {}", answers.fault), advice));
    }
    let mut parts = vec![states.join(", "), format!("{:.0} samples a second", answers.samples_per_s)];
    parts.retain(|part| !part.is_empty());
    parts.extend(problems.iter().map(|(problem, _)| problem.clone()));
    let mut advice: Vec<&str> = Vec::new();
    for (_, one) in &problems {
        if !advice.contains(one) {
            advice.push(one);
        }
    }
    Finding {
        channels: found.channels.clone(),
        bad_answers_share: Some(answers.bad_share),
        ..Finding::new(subject, problems.is_empty(), parts.join("; "), advice.join("; "))
    }
}

/// Rate, ages, and whether anything valid came.
fn timely(c: &ChannelReport, problems: &mut Vec<Advice>) {
    let name = c.name;
    if c.invalid_share > INVALID_SHARE {
        let why = c.missing.map_or("the instrument declared samples invalid".into(), |why| why.to_string());
        let problem =
            format!("{name}: {:.0} % of the looks found no valid sample ({why})", c.invalid_share * 1e2);
        let advice = match c.missing {
            Some(NoData::Invalid | NoData::Corrupt) | None => {
                "the instrument sends what is not a number, or says itself that it is not valid: check its status, and type and byte order in its profile"
            }
            _ => LINK,
        };
        problems.push((problem, advice));
        if c.invalid_share > 0.5 {
            return;
        }
    }
    if let Some([_, most, _]) = c.age_ms.filter(|[_, most, _]| *most > c.age_limit_ms) {
        let problem =
            format!("{name}: samples are {most:.0} ms old, and stale from {:.0} ms on", c.age_limit_ms);
        problems.push((problem, "find what holds its samples up; state its true rate as `rate_hz`"));
    }
    if c.rate_hz < CAME_SHARE * c.due_hz {
        let problem = format!("{name}: {:.1} new samples a second, {:.0} are due", c.rate_hz, c.due_hz);
        problems.push((problem, "set the instrument to that rate, or state its true rate as `rate_hz`"));
    }
}

/// Samples at the ends of the range.
fn saturated(c: &ChannelReport, problems: &mut Vec<Advice>) {
    if c.saturated_share > INVALID_SHARE {
        let (name, percent) = (c.name, c.saturated_share * 1e2);
        let problem = format!("{name}: {percent:.0} % of its samples are at the end of its range");
        problems.push((problem, "unload and zero it, or use one of a larger range; a range in the profile that is too narrow does the same"));
    }
}

fn linked(answers: &LinkCounts, problems: &mut Vec<Advice>) {
    if answers.bad_share > BAD_SHARE {
        problems.push((format!("{:.0} % of its answers are none", answers.bad_share * 1e2), LINK));
    }
    if answers.lost_share > 1.0 - CAME_SHARE {
        problems.push((format!("{:.0} % of its samples never came", answers.lost_share * 1e2), LINK));
    }
    if answers.reconnected > 0 {
        problems.push((format!("its link broke {} times", answers.reconnected), LINK));
    }
    if !answers.last_problem.is_empty() {
        problems.push((answers.last_problem.clone(), drivers::remedy::advice(&answers.last_problem)));
    }
    if answers.repeats_only {
        let problem = "answers come, but the counter that its profile names as `sequence` does not change";
        problems.push((problem.into(), "start its measurement; else correct `sequence` or leave it out"));
    }
}

/// Values of an axis of force at rest.
fn force(c: &ChannelReport, target: &InspectionScope<'_>, problems: &mut Vec<Advice>) {
    let (limits, name) = (&target.setup.config.limits, c.name);
    let most = if name == "normal" { limits.normal_force_max_n } else { limits.lateral_force_max_n };
    let frozen_after = limits.frozen_after;
    let still = c.samples >= SAMPLES_MIN
        && (c.equal_in_a_row >= frozen_after || u64::from(c.equal_in_a_row) >= c.samples);
    if still {
        let problem = format!("{name}: frozen, one value {} times in a row", c.equal_in_a_row);
        let advice = "switch the sensor off and on; if its noise is below one count, raise `frozen_after`";
        problems.push((problem, advice));
    }
    let Some(mean) = c.mean else { return };
    if mean.abs() > most {
        let problem = format!("{name}: {} at rest, and the limit is {most} N", quantity(mean, "N"));
        problems.push((problem, UNIT));
    } else if name == "normal" && mean < -LOAD_ZERO_N {
        let problem = format!("normal: {mean:.3} N at rest, and compression is positive");
        problems.push((problem, "zero the sensor; if it is loaded, turn the axis round with `gain = -1`"));
    } else if name == "normal" && mean > LOAD_ZERO_N {
        let problem = format!("normal: {mean:.3} N at rest: a run trips over a load that it did not command");
        problems.push((problem, "lift the finger off and zero the sensor"));
    }
    let stated = [Some(target.setup.config.estimate.sample_sd_n), stated_noise(target.setup, name)];
    let stated = stated.into_iter().flatten().fold(0.0, f64::max);
    if let Some(noise) = c.noise_sd.filter(|sd| *sd > NOISE_TIMES * stated && mean.abs() <= most) {
        let problem =
            format!("{name}: its noise is {:.1} mN, and {:.1} mN are stated", noise * 1e3, stated * 1e3);
        let advice = "check cable, shield and ground, the unit in its profile, and that nothing moves";
        problems.push((problem, advice));
    }
}

/// Noise of an axis by its profile, in N.
fn stated_noise(setup: &Setup, axis: &str) -> Option<f64> {
    setup.file.axes().filter(|found| found.name == axis).find_map(|axis| {
        let described = axis.described();
        let count = axis.profile.lsb_si(axis.signal, &axis.profile.values());
        let noise = described.noise.map_or(count, |noise| noise * described.si.factor);
        Some(noise.abs() * axis.gain.abs()).filter(|noise| noise.is_finite())
    })
}

fn amplifier(s: AmplifierState, setup: &Setup, supply_is_open: bool, problems: &mut Vec<Advice>) -> String {
    if s.output_on {
        problems.push(("its output is ON at rest".into(), "find who drives it, and switch it off"));
    }
    // Without its supply every amplifier that can shows a fault: it is not its own.
    if s.fault && !supply_is_open {
        problems.push(("it reports a FAULT".into(), "read the fault on the amplifier, and reset it there"));
    }
    if setup.config.limits.temperature_fitted && s.temperature_c == Err(NoData::NotFitted) {
        problems.push(("it has no thermometer, and a run waits for one".into(), THERMOMETER));
    }
    let vibrates = |w: &Sample| !s.output_on && w.value.abs() > OFF_AMPLITUDE_PP_M;
    if let Some(w) = s.amplitude.ok().filter(vibrates) {
        let problem = format!("it is off, and its plate is read at {} peak-to-peak", quantity(w.value, "m"));
        problems.push((problem, "check the amplitude's zero, unit and `measured_m_per_unit`"));
    }
    format!(
        "output {}, set to {} peak-to-peak at {}",
        if s.output_on { "ON" } else { "off" },
        quantity(s.echoed_amplitude.metres(), "m"),
        quantity(s.echoed_frequency_hz, "Hz")
    )
}

fn stage(s: StageState, setup: &Setup, problems: &mut Vec<Advice>) -> String {
    let (left, right) = setup.config.limits.travel_m;
    if s.fault {
        problems.push(("it reports a FAULT".into(), "read the fault on the stage, and reset it there"));
    }
    if !(s.position_m >= left && s.position_m <= right) || s.at_limit {
        let problem = format!("outside its travel, {left} to {right} m");
        problems.push((problem, "move it between its ends by hand; check `travel_min_m`, `travel_max_m` and the unit of its position"));
    }
    if s.velocity_m_s.is_nan() || s.velocity_m_s.abs() > AT_REST_M_S {
        problems.push(("it moves at rest".into(), "find who moves it; check the unit of its velocity"));
    }
    format!("at {}, {}", quantity(s.position_m, "m"), quantity(s.velocity_m_s, "m/s"))
}

fn contacts(c: &Contacts, states: &mut Vec<String>, problems: &mut Vec<Advice>) {
    let mut one = |name: &str, contact: Result<SafetyContact, NoData>, needed: bool| match contact {
        Err(NoData::NotFitted) => {}
        Err(why) => problems.push((format!("{name}: {why}"), LINK)),
        Ok(contact) => {
            states.push(format!("{name} {}", if contact.closed { "closed" } else { "open" }));
            if needed && !contact.closed {
                let advice = "release the emergency stop and close the guard; else check wire and input";
                problems.push((format!("{name} is open: nothing is armed so"), advice));
            }
        }
    };
    one("emergency stop", c.emergency_stop, true);
    one("interlock", c.interlock, true);
    one("dead-man device", c.dead_man, false);
}

/// Whether the loop's own rules would let a sweep begin.
fn arming(inspected: &Inspection) -> Finding {
    match inspected.blocking.filter(|(_, share)| *share > INVALID_SHARE) {
        None => {
            let open = "; whether the amplifier has a fault of its own shows when arming closes its supply";
            let found = "the rules of the loop would let it begin";
            let open = if inspected.supply_is_open() { open } else { "" };
            Finding::new("a sweep", true, format!("{found}{open}"), "")
        }
        Some((cause, share)) => {
            let rule = RULES.iter().find(|rule| rule.cause == cause);
            let (id, text) = rule.map_or(("", ""), |rule| (rule.id, rule.text));
            let found = format!("would not be armed in {:.0} % of the cycles: {id}, {text}", share * 1e2);
            Finding::new("a sweep", false, found, cause.remedy())
        }
    }
}

/// Whether a normal force at rest is one that spoils the `least` load, in N. A dead weight may stand on the
/// finger: nothing but a hand lifts it.
fn is_loaded(rest_n: f64, weight_n: f64, least_n: f64) -> bool {
    rest_n.abs().min((rest_n - weight_n).abs()) > 0.5 * least_n
}

/// The plan on this rig, with the noise that was found.
fn planned(inspected: &Inspection, setup: &Setup, plan: &Plan, mended: bool) -> Finding {
    let subject = format!("the plan {}", plan.file.name);
    let channel = |name: &str| {
        let mut all = inspected.found.iter().flat_map(|f| &f.channels);
        all.find(|c| c.name == name).filter(|c| c.missing.is_none())
    };
    let noise = channel("lateral").and_then(|c| c.noise_sd);
    let passes = match tables::check::preflight(setup, plan.clone(), None, noise) {
        Ok((passes, _)) => passes,
        Err(why) => {
            let advice = why.help().map_or("change plan or setup".into(), |h| h.to_string());
            return Finding::new(subject, false, format!("{why}"), advice);
        }
    };
    let loads = plan.file.series.iter().flat_map(|s| s.normal_force_n.iter().copied());
    let least = loads.chain([plan.file.base.normal_force_n]).fold(f64::INFINITY, f64::min);
    let weight = setup.file.stage.dead_weight_n.unwrap_or(0.0);
    let loaded = |rest: &f64| is_loaded(*rest, weight, least);
    if let Some(rest) = channel("normal").and_then(|c| c.mean).filter(loaded) {
        let found =
            format!("{rest:+.3} N stand on the normal axis at rest, and its smallest load is {least} N");
        let advice = "lift the finger off and zero the sensor; check sign, unit and factor of its signal";
        return Finding::new(subject, false, found, advice);
    }
    let found = if mended { "" } else { ", once the problems above are solved" };
    Finding::new(subject, true, format!("{passes} passes can be made and seen{found}"), "")
}

#[cfg(test)]
mod tests {
    use super::*;
    use realtime::ports::{Forces, Nanos};
    use realtime::safety::Observation;
    use realtime::stall_monitor::StallReport;

    #[test]
    fn a_dead_weight_on_the_finger_is_no_zero_that_is_off() {
        assert!(is_loaded(0.25, 0.0, 0.25), "a stage that loads: the finger is not lifted");
        assert!(!is_loaded(0.249, 0.25, 0.25), "the weight stands on it");
        assert!(!is_loaded(-0.001, 0.25, 0.25), "a hand holds it");
        assert!(is_loaded(0.5, 0.25, 0.25) && is_loaded(-0.25, 0.25, 0.25), "zero, sign or unit is wrong");
    }

    /// One channel whose samples came at a share of its rate, beside so many stalls.
    fn inspected(came: f64, mean: f64, stalls: u64) -> Inspection {
        let channel = ChannelReport {
            name: "lateral",
            unit: "N",
            rate_hz: came * 1e3,
            due_hz: 1e3,
            age_ms: Some([1.0, 2.0, 3.0]),
            age_limit_ms: 48.0,
            mean: Some(mean),
            noise_sd: Some(1e-3),
            saturated_share: 0.0,
            invalid_share: 0.0,
            equal_in_a_row: 1,
            samples: 1000,
            missing: None,
        };
        let found = InstrumentFound {
            role: "force",
            id: "muprime-force2".into(),
            address: "127.0.0.1:1".into(),
            answers: Ok(LinkCounts::default()),
            channels: vec![channel],
        };
        let stalls = StallReport { count: stalls, worst: Nanos(21_400_000), latest: Vec::new() };
        let none = NoData::NotFitted;
        let seen = Observation {
            forces: Forces::missing(none),
            amplifier: Err(none),
            stage: Err(none),
            lateness: Nanos(0),
            supply: Err(none),
            contacts: Contacts::ABSENT,
        };
        Inspection { found: vec![found], seen, blocking: None, stalls }
    }

    #[test]
    fn stalls_of_this_computer_are_reported_where_samples_came_late() {
        let setup = Setup::load("virtual-ideal").unwrap();
        let of_computer = |inspected: &Inspection| {
            let findings = judge(inspected, &InspectionScope { setup: &setup, plan: None });
            let of = |what: &str| findings.iter().find(|f| f.subject.starts_with(what)).cloned();
            let force = of("force").unwrap();
            let computer = of("this computer");
            let first = !force.good && computer.is_some();
            assert_eq!(force.advice.starts_with("first this computer"), first, "{findings:?}");
            (force.good, computer)
        };
        let (good, finding) = of_computer(&inspected(0.48, 0.0, 7));
        let finding = finding.unwrap();
        assert!(!good && !finding.good, "{finding:?}");
        assert!(finding.found.contains("7 times") && finding.found.contains("21 ms"), "{finding:?}");
        for (inspected, good, why) in [
            (inspected(0.48, 0.0, 0), false, "nothing is claimed that no monitor saw"),
            (inspected(1.0, 0.0, 7), true, "nothing is explained where nothing is wrong"),
            (inspected(1.0, 1e3, 7), false, "no stall makes a wrong force"),
        ] {
            let (found_good, finding) = of_computer(&inspected);
            assert_eq!((found_good, finding.is_none()), (good, true), "{why}: {finding:?}");
        }
    }
}

//! The rules, each with its requirement identifier. Add a rule: a variant with words and remedy in
//! `cause.rs`, one line in [`RULES`] and one function here.

use super::arming::{CutFor, SUPPLY_ACTS};
use super::cause::{TripCause, Unit};
use super::watch::{ForceWatch, STAGE_RESPONSE, SafetyMemory};
use super::{Controls, HARD, Limits, Observation, Remark, Request};
use crate::signals::{AmplifierState, Channel, Nanos, NoData, SafetyContact, SupplyCommand};

/// A rule and what it is for.
#[derive(Clone, Copy)]
pub struct Rule {
    /// Requirement identifier, stable over versions.
    pub id: &'static str,
    /// The cause that it latches.
    pub cause: TripCause,
    /// The units that value and bound of its trip may be in.
    pub units: &'static [Unit],
    /// What it demands, in one sentence.
    pub text: &'static str,
    check: fn(&Context<'_>) -> Option<(f64, f64, Unit)>,
}

impl std::fmt::Debug for Rule {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:?}", self.id, self.cause)
    }
}

/// What a rule may look at.
pub(super) struct Context<'a> {
    pub limits: &'a Limits,
    pub seen: &'a Observation,
    pub request: &'a Request,
    pub controls: Controls,
    pub watch: &'a SafetyMemory,
    pub armed_since: Option<Nanos>,
    pub now: Nanos,
}

/// A rule that is broken, by what value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Breach {
    pub cause: TripCause,
    pub value: f64,
    pub bound: f64,
    pub unit: Unit,
}

/// The first broken rule, in the order of [`RULES`], whose cause is not excused.
pub(super) fn first_broken_but(context: &Context<'_>, excused: &[TripCause]) -> Option<Breach> {
    RULES.iter().filter(|rule| !excused.contains(&rule.cause)).find_map(|rule| {
        (rule.check)(context).map(|(value, bound, unit)| Breach { cause: rule.cause, value, bound, unit })
    })
}

/// What the second channel must act for: the amplifier stays on, or the emergency stop is pressed, or nothing is known of it.
pub(super) fn cuts_the_supply(c: &Context<'_>) -> Option<CutFor> {
    let stop = contact_open(c, &c.seen.contacts.emergency_stop).map(|(.., unit)| match unit {
        Unit::Flag => CutFor::Pressed,
        _ => CutFor::Silence,
    });
    let hands = c.controls.open_supply.then_some(CutFor::Hands);
    c.watch.refuses_off(c.limits, c.now).then_some(CutFor::Refusal).max(stop).max(hands)
}

macro_rules! rules {
    ($($id:literal $cause:ident [$($unit:ident),+] $text:literal => $check:expr;)*) => {
        /// Every rule, most urgent first.
        pub const RULES: &[Rule] = &[$(Rule {
            id: $id,
            cause: TripCause::$cause,
            units: &[$(Unit::$unit),+],
            text: $text,
            check: rules!(@check $check, $($unit)+),
        },)*];
    };
    // One unit belongs to the rule; where there are several, the check says which.
    (@check $check:expr, $unit:ident) => {
        |c| {
            let check: fn(&Context<'_>) -> Option<(f64, f64)> = $check;
            check(c).map(|(value, bound)| (value, bound, Unit::$unit))
        }
    };
    (@check $check:expr, $($unit:ident)+) => { $check };
}

rules! {
    "SR-35" EmergencyStop [Flag, Second] "A pressed, silent or broken emergency stop switches off and cuts the supply." => |c| to_blame(c, &c.seen.contacts.emergency_stop);
    "SR-01" Stopped [Flag] "A stop switches off and latches." => |c| broken(c.controls.stop, 1.0, 0.0);
    "SR-36" Interlock [Flag, Second] "An open, silent or broken interlock switches off." => |c| to_blame(c, &c.seen.contacts.interlock);
    "SR-31" Suspended [Second] "A cycle that begins fifty periods after its deadline switches off: nothing controlled the rig meanwhile." => stood_still;
    "SR-02" DeadMan [Flag] "With a human finger, releasing the dead-man input switches off; it must be seen released, then held, before arming." => dead_man;
    "SR-03" Exposure [Second] "With a human finger, vibration in one go lasts no longer than its limit; only a rest of full length ends a go." => exposure;
    "SR-04" NormalOverforce [Newton] "Normal force stays below its limit, either sign." => |c| overforce(c, &c.watch.normal, c.limits.normal_force_max_n, c.limits.timing.normal.period);
    "SR-05" LateralOverforce [Newton] "Lateral force stays below its limit, either sign." => |c| overforce(c, &c.watch.lateral, c.limits.lateral_force_max_n, c.limits.timing.lateral.period);
    "SR-06" ForceRate [NewtonPerSecond] "Normal force does not change faster than its limit over two samples in a row." => |c| broken(c.watch.normal.fast_in_a_row >= 2, c.watch.normal.rate_n_s.abs(), c.limits.force_rate_max_n_s);
    "SR-07" OverAmplitude [Metre] "Measured amplitude stays below its limit." => |c| above(amplitude_pp_m(c), c.limits.amplitude_max.metres());
    "SR-08" AmplitudeRunaway [Metre] "Measured amplitude exceeds what was commanded by no more than 30 % and 0.3 \u{b5}m, ring-down allowed." => |c| above(amplitude_pp_m(c), 1.3 * c.watch.ringing_pp_m + 0.3e-6);
    "SR-09" AmplitudeRate [MetrePerSecond] "Measured amplitude does not rise faster than its limit over two samples in a row." => |c| broken(c.watch.amplitude_fast_in_a_row >= 2, c.watch.amplitude_rate_m_s, c.limits.amplitude_rate_max_m_s);
    "SR-10" LateralInvalid [Count] "Three cycles without a valid lateral sample switch off." => |c| broken(c.watch.lateral.invalid_in_a_row >= 3, f64::from(c.watch.lateral.invalid_in_a_row), 3.0);
    "SR-11" NormalInvalid [Count] "Three cycles without a valid normal sample switch off." => |c| broken(c.watch.normal.invalid_in_a_row >= 3, f64::from(c.watch.normal.invalid_in_a_row), 3.0);
    "SR-12" LateralSaturated [Count] "A lateral channel at the end of its range for two cycles, or for five in fifty, switches off." => |c| saturated(&c.watch.lateral);
    "SR-13" NormalSaturated [Count] "A normal channel at the end of its range for two cycles, or for five in fifty, switches off." => |c| saturated(&c.watch.normal);
    "SR-14" LateralStale [Second] "A lateral sample is no older than its own periods and latency allow." => |c| stale(&c.seen.forces.lateral, c.limits.timing.lateral.age_limit(), c.now);
    "SR-15" NormalStale [Second] "A normal sample is no older than its own periods and latency allow." => |c| stale(&c.seen.forces.normal, c.limits.timing.normal.age_limit(), c.now);
    "SR-16" LateralFrozen [Count] "A lateral channel does not repeat its raw value more often than its noise allows." => |c| frozen(c, c.watch.lateral.equal_in_a_row);
    "SR-17" NormalFrozen [Count] "A normal channel does not repeat its raw value more often than its noise allows." => |c| frozen(c, c.watch.normal.equal_in_a_row);
    "SR-18" Noisy [Count] "Fewer than five spikes in fifty cycles on either force." => |c| broken(spikes(c) >= 5, f64::from(spikes(c)), 5.0);
    "SR-19" AmplifierStale [Second] "The amplifier's state is no older than its own periods and latency allow." => |c| state_stale(c.seen.amplifier.map(|a| a.taken_at), c.limits.timing.amplifier.age_limit(), c.now);
    "SR-20" AmplifierFault [Flag] "An amplifier that reports a fault, or values that are not numbers, is switched off." => |c| broken(c.seen.amplifier.is_ok_and(|a| a.fault || !is_numeric(&a)), 1.0, 0.0);
    "SR-21" AmplifierWatchdog [Flag] "An amplifier whose own watchdog has fired is switched off." => |c| broken(c.seen.amplifier.is_ok_and(|a| a.watchdog_tripped) && c.watch.enabled, 1.0, 0.0);
    "SR-22" DriveNoResponse [Metre] "A driven plate vibrates: at least a fifth of the commanded amplitude after ring-up." => no_response;
    "SR-23" EchoMismatch [Metre, Hertz, Flag] "The amplifier echoes the set-point that it was given, within its resolution, and shows itself on while it is driven." => echo;
    "SR-24" RefusesOff [Flag] "An amplifier that stays on after 'off' is cut from its supply." => |c| broken(c.watch.refuses_off(c.limits, c.now), 1.0, 0.0);
    "SR-25" OverTemperature [Celsius] "Plate and amplifier stay below the temperature limit; a lost sensor counts as too hot." => temperature;
    "SR-26" StageStale [Second] "The stage's state is no older than its own periods and latency allow." => |c| state_stale(c.seen.stage.map(|s| s.taken_at), c.limits.timing.stage.age_limit(), c.now);
    "SR-27" StageFault [Flag] "A stage that reports a fault, or values that are not numbers, is stopped." => |c| broken(c.seen.stage.is_ok_and(|s| s.fault || !(s.position_m.is_finite() && s.velocity_m_s.is_finite())), 1.0, 0.0);
    "SR-28" OverTravel [Metre] "The stage stays within its travel." => travel;
    "SR-29" Overrun [Count] "The loop misses fewer deadlines in a row than its limit (three by default), and of a thousand no more than another (ten by default); a skipped deadline is a missed one." => overrun;
    "SR-30" RequestRefused [Metre, MetrePerSecond, Newton, Hertz] "A request beyond any limit, or not finite, switches off." => request;
    "SR-32" StageNotFollowing [MetrePerSecond] "The stage follows its commanded speed: after its response time between a fifth and one and a half times that speed." => following;
    "SR-33" LateralLossy [Share] "At least a quarter of the lateral samples that are due in a window come." => |c| lossy(c, c.watch.lateral.share_came);
    "SR-34" NormalLossy [Share] "At least a quarter of the normal samples that are due in a window come." => |c| lossy(c, c.watch.normal.share_came);
    "SR-37" SupplySwitch [Second] "A second switch-off channel that is fitted reads back its command." => supply_switch;
    "SR-38" Unguarded [Flag] "A human finger needs a second channel, an emergency stop, a dead-man device, and a watchdog of at most 1 s at the amplifier or at the second channel; an amplifier without such a watchdog needs a second channel." => unguarded;
    "SR-39" ExposureDuty [Second] "With a human finger, no larger share of the last hour is vibrated than its limit." => |c| above(last_hour(c).map(|(driven, _)| driven), 3600.0 * c.limits.exposure_duty_max);
    "SR-40" ExposureDose [SquareMetrePerSecond] "With a human finger, the squared velocity summed over the last hour stays below its limit." => |c| above(last_hour(c).map(|(_, dose)| dose), c.limits.exposure_dose_max_m2_s);
    "SR-41" AmplitudeSaturated [Count] "An amplitude at the end of its range in two states in a row switches off." => |c| broken(c.watch.amplitude_saturated_in_a_row >= 2, f64::from(c.watch.amplitude_saturated_in_a_row), 2.0);
    "SR-42" AmplitudeFrozen [Count] "While the plate is driven, a measured amplitude that has noise does not repeat its raw value more often than that allows." => amplitude_frozen;
    "SR-43" LoadImplausible [Newton] "Normal force, either sign, stays below 1.5 times the load that the stage is commanded to apply and 0.3 N, also when it is commanded to lift off." => load_plausible;
}

fn broken(is: bool, value: f64, bound: f64) -> Option<(f64, f64)> {
    is.then_some((value, bound))
}

fn above(value: Option<f64>, bound: f64) -> Option<(f64, f64)> {
    value.filter(|v| *v > bound).map(|v| (v, bound))
}

/// A loop that was stopped for longer than an amplifier's own watchdog waits has lost its rig, not just a
/// deadline. Stalls of a shared virtual machine were measured at 6 to 21 ms at worst.
const SUSPENDED_CYCLES: f64 = 50.0;
/// Below this share of the samples that are due a channel is as good as lost.
const LOSSY_SHARE: f64 = 0.25;
/// Below this share it is remarked: of a channel that loses 30 %, one window of a hundred in 1500 is above it.
const REMARKED_SHARE: f64 = 0.85;

/// What is remarked, worst first.
pub(super) fn remark(c: &Context<'_>) -> Option<Remark> {
    let sags = c.watch.enabled
        && match c.watch.envelope.over() {
            Some(over) => over.shown_pp_m.is_some_and(|w| w < 0.7 * over.mean_pp_m),
            None => {
                c.now.since(c.watch.commanded_since) > c.limits.timing.response()
                    && amplitude_pp_m(c).is_some_and(|w| w < 0.7 * c.watch.commanded_pp_m)
            }
        };
    let lossy = |watch: &ForceWatch| watch.share_came < REMARKED_SHARE;
    let (lateral, normal) = (lossy(&c.watch.lateral), lossy(&c.watch.normal));
    let worst_first =
        [(sags, Remark::AmplitudeSags), (lateral, Remark::LateralLossy), (normal, Remark::NormalLossy)];
    worst_first.into_iter().find_map(|(is, remark)| is.then_some(remark))
}

fn lossy(c: &Context<'_>, share: f64) -> Option<(f64, f64)> {
    // Arming begins a new window: a channel that was still being opened is not lossy.
    broken(share < LOSSY_SHARE && c.armed_since.is_some(), share, LOSSY_SHARE)
}

fn following(c: &Context<'_>) -> Option<(f64, f64)> {
    let stage = c.seen.stage.ok()?;
    if c.watch.fast_stage_in_a_row >= 2 {
        return Some((stage.velocity_m_s, 1.5 * c.watch.fastest_m_s + 0.02));
    }
    let since = c.watch.moving_since?;
    let forwards = stage.velocity_m_s * c.watch.velocity_m_s.signum();
    let due = c.now.since(since).0 > STAGE_RESPONSE.0 + c.limits.timing.stage.age_limit().0;
    broken(due && forwards < 0.2 * c.watch.slowest_m_s, forwards, 0.2 * c.watch.slowest_m_s)
}

fn overforce(c: &Context<'_>, watch: &ForceWatch, limit: f64, period: Nanos) -> Option<(f64, f64)> {
    // What is shown above the limit for two sample periods is no spike, whatever its counter says.
    let shown = watch
        .over_since
        .filter(|since| c.now.since(*since).0 >= 2 * period.0.max(c.limits.timing.cycle.0))
        .map(|_| (watch.over_value, limit));
    // The sign tells a pull from a push.
    watch.believed.filter(|r| r.value.abs() > limit).map(|r| (r.value, limit)).or(shown)
}

fn saturated(watch: &ForceWatch) -> Option<(f64, f64)> {
    let (row, window) = (watch.saturated_in_a_row, watch.saturated_in_window());
    broken(row >= 2, f64::from(row), 2.0).or_else(|| broken(window >= 5, f64::from(window), 5.0))
}

/// A contact that is fitted and not known to be closed; its age against the age limit, or that it is open.
fn contact_open(c: &Context<'_>, contact: &Result<SafetyContact, NoData>) -> Option<(f64, f64, Unit)> {
    let timing = &c.limits.timing.contacts;
    match contact {
        Err(NoData::NotFitted) => None,
        Err(_) => Some((f64::INFINITY, timing.age_limit().seconds(), Unit::Second)),
        Ok(contact) if !contact.closed => Some((0.0, 1.0, Unit::Flag)),
        Ok(contact) if timing.is_fresh(contact.taken_at, c.now) => None,
        Ok(contact) => {
            Some((c.now.since(contact.taken_at).seconds(), timing.age_limit().seconds(), Unit::Second))
        }
    }
}

/// As [`contact_open`], save that what grew old while the loop stood still is not the fault of the contact.
fn to_blame(c: &Context<'_>, contact: &Result<SafetyContact, NoData>) -> Option<(f64, f64, Unit)> {
    contact_open(c, contact).filter(|(.., unit)| *unit == Unit::Flag || stood_still(c).is_none())
}

fn stood_still(c: &Context<'_>) -> Option<(f64, f64)> {
    above(Some(c.seen.lateness.seconds()), SUSPENDED_CYCLES * c.limits.timing.cycle.seconds())
}

fn dead_man(c: &Context<'_>) -> Option<(f64, f64)> {
    let confirmed = c.armed_since.is_some() || c.watch.hand_let_go;
    broken(c.limits.human_contact && !(c.watch.hand_holds && confirmed), 0.0, 1.0)
}

fn exposure(c: &Context<'_>) -> Option<(f64, f64)> {
    let in_one_go = c.watch.exposure.in_one_go.seconds();
    broken(c.limits.human_contact && in_one_go > c.limits.exposure_max_s, in_one_go, c.limits.exposure_max_s)
}

/// Time driven in the last hour and its dose, with a human finger: without one nobody is exposed, and nothing is summed.
fn last_hour(c: &Context<'_>) -> Option<(f64, f64)> {
    c.limits.human_contact.then(|| {
        let (driven, dose) = c.watch.exposure.in_the_last_hour();
        (driven.seconds(), dose)
    })
}

fn supply_switch(c: &Context<'_>) -> Option<(f64, f64)> {
    let timing = &c.limits.timing.supply;
    let limit = timing.age_limit().seconds();
    match c.seen.supply {
        Err(NoData::NotFitted) if !c.limits.supply_required => None,
        Err(_) => Some((f64::INFINITY, limit)),
        Ok(state) if !timing.is_fresh(state.taken_at, c.now) => {
            Some((c.now.since(state.taken_at).seconds(), limit))
        }
        Ok(state) => {
            let cut = c.watch.supply_commanded == SupplyCommand::Cut;
            let waited = c.now.since(c.watch.supply_since);
            broken(state.cut != cut && waited > SUPPLY_ACTS, waited.seconds(), SUPPLY_ACTS.seconds())
        }
    }
}

fn unguarded(c: &Context<'_>) -> Option<(f64, f64)> {
    let absent = Err(NoData::NotFitted);
    let (supply, contacts) = (c.seen.supply.is_err_and(|e| e == NoData::NotFitted), &c.seen.contacts);
    let human = c.limits.human_contact;
    let missing = [
        (1.0, !c.limits.amplifier_watchdog && supply),
        (2.0, human && supply),
        (3.0, human && contacts.emergency_stop == absent),
        (4.0, human && contacts.dead_man == absent && !c.limits.dead_man_key),
        (5.0, human && !c.limits.amplifier_watchdog && !c.limits.supply_watchdog),
    ];
    missing.into_iter().find(|(_, is)| *is).map(|(which, _)| (which, 0.0))
}

fn amplitude_frozen(c: &Context<'_>) -> Option<(f64, f64)> {
    let most = c.limits.amplitude_frozen_after?;
    let equal = c.watch.amplitude_equal_in_a_row;
    broken(c.watch.enabled && equal >= most, f64::from(equal), f64::from(most))
}

/// Time within which a loading axis has applied its load or lifted off.
const LOAD_SETTLES: Nanos = Nanos(2_000_000_000);
/// Force in N that may stand on a sensor without a load: its zero, and the weight of what is mounted on it.
const LOAD_ZERO_N: f64 = 0.3;
/// What a loading axis may overshoot for ever, beside that.
const LOAD_FACTOR: f64 = 1.5;

fn load_plausible(c: &Context<'_>) -> Option<(f64, f64)> {
    let settled = c.limits.load_commanded && c.now.since(c.watch.load_since) > LOAD_SETTLES;
    let force = c.watch.normal.believed.map(|r| r.value.abs()).filter(|_| settled && c.watch.normal.usable);
    above(force, LOAD_FACTOR * c.watch.load_n + LOAD_ZERO_N)
}

/// A reading at the end of its range is a lower bound of the truth: what it breaks is broken.
fn amplitude_pp_m(c: &Context<'_>) -> Option<f64> {
    c.seen.amplifier.ok()?.amplitude.ok().map(|r| r.value)
}

/// An amplitude is not negative; the noise of a sensor at rest may make it a little so.
const AMPLITUDE_NOISE_M: f64 = -0.3e-6;

fn is_numeric(a: &AmplifierState) -> bool {
    a.amplitude.map_or(true, |r| r.value >= AMPLITUDE_NOISE_M && r.value.is_finite())
        && a.echoed_frequency_hz.is_finite()
        && a.echoed_amplitude.metres().is_finite()
}

fn stale(channel: &Channel, limit: Nanos, now: Nanos) -> Option<(f64, f64)> {
    match channel {
        Ok(reading) => above(Some(reading.age(now).seconds()), limit.seconds()),
        Err(NoData::Invalid | NoData::Corrupt) => None, // the rule for invalid samples counts these
        Err(_) => Some((f64::INFINITY, limit.seconds())),
    }
}

fn state_stale(taken_at: Result<Nanos, NoData>, limit: Nanos, now: Nanos) -> Option<(f64, f64)> {
    match taken_at {
        // A stamp ahead of the loop's time would never grow old.
        Ok(at) if at > now.plus(limit) => Some((f64::INFINITY, limit.seconds())),
        Ok(at) => above(Some(now.since(at).seconds()), limit.seconds()),
        Err(_) => Some((f64::INFINITY, limit.seconds())),
    }
}

fn frozen(c: &Context<'_>, equal: u32) -> Option<(f64, f64)> {
    broken(equal >= c.limits.frozen_after, f64::from(equal), f64::from(c.limits.frozen_after))
}

fn spikes(c: &Context<'_>) -> u32 {
    c.watch.lateral.spikes_in_window().max(c.watch.normal.spikes_in_window())
}

fn no_response(c: &Context<'_>) -> Option<(f64, f64)> {
    // Of an amplitude that changes from cycle to cycle its greatest value is compared with the mean command.
    let modulated = c.watch.envelope.over();
    let settled = c.now.since(c.watch.commanded_since) > c.limits.timing.response();
    let driven = c.watch.enabled && (settled || modulated.is_some());
    let bound = 0.2 * modulated.map_or(c.watch.commanded_pp_m, |over| over.mean_pp_m);
    // A sensor of the amplitude that is fitted and says nothing is as dead as one that says zero.
    let lost = c.seen.amplifier.is_ok_and(|a| a.amplitude.is_err_and(|why| why != NoData::NotFitted));
    if driven && lost {
        return Some((0.0, bound));
    }
    let shown = modulated.map_or_else(|| amplitude_pp_m(c), |over| over.shown_pp_m);
    shown.filter(|w| driven && *w < bound).map(|w| (w, bound))
}

fn echo(c: &Context<'_>) -> Option<(f64, f64, Unit)> {
    let state = c.seen.amplifier.ok()?;
    let modulated = c.watch.envelope.over();
    let settled = c.now.since(c.watch.commanded_since) > c.limits.timing.response();
    if !(c.watch.enabled && (settled || modulated.is_some())) {
        return None;
    }
    let amplitude = state.echoed_amplitude.metres();
    let wanted = c.watch.commanded_pp_m;
    let [low, high] = modulated.map_or([wanted; 2], |over| over.range_pp_m);
    let nearest = amplitude.clamp(low, high);
    if (amplitude - nearest).abs() > 0.02 * nearest + 5e-9 {
        return Some((amplitude, nearest, Unit::Metre));
    }
    let frequency = state.echoed_frequency_hz;
    let off = (frequency - c.watch.commanded_hz).abs() > 1.0 + 1e-4 * frequency;
    // Another master's 'off' is no harm, but it is another master's; and what is measured then is a plate at
    // rest. One that is commanded off in between may still show it.
    let on = low > 0.0 || modulated.is_none();
    let switched = (on && !state.output_on).then_some((0.0, 1.0, Unit::Flag));
    off.then_some((frequency, c.watch.commanded_hz, Unit::Hertz)).or(switched)
}

fn temperature(c: &Context<'_>) -> Option<(f64, f64)> {
    if !c.limits.temperature_fitted {
        return None;
    }
    let bound = c.limits.temperature_max_c;
    let state = c.seen.amplifier.ok()?;
    let reading = state.temperature_c.ok().map(|r| r.value).filter(|v| v.is_finite());
    above(Some(reading.unwrap_or(f64::INFINITY)), bound)
}

fn travel(c: &Context<'_>) -> Option<(f64, f64)> {
    let stage = c.seen.stage.ok()?;
    let (left, right) = c.limits.travel_m;
    let middle = 0.5 * (left + right);
    let outside = stage.position_m < left || stage.position_m > right || stage.at_limit;
    let left_side = stage.position_m < middle;
    // Only a motion back towards the middle is let through.
    let inwards = if left_side { c.request.velocity_m_s > 0.0 } else { c.request.velocity_m_s < 0.0 };
    broken(outside && !inwards, stage.position_m, if left_side { left } else { right })
}

fn overrun(c: &Context<'_>) -> Option<(f64, f64)> {
    let row = (c.watch.late_in_a_row, c.limits.late_in_a_row_max);
    if row.0 >= row.1 {
        return Some((f64::from(row.0), f64::from(row.1)));
    }
    // In the last thousand cycles, the first second after arming included.
    let (late, most) = (c.watch.late_in_window(), c.limits.late_cycles_max);
    broken(is_late(c) && c.armed_since.is_some(), f64::from(late), f64::from(most))
}

/// Whether so many deadlines were missed of late that an armed rig trips: armed now, it would do so in its first cycle.
pub(super) fn is_late(c: &Context<'_>) -> bool {
    c.watch.late_in_window() > c.limits.late_cycles_max
}

fn request(c: &Context<'_>) -> Option<(f64, f64, Unit)> {
    let (r, l) = (c.request, c.limits);
    let amplitude_max = l.amplitude_max.metres().min(HARD.amplitude_max.metres());
    let checks = [
        (r.amplitude.metres(), 0.0, amplitude_max, Unit::Metre),
        (r.velocity_m_s, -l.speed_max_m_s, l.speed_max_m_s, Unit::MetrePerSecond),
        (r.normal_force_n, 0.0, l.normal_force_max_n, Unit::Newton),
    ];
    for (value, low, high, unit) in checks {
        if !(value >= low && value <= high) {
            return Some((value, if value < low { low } else { high }, unit));
        }
    }
    let driven = r.amplitude.metres() > 0.0;
    let (low, high) = l.frequency_hz;
    let inside = r.frequency_hz >= low && r.frequency_hz <= high;
    let bound = if r.frequency_hz < low { low } else { high };
    (driven && !inside).then_some((r.frequency_hz, bound, Unit::Hertz))
}

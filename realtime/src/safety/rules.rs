//! The rules, each with its requirement identifier. Add a rule: one variant, one line in [`RULES`], one function.

use super::watch::{STAGE_RESPONSE, Watch};
use super::{Controls, HARD, Limits, Observation, Remark, Request};
use crate::ports::{AmplifierState, Channel, Nanos, NoData, Quality};
use serde::{Deserialize, Serialize};

/// Why the rig is, or would be, faulted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The rig has not been armed since it was started.
    StartUp,
    /// An operator, a signal or the end of a sweep stopped the rig.
    Stopped,
    /// The dead-man input was released in human-contact mode.
    DeadMan,
    /// Vibration on a human finger lasted too long.
    Exposure,
    /// Normal force above its limit.
    NormalOverforce,
    /// Lateral force above its limit.
    LateralOverforce,
    /// Normal force changes too fast.
    ForceRate,
    /// A lateral sample is older than its age limit, or there is none.
    LateralStale,
    /// A normal sample is older than its age limit, or there is none.
    NormalStale,
    /// Three cycles without a valid lateral sample.
    LateralInvalid,
    /// Three cycles without a valid normal sample.
    NormalInvalid,
    /// The lateral channel is at the end of its range.
    LateralSaturated,
    /// The normal channel is at the end of its range.
    NormalSaturated,
    /// The lateral channel repeats itself.
    LateralFrozen,
    /// The normal channel repeats itself.
    NormalFrozen,
    /// Five spikes within fifty cycles on either force.
    Noisy,
    /// The amplifier's state is older than its age limit, or there is none.
    AmplifierStale,
    /// The amplifier reports a fault.
    AmplifierFault,
    /// The amplifier's own watchdog has switched it off while it was to be on.
    AmplifierWatchdog,
    /// Measured amplitude above its limit.
    OverAmplitude,
    /// Measured amplitude above what was commanded.
    AmplitudeRunaway,
    /// Measured amplitude rises too fast.
    AmplitudeRate,
    /// The plate does not respond to the drive.
    DriveNoResponse,
    /// The amplifier echoes another set-point than it was given.
    EchoMismatch,
    /// The amplifier stays on although it was told to be off.
    RefusesOff,
    /// Too hot, or the temperature is not known where it must be.
    OverTemperature,
    /// The stage's state is older than its age limit, or there is none.
    StageStale,
    /// The stage reports a fault.
    StageFault,
    /// The stage is outside its travel.
    OverTravel,
    /// The loop missed too many deadlines in a row, or of a thousand.
    Overrun,
    /// A request beyond the limits.
    RequestRefused,
    /// The loop was held up for so long that nothing is known of the rig.
    Suspended,
    /// The stage does not move as it is told: stalled, or faster.
    StageNotFollowing,
    /// Most lateral samples are lost.
    LateralLossy,
    /// Most normal samples are lost.
    NormalLossy,
}

/// A rule and what it is for.
#[derive(Clone, Copy)]
pub struct Rule {
    /// Requirement identifier, stable over versions.
    pub id: &'static str,
    /// The cause that it latches.
    pub cause: Cause,
    /// What it demands, in one sentence.
    pub text: &'static str,
    check: fn(&Context<'_>) -> Option<(f64, f64)>,
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
    pub watch: &'a Watch,
    pub armed_since: Option<Nanos>,
    pub now: Nanos,
}

/// A rule that is broken, by what value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Breach {
    pub cause: Cause,
    pub value: f64,
    pub bound: f64,
}

/// The first broken rule in the order of [`RULES`].
pub(super) fn first_broken(context: &Context<'_>) -> Option<Breach> {
    RULES.iter().find_map(|rule| {
        (rule.check)(context).map(|(value, bound)| Breach { cause: rule.cause, value, bound })
    })
}

macro_rules! rules {
    ($($id:literal $cause:ident $text:literal => $check:expr;)*) => {
        /// Every rule, most urgent first.
        pub const RULES: &[Rule] = &[$(Rule { id: $id, cause: Cause::$cause, text: $text, check: $check },)*];
    };
}

rules! {
    "SR-01" Stopped "A stop switches off and latches." => |c| broken(c.controls.stop, 1.0, 0.0);
    "SR-02" DeadMan "With a human finger, releasing the dead-man input switches off." => |c| broken(c.limits.human_contact && !c.controls.dead_man, 0.0, 1.0);
    "SR-03" Exposure "With a human finger, vibration lasts no longer than the exposure limit." => exposure;
    "SR-04" NormalOverforce "Normal force stays below its limit." => |c| overforce(c, Axis::Normal);
    "SR-05" LateralOverforce "Lateral force stays below its limit, either sign." => |c| overforce(c, Axis::Lateral);
    "SR-06" ForceRate "Normal force does not change faster than its limit over two samples in a row." => |c| broken(c.watch.normal.fast_in_a_row >= 2, c.watch.normal.rate_n_s.abs(), c.limits.force_rate_max_n_s);
    "SR-07" OverAmplitude "Measured amplitude stays below its limit." => |c| above(amplitude_pp_m(c), c.limits.amplitude_max.metres());
    "SR-08" AmplitudeRunaway "Measured amplitude stays within 30 % (and 0.3 um) of what was commanded, ring-down allowed." => runaway;
    "SR-09" AmplitudeRate "Measured amplitude does not rise faster than its limit over two samples in a row." => |c| broken(c.watch.amplitude_fast_in_a_row >= 2, c.watch.amplitude_rate_m_s, c.limits.amplitude_rate_max_m_s);
    "SR-10" LateralInvalid "Three cycles without a valid lateral sample switch off." => |c| broken(c.watch.lateral.invalid_in_a_row >= 3, f64::from(c.watch.lateral.invalid_in_a_row), 3.0);
    "SR-11" NormalInvalid "Three cycles without a valid normal sample switch off." => |c| broken(c.watch.normal.invalid_in_a_row >= 3, f64::from(c.watch.normal.invalid_in_a_row), 3.0);
    "SR-12" LateralSaturated "A lateral channel at the end of its range for two cycles switches off." => |c| broken(c.watch.lateral.saturated_in_a_row >= 2, f64::from(c.watch.lateral.saturated_in_a_row), 2.0);
    "SR-13" NormalSaturated "A normal channel at the end of its range for two cycles switches off." => |c| broken(c.watch.normal.saturated_in_a_row >= 2, f64::from(c.watch.normal.saturated_in_a_row), 2.0);
    "SR-14" LateralStale "A lateral sample is no older than its own periods and latency allow." => |c| stale(&c.seen.forces.lateral, c.limits.timing.lateral.age_limit(), c.now);
    "SR-15" NormalStale "A normal sample is no older than its own periods and latency allow." => |c| stale(&c.seen.forces.normal, c.limits.timing.normal.age_limit(), c.now);
    "SR-16" LateralFrozen "A lateral channel does not repeat its raw value more often than its noise allows." => |c| frozen(c, c.watch.lateral.equal_in_a_row);
    "SR-17" NormalFrozen "A normal channel does not repeat its raw value more often than its noise allows." => |c| frozen(c, c.watch.normal.equal_in_a_row);
    "SR-18" Noisy "Fewer than five spikes in fifty cycles on either force." => |c| broken(spikes(c) >= 5, f64::from(spikes(c)), 5.0);
    "SR-19" AmplifierStale "The amplifier's state is no older than its own periods and latency allow." => |c| state_stale(c.seen.amplifier.map(|a| a.taken_at), c.limits.timing.amplifier.age_limit(), c.now);
    "SR-20" AmplifierFault "An amplifier that reports a fault, or numbers that are none, is switched off." => |c| broken(c.seen.amplifier.is_ok_and(|a| a.fault || !told_in_numbers(&a)), 1.0, 0.0);
    "SR-21" AmplifierWatchdog "An amplifier whose own watchdog has fired is switched off." => |c| broken(c.seen.amplifier.is_ok_and(|a| a.watchdog_tripped) && c.watch.enabled, 1.0, 0.0);
    "SR-22" DriveNoResponse "A driven plate vibrates: at least a fifth of the commanded amplitude after ring-up." => no_response;
    "SR-23" EchoMismatch "The amplifier echoes the set-point that it was given, within its resolution." => echo;
    "SR-24" RefusesOff "An amplifier that stays on when told to be off is cut from its supply." => |c| broken(c.watch.refuses_off(c.limits, c.now), 1.0, 0.0);
    "SR-25" OverTemperature "Plate and amplifier stay below the temperature limit; a lost sensor counts as too hot." => temperature;
    "SR-26" StageStale "The stage's state is no older than its own periods and latency allow." => |c| state_stale(c.seen.stage.map(|s| s.taken_at), c.limits.timing.stage.age_limit(), c.now);
    "SR-27" StageFault "A stage that reports a fault, or numbers that are none, is stopped." => |c| broken(c.seen.stage.is_ok_and(|s| s.fault || !(s.position_m.is_finite() && s.velocity_m_s.is_finite())), 1.0, 0.0);
    "SR-28" OverTravel "The stage stays within its travel." => travel;
    "SR-29" Overrun "The loop misses fewer deadlines in a row than its limit (three by default), and of a thousand no more than another (ten by default)." => overrun;
    "SR-30" RequestRefused "A request beyond any limit, or not finite, switches off." => request;
    "SR-31" Suspended "A cycle that begins fifty periods late switches off: the rig was alone for that time." => |c| above(Some(c.seen.lateness.seconds()), SUSPENDED_CYCLES * c.limits.timing.cycle.seconds());
    "SR-32" StageNotFollowing "The stage moves as it is told: at least a fifth of its speed after its response time, and not half as fast again." => following;
    "SR-33" LateralLossy "At least a quarter of the lateral samples that are due in a window come." => |c| lossy(c, c.watch.lateral.share_came);
    "SR-34" NormalLossy "At least a quarter of the normal samples that are due in a window come." => |c| lossy(c, c.watch.normal.share_came);
}

fn broken(is: bool, value: f64, bound: f64) -> Option<(f64, f64)> {
    is.then_some((value, bound))
}

fn above(value: Option<f64>, bound: f64) -> Option<(f64, f64)> {
    value.filter(|v| *v > bound).map(|v| (v, bound))
}

/// A loop that was stopped for longer than an amplifier's own watchdog waits has lost its rig, not just a deadline.
/// Stalls of a shared virtual machine were measured at 6 to 21 ms at worst.
const SUSPENDED_CYCLES: f64 = 50.0;
/// Below this share of the samples that are due a channel is as good as lost.
const LOSSY_SHARE: f64 = 0.25;
/// Below this share it is remarked: of a channel that loses 30 %, one window of a hundred in 1500 is above it.
const REMARKED_SHARE: f64 = 0.85;

/// What is remarked, worst first.
pub(super) fn remark(c: &Context<'_>) -> Option<Remark> {
    let sags = c.watch.enabled
        && c.now.since(c.watch.commanded_since) > response_time(c)
        && amplitude_pp_m(c).is_some_and(|w| w < 0.7 * c.watch.commanded_pp_m);
    if sags {
        Some(Remark::AmplitudeSags)
    } else if c.watch.lateral.share_came < REMARKED_SHARE {
        Some(Remark::LateralLossy)
    } else if c.watch.normal.share_came < REMARKED_SHARE {
        Some(Remark::NormalLossy)
    } else {
        None
    }
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
    let forwards = stage.velocity_m_s * c.watch.velocity_m_s().signum();
    let due = c.now.since(since).0 > STAGE_RESPONSE.0 + c.limits.timing.stage.age_limit().0;
    broken(due && forwards < 0.2 * c.watch.slowest_m_s, forwards, 0.2 * c.watch.slowest_m_s)
}

enum Axis {
    Lateral,
    Normal,
}

fn overforce(c: &Context<'_>, axis: Axis) -> Option<(f64, f64)> {
    let (watch, limit) = match axis {
        Axis::Lateral => (&c.watch.lateral, c.limits.lateral_force_max_n),
        Axis::Normal => (&c.watch.normal, c.limits.normal_force_max_n),
    };
    above(watch.believed.map(|r| r.value.abs()), limit)
}

fn exposure(c: &Context<'_>) -> Option<(f64, f64)> {
    let since = c.watch.exposed_since.filter(|_| c.limits.human_contact)?;
    above(Some(c.now.since(since).seconds()), c.limits.exposure_max_s)
}

fn amplitude_pp_m(c: &Context<'_>) -> Option<f64> {
    let state = c.seen.amplifier.ok()?;
    state.amplitude.ok().filter(|r| r.quality != Quality::Saturated).map(|r| r.value)
}

/// An amplitude is not negative; the noise of a sensor at rest may make it a little so.
const AMPLITUDE_NOISE_M: f64 = -0.3e-6;

fn told_in_numbers(a: &AmplifierState) -> bool {
    a.amplitude.map_or(true, |r| r.value >= AMPLITUDE_NOISE_M && r.value.is_finite())
        && a.echoed_frequency_hz.is_finite()
        && a.echoed_amplitude.metres().is_finite()
}

fn runaway(c: &Context<'_>) -> Option<(f64, f64)> {
    above(amplitude_pp_m(c), 1.3 * c.watch.ringing_pp_m + 0.3e-6)
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

/// Time from a new set-point until a fresh state must show it: five ring times, the state's age, two cycles.
fn response_time(c: &Context<'_>) -> Nanos {
    let t = &c.limits.timing;
    Nanos(5 * t.ring_time.0 + 2 * t.amplifier.age_limit().0 + 2 * t.cycle.0)
}

fn no_response(c: &Context<'_>) -> Option<(f64, f64)> {
    let driven = c.watch.enabled && c.now.since(c.watch.commanded_since) > response_time(c);
    let bound = 0.2 * c.watch.commanded_pp_m;
    // A sensor of the amplitude that is fitted and says nothing is as dead as one that says zero.
    let lost = c.seen.amplifier.is_ok_and(|a| a.amplitude.is_err_and(|why| why != NoData::NotFitted));
    if driven && lost {
        return Some((0.0, bound));
    }
    amplitude_pp_m(c).filter(|w| driven && *w < bound).map(|w| (w, bound))
}

fn echo(c: &Context<'_>) -> Option<(f64, f64)> {
    let state = c.seen.amplifier.ok()?;
    if !c.watch.enabled || c.now.since(c.watch.commanded_since) <= response_time(c) {
        return None;
    }
    let amplitude = state.echoed_amplitude.metres();
    let wanted = c.watch.commanded_pp_m;
    if (amplitude - wanted).abs() > 0.02 * wanted + 5e-9 {
        return Some((amplitude, wanted));
    }
    let frequency = state.echoed_frequency_hz;
    broken((frequency - c.watch.commanded_hz).abs() > 1.0 + 1e-4 * frequency, frequency, c.watch.commanded_hz)
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
    // Among the last thousand cycles, the first second after arming included.
    let (late, most) = (c.watch.late_in_window(), c.limits.late_cycles_max);
    broken(late > most && c.armed_since.is_some(), f64::from(late), f64::from(most))
}

fn request(c: &Context<'_>) -> Option<(f64, f64)> {
    let (r, l) = (c.request, c.limits);
    let amplitude_max = l.amplitude_max.metres().min(HARD.amplitude_max.metres());
    let checks = [
        (r.amplitude.metres(), 0.0, amplitude_max),
        (r.velocity_m_s, -l.speed_max_m_s, l.speed_max_m_s),
        (r.normal_force_n, 0.0, l.normal_force_max_n),
    ];
    for (value, low, high) in checks {
        if !(value >= low && value <= high) {
            return Some((value, if value < low { low } else { high }));
        }
    }
    let driven = r.amplitude.metres() > 0.0;
    let (low, high) = l.frequency_hz;
    let inside = r.frequency_hz >= low && r.frequency_hz <= high;
    broken(driven && !inside, r.frequency_hz, if r.frequency_hz < low { low } else { high })
}

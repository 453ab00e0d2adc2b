//! What must be remembered of each channel to judge it: spikes, repeats, gaps, rates.

use super::envelope::Envelope;
use super::exposure::Exposure;
use super::{ChannelTiming, Controls, Limits, Observation, SafetyDecision};
use crate::signals::{Channel, Nanos, NoData, Quality, Sample, SupplyCommand};

/// Memory of one force channel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ForceWatch {
    /// The last sample that was believed.
    pub believed: Option<Sample>,
    /// The value before it, for rates.
    earlier: Option<Sample>,
    /// A far-off sample that the next one must confirm.
    suspect: bool,
    /// New samples in a row with the same raw counts.
    pub equal_in_a_row: u32,
    /// Cycles in a row without a sample to believe: invalid ones, and a far-off one that waits for its confirmation.
    pub invalid_in_a_row: u32,
    /// Cycles in a row at the end of the range.
    pub saturated_in_a_row: u32,
    /// One bit a cycle, newest lowest: was it at the end of the range?
    saturated: u64,
    /// Since when every value shown is above the limit, believed or not, and the last of them: a counter that
    /// stands still, or a sample at the end of its range, hides no overforce.
    pub over_since: Option<Nanos>,
    pub over_value: f64,
    /// One bit a cycle, newest lowest: was it a spike?
    spikes: u64,
    /// N/s over the last two believed samples, and how often in a row it was above the limit.
    pub rate_n_s: f64,
    pub fast_in_a_row: u32,
    /// Whether this cycle's value may enter an estimate.
    pub usable: bool,
    last_sequence: u32,
    last_raw: i64,
    /// Samples due and come in the present window, and the share that came in the last whole one.
    due: f64,
    came: f64,
    pub share_came: f64,
}

/// Samples due in a window of the rule for lost samples.
const LOSS_WINDOW: f64 = 100.0;

/// Cycles that the rules for repeated spikes and saturation look back on.
const SPIKE_WINDOW: u32 = 50;

const fn bits_in_window(bits: u64) -> u32 {
    (bits & ((1 << SPIKE_WINDOW) - 1)).count_ones()
}

impl ForceWatch {
    /// Counts the samples that are due: no cycle can see more than one.
    fn expect(&mut self, cycle: Nanos, period: Nanos) {
        self.due += (cycle.seconds() / period.seconds().max(1e-9)).min(1.0);
        if self.due >= LOSS_WINDOW {
            self.share_came = self.came / self.due;
            (self.due, self.came) = (0.0, 0.0);
        }
    }

    /// Begins a new window: what was lost while the channel was being opened is no fault of the armed rig.
    pub(super) fn forget_losses(&mut self) {
        (self.due, self.came, self.share_came) = (0.0, 0.0, 1.0);
    }

    fn new() -> Self {
        ForceWatch { share_came: 1.0, ..Self::default() }
    }

    pub(super) const fn spikes_in_window(&self) -> u32 {
        bits_in_window(self.spikes)
    }

    pub(super) const fn saturated_in_window(&self) -> u32 {
        bits_in_window(self.saturated)
    }

    /// Takes a cycle's channel; timing and largest force are those of its axis.
    fn look(&mut self, channel: &Channel, limits: &Limits, axis: (&ChannelTiming, f64), now: Nanos) {
        let (timing, force_max_n) = axis;
        let age_limit = timing.age_limit();
        self.spikes <<= 1;
        self.saturated <<= 1;
        if let Ok(reading) = channel {
            let over = reading.value.abs() > force_max_n;
            self.over_since = if over { self.over_since.or(Some(now)) } else { None };
            self.over_value = reading.value;
        }
        self.usable = false;
        self.expect(limits.timing.cycle, timing.period);
        let reading = match channel {
            // A stamp ahead of the loop's time would never grow old: such a sample has no known age.
            Ok(reading)
                if reading.value.is_finite()
                    && !reading.value.is_subnormal()
                    && reading.taken_at <= now.plus(age_limit) =>
            {
                reading
            }
            _ => {
                self.invalid_in_a_row = self.invalid_in_a_row.saturating_add(1);
                return;
            }
        };
        if reading.quality == Quality::Saturated {
            self.invalid_in_a_row = 0;
            self.saturated_in_a_row = self.saturated_in_a_row.saturating_add(1);
            self.saturated |= 1;
            return;
        }
        self.saturated_in_a_row = 0;
        let fresh = reading.age(now) <= age_limit;
        // Every channel counts its samples: the same count is the same sample, not a frozen value.
        if self.believed.is_some() && reading.sequence == self.last_sequence {
            self.usable = fresh && !self.suspect;
            // An old sample that still stands ends a row of invalid ones; one that waits to be confirmed does not.
            self.invalid_in_a_row = if self.suspect { self.invalid_in_a_row } else { 0 };
            return;
        }
        // Late and overtaken: the newer one has been seen already, and this one counts as lost.
        if self.believed.is_some_and(|b| reading.taken_at < b.taken_at) {
            return;
        }
        self.came += 1.0;
        let repeats = self.believed.is_some() && reading.raw == self.last_raw;
        self.equal_in_a_row = if repeats { self.equal_in_a_row.saturating_add(1) } else { 0 };
        (self.last_sequence, self.last_raw) = (reading.sequence, reading.raw);

        let far = self.believed.is_some_and(|b| (reading.value - b.value).abs() > limits.force_step_max_n);
        if far && !self.suspect {
            // One far-off sample is a spike until a second one confirms it.
            self.suspect = true;
            self.spikes |= 1;
            self.invalid_in_a_row = self.invalid_in_a_row.saturating_add(1);
            return;
        }
        self.suspect = false;
        self.invalid_in_a_row = 0;
        self.earlier = self.believed;
        self.believed = Some(*reading);
        if let Some(before) = self.earlier {
            let dt = reading.taken_at.since(before.taken_at).seconds();
            let rate = if dt > 0.0 { (reading.value - before.value) / dt } else { 0.0 };
            // Up and down again is a small spike; only a force that goes on one way is on its way somewhere.
            let onwards = rate * self.rate_n_s > 0.0;
            let fast = rate.abs() > limits.force_rate_max_n_s;
            self.fast_in_a_row = match (fast, onwards) {
                (true, true) => self.fast_in_a_row.saturating_add(1),
                (true, false) => 1,
                (false, _) => 0,
            };
            self.rate_n_s = rate;
        }
        self.usable = fresh;
    }
}

/// Cycles of overrun bookkeeping: a thousand cycles in buckets of a hundred.
const BUCKETS: usize = 10;
const BUCKET_CYCLES: u32 = 100;

/// Everything safety remembers. `Copy`: no heap, no lock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SafetyMemory {
    pub lateral: ForceWatch,
    pub normal: ForceWatch,
    /// Deadlines missed in a row.
    pub late_in_a_row: u32,
    late: [u32; BUCKETS],
    filled: u32,
    bucket: usize,
    /// The drive as last commanded, and since when it has been that (to the micrometre of amplitude).
    pub commanded_pp_m: f64,
    pub commanded_hz: f64,
    pub commanded_since: Nanos,
    pub enabled: bool,
    /// When the output was commanded off; `None` while it is commanded on.
    pub off_since: Option<Nanos>,
    /// How long and how strongly the plate was driven.
    pub exposure: Exposure,
    amplitude: Option<Sample>,
    /// States in a row whose amplitude was at the end of its range, and whose raw amplitude was that before.
    pub amplitude_saturated_in_a_row: u32,
    pub amplitude_equal_in_a_row: u32,
    /// m/s over the last two amplitude samples.
    pub amplitude_rate_m_s: f64,
    pub amplitude_fast_in_a_row: u32,
    /// The amplitudes of the last while, where they change from cycle to cycle.
    pub envelope: Envelope,
    /// The amplifier's last report of its output.
    amplifier_on: bool,
    /// Highest amplitude commanded within the last ring-down: measured may still be that high.
    pub ringing_pp_m: f64,
    /// Velocity as last commanded in m/s, and since when its sign and at least its speed stand.
    pub velocity_m_s: f64,
    pub moving_since: Option<Nanos>,
    /// Slowest speed commanded since then, and the fastest within the stage's response time, in m/s.
    pub slowest_m_s: f64,
    pub fastest_m_s: f64,
    /// States in a row in which the stage was faster than commanded.
    pub fast_stage_in_a_row: u32,
    stage_sequence: u32,
    /// Normal load as last commanded in N, and since when.
    pub load_n: f64,
    pub load_since: Nanos,
    /// The last command to the second channel, and since when.
    pub supply_commanded: SupplyCommand,
    pub supply_since: Nanos,
    /// Whether the dead-man device is held, and whether it was seen released since the last trip: a hand that
    /// lets go and grips again is a person who confirms.
    pub hand_holds: bool,
    pub hand_let_go: bool,
}

/// Time within which a stage follows a new velocity: the slowest one for a reversal at full speed, and the
/// age of its state.
pub(super) const STAGE_RESPONSE: Nanos = Nanos(300_000_000);
/// Speeds below this are approach and hold: a stage may rest at them, m/s.
pub(super) const CREEP_M_S: f64 = 1.5e-3;

impl SafetyMemory {
    pub(super) fn new() -> Self {
        SafetyMemory {
            lateral: ForceWatch::new(),
            normal: ForceWatch::new(),
            off_since: Some(Nanos(0)),
            supply_commanded: SupplyCommand::Restore,
            ..Self::default()
        }
    }

    /// Deadlines missed in the last thousand cycles or so.
    pub(super) fn late_in_window(&self) -> u32 {
        self.late.iter().sum()
    }

    pub(super) fn look(&mut self, limits: &Limits, seen: &Observation, controls: Controls, now: Nanos) {
        let timing = &limits.timing;
        let [lateral, normal] = [limits.lateral_force_max_n, limits.normal_force_max_n];
        self.lateral.look(&seen.forces.lateral, limits, (&timing.lateral, lateral), now);
        self.normal.look(&seen.forces.normal, limits, (&timing.normal, normal), now);
        self.hand_holds = match seen.contacts.dead_man {
            Ok(contact) => contact.closed && timing.contacts.is_fresh(contact.taken_at, now),
            Err(NoData::NotFitted) => limits.dead_man_key && controls.dead_man,
            Err(_) => false,
        };
        self.hand_let_go |= !self.hand_holds;

        let missed = if seen.lateness > timing.cycle { seen.missed(timing.cycle) } else { 0 };
        self.late_in_a_row = if missed > 0 { self.late_in_a_row.saturating_add(missed) } else { 0 };
        if self.filled == BUCKET_CYCLES {
            self.bucket = (self.bucket + 1) % BUCKETS;
            self.late[self.bucket] = 0;
            self.filled = 0;
        }
        self.filled += 1;
        self.late[self.bucket] = self.late[self.bucket].saturating_add(missed);

        self.envelope.begin(controls.modulated, timing.response(), now);
        if let Ok(state) = seen.amplifier {
            self.amplifier_on = state.output_on;
        }
        if let Ok(reading) = seen.amplifier.and_then(|state| state.amplitude) {
            if let Some(before) = self.amplitude
                && reading.sequence != before.sequence
            {
                let stands = before.taken_at >= self.commanded_since || controls.modulated;
                let equal = reading.raw == before.raw && self.enabled && stands;
                self.amplitude_equal_in_a_row =
                    if equal { self.amplitude_equal_in_a_row.saturating_add(1) } else { 0 };
                let dt = reading.taken_at.since(before.taken_at).seconds();
                self.amplitude_rate_m_s = if dt > 0.0 { (reading.value - before.value) / dt } else { 0.0 };
                let fast = self.amplitude_rate_m_s > limits.amplitude_rate_max_m_s;
                self.amplitude_fast_in_a_row = if fast { self.amplitude_fast_in_a_row + 1 } else { 0 };
            }
            let saturated = reading.quality == Quality::Saturated;
            if self.amplitude.is_none_or(|before| before.sequence != reading.sequence) {
                self.amplitude_saturated_in_a_row =
                    if saturated { self.amplitude_saturated_in_a_row.saturating_add(1) } else { 0 };
            }
            self.amplitude = Some(reading);
            self.envelope.shown(reading.value);
        }
        let w = self.amplitude.map_or(0.0, |r| r.value).max(self.commanded_pp_m);
        let velocity_rms_m_s = std::f64::consts::FRAC_1_SQRT_2 * std::f64::consts::PI * w * self.commanded_hz;
        let rest = Nanos::from_seconds(limits.exposure_rest_s);
        self.exposure.add(self.enabled || self.amplifier_on, velocity_rms_m_s, rest, now);
        let fade = (-timing.cycle.seconds() / STAGE_RESPONSE.seconds()).exp();
        self.fastest_m_s = (self.fastest_m_s * fade).max(self.velocity_m_s.abs());
        if let Ok(stage) = seen.stage
            && stage.sequence != self.stage_sequence
        {
            self.stage_sequence = stage.sequence;
            let fast = stage.velocity_m_s.abs() > 1.5 * self.fastest_m_s + 0.02;
            self.fast_stage_in_a_row = if fast { self.fast_stage_in_a_row + 1 } else { 0 };
        }
        // A lower set-point is on its way for as long as it may be sent and its effect may be read; then the
        // plate rings down with its own time constant. The measured amplitude is judged against that.
        let on_its_way = Nanos(timing.command_expiry.0 + timing.amplifier.age_limit().0);
        let recent = self.envelope.over().map(|over| over.range_pp_m[1]);
        if recent.is_some() || now.since(self.commanded_since) > on_its_way {
            let decay = (-timing.cycle.seconds() / timing.ring_time.seconds().max(1e-9)).exp();
            self.ringing_pp_m = (self.ringing_pp_m * decay).max(recent.unwrap_or(self.commanded_pp_m));
        }
    }

    /// The hand at the dead-man device must let go and grip again before anything is armed.
    pub(super) fn forget_the_hand(&mut self) {
        self.hand_let_go = false;
    }

    /// The supply is read back cut: whatever the amplifier reported before, its output is off.
    pub(super) fn supply_is_cut(&mut self) {
        self.amplifier_on = false;
    }

    pub(super) fn commanded(&mut self, decision: &SafetyDecision, now: Nanos) {
        let (drive, stage) = (&decision.drive, &decision.stage);
        if decision.supply != self.supply_commanded {
            (self.supply_commanded, self.supply_since) = (decision.supply, now);
        }
        if stage.normal_force_n() != self.load_n {
            (self.load_n, self.load_since) = (stage.normal_force_n(), now);
        }
        let velocity = stage.velocity_m_s();
        let same = velocity * self.velocity_m_s > 0.0 && velocity.abs() >= CREEP_M_S;
        if !same {
            self.moving_since = (velocity.abs() >= CREEP_M_S).then_some(now);
            self.slowest_m_s = velocity.abs();
        }
        self.slowest_m_s = self.slowest_m_s.min(velocity.abs());
        self.velocity_m_s = velocity;
        let amplitude = drive.amplitude().metres();
        if amplitude != self.commanded_pp_m || drive.frequency_hz() != self.commanded_hz {
            self.commanded_since = now;
        }
        self.envelope.commanded(amplitude);
        self.commanded_pp_m = amplitude;
        self.commanded_hz = drive.frequency_hz();
        self.ringing_pp_m = self.ringing_pp_m.max(amplitude);
        self.enabled = drive.enable();
        self.off_since = if drive.enable() { None } else { self.off_since.or(Some(now)) };
    }

    /// Whether the amplifier stays on although it has long been commanded off: ten cycles after a fresh state
    /// should have shown it.
    pub(super) fn refuses_off(&self, limits: &Limits, now: Nanos) -> bool {
        let grace = Nanos(limits.timing.amplifier.age_limit().0 + 10 * limits.timing.cycle.0);
        let long_off = self.off_since.is_some_and(|since| now.since(since) > grace);
        long_off && self.amplifier_on
    }
}

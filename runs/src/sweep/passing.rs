//! A pass while it slides: its samples are summed, and what they come to is compared with the model.

use super::{Event, MeasuredPass, Outcome, Reaction, State, Sweep, TRIES, sliding};
use crate::ambient::Level;
use crate::certificates::temperature::TemperatureFlag;
use crate::plan::Point;
use models::psi::PsiEq17;
use models::{Condition, Pass, PeakToPeak};
use realtime::estimate::Moments;
use realtime::ports::{Channel, Nanos};
use realtime::safety::{Request, TripCause};
use realtime::{Command, Phase, Row};

/// A channel that ends a pass with one raw value, for a tenth of `frozen_after` and a quarter of the pass, is no data.
const FROZEN_SHARES: [u32; 2] = [10, 4];

/// Raw values of a channel in a pass: the last, how many in a row are equal to it, and how many there are.
#[derive(Clone, Copy, Debug, Default)]
struct Raw {
    last: Option<(u32, i64)>,
    equal: u32,
    samples: u32,
}

impl Raw {
    fn take(&mut self, channel: &Channel) {
        let Ok(reading) = channel else { return };
        if self.last.is_some_and(|(sequence, _)| sequence == reading.sequence) {
            return;
        }
        self.equal = if self.last.is_some_and(|(_, raw)| raw == reading.raw) { self.equal + 1 } else { 1 };
        self.samples += 1;
        self.last = Some((reading.sequence, reading.raw));
    }
}

/// Sums over the steady part of a pass.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub(super) lateral: Moments,
    pub(super) normal: Moments,
    amplitude: Moments,
    speed: Moments,
    position: Moments,
    temperature: Moments,
    lateral_sequence: Option<u32>,
    /// Of the lateral and the normal channel.
    raw: [Raw; 2],
    frequency_hz: f64,
}

impl Sweep {
    /// Compares the amplifier's temperature with the certificates; what is new becomes an event.
    pub(super) fn check_temperature(&mut self, row: &Row, out: &mut Reaction) {
        let temperature_c = row.inputs.seen.amplifier.and_then(|amplifier| amplifier.temperature_c);
        let flags: Vec<TemperatureFlag> =
            self.temperature_ranges.iter().filter_map(|range| range.flag(&temperature_c)).collect();
        let before = std::mem::take(&mut self.temperature_flags);
        let point = self.points[self.next].number;
        let fresh = flags.iter().filter(|flag| !before.iter().any(|b| b.certificate == flag.certificate));
        let events = fresh.map(|flag| Event::TemperatureBeyondCertificate { point, flag: flag.clone() });
        out.events.extend(events);
        self.temperature_flags = flags;
    }

    /// Adds a row's fresh samples to the sums.
    pub(super) fn take(&mut self, row: &Row) {
        let seen = &row.inputs.seen;
        self.sums.raw[0].take(&seen.forces.lateral);
        self.sums.raw[1].take(&seen.forces.normal);
        if let (true, Ok(lateral), Ok(normal)) = (row.usable, &seen.forces.lateral, &seen.forces.normal)
            && self.sums.lateral_sequence != Some(lateral.sequence)
        {
            self.sums.lateral_sequence = Some(lateral.sequence);
            self.sums.lateral.push(lateral.value);
            self.sums.normal.push(normal.value);
        }
        if let Ok(amplifier) = &seen.amplifier {
            if let Ok(amplitude) = &amplifier.amplitude {
                self.sums.amplitude.push(amplitude.value);
            }
            if let Ok(temperature) = &amplifier.temperature_c {
                self.sums.temperature.push(temperature.value);
            }
            self.sums.frequency_hz = amplifier.echoed_frequency_hz;
        }
        if let Ok(stage) = &seen.stage {
            self.sums.speed.push(stage.velocity_m_s.abs());
            self.sums.position.push(stage.position_m);
        }
    }

    pub(super) fn measure(&mut self, row: &Row, since: Nanos, out: &mut Reaction) {
        if row.marker.phase == Phase::Measure {
            self.take(row);
            self.at_rig.during_pass();
        }
        let point = self.points[self.next];
        let remark = row.remark.filter(|_| row.marker.phase == Phase::Measure).map(|r| (point.number, r));
        if let Some((point, remark)) = remark.filter(|_| remark != self.remarked) {
            out.events.push(Event::Remarked { point, remark });
            self.remarked = Some((point, remark));
        }
        if row.now.since(since) < Nanos::from_seconds(self.times.measured_s(point.condition.speed_m_s)) {
            return;
        }
        let normal = self.sums.normal.mean().unwrap_or(0.0);
        // A pass that was never in contact says nothing about friction, and neither does a frozen sensor.
        let (least, frozen) = (0.3 * point.condition.normal_force_n, self.frozen());
        if frozen.is_some() || normal < least {
            self.tries += 1;
            let point = point.number;
            if self.tries >= TRIES {
                out.commands.push(Command::Stop);
                let no_contact = Outcome::NoContact { point, normal_n: Some(normal), least_n: Some(least) };
                self.finish(out, frozen.map_or(no_contact, |cause| Outcome::Frozen { point, cause }));
                return;
            }
            out.events.push(Event::PassRepeated { point, cause: frozen });
            self.begin_next(row, out);
            return;
        }
        self.tries = 0;
        let (pass, levels) = self.pass_of(&point, since, normal, row.now);
        let lost = levels.iter().filter_map(|level| level.planned.filter(|_| level.lost).map(|w| (level, w)));
        out.events.extend(lost.map(|(level, wanted)| Event::LevelLost {
            point: point.number,
            quantity: level.quantity.clone(),
            wanted,
            range: level.range,
        }));
        let commanded_normal_force_n = self.load_commanded.then_some(point.condition.normal_force_n);
        let measured =
            MeasuredPass { levels, commanded_normal_force_n, ..self.compare(pass, point.reference) };
        if let Some(comparison) = &measured.comparison {
            if let Some(mu0) = self.comparator.mu0() {
                out.commands.push(Command::Mu0(mu0));
            }
            if comparison.departed && !self.departed {
                self.departed = true;
                let log_evidence = comparison.log_evidence;
                out.events.push(Event::ModelDeparted { point: measured.pass.point, log_evidence });
            }
        }
        out.pass = Some(measured);
        self.edges(row, since, 0, out);
    }

    /// The channel that stood still at the end of this pass.
    fn frozen(&self) -> Option<TripCause> {
        let least =
            |raw: &Raw| self.frozen_after.div_ceil(FROZEN_SHARES[0]).max(raw.samples / FROZEN_SHARES[1]);
        let mut causes = self.sums.raw.iter().zip([TripCause::LateralFrozen, TripCause::NormalFrozen]);
        causes.find(|(raw, _)| raw.equal >= least(raw)).map(|(_, cause)| cause)
    }

    /// The edges behind a pass: off, on, off and so on, and last a turn of the stage with the drive off.
    pub(super) fn edges(&mut self, row: &Row, since: Nanos, sent: u32, out: &mut Reaction) {
        let point = self.points[self.next];
        if sent > 0 && row.now.since(since) < Nanos::from_seconds(self.times.edge_s) {
            return;
        }
        if point.edges == 0 || sent == 2 * point.edges + 2 {
            self.next += 1;
            return self.begin_next(row, out);
        }
        let (on, turned) = (sent % 2 == 1 && sent < 2 * point.edges, sent == 2 * point.edges + 1);
        let slides = sliding(&point.condition);
        let driven =
            if on { slides } else { Request { amplitude: PeakToPeak::ZERO, frequency_hz: 0.0, ..slides } };
        let velocity_m_s = if turned { -slides.velocity_m_s } else { slides.velocity_m_s };
        let request = Request { velocity_m_s, ..driven };
        out.commands.push(Command::Set(request, self.marker(Phase::Edges)));
        self.state = State::Edges { since: row.now, sent: sent + 1 };
    }

    fn pass_of(&self, point: &Point, since: Nanos, normal: f64, now: Nanos) -> (Pass, Vec<Level>) {
        let sums = &self.sums;
        let still = point.condition.amplitude == PeakToPeak::ZERO;
        let measured = sums.amplitude.mean().unwrap_or(point.condition.amplitude.metres());
        // What was planned of the air is not what was there.
        let mut air = Condition {
            ambient_pressure_pa: None,
            temperature_c: None,
            relative_humidity_pct: None,
            ..point.condition
        };
        let levels = self.at_rig.levels(&point.condition, &mut air, now);
        let condition = Condition {
            amplitude: if still { PeakToPeak::ZERO } else { PeakToPeak::from_metres(measured.max(0.0)) },
            frequency_hz: if still { point.condition.frequency_hz } else { sums.frequency_hz },
            speed_m_s: sums.speed.mean().unwrap_or(point.condition.speed_m_s),
            position_m: sums.position.mean().unwrap_or(point.condition.position_m),
            normal_force_n: normal,
            time_s: self.start_s + since.seconds(),
            ..air.within(&self.ambient)
        };
        let pass = Pass {
            normal_force_sd_n: sums.normal.sd(),
            lateral_force_sd_n: sums.lateral.sd(),
            samples: Some(sums.lateral.count()),
            // The channel's, or none: two thermometers in one column would look like a change.
            temperature_c: if self.at_rig.means[1].is_some() {
                air.temperature_c
            } else {
                sums.temperature.mean()
            },
            replicate: Some(u64::from(point.replicate)),
            session: self.session,
            // What was rendered has no steady friction: its force is in the record, cycle by cycle.
            ..Pass::at(
                u64::from(point.number),
                &condition,
                sums.lateral.mean().filter(|_| !self.renders(&point.condition)),
            )
        };
        (pass, levels)
    }

    fn compare(&mut self, pass: Pass, reference: bool) -> MeasuredPass {
        let mu0 = self.comparator.mu0().map_or(1.0, |m| m.value);
        let condition = pass.condition(mu0).within(&self.ambient);
        let comparison =
            pass.friction_force_n().and_then(|f| self.comparator.pass(&*self.model, &condition, f).ok());
        self.last_comparison = comparison.or(self.last_comparison);
        let regime = self.model.predict(&condition).ok().map(|p| p.regime);
        let known = self.comparator.mu0().filter(|_| condition.amplitude > PeakToPeak::ZERO);
        let psi_eq17 =
            known.map(|m| PsiEq17::at(&Condition { mu0: m.value, ..condition }, self.poisson_ratio).0);
        MeasuredPass {
            pass,
            reference,
            comparison,
            regime,
            psi_eq17,
            temperature_flags: self.temperature_flags.clone(),
            commanded_normal_force_n: None,
            levels: Vec::new(),
        }
    }
}

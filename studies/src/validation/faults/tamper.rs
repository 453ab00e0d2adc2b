//! What instruments show that must not be: a wrapper around the virtual rig's ports that alters what they say.

use realtime::ports::{
    Amplifier, AmplifierState, ForceSensor, Forces, Nanos, NoData, Quality, Sample, Stage, StageState,
};
use realtime::safety::{DriveCommand, StageCommand};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// What is shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tamper {
    /// The measured amplitude times a factor.
    AmplitudeTimes(f64),
    /// No measured amplitude, although one is fitted.
    AmplitudeLost,
    /// Normal force so many N higher.
    NormalStep(f64),
    /// Lateral force so many N higher.
    LateralStep(f64),
    /// Normal force rising, N/s, slowly enough for the rate limit: shown from the limit of 1.5 N on.
    NormalRamp(f64),
    /// Normal force rising, N/s, faster than the rate limit.
    NormalFast(f64),
    /// 80 degrees Celsius.
    Hot,
    /// No temperature, although one is fitted.
    TemperatureLost,
    /// The amplifier reports a fault.
    AmplifierFault,
    /// The amplifier's watchdog has fired.
    WatchdogFired,
    /// The stage beyond its travel.
    OverTravel,
    /// The stage at 0.3 m/s.
    StageFast,
    /// Both forces at zero.
    ContactLost,
    /// The measured amplitude and its raw value stand still; samples go on counting.
    AmplitudeStuck,
    /// The measured amplitude is at the end of its range, at a plausible value.
    AmplitudeRails,
    /// The normal force is at the end of its range in every other cycle.
    NormalRailsByTurns,
    /// The normal force's counter stands still, at so many N.
    NormalStuckCounter(f64),
}

/// A port with something to show from a time on; when it did so first is left in `shown` (ns; 0: not yet).
pub struct Tampered<P> {
    pub inner: P,
    pub tamper: Option<(Tamper, Nanos)>,
    pub shown: Arc<AtomicU64>,
    /// Cycles tampered with, and what is held since the first.
    pub cycles: u64,
    pub held: Option<Sample>,
}

impl<P> Tampered<P> {
    pub fn new(inner: P, tamper: Option<(Tamper, Nanos)>, shown: &Arc<AtomicU64>) -> Self {
        Tampered { inner, tamper, shown: Arc::clone(shown), cycles: 0, held: None }
    }

    fn acting(&self, now: Nanos) -> Option<(Tamper, f64)> {
        self.tamper.filter(|(_, from)| now >= *from).map(|(t, from)| (t, now.since(from).seconds()))
    }

    fn show(&self, now: Nanos) {
        let _ = self.shown.compare_exchange(0, now.0, Ordering::Relaxed, Ordering::Relaxed);
    }
}

fn shift(reading: &mut Result<Sample, NoData>, by: f64) {
    if let Ok(reading) = reading {
        reading.value += by;
        reading.raw += (by * 1e5) as i64;
    }
}

impl<P: ForceSensor> ForceSensor for Tampered<P> {
    fn read(&mut self, now: Nanos) -> Forces {
        let mut forces = self.inner.read(now);
        let Some((tamper, since)) = self.acting(now) else { return forces };
        match tamper {
            Tamper::NormalStep(by) => shift(&mut forces.normal, by),
            Tamper::LateralStep(by) => shift(&mut forces.lateral, by),
            Tamper::NormalRamp(rate) => {
                shift(&mut forces.normal, rate * since);
                if !forces.normal.is_ok_and(|r| r.value > 1.5) {
                    return forces;
                }
            }
            Tamper::NormalRailsByTurns => {
                self.cycles += 1;
                if let (Ok(normal), true) = (&mut forces.normal, self.cycles % 2 == 1) {
                    normal.quality = Quality::Saturated;
                }
            }
            Tamper::NormalStuckCounter(newtons) => {
                if let Ok(normal) = &mut forces.normal {
                    normal.value = newtons;
                    normal.sequence = self.held.get_or_insert(*normal).sequence;
                }
            }
            Tamper::NormalFast(rate) => shift(&mut forces.normal, rate * (since + 1e-3)),
            Tamper::ContactLost => {
                for reading in [&mut forces.lateral, &mut forces.normal].into_iter().flatten() {
                    // The sensor's noise stays: half a millinewton of it, from the sample's own count.
                    let noise = reading.sequence.wrapping_mul(0x9E37_79B9) >> 12;
                    reading.raw = i64::from(noise) - (1 << 19);
                    reading.value = reading.raw as f64 * 1e-9;
                }
            }
            _ => return forces,
        }
        self.show(now);
        forces
    }
}

impl<P: Amplifier> Amplifier for Tampered<P> {
    fn command(&mut self, command: DriveCommand, now: Nanos) {
        self.inner.command(command, now);
    }

    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData> {
        let mut state = self.inner.state(now)?;
        let Some((tamper, _)) = self.acting(now) else { return Ok(state) };
        match tamper {
            Tamper::AmplitudeTimes(factor) => state.amplitude.iter_mut().for_each(|a| a.value *= factor),
            Tamper::AmplitudeStuck => {
                if let Ok(amplitude) = &mut state.amplitude {
                    let held = *self.held.get_or_insert(*amplitude);
                    (amplitude.value, amplitude.raw) = (held.value, held.raw);
                }
            }
            Tamper::AmplitudeRails => state.amplitude.iter_mut().for_each(|a| a.quality = Quality::Saturated),
            Tamper::AmplitudeLost => state.amplitude = Err(NoData::Invalid),
            Tamper::Hot => state.temperature_c.iter_mut().for_each(|t| t.value = 80.0),
            Tamper::TemperatureLost => state.temperature_c = Err(NoData::Invalid),
            Tamper::AmplifierFault => state.fault = true,
            Tamper::WatchdogFired => state.watchdog_tripped = true,
            _ => return Ok(state),
        }
        self.show(now);
        Ok(state)
    }
}

impl<P: Stage> Stage for Tampered<P> {
    fn command(&mut self, command: StageCommand, now: Nanos) {
        self.inner.command(command, now);
    }

    fn state(&mut self, now: Nanos) -> Result<StageState, NoData> {
        let mut state = self.inner.state(now)?;
        let Some((tamper, _)) = self.acting(now) else { return Ok(state) };
        match tamper {
            Tamper::OverTravel => state.position_m = 0.07,
            Tamper::StageFast => state.velocity_m_s = 0.3,
            _ => return Ok(state),
        }
        self.show(now);
        Ok(state)
    }
}

//! The three ports of the loop on a world in this process, in virtual time.
//!
//! [`VirtualRig`] is all three ports on one world: nothing is shared, nothing locked. Where three separate
//! ports are wanted, [`VirtualRig::split`] shares the world between them behind a mutex: for threads beside
//! the loop, not for its real-time path. Each call first moves the world to the time it is given.

use crate::amplifier::AmplifierInput;
use crate::sensor::ForceSample;
use crate::stage::StageInput;
use crate::world::{ConfigError, World, WorldConfig};
use realtime::ports::{
    Amplifier, AmplifierState, Channel, Contacts, ForceSensor, Forces, Nanos, NoData, Quality, SafetyContact,
    SafetyInputs, Sample, Stage, StageState, SupplyCommand, SupplyState, SupplySwitch,
};
use realtime::safety::{DriveCommand, StageCommand};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A world with the loop's three ports.
pub struct VirtualRig {
    /// The world behind the ports.
    pub world: World,
}

impl VirtualRig {
    /// A rig of a configuration and a seed.
    ///
    /// # Errors
    /// A configuration that cannot be, by name.
    pub fn new(config: &WorldConfig, seed: u64) -> Result<Self, ConfigError> {
        Ok(Self { world: World::new(config, seed)? })
    }

    /// Three ports that share the world.
    pub fn split(self) -> [SharedRig; 3] {
        let shared = SharedRig(Arc::new(Mutex::new(self)));
        [shared.clone(), shared.clone(), shared]
    }
}

fn reading(sample: &ForceSample, axis: usize, unstated: Nanos) -> Channel {
    if !sample.force_n[axis].is_finite() {
        return Err(NoData::Invalid);
    }
    Ok(Sample {
        value: sample.force_n[axis],
        raw: i64::from(sample.counts[axis]),
        taken_at: sample.taken_at.plus(unstated),
        sequence: sample.sequence,
        quality: if sample.saturated[axis] { Quality::Saturated } else { Quality::Good },
    })
}

impl ForceSensor for VirtualRig {
    fn read(&mut self, now: Nanos) -> Forces {
        self.world.advance_to(now);
        let unstated = Nanos::from_seconds(self.world.config.sensor.unstated_latency_s);
        let Some(sample) = self.world.force_sample() else { return Forces::missing(NoData::NeverRead) };
        Forces { lateral: reading(&sample, 0, unstated), normal: reading(&sample, 1, unstated) }
    }
}

impl Amplifier for VirtualRig {
    fn command(&mut self, command: DriveCommand, now: Nanos) {
        self.world.advance_to(now);
        if now <= command.expires_at() {
            self.world.command_amplifier(AmplifierInput {
                amplitude: command.amplitude(),
                frequency_hz: command.frequency_hz(),
                enable: command.enable(),
                heartbeat: command.sequence(),
            });
        }
    }

    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData> {
        self.world.advance_to(now);
        let status = self.world.amplifier_status().ok_or(NoData::NeverRead)?;
        let channel = |value: f64, raw: i64| {
            let (taken_at, sequence) = (status.taken_at, status.sequence);
            Ok(Sample { value, raw, taken_at, sequence, quality: Quality::Good })
        };
        Ok(AmplifierState {
            amplitude: channel(status.measured_pp_m, status.measured_counts),
            echoed_amplitude: status.echoed_amplitude,
            echoed_frequency_hz: status.echoed_frequency_hz,
            output_on: status.output_on,
            watchdog_tripped: status.watchdog_tripped,
            fault: status.fault || !status.supply_closed,
            temperature_c: channel(status.temperature_c, (status.temperature_c * 10.0).round() as i64),
            taken_at: status.taken_at,
            sequence: status.sequence,
        })
    }
}

impl SupplySwitch for VirtualRig {
    fn command(&mut self, command: SupplyCommand, now: Nanos) {
        self.world.advance_to(now);
        match command {
            SupplyCommand::Cut => self.world.amplifier.cut_supply(),
            SupplyCommand::Restore => self.world.amplifier.supply_closed = true,
        }
    }

    fn state(&mut self, now: Nanos) -> Result<SupplyState, NoData> {
        self.world.advance_to(now);
        let taken_at = self.world.now();
        Ok(SupplyState { cut: !self.world.amplifier.supply_closed, taken_at, sequence: taken_at.0 as u32 })
    }
}

impl SafetyInputs for VirtualRig {
    fn read(&mut self, now: Nanos) -> Contacts {
        self.world.advance_to(now);
        let (operator, taken_at) = (self.world.operator, self.world.now());
        let contact = |closed| Ok(SafetyContact { closed, taken_at, sequence: taken_at.0 as u32 });
        Contacts {
            emergency_stop: contact(!operator.presses_emergency_stop),
            interlock: contact(!operator.opens_guard),
            dead_man: contact(operator.holds_dead_man_from.is_some_and(|from| taken_at >= from)),
        }
    }
}

impl Stage for VirtualRig {
    fn command(&mut self, command: StageCommand, now: Nanos) {
        self.world.advance_to(now);
        if now <= command.expires_at() {
            self.world.command_stage(StageInput {
                velocity_m_s: command.velocity_m_s(),
                normal_force_n: command.normal_force_n(),
            });
        }
    }

    fn state(&mut self, now: Nanos) -> Result<StageState, NoData> {
        self.world.advance_to(now);
        self.world.stage_status().ok_or(NoData::NeverRead)
    }
}

/// One of three ports on a shared world.
#[derive(Clone)]
pub struct SharedRig(Arc<Mutex<VirtualRig>>);

impl SharedRig {
    /// The rig, for as long as the guard lives.
    pub fn rig(&self) -> MutexGuard<'_, VirtualRig> {
        // A world has no half-made states that outlive a panic in another port's reader.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ForceSensor for SharedRig {
    fn read(&mut self, now: Nanos) -> Forces {
        ForceSensor::read(&mut *self.rig(), now)
    }
}

/// A port that takes commands and says its state passes both on to the rig.
macro_rules! commanded {
    ($($port:ident $command:ident $state:ident;)*) => {
        $(impl $port for SharedRig {
            fn command(&mut self, command: $command, now: Nanos) {
                $port::command(&mut *self.rig(), command, now);
            }

            fn state(&mut self, now: Nanos) -> Result<$state, NoData> {
                $port::state(&mut *self.rig(), now)
            }
        })*
    };
}

commanded! {
    Amplifier DriveCommand AmplifierState;
    SupplySwitch SupplyCommand SupplyState;
    Stage StageCommand StageState;
}

impl SafetyInputs for SharedRig {
    fn read(&mut self, now: Nanos) -> Contacts {
        SafetyInputs::read(&mut *self.rig(), now)
    }
}

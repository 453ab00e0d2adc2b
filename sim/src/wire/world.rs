//! The virtual rig's world as the emulators meet it.

use super::{Command, Plant, Quantity};
use crate::amplifier::AmplifierInput;
use crate::defects::Forces;
use crate::room::Air;
use crate::stage::StageInput;
use crate::world::World;
use models::PeakToPeak;
use realtime::ports::{Nanos, StageState};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// An operator's hands at the virtual rig: weights to hang on the force sensor, a vibrometer to look with.
/// What they do reaches the world with the next look at it by an instrument.
#[derive(Clone, Default)]
pub struct Hands(Arc<Mutex<Shared>>);

#[derive(Clone, Copy, Default)]
struct Shared {
    hung_n: [f64; 2],
    free: Laser,
}

/// What the vibrometer shows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Laser {
    /// True peak-to-peak motion of the free plate (m).
    pub amplitude_pp_m: f64,
    /// Frequency of the drive (Hz).
    pub frequency_hz: f64,
    /// Time of the world (s).
    pub time_s: f64,
}

impl Hands {
    /// Hangs true forces on the sensor (N), lateral and normal, in place of those before.
    pub fn hang(&self, lateral_n: f64, normal_n: f64) {
        self.shared().hung_n = [lateral_n, normal_n];
    }

    /// Looks with the vibrometer.
    pub fn look(&self) -> Laser {
        self.shared().free
    }

    fn shared(&self) -> MutexGuard<'_, Shared> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A world behind the wire. Set-points arrive in blocks; what a block leaves out keeps its last value.
pub struct WorldPlant {
    world: World,
    hands: Hands,
    drive: AmplifierInput,
    motion: StageInput,
    guard: Watchdog,
    supply_guard: Watchdog,
}

/// Time that the stage moves on without a new heartbeat: twice that of the amplifier's watchdog, so that the
/// plate is quiet before the finger leaves it.
pub const STAGE_HEARTBEAT_WITHIN: Nanos = Nanos(100_000_000);
/// Time that the switch in the supply stays closed without a new heartbeat: what the profiles of watchdog
/// outputs have as `timeout_ms`.
pub const SUPPLY_HEARTBEAT_WITHIN: Nanos = Nanos(200_000_000);
const AT_REST: StageInput = StageInput { velocity_m_s: 0.0, normal_force_n: 0.0 };

/// A watchdog of the stage or of the supply's switch: where heartbeats have come and then stand still, the
/// stage stops and lifts off, or the switch opens, and takes no set-point until the heartbeat goes on. A
/// controller whose profile has no heartbeat is not watched.
#[derive(Clone, Copy)]
struct Watchdog {
    /// How long it waits.
    within: Nanos,
    /// Last heartbeat, and when it was new.
    last: Option<(f64, Nanos)>,
    lapsed: bool,
}

impl Watchdog {
    const fn new(within: Nanos) -> Self {
        Watchdog { within, last: None, lapsed: false }
    }

    fn beat(&mut self, value: f64, now: Nanos) {
        if self.last.is_none_or(|(before, _)| before != value) {
            (self.last, self.lapsed) = (Some((value, now)), false);
        }
    }

    /// When the heartbeat has stood still for too long, if that is still to come or has not been acted upon.
    fn due(&self) -> Option<Nanos> {
        self.last.filter(|_| !self.lapsed).map(|(_, since)| since.plus(self.within))
    }
}

impl WorldPlant {
    /// Puts a world behind the wire.
    pub fn new(world: World) -> Self {
        Self::at_hand(world).0
    }

    /// The same, with hands at the bench.
    pub fn at_hand(world: World) -> (Self, Hands) {
        let hands = Hands::default();
        let drive =
            AmplifierInput { amplitude: PeakToPeak::ZERO, frequency_hz: 0.0, enable: false, heartbeat: 0 };
        let guard = Watchdog::new(STAGE_HEARTBEAT_WITHIN);
        let supply_guard = Watchdog::new(SUPPLY_HEARTBEAT_WITHIN);
        (WorldPlant { world, hands: hands.clone(), drive, motion: AT_REST, guard, supply_guard }, hands)
    }
}

impl Plant for WorldPlant {
    fn advance(&mut self, now: Nanos) {
        // Whatever was hung since the last look has been there since then.
        let [lateral_n, normal_n] = self.hands.shared().hung_n;
        self.world.hung = Forces { lateral_n, normal_n };
        // The earlier of the two first.
        while let Some(due) = [&self.guard, &self.supply_guard].iter().filter_map(|g| g.due()).min()
            && due < now
        {
            self.world.advance_to(due);
            if self.supply_guard.due() == Some(due) {
                self.supply_guard.lapsed = true;
                self.world.amplifier.cut_supply();
            } else {
                self.guard.lapsed = true;
                self.motion = AT_REST;
                self.world.command_stage(AT_REST);
            }
        }
        self.world.advance_to(now);
        self.hands.shared().free = Laser {
            amplitude_pp_m: self.world.free_amplitude_pp_m(),
            frequency_hz: self.world.truth.frequency_hz,
            time_s: self.world.now().seconds(),
        };
    }

    fn measure(&mut self, quantity: Quantity) -> f64 {
        let truth = |is: bool| f64::from(u8::from(is));
        let unknown = f64::NAN;
        let force = self.world.force_sample();
        let drive = self.world.amplifier_status();
        let stage = self.world.stage_status();
        let of_force = |f: fn(&crate::sensor::ForceSample) -> f64| force.as_ref().map_or(unknown, f);
        let of_drive = |f: fn(&crate::amplifier::AmplifierStatus) -> f64| drive.as_ref().map_or(unknown, f);
        let of_stage = |f: fn(&StageState) -> f64| stage.as_ref().map_or(unknown, f);
        match quantity {
            Quantity::LateralForce => of_force(|s| s.force_n[0]),
            Quantity::NormalForce => of_force(|s| s.force_n[1]),
            Quantity::ForceSample => of_force(|s| f64::from(s.sequence)),
            Quantity::ForceTime => of_force(|s| s.device_time.seconds()),
            Quantity::ForceSaturated => truth(force.is_some_and(|s| s.saturated[0] || s.saturated[1])),
            Quantity::ForceFault => 0.0,
            Quantity::Amplitude => of_drive(|s| s.measured_pp_m),
            Quantity::Frequency | Quantity::FrequencySetPoint => of_drive(|s| s.echoed_frequency_hz),
            Quantity::AmplitudeSetPoint => of_drive(|s| s.echoed_amplitude.metres()),
            Quantity::Temperature => of_drive(|s| s.temperature_c),
            Quantity::OutputOn => truth(drive.is_some_and(|s| s.output_on)),
            Quantity::WatchdogTripped => truth(drive.is_some_and(|s| s.watchdog_tripped)),
            Quantity::DriveFault => truth(drive.is_some_and(|s| s.fault || !s.supply_closed)),
            Quantity::Heartbeat => f64::from(self.drive.heartbeat),
            Quantity::DriveCount => of_drive(|s| f64::from(s.sequence)),
            Quantity::DriveTime => of_drive(|s| s.taken_at.seconds()),
            Quantity::Position => of_stage(|s| s.position_m),
            Quantity::Velocity => of_stage(|s| s.velocity_m_s),
            Quantity::VelocitySetPoint => self.motion.velocity_m_s,
            Quantity::LoadSetPoint => self.motion.normal_force_n,
            Quantity::AtLimit => truth(stage.is_some_and(|s| s.at_limit)),
            Quantity::StageFault => truth(stage.is_some_and(|s| s.fault)),
            Quantity::StageCount => of_stage(|s| f64::from(s.sequence)),
            Quantity::StageTime => of_stage(|s| s.taken_at.seconds()),
            Quantity::SupplyClosed => truth(self.world.amplifier.supply_closed),
            Quantity::EmergencyStop => truth(!self.world.operator.presses_emergency_stop),
            Quantity::Interlock => truth(!self.world.operator.opens_guard),
            Quantity::DeadMan => {
                let now = self.world.now();
                truth(self.world.operator.holds_dead_man_from.is_some_and(|from| now >= from))
            }
            Quantity::AmbientPressure => self.world.room.of(Air::Pressure),
            Quantity::AirTemperature => self.world.room.of(Air::Temperature),
            Quantity::RelativeHumidity => self.world.room.of(Air::Humidity),
            Quantity::DeviceTime => self.world.now().seconds(),
            // The emulator counts its own reads; the world knows nothing of them.
            Quantity::DeviceReads => 0.0,
        }
    }

    fn command(&mut self, commands: &[(Command, f64)]) {
        let (mut drives, mut moves) = (false, false);
        for &(command, value) in commands {
            match command {
                Command::Amplitude => self.drive.amplitude = PeakToPeak::from_metres(value),
                Command::Frequency => self.drive.frequency_hz = value,
                Command::Enable => self.drive.enable = value != 0.0,
                Command::DriveHeartbeat => self.drive.heartbeat = value as u32,
                Command::Velocity => self.motion.velocity_m_s = value,
                Command::NormalForce => self.motion.normal_force_n = value,
                Command::StageHeartbeat => self.guard.beat(value, self.world.now()),
                Command::SupplyHeartbeat => self.supply_guard.beat(value, self.world.now()),
                // The switch has a wire of its own: it moves nothing else.
                Command::CloseSupply if value == 0.0 => self.world.amplifier.cut_supply(),
                Command::CloseSupply if self.supply_guard.lapsed => {}
                Command::CloseSupply => self.world.amplifier.supply_closed = true,
                Command::AmbientPressure => self.world.room.set(Air::Pressure, value),
                Command::AirTemperature => self.world.room.set(Air::Temperature, value),
                Command::RelativeHumidity => self.world.room.set(Air::Humidity, value),
            }
            drives |= matches!(command, Command::Amplitude | Command::Frequency);
            drives |= matches!(command, Command::Enable | Command::DriveHeartbeat);
            moves |= matches!(command, Command::Velocity | Command::NormalForce | Command::StageHeartbeat);
        }
        if drives {
            self.world.command_amplifier(self.drive);
        }
        if self.guard.lapsed {
            self.motion = AT_REST;
        }
        if moves {
            self.world.command_stage(self.motion);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::WorldConfig;

    fn ms(n: u64) -> Nanos {
        Nanos(n * 1_000_000)
    }

    fn slide(plant: &mut WorldPlant, beat: Option<f64>) {
        plant.command(&[(Command::Velocity, 0.02), (Command::NormalForce, 0.25)]);
        if let Some(beat) = beat {
            plant.command(&[(Command::StageHeartbeat, beat)]);
        }
    }

    #[test]
    fn a_stage_whose_heartbeat_stands_still_stops_and_lifts_off() {
        let mut plant = WorldPlant::new(World::new(&WorldConfig::ideal(), 1).unwrap());
        for n in 0..300 {
            plant.advance(ms(n));
            slide(&mut plant, Some(n as f64));
        }
        let moving = |plant: &mut WorldPlant| plant.measure(Quantity::Velocity).abs() > 1e-3;
        let loaded = |plant: &mut WorldPlant| plant.world.truth.normal_force_n > 0.01;
        plant.advance(ms(390));
        assert!(moving(&mut plant) && loaded(&mut plant), "within its time it goes on");
        // The controller is dead; the same heartbeat over and over is no life.
        for n in 391..600 {
            plant.advance(ms(n));
            slide(&mut plant, Some(299.0));
        }
        assert!(!moving(&mut plant) && !loaded(&mut plant));
        let here = plant.measure(Quantity::Position);
        plant.advance(ms(2000));
        assert!((plant.measure(Quantity::Position) - here).abs() < 1e-5);
        assert_eq!(plant.measure(Quantity::VelocitySetPoint), 0.0);
        // Nobody needs to look for it to happen in time.
        let mut unseen = WorldPlant::new(World::new(&WorldConfig::ideal(), 1).unwrap());
        slide(&mut unseen, Some(1.0));
        unseen.advance(ms(5000));
        assert!(!moving(&mut unseen) && unseen.measure(Quantity::Position).abs() < 0.02 * 0.2);
        // A living controller takes it up again.
        for n in 5001..5200 {
            unseen.advance(ms(n));
            slide(&mut unseen, Some(n as f64));
        }
        assert!(moving(&mut unseen) && loaded(&mut unseen));
    }

    #[test]
    fn a_switch_whose_heartbeat_stands_still_opens_and_stays_open_until_it_beats_again() {
        let mut plant = WorldPlant::new(World::new(&WorldConfig::ideal(), 1).unwrap());
        let closed = |plant: &mut WorldPlant, now: Nanos| {
            plant.advance(now);
            plant.measure(Quantity::SupplyClosed) == 1.0
        };
        plant.command(&[(Command::CloseSupply, 1.0)]);
        assert!(closed(&mut plant, ms(900)), "one without a heartbeat is not watched");
        for n in 901..1000 {
            plant.advance(ms(n));
            plant.command(&[(Command::CloseSupply, 1.0), (Command::SupplyHeartbeat, (n % 2) as f64)]);
        }
        assert!(closed(&mut plant, ms(999 + 200)) && !closed(&mut plant, ms(999 + 202)));
        plant.command(&[(Command::CloseSupply, 1.0), (Command::SupplyHeartbeat, 1.0)]);
        assert!(!closed(&mut plant, ms(1300)), "the same value is no life");
        plant.command(&[(Command::SupplyHeartbeat, 0.0), (Command::CloseSupply, 1.0)]);
        assert!(closed(&mut plant, ms(1301)));
    }

    #[test]
    fn a_stage_that_never_had_a_heartbeat_is_not_watched() {
        let mut plant = WorldPlant::new(World::new(&WorldConfig::ideal(), 1).unwrap());
        slide(&mut plant, None);
        plant.advance(ms(1000));
        assert!(plant.measure(Quantity::Velocity).abs() > 1e-3);
    }
}

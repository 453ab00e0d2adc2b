//! The world: fingertip, plate, amplifier, sensor and stage, stepped together in its own time.
//!
//! Time is a number handed in: [`World::advance_to`] steps to it in ticks. The same world runs in virtual
//! time (the in-process ports of `virtual_rig`) and in wall-clock time (behind the protocols of `wire`). Same
//! configuration, same seed, same inputs at the same times: same bytes.
//!
//! A tick, in order: the amplifier gives its drive, the plate follows, the stage slides and presses, the
//! contact yields its friction, the pad passes it on, the sensor feels and samples, the channels deliver.

mod config;
mod ridge_table;
mod steady;

use realtime::ports::{Nanos, StageState};

pub use crate::room::RoomConfig;
pub use config::{ConfigError, ContactMode, WorldConfig};
use ridge_table::RidgeTable;
pub use steady::{Point, steady_contact, steady_forces};

use crate::amplifier::{Amplifier, AmplifierInput, AmplifierStatus};
use crate::channel::{ChannelName, Gate};
use crate::contact::averaged::Averager;
use crate::contact::resolved::March;
use crate::contact::{Contact, Motion, Steady, StretchRecovery};
use crate::defects::{Forces, Surroundings};
use crate::finger::{Pad, VirtualFinger};
use crate::noise::Noise;
use crate::plate::Plate;
use crate::room::{Air, Room};
use crate::sensor::{ForceSample, Sensor};
use crate::stage::{Stage, StageInput};

/// What is true of the world at an instant: for scoring, never for a reader on the rig.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// Peak-to-peak amplitude under the finger (m).
    pub amplitude_pp_m: f64,
    /// Frequency of the drive (Hz).
    pub frequency_hz: f64,
    /// True normal force (N).
    pub normal_force_n: f64,
    /// Lateral force on the sensor's side of the pad, before the sensor (N), signed.
    pub lateral_force_n: f64,
    /// Velocity of the stage (m/s).
    pub velocity_m_s: f64,
    /// Position of the stage (m).
    pub position_m: f64,
    /// Share of the plate's cycle in contact (-).
    pub contact_fraction: f64,
}

/// The hands of whoever stands at the virtual rig: what its safety contacts show. At first nothing is
/// pressed, the guard shut, the dead-man device released.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operator {
    /// The emergency stop is pressed.
    pub presses_emergency_stop: bool,
    /// The guard is open.
    pub opens_guard: bool,
    /// The dead-man device is held, from this time on; `None`: never.
    pub holds_dead_man_from: Option<Nanos>,
}

/// Speeds below this are standing still (m/s).
const STILL_M_S: f64 = 1e-7;
/// Steps a period when every cycle is marched.
const MARCH_STEPS: usize = 400;

/// The virtual rig's world.
pub struct World {
    /// What it was built from, set-up defects included.
    pub config: WorldConfig,
    now: Nanos,
    tick_s: f64,
    ticks: u64,
    every: [u64; 3],
    sequence: [u32; 2],
    /// The fingertip's true properties: outside, for scoring only.
    pub finger: VirtualFinger,
    pad: Pad,
    plate: Plate,
    /// The amplifier, and the relay in its supply: a wire of its own, whatever its link does.
    pub amplifier: Amplifier,
    sensor: Sensor,
    stage: Stage,
    /// The air around the rig, and its chamber.
    pub room: Room,
    /// The hands at the safety contacts.
    pub operator: Operator,
    averager: Averager,
    march: Option<March>,
    ridge: Option<RidgeTable>,
    noise: Noise,
    strokes: u64,
    pass_factor: f64,
    contact_time_s: f64,
    /// What is true now: for scoring only.
    pub truth: Truth,
    /// Dead weights that hang on the force sensor: true forces from the next tick on (N).
    pub hung: Forces,
    known_pp_m: f64,
    forces: Gate<ForceSample>,
    amplifier_states: Gate<AmplifierStatus>,
    stage_states: Gate<StageState>,
}

impl World {
    /// A world at rest: output off, finger lifted.
    ///
    /// # Errors
    /// A configuration that cannot be, by name.
    pub fn new(config: &WorldConfig, seed: u64) -> Result<Self, ConfigError> {
        let mut config = config.clone();
        let defects = std::mem::take(&mut config.defects);
        defects.setup(&mut config);
        config.defects = defects;
        config.check()?;
        let tick_s = config.tick_ns as f64 * 1e-9;
        let every =
            [config.sensor.sample_period_s, config.amplifier.state_period_s, config.stage.state_period_s]
                .map(|period| (period / tick_s).round() as u64);
        let faults = &config.defects.channels;
        let link = |of: &str| Noise::new(seed, of);
        Ok(Self {
            now: Nanos(0),
            tick_s,
            ticks: 0,
            every,
            sequence: [0; 2],
            finger: VirtualFinger::new(&config.finger, seed),
            pad: Pad::default(),
            plate: Plate::new(config.plate),
            amplifier: Amplifier::new(config.amplifier, config.room.temperature_c),
            sensor: Sensor::new(config.sensor, tick_s, seed),
            stage: Stage::new(config.stage, seed),
            room: Room::new(&config.room),
            operator: Operator::default(),
            averager: Averager::default(),
            march: None,
            ridge: RidgeTable::of(&config)?,
            noise: Noise::new(seed, "world"),
            strokes: 0,
            pass_factor: 1.0,
            contact_time_s: 0.0,
            truth: Truth::default(),
            hung: Forces { lateral_n: 0.0, normal_n: 0.0 },
            known_pp_m: 0.0,
            forces: Gate::new(ChannelName::Force, config.sensor.latency_s, faults, link("force link")),
            amplifier_states: Gate::new(ChannelName::Amplifier, 0.0, faults, link("amplifier link")),
            stage_states: Gate::new(ChannelName::Stage, 0.0, faults, link("stage link")),
            config,
        })
    }

    /// The world's time.
    pub fn now(&self) -> Nanos {
        self.now
    }

    /// Steps to a time; a time already reached changes nothing.
    pub fn advance_to(&mut self, now: Nanos) {
        while self.now.0 + self.config.tick_ns <= now.0 {
            self.tick();
        }
    }

    fn tick(&mut self) {
        self.now = Nanos(self.now.0 + self.config.tick_ns);
        self.ticks += 1;
        let dt = self.tick_s;
        self.room.step(self.now.seconds(), dt);
        let room_c = self.room.of(Air::Temperature);
        let (drive, frequency) = self.amplifier.step(self.now, room_c, self.plate.warming_k);
        let known_pp = self.plate.step(drive, frequency, dt);
        self.known_pp_m = known_pp;
        self.stage.step(dt);
        if self.stage.strokes != self.strokes {
            self.strokes = self.stage.strokes;
            self.pass_factor = 1.0 + self.config.pass_relative_sd * self.noise.normal();
        }
        let velocity = self.stage.true_velocity_m_s();
        let normal = self.stage.normal_force_n;
        self.contact_time_s = if normal > 0.0 { self.contact_time_s + dt } else { 0.0 };
        let at = Surroundings {
            time_s: self.now.seconds(),
            contact_time_s: self.contact_time_s,
            position_m: self.stage.position_m,
            direction: if velocity < 0.0 { -1.0 } else { 1.0 },
            frequency_hz: frequency,
            normal_force_n: normal,
            ambient_pressure_pa: self.room.of(Air::Pressure),
            temperature_c: room_c + self.plate.warming_k,
        };
        let (pp, steady) = self.meet(&at, known_pp, velocity.abs(), dt);
        let limit = steady.lateral_force_n * self.pass_factor;
        let lateral = self.pad.step(self.config.finger.pad_stiffness_n_per_m, velocity, limit, dt);
        self.truth = Truth {
            amplitude_pp_m: pp,
            frequency_hz: frequency,
            normal_force_n: normal,
            lateral_force_n: lateral,
            velocity_m_s: velocity,
            position_m: at.position_m,
            contact_fraction: steady.contact_fraction,
        };
        let mut forces =
            Forces { lateral_n: lateral + self.hung.lateral_n, normal_n: normal + self.hung.normal_n };
        self.config.defects.forces(&at, &mut forces);
        let shown = self.sensor.feel(forces.lateral_n, forces.normal_n);
        if self.ticks.is_multiple_of(self.every[0]) {
            let sample = self.sensor.sample(shown, self.now);
            self.forces.offer(sample, self.now);
        }
        if self.ticks.is_multiple_of(self.every[1]) {
            self.sequence[0] = self.sequence[0].wrapping_add(1);
            let status = self.amplifier.status(known_pp, self.noise.normal(), self.now, self.sequence[0]);
            self.amplifier_states.offer(status, self.now);
        }
        if self.ticks.is_multiple_of(self.every[2]) {
            self.sequence[1] = self.sequence[1].wrapping_add(1);
            let status = self.stage.status(self.now, self.sequence[1]);
            self.stage_states.offer(status, self.now);
        }
    }

    /// The contact of this tick: amplitude under the finger (m) and the friction it yields.
    fn meet(&mut self, at: &Surroundings, known_pp: f64, speed: f64, dt: f64) -> (f64, Steady) {
        if at.normal_force_n <= 0.0 {
            self.march = None;
            return (known_pp, Steady::NONE);
        }
        let point = Point { at: *at, known_pp_m: known_pp, speed_m_s: speed.max(STILL_M_S) };
        let contact = steady_contact(&self.finger, &self.config.defects, &point);
        let pp = 2.0 * contact.sine_amplitude_m;
        if let Some(ridge) = &self.ridge {
            return (pp, ridge.steady(&contact));
        }
        // Only mass and late recovery carry anything from one cycle to the next; the march knows them for one
        // ridge on a plain sine. Every other contact is periodic from its first cycle: its steady state is
        // its every cycle.
        let remembers = contact.has_inertia() || contact.recovery != StretchRecovery::Instant;
        let plain = contact.motion == Motion::default() && contact.ridge.height_sd_m == 0.0;
        let steady = if self.config.contact == ContactMode::Averaged {
            self.averager.steady(&contact)
        } else if remembers && plain && contact.sine_amplitude_m > 1e-10 {
            self.march_tick(&contact, dt)
        } else {
            self.march = None;
            contact.steady()
        };
        (pp, steady)
    }

    /// Every cycle of this tick in turn.
    fn march_tick(&mut self, contact: &Contact, dt: f64) -> Steady {
        let march = self.march.get_or_insert_with(|| March::new(contact, MARCH_STEPS));
        let cycles = ((contact.frequency_hz * dt).round() as usize).max(1);
        let mut sum = Steady::NONE;
        for _ in 0..cycles {
            let cycle = march.cycle(contact);
            sum.lateral_force_n += cycle.lateral_n / cycles as f64;
            sum.contact_fraction += cycle.contact / cycles as f64;
        }
        sum
    }

    /// The latest force sample that has arrived; `None` before the first.
    pub fn force_sample(&mut self) -> Option<ForceSample> {
        self.forces.latest(self.now)
    }

    /// The amplifier's latest state that has arrived; `None` before the first.
    pub fn amplifier_status(&mut self) -> Option<AmplifierStatus> {
        self.amplifier_states.latest(self.now)
    }

    /// The stage's latest state that has arrived; `None` before the first.
    pub fn stage_status(&mut self) -> Option<StageState> {
        self.stage_states.latest(self.now)
    }

    /// A command reaches the amplifier (unless its link is off).
    pub fn command_amplifier(&mut self, input: AmplifierInput) {
        if self.amplifier_states.open(self.now) {
            self.amplifier.command(input, self.now);
        }
    }

    /// A command reaches the stage (unless its link is off).
    pub fn command_stage(&mut self, input: StageInput) {
        if self.stage_states.open(self.now) {
            self.stage.command(input);
        }
    }

    /// What a vibrometer beside the finger sees: the true motion of the free plate at the stage's place,
    /// peak-to-peak (m).
    pub fn free_amplitude_pp_m(&self) -> f64 {
        let at = Surroundings {
            time_s: self.now.seconds(),
            contact_time_s: 0.0,
            position_m: self.truth.position_m,
            direction: 1.0,
            frequency_hz: self.truth.frequency_hz,
            normal_force_n: 0.0,
            ambient_pressure_pa: self.room.of(Air::Pressure),
            temperature_c: self.room.of(Air::Temperature),
        };
        self.config.defects.plate(&at, self.known_pp_m)
    }
}

//! The stage: slides the plate under the finger with limited acceleration and travel, and presses the finger
//! on with a force controller of its own.

use crate::noise::{Noise, Wander};
use realtime::ports::{Nanos, StageState};
use serde::{Deserialize, Serialize};

/// What the stage is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StageConfig {
    /// Acceleration (m/s2).
    pub acceleration_m_s2: f64,
    /// Fastest speed (m/s).
    pub speed_max_m_s: f64,
    /// Ends of the travel (m).
    pub travel_m: [f64; 2],
    /// Resolution of its encoder (m).
    pub encoder_m: f64,
    /// Relative noise of the velocity that it reports (-).
    pub velocity_relative_sd: f64,
    /// Relative ripple of the true speed (-).
    pub ripple: f64,
    /// Pitch of the ripple (m).
    pub ripple_pitch_m: f64,
    /// Time constant of the normal-force controller (s).
    pub load_time_s: f64,
    /// Gap when lifted off (m).
    pub lift_gap_m: f64,
    /// Speed of the approach over the gap (m/s).
    pub approach_m_s: f64,
    /// Largest normal-force set-point taken (N).
    pub load_max_n: f64,
    /// Relative unsteadiness of the true normal force (-).
    pub load_relative_sd: f64,
    /// Correlation time of that unsteadiness (s).
    pub load_wander_s: f64,
    /// Time between two states that it publishes (s).
    pub state_period_s: f64,
    /// Fault: the slide stands still from this time on (s); negative: never.
    pub stalls_at_s: f64,
}

impl Default for StageConfig {
    fn default() -> Self {
        Self {
            acceleration_m_s2: 2.0,
            speed_max_m_s: 0.25,
            travel_m: [-0.05, 0.05],
            encoder_m: 1e-7,
            velocity_relative_sd: 1e-3,
            ripple: 0.0,
            ripple_pitch_m: 2e-3,
            load_time_s: 0.03,
            lift_gap_m: 5e-4,
            approach_m_s: 0.02,
            load_max_n: 2.0,
            load_relative_sd: 0.01,
            load_wander_s: 0.1,
            state_period_s: 1e-3,
            stalls_at_s: -1.0,
        }
    }
}

/// A set-point as the stage's inputs take it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageInput {
    /// Velocity (m/s), signed.
    pub velocity_m_s: f64,
    /// Normal force (N); not positive: lift off.
    pub normal_force_n: f64,
}

/// The stage's state.
#[derive(Clone, Debug)]
pub struct Stage {
    config: StageConfig,
    input: StageInput,
    /// True position (m).
    pub position_m: f64,
    /// True velocity without ripple (m/s).
    pub velocity_m_s: f64,
    /// True normal force (N).
    pub normal_force_n: f64,
    /// Counts strokes: one more whenever it starts moving or turns round.
    pub strokes: u64,
    at_limit: bool,
    load_n: f64,
    gap_m: f64,
    time_s: f64,
    wander: Wander,
    noise: Noise,
}

impl Stage {
    /// A stage at rest in the middle of its travel, lifted off.
    pub fn new(config: StageConfig, seed: u64) -> Self {
        let mut noise = Noise::new(seed, "stage");
        let wander = Wander::new(config.load_relative_sd, config.load_wander_s, &mut noise);
        Self {
            config,
            input: StageInput { velocity_m_s: 0.0, normal_force_n: 0.0 },
            position_m: 0.5 * (config.travel_m[0] + config.travel_m[1]),
            velocity_m_s: 0.0,
            normal_force_n: 0.0,
            strokes: 0,
            at_limit: false,
            load_n: 0.0,
            gap_m: config.lift_gap_m,
            time_s: 0.0,
            wander,
            noise,
        }
    }

    /// Takes a command. A value that is not finite leaves that set-point as it was.
    pub fn command(&mut self, input: StageInput) {
        let c = &self.config;
        if input.velocity_m_s.is_finite() {
            self.input.velocity_m_s = input.velocity_m_s.clamp(-c.speed_max_m_s, c.speed_max_m_s);
        }
        if input.normal_force_n.is_finite() {
            self.input.normal_force_n = input.normal_force_n.clamp(0.0, c.load_max_n);
        }
    }

    /// Moves on by `dt` seconds.
    pub fn step(&mut self, dt: f64) {
        self.time_s += dt;
        if self.config.stalls_at_s >= 0.0 && self.time_s >= self.config.stalls_at_s {
            self.velocity_m_s = 0.0;
        } else {
            self.slide(dt);
        }
        self.press(dt);
    }

    fn slide(&mut self, dt: f64) {
        let c = self.config;
        let [low, high] = c.travel_m;
        // Brake in time: the fastest speed from which the end can still be reached at rest.
        let room = if self.input.velocity_m_s > 0.0 { high - self.position_m } else { self.position_m - low };
        let step = 0.5 * c.acceleration_m_s2 * dt;
        let towards = (self.velocity_m_s * self.input.velocity_m_s.signum()).max(0.0);
        let left = (room - 0.5 * towards * dt).max(0.0); // once this step's first half is travelled
        let reach = (step * step + 2.0 * c.acceleration_m_s2 * left).sqrt() - step;
        let wanted = self.input.velocity_m_s.signum() * self.input.velocity_m_s.abs().min(reach);
        let change = (wanted - self.velocity_m_s).clamp(-c.acceleration_m_s2 * dt, c.acceleration_m_s2 * dt);
        let before = self.velocity_m_s;
        self.velocity_m_s =
            if wanted.abs() < 1e-9 && change == wanted - before { 0.0 } else { before + change };
        let turned = before == 0.0 || self.velocity_m_s.signum() != before.signum();
        if self.velocity_m_s != 0.0 && turned {
            self.strokes += 1;
        }
        self.position_m += 0.5 * (before + self.velocity_m_s) * dt;
        if self.position_m < low || self.position_m > high {
            self.position_m = self.position_m.clamp(low, high);
            self.velocity_m_s = 0.0;
        }
        self.at_limit = (self.position_m - low).min(high - self.position_m) < 1e-5;
    }

    fn press(&mut self, dt: f64) {
        let c = self.config;
        let wanted = self.input.normal_force_n;
        if wanted > 0.0 && self.gap_m > 0.0 {
            self.gap_m = (self.gap_m - c.approach_m_s * dt).max(0.0);
            self.load_n = 0.0;
        } else {
            self.load_n += (wanted - self.load_n) * (1.0 - (-dt / c.load_time_s).exp());
            if wanted == 0.0 && self.load_n < 1e-3 {
                self.load_n = 0.0;
                self.gap_m = (self.gap_m + c.approach_m_s * dt).min(c.lift_gap_m);
            }
        }
        let unsteady = self.wander.step(dt, &mut self.noise);
        self.normal_force_n = (self.load_n * (1.0 + unsteady)).max(0.0);
    }

    /// True velocity with the ripple of the drive (m/s).
    pub fn true_velocity_m_s(&self) -> f64 {
        if self.config.ripple == 0.0 {
            return self.velocity_m_s;
        }
        let phase = 2.0 * std::f64::consts::PI * self.position_m / self.config.ripple_pitch_m;
        self.velocity_m_s * (1.0 + self.config.ripple * phase.sin())
    }

    /// Its state.
    pub fn status(&mut self, now: Nanos, sequence: u32) -> StageState {
        let c = &self.config;
        StageState {
            position_m: (self.position_m / c.encoder_m).round() * c.encoder_m,
            velocity_m_s: self.velocity_m_s * (1.0 + c.velocity_relative_sd * self.noise.normal()),
            at_limit: self.at_limit,
            fault: false,
            taken_at: now,
            sequence,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steady() -> StageConfig {
        StageConfig { load_relative_sd: 0.0, velocity_relative_sd: 0.0, ..StageConfig::default() }
    }

    #[test]
    fn it_accelerates_no_faster_than_it_can_and_stops_at_the_end() {
        let mut stage = Stage::new(steady(), 1);
        stage.command(StageInput { velocity_m_s: 0.1, normal_force_n: 0.0 });
        let dt = 5e-4;
        let mut fastest_change = 0.0_f64;
        for _ in 0..4000 {
            let before = stage.velocity_m_s;
            stage.step(dt);
            fastest_change = fastest_change.max((stage.velocity_m_s - before).abs() / dt);
        }
        assert!(fastest_change <= 2.0 + 1e-9, "{fastest_change}");
        assert!(stage.status(Nanos(0), 0).at_limit && (stage.position_m - 0.05).abs() < 1e-5);
        assert!(stage.velocity_m_s.abs() < 1e-3);
        assert_eq!(stage.strokes, 1);
        stage.command(StageInput { velocity_m_s: -0.1, normal_force_n: 0.0 });
        for _ in 0..100 {
            stage.step(dt);
        }
        assert_eq!(stage.strokes, 2);
    }

    #[test]
    fn the_load_settles_with_its_time_constant_after_the_gap() {
        let mut stage = Stage::new(steady(), 1);
        stage.command(StageInput { velocity_m_s: 0.0, normal_force_n: 0.5 });
        let dt = 1e-4;
        let mut t = 0.0;
        while stage.normal_force_n == 0.0 {
            stage.step(dt);
            t += dt;
        }
        assert!((t - 0.025).abs() < 2e-3, "the gap of 0.5 mm at 20 mm/s takes 25 ms: {t}");
        for _ in 0..300 {
            stage.step(dt);
        }
        assert!((stage.normal_force_n / (0.5 * (1.0 - (-1.0_f64).exp())) - 1.0).abs() < 0.02);
        stage.command(StageInput { velocity_m_s: 0.0, normal_force_n: 0.0 });
        for _ in 0..3000 {
            stage.step(dt);
        }
        assert_eq!(stage.normal_force_n, 0.0);
    }
}

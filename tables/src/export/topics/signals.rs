//! What of a cycle is a curve: a topic a quantity, its unit at the end of the name.

use realtime::ports::{AmplifierState, StageState};
use realtime::{Phase, Row};

/// One curve.
pub struct Signal {
    /// Topic.
    pub topic: &'static str,
    /// What it is, in words.
    pub words: &'static str,
    /// Its value in a cycle; none where there was none.
    pub of: fn(&Row) -> Option<f64>,
    /// Holds from one change to the next: a set-point, an echo, a flag.
    pub holds: bool,
}

/// Measured, or reckoned from what is measured.
const fn signal(topic: &'static str, words: &'static str, of: fn(&Row) -> Option<f64>) -> Signal {
    Signal { topic, words, of, holds: false }
}

const fn holding(topic: &'static str, words: &'static str, of: fn(&Row) -> Option<f64>) -> Signal {
    Signal { topic, words, of, holds: true }
}

fn amplifier(row: &Row) -> Option<AmplifierState> {
    row.inputs.seen.amplifier.ok()
}

fn stage(row: &Row) -> Option<StageState> {
    row.inputs.seen.stage.ok()
}

fn flag(on: bool) -> Option<f64> {
    Some(f64::from(u8::from(on)))
}

/// The curves, in the order of a viewer's list.
pub const SIGNALS: [Signal; 25] = [
    signal("/force/lateral_force_n", "lateral force, signed as the sensor has it", |r| {
        r.inputs.seen.forces.lateral.ok().map(|f| f.value)
    }),
    signal("/force/normal_force_n", "normal force, positive in compression", |r| {
        r.inputs.seen.forces.normal.ok().map(|f| f.value)
    }),
    signal("/force/age_s", "age of the older of the two force samples at the cycle", |r| {
        let forces = r.inputs.seen.forces;
        let oldest = forces.lateral.ok()?.taken_at.min(forces.normal.ok()?.taken_at);
        Some(r.now.0.saturating_sub(oldest.0) as f64 * 1e-9)
    }),
    signal("/friction/mu_relative", "running relative friction mu' = mu / mu_0", |r| {
        r.mu_relative.ok().map(|m| m.value)
    }),
    signal("/friction/mu_relative_sd", "its standard uncertainty", |r| r.mu_relative.ok().map(|m| m.sd)),
    signal("/friction/mu_relative_predicted", "mu' that the model predicts at the measured condition", |r| {
        r.online.map(|o| o.predicted)
    }),
    signal("/friction/mu_relative_predicted_sd", "standard uncertainty of the prediction", |r| {
        r.online.map(|o| o.predicted_sd)
    }),
    signal("/friction/mu_relative_wanted", "mu' that a rendered target wants at this position", |r| {
        r.rendered.map(|rendered| rendered.wanted)
    }),
    signal("/friction/residual_z", "measured less predicted, in standard deviations", |r| {
        r.online.map(|o| o.z)
    }),
    signal("/drive/amplitude_pp_m", "amplitude as measured, peak-to-peak", |r| {
        amplifier(r)?.amplitude.ok().map(|a| a.value)
    }),
    holding("/drive/commanded_amplitude_pp_m", "amplitude commanded, peak-to-peak; zero is off", |r| {
        Some(r.drive_pp_m)
    }),
    holding("/drive/echoed_amplitude_pp_m", "set-point that the amplifier echoes, peak-to-peak", |r| {
        Some(amplifier(r)?.echoed_amplitude.metres())
    }),
    holding("/drive/commanded_frequency_hz", "frequency commanded; zero is off", |r| Some(r.drive_hz)),
    holding("/drive/echoed_frequency_hz", "frequency that the amplifier echoes", |r| {
        Some(amplifier(r)?.echoed_frequency_hz)
    }),
    holding("/drive/output_on", "1 while the amplifier's output is on", |r| flag(amplifier(r)?.output_on)),
    signal("/drive/temperature_c", "temperature of the amplifier or the plate", |r| {
        amplifier(r)?.temperature_c.ok().map(|t| t.value)
    }),
    signal("/stage/position_m", "position along the stroke", |r| Some(stage(r)?.position_m)),
    signal("/stage/velocity_m_s", "velocity as measured, signed", |r| Some(stage(r)?.velocity_m_s)),
    holding("/stage/commanded_velocity_m_s", "velocity commanded, signed", |r| Some(r.velocity_m_s)),
    holding("/stage/commanded_normal_force_n", "normal load commanded; zero is lifted off", |r| {
        Some(r.load_n)
    }),
    signal("/loop/lateness_s", "how late the cycle began", |r| Some(r.inputs.seen.lateness.0 as f64 * 1e-9)),
    holding("/safety/armed", "1 while the rig is armed", |r| flag(r.armed)),
    holding("/safety/tripped", "1 in the cycle in which a trip was latched", |r| flag(r.tripped.is_some())),
    holding("/safety/supply_cut", "1 while the supply is commanded to be cut", |r| flag(r.supply_cut)),
    holding("/sweep/point", "number of the point that the cycle belongs to; none between passes", |r| {
        let between = matches!(r.marker.phase, Phase::Idle | Phase::Zero);
        (!between).then(|| f64::from(r.marker.point))
    }),
];

//! The loading of Fig. 6: press, slide, vibrate; and what is read from it.
//!
//! The 1.8 mm of subcutaneous tissue is so soft that it carries the load like a weight: the load stands as a
//! dead load at the base of the stratum corneum, and so does the lateral force that sliding has built up
//! there. From rest that force would need tens of milliseconds at 20 mm/s. So the run starts in the
//! quasi-static slip state, and after each cycle the lateral load follows the mean friction: this skips the
//! slow drift of the soft tissue and nothing else. At the end both agree, which is checked.

use super::body::{Energy, Work};
use super::cycle::{self, BINS, RidgeCycle, Steady, mean};
use super::{Body, ContactForce, Plate, RidgeCase, RidgeError, stability};
use crate::psi::PsiEq17;
use crate::regime::Regime;
use serde::Serialize;

/// Width about the tip over which the skin's motion is averaged, m: that of the contact. (The tip node alone
/// is fragile on fine meshes; the whole 120 um of the vibrometer's spot take in the free flanks.)
pub const SPOT_M: f64 = 20e-6;
/// Time for pressing and then for reaching slip, s, each: a few crossings of the dermis by a wave.
const SETTLE_S: f64 = 60e-6;
/// Share of time in contact above which contact counts as never lost.
const FULL_CONTACT: f64 = 0.999;
/// Cycles over which the amplitude grows.
const RAMP_CYCLES: usize = 2;
/// Share of the gap to the mean friction that the lateral load takes after each cycle.
const FOLLOW: f64 = 0.5;
/// Mass added about the tip by default, as a share of the stratum corneum's: see 'Performance' in
/// `docs/ridge.md`.
pub const ADDED_MASS: f64 = 0.002;

/// How to run a case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunSettings {
    /// When to stop.
    pub steady: Steady,
    /// Time step in s; none for the largest stable one.
    pub step_s: Option<f64>,
    /// Whether to count work and energy.
    pub energy: bool,
    /// Amplitude from which the run comes, over the case's: 1 grows to it from rest, in contact for as long
    /// as possible; more comes down to it, from contact that is lost or doubled. From 1 to 10.
    pub overshoot: f64,
    /// Whether all layers move in the surface's step; otherwise the soft ones in longer ones
    /// (`stability::longer_steps`).
    pub one_step: bool,
    /// Mass added about the tip for a longer step (`stability::add_mass`), as a share of the stratum
    /// corneum's.
    pub added_mass: f64,
}

impl Default for RunSettings {
    fn default() -> Self {
        RunSettings {
            steady: Steady::default(),
            step_s: None,
            energy: true,
            one_step: false,
            added_mass: ADDED_MASS,
            overshoot: 1.0,
        }
    }
}

/// Cycles at the greater amplitude, where the run comes down to the case's.
const OVERSHOOT_CYCLES: usize = 20;

/// Work over the averaged cycles, J per metre of depth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct EnergyBalance {
    /// Given to the skin by the plate.
    pub plate_work: f64,
    /// Given by the dead loads.
    pub load_work: f64,
    /// Lost to mass damping.
    pub damping_loss: f64,
    /// Lost inside the tissue: bulk viscosity and viscous arms. Never negative in a sound run.
    pub inner_loss: f64,
    /// Change of kinetic and stored energy.
    pub stored: f64,
}

/// What a run gives.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RidgeRun {
    /// Relative friction, Eq. 5.
    pub mu_relative: f64,
    /// Standard error of `mu_relative` over pairs of cycles.
    pub mu_relative_sd: f64,
    /// Mean lateral force of the whole finger, N.
    pub lateral_force_n: f64,
    /// Mean reaction force of the whole finger, N (Eq. 4: equals the applied load).
    pub mean_reaction_force_n: f64,
    /// Greatest reaction force of the whole finger in the mean cycle, N.
    pub peak_reaction_force_n: f64,
    /// Share of time in contact.
    pub contact_fraction: f64,
    /// Phase shift of Eq. 1 in degrees, 0 to 360; zero in full contact, none without vibration.
    pub phase_shift_deg: Option<f64>,
    /// Phase of touch-down after the plate's greatest acceleration; none if contact is never lost.
    pub touch_down_deg: Option<f64>,
    /// Contact regime.
    pub regime: Regime,
    /// Whether the contact repeats only every second cycle.
    pub period_doubled: bool,
    /// Whether the averages became steady within the tolerance.
    pub steady: bool,
    /// Psi of Eq. 17.
    pub psi_eq17: f64,
    /// Psi of Eq. 16 with G/E for k_l/k_n: half of Eq. 17's.
    pub psi_eq16: f64,
    /// Cycles computed at full amplitude.
    pub cycles: usize,
    /// Cycles averaged.
    pub averaged_cycles: usize,
    /// Elements.
    pub elements: usize,
    /// Time steps.
    pub steps: usize,
    /// Time step in s.
    pub step_s: f64,
    /// Memory of the body in bytes.
    pub memory_bytes: usize,
    /// Work and energy over the averaged cycles, if requested.
    pub energy: Option<EnergyBalance>,
    /// The mean cycle, forces per metre of depth of the ridge.
    #[serde(skip)]
    pub mean_cycle: RidgeCycle,
    /// All cycles, the ramp first.
    #[serde(skip)]
    pub history: Vec<RidgeCycle>,
}

struct Rig {
    body: Body,
    plate: Plate,
    /// (node, weight) under the vibrometer's spot.
    spot: Vec<(usize, f64)>,
    /// (node, share of the ridge's width) at the base of the stratum corneum.
    base: Vec<(usize, f64)>,
    dt: f64,
    damping: f64,
    steps: usize,
    plate_work: f64,
}

impl Rig {
    fn new(case: &RidgeCase, settings: &RunSettings) -> Result<(Rig, usize), RidgeError> {
        case.check()?;
        let built = case.geometry.mesh(case.materials(), case.elements)?;
        let plate = case.plate(&built)?;
        let mesh = built.mesh;
        let surface = mesh.tributary_width_m(0);
        let spot: Vec<(usize, f64)> =
            (0..mesh.nx).filter(|i| mesh.x_m[*i].abs() <= 0.5 * SPOT_M).map(|i| (i, surface[i])).collect();
        let whole: f64 = spot.iter().map(|s| s.1).sum();
        let spot = spot.into_iter().map(|(i, w)| (i, w / whole)).collect();
        let width = mesh.tributary_width_m(built.corneum_rows);
        let start = built.corneum_rows * mesh.stride();
        let base = (0..mesh.nx).map(|i| (start + i, width[i] / mesh.width_m())).collect();
        let mut body = Body::new(mesh, case.strain);
        body.hold_top();
        body.damp_stiffness(case.stiffness_damping_s);
        body.count_energy = settings.energy;
        stability::add_mass(&mut body, &plate.penalty, settings.added_mass);
        let stable = stability::contact_step_s(&body, &plate.penalty);
        if let Some(wanted_s) = settings.step_s
            && !(wanted_s > 0.0 && wanted_s <= stable)
        {
            return Err(RidgeError::UnstableStep { wanted_s, stable_s: stable });
        }
        let bin = 1.0 / (case.frequency_hz * BINS as f64);
        let per_bin = (bin / settings.step_s.unwrap_or(stable)).ceil().max(1.0) as usize;
        let dt = bin / per_bin as f64;
        // Stiffness-proportional damping holds the step of every layer down: they all move in the surface's.
        if !settings.one_step && case.stiffness_damping_s <= 0.0 {
            body.move_in_longer_steps(&stability::longer_steps(&body, dt, case.mass_damping_per_s));
        }
        let rig =
            Rig { body, plate, spot, base, dt, damping: case.mass_damping_per_s, steps: 0, plate_work: 0.0 };
        Ok((rig, per_bin))
    }

    /// Sets the dead loads, N per metre of depth: `normal` towards the plate, `lateral` against its motion.
    fn load(&mut self, normal: f64, lateral: f64) {
        for (node, share) in &self.base {
            self.body.set_load(*node, -lateral * share, -normal * share);
        }
    }

    /// Runs `count` steps with the plate's height given by `height(step in this call)`.
    fn run(
        &mut self,
        count: usize,
        speed: f64,
        height: impl Fn(usize) -> f64,
        mut seen: impl FnMut(ContactForce),
    ) {
        let (plate, dt) = (&mut self.plate, self.dt);
        let (mut k, mut work) = (0, 0.0);
        self.body.advance(dt, self.damping, count, &mut |mut surface| {
            k += 1;
            let force = plate.touch(&mut surface, height(k), speed);
            work += force.power * dt;
            seen(force);
        });
        self.plate_work += work;
        self.steps += count;
    }

    fn skin_velocity(&self) -> f64 {
        self.spot.iter().map(|(node, weight)| weight * self.body.velocity_m_s(*node).1).sum()
    }

    /// One cycle of the plate with an amplitude going linearly from `from` to `to` (sine amplitudes, m).
    fn cycle(&mut self, per_bin: usize, speed: f64, from: f64, to: f64) -> RidgeCycle {
        let mut cycle = RidgeCycle::default();
        let total = (per_bin * BINS) as f64;
        let mut touching = 0_usize;
        for bin in 0..BINS {
            let (mut normal, mut lateral) = (0.0, 0.0);
            let before = self.skin_velocity();
            let height = |k: usize| {
                let turn = (bin * per_bin + k) as f64 / total;
                (from + (to - from) * turn) * (2.0 * std::f64::consts::PI * turn).sin()
            };
            self.run(per_bin, speed, height, |force| {
                normal += force.normal;
                lateral += force.lateral;
                touching += usize::from(force.nodes > 0);
            });
            cycle.normal[bin] = normal / per_bin as f64;
            cycle.lateral[bin] = lateral / per_bin as f64;
            cycle.skin_velocity[bin] = 0.5 * (before + self.skin_velocity());
        }
        cycle.contact_fraction = touching as f64 / total;
        cycle
    }

    fn tally(&self) -> Tally {
        Tally { energy: self.body.energy(), work: self.body.work, plate: self.plate_work }
    }
}

/// Energies and works since the start, J per metre of depth.
#[derive(Clone, Copy, Default)]
struct Tally {
    energy: Energy,
    work: Work,
    plate: f64,
}

impl Tally {
    fn since(&self, start: &Tally) -> EnergyBalance {
        let stored = |t: &Tally| t.energy.elastic + t.energy.hourglass;
        let stored = stored(self) - stored(start);
        let inner = |t: &Tally| t.work.internal + t.plate;
        EnergyBalance {
            plate_work: self.plate - start.plate,
            load_work: self.work.load - start.work.load,
            damping_loss: self.work.damping - start.work.damping,
            inner_loss: inner(self) - inner(start) - stored,
            stored: stored + self.energy.kinetic - start.energy.kinetic,
        }
    }
}

/// Runs a case to its steady state.
///
/// # Errors
/// Bad input, an unstable step, or a run that diverged.
pub fn run(case: &RidgeCase, settings: &RunSettings) -> Result<RidgeRun, RidgeError> {
    run_watched(case, settings, &mut |_| {})
}

/// The same; `each` receives the relative friction of each cycle with the whole amplitude.
///
/// # Errors
/// As [`run`].
pub fn run_watched(
    case: &RidgeCase,
    settings: &RunSettings,
    each: &mut dyn FnMut(f64),
) -> Result<RidgeRun, RidgeError> {
    let (mut rig, per_bin) = Rig::new(case, settings)?;
    let load = case.line_load_n_m();
    let settle = (SETTLE_S / rig.dt).ceil() as usize;
    // Press, at rest; then slide, pulled back by the friction that a long slide would have built up.
    rig.load(load, 0.0);
    rig.run(settle, 0.0, |_| 0.0, |_| {});
    let mut pull = if case.speed_m_s > 0.0 { case.mu0 * load } else { 0.0 };
    rig.load(load, pull);
    rig.run(settle, case.speed_m_s, |_| 0.0, |_| {});
    rig.body.is_finite()?;

    let amplitude = case.amplitude.sine_amplitude_m();
    let mut history = Vec::new();
    let over = settings.overshoot;
    RidgeError::unless((1.0..=10.0).contains(&over), "overshoot", over, "1 to 10")?;
    let first = amplitude * settings.overshoot;
    for ramp in 0..RAMP_CYCLES {
        let share = |k: usize| first * k as f64 / RAMP_CYCLES as f64;
        history.push(rig.cycle(per_bin, case.speed_m_s, share(ramp), share(ramp + 1)));
    }
    if settings.overshoot > 1.0 {
        let down = |k: usize| first + (amplitude - first) * k as f64 / RAMP_CYCLES as f64;
        let high = std::iter::repeat_n((first, first), OVERSHOOT_CYCLES);
        for (from, to) in high.chain((0..RAMP_CYCLES).map(|k| (down(k), down(k + 1)))) {
            let cycle = rig.cycle(per_bin, case.speed_m_s, from, to);
            pull += FOLLOW * (cycle.mean_lateral() - pull);
            rig.load(load, pull);
            history.push(cycle);
        }
    }
    let mut values: Vec<[f64; 2]> = Vec::new();
    let mut marks = Vec::new();
    let window = loop {
        marks.push(if settings.energy { rig.tally() } else { Tally::default() });
        let cycle = rig.cycle(per_bin, case.speed_m_s, amplitude, amplitude);
        rig.body.is_finite()?;
        let (normal, lateral) = (cycle.mean_normal(), cycle.mean_lateral());
        pull += FOLLOW * (lateral - pull);
        rig.load(load, pull);
        values.push([lateral / (case.mu0 * normal), normal / load]);
        each(lateral / (case.mu0 * normal));
        history.push(cycle);
        if let Some(window) = settings.steady.window(&values) {
            break Some(window);
        }
        if values.len() >= settings.steady.at_most {
            break None;
        }
    };
    let averaged = window.unwrap_or((values.len() / 2).max(1));
    let last = &history[history.len() - averaged..];
    let mean_cycle = RidgeCycle::average(last);
    let energy = settings.energy.then(|| rig.tally().since(&marks[marks.len() - averaged]));
    let scale = case.finger_per_ridge_m();
    let (normal, lateral) = (mean_cycle.mean_normal(), mean_cycle.mean_lateral());
    // Eqs. 3 and 5 (its first form): the ratio of the means, over mu_0.
    let mu_relative = lateral / (case.mu0 * normal);
    let pairs: Vec<f64> = values[values.len() - averaged..]
        .chunks(2)
        .map(|p| mean(&p.iter().map(|v| v[0]).collect::<Vec<_>>()))
        .collect();
    let variance =
        pairs.iter().map(|v| (v - mean(&pairs)).powi(2)).sum::<f64>() / (pairs.len() as f64 - 1.0).max(1.0);
    let vibrates = amplitude > 0.0;
    let psi = PsiEq17::at(&case.condition(), case.poisson_ratio).0;
    let touch_down_deg = mean_cycle.touch_down_deg();
    Ok(RidgeRun {
        mu_relative,
        mu_relative_sd: (variance / pairs.len() as f64).sqrt(),
        lateral_force_n: scale * lateral,
        mean_reaction_force_n: scale * normal,
        peak_reaction_force_n: scale * mean_cycle.normal.iter().fold(0.0, |a: f64, b| a.max(*b)),
        contact_fraction: mean_cycle.contact_fraction,
        // In full contact the skin goes with the plate; the peak of its acceleration is then no more than
        // the ringing of the free flanks beside the contact.
        phase_shift_deg: vibrates.then(|| match mean_cycle.contact_fraction {
            c if c > FULL_CONTACT => 0.0,
            _ => mean_cycle.phase_shift_deg(),
        }),
        touch_down_deg,
        regime: match mean_cycle.contact_fraction {
            c if c > FULL_CONTACT => Regime::FullContact,
            _ if lateral > 0.998 * case.mu0 * normal => Regime::FullSlip,
            _ => Regime::Intermittent,
        },
        period_doubled: cycle::period_doubled(last),
        steady: window.is_some(),
        psi_eq17: psi,
        psi_eq16: 0.5 * psi,
        cycles: values.len(),
        averaged_cycles: averaged,
        elements: rig.body.mesh.elements(),
        steps: rig.steps,
        step_s: rig.dt,
        memory_bytes: rig.body.memory_bytes() + history.len() * 3 * BINS * size_of::<f64>(),
        energy,
        mean_cycle,
        history,
    })
}

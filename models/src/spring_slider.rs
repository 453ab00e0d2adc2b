//! The massless spring-Coulomb slider of section 4 (Eqs. 6-15) with section 5.3's finite lateral recovery.
//!
//! Over one period the plate's phase is `phi = 2 pi f t`, zero where the plate presses most. The reaction
//! force, in units of `k_n a` (`a = w/2`, [`PeakToPeak::sine_amplitude_m`]), is `g(phi) = cos(phi) + s` where
//! that is positive and zero elsewhere (Eq. 14). The offset `s` follows from the force balance of Eq. 15 by
//! root finding, never from a table.
//!
//! The lateral stretch, in units of `mu_0 k_n a / k_l`, grows at `kappa = k_l U / (2 pi f mu_0 k_n a)` while the
//! slider sticks, and slips where it would exceed `g` (Eqs. 9-13). While it lies above `g` or contact is lost it
//! falls at no more than `rho`, the same group with the recovery speed `v_r` for `U`. The rate limit therefore
//! also binds the slip-back at and after touch-down: without that the effect of section 5.3 vanishes.
//!
//! Exact regimes: full contact where `w/2 <= F_n/k_n`; full slip (`mu' = 1`) where the slider never sticks,
//! always so for `kappa >= 1`, which is `k_l U >= pi mu_0 k_n w f`.

mod inverse;
mod stretch;

use crate::condition::{Condition, OutOfDomain};
use crate::finger::Finger;
use crate::quantity::PeakToPeak;
use crate::regime::Regime;
use crate::root;
pub use inverse::amplitude_for;
use std::f64::consts::PI;
use stretch::Stretch;

/// Static compression of the normal spring `h = F_n / k_n` in m (Eq. 6).
pub fn static_compression_m(normal_force_n: f64, normal_stiffness_n_per_m: f64) -> f64 {
    normal_force_n / normal_stiffness_n_per_m
}

/// The critical amplitude above which contact becomes intermittent (Eq. 7).
///
/// Eq. 7 reads `w_c = F_nc / k_n` with `w` the sine's amplitude of Eq. 14; as a peak-to-peak value it is
/// twice that, `2 F_n / k_n`.
pub fn critical_amplitude(normal_force_n: f64, normal_stiffness_n_per_m: f64) -> PeakToPeak {
    PeakToPeak::from_metres(2.0 * static_compression_m(normal_force_n, normal_stiffness_n_per_m))
}

/// The half contact angle `alpha` in (0, pi): the solution of Eq. 15, which for a sine reads
/// `sin(alpha) - alpha cos(alpha) = pi h / a`. Contact lasts `alpha / (pi f)`.
///
/// `compression_ratio` is `h / a`; 1 or more is full contact and gives `pi`.
pub fn half_contact_angle_rad(compression_ratio: f64) -> f64 {
    if compression_ratio >= 1.0 {
        return PI;
    }
    // The leading terms for short contact and for contact that is nearly never lost.
    let start = if compression_ratio < 0.6 {
        let short = (3.0 * PI * compression_ratio).cbrt();
        short * (1.0 + short * short / 30.0)
    } else {
        let gap = (2.0 * (1.0 - compression_ratio)).sqrt();
        PI - gap * (1.0 + gap / (3.0 * PI))
    };
    half_contact_angle_from(compression_ratio, start)
}

/// [`half_contact_angle_rad`] by Newton's method from a guess.
fn half_contact_angle_from(compression_ratio: f64, start: f64) -> f64 {
    if compression_ratio >= 1.0 {
        return PI;
    }
    let target = PI * compression_ratio;
    // For short contact the leading term alpha^3/3 is nearly exact: bracket it closely, for speed and digits.
    let upper = if target < 0.1 { (3.0 * target).cbrt() * 1.1 } else { PI };
    let excess = |alpha: f64| (contact_area(alpha) - target, alpha * alpha.sin());
    root::newton(excess, 0.0, upper, start)
}

/// `sin(alpha) - alpha cos(alpha)` without cancellation at small `alpha`.
fn contact_area(alpha: f64) -> f64 {
    if alpha < 0.2 {
        let a2 = alpha * alpha;
        alpha * a2 / 3.0 * (1.0 - a2 / 10.0 * (1.0 - a2 / 28.0 * (1.0 - a2 / 54.0)))
    } else {
        alpha.sin() - alpha * alpha.cos()
    }
}

/// The periodic steady state of the slider at one condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlipCycle {
    /// Relative friction `mu'` (Eq. 5), in [0, 1].
    pub mu_relative: f64,
    /// Mean lateral force of the cycle in N, `mu' mu_0 F_n`.
    pub lateral_force_n: f64,
    /// Mean reaction force in N; equals the applied normal force (Eq. 8).
    pub mean_reaction_force_n: f64,
    /// Contact time over period, `t_c / T`, in (0, 1].
    pub contact_fraction: f64,
    /// Time from touch-down to the slip that lasts to separation, `t_s` of Eq. 10, in s.
    /// `None` where the slider never sticks, or in full contact.
    pub slip_onset_s: Option<f64>,
    /// Eq. 1 with the slider's acceleration, which peaks just before it separates (Fig. 10), in [0, 360).
    pub phase_shift_deg: f64,
    /// Eq. 1 with the time of touch-down, the other reading of section 4.1, in [0, 360).
    pub touch_down_deg: f64,
    /// Full contact, intermittent or full slip.
    pub regime: Regime,
    groups: Groups,
}

/// The dimensionless numbers that fix a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Groups {
    stretch: Stretch,
    /// `h / a`.
    compression_ratio: f64,
}

impl Groups {
    fn of(compression_ratio: f64, alpha: f64, kappa: f64, rho: f64) -> Self {
        let always_touching = compression_ratio >= 1.0;
        let offset = if always_touching { compression_ratio } else { -alpha.cos() };
        Groups { stretch: Stretch { offset, alpha, always_touching, kappa, rho }, compression_ratio }
    }

    fn at(c: &Condition, finger: &Finger) -> Self {
        let a = c.amplitude.sine_amplitude_m();
        let kn = finger.normal_stiffness_n_per_m;
        let compression_ratio = static_compression_m(c.normal_force_n, kn) / a;
        let alpha = half_contact_angle_rad(compression_ratio);
        let rate = finger.lateral_stiffness_n_per_m / (2.0 * PI * c.frequency_hz * c.mu0 * kn * a);
        let rho = finger.lateral_recovery_m_per_s.map_or(f64::INFINITY, |v| rate * v);
        Groups::of(compression_ratio, alpha, rate * c.speed_m_s, rho)
    }

    /// The same with both stiffnesses multiplied. The contact angle depends on the normal one alone.
    fn with_stiffness_times(&self, normal: f64, lateral: f64) -> Self {
        let Stretch { alpha: own, kappa, rho, .. } = self.stretch;
        let compression_ratio = self.compression_ratio / normal;
        let alpha = match own {
            alpha if normal == 1.0 => alpha,
            alpha if alpha < PI => half_contact_angle_from(compression_ratio, alpha),
            _ => half_contact_angle_rad(compression_ratio),
        };
        let rate = lateral / normal;
        Groups::of(compression_ratio, alpha, kappa * rate, rho * rate)
    }

    fn mu_relative(&self) -> f64 {
        (self.stretch.steady().1.mean_force / self.compression_ratio).clamp(0.0, 1.0)
    }

    /// Whether the slider sticks at some instant of a cycle in the instant-recovery limit.
    fn sticks(&self) -> bool {
        let alpha = self.stretch.alpha;
        self.stretch.kappa < if alpha >= PI / 2.0 { 1.0 } else { alpha.sin() }
    }
}

/// Solves the slider at a condition (Eqs. 6-15; section 5.3 where the finger has a recovery speed).
///
/// ```
/// use muprime_models::{condition::Condition, finger::Finger, spring_slider};
/// let cycle = spring_slider::solve(&Condition::paper(), &Finger::paper())?;
/// assert!(cycle.mu_relative > 0.2 && cycle.mu_relative < 0.3);
/// # Ok::<(), muprime_models::condition::OutOfDomain>(())
/// ```
///
/// # Errors
/// A condition or finger outside the domain of the model, by name.
pub fn solve(c: &Condition, finger: &Finger) -> Result<SlipCycle, OutOfDomain> {
    c.check()?;
    finger.check()?;
    Ok(solve_checked(c, finger))
}

/// [`solve`] for values that were checked before: no branch for bad input.
pub(crate) fn solve_checked(c: &Condition, finger: &Finger) -> SlipCycle {
    if c.amplitude.metres() == 0.0 {
        return still(c);
    }
    let groups = Groups::at(c, finger);
    let (alpha, steady) = (groups.stretch.alpha, groups.stretch.steady().1);
    let mu_relative = (steady.mean_force / groups.compression_ratio).clamp(0.0, 1.0);
    let full_contact = groups.stretch.always_touching;
    let regime = if full_contact {
        Regime::FullContact
    } else if groups.sticks() {
        Regime::Intermittent
    } else {
        Regime::FullSlip
    };
    let sticks = regime == Regime::Intermittent;
    let slip_onset = steady.slip_onset.filter(|_| sticks);
    SlipCycle {
        mu_relative,
        lateral_force_n: mu_relative * c.mu0 * c.normal_force_n,
        mean_reaction_force_n: c.normal_force_n,
        contact_fraction: alpha / PI,
        slip_onset_s: slip_onset.map(|phi| (phi + alpha) / (2.0 * PI * c.frequency_hz)),
        phase_shift_deg: if full_contact { 0.0 } else { (PI + alpha).to_degrees() },
        touch_down_deg: if full_contact { 0.0 } else { (PI - alpha).to_degrees() },
        regime,
        groups,
    }
}

impl SlipCycle {
    /// Standard deviation of `mu'` from independent relative standard deviations `sd` of both stiffnesses:
    /// half the spread at one standard deviation either way, exact to second order.
    pub fn mu_relative_sd(&self, sd: f64) -> f64 {
        if sd == 0.0 || !self.groups.compression_ratio.is_finite() {
            return 0.0;
        }
        let at = |kn: f64, kl: f64| self.groups.with_stiffness_times(kn, kl).mu_relative();
        let normal = 0.5 * (at(1.0 + sd, 1.0) - at(1.0 - sd, 1.0));
        let lateral = 0.5 * (at(1.0, 1.0 + sd) - at(1.0, 1.0 - sd));
        normal.hypot(lateral)
    }

    /// The forces over one period in `n` steps from touch-down, as in Figs. 8 and 10.
    pub fn waveform(&self, n: usize) -> Vec<Instant> {
        let groups = self.groups;
        if !groups.compression_ratio.is_finite() {
            let at = |i| i as f64 / n as f64;
            let still =
                |i| Instant { time_over_period: at(i), reaction_over_normal: 1.0, lateral_over_coulomb: 1.0 };
            return (0..n).map(still).collect();
        }
        let (start, _) = groups.stretch.steady();
        groups.stretch.sample(start, n, |turn, reaction, lateral| Instant {
            time_over_period: turn,
            reaction_over_normal: reaction / groups.compression_ratio,
            lateral_over_coulomb: lateral / groups.compression_ratio,
        })
    }
}

/// Without vibration: Coulomb friction.
fn still(c: &Condition) -> SlipCycle {
    SlipCycle {
        mu_relative: 1.0,
        lateral_force_n: c.mu0 * c.normal_force_n,
        mean_reaction_force_n: c.normal_force_n,
        contact_fraction: 1.0,
        slip_onset_s: None,
        phase_shift_deg: 0.0,
        touch_down_deg: 0.0,
        regime: Regime::FullContact,
        groups: Groups::of(f64::INFINITY, PI, 0.0, f64::INFINITY),
    }
}

/// One instant of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Time from touch-down in units of the period.
    pub time_over_period: f64,
    /// Reaction force of the plate in units of the mean normal force.
    pub reaction_over_normal: f64,
    /// Lateral force in units of `mu_0` times the mean normal force.
    pub lateral_over_coulomb: f64,
}

/// Mean relative friction of each of the first `cycles` periods after the slider was last unstretched (Fig. 13).
///
/// # Errors
/// As [`solve`]; also an amplitude of zero, which has no cycles.
pub fn transient(c: &Condition, finger: &Finger, cycles: usize) -> Result<Vec<f64>, OutOfDomain> {
    c.check()?;
    finger.check()?;
    let vibrates = c.amplitude.metres() != 0.0;
    OutOfDomain::unless(vibrates, "amplitude_pp_m", 0.0, "a number above zero")?;
    let groups = Groups::at(c, finger);
    let mut x = 0.0;
    let run = |_| {
        let turn = groups.stretch.turn(x);
        x = turn.left_over;
        turn.mean_force / groups.compression_ratio
    };
    Ok((0..cycles).map(run).collect())
}

//! A test that may be read after every pass without inflating its false alarms.
//!
//! Each bet below is an e-process: a product of likelihood ratios against N(0, 1) whose expectation stays at
//! most 1 under the null hypothesis, at every time (Ville's inequality; Ramdas et al., 'Game-theoretic
//! statistics and safe anytime-valid inference', Statistical Science 38(4), 2023). So is their average, and
//! the chance that it ever reaches 1/alpha is at most alpha. Residuals beyond four standard deviations count
//! as four: a single accident must not end the agreement, and capping a bet only lowers it.

use models::Condition;

/// Chance of a false alarm in a whole run, whatever its length.
pub const ALARM_LEVEL: f64 = 0.005;

/// Standard deviation of the mixture of shifts that a shift bet is placed on, in sd of a pass.
const SHIFT_SD: f64 = 1.0;
/// Scatters, in sd of a pass, that scatter bets are placed on.
const SCATTERS: [f64; 3] = [1.5, 2.0, 4.0];
/// Residuals beyond so many standard deviations count as so many.
pub(super) const CAP: f64 = 4.0;

/// Directions in which a departure may pull: the same way always, with the sliding direction, with the
/// amplitude, with the speed.
pub(super) const PULLS: usize = 4;

/// Number of bets that are averaged.
pub(super) const BETS: usize = PULLS + SCATTERS.len();

/// How strongly a departure at a condition pulls, by each of the four bets on shifts.
pub(super) fn pulls(c: &Condition) -> [f64; PULLS] {
    let vibrating = f64::from(u8::from(c.amplitude.metres() > 0.0));
    [
        vibrating,
        c.direction.sign(),
        (c.amplitude.metres() / 2.5e-6 - 1.0).clamp(-1.0, 1.0) * vibrating,
        ((c.speed_m_s / 0.02).ln() / 2.0).clamp(-1.0, 1.0) * vibrating,
    ]
}

/// The running evidence.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sequential {
    score: [f64; PULLS],
    information: [f64; PULLS],
    log_scatter: [f64; SCATTERS.len()],
    worst: f64,
}

impl Sequential {
    /// Takes a standardised residual and the condition it came from (fixed before the residual was seen).
    pub(super) fn push(&mut self, z: f64, c: &Condition) {
        let z = z.clamp(-CAP, CAP);
        for (i, pull) in pulls(c).into_iter().enumerate() {
            self.score[i] += pull * z;
            self.information[i] += pull * pull;
        }
        for (log, scatter) in self.log_scatter.iter_mut().zip(SCATTERS) {
            *log += 0.5 * z * z * (1.0 - 1.0 / (scatter * scatter)) - scatter.ln();
        }
        self.worst = self.worst.max(self.log_evidence());
    }

    /// Natural logarithm of the evidence against the model now: the average of all bets.
    pub fn log_evidence(&self) -> f64 {
        let v = SHIFT_SD * SHIFT_SD;
        let shift = |i: usize| {
            let spread = 1.0 + v * self.information[i];
            0.5 * (v * self.score[i] * self.score[i] / spread - spread.ln())
        };
        let bet = |i: usize| if i < PULLS { shift(i) } else { self.log_scatter[i - PULLS] };
        let bets: [f64; BETS] = std::array::from_fn(bet);
        let most = bets.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = bets.iter().map(|b| (b - most).exp()).sum();
        most + (sum / bets.len() as f64).ln()
    }

    /// Whether the evidence has ever reached `1 / ALARM_LEVEL`.
    pub fn alarmed(&self) -> bool {
        self.worst >= -ALARM_LEVEL.ln()
    }
}

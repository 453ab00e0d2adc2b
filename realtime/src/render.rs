//! The amplitude of the next cycle for a wanted friction: the target at the present position, through the
//! law turned round.
//!
//! It runs behind the cycle's command, so it costs one cycle of delay and delays no 'off'. What it gives is
//! a request like any other: safety judges it at the head of the next cycle.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

use crate::safety::{HARD, Limits};
use models::inverse::{QuickAnswer, Reach, quick};
use models::target::{Feedback, MOST_DELAY, Target};
use models::{Condition, FrictionModel, PeakToPeak};
use serde::{Deserialize, Serialize};

/// What a target wants at a position, and the amplitude for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rendered {
    /// Wanted `mu'` at the position that the stage reads back.
    pub wanted: f64,
    /// Amplitude that the next cycle requests, peak-to-peak.
    pub amplitude: PeakToPeak,
    /// `mu'` that the law gives at that amplitude.
    pub expected: f64,
    /// Slope `d mu'/dw` of the law there in 1/m: the uncertainty of `mu'` over it is that of the amplitude.
    pub slope_per_m: f64,
    /// Whether the wanted friction can be had.
    pub reach: Reach,
    /// Change of the wanted `mu'` by the feedback; none in open loop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<f64>,
}

/// What is remembered from cycle to cycle while a target is rendered.
#[derive(Clone, Copy, Debug, Default)]
pub struct Render {
    /// Largest amplitude that it commands.
    pub largest: PeakToPeak,
    last: Option<QuickAnswer>,
    /// Integral part of the feedback, in `mu'`.
    integral: f64,
    /// The last wanted values, a ring, with the place of the next and how many there are.
    wanted: [f64; MOST_DELAY + 1],
    next: usize,
    filled: usize,
    /// What the measurement should show now: the wanted value of a while ago through the plate's ring-up.
    due: f64,
}

/// The feedback changes the wanted `mu'` by no more than this.
pub const MOST_CORRECTION: f64 = 0.5;

impl Render {
    /// What the measurement should show now; `None` before the first wanted value has come through.
    fn due(&mut self, wanted: f64, gains: &Feedback, cycle_s: f64) -> Option<f64> {
        let length = self.wanted.len();
        self.wanted[self.next] = wanted;
        let delay = gains.delay_cycles.min(MOST_DELAY);
        let old = self.wanted[(self.next + length - delay) % length];
        self.next = (self.next + 1) % length;
        self.filled = (self.filled + 1).min(length);
        if self.filled <= delay {
            return None;
        }
        let share = 1.0 - (-cycle_s / gains.ring_time_s.max(1e-9)).exp();
        self.due = if self.filled == delay + 1 { old } else { self.due + share * (old - self.due) };
        Some(self.due)
    }

    /// The amplitude for the target at a measured condition; `None` beyond the target's ends, and where the
    /// law has no answer.
    pub fn next(
        &mut self,
        law: &dyn FrictionModel,
        target: &Target,
        now: &Condition,
        lateral_n: Option<f64>,
        limits: &Limits,
    ) -> Option<Rendered> {
        let wanted = target.at(now.position_m)?;
        let lead_m = now.direction.sign() * now.speed_m_s * target.lead_s;
        let ahead = target.at(now.position_m + lead_m).unwrap_or(wanted);
        let measured = lateral_n.map(|l| now.direction.sign() * l / (now.normal_force_n * now.mu0));
        let cycle_s = limits.timing.cycle.seconds();
        let due = target.feedback.and_then(|gains| self.due(ahead, &gains, cycle_s));
        let error = due.zip(measured).map_or(0.0, |(due, mu)| due - mu);
        let correction = target.feedback.map(|gains| {
            (self.integral + gains.proportional * error).clamp(-MOST_CORRECTION, MOST_CORRECTION)
        });
        let largest =
            self.largest.metres().min(limits.amplitude_max.metres()).min(HARD.amplitude_max.metres());
        let largest = PeakToPeak::from_metres(largest);
        let found = quick(law, now, ahead + correction.unwrap_or(0.0), largest, self.last.as_ref())?;
        if let Some(gains) = target.feedback {
            // Anti-windup: what cannot be had is not summed further in its direction.
            let stuck = match found.reach {
                Reach::Within => false,
                Reach::TooHigh => error > 0.0,
                Reach::TooLow => error < 0.0,
                Reach::BeyondLaw => true,
            };
            let step = gains.integral_per_s * cycle_s * error;
            if !stuck {
                self.integral = (self.integral + step).clamp(-MOST_CORRECTION, MOST_CORRECTION);
            }
        }
        if found.amplitude > PeakToPeak::ZERO {
            self.last = Some(found);
        }
        Some(Rendered {
            wanted,
            amplitude: found.amplitude,
            expected: found.mu_relative,
            slope_per_m: found.slope_per_m,
            reach: found.reach,
            correction,
        })
    }
}

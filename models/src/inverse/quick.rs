//! The inverse that the loop calls in every cycle: bounded, without allocation, warm from the cycle before.
//!
//! Eq. 20 reads `ln(-ln(1 - mu')) = ln(Psi/Psi*)`, and `Psi` falls as `1/w`: in these logarithms every law
//! of the project is close to a line of slope -1. The secant is taken there, and the bracket is halved
//! where it fails.

use crate::condition::Condition;
use crate::prediction::FrictionModel;
use crate::quantity::PeakToPeak;
use serde::{Deserialize, Serialize};

/// Whether a wanted friction can be had, and if not, why.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reach {
    /// The amplitude gives the wanted friction.
    Within,
    /// Less friction is wanted than the largest amplitude gives.
    TooLow,
    /// More friction is wanted than there is without vibration.
    TooHigh,
    /// The law has no answer at the amplitude that would be needed; this is the nearest one at which it has.
    BeyondLaw,
}

/// The amplitude for a wanted friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuickAnswer {
    /// The amplitude.
    pub amplitude: PeakToPeak,
    /// `mu'` that the law gives there.
    pub mu_relative: f64,
    /// Slope `d mu'/dw` in 1/m at the last step; zero where none was seen.
    pub slope_per_m: f64,
    /// Whether that is what was wanted.
    pub reach: Reach,
    /// Evaluations of the law.
    pub evaluations: u32,
}

impl QuickAnswer {
    /// The slope in the logarithms, -1 where none is known, and the amplitude in m at which the line through
    /// this answer reaches `target`.
    fn onwards(&self, target: f64) -> (f64, f64) {
        let (w, mu) = (self.amplitude.metres(), self.mu_relative);
        let slope = self.slope_per_m * w / ((1.0 - mu) * -(-mu).ln_1p());
        let slope = if slope.is_finite() && slope < 0.0 { slope } else { -1.0 };
        let to = w * ((target - log_log(mu)) / slope).exp();
        (slope, if to.is_finite() { to } else { w })
    }
}

/// Evaluations of the law for one answer at most.
pub const MOST_EVALUATIONS: u32 = 40;
/// Difference in `mu'` at which an answer is taken: a tenth of what a step of 1 nm changes.
const CLOSE: f64 = 2e-5;
/// Width of the bracket in m at which a jump of a law is taken for the answer.
const NARROW_M: f64 = 1e-13;
/// What an answer may be off by before it is one at a jump.
const JUMP: f64 = 1e-3;
/// Where to begin without an earlier answer, and what is tried where a law has none there, as shares of the
/// largest amplitude.
const STARTS: [f64; 4] = [0.25, 1.0, 0.05, 0.01];

/// `ln(-ln(1 - mu'))`; not finite at the ends.
fn log_log(mu: f64) -> f64 {
    (-(-mu).ln_1p()).ln()
}

/// The search of one answer: `mu'` is above the wanted at `low` and not above it at `high`.
struct Search {
    wanted: f64,
    target: f64,
    low: (f64, f64),
    high: Option<(f64, f64)>,
    /// The last point, in the logarithms, and the slope there.
    last: Option<(f64, f64)>,
    slope: f64,
    per_m: f64,
}

impl Search {
    /// Takes a point in, and proposes the next amplitude.
    fn next(&mut self, w: f64, mu: f64, largest: f64) -> f64 {
        let (x, y) = (w.ln(), log_log(mu));
        if let Some((x0, y0)) = self.last
            && x != x0
        {
            let slope = (y - y0) / (x - x0);
            self.slope = if slope.is_finite() && slope < 0.0 { slope } else { -1.0 };
        }
        self.last = y.is_finite().then_some((x, y));
        if mu > self.wanted {
            self.low = (w, mu)
        } else {
            self.high = Some((w, mu))
        }
        if let Some(high) = self.high {
            self.per_m = (high.1 - self.low.1) / (high.0 - self.low.0);
        }
        let to = (x + (self.target - y) / self.slope).exp();
        let upper = self.high.map_or(largest, |high| high.0);
        if to > self.low.0 && to < upper {
            to
        } else if self.high.is_none() && (to >= largest || !to.is_finite()) {
            largest
        } else {
            0.5 * (self.low.0 + upper)
        }
    }
}

/// The amplitude up to `largest` at which `law` gives `wanted` at a condition. `last` is the answer of the
/// cycle before, from which the search goes on. Where friction is not monotone in the amplitude
/// the crossing near `last` is found.
///
/// The result is `None` where the law has no answer at this condition, whatever the amplitude.
pub fn quick(
    law: &dyn FrictionModel,
    condition: &Condition,
    wanted: f64,
    largest: PeakToPeak,
    last: Option<&QuickAnswer>,
) -> Option<QuickAnswer> {
    let largest = largest.metres();
    let at = |w: f64| {
        let condition = Condition { amplitude: PeakToPeak::from_metres(w), ..*condition };
        law.mu_relative(&condition).ok().filter(|mu| mu.is_finite())
    };
    let answer = |w: f64, mu_relative: f64, slope_per_m: f64, reach: Reach, evaluations: u32| {
        let amplitude = PeakToPeak::from_metres(w);
        Some(QuickAnswer { amplitude, mu_relative, slope_per_m, reach, evaluations })
    };
    if !(wanted.is_finite() && largest > 0.0) {
        return None;
    }
    if let Some((w, slope)) = law.amplitude_for(condition, wanted) {
        let within = w.metres() <= largest;
        let beyond = || answer(largest, at(largest)?, 0.0, Reach::TooLow, 1);
        return if within { answer(w.metres(), wanted, slope, Reach::Within, 0) } else { beyond() };
    }
    let target = log_log(wanted);
    let (slope, first) = last.map_or((-1.0, 0.0), |last| last.onwards(target));
    let first = first.min(largest);
    // d mu'/dw from a slope of the logarithms: d mu' = (1 - mu') (-ln(1 - mu')) slope dw / w.
    let per_m = |w: f64, mu: f64, slope: f64| (1.0 - mu) * -(-mu).ln_1p() * slope / w;
    // The line through the answer before may already lead to this one.
    let ahead = if first > 0.0 { at(first) } else { None };
    let mut evaluations = u32::from(first > 0.0);
    if let Some(mu) = ahead.filter(|mu| (mu - wanted).abs() <= CLOSE && *mu < 1.0) {
        return answer(first, mu, per_m(first, mu, slope), Reach::Within, 1);
    }
    let still = at(0.0)?;
    if wanted >= still {
        let reach = if wanted > still + CLOSE { Reach::TooHigh } else { Reach::Within };
        return answer(0.0, still, 0.0, reach, evaluations + 1);
    }
    let mut begin = ahead.map(|mu| (first, mu));
    for w in STARTS.map(|share| share * largest) {
        if begin.is_some() {
            break;
        }
        evaluations += 1;
        begin = at(w).map(|mu| (w, mu));
    }
    let (mut w, mut mu) = begin?;
    let mut search = Search { wanted, target, low: (0.0, still), high: None, last: None, slope, per_m: 0.0 };
    // Where the law has no answer: below one of two amplitudes, above the other.
    let mut beyond = false;
    while evaluations < MOST_EVALUATIONS && (mu - wanted).abs() > CLOSE {
        let mut to = search.next(w, mu, largest);
        if search.high.is_some_and(|high| high.0 - search.low.0 < NARROW_M) {
            break;
        }
        if w == largest && mu > wanted {
            return answer(w, mu, search.per_m, Reach::TooLow, evaluations);
        }
        evaluations += 1;
        let mut found = at(to);
        while found.is_none() && evaluations < MOST_EVALUATIONS {
            // Halfway back to where there was one.
            beyond = true;
            to = 0.5 * (to + w);
            evaluations += 1;
            found = at(to);
        }
        (w, mu) = (to, found.unwrap_or(mu));
        if beyond && evaluations >= MOST_EVALUATIONS / 2 {
            return answer(w, mu, search.per_m, Reach::BeyondLaw, evaluations);
        }
    }
    let seen = (search.last.is_some() || last.is_some()) && mu > 0.0 && mu < 1.0 && w > 0.0;
    let slope = if seen { per_m(w, mu, search.slope) } else { search.per_m };
    // At a jump of the law no amplitude gives what is wanted.
    let reach = if (mu - wanted).abs() > JUMP { Reach::BeyondLaw } else { Reach::Within };
    answer(w, mu, slope, reach, evaluations)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::finger::Finger;
    use crate::prediction::{EmpiricalPsi, SpringSlider};
    use crate::psi::PSI_STAR;
    use crate::reading::Reading;

    const LARGEST: PeakToPeak = PeakToPeak::from_metres(8e-6);

    /// Eq. 20 solved by hand: `w = U / (f mu_0 (1 + nu) Psi)` with `Psi = -Psi* ln(1 - mu')`.
    #[test]
    fn the_inverse_of_eq_20_is_its_closed_form() {
        let finger = Finger::paper();
        let reading =
            Reading::ALL.into_iter().find(|r| r.psi_star().0 == PSI_STAR).expect("the paper's Psi*");
        let law = EmpiricalPsi::read(finger, reading).expect("a finger");
        let c = Condition::paper();
        let mut last = None;
        for k in 1..60 {
            let wanted = 0.15 + 0.8 * (f64::from(k) * 0.618).fract();
            let psi = -PSI_STAR * (1.0 - wanted).ln();
            let exact = c.speed_m_s / (c.frequency_hz * c.mu0 * (1.0 + finger.poisson_ratio) * psi);
            let found = quick(&law, &c, wanted, LARGEST, last.as_ref()).expect("an answer");
            if exact > LARGEST.metres() {
                assert_eq!(found.reach, Reach::TooLow, "{wanted}");
                continue;
            }
            assert!((found.amplitude.metres() / exact - 1.0).abs() < 1e-4, "{wanted}: {found:?}, {exact}");
            assert!(found.evaluations <= 8, "{found:?}");
            // d mu'/dw = -(1 - mu') Psi / (Psi* w).
            let slope = -(1.0 - wanted) * psi / PSI_STAR / exact;
            assert!((found.slope_per_m / slope - 1.0).abs() < 1e-3, "{found:?} {slope}");
            last = Some(found);
        }
    }

    #[test]
    fn saturation_is_said_both_ways() {
        let law = SpringSlider::new(Finger::paper()).expect("a finger");
        let at = |wanted| quick(&law, &Condition::paper(), wanted, LARGEST, None).expect("an answer");
        assert_eq!((at(0.01).reach, at(0.01).amplitude), (Reach::TooLow, LARGEST));
        assert_eq!((at(1.2).reach, at(1.2).amplitude), (Reach::TooHigh, PeakToPeak::ZERO));
        assert_eq!((at(1.0).reach, at(1.0).amplitude), (Reach::Within, PeakToPeak::ZERO));
        assert!(quick(&law, &Condition::paper(), f64::NAN, LARGEST, None).is_none());
    }
}

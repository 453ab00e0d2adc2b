//! Which reading of the paper's `w` a rig's passes favour, and by how many nats.
//!
//! Eq. 20 is held against the forces of the passes under every `Psi*` of a grid. Under each, `mu_0` and the law's own error are
//! carried along in a Kalman filter: the exponential is a fit, and what it is off by is common to passes at like conditions, so that
//! no number of repeats can take it for evidence. The evidence of a reading is the mean of the grid's likelihoods over the paper's
//! `Psi*` and its uncertainty; that of 'neither' over any `Psi*`, flat in its logarithm.
//!
//! The law's error is `4 mu' (1 - mu')` times a plane in the logarithms of Psi, w, U and F_n: it is nothing where friction is
//! whole or gone. Its coefficients are the scatter of the finite element ridge about its own best exponential, 0.055 rms in
//! those units and 0.02 to 0.05 a factor of e (Fig. 9's study under both readings, `docs/ridge.md`).

use crate::condition::Condition;
use crate::psi::{PsiEq17, relative_friction};
use crate::quantity::PeakToPeak;
use crate::reading::Reading;
use crate::rig_file::PassNoise;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Values of `Psi*`.
const NODES: usize = 72;
/// The least and the greatest `Psi*` of the grid.
pub const PSI_STAR_RANGE: [f64; 2] = [0.3, 9.0];
/// `Psi` of the true stroke at which passes are asked: about one, where the readings differ most.
pub const PSI_RANGE: [f64; 2] = [0.4, 4.0];
/// `mu_0`, and the law's error: everywhere, with Psi, w, U and F_n.
const STATES: usize = 6;
/// Standard deviation of each coefficient of the law's error (-).
const FORM_SD: f64 = 0.04;
/// Relative width of the prior on `mu_0`.
const MU0_RELATIVE_SD: f64 = 1.0;
/// What the plane leaves of the law's error, in the same units: the ridge's, 0.02 rms.
const FORM_REST_SD: f64 = 0.02;
/// Share of bad passes, and how far their mu' may be off: one bad pass must not decide.
const BAD_SHARE: f64 = 0.01;
const BAD_SD: f64 = 0.3;
/// Nats from which a reading is said to be favoured: odds of 20 to 1.
pub const DECIDED_NATS: f64 = 2.995_732_273_553_991;
/// Standard deviation of `ln Psi*` up to which the two readings, a factor of 2 apart, are told from what lies between them.
const RESOLVED_SD: f64 = 0.25;

/// What the passes say of the readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// `w` is the whole stroke.
    PeakToPeak,
    /// `w` is the sine's amplitude.
    SineAmplitude,
    /// `Psi*` is known well enough, and lies between the two: neither is favoured.
    Between,
    /// Another `Psi*` is favoured, outside of what the two readings span.
    Neither,
    /// Too little is known.
    TooLittle,
}

/// The weights of the readings after some passes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ReadingFinding {
    /// What may be said.
    pub decision: Decision,
    /// Natural logarithm of the evidence for peak-to-peak over that for the sine's amplitude: negative favours the latter.
    pub nats: f64,
    /// Natural logarithm of the evidence for any other `Psi*` over that for the better of the two readings.
    pub neither_nats: f64,
    /// `Psi*` of the true stroke (-), free of both readings: the median.
    pub psi_star: f64,
    /// Its interval of 95 %, low end.
    pub psi_star_low: f64,
    /// Its interval of 95 %, high end.
    pub psi_star_high: f64,
    /// Passes with vibration behind it.
    pub judged: u32,
}

impl fmt::Display for ReadingFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let free = format!(
            "Psi* {:.2}, 95 % from {:.2} to {:.2}",
            self.psi_star, self.psi_star_low, self.psi_star_high
        );
        let passes = self.judged;
        let favoured = |reading: Reading, f: &mut fmt::Formatter<'_>| {
            let (nats, words) = (self.nats.abs(), reading.words());
            write!(
                f,
                "of the two readings of the paper's w, {passes} passes favour that {words}, by {nats:.1} nats; free of both: {free}"
            )
        };
        match self.decision {
            Decision::PeakToPeak => favoured(Reading::PeakToPeak, f),
            Decision::SineAmplitude => favoured(Reading::SineAmplitude, f),
            Decision::Between => {
                write!(
                    f,
                    "neither reading of the paper's w is favoured by {passes} passes: {free}, between 1.19 and 2.38"
                )
            }
            Decision::Neither => {
                write!(f, "neither reading of the paper's w (Psi* 2.38 or 1.19) fits {passes} passes: {free}")
            }
            Decision::TooLittle => write!(
                f,
                "which reading of the paper's w holds (Psi* 2.38 or 1.19) cannot be told from {passes} passes with vibration near Psi = 1: {free}; \
                 the plan 'psi-reading' asks for it"
            ),
        }
    }
}

/// One value of `Psi*` under the passes so far.
#[derive(Clone, Copy, Debug)]
struct Node {
    psi_star: f64,
    estimate: [f64; STATES],
    covariance: [[f64; STATES]; STATES],
    log_likelihood: f64,
}

/// The evidence of a sweep, pass by pass, in the order they were made.
#[derive(Clone, Debug)]
pub struct ReadingEvidence {
    nodes: Vec<Node>,
    noise: PassNoise,
    poisson_ratio: f64,
    judged: u32,
    references: u32,
}

impl ReadingEvidence {
    /// Before the first pass. `mu0` needs the right order only: it is taken as known within a factor of two.
    pub fn new(mu0: f64, poisson_ratio: f64, noise: PassNoise) -> Self {
        let mut covariance = [[0.0; STATES]; STATES];
        covariance[0][0] = (mu0 * MU0_RELATIVE_SD).powi(2);
        for (i, row) in covariance.iter_mut().enumerate().skip(1) {
            row[i] = FORM_SD * FORM_SD;
        }
        let mut estimate = [0.0; STATES];
        estimate[0] = mu0;
        let [low, high] = PSI_STAR_RANGE;
        let node = |i: usize| Node {
            psi_star: low * (high / low).powf(i as f64 / (NODES - 1) as f64),
            estimate,
            covariance,
            log_likelihood: 0.0,
        };
        ReadingEvidence {
            nodes: (0..NODES).map(node).collect(),
            noise,
            poisson_ratio,
            judged: 0,
            references: 0,
        }
    }

    /// Takes a pass: its measured condition (whose `mu0` is ignored) and mean friction force in N, positive along the
    /// sliding direction. Left out are passes that the law says nothing of (no load, no speed, no finite force), those whose Psi is
    /// far from one ([`PSI_RANGE`]), and those with vibration before the first one without, which alone tells `mu_0`.
    pub fn pass(&mut self, condition: &Condition, friction_force_n: f64) {
        let usable = |v: f64| v.is_finite() && v > 0.0;
        let still = condition.amplitude == PeakToPeak::ZERO;
        let moves = usable(condition.frequency_hz) && usable(condition.amplitude.metres());
        if !usable(condition.normal_force_n)
            || !usable(condition.speed_m_s)
            || !friction_force_n.is_finite()
            || !(still || moves)
        {
            return;
        }
        // Without mu_0 the friction under vibration says nothing of Psi*; far from Psi = 1 the readings hardly differ, and the exponential
        // is least of all to be trusted.
        let known = self.references > 0;
        let psi = PsiEq17::at(&self.nodes[NODES / 2].at_its_mu0(condition), self.poisson_ratio).0;
        if still {
            self.references += 1;
        } else if known && (PSI_RANGE[0]..=PSI_RANGE[1]).contains(&psi) {
            self.judged += 1;
        } else {
            return;
        }
        for node in &mut self.nodes {
            node.pass(condition, self.poisson_ratio, &self.noise, friction_force_n, known);
        }
    }

    /// What the passes say; `None` before one with vibration.
    pub fn finding(&self) -> Option<ReadingFinding> {
        if self.judged == 0 {
            return None;
        }
        let [pp, sine] = Reading::ALL.map(|reading| {
            let (psi_star, sd) = reading.psi_star();
            let relative = sd / psi_star;
            self.evidence(|at| (-0.5 * ((at / psi_star).ln() / relative).powi(2)).exp())
        });
        let neither = self.evidence(|_| 1.0);
        let (nats, neither_nats) = (pp - sine, neither - pp.max(sine));
        let (low, middle, high, sd) = self.psi_star();
        let span = [Reading::SineAmplitude, Reading::PeakToPeak].map(|reading| reading.psi_star().0);
        let decision = if sd > RESOLVED_SD && nats.abs() < DECIDED_NATS {
            Decision::TooLittle
        } else if neither_nats >= DECIDED_NATS && !(span[0]..=span[1]).contains(&middle) {
            Decision::Neither
        } else if nats.abs() < DECIDED_NATS || neither_nats >= DECIDED_NATS {
            Decision::Between
        } else if nats > 0.0 {
            Decision::PeakToPeak
        } else {
            Decision::SineAmplitude
        };
        Some(ReadingFinding {
            decision,
            nats,
            neither_nats,
            psi_star: middle,
            psi_star_low: low,
            psi_star_high: high,
            judged: self.judged,
        })
    }

    /// Logarithm of the mean likelihood under a prior over `Psi*`.
    fn evidence(&self, prior: impl Fn(f64) -> f64) -> f64 {
        let most = self.nodes.iter().map(|n| n.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
        let (mut sum, mut weight) = (0.0, 0.0);
        for node in &self.nodes {
            let p = prior(node.psi_star);
            sum += p * (node.log_likelihood - most).exp();
            weight += p;
        }
        most + (sum / weight).max(f64::MIN_POSITIVE).ln()
    }

    /// Low, median and high end of 95 % of `Psi*` under the flat prior, and the standard deviation of its logarithm.
    fn psi_star(&self) -> (f64, f64, f64, f64) {
        let most = self.nodes.iter().map(|n| n.log_likelihood).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = self.nodes.iter().map(|n| (n.log_likelihood - most).exp()).collect();
        let total: f64 = weights.iter().sum();
        let log = |i: usize| self.nodes[i].psi_star.ln();
        let quantile = |share: f64| {
            let mut before = 0.0;
            for (i, weight) in weights.iter().enumerate() {
                let after = before + weight / total;
                if after >= share {
                    // Each node stands for the step about it.
                    let step = log(1) - log(0);
                    let within = (share - before) / (after - before) - 0.5;
                    return (log(i) + within * step).exp();
                }
                before = after;
            }
            self.nodes[NODES - 1].psi_star
        };
        let mean = weights.iter().enumerate().map(|(i, w)| w / total * log(i)).sum::<f64>();
        let variance =
            weights.iter().enumerate().map(|(i, w)| w / total * (log(i) - mean).powi(2)).sum::<f64>();
        (quantile(0.025), quantile(0.5), quantile(0.975), variance.sqrt())
    }
}

impl Node {
    /// A condition with the `mu_0` that this node has come to.
    fn at_its_mu0(&self, c: &Condition) -> Condition {
        Condition { mu0: self.estimate[0].max(1e-6), ..*c }
    }

    fn pass(&mut self, c: &Condition, poisson_ratio: f64, noise: &PassNoise, force_n: f64, known: bool) {
        let c = &self.at_its_mu0(c);
        let (mu0, load) = (c.mu0, c.normal_force_n);
        let (mut expected, mut slope) = (mu0 * load, [0.0; STATES]);
        slope[0] = load;
        // What the force does as the load moves: nothing beyond Coulomb's where the plate is still.
        let mut load_slope = mu0;
        let mut rest = 0.0;
        if c.amplitude > PeakToPeak::ZERO {
            let psi = PsiEq17::at(c, poisson_ratio);
            let ratio = psi.0 / self.psi_star;
            let law = relative_friction(psi, self.psi_star);
            let weight = 4.0 * law * (1.0 - law);
            let features = [
                1.0,
                ratio.ln(),
                (c.amplitude.metres() / 2e-6).ln(),
                (c.speed_m_s / 0.02).ln(),
                (load / 0.25).ln(),
            ];
            let error: f64 = features.iter().zip(&self.estimate[1..]).map(|(f, b)| f * b).sum();
            let mu_relative = law + weight * error;
            expected = mu0 * load * mu_relative;
            for (slope, feature) in slope[1..].iter_mut().zip(features) {
                *slope = mu0 * load * weight * feature;
            }
            // mu_0 (1 - exp(-P / mu_0)): its slope in mu_0.
            slope[0] = load * (mu_relative - ratio * (-ratio).exp());
            load_slope = mu0 * mu_relative;
            rest = FORM_REST_SD * weight * mu0 * load;
        }
        let own = (noise.pass_relative_sd * expected).powi(2)
            + noise.force_sd_n.powi(2) * (1.0 + load_slope * load_slope)
            + rest * rest;
        let gain = self.covariance.map(|row| row.iter().zip(&slope).map(|(a, b)| a * b).sum::<f64>());
        let variance = own + gain.iter().zip(&slope).map(|(a, b)| a * b).sum::<f64>();
        let innovation = force_n - expected;
        // A pass belongs to the rest or is a bad one; what it says of the state is weighed by how likely that is.
        let bad = variance + (BAD_SD * mu0 * load).powi(2);
        let log = |share: f64, v: f64| share.ln() - 0.5 * (innovation * innovation / v + v.ln());
        let [good, bad_one] = [log(1.0 - BAD_SHARE, variance), log(BAD_SHARE, bad)];
        let belongs = if known { 1.0 / (1.0 + (bad_one - good).exp()) } else { 1.0 };
        // The first word on mu_0 is the same under every Psi*: no evidence.
        if known {
            let most = good.max(bad_one);
            self.log_likelihood += most + ((good - most).exp() + (bad_one - most).exp()).ln();
        }
        let taken = belongs / variance + (1.0 - belongs) / bad;
        let apart = innovation * (1.0 / variance - 1.0 / bad);
        let narrowed = taken - belongs * (1.0 - belongs) * apart * apart;
        for (estimate, gain) in self.estimate.iter_mut().zip(&gain) {
            *estimate += gain * taken * innovation;
        }
        for (row, left) in self.covariance.iter_mut().zip(&gain) {
            for (cell, right) in row.iter_mut().zip(&gain) {
                *cell -= left * right * narrowed;
            }
        }
    }
}

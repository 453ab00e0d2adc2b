//! From a fitted series to a certificate, and from a verified certificate to newtons in the loop.

use super::matrix::{ForceFit, Term};
use super::series::Weighing;
use super::zero::Zero;
use super::{AXES, Axis};
use crate::certificate::{
    BudgetLine, CalibrationResult, CertificateKind, Finding, Parameter, Refusal, Residuals, Verified,
    parameters,
};
use models::Calibration;
use nalgebra::{Matrix2, Vector2};
use std::collections::BTreeMap;

/// Without temperature coefficients a certificate holds this far from the temperature of the series, in K.
const TEMPERATURE_REACH_K: f64 = 3.0;

impl ForceFit {
    /// Everything that the certificate states.
    pub fn outcome(&self, weighing: &Weighing) -> CalibrationResult {
        let covariance = self.covariance();
        let names = AXES.iter().flat_map(|a| self.terms.iter().map(|t| t.name(*a)));
        let numbers = self.estimates.iter().zip(self.effective_degrees_of_freedom());
        let findings: Vec<Finding> = names
            .zip(numbers)
            .enumerate()
            .map(|(i, ((name, unit), (value, dof)))| {
                Finding::new(name, unit, [*value, covariance[(i, i)].sqrt()], dof)
            })
            .collect();
        let parameters = parameters(&findings, &covariance);
        let with_temperature = self.terms.contains(&Term::ZeroTemperature);
        let mut remarks = Vec::new();
        for channel in AXES {
            for axis in AXES {
                remarks.extend(self.remark(&parameters, channel, Term::Square(axis), "non-linearity"));
                remarks.extend(self.remark(&parameters, channel, Term::Hysteresis(axis), "hysteresis"));
            }
            let drift = "drift of the zero over the series";
            remarks.extend(self.remark(&parameters, channel, Term::Drift, drift));
        }
        if !with_temperature {
            remarks
                .push("temperature coefficients were not determined: the series saw one temperature".into());
        }
        if self.lack_of_fit_p.is_none() {
            remarks.push("no replicates: the model was not tested against repeatability".into());
        }
        let largest = self.residuals.iter().flatten().fold(0f64, |m, r| m.max(r.abs()));
        let gain = |a: Axis| self.value(a, Term::Gain(a));
        let type_a = |a: Axis| {
            self.index(a, Term::Gain(a)).map_or(f64::NAN, |i| self.type_a[(i, i)].sqrt() / gain(a).abs())
        };
        let mut budget = vec![
            BudgetLine::b("free fall, common to all loads", weighing.gravity_relative_sd, "1"),
            BudgetLine::b("masses, common to all loads", weighing.mass_relative_sd, "1"),
        ];
        for a in AXES {
            budget.push(BudgetLine::a(format!("repeatability of the {a} gain"), type_a(a), "1"));
            let sd = weighing.alignment_sd_rad[a as usize];
            budget.push(BudgetLine::b(format!("direction of the {a} pull"), sd, "rad"));
        }
        CalibrationResult {
            kind: CertificateKind::Force,
            model: "counts_i = offset_i + sum_j (gain_ij F_j + square_ij F_j^2) + drift_i (t - mean t) \
                    + hysteresis_ij b 4 s (1 - |s|) + temperature"
                .into(),
            settings: BTreeMap::from([
                ("tare".into(), "explicit".into()),
                (
                    "reference_temperature_c".into(),
                    self.temperature_c.map_or("unknown".into(), |t| t[0].to_string()),
                ),
            ]),
            remarks,
            parameters,
            covariance,
            residuals: Residuals {
                count: 2 * self.readings as u64,
                sd: (self.scatter.trace() / 2.0).sqrt(),
                largest,
                unit: "counts".into(),
                lack_of_fit_p: self.lack_of_fit_p,
            },
            temperature_c: self.temperature_c.map(|[mean, low, high]| {
                if with_temperature {
                    [low, high]
                } else {
                    [mean - TEMPERATURE_REACH_K, mean + TEMPERATURE_REACH_K]
                }
            }),
            range: AXES.iter().map(|a| (format!("{a}_force_n"), self.range_n[*a as usize])).collect(),
            budget,
        }
    }

    /// A finding where a term that should vanish does not.
    fn remark(&self, parameters: &[Parameter], channel: Axis, term: Term, what: &str) -> Option<String> {
        let p = &parameters[self.index(channel, term)?];
        let significant = !(p.ci95[0]..=p.ci95[1]).contains(&0.0);
        significant.then(|| {
            let on = match term {
                Term::Square(axis) | Term::Hysteresis(axis) => format!(" under {axis} load"),
                _ => String::new(),
            };
            format!("{channel} channel: {what}{on} of {:.3e} {} is significant", p.value, p.unit)
        })
    }
}

/// The calibration in use: counts to newtons, without allocation.
///
/// It is made from a [`Verified`] certificate only, and it takes counts, so that it can neither be applied
/// unverified nor twice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceCalibration {
    gain: Matrix2<f64>,
    inverse: Matrix2<f64>,
    square: Matrix2<f64>,
    /// Covariance of the four gains, row by row: (ll, ln, nl, nn).
    gain_covariance: nalgebra::Matrix4<f64>,
    hysteresis_counts: [f64; 2],
    range_n: [[f64; 2]; 2],
}

impl ForceCalibration {
    /// Compiles a verified force certificate for use at a temperature.
    ///
    /// # Errors
    /// A tare policy other than explicit, a missing gain, a matrix that cannot be inverted.
    pub fn compile(verified: Verified, temperature_c: Option<f64>) -> Result<Self, Refusal> {
        let certificate = verified.certificate();
        let malformed = |reason: String| Refusal::Malformed { reason };
        if certificate.settings.get("tare").map(String::as_str) != Some("explicit") {
            return Err(malformed("its tare policy is not `explicit`: a tare is never silent".into()));
        }
        let find = |channel: Axis, term: Term| {
            let (name, _) = term.name(channel);
            certificate.parameters.iter().position(|p| p.name == name)
        };
        let value = |channel, term| find(channel, term).map(|i| certificate.parameters[i].value);
        let kelvin = certificate.kelvin(temperature_c);
        let mut gain = Matrix2::zeros();
        let mut square = Matrix2::zeros();
        let mut at = [0; 4];
        let mut hysteresis_counts = [0.0; 2];
        for channel in AXES {
            for axis in AXES {
                let (i, j) = (channel as usize, axis as usize);
                at[2 * i + j] = find(channel, Term::Gain(axis))
                    .ok_or_else(|| malformed(format!("`{}` is missing", Term::Gain(axis).name(channel).0)))?;
                gain[(i, j)] = certificate.parameters[at[2 * i + j]].value
                    + kelvin * value(channel, Term::GainTemperature(axis)).unwrap_or(0.0);
                square[(i, j)] = value(channel, Term::Square(axis)).unwrap_or(0.0);
                let opening = value(channel, Term::Hysteresis(axis)).unwrap_or(0.0).abs();
                hysteresis_counts[i] = opening.max(hysteresis_counts[i]);
            }
        }
        let inverse = gain
            .try_inverse()
            .filter(|m| m.iter().all(|x| x.is_finite()))
            .ok_or_else(|| malformed("its matrix cannot be inverted".into()))?;
        let covariance = certificate.covariance_matrix();
        let range = |name: &str| {
            certificate.validity.range.get(name).copied().unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
        };
        Ok(ForceCalibration {
            gain,
            inverse,
            square,
            gain_covariance: nalgebra::Matrix4::from_fn(|i, j| covariance[(at[i], at[j])]),
            hysteresis_counts,
            range_n: [range("lateral_force_n"), range("normal_force_n")],
        })
    }

    /// Forces in N, lateral and normal, of counts of which the zero was taken explicitly.
    pub fn apply(&self, counts: [f64; 2], zero: &Zero) -> [f64; 2] {
        let net = Vector2::new(counts[0] - zero.counts[0], counts[1] - zero.counts[1]);
        let mut force = self.inverse * net;
        if self.square != Matrix2::zeros() {
            // The squares are a per cent or so: each round gains two digits, and the number of rounds is fixed.
            for _ in 0..8 {
                force = self.inverse * (net - self.square * force.component_mul(&force));
            }
        }
        [force[0], force[1]]
    }

    /// Standard uncertainty of a force in N, lateral and normal: of the certificate, the zero, and the
    /// hysteresis (rectangular, since the branch is not known in use). Noise of the sample is not in it.
    pub fn standard_uncertainty(&self, force_n: [f64; 2], zero: &Zero) -> [f64; 2] {
        let mut counts_covariance = Matrix2::zeros();
        for a in 0..2 {
            for b in 0..2 {
                for j in 0..2 {
                    for k in 0..2 {
                        counts_covariance[(a, b)] +=
                            self.gain_covariance[(2 * a + j, 2 * b + k)] * force_n[j] * force_n[k];
                    }
                }
            }
            counts_covariance[(a, a)] +=
                zero.standard_uncertainty[a].powi(2) + self.hysteresis_counts[a].powi(2) / 3.0;
        }
        let covariance = self.inverse * counts_covariance * self.inverse.transpose();
        [covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()]
    }

    /// Whether a force is in the range that was calibrated.
    pub fn in_range(&self, force_n: [f64; 2]) -> bool {
        (0..2).all(|a| (self.range_n[a][0]..=self.range_n[a][1]).contains(&force_n[a]))
    }

    /// Takes what remains uncertain of the gains (relative) and of the two cross-talks (N/N) into what the
    /// diagnosis knows: standard uncertainties.
    pub fn take_into(&self, known: &mut Calibration) {
        let g = |i: usize, j: usize| self.gain[(i, j)];
        let c = |i: usize, j: usize| self.gain_covariance[(i, j)];
        let ratio = |top: usize, bottom: usize, t: f64, b: f64| {
            let r = t / b;
            ((c(top, top) - 2.0 * r * c(top, bottom) + r * r * c(bottom, bottom)) / (b * b)).max(0.0).sqrt()
        };
        known.lateral_gain_sd = Some(c(0, 0).sqrt() / g(0, 0).abs());
        known.normal_gain_sd = Some(c(3, 3).sqrt() / g(1, 1).abs());
        known.crosstalk_sd = Some(ratio(1, 0, g(0, 1), g(0, 0)));
        known.crosstalk_onto_normal_sd = Some(ratio(2, 3, g(1, 0), g(1, 1)));
    }
}

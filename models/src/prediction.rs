//! What every friction law answers, and the laws that are ready to ask.

use crate::condition::{Condition, OutOfDomain};
use crate::finger::Finger;
use crate::psi::{self, PsiEq17};
use crate::quantity::PeakToPeak;
use crate::reading::Reading;
pub use crate::regime::Regime;
use crate::spring_slider;
use serde::{Deserialize, Serialize};

/// Whether a prediction rests on the conditions that its law was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Validity {
    /// Inside the range that the law was fitted on or derived for.
    Inside,
    /// Outside it: an extrapolation, to be shown as such.
    Extrapolated,
}

/// A law's answer at one condition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Relative friction `mu' = mu / mu_0` (Eq. 5).
    pub mu_relative: f64,
    /// Standard uncertainty of `mu_relative` from the law and its parameters (not from the condition).
    pub mu_relative_sd: f64,
    /// Magnitude of the mean lateral force in N, `mu' mu_0 F_n`.
    pub lateral_force_n: f64,
    /// Contact regime.
    pub regime: Regime,
    /// Inside or outside the law's range.
    pub validity: Validity,
}

/// Relative friction alone, without the contact's regime: the result of a law for whole columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeFriction {
    /// `mu'`, as [`Prediction::mu_relative`].
    pub mu_relative: f64,
    /// Its standard uncertainty, as [`Prediction::mu_relative_sd`].
    pub sd: f64,
    /// Inside or outside the law's range.
    pub validity: Validity,
}

/// A law of friction under ultrasonic vibration. `predict` allocates nothing: the real-time loop calls it.
pub trait FrictionModel: Send + Sync {
    /// A short name for records and reports.
    fn name(&self) -> &str;

    /// The prediction at a condition.
    ///
    /// # Errors
    /// A condition outside the domain of the law, by name.
    fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain>;

    /// The same without force and regime. A law that must solve something else for its regime says less here,
    /// and sooner.
    ///
    /// # Errors
    /// As [`FrictionModel::predict`].
    fn relative_friction(&self, condition: &Condition) -> Result<RelativeFriction, OutOfDomain> {
        self.predict(condition).map(|p| RelativeFriction {
            mu_relative: p.mu_relative,
            sd: p.mu_relative_sd,
            validity: p.validity,
        })
    }

    /// `mu'` alone, for a loop that inverts the law in every cycle: a law that has it without its
    /// uncertainty says it sooner.
    ///
    /// # Errors
    /// As [`FrictionModel::predict`].
    fn mu_relative(&self, condition: &Condition) -> Result<f64, OutOfDomain> {
        self.relative_friction(condition).map(|friction| friction.mu_relative)
    }

    /// The amplitude for a wanted `mu'` at a condition, whose own amplitude does not count, and the slope
    /// `d mu'/dw` there in 1/m, where the law can be turned round without a search.
    fn amplitude_for(&self, condition: &Condition, wanted: f64) -> Option<(PeakToPeak, f64)> {
        let _ = (condition, wanted);
        None
    }

    /// Relative standard deviations of the two parameters that a calibration leaves uncertain (normal and
    /// lateral stiffness, or what takes their place). Zero: the law has none.
    fn parameter_relative_sd(&self) -> [f64; 2] {
        [0.0; 2]
    }

    /// `mu'` with those parameters multiplied by `exp(deviation)`.
    ///
    /// # Errors
    /// As [`FrictionModel::predict`].
    fn mu_relative_with(&self, condition: &Condition, deviation: [f64; 2]) -> Result<f64, OutOfDomain> {
        let _ = deviation;
        self.predict(condition).map(|p| p.mu_relative)
    }

    /// Standard deviation of `mu'` from the law itself, beside one of its predictions: what no choice of its
    /// parameters mends.
    fn form_sd(&self, of: &Prediction) -> f64 {
        let _ = of;
        0.0
    }

    /// SHA-256 (hex) of the table that the law was read from; none for a formula.
    fn sha256(&self) -> Option<&str> {
        None
    }

    /// The law that a corrected model corrects, where it is another than the spring-slider.
    fn base(&self) -> Option<&dyn FrictionModel> {
        None
    }

    /// The wanted friction over position that a loop is to render by this law; none: the amplitude is set
    /// as requested.
    fn target(&self) -> Option<&crate::target::Target> {
        None
    }
}

/// What a law that wraps another in its field `law` answers as that one does.
macro_rules! as_its_law {
    () => {
        fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain> {
            self.law.predict(condition)
        }

        fn relative_friction(&self, condition: &Condition) -> Result<RelativeFriction, OutOfDomain> {
            self.law.relative_friction(condition)
        }

        fn mu_relative(&self, condition: &Condition) -> Result<f64, OutOfDomain> {
            self.law.mu_relative(condition)
        }

        fn amplitude_for(
            &self,
            condition: &Condition,
            wanted: f64,
        ) -> Option<($crate::quantity::PeakToPeak, f64)> {
            self.law.amplitude_for(condition, wanted)
        }

        fn parameter_relative_sd(&self) -> [f64; 2] {
            self.law.parameter_relative_sd()
        }

        fn mu_relative_with(&self, condition: &Condition, deviation: [f64; 2]) -> Result<f64, OutOfDomain> {
            self.law.mu_relative_with(condition, deviation)
        }

        fn form_sd(&self, of: &Prediction) -> f64 {
            self.law.form_sd(of)
        }
    };
}
pub(crate) use as_its_law;

/// The spring-slider with a finger's stiffnesses and their uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringSlider {
    finger: Finger,
}

impl SpringSlider {
    /// The law for a finger.
    ///
    /// # Errors
    /// A finger outside the domain of the model, by name.
    pub fn new(finger: Finger) -> Result<Self, OutOfDomain> {
        finger.check()?;
        Ok(SpringSlider { finger })
    }
}

impl FrictionModel for SpringSlider {
    fn name(&self) -> &str {
        "spring-slider"
    }

    fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain> {
        condition.check()?;
        let cycle = spring_slider::solve_checked(condition, &self.finger);
        Ok(Prediction {
            mu_relative: cycle.mu_relative,
            mu_relative_sd: cycle.mu_relative_sd(self.finger.stiffness_relative_sd),
            lateral_force_n: cycle.lateral_force_n,
            regime: cycle.regime,
            validity: Validity::Inside,
        })
    }

    fn mu_relative(&self, condition: &Condition) -> Result<f64, OutOfDomain> {
        condition.check()?;
        Ok(spring_slider::solve_checked(condition, &self.finger).mu_relative)
    }

    fn amplitude_for(&self, condition: &Condition, wanted: f64) -> Option<(PeakToPeak, f64)> {
        condition.check().ok()?;
        spring_slider::amplitude_for(condition, &self.finger, wanted)
    }

    fn parameter_relative_sd(&self) -> [f64; 2] {
        [self.finger.stiffness_relative_sd; 2]
    }

    fn mu_relative_with(&self, condition: &Condition, deviation: [f64; 2]) -> Result<f64, OutOfDomain> {
        let finger = Finger {
            normal_stiffness_n_per_m: self.finger.normal_stiffness_n_per_m * deviation[0].exp(),
            lateral_stiffness_n_per_m: self.finger.lateral_stiffness_n_per_m * deviation[1].exp(),
            ..self.finger
        };
        spring_slider::solve(condition, &finger).map(|cycle| cycle.mu_relative)
    }
}

/// The empirical law of Eq. 20 with the paper's fit, under both readings of its `w`: a mixture, until data
/// decide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmpiricalPsi {
    finger: Finger,
    /// Weight of each reading, in the order of [`Reading::ALL`].
    weights: [f64; 2],
}

impl EmpiricalPsi {
    /// Eq. 20 with `Psi* = 2.38 +- 0.21` for a `w` of which the paper does not say surely what it is: each
    /// reading as likely as the other.
    ///
    /// # Errors
    /// A finger outside the domain of the model, by name.
    pub fn paper(finger: Finger) -> Result<Self, OutOfDomain> {
        finger.check()?;
        Ok(EmpiricalPsi { finger, weights: [0.5; 2] })
    }

    /// The same under one reading.
    ///
    /// # Errors
    /// A finger outside the domain of the model, by name.
    pub fn read(finger: Finger, reading: Reading) -> Result<Self, OutOfDomain> {
        finger.check()?;
        Ok(EmpiricalPsi { finger, weights: Reading::ALL.map(|r| f64::from(u8::from(r == reading))) })
    }

    /// `mu'` at a condition under one reading, and its standard uncertainty from `Psi*` and the collapse.
    ///
    /// # Errors
    /// A condition outside the domain of the law, by name.
    pub fn under(&self, condition: &Condition, reading: Reading) -> Result<(f64, f64), OutOfDomain> {
        condition.check()?;
        Ok(self.under_checked(condition, reading))
    }

    fn under_checked(&self, condition: &Condition, reading: Reading) -> (f64, f64) {
        if condition.amplitude.metres() == 0.0 {
            return (1.0, 0.0);
        }
        let group = PsiEq17::at(condition, self.finger.poisson_ratio);
        let (psi_star, sd) = reading.psi_star();
        let fit = psi::sensitivity_to_psi_star(group, psi_star) * sd;
        (psi::relative_friction(group, psi_star), fit.hypot(psi::COLLAPSE_RMSE))
    }
}

impl FrictionModel for EmpiricalPsi {
    fn name(&self) -> &str {
        "psi"
    }

    fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain> {
        let friction = self.relative_friction(condition)?;
        // Eq. 20 knows no contact: the spring-slider says how finger and plate meet.
        let regime = spring_slider::solve_checked(condition, &self.finger).regime;
        let known = crate::law_table::prediction(condition, [friction.mu_relative, friction.sd]);
        Ok(Prediction { regime, validity: friction.validity, ..known })
    }

    fn relative_friction(&self, condition: &Condition) -> Result<RelativeFriction, OutOfDomain> {
        let (mut mu_relative, mut square) = (0.0, 0.0);
        condition.check()?;
        for (reading, weight) in
            Reading::ALL.into_iter().zip(self.weights).filter(|(_, weight)| *weight > 0.0)
        {
            let (mu, sd) = self.under_checked(condition, reading);
            mu_relative += weight * mu;
            square += weight * (mu * mu + sd * sd);
        }
        let inside = condition.amplitude.metres() == 0.0 || psi::within_fitted_range(condition);
        Ok(RelativeFriction {
            mu_relative,
            // Of the mixture: within the readings and between them.
            sd: (square - mu_relative * mu_relative).max(0.0).sqrt(),
            validity: if inside { Validity::Inside } else { Validity::Extrapolated },
        })
    }

    fn mu_relative(&self, condition: &Condition) -> Result<f64, OutOfDomain> {
        condition.check()?;
        let group = PsiEq17::at(condition, self.finger.poisson_ratio);
        let under = |reading: Reading| psi::relative_friction(group, reading.psi_star().0);
        Ok(Reading::ALL.into_iter().zip(self.weights).map(|(reading, weight)| weight * under(reading)).sum())
    }

    fn form_sd(&self, of: &Prediction) -> f64 {
        of.mu_relative_sd
    }
}

//! The corrected model: baseline and named effects, as `diagnose --save-model` writes it and a run uses it.
//!
//! It is evaluated directly, without allocation: the contact is a closed form or one short sweep, so no table
//! and no interpolation error stands between the verdict and the loop. The one exception is ridge inertia,
//! whose table's error is stated in [`crate::contact::impact::STATED_ERROR`].

use crate::effect::Effect;
use crate::operating::{Baseline, Design};
use crate::predict::{Active, lateral_force};
use models::prediction::{FrictionModel, Prediction, Regime, Validity};
use models::{Ambient, Condition, Covariate, OutOfDomain};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Most effects of one model.
const MOST_EFFECTS: usize = 4;

/// MODEL.toml.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SavedModel {
    /// `muprime.model/1`.
    pub schema: String,
    /// The verdict that the model rests on.
    pub verdict: String,
    /// Relative standard uncertainty of the relative friction that the diagnosis left.
    pub relative_sd: f64,
    /// Error of mu' by interpolation, root mean square; zero where the prediction is evaluated directly.
    pub interpolation_error: f64,
    /// Recalibrated baseline.
    pub baseline: Baseline,
    /// Scales of the table that was diagnosed.
    pub design: Design,
    /// The law that the effects correct, where it is another than the spring-slider.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<SavedLaw>,
    /// Effects; empty where there is no gap.
    #[serde(default, rename = "effect")]
    pub effects: Vec<SavedEffect>,
}

/// The base law of a saved model: the forces of the law, and beside them the change that the effects and the
/// recalibrated baseline make on the spring-slider.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SavedLaw {
    /// Name.
    pub name: String,
    /// SHA-256 of its table, hex; none for a formula. On a table with another hash the model is refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sha256: Option<String>,
    /// Text of its file; none for a built-in law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
    /// Baseline of the spring-slider from which the changes count.
    pub reference: Baseline,
}

/// One effect of a saved model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SavedEffect {
    /// Name.
    pub name: String,
    /// Name of the law.
    pub law: String,
    /// `prediction`, or `reading` for an effect of an instrument.
    pub acts_on: String,
    /// Parameters in the law's order, SI units.
    pub parameters: Vec<SavedParameter>,
    /// Covariance of the parameters, row by row.
    #[serde(default)]
    pub covariance: Vec<Vec<f64>>,
    /// Text of its table, where it is an effect of the user's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
}

/// One parameter of a saved effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SavedParameter {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: String,
}

/// A saved model that cannot be used, and why.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum ModelError {
    /// Another schema.
    #[error("schema is '{0}'; this version reads 'muprime.model/1'")]
    Schema(String),
    /// An effect that the library does not have.
    #[error("effect '{0}' is not in the library; `muprime model effects` lists those that are")]
    Effect(String),
    /// A table of an effect that cannot be used.
    #[error("the table of an effect: {0}")]
    Table(String),
    /// A law that the effect does not have.
    #[error("effect '{effect}' has no law '{law}'")]
    Law { effect: String, law: String },
    /// Parameters that are not the law's.
    #[error("effect '{effect}': parameter {index} should be '{expected}'")]
    Parameter { effect: String, index: usize, expected: &'static str },
    /// A value outside the parameter's range.
    #[error("effect '{effect}': '{name}' = {value} is outside [{lower}, {upper}]")]
    Range { effect: String, name: &'static str, value: f64, lower: f64, upper: f64 },
    /// More effects than a model may hold.
    #[error("{0} effects; at most 4 are compiled")]
    TooMany(usize),
    /// The base law is missing or another one.
    #[error(
        "the model corrects the law '{name}' (SHA-256 {wanted}), and this is {found}; diagnose again with `--model` of the law \
         that is to lead"
    )]
    OtherLaw { name: String, wanted: String, found: String },
    /// A baseline or scale that is not positive.
    #[error("'{0}' must be a finite number above zero")]
    NotPositive(&'static str),
}

/// A law that would do nothing for want of a covariate.
#[derive(Debug, Clone, Copy, thiserror::Error)]
#[error("law '{law}' of {effect} needs the {}", covariate.words)]
pub struct Lack {
    /// The effect.
    pub effect: &'static str,
    /// Its law.
    pub law: &'static str,
    /// What it needs.
    pub covariate: &'static Covariate,
}

#[derive(Clone)]
struct Compiled {
    effect: &'static Effect,
    law: usize,
    theta: Vec<f64>,
}

/// Standard deviation of a law's form, as a share of the change that the effects make: a real cause never has
/// exactly the library's form. On independent data true causes with another formula left 10 to 50 % of the
/// gap.
const FORM_SHARE: f64 = 0.15;

/// A corrected model, checked and ready for the loop.
#[derive(Clone)]
pub struct Corrected {
    baseline: Baseline,
    design: Design,
    effects: Vec<Compiled>,
    relative_sd: f64,
    /// The base law, and the baseline from which changes count.
    law: Option<(Arc<dyn FrictionModel>, Baseline)>,
}

impl Corrected {
    /// Checks a saved model on the law that it corrects, none for the spring-slider, and makes it ready.
    ///
    /// # Errors
    /// Names, ranges or a schema that the library does not know; another law than the one that was corrected.
    pub fn compile_on(saved: &SavedModel, law: Option<Arc<dyn FrictionModel>>) -> Result<Self, ModelError> {
        let none = || "none".to_string();
        let wanted = saved.law.as_ref().map(|l| (l.name.clone(), l.sha256.clone().unwrap_or_else(none)));
        let found =
            law.as_deref().map(|l| (l.name().to_string(), l.sha256().map_or_else(none, String::from)));
        // A table is known by its hash, a formula by its name.
        let key = |(name, sha256): &(String, String)| [name, sha256][usize::from(*sha256 != none())].clone();
        if wanted.as_ref().map(key) != found.as_ref().map(key) {
            let words = |law: Option<_>| law.unwrap_or_else(|| ("spring-slider".to_string(), none()));
            let ((name, wanted), (other, sha256)) = (words(wanted), words(found));
            return Err(ModelError::OtherLaw { name, wanted, found: format!("'{other}' ({sha256})") });
        }
        if saved.schema != "muprime.model/1" {
            return Err(ModelError::Schema(saved.schema.clone()));
        }
        let b = &saved.baseline;
        for (name, v) in [
            ("baseline.mu0", b.mu0),
            ("baseline.normal_stiffness_n_per_m", b.normal_stiffness_n_per_m),
            ("baseline.lateral_stiffness_n_per_m", b.lateral_stiffness_n_per_m),
            ("design.reference_load_n", saved.design.reference_load_n),
            ("design.reference_speed_m_s", saved.design.reference_speed_m_s),
        ] {
            if !(v.is_finite() && v > 0.0) {
                return Err(ModelError::NotPositive(name));
            }
        }
        if saved.effects.len() > MOST_EFFECTS {
            return Err(ModelError::TooMany(saved.effects.len()));
        }
        let mut effects = Vec::with_capacity(saved.effects.len());
        for s in &saved.effects {
            let effect = match &s.table {
                None => crate::library().iter().copied().find(|e| e.name == s.name),
                Some(text) => Some(crate::at(crate::own(&s.name, text).map_err(ModelError::Table)?)),
            };
            let effect = effect.ok_or_else(|| ModelError::Effect(s.name.clone()))?;
            let no_law = || ModelError::Law { effect: s.name.clone(), law: s.law.clone() };
            let law = effect.laws.iter().position(|l| l.name == s.law).ok_or_else(no_law)?;
            let expected = effect.laws[law].parameters;
            let mut theta = Vec::with_capacity(expected.len());
            for (index, p) in expected.iter().map(|p| p.at_load(saved.design.reference_load_n)).enumerate() {
                let given = s.parameters.get(index).filter(|g| g.name == p.name && g.unit == p.unit);
                let other = || ModelError::Parameter { effect: s.name.clone(), index, expected: p.name };
                let value = given.ok_or_else(other)?.value;
                let slack = 1e-9 * (p.upper - p.lower).abs().min(1.0);
                if !(value >= p.lower - slack && value <= p.upper + slack) {
                    let (effect, name, lower, upper) = (s.name.clone(), p.name, p.lower, p.upper);
                    return Err(ModelError::Range { effect, name, value, lower, upper });
                }
                theta.push(value);
            }
            (effect.prepare)(law, &theta);
            effects.push(Compiled { effect, law, theta });
        }
        crate::contact::prepare();
        effects.sort_by_key(|c| {
            crate::library().iter().position(|e| e.name == c.effect.name).unwrap_or(usize::MAX)
        });
        Ok(Self {
            baseline: saved.baseline,
            design: saved.design,
            effects,
            relative_sd: saved.relative_sd,
            law: law.zip(saved.law.as_ref().map(|l| l.reference)),
        })
    }

    /// The first law that needs what neither a channel of every rig nor `ambient` gives.
    pub fn lacks(&self, ambient: &Ambient) -> Option<Lack> {
        let known = Condition::paper().within(ambient);
        self.effects.iter().find_map(|c| {
            let law = &c.effect.laws[c.law];
            let needs = c.effect.needs.iter().chain(law.needs);
            let covariate = needs.filter_map(|n| n.covariate()).find(|k| k.of(&known).is_none())?;
            Some(Lack { effect: c.effect.name, law: law.name, covariate })
        })
    }

    /// Signed mean lateral force that the sensor will read at a pass, N; NaN where the base law cannot tell.
    /// Allocates nothing.
    pub fn lateral_force(&self, pass: &Condition) -> f64 {
        let beside =
            self.law.as_ref().map_or(Ok([0.0; 2]), |(_, reference)| self.beside(reference.mu0, pass));
        self.lateral_force_from(&self.baseline, pass) + beside.map_or(f64::NAN, |[force, _]| force)
    }

    /// Force of the base law less that of the spring-slider which stands for it, N, signed, and the standard
    /// deviation of the law's `mu'`; zeros without a base law.
    fn beside(&self, mu0: f64, pass: &Condition) -> Result<[f64; 2], OutOfDomain> {
        let Some((law, reference)) = &self.law else { return Ok([0.0; 2]) };
        let of = law.predict(&Condition { mu0, ..*pass })?;
        let slider = lateral_force(&Baseline { mu0, ..*reference }, &[], pass, &self.design);
        Ok([of.lateral_force_n * pass.direction.sign() - slider, law.form_sd(&of)])
    }

    fn lateral_force_from(&self, baseline: &Baseline, pass: &Condition) -> f64 {
        let zero: [f64; 0] = [];
        let idle = Active { effect: &Effect::NONE, law: 0, theta: &zero };
        let mut active = [idle; MOST_EFFECTS];
        for (slot, c) in active.iter_mut().zip(&self.effects) {
            *slot = Active { effect: c.effect, law: c.law, theta: &c.theta };
        }
        lateral_force(baseline, &active[..self.effects.len()], pass, &self.design)
    }
}

impl FrictionModel for Corrected {
    fn name(&self) -> &str {
        "corrected"
    }

    fn base(&self) -> Option<&dyn FrictionModel> {
        self.law.as_ref().map(|(law, _)| &**law)
    }

    fn form_sd(&self, of: &Prediction) -> f64 {
        of.mu_relative_sd
    }

    /// The lateral force is what the sensor will read along the motion, so an effect of an instrument is in
    /// it; the relative friction is that force over `mu_0 F_n` with the loop's own `mu_0`.
    fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain> {
        condition.check()?;
        let mut own = self.effects.iter().filter_map(|c| c.effect.own);
        own.try_for_each(|own| own.factor(1.0, condition).map(drop))?;
        // The finger of today may rub more or less than that of the diagnosis: the loop's mu_0 counts.
        let baseline = Baseline { mu0: condition.mu0, ..self.baseline };
        let sign = condition.direction.sign();
        let sliding = self.lateral_force_from(&baseline, condition);
        let [beside, of_law] = self.beside(condition.mu0, condition)?;
        let along = sign * (sliding + beside);
        let full = condition.mu0 * condition.normal_force_n;
        let change = sliding - lateral_force(&baseline, &[], condition, &self.design);
        let contact = self.baseline.contact(condition, &self.design);
        let regime = if contact.amplitude_pp < crate::contact::STILL_PLATE_M || contact.load_ratio() >= 1.0 {
            Regime::FullContact
        } else if contact.drag() >= 1.0 {
            Regime::FullSlip
        } else {
            Regime::Intermittent
        };
        let outside = condition.amplitude.metres() > 1.05 * self.design.largest_amplitude_m;
        Ok(Prediction {
            mu_relative: along / full,
            mu_relative_sd: (self.relative_sd * along / full).hypot(FORM_SHARE * change / full).hypot(of_law),
            lateral_force_n: along,
            regime,
            validity: if outside { Validity::Extrapolated } else { Validity::Inside },
        })
    }
}

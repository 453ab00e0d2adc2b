//! Laws by name, laws from files with the hash by which records and verdicts call them, a law with a target.

use crate::condition::{Condition, OutOfDomain};
use crate::finger::Finger;
use crate::prediction::{
    EmpiricalPsi, FrictionModel, Prediction, RelativeFriction, SpringSlider, as_its_law,
};
use crate::surrogate::Surrogate;
use crate::target::Target;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A law that needs no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BuiltIn {
    /// Eqs. 6-15.
    SpringSlider,
    /// Eqs. 16-20.
    Psi,
    /// The ridge table that ships with the project.
    Surrogate,
}

impl BuiltIn {
    /// Every one.
    pub const ALL: [BuiltIn; 3] = [BuiltIn::SpringSlider, BuiltIn::Psi, BuiltIn::Surrogate];

    /// The name that people type.
    pub const fn name(self) -> &'static str {
        match self {
            BuiltIn::SpringSlider => "spring-slider",
            BuiltIn::Psi => "psi",
            BuiltIn::Surrogate => "surrogate",
        }
    }

    /// The names in a sentence.
    pub fn names() -> String {
        Self::ALL.map(Self::name).join(", ")
    }

    /// The law of that name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|law| law.name() == name)
    }

    /// The law for a finger.
    ///
    /// # Errors
    /// A finger outside the domain of the law, by name.
    pub fn law(self, finger: &Finger) -> Result<Arc<dyn FrictionModel>, OutOfDomain> {
        finger.check()?;
        let table = || Surrogate::shipped().expect("the shipped table reads, as a test proves");
        Ok(match self {
            BuiltIn::SpringSlider => Arc::new(SpringSlider::new(*finger)?),
            BuiltIn::Psi => Arc::new(EmpiricalPsi::paper(*finger)?),
            BuiltIn::Surrogate => Arc::new(table().for_finger(finger)),
        })
    }
}

/// A law from a table, with its name and the hash of the table.
pub struct Named {
    /// The law.
    pub law: Arc<dyn FrictionModel>,
    /// Its name in records and reports.
    pub name: String,
    /// SHA-256 of its table, hex.
    pub sha256: String,
}

impl FrictionModel for Named {
    fn name(&self) -> &str {
        &self.name
    }

    as_its_law!();

    fn sha256(&self) -> Option<&str> {
        Some(&self.sha256)
    }
}

/// A law with the target that a loop renders by it.
pub struct Rendering {
    /// The law.
    pub law: Arc<dyn FrictionModel>,
    /// The target.
    pub target: Target,
}

impl FrictionModel for Rendering {
    fn name(&self) -> &str {
        self.law.name()
    }

    as_its_law!();

    fn sha256(&self) -> Option<&str> {
        self.law.sha256()
    }

    fn base(&self) -> Option<&dyn FrictionModel> {
        self.law.base()
    }

    fn target(&self) -> Option<&Target> {
        Some(&self.target)
    }
}

//! One cause in one of its laws: a part of a hypothesis. docs/diagnosis/model.md, section 4.

use effects::{Design, Law, Location, Parameter};

/// One member of a hypothesis: number of the effect, and index of its law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Member {
    /// Number of the effect, see [`effects::at`]: the library comes first.
    pub effect: usize,
    /// Index of the law.
    pub law: usize,
}

impl Member {
    /// The law.
    pub fn form(&self) -> &'static Law {
        &effects::at(self.effect).laws[self.law]
    }
    /// The law's parameters, with what the loads of a table make of their priors.
    pub fn parameters(&self, design: &Design) -> Vec<Parameter> {
        self.form().parameters.iter().map(|p| p.at_load(design.reference_load_n)).collect()
    }
    /// How many there are.
    pub fn count(&self) -> usize {
        self.form().parameters.len()
    }
    /// The effect's name.
    pub fn name(&self) -> &'static str {
        effects::at(self.effect).name
    }
    /// Largest share of its change by which it may depart from its form.
    pub fn departs_by(&self) -> f64 {
        effects::at(self.effect).departs_by
    }
    /// Where the effect sits.
    pub fn place(&self) -> Location {
        effects::at(self.effect).place
    }
}

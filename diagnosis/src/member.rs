//! One cause in one of its laws: the letter from which hypotheses are spelled.

use effects::{Design, Law, Parameter, Place, known};

/// One member of a hypothesis: index of the effect among the known ones, and of its law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Member {
    /// Index among [`known`] causes, the library first.
    pub effect: usize,
    /// Index of the law.
    pub law: usize,
}

impl Member {
    /// The law.
    pub fn form(&self) -> &'static Law {
        &known()[self.effect].laws[self.law]
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
        known()[self.effect].name
    }
    /// Largest share of its change by which it may depart from its form.
    pub fn departs_by(&self) -> f64 {
        known()[self.effect].departs_by
    }
    /// Where the effect sits.
    pub fn place(&self) -> Place {
        known()[self.effect].place
    }
}

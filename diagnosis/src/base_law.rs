//! A base law in place of the spring-slider. docs/diagnosis/model.md, section 2.
//!
//! It is read once for each pass, at the nominal mu_0. What recalibration and candidate effects do is the
//! change that they make on the spring-slider, and it is added to the force of the law. The law's own
//! uncertainty counts as scatter of each pass, as it does in the loop. Passes at which the law cannot tell
//! are left out and named.

use crate::data::Table;
use effects::corrected::SavedLaw;
use effects::{Baseline, Design};
use models::{Condition, FrictionModel};
use serde::Serialize;
use std::sync::Arc;

/// Fewest passes that a law must be able to tell.
const FEWEST: usize = 12;

/// The base law of a verdict.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct LawNote {
    /// Name.
    pub name: String,
    /// SHA-256 of its table, hex; none for a formula.
    pub sha256: Option<String>,
    /// Points at which the law cannot tell: they are left out.
    pub cannot_tell: Vec<u64>,
}

/// A law that can tell too little of a table.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "the law '{law}' cannot tell at {missing} of {of} passes, first at point {point} ({why}); at least {FEWEST} passes must be \
     within it: widen its table"
)]
pub struct CannotTell {
    law: String,
    missing: usize,
    of: usize,
    point: u64,
    why: String,
}

/// A base law on a table.
pub struct BaseLaw {
    model: Arc<dyn FrictionModel>,
    text: Option<String>,
    left_out: Vec<u64>,
}

impl std::fmt::Debug for BaseLaw {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BaseLaw").field("note", &self.note()).finish_non_exhaustive()
    }
}

impl BaseLaw {
    /// A law with the text of its file (none for a built-in one), and the passes of a table at which it can
    /// tell.
    ///
    /// # Errors
    /// Fewer than 12 of them.
    pub fn on(
        model: Arc<dyn FrictionModel>,
        text: Option<String>,
        table: &Table,
    ) -> Result<(BaseLaw, Table), CannotTell> {
        let mu0 = table.nominal_mu0();
        let tells = |i: &usize| model.predict(&Condition { mu0, ..table.passes[*i] });
        let (within, without): (Vec<usize>, Vec<usize>) = (0..table.len()).partition(|i| tells(i).is_ok());
        let left_out = without.iter().map(|i| table.points[*i]).collect();
        match without.first() {
            Some(first) if within.len() < FEWEST => Err(CannotTell {
                law: model.name().to_string(),
                missing: without.len(),
                of: table.len(),
                point: table.points[*first],
                why: tells(first).map_or_else(|why| why.to_string(), |_| String::new()),
            }),
            _ => Ok((BaseLaw { model, text, left_out }, table.select(&within))),
        }
    }

    /// Signed lateral force beside that of the spring-slider's nominal baseline, and the law's standard
    /// uncertainty, N. NaN where the law cannot tell.
    pub(crate) fn beside(&self, nominal: &Baseline, design: &Design, pass: &Condition) -> [f64; 2] {
        let condition = Condition { mu0: nominal.mu0, ..*pass };
        self.model.predict(&condition).map_or([f64::NAN; 2], |p| {
            let sd = self.model.form_sd(&p) * nominal.mu0 * pass.normal_force_n;
            let slider = effects::lateral_force(nominal, &[], pass, design);
            [pass.direction.sign() * p.lateral_force_n - slider, sd]
        })
    }

    /// Whether the law can tell at a condition.
    pub(crate) fn tells(&self, mu0: f64, pass: &Condition) -> bool {
        self.model.predict(&Condition { mu0, ..*pass }).is_ok()
    }

    /// How the verdict names it.
    pub fn note(&self) -> LawNote {
        LawNote {
            name: self.model.name().to_string(),
            sha256: self.model.sha256().map(String::from),
            cannot_tell: self.left_out.clone(),
        }
    }

    /// How a corrected model names it.
    pub(crate) fn saved(&self, reference: Baseline) -> SavedLaw {
        let LawNote { name, sha256, .. } = self.note();
        SavedLaw { name, sha256, table: self.text.clone(), reference }
    }

    /// What is to be known beside a verdict.
    pub(crate) fn remark(&self) -> String {
        let left_out = match self.left_out.len() {
            0 => String::new(),
            n => format!(
                " The law cannot tell at {n} passes outside its range, the first at point {}: they are left out.",
                self.left_out[0]
            ),
        };
        format!(
            "The base prediction is the law '{}'. Recalibration and candidate effects add the change that they make on the \
             spring-slider.{left_out}",
            self.model.name()
        )
    }
}

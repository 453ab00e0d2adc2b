//! One sealed set a case, made, diagnosed and scored: case `i` is the `i`th set that `muprime blind --seed SEED` scores.

use super::{Case, CaseKind, document, flag, no_lines, number, settings, text, word};
use crate::cases::{file::Header, run::here};
pub use crate::validation::blind::BlindStudy;
use crate::validation::blind::{Scored, score, set};

/// The kind.
pub const KIND: CaseKind = CaseKind {
    name: "blind",
    words: "a sealed set of the independent simulation, diagnosed and scored, as `muprime blind` does",
    model: 1,
    columns: &[
        text("stratum", "kind of truth"),
        text("truth", "true causes, joined by +"),
        text("verdict", "the verdict"),
        text("named", "effects of the first hypothesis, joined by +"),
        number("probability_of_truth", "stated probability of the truth"),
        number("top_probability", "stated probability of the first hypothesis"),
        flag("top_right", "whether the first hypothesis is the truth"),
        number("claimed_shrinkage", "claimed shrinkage of the gap"),
        number("achieved_shrinkage", "achieved on the hidden passes"),
        number("covered", "share of hidden passes inside their intervals"),
        text("document", "the scored set as `muprime blind --json` has it"),
    ],
    prepare,
};

fn prepare(header: &Header, _: &std::path::Path) -> miette::Result<super::Make> {
    no_lines(header)?;
    let settings: BlindStudy = settings(header)?;
    let inputs = serde_json::to_string(&settings).unwrap_or_default();
    let options = settings.options()?;
    Ok(Box::new(move |index, _| {
        let (settings, options) = (settings.clone(), options.clone());
        let run = move || {
            let scored = score(&set(settings.seed, index, settings.stratum), &options)
                .map_err(|why| format!("{why:#}"))?;
            Ok(vec![
                word(scored.stratum)?.into(),
                scored.truth.join("+").into(),
                word(scored.verdict)?.into(),
                scored.named.join("+").into(),
                scored.probability_of_truth.into(),
                scored.top_probability.into(),
                scored.top_right.into(),
                scored.claimed.into(),
                scored.achieved.into(),
                scored.covered.into(),
                serde_json::to_string(&scored).map_err(|e| e.to_string())?.into(),
            ])
        };
        Ok(Case { inputs: format!("{index} {inputs}"), run: Box::new(run) })
    }))
}

/// Makes and scores so many sets here; `watch` gets each.
///
/// # Errors
/// A constant that there is not, or a set that the diagnosis refuses.
pub fn run(settings: &BlindStudy, sets: u64, watch: &mut dyn FnMut(&Scored)) -> miette::Result<Vec<Scored>> {
    let mut all = Vec::new();
    here(&KIND, settings, sets, &mut |cells| {
        let scored = document(&cells)?;
        watch(&scored);
        all.push(scored);
        Ok(())
    })?;
    Ok(all)
}

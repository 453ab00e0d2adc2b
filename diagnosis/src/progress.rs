//! Progress of a diagnosis.

use std::fmt;
use std::sync::Arc;

/// A stage that was reached.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgressReport {
    /// What is being done.
    pub doing: &'static str,
    /// Share of the work that is done, 0 to 1; a second look at the table begins anew.
    pub share: f64,
    /// Effects that lead so far with their log evidence over no gap in nats, best first: before pairs,
    /// left-out regions and the open set are judged, so no verdict. Empty until there are some.
    pub leading: Vec<(Vec<&'static str>, f64)>,
}

/// The receiver of the stages; none by default.
#[derive(Clone, Default)]
pub struct Progress(Option<Arc<dyn Fn(ProgressReport) + Send + Sync>>);

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Progress").field(&self.0.is_some()).finish()
    }
}

impl Progress {
    /// Calls `receiver` at each stage, from any thread.
    pub fn to(receiver: impl Fn(ProgressReport) + Send + Sync + 'static) -> Self {
        Progress(Some(Arc::new(receiver)))
    }

    /// A stage is reached.
    pub(crate) fn at(&self, doing: &'static str, share: f64) {
        self.with(doing, share, Vec::new);
    }

    /// A stage is reached with something to show.
    pub(crate) fn with(
        &self,
        doing: &'static str,
        share: f64,
        leading: impl FnOnce() -> Vec<(Vec<&'static str>, f64)>,
    ) {
        if let Some(receiver) = &self.0 {
            receiver(ProgressReport { doing, share, leading: leading() });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypotheses::Options;
    use crate::tests::{Deviates, rig, table};
    use std::sync::Mutex;

    #[test]
    fn stages_are_reported_and_change_nothing() {
        let table = table(&mut Deviates(5), 0.8);
        let stages = Arc::new(Mutex::new(Vec::new()));
        let sink = Arc::clone(&stages);
        let quiet = Options { pairs: false, ..Options::default() };
        let progress = Progress::to(move |stage| sink.lock().unwrap().push(stage));
        let options = Options { progress, ..quiet.clone() };
        let alone = crate::report::diagnose(&table, &rig(), &quiet, String::new());
        let watched = crate::report::diagnose(&table, &rig(), &options, String::new());
        let outcome = |d: &crate::report::Diagnosis| -> Vec<(Vec<String>, u64)> {
            d.report.hypotheses.iter().map(|h| (h.effects.clone(), h.probability.to_bits())).collect()
        };
        assert_eq!(outcome(&alone), outcome(&watched));
        let stages = stages.lock().unwrap();
        assert!(stages.len() > 20 && stages.iter().all(|s| (0.0..=1.0).contains(&s.share)), "{stages:?}");
        assert!(stages.iter().any(|s| s.leading.len() > 3), "{stages:?}");
    }

    /// It reported the stages a second time; a diagnosis stopped meanwhile showed its leading causes.
    #[test]
    fn the_second_opinion_on_suspect_passes_reports_nothing() {
        let mut table = table(&mut Deviates(5), 0.8);
        table.lateral[7] *= 1.5;
        let stages = Arc::new(Mutex::new(Vec::new()));
        let sink = Arc::clone(&stages);
        let progress = Progress::to(move |stage| sink.lock().unwrap().push(stage.doing));
        let options = Options { progress, pairs: false, ..Options::default() };
        let watched = crate::report::diagnose(&table, &rig(), &options, String::new());
        assert!(watched.report.with_suspects.is_some(), "{:?}", watched.report.scatter);
        assert_eq!(stages.lock().unwrap().last(), Some(&"suspect passes"));
    }
}

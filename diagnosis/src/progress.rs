//! How far a diagnosis is, told to whoever waits for it.

use std::fmt;
use std::sync::Arc;

/// A stage that was reached.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// What is being done.
    pub doing: &'static str,
    /// Share of the work that is done, 0 to 1; a second look at the table begins anew.
    pub share: f64,
    /// Effects that lead so far with their log evidence over no gap in nats, best first: before pairs, left-out regions and the open set
    /// are judged, so no verdict. Empty until there are some.
    pub leading: Vec<(Vec<&'static str>, f64)>,
}

/// Who is told; nobody by default.
#[derive(Clone, Default)]
pub struct Progress(Option<Arc<dyn Fn(Stage) + Send + Sync>>);

impl fmt::Debug for Progress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Progress").field(&self.0.is_some()).finish()
    }
}

impl Progress {
    /// Tells that one, from whichever thread.
    pub fn to(told: impl Fn(Stage) + Send + Sync + 'static) -> Self {
        Progress(Some(Arc::new(told)))
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
        if let Some(told) = &self.0 {
            told(Stage { doing, share, leading: leading() });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::example::{Deviates, rig, table};
    use crate::hypotheses::Options;
    use std::sync::Mutex;

    #[test]
    fn stages_are_told_and_change_nothing() {
        let table = table(&mut Deviates(5), 0.8);
        let told = Arc::new(Mutex::new(Vec::new()));
        let kept = Arc::clone(&told);
        let quiet = Options { pairs: false, ..Options::default() };
        let progress = Progress::to(move |stage| kept.lock().unwrap().push(stage));
        let options = Options { progress, ..quiet.clone() };
        let alone = crate::verdict::diagnose(&table, &rig(), &quiet, String::new());
        let watched = crate::verdict::diagnose(&table, &rig(), &options, String::new());
        let said = |d: &crate::verdict::Diagnosis| -> Vec<(Vec<String>, u64)> {
            d.report.hypotheses.iter().map(|h| (h.effects.clone(), h.probability.to_bits())).collect()
        };
        assert_eq!(said(&alone), said(&watched));
        let told = told.lock().unwrap();
        assert!(told.len() > 20 && told.iter().all(|s| (0.0..=1.0).contains(&s.share)), "{told:?}");
        assert!(told.iter().any(|s| s.leading.len() > 3), "{told:?}");
    }
}

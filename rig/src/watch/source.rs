//! Hears a run: by its feed where one can be had, else by looking into its folder.

use super::{Shared, Source};
use crate::live::{Ended, Progress, Received, Run, Viewer};
use runs::Summary;
use runs::run_dir::{self, passes_in};
use runs::setup::Guards;
use std::path::Path;
use std::time::{Duration, Instant};

/// The longest that is waited for a message.
const HEAR_FOR: Duration = Duration::from_millis(100);
/// Time between two tries to find a feed, or two looks into a folder.
const AGAIN_AFTER: Duration = Duration::from_millis(500);

/// Hears until the view is over.
pub(super) fn hear(shared: &Shared) {
    let mut folder = Folder::default();
    while !shared.is_over() {
        // Looked at before the feed: a run that ends between the two is looked at once more.
        let held = run_dir::is_held(&shared.folder);
        match Viewer::connect(&shared.folder) {
            Ok(viewer) => follow(shared, viewer),
            // Its own run is on its way; whoever looks at another one looks into its folder.
            Err(_) if shared.own => {}
            Err(why) => folder.look(shared, held, &why.to_string()),
        }
        let until = Instant::now() + AGAIN_AFTER;
        while Instant::now() < until && !shared.is_over() {
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

/// Follows a feed until it ends, or lets this viewer go.
fn follow(shared: &Shared, mut viewer: Viewer) {
    shared.hand.reach(viewer.asking().ok().map(|ask| Box::new(ask) as _));
    while !shared.is_over() {
        match viewer.hear(HEAR_FOR) {
            Received::Message(message) => {
                let mut seen = shared.seen();
                seen.source = Source::Feed;
                seen.heard = Instant::now();
                seen.view.take(*message);
            }
            Received::Nothing => {}
            Received::Gone => break,
        }
    }
    shared.hand.reach(None);
}

/// A run's folder, as it was looked at last.
#[derive(Default)]
struct Folder {
    journal: u64,
    read: bool,
    ended: bool,
    run: Option<Run>,
}

impl Folder {
    /// Shows the passes of a run without a feed, and its end once no process holds it.
    fn look(&mut self, shared: &Shared, held: bool, why: &str) {
        // The feed's end is more complete than the folder's.
        if shared.seen().view.ended.is_some() && (self.ended || !self.read) && !held {
            return;
        }
        let folder = &shared.folder;
        let length = std::fs::metadata(folder.join(run_dir::JOURNAL)).map_or(0, |m| m.len());
        let grown = !self.read || length != self.journal;
        let passes = grown.then(|| passes_in(folder));
        let ended = (!held).then(|| end_of(folder));
        if self.run.is_none() {
            self.run = run_of(folder);
        }
        let planned = planned(folder);
        let mut seen = shared.seen();
        seen.heard = Instant::now();
        seen.source = Source::Folder(held.then(|| why.to_string()));
        let view = &mut seen.view;
        if view.run.is_none() {
            view.run.clone_from(&self.run);
        }
        // A table that is read between two writes is whole at the next look.
        if let Some(Ok(passes)) = passes {
            view.passes = passes;
            (self.read, self.journal) = (true, length);
        }
        let made = view.passes.len();
        let planned = planned.unwrap_or(view.progress.planned);
        view.progress = Progress { made, planned, remaining_s: 0.0 };
        // A run may be resumed.
        self.ended = ended.is_some();
        view.ended = ended;
        seen.view.states.clear();
    }
}

/// How a run ended that no process leads.
fn end_of(folder: &Path) -> Ended {
    let Some(summary) = Summary::written_in(folder) else {
        let error = Some("it has no summary: its process ended without one".into());
        let off = Some("nobody has seen whether the drive is off: check the amplifier".into());
        return Ended { error, off, ..Ended::default() };
    };
    Ended::of(&Ok(summary))
}

fn planned(folder: &Path) -> Option<usize> {
    let begun = run_dir::identity_in(folder).ok().map(|run| run.planned).filter(|planned| *planned > 0);
    begun.or_else(|| Some(Summary::written_in(folder)?.planned))
}

fn run_of(folder: &Path) -> Option<Run> {
    let mut facts = run_dir::record_facts(folder).ok()?;
    let mut fact = |name: &str| facts.remove(name);
    let started_unix_s = fact("start_unix_ns").and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9;
    Some(Run {
        folder: folder.into(),
        plan: fact("plan").unwrap_or_default(),
        setup: fact("setup").unwrap_or_default(),
        model: fact("model").unwrap_or_default(),
        operator: fact("operator"),
        sample: fact("sample"),
        started_unix_s,
        fast: fact("clock").is_some_and(|clock| clock == "virtual"),
        guards: Guards::of_facts(fact),
        ..Run::default()
    })
}

//! The studies of `muprime blind` beside the score: other scatter, other constants, the library's own forms, further passes.

use super::super::prelude::*;
use super::Args;
use diagnosis::constants::{Row, Stage};
use diagnosis::hypotheses::Options;
use serde_json::Value;
use sim::sealed::Stratum;
use sim::sealed::rough::{RoughSet, Roughness};
use std::sync::Arc;
use studies::progress::Study;
use studies::validation::blind::further::{self, LIMIT, Race};
use studies::validation::blind::rough::{self, Answers, TRUTHS};
use studies::validation::blind::same_form::{self, Covered};
use studies::validation::blind::{sensitivity, share};

/// One JSON document; one that Ctrl-C has cut says so.
fn document(mut report: Value, partial: bool) {
    if partial {
        report["partial"] = true.into();
    }
    out!("{report}");
}

/// What stands above a table that Ctrl-C has cut.
fn cut(done: u64, of: usize, json: bool) {
    if !json {
        out!("partial: {done} of {of} sets");
    }
}

/// Answers on scatter that is not what rig.toml states.
pub fn rough(args: &Args, kind: &str, options: &Options, json: bool) -> miette::Result<ExitCode> {
    let picked: Vec<_> =
        Roughness::ALL.into_iter().filter(|(name, _)| kind == "all" || kind == *name).collect();
    if picked.is_empty() {
        let names: Vec<&str> = Roughness::ALL.iter().map(|k| k.0).collect();
        miette::bail!("--noise {kind}: {} or all is needed", names.join(", "));
    }
    let (seed, sets, all) = (args.of.seed, args.sets, args.sets * TRUTHS.len() * picked.len());
    let study = Study::begin(all as u64, "sets", move |found: Vec<Answers>, done| {
        cut(done, all, json);
        tell_rough(&Answers::summed(&found), seed, sets, true, json);
    })?;
    let each = |seed: u64, set: &RoughSet, report: &diagnosis::verdict::Report, one: &Answers| {
        if args.verbose {
            let suspects: Vec<u64> = report.scatter.suspects.iter().map(|s| s.point).collect();
            let (s, text) = (&report.scatter, &report.text);
            study.bar.suspend(|| say!(
                "{seed}: bad {:?}, suspect {suspects:?}, together {:?}, scale {:.2}, runs {:?}, correlation {:.2}; {text}",
                set.bad,
                s.together_in,
                s.scale,
                s.run_relative_sd,
                s.serial_correlation
            ));
        }
        study.done(Some(one.clone()));
    };
    let mut rows: Vec<Answers> = Vec::new();
    for kind in picked {
        rows.extend(rough::run(seed, sets, kind, &TRUTHS, options, each)?);
    }
    drop(study);
    tell_rough(&rows, seed, sets, false, json);
    Ok(ExitCode::SUCCESS)
}

fn tell_rough(rows: &[Answers], seed: u64, sets: usize, partial: bool, json: bool) {
    if json {
        let report = json!({
            "schema": "muprime.blind.noise/1", "seed": seed, "sets": sets, "rows": rows,
        });
        return document(report, partial);
    }
    out!(
        "| scatter | truth | sets | right | wrong | ambiguous | unknown | missed | bad passes found | others suspect |"
    );
    out!("|---|---|---|---|---|---|---|---|---|---|");
    for a in rows {
        let (found, others) = (format!("{}/{}", a.found, a.bad), format!("{}/{}", a.falsely, a.good));
        out!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {found} | {others} |",
            a.noise,
            a.truth,
            a.sets,
            a.right,
            a.wrong,
            a.ambiguous,
            a.unknown,
            a.missed
        );
    }
}

/// Verdicts with each constant halved and doubled.
pub fn sensitivity(
    args: &Args,
    choice: &str,
    stratum: Option<Stratum>,
    options: &Options,
    json: bool,
) -> miette::Result<ExitCode> {
    let picked = |row: &Row| match choice {
        "all" => true,
        "fit" => row.stage == Stage::Fit,
        "decision" => row.stage == Stage::Decision,
        name => row.name == name,
    };
    if !options.constants.rows().iter().any(picked) {
        miette::bail!("--sensitivity {choice}: fit, decision, the name of a constant, or nothing is needed");
    }
    let tried = Arc::new(sensitivity::Study::new(options, &picked)?);
    let (seed, sets, so_far) = (args.of.seed, args.sets, Arc::clone(&tried));
    let study = Study::begin(sets as u64, "sets", move |_: Vec<()>, done| {
        cut(done, sets, json);
        tell_sensitivity(&so_far.rows(), seed, sets, true, json);
    })?;
    tried.run(seed, sets, stratum, &|| study.done(None))?;
    drop(study);
    tell_sensitivity(&tried.rows(), seed, sets, false, json);
    Ok(ExitCode::SUCCESS)
}

fn tell_sensitivity(rows: &[sensitivity::Row], seed: u64, sets: usize, partial: bool, json: bool) {
    if json {
        let report = json!({
            "schema": "muprime.blind.sensitivity/1", "seed": seed, "sets": sets, "rows": rows,
        });
        return document(report, partial);
    }
    out!("| constant | factor | right | misnamed | changed | probability on the truth | n |");
    out!("|---|---|---|---|---|---|---|");
    for r in rows {
        out!(
            "| `{}` | {} | {} | {} | {} | {:.3} | {} |",
            r.constant,
            r.factor,
            r.right,
            r.misnamed,
            r.changed,
            r.probability,
            r.sets
        );
    }
}

/// Coverage of the size's interval, and how many sets were named in their own form.
pub fn same_form(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let sets = args.sets;
    let study = Study::begin(sets as u64, "sets", move |found: Vec<Covered>, done| {
        cut(done, sets, json);
        tell_same_form(&found, true, json);
    })?;
    let found = same_form::run(args.of.seed, sets, &|one| study.done(Some(one.clone())))?;
    drop(study);
    tell_same_form(&found, false, json);
    Ok(ExitCode::SUCCESS)
}

fn tell_same_form(sets: &[Covered], partial: bool, json: bool) {
    let stated: Vec<(f64, [f64; 2])> = sets.iter().filter_map(|s| Some((s.truth, s.ci95?))).collect();
    let covered = stated.iter().map(|(t, ci)| ci[0] <= *t && *t <= ci[1]).collect();
    let figure = share("size inside its 95 % interval, same form", "0.92 to 0.98", covered);
    if json {
        let report = json!({ "schema": "muprime.blind.same_form/1", "figure": figure, "sets": sets });
        return document(report, partial);
    }
    let ci = figure.ci95.unwrap_or([f64::NAN; 2]);
    out!(
        "{}: {:.3} [{:.3}, {:.3}], n {} of {} sets (the others were not named in their own form)",
        figure.name,
        figure.value.unwrap_or(f64::NAN),
        ci[0],
        ci[1],
        figure.n,
        sets.len()
    );
}

/// Passes until a probability of 0.9, designed and at random.
pub fn further(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let sets = args.sets;
    let study = Study::begin(sets as u64, "sets", move |races: Vec<Race>, done| {
        cut(done, sets, json);
        tell_further(&races, true, json);
    })?;
    let each = |race: Option<&Race>| {
        if let Some(r) = race.filter(|_| args.verbose) {
            let passes = |n: Option<usize>| n.map_or(format!("> {LIMIT}"), |n| n.to_string());
            let (designed, random) = (passes(r.designed), passes(r.random));
            study.bar.suspend(|| {
                say!(
                    "{} {:26} from {} before {:.3} designed {designed} random {random}",
                    r.seed,
                    r.truth,
                    r.passes,
                    r.before
                );
            });
        }
        study.done(race.cloned());
    };
    let races = further::run(args.of.seed, sets, &each)?;
    drop(study);
    tell_further(&races, false, json);
    Ok(ExitCode::SUCCESS)
}

fn tell_further(races: &[Race], partial: bool, json: bool) {
    let figures = further::figures(races);
    if json {
        let report = json!({
            "schema": "muprime.blind.further/2", "limit": LIMIT, "figures": figures, "races": races,
        });
        return document(report, partial);
    }
    out!(
        "further passes to a probability of 0.9 on the truth, {} sets whose cause is open at first:",
        races.len()
    );
    for f in figures {
        let ci = f.ci95.unwrap_or([f64::NAN; 2]);
        let value = f.value.unwrap_or(f64::NAN);
        out!("  {:46} {value:7.3} [{:.3}, {:.3}]  n {}  {}", f.name, ci[0], ci[1], f.n, f.target);
    }
    let count = |of: &dyn Fn(usize, usize) -> bool| {
        let passes = |n: Option<usize>| n.unwrap_or(usize::MAX);
        races.iter().filter(|r| of(passes(r.designed), passes(r.random))).count()
    };
    out!("  designed sooner in {}, later in {}", count(&|d, r| d < r), count(&|d, r| d > r));
}

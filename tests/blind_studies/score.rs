//! Scores labelled sets on disk: `cargo run --release -p muprime-tests --example score -- FOLDER LINES.json
//! [+NAME=VALUE ...] [NAME=VALUE ...]`.
//!
//! Every folder in `FOLDER` holds `train.csv`, `rig.toml`, `conditions.csv` and `truth.json`: `cause`
//! (names; none for no gap; `outside the library`), `detectable`, and `hidden` (noise-free force and full
//! friction by point). `noise_free` (forces of the training passes by point), where it is there, says how far
//! the cause is from the library, and whether another imitates it (`decidable.rs`). One line a set goes to
//! `LINES.json`, with everything that was fitted; what is printed is their summary.
#![allow(clippy::disallowed_methods, reason = "it says how long each set took")]
#![allow(missing_docs, reason = "a study, not a library")]

mod decidable;

use decidable::{NoiseFree, Oracle, oracle};
use diagnosis::constants::Constants;
use diagnosis::data::{RigFile, Table};
use diagnosis::verdict::decide;
use diagnosis::{Diagnosis, Options, diagnose};
use models::pass::read_passes;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

#[derive(Deserialize)]
struct Truth {
    cause: Vec<String>,
    detectable: bool,
    hidden: Vec<Hidden>,
    #[serde(default)]
    noise_free: Vec<NoiseFree>,
    #[serde(default)]
    stranger: Option<Stranger>,
}

/// What a cause outside the library looks like.
#[derive(Deserialize)]
struct Stranger {
    structure: String,
    covariate: String,
}

#[derive(Deserialize)]
struct Hidden {
    point: u64,
    lateral_force_n: f64,
    mu0_f_n: f64,
    #[serde(default)]
    in_hidden_region: bool,
}

#[derive(Serialize)]
struct Line {
    set: String,
    truth: Vec<String>,
    detectable: bool,
    verdict: String,
    top: Vec<String>,
    class: Vec<String>,
    /// Every hypothesis with its probability.
    stated: Vec<(Vec<String>, f64)>,
    /// Log evidences beside no gap's.
    evidence: Vec<(String, f64)>,
    /// Scale of the scatter, shift of runs, size and correlation of what lasts, what it cost, bare scale,
    /// structure nats, clustered p, suspects.
    scatter: Vec<f64>,
    closure: f64,
    carrying: usize,
    closed: usize,
    /// Of each region: name, passes, mean squares of baseline and cause, whether it judges and is informed.
    regions: Vec<(String, usize, f64, f64, bool, bool)>,
    achieved: Option<f64>,
    achieved_scattered: Option<f64>,
    achieved_region: Option<f64>,
    claimed_ci95: Option<[f64; 2]>,
    shrinkage: Option<f64>,
    at_least: Vec<String>,
    structure: Option<String>,
    description: Vec<String>,
    /// Of a stranger: whether the first structure that the verdict describes is the true one.
    described: Option<bool>,
    seconds: f64,
    passes: usize,
    gap_chi2: f64,
    shapes: f64,
    /// Names, log evidence, chi2 left, pull, share, chi2 that the law alone leaves.
    fits: Vec<(String, f64, f64, f64, f64, f64)>,
    /// Verdict, names and probabilities with each changed constant of the decision.
    changed: Vec<Changed>,
    /// Of a cause or pair with `noise_free`.
    oracle: Option<Oracle>,
}

/// The share of the gap that is closed on these passes.
fn closed<'a>(errors: impl Iterator<Item = &'a (bool, [f64; 2])>) -> Option<f64> {
    let [before, after] = errors.fold([0.0; 2], |sum, (_, e)| [sum[0] + e[0], sum[1] + e[1]]);
    (before > 0.0).then(|| 1.0 - (after / before).sqrt())
}

type Changed = (String, Vec<String>, Vec<(Vec<String>, f64)>, Vec<String>);

fn with(result: &mut Diagnosis, constants: &Constants) -> Changed {
    let fitted = &mut result.fitted;
    fitted.problem.constants = Arc::new(constants.clone());
    let decision = decide(fitted);
    let names =
        |i: usize| -> Vec<String> { fitted.candidates[i].names().iter().map(|n| (*n).to_string()).collect() };
    let mut stated: Vec<(Vec<String>, f64)> =
        (0..fitted.candidates.len()).map(|i| (names(i), decision.probabilities[i])).collect();
    stated.extend([(Vec::new(), decision.no_gap), (vec!["unknown".to_string()], decision.open_set)]);
    stated.sort_by(|a, b| b.1.total_cmp(&a.1));
    stated.truncate(12);
    let class = decision.class.iter().map(|&i| names(i).join("+")).collect();
    (format!("{:?}", decision.verdict), stated[0].0.clone(), stated, class)
}

fn score(folder: &Path, options: &Options, changes: &[Constants]) -> Result<Line, Box<dyn Error>> {
    let read = |name: &str| fs::read_to_string(folder.join(name));
    let passes = read_passes(read("train.csv")?.as_bytes())?;
    let hidden = read_passes(read("conditions.csv")?.as_bytes())?;
    let rig = RigFile::parse(&read("rig.toml")?)?;
    let truth: Truth = serde_json::from_str(&read("truth.json")?)?;
    let table = Table::measured(&passes)?;
    let conditions = Table::conditions(&hidden, &table.origin(&passes))?;
    let start = Instant::now();
    let mut result = diagnose(&table, &rig, options, String::new());
    let forecasts = result.predict(&conditions)?;
    let seconds = start.elapsed().as_secs_f64();
    let as_fitted = result.fitted.candidates.clone();
    let changed = changes
        .iter()
        .map(|constants| {
            result.fitted.candidates.clone_from(&as_fitted);
            with(&mut result, constants)
        })
        .collect();
    let mut causes = truth.cause.clone();
    causes.sort_unstable();
    let asked = truth.detectable && !truth.noise_free.is_empty() && causes != ["outside the library"];
    let oracle = if asked { oracle(&passes, &truth.noise_free, &rig, &causes, options) } else { None };
    let (report, fitted) = (&result.report, &result.fitted);
    let wanted: BTreeMap<u64, &Hidden> = truth.hidden.iter().map(|h| (h.point, h)).collect();
    let error = |m: f64, h: &Hidden| ((h.lateral_force_n - m) / h.mu0_f_n).powi(2);
    let errors: Vec<(bool, [f64; 2])> = conditions
        .points
        .iter()
        .zip(&forecasts)
        .filter_map(|(point, f)| Some((wanted.get(point)?, f)))
        .map(|(h, f)| (h.in_hidden_region, [f.recalibrated, f.corrected].map(|m| error(m, h))))
        .collect();
    let first = report.hypotheses.iter().find(|h| !h.effects.is_empty() && h.effects != ["unknown"]);
    let none = fitted.baseline.log_evidence;
    let mut evidence: Vec<(String, f64)> =
        fitted.candidates.iter().map(|c| (c.names().join("+"), c.log_evidence - none)).collect();
    evidence.push(("unknown".to_string(), fitted.discrepancy.log_evidence - none));
    evidence.sort_by(|a, b| b.1.total_cmp(&a.1));
    Ok(Line {
        set: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        truth: truth.cause,
        detectable: truth.detectable,
        verdict: serde_json::to_value(report.verdict)?.as_str().unwrap_or_default().to_string(),
        top: report.hypotheses[0].effects.clone(),
        class: first.map(|h| h.alias_class.clone()).unwrap_or_default(),
        stated: report.hypotheses.iter().map(|h| (h.effects.clone(), h.probability)).collect(),
        evidence,
        scatter: {
            let s = &fitted.scatter;
            let own =
                [s.scale, s.run_relative_sd.unwrap_or(0.0), s.slow[0], s.slow[1], s.slow_cost, s.bare_scale];
            let own = own.into_iter().chain([s.structure_nats, s.clustered_p, s.suspects.len() as f64]);
            own.collect()
        },
        closure: report.left_out.pooled_closure,
        carrying: report.left_out.carrying,
        closed: report.left_out.closed,
        regions: result
            .decision
            .regions
            .iter()
            .map(|r| {
                let e = &r.errors;
                (r.name.clone(), e.passes, e.recalibrated, e.after, r.judges, r.informed)
            })
            .collect(),
        achieved: closed(errors.iter()),
        achieved_scattered: closed(errors.iter().filter(|(region, _)| !region)),
        achieved_region: closed(errors.iter().filter(|(region, _)| *region)),
        claimed_ci95: report.gap.shrinkage_ci95,
        shrinkage: report.gap.shrinkage,
        at_least: report.at_least.clone(),
        structure: fitted.structure.as_ref().map(|s| format!("{} p {:.1e}", s.place, s.p)),
        description: fitted
            .shapes
            .iter()
            .take(8)
            .map(|s| {
                format!(
                    "{:?} {} {:.4} {:?} size {:.4} nats {:.1}",
                    s.kind, s.covariate.name, s.at.0, s.at.1, s.size.0, s.nats
                )
            })
            .collect(),
        described: truth.stranger.map(|s| {
            let first = report.description.first();
            first.is_some_and(|d| {
                d.covariate == s.covariate && serde_json::json!(d.structure) == s.structure.as_str()
            })
        }),
        seconds,
        passes: fitted.problem.len(),
        gap_chi2: fitted.problem.misfit(&fitted.baseline.prediction),
        shapes: diagnosis::hypotheses::structure::shapes::nats(&fitted.shapes),
        fits: fitted
            .candidates
            .iter()
            .map(|c| {
                let b = &c.best;
                (
                    c.names().join("+"),
                    c.log_evidence - none,
                    fitted.problem.misfit(&b.mechanism),
                    b.pull(),
                    b.freedom.share + 10.0 * b.freedom.bend,
                    fitted.problem.misfit(&b.by_law().mechanism),
                )
            })
            .collect(),
        changed,
        oracle,
    })
}

/// What a verdict is beside its truth.
struct Judged<'a> {
    line: &'a Line,
    kind: &'static str,
    right: bool,
    probability: f64,
}

fn judge(line: &Line) -> Judged<'_> {
    let kind = match line.truth.as_slice() {
        [] => "none",
        [one] if one == "outside the library" => "stranger",
        _ if !line.detectable => "faint",
        [_] => "single",
        _ => "pair",
    };
    let mut truth = line.truth.clone();
    truth.sort_unstable();
    let is_truth = |effects: &[String]| {
        let mut own = effects.to_vec();
        own.sort_unstable();
        match kind {
            "stranger" => own == ["unknown"],
            // What cannot be seen may be called nothing.
            "faint" => own.is_empty() || own == truth,
            _ => own == truth,
        }
    };
    let probability = line.stated.iter().filter(|(e, _)| is_truth(e)).map(|(_, p)| p).sum();
    Judged { line, kind, right: is_truth(&line.top), probability }
}

fn in_class(line: &Line) -> bool {
    let mut truth = line.truth.clone();
    truth.sort_unstable();
    line.class.iter().any(|names| {
        let mut names: Vec<&str> = names.split('+').collect();
        names.sort_unstable();
        names == truth
    })
}

fn median(mut list: Vec<f64>) -> f64 {
    list.sort_by(f64::total_cmp);
    if list.is_empty() { f64::NAN } else { 0.5 * (list[(list.len() - 1) / 2] + list[list.len() / 2]) }
}

/// Named right among those that noise-free forces can decide, by their distance from the library.
fn by_oracle(what: &str, list: &[&Judged<'_>], right: &dyn Fn(&Judged<'_>) -> bool) -> String {
    let known: Vec<(&Oracle, bool)> =
        list.iter().filter_map(|j| Some((j.line.oracle.as_ref()?, right(j)))).collect();
    if known.is_empty() {
        return String::new();
    }
    let count = |f: &dyn Fn(&Oracle) -> bool| {
        let own = known.iter().filter(|(o, _)| f(o));
        format!("{} of {}", own.clone().filter(|(_, right)| *right).count(), own.count())
    };
    format!(
        "{what}, decidable: named right {} ({} within 0.15 of the library, {} beyond); undecidable {}; distances \
         beyond 0.15 in {} of {}\n",
        count(&|o| o.decidable()),
        count(&|o| o.decidable() && o.distance <= 0.15),
        count(&|o| o.decidable() && o.distance > 0.15),
        count(&|o| !o.decidable()),
        known.iter().filter(|(o, _)| o.distance > 0.15).count(),
        known.len()
    )
}

fn summary(lines: &[Line]) -> String {
    let all: Vec<Judged<'_>> = lines.iter().map(judge).collect();
    let of = |kind: &str| all.iter().filter(|j| j.kind == kind).collect::<Vec<_>>();
    let count = |list: &[&Judged<'_>], f: &dyn Fn(&Judged<'_>) -> bool| {
        format!("{} of {}", list.iter().filter(|j| f(j)).count(), list.len())
    };
    let is = |verdict: &'static str| move |j: &Judged<'_>| j.line.verdict == verdict;
    let named_right = |j: &Judged<'_>| j.line.verdict == "named" && j.right;
    let named_wrong = |j: &Judged<'_>| j.line.verdict == "named" && !j.right;
    let (single, faint, pair) = (of("single"), of("faint"), of("pair"));
    let (stranger, none) = (of("stranger"), of("none"));
    let sure: Vec<f64> = all
        .iter()
        .filter(|j| j.line.stated.iter().any(|(_, p)| *p >= 0.99))
        .map(|j| f64::from(u8::from(j.right)))
        .collect();
    let log = |list: &[&Judged<'_>]| {
        list.iter().map(|j| j.probability.max(1e-6).ln()).sum::<f64>() / list.len().max(1) as f64
    };
    let everything: Vec<&Judged<'_>> = all.iter().collect();
    let mut text = String::new();
    text += &format!(
        "singles: named right {}, in class {}, named wrong {}, log score {:.2}\n",
        count(&single, &named_right),
        count(&single, &|j| in_class(j.line) && matches!(j.line.verdict.as_str(), "named" | "ambiguous")),
        count(&single, &named_wrong),
        log(&single)
    );
    text += &by_oracle("singles", &single, &|j| named_right(j));
    text += &by_oracle("pairs", &pair, &|j| named_right(j));
    text += &format!("faint: named wrong {}, log score {:.2}\n", count(&faint, &named_wrong), log(&faint));
    text += &format!(
        "pairs: both named {}, both lead {}, in class {}, named wrong {}, log score {:.2}\n",
        count(&pair, &named_right),
        count(&pair, &|j| j.right),
        count(&pair, &|j| in_class(j.line)),
        count(&pair, &named_wrong),
        log(&pair)
    );
    text += &format!(
        "strangers: unknown {}, named {}, no gap {}, log score {:.2}\n",
        count(&stranger, &is("unknown")),
        count(&stranger, &is("named")),
        count(&stranger, &is("no_gap")),
        log(&stranger)
    );
    let seen: Vec<&&Judged<'_>> = stranger.iter().filter(|j| j.line.detectable).collect();
    let unknown = seen.iter().filter(|j| j.line.verdict == "unknown").count();
    let described = seen.iter().filter(|j| j.line.described == Some(true)).count();
    text += &format!(
        "detectable strangers: {}, unknown {unknown}, of these first described right {described}\n",
        seen.len()
    );
    text += &format!("none: no gap {}, log score {:.2}\n", count(&none, &is("no_gap")), log(&none));
    text += &format!("0.99 and more is right: {} of {}\n", sure.iter().sum::<f64>(), sure.len());
    text += &format!("log score of all: {:.3}\n", log(&everything));
    let seen: Vec<&&Judged<'_>> = single.iter().chain(&pair).collect();
    for (place, of) in [
        ("all hidden passes", (|l| l.achieved) as fn(&Line) -> Option<f64>),
        ("scattered ones", |l| l.achieved_scattered),
        ("the hidden region", |l| l.achieved_region),
    ] {
        let claims: Vec<([f64; 2], f64)> =
            seen.iter().filter_map(|j| Some((j.line.claimed_ci95?, of(j.line)?))).collect();
        let kept = claims.iter().filter(|(ci, a)| ci[0] <= *a && *a <= ci[1]).count();
        let median = median(seen.iter().filter_map(|j| of(j.line)).collect());
        text += &format!(
            "gap closed on {place}, median {median:.3}; inside its interval {kept} of {}\n",
            claims.len()
        );
    }
    let mut seconds: Vec<f64> = lines.iter().map(|l| l.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let at = |q: f64| seconds[((seconds.len() - 1) as f64 * q) as usize];
    text + &format!("seconds: median {:.1}, 95 % {:.1}, worst {:.1}\n", at(0.5), at(0.95), at(1.0))
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some(folder) = arguments.first() else { return Err("usage: score FOLDER [LINES.json]".into()) };
    let mut folders: Vec<PathBuf> = fs::read_dir(folder)?
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.join("truth.json").exists())
        .collect();
    folders.sort();
    let mut base = Constants::default();
    for (name, value) in arguments.iter().filter_map(|a| a.strip_prefix('+')?.split_once('=')) {
        base.set(name, value)?;
    }
    let options = Options { constants: Arc::new(base), ..Options::default() };
    let changes: Result<Vec<Constants>, Box<dyn Error>> = arguments[2.min(arguments.len())..]
        .iter()
        .filter(|list| !list.starts_with('+'))
        .map(|list| {
            let mut constants = (*options.constants).clone();
            for part in list.split('/') {
                let (name, value) = part.split_once('=').ok_or("NAME=VALUE is needed")?;
                constants.set(name, value)?;
            }
            Ok(constants)
        })
        .collect();
    let changes = changes?;
    let scored: Vec<Result<Line, String>> = folders
        .par_iter()
        .with_max_len(1)
        .map(|f| score(f, &options, &changes).map_err(|e| format!("{}: {e}", f.display())))
        .collect();
    let mut lines = Vec::new();
    for s in scored {
        match s {
            Ok(line) => lines.push(line),
            Err(problem) => eprintln!("{problem}"),
        }
    }
    if let Some(path) = arguments.get(1) {
        let text: Result<Vec<String>, _> = lines.iter().map(serde_json::to_string).collect();
        fs::write(path, text?.join("\n"))?;
    }
    print!("{}", summary(&lines));
    Ok(())
}

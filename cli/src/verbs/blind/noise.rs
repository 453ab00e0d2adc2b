//! `muprime blind --noise`: the score on scatter that is not what rig.toml states.

use super::super::prelude::*;
use super::Args;
use sim::sealed::rough::{RoughSet, Roughness};
use studies::progress::Study;
use studies::validation::blind::rough::{self, NoiseScore, TRUTHS};

/// Answers on scatter that is not what rig.toml states.
pub fn run(args: &Args, kind: &str, json: bool) -> miette::Result<ExitCode> {
    let picked: Vec<_> =
        Roughness::ALL.into_iter().filter(|(name, _)| kind == "all" || kind == *name).collect();
    if picked.is_empty() {
        let names: Vec<&str> = Roughness::ALL.iter().map(|k| k.0).collect();
        miette::bail!("--noise {kind}: {} or all is needed", names.join(", "));
    }
    let options = args.of.options()?;
    let (seed, sets, all) = (args.of.seed, args.sets, args.sets * TRUTHS.len() * picked.len());
    let study = Study::begin(all as u64, "sets", move |found: Vec<NoiseScore>, done| {
        if !json {
            out!("partial: {done} of {all} sets");
        }
        tell(&NoiseScore::summed(&found), seed, sets, true, json);
    })?;
    let each = |seed: u64, set: &RoughSet, report: &diagnosis::report::Report, one: &NoiseScore| {
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
    let mut rows: Vec<NoiseScore> = Vec::new();
    for kind in picked {
        rows.extend(rough::run(seed, sets, kind, &TRUTHS, &options, each)?);
    }
    drop(study);
    tell(&rows, seed, sets, false, json);
    Ok(ExitCode::SUCCESS)
}

fn tell(rows: &[NoiseScore], seed: u64, sets: usize, partial: bool, json: bool) {
    if json {
        let mut report = json!({
            "schema": "muprime.blind.noise/1", "seed": seed, "sets": sets, "rows": rows,
        });
        if partial {
            report["partial"] = true.into();
        }
        return out!("{report}");
    }
    out!(
        "| scatter | truth | sets | right | wrong | ambiguous | unknown | missed | bad passes found | others suspect |"
    );
    out!("|---|---|---|---|---|---|---|---|---|---|");
    for a in rows {
        let NoiseScore { noise, truth, sets, right, wrong, ambiguous, unknown, missed, .. } = a;
        let (found, others) = (format!("{}/{}", a.found, a.bad), format!("{}/{}", a.falsely, a.good));
        out!(
            "| {noise} | {truth} | {sets} | {right} | {wrong} | \
             {ambiguous} | {unknown} | {missed} | {found} | {others} |"
        );
    }
}

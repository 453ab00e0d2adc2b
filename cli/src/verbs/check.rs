//! `muprime check FILE...`: says what is wrong with files of any kind, and whether a plan can run on a setup.

use super::prelude::*;
use runs::Setup;
use runs::print::folded;
use tables::check::{Good, On, kind_of, problems_of};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Files of any kind, folders of runs, or bundled names: plans, setups, profiles, fingertips, rig.toml,
    /// point tables, models, certificates, defects, verdicts, summaries, records
    #[arg(required = true)]
    files: Vec<String>,
    /// Setup that the plans are to run on [default: the setup among the files, where there is one]
    #[arg(long)]
    setup: Option<String>,
    /// The law that they are to run with, as for 'muprime run --model'
    #[arg(long, value_name = "LAW")]
    model: Option<PathBuf>,
    /// Away from the bench: leave out whether the instruments' ports can be opened
    #[arg(long)]
    offline: bool,
}

/// Checks every file, and every plan against the setup; the status tells of the worst. What is wrong with the
/// files is the answer; a setup or a model that was named and cannot be used is a refusal.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let named = args.setup.as_deref().map(super::setup).transpose()?;
    let among = args.files.iter().filter(|f| kind_of(f).is_ok_and(|k| k == "setup"));
    let setup = match (named, among.collect::<Vec<_>>().as_slice()) {
        (Some(setup), _) => Some(setup),
        // A wrong one is reported by itself.
        (None, [one]) => Setup::load(one).ok(),
        (None, _) => None,
    };
    let model = match (&args.model, &setup) {
        (None, _) => None,
        (Some(what), Some(setup)) => Some(tables::law::for_run(what, setup)?.model),
        (Some(_), None) => miette::bail!(help = "name it with --setup", "--model is judged on a setup"),
    };
    let on = On { setup, model, ports: (!args.offline).then_some(rig::free_ports::free) };
    let mut worst = DONE;
    for file in &args.files {
        let verdict = tables::check::file(file, &on);
        if json {
            let document = match &verdict {
                Ok(good) => json!({
                    "file": file, "ok": true, "kind": good.kind, "passes": good.passes, "remarks": good.remarks,
                }),
                Err(e) => json!({
                    "file": file, "ok": false, "problem": format!("{e}"), "causes": causes(e),
                    "help": e.help().map(|h| h.to_string()), "problems": problems_of(e),
                }),
            };
            out!("{document}");
        } else {
            match &verdict {
                Ok(good) => {
                    say!("{}", folded(&format!("{file}: {}", words(good, on.setup.as_ref())), 2));
                    let remarks = good.remarks.iter().map(|remark| format!("  remark: {remark}"));
                    remarks.for_each(|remark| say!("{}", folded(&remark, 2)));
                }
                Err(e) => say!("{file}:\n{e:?}"),
            }
        }
        if verdict.is_err() {
            worst = REFUSED;
        }
    }
    exit(worst)
}

fn causes(error: &miette::Report) -> Vec<String> {
    error.chain().skip(1).map(ToString::to_string).collect()
}

fn words(good: &Good, setup: Option<&Setup>) -> String {
    match (good.kind, good.passes, setup) {
        ("plan", Some(passes), Some(setup)) => {
            format!("OK: {passes} passes on {}", setup.file.name)
        }
        (kind, Some(passes), _) => format!("OK: {kind} of {passes} passes"),
        (kind, None, _) => format!("OK: {kind}"),
    }
}

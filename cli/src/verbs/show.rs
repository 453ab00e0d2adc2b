//! `muprime show [NAME]`: what comes with the program.

mod sample;

use super::prelude::*;
use runs::print::folded;
use sample::Sample;
use tables::schemas::bundled::all;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Name of a plan, setup, fingertip or profile; without it all are listed (--json: a stream, one
    /// document a line for each)
    name: Option<String>,
    /// Write a sample table to try: measured now, on the virtual rig in virtual time
    #[arg(long, value_enum, conflicts_with = "name")]
    sample: Option<Sample>,
    /// Folder of the sample [default: one of its name]
    #[arg(long, requires = "sample")]
    out: Option<PathBuf>,
}

/// Lists, or prints one file, or writes a sample; refused: a name that nothing has, a folder that cannot be
/// written.
pub fn run(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let all = all();
    match (&args.name, args.sample) {
        (_, Some(sample)) => {
            let folder = args.out.clone().unwrap_or_else(|| tables::schemas::schema::typed(sample).into());
            let table = sample::write(sample, &folder)?;
            if json {
                answer_json(&json!({ "table": table }));
            } else if sample == Sample::Foreign {
                say!("{}; next: muprime import {} -o imported", table.display(), quoted(table.display()));
            } else {
                say!("{}; next: muprime diagnose {}", table.display(), quoted(folder.display()));
            }
        }
        (None, _) if json => all.iter().for_each(|b| answer_json(&json!(b))),
        (None, _) => all
            .iter()
            .for_each(|b| out!("{}", folded(&format!("{:<10} {:<26} {}", b.kind, b.name, b.about()), 38))),
        (Some(name), _) => {
            let Some(found) = all.iter().find(|b| b.name == name) else {
                let help = "`muprime show` lists what there is";
                miette::bail!(help = help, "nothing that is bundled is called '{name}'");
            };
            let document = json!({ "kind": found.kind, "name": found.name, "text": found.text });
            return answered(json, &document, found.text.trim_end());
        }
    }
    exit(DONE)
}

//! The `muprime` command: parses its arguments and hands over to one file per subcommand in `verbs/`.

#![deny(clippy::print_stdout, clippy::print_stderr)]
#![allow(
    rustdoc::broken_intra_doc_links,
    reason = "options are documented for a terminal: [user@]host is not a link"
)]

mod verbs;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use runs::print::{LogWriter, answer_json};
use runs::{out, say, version};
use serde_json::json;
use std::io::IsTerminal;
use std::process::ExitCode;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use verbs as cli;

/// Runs friction sweeps on a tribometer with an ultrasonic plate and explains the results.
#[derive(Parser)]
#[command(name = "muprime", version, arg_required_else_help = true, max_term_width = 80)]
struct Cli {
    /// Print one JSON document (or one per line where a command streams) on stdout and nothing else.
    #[arg(long, global = true, help_heading = "Common options")]
    json: bool,
    /// Folder of instrument profiles, besides ~/.config/muprime/profiles and the bundled ones
    #[arg(long, global = true, value_name = "DIR", help_heading = "Common options")]
    profiles: Option<std::path::PathBuf>,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Run a friction sweep; by default on the bundled virtual rig
    Run(cli::run::Args),
    /// Serve the simulated rig over real protocols until interrupted
    VirtualRig(cli::virtual_rig::Args),
    /// Make calibration certificates with uncertainties from data
    Calibrate(cli::calibrate::Args),
    /// Check setups, plans, profiles and certificates, line by line
    Check(cli::check::Args),
    /// Test this machine, and every channel of a setup's instruments
    Doctor(cli::doctor::Args),
    /// Find where measurement and model disagree, and the likely cause
    Diagnose(cli::diagnose::Args),
    /// Score the diagnosis on labelled sets of an independent simulation
    Blind(cli::blind::Args),
    /// Inject every known fault into the virtual rig, in virtual time
    Faults(cli::faults::Args),
    /// Write a study as a file of cases, for one machine or many
    #[cfg(feature = "parquet")]
    Cases(cli::cases::Args),
    /// Run one case of a study, or a range of them
    #[cfg(feature = "parquet")]
    Case(cli::case::Args),
    /// Run a study's missing cases: here, on Slurm, HyperQueue or Dask
    #[cfg(feature = "parquet")]
    Submit(cli::submit::Args),
    /// Collect the results of a study in one table
    #[cfg(feature = "parquet")]
    Gather(cli::gather::Args),
    /// Evaluate the friction models; recompute the paper's figures
    Model(cli::model::ModelArgs),
    /// Convert your own data into a table that 'diagnose' reads
    Import(cli::import::Args),
    /// Write the report page of a run
    Report(cli::report::Args),
    /// Compare two runs: what differs beyond their uncertainty
    Compare(cli::compare::Args),
    /// Repeat the cycles of a record; compare decisions bit for bit
    Replay(cli::replay::Args),
    /// Convert a run for other programs: HDF5, Parquet, MCAP, RO-Crate
    Export(cli::export::Args),
    /// Repair a truncated record
    Recover(cli::recover::Args),
    /// List and search the runs
    Runs(cli::runs::Args),
    /// Watch a run live in the terminal
    Watch(cli::watch::Args),
    /// Show the rig, the runs and their reports in a browser
    Dashboard(cli::dashboard::Args),
    /// Print the JSON Schema of a kind of file
    Schema(cli::schema::Args),
    /// Print a commented plan, setup, fingertip or profile to edit
    Init(cli::init::Args),
    /// List the bundled files, or print one
    Show(cli::show::Args),
    /// Print a readable page about an instrument profile
    Doc(cli::doc::Args),
    /// Write manual pages
    Man(cli::man::Args),
    /// Print a completion script for a shell
    Completions(cli::completions::Args),
}

/// The command line, with an example for every command.
fn command() -> clap::Command {
    cli::groups::grouped(cli::examples::with_examples(cli::quantities::with_units(Cli::command()), ""))
}

fn parsed(arguments: impl IntoIterator<Item = std::ffi::OsString>) -> Result<Cli, clap::Error> {
    Cli::from_arg_matches(&command().try_get_matches_from(arguments)?)
}

fn features() -> Vec<&'static str> {
    let all = [
        ("arrow", cfg!(feature = "arrow")),
        ("can", cfg!(feature = "can")),
        ("dashboard", cfg!(feature = "dashboard")),
        ("excel", cfg!(feature = "excel")),
        ("matlab", cfg!(feature = "matlab")),
        ("mqtt", cfg!(feature = "mqtt")),
        ("parquet", cfg!(feature = "parquet")),
    ];
    all.into_iter().filter(|(_, there)| *there).map(|(name, _)| name).collect()
}

/// `-V` is a line, `--version` says which build and which models, with `--json` as a document.
fn say_version() -> ExitCode {
    let has = |flag: &str| std::env::args().any(|a| a == flag);
    if has("--json") {
        answer_json(&json!(version::of_this_program(features())));
    } else if has("--version") {
        out!("{}", version::of_this_program(features()).words());
    } else {
        out!("muprime {}", env!("CARGO_PKG_VERSION"));
    }
    ExitCode::from(cli::DONE)
}

fn main() -> ExitCode {
    let code = ended();
    let Some(why) = runs::print::lacks() else { return code };
    say!("standard output could not be written to its end: {}", cli::plain(&why.to_string()));
    if code == ExitCode::SUCCESS { ExitCode::from(cli::FAILED) } else { code }
}

/// The status with which the program ends.
fn ended() -> ExitCode {
    // Places are named in records, catalogues and JSON, all of which are text.
    let unreadable =
        std::env::args_os().chain(std::env::var_os("MUPRIME_RUNS")).find(|a| a.to_str().is_none());
    let wants_json = || std::env::args_os().any(|a| a == "--json");
    if let Some(argument) = unreadable {
        let (help, shown) = ("give the file or folder another name", argument.display());
        return refused(&miette::miette!(help = help, "{shown} is not text in UTF-8"), wants_json());
    }
    let cli = match parsed(std::env::args_os()) {
        Ok(cli) => cli,
        Err(error) => {
            if error.kind() == ErrorKind::DisplayVersion {
                return say_version();
            }
            if error.use_stderr() && wants_json() {
                answer_json(&usage_error(&error));
            }
            let message = error.render().to_string();
            match cli::plain(&message) {
                better if better != message => say!("{}", better.trim_end()),
                _ => runs::print::written(error.print()),
            }
            return ExitCode::from(if error.use_stderr() { cli::REFUSED } else { cli::DONE });
        }
    };
    let wanted = std::env::var("MUPRIME_LOG").unwrap_or_else(|_| "warn".into());
    let filter: Targets = match wanted.parse() {
        Ok(filter) => filter,
        Err(error) => {
            let help = "give a level, or parts with levels, as in 'warn,muprime_drivers=debug'";
            return refused(&miette::miette!(help = help, "MUPRIME_LOG={wanted}: {error}"), cli.json);
        }
    };
    let colours = std::io::stderr().is_terminal();
    tracing_subscriber::registry()
        .with(tracing_subscriber::fmt::layer().with_ansi(colours).with_writer(|| LogWriter))
        .with(filter)
        .init();
    runs::setup::look_in(cli.profiles);
    let json = cli.json;
    studies::progress::JSON.store(json, std::sync::atomic::Ordering::Relaxed);
    let code = runs::exit::until_the_end(move || run(cli.verb, json), cli::INTERNAL);
    // Whoever leaves at once leaves others no time for it.
    rig::terminal::give_back();
    cli::keep_unread();
    code
}

fn run(verb: Verb, json: bool) -> ExitCode {
    // A panic is a fault of this program: status 3, after the threads have put the rig in its safe state.
    let outcome = std::panic::catch_unwind(|| match verb {
        Verb::Run(args) => cli::run::run(args, json),
        Verb::VirtualRig(args) => cli::virtual_rig::run(args, json),
        Verb::Calibrate(args) => cli::calibrate::run(args, json),
        Verb::Check(args) => cli::check::run(args, json),
        Verb::Doctor(args) => cli::doctor::run(args, json),
        Verb::Diagnose(args) => cli::diagnose::run(args, json),
        Verb::Blind(args) => cli::blind::run(args, json),
        Verb::Faults(args) => cli::faults::run(args, json),
        #[cfg(feature = "parquet")]
        Verb::Cases(args) => cli::cases::run(args, json),
        #[cfg(feature = "parquet")]
        Verb::Case(args) => cli::case::run(args, json),
        #[cfg(feature = "parquet")]
        Verb::Submit(args) => cli::submit::run(args, json),
        #[cfg(feature = "parquet")]
        Verb::Gather(args) => cli::gather::run(args, json),
        Verb::Model(args) => cli::model::run(args, json),
        Verb::Import(args) => cli::import::run(args, json),
        Verb::Report(args) => cli::report::run(args, json),
        Verb::Compare(args) => cli::compare::run(&args, json),
        Verb::Replay(args) => cli::replay::run(args, json),
        Verb::Export(args) => cli::export::run(args, json),
        Verb::Recover(args) => cli::recover::run(args, json),
        Verb::Runs(args) => cli::runs::run(args, json),
        Verb::Dashboard(args) => cli::dashboard::run(args, json),
        Verb::Watch(args) => cli::watch::run(args, json),
        Verb::Schema(args) => cli::schema::run(&args),
        Verb::Init(args) => cli::init::run(&args, json),
        Verb::Show(args) => cli::show::run(&args, json),
        Verb::Doc(args) => cli::doc::run(&args, json),
        Verb::Man(args) => cli::man::run(&args, &command(), json),
        Verb::Completions(args) => cli::completions::run(&args, &mut command(), json),
    });
    match outcome {
        Ok(Ok(code)) => code,
        Ok(Err(report)) => refused(&report, json),
        Err(_) => {
            if json {
                let help = "report it: standard error says where it happened";
                answer_json(&json!({
                    "error": "a fault of the program", "causes": [], "help": help, "status": cli::INTERNAL
                }));
            }
            ExitCode::from(cli::INTERNAL)
        }
    }
}

/// Says an error on standard error, and with `--json` as a document.
fn refused(report: &miette::Report, json: bool) -> ExitCode {
    let status = cli::status_of(report);
    if json {
        let causes: Vec<String> = report.chain().skip(1).map(|c| cli::plain(&c.to_string())).collect();
        // Of several problems each has a help of its own.
        let helps = tables::check::problems_of(report).into_iter().filter_map(|p| p.help);
        let mut helps: Vec<String> = helps.filter(|help| !help.is_empty()).collect();
        helps.dedup();
        let help = (!helps.is_empty()).then(|| helps.join("; "));
        answer_json(&json!({
            "error": cli::plain(&report.to_string()), "causes": causes, "help": help, "status": status
        }));
    }
    say!("{}", cli::plain(&format!("{report:?}")));
    ExitCode::from(status)
}

/// A command line that cannot be read, as a document: the first paragraph is the error, tips and usage are
/// the help.
fn usage_error(error: &clap::Error) -> serde_json::Value {
    let text = cli::plain(&error.to_string());
    let joined = |part: &str| part.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut parts = text.split("\n\n");
    let incomplete = error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand;
    let first = if incomplete {
        "the command is incomplete".into()
    } else {
        joined(parts.next().unwrap_or_default())
    };
    let helps = parts.map(joined).filter(|part| !incomplete && !part.starts_with("For more information"));
    let helps = helps.collect::<Vec<_>>().join("; ");
    let help = if helps.is_empty() { "add `--help`: it lists what is possible" } else { &helps };
    let what = first.strip_prefix("error: ").unwrap_or(&first);
    json!({ "error": what, "causes": [], "help": help, "status": cli::REFUSED })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaves(command: &clap::Command, path: &str, into: &mut Vec<String>) {
        let subs: Vec<_> = command.get_subcommands().filter(|s| s.get_name() != "help").collect();
        // `doctor` acts by itself and has a verb of its own.
        if subs.is_empty() || !(path.is_empty() || command.is_subcommand_required_set()) {
            assert!(
                command.get_after_help().is_some(),
                "{path}: no example under --help; add one in cli/src/verbs/examples.txt"
            );
            into.push(path.to_string());
        }
        for sub in subs {
            leaves(sub, format!("{path} {}", sub.get_name()).trim(), into);
        }
    }

    /// Words of a line as a shell parts them, quotes taken off.
    fn words(line: &str) -> Vec<std::ffi::OsString> {
        let (mut all, mut now, mut quoted) = (Vec::new(), String::new(), false);
        for c in line.chars() {
            match c {
                '\'' => quoted = !quoted,
                ' ' if !quoted => all.push(std::mem::take(&mut now)),
                c => now.push(c),
            }
        }
        all.push(now);
        all.into_iter().filter(|w| !w.is_empty()).map(Into::into).collect()
    }

    #[test]
    fn a_command_line_that_cannot_be_read_is_a_whole_document() {
        let document = |line: &str| usage_error(&parsed(words(line)).err().expect("it cannot be read"));
        for (line, error, help) in [
            ("muprime --json rum", "unrecognized subcommand 'rum'", "'runs', 'run'; Usage: muprime"),
            (
                "muprime run --sed 3",
                "unexpected argument '--sed' found",
                "a similar argument exists: '--seed'",
            ),
            ("muprime check", "required arguments were not provided: <FILES>", "Usage: muprime check"),
            ("muprime model", "the command is incomplete", "--help"),
            ("muprime run --seed 1e3", "invalid value '1e3'", "--help"),
        ] {
            let document = document(line);
            assert!(document["error"].as_str().unwrap().contains(error), "{line}: {document}");
            assert!(!document["error"].as_str().unwrap().starts_with("error"), "{line}: {document}");
            assert!(document["help"].as_str().unwrap().contains(help), "{line}: {document}");
            assert_eq!((&document["causes"], &document["status"]), (&json!([]), &json!(2)), "{line}");
        }
    }

    fn pages(command: &mut clap::Command, pages: &mut Vec<String>) {
        pages.push(command.render_long_help().to_string());
        pages.push(command.render_help().to_string());
        for sub in command.get_subcommands_mut() {
            self::pages(sub, pages);
        }
    }

    #[test]
    fn every_help_page_fits_80_columns() {
        let mut all = Vec::new();
        let mut whole = command();
        whole.build();
        pages(&mut whole, &mut all);
        assert!(all.len() > 60, "{}", all.len());
        let long: Vec<&str> = all.iter().flat_map(|p| p.lines()).filter(|l| l.chars().count() > 80).collect();
        assert!(long.is_empty(), "{long:#?}");
    }

    #[test]
    fn every_command_has_an_example_and_each_example_parses() {
        let mut there = Vec::new();
        leaves(&command(), "", &mut there);
        for line in cli::examples::EXAMPLES.lines() {
            let known = there.iter().any(|path| format!("{line} ").starts_with(&format!("muprime {path} ")));
            assert!(known || cfg!(not(feature = "parquet")), "{line}: no such command");
            if let (true, Err(error)) = (known, parsed(words(line))) {
                panic!("{line}: {error}");
            }
        }
    }
}

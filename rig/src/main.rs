//! The `muprime` command: parses its arguments and hands over to one file per subcommand in `cli/`.

#![deny(clippy::print_stdout, clippy::print_stderr)]

use clap::{CommandFactory, Parser, Subcommand};
use muprime_rig::cli;
use muprime_rig::print::Remarks;
use muprime_rig::say;
use std::io::IsTerminal;
use std::process::ExitCode;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// Controller of a hardware-in-the-loop tribometer: ultrasonic friction reduction, measured and explained.
#[derive(Parser)]
#[command(name = "muprime", version, arg_required_else_help = true)]
struct Cli {
    /// Print one JSON document (or one per line where a command streams) on stdout and nothing else.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// An automated friction sweep; without arguments on the bundled virtual rig
    Run(cli::run::Args),
    /// Serve the simulated rig behind real protocols until interrupted
    VirtualRig(cli::virtual_rig::Args),
    /// Data in, a dated and hashed certificate with uncertainties out
    Calibrate(cli::calibrate::Args),
    /// Read setups, plans, profiles, certificates; say what is wrong, with the place in the file
    Check(cli::check::Args),
    /// Judge this machine, and the instruments of a setup
    Doctor(cli::doctor::Args),
    /// Say where simulation and reality part, which effect causes it, and how far it shrinks
    Diagnose(cli::diagnose::Args),
    /// Score the diagnosis on sealed sets of an independent simulation
    Blind(cli::blind::Args),
    /// Strike the virtual rig with every fault of the list, in virtual time, from seeds
    Faults(cli::faults::Args),
    /// Evaluate the models: a point, a finite element case, a study, the paper's figures
    Model(cli::model::ModelArgs),
    /// Make a point table of a foreign one: any delimiter, Excel, Parquet, NumPy, time series
    Import(cli::import::Args),
    /// Write the report of a run
    Report(cli::report::Args),
    /// Run a recorded run's cycles again: the same decisions, bit for bit
    Replay(cli::replay::Args),
    /// Convert the passes of a run
    Export(cli::export::Args),
    /// Make a cut record whole again
    Recover(cli::recover::Args),
    /// List the runs
    Runs(cli::runs::Args),
    /// Follow a run
    Watch(cli::watch::Args),
    /// Print a completion script for a shell
    Completions(cli::completions::Args),
}

fn main() -> ExitCode {
    // Places are named in records, catalogues and JSON, all of which are text.
    let unreadable =
        std::env::args_os().chain(std::env::var_os("MUPRIME_RUNS")).find(|a| a.to_str().is_none());
    if let Some(argument) = unreadable {
        say!("{} is not text in UTF-8: give the file or folder another name", argument.display());
        return ExitCode::from(cli::REFUSED);
    }
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { cli::REFUSED } else { cli::DONE });
        }
    };
    let wanted = std::env::var("MUPRIME_LOG").unwrap_or_else(|_| "warn".into());
    let filter: Targets = match wanted.parse() {
        Ok(filter) => filter,
        Err(error) => {
            say!("MUPRIME_LOG={wanted}: {error}; a level, or as in 'warn,muprime_drivers=debug'");
            return ExitCode::from(cli::REFUSED);
        }
    };
    let colours = std::io::stderr().is_terminal();
    tracing_subscriber::registry()
        .with(tracing_subscriber::fmt::layer().with_ansi(colours).with_writer(|| Remarks))
        .with(filter)
        .init();
    let json = cli.json;
    cli::until_the_end(move || run(cli.verb, json))
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
        Verb::Model(args) => cli::model::run(args, json),
        Verb::Import(args) => cli::import::run(args, json),
        Verb::Report(args) => cli::report::run(args, json),
        Verb::Replay(args) => cli::replay::run(args, json),
        Verb::Export(args) => cli::export::run(args, json),
        Verb::Recover(args) => cli::recover::run(args, json),
        Verb::Runs(args) => cli::runs::run(args, json),
        Verb::Watch(args) => cli::watch::run(args, json),
        Verb::Completions(args) => cli::completions::run(&args, &mut Cli::command()),
    });
    match outcome {
        Ok(Ok(code)) => code,
        Ok(Err(report)) => {
            say!("{report:?}");
            ExitCode::from(cli::status_of(&report))
        }
        Err(_) => ExitCode::from(cli::INTERNAL),
    }
}

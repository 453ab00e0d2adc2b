//! The `muprime` command: parses its arguments and hands over to one file per subcommand in `cli/`.

use clap::{Parser, Subcommand};
use std::process::ExitCode;

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
enum Verb {}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let _ = cli.json;
    match cli.verb {}
}

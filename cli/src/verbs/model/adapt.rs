//! `muprime model adapt`: a surrogate over up to ten variables whose nodes are chosen in rounds, each round a study that is submitted.

use crate::verbs::cases::{spans, values};
use crate::verbs::prelude::*;
use clap::Args;
use models::ridge::Steady;
use serde_json::Value;
use std::collections::BTreeMap;
use studies::cases::adaptive::{SparseGrid, place_of};
use studies::cases::file::Header;
use studies::cases::kinds::{Cell, ridge, ridge::RidgeSettings};
use studies::cases::run::Entry;
use studies::cases::submit::{Options, checked, whole};

/// Number of the first held-out draw.
const HELD_OUT_FROM: u64 = 1_000_000_007;

/// Arguments of `muprime model adapt`.
#[derive(Args)]
pub struct AdaptArgs {
    /// Folder of the surrogate and of its rounds; one that stands there goes on
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// A variable from LOW to HIGH, with :log evenly in its logarithm (may be repeated)
    #[arg(long, value_name = "NAME=LOW..HIGH[:log]", required = true)]
    span: Vec<String>,
    /// A variable that all cases share (may be repeated)
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Elements of each mesh, about
    #[arg(long, default_value_t = 256)]
    elements: usize,
    /// Tolerance on mu' at which the cycles of a case count as steady
    #[arg(long, default_value_t = 0.004)]
    tolerance: f64,
    /// Most cycles of a case at full amplitude
    #[arg(long, default_value_t = 300)]
    at_most: usize,
    /// Root mean square error of mu' on the held-out cases at which it ends
    #[arg(long, default_value_t = 0.01)]
    wanted: f64,
    /// Nodes at most
    #[arg(long, default_value_t = 10_000)]
    nodes: usize,
    /// Nodes of a round, about
    #[arg(long, default_value_t = 500)]
    round: usize,
    /// Held-out cases, which no node is chosen by
    #[arg(long, default_value_t = 200)]
    held_out: u64,
    #[command(flatten)]
    rounds: Options,
}

/// Runs one study of the surrogate; mu' of each of its cases, none where a case failed.
fn run_study(
    args: &AdaptArgs,
    name: &str,
    header: Header,
    lines: Option<&[Value]>,
) -> miette::Result<Vec<Option<f64>>> {
    let column = ridge::KIND.columns.iter().position(|c| c.name == "mu_relative").unwrap_or_default();
    let mu = |entry: Entry| match entry.outcome.ok()?.get(column) {
        Some(Cell::Number(mu)) => Some(*mu),
        _ => None,
    };
    Ok(whole(&args.out, name, header, lines, &args.rounds)?.into_iter().map(mu).collect())
}

/// Grows the surrogate round by round; refused: bad variables, a folder of another surrogate, an engine that
/// takes nothing.
pub fn run(args: &AdaptArgs, json: bool) -> miette::Result<ExitCode> {
    if args.rounds.detach {
        miette::bail!("--detach: a round follows from the results of the one before it");
    }
    checked(&args.rounds)?;
    let (spans, base) = (spans(&args.span)?, values(&args.set)?);
    let steady = Steady { tolerance: args.tolerance, at_most: args.at_most, ..Steady::default() };
    let header = |spans: BTreeMap<String, ridge::ValueRange>, cases: u64| {
        let (elements, base) = (args.elements, base.clone());
        let settings = RidgeSettings { elements, steady, base, spans, first: HELD_OUT_FROM, case: None };
        settings.check_spans()?;
        Header::of(&ridge::KIND, &settings, cases)
    };
    // Looked at before anything is written.
    drop((ridge::KIND.prepare)(&header(spans.clone(), args.held_out)?, Path::new("/"))?);
    runs::files::make_folder(&args.out)?;
    let held_out = run_study(args, "held-out", header(spans.clone(), args.held_out)?, None)?;
    let places: Vec<Vec<f64>> =
        (0..args.held_out).map(|i| ridge::kronecker(HELD_OUT_FROM + i, spans.len())).collect();
    let mut grid = SparseGrid::new(spans.len());
    let mut rounds = Vec::new();
    let mut rms = f64::INFINITY;
    while rms > args.wanted && grid.nodes.len() < args.nodes {
        let new = grid.next(args.round.min(args.nodes - grid.nodes.len()));
        if new.is_empty() {
            break;
        }
        let line = |steps: &Vec<(u8, u32)>| {
            let value =
                |((name, span), x): ((&String, &ridge::ValueRange), f64)| (name.clone(), json!(span.at(x)));
            Value::Object(spans.iter().zip(place_of(steps)).map(value).collect())
        };
        let lines: Vec<Value> = new.iter().map(line).collect();
        let name = format!("round-{:03}", rounds.len());
        let found = run_study(args, &name, header(BTreeMap::new(), 0)?, Some(&lines))?;
        let failed = found.iter().filter(|v| v.is_none()).count();
        grid.take(new, &found);
        let errors: Vec<f64> =
            places.iter().zip(&held_out).filter_map(|(p, mu)| Some(grid.at(p) - (*mu)?)).collect();
        rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt();
        let worst = errors.iter().fold(0.0_f64, |a, e| a.max(e.abs()));
        let (nodes, held_out) = (grid.nodes.len(), errors.len());
        say!("{name}: {nodes} nodes, on {held_out} held-out cases rms {rms:.4}, worst {worst:.4}");
        let round =
            json!({ "nodes": nodes, "failed": failed, "held_out": held_out, "rms": rms, "worst": worst });
        rounds.push(round);
    }
    let surrogate = args.out.join("surrogate.json");
    let document = json!({
        "schema": "muprime.adaptive/1", "version": ridge::KIND.version(), "quantity": "mu_relative",
        "variables": spans, "set": base, "elements": args.elements, "rounds": rounds, "grid": grid,
    });
    runs::files::write_whole(&surrogate, document.to_string())?;
    let (nodes, wanted) = (grid.nodes.len(), args.wanted);
    let document =
        json!({ "file": surrogate, "nodes": nodes, "rms": rms, "wanted": wanted, "rounds": rounds });
    let words = format!("{}: {nodes} nodes, rms {rms:.4} of {wanted} wanted", surrogate.display());
    answered(json, &document, words)?;
    Ok(ExitCode::from(u8::from(rms > args.wanted)))
}

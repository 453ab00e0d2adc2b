//! `muprime import FILE --map '...' -o DIR`: a foreign table made into a point table.

use super::prelude::*;
use models::covariate;
use runs::ask;
use runs::files::{make_folder, write_whole};
use runs::format::number;
use runs::input::{MAX_TABLE_BYTES, bytes_of};
use std::io::IsTerminal;
use tables::import::guess::guess;
use tables::import::map::Map;
use tables::import::{Cut, Grid, Imported, Marks, Wanted, guessed_lines, import, read};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The table: delimited text, Excel, OpenDocument, Parquet, Arrow, NumPy, MAT, HDF5
    file: PathBuf,
    /// What is what: HEADER=TARGET:UNIT, separated by commas; may be repeated; docs/reference.md lists
    /// targets and units [default: guessed from the headers and shown]
    #[arg(long)]
    map: Vec<String>,
    /// Constants for what has no column: NAME=VALUE[:UNIT], separated by commas; may be repeated
    #[arg(long)]
    set: Vec<String>,
    /// Sheet of a workbook [default: the only one]
    #[arg(long)]
    sheet: Option<String>,
    /// Delimiter of a text [default: found out]
    #[arg(long, value_parser = mark)]
    delimiter: Option<char>,
    /// Decimal mark of a text, . or , [default: found out]
    #[arg(long, value_parser = ["." , ","])]
    decimal: Option<String>,
    /// The rows are samples of a time series: cut it into passes at reversals and steps of velocity
    #[arg(long)]
    series: bool,
    /// s left out at the beginning of a steady stretch [default: a fifth of it]
    #[arg(long, requires = "series")]
    settle_s: Option<f64>,
    /// s that a pass lasts at most: longer stretches are several passes [default: a stretch is a pass]
    #[arg(long, requires = "series")]
    window_s: Option<f64>,
    /// A rig.toml that is known [default: written, with what was assumed]
    #[arg(long, conflicts_with = "tip")]
    rig: Option<PathBuf>,
    /// What is right although it looks wrong: padding (rows of zeros at the end), unsorted (rows that are not in the order of time)
    #[arg(long, value_parser = ["padding", "unsorted"])]
    accept: Vec<String>,
    /// Fingertip of the library whose stiffnesses rig.toml gets
    #[arg(long)]
    tip: Option<String>,
    /// Take the guessed map without asking
    #[arg(long)]
    yes: bool,
    /// Folder for points.csv, rig.toml and import.json
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
}

fn mark(text: &str) -> Result<char, String> {
    match text {
        "tab" | "\\t" => Ok('\t'),
        "space" => Ok(' '),
        _ => {
            let mut all = text.chars();
            let first = all.next().filter(|c| c.is_ascii() && all.next().is_none());
            first.ok_or_else(|| "one character, 'tab' or 'space'".into())
        }
    }
}

/// Imports; nothing is written where a source or a map is refused, or the folder holds a table already.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let there = ["points.csv", "rig.toml", "import.json"].map(|name| args.out.join(name));
    if let Some(path) = there.iter().find(|path| path.exists()) {
        let help = "give another folder, or remove it first";
        miette::bail!(help = help, "{} is there already", path.display());
    }
    if args.out.exists() && !args.out.is_dir() {
        let help = "name a folder, as in -o imported";
        miette::bail!(help = help, "{} is a file, and the import writes into a folder", args.out.display());
    }
    for (flag, value) in [("--settle-s", args.settle_s), ("--window-s", args.window_s)] {
        if value.is_some_and(|v| !(v.is_finite() && v >= 0.0)) || flag == "--window-s" && value == Some(0.0) {
            miette::bail!("{flag}: a number of seconds above zero is needed");
        }
    }
    let bytes = bytes_of(&args.file, MAX_TABLE_BYTES)?;
    let marks =
        Marks { delimiter: args.delimiter, decimal: args.decimal.as_ref().and_then(|d| d.chars().next()) };
    let wanted = Map::headers(&args.map);
    let grid = read(&args.file, &bytes, args.sheet.as_deref(), marks, &wanted)?;
    let map = map_of(&args, &grid)?;
    let text_of = |path: &PathBuf| runs::input::rig_file(path).and_then(|_| runs::input::text_of(path));
    let rig = args.rig.as_ref().map(text_of).transpose()?;
    let series = args.series.then_some(Cut { settle_s: args.settle_s, window_s: args.window_s });
    let accepts = |what: &str| args.accept.iter().any(|a| a == what);
    let (padding, unsorted) = (accepts("padding"), accepts("unsorted"));
    let (set, tip) = (args.set.clone(), args.tip.as_deref());
    let wanted = Wanted { map, set, series, rig, tip, padding, unsorted };
    let source = args.file.file_name().unwrap_or_default().to_string_lossy();
    let Imported { table, rig, log } = import(&source, &bytes, &grid, &wanted)?;
    make_folder(&args.out)?;
    write_whole(&args.out.join("points.csv"), &table)?;
    write_whole(&args.out.join("rig.toml"), &rig)?;
    let written = serde_json::to_string_pretty(&log).into_diagnostic()?;
    write_whole(&args.out.join("import.json"), &written)?;
    if json {
        answer_json(&log);
        return exit(DONE);
    }
    say!("{source}: {}; {} rows", log.format, log.rows);
    for range in &log.ranges {
        let known = covariate::by_name(range.column);
        let (words, (factor, unit)) = known.map_or(("lateral force", (1e3, "mN")), |c| (c.words, c.shown));
        let [low, median, high] = range.low_median_high.map(|value| number(value * factor));
        say!("  {words:<22} {}, median {median}", format!("{low} to {high} {unit}").trim_end());
    }
    if !log.not_taken.is_empty() {
        say!("columns that are not taken: {}", log.not_taken.join(", "));
    }
    log.notes.iter().for_each(|note| say!("note: {note}"));
    log.assumed.iter().for_each(|what| say!("assumed in rig.toml: {what}"));
    if let Some(cut) = &log.series {
        let (samples, in_passes, reversals) = (cut.samples, cut.in_passes, cut.reversals);
        let (changing, settling, too_short) = (cut.changing, cut.settling, cut.too_short);
        say!(
            "of {samples} samples {in_passes} are in passes; left out: {changing} of changing speed, \
             load or vibration, {settling} at beginnings, {too_short} in short stretches; {reversals} reversals"
        );
    }
    if !log.dropped.is_empty() {
        let rows = if log.dropped.len() == 1 { "row was" } else { "rows were" };
        say!("{} {rows} left out; import.json lists each with the reason. The first:", log.dropped.len());
        for d in log.dropped.iter().take(3) {
            say!("  row {}: {} '{}': {}", d.row, d.column, d.text, d.reason);
        }
    }
    log.remarks.iter().for_each(|remark| say!("remark: {remark}"));
    let (table, folder) = (args.out.join("points.csv"), quoted(args.out.display()));
    say!("{} passes: {}; next: muprime diagnose {folder}", log.passes, table.display());
    exit(DONE)
}

/// The map that was stated; what it leaves open is guessed, once that is confirmed.
fn map_of(args: &Args, grid: &Grid) -> miette::Result<Map> {
    let mut map = Map::default();
    let mut wrong = map.set(&args.set).err().unwrap_or_default();
    match Map::stated(grid, &args.map) {
        Ok(columns) => map.columns = columns,
        Err(more) => wrong.extend(more),
    }
    if !wrong.is_empty() {
        miette::bail!("{}", wrong.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"));
    }
    if !args.map.is_empty() && map.lacks(grid, args.series).is_empty() {
        return Ok(map);
    }
    let guessed = guess(grid, &map);
    if !args.map.is_empty() && guessed.is_empty() {
        return Ok(map);
    }
    let what = if args.map.is_empty() { "The map" } else { "What --map leaves open" };
    say!("{what}, guessed from the headers:");
    guessed_lines(&guessed).iter().for_each(|line| say!("{line}"));
    map.columns.extend(guessed);
    // The import itself reports everything that is missing or given twice.
    if args.yes || !map.lacks(grid, args.series).is_empty() || !map.twice().is_empty() {
        return Ok(map);
    }
    if std::io::stdin().is_terminal() && std::io::stderr().is_terminal() {
        ask!("Take it? [y/N] ");
        let mut answer = String::new();
        std::io::stdin().read_line(&mut answer).into_diagnostic()?;
        if matches!(answer.trim(), "y" | "Y" | "yes") {
            return Ok(map);
        }
    }
    miette::bail!(
        help = format!("pass --yes, or the map with what you correct in it: --map '{}'", map.written()),
        "a guessed map must be confirmed"
    )
}

//! `muprime show --sample NAME`: tables to try, measured on the virtual rig in virtual time.

use super::super::prelude::*;
use clap::ValueEnum;
use models::SpringSlider;
use runs::job::{Job, Notes, Signals};
use runs::{Plan, Setup};
use std::fmt::Write;
use std::sync::Arc;

/// Samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Sample {
    /// A dry human finger
    Dry,
    /// A moist human finger
    Moist,
    /// A silicone fingertip
    Silicone,
    /// The silicone fingertip as another laboratory's file, for 'muprime import'
    Foreign,
}

impl Sample {
    fn tip(self) -> &'static str {
        match self {
            Sample::Dry => "human-index-dry",
            Sample::Moist => "human-index-moist",
            Sample::Silicone | Sample::Foreign => "artificial-silicone",
        }
    }
}

/// Columns of the foreign file: ours, theirs, and the factor between them.
const FOREIGN: [(&str, &str, f64); 7] = [
    ("time_s", "Time (s)", 1.0),
    ("amplitude_pp_m", "Amplitude (um p-p)", 1e6),
    ("frequency_hz", "Frequency (kHz)", 1e-3),
    ("speed_m_s", "Speed (mm/s)", 1e3),
    ("direction", "Direction", 1.0),
    ("normal_force_n", "Normal force (N)", 1.0),
    ("lateral_force_n", "Lateral force (mN)", 1e3),
];

/// Measures a sample into a folder that is not there yet, and returns the table; refused: a folder that is
/// there, or that cannot be written.
pub fn write(sample: Sample, folder: &Path) -> miette::Result<PathBuf> {
    if folder.exists() {
        miette::bail!(help = "give another folder with --out", "{} is there already", folder.display());
    }
    // Nobody touches a simulated plate: a human fingertip needs no guards there.
    let guards = if sample.tip().starts_with("human") { "\nnobody_touches_the_plate = true" } else { "" };
    let tip = format!("tip = \"{}\"{guards}", sample.tip());
    let bundled = Setup::load("virtual")?.text;
    let setup =
        Setup::parse("sample", &bundled.replace("tip = \"artificial-silicone\"", &tip), Path::new("."))?;
    let plan = Plan::load("first-sweep")?;
    let job = Job {
        model: Arc::new(SpringSlider::new(setup.tip.finger).into_diagnostic()?),
        seed: plan.file.seed,
        setup,
        plan,
        model_file: None,
        defects: None,
        out: folder.to_path_buf(),
        fast: true,
        notes: Notes { sample: Some(format!("sample of muprime: {}", sample.tip())), ..Notes::default() },
        answers: None,
    };
    rig::wall_clock_run::run(job, &Signals::default(), &mut |_| {})?;
    let table = folder.join("points.csv");
    if sample != Sample::Foreign {
        return Ok(table);
    }
    let text = std::fs::read_to_string(&table).into_diagnostic()?;
    let foreign = folder.join("foreign.csv");
    runs::files::write_whole(&foreign, foreign_of(&text))?;
    Ok(foreign)
}

/// The table as another program writes it: its own names and units, semicolons.
fn foreign_of(table: &str) -> String {
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap_or_default();
    let at = FOREIGN.map(|(ours, ..)| head.iter().position(|h| *h == ours));
    let mut text = FOREIGN.map(|(_, theirs, _)| theirs).join(";");
    text.push('\n');
    for row in lines {
        let cells = at.iter().zip(FOREIGN).map(|(at, (_, _, factor))| {
            let value: Option<f64> = at.and_then(|at| row.get(at)).and_then(|cell| cell.parse().ok());
            value.map_or_else(String::new, |value| format!("{:.6}", value * factor))
        });
        let _ = writeln!(text, "{}", cells.collect::<Vec<_>>().join(";"));
    }
    text
}

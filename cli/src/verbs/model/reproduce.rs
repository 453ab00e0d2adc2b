//! `muprime model reproduce`: the paper's figures.

use super::conditions::ContactArgs;
use super::refused;
use crate::verbs::prelude::*;
use clap::{Args, ValueEnum};
use models::ridge::study::{FIG_9_AMPLITUDES_PP_M, FINE_AMPLITUDES_PP_M, content_key};
use models::ridge::{RidgeCase, case};
use studies::figures::reading::{self, Reading};
use studies::figures::{self, Study, paper, store};

/// A figure of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Figure {
    /// Phase shift against amplitude.
    Fig4,
    /// Velocity of ridge and plate, dry skin.
    Fig5,
    /// Loading.
    Fig6,
    /// Reaction force in time.
    Fig7,
    /// Lateral force in a period.
    Fig8,
    /// Parametric study.
    Fig9,
    /// Spring-slider: forces in a period.
    Fig10,
    /// Spring-slider: phase shift.
    Fig11,
    /// mu' against Psi.
    Fig12,
    /// Spring-slider: slow recovery, in time.
    Fig13,
    /// Spring-slider: slow recovery, steady.
    Fig14,
    /// All of them.
    All,
}

/// How figures are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Style {
    /// Each chart by itself, with a title and a grid.
    Screen,
    /// As a journal prints them.
    Paper,
}

/// Arguments of `muprime model reproduce`.
#[derive(Args)]
pub struct ReproduceArgs {
    /// Which figure
    #[arg(value_enum)]
    figure: Figure,
    /// Folder for CSV and SVG files, and for the study that they come from
    #[arg(long, default_value = "studies")]
    out: PathBuf,
    /// For a screen, each chart by itself, or as a journal prints it: assembled panels of 85 or 174 mm, as SVG and PDF
    #[arg(long, value_enum, default_value_t = Style::Screen)]
    style: Style,
    /// How the paper's w is read: as its captions say, or as its Eqs. 7 and 14 have it [default: both]
    #[arg(long, value_parser = reading::parser())]
    reading: Option<Reading>,
    /// Figs. 9 and 12 at 20 amplitudes from 0.3 to 5 um instead of 12 from 0.1
    #[arg(long)]
    fine: bool,
    /// Elements of each mesh, about
    #[arg(long, default_value_t = case::ELEMENTS)]
    elements: usize,
    /// Mean pressure at 0.25 N in Pa, which the paper leaves open; it grows with the cube root of the force
    #[arg(long, default_value_t = case::MEAN_PRESSURE_AT_QUARTER_NEWTON_PA)]
    mean_pressure_pa: f64,
    /// Mass damping in 1/s, which the paper leaves open
    #[arg(long, default_value_t = case::MASS_DAMPING_PER_S)]
    mass_damping_per_s: f64,
    #[command(flatten)]
    contact: ContactArgs,
}

impl ReproduceArgs {
    /// The paper's nominal case with what is stated of the open quantities.
    fn base(&self) -> RidgeCase {
        let ReproduceArgs { elements, mean_pressure_pa, mass_damping_per_s, .. } = *self;
        let paper = RidgeCase::paper();
        self.contact.of(RidgeCase { elements, mean_pressure_pa, mass_damping_per_s, ..paper })
    }
}

/// Recomputes the figure or all of them.
pub fn run(args: &ReproduceArgs, json: bool) -> miette::Result<ExitCode> {
    args.base().check().map_err(refused)?;
    std::fs::create_dir_all(&args.out)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot make the folder {}", args.out.display()))?;
    let wanted: Vec<Figure> = match args.figure {
        Figure::All => Figure::value_variants().iter().copied().filter(|f| *f != Figure::All).collect(),
        one => vec![one],
    };
    let readings = args.reading.map_or(Reading::ALL.to_vec(), |one| vec![one]);
    for figure in wanted {
        let name = tables::schemas::schema::typed(figure);
        for reading in &readings {
            // Fig. 6 has no amplitude to read.
            if figure == Figure::Fig6 && *reading != readings[0] {
                continue;
            }
            one(args, figure, &name, *reading, json)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// One figure under one reading: its files, and its lines on standard output.
fn one(args: &ReproduceArgs, figure: Figure, name: &str, reading: Reading, json: bool) -> miette::Result<()> {
    let base = args.base();
    let study = Study { base, reading, w_m: ladder(args.fine) };
    let reproduced = match figure {
        Figure::Fig4 => figures::phase_shift(base, &args.out, reading)?,
        Figure::Fig5 => figures::velocities(base, reading)?,
        Figure::Fig6 => figures::loading(base)?,
        Figure::Fig7 => figures::reaction_force(base, reading)?,
        Figure::Fig8 => figures::lateral_force(base, reading)?,
        Figure::Fig9 => figures::parametric_study(study, &args.out)?,
        Figure::Fig10 => figures::slider::forces(reading)?,
        Figure::Fig11 => figures::slider::phase_shift(reading)?,
        Figure::Fig12 => figures::collapse(study, &args.out)?,
        Figure::Fig13 => figures::slider::slow_recovery(reading)?,
        Figure::Fig14 => figures::slider::steady_recovery(reading)?,
        Figure::All => return Ok(()),
    };
    let file = if figure == Figure::Fig6 { name.to_string() } else { reading::file(reading, name) };
    for chart in &reproduced.charts {
        chart.write_table(&args.out)?;
        if args.style == Style::Screen {
            chart.write_picture(&args.out)?;
        }
    }
    let mut files: Vec<String> = reproduced.charts.iter().map(|c| format!("{}.csv", c.name)).collect();
    if args.style == Style::Paper {
        paper::write(&file, &reproduced.charts, &args.out)?;
        files.extend(["svg", "pdf"].map(|end| format!("{file}.{end}")));
    } else {
        files.extend(reproduced.charts.iter().map(|c| format!("{}.svg", c.name)));
    }
    let text = reproduced.lines.join("\n");
    runs::files::write_whole(&args.out.join(format!("{file}.txt")), format!("{text}\n"))?;
    if json {
        let lines = &reproduced.lines;
        let document =
            json!({"figure": name, "reading": reading.name(), "files": files, "comparison": lines});
        out!("{document}");
    } else {
        let read =
            if figure == Figure::Fig6 { String::new() } else { format!(", w read as {}", reading.name()) };
        out!("{name}{read}\n  {}", text.replace('\n', "\n  "));
    }
    Ok(())
}

/// The amplitudes of Fig. 9, or the finer ladder.
pub fn ladder(fine: bool) -> &'static [f64] {
    if fine { &FINE_AMPLITUDES_PP_M } else { &FIG_9_AMPLITUDES_PP_M }
}

/// The complete study as one table.
pub fn write_fig_9_table(file: &Path, study: Study, results: &store::Results) -> miette::Result<()> {
    let mut csv = csv::Writer::from_path(file)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot write {}", file.display()))?;
    let mut is_first = true;
    for point in study.points() {
        let c = &point.case;
        let key = content_key(c, &figures::settings());
        let Some(run) = results.get(&key) else { continue };
        let psi = c.speed_m_s / (c.amplitude.metres() * c.frequency_hz * c.mu0 * (1.0 + c.poisson_ratio));
        let row = [
            ("panel", point.panel.variable().to_string()),
            ("value", point.value.to_string()),
            ("amplitude_pp_m", format!("{:e}", c.amplitude.metres())),
            ("frequency_hz", c.frequency_hz.to_string()),
            ("speed_m_s", c.speed_m_s.to_string()),
            ("normal_force_n", c.normal_force_n.to_string()),
            ("mu0", c.mu0.to_string()),
            ("young_modulus_pa", c.young_modulus_pa.to_string()),
            ("psi_eq17", format!("{psi:.6}")),
            ("mu_relative", format!("{:.6}", run.mu_relative)),
            ("mu_relative_sd", format!("{:.6}", run.mu_relative_sd)),
            ("reaction_over_load", format!("{:.6}", run.reaction_over_load)),
            ("contact_fraction", format!("{:.6}", run.contact_fraction)),
            ("phase_shift_deg", run.phase_shift_deg.map_or(String::new(), |p| format!("{p:.2}"))),
            ("period_doubled", run.period_doubled.to_string()),
            ("steady", run.steady.to_string()),
            ("cycles", run.cycles.to_string()),
            ("key", key),
        ];
        if std::mem::take(&mut is_first) {
            csv.write_record(row.iter().map(|(name, _)| name)).into_diagnostic()?;
        }
        csv.write_record(row.iter().map(|(_, cell)| cell)).into_diagnostic()?;
    }
    csv.flush().into_diagnostic()
}

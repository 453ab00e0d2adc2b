//! The paper's figures recomputed, each with a line on how it compares with the paper. Here those of the finite element model;
//! those of the spring-slider in [`slider`], their charts in [`plot`] and, as a journal prints them, in [`paper`]; what was already computed in [`store`].

mod collapse;
pub mod paper;
mod pdf;
pub mod plot;
pub mod reading;
pub mod slider;
pub mod store;

pub use collapse::collapse;
use miette::{IntoDiagnostic, miette};
use models::ridge::study::{Panel, StudyPoint, content_key, fig_9_at};
use models::ridge::{self, RidgeCase, RidgeCycle, RidgeRun, RunSettings};
use plot::{Chart, PaperMark, Series};
use reading::Reading;
use runs::report::plots::ends;
use std::path::Path;

/// What a figure gives: its charts, and how it compares with the paper.
pub struct Reproduced {
    /// Charts to write.
    pub charts: Vec<Chart>,
    /// Lines of comparison.
    pub lines: Vec<String>,
}

impl Reproduced {
    fn one(line: String, chart: Chart) -> Self {
        Reproduced { charts: vec![chart], lines: vec![line] }
    }
}

/// A study of Fig. 9.
#[derive(Clone, Copy)]
pub struct Study {
    /// The nominal case; at rest, where its speed is zero.
    pub base: RidgeCase,
    /// How w is read.
    pub reading: Reading,
    /// The values of w, m.
    pub w_m: &'static [f64],
}

impl Study {
    /// Its points. At rest neither speed nor friction matter: those panels are left out.
    pub fn points(&self) -> Vec<StudyPoint> {
        let at_rest = self.base.speed_m_s == 0.0;
        fig_9_at(self.base, self.w_m)
            .into_iter()
            .filter(|p| !at_rest || !matches!(p.panel, Panel::Speed | Panel::Mu0))
            .map(|p| StudyPoint { case: p.case.at_w(self.reading, p.case.amplitude.metres()), ..p })
            .collect()
    }

    /// Its results, running what is missing in `out`, and how many failed.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn results(&self, out: &Path) -> miette::Result<(store::Results, usize)> {
        store::complete(out, self.points().into_iter().map(|p| p.case))
    }

    /// Each point with its result.
    ///
    /// # Errors
    /// A study that is not whole.
    pub fn whole(&self, out: &Path) -> miette::Result<Vec<(StudyPoint, store::StoredRun)>> {
        let (results, failed) = self.results(out)?;
        let points = self.points();
        let stored = |p: &StudyPoint| Some((*p, results.get(&content_key(&p.case, &settings()))?.clone()));
        let found: Vec<_> = points.iter().filter_map(stored).collect();
        if failed > 0 || found.len() < points.len() {
            let missing = points.len() - found.len();
            return Err(miette!("{missing} of {} points of Fig. 9 are missing", points.len()));
        }
        Ok(found)
    }
}

/// How the figures' cases are run.
pub fn settings() -> RunSettings {
    RunSettings { energy: false, ..RunSettings::default() }
}

const MOIST_PA: [f64; 4] = [20e6, 28.3e6, 35e6, 50e6];
const DRY_PA: [f64; 4] = [100e6, 202.4e6, 500e6, 1000e6];
const FIG_4_AMPLITUDES_M: [f64; 14] = [
    0.1e-6, 0.2e-6, 0.3e-6, 0.4e-6, 0.5e-6, 0.6e-6, 0.7e-6, 0.8e-6, 1.0e-6, 1.2e-6, 1.4e-6, 1.7e-6, 2.1e-6,
    2.5e-6,
];

fn run(case: &RidgeCase) -> miette::Result<RidgeRun> {
    ridge::run(case, &settings()).into_diagnostic()
}

/// Cycle bins as (time in periods, value), over `turns` periods.
fn trace(values: &[f64], turns: usize, scale: f64) -> Vec<(f64, f64)> {
    let n = values.len();
    (0..n * turns).map(|i| ((i as f64 + 0.5) / n as f64, scale * values[i % n])).collect()
}

/// The last amplitude in um at which a curve of (um, degrees) passes a level upwards, in words.
pub fn passing(curve: &[(f64, f64)], level: f64) -> String {
    let passes = curve.windows(2).rev().find(|p| p[0].1 < level && p[1].1 >= level);
    let last = curve.last().map_or(0.0, |p| p.0);
    passes.map_or_else(
        || match curve.first() {
            Some(first) if first.1 >= level => format!("less than {:.2}", first.0),
            _ => format!("more than {last:.2}"),
        },
        |p| format!("{:.2}", p[0].0 + (p[1].0 - p[0].0) * (level - p[0].1) / (p[1].1 - p[0].1)),
    )
}

/// Fig. 4: phase shift against amplitude, at rest as measured.
pub fn phase_shift(base: RidgeCase, out: &Path, reading: Reading) -> miette::Result<Reproduced> {
    let at = |young_modulus_pa: f64, w: f64| {
        RidgeCase { young_modulus_pa, speed_m_s: 0.0, ..base }.at_w(reading, w)
    };
    let moduli = || MOIST_PA.into_iter().chain(DRY_PA);
    let cases = moduli().flat_map(|e| FIG_4_AMPLITUDES_M.map(|w| at(e, w)));
    let (results, failed) = store::complete(out, cases)?;
    let curve = |e: f64| -> Vec<(f64, f64)> {
        let points = FIG_4_AMPLITUDES_M.iter().filter_map(|w| {
            let phase = results.get(&content_key(&at(e, *w), &settings()))?.phase_shift_deg?;
            // A lead of some degrees in full contact is drawn as such.
            Some((w * 1e6, if phase > 270.0 { phase - 360.0 } else { phase }))
        });
        points.collect()
    };
    // Where the curve passes levels of the way from contact to its plateau near 90.
    let crossing = |e: f64, level: f64| passing(&curve(e), level);
    let chart = |name: &str, title: &str, moduli: [f64; 4], transition: [f64; 2]| {
        let series = moduli.map(|e| Series::line(format!("E_sc {} MPa", e / 1e6), curve(e))).into();
        let axes = [reading::column(reading), "phase_shift_deg"];
        let stated = vec![
            PaperMark::Span(transition, "transition (paper)"),
            PaperMark::Level(90.0, "plateau (paper)"),
        ];
        Chart { stated, ..Chart::new(reading::file(reading, name), title, axes, series) }
    };
    let mut lines = Vec::new();
    for (what, e, paper) in [("moist", 28.3e6, "0.8 to 1.3"), ("dry", 202.4e6, "0.4 to 0.8")] {
        let [at_10, at_30, at_60] = [10.0, 30.0, 60.0].map(|level| crossing(e, level));
        lines.push(format!(
            "{what} ({} MPa): the phase passes 10, 30 and 60 deg at {at_10}, {at_30} and {at_60} \u{b5}m; paper: transition at {paper} \u{b5}m, plateau near 90 deg; here {:.0} deg at 2.5 \u{b5}m",
            e / 1e6,
            curve(e).last().map_or(f64::NAN, |p| p.1)
        ));
    }
    if failed > 0 {
        lines.push(format!("{failed} cases failed and are missing"));
    }
    let charts = vec![
        chart("fig4_moist", "Phase shift, moist skin (Fig. 4a)", MOIST_PA, [0.8, 1.3]),
        chart("fig4_dry", "Phase shift, dry skin (Fig. 4a)", DRY_PA, [0.4, 0.8]),
    ];
    Ok(Reproduced { charts, lines })
}

/// Fig. 5: velocities of plate and skin, dry, 1.35 um, at rest.
pub fn velocities(base: RidgeCase, reading: Reading) -> miette::Result<Reproduced> {
    let case = RidgeCase { young_modulus_pa: 202.4e6, speed_m_s: 0.0, ..base }.at_w(reading, 1.35e-6);
    let result = run(&case)?;
    let skin = &result.mean_cycle.skin_velocity;
    let n = skin.len();
    let turn = 2.0 * std::f64::consts::PI;
    let top = turn * case.frequency_hz * case.amplitude.sine_amplitude_m();
    let plate: Vec<f64> = (0..n).map(|i| top * (turn * (i as f64 + 0.5) / n as f64).cos()).collect();
    let [trough, peak] = ends(skin);
    // From the greatest to the least velocity: the unloading is slower than the loading.
    let index = |target: f64| skin.iter().position(|v| *v == target).unwrap_or(0);
    let (high, low) = (index(peak), index(trough));
    let falling = ((low + n - high) % n) as f64 / n as f64;
    let line = format!(
        "dry, 1.35 \u{b5}m: skin {:.0} to {:.0} mm/s, plate +-{:.0} mm/s; the fall takes {:.0} % of the period, the rise {:.0} %; paper: the velocity peak is asymmetric, the unloading sloping through inertia (drawn; no number is stated)",
        1e3 * trough,
        1e3 * peak,
        1e3 * top,
        100.0 * falling,
        100.0 * (1.0 - falling)
    );
    let chart = Chart::new(
        reading::file(reading, "fig5"),
        "Velocity of skin and plate, dry, 1.35 \u{b5}m (Fig. 5)",
        ["time_periods", "velocity_m_s"],
        vec![Series::line("skin", trace(skin, 2, 1.0)), Series::line("plate", trace(&plate, 2, 1.0))],
    );
    Ok(Reproduced::one(line, chart))
}

/// Fig. 6: press, slide, vibrate.
pub fn loading(base: RidgeCase) -> miette::Result<Reproduced> {
    // Times as they are run: 60 us each for pressing and for reaching slip, then two periods of growth.
    let (press, period) = (60.0, 1e6 / base.frequency_hz);
    let (slide, full) = (2.0 * press, 2.0 * press + 2.0 * period);
    let end = full + 2.0 * period;
    let step = |from: f64| vec![(0.0, 0.0), (from, 0.0), (from, 1.0), (end, 1.0)];
    let line = format!(
        "press at once and settle for {press:.0} us, slide in the quasi-static slip state for {press:.0} us, then vibrate, growing over two periods; paper: this order, with waits whose lengths are not stated"
    );
    let chart = Chart::new(
        "fig6",
        "Loading (Fig. 6), relative to its final value",
        ["time_us", "share"],
        vec![
            Series::line("normal load", step(0.0)),
            Series::line("lateral velocity", step(press)),
            Series::line("vibration amplitude", vec![(0.0, 0.0), (slide, 0.0), (full, 1.0), (end, 1.0)]),
        ],
    );
    Ok(Reproduced::one(line, chart))
}

/// Fig. 7: reaction force at 0.1, 1 and 2 um.
pub fn reaction_force(base: RidgeCase, reading: Reading) -> miette::Result<Reproduced> {
    let (mut series, mut lines) = (Vec::new(), Vec::new());
    for w in [0.1, 1.0, 2.0] {
        let case = base.at_w(reading, w * 1e-6);
        let result = run(&case)?;
        let scale = case.finger_per_ridge_m();
        series.push(Series::line(format!("{w} \u{b5}m"), trace(&result.mean_cycle.normal, 3, scale)));
        lines.push(format!(
            "{w} \u{b5}m: mean {:.4} N for {} N applied, N/N0 {:.3} (paper: 1, Eq. 4), greatest {:.3} N, contact {:.0} % of the time",
            result.mean_reaction_force_n,
            case.normal_force_n,
            result.mean_reaction_force_n / case.normal_force_n,
            result.peak_reaction_force_n,
            100.0 * result.contact_fraction
        ));
    }
    lines.push("paper: always positive at 0.1 \u{b5}m, zero for a significant time at 1 \u{b5}m and longer at 2 \u{b5}m, the greatest force growing, the mean equal to the applied 0.25 N".into());
    let (name, axes) = (reading::file(reading, "fig7"), ["time_periods", "reaction_force_n"]);
    let stated = vec![PaperMark::Level(base.normal_force_n, "applied (paper)")];
    let chart = Chart::new(name, "Reaction force of the finger (Fig. 7)", axes, series);
    Ok(Reproduced { charts: vec![Chart { stated, ..chart }], lines })
}

/// Fig. 8: reaction, Coulomb's limit and lateral force at 1.35 um.
pub fn lateral_force(base: RidgeCase, reading: Reading) -> miette::Result<Reproduced> {
    let case = base.at_w(reading, 1.35e-6);
    let result = run(&case)?;
    let scale = case.finger_per_ridge_m();
    let RidgeCycle { normal, lateral, .. } = &result.mean_cycle;
    let n = normal.len();
    // From the touch-down after the longest absence to the first bin that slips.
    let sticks = (0..n).filter(|i| normal[*i] > 0.0 && lateral[*i] < 0.99 * case.mu0 * normal[*i]).count();
    let line = format!(
        "1.35 \u{b5}m, 20 mm/s: mu' = {:.3}; below Coulomb's limit for {:.0} % of the period, contact for {:.0} %; paper: after touch-down the ridge first deforms laterally, slips once mu_0 F_reac is reached, and the force then falls with it to zero (drawn; no number is stated)",
        result.mu_relative,
        100.0 * sticks as f64 / n as f64,
        100.0 * result.contact_fraction
    );
    let chart = Chart::new(
        reading::file(reading, "fig8"),
        "Forces in one period, 1.35 \u{b5}m (Fig. 8)",
        ["time_periods", "force_n"],
        vec![
            Series::line("F_reac", trace(normal, 1, scale)),
            Series::line("mu_0 F_reac", trace(normal, 1, scale * case.mu0)),
            Series::line("lateral force", trace(lateral, 1, scale)),
        ],
    );
    Ok(Reproduced::one(line, chart))
}

/// Fig. 9: the five panels.
///
/// # Errors
/// A study that is not whole.
pub fn parametric_study(study: Study, out: &Path) -> miette::Result<Reproduced> {
    let (found, reading) = (study.whole(out)?, study.reading);
    let at = |panel: Panel, value: f64, w: f64| {
        let hit = found.iter().find(|(p, _)| {
            p.panel == panel && p.value == value && (reading.w_m(p.case.amplitude) - w).abs() < 1e-12
        });
        hit.map_or(f64::NAN, |(_, k)| k.mu_relative)
    };
    let (mut charts, mut lines) = (Vec::new(), Vec::new());
    for (panel, letter) in Panel::ALL.into_iter().zip('a'..) {
        let curve = |value: f64| -> Vec<(f64, f64)> {
            let of = found.iter().filter(|(p, _)| p.panel == panel && p.value == value);
            of.map(|(p, k)| (reading.w_m(p.case.amplitude) * 1e6, k.mu_relative)).collect()
        };
        let values = panel.values();
        charts.push(Chart::new(
            reading::file(reading, &format!("fig9{letter}")),
            format!("Relative friction (Fig. 9{letter})"),
            [reading::column(reading), "mu_relative"],
            values.map(|v| Series::line(format!("{} {v}", panel.variable()), curve(v))).into(),
        ));
        let row = |w: f64| values.map(|v| format!("{:.3}", at(panel, v, w))).join(" ");
        let (varied, [at_1, at_2_5, at_5]) = (panel.variable(), [1e-6, 2.5e-6, 5e-6].map(row));
        lines.push(format!(
            "({letter}) {varied} {values:?}: mu' at 1 \u{b5}m {at_1}, at 2.5 \u{b5}m {at_2_5}, at 5 \u{b5}m {at_5}"
        ));
    }
    let spread = |panel: Panel| {
        let at_w = |w: f64| {
            let [least, greatest] = ends(panel.values().map(|v| at(panel, v, w)));
            greatest - least
        };
        [3e-6, 4e-6, 5e-6].map(at_w).into_iter().fold(0.0, f64::max)
    };
    lines.push(format!(
        "above 2.5 \u{b5}m the modulus moves mu' by at most {:.3} and the normal force by {:.3}; paper: nearly independent of both there",
        spread(Panel::YoungModulus), spread(Panel::NormalForce)
    ));
    let [least, greatest] = ends(found.iter().map(|f| f.1.reaction_over_load));
    lines.push(format!(
        "mean reaction over load: {least:.3} to {greatest:.3} over the study (paper: 1, Eq. 4)"
    ));
    Ok(Reproduced { charts, lines })
}

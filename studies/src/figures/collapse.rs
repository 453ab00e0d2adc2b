//! Fig. 12: the study of Fig. 9 against Psi of Eq. 17, and Psi* refitted: on all points, on those of the
//! caption, where contact is lost, and curve by curve.

use super::plot::{Chart, Series};
use super::reading::{self, Reading};
use super::{Reproduced, Study, store};
use miette::miette;
use models::psi::{PSI_STAR, PSI_STAR_UNCERTAINTY, PsiEq17, relative_friction};
use models::psi_fit;
use models::ridge::study::{Panel, StudyPoint};
use std::path::Path;

/// A point of Fig. 12.
struct Plotted {
    panel: Panel,
    /// Place of the panel's value among its four.
    value: usize,
    w_m: f64,
    psi: f64,
    mu_relative: f64,
    contact_fraction: f64,
}

impl Plotted {
    fn of(point: &StudyPoint, run: &store::StoredRun, reading: Reading) -> Plotted {
        let (c, panel) = (&point.case, point.panel);
        let w_m = reading.w_m(c.amplitude);
        Plotted {
            panel,
            value: panel.values().iter().position(|v| *v == point.value).unwrap_or(0),
            w_m,
            psi: c.speed_m_s / (w_m * c.frequency_hz * c.mu0 * (1.0 + c.poisson_ratio)),
            mu_relative: run.mu_relative,
            contact_fraction: run.contact_fraction,
        }
    }

    /// Moduli and normal forces only above 1 um, as the paper has it.
    fn is_drawn(&self) -> bool {
        !matches!(self.panel, Panel::YoungModulus | Panel::NormalForce) || self.w_m > 1.0e-6 * 1.001
    }

    /// The amplitudes of Fig. 12's caption: 1, 3 and 5 um; 2, 3 and 5 um where moduli and forces are varied.
    fn is_of_the_caption(&self) -> bool {
        let first = if matches!(self.panel, Panel::YoungModulus | Panel::NormalForce) { 2e-6 } else { 1e-6 };
        [first, 3e-6, 5e-6].iter().any(|w| (self.w_m - w).abs() < 1e-12)
    }
}

/// Psi* of what is chosen; a curve is one value of one panel.
fn fitted<'a>(chosen: impl Iterator<Item = &'a Plotted>) -> Option<psi_fit::PsiFit> {
    let place = |panel: Panel| Panel::ALL.iter().position(|p| *p == panel).unwrap_or(0);
    let entries: Vec<_> = chosen.map(|p| (4 * place(p.panel) + p.value, p.psi, p.mu_relative)).collect();
    psi_fit::fit(&entries)
}

/// Fig. 12: mu' against Psi, and the refit of Psi*.
///
/// # Errors
/// A study that is not whole.
pub fn collapse(study: Study, out: &Path) -> miette::Result<Reproduced> {
    let Study { base, reading, .. } = study;
    let found = study.whole(out)?;
    let all: Vec<Plotted> = found.iter().map(|(point, run)| Plotted::of(point, run, reading)).collect();
    let drawn: Vec<&Plotted> = all.iter().filter(|p| p.is_drawn()).collect();
    let marks = |panel: Panel| {
        let shown = drawn.iter().filter(|p| p.panel == panel && p.psi <= 12.0);
        Series::marks(panel.variable(), shown.map(|p| (p.psi, p.mu_relative)).collect())
    };
    let mut series: Vec<Series> = Panel::ALL.into_iter().map(marks).collect();
    // The base curve is in every panel: it counts once.
    let counted =
        |p: &&&Plotted| p.panel == Panel::Frequency || p.panel.set(base, p.panel.values()[p.value]) != base;
    let missing = || miette!("no Psi* fits");
    let is_open = |p: &&&Plotted| p.contact_fraction < 0.7;
    let fit = fitted(drawn.iter().filter(counted).copied()).ok_or_else(missing)?;
    let of_caption = drawn.iter().filter(counted).filter(|p| p.is_of_the_caption()).copied();
    let caption = fitted(of_caption).ok_or_else(missing)?;
    let open = fitted(drawn.iter().filter(counted).filter(is_open).copied()).ok_or_else(missing)?;
    let curve = |star: f64| {
        (0..=200).map(|k| 0.06 * f64::from(k)).map(move |p| (p, relative_friction(PsiEq17(p), star)))
    };
    let law = |name: String, star: f64, sd: f64| {
        let within = curve(star - sd).zip(curve(star + sd));
        let band = within.map(|((psi, a), (_, b))| (psi, a.min(b), a.max(b))).collect();
        Series { band, ..Series::line(name, curve(star).collect()) }
    };
    let refit = format!("\u{3a8}* {:.2} \u{b1} {:.2} (refit)", fit.psi_star, fit.psi_star_sd);
    series.push(law(refit, fit.psi_star, fit.psi_star_sd));
    let stated = format!("\u{3a8}* {PSI_STAR} \u{b1} {PSI_STAR_UNCERTAINTY} (paper)");
    series.push(law(stated, PSI_STAR, PSI_STAR_UNCERTAINTY));
    let part =
        |of: &str, psi_fit::PsiFit { psi_star, psi_star_sd: sd, rmse, points, .. }: &psi_fit::PsiFit| {
            format!("{of}: Psi* = {psi_star:.2} +- {sd:.2}, rmse {rmse:.3}, {points} points")
        };
    let mut lines = vec![
        format!(
            "refit on the paper's choice of data: Psi* = {:.2} +- {:.2} (jackknife over curves), rmse {:.3}, {} points; paper: {PSI_STAR} +- {PSI_STAR_UNCERTAINTY}",
            fit.psi_star, fit.psi_star_sd, fit.rmse, fit.points
        ),
        part("on the amplitudes of its caption alone", &caption),
        part("where contact is lost for 30 % of the time or more", &open),
    ];
    for panel in Panel::ALL {
        let local = (0..4).map(|value| {
            let curve = drawn.iter().filter(|p| p.panel == panel && p.value == value).filter(is_open);
            fitted(curve.copied()).map_or("none".into(), |fit| format!("{:.2}", fit.psi_star))
        });
        let local: Vec<String> = local.collect();
        lines.push(format!("local Psi* at {} {:?}: {}", panel.variable(), panel.values(), local.join(", ")));
    }
    let chart = Chart::new(
        reading::file(reading, "fig12"),
        "Relative friction against Psi of Eq. 17 (Fig. 12)",
        ["psi_eq17", "mu_relative"],
        series,
    );
    Ok(Reproduced { charts: vec![chart], lines })
}

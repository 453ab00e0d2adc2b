//! The figures of published values: the passes of a run against amplitude, frequency and speed, what others
//! published of the same, and Eq. 20 with their `Psi*` at the conditions of the passes.

use super::{
    AMPLITUDE, AxisRange, COLOURS, GREY, PANEL, band, beyond, capital, draw, figure, line, mark, mark_name,
    measured, mu_axis, mu_on,
};
use crate::format::{number, settings};
use crate::report::html::escape;
use crate::report::levels::{FORCE, FREQUENCY, Levels, PRESSURE, SPEED};
use crate::report::published::Published;
use crate::{MeasuredPass, RunData};
use models::covariate::{self, Covariate};
use models::psi::{PsiEq17, relative_friction, within_fitted_range};
use models::{Condition, PeakToPeak};
use plotters::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

const PLACES: u32 = 120;

/// An axis: what it shows of a pass and of a published value.
struct PaperAxis {
    title: &'static str,
    covariate: &'static Covariate,
    /// How far, as a share, the values of one setting lie apart.
    within: f64,
    published: fn(&Published) -> Option<f64>,
    /// The range of the paper's data, SI.
    papers: [f64; 2],
}

impl PaperAxis {
    const fn new(
        title: &'static str,
        covariate: &'static Covariate,
        within: f64,
        published: fn(&Published) -> Option<f64>,
        papers: [f64; 2],
    ) -> Self {
        PaperAxis { title, covariate, within, published, papers }
    }

    fn of(&self, c: &Condition) -> f64 {
        self.covariate.of(c).unwrap_or(f64::NAN)
    }
}

static AXES: [PaperAxis; 5] = [
    PaperAxis::new(AMPLITUDE, &covariate::AMPLITUDE, FREQUENCY, |p| p.amplitude_pp_m, [0.0, 5e-6]),
    PaperAxis::new("frequency f, kHz", &covariate::FREQUENCY, FREQUENCY, |p| p.frequency_hz, [10e3, 100e3]),
    PaperAxis::new("speed U, mm/s", &covariate::SPEED, SPEED, |p| p.speed_m_s, [5e-3, 0.1]),
    // No panels: load and pressure only say which passes belong together.
    PaperAxis::new("load, N", &covariate::NORMAL_FORCE, FORCE, |p| p.normal_force_n, [0.1, 1.0]),
    PaperAxis::new("pressure, kPa", &covariate::AMBIENT_PRESSURE, PRESSURE, |_| None, [0.0, 1e7]),
];

/// The three panels; their captions state what is not drawn.
pub fn panels(run: &RunData, all: &[Published]) -> miette::Result<String> {
    let mu0 = models::pass::coulomb_coefficient(run.passes.iter().map(|p| &p.pass));
    let compared = run.passes.iter().filter(|p| p.comparison.is_some_and(|c| c.mu_relative.is_some()));
    let driven: Vec<(&MeasuredPass, Condition)> = compared
        .filter(|p| p.pass.amplitude > PeakToPeak::ZERO)
        .map(|p| (p, p.pass.condition(mu0.unwrap_or(f64::NAN))))
        .collect();
    if driven.is_empty() {
        return Ok("<p>No pass with vibration to compare with.</p>".into());
    }
    let figures: miette::Result<Vec<String>> = (0..3).map(|k| panel(run, all, &driven, mu0, k)).collect();
    Ok(format!("<div class=\"panels\">{}</div>", figures?.concat()))
}

/// The passes that differ along one axis alone, those with most settings along it.
fn along<'a>(driven: &[(&'a MeasuredPass, Condition)], k: usize) -> Vec<(&'a MeasuredPass, Condition)> {
    let levels = AXES.each_ref().map(|axis| Levels::of(driven.iter().map(|(_, c)| axis.of(c)), axis.within));
    let mut groups = BTreeMap::<Vec<usize>, Vec<(&MeasuredPass, Condition)>>::new();
    for (pass, c) in driven {
        let others = (0..AXES.len()).filter(|i| *i != k).map(|i| levels[i].index(AXES[i].of(c)));
        groups.entry(others.collect()).or_default().push((*pass, *c));
    }
    let settings = |group: &Vec<(&MeasuredPass, Condition)>| {
        let along: BTreeSet<_> = group.iter().map(|(_, c)| levels[k].index(AXES[k].of(c))).collect();
        (along.len(), group.len())
    };
    groups.into_values().max_by_key(settings).unwrap_or_default()
}

fn panel(
    run: &RunData,
    all: &[Published],
    driven: &[(&MeasuredPass, Condition)],
    mu0: Option<f64>,
    k: usize,
) -> miette::Result<String> {
    let axis = &AXES[k];
    let scale = axis.covariate.shown.0;
    let chosen = along(driven, k);
    let base = chosen[chosen.len() / 2].1;
    let own = |(p, c): &(&MeasuredPass, Condition)| {
        let found = p.comparison?;
        Some((scale * axis.of(c), found.mu_relative?, found.mu_relative_sd.unwrap_or(0.0)))
    };
    let own: Vec<(f64, f64, f64)> = chosen.iter().filter_map(own).collect();
    let laws: Vec<&Published> = all.iter().filter(|p| p.psi_star.is_some() && mu0.is_some()).collect();
    let values: Vec<(&Published, f64, f64)> =
        all.iter().filter_map(|p| Some((p, scale * (axis.published)(p)?, p.mu_relative?))).collect();
    let papers = axis.papers.map(|v| scale * v).into_iter().filter(|_| !laws.is_empty());
    let xs = || own.iter().map(|p| p.0).chain(values.iter().map(|v| v.1)).chain(papers.clone());
    let span = if k == 0 { AxisRange::from_zero(xs()) } else { AxisRange::over(xs(), true) };
    let ys = mu_axis(own.iter().map(|p| p.1).chain(values.iter().map(|v| v.2)));
    let mut sources: Vec<String> = Vec::new();
    for (p, ..) in &values {
        if !sources.contains(&p.named()) {
            sources.push(p.named());
        }
    }
    let [passes, published, lines] = [own.len(), values.len(), laws.len()];
    let alt = format!(
        "Relative friction against {}: {passes} passes of this run, {published} published values and {lines} laws.",
        axis.title
    );
    // Alike in every other setting that the source states.
    let alike = |p: &Published| {
        (0..AXES.len()).filter(|i| *i != k).all(|i| {
            let own = AXES[i].of(&base);
            (AXES[i].published)(p).is_none_or(|v| (v - own).abs() <= 0.1 * own)
        })
    };
    let cut = |v: f64| v.clamp(ys[0], ys[1]);
    let svg = figure(PANEL, (span, axis.title), mu_on(ys), &alt, |chart, size| {
        if k == 0 {
            for (i, at) in all.iter().filter(|p| p.mu_relative.is_none()).enumerate() {
                let Some(from) = at.amplitude_pp_m.map(|w| w * 1e6) else { continue };
                match at.amplitude_to_m {
                    Some(to) => {
                        let fill = COLOURS[if i % 2 == 0 { 5 } else { 4 }].mix(0.2).filled();
                        draw(chart, [Rectangle::new([(from, ys[0]), (to * 1e6, ys[1])], fill)])?;
                    }
                    None => line(chart, vec![(from, ys[0]), (from, ys[1])], GREY, Some(3))?,
                }
            }
        }
        for law in &laws {
            let place = |x: f64| {
                let mut c = base;
                axis.covariate.put(&mut c, x / scale);
                let shown = !law.of_paper || within_fitted_range(&c);
                shown.then(|| (x, PsiEq17::at(&c, run.finger.poisson_ratio)))
            };
            let places: Vec<(f64, PsiEq17)> = span.places(PLACES).filter_map(place).collect();
            let star = law.psi_star.unwrap_or(f64::NAN);
            let curve = |star: f64| -> Vec<(f64, f64)> {
                places.iter().map(|(x, psi)| (*x, cut(relative_friction(*psi, star)))).collect()
            };
            if let Some(sd) = law.psi_star_sd.filter(|sd| *sd < star) {
                band(chart, &curve(star + sd), &curve(star - sd), GREY)?;
            }
            line(chart, curve(star), GREY, None)?;
        }
        measured(chart, 0, size, COLOURS[0], &own, ys)?;
        for (p, x, y) in &values {
            let series = 1 + sources.iter().position(|s| *s == p.named()).unwrap_or(0);
            let colour = COLOURS[series % COLOURS.len()];
            let sd = p.mu_relative_sd.unwrap_or(0.0);
            let bar = [(*x, cut(y - sd)), (*x, cut(y + sd))];
            draw(chart, [PathElement::new(bar.to_vec(), colour.stroke_width(1))])?;
            draw(chart, [mark(series, (*x, cut(*y)), size, colour, alike(p))])?;
        }
        Ok(())
    })?;
    let words = caption(k, passes, &base, &sources, &laws, mu0, all);
    let cut = beyond(own.iter().map(|p| p.1).chain(values.iter().map(|v| v.2)), ys);
    Ok(format!("<figure>{svg}<figcaption>{}{cut}</figcaption></figure>", escape(&words)))
}

/// What the marks and lines of a panel stand for.
fn caption(
    k: usize,
    passes: usize,
    base: &Condition,
    sources: &[String],
    laws: &[&Published],
    mu0: Option<f64>,
    all: &[Published],
) -> String {
    let axis = &AXES[k];
    let others = AXES.iter().map(|a| a.covariate).filter(|c| c.name != axis.covariate.name);
    let mut words = format!("Discs: {passes} passes of this run at {}.", settings(others, base));
    for (i, source) in sources.iter().enumerate() {
        words += &format!(" {}: {source}.", capital(mark_name((1 + i) % 5)));
    }
    if !sources.is_empty() {
        words += " Hollow where the source states other conditions.";
    }
    for law in laws {
        let sd = law.psi_star_sd.map_or(String::new(), |sd| format!(" \u{b1} {}", number(sd)));
        let mu0 = number(mu0.unwrap_or(f64::NAN));
        let star = number(law.psi_star.unwrap_or(f64::NAN));
        let range = if law.of_paper { ", where the paper's data reach" } else { "" };
        words += &format!(
            " Line: Eq. 20 with \u{3a8}* {star}{sd} ({}) at these conditions and \u{3bc}0 {mu0}{range}.",
            law.named()
        );
    }
    if k == 0 && all.iter().any(|p| p.mu_relative.is_none() && p.amplitude_pp_m.is_some()) {
        words += " Upright lines and areas: amplitudes of the table below.";
    }
    if mu0.is_none() && all.iter().any(|p| p.psi_star.is_some()) {
        words += " Eq. 20 is not drawn: the run has no pass without vibration, so its \u{3bc}0 is not known.";
    }
    words
}

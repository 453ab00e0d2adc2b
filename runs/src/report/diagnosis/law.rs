//! What a hypothesis adds to the recalibrated baseline along the setting that moves it most, over the passes:
//! as the table has it, and by the library's law alone.

use super::overlay::Overlay;
use crate::format::{settings, titled};
use crate::report::html::{escape, note};
use crate::report::plots::verdict::{LawPass, law};
use crate::report::plots::{AxisRange, ends};
use diagnosis::report::format::plain;
use diagnosis::{Forecast, Hypothesis};
use models::Condition;
use models::covariate::{self, Covariate, Scale};

const PLACES: usize = 60;
/// Share of full friction below which a law does nothing that a figure could show.
const LEAST: f64 = 1e-4;

/// The settings along which a law is drawn.
const ALONG: [&Covariate; 6] = [
    &covariate::AMPLITUDE,
    &covariate::SPEED,
    &covariate::FREQUENCY,
    &covariate::NORMAL_FORCE,
    &covariate::TIME,
    &covariate::TEMPERATURE,
];

impl Overlay<'_> {
    /// The figure of a hypothesis; nothing for one without a law, or whose law the table does not move.
    pub fn law(&self, h: &Hypothesis) -> miette::Result<String> {
        let Some(base) = self.middle() else { return Ok(String::new()) };
        let passes = &self.table.passes;
        let axis = |c: &'static Covariate| {
            let seen: Vec<f64> = passes.iter().map(|p| c.of(p)).collect::<Option<_>>()?;
            let [low, high] = ends(seen);
            let span = AxisRange::over([low, high].into_iter(), c.scale == Scale::Log && low > 0.0);
            let within = |v: f64| v.clamp(low, high);
            (high - low > 1e-3 * high.abs()).then(|| (c, span.places(PLACES as u32).map(within).collect()))
        };
        let axes: Vec<(&Covariate, Vec<f64>)> = ALONG.into_iter().filter_map(axis).collect();
        let at = |c: &Covariate, value: f64| {
            let mut condition = base;
            c.put(&mut condition, value);
            condition
        };
        let mut wanted: Vec<Condition> =
            axes.iter().flat_map(|(c, places)| places.iter().map(|v| at(c, *v))).collect();
        let curves = wanted.len();
        wanted.extend(passes);
        let Some(forecasts) = self.result.hypothesis_curve(&h.effects, &wanted) else {
            return Ok(String::new());
        };
        let adds = |i: usize, of: fn(&Forecast) -> f64| {
            (of(&forecasts[i]) - forecasts[i].recalibrated) / self.full(&wanted[i])
        };
        let swing = |k: usize| {
            let [low, high] = ends((0..PLACES).map(|i| adds(k * PLACES + i, |f| f.corrected)));
            high - low
        };
        let Some(k) = (0..axes.len()).max_by(|a, b| swing(*a).total_cmp(&swing(*b))) else {
            return Ok(String::new());
        };
        if swing(k) < LEAST {
            return Ok(String::new());
        }
        let (along, places) = &axes[k];
        let x = |v: f64| along.shown.0 * v;
        let of = |(i, v): (usize, &f64)| {
            let i = k * PLACES + i;
            let sd = (forecasts[i].corrected_sd.powi(2) - forecasts[i].scatter_sd.powi(2)).max(0.0).sqrt();
            (x(*v), adds(i, |f| f.corrected), sd / self.full(&wanted[i]).abs())
        };
        let curve: Vec<(f64, f64, f64)> = places.iter().enumerate().map(of).collect();
        let mark = |i: usize| {
            let at = x(along.of(&passes[i])?);
            let off = (self.table.lateral[i] - forecasts[curves + i].corrected) / self.full(&passes[i]);
            Some(LawPass { x: at, y: on(&curve, at) + off, suspect: self.suspects.contains(&i) })
        };
        let marks: Vec<LawPass> = (0..passes.len()).filter_map(mark).collect();
        let held = settings(ALONG.into_iter().take(4).filter(|c| c.name != along.name), &base);
        let name = plain(&h.effects.join(" + "));
        let form = |(i, v): (usize, &f64)| (x(*v), adds(k * PLACES + i, |f| f.form));
        let alone: Vec<(f64, f64)> = places.iter().enumerate().map(form).collect();
        let span = AxisRange::over(curve.iter().map(|(x, ..)| *x), along.scale == Scale::Log);
        Ok(law(&name, (&titled(along), span), &marks, &curve, &alone)?
            + &note(&format!(
                "What {} adds to the recalibrated baseline along the {}, at {}. Line: as the table has it, with its \
                 departure from the law; band: twice the standard deviation of its parameters and of that departure. \
                 Short dashes: the library's law alone. Discs: passes, each at the line plus what it deviates from \
                 the model, so that passes at other conditions are on the same figure.",
                escape(&name),
                along.words,
                held
            )))
    }

    /// The pass with vibration that is nearest to the middle of every setting.
    fn middle(&self) -> Option<Condition> {
        let driven: Vec<Condition> =
            self.table.passes.iter().filter(|p| p.amplitude.metres() > 0.0).copied().collect();
        let off = |p: &Condition| -> f64 {
            let one = |c: &&Covariate| {
                let (of, all) = (c.of(p).unwrap_or(0.0), || driven.iter().filter_map(|p| c.of(p)));
                (all().filter(|v| *v < of).count() as f64 - all().filter(|v| *v > of).count() as f64).abs()
            };
            ALONG[..4].iter().map(one).sum()
        };
        driven.iter().map(|p| (off(p), *p)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, p)| p)
    }
}

/// A curve between its places.
fn on(curve: &[(f64, f64, f64)], at: f64) -> f64 {
    let k = curve.partition_point(|(x, ..)| *x < at).clamp(1, curve.len() - 1);
    let ((x0, y0, _), (x1, y1, _)) = (curve[k - 1], curve[k]);
    let share = if x1 > x0 { ((at - x0) / (x1 - x0)).clamp(0.0, 1.0) } else { 0.0 };
    y0 + share * (y1 - y0)
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_curve_is_followed_between_its_places() {
        let curve = [(1.0, 0.0, 0.0), (2.0, 1.0, 0.0), (4.0, -1.0, 0.0)];
        let at = [0.0, 1.5, 2.0, 3.0, 9.0].map(|x| super::on(&curve, x));
        assert_eq!(at, [0.0, 0.5, 1.0, 0.0, -1.0]);
    }
}

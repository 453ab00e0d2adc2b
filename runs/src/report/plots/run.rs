//! The figures of a run.

use super::{
    AMPLITUDE, AxisRange, COLOURS, GREY, WIDE, band, beyond, draw, edge_of, eq_20, figure, line, mark,
    measured, mu_axis, mu_on, series_key, wrong,
};
use crate::ambient::{air_set, one_air, shown};
use crate::format::number;
use crate::report::html::escape;
use crate::report::levels::{FORCE, FREQUENCY, Levels, SPEED};
use crate::{MeasuredPass, RunData};
use models::{Condition, FrictionModel, PeakToPeak, SpringSlider};
use plotters::prelude::*;
use realtime::pacing::LoopReport;

/// A measured `mu'` of a pass with vibration: amplitude in um, value, sd.
fn value(p: &MeasuredPass) -> Option<(f64, f64, f64)> {
    let c = p.comparison?;
    (p.pass.amplitude > PeakToPeak::ZERO).then_some(())?;
    Some((p.pass.amplitude.micrometres(), c.mu_relative?, c.mu_relative_sd?))
}

/// The passes with vibration at the most common frequency, load and air: the base of the figure by speed.
fn at_base(passes: &[MeasuredPass]) -> Vec<&MeasuredPass> {
    let driven: Vec<&MeasuredPass> = passes.iter().filter(|p| p.pass.amplitude > PeakToPeak::ZERO).collect();
    let frequencies = Levels::of(driven.iter().map(|p| p.pass.frequency_hz), FREQUENCY);
    let loads = Levels::of(driven.iter().map(|p| p.pass.normal_force_n), FORCE);
    let (set, mut airs) = (air_set(passes), Vec::new());
    let mut settings = std::collections::BTreeMap::<_, Vec<&MeasuredPass>>::new();
    for p in driven {
        let air = airs.iter().position(|air| one_air([*air, p.air(set)])).unwrap_or(airs.len());
        airs.extend((air == airs.len()).then(|| p.air(set)));
        let setting = (frequencies.index(p.pass.frequency_hz), loads.index(p.pass.normal_force_n), air);
        settings.entry(setting).or_default().push(p);
    }
    settings.into_values().max_by_key(Vec::len).unwrap_or_default()
}

fn mean(passes: &[&MeasuredPass], of: fn(&MeasuredPass) -> f64) -> f64 {
    passes.iter().map(|p| of(p)).sum::<f64>() / passes.len() as f64
}

/// Relative friction against amplitude: a mark a speed, the spring-slider as a line with its band, and what
/// was predicted for each pass (by a corrected model too) as a short stroke.
pub fn mu_against_amplitude(run: &RunData) -> miette::Result<String> {
    let chosen = at_base(&run.passes);
    if chosen.is_empty() {
        return Ok("<p>No pass with vibration.</p>".into());
    }
    let f = number(mean(&chosen, |p| p.pass.frequency_hz / 1e3));
    let speed = |p: &MeasuredPass| p.pass.speed_m_s * 1e3;
    let speeds = Levels::of(chosen.iter().map(|p| speed(p)), SPEED);
    let marks = || chosen.iter().filter_map(|p| value(p));
    let axis = mu_axis(marks().flat_map(|(_, mu, sd)| [mu - sd, mu + sd]));
    let widest = chosen.iter().map(|p| p.pass.amplitude.micrometres()).fold(1.0, f64::max) * 1.05;
    let model = SpringSlider::new(run.finger).map_err(wrong)?;
    let mu0 = models::pass::coulomb_coefficient(run.passes.iter().map(|p| &p.pass));
    let alt = format!(
        "Relative friction against amplitude at {f} kHz: {} passes at {} speeds, measured and predicted.",
        chosen.len(),
        speeds.count()
    );
    let x = (AxisRange::linear(0.0..widest), AMPLITUDE);
    let svg = figure(WIDE, x, mu_on(axis), &alt, |chart, size| {
        for i in 0..speeds.count() {
            let colour = COLOURS[i % COLOURS.len()];
            let of_speed: Vec<_> = chosen.iter().filter(|p| speeds.index(speed(p)) == i).collect();
            if let (Some(mu0), Some(first)) = (mu0, of_speed.first()) {
                let at = |w: f64| {
                    let amplitude = PeakToPeak::from_metres(w * 1e-6);
                    model.predict(&Condition { amplitude, ..first.pass.condition(mu0) }).ok()
                };
                let grid = (1..=200).map(|k| widest * f64::from(k) / 200.0);
                let curve: Vec<(f64, f64, f64)> =
                    grid.filter_map(|w| at(w).map(|p| (w, p.mu_relative, p.mu_relative_sd))).collect();
                band(chart, &edge_of(&curve, -2.0, axis), &edge_of(&curve, 2.0, axis), colour)?;
                line(chart, edge_of(&curve, 0.0, axis), colour, (i > 0).then_some(3 * i as i32))?;
            }
            // Predictions of the run's own model, at the measured conditions.
            let strokes = of_speed.iter().filter_map(|p| {
                let (w, predicted) = (value(p)?.0, p.comparison?.predicted.clamp(axis[0], axis[1]));
                let ends = [-0.012 * widest, 0.012 * widest].map(|aside| (w + aside, predicted));
                Some(PathElement::new(ends.to_vec(), BLACK.stroke_width(2)))
            });
            draw(chart, strokes)?;
            let points: Vec<_> = of_speed.iter().filter_map(|p| value(p)).collect();
            measured(chart, i, size, colour, &points, axis)?;
        }
        Ok(())
    })?;
    let load = number(mean(&chosen, |p| p.pass.normal_force_n));
    let driven = run.passes.iter().filter(|p| p.pass.amplitude > PeakToPeak::ZERO).count();
    let elsewhere = match driven - chosen.len() {
        0 => String::new(),
        n => format!(
            " {n} passes at other frequencies, loads or levels of the air are in the table, not in this figure."
        ),
    };
    let air = chosen[0].air(air_set(&run.passes)).into_iter().enumerate();
    let air: String = air.filter_map(|(at, level)| Some(format!(", {}", shown(at, level?)))).collect();
    Ok(format!(
        "<figure>{svg}<figcaption>at {f} kHz and {load} N{air}. {}. Short strokes: what was predicted for each pass.{}{elsewhere}</figcaption></figure>",
        escape(&series_key(&speeds.names(), "mm/s")),
        beyond(marks().map(|m| m.1), axis)
    ))
}

/// Relative friction against Psi (Eq. 17) with Eq. 20 and the run's Psi*.
pub fn mu_against_psi(run: &RunData) -> miette::Result<String> {
    let points: Vec<(f64, f64, f64)> =
        run.passes.iter().filter_map(|p| Some((p.psi_eq17?, value(p)?.1, value(p)?.2))).collect();
    if points.is_empty() {
        return Ok("<p>No pass with a &Psi;.</p>".into());
    }
    let lowest = points.iter().map(|p| p.0).fold(0.1, f64::min) * 0.8;
    let highest = points.iter().map(|p| p.0).fold(10.0, f64::max) * 1.2;
    let axis = mu_axis(points.iter().flat_map(|(_, mu, sd)| [mu - sd, mu + sd]));
    let alt = format!(
        "Relative friction against Psi from {lowest:.2} to {highest:.1}: {} passes and the curve of Eq. 20 with the run's Psi*.",
        points.len()
    );
    let x = (AxisRange::logarithmic(lowest..highest), "\u{3a8} of Eq. 17");
    let svg = figure(WIDE, x, mu_on(axis), &alt, |chart, size| {
        let law = |star: f64| eq_20(lowest, highest, star);
        if let Some(found) = run.summary.as_ref().and_then(|s| s.psi_star) {
            band(chart, &law(found.high), &law(found.low), GREY)?;
            line(chart, law(found.psi_star), GREY, None)?;
        }
        measured(chart, 0, size, COLOURS[0], &points, axis)
    })?;
    Ok(format!(
        "<figure>{svg}<figcaption>All {} passes with vibration and a &Psi;.{}</figcaption></figure>",
        points.len(),
        beyond(points.iter().map(|p| p.1), axis)
    ))
}

/// How far each pass lies from what was expected after those before it, in the order of measurement.
pub fn residuals(run: &RunData) -> miette::Result<String> {
    let judged = run.passes.iter().filter_map(|p| Some((p.pass.time_s, p.comparison?.z, p.reference)));
    let points: Vec<(f64, f64, bool)> = judged.filter(|(_, z, _)| z.is_finite()).collect();
    if points.is_empty() {
        return Ok("<p>No pass was judged.</p>".into());
    }
    let end = points.iter().map(|p| p.0).fold(1.0, f64::max) * 1.02;
    let worst = points.iter().map(|p| p.1.abs()).fold(0.0, f64::max);
    let most = worst.clamp(3.0, 40.0) * 1.1;
    let (passes, largest) = (points.len(), number(worst));
    let alt =
        format!("Surprise of {passes} passes against time, the largest of {largest} standard deviations.");
    let (x, y) = (AxisRange::linear(0.0..end), AxisRange::linear(-most..most));
    let (x, y) = ((x, "time, s"), (y, "surprise, standard deviations"));
    let svg = figure((WIDE.0, 340), x, y, &alt, |chart, size| {
        for level in [-1.96, 1.96] {
            line(chart, vec![(0.0, level), (end, level)], GREY, Some(6))?;
        }
        let marks = points.iter().map(|(t, z, reference)| {
            let colour = if *reference { GREY } else { COLOURS[1] };
            mark(usize::from(*reference), (*t, z.clamp(-most, most)), size, colour, !reference)
        });
        draw(chart, marks)
    })?;
    let cut = beyond(points.iter().map(|p| p.1), [-most, most]);
    Ok(format!(
        "<figure>{svg}<figcaption>Hollow squares: references without vibration.{cut}</figcaption></figure>"
    ))
}

/// Histogram of the loop's lateness.
pub fn lateness(report: &LoopReport) -> miette::Result<String> {
    let filled = report.histogram.iter().filter(|(_, n)| *n > 0);
    let bars: Vec<(f64, f64)> = filled.map(|(ns, n)| (*ns as f64 / 1e3, *n as f64)).collect();
    if bars.is_empty() {
        return Ok("<p>No cycle was timed.</p>".into());
    }
    let highest = bars.iter().map(|b| b.0).fold(10.0, f64::max) * 2.0;
    let most = bars.iter().map(|b| b.1).fold(10.0, f64::max) * 2.0;
    let (x, y) = (AxisRange::logarithmic(0.5..highest), AxisRange::logarithmic(0.7..most));
    let (x, y) = ((x, "lateness, \u{b5}s"), (y, "deadlines"));
    let alt = "Histogram of the lateness of the loop's cycles; the figures below say the same.";
    let svg = figure((WIDE.0, 300), x, y, alt, |chart, _| {
        let bar = |(upper, n): &(f64, f64)| {
            Rectangle::new([(upper / 2.0, 0.7), (*upper, *n)], COLOURS[0].mix(0.6).filled())
        };
        draw(chart, bars.iter().map(bar))
    })?;
    Ok(format!("<figure>{svg}</figure>"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ambient::{Level, Source};
    use models::Pass;

    fn run(passes: Vec<MeasuredPass>) -> RunData {
        RunData {
            about: Vec::new(),
            facts: Default::default(),
            files: Default::default(),
            passes,
            events: Vec::new(),
            summary: None,
            finger: crate::setup::Setup::load("virtual").unwrap().tip.finger,
            fidelity: None,
            damage: Vec::new(),
        }
    }

    /// A pass at 2 um in air of this pressure, Pa, that its plan sets or leaves as it is.
    fn pass(planned: Option<f64>, value: f64) -> MeasuredPass {
        let at = Condition {
            amplitude: PeakToPeak::from_metres(2e-6),
            ambient_pressure_pa: Some(value),
            ..Condition::paper()
        };
        let quantity = "ambient_pressure_pa".into();
        let (range, source) = ([value; 2], Source::Simulated);
        MeasuredPass {
            pass: Pass::at(1, &at, Some(0.05)),
            reference: false,
            comparison: None,
            regime: None,
            psi_eq17: None,
            temperature_flags: Vec::new(),
            commanded_normal_force_n: None,
            levels: vec![Level { quantity, planned, value, range, source, age_s: 0.0, lost: false }],
        }
    }

    /// Air as it is and a planned level that is the same were two airs: the figure left out passes.
    #[test]
    fn air_as_it_is_and_the_same_air_planned_are_one_condition() {
        let passes = [(None, 101_320.0), (Some(101_325.0), 101_330.0), (Some(50_000.0), 50_010.0)];
        let passes = passes.into_iter().flat_map(|(planned, found)| vec![pass(planned, found); 3]).collect();
        let caption = mu_against_amplitude(&run(passes)).unwrap();
        assert!(caption.contains(" 3 passes at other frequencies, loads or levels of the air"), "{caption}");
        assert!(caption.contains(", pressure 101.32 kPa."), "{caption}");
        let weather = vec![pass(None, 101_320.0), pass(None, 98_000.0)];
        let caption = mu_against_amplitude(&run(weather)).unwrap();
        assert!(!caption.contains("passes at other") && !caption.contains("pressure"), "{caption}");
    }
}

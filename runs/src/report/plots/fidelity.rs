//! The figures of a rendered target.

use super::{AxisRange, COLOURS, GREY, PANEL, WIDE, band, figure, line, measured, series_key};
use crate::fidelity::{Group, PlaceMeans};
use crate::format::number;

/// Wanted and measured `mu'` over position, one direction of one group.
pub fn over_position(places: &[PlaceMeans], what: &str) -> miette::Result<String> {
    let of = |mu: fn(&PlaceMeans) -> f64| -> Vec<(f64, f64)> {
        places.iter().map(|p| (p.x_m * 1e3, mu(p))).collect()
    };
    let edges = [of(|p| p.measured - 2.0 * p.measured_sd), of(|p| p.measured + 2.0 * p.measured_sd)];
    let values = edges.iter().flatten().map(|p| p.1).chain(places.iter().map(|p| p.wanted));
    let alt = format!("Wanted, predicted and measured relative friction over position, {what}.");
    let x = (AxisRange::over(places.iter().map(|p| p.x_m * 1e3), false), "position, mm");
    let y = (AxisRange::over(values, false), "relative friction \u{3bc}'");
    figure(PANEL, x, y, &alt, |chart, _| {
        band(chart, &edges[0], &edges[1], COLOURS[0])?;
        line(chart, of(|p| p.wanted), GREY, None)?;
        line(chart, of(|p| p.predicted), COLOURS[1], Some(5))?;
        line(chart, of(|p| p.measured), COLOURS[0], None)
    })
}

/// Gain from wanted to measured `mu'` against temporal frequency, a mark a group, beside the known dynamics.
pub fn transfer(groups: &[Group]) -> miette::Result<String> {
    let bins = || groups.iter().flat_map(|g| &g.transfer);
    if bins().next().is_none() {
        return Ok(String::new());
    }
    let places = AxisRange::over(bins().map(|b| b.hz), true);
    let highest = bins().map(|b| b.gain + 2.0 * b.gain_sd).fold(1.1, f64::max).min(3.0);
    let y = (AxisRange::linear(0.0..highest), "measured over wanted \u{3bc}'");
    let alt = "Gain from wanted to measured relative friction against frequency, with the known dynamics.";
    figure(WIDE, (places, "temporal frequency, Hz"), y, alt, |chart, size| {
        if let Some(known) = groups.iter().find_map(|g| g.known) {
            line(chart, places.places(200).map(|hz| (hz, known.gain(hz))).collect(), GREY, None)?;
        }
        for (i, group) in groups.iter().enumerate() {
            let points: Vec<_> = group.transfer.iter().map(|b| (b.hz, b.gain, b.gain_sd)).collect();
            measured(chart, i, size.saturating_sub(1), COLOURS[i % COLOURS.len()], &points, [0.0, highest])?;
        }
        Ok(())
    })
}

/// The mark of each speed.
pub fn key(groups: &[Group]) -> String {
    series_key(&groups.iter().map(|g| number(g.speed_m_s * 1e3)).collect::<Vec<_>>(), "mm/s")
}

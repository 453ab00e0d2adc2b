//! The figures of a campaign.

use super::{
    AxisRange, COLOURS, GREY, PANEL, WIDE, band, draw, edge_of, eq_20, figure, filled, line, mark, measured,
    mu_on,
};
use models::Reading;

/// What one cell, or one model of it, puts into a figure.
#[derive(Default)]
pub struct Series {
    /// Measured: place, mu' and its standard deviation over sessions.
    pub points: Vec<(f64, f64, f64)>,
    /// The spring-slider: place, mu' and its standard uncertainty.
    pub slider: Vec<(f64, f64, f64)>,
    /// The finite element ridge: place and mu'.
    pub ridge: Vec<(f64, f64)>,
}

const MU: [f64; 2] = [0.0, 1.15];

/// Relative friction against one factor, a mark a cell.
pub fn against(axis: &str, logarithmic: bool, all: &[Series]) -> miette::Result<String> {
    let places = || all.iter().flat_map(|s| s.points.iter().map(|p| p.0));
    let alt = format!("Relative friction against {axis}: {} cells, measured and predicted.", all.len());
    figure(PANEL, (AxisRange::over(places(), logarithmic), axis), mu_on(MU), &alt, |chart, size| {
        for (i, series) in all.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let edge = |k: f64| edge_of(&series.slider, k, MU);
            band(chart, &edge(-2.0), &edge(2.0), colour)?;
            line(chart, edge(0.0), colour, None)?;
            line(chart, series.ridge.clone(), colour, Some(5))?;
            measured(chart, i, size, colour, &series.points, MU)?;
        }
        Ok(())
    })
}

/// Relative friction of all cells against Psi of Eq. 17, with Eq. 20.
pub fn against_psi(all: &[(String, Vec<(f64, f64)>)]) -> miette::Result<String> {
    let places = || all.iter().flat_map(|(_, points)| points.iter().map(|p| p.0));
    let (low, high) = (places().fold(0.1, f64::min) * 0.8, places().fold(10.0, f64::max) * 1.2);
    let x = (AxisRange::logarithmic(low..high), "\u{3a8} of Eq. 17");
    let alt = "Relative friction against Psi, all passes of all cells, with Eq. 20.";
    figure(WIDE, x, mu_on(MU), alt, |chart, size| {
        let law = |star: f64| eq_20(low, high, star);
        for reading in Reading::ALL {
            let (star, sd) = reading.psi_star();
            band(chart, &law(star + sd), &law(star - sd), GREY)?;
            line(chart, law(star), GREY, None)?;
        }
        for (i, (_, points)) in all.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let size = size.saturating_sub(1);
            let cut = |at: &(f64, f64)| (at.0, at.1.clamp(MU[0], MU[1]));
            draw(chart, points.iter().map(|at| mark(i, cut(at), size, colour, filled(i))))?;
        }
        Ok(())
    })
}

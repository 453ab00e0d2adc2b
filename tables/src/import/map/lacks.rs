//! What a map lacks for a point table.

use super::{Map, Taken, doubts};
use crate::import::grid::Grid;
use crate::import::targets::{ColumnTarget, Id};
use models::covariate;

/// What gives a column.
fn how(column: &str, series: bool) -> &'static str {
    match column {
        "time_s" if series => {
            "HEADER=time:s, or of a column that counts the samples HEADER=time:0.01s (every 0.01 s)"
        }
        "time_s" => "HEADER=time:s, or --set time_s=rows (row after row, a second each)",
        "amplitude_pp_m" => {
            "HEADER=amplitude_pp:um (or amplitude_peak, amplitude_rms), or --set amplitude_pp_m=0 where nothing vibrates"
        }
        "frequency_hz" => {
            "HEADER=frequency:kHz, or --set frequency_hz=27500; without vibration none is needed"
        }
        "speed_m_s" => "HEADER=speed:mm/s, HEADER=velocity:mm/s (with a sign), or --set speed_m_s=0.01",
        "direction" => "HEADER=direction, a velocity with a sign, or --set direction=1",
        "normal_force_n" => "HEADER=normal_force:N, or --set normal_force_n=0.25",
        _ => "HEADER=lateral_force:N (with a sign), friction_force:N or friction_coefficient (magnitudes)",
    }
}

impl Map {
    /// Whether the plate vibrates in some row, as far as amplitudes are given.
    fn vibrates(&self, grid: &Grid) -> bool {
        let is_amplitude = |target: &ColumnTarget| target.column == Id::AmplitudePp.target().column;
        let value = |c: &Taken, r| c.unit.apply(&grid.cell(r, c.index)?.digits(grid.comma)?);
        let in_rows = |c: &Taken| grid.rows.iter().any(|r| value(c, r).is_some_and(|a| a > 0.0));
        self.constants.iter().any(|c| is_amplitude(c.target) && c.value > 0.0)
            || self.columns.iter().any(|c| is_amplitude(c.target) && in_rows(c))
    }

    /// All columns of the point table that are missing, with what would give each. The position of a series
    /// gives speed and direction as well; a plate that stands still needs no frequency.
    pub fn lacks(&self, grid: &Grid, series: bool) -> Vec<String> {
        let path = self.gives("position_m");
        let otherwise = |column: &str| match column {
            "time_s" => self.time_by_rows,
            "frequency_hz" => self.gives("amplitude_pp_m") && !self.vibrates(grid),
            "speed_m_s" => series && path,
            "direction" => series && path || self.has(Id::Velocity),
            column => column == "position_m",
        };
        let missing = |column: &str| {
            let record = path && column == "speed_m_s";
            let more = if record { ", or --series if the rows are samples of a record in time" } else { "" };
            let (how, open) = (how(column, series), doubts::open(self, grid, column));
            format!("{column} is missing: {how}{more}{open}")
        };
        let needed = covariate::REQUIRED.iter().map(|c| c.name).chain(["lateral_force_n"]);
        let lacking = needed.filter(|column| !self.gives(column) && !otherwise(column));
        lacking.map(missing).chain(self.columns.iter().filter_map(|c| doubts::signed(c, grid))).collect()
    }
}

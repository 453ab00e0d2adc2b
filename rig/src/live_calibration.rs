//! Calibrations with the instruments at hand: a dead-weight series, a vibrometer's table.
#![allow(clippy::disallowed_methods, reason = "people wait in wall-clock time")]

mod guided;
mod live;

use drivers::vibrometer::VibrometerSettings;
use runs::Setup;
use tables::calibrate::{Bench, LiveTable, SeriesOptions};

/// The bench of this machine: instruments are opened, the operator answers at the terminal.
pub struct AtTheBench;

impl Bench for AtTheBench {
    fn series(&self, options: &SeriesOptions<'_>) -> miette::Result<String> {
        guided::series(options)
    }

    fn amplitudes(&self, setup: &Setup, table: &LiveTable<'_>) -> miette::Result<String> {
        live::table(setup, table)
    }

    /// The settings of the vibrometer's controller, read back now; they must cover the drive's frequency.
    fn vibrometer(&self, setup: &Setup, frequency_hz: f64) -> miette::Result<VibrometerSettings> {
        let Some(vibrometer) = &setup.file.vibrometer else {
            miette::bail!(
                help = "[vibrometer] profile = \"polytec-ofv5000\", address = \"/dev/ttyS0\", decoder = \"VD-02\"",
                "{}: the setup names no vibrometer",
                setup.origin
            );
        };
        let settings = drivers::vibrometer::settings(vibrometer).map_err(|e| miette::miette!("{e}"))?;
        settings.covers(frequency_hz).map_err(|e| miette::miette!("{e}"))?;
        Ok(settings)
    }
}

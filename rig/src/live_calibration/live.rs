//! A vibrometer's table taken live: set-points driven on the amplifier, the velocity's amplitude read off,
//! the range read back from the vibrometer's controller.
//!
//! The drive goes through the same loop with the same safety rules as a sweep; the finger is lifted and the stage stands.
//! What stands in this file is only the order of the set-points and the questions. The velocity is a voltage that a
//! digitiser, an oscilloscope or a lock-in shows: its amplitude comes from the standard input, typed or from a program.

mod drive;

use super::AtTheBench;
use crate::rig_lock::RigLock;
use drive::Drive;
use drivers::vibrometer::VibrometerSettings;
use miette::IntoDiagnostic;
use models::PeakToPeak;
use realtime::threads;
use runs::job::Unfinished;
use runs::{Setup, ask, say};
use std::fmt::Write as _;
use std::io::{BufRead, Write as _};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;
use tables::calibrate::{Bench, LiveTable, displacement};

/// How often a wait for an answer looks whether the operator has ended it otherwise.
const POLL_EVERY: Duration = Duration::from_millis(20);

/// Drives the set-points and asks for the readings; the table as CSV, with the settings at its head.
///
/// # Errors
/// A setup without a vibrometer, a rig that does not connect or will not stay armed, set-points beyond its
/// limits, an input that ends early, settings that were changed meanwhile.
pub fn table(setup: &Setup, table: &LiveTable<'_>) -> miette::Result<String> {
    check(setup, table)?;
    let settings = AtTheBench.vibrometer(setup, table.frequency_hz)?;
    say!("vibrometer: {settings}");
    let _rig_lock = RigLock::take(setup)?;
    let drive = Drive::start(setup)?;
    let taken = take(table, &drive, &settings);
    // Whatever became of the table: off first, and its report was read back.
    let off = drive.end();
    let _ = writeln!(std::io::stderr(), "{}", off.words());
    let text = match taken {
        Ok(_) if !off.read_back => {
            return Err(miette::miette!("{}", off.words()).wrap_err(Unfinished::NotOff));
        }
        Err(why) if !off.read_back => return Err(why.wrap_err(Unfinished::NotOff)),
        taken => taken?,
    };
    let after = AtTheBench.vibrometer(setup, table.frequency_hz)?;
    if after != settings {
        miette::bail!("the vibrometer was set otherwise while the table was taken ({after} now): no table");
    }
    Ok(text)
}

/// The set-points and the questions.
fn take(table: &LiveTable<'_>, drive: &Drive, settings: &VibrometerSettings) -> miette::Result<String> {
    drive.arm()?;
    say!(
        "The plate will vibrate at {:.1} Hz, up to {:.2} \u{b5}m peak-to-peak. Nothing may touch it. Each question wants the \
         amplitude of the velocity signal in V, zero to peak; an empty line asks again after another settling.",
        table.frequency_hz,
        table.set_points_pp_m.iter().fold(0.0f64, |a, b| a.max(*b)) * 1e6
    );
    let mut text = format!("# vibrometer: {settings}\nset_point_pp_m,velocity_v,amplitude_pp_m\n");
    let lines = lines_of_stdin()?;
    for pass in 0..table.passes {
        let mut order = table.set_points_pp_m.to_vec();
        if pass % 2 == 1 {
            order.reverse();
        }
        for set_point in order {
            let amplitude = PeakToPeak::from_metres(set_point);
            let (volts, w) = loop {
                if let Err(why) = drive.hold(amplitude, table.frequency_hz, table.settle_s) {
                    // A trip stays until somebody at the rig takes it back.
                    ask!("  {why}; an empty line arms the rig again> ");
                    answer(&lines, drive)?;
                    drive.arm()?;
                    continue;
                }
                ask!("set-point {set_point:.3e} m, volts> ");
                let line = answer(&lines, drive)?;
                if !drive.holds(amplitude) {
                    say!("  no reading: the drive did not stand while it was taken; again");
                    continue;
                }
                let volts = line.trim().parse().unwrap_or(f64::NAN);
                match displacement(volts, settings.range_m_s_per_v, table.frequency_hz) {
                    Ok(w) => break (volts, w),
                    Err(why) => say!("  no reading: {why}"),
                }
            };
            say!("  {volts} V are {:.4} \u{b5}m peak-to-peak", w.micrometres());
            let _ = writeln!(text, "{set_point:e},{volts},{:e}", w.metres());
        }
    }
    Ok(text)
}

/// The lines of the standard input, read on a thread of their own: a wait for one can then be ended otherwise.
fn lines_of_stdin() -> miette::Result<Receiver<std::io::Result<String>>> {
    let (into, lines) = sync_channel(1);
    let read = move || std::io::stdin().lock().lines().try_for_each(|line| into.send(line));
    threads::spawn("answers", read).into_diagnostic()?;
    Ok(lines)
}

/// What the operator, or the program in his place, says next.
fn answer(lines: &Receiver<std::io::Result<String>>, drive: &Drive) -> miette::Result<String> {
    loop {
        drive.go_on()?;
        match lines.recv_timeout(POLL_EVERY) {
            Ok(line) => return line.map_err(|e| miette::miette!("the terminal: {e}")),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                miette::bail!("the input ended before the last set-point: no table, no certificate")
            }
        }
    }
}

/// Refuses before anything moves.
fn check(setup: &Setup, table: &LiveTable<'_>) -> miette::Result<()> {
    if setup.file.virtual_rig.is_some() {
        miette::bail!(
            help = "serve it with `muprime virtual-rig --hands` and name its addresses in a setup without [virtual]",
            "a virtual rig inside this process shows its plate to no vibrometer"
        );
    }
    let limits = &setup.config.limits;
    let largest = limits.amplitude_max.metres();
    for set in table.set_points_pp_m {
        if !(*set > 0.0 && *set <= largest) {
            miette::bail!("--live {set}: above 0 and at most {largest:e} m peak-to-peak (the setup's limit)");
        }
    }
    let (low, high) = limits.frequency_hz;
    if !(low..=high).contains(&table.frequency_hz) {
        miette::bail!("--frequency-hz {}: the setup allows {low} to {high}", table.frequency_hz);
    }
    if !(0.05..=60.0).contains(&table.settle_s) || !(1..=20).contains(&table.passes) {
        miette::bail!("--settle-s is between 0.05 and 60, --passes between 1 and 20");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volts_become_peak_to_peak_metres() {
        // 2 um peak-to-peak at 27.5 kHz moves at 0.1728 m/s (Fig. 2's plate); 25 mm/s/V shows 6.911 V.
        let w = displacement(0.172_788 / 0.025, 0.025, 27_500.0).unwrap();
        assert!((w.metres() / 2e-6 - 1.0).abs() < 1e-5, "{w}");
        for bad in [0.0, -1.0, f64::NAN, 10.0, 12.0] {
            assert!(displacement(bad, 0.025, 27_500.0).is_err(), "{bad}");
        }
    }
}

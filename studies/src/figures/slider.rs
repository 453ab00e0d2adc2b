//! The figures of the spring-slider (sections 4 and 5.3).

use super::Reproduced;
use super::plot::{Chart, Series};
use super::reading::{self, Reading};
use miette::IntoDiagnostic;
use models::spring_slider::{self, SlipCycle};
use models::{Condition, Finger};

fn condition(reading: Reading, w_m: f64, normal_force_n: f64) -> Condition {
    Condition { amplitude: reading.motion(w_m), normal_force_n, ..Condition::paper() }
}

fn solve(reading: Reading, w_m: f64, normal_force_n: f64, finger: &Finger) -> miette::Result<SlipCycle> {
    spring_slider::solve(&condition(reading, w_m, normal_force_n), finger).into_diagnostic()
}

/// A finger of this normal stiffness, N/m, whose springs have the ratio of the paper's.
fn springs(normal_stiffness_n_per_m: f64) -> Finger {
    let lateral_stiffness_n_per_m = normal_stiffness_n_per_m / 2.6;
    Finger { normal_stiffness_n_per_m, lateral_stiffness_n_per_m, ..Finger::paper() }
}

fn amplitudes_um(count: usize, last: f64) -> Vec<f64> {
    (1..=count).map(|k| last * k as f64 / count as f64).collect()
}

/// Fig. 10: forces over one period from touch-down.
pub fn forces(reading: Reading) -> miette::Result<Reproduced> {
    let c = condition(reading, 2e-6, 0.25);
    let cycle = spring_slider::solve(&c, &Finger::paper()).into_diagnostic()?;
    let wave = cycle.waveform(400);
    let force = |pick: fn(&spring_slider::Instant) -> f64| -> Vec<(f64, f64)> {
        wave.iter().map(|i| (i.time_over_period, c.mu0 * c.normal_force_n * pick(i))).collect()
    };
    let slip = cycle.slip_onset_s.map_or("none".into(), |t| format!("{:.3}", t * c.frequency_hz));
    let line = format!(
        "2 \u{b5}m: t_s* = {slip}, t_c* = {:.3}, mu' = {:.3}; paper: the force rises linearly to mu_0 F_reac, then follows it to zero (drawn; no number is stated)",
        cycle.contact_fraction, cycle.mu_relative
    );
    let chart = Chart::new(
        reading::file(reading, "fig10"),
        "Spring-slider: forces from touch-down, 2 \u{b5}m (Fig. 10)",
        ["time_periods", "force_n"],
        vec![
            Series::line("mu_0 F_reac", force(|i| i.reaction_over_normal)),
            Series::line("lateral force", force(|i| i.lateral_over_coulomb)),
        ],
    );
    Ok(Reproduced::one(line, chart))
}

/// Fig. 11: phase shift for normal stiffnesses of 0.2 to 4 MN/m at 0.5 N, both readings of section 4.1.
pub fn phase_shift(reading: Reading) -> miette::Result<Reproduced> {
    let (mut charts, mut lines) = (Vec::new(), Vec::new());
    for kn in [0.2e6, 4e6] {
        // Eq. 7 at 0.5 N: the sine's amplitude is F_n / k_n there.
        let first = spring_slider::critical_amplitude(0.5, kn);
        let finger = springs(kn);
        let touch =
            |w_um: f64| solve(reading, w_um * 1e-6, 0.5, &finger).map(|c| format!("{:.0}", c.touch_down_deg));
        lines.push(format!(
            "k_n {} MN/m: contact is lost from {:.2} \u{b5}m, touch-down at {} deg at 1.35 \u{b5}m, {} at 2.5 \u{b5}m and {} at 5 \u{b5}m",
            kn / 1e6,
            1e6 * reading.w_m(first),
            touch(1.35)?,
            touch(2.5)?,
            touch(5.0)?
        ));
    }
    for (name, touch) in [("fig11", true), ("fig11_acceleration", false)] {
        let mut series = Vec::new();
        for kn in [0.2e6, 0.5e6, 1e6, 2e6, 4e6] {
            let mut points = Vec::new();
            for w in amplitudes_um(100, 5.0) {
                let cycle = solve(reading, w * 1e-6, 0.5, &springs(kn))?;
                points.push((w, if touch { cycle.touch_down_deg } else { cycle.phase_shift_deg }));
            }
            series.push(Series::line(format!("k_n {} MN/m", kn / 1e6), points));
        }
        charts.push(Chart::new(
            reading::file(reading, name),
            "Spring-slider: phase shift at 0.5 N (Fig. 11)",
            [reading::column(reading), "phase_shift_deg"],
            series,
        ));
    }
    lines.push("paper: 0.2 to 4 MN/m give phases like the measured ones (transition at 0.4 to 1.3 \u{b5}m, about 90 deg beyond), rising from zero at the loss of contact, the later the softer the spring; so here with the time of touch-down, while the acceleration's peak (just before separation) starts from 360 deg".into());
    Ok(Reproduced { charts, lines })
}

fn slow(recovery: Option<f64>) -> Finger {
    Finger { lateral_recovery_m_per_s: recovery, ..Finger::paper() }
}

/// Fig. 13: relative friction cycle by cycle with a recovery of 1.5 mm/s.
pub fn slow_recovery(reading: Reading) -> miette::Result<Reproduced> {
    let c = condition(reading, 5e-6, 0.5);
    let curve = |recovery| -> miette::Result<Vec<(f64, f64)>> {
        let cycles = spring_slider::transient(&c, &slow(recovery), 60).into_diagnostic()?;
        Ok(cycles.into_iter().enumerate().map(|(n, mu)| (n as f64 + 1.0, mu)).collect())
    };
    let (held, free) = (curve(Some(1.5e-3))?, curve(None)?);
    let last = |v: &[(f64, f64)]| v.last().map_or(f64::NAN, |p| p.1);
    let line = format!(
        "5 \u{b5}m: mu' climbs from {:.3} to {:.3} with 1.5 mm/s, and is {:.3} with instant recovery; that is {:.3} of mu_0 F_reac in the end; paper: climbs to a value slightly less than mu_0 F_reac",
        held.first().map_or(f64::NAN, |p| p.1),
        last(&held),
        last(&free),
        last(&held)
    );
    let chart = Chart::new(
        reading::file(reading, "fig13"),
        "Spring-slider: slow lateral recovery (Fig. 13)",
        ["cycle", "mu_relative"],
        vec![Series::line("1.5 mm/s", held), Series::line("instant", free)],
    );
    Ok(Reproduced::one(line, chart))
}

/// Fig. 14: steady relative friction for recoveries of 1.5 to 15 mm/s.
pub fn steady_recovery(reading: Reading) -> miette::Result<Reproduced> {
    let (mut series, mut at_five) = (Vec::new(), Vec::new());
    for mm_s in [1.5, 3.0, 5.0, 8.0, 15.0] {
        let point = |w| Ok((w, solve(reading, w * 1e-6, 0.5, &slow(Some(mm_s * 1e-3)))?.mu_relative));
        let points = amplitudes_um(50, 5.0).into_iter().map(point).collect::<miette::Result<Vec<_>>>()?;
        at_five.push(format!("{mm_s}: {:.3}", points.last().map_or(f64::NAN, |p| p.1)));
        series.push(Series::line(format!("{mm_s} mm/s"), points));
    }
    let line = format!(
        "steady mu' at 5 \u{b5}m for recovery speeds in mm/s: {}; paper: falls as the recovery gets faster, 1.5 to 15 mm/s (drawn; no value is stated)",
        at_five.join(", ")
    );
    let chart = Chart::new(
        reading::file(reading, "fig14"),
        "Spring-slider: slow recovery, steady (Fig. 14)",
        [reading::column(reading), "mu_relative"],
        series,
    );
    Ok(Reproduced::one(line, chart))
}

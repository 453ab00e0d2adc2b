//! The page: words and tables around the figures.

use super::comparison::air_cell;
use super::html::{cell, columns, escape, glossary, head, list, note, row, shell, table};
use super::published::Published;
use super::traces::Trace;
use super::{events, explore, fidelity, plots, published};
use crate::ambient::{AIR, LevelsFound, levels_of};
use crate::format::number;
use crate::input::unit_of;
use crate::run_data::{RunData, remarks};
use crate::sweep::{Outcome, Zeros};
use models::Ambient;
use std::fmt::Write;

pub(super) fn page(run: &RunData, traces: &[Trace], overlay: &[Published]) -> miette::Result<String> {
    let fact = |name: &str| escape(run.facts.get(name).map_or("unknown", String::as_str));
    let mut html = String::new();
    let w = &mut html;
    let title = format!("{} on {}", fact("plan"), fact("setup"));
    let _ = writeln!(w, "<h1>{title}</h1>{}", head(&run.about));
    verdict(w, run);
    if let Some(rendered) = &run.fidelity {
        w.push_str(&fidelity::section(rendered)?);
    }
    w.push_str(&explore::section(run, traces));
    let _ = write!(
        w,
        "<h2>Relative friction against amplitude</h2>{}{}\
         <h2>Relative friction against &Psi;</h2>{}{}\
         <h2>Surprise of each pass</h2>{}{}",
        plots::run::mu_against_amplitude(run)?,
        note(
            "Marks: measured passes with one standard uncertainty. Lines and bands: the spring-slider alone at the \
                 base condition of each speed, with twice its standard uncertainty. What the run was compared with, a corrected model \
                 too, stands as a short stroke at each pass. w is peak-to-peak."
        ),
        plots::run::mu_against_psi(run)?,
        note(
            "&Psi; = U / (w f &mu;<sub>0</sub> (1+&nu;)), Eq. 17, with w peak-to-peak. Line and band: Eq. 20 with this run's &Psi;* and its \
             interval of 95 %, which holds how far the conditions differ."
        ),
        plots::run::residuals(run)?,
        note(
            "How far the force of each pass lies from what the model and the passes before it let expect, in standard deviations, in the \
             order of measurement. While the model holds it is independent from pass to pass. Dashed: &plusmn;1.96."
        ),
    );
    w.push_str(&published::section(run, overlay)?);
    w.push_str(&levels(run));
    timing(w, run)?;
    w.push_str(&events::section(&run.events));
    passes(w, run);
    facts(w, run);
    w.push_str(&glossary());
    Ok(shell(&title, &html))
}

fn verdict(w: &mut String, run: &RunData) {
    let departed = run.passes.iter().find(|p| p.comparison.is_some_and(|c| c.departed));
    let made = run.passes.len();
    let remedy = run.summary.as_ref().and_then(|s| s.outcome.remedy());
    let remedy = remedy.map_or(String::new(), |remedy| format!("<br>{}", escape(remedy)));
    let outcome = escape(&run.ending()) + "." + &remedy;
    let finding = if let Some(first) = departed {
        format!(
            "<strong>The measurement disagrees with the model</strong> (first at pass {}). \
                 Run <code>muprime diagnose</code> on this folder to learn where and why.",
            first.pass.point
        )
    } else {
        let complete = run.summary.as_ref().is_some_and(|s| s.outcome == Outcome::Complete);
        let last = run.passes.iter().rev().find_map(|p| p.comparison.as_ref());
        escape(&format!("Finding: {}.", realtime::compare::Agreement::of(last, complete)))
    };
    let psi_star = run.summary.as_ref().and_then(|s| s.psi_star);
    let psi_star = psi_star.map_or_else(String::new, |found| format!("<br>{}.", escape(&found.to_string())));
    let class = if departed.is_some() { "verdict departed" } else { "verdict" };
    let _ = writeln!(w, "<p class=\"{class}\">{finding}<br>{outcome}{psi_star}</p>");
    let zeros = run.summary.as_ref().map_or_else(Zeros::default, |s| s.zeros);
    for remark in remarks::of_passes(&run.passes, &zeros) {
        let _ = writeln!(w, "<p class=\"verdict departed\">{}.</p>", escape(&remark));
    }
    if !run.damage.is_empty() {
        let _ = writeln!(
            w,
            "<div class=\"verdict departed\"><strong>The records of this run are not whole</strong>{}</div>",
            list(&run.damage, "")
        );
    }
    let flagged = run.passes.iter().filter(|p| !p.temperature_flags.is_empty()).count();
    if let Some(flag) = run.passes.iter().find_map(|p| p.temperature_flags.first()) {
        let _ = writeln!(
            w,
            "<p class=\"verdict departed\">{flagged} of {made} passes began at a temperature at which a certificate \
             does not hold (first: {}). They are marked * below; nothing was corrected.</p>",
            escape(&flag.to_string())
        );
    }
}

/// What was found of the air and typed at the rig; nothing where the plan asks for nothing.
fn levels(run: &RunData) -> String {
    let found = levels_of(&run.passes);
    if found.is_empty() {
        return String::new();
    }
    let row = |f: &LevelsFound| {
        let known = AIR.iter().find(|(covariate, _)| covariate.name == f.quantity);
        let (name, (factor, unit)) =
            known.map_or((&*f.quantity, (1.0, unit_of(&f.quantity))), |(c, _)| (c.words, c.shown));
        let value = |v: f64| number(v * factor);
        format!(
            "<tr><td>{}</td><td>{unit}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{} to {}</td><td>{}</td><td class=\"n\">{:.0}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>\n",
            escape(name),
            f.planned.map_or("&ndash;".into(), value),
            value(f.mean),
            value(f.range[0]),
            value(f.range[1]),
            f.source,
            f.oldest_s,
            f.passes,
            f.lost
        )
    };
    let head = columns("quantity|unit|planned|found|range|how|oldest reading, s|passes|level lost");
    format!("<h2>Air and protocol</h2>{}", table("Air and protocol", &head, found.iter().map(row)))
}

fn timing(w: &mut String, run: &RunData) -> miette::Result<()> {
    let Some(report) = run.summary.as_ref().and_then(|s| s.loop_report.as_ref()) else {
        let _ = writeln!(w, "<h2>Loop</h2><p>No loop timing: virtual time, or no ending.</p>");
        return Ok(());
    };
    let [p50, _, p99, p999, max] = report.lateness_ns.map(|ns| format!("{:.0} \u{b5}s", ns as f64 / 1e3));
    let granted = &report.grants;
    let class = match &granted.policy_refused {
        None => format!("{} priority {}", escape(&granted.policy), granted.priority),
        Some(why) => format!("{} (SCHED_FIFO refused: {})", escape(&granted.policy), escape(why)),
    };
    let locked = if granted.memory_locked { "memory locked" } else { "memory not locked" };
    let _ = write!(
        w,
        "<h2>Loop</h2>{}{}<p>{} cycles of {} \u{b5}s. Lateness: median {p50}, 99 % {p99}, 99.9 % {p999}, worst {max}. \
         {} deadlines missed. Scheduling: {class}, {locked}. Page faults in the loop: {} minor, {} major. \
         Rows lost: {}.{}</p>",
        plots::run::lateness(report)?,
        note("How late the loop was at each deadline, missed ones included. Both axes logarithmic."),
        report.cycles,
        report.period_ns / 1000,
        report.overruns,
        report.minor_faults,
        report.major_faults,
        run.summary.as_ref().map_or(0, |s| s.record_lost),
        run.summary.as_ref().and_then(|s| s.held).map_or_else(String::new, |held| format!(" {held}.")),
    );
    Ok(())
}

fn passes(w: &mut String, run: &RunData) {
    let air = run.passes.iter().any(|p| p.levels_set() != Ambient::default());
    let head = columns(
        "pass|w, &micro;m|f, kHz|U, mm/s|direction|load, N|lateral force, N|&mu;'|&plusmn;|predicted|&plusmn;|difference|surprise, sd",
    ) + &if air { columns("air") } else { String::new() };
    let mut rows = String::new();
    for p in &run.passes {
        let c = p.comparison;
        let or = |shown: Option<String>| shown.unwrap_or_else(|| "&ndash;".into());
        let number = |v: Option<f64>, digits: usize| or(v.map(|v| format!("{v:.digits$}")));
        let signed = |v: Option<f64>, digits: usize| or(v.map(|v| format!("{v:+.digits$}")));
        let _ = writeln!(
            rows,
            "<tr><td>{}{}</td><td>{:.3}</td><td>{:.2}</td><td>{:.1}</td><td>{}</td><td>{:.4}</td><td>{}</td><td>{}</td>\
             <td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>{}</tr>",
            p.pass.point,
            if p.temperature_flags.is_empty() { "" } else { "*" },
            p.pass.amplitude.micrometres(),
            p.pass.frequency_hz / 1e3,
            p.pass.speed_m_s * 1e3,
            i8::from(p.pass.direction),
            p.pass.normal_force_n,
            number(p.pass.lateral_force_n, 4),
            number(c.and_then(|c| c.mu_relative), 3),
            number(c.and_then(|c| c.mu_relative_sd), 3),
            number(c.map(|c| c.predicted), 3),
            number(c.map(|c| c.predicted_sd), 3),
            signed(c.and_then(|c| Some(c.mu_relative? - c.predicted)), 3),
            signed(c.map(|c| c.z), 1),
            air_cell(air, &Ambient::of(&p.pass.condition(1.0))),
        );
    }
    let all = table("All passes", &head, [rows]).replacen("<table>", "<table class=\"nums\">", 1);
    let _ = writeln!(
        w,
        "<details><summary>All {} passes</summary>{}{all}</details>",
        run.passes.len(),
        note(
            "Difference: measured less predicted &mu;', at the stiffnesses that the setup states. Surprise: the force of the pass against \
             what the model lets expect after the passes before it, which have corrected its stiffnesses and &mu;<sub>0</sub> within what \
             the setup leaves open. So the two can differ, in sign too; the surprise is what the finding rests on."
        )
    );
}

fn facts(w: &mut String, run: &RunData) {
    let row = |(name, value): (&String, &String)| {
        row(escape(name), [cell(format!("<code>{}</code>", escape(value)))]) + "\n"
    };
    let all = table("The record", &columns("fact|value"), run.facts.iter().map(row));
    let _ = writeln!(w, "<details><summary>The record</summary>{all}</details>");
}

//! The page of more than two runs: their groups on one figure, and the differences at each condition.

use super::comparison::air_cell;
use super::explore::{place, script};
use super::html::{cell, column, columns, escape, glossary, list, note, numeric, row, shell, table};
use super::plots::comparison::{group_differences, group_overlay};
use crate::compare::groups::{AtCondition, Group, GroupBy, Grouped};
use models::Ambient;
use std::fmt::Write;
use std::path::PathBuf;

/// The page.
pub fn page(compared: &Grouped) -> miette::Result<String> {
    let runs: usize = compared.groups.iter().map(|g| g.runs.len()).sum();
    let title = match compared.by {
        GroupBy::Run => format!("{runs} runs"),
        GroupBy::Tip => format!("{runs} runs by tip"),
        GroupBy::Moisture => format!("{runs} runs by moisture"),
        GroupBy::Day => format!("{runs} runs by day"),
        GroupBy::Model => format!("{runs} runs by model"),
    };
    let mut html = format!(
        "<h1>{title}</h1><div class=\"verdict undecided\"><p>{}</p></div>",
        escape(&compared.words())
    );
    html += &groups(compared);
    if !compared.warnings.is_empty() {
        let _ = write!(html, "<h2>Caution</h2>{}", list(&compared.warnings, ""));
    }
    let data = serde_json::to_string(compared).map_err(|e| miette::miette!("{e}"))?;
    let _ = write!(
        html,
        "{}<h2>Relative friction of all groups</h2>{}<h2>Differences from the first group</h2>{}",
        place(&data),
        group_overlay(compared)?,
        group_differences(compared)?
    );
    html += &conditions(compared);
    html += &glossary();
    html += &script("exploreGroups");
    Ok(shell(&title, &html))
}

fn groups(compared: &Grouped) -> String {
    let row = |group: &Group| {
        let run = |(run, mu0): (&PathBuf, &f64)| {
            let name = run.file_name().unwrap_or(run.as_os_str()).to_string_lossy();
            format!("{} ({mu0:.3})", escape(&name))
        };
        let runs: Vec<String> = group.runs.iter().zip(&group.mu0).map(run).collect();
        row(escape(&group.name), [numeric(runs.len()), cell(runs.join(", "))]) + "\n"
    };
    let head = columns("group|#runs|folders (\u{3bc}<sub>0</sub>)");
    table("Groups", &head, compared.groups.iter().map(row))
}

fn conditions(compared: &Grouped) -> String {
    let mut head = columns("#w, \u{b5}m|#f, kHz|#U, mm/s|#load, N");
    head += &compared.groups.iter().map(|g| column(&format!("#{}", escape(&g.name)))).collect::<String>();
    let less = |g: &Group| column(&format!("#{} less first", escape(&g.name)));
    head += &compared.groups[1..].iter().map(less).collect::<String>();
    let air = compared.conditions.iter().any(|c| c.air != Ambient::default());
    head += &if air { columns("air") } else { String::new() };
    let row = |c: &AtCondition| {
        let (w, f, u) = (c.amplitude_pp_m * 1e6, c.frequency_hz / 1e3, c.velocity_m_s * 1e3);
        let [w, f, u, n] =
            [format!("{w:.2}"), format!("{f:.1}"), format!("{u:+.1}"), format!("{:.2}", c.normal_force_n)];
        let mut cells = [w, f, u, n].map(numeric).concat();
        for mean in &c.means {
            let text =
                mean.map_or("not measured".into(), |m| format!("{:.3} &plusmn; {:.3}", m.mu_relative, m.sd));
            cells += &numeric(text);
        }
        for d in &c.differences {
            let text = d.map_or("&ndash;".into(), |d| {
                let [low, high] = d.interval_95;
                let one = if d.between_runs { "" } else { "*" };
                format!("{:+.3} ({low:+.3} to {high:+.3}){one}", d.difference)
            });
            let apart = d.is_some_and(|d| d.interval_95[0] > 0.0 || d.interval_95[1] < 0.0);
            let _ = write!(cells, "<td class=\"n{}\">{text}</td>", if apart { " out" } else { "" });
        }
        format!("<tr>{cells}{}</tr>\n", air_cell(air, &c.air))
    };
    format!(
        "<h2>Condition by condition</h2>{}{}",
        note(
            "Differences have intervals of 95 %, each for itself; those without zero are bold. *: a group of one run, whose interval \
             leaves out how far another run would lie."
        ),
        table("All conditions", &head, compared.conditions.iter().map(row))
    )
}

//! The part of a run's page that is worked with: the script, the library that draws, and the data, all in the
//! page itself. Without JavaScript it stays hidden, and the figures below say the same.

use super::events::describe;
use super::traces::Trace;
use crate::format::rounded;
use crate::job::{REPLAYABLE, Replayable};
use crate::{MeasuredPass, RunData};
use models::PeakToPeak;

/// The figures of the dashboard and of a run's page, a module.
pub const FIGURES: &str = include_str!("assets/plots.js");
/// What a run's page does with them, a module.
pub const EXPLORE: &str = include_str!("explore.js");
/// The library that draws them.
pub const UPLOT: &str = include_str!("assets/uPlot.iife.min.js");
/// Its style.
pub const UPLOT_STYLE: &str = include_str!("assets/uPlot.min.css");

/// The section, hidden until the script shows it; nothing for a run without a pass.
pub(super) fn section(run: &RunData, traces: &[Trace]) -> String {
    if run.passes.is_empty() {
        return String::new();
    }
    place(&data(run, traces).to_string()) + &script("explore")
}

/// Where the script works, hidden until then, and its data: no markup can begin within them.
pub(super) fn place(data: &str) -> String {
    format!(
        "<section id=\"explore\" hidden></section><script type=\"application/json\" id=\"run-data\">{}</script>\n",
        data.replace('<', "\\u003c")
    )
}

/// The library with its style, the figures and the function that is called with place and data, in the page
/// itself: one that is opened as a file can import no module.
pub(super) fn script(function: &str) -> String {
    let imported = EXPLORE.split_once('\n').map_or("", |(_, rest)| rest);
    let figures = format!("{FIGURES}\n{imported}").replace("\nexport ", "\n");
    format!(
        "<style>{UPLOT_STYLE}</style><script>{UPLOT}\ndocument.addEventListener(\"DOMContentLoaded\", () => {{\n{figures}\n\
         {function}(document.getElementById(\"explore\"), JSON.parse(document.getElementById(\"run-data\").textContent), \
         document);\n}});</script>\n"
    )
}

fn data(run: &RunData, traces: &[Trace]) -> serde_json::Value {
    let pass = |p: &MeasuredPass| {
        let (c, pass) = (p.comparison, &p.pass);
        let friction = pass.friction_force_n();
        let still = pass.amplitude == PeakToPeak::ZERO;
        let [mu, mu_sd] = [c.and_then(|c| c.mu_relative), c.and_then(|c| c.mu_relative_sd)].map(short);
        let [time, w, f, u, normal] = [
            pass.time_s,
            pass.amplitude.micrometres(),
            pass.frequency_hz / 1e3,
            pass.speed_m_s * 1e3,
            pass.normal_force_n,
        ]
        .map(|v| short(Some(v)));
        serde_json::json!({
            "point": pass.point, "time_s": time, "w_um": w, "f_khz": f, "u_mm_s": u, "direction": i8::from(pass.direction),
            "normal_n": normal, "lateral_n": short(pass.lateral_force_n), "psi": short(p.psi_eq17), "mu": mu, "mu_sd": mu_sd,
            "predicted": short(c.map(|c| c.predicted)), "predicted_sd": short(c.map(|c| c.predicted_sd)),
            "surprise": short(c.map(|c| c.z)), "mu0": short(friction.filter(|_| still).map(|f| f / pass.normal_force_n)),
        })
    };
    let passes: Vec<_> = run.passes.iter().map(pass).collect();
    let event = |(at_s, event): &(f64, serde_json::Value)| {
        Some((*at_s, describe(&serde_json::from_value(event.clone()).ok()?)))
    };
    let events: Vec<_> = run.events.iter().filter_map(event).collect();
    // The limits that the run had. The setup's own need its certificates, which may be elsewhere by now.
    let replayed = run.files.get(REPLAYABLE).and_then(|text| serde_json::from_slice::<Replayable>(text).ok());
    let limits = replayed.map(|replayed| {
        let limits = &replayed.config.limits;
        serde_json::json!({ "lateral_n": limits.lateral_force_max_n, "normal_n": limits.normal_force_max_n })
    });
    serde_json::json!({ "passes": passes, "traces": traces, "events": events, "limits": limits })
}

/// A value with the digits that a figure or its table can show.
fn short(value: Option<f64>) -> Option<f64> {
    value.map(|v| rounded(v, 6))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::Setup;
    use std::collections::BTreeMap;

    /// Without the library's style its figures lie over what follows them.
    #[test]
    fn the_script_comes_with_the_librarys_style() {
        let page = script("start();");
        assert!(page.find(".uplot").is_some_and(|style| style < page.find("<script>").unwrap()));
    }

    /// A run's folder that was copied has no files of certificates beside it.
    #[test]
    fn a_page_shows_the_limits_of_a_run_whose_certificates_are_elsewhere() {
        let setup = Setup::load("virtual").unwrap();
        let (config, finger) = (setup.config, setup.tip.finger);
        let replayed = Replayable { config, finger, law: None, lateral_passband_hz: None };
        let moved = format!("certificates = [\"elsewhere.toml\"]\n{}", setup.text);
        let files =
            [("setup.toml", moved.into_bytes()), (REPLAYABLE, serde_json::to_vec_pretty(&replayed).unwrap())];
        let run = RunData {
            about: Vec::new(),
            facts: BTreeMap::new(),
            files: files.map(|(name, text)| (name.to_string(), text)).into(),
            passes: Vec::new(),
            events: Vec::new(),
            summary: None,
            finger,
            fidelity: None,
            damage: Vec::new(),
        };
        let limits = &data(&run, &[])["limits"];
        assert_eq!(limits["lateral_n"], config.limits.lateral_force_max_n);
        assert_eq!(limits["normal_n"], config.limits.normal_force_max_n);
    }
}

//! Every pass of a table with its numbers: where the marks of the maps lead.

use super::overlay::Overlay;
use crate::format::titled;
use crate::report::html::{column, columns, table};
use diagnosis::{Forecast, Table};
use models::covariate::{self, Covariate};
use std::fmt::Write;

/// The settings that a row begins with.
const SETTINGS: [(&Covariate, usize); 5] = [
    (&covariate::AMPLITUDE, 3),
    (&covariate::FREQUENCY, 2),
    (&covariate::SPEED, 1),
    (&covariate::DIRECTION, 0),
    (&covariate::NORMAL_FORCE, 3),
];

/// The section. A link to a row opens it.
pub fn section(points: &Table, overlay: &Overlay<'_>, forecasts: &[Forecast]) -> String {
    let settings = SETTINGS.iter().map(|(c, _)| column(&titled(c)));
    let values = columns("\u{3bc}' measured|baseline|model|gap before|gap after");
    let head = [column("pass"), settings.collect(), values].concat();
    let mut rows = String::new();
    for (i, (pass, (before, after))) in points.passes.iter().zip(overlay.errors()).enumerate() {
        let point = points.points[i];
        let _ = write!(rows, "<tr id=\"pass-{point}\"><th scope=\"row\">{point}</th>");
        for (c, digits) in SETTINGS {
            let _ = match c.of(pass) {
                Some(v) => write!(rows, "<td>{:.digits$}</td>", c.shown.0 * v),
                None => write!(rows, "<td>&ndash;</td>"),
            };
        }
        let full = overlay.full(pass);
        let [measured, baseline, model] =
            [points.lateral[i], forecasts[i].recalibrated, forecasts[i].corrected].map(|n| n / full);
        let _ = writeln!(
            rows,
            "<td>{measured:.3}</td><td>{baseline:.3}</td><td>{model:.3}</td><td>{before:+.3}</td><td>{after:+.3}</td></tr>"
        );
    }
    let all = table("All passes", &head, [rows]).replacen("<table>", "<table class=\"nums\">", 1);
    format!("<details><summary>All {} passes</summary>{all}</details>", points.len())
}

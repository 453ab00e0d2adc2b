//! The transition of the phase shift in a study at rest.

use models::ridge::study::{Panel, content_key};
use studies::figures::{self, Study, store};

/// For each curve: where the phase passes 30 and 60 degrees, and where it stands at 2.5 and 5 um.
pub fn lines(study: Study, results: &store::Results) -> Vec<String> {
    let points = study.points();
    let mut lines = Vec::new();
    for panel in [Panel::Frequency, Panel::YoungModulus, Panel::NormalForce] {
        for value in panel.values() {
            let mut curve: Vec<(f64, f64)> = Vec::new();
            for p in points.iter().filter(|p| p.panel == panel && p.value == value) {
                let stored = results.get(&content_key(&p.case, &figures::settings()));
                if let Some(phase) = stored.and_then(|k| k.phase_shift_deg) {
                    let lead = if phase > 270.0 { phase - 360.0 } else { phase };
                    curve.push((1e6 * study.reading.w_m(p.case.amplitude), lead));
                }
            }
            let at = |w: f64| {
                let hit = curve.iter().find(|p| (p.0 - w).abs() < 1e-6);
                hit.map_or("missing".into(), |p| format!("{:.0} deg", p.1))
            };
            lines.push(format!(
                "{} {value}: passes 30 and 60 deg at {} and {} \u{b5}m; at 2.5 \u{b5}m {}, at 5 \u{b5}m {}",
                panel.variable(),
                figures::passing(&curve, 30.0),
                figures::passing(&curve, 60.0),
                at(2.5),
                at(5.0)
            ));
        }
    }
    lines
}

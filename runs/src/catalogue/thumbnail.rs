//! A small picture of a run: measured `mu'` against amplitude, as SVG that needs nothing else.

use crate::sweep::MeasuredPass;
use models::PeakToPeak;
use std::fmt::Write;

/// Width and height in px.
const SIZE: [f64; 2] = [96.0, 32.0];
/// Marks at most: a list of many runs stays small.
const MOST: usize = 60;

/// The picture; none without a pass with vibration whose `mu'` is known. Its axes begin at zero and reach to
/// 1.1 and to the largest amplitude; what lies beyond is drawn at the end.
pub fn thumbnail(passes: &[MeasuredPass]) -> Option<String> {
    let driven = passes.iter().filter(|p| p.pass.amplitude > PeakToPeak::ZERO);
    let points: Vec<(f64, f64)> = driven
        .filter_map(|p| Some((p.pass.amplitude.micrometres(), p.comparison?.mu_relative?)))
        .filter(|(_, mu)| mu.is_finite())
        .collect();
    let widest = points.iter().map(|p| p.0).reduce(f64::max)?;
    let [width, height] = SIZE;
    let mut svg = format!(
        "<svg class=\"thumb\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" role=\"img\" \
         aria-label=\"\u{3bc}' against w up to {widest:.1} \u{b5}m\"><path d=\"M2 1V30H95\" fill=\"none\" stroke=\"currentColor\" \
         opacity=\".4\"/><g fill=\"currentColor\">"
    );
    for (w, mu) in points.iter().step_by(points.len().div_ceil(MOST)) {
        let x = 3.0 + 90.0 * w / widest;
        let y = 30.0 - 28.0 * mu.clamp(0.0, 1.1) / 1.1;
        let _ = write!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"1.6\"/>");
    }
    Some(svg + "</g></svg>")
}

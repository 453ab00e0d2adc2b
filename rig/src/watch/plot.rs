//! The traces of the last minute and the curve, drawn with characters.

use super::style::Look;
use crate::live::{State, View};
use ratatui_core::buffer::Buffer;
use ratatui_core::layout::Rect;
use ratatui_core::style::{Modifier, Style};

/// Length of a trace in s.
const LAST_S: f64 = 60.0;
/// Dots of a cell of braille: columns and rows.
const DOTS: [usize; 2] = [2, 4];

struct Dots {
    cells: [usize; 2],
    set: Vec<bool>,
}

impl Dots {
    fn new(area: Rect) -> Self {
        let cells = [usize::from(area.width), usize::from(area.height)];
        Dots { cells, set: vec![false; cells[0] * cells[1] * DOTS[0] * DOTS[1]] }
    }

    fn size(&self) -> [usize; 2] {
        [self.cells[0] * DOTS[0], self.cells[1] * DOTS[1]]
    }

    fn set(&mut self, x: usize, y: usize) {
        let [width, height] = self.size();
        if x < width && y < height {
            self.set[y * width + x] = true;
        }
    }

    /// What a cell looks like.
    fn sign(&self, cx: usize, cy: usize, unicode: bool) -> char {
        // The bits of braille by column and row.
        const BITS: [[u32; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];
        let (mut code, mut upper, mut lower) = (0, false, false);
        for x in 0..DOTS[0] {
            for y in 0..DOTS[1] {
                if self.set[(cy * DOTS[1] + y) * self.size()[0] + cx * DOTS[0] + x] {
                    code |= BITS[x][y];
                    upper |= y < 2;
                    lower |= y >= 2;
                }
            }
        }
        match (unicode, upper, lower) {
            (_, false, false) => ' ',
            (true, ..) => char::from_u32(0x2800 + code).unwrap_or('#'),
            (false, true, true) => '|',
            (false, true, false) => '\'',
            (false, false, true) => '.',
        }
    }
}

/// Least and greatest value of a channel in the last minute.
fn range(states: &[(f64, [f64; 2])]) -> Option<[f64; 2]> {
    let widen = |[low, high]: [f64; 2], span: &[f64; 2]| [low.min(span[0]), high.max(span[1])];
    (!states.is_empty())
        .then(|| states.iter().map(|(_, span)| span).fold([f64::INFINITY, f64::NEG_INFINITY], widen))
}

/// A channel's envelope over the last minute under its title: every dot column from the least to the greatest value of its cycles.
pub fn trace(
    buffer: &mut Buffer,
    area: Rect,
    look: Look,
    (name, view): (&str, &View),
    span: impl Fn(&State) -> Option<[f64; 2]>,
) {
    if area.is_empty() {
        return;
    }
    let now = view.now_s();
    let fit = |s: &State| {
        let span = span(s).filter(|[low, high]| low.is_finite() && high.is_finite())?;
        (now - s.time_s <= LAST_S).then_some((now - s.time_s, span))
    };
    let states: Vec<(f64, [f64; 2])> = view.states.iter().filter_map(fit).collect();
    let title = match range(&states) {
        Some([low, high]) => format!("{name}, N, 60 s: {low:+.3}..{high:+.3}"),
        None => format!("{name}, N: none in 60 s"),
    };
    buffer.set_stringn(area.x, area.y, title, area.width.into(), look.heading());
    let field = Rect { y: area.y + 1, height: area.height - 1, ..area };
    let Some([low, high]) = range(&states).filter(|_| !field.is_empty()) else { return };
    let mut dots = Dots::new(field);
    let [width, height] = dots.size();
    // A force that does not change is a line in the middle.
    let (low, scale) = if high > low { (low, high - low) } else { (low - 0.5, 1.0) };
    let row = |v: f64| ((1.0 - (v - low) / scale) * (height - 1) as f64).round() as usize;
    for (age, [least, greatest]) in states {
        let x = ((1.0 - age / LAST_S) * (width - 1) as f64).round() as usize;
        for y in row(greatest)..=row(least) {
            dots.set(x, y);
        }
    }
    for cy in 0..dots.cells[1] {
        let line: String = (0..dots.cells[0]).map(|cx| dots.sign(cx, cy, look.unicode)).collect();
        buffer.set_stringn(field.x, field.y + cy as u16, line, field.width.into(), Style::new());
    }
}

/// The next of 1, 2, 5 times a power of ten from a value on.
fn rounded_up(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    let decade = 10f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];
    let mut bounds = steps.into_iter().map(|step| step * decade);
    bounds.find(|bound| *bound >= value * 0.999_999).unwrap_or(10.0 * decade)
}

/// Columns of the labels of mu'.
const GUTTER: u16 = 5;

/// `mu'` against amplitude: a mark for each pass, measured and predicted with different shapes.
pub fn curve(buffer: &mut Buffer, area: Rect, look: Look, view: &View) {
    if area.width < GUTTER + 8 || area.height < 4 {
        return;
    }
    let title = "mu' by w: o measured - predicted @ both";
    buffer.set_stringn(area.x, area.y, title, area.width.into(), look.heading());
    let finite = |v: f64| v.is_finite().then_some(v);
    let marks: Vec<(f64, Option<f64>, Option<f64>)> = view
        .passes
        .iter()
        .map(|p| {
            let c = p.comparison;
            let w = p.pass.amplitude.micrometres();
            (w, c.and_then(|c| c.mu_relative).and_then(finite), c.and_then(|c| finite(c.predicted)))
        })
        .filter(|(w, ..)| w.is_finite())
        .collect();
    let (width, height) = (area.width - GUTTER - 1, area.height - 3);
    let field = Rect { x: area.x + GUTTER + 1, y: area.y + 1, width, height };
    let all = || marks.iter().flat_map(|(_, m, p)| [*m, *p]).flatten();
    let high = all().fold(1.0, f64::max);
    let high = if high <= 1.05 { 1.05 } else { rounded_up(high) };
    let low = -rounded_up(-all().fold(0.0, f64::min)) * f64::from(u8::from(all().any(|v| v < 0.0)));
    let widest = rounded_up(marks.iter().map(|m| m.0).fold(0.0, f64::max));
    for y in 0..field.height {
        let v = high - (high - low) * f64::from(y) / f64::from((field.height - 1).max(1));
        let labelled = y == 0 || y == field.height - 1 || y == field.height / 2;
        let label = if labelled { format!("{v:5.2}|") } else { "     |".into() };
        buffer.set_stringn(area.x, field.y + y, label, usize::from(GUTTER + 1), Style::new());
    }
    let axis = format!("     +{}", "-".repeat(field.width.into()));
    buffer.set_stringn(area.x, field.bottom(), axis, area.width.into(), Style::new());
    let most = format!("{widest}");
    let between = usize::from(field.width).saturating_sub(1 + most.len());
    let under = format!("      0{:^between$}", "w, um peak-to-peak");
    buffer.set_stringn(area.x, field.bottom() + 1, format!("{under}{most}"), area.width.into(), Style::new());
    if marks.is_empty() {
        let (x, y, width) = (field.x + 2, field.y + field.height / 2, field.width.saturating_sub(2));
        buffer.set_stringn(x, y, "no pass so far", width.into(), Style::new());
        return;
    }
    let place = |w: f64, v: f64| {
        let x = (w / widest * f64::from(field.width - 1)).round() as u16;
        let y = ((high - v) / (high - low) * f64::from((field.height - 1).max(1))).round() as u16;
        (field.x + x.min(field.width - 1), field.y + y.min(field.height - 1))
    };
    let last = marks.len() - 1;
    for (i, (w, measured, predicted)) in marks.into_iter().enumerate() {
        // The newest one stands out.
        let style = if i == last { Style::new().add_modifier(Modifier::REVERSED) } else { Style::new() };
        for (v, sign) in [(predicted, "-"), (measured, "o")] {
            let Some(cell) = v.and_then(|v| buffer.cell_mut(place(w, v))) else { continue };
            let both = match (cell.symbol(), sign) {
                ("@", _) | ("-", "o") | ("o", "-") => "@",
                _ => sign,
            };
            cell.set_symbol(both).set_style(style);
        }
    }
}

//! Times: clocks of a day, stopwatches, and an order of rows that a clock must not contradict.

use super::grid::{Cell, Grid};
use super::targets::Id;
use super::values::Values;

const DAY_S: f64 = 86_400.0;

/// What a time of two fields is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fields {
    Hours,
    Minutes,
}

/// A time as it is written.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    /// s from some day, a time of two fields read as hours and minutes.
    seconds: f64,
    /// A date came with it.
    dated: bool,
    /// Two fields, and whether they must be minutes and seconds.
    two: Option<bool>,
}

/// Whether a cell is a time.
pub fn is_time(cell: &Cell) -> bool {
    reading(cell).is_some()
}

/// A workbook's time, `12:34:56.7`, `1:02 PM`, with a date before it where there is one (`2024-03-01`,
/// `01.03.2024`; one with slashes may begin with the month or the day, and is refused).
fn reading(cell: &Cell) -> Option<Reading> {
    let text = match cell {
        Cell::Clock(seconds) => {
            return Some(Reading { seconds: *seconds, dated: *seconds >= DAY_S, two: None });
        }
        Cell::Text(text) if text.contains(':') => text.trim_end_matches('Z'),
        _ => return None,
    };
    let upper = text.to_ascii_uppercase();
    let half = ["AM", "PM"].iter().position(|half| upper.ends_with(half));
    let text = if half.is_some() { text[..text.len() - 2].trim_end() } else { text };
    let (date, time) = match text.split_once(['T', ' ']) {
        Some((date, time)) => (Some(date), time),
        None => (None, text),
    };
    let fields: Vec<&str> = time.split(':').collect();
    let number =
        |k: usize| fields.get(k).map_or(Some(0.0), |p| p.trim().replace(',', ".").parse::<f64>().ok());
    if !(2..=3).contains(&fields.len()) {
        return None;
    }
    let (mut hours, minutes, seconds) = (number(0)?, number(1)?, number(2)?);
    if [hours, minutes, seconds].iter().any(|v| !v.is_finite() || *v < 0.0) {
        return None;
    }
    if let Some(half) = half {
        hours = hours % 12.0 + 12.0 * half as f64;
    }
    let days = match date {
        None => 0.0,
        Some(date) => {
            let dotted = date.contains('.');
            let parts: Vec<&str> = date.split(if dotted { '.' } else { '-' }).collect();
            let number = |k: usize| parts.get(k)?.parse::<i64>().ok();
            // A year of two digits might be a day.
            let m = number(1).filter(|_| parts.len() == 3 && parts[if dotted { 2 } else { 0 }].len() == 4)?;
            let (y, d) = if dotted { (number(2)?, number(0)?) } else { (number(0)?, number(2)?) };
            if !(0..=9999).contains(&y) || !(1..=12).contains(&m) || !(1..=31).contains(&d) {
                return None;
            }
            // Days of the civil calendar (proleptic Gregorian), the year beginning in March.
            let (y, m) = if m > 2 { (y, m - 3) } else { (y - 1, m + 9) };
            (365 * y + y.div_euclid(4) - y.div_euclid(100) + y.div_euclid(400) + (153 * m + 2) / 5 + d) as f64
        }
    };
    // Minutes have no decimals; hours of a clock end at 24.
    let stopwatch = fields[1].contains(['.', ',']) || hours >= 24.0;
    let two = (fields.len() == 2 && half.is_none() && date.is_none()).then_some(stopwatch);
    let seconds = days * DAY_S + hours * 3600.0 + minutes * 60.0 + seconds;
    Some(Reading { seconds, dated: date.is_some(), two })
}

/// The times of a column in s from the earliest, row by row, and what is to be noted of them; no times at all
/// where none is written as a clock's.
///
/// # Errors
/// In words: times of two fields that may be either, clocks beside numbers, a clock without a date that jumps.
pub fn times(grid: &Grid, column: usize, stated: &str) -> Result<(Vec<Option<f64>>, Vec<String>), String> {
    let cells: Vec<Option<&Cell>> = grid.rows.iter().map(|r| grid.cell(r, column)).collect();
    let read: Vec<Option<Reading>> = cells.iter().map(|c| c.and_then(reading)).collect();
    let Some(known) = read.iter().position(Option::is_some) else { return Ok((Vec::new(), Vec::new())) };
    let place = |k: usize| grid.rows[k].place;
    let number = |c: &Option<&Cell>| c.is_some_and(|c| c.is_number(grid.comma) && !is_time(c));
    if let Some(k) = cells.iter().position(number) {
        return Err(format!(
            "row {} has a time of day, row {} a number of seconds: make one of them the other",
            place(known),
            place(k)
        ));
    }
    let two: Vec<bool> = read.iter().flatten().filter_map(|r| r.two).collect();
    let fields = match stated {
        "mm:ss" => Fields::Minutes,
        "hh:mm" => Fields::Hours,
        _ if two.contains(&true) => Fields::Minutes,
        _ if two.is_empty() => Fields::Hours,
        _ => {
            return Err(format!(
                "row {}: '{}' may be hours and minutes or minutes and seconds; say which: map the column as time:hh:mm or time:mm:ss",
                place(known),
                cells[known].map(Cell::shown).unwrap_or_default()
            ));
        }
    };
    let minutes = fields == Fields::Minutes;
    let seconds = |r: &Reading| if r.two.is_some() && minutes { r.seconds / 60.0 } else { r.seconds };
    let mut notes = vec!["times of day are counted from the earliest".to_string()];
    let mut all: Vec<Option<f64>> = read.iter().map(|r| r.as_ref().map(seconds)).collect();
    let rows: Vec<usize> = (0..all.len()).filter(|k| all[*k].is_some()).collect();
    let of_day = !minutes && read.iter().flatten().all(|r| !r.dated);
    let steps: Vec<(usize, f64)> =
        rows.windows(2).map(|w| (w[1], all[w[1]].unwrap_or(0.0) - all[w[0]].unwrap_or(0.0))).collect();
    if of_day && steps.iter().any(|(_, s)| *s < -0.5 * DAY_S) {
        if let Some((k, _)) = steps.iter().find(|(_, s)| *s > 0.5 * DAY_S || *s < 0.0 && *s > -0.5 * DAY_S) {
            return Err(format!(
                "the times of day have no date and jump to and fro (row {}); add the date, or sort the rows by time",
                place(*k)
            ));
        }
        let mut days = 0.0;
        for k in &rows {
            if let Some((k, _)) = steps.iter().find(|(at, s)| at == k && *s < 0.0) {
                days += DAY_S;
                notes.push(format!("row {} is after midnight: a day was added", place(*k)));
            }
            all[*k] = all[*k].map(|s| s + days);
        }
    }
    let earliest = all.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    // Differences of large numbers of seconds keep the digits that were written.
    let counted = |s: f64| ((s - earliest) * 1e6).round() / 1e6;
    Ok((all.into_iter().map(|s| s.map(counted)).collect(), notes))
}

/// What the order of the rows says against their times: `Err` where a clock began again, `Ok` with a note
/// where the rows are sorted otherwise.
pub fn order(values: &[&Values], accepted: bool) -> Result<Option<String>, String> {
    let mut runs: Vec<(Option<&str>, Vec<(u64, f64)>)> = Vec::new();
    for v in values {
        let Some(time) = v.get(Id::Time) else { continue };
        let (run, at) = (v.run.as_deref(), (v.place, time));
        match runs.iter_mut().rev().find(|(name, _)| *name == run) {
            Some((_, rows)) => rows.push(at),
            None => runs.push((run, vec![at])),
        }
    }
    let mut note = None;
    for (_, rows) in &runs {
        let back: Vec<usize> = (1..rows.len()).filter(|k| rows[*k].1 < rows[*k - 1].1).collect();
        // Newest first is an order as good.
        if back.is_empty() || rows.windows(2).all(|w| w[1].1 < w[0].1) {
            continue;
        }
        let mut sorted: Vec<f64> = rows.iter().map(|r| r.1).collect();
        sorted.sort_by(f64::total_cmp);
        let mut gaps: Vec<f64> = sorted.windows(2).map(|w| w[1] - w[0]).collect();
        gaps.sort_by(f64::total_cmp);
        let span = sorted[sorted.len() - 1] - sorted[0];
        // A rig makes one pass after the other. Passes of one clock keep a distance; those of clocks that begin again coincide.
        let close = gaps[gaps.len() / 10] < 0.2 * span / gaps.len() as f64;
        let few = 4 * back.len() <= rows.len();
        let twice = gaps[0] <= 0.0;
        let first: Vec<String> = back.iter().take(5).map(|k| rows[*k].0.to_string()).collect();
        let more = if back.len() > 5 { ", ..." } else { "" };
        if (twice || few && close) && !accepted {
            return Err(format!("the time goes back in row {}{more}", first.join(", ")));
        }
        note = Some(format!(
            "the rows are not in the order of time (row {}{more}): time_s holds",
            first.join(", ")
        ));
    }
    Ok(note)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_read() {
        let at = |text: &str| reading(&Cell::Text(text.into())).map(|r| r.seconds);
        assert_eq!(at("01:02:03.5"), Some(3723.5));
        assert_eq!(at("00:01"), Some(60.0));
        let day = |a: &str, b: &str| at(b).unwrap() - at(a).unwrap();
        assert_eq!(day("2024-02-28 23:59:59", "2024-03-01T00:00:00Z"), 86_401.0);
        assert_eq!(day("2023-12-31 00:00:00", "2024-12-31 00:00:00"), 366.0 * 86_400.0);
        assert_eq!((at("1:02:03 PM"), at("12:00:01 am")), (Some(46_923.0), Some(1.0)));
        assert_eq!(day("29.02.2024 23:59:50,625", "2024-03-01 00:00:00"), 9.375);
        assert_eq!(day("01.03.2024 23:59:50,5", "2.3.2024 00:00:01,5"), 11.0);
        for ambiguous in [
            "01/03/2024 10:00:00",
            "01.03.24 10:00:00",
            "01.13.2024 10:00:00",
            "01.03 10:00:00",
            "01-03-24 10:00:00",
            "01-03-2024 10:00:00",
        ] {
            assert_eq!(at(ambiguous), None, "{ambiguous}");
        }
        assert_eq!(at("1.5"), None);
        assert_eq!(at("a:b"), None);
    }
}

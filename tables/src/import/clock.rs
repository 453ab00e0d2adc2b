//! Times: clocks of a day, stopwatches, and an order of rows that a clock must not contradict.

use super::grid::{Cell, Grid};
use super::targets::Id;
use super::values::Values;
use chrono::{Datelike, NaiveDate};

/// A day, by which workbooks count time, in s.
pub const DAY_S: f64 = 86_400.0;

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
    [true, false].into_iter().any(|month_first| written(cell, Some(month_first)).is_some())
}

/// A workbook's time, `12:34:56.7`, `1:02 PM`, with a date before it where there is one; see [`days`].
fn written(cell: &Cell, month_first: Option<bool>) -> Option<Reading> {
    let text = match cell {
        Cell::Clock(seconds) => {
            return Some(Reading { seconds: *seconds, dated: *seconds >= DAY_S, two: None });
        }
        Cell::Text(text) if text.contains(':') => text.trim_end_matches('Z'),
        _ => return None,
    };
    // An offset from universal time: +01:00.
    let (text, offset_s) = match text.len().checked_sub(6).and_then(|at| text.split_at_checked(at)) {
        Some((time, offset)) if time.contains('T') && offset.starts_with(['+', '-']) => {
            let (hours, minutes) = offset[1..].split_once(':')?;
            let seconds = 3600.0 * hours.parse::<f64>().ok()? + 60.0 * minutes.parse::<f64>().ok()?;
            (time, if offset.starts_with('-') { -seconds } else { seconds })
        }
        _ => (text, 0.0),
    };
    let upper = text.to_ascii_uppercase();
    let half = ["AM", "PM"].iter().position(|half| upper.ends_with(half));
    let text = if half.is_some() { text[..text.len() - 2].trim_end() } else { text };
    let (date, time) = match text.split_once(['T', ' ']) {
        Some((date, time)) => (Some(date), time),
        None => (None, text),
    };
    // LabVIEW parts milliseconds with a colon too.
    let joined = time.rsplit_once(':').filter(|(rest, ms)| rest.matches(':').count() == 2 && ms.len() == 3);
    let joined = joined.map(|(rest, ms)| format!("{rest}.{ms}"));
    let fields: Vec<&str> = joined.as_deref().unwrap_or(time).split(':').collect();
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
        Some(date) => days(date, month_first)?,
    };
    // Minutes have no decimals; hours of a clock end at 24.
    let stopwatch = fields[1].contains(['.', ',']) || hours >= 24.0;
    let two = (fields.len() == 2 && half.is_none() && date.is_none()).then_some(stopwatch);
    let seconds = days * DAY_S + hours * 3600.0 + minutes * 60.0 + seconds - offset_s;
    Some(Reading { seconds, dated: date.is_some(), two })
}

/// Days of a date from 1970: `2024-03-01`, `01.03.2024`, `01-Mar-2024`; of one with slashes if it is
/// known whether it begins with the month.
fn days(date: &str, month_first: Option<bool>) -> Option<f64> {
    let slashes = month_first.map(|month_first| if month_first { "%m/%d/%Y" } else { "%d/%m/%Y" });
    let mut forms = ["%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d-%b-%Y"].into_iter().chain(slashes);
    let day = forms.find_map(|form| NaiveDate::parse_from_str(date, form).ok())?;
    // A year of two digits might be a day.
    Some((day - NaiveDate::default()).num_days() as f64).filter(|_| (1000..=9999).contains(&day.year()))
}

/// The dates beside times of a day, row by row, and the column that has them.
///
/// # Errors
/// In words: a column that is called a date and holds several that are not understood.
fn dates(grid: &Grid, month_first: Option<bool>) -> Result<Option<(usize, Vec<f64>)>, String> {
    let is_date = |word: &str| word.eq_ignore_ascii_case("date") || word.eq_ignore_ascii_case("datum");
    let named = |header: &String| header.split(|c: char| !c.is_alphabetic()).any(is_date);
    let Some(column) = grid.header.iter().position(named) else { return Ok(None) };
    let day = |row| match grid.cell(row, column)? {
        Cell::Clock(seconds) => Some(seconds / DAY_S).filter(|day| day.fract() == 0.0),
        Cell::Text(text) => days(text.trim_end_matches(" 00:00:00"), month_first),
        _ => None,
    };
    let name = &grid.header[column];
    match grid.rows.iter().map(day).collect() {
        Some(days) => Ok(Some((column, days))),
        None if grid.rows.windows(2).all(|w| grid.cell(&w[0], column) == grid.cell(&w[1], column)) => {
            Ok(None)
        }
        None => Err(format!(
            "the column '{name}' holds dates that are not understood: write them as 2024-03-01, or map the time as time:mdy or time:dmy"
        )),
    }
}

/// The times of a column in s from the earliest, row by row, and what is to be noted of them; no times at all
/// where none is written as a clock's.
///
/// # Errors
/// In words: times of two fields that may be either, clocks beside numbers, a clock without a date that jumps.
pub fn times(grid: &Grid, column: usize, stated: &str) -> Result<(Vec<Option<f64>>, Vec<String>), String> {
    let cells: Vec<Option<&Cell>> = grid.rows.iter().map(|r| grid.cell(r, column)).collect();
    let month_first = ["mdy", "dmy"].iter().position(|order| *order == stated).map(|k| k == 0);
    let known = cells.iter().position(|c| c.is_some_and(is_time));
    let Some(known) = known else { return Ok((Vec::new(), Vec::new())) };
    let place = |k: usize| grid.rows[k].place;
    let mut read: Vec<Option<Reading>> = cells.iter().map(|c| written((*c)?, month_first)).collect();
    let either = |k: usize, what: &str, as_what: &str| {
        let shown = cells[k].map(Cell::shown).unwrap_or_default();
        Err(format!("row {}: '{shown}' may {what}; say which: map the column as {as_what}", place(k)))
    };
    let unclear = |k: &usize| month_first.is_none() && read[*k].is_none() && cells[*k].is_some_and(is_time);
    if let Some(k) = (0..cells.len()).find(unclear) {
        return either(k, "begin with the month or the day", "time:mdy or time:dmy");
    }
    let number = |c: &Option<&Cell>| c.is_some_and(|c| c.is_number(grid.comma) && !is_time(c));
    if let Some(k) = cells.iter().position(number) {
        return Err(format!(
            "row {} has a time of day, row {} a number of seconds: make one of them the other",
            place(known),
            place(k)
        ));
    }
    let two: Vec<bool> = read.iter().flatten().filter_map(|r| r.two).collect();
    let minutes = match stated {
        "mm:ss" => true,
        "hh:mm" => false,
        _ if two.is_empty() || two.contains(&true) => !two.is_empty(),
        _ => return either(known, "be hours and minutes or minutes and seconds", "time:hh:mm or time:mm:ss"),
    };
    let seconds = |r: &Reading| if r.two.is_some() && minutes { r.seconds / 60.0 } else { r.seconds };
    let mut notes = vec!["times of day are counted from the earliest".to_string()];
    if !minutes
        && read.iter().flatten().all(|r| !r.dated)
        && let Some((column, days)) = dates(grid, month_first)?
    {
        for (reading, day) in read.iter_mut().zip(days) {
            *reading = reading.map(|r| Reading { seconds: r.seconds + day * DAY_S, dated: true, ..r });
        }
        notes.push(format!("the dates of '{}' were added", grid.header[column]));
    }
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

/// What the order of the rows says against their times: `Err` where a clock may have begun again, `Ok` with a
/// note where it is accepted that the rows are sorted otherwise.
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
        let first: Vec<String> = back.iter().take(5).map(|k| rows[*k].0.to_string()).collect();
        let more = if back.len() > 5 { ", ..." } else { "" };
        if !accepted {
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
        let at = |text: &str| written(&Cell::Text(text.into()), None).map(|r| r.seconds);
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
            "30.02.2024 10:00:00",
            "2023-02-29 10:00:00",
        ] {
            assert_eq!(at(ambiguous), None, "{ambiguous}");
        }
        assert_eq!(day("2024-03-01T11:59:50+01:00", "2024-03-01T10:59:51Z"), 1.0);
        assert_eq!(day("01-Mar-2024 23:59:59", "2024-03-02 00:00:01"), 2.0);
        assert!((day("2024-03-01 11:59:50.708", "2024-03-01 11:59:52.127") - 1.419).abs() < 5e-7);
        assert_eq!(at("11:59:50:708"), Some(43_190.708));
        assert_eq!(at("1.5"), None);
        assert_eq!(at("a:b"), None);
    }

    fn import(header: &str, row: &str, map: &str) -> Result<Vec<f64>, String> {
        use crate::import::guess::tests::{imported, table};
        let text = table(&format!("{header};v (mm/s);Fz (N);Fx (N)"), &format!("{row};{{v}};0.25;{{fx}}"));
        let (day, next) = text.split_at(text.match_indices('\n').nth(12).unwrap().0);
        let text = format!("{day}{}", next.replace("01.03.", "02.03.").replace("03/01", "03/02"));
        let made = imported(&text, map, "amplitude_pp=0", false)?;
        Ok(made.table.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect())
    }

    #[test]
    fn a_date_beside_a_time_of_day_counts() {
        let times = import("Datum;Zeit", "01.03.2024;12:00:{t}", "").unwrap();
        assert_eq!((times[1], times[12]), (2.0, 86_424.0));
        let refusal = import("Date;Time", "03/01/2024;12:00:{t}", "").unwrap_err();
        assert!(refusal.contains("'Date' holds dates that are not understood"), "{refusal}");
        // One date that stays the same says nothing.
        assert!(import("Date;Time", "5/1/2024;12:00:{t}", "").is_ok());
    }

    #[test]
    fn a_date_with_slashes_needs_its_order() {
        let refusal = import("Time", "03/01/2024 12:00:{t}", "").unwrap_err();
        assert!(refusal.contains("time:mdy or time:dmy"), "{refusal}");
        let times = import("Time", "03/01/2024 12:00:{t} PM", "Time=time:mdy").unwrap();
        assert_eq!((times[1], times[12]), (2.0, 86_424.0));
        let times = import("Time", "03/01/2024 12:00:{t}", "Time=time:dmy").unwrap();
        assert_eq!(times[12], 24.0 + 31.0 * DAY_S, "the month is the second");
    }

    #[test]
    fn a_clock_that_begins_again_is_refused() {
        use crate::import::guess::tests::{imported, table};
        let text = table("Time (s);v (mm/s);Fz (N);Fx (N)", "{t};{v};0.25;{fx}");
        let again =
            text.lines().skip(1).map(|line| format!("0.5{}\n", line.trim_start_matches(|c| c != ';')));
        let refusal =
            imported(&format!("{text}{}", again.take(1).collect::<String>()), "", "amplitude_pp=0", false);
        assert!(refusal.clone().is_err_and(|e| e.contains("the time goes back in row 26")), "{refusal:?}");
    }
}

//! The cells of a point table: all that is wrong with them, each at its cell.

use super::place::remedy;
use crate::import::apart;
use diagnosis::data::DataError;
use models::pass::{FAULTS, Pass, TableError, read_readable};
use runs::input::Problems;
use std::ops::Range;

/// The passes of a table, as a diagnosis would take each of them.
///
/// # Errors
/// Every cell that is wrong, the first [`FAULTS`] of them by themselves.
pub(super) fn passes(name: &str, bytes: &[u8]) -> miette::Result<Vec<Pass>> {
    let found = read_readable(bytes);
    let place = |fault: &TableError| {
        let (line, column) = fault.place();
        (line, column.map(str::to_string), fault.to_string())
    };
    let mut faults: Vec<_> = found.faults.iter().map(place).collect();
    // What has no lateral force in a table of measurements is passed over there.
    let measured = found.passes.iter().any(|(_, pass)| pass.lateral_force_n.is_some());
    let judged = found.passes.iter().filter(|(_, pass)| !measured || pass.lateral_force_n.is_some());
    for (line, pass) in judged {
        if let Err(why) = diagnosis::data::check(pass) {
            let DataError::BadValue { column, .. } = &why else { continue };
            faults.push((*line, Some(column.to_string()), why.to_string()));
        }
    }
    faults.sort_by_key(|(line, ..)| *line);
    let further = found.further + faults.len().saturating_sub(FAULTS);
    let text = String::from_utf8_lossy(bytes);
    let mut wrong = Problems::of(name, &text);
    for (line, column, problem) in faults.into_iter().take(FAULTS) {
        let help = match problem.contains("normal_force_n = -") {
            true => "the normal force is positive in compression: turn the sign of the column".into(),
            false => remedy(Some("table")),
        };
        wrong.add_at(Some(cell(&text, line, column.as_deref())), problem, help);
    }
    if further > 0 {
        let problem = format!("{further} more cells or rows are at fault");
        wrong.add_at(None, problem, "correct those above, and check again".to_string());
    }
    wrong.end()?;
    Ok(found.passes.into_iter().map(|(_, pass)| pass).collect())
}

/// The cell of a column in a line (from 1) of a CSV text, or where that line begins.
fn cell(text: &str, line: u64, column: Option<&str>) -> Range<usize> {
    let line = usize::try_from(line).unwrap_or(1).max(1);
    let start: usize = text.split_inclusive('\n').take(line - 1).map(str::len).sum();
    let cells = |from: usize| cells(&text[from..][..text[from..].find('\n').unwrap_or(text.len() - from)]);
    // Of a column that is there twice, the second one.
    let at = column.and_then(|column| cells(0).into_iter().rposition(|cell| text[cell].trim() == column));
    let found = at.and_then(|at| cells(start).into_iter().nth(at));
    found.map_or(start..start, |cell| start + cell.start..start + cell.end)
}

/// The cells of one line without blanks around them: a comma in quotation marks parts none.
fn cells(line: &str) -> Vec<Range<usize>> {
    let mut from = 0;
    let range = |cell: &str| {
        let start = from + cell.len() - cell.trim_start().len();
        let range = start..start.max(from + cell.trim_end().len());
        from += cell.len() + 1;
        range
    };
    apart(line, |c| c == ',').map(range).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::problems_of;

    const HEAD: &str = "run,point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,lateral_force_n";

    #[test]
    fn every_wrong_cell_is_reported_at_its_place() {
        let table = format!(
            "{HEAD}\n\"a,b\",0,0,0,0.02,1,0.25,0.1\nx,1,1,0,fast,1,0.25,0.1\nx,4,2,0,0.02,1,-0.25,0.1\n\
             x,5,3,0,0.02,7, 0.2N,0.1\nx,6,4,0\n"
        );
        let problems = problems_of(&passes("t.csv", table.as_bytes()).unwrap_err());
        let places: Vec<_> = problems.iter().map(|p| [p.line, p.column].map(Option::unwrap)).collect();
        assert_eq!(places, [[3, 9], [4, 16], [5, 14], [5, 17], [6, 1]], "{problems:?}");
        assert!(problems[1].help.as_ref().unwrap().contains("positive in compression"), "{problems:?}");
        assert!(problems.iter().all(|p| p.help.is_some()));
        let good = passes("t.csv", format!("{HEAD}\n\"a,b\",0,0,0,0.02,1,0.25,0.1\n").as_bytes()).unwrap();
        assert_eq!(good[0].run.as_deref(), Some("a,b"));
    }

    #[test]
    fn of_very_many_faults_the_rest_is_counted() {
        let table = format!("{HEAD}\n{}", "x,1,1,0,fast,1,0.25,0.1\nx,4,2,0,0.02,1,-0.25,0.1\n".repeat(40));
        let problems = problems_of(&passes("t.csv", table.as_bytes()).unwrap_err());
        assert_eq!(problems.len(), FAULTS + 1);
        assert_eq!(problems[FAULTS].problem, "30 more cells or rows are at fault");
        let double = "point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,point\n";
        let problems = problems_of(&passes("t.csv", double.as_bytes()).unwrap_err());
        assert_eq!((problems[0].line, problems[0].column), (Some(1), Some(64)), "{problems:?}");
    }
}

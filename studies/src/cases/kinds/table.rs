//! One node of the shipped surrogate's table a case, then those held out to judge it.

use super::{Case, CaseKind, Cell, flag, no_lines, number};
use crate::cases::file::Header;
use crate::cases::run::Entry;
use miette::bail;
use models::ridge::{self, study};
use models::surrogate::{GridPoint, SurrogateGrid, TableResult};

/// The kind.
pub const KIND: CaseKind = CaseKind {
    name: "table",
    words: "a node of the surrogate's table, as `muprime model table --surrogate` computes it",
    model: study::MODEL_VERSION,
    columns: &[
        flag("at_rest", "a case at rest, for phase and contact"),
        number("mu_relative", "mu'"),
        number("phase_shift_deg", "phase shift of Eq. 1"),
        number("contact_fraction", "share of the time in contact"),
        flag("steady", "whether the cycles became steady"),
    ],
    prepare,
};

/// Cases that are not in the table, on which it is judged.
pub const HELD_OUT: usize = 200;

/// The nodes, and after them those that are held out.
pub fn points() -> Vec<GridPoint> {
    let grid = SurrogateGrid::SHIPPED;
    [grid.points(), grid.held_out(HELD_OUT)].concat()
}

fn prepare(header: &Header, _: &std::path::Path) -> miette::Result<super::Make> {
    no_lines(header)?;
    let points = points();
    if header.cases > points.len() as u64 {
        bail!("{} cases: the table has {} nodes, held-out ones included", header.cases, points.len());
    }
    let settings = SurrogateGrid::settings();
    Ok(Box::new(move |index, _| {
        let GridPoint { case, at_rest, .. } = points[index as usize].clone();
        let run = move || {
            let run = ridge::run(&case, &settings).map_err(|why| why.to_string())?;
            Ok(vec![
                at_rest.into(),
                run.mu_relative.into(),
                run.phase_shift_deg.into(),
                run.contact_fraction.into(),
                run.steady.into(),
            ])
        };
        let inputs = format!("{at_rest} {}", super::ridge::inputs_of(&case, &settings));
        Ok(Case { inputs, run: Box::new(run) })
    }))
}

/// What the surrogate's table holds of a case; none where it has no result.
pub fn result(entry: &Entry) -> Option<TableResult> {
    let [_, Cell::Number(mu_relative), phase, Cell::Number(contact_fraction), _] =
        entry.outcome.as_ref().ok()?.as_slice()
    else {
        return None;
    };
    let phase_shift_deg = if let Cell::Number(degrees) = phase { *degrees } else { 0.0 };
    Some(TableResult { mu_relative: *mu_relative, phase_shift_deg, contact_fraction: *contact_fraction })
}

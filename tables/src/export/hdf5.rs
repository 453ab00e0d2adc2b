//! HDF5 in the manner of NeXus (<https://manual.nexusformat.org>): `/entry` is an `NXentry` with user, sample, instrument and
//! facts; `/entry/passes` an `NXdata` with a dataset a column, its `units` and `long_name`, mu' against amplitude as the default
//! plot. Missing numbers are NaN, missing counts the largest there is, missing text is empty; each dataset that has some says how
//! many (`missing`). The cycles are not here: `--to mcap` has them.

use super::columns::{Cells, Column, Table};
use super::facts::Facts;
use hdf5_pure::{AttrValue, FileBuilder, GroupBuilder};
use miette::IntoDiagnostic;

fn text(of: &str) -> AttrValue {
    AttrValue::VarLenString(of.to_string())
}

/// The file.
pub fn bytes(table: &Table, facts: &Facts) -> miette::Result<Vec<u8>> {
    let mut file = FileBuilder::new();
    file.set_attr("NX_class", text("NXroot"));
    file.set_attr("default", text("entry"));
    file.set_attr("creator", text(concat!("muprime ", env!("CARGO_PKG_VERSION"))));
    let mut entry = file.create_group("entry");
    entry.set_attr("NX_class", text("NXentry"));
    entry.set_attr("default", text("passes"));
    for (name, fact) in [("title", "plan"), ("start_time", "date"), ("program_name", "muprime_version")] {
        put_fact(&mut entry, name, facts.get(fact));
    }
    for (group, class, known) in [
        ("user", "NXuser", &[("name", "operator")][..]),
        ("sample", "NXsample", &[("name", "sample"), ("description", "fingertip")]),
        ("instrument", "NXinstrument", &[("name", "setup"), ("devices", "instruments")]),
    ] {
        let mut group = entry.create_group(group);
        group.set_attr("NX_class", text(class));
        known.iter().for_each(|(name, fact)| put_fact(&mut group, name, facts.get(*fact)));
        entry.add_group(group.finish());
    }
    let mut all = entry.create_group("facts");
    all.set_attr("NX_class", text("NXcollection"));
    facts.iter().for_each(|(name, fact)| put_fact(&mut all, name, Some(fact)));
    entry.add_group(all.finish());

    let mut passes = entry.create_group("passes");
    passes.set_attr("NX_class", text("NXdata"));
    passes.set_attr("signal", text("mu_relative"));
    passes.set_attr("axes", text("amplitude_pp_m"));
    table.iter().for_each(|column| put(&mut passes, column));
    entry.add_group(passes.finish());
    file.add_group(entry.finish());
    file.finish().into_diagnostic()
}

fn put_fact(group: &mut GroupBuilder, name: &str, fact: Option<&String>) {
    if let Some(fact) = fact {
        group.create_dataset(name).with_vlen_strings(&[fact]).with_shape(&[]);
    }
}

fn put(group: &mut GroupBuilder, column: &Column) {
    let dataset = group.create_dataset(column.name);
    match &column.cells {
        Cells::Numbers(v) => {
            dataset.with_f64_data(&v.iter().map(|v| v.unwrap_or(f64::NAN)).collect::<Vec<_>>());
        }
        Cells::Counts(v) => {
            dataset.with_u64_data(&v.iter().map(|v| v.unwrap_or(u64::MAX)).collect::<Vec<_>>());
        }
        Cells::Texts(v) => {
            let values: Vec<&str> = v.iter().map(|v| v.as_deref().unwrap_or_default()).collect();
            dataset.with_vlen_strings(&values);
        }
    }
    let missing = (0..column.rows()).filter(|row| column.shown(*row).is_none()).count();
    dataset.set_attr("long_name", text(column.words));
    if let Some(unit) = column.unit() {
        // The empty unit is NeXus's word for a number without one.
        dataset.set_attr("units", text(if unit == "1" { "" } else { unit }));
    }
    if missing > 0 {
        dataset.set_attr("missing", AttrValue::U64(missing as u64));
        if matches!(column.cells, Cells::Counts(_)) {
            dataset.set_attr("_FillValue", AttrValue::U64(u64::MAX));
        }
    }
}

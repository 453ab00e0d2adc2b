//! What a case can be. Add one: a file here, and a line in [`KINDS`].

pub mod blind;
pub mod diagnose;
pub mod faults;
pub mod finger;
pub mod noop;
pub mod ridge;
pub mod table;

use super::file::Header;
use miette::IntoDiagnostic;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::path::Path;

/// All kinds.
pub const KINDS: [&CaseKind; 7] =
    [&ridge::KIND, &table::KIND, &faults::KIND, &blind::KIND, &diagnose::KIND, &finger::KIND, &noop::KIND];

/// What a cell of a result holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    /// A number with a unit.
    Number,
    /// A whole number.
    Count,
    /// Yes or no.
    Flag,
    /// Words, or a JSON document.
    Text,
}

/// A column of a kind's results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name, ending with the unit.
    pub name: &'static str,
    /// What it holds.
    pub cells: Type,
    /// What it is.
    pub words: &'static str,
}

/// A cell.
#[derive(Clone, Debug)]
pub enum Cell {
    /// Of a column of numbers.
    Number(f64),
    /// Of a column of whole numbers.
    Count(u64),
    /// Of a column of flags.
    Flag(bool),
    /// Of a column of text.
    Text(String),
    /// There is none.
    Missing,
}

/// Equal to the last bit.
impl PartialEq for Cell {
    fn eq(&self, other: &Cell) -> bool {
        match (self, other) {
            (Cell::Number(a), Cell::Number(b)) => a.to_bits() == b.to_bits(),
            (Cell::Count(a), Cell::Count(b)) => a == b,
            (Cell::Flag(a), Cell::Flag(b)) => a == b,
            (Cell::Text(a), Cell::Text(b)) => a == b,
            (Cell::Missing, Cell::Missing) => true,
            _ => false,
        }
    }
}

macro_rules! cells {
    ($($of:ty => $cell:ident $column:ident,)+) => {
        $(
            impl From<$of> for Cell {
                fn from(value: $of) -> Cell {
                    Cell::$cell(value)
                }
            }

            const fn $column(name: &'static str, words: &'static str) -> Column {
                Column { name, cells: Type::$cell, words }
            }
        )+
    };
}

cells! {
    f64 => Number number,
    u64 => Count count,
    bool => Flag flag,
    String => Text text,
}

impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Cell {
        value.map_or(Cell::Missing, Into::into)
    }
}

/// What came of a case: its cells in the order of the kind's columns, or why there are none.
pub type Outcome = Result<Vec<Cell>, String>;

/// One case, ready to be run.
pub struct Case {
    /// All that its result depends on, but for the version: what the key is made of.
    pub inputs: String,
    /// Runs it. The outcome depends on nothing but the inputs: no clock, no host, no number of threads.
    pub run: Box<dyn FnOnce() -> Outcome + Send>,
}

/// Makes a case of its index and its line.
pub type Make = Box<dyn Fn(u64, Option<&Value>) -> miette::Result<Case> + Send + Sync>;

/// A kind of case.
pub struct CaseKind {
    /// Name in the header of a file of cases.
    pub name: &'static str,
    /// What it is.
    pub words: &'static str,
    /// Number that is raised whenever the model behind the kind changes its results.
    pub model: u32,
    /// Columns of its results.
    pub columns: &'static [Column],
    /// Reads the settings of the header; the folder is that of the file of cases, for paths in its lines.
    pub prepare: fn(&Header, &Path) -> miette::Result<Make>,
}

impl CaseKind {
    /// Version of the program and of the model: part of every key.
    pub fn version(&self) -> String {
        format!("muprime {}, {} {}", env!("CARGO_PKG_VERSION"), self.name, self.model)
    }

    /// The key of a case: SHA-256 over the kind's version and the inputs.
    pub fn key(&self, inputs: &str) -> [u8; 32] {
        let mut hash = Sha256::new();
        hash.update(self.version().as_bytes());
        hash.update(b"\n");
        hash.update(inputs.as_bytes());
        hash.finalize().into()
    }
}

/// The kind of that name.
///
/// # Errors
/// There is none.
pub fn by_name(name: &str) -> miette::Result<&'static CaseKind> {
    KINDS.into_iter().find(|k| k.name == name).ok_or_else(|| {
        let names: Vec<&str> = KINDS.iter().map(|k| k.name).collect();
        miette::miette!("no kind of case '{name}': there are {}", names.join(", "))
    })
}

/// The settings of a header as a type; unknown keys are refused where the type says so.
fn settings<T: serde::de::DeserializeOwned + Default>(header: &Header) -> miette::Result<T> {
    if header.settings.is_null() {
        return Ok(T::default());
    }
    serde_json::from_value(header.settings.clone())
        .map_err(|why| miette::miette!("settings of the {} cases: {why}", header.kind))
}

/// A line as a type.
fn line<T: serde::de::DeserializeOwned>(index: u64, line: Option<&Value>) -> miette::Result<T> {
    let value =
        line.ok_or_else(|| miette::miette!("case {index} has no line: the header must say `listed`"))?;
    T::deserialize(value).map_err(|why| miette::miette!("case {index}: {why}"))
}

/// Refuses lines for cases that follow from the settings.
fn no_lines(header: &Header) -> miette::Result<()> {
    if header.listed {
        miette::bail!("cases of the kind {} follow from the settings: no line a case", header.kind);
    }
    Ok(())
}

/// A unit variant as its JSON has it.
fn word(of: impl serde::Serialize) -> Result<String, String> {
    let value = serde_json::to_value(of).map_err(|e| e.to_string())?;
    Ok(value.as_str().map_or_else(|| value.to_string(), str::to_string))
}

/// What the last cell of a kind with a column `document` holds.
fn document<T: serde::de::DeserializeOwned>(cells: &[Cell]) -> miette::Result<T> {
    let Some(Cell::Text(text)) = cells.last() else { miette::bail!("a result without its document") };
    serde_json::from_str(text).into_diagnostic()
}

//! Which column of the source is what: stated by `--map` and `--set`, or guessed from the headers.

use super::grid::{Block, Grid};
use super::targets::{ColumnKind, Id, TARGETS, Target};
use super::units::{Dimension, Unit};

mod doubts;

pub use doubts::contradicted;

/// What is wrong with an entry of `--map` or `--set`, or with the map under a second header (in row `row`).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum MapError {
    #[error("'{0}': HEADER=TARGET:UNIT is needed")]
    MapEntry(String),
    #[error("'{0}' is not a target; there are {known}", known = names())]
    Target(String),
    #[error("'{name}' has no unit ('{unit}')")]
    Unitless { name: String, unit: String },
    #[error("'{unit}' is not a unit of {name}; there are {}", .dimension.known())]
    Unit { name: String, unit: String, dimension: Dimension },
    #[error("'{name}' needs a unit, as in {name}:{}; there are {}", .dimension.si(), .dimension.known())]
    NeedsUnit { name: String, dimension: Dimension },
    #[error("the table has no column '{header}'; it has {there}")]
    NoColumn { header: String, there: String },
    #[error("several columns are called '{0}'; name them by number, as in #3")]
    SeveralColumns(String),
    #[error("--set {0}: NAME=VALUE is needed")]
    SetEntry(String),
    #[error("--set {0}: no such target; there are {known}", known = names())]
    SetTarget(String),
    #[error("--set {name}: '{value}' cannot be read")]
    SetValue { name: String, value: String },
    #[error("--set {0}: a count differs from row to row")]
    SetCount(String),
    #[error("--set {name}: '{unit}' is not a unit; there are {}", .dimension.known())]
    SetUnit { name: String, unit: String, dimension: Dimension },
    #[error("row {row} is a second header, without a column '{header}'")]
    NotUnder { row: u64, header: String },
    #[error("row {row} is a second header, with another unit of '{header}' ('{other}')")]
    OtherUnit { row: u64, header: String, other: String },
}

/// A column of the source that is taken.
#[derive(Clone, Debug)]
pub struct Taken {
    /// Place in the source.
    pub index: usize,
    /// Its header.
    pub header: String,
    /// Place of its target in [`TARGETS`].
    pub target: usize,
    /// Its unit as stated; empty for what has none.
    pub unit_text: String,
    /// Its unit.
    pub unit: Unit,
    /// The SI unit was assumed: the header states none.
    pub assumed: bool,
}

/// A value that holds for every row.
#[derive(Clone, Debug)]
pub struct Constant {
    /// Place of its target in [`TARGETS`].
    pub target: usize,
    /// As it was written.
    pub text: String,
    /// SI; NaN for text.
    pub value: f64,
}

/// What is taken from where.
#[derive(Clone, Debug, Default)]
pub struct Map {
    /// Columns.
    pub columns: Vec<Taken>,
    /// Constants.
    pub constants: Vec<Constant>,
    /// Time is the number of the row, in s.
    pub time_by_rows: bool,
}

impl Map {
    /// Whether a target is mapped or set.
    pub fn has(&self, id: Id) -> bool {
        let at = id as usize;
        self.columns.iter().any(|c| c.target == at) || self.constants.iter().any(|c| c.target == at)
    }

    /// Whether a column of the point table is mapped or set.
    pub fn gives(&self, column: &str) -> bool {
        let targets = self.columns.iter().map(|c| c.target).chain(self.constants.iter().map(|c| c.target));
        targets.into_iter().any(|t| TARGETS[t].column == column)
    }

    /// The map as `--map` takes it.
    pub fn written(&self) -> String {
        let entry = |c: &Taken| {
            let special = c.header.contains([',', '=', '"', ' ', '\'']);
            let header = if special { format!("\"{}\"", c.header) } else { c.header.clone() };
            let unit = if c.unit_text.is_empty() { String::new() } else { format!(":{}", c.unit_text) };
            format!("{header}={}{unit}", TARGETS[c.target].name)
        };
        self.columns.iter().map(entry).collect::<Vec<_>>().join(", ")
    }

    /// The headers that entries of `--map` name.
    pub fn headers(entries: &[String]) -> Vec<String> {
        let header = |e: String| Some(e.rsplit_once('=')?.0.trim().to_string());
        entries.iter().flat_map(|e| parted(e)).filter_map(header).collect()
    }

    /// Reads the entries of `--map`: `HEADER=TARGET[:UNIT]`, parted by commas; a header with a comma in
    /// double quotes; `#3` is the third column.
    ///
    /// # Errors
    /// Everything that is wrong with them at once.
    pub fn stated(grid: &Grid, entries: &[String]) -> Result<Vec<Taken>, Vec<MapError>> {
        let (mut taken, mut wrong) = (Vec::new(), Vec::new());
        for entry in entries.iter().flat_map(|e| parted(e)) {
            match column(grid, &entry) {
                Ok(column) => taken.push(column),
                Err(why) => wrong.push(why),
            }
        }
        if wrong.is_empty() { Ok(taken) } else { Err(wrong) }
    }

    /// Reads `--set NAME=VALUE[:UNIT]`, into the map.
    ///
    /// # Errors
    /// Everything that is wrong at once.
    pub fn set(&mut self, entries: &[String]) -> Result<(), Vec<MapError>> {
        let mut wrong = Vec::new();
        for entry in entries.iter().flat_map(|e| parted(e)) {
            match constant(&entry) {
                Ok(None) => self.time_by_rows = true,
                Ok(Some(constant)) => self.constants.push(constant),
                Err(why) => wrong.push(why),
            }
        }
        if wrong.is_empty() { Ok(()) } else { Err(wrong) }
    }

    /// The places of all targets that are mapped or set.
    fn targets(&self) -> Vec<usize> {
        self.columns.iter().map(|c| c.target).chain(self.constants.iter().map(|c| c.target)).collect()
    }

    /// Columns of the point table that are given more than once, in sentences; [`ONCE`] is the remedy.
    pub fn twice(&self) -> Vec<String> {
        let (mut wrong, all) = (Vec::new(), self.targets());
        for (k, target) in TARGETS.iter().enumerate() {
            let same = |t: &&usize| TARGETS[**t].column == target.column;
            let first = TARGETS.iter().position(|t| t.column == target.column);
            if first == Some(k) && all.iter().filter(same).count() > 1 {
                wrong.push(format!("{} is given more than once", target.column));
            }
        }
        if self.has(Id::Velocity) && self.has(Id::Direction) {
            wrong.push("the sign of `velocity` is the direction: map one of velocity and direction".into());
        }
        if self.time_by_rows && self.has(Id::Time) {
            wrong.push("time_s is mapped and set".into());
        }
        wrong
    }

    /// Whether the plate vibrates in some row, as far as amplitudes are given.
    fn vibrates(&self, grid: &Grid) -> bool {
        let is_amplitude = |target: usize| TARGETS[target].column == Id::AmplitudePp.target().column;
        let value = |c: &Taken, r| c.unit.apply(&grid.cell(r, c.index)?.digits(grid.comma)?);
        let in_rows = |c: &Taken| grid.rows.iter().any(|r| value(c, r).is_some_and(|a| a > 0.0));
        self.constants.iter().any(|c| is_amplitude(c.target) && c.value > 0.0)
            || self.columns.iter().any(|c| is_amplitude(c.target) && in_rows(c))
    }

    /// All columns of the point table that are missing, with what would give each. The position of a series
    /// gives speed and direction as well; a plate that stands still needs no frequency.
    pub fn lacks(&self, grid: &Grid, series: bool) -> Vec<String> {
        let (mut wrong, all) = (Vec::new(), self.targets());
        let gives = |column: &str| all.iter().any(|t| TARGETS[*t].column == column);
        let by_path = series && gives("position_m");
        let still = gives("amplitude_pp_m") && !self.vibrates(grid);
        let needed = [
            (
                "time_s",
                self.time_by_rows,
                if series {
                    "HEADER=time:s, or of a column that counts the samples HEADER=time:0.01s (every 0.01 s)"
                } else {
                    "HEADER=time:s, or --set time_s=rows (row after row, a second each)"
                },
            ),
            (
                "amplitude_pp_m",
                false,
                "HEADER=amplitude_pp:um (or amplitude_peak, amplitude_rms), or --set amplitude_pp_m=0 where nothing vibrates",
            ),
            (
                "frequency_hz",
                still,
                "HEADER=frequency:kHz, or --set frequency_hz=27500; without vibration none is needed",
            ),
            (
                "speed_m_s",
                by_path,
                "HEADER=speed:mm/s, HEADER=velocity:mm/s (with a sign), or --set speed_m_s=0.01",
            ),
            (
                "direction",
                by_path || self.has(Id::Velocity),
                "HEADER=direction, a velocity with a sign, or --set direction=1",
            ),
            ("normal_force_n", false, "HEADER=normal_force:N, or --set normal_force_n=0.25"),
            (
                "lateral_force_n",
                false,
                "HEADER=lateral_force:N (with a sign), friction_force:N or friction_coefficient (magnitudes)",
            ),
        ];
        for (column, otherwise, how) in needed {
            if !gives(column) && !otherwise {
                let path = column == "speed_m_s" && gives("position_m");
                let more =
                    if path { ", or --series if the rows are samples of a record in time" } else { "" };
                let open = doubts::open(self, grid, column);
                wrong.push(format!("{column} is missing: {how}{more}{open}"));
            }
        }
        wrong.extend(self.columns.iter().filter_map(|c| doubts::signed(c, grid)));
        wrong
    }
}

/// What cures a column that is given more than once.
pub const ONCE: &str = "keep one of them: name it in --map, and leave the other out of --map and --set";

/// Entries at commas outside of double quotes.
fn parted(text: &str) -> Vec<String> {
    let (mut all, mut now, mut quoted) = (Vec::new(), String::new(), false);
    for c in text.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => all.push(std::mem::take(&mut now)),
            c => now.push(c),
        }
    }
    all.push(now);
    all.iter().map(|e| e.trim().to_string()).filter(|e| !e.is_empty()).collect()
}

fn names() -> String {
    TARGETS.iter().map(|t| t.name).collect::<Vec<_>>().join(", ")
}

/// The target and the unit of `TARGET[:UNIT]`. The name of a column of the point table states its unit; of
/// any other it may be `written` in the source beyond doubt.
fn target_of(text: &str, written: Option<&str>) -> Result<(usize, Unit, String), MapError> {
    let (name, unit_text) =
        text.split_once(':').map_or((text.trim(), None), |(n, u)| (n.trim(), Some(u.trim())));
    let own = || name.to_string();
    let at = Target::named(name).ok_or_else(|| MapError::Target(own()))?;
    let target = &TARGETS[at];
    let ColumnKind::Number(dimension) = target.kind else {
        return match unit_text {
            Some(unit) => Err(MapError::Unitless { name: own(), unit: unit.into() }),
            None => Ok((at, Unit::SI, String::new())),
        };
    };
    let by_column = name == target.column && name != target.name;
    let bare = matches!(dimension, Dimension::Ratio) || by_column;
    match unit_text {
        Some(text) => {
            let unknown = || MapError::Unit { name: own(), unit: text.into(), dimension };
            Ok((at, Unit::parse(dimension, text).ok_or_else(unknown)?, text.to_string()))
        }
        None if bare => Ok((at, Unit::SI, dimension.si().to_string())),
        None => written
            .and_then(|w| Unit::guess(dimension, w).filter(|(_, u)| Unit::parse(dimension, w) == Some(*u)))
            .map(|(text, unit)| (at, unit, text))
            .ok_or_else(|| MapError::NeedsUnit { name: own(), dimension }),
    }
}

fn column(grid: &Grid, entry: &str) -> Result<Taken, MapError> {
    let (header, rest) = entry.rsplit_once('=').ok_or_else(|| MapError::MapEntry(entry.into()))?;
    let header = header.trim();
    // Within the one group that is read its columns have short names.
    let last = header.rsplit('/').next().unwrap_or(header);
    let header =
        if !grid.within.is_empty() && *header == format!("{}{last}", grid.within) { last } else { header };
    let numbered = header.strip_prefix('#').and_then(|n| n.parse::<usize>().ok());
    let exact: Vec<usize> = (0..grid.header.len()).filter(|k| grid.header[*k] == header).collect();
    // A map that was copied from a terminal may be broken over lines within a header.
    let squeezed = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let wanted = squeezed(header);
    let alike: Vec<usize> =
        (0..grid.header.len()).filter(|k| squeezed(&grid.header[*k]).eq_ignore_ascii_case(&wanted)).collect();
    let index = match (&exact[..], &alike[..], numbered) {
        ([one], ..) | ([], [one], _) => *one,
        ([], [], Some(n)) if (1..=grid.header.len()).contains(&n) => n - 1,
        ([], [], _) => {
            let there = grid.header.iter().map(|h| format!("'{h}'")).collect::<Vec<_>>().join(", ");
            return Err(MapError::NoColumn { header: header.into(), there });
        }
        _ => return Err(MapError::SeveralColumns(header.into())),
    };
    let written = unit_row(&grid.units, index).or_else(|| stated(&grid.header[index]));
    let (target, unit, unit_text) = target_of(rest, written)?;
    Ok(Taken { index, header: grid.name(index), target, unit_text, unit, assumed: false })
}

fn constant(entry: &str) -> Result<Option<Constant>, MapError> {
    let (name, text) = entry.split_once('=').ok_or_else(|| MapError::SetEntry(entry.into()))?;
    let (name, text) = (name.trim(), text.trim());
    let (number, unit) = text.split_once(':').map_or((text, None), |(n, u)| (n.trim(), Some(u)));
    let at = Target::named(name).ok_or_else(|| MapError::SetTarget(name.into()))?;
    let target = &TARGETS[at];
    if at == Id::Time as usize && number == "rows" {
        return Ok(None);
    }
    let bad = || MapError::SetValue { name: name.into(), value: number.into() };
    let value = match target.kind {
        ColumnKind::Text => f64::NAN,
        ColumnKind::Way => way(number).ok_or_else(bad)?,
        ColumnKind::Count => return Err(MapError::SetCount(name.into())),
        ColumnKind::Number(dimension) => {
            // A value without a unit is SI, as the columns of the point table are.
            let unit = unit.unwrap_or(dimension.si());
            let unknown = || MapError::SetUnit { name: name.into(), unit: unit.into(), dimension };
            Unit::parse(dimension, unit).ok_or_else(unknown)?.apply(number).ok_or_else(bad)?
        }
    };
    Ok(Some(Constant { target: at, text: text.to_string(), value }))
}

/// A direction as people write it.
pub fn way(text: &str) -> Option<f64> {
    match text.trim().to_lowercase().as_str() {
        "forward" | "fwd" | "f" | "trace" | "vor" | "vorwärts" => return Some(1.0),
        "backward" | "bwd" | "b" | "retrace" | "reverse" | "rev" | "zurück" | "rückwärts" => {
            return Some(-1.0);
        }
        _ => {}
    }
    let value = Unit::SI.apply(text)?;
    (value.abs() == 1.0).then_some(value)
}

/// The map under another header of the source: the same columns, wherever they are there and whatever their
/// units. `None` where that header has none of them.
///
/// # Errors
/// A column that is missing there, units that are not stated in both places.
pub fn under(map: &Map, grid: &Grid, block: &Block) -> Result<Option<Map>, MapError> {
    let there = |c: &Taken| block.columns.get(c.index).copied().flatten();
    let here = map.columns.iter().filter(|c| there(c).is_some()).count();
    if here == 0 {
        return Ok(None);
    }
    let mut own = map.clone();
    for column in &mut own.columns {
        let (row, header) = (block.place, column.header.clone());
        let missing = || MapError::NotUnder { row, header: header.clone() };
        let index = there(column).ok_or_else(missing)?;
        let (was, is) = (unit_row(&grid.units, column.index), unit_row(&block.units, index));
        if grid.header[column.index] != block.header[index] || was != is {
            let ColumnKind::Number(dimension) = TARGETS[column.target].kind else {
                column.index = index;
                continue;
            };
            let stated = |header: &str, row: Option<&str>| match (stated(header), row) {
                (Some(unit), None) | (None, Some(unit)) => Unit::guess(dimension, unit),
                _ => None,
            };
            let first = stated(&grid.header[column.index], was);
            let second = stated(&block.header[index], is);
            match (first, second) {
                (Some((_, first)), Some((_, second))) if first == column.unit => column.unit = second,
                (Some((_, first)), Some((_, second))) if first == second => {}
                _ => return Err(MapError::OtherUnit { row, header, other: block.header[index].clone() }),
            }
        }
        column.index = index;
    }
    Ok(Some(own))
}

/// The unit of a column in a row of units.
pub fn unit_row(units: &[String], at: usize) -> Option<&str> {
    units.get(at).map(String::as_str).filter(|u| !u.is_empty())
}

/// The unit that a header states in brackets, or after a slash, a comma or 'in'.
pub fn stated(header: &str) -> Option<&str> {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((_, rest)) = header.split_once(open) {
            return rest.split(close).next();
        }
    }
    [" / ", ", ", " in ", "/"].iter().find_map(|mark| header.split_once(mark)).map(|(_, unit)| unit)
}

#[cfg(test)]
mod tests {
    use super::super::guess::guess;
    use super::super::text::{Marks, read};
    use super::*;

    fn guessed(text: &str) -> String {
        let grid = read(text.as_bytes(), Marks::default()).unwrap();
        Map { columns: guess(&grid, &Map::default()), ..Map::default() }.written()
    }

    #[test]
    fn headers_say_what_and_in_which_unit() {
        assert_eq!(
            guessed("t [s];w pp [µm];Freq (kHz);V_mm_s;dir;FN / mN;Ft N\n0;1,5;27,5;10;1;250;0,1\n"),
            "\"t [s]\"=time:s, \"w pp [µm]\"=amplitude_pp:um, \"Freq (kHz)\"=frequency:kHz, V_mm_s=speed:mm/s, \
             dir=direction, \"FN / mN\"=normal_force:mN, \"Ft N\"=lateral_force:N"
        );
        assert_eq!(
            guessed("TIME,AMP_UM,FREQ_KHZ,VEL_MM_S,LOAD_MN,FX_MN,COF\n0,1,27.5,-10,250,-100,0.4\n"),
            "TIME=time:s, AMP_UM=amplitude_pp:um, FREQ_KHZ=frequency:kHz, VEL_MM_S=velocity:mm/s, LOAD_MN=normal_force:mN, FX_MN=lateral_force:mN"
        );
        assert_eq!(guessed("fx,lateral,fn\n1,2,3\n"), "fn=normal_force:N", "two lateral forces");
    }

    #[test]
    fn entries_may_hold_commas_and_numbers_of_columns() {
        let grid = read(b"\"F, raw\",b\n1,2\n", Marks::default()).unwrap();
        let taken = Map::stated(&grid, &["\"F, raw\"=lateral_force:-mN, #2=speed_m_s".into()]).unwrap();
        assert_eq!((taken[0].index, taken[1].index), (0, 1));
        assert_eq!(taken[0].unit.apply("5"), Some(-0.005));
        // As a terminal breaks it.
        let broken = Map::stated(&grid, &["\"F,\n        raw\"=lateral_force:mN,\n  b=speed_m_s".into()]);
        assert_eq!(broken.unwrap().iter().map(|t| t.index).collect::<Vec<_>>(), [0, 1]);
        let wrong = Map::stated(&grid, &["c=speed:mm/s, b=speed, b=pace:s, b=speed:N".into()]).unwrap_err();
        assert_eq!(wrong.len(), 4, "{wrong:?}");
    }

    #[test]
    fn strokes_and_bare_letters() {
        for (header, expected) in [
            ("Amplitude (µm p-p)", "amplitude_pp:um"),
            ("Amplitude [um pp]", "amplitude_pp:um"),
            ("peak-to-peak amplitude (um)", "amplitude_pp:um"),
            ("Amplitude peak to peak / um", "amplitude_pp:um"),
            ("Amplitude peak-peak (um)", "amplitude_pp:um"),
            ("Amplitude (um, 0-p)", "amplitude_peak:um"),
            ("Amplitude (um rms)", "amplitude_rms:um"),
            ("Amplitude peak (um)", "amplitude_peak:um"),
            ("amp_um", "amplitude_pp:um"),
            ("f (kHz)", "frequency:kHz"),
        ] {
            let found = guessed(&format!("\"{header}\";b\n1;2\n"));
            assert!(found.ends_with(&format!("={expected}")), "{header}: {found}");
        }
        for header in ["F", "amp", "F (N)", "w", "Peak load (N)", "speed;rpm"] {
            let units = header.split_once(';').map_or(String::new(), |(_, unit)| format!("{unit};N\n"));
            let name = header.split(';').next().unwrap();
            assert_eq!(
                guessed(&format!("{name};Fn (N)\n{units}2;5\n")),
                "\"Fn (N)\"=normal_force:N",
                "{header}"
            );
        }
    }

    #[test]
    fn all_that_is_missing_is_told_at_once() {
        let mut map = Map::default();
        let lacks = |map: &Map| map.lacks(&Grid::default(), false);
        assert_eq!(lacks(&map).len(), 7);
        map.set(&["time_s=rows, direction=forward, speed=10:mm/s".into()]).unwrap();
        assert_eq!(map.constants[1].value, 0.01);
        assert_eq!(lacks(&map).len(), 4, "{:?}", lacks(&map));
    }
}

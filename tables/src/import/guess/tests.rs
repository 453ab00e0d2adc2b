//! What may not be guessed, and tables that would become wrong passes without a word.

use super::guess;
use crate::import::grid::Cell;
use crate::import::map::Map;
use crate::import::{Cut, Imported, Marks, Wanted, import, read};
use std::fmt::Write;
use std::path::Path;

/// Imports a text with a map that is completed by the guess; a refusal with its remedy.
pub fn imported(text: &str, map: &str, set: &str, series: bool) -> Result<Imported, String> {
    let told = |e: miette::Report| format!("{e}\n{}", e.help().map(|h| h.to_string()).unwrap_or_default());
    let (path, bytes) = (Path::new("a.csv"), text.as_bytes());
    let grid = read(path, bytes, None, Marks::default(), &[]).map_err(told)?;
    let mut all = Map::default();
    all.set(&[set.into()]).map_err(|e| format!("{e:?}"))?;
    all.columns = Map::stated(&grid, &[map.into()]).map_err(|e| format!("{e:?}"))?;
    all.columns.extend(guess(&grid, &all));
    let series = series.then(Cut::default);
    import("a.csv", bytes, &grid, &Wanted { map: all, series, ..Wanted::default() }).map_err(told)
}

/// A table of 24 passes: `{t}`, `{v}` (mm/s) and `{fx}` with their signs, `{mu}`, `{smu}` with the sign of
/// the direction and `{k}` stand for their values.
pub fn table(header: &str, row: &str) -> String {
    let mut text = format!("{header}\n");
    for k in 0..24 {
        let (way, mu) = (if k % 2 == 0 { 1.0 } else { -1.0 }, 0.4 + 0.01 * f64::from(k % 3));
        let values = [
            ("{t}", (2 * k).to_string()),
            ("{v}", format!("{}", way * 20.0)),
            ("{fx}", format!("{:.4}", way * mu * 0.25)),
            ("{mu}", format!("{mu:.2}")),
            ("{smu}", format!("{:.2}", way * mu)),
            ("{k}", k.to_string()),
        ];
        let line = values.iter().fold(row.to_string(), |line, (name, value)| line.replace(name, value));
        writeln!(text, "{line}").unwrap();
    }
    text
}

/// A whole table but for the columns that a test is about.
fn beside(header: &str, row: &str) -> Result<Imported, String> {
    let text = table(&format!("t (s);v (mm/s);{header}"), &format!("{{t}};{{v}};{row}"));
    imported(&text, "", "amplitude_pp=0", false)
}

fn targets(header: &str) -> String {
    let grid =
        read(Path::new("a.csv"), format!("{header};b\n1;2\n3;4\n").as_bytes(), None, Marks::default(), &[]);
    Map { columns: guess(&grid.unwrap(), &Map::default()), ..Map::default() }.written()
}

#[test]
fn a_deviation_or_an_extreme_is_not_the_quantity() {
    for header in [
        "Std. load (N)",
        "Max. speed (mm/s)",
        "std.Fx (N)",
        "Fz (N) SD",
        "Fz [N] max",
        "Std.-Abw. Fz (N)",
        "StdDev.load (N)",
        "Min.speed (mm/s)",
    ] {
        assert_eq!(targets(header), "", "{header}");
    }
    for (header, target) in [
        ("Mean load (N)", "\"Mean load (N)\"=normal_force:N"),
        ("Avg. speed (mm/s)", "\"Avg. speed (mm/s)\"=speed:mm/s"),
        ("fn_sd (N)", "\"fn_sd (N)\"=normal_force_sd:N"),
        ("rig.Fx (N)", "\"rig.Fx (N)\"=lateral_force:N"),
        ("speed_mm_min", "speed_mm_min=speed:mm/min"),
        ("Zeit in min", "\"Zeit in min\"=time:min"),
    ] {
        assert_eq!(targets(header), target, "{header}");
    }
}

#[test]
fn letters_that_are_not_latin_are_not_passed_over() {
    assert_eq!(targets("摩耗 w (µm)"), "");
    assert_eq!(targets("Δx (mm)"), "");
    assert_eq!(targets("x (µm)"), "\"x (µm)\"=position:um");
}

#[test]
fn signs_are_units_too() {
    for header in ["Load [%]", "Load (%)", "Load / %", "Load_%", "Position [°]", "Fx [Ω]", "Speed [-]"] {
        assert_eq!(targets(header), "", "{header}");
    }
    for (header, target) in [
        ("Friction [-]", "\"Friction [-]\"=friction_coefficient:-"),
        ("Friction (1)", "\"Friction (1)\"=friction_coefficient:1"),
        ("Friction [%]", "\"Friction [%]\"=friction_coefficient:%"),
        ("Friction [N]", "\"Friction [N]\"=friction_force:N"),
        ("COF [–]", "\"COF [–]\"=friction_coefficient:–"),
        ("Direction [-]", "\"Direction [-]\"=direction"),
    ] {
        assert_eq!(targets(header), target, "{header}");
    }
    let made = beside("Load (N);Friction [-]", "0.25;{mu}").unwrap();
    assert_eq!(made.log.ranges.last().unwrap().low_median_high[2], 0.42 * 0.25);
    let said = beside("Load [%];Fx (N)", "25;{fx}").unwrap_err();
    assert!(said.contains("'Load [%]' was left open: '%' is not a unit of normal_force"), "{said}");
    // Beside a row of units a friction without one is left open.
    let said = imported(
        &table("Time;Velocity;Load;Friction\ns;mm/s;N;-", "{t};{v};0.25;{mu}"),
        "",
        "amplitude_pp=0",
        false,
    );
    assert!(said.unwrap_err().contains("lateral_force_n is missing"));
}

#[test]
fn a_number_in_a_header_is_no_factor() {
    let said = beside("Fz (5 N);Fx (N)", "0.25;{fx}").unwrap_err();
    assert!(said.contains("'Fz (5 N)' was left open: '5 N' is not a unit"), "{said}");
    let text = table("t (s);v (mm/s);Fz (5 N);Fx (N)", "{t};{v};0.25;{fx}");
    let said = imported(&text, "Fz (5 N)=normal_force", "amplitude_pp=0", false).unwrap_err();
    assert!(said.contains("NeedsUnit"), "{said}");
    // What the map states counts.
    let made = imported(&text, "Fz (5 N)=normal_force:5N", "amplitude_pp=0", false).unwrap();
    assert!(made.log.ranges.iter().any(|r| r.column == "normal_force_n" && r.low_median_high[1] == 1.25));
}

#[test]
fn an_assumed_unit_is_in_the_log() {
    let made = beside("Fz;Fx (N)", "0.25;{fx}").unwrap();
    assert_eq!(made.log.remarks, ["Fz: no unit stated, N assumed"]);
}

#[test]
fn a_coefficient_with_both_signs_is_refused() {
    let said = beside("Fz (N);COF", "0.25;{smu}").unwrap_err();
    assert!(
        said.contains("COF: 12 of 24 values are negative") && said.contains("lateral_force:5N"),
        "{said}"
    );
    let text = table("t (s);v (mm/s);Fz (N);COF", "{t};{v};0.25;{smu}");
    let made = imported(&text, "COF=lateral_force:0.25N", "amplitude_pp=0", false).unwrap();
    assert_eq!(made.log.remarks, [""; 0]);
    let said = imported(&text, "COF=friction_force:N", "amplitude_pp=0", false).unwrap_err();
    assert!(said.contains("map it as lateral_force"), "{said}");
}

#[test]
fn a_count_of_the_amplitude_that_contradicts_the_header_is_remarked_on() {
    for (header, says) in [
        ("A rms (um)", "amplitude_rms"),
        ("A 0-pk (um)", "amplitude_peak"),
        ("A zero-to-peak (um)", "amplitude_peak"),
        ("A peak (um)", "amplitude_peak"),
    ] {
        let text = table(&format!("t (s);v (mm/s);Fz (N);Fx (N);{header}"), "{t};{v};0.25;{fx};1.5");
        let of = |target: &str| {
            let map = format!("{header}={target}:um");
            imported(&text, &map, "frequency=27.5:kHz", false).unwrap().log.remarks.concat()
        };
        let said = of("amplitude_pp");
        assert!(said.contains(&format!("the header says {says}, the map says amplitude_pp")), "{said}");
        assert_eq!(of(says), "");
    }
}

#[test]
fn rows_without_the_name_of_their_run_are_remarked_on() {
    let text = table("Run;t (s);v (mm/s);Fz (N);Fx (N)", ";{t};{v};0.25;{fx}");
    let text = text.replacen("\n;0;", "\nR0;0;", 1).replacen("\n;24;", "\nR1;24;", 1);
    let said = imported(&text, "", "amplitude_pp=0", false).unwrap().log.remarks.concat();
    assert!(said.contains("Run: 22 of 24 rows name no run (first row 3)"), "{said}");
}

#[test]
fn a_speed_a_thousand_times_too_large_is_remarked_on() {
    let text = table("t (s);v;Fz (N);Fx (N)", "{t};{v};0.25;{fx}");
    let said = imported(&text, "v=velocity:m/s", "amplitude_pp=0", false).unwrap().log.remarks.concat();
    assert!(said.contains("speed_m_s: 20000 mm/s is a thousand times too large"), "{said}");
}

#[test]
fn a_factor_behind_the_unit_leaves_a_column_open() {
    for header in [
        "Fx [N] x10",
        "Fx [N] (gain 10)",
        "Fz [N] (x100)",
        "Amplitude pp [um] /10",
        "Fz [N]*1000",
        "Fz (N) × 2",
    ] {
        assert_eq!(targets(header), "", "{header}");
    }
    assert_eq!(targets("Fz [N] (left)"), "\"Fz [N] (left)\"=normal_force:N");
    let said = beside("Fz (N);Fx [N] x10", "0.25;{fx}").unwrap_err();
    assert!(said.contains("'Fx [N] x10' was left open: '[N] x10' is not a unit of lateral_force"), "{said}");
    let said = beside("Fz (comp. +) [mN];Fx [N]", "0.25;{fx}").unwrap_err();
    assert!(said.contains("was left open: 'comp. +' is not a unit of normal_force"), "{said}");
}

/// A spreadsheet makes 1.35 a day in January 2035.
#[test]
fn a_number_that_became_a_date_is_shown_as_that_date() {
    let text = table("t (s);v (mm/s);Fz (N);Fx (N)", "{t};{v};0.25;{fx}");
    let mut grid = read(Path::new("a.csv"), text.as_bytes(), None, Marks::default(), &[]).unwrap();
    grid.format = "workbook, sheet 'A'".into();
    grid.rows[3].cells[2] = Cell::Clock(4_260_384_000.0);
    let mut map = Map::default();
    map.set(&["amplitude_pp=0".into()]).unwrap();
    map.columns = guess(&grid, &map);
    let log = import("a.xlsx", b"", &grid, &Wanted { map, ..Wanted::default() }).unwrap().log;
    let reason = &log.dropped[0].reason;
    assert!(reason.contains("the spreadsheet made a date of it, 2035-01-01"), "{reason}");
}

#[test]
fn a_choice_is_left_to_the_reader_and_named() {
    let said = beside("Fz (N);Fx (N);Fy (N)", "0.25;0.01;{fx}").unwrap_err();
    assert!(said.contains("'Fx (N)' or 'Fy (N)': map one of them"), "{said}");
    let said = beside("Load (N);Fz (N);Fx (N)", "0.25;0.25;{fx}").unwrap_err();
    assert!(said.contains("'Load (N)' or 'Fz (N)': map one of them"), "{said}");
    let said = beside("Fz (N);Fx (N);Fx (N)", "0.25;{fx};{fx}").unwrap_err();
    assert!(said.contains("'#4' or '#5': map one of them"), "{said}");
    assert_eq!(targets("Fy (N)"), "\"Fy (N)\"=lateral_force:N");
}

#[test]
fn the_pressure_of_a_contact_is_not_that_of_the_air() {
    for header in ["Pressure [kPa]", "Pressure [MPa]", "Contact pressure [kPa]"] {
        assert_eq!(targets(header), "", "{header}");
    }
    assert_eq!(targets("Air pressure [kPa]"), "\"Air pressure [kPa]\"=ambient_pressure:kPa");
}

/// Air is judged by its largest value: a vacuum of some kPa is one, 101.3 and 1013 are no pascals.
#[test]
fn a_pressure_in_other_units_and_a_humidity_as_a_ratio_are_remarked_on() {
    let said = |header: &str, air: &str| {
        let text = table(
            &format!("t (s);v (mm/s);Fz (N);Fx (N);{header}"),
            &format!("{{t}};{{v}};0.25;{{fx}};{air}"),
        );
        let text = text.replacen(air, "0.001", 1);
        imported(&text, "", "amplitude_pp=0", false).unwrap().log.remarks.concat()
    };
    let kilo = said("Ambient pressure [Pa]", "101.3");
    assert!(kilo.contains("ambient_pressure_pa: 0.101 kPa is a thousand times too small"), "{kilo}");
    let hecto = said("Ambient pressure [Pa]", "1013");
    assert!(hecto.contains("ambient_pressure_pa: 1.01 kPa is a hundred times too small"), "{hecto}");
    for right in ["101325", "50660", "3000"] {
        assert_eq!(said("Ambient pressure [Pa]", right), "", "{right}");
    }
    let ratio = said("RH [%]", "0.45");
    assert!(ratio.contains("relative_humidity_pct: 0.45 % is a hundred times too small"), "{ratio}");
    assert_eq!(said("RH [%]", "45"), "");
}

#[test]
fn sizes_that_no_tribometer_has_are_remarked_on() {
    assert_eq!(targets("Frequency [mHz]"), "\"Frequency [mHz]\"=frequency:MHz");
    let text = table("t (s);v (mm/s);Fz (N);Fx (N);w (um);f (Hz)", "{t};{v};0.25;{fx};1.5;2.75e-5");
    let said = imported(&text, "", "", false).unwrap().log.remarks.concat();
    assert!(said.contains("kHz is unusual for a tribometer"), "{said}");
    // Serial days, and clocks without colons, under a bare name.
    for time in ["45352.50", "1159"] {
        let text = table("Time;v (mm/s);Fz (N);Fx (N)", "?{v};0.25;{fx}");
        let text = text.split('?').enumerate().fold(String::new(), |all, (k, part)| match k {
            0 => part.to_string(),
            k => format!("{all}{time}{k:02};{part}"),
        });
        let said = imported(&text, "", "amplitude_pp=0", false).unwrap().log.remarks.concat();
        assert!(said.contains("days of a spreadsheet (HEADER=time:d)"), "{said}");
    }
    // One reading at the end of its range among others.
    let text = table("t (s);v (mm/s);Fz (N);Fx (N)", "{t};{v};0.5;{fx}").replacen(";-0.1025", ";-32.767", 1);
    let said = imported(&text, "", "amplitude_pp=0", false).unwrap().log.remarks.concat();
    assert!(said.contains("lateral over normal force is more than 20 in point"), "{said}");
}

#[test]
fn words_of_a_direction_are_understood_or_stated() {
    let directed = |forward: &str, backward: &str, map: &str| {
        let row = |k: usize| [forward, backward][k % 2];
        let text = table("t (s);Speed (mm/s);Fz (N);Fx (N);Dir", "{t};20;0.25;{fx};?");
        let text = text.split('?').enumerate().fold(String::new(), |all, (k, part)| match k {
            0 => part.to_string(),
            k => format!("{all}{}{part}", row(k - 1)),
        });
        imported(&text, map, "amplitude_pp=0", false)
    };
    for (forward, backward) in [("1", "0"), ("F", "R"), ("A", "B"), ("hin", "rück"), ("CW", "CCW")] {
        let said = directed(forward, backward, "").unwrap_err();
        assert!(
            said.contains("is not known: state the two words, forward first, as in Dir=direction:hin/zurück"),
            "{forward}: {said}"
        );
        let made = directed(forward, backward, &format!("Dir=direction:{forward}/{backward}")).unwrap();
        assert_eq!((made.log.passes, made.log.remarks.len()), (24, 0), "{forward}");
        assert!(made.log.map_argument.contains(&format!("Dir=direction:{forward}/{backward}")));
    }
    // A few marks of failed readings are rows that are left out.
    let text = table("t (s);Speed (mm/s);Fz (N);Fx (N);Dir", "{t};20;0.25;{fx};fwd");
    let log = imported(&text.replacen("fwd", "??", 1), "", "amplitude_pp=0", false).unwrap().log;
    assert_eq!((log.passes, log.dropped.len()), (23, 1));
}

#[test]
fn what_was_passed_over_is_said_with_a_refusal() {
    let text = table("t (s);v (mm/s);Fz (N)", "{t};{v};0.25;{fx}");
    let said = imported(&text, "", "amplitude_pp=0", false).unwrap_err();
    assert!(said.contains("row 1 has 3 names over rows of 4 cells"), "{said}");
    // Names that are broken within quotes are whole.
    let text = table("t (s);v (mm/s);\"Fz\n(N)\";\"Fx\n(N)\"", "{t};{v};0.25;{fx}");
    assert_eq!(imported(&text, "", "amplitude_pp=0", false).unwrap().log.passes, 24);
}

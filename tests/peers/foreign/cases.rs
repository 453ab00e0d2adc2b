//! A test a folder of `tests/foreign/`, each with its right value or the refusal that names the place.

use super::{Output, Pass, import};
use std::path::Path;
use tests::{file, muprime, texts};

const STILL: [&str; 2] = ["--set", "amplitude_pp_m=0,direction=1"];

fn take(source: &str, arguments: &[&str]) -> (Output, Vec<Pass>) {
    let folder = tempfile::tempdir().unwrap();
    import(folder.path(), &file("tests/foreign").join(source), arguments)
}

/// The passes of a source that is taken.
fn taken(source: &str, arguments: &[&str]) -> Vec<Pass> {
    let (output, passes) = take(source, &[&STILL[..], arguments].concat());
    assert_eq!(output.status.code(), Some(0), "{source}: {}", texts(&output).1);
    passes
}

/// The words of a source that is refused, their blanks and line ends made one.
fn refused(source: &str, arguments: &[&str]) -> String {
    let (output, _) = take(source, &[&STILL[..], arguments].concat());
    assert_eq!(output.status.code(), Some(2), "{source}: {}", texts(&output).1);
    words(&output)
}

fn words(output: &Output) -> String {
    let said = texts(output).1.replace(['│', '×', '╰', '─', '▶'], " ");
    said.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn holds(said: &str, words: &[&str]) {
    words.iter().for_each(|w| assert!(said.contains(w), "no '{w}' in: {said}"));
}

fn times(passes: &[Pass]) -> Vec<f64> {
    passes.iter().map(|p| p.time_s).collect()
}

#[test]
fn clocks_that_begin_again_are_refused_until_steps_are_runs() {
    let source = "clock-starts-again/steps.csv";
    holds(&refused(source, &["--yes"]), &["row 10, 18", "HEADER=run"]);
    let map = "Step=run,Time (s)=time:s,Load (N)=normal_force:N,Friction (N)=friction_force:N,Speed (mm/s)=speed:mm/s";
    let passes = taken(source, &["--map", map]);
    assert_eq!(
        passes.iter().map(|p| p.run.as_deref().unwrap()).collect::<String>(),
        "1".repeat(8) + &"2".repeat(8) + &"3".repeat(8)
    );
}

#[test]
fn a_second_header_holds_for_the_rows_below_it() {
    let passes = taken("header-again-other-order/two-steps.csv", &["--yes", "--accept", "unsorted"]);
    assert_eq!(passes.len(), 28);
    for (k, p) in passes.iter().enumerate() {
        let friction = if k < 14 { 0.5 + 0.001 * k as f64 } else { 0.8 + 0.001 * (k - 14) as f64 };
        assert!((p.lateral_force_n.unwrap() - friction).abs() < 1e-12 && p.normal_force_n == 2.0, "{p:?}");
    }
    holds(
        &refused("header-again-other-order/two-steps.csv", &["--yes"]),
        &["goes back in row 21", "rows 18 to 20 are a header again"],
    );
}

#[test]
fn midnight_and_stopwatches() {
    let even: Vec<f64> = (0..14).map(|k| f64::from(2 * k)).collect();
    assert_eq!(times(&taken("midnight/midnight.csv", &["--yes"])), even);
    let tens: Vec<f64> = (0..14).map(|k| f64::from(10 * k)).collect();
    assert_eq!(times(&taken("minutes-seconds/stopwatch.csv", &["--yes"])), tens);
}

#[test]
fn empty_cells_between_tabs_and_rows_of_unknown_units() {
    let passes =
        taken("tabs-with-an-empty-column/gauge.txt", &["--set", "speed=10:mm/s,time_s=rows", "--yes"]);
    assert!(passes.len() == 14 && passes.iter().all(|p| p.normal_force_n == 5.0));
    let passes = taken("unit-row-unknown-unit/rows.csv", &["--yes"]);
    assert!(passes.len() == 14 && passes.iter().all(|p| p.normal_force_n == 5.0 && p.speed_m_s == 0.01));
}

#[test]
fn one_column_and_loads_across() {
    let given = "speed=100:mm/s,normal_force=10:N,time_s=rows";
    let passes = taken("one-column/mu.txt", &["--map", "#1=friction_coefficient:1", "--set", given]);
    assert_eq!((passes.len(), passes[1].lateral_force_n), (21, Some(2.0)));
    holds(&refused("loads-across/wide.csv", &["--yes"]), &["41 g, 53 g, 65 g", "one row a pass"]);
}

#[test]
fn padding_is_accepted_where_it_is_said() {
    let map = ["--map", "#1=time:s,#2=normal_force:N,#3=friction_force:N,#4=speed:m/s"];
    holds(&refused("padded-with-zeros/chunk.h5", &map), &["the last 40 rows are zeros", "--accept padding"]);
    assert_eq!(taken("padded-with-zeros/chunk.h5", &[&map[..], &["--accept", "padding"]].concat()).len(), 20);
}

#[test]
fn units_in_attributes_and_workspaces() {
    let passes = taken("units-in-attributes/units.h5", &["--yes"]);
    let first = &passes[0];
    assert_eq!((first.normal_force_n, first.lateral_force_n, first.speed_m_s), (0.2, Some(0.08), 0.01));
    let map = ["--map", "t=time:s,Fn=normal_force:N,Ft=lateral_force:N,v=speed:m/s"];
    for name in ["workspace.mat", "workspace73.mat", "workspace.h5"] {
        assert_eq!(taken(&format!("workspace-mat/{name}"), &map).len(), 20, "{name}");
    }
    holds(
        &refused("cell-mat/cells.mat", &["--yes"]),
        &["runs is a cell array (1 x 2)", "writematrix(runs{1}"],
    );
}

#[test]
fn a_last_sample_that_is_there_twice_is_left_out() {
    let map = "Time (s)=time:s,Travel (mm)=position:mm,Force (N)=lateral_force:N";
    let source = file("tests/foreign/time-stands-still/end-twice.csv");
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["--series", "--map", map, "--set", "amplitude_pp_m=0,normal_force=5:N"];
    let (output, passes) = import(folder.path(), &source, &arguments);
    assert_eq!(passes.len(), 1, "{}", texts(&output).1);
    holds(&words(&output), &["the last sample is there twice"]);
    // Several samples with one stamp are another matter.
    let coarse = folder.path().join("coarse.csv");
    let text = std::fs::read_to_string(&source).unwrap().replace("\n1.1,", "\n1.0,");
    std::fs::write(&coarse, text).unwrap();
    let (output, _) = import(folder.path(), &coarse, &arguments);
    holds(&words(&output), &["samples share a stamp", "too coarse"]);
}

fn check(profile: &Path) -> (Option<i32>, String) {
    let output = muprime().arg("check").arg(profile).output().unwrap();
    let both = texts(&output).0 + &texts(&output).1;
    let both = both.replace(['│', '×', '╰', '─', '▶'], " ");
    (output.status.code(), both.split_whitespace().collect::<Vec<_>>().join(" "))
}

#[test]
fn profiles_of_foreign_files() {
    let at = |name: &str| file("tests/foreign").join(name);
    for (name, words) in [
        ("dbc-identifier-too-large/sensor.toml", ["536871000", "29 bits", "line 9"]),
        ("dbc-two-of-one-name/sensor.toml", ["two signals Fx", "10", "12"]),
    ] {
        let (status, said) = check(&at(name));
        assert_eq!(status, Some(2), "{name}: {said}");
        holds(&said, &words);
    }
    for name in
        ["dbc-unused-bad-message/sensor.toml", "dbc-windows-1252/sensor.toml", "sign-apart/balance.toml"]
    {
        let (status, said) = check(&at(name));
        assert_eq!(status, Some(0), "{name}: {said}");
    }
    // The same files with the mark of UTF-8, and in UTF-16.
    let folder = tempfile::tempdir().unwrap();
    let profile = std::fs::read_to_string(at("dbc-windows-1252/sensor.toml")).unwrap();
    std::fs::write(folder.path().join("sensor.toml"), profile).unwrap();
    let marked = std::fs::read(at("dbc-windows-1252/sensor-bom.dbc")).unwrap();
    let text = String::from_utf8(marked[3..].to_vec()).unwrap();
    let wide: Vec<u8> =
        [0xFFu8, 0xFE].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    for bytes in [marked, wide] {
        std::fs::write(folder.path().join("sensor.dbc"), bytes).unwrap();
        let (status, said) = check(&folder.path().join("sensor.toml"));
        assert_eq!(status, Some(0), "{said}");
    }
}

/// What `export` writes is the same table to `import`, whatever the format: the points are equal to the byte.
#[test]
fn what_is_exported_is_imported_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("run");
    let plan = tests::short_plan(folder.path());
    let made = muprime()
        .args(["run", &plan, "--fast", "--out"])
        .arg(&run)
        .env("MUPRIME_RUNS", folder.path())
        .output();
    assert_eq!(made.unwrap().status.code(), Some(0));
    let points = |source: &Path| {
        let (output, passes) = import(folder.path(), source, &["--yes"]);
        assert_eq!(passes.len(), 22, "{source:?}: {}", texts(&output).1);
        std::fs::read(folder.path().join("out").join(source.file_name().unwrap()).join("points.csv")).unwrap()
    };
    let own = points(&run.join("points.csv"));
    for (format, name) in [
        ("csv", "passes.csv"),
        ("parquet", "passes.parquet"),
        ("arrow", "passes.arrow"),
        ("hdf5", "passes.h5"),
    ] {
        let exported = muprime().arg("export").arg(&run).args(["--to", format]).output().unwrap();
        assert_eq!(exported.status.code(), Some(0), "{format}: {}", texts(&exported).1);
        assert_eq!(String::from_utf8(points(&run.join(name))), String::from_utf8(own.clone()), "{format}");
    }
}

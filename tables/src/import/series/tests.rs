//! Records that cannot be cut as they are, and samples that are none.

use crate::import::guess::tests::imported;
use std::fmt::Write;

/// Strokes of 2 s to and fro at 10 mm/s, 100 samples a second; `cell` may change a cell of a row.
fn strokes(position: impl Fn(f64, f64) -> f64, cell: impl Fn(usize, usize, String) -> String) -> String {
    let mut text = String::from("t (s);x (mm);Fz (N);Fx (N)\n");
    let (mut x, mut way_up) = (0.0, 0.0);
    for k in 0..1600usize {
        let way = if k / 200 % 2 == 0 { 1.0 } else { -1.0 };
        (x, way_up) = (x + 0.1 * way, way_up + 0.1);
        let cells = [k as f64 * 0.01, position(x, way_up), 0.5, 0.2 * way];
        let cells: Vec<String> =
            cells.iter().enumerate().map(|(c, v)| cell(k, c, format!("{v:.3}"))).collect();
        writeln!(text, "{}", cells.join(";")).unwrap();
    }
    text
}

fn same(_: usize, _: usize, text: String) -> String {
    text
}

#[test]
fn a_direction_that_the_position_contradicts_is_refused() {
    let text = strokes(|x, _| x, same);
    let said = imported(&text, "", "amplitude_pp=0,direction=1", true).unwrap_err();
    assert!(
        said.contains("turns back 7 times (first in row") && said.contains("leave the direction out"),
        "{said}"
    );
    let log = imported(&text, "", "amplitude_pp=0", true).unwrap().log;
    assert!(log.passes == 8 && !log.remarks.concat().contains("reversals"), "{:?}", log.remarks);
}

#[test]
fn reversals_hidden_in_a_way_that_counts_up_are_remarked_on() {
    let log = imported(&strokes(|_, way_up| way_up, same), "", "amplitude_pp=0", true).unwrap().log;
    assert!(log.remarks.concat().contains("are reversals hidden in them?"), "{:?}", log.remarks);
}

#[test]
fn samples_with_an_empty_cell_are_left_out_and_listed() {
    for (column, name) in [(0, "time_s"), (1, "position_m"), (2, "normal_force_n"), (3, "lateral_force_n")] {
        let text = strokes(|x, _| x, |k, c, text| if (k, c) == (55, column) { String::new() } else { text });
        let log = imported(&text, "", "amplitude_pp=0", true).unwrap_or_else(|e| panic!("{name}: {e}")).log;
        let told: Vec<_> =
            log.dropped.iter().map(|d| (d.row, d.column.as_str(), d.reason.as_str())).collect();
        assert_eq!(told, [(57, name, "empty")]);
        assert_eq!(log.passes, 8, "{name}");
    }
}

#[test]
fn a_clock_that_is_too_coarse_gets_the_remedy() {
    let coarse = |_: usize, c: usize, text: String| if c == 0 { text[..text.len() - 2].into() } else { text };
    let said = imported(&strokes(|x, _| x, coarse), "", "amplitude_pp=0", true).unwrap_err();
    assert!(said.contains("--map Sample=time:0.01s"), "{said}");
    let text = strokes(|x, _| x, same).replace("t (s)", "Sample").replace("Sample", "Nr");
    let said = imported(&text, "", "amplitude_pp=0", true).unwrap_err();
    assert!(said.contains("HEADER=time:0.01s") && !said.contains("time_s=rows"), "{said}");
}

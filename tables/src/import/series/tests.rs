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
    let mut text = String::from("t (s);v (mm/s);dir;Fz (N);Fx (N)\n");
    for k in 0..800 {
        let way = if k == 55 {
            ""
        } else if k / 400 == 0 {
            "1"
        } else {
            "-1"
        };
        writeln!(text, "{:.2};20;{way};0.5;0.2", f64::from(k) * 0.01).unwrap();
    }
    let log = imported(&text, "v (mm/s)=speed:mm/s", "amplitude_pp=0", true).unwrap().log;
    assert_eq!((log.passes, log.dropped[0].row, log.dropped[0].column.as_str()), (2, 57, "direction"));
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

/// Moves of a second at the given speeds in mm/s, 100 samples a second, each before a rest of so many
/// samples. Moving takes 0.5 N, a rest 0.1 N; positions are rounded to 0.1 um.
fn moves(speeds: &[f64], rest: usize) -> String {
    let mut text = String::from("t (s);x (mm);Fz (N);Fx (N)\n");
    let (mut k, mut x) = (0, 0.0);
    for speed in speeds {
        for sample in 0..100 + rest {
            let speed = if sample < 100 { *speed } else { 0.0 };
            x += speed * 0.01;
            let force = if speed == 0.0 { 0.1 } else { 0.5 * speed.signum() };
            writeln!(text, "{};{x:.4};1;{force}", f64::from(k) * 0.01).unwrap();
            k += 1;
        }
    }
    text
}

#[test]
fn moves_with_rests_between_are_passes_of_moving_alone() {
    let two = [20.0, 40.0].repeat(7);
    for (speeds, rest) in
        [(vec![20.0; 14], 100), (vec![20.0; 14], 30), (vec![20.0; 14], 10), (two.clone(), 100), (two, 30)]
    {
        let made = imported(&moves(&speeds, rest), "", "amplitude_pp=0", true).unwrap();
        assert_eq!(made.log.passes, 14, "{rest}: {}", made.table);
        let range = |name: &str| made.log.ranges.iter().find(|r| r.column == name).unwrap().low_median_high;
        let (speed, force) = (range("speed_m_s"), range("lateral_force_n"));
        assert!(speed[0] > 0.0199 && speed[2] < 1.001e-3 * speeds[1], "{rest}: {speed:?}");
        assert!(force[0] > 0.499 && force[2] < 0.501, "{rest}: {force:?}");
    }
    // To and fro, with a longer rest at each end.
    let text = moves(&[20.0, -20.0].repeat(6), 300);
    assert_eq!(imported(&text, "", "amplitude_pp=0", true).unwrap().log.passes, 12);
}

/// A load that is constant, in noise of 12 and 25 % of a sample: the noise is no change of the load.
#[test]
fn noise_of_the_samples_cuts_no_stroke() {
    for share in [0.12, 0.25] {
        let mut state = 7u64;
        // A sum of twelve uniform numbers is nearly normal.
        let mut normal = || {
            let one = |_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f64 / (1u64 << 24) as f64
            };
            (0..12).map(one).sum::<f64>() - 6.0
        };
        let noise: Vec<f64> = (0..1600).map(|_| 0.5 * (1.0 + share * normal())).collect();
        let noisy = |k: usize, c: usize, text: String| if c == 2 { format!("{:.4}", noise[k]) } else { text };
        let made = imported(&strokes(|x, _| x, noisy), "", "amplitude_pp=0", true).unwrap();
        assert_eq!(made.log.passes, 8, "{share}: {}", made.table);
    }
}

#[test]
fn a_bad_sample_is_left_out_or_remarked_on() {
    let with = |column: usize, bad: &'static str| {
        let text =
            strokes(|x, _| x, move |k, c, text| if (k, c) == (150, column) { bad.into() } else { text });
        imported(&text, "", "amplitude_pp=0", true).unwrap().log
    };
    for (column, bad, name) in [
        (3, "-9999", "lateral_force_n"),
        (3, "1E+38", "lateral_force_n"),
        (2, "1E+38", "normal_force_n"),
        (2, "-9999", "normal_force_n"),
    ] {
        let log = with(column, bad);
        assert_eq!(log.passes, 8, "{bad}");
        assert_eq!((log.dropped[0].row, log.dropped[0].column.as_str()), (152, name), "{:?}", log.dropped);
        assert_eq!(log.dropped[0].text.parse::<f64>(), bad.parse(), "{:?}", log.dropped);
    }
    let said = with(3, "40").remarks.concat();
    assert!(said.contains("scatters by more than 3 times its mean in point 1: a bad sample"), "{said}");
}

#[test]
fn a_clock_that_begins_again_in_each_run_is_cut_run_by_run() {
    let text =
        strokes(|x, _| x, |k, c, text| if c == 0 { format!("{:.2}", (k % 200) as f64 * 0.01) } else { text });
    let mut lines = text.lines();
    let head = format!("Pass;{}\n", lines.next().unwrap());
    let text = lines.enumerate().fold(head, |all, (k, line)| format!("{all}P{};{line}\n", k / 200));
    let said = imported(&text, "", "amplitude_pp=0", true).unwrap_err();
    assert!(said.contains("map the column that numbers the steps (HEADER=run)"), "{said}");
    let log = imported(&text, "Pass=run", "amplitude_pp=0", true).unwrap().log;
    assert_eq!((log.passes, log.series.unwrap().in_passes), (8, 8 * 160));
}

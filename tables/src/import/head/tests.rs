//! Rows between and below those of a table.

use crate::import::guess::tests::{imported, table};

const HEAD: &str = "t (s);v (mm/s);Fz (N);Fx (N)";

fn whole() -> String {
    table(HEAD, "{t};{v};0.25;{fx}")
}

#[test]
fn rows_that_sum_others_up_are_no_passes() {
    let named = table("Probe;v (mm/s);Fz (N);Fx (N)", "P{k};{v};0.25;{fx}");
    let text = format!("{named}Mittelwert;20;0.25;0.1\nStd.-Abw.;1;0.01;0.01\nMax;20;0.25;0.1\n");
    let log = imported(&text, "", "amplitude_pp=0,time_s=rows", false).unwrap().log;
    let told: Vec<(u64, &str)> = log.dropped.iter().map(|d| (d.row, d.reason.as_str())).collect();
    assert_eq!(log.passes, 24);
    assert_eq!(told[1], (27, "'Std.-Abw.' sums up other rows: no pass"));
    assert_eq!(told.len(), 3);
}

/// A tester called Max lost his passes.
#[test]
fn a_name_that_is_a_statistic_too_is_a_name() {
    for row in ["Max;{v};0.25;{fx}", "{k}x;{v};0.25;{fx}"] {
        let text = table("Operator;v (mm/s);Fz (N);Fx (N)", row)
            .replace("\n3x;", "\nMax;")
            .replace("\n4x;", "\nMax;");
        let log = imported(&text, "", "amplitude_pp=0,time_s=rows", false).unwrap().log;
        assert_eq!(log.passes, 24, "{row}");
        let log = imported(&format!("{text}Mean;20;0.25;0.1\n"), "", "amplitude_pp=0,time_s=rows", false);
        assert_eq!(log.unwrap().log.passes, 24, "{row}");
    }
}

#[test]
fn other_units_end_a_table() {
    let below = "s;m/s;mN;mN\n60;0.02;250;100\n62;-0.02;250;-100\n";
    let log = imported(&format!("{}{below}", whole()), "", "amplitude_pp=0", false).unwrap().log;
    assert_eq!(log.passes, 24);
    assert_eq!(log.dropped.iter().map(|d| d.row).collect::<Vec<_>>(), [26, 27, 28]);
    assert!(log.dropped[1].reason.starts_with("below row 26, which states other units"), "{:?}", log.dropped);
    // The same units say nothing new.
    let below = "s;mm/s;N;N\n60;20;0.25;0.1\n";
    let log = imported(&format!("{}{below}", whole()), "", "amplitude_pp=0", false).unwrap().log;
    assert_eq!(log.passes, 25);
}

#[test]
fn a_header_that_is_not_known_ends_a_table() {
    let below = "Kanal A;Kraft B;Weg C;Hub D\n60;20;250;100\n62;-20;250;-100\n";
    let log = imported(&format!("{}{below}", whole()), "", "amplitude_pp=0", false).unwrap().log;
    assert_eq!(log.passes, 24);
    let reason = &log.dropped[2].reason;
    assert!(reason.starts_with("below the words of row 26, which name no column"), "{reason}");
    // Failed readings are no header, and a known header begins the table again.
    let below = "OVL;OVL;OVL;OVL\n60;20;0.25;0.1\n";
    let log = imported(&format!("{}{below}", whole()), "", "amplitude_pp=0", false).unwrap().log;
    assert_eq!((log.passes, log.dropped.len()), (25, 1));
    let again = format!("{}a;b;c;d\n60;20;0.25;0.1\n{HEAD}\n62;-20;0.25;-0.1\n", whole());
    let log = imported(&again, "", "amplitude_pp=0", false).unwrap().log;
    assert_eq!((log.passes, log.dropped.len()), (25, 2));
}

#[test]
fn a_word_and_its_value_above_a_narrow_table_are_no_data() {
    for before in ["Load [N];5\n", "Sample;A12\nLoad [N];0.25\nRate [Hz];10\n", "Load [N];5\n\n"] {
        let text = format!("{before}{}", table("t (s);COF", "{t};{mu}"));
        let set = "amplitude_pp=0,speed=20:mm/s,direction=1,normal_force=5";
        let log = imported(&text, "", set, false).unwrap_or_else(|e| panic!("{before}: {e}")).log;
        assert_eq!(log.passes, 24, "{before}");
        assert!(
            log.notes.concat().contains("before the header was passed over: Load [N] 5") || before.len() > 12
        );
    }
}

#[test]
fn rows_of_statistics_are_no_passes_in_other_words_too() {
    let named = table("Probe;v (mm/s);Fz (N);Fx (N)", "P{k};{v};0.25;{fx}");
    for words in [
        "MW",
        "Ø",
        "StAbw.",
        "STDEV.S",
        "Durchschnitt",
        "Mittelwerte",
        "arith. Mittel",
        "Gesamt",
        "Spannweite",
        "Streuung",
        "Varianz",
        "Variance",
        "Range",
        "CV",
        "CV %",
        "RSD",
        "RMS",
        "Mean (40)",
        "Mean (n=40)",
        "Mean of 40",
        "Mean ± SD",
        "mean_all",
        "Standard error",
        "95% CI",
        "overall",
        "x̄",
        "σ",
        "moyenne",
        "écart-type",
        "Media",
        "Promedio",
        "Mean;20;0.25;0.1\nn",
        "Mean;20;0.25;0.1\nN",
    ] {
        let text = format!("{named}{words};20;0.25;0.1\n");
        let log = imported(&text, "", "amplitude_pp=0,time_s=rows", false).unwrap().log;
        assert_eq!(log.passes, 24, "{words}");
    }
    for name in ["Max Weber", "N", "n1", "A range of mine", "40 N"] {
        let text = format!("{named}{name};20;0.25;0.1\n");
        assert_eq!(
            imported(&text, "", "amplitude_pp=0,time_s=rows", false).unwrap().log.passes,
            25,
            "{name}"
        );
    }
}

/// The header of a LabVIEW measurement: words and then numbers, as wide as the table.
#[test]
fn a_header_below_rows_of_a_word_and_numbers_heads_the_table() {
    let rows = table("X_Value\tv (mm/s)\tFz (N)\tFx (N)\tComment", "{t}\t{v}\t0.25\t{fx}");
    let text = format!(
        "LabVIEW Measurement\t\nSeparator\tTab\nDate\t2024/03/01\n***End_of_Header***\t\n\t\nChannels\t3\t\t\t\n\
         Samples\t24\t24\t24\t\nDate\t2024/03/01\t2024/03/01\t2024/03/01\t\nX_Dimension\tTime\tTime\tTime\t\n\
         X0\t0.0E+0\t0.0E+0\t0.0E+0\t\nDelta_X\t1.0\t1.0\t1.0\t\n***End_of_Header***\t\t\t\t\n{rows}"
    );
    let log = imported(&text, "", "amplitude_pp=0", false).unwrap().log;
    assert_eq!((log.passes, log.map[0].from.as_str()), (24, "X_Value"));
}

#[test]
fn lines_before_a_header_are_counted_and_three_are_shown() {
    let text = format!("{}{}", "a word;another\n".repeat(9), whole());
    let notes = imported(&text, "", "amplitude_pp=0", false).unwrap().log.notes;
    assert!(notes.iter().any(|n| n.contains("6 more rows before the header were passed")), "{notes:?}");
    assert_eq!(notes.iter().filter(|n| n.contains("header was passed over")).count(), 3);
}

use super::grid::LawGrid;
use super::*;

const HEAD: &str = "amplitude_pp_m,speed_m_s,mu_relative";

fn refusal(text: &str) -> String {
    LawTable::from_csv(text).unwrap_err().to_string()
}

fn at(w: f64, u: f64) -> Condition {
    Condition { amplitude: PeakToPeak::from_metres(w), speed_m_s: u, ..Condition::paper() }
}

#[test]
fn a_bilinear_law_is_read_exactly_and_nothing_is_said_beyond_it() {
    let f = |w: f64, u: f64| 0.9 - 1e5 * w + 2.0 * u - 5e5 * w * u;
    let mut text = format!("# a comment\n{HEAD},mu_relative_sd\n");
    for u in [0.1, 0.01, 0.05] {
        for w in [1e-6, 2e-6, 5e-6] {
            text += &format!("{w:e},{u:e},{},0.02\n", f(w, u));
        }
    }
    let law = LawTable::from_csv(&text).unwrap();
    assert_eq!(law.values.len(), 9);
    for (w, u) in [(1e-6, 0.01), (5e-6, 0.1), (3.3e-6, 0.02), (1.5e-6, 0.099)] {
        let p = law.predict(&at(w, u)).unwrap();
        assert!((p.mu_relative - f(w, u)).abs() < 1e-12 && (p.mu_relative_sd - 0.02).abs() < 1e-12);
        assert_eq!(law.form_sd(&p), p.mu_relative_sd);
    }
    for (w, u, name) in
        [(0.9e-6, 0.05, "amplitude_pp_m"), (2e-6, 0.11, "speed_m_s"), (2e-6, 0.009, "speed_m_s")]
    {
        let why = law.predict(&at(w, u)).unwrap_err();
        assert!(why.name == name && why.to_string().contains("cannot tell"), "{why}");
    }
    // Still it is one by definition; any frequency will do, as the law does not depend on it.
    assert_eq!(law.predict(&at(0.0, 3.0)).unwrap().mu_relative, 1.0);
    assert!(law.predict(&Condition { frequency_hz: 9e4, ..at(2e-6, 0.05) }).is_ok());
}

#[test]
fn wrong_tables_are_refused_with_line_and_remedy() {
    let full = "1e-6,0.01,0.5\n1e-6,0.02,0.6\n2e-6,0.01,0.3\n";
    for (text, parts) in [
        ("amplitude_um,mu_relative\n1,0.5\n".to_string(), ["line 1", "'amplitude_um'", "amplitude_pp_m"]),
        (
            "# c\nspeed_m_s;mu_relative\n0,1;1\n".into(),
            ["line 2", "separated by semicolons", "decimal comma"],
        ),
        ("speed_m_s\tmu_relative\n0.1\t1\n".into(), ["line 1", "separated by tabs", "commas"]),
        (format!("{HEAD}\n1e-6,0,01,0,5\n"), ["line 2", "number of cells", "not a comma"]),
        ("speed_m_s,speed_m_s,mu_relative\n".into(), ["line 1", "two columns", "remove one"]),
        ("# c\nspeed_m_s\n0.1\n".into(), ["line 2", "'mu_relative' is missing", "add it"]),
        ("mu_relative\n0.1\n".into(), ["line 1", "no column is a variable", "add"]),
        (format!("{HEAD}\n{full}2e-6,0.02,nan\n"), ["line 5", "'mu_relative' is 'nan'", "from 0 to 2"]),
        (format!("{HEAD}\n{full}2e-6,0.02,29.6\n"), ["line 5", "'29.6'", "from 0 to 2"]),
        (format!("{HEAD}\n{full}2,0.02,0.5\n"), ["line 5", "'amplitude_pp_m' is '2'", "metres"]),
        (format!("{HEAD}\n{full}2e-6,,0.5\n"), ["line 5", "'speed_m_s' is ''", "m/s"]),
        (format!("{HEAD}\n{full}2e-6,0.02\n"), ["line 5", "number of cells", "complete it"]),
        (format!("{HEAD}\n{full}2e-6,0.01,0.5\n"), ["line 5", "those of line 4", "remove one"]),
        (
            format!("{HEAD}\n{full}"),
            [
                "needs 4 rows, and there are 3",
                "2 of speed_m_s",
                "amplitude_pp_m = 0.000002, speed_m_s = 0.02",
            ],
        ),
        (
            format!("{HEAD}\n1e-6,0.01,0.5\n2e-6,0.01,0.5\n"),
            ["line 1", "'speed_m_s' has fewer", "remove the column"],
        ),
        (format!("{HEAD}\n0,0.01,0.5\n"), ["line 2", "0.5 without vibration", "divide by mu0"]),
    ] {
        let why = refusal(&text);
        assert!(parts.iter().all(|p| why.contains(p)), "{text}: {why}");
    }
}

#[test]
fn a_grid_names_its_places_and_measures_its_error() {
    let grid = LawGrid::parse(["speed_m_s=0.01..0.1:5:log", "amplitude_pp_m=1e-6..5e-6:9"]).unwrap();
    assert_eq!(grid.columns(), ["amplitude_pp_m", "speed_m_s"]);
    let f = |w: f64, u: f64| 1.0 - (-0.3 * u / w * 1e-6 / 0.02).exp();
    let answers =
        |checks| -> Vec<[f64; 2]> { grid.conditions(checks).iter().map(|c| [f(c[0], c[1]), 0.01]).collect() };
    let made = grid.table(400, &answers(400)).unwrap();
    assert_eq!((made.checks, LawTable::from_csv(&made.csv).unwrap().values.len()), (416, 45));
    // The greatest error that is stated is the greatest of a dense search, within a fifth.
    let law = LawTable::from_csv(&made.csv).unwrap();
    let dense = (0..160_000)
        .map(|k| (1e-6 + 4e-6 * f64::from(k / 400) / 399.0, 0.01 + 0.09 * f64::from(k % 400) / 399.0));
    let greatest = dense.map(|(w, u)| (law.at(&at(w, u)).unwrap()[0] - f(w, u)).abs()).fold(0.0, f64::max);
    assert!(
        made.greatest <= greatest * 1.001 && made.greatest > 0.8 * greatest,
        "{} {greatest}",
        made.greatest
    );
    let sd = law.at(&at(1e-6, 0.01)).unwrap()[1];
    assert!((sd - 0.01_f64.hypot(made.rms)).abs() < 1e-9);
    // A law that answers another time otherwise shows in the error.
    let mut restless = answers(0);
    restless.last_mut().unwrap()[0] += 0.3;
    assert!((grid.table(0, &restless).unwrap().greatest - 0.3).abs() < 1e-9);
    for (words, part) in [
        (vec!["speed_m_s=1..2"], "NAME=LOW..HIGH:COUNT"),
        (vec!["speed_mm_s=1..2:3"], "no variable 'speed_mm_s'"),
        (vec!["speed_m_s=0.1..0.01:3"], "rise"),
        (vec!["amplitude_pp_m=1..5:3"], "metres peak to peak"),
        (vec!["mu0=0.1..1:2", "mu0=0.1..1:2"], "twice"),
        (vec!["speed_m_s=0..1:2000000"], "nodes"),
    ] {
        let why = LawGrid::parse(words.iter().copied()).unwrap_err();
        assert!(why.contains(part), "{why}");
    }
    let mut wrong = answers(0);
    wrong[3][0] = f64::NAN;
    assert!(grid.table(0, &wrong).unwrap_err().contains("mu_relative is NaN at amplitude_pp_m = 1.0000e-6"));
}

/// It listed variables of effects, which a law cannot have.
#[test]
fn a_grid_names_the_variables_of_laws() {
    let why = LawGrid::parse(["temperature_c=20..30:3"]).unwrap_err();
    assert!(why.ends_with("there are amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0"), "{why}");
}

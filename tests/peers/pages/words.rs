//! What pages and the terminal say is so: each of these once said something that its own numbers contradict.

use runs::job::{Job, Notes, Signals, Update};
use runs::{Event, Plan, Setup};
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tests::{muprime, texts};

fn run(setup: &str, out: &Path) {
    let made = muprime()
        .args(["run", "--fast", "--setup", setup, "--seed", "3", "--out"])
        .arg(out)
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", texts(&made).1);
}

fn done(output: &Output) -> String {
    let (said, err) = texts(output);
    assert!(output.status.success(), "{err}");
    said
}

fn page(path: PathBuf) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// Cells of each row of a table with so many columns.
fn rows(html: &str, columns: usize) -> Vec<Vec<String>> {
    let row = |row: &str| -> Vec<String> {
        let cells = row.split("<td").skip(1).map(|cell| {
            let text = cell.split_once('>').unwrap().1;
            text.split("</td>").next().unwrap().to_string()
        });
        cells.collect()
    };
    html.split("<tr")
        .map(|text| row(text.split("</tr>").next().unwrap()))
        .filter(|r| r.len() == columns)
        .collect()
}

/// A row's difference is that of its own two numbers, and what is not says so.
#[test]
fn a_row_of_a_report_does_not_contradict_itself() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    run("virtual", &out);
    let html = page(out.join("report.html"));
    assert!(html.contains(">difference<") && html.contains(">surprise, sd<") && !html.contains(">z<"));
    let rows = rows(&html, 13);
    assert_eq!(rows.len(), 98);
    let number = |cell: &String| cell.parse::<f64>().ok();
    let mut compared = 0;
    for row in &rows {
        let (Some(mu), Some(predicted), Some(difference)) =
            (number(&row[7]), number(&row[9]), number(&row[11]))
        else {
            continue;
        };
        compared += 1;
        assert!((mu - predicted - difference).abs() < 0.00151, "{row:?}");
    }
    assert!(compared > 80, "{compared}");
    // Every speed of the plan has a mark of its own, in a figure that does not show all passes.
    // Every pass at the base load is in it, whatever the load's last digits: the others are 12 at other loads and 6 at another frequency.
    let others = " 18 passes at other frequencies, loads or levels of the air";
    for said in ["discs: 5 mm/s", "squares: 10 mm/s", "diamonds: 80 mm/s", others] {
        assert!(html.contains(said), "{said}");
    }
}

/// A run that was stopped on request is no trip, and says so in words.
#[test]
fn a_stop_on_request_is_told_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let setup = Setup::load("virtual-ideal").unwrap();
    let model = Arc::new(models::prediction::SpringSlider::new(setup.tip.finger).unwrap());
    let plan = Plan::load("first-sweep").unwrap();
    let notes = Notes::default();
    let (model_file, defects) = (None, None);
    let job = Job {
        seed: 3,
        setup,
        plan,
        model,
        model_file,
        defects,
        out: out.clone(),
        fast: true,
        notes,
        answers: None,
    };
    let signals = Signals::default();
    let asked = signals.clone();
    let mut events = Vec::new();
    let summary = job
        .run_in_virtual_time(&signals, &mut |update| match update {
            Update::Pass(pass) if pass.pass.point >= 9 => asked.stops.store(1, Ordering::Relaxed),
            Update::Event(event @ Event::Tripped(_)) => events.push(runs::report::events::describe(event)),
            _ => {}
        })
        .unwrap();
    assert!(summary.passes < summary.planned);
    let html = page(out.join("report.html"));
    assert!(html.contains("passes: stopped on request."), "{html:.3000}");
    for wrong in ["{\"outcome\"", "&quot;outcome&quot;", "TRIP", "Stopped"] {
        assert!(!html.contains(wrong) && !events.iter().any(|e| e.contains(wrong)), "{wrong}: {events:?}");
    }
}

/// Two rigs that differ from condition to condition: that is what is said first, in no good colour, and no shift is drawn.
#[test]
fn a_comparison_leads_with_what_decides_it() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b, c] = ["a", "b", "c"].map(|name| folder.path().join(name));
    run("virtual", &a);
    run("virtual-ideal", &b);
    let same = muprime()
        .args(["run", "--fast", "--setup", "virtual-ideal", "--seed", "4", "--out"])
        .arg(&c)
        .output();
    done(&same.unwrap());
    let out = folder.path().join("compare.html");
    let compared = |x: &Path, y: &Path| {
        done(&muprime().arg("compare").args([x, y]).arg("--report").arg(&out).output().unwrap())
            .replace("\n  ", " ")
    };
    let said = compared(&a, &b);
    let second = said.lines().find(|line| line.starts_with("the difference of mu' varies")).expect(&said);
    assert!(said.contains("no single shift describes that"), "{said}");
    // From the least to the greatest of the table's own differences.
    let html = page(out.clone());
    let of_row = |row: &Vec<String>| row[6].split(' ').next().unwrap().parse::<f64>().unwrap();
    let each: Vec<f64> = rows(&html, 8).iter().map(of_row).collect();
    let ends = each.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    for end in [ends.0, ends.1] {
        assert!(second.contains(&format!("{end:+.3}")), "{end}: {second}");
    }
    assert!(html.contains("class=\"verdict departed\"") && html.contains("No shift is drawn"));
    // What both have is written once.
    assert_eq!(html.matches("<td colspan=\"2\">artificial-silicone</td>").count(), 1);
    let said = compared(&b, &c);
    let html = page(out.clone());
    assert!(said.contains("mu' shifts by") && html.contains("class=\"verdict\""), "{said}");
}

/// A share has its interval beside it, certainty is not claimed, and a page that was written elsewhere is in the run's folder as well.
#[test]
fn a_verdict_claims_no_certainty() {
    let folder = tempfile::tempdir().unwrap();
    let run_folder = folder.path().join("run");
    run("virtual", &run_folder);
    let elsewhere = folder.path().join("gap.html");
    let diagnosed =
        muprime().arg("diagnose").arg(&run_folder).arg("--report").arg(&elsewhere).output().unwrap();
    let said = done(&diagnosed).replace("\n    ", " ");
    let headline = said.lines().next().unwrap();
    assert!(headline.contains("% (95 %: ") && !said.contains("1.00)") && !said.contains("1.000"), "{said}");
    let html = page(elsewhere.clone());
    assert!(html.contains("% (95 %: ") && !html.contains("no pass inside"));
    // Regions that were left out: no share without its interval.
    assert!(html.contains("by the recalibrated baseline, ") && !html.contains("of the gap closed"));
    let copy = run_folder.join("diagnosis.html");
    let told = texts(&diagnosed).1;
    for place in [&elsewhere, &copy] {
        assert!(told.contains(&format!(": {}", place.display())), "{told}");
    }
    assert_eq!(html, page(copy));
}

/// What no rig can be is refused with the unit that was meant, and a law without an uncertainty prints none.
#[test]
fn a_point_that_no_rig_can_have_is_refused() {
    let point = |words: &[&str]| muprime().args(["model"]).args(words).output().unwrap();
    for (words, hint) in [
        (["point", "--amplitude-pp-m", "2"], "\u{b5}m meant? Then write 2e-6"),
        (["point", "--speed-m-s", "20"], "mm/s meant? Then write 2e-2"),
        (["point", "--normal-force-n", "5000"], "0 to 1000 N"),
        (["point", "--frequency-hz", "27.5"], "kHz meant? Then write 2.75e4"),
        (["ridge", "--amplitude-pp-m", "2"], "\u{b5}m meant?"),
    ] {
        let ended = point(&words);
        let (said, err) = texts(&ended);
        let err = err.replace("\u{2502} ", "").split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(ended.status.code() == Some(2) && said.is_empty() && err.contains(hint), "{words:?}: {err}");
    }
    let said = done(&point(&["point"]));
    assert!(said.contains("mu' = 0.29") && !said.contains("+-"), "{said}");
    let law = |load: &str| done(&point(&["point", "--model", "surrogate", "--normal-force-n", load]));
    assert!(law("0.25").contains("\u{b1}") && !law("0.25").contains("an extrapolation"));
    assert!(law("5").contains("an extrapolation"));
}

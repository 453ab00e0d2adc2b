//! Files as other people's programs write them: the small cases of `tests/foreign/`, each with its right
//! value or refusal, and one truth in many dialects. A wrong value is never right; a refusal may be.

#[path = "foreign/bus.rs"]
mod bus;
#[path = "foreign/cases.rs"]
mod cases;
#[path = "foreign/hostile.rs"]
mod hostile;

use models::pass::{Pass, read_passes};
use std::path::Path;
use std::process::Output;
use tests::{documents, file, muprime, python, texts};

/// Imports, and reads what was written.
fn import(folder: &Path, source: &Path, arguments: &[&str]) -> (Output, Vec<Pass>) {
    let out = folder.join("out").join(source.file_name().unwrap());
    let _ = std::fs::remove_dir_all(&out);
    let output = muprime().arg("import").arg(source).args(arguments).arg("-o").arg(&out).output().unwrap();
    let table = std::fs::File::open(out.join("points.csv"));
    let passes = table.map_or(Vec::new(), |table| read_passes(table).unwrap());
    assert_eq!(output.status.code() == Some(0), !passes.is_empty(), "{source:?}: {}", texts(&output).1);
    (output, passes)
}

/// Whether the passes are those of the truth: rows of time, speed in mm/s, load and friction in N.
fn is_truth(passes: &[Pass], truth: &[Vec<f64>], steps: bool) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs().max(1.0);
    let mut passes = passes.to_vec();
    if !steps {
        passes.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    }
    let begin = passes.first().map_or(0.0, |p| p.time_s);
    passes.len() == truth.len()
        && passes.iter().zip(truth).all(|(p, t)| {
            let time = if steps { t[0] % 14.0 } else { t[0] };
            near(p.time_s - begin, time)
                && near(p.speed_m_s, t[1] * 1e-3)
                && near(p.normal_force_n, t[2])
                // Coefficients are written to four digits.
                && (p.lateral_force_n.unwrap() - t[3]).abs() < 2e-4 * t[3].abs()
        })
}

/// The same table in some ninety dialects of texts, workbooks and arrays.
#[test]
fn one_truth_in_many_dialects() {
    let folder = tempfile::tempdir().unwrap();
    let told = documents(
        &python().arg(file("tests/peers/foreign_dialects.py")).arg(folder.path()).output().unwrap(),
    );
    let truth: Vec<Vec<f64>> = serde_json::from_value(told[0]["truth"].clone()).unwrap();
    let (mut right, mut refused, mut wrong) = (0, Vec::new(), Vec::new());
    for dialect in &told[1..] {
        let (name, expect) = (dialect["file"].as_str().unwrap(), dialect["expect"].as_str().unwrap());
        let arguments: Vec<&str> =
            dialect["args"].as_array().unwrap().iter().map(|a| a.as_str().unwrap()).collect();
        let (output, passes) = import(folder.path(), &folder.path().join(name), &arguments);
        let said = texts(&output).1;
        match output.status.code() {
            Some(0) if is_truth(&passes, &truth, name.starts_with("steps")) => {
                right += 1;
                if expect == "refused" {
                    wrong.push(format!("{name}: taken\n{said}"));
                }
            }
            Some(2) if expect == "right" => refused.push(format!("{name}: {said}")),
            Some(2) => {}
            _ => wrong.push(format!("{name}: {said}\n{:?}", passes.iter().take(3).collect::<Vec<_>>())),
        }
    }
    println!(
        "{} dialects: {right} right, {} refused that are readable, {} wrong",
        told.len() - 1,
        refused.len(),
        wrong.len()
    );
    assert!(wrong.is_empty(), "wrong:\n{}", wrong.join("\n"));
    assert!(told.len() > 80 && refused.is_empty(), "refused:\n{}", refused.join("\n"));
}

//! Small files that say they are huge: bounds come from the bytes that are there, before any memory is taken.

use tests::{documents, file, muprime, python};

#[test]
fn small_files_that_say_they_are_huge_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let script = file("tests/peers/hostile_files.py");
    let output = python().arg(script).arg(folder.path()).arg(muprime().get_program()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told = documents(&output);
    for one in &told {
        let number = |name: &str| one[name].as_f64().unwrap();
        println!(
            "{:<16} {:>9} bytes: exit {}, {:.2} s, {:.0} MB",
            one["name"].as_str().unwrap(),
            number("bytes"),
            one["status"],
            number("seconds"),
            number("memory") * 1e-6
        );
    }
    assert!(told.len() >= 14, "{}", told.len());
    for one in &told {
        assert_eq!(one["status"], 2, "{one}");
        assert!(one["memory"].as_f64().unwrap() < 200e6, "{one}");
        // Of processor time, which a machine with other work does not lengthen; a release build takes a tenth.
        assert!(one["seconds"].as_f64().unwrap() < 10.0, "{one}");
    }
}

/// Damaged copies of files of every reader: read or refused, never more than that.
#[test]
fn damaged_files_are_read_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let script = file("tests/peers/damaged_files.py");
    let count = tests::rounds(100, 1000).to_string();
    let program = muprime().get_program().to_owned();
    let output = python().arg(script).arg(folder.path()).arg(program).arg(&count).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told = documents(&output);
    let most = |name: &str| told.iter().map(|one| one[name].as_f64().unwrap()).fold(0.0, f64::max);
    let of = |status: i64| told.iter().filter(|one| one["status"] == status).count();
    println!(
        "{count} damaged files: {} read, {} refused, at most {:.2} s of CPU and {:.0} MB",
        of(0),
        of(2),
        most("seconds"),
        most("memory") * 1e-6
    );
    assert_eq!(told.len().to_string(), count);
    for one in &told {
        assert!(one["status"] == 0 || one["status"] == 2, "{one}");
        assert!(one["memory"].as_f64().unwrap() < 200e6, "{one}");
        assert!(one["seconds"].as_f64().unwrap() < 10.0, "{one}");
        assert!(!one["said"].as_str().unwrap().contains("panicked"), "{one}");
    }
}

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

//! What is generated from the profiles: the schema for editors and a page for each instrument.
//! `MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test documents` writes them again.

use drivers::{bundled, profile};
use tests::file;

fn check(path: &str, text: &str) {
    let path = file(path);
    if std::env::var_os("MUPRIME_UPDATE").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == text,
        "{} is old: MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test documents",
        path.display()
    );
}

#[test]
fn the_schema_for_editors_is_current() {
    let schema = serde_json::to_string_pretty(&instruments::schema::json_schema()).unwrap();
    check("drivers/profiles/profile.schema.json", &format!("{schema}\n"));
}

#[test]
fn the_pages_of_the_instruments_are_current() {
    for id in bundled::ids() {
        check(
            &format!("drivers/profiles/docs/{id}.md"),
            &instruments::document::markdown(&profile(id).unwrap()),
        );
    }
}

/// Every test that the table of traps names exists where it says, and every trap but one has a test.
#[test]
fn every_trap_has_the_tests_that_it_names() {
    let page = std::fs::read_to_string(file("docs/devices.md")).unwrap();
    let rows = page.lines().skip_while(|line| !line.starts_with("| trap |")).skip(2);
    let (mut traps, mut without, mut named) = (0, 0, 0);
    for row in rows.take_while(|line| line.starts_with('|')) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 6, "{row}");
        traps += 1;
        without += usize::from(cells[4].starts_with("none:"));
        for test in cells[4].split('`').skip(1).step_by(2) {
            let (path, name) = test.split_once(": ").unwrap_or_else(|| panic!("{test}"));
            let source = std::fs::read_to_string(file(path)).unwrap_or_else(|e| panic!("{path}: {e}"));
            let at = source.find(&format!("fn {name}(")).unwrap_or_else(|| panic!("{path} has no {name}"));
            let head = &source[..at];
            let attribute = head.rfind("#[test]").unwrap_or_else(|| panic!("{name} is no test"));
            assert!(!head[attribute..].contains("fn "), "{name} is no test");
            named += 1;
        }
    }
    assert!(traps >= 20 && named >= 25 && without == 1, "{traps} traps, {named} tests, {without} without");
}

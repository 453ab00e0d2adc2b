//! What is generated from the profiles: the schema for editors and a page for each instrument.
//! `MUPRIME_WRITE_DOCUMENTS=1 cargo test --release -p tests --test wire documents` writes them anew.

use super::peers::file;
use rig::drivers::{bundled, profile};

fn check(path: &str, text: &str) {
    let path = file(path);
    if std::env::var_os("MUPRIME_WRITE_DOCUMENTS").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == text,
        "{} is not what the profiles say now; see the head of this file",
        path.display()
    );
}

#[test]
fn the_schema_for_editors_is_current() {
    let schema = serde_json::to_string_pretty(&instruments::schema::json_schema()).unwrap();
    check("rig/profiles/profile.schema.json", &format!("{schema}\n"));
}

#[test]
fn the_pages_of_the_instruments_are_current() {
    for id in bundled::ids() {
        check(&format!("rig/profiles/docs/{id}.md"), &instruments::document::markdown(&profile(id).unwrap()));
    }
}

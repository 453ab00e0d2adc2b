//! The pages: every command that any page names exists with its flags, every page is in the book, every link leads somewhere.
//!
//! `MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test docs` writes docs/commands.md and docs/how-to/errors.md.
//! The book itself: tests/peers/book.rs.

#[path = "docs/banned.rs"]
mod banned;
#[path = "docs/errors.rs"]
mod errors;
#[path = "docs/words.rs"]
mod words;

use std::path::PathBuf;
use tests::file;

/// Pages of docs/ that stand in the table of contents.
fn listed() -> Vec<PathBuf> {
    let summary = std::fs::read_to_string(file("docs/SUMMARY.md")).unwrap();
    let links = summary.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    links.map(|link| file("docs").join(link)).collect()
}

/// Every `muprime ...` in any page, listing or not, is a command with flags that there are.
#[test]
fn every_command_that_a_page_names_exists() {
    let commands = words::commands();
    let mut pages = words::markdown(&file("docs"));
    pages.extend(["README.md", "CONTRIBUTING.md", "python/README.md"].map(file));
    let (mut named, mut wrong) = (0, Vec::new());
    for path in &pages {
        let text = std::fs::read_to_string(path).unwrap();
        for (line, call) in words::calls(&text) {
            named += 1;
            if let Err(why) = words::exists(&call, &commands) {
                wrong.push(format!("{}:{line}: `{call}`: {why}", path.display()));
            }
        }
    }
    println!("{named} calls of muprime in {} pages", pages.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(named > 150, "{named}");
    // It can fail.
    assert!(words::exists("muprime rum --fast", &commands).is_err());
    assert!(words::exists("muprime run --fastest", &commands).is_err());
    assert!(words::exists("muprime model pointt", &commands).is_err());
}

/// The front page is short, and its numbers are those of the code.
#[test]
fn the_front_page_is_short_and_its_counts_hold() {
    let page = std::fs::read_to_string(file("README.md")).unwrap();
    assert!(page.lines().count() < 80, "{} lines", page.lines().count());
    for claim in [
        format!("; {} are bundled", drivers::bundled::ids().count()),
        format!("{} rules trip and latch", realtime::safety::RULES.len()),
        format!("{} candidate causes", effects::library::library().len()),
    ] {
        assert!(page.contains(&claim), "README.md does not say '{claim}'");
    }
}

/// docs/commands.md is what the program's own help says.
#[test]
fn the_page_of_commands_is_that_of_the_program() {
    let (path, now) = (file("docs/commands.md"), words::page(&words::commands()));
    if std::env::var_os("MUPRIME_UPDATE").is_some() {
        std::fs::write(&path, &now).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == now,
        "docs/commands.md is old: MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test docs"
    );
}

/// docs/how-to/errors.md is what the program answers, and its answers are words for people.
#[test]
fn the_page_of_errors_is_that_of_the_program() {
    let (now, wrong) = errors::page();
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
    let path = file("docs/how-to/errors.md");
    if std::env::var_os("MUPRIME_UPDATE").is_some() {
        std::fs::write(&path, &now).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    println!("{} errors provoked", now.lines().filter(|l| l.starts_with("| `")).count() - 1);
    assert!(
        written == now,
        "docs/how-to/errors.md is old: MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test docs"
    );
}

/// No word of the banned list in the files that are clean.
#[test]
fn no_banned_word_is_told_to_people() {
    let (read, wrong) = banned::look(&words::commands());
    println!("{read} lines read in {} rooms, {} banned words in them", banned::ROOMS.len() + 3, wrong.len());
    assert!(wrong.is_empty(), "{} of {read} lines:\n{}", wrong.len(), wrong.join("\n"));
    assert!(read > 800, "{read}");
    assert!(banned::in_line("each stands in import.json").is_some(), "it can fail");
}

/// Every page of docs/ stands in the table of contents.
#[test]
fn every_page_is_in_the_book() {
    let listed: Vec<PathBuf> = listed()
        .iter()
        .map(|p| p.canonicalize().unwrap_or_else(|e| panic!("{}: {e}", p.display())))
        .collect();
    let missing: Vec<PathBuf> = words::markdown(&file("docs"))
        .into_iter()
        .filter(|p| !p.ends_with("SUMMARY.md") && !listed.contains(&p.canonicalize().unwrap()))
        .collect();
    assert!(missing.is_empty(), "not in docs/SUMMARY.md: {missing:?}");
}

/// Links of the files beside the book.
#[test]
fn every_link_of_the_pages_beside_the_book_leads_somewhere() {
    let mut wrong = Vec::new();
    let mut pages = words::markdown(&file("docs"));
    pages.extend(
        [
            "README.md",
            "CONTRIBUTING.md",
            "ARCHITECTURE.md",
            "BENCHMARKS.md",
            "CHANGELOG.md",
            "python/README.md",
        ]
        .map(file),
    );
    for path in &pages {
        let text = std::fs::read_to_string(path).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split([')', '#', ' ', '\n']).next()) {
            let local = !target.is_empty() && !target.contains("://") && !target.contains('`');
            if local && !path.parent().unwrap().join(target).exists() {
                wrong.push(format!("{}: {target}", path.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

//! The book: every command that it shows is run and answers what it says, every file that it shows is the file that is used, every command that
//! any page names exists with its flags, every link leads somewhere, and it reads and searches without a network.
//!
//! `MUPRIME_UPDATE=1 cargo test --release -p muprime-tests-peers --test book` puts what commands answered into the pages, and writes docs/commands.md anew;
//! `MUPRIME_PAGES=FOLDER` keeps pictures of the pages. `MUPRIME_CHAPTER=WORD` follows the chapters whose path holds the word.

#[path = "book/compare.rs"]
mod compare;
#[path = "book/follow.rs"]
mod follow;
#[path = "book/page.rs"]
mod page;

use follow::{Followed, follow, update};
use page::{Page, Step};
use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use tests::{file, python, texts};

/// Folders of docs/ whose pages are chapters of the book alone: there every block is run or says why not.
const CHAPTERS: [&str; 4] = ["tutorial", "how-to", "physics", "statistics"];

/// Pages of docs/ that stand in the table of contents.
fn listed() -> Vec<PathBuf> {
    let summary = std::fs::read_to_string(file("docs/SUMMARY.md")).unwrap();
    let links = summary.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    links.map(|link| file("docs").join(link)).collect()
}

/// The pages that are followed: chapters of the book, and README.
fn followed() -> Vec<Page> {
    let chapter = |path: &PathBuf| CHAPTERS.iter().any(|c| path.starts_with(file("docs").join(c)));
    let mut pages: Vec<Page> =
        listed().iter().filter(|path| chapter(path)).map(|path| Page::read(path, true)).collect();
    // Their console blocks too; those of docs/diagnosis/example.md are run by `tests/real_tables.rs`.
    pages.extend(["README.md", "docs/viewers.md"].map(|path| Page::read(&file(path), false)));
    pages
}

fn chosen(page: &Page) -> bool {
    let word = std::env::var("MUPRIME_CHAPTER").unwrap_or_default();
    page.path.to_string_lossy().contains(&word)
}

fn told(page: &Page, seen: &Followed) {
    let name = page.path.strip_prefix(file("")).unwrap_or(&page.path).display();
    println!("{name}: {} commands, {} files", seen.commands, seen.files);
    for (line, step) in &page.steps {
        if let Step::NotRun(why) = step {
            println!("{name}:{line}: not run: {why}");
        }
    }
    update(page, &seen.came);
}

/// The drawings are those of their script, whose cycle is that of the spring-slider.
#[test]
fn the_pictures_are_as_their_script_draws_them() {
    let drawn = python().arg(file("book/pictures.py")).arg("--check").output().unwrap();
    assert!(drawn.status.success(), "{}", texts(&drawn).1);
}

/// Every block of every chapter is run or says why not; what is run answers what the page says.
#[test]
fn the_chapters_do_what_they_say() {
    let pages: Vec<Page> = followed().into_iter().filter(chosen).collect();
    let outcomes: Vec<(&Page, Followed)> = pages
        .par_iter()
        .filter(|page| !page.wall_clock)
        .map(|page| {
            let folder = tempfile::tempdir().unwrap();
            (page, follow(page, folder.path()))
        })
        .collect();
    outcomes.iter().for_each(|(page, seen)| told(page, seen));
    let mut wrong: Vec<String> =
        pages.iter().flat_map(|p| p.wrong.iter().map(|w| format!("{}: {w}", p.path.display()))).collect();
    wrong.extend(outcomes.iter().flat_map(|(_, seen)| seen.wrong.clone()));
    let commands: usize = outcomes.iter().map(|(_, seen)| seen.commands).sum();
    let apart: usize = pages.iter().filter(|p| p.wall_clock).map(|p| p.commands().count()).sum();
    let skipped: usize =
        pages.iter().flat_map(|p| &p.steps).filter(|(_, s)| matches!(s, Step::NotRun(_))).count();
    println!("{commands} commands run, {apart} in wall-clock time apart, {skipped} blocks not run");
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n\n"));
    assert!(commands > 60 || std::env::var_os("MUPRIME_CHAPTER").is_some(), "{commands}");
}

/// The same for chapters whose instruments are real processes on real wires, and whose runs take their time.
#[test]
fn the_chapters_in_wall_clock_time_do_what_they_say() {
    for page in followed().into_iter().filter(|page| page.wall_clock && chosen(page)) {
        let folder = tempfile::tempdir().unwrap();
        let seen = follow(&page, folder.path());
        told(&page, &seen);
        assert!(
            page.wrong.is_empty() && seen.wrong.is_empty(),
            "{:?}\n{}",
            page.wrong,
            seen.wrong.join("\n\n")
        );
    }
}

/// Makes the book into a folder.
fn build(into: &Path, source: &Path) {
    let venv = file("target/venv/bin").canonicalize().expect("run tests/venv");
    let path = format!("{}:{}", venv.display(), std::env::var("PATH").unwrap_or_default());
    let mut command = Command::new(venv.join("mdbook"));
    command.arg("build").arg(file("book")).arg("--dest-dir").arg(into).env("PATH", path);
    command.env("MDBOOK_BOOK__SRC", source);
    let output = command.output().unwrap();
    let (out, err) = texts(&output);
    assert!(output.status.success(), "{out}{err}");
    assert!(!err.contains("WARN") && !err.contains("ERROR"), "{err}");
}

/// What is wrong with the links of a built book; how many there are, and the addresses elsewhere.
fn links(book: &Path) -> Value {
    let output = python().arg(file("tests/peers/book.py")).arg("links").arg(book).output().unwrap();
    let (said, err) = texts(&output);
    assert!(output.status.success(), "{err}");
    serde_json::from_str(&said).unwrap()
}

/// The built book: links and anchors, nothing from elsewhere, equations drawn, the search finds.
#[test]
fn the_book_stands_alone() {
    let folder = tempfile::tempdir().unwrap();
    let book = folder.path().join("book");
    build(&book, &file("docs").canonicalize().unwrap());
    let said = links(&book);
    println!("{} links within, {} pages; elsewhere: {}", said["within"], said["pages"], said["elsewhere"]);
    assert_eq!(said["broken"], serde_json::json!([]), "broken links");
    assert!(said["within"].as_u64() > Some(500), "{said}");

    let kept = std::env::var_os("MUPRIME_PAGES").map(PathBuf::from);
    let pictures = kept.unwrap_or_else(|| folder.path().join("pictures"));
    std::fs::create_dir_all(&pictures).unwrap();
    let output =
        python().arg(file("tests/peers/book.py")).arg("look").args([&book, &pictures]).output().unwrap();
    let (seen, err) = texts(&output);
    assert!(output.status.success(), "{err}");
    let seen: Value = serde_json::from_str(&seen).unwrap();
    println!("{seen}");
    assert_eq!(seen["asked"], serde_json::json!([]), "asks for something from elsewhere");
    assert_eq!(seen["errors"], serde_json::json!([]), "errors in the browser");
    assert_eq!(seen["wide"], serde_json::json!([]), "wider than the window");
    assert_eq!(seen["axe"], serde_json::json!([]), "serious faults by axe-core");
    assert!(seen["equations"].as_u64() >= Some(20), "{seen}");
    assert_eq!(seen["flat"], serde_json::json!([]), "equations without height or width");
    for (asked, page) in
        [("ridge penalty", "ridge"), ("pseudo-terminal", "first-rig"), ("e-process", "statistics")]
    {
        let found = seen["found"][asked].as_array().unwrap();
        assert!(found.iter().any(|f| f.as_str().unwrap().contains(page)), "search '{asked}': {found:?}");
    }
    // The check of the links can fail: a page that leads nowhere, and an anchor that is not there.
    let page = book.join("glossary.html");
    let text = std::fs::read_to_string(&page).unwrap();
    let spoilt =
        text.replace("</main>", "<a href=\"nowhere.html\">x</a><a href=\"index.html#nothing\">y</a></main>");
    assert_ne!(text, spoilt);
    std::fs::write(&page, spoilt).unwrap();
    assert_eq!(links(&book)["broken"].as_array().unwrap().len(), 2);
}

//! Words that no text for people has: Germanisms, private metaphors, identifiers. The files below stay clean.

use super::words::Commands;
use tests::file;

/// Words and turns that are banned, in lower case.
const BANNED: &[&str] = &[
    "anew",
    "at will",
    "belongs into",
    "besides,",
    "glimpse",
    "has left the measurement",
    "held against",
    "is told",
    "let go",
    "made whole",
    "make a cut record whole",
    "of one's own",
    "parted by",
    "so-called",
    "so much:",
    "each stands in",
    "model departed",
    "stands in the",
    "strike the",
    "taken up again",
    "told at once",
    "who leads the run",
    "would have been seen",
    "nats expected",
];

/// Sources whose strings people read at a terminal, in events and on report pages; and pages beside those of
/// the book.
pub const ROOMS: &[&str] = &[
    "README.md",
    "SECURITY.md",
    "CODE_OF_CONDUCT.md",
    "examples/README.md",
    "CONTRIBUTING.md",
    "ARCHITECTURE.md",
    "python/README.md",
    "runs/src/report/events.rs",
    "runs/src/report/page.rs",
    "runs/src/verdict_text.rs",
    "realtime/src/compare/agreement.rs",
    "cli/src/verbs.rs",
    "cli/src/verbs/groups.rs",
    "cli/src/verbs/run.rs",
    "cli/src/verbs/runs.rs",
    "cli/src/verbs/report.rs",
    "cli/src/verbs/replay.rs",
    "cli/src/verbs/recover.rs",
    "cli/src/verbs/compare.rs",
    "cli/src/verbs/diagnose.rs",
    "cli/src/verbs/doctor/peek.rs",
    "cli/src/verbs/init.rs",
    "cli/src/verbs/show.rs",
    "cli/src/verbs/check.rs",
    "rig/src/live_calibration/guided.rs",
    "tables/src/calibrate.rs",
];

/// The banned word of a line.
pub fn in_line(line: &str) -> Option<&'static str> {
    let line = line.to_lowercase();
    BANNED.iter().copied().find(|word| {
        line.match_indices(word).any(|(at, _)| {
            let letter = |c: Option<char>| c.is_some_and(char::is_alphanumeric);
            !letter(line[..at].chars().next_back()) && !letter(line[at + word.len()..].chars().next())
        })
    })
}

/// Lines read, and those with a banned word: help of every command, a run's and a diagnosis' terminal lines, errors, files.
pub fn look(commands: &Commands) -> (usize, Vec<String>) {
    let mut texts: Vec<(String, String)> =
        commands.iter().map(|(name, help)| (format!("muprime {name} --help"), help.clone())).collect();
    let folder = tempfile::tempdir().unwrap();
    for typed in
        ["run --fast --out first", "run --fast --out first", "diagnose first", "report first", "replay first"]
    {
        let output = tests::muprime()
            .args(typed.split(' '))
            .current_dir(folder.path())
            .env_remove("MUPRIME_RUNS")
            .output()
            .unwrap();
        let (out, err) = tests::texts(&output);
        texts.push((format!("muprime {typed}"), out + &err));
    }
    texts.push(("errors".into(), std::fs::read_to_string(file("docs/how-to/errors.md")).unwrap_or_default()));
    let summary = std::fs::read_to_string(file("docs/SUMMARY.md")).unwrap();
    let pages = summary
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split_once(')'))
        .map(|(page, _)| format!("docs/{page}"));
    let pages: Vec<String> = pages.filter(|page| page.ends_with(".md") && !page.contains("..")).collect();
    for room in ROOMS.iter().copied().chain(pages.iter().map(String::as_str)) {
        let text = std::fs::read_to_string(file(room)).unwrap();
        // Of a source the strings: comments are for its readers. Tests at its end are none of it.
        let text = if room.ends_with(".rs") {
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            code.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
        } else {
            text
        };
        texts.push((room.to_string(), text));
    }
    let mut read = 0;
    let mut wrong = Vec::new();
    for (place, text) in texts {
        for (n, line) in text.lines().enumerate() {
            read += 1;
            if let Some(word) = in_line(line) {
                wrong.push(format!("{place}:{}: '{word}': {}", n + 1, line.trim()));
            }
        }
    }
    (read, wrong)
}

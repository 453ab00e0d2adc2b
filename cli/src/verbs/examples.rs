//! An example for every command: it stands under `--help` and in the manual, and a test parses each.

use runs::print::{COLUMNS, folded};

/// The examples, a command a line; those of one command in the order of their reading. Add one with every subcommand.
pub const EXAMPLES: &str = include_str!("examples.txt");

/// The examples of a command, as the end of its help. Where it has subcommands, theirs are not its own.
fn help_of(path: &str, has_subcommands: bool) -> Option<String> {
    let own = |line: &&str| {
        let rest = line.strip_prefix("muprime ").and_then(|line| line.strip_prefix(path));
        let of_path =
            |rest: &str| rest.is_empty() || rest.starts_with(if has_subcommands { " -" } else { " " });
        !path.is_empty() && rest.is_some_and(of_path)
    };
    let lines: Vec<String> = EXAMPLES.lines().filter(own).map(broken).collect();
    let head = if lines.len() > 1 { "Examples:" } else { "Example:" };
    (!lines.is_empty()).then(|| format!("{head}\n{}", lines.join("\n")))
}

/// A command line as a shell takes it within the columns of a page: broken between its words with a
/// backslash, and within quotes as it is, which the map of an import does not mind.
fn broken(line: &str) -> String {
    let (mut shown, mut now, mut quoted) = (String::new(), String::from("  "), false);
    for word in line.split(' ') {
        // Room for the blank and the backslash.
        if !now.trim_start().is_empty() && now.chars().count() + 1 + word.chars().count() > COLUMNS - 2 {
            shown.push_str(&now);
            shown.push_str(if quoted { "\n" } else { " \\\n" });
            now = " ".repeat(6);
            now.push_str(word);
        } else {
            if !now.trim_start().is_empty() {
                now.push(' ');
            }
            now.push_str(word);
        }
        quoted ^= word.matches('\'').count() % 2 == 1;
    }
    shown + &now
}

/// A command with its examples, and those of its subcommands; `path` leads to it from the program.
pub fn with_examples(mut command: clap::Command, path: &str) -> clap::Command {
    let names: Vec<String> = command.get_subcommands().map(|s| s.get_name().to_string()).collect();
    for name in names {
        let path = if path.is_empty() { name.clone() } else { format!("{path} {name}") };
        command = command.mut_subcommand(&name, |sub| with_examples(sub, &path));
    }
    if let Some(usage) = short_usage(&command, path) {
        command = command.override_usage(usage);
    }
    match help_of(path, command.has_subcommands()) {
        Some(text) => command.after_help(text),
        None => command,
    }
}

/// The usage of a command, folded where it is longer than a line: clap folds every other part of a page.
fn short_usage(command: &clap::Command, path: &str) -> Option<String> {
    const HEAD: &str = "Usage: ";
    let usage = command.clone().bin_name(format!("muprime {path}")).render_usage().to_string();
    let usage = usage.strip_prefix(HEAD)?;
    if usage.contains('\n') || HEAD.len() + usage.chars().count() <= COLUMNS {
        return None;
    }
    // A flag stays with its value.
    let words = usage.replace(" <", "\u{a0}<");
    let whole = folded(&format!("{HEAD}{words}"), HEAD.len());
    Some(whole.trim_start_matches(HEAD).replace('\u{a0}', " "))
}

//! What `muprime --help` lists: the verbs by what people do with them.

use std::fmt::Write;

/// The groups in their order, each with its verbs. A test keeps every verb in exactly one of them.
pub const GROUPS: &[(&str, &[&str])] = &[
    ("Measure", &["run", "virtual-rig", "doctor", "check", "init"]),
    ("Understand", &["diagnose", "compare", "import", "model"]),
    ("Calibrate", &["calibrate"]),
    ("Look", &["report", "watch", "dashboard", "runs", "show", "replay", "export", "recover"]),
    ("Studies", &["cases", "case", "submit", "gather"]),
    ("Develop", &["blind", "faults", "schema", "doc", "man", "completions"]),
];

/// What to type first.
const FIRST: &str = "\
Try first:
  muprime run --fast --out runs/first   a sweep on the bundled virtual rig
  muprime diagnose runs/first           why it disagrees with the model
";

/// The command with its verbs in groups.
pub fn grouped(command: clap::Command) -> clap::Command {
    let mut list = String::new();
    for (group, verbs) in GROUPS {
        let known: Vec<_> = verbs.iter().filter_map(|verb| command.find_subcommand(verb)).collect();
        if known.is_empty() {
            continue;
        }
        let _ = writeln!(list, "{group}:");
        for verb in known {
            let about = verb.get_about().map(ToString::to_string).unwrap_or_default();
            let _ = writeln!(list, "  {:<12} {about}", verb.get_name());
        }
        list.push('\n');
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{FIRST}\n{{usage-heading}} {{usage}}\n\n{list}Common options:\n{{options}}\n\
         'muprime help VERB' explains a verb and shows examples."
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn every_verb_is_in_one_group_and_fits_a_line() {
        let command = crate::Cli::command();
        for verb in command.get_subcommands() {
            let name = verb.get_name();
            let count = GROUPS.iter().flat_map(|(_, verbs)| *verbs).filter(|listed| **listed == name).count();
            assert_eq!(count, 1, "{name}");
            let about = verb.get_about().map(ToString::to_string).unwrap_or_default();
            assert!(about.len() <= 65, "{name}: {} columns", about.len());
        }
        let help = grouped(command).render_help().to_string();
        assert!(help.lines().all(|line| line.chars().count() <= 80), "{help}");
        assert!(help.contains("Try first:") && help.contains("Understand:"), "{help}");
    }
}

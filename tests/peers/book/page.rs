//! What a page of the book shows: commands with what they answer, files, and blocks that nobody can run here.

use std::path::{Path, PathBuf};

/// Whether numbers agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Near {
    /// To one in the last digit that is shown.
    LastDigit,
    /// Within this share of the larger one: they depend on the machine.
    Share(f64),
}

/// A command and what the page says of it.
#[derive(Clone, Debug)]
pub struct Command {
    /// For the shell; continued lines are joined.
    pub text: String,
    /// Lines of output; `...` stands for any lines, and an ellipsis within a line for any words.
    pub answer: Vec<String>,
    /// Where its answer stands in the page, from and to, by line.
    pub answer_lines: (usize, usize),
    /// Exit status.
    pub status: i32,
    /// How near numbers must be.
    pub near: Near,
    /// It goes on until the chapter ends.
    pub background: bool,
}

/// A part of a page that does something.
#[derive(Clone, Debug)]
pub enum Step {
    /// A file that the reader writes.
    Write {
        /// Its name.
        name: String,
        /// What is in it.
        text: String,
    },
    /// A file that the reader takes from beside the page.
    Take(PathBuf),
    /// Part of a file that is there by then.
    Shown {
        /// Its name.
        name: String,
        /// What the page shows of it.
        text: String,
    },
    /// A command.
    Run(Command),
    /// A block that is not run, and why.
    NotRun(String),
    /// An equation.
    Equation,
}

/// A page.
pub struct Page {
    /// Its file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    /// What it does, with the line where that stands (from 1).
    pub steps: Vec<(usize, Step)>,
    /// What is neither run nor marked.
    pub wrong: Vec<String>,
    /// The chapter is in wall-clock time.
    pub wall_clock: bool,
}

/// A word of a fence, such as `near=0.1`.
fn word<'a>(info: &'a str, key: &str) -> Option<&'a str> {
    info.split(' ').find_map(|w| w.strip_prefix(key).and_then(|rest| rest.strip_prefix('=')))
}

/// The commands of a console block that begins at a line.
fn commands(info: &str, lines: &[&str], first: usize) -> Result<Vec<Command>, String> {
    let near = match word(info, "near") {
        None => Near::LastDigit,
        Some(share) => Near::Share(share.parse().map_err(|_| format!("near={share} is not a number"))?),
    };
    let mut all: Vec<Command> = Vec::new();
    let mut open = false;
    for (n, line) in lines.iter().enumerate() {
        let at = first + n + 1;
        if open {
            let command = all.last_mut().expect("a command goes on");
            command.text.push('\n');
            command.text.push_str(line);
            command.answer_lines = (at, at);
        } else if let Some(text) = line.strip_prefix("$ ") {
            all.push(Command {
                text: text.to_string(),
                answer: Vec::new(),
                answer_lines: (at, at),
                status: 0,
                near,
                background: info.split(' ').any(|w| w == "background"),
            });
        } else {
            let command = all.last_mut().ok_or("a console block begins with '$ '")?;
            command.answer.push((*line).to_string());
            command.answer_lines.1 = at;
        }
        open = (open || line.starts_with("$ ")) && line.ends_with('\\');
    }
    if let (Some(status), Some(last)) = (word(info, "status"), all.last_mut()) {
        last.status = status.parse().map_err(|_| format!("status={status} is not a number"))?;
    }
    Ok(all)
}

/// Links of a line to tables of the book, which the reader saves.
fn taken(line: &str) -> impl Iterator<Item = &str> {
    let links = line.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    links.filter(|link| link.ends_with(".csv") && !link.contains("://"))
}

impl Page {
    /// Reads a page. `strict`: every block must be run or marked.
    pub fn read(path: &Path, strict: bool) -> Page {
        let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let lines: Vec<&str> = text.lines().collect();
        let (mut steps, mut wrong) = (Vec::new(), Vec::new());
        let mut reason: Option<String> = None;
        let mut n = 0;
        while n < lines.len() {
            let line = lines[n];
            if let Some(rest) = line.trim().strip_prefix("<!-- not run: ") {
                reason = Some(rest.trim_end_matches("-->").trim().to_string());
            } else if let Some(info) = line.trim_start().strip_prefix("```") {
                let indent = line.len() - line.trim_start().len();
                let end = (n + 1..lines.len()).find(|m| lines[*m].trim() == "```");
                let Some(end) = end else {
                    wrong.push(format!("line {}: a block without an end", n + 1));
                    break;
                };
                let inside: Vec<&str> =
                    lines[n + 1..end].iter().map(|l| l.get(indent..).unwrap_or(l.trim_start())).collect();
                let whole = format!("{}\n", inside.join("\n"));
                let at = n + 1;
                if info == "math" {
                    steps.push((at, Step::Equation));
                } else if let Some(why) = reason.take() {
                    steps.push((at, Step::NotRun(why)));
                } else if let Some(name) = word(info, "file") {
                    steps.push((at, Step::Write { name: name.to_string(), text: whole }));
                } else if let Some(name) = word(info, "shows") {
                    steps.push((at, Step::Shown { name: name.to_string(), text: whole }));
                } else if info == "console" || info.starts_with("console ") {
                    match commands(info, &inside, n + 1) {
                        Ok(all) => steps.extend(all.into_iter().map(|c| (at, Step::Run(c)))),
                        Err(why) => wrong.push(format!("line {at}: {why}")),
                    }
                } else if strict {
                    wrong.push(format!(
                        "line {at}: a block '{info}' that is neither run nor marked 'not run: why'"
                    ));
                }
                n = end;
            } else {
                let folder = path.parent().expect("a page has a folder");
                steps.extend(taken(line).map(|link| (n + 1, Step::Take(folder.join(link)))));
                if !line.trim().is_empty() {
                    reason = None;
                }
            }
            n += 1;
        }
        let wall_clock = text.contains("<!-- wall clock -->");
        Page { path: path.to_path_buf(), text, steps, wrong, wall_clock }
    }

    /// Its commands.
    pub fn commands(&self) -> impl Iterator<Item = &Command> {
        self.steps.iter().filter_map(|(_, step)| match step {
            Step::Run(command) => Some(command),
            _ => None,
        })
    }
}

//! A chapter followed as a reader would: its files written, its commands run in order, in a folder of its own.

use super::compare::agrees;
use super::page::{Command, Page, Step};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// How often a command in wall-clock time is given, where the machine stalls each time.
const ATTEMPTS: u32 = 16;

/// What came of a chapter.
#[derive(Default)]
pub struct Followed {
    /// Commands that were run.
    pub commands: usize,
    /// Files that were written, taken or shown.
    pub files: usize,
    /// What did not come as the page says.
    pub wrong: Vec<String>,
    /// Answers that came instead: lines of the page, from and to, and what belongs there.
    pub came: Vec<((usize, usize), Vec<String>)>,
}

/// Commands that go on until the chapter is over, each a group of processes.
struct Background(Vec<Child>);

impl Drop for Background {
    fn drop(&mut self) {
        for child in &mut self.0 {
            // SAFETY: a signal to the group of a child that has not been waited for.
            unsafe { libc::kill(-(child.id() as i32), libc::SIGTERM) };
            let _ = child.wait();
        }
    }
}

/// The shell in which a reader sits: this build's `muprime`, the peers' Python, a home and a catalogue of its own.
fn shell(text: &str, folder: &Path) -> std::process::Command {
    let muprime = PathBuf::from(tests::muprime().get_program());
    let beside = std::fs::canonicalize(muprime.parent().expect("it stands in a folder")).expect("a folder");
    let python = std::fs::canonicalize(tests::file("target/venv/bin")).expect("run tests/venv");
    let path = std::env::var("PATH").unwrap_or_default();
    let mut shell = std::process::Command::new("bash");
    shell.args(["-c", text]).current_dir(folder).stdin(Stdio::null());
    shell.env("PATH", format!("{}:{}:{path}", beside.display(), python.display()));
    shell.env("HOME", folder.join(".home")).env("MUPRIME_RUNS", folder.join("runs"));
    shell.env("LC_ALL", "C.UTF-8").env("TERM", "dumb").env("NO_COLOR", "1").env("PYTHONUNBUFFERED", "1");
    shell.env_remove("MUPRIME_LOG").env_remove("COLUMNS").env_remove("MUPRIME_PROFILES");
    shell
}

/// A command's words and errors in the order in which they came, and its status.
fn answer(command: &Command, folder: &Path) -> (String, Option<i32>) {
    let output = shell(&format!("{{ {}\n}} 2>&1", command.text), folder).output().expect("bash runs");
    (String::from_utf8_lossy(&output.stdout).into_owned(), output.status.code())
}

/// The same; in wall-clock time a command whose answer is another than the page's beside a stall of the machine is given again, as the page
/// says: a run then goes on where it was cut, and `doctor` looks anew. A wrong answer without a stall stands.
fn settled(command: &Command, folder: &Path, wall_clock: bool) -> (String, Option<i32>) {
    if !wall_clock {
        return answer(command, folder);
    }
    let mut attempt = 1;
    loop {
        let began = realtime::pacing::monotonic_ns();
        let monitor = realtime::stall_monitor::StallMonitor::start(began).expect("threads start");
        let (said, status) = answer(command, folder);
        let stalls = monitor.finish();
        let came: Vec<&str> = said.lines().collect();
        let right = status == Some(command.status) && agrees(&command.answer, &came, command.near);
        if right || stalls.count == 0 || attempt == ATTEMPTS {
            return (said, status);
        }
        eprintln!(
            "attempt {attempt}: {} stalls, {} ms at most:\n{said}",
            stalls.count,
            stalls.worst.0 / 1_000_000
        );
        attempt += 1;
    }
}

/// Starts a command that goes on, and waits for what the page says that it answers.
fn start(command: &Command, folder: &Path, background: &mut Background) -> Result<(), String> {
    let log = folder.join(format!(".background-{}", background.0.len()));
    let file = std::fs::File::create(&log).expect("a folder that can be written");
    let mut shell = shell(&command.text, folder);
    shell.process_group(0).stdout(file.try_clone().expect("a file")).stderr(file);
    background.0.push(shell.spawn().expect("bash runs"));
    let began = Instant::now();
    loop {
        let said = std::fs::read_to_string(&log).unwrap_or_default();
        let came: Vec<&str> = said.lines().collect();
        if agrees(&command.answer, &came, command.near) {
            return Ok(());
        }
        if began.elapsed() > Duration::from_secs(30) {
            return Err(format!("`{}` said within 30 s:\n{said}", command.text));
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Follows a page in a folder. After a step that went wrong the rest is left out: it builds on it.
pub fn follow(page: &Page, folder: &Path) -> Followed {
    let mut seen = Followed::default();
    let mut background = Background(Vec::new());
    std::fs::create_dir_all(folder.join(".home")).expect("a folder that can be written");
    let update = std::env::var_os("MUPRIME_UPDATE").is_some();
    for (line, step) in &page.steps {
        let at = format!("{}:{line}", page.path.display());
        let fault = match step {
            Step::Equation | Step::NotRun(_) => continue,
            Step::Write { name, text } => {
                let path = folder.join(name);
                std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
                seen.files += 1;
                std::fs::write(path, text).err().map(|e| format!("{name}: {e}"))
            }
            Step::Take(from) => {
                seen.files += 1;
                let name = from.file_name().expect("a file");
                std::fs::copy(from, folder.join(name)).err().map(|e| format!("{}: {e}", from.display()))
            }
            Step::Shown { name, text } => {
                seen.files += 1;
                match std::fs::read_to_string(folder.join(name)) {
                    Ok(there) if there.contains(text.as_str()) => None,
                    Ok(there) => Some(format!("{name} does not hold this:\n{text}\nbut\n{there}")),
                    Err(error) => Some(format!("{name}: {error}")),
                }
            }
            Step::Run(command) if command.background => {
                seen.commands += 1;
                start(command, folder, &mut background).err()
            }
            Step::Run(command) => {
                seen.commands += 1;
                let (said, status) = settled(command, folder, page.wall_clock);
                let came: Vec<&str> = said.lines().collect();
                if status != Some(command.status) {
                    Some(format!("`{}` ended with {status:?}, not {}:\n{said}", command.text, command.status))
                } else if agrees(&command.answer, &came, command.near) {
                    None
                } else if update {
                    seen.came.push((command.answer_lines, came.iter().map(|l| (*l).to_string()).collect()));
                    None
                } else {
                    Some(format!(
                        "`{}` is to answer\n{}\nand answered\n{said}",
                        command.text,
                        command.answer.join("\n")
                    ))
                }
            }
        };
        if let Some(fault) = fault {
            seen.wrong.push(format!("{at}: {fault}"));
            break;
        }
    }
    seen
}

/// Puts what came into the page: with `MUPRIME_UPDATE=1`.
pub fn update(page: &Page, came: &[((usize, usize), Vec<String>)]) {
    let mut lines: Vec<String> = page.text.lines().map(str::to_string).collect();
    for ((from, to), new) in came.iter().rev() {
        lines.splice(*from..*to, new.iter().cloned());
    }
    std::fs::write(&page.path, lines.join("\n") + "\n").expect("a page that can be written");
}

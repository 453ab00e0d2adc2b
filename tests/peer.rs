//! A program that nobody here wrote, started by a test.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

/// A program that ends with the test.
pub struct Peer(pub Child);

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts a program and returns the first line that it prints.
pub fn start(command: &mut Command) -> (Peer, String) {
    let mut child = command.stdout(Stdio::piped()).spawn().expect("a program that can be run");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("text");
    assert!(!line.is_empty(), "the program ended without a word");
    (Peer(child), line.trim().to_string())
}

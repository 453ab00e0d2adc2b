//! What is wrong with a profile, where in the file, and what to do about it.

use std::ops::Range;

/// A profile was refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProfileError {
    /// What is wrong.
    pub message: String,
    /// What to do about it; empty where the message says it all.
    pub help: String,
    /// The bytes of the file that the message speaks of.
    pub span: Option<Range<usize>>,
    /// Line and column of the start of `span`, both from 1.
    pub place: Option<(usize, usize)>,
}

impl ProfileError {
    /// An error at `span` of `text`.
    pub fn at(text: &str, span: Option<Range<usize>>, message: impl ToString) -> Self {
        let place = span.as_ref().map(|span| line_and_column(text, span.start));
        Self { message: message.to_string(), help: String::new(), span, place }
    }

    /// The same error with a remedy.
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = help.into();
        self
    }
}

impl std::fmt::Display for ProfileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some((line, column)) = self.place {
            write!(f, "line {line}, column {column}: ")?;
        }
        f.write_str(&self.message)?;
        if !self.help.is_empty() {
            write!(f, " ({})", self.help)?;
        }
        Ok(())
    }
}

impl std::error::Error for ProfileError {}

fn line_and_column(text: &str, at: usize) -> (usize, usize) {
    let before = &text.as_bytes()[..at.min(text.len())];
    let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
    let column = before.iter().rev().take_while(|&&byte| byte != b'\n').count() + 1;
    (line, column)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_counts_from_one() {
        assert_eq!(line_and_column("a\nbc\n", 0), (1, 1));
        assert_eq!(line_and_column("a\nbc\n", 3), (2, 2));
        assert_eq!(line_and_column("a\nbc\n", 99), (3, 1));
    }
}

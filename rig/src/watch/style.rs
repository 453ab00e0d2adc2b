//! What a terminal can show: colours, and signs beyond ASCII.

use ratatui_core::style::{Color, Modifier, Style};

/// What a terminal can show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Look {
    /// Colours, which only repeat what words and shapes say.
    pub colour: bool,
    /// Signs beyond ASCII.
    pub unicode: bool,
}

impl Look {
    /// By the environment: no colour where `NO_COLOR` asks for none or `TERM` has none; signs by the locale.
    pub fn of(variable: impl Fn(&str) -> Option<String>) -> Self {
        let given = |name: &str| variable(name).filter(|value| !value.is_empty());
        let plain = given("TERM")
            .is_none_or(|term| ["dumb", "vt100", "vt102", "vt220", "linux-m"].iter().any(|t| term == *t));
        let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(given).unwrap_or_default();
        let locale = locale.to_lowercase();
        let colour = given("NO_COLOR").is_none() && !plain;
        Look { colour, unicode: locale.contains("utf-8") || locale.contains("utf8") }
    }

    /// A style that stands out in this colour, bold where there is none.
    pub fn strong(self, colour: Color) -> Style {
        let style = Style::new().add_modifier(Modifier::BOLD);
        if self.colour { style.fg(colour) } else { style }
    }

    /// A style for what must not be overlooked.
    pub fn alarm(self) -> Style {
        let style = Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED);
        if self.colour { style.fg(Color::Red) } else { style }
    }

    /// A style for headings.
    pub fn heading(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }
}

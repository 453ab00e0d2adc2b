//! Lines of text with numbers in them, both ways: `AMP={amplitude}%,FREQ={frequency:.1}kHz`.
//!
//! | in a line | means |
//! |---|---|
//! | `{name}` | a decimal number |
//! | `{name:.3}` | the same; three decimals are sent, so that 0.001 is its step |
//! | `{name:x}`, `{name:04X}` | a whole number in hexadecimal digits, padded with zeros to that width |
//! | `{name:OFF\|ON}` | one of these words, which stand for 0, 1 and so on |
//! | `{*}` | anything, up to what follows |
//! | `{{`, `}}` | a brace |
//!
//! A space stands for one or more of them; spaces before a number and between its sign and its digits do not count. All else must be there as it is written.

/// How a number is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Form {
    /// A decimal number, with so many decimals where they are stated.
    Decimal(Option<u8>),
    /// A whole number in hexadecimal digits: least width, and whether in capitals.
    Hex(u8, bool),
    /// Words for 0, 1 and so on.
    Words(Vec<String>),
}

impl Form {
    /// The smallest difference between two numbers; `None` where the form does not say.
    pub fn step(&self) -> Option<f64> {
        match self {
            Self::Decimal(decimals) => decimals.map(|decimals| 10_f64.powi(-i32::from(decimals))),
            Self::Hex(..) | Self::Words(_) => Some(1.0),
        }
    }

    /// The form that `text` states, if it is one.
    fn parse(text: &str) -> Option<Self> {
        if let Some(decimals) = text.strip_prefix('.') {
            return decimals.parse().ok().filter(|decimals| *decimals <= 12).map(|n| Self::Decimal(Some(n)));
        }
        if text.contains('|') {
            let words: Vec<String> = text.split('|').map(String::from).collect();
            let repeated = words.iter().enumerate().any(|(i, word)| words[..i].contains(word));
            let empty = words.iter().any(String::is_empty);
            return (!repeated && !empty).then_some(Self::Words(words));
        }
        let width = text.strip_suffix(['x', 'X'])?;
        let width = if width.is_empty() { 0 } else { width.parse().ok()? };
        (width <= 13).then_some(Self::Hex(width, text.ends_with('X')))
    }

    /// The number at the head of `text`, and what follows.
    fn read<'a>(&self, text: &'a str) -> Option<(f64, &'a str)> {
        match self {
            Self::Decimal(_) => decimal(text.trim_start()),
            Self::Hex(..) => {
                let text = text.trim_start();
                let digits = text.bytes().take_while(u8::is_ascii_hexdigit).count();
                // More would not be exact.
                let number = u64::from_str_radix(&text[..digits], 16).ok().filter(|_| digits <= 13)?;
                Some((number as f64, &text[digits..]))
            }
            Self::Words(words) => {
                // The longest: one word may begin another.
                let fits = words.iter().enumerate().filter(|(_, word)| text.starts_with(word.as_str()));
                let (at, word) = fits.max_by_key(|(_, word)| word.len())?;
                Some((at as f64, &text[word.len()..]))
            }
        }
    }

    fn write(&self, value: f64, decimals: u8) -> String {
        match self {
            Self::Decimal(stated) => format!("{value:.*}", usize::from(stated.unwrap_or(decimals))),
            Self::Hex(width, capitals) => {
                // Saturates: a negative number becomes zero.
                let (number, width) = (value.round() as u64, usize::from(*width));
                if *capitals { format!("{number:0width$X}") } else { format!("{number:0width$x}") }
            }
            Self::Words(words) => {
                let last = words.len().saturating_sub(1);
                words.get((value.round() as usize).min(last)).cloned().unwrap_or_default()
            }
        }
    }
}

/// The decimal number at the head of `text`, and what follows. Only digits, a sign, a point and an exponent:
/// Rust would read `inf` as well.
fn decimal(text: &str) -> Option<(f64, &str)> {
    let bytes = text.as_bytes();
    let digits =
        |from: usize| bytes[from.min(bytes.len())..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let signed = usize::from(matches!(bytes.first(), Some(b'+' | b'-')));
    // Balances write the sign first and fill up with spaces.
    let sign = signed + bytes[signed..].iter().take_while(|byte| signed == 1 && **byte == b' ').count();
    let mut end = sign + digits(sign);
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits(end + 1 + sign);
        // A letter that begins a unit is not an exponent.
        end += if exponent > 0 { 1 + sign + exponent } else { 0 };
    }
    let number = format!("{}{}", &text[..signed], &text[sign..end]);
    number.parse().ok().filter(|number: &f64| number.is_finite()).map(|number| (number, &text[end..]))
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Part {
    Literal(String),
    Field(String, Form),
    Any,
}

/// What is wrong with a pattern.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum PatternError {
    #[error("a brace without its other; `{{{{` is one brace")]
    Brace,
    #[error("`:{0}` is not a form: `.3`, `x`, `04X`, or words as in `OFF|ON`")]
    Form(String),
    #[error("between `{{*}}` and `{{{0}}}` something must stand")]
    Neighbours(String),
    #[error("`{{{0}}}` stands there twice")]
    Twice(String),
}

/// A line with numbers in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern(Vec<Part>);

impl Pattern {
    /// Reads a pattern. A field without a name is the value of whoever owns the pattern.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, PatternError> {
        let (mut parts, mut literal, mut rest) = (Vec::new(), String::new(), text);
        while let Some(at) = rest.find(['{', '}']) {
            literal.push_str(&rest[..at]);
            let brace = &rest[at..=at];
            rest = &rest[at + 1..];
            if let Some(after) = rest.strip_prefix(brace) {
                literal.push_str(brace);
                rest = after;
                continue;
            }
            let end = rest.find('}').filter(|_| brace == "{").ok_or(PatternError::Brace)?;
            let (inside, after) = (&rest[..end], &rest[end + 1..]);
            rest = after;
            if !literal.is_empty() {
                parts.push(Part::Literal(std::mem::take(&mut literal)));
            }
            let open = matches!(parts.last(), Some(Part::Any));
            if inside == "*" {
                parts.push(Part::Any);
                continue;
            }
            let (name, form) = match inside.split_once(':') {
                Some((name, form)) => {
                    (name, Form::parse(form).ok_or_else(|| PatternError::Form(form.into()))?)
                }
                None => (inside, Form::Decimal(None)),
            };
            if open {
                return Err(PatternError::Neighbours(inside.into()));
            }
            if parts.iter().any(|part| matches!(part, Part::Field(known, _) if known == name)) {
                return Err(PatternError::Twice(name.into()));
            }
            parts.push(Part::Field(name.into(), form));
        }
        literal.push_str(rest);
        if !literal.is_empty() {
            parts.push(Part::Literal(literal));
        }
        Ok(Self(parts))
    }

    /// Names and forms of its numbers, in their order.
    pub fn fields(&self) -> impl Iterator<Item = (&str, &Form)> {
        self.0.iter().filter_map(|part| match part {
            Part::Field(name, form) => Some((name.as_str(), form)),
            _ => None,
        })
    }

    /// What every such line begins with.
    pub fn head(&self) -> &str {
        if let Some(Part::Literal(text)) = self.0.first() { text } else { "" }
    }

    /// Characters that a line has at the least.
    pub fn least_length(&self) -> usize {
        let length = |part: &Part| match part {
            Part::Literal(text) => text.len(),
            Part::Field(..) => 1,
            Part::Any => 0,
        };
        self.0.iter().map(length).sum()
    }

    /// The numbers of a line; `None` where it is no such line. Spaces at its ends do not count.
    pub fn read(&self, line: &str) -> Option<Vec<f64>> {
        let (mut rest, mut values) = (line.trim(), Vec::new());
        let last = self.0.len().saturating_sub(1);
        for (at, part) in self.0.iter().enumerate() {
            match part {
                Part::Literal(text) => {
                    let text = if at == 0 { text.trim_start() } else { text };
                    rest = after(rest, if at == last { text.trim_end() } else { text })?;
                }
                Part::Field(_, form) => {
                    let (value, left) = form.read(rest)?;
                    values.push(value);
                    rest = left;
                }
                Part::Any => {
                    rest = match self.0.get(at + 1) {
                        Some(Part::Literal(text)) => &rest[rest.find(text.as_str())?..],
                        _ => "",
                    }
                }
            }
        }
        rest.is_empty().then_some(values)
    }

    /// The line that has these numbers; those whose form states no decimals have `decimals` of them. A number
    /// that is missing is zero.
    pub fn write(&self, values: &[f64], decimals: u8) -> String {
        let mut values = values.iter().copied();
        let write = |part: &Part| match part {
            Part::Literal(text) => text.clone(),
            Part::Field(_, form) => form.write(values.next().unwrap_or(0.0), decimals),
            Part::Any => String::new(),
        };
        self.0.iter().map(write).collect()
    }
}

/// What follows `literal` at the head of `text`; a space in it stands for one or more.
fn after<'a>(text: &'a str, literal: &str) -> Option<&'a str> {
    let mut rest = text;
    for (at, word) in literal.split(' ').enumerate() {
        if at > 0 {
            let trimmed = rest.trim_start();
            if trimmed.len() == rest.len() && !text[..text.len() - rest.len()].ends_with(' ') {
                return None;
            }
            rest = trimmed;
        }
        rest = rest.strip_prefix(word)?;
    }
    Some(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(pattern: &str, line: &str) -> Option<Vec<f64>> {
        Pattern::parse(pattern).unwrap_or_else(|why| panic!("{why}")).read(line)
    }

    #[test]
    fn lines_are_read() {
        for (pattern, line, expected) in [
            ("AMP={a}%", "AMP=50%", Some(vec![50.0])),
            ("AMP={a}%", " AMP= +50.5%\r", Some(vec![50.5])),
            ("AMP={a}%", "AMP=50", None),
            ("AMP={a}%", "AMP=x%", None),
            ("AMP={a}%", "PHASE=50%", None),
            ("AMP={a}%", "AMP=50% AND MORE", None),
            ("{a},{b},{c}", "1.5,-2e-3,+.25", Some(vec![1.5, -2e-3, 0.25])),
            ("{a},{b},{c}", "1.5,2", None),
            ("F {f} kHz", "F   27.5   kHz", Some(vec![27.5])),
            ("F {f} kHz", "F27.5 kHz", None),
            ("{f}e", "5e", Some(vec![5.0])),
            ("S{s:x}", "S1fA0", Some(vec![8096.0])),
            ("S{s:x}", "S", None),
            ("S{s:x}", "S12345678901234", None),
            ("OUT {on:OFF|ON|ONCE}", "OUT ONCE", Some(vec![2.0])),
            ("OUT {on:OFF|ON|ONCE}", "OUT ON", Some(vec![1.0])),
            ("OUT {on:OFF|ON|ONCE}", "OUT MAYBE", None),
            ("{*}={v} N", "channel two=-1.25 N", Some(vec![-1.25])),
            ("{*}={v} N", "channel two -1.25 N", None),
            ("v{v}{*}", "v3 and so on", Some(vec![3.0])),
            ("{{{v}}}", "{7}", Some(vec![7.0])),
            ("N {v} g", "N     -   62.916 g", Some(vec![-62.916])),
            ("N {v} g", "N     +   62.916 g", Some(vec![62.916])),
            ("N {v} g", "N     -   g", None),
            ("N {v} g", "N     - - 2 g", None),
            ("{a},{b}", "- 1,+ 2", Some(vec![-1.0, 2.0])),
            ("{v}", "inf", None),
            ("{v}", "nan", None),
            ("{v}", "1e999", None),
            ("{v}", "", None),
            ("OK", "OK", Some(vec![])),
        ] {
            assert_eq!(read(pattern, line), expected, "{pattern} {line}");
        }
    }

    #[test]
    fn what_is_written_is_read_back() {
        for (pattern, values, line) in [
            ("AMP={a:.1}%,F={f:.3}", vec![50.04, 27.5], "AMP=50.0%,F=27.500"),
            ("W{a:04X}", vec![171.0], "W00AB"),
            ("W{a:x}", vec![171.2], "Wab"),
            ("O {on:OFF|ON}", vec![1.0], "O ON"),
            ("{a}", vec![1.23456], "1.23"),
        ] {
            let pattern = Pattern::parse(pattern).unwrap();
            assert_eq!(pattern.write(&values, 2), line);
            assert!(pattern.read(line).is_some(), "{line}");
        }
    }

    #[test]
    fn what_is_no_pattern_is_refused() {
        for text in
            ["{a", "a}", "{a:q}", "{a:.}", "{a:.99}", "{a}{a}", "{*}{a}", "{a:ON|ON}", "{a:|}", "{a:99x}"]
        {
            assert!(Pattern::parse(text).is_err(), "{text}");
        }
    }
}

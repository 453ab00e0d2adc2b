//! The tiny total language of a profile's conditions.
//!
//! Numbers (`12`, `0x4F`, `2.5`), names of signals, `+ - * /`, `& |` on whole numbers, comparisons,
//! `&& || !`, parentheses and `pow10(x)`. Truth is 1 and falsehood 0. There is no loop, no
//! assignment and no call but `pow10`, so every expression ends. It is compiled when the profile is
//! read; evaluation allocates nothing.

/// A compiled expression; names became indices of signals.
#[derive(Debug, Clone)]
pub struct Expression(Node);

type Unary = fn(f64) -> f64;
type Binary = fn(f64, f64) -> f64;

#[derive(Debug, Clone)]
enum Node {
    Number(f64),
    Signal(usize),
    Unary(Unary, Box<Node>),
    Binary(Binary, Box<Node>, Box<Node>),
}

/// Operators by how tightly they bind, the loosest first; longer spellings before their prefixes.
/// Unlike C, `&` binds tighter than `==`, so `status & 0x4F == 8` means what it looks like.
const LEVELS: [&[(&str, Binary)]; 7] = [
    &[("||", |a, b| truth(a != 0.0 || b != 0.0))],
    &[("&&", |a, b| truth(a != 0.0 && b != 0.0))],
    &[
        ("==", |a, b| truth(a == b)),
        ("!=", |a, b| truth(a != b)),
        ("<=", |a, b| truth(a <= b)),
        (">=", |a, b| truth(a >= b)),
        ("<", |a, b| truth(a < b)),
        (">", |a, b| truth(a > b)),
    ],
    &[("|", |a, b| bits(a, b, |a, b| a | b))],
    &[("&", |a, b| bits(a, b, |a, b| a & b))],
    &[("+", |a, b| a + b), ("-", |a, b| a - b)],
    &[("*", |a, b| a * b), ("/", |a, b| a / b)],
];

/// Brackets and signs deeper than this are refused, so that a hostile file cannot exhaust the stack.
const DEEPEST: usize = 40;

/// Text that is no expression.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum ExpressionError {
    #[error("{what} expected at character {at}")]
    Expected { what: &'static str, at: usize },
    #[error("{what} expected after {after}")]
    ExpectedAfter { what: &'static str, after: &'static str },
    #[error("unexpected `{rest}` at character {at}")]
    Unexpected { rest: String, at: usize },
    #[error("nested more than {DEEPEST} deep")]
    TooDeep,
    #[error("`{word}` is not {kind}")]
    Number { word: String, kind: &'static str },
    #[error("no signal is called `{0}`")]
    UnknownSignal(String),
}

type Parsed<T> = Result<T, ExpressionError>;

impl Expression {
    /// Compiles `text`; `index` gives a signal's place by its name.
    ///
    /// # Errors
    /// Says what was expected, and at which character.
    pub fn compile(text: &str, index: &dyn Fn(&str) -> Option<usize>) -> Result<Self, ExpressionError> {
        let mut parser = Parser { text, at: 0, depth: 0, index };
        let node = parser.level(0)?;
        parser.skip_space();
        if parser.at < text.len() {
            return Err(ExpressionError::Unexpected { rest: parser.rest().into(), at: parser.at + 1 });
        }
        Ok(Self(node))
    }

    /// The value, with the signals' values by index (a missing one counts as not a number).
    pub fn value(&self, signals: &[f64]) -> f64 {
        evaluate(&self.0, signals)
    }

    /// Whether the value is true: not zero and a number.
    pub fn holds(&self, signals: &[f64]) -> bool {
        let value = self.value(signals);
        value != 0.0 && !value.is_nan()
    }
}

// raw counts and bits are whole numbers, exactly
fn evaluate(node: &Node, signals: &[f64]) -> f64 {
    match node {
        Node::Number(number) => *number,
        Node::Signal(index) => signals.get(*index).copied().unwrap_or(f64::NAN),
        Node::Unary(of, inner) => of(evaluate(inner, signals)),
        Node::Binary(of, left, right) => of(evaluate(left, signals), evaluate(right, signals)),
    }
}

fn truth(yes: bool) -> f64 {
    f64::from(yes)
}

// status words have at most 32 bits
fn bits(a: f64, b: f64, operation: impl Fn(i64, i64) -> i64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { operation(a as i64, b as i64) as f64 }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    index: &'a dyn Fn(&str) -> Option<usize>,
}

impl Parser<'_> {
    fn skip_space(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start().len();
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn take(&mut self, token: &str) -> bool {
        self.skip_space();
        let found = self.rest().starts_with(token);
        self.at += if found { token.len() } else { 0 };
        found
    }

    fn level(&mut self, level: usize) -> Parsed<Node> {
        let Some(operators) = LEVELS.get(level) else { return self.unary() };
        let mut left = self.level(level + 1)?;
        'more: loop {
            self.skip_space();
            for (token, operator) in *operators {
                // `|` must not eat the first half of `||`.
                let doubled =
                    token.len() == 1 && "|&".contains(token) && self.rest().starts_with(&token.repeat(2));
                if !doubled && self.take(token) {
                    let right = self.level(level + 1)?;
                    left = Node::Binary(*operator, Box::new(left), Box::new(right));
                    continue 'more;
                }
            }
            return Ok(left);
        }
    }

    fn unary(&mut self) -> Parsed<Node> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(ExpressionError::TooDeep);
        }
        self.skip_space();
        let node = if !self.rest().starts_with("!=") && self.take("!") {
            Node::Unary(|x| truth(x == 0.0), Box::new(self.unary()?))
        } else if self.take("-") {
            Node::Unary(|x| -x, Box::new(self.unary()?))
        } else {
            self.atom()?
        };
        self.depth -= 1;
        Ok(node)
    }

    /// Takes `token`, or refuses it by the place where it should be.
    fn demand(&mut self, token: &str, refusal: impl FnOnce(usize) -> ExpressionError) -> Parsed<()> {
        if self.take(token) { Ok(()) } else { Err(refusal(self.at + 1)) }
    }

    fn atom(&mut self) -> Parsed<Node> {
        if self.take("(") {
            let inner = self.level(0)?;
            self.demand(")", |at| ExpressionError::Expected { what: "`)`", at })?;
            return Ok(inner);
        }
        self.skip_space();
        let start = self.at;
        let length = self
            .rest()
            .find(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.'))
            .unwrap_or(self.rest().len());
        let word = &self.text[start..start + length];
        self.at += length;
        if word.is_empty() {
            let what = "a number or the name of a signal";
            return Err(ExpressionError::Expected { what, at: start + 1 });
        }
        let wrong = |kind| ExpressionError::Number { word: word.into(), kind };
        if let Some(hex) = word.strip_prefix("0x") {
            let number = u32::from_str_radix(hex, 16);
            let number = number.map_err(|_| wrong("a hexadecimal number of 32 bits"))?;
            return Ok(Node::Number(f64::from(number)));
        }
        if word.starts_with(|c: char| c.is_ascii_digit()) {
            return word.parse().map(Node::Number).map_err(|_| wrong("a number"));
        }
        if word == "pow10" {
            let after = |what, after| move |_| ExpressionError::ExpectedAfter { what, after };
            self.demand("(", after("`(`", "`pow10`"))?;
            let inner = self.level(0)?;
            self.demand(")", after("`)`", "`pow10(`"))?;
            return Ok(Node::Unary(|x| 10_f64.powf(x), Box::new(inner)));
        }
        (self.index)(word).map(Node::Signal).ok_or_else(|| ExpressionError::UnknownSignal(word.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        let index = |name: &str| ["a", "b", "nan"].iter().position(|&known| known == name);
        Expression::compile(text, &index).expect(text).value(&[6.0, 3.0, f64::NAN])
    }

    #[test]
    // whole numbers
    fn arithmetic_and_logic() {
        for (text, expected) in [
            ("1 + 2 * 3", 7.0),
            ("(1 + 2) * 3", 9.0),
            ("a / b - -1", 3.0),
            ("a & 0x2 == 2", 1.0),
            ("a | 1", 7.0),
            ("a == 6 && b != 3 || a >= 6", 1.0),
            ("!(a < b)", 1.0),
            ("pow10(-2) * 1234", 12.34),
            ("nan == nan", 0.0),
        ] {
            assert_eq!(value(text), expected, "{text}");
        }
    }

    #[test]
    fn a_missing_value_is_never_true() {
        let expression = Expression::compile("x & 4", &|_| Some(0)).unwrap();
        assert!(!expression.holds(&[f64::NAN]));
        assert!(!expression.holds(&[]));
    }

    #[test]
    fn faults_in_an_expression_are_reported() {
        let none = |_: &str| None;
        for (text, problem) in [
            ("1 +", "expected at character 4"),
            ("speed > 1", "no signal is called `speed`"),
            ("(1", "`)` expected"),
            ("1 2", "unexpected `2`"),
            ("0xZZ", "hexadecimal"),
            ("", "expected at character 1"),
        ] {
            let error = Expression::compile(text, &none).unwrap_err().to_string();
            assert!(error.contains(problem), "{text}: {error}");
        }
        assert!(Expression::compile(&"(".repeat(10_000), &none).is_err());
    }
}

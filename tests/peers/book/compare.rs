//! What a command answered beside what the page says.

use super::page::Near;

/// Text and numbers by turns: `12.5 mm` is ["", "12.5", " mm"].
fn pieces(line: &str) -> Vec<String> {
    let letters: Vec<char> = line.chars().collect();
    let mut pieces = vec![String::new()];
    let mut n = 0;
    while n < letters.len() {
        // Digits within a word are part of it: `fig9`, `mu2F`.
        let within = n > 0 && (letters[n - 1].is_ascii_alphanumeric() || letters[n - 1] == '_');
        if letters[n].is_ascii_digit() && !within {
            let mut end = n;
            while end < letters.len()
                && (letters[end].is_ascii_digit()
                    || (letters[end] == '.' && letters.get(end + 1).is_some_and(char::is_ascii_digit))
                    || (letters[end] == 'e'
                        && letters.get(end + 1).is_some_and(|c| c.is_ascii_digit() || *c == '-')
                        && letters.get(end + 2).is_some_and(char::is_ascii_digit)))
            {
                end += 1;
            }
            pieces.push(letters[n..end].iter().collect());
            pieces.push(String::new());
            n = end;
        } else {
            pieces.last_mut().expect("there is one").push(letters[n]);
            n += 1;
        }
    }
    pieces
}

/// One in the last digit of a number as it is written.
fn last_digit(number: &str) -> f64 {
    let (mantissa, exponent) = number.split_once('e').unwrap_or((number, "0"));
    let decimals = mantissa.split_once('.').map_or(0, |(_, d)| d.len() as i32);
    10f64.powi(exponent.parse::<i32>().unwrap_or(0) - decimals)
}

fn numbers_agree(said: &str, came: &str, near: Near) -> bool {
    let (Ok(a), Ok(b)) = (said.parse::<f64>(), came.parse::<f64>()) else { return said == came };
    match near {
        Near::LastDigit => (a - b).abs() <= 1.000_001 * last_digit(said).max(last_digit(came)),
        Near::Share(share) => (a - b).abs() <= share * a.abs().max(b.abs()),
    }
}

/// Whether two lines agree, without what an ellipsis stands for.
pub fn line_agrees(said: &str, came: &str, near: Near) -> bool {
    let squeeze = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    let (said, came) = (squeeze(said), squeeze(came));
    let Some((head, tail)) = said.split_once('\u{2026}') else { return whole(&said, &came, near) };
    let places = || came.char_indices().map(|(n, _)| n).chain([came.len()]);
    // What the ellipsis stands for begins after some start that agrees with the head, and ends before some end that agrees with the tail.
    let begins = places().find(|n| whole(head, &came[..*n], near));
    begins.is_some_and(|begins| places().any(|ends| ends >= begins && whole(tail, &came[ends..], near)))
}

/// Whether text is equal and numbers agree.
fn whole(said: &str, came: &str, near: Near) -> bool {
    let (a, b) = (pieces(said), pieces(came));
    a.len() == b.len()
        && a.iter()
            .zip(&b)
            .enumerate()
            .all(|(n, (x, y))| if n % 2 == 1 { numbers_agree(x, y, near) } else { x == y })
}

/// Whether an answer is what the page says; a line `...` stands for any lines.
pub fn agrees(said: &[String], came: &[&str], near: Near) -> bool {
    match said.split_first() {
        None => came.is_empty(),
        Some((skip, rest)) if skip.trim() == "..." => {
            (0..=came.len()).any(|n| agrees(rest, &came[n..], near))
        }
        Some((first, rest)) => came
            .split_first()
            .is_some_and(|(line, others)| line_agrees(first, line, near) && agrees(rest, others, near)),
    }
}

#[cfg(test)]
mod tests {
    use super::{Near, agrees, line_agrees};

    #[test]
    fn numbers_to_the_last_digit_words_to_the_letter() {
        let exact = |a, b| line_agrees(a, b, Near::LastDigit);
        assert!(exact("mu' = 0.2957 +- 0.0012", "mu' =  0.2958 +- 0.0012"));
        assert!(!exact("mu' = 0.2957", "mu' = 0.2959"));
        assert!(!exact("mu' = 0.2957", "mu = 0.2957"));
        assert!(!exact("fig9", "fig8"));
        assert!(!exact("98 passes", "88 passes"));
        assert!(exact("took … s of all", "took 12.3 s of all"));
        assert!(!exact("took … s of all", "took 12.3 s of some"));
        assert!(
            exact("a 1.50 mm, …", "a 1.51 mm, 3 of them") && !exact("a 1.50 mm, …", "a 1.53 mm, 3 of them")
        );
        assert!(exact("muprime 0.…", "muprime 0.1.0") && !exact("muprime 0.…", "muprime 2.1.0"));
        assert!(exact("… 12 of 40 s", "took 12 of 40 s") && !exact("… 12 of 40 s", "took 12 of 90 s"));
        assert!(line_agrees("in 10 s", "in 13 s", Near::Share(0.3)));
        assert!(!line_agrees("in 10 s", "in 23 s", Near::Share(0.3)));
        assert!(exact("p < 1e-6", "p < 1e-6") && !exact("p < 1e-6", "p < 1e-2"));
    }

    #[test]
    fn lines_may_be_left_out_where_the_page_says_so() {
        let said = |lines: &[&str]| lines.iter().map(|l| (*l).to_string()).collect::<Vec<_>>();
        let came = ["one", "two", "three"];
        assert!(agrees(&said(&["one", "...", "three"]), &came, Near::LastDigit));
        assert!(agrees(&said(&["one", "two", "three", "..."]), &came, Near::LastDigit));
        assert!(!agrees(&said(&["one", "three"]), &came, Near::LastDigit));
        assert!(!agrees(&said(&["one", "..."]), &[], Near::LastDigit));
        assert!(!agrees(&said(&["one", "two"]), &came, Near::LastDigit));
    }
}

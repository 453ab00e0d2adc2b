//! Pieces of a page: safe text, the shell around a body, tables, figures, the words of the field.

use std::fmt::Display;

/// Text made safe for HTML: names in records may hold markup.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '&' => safe.push_str("&amp;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c if c.is_control() && c != '\n' => safe.push('\u{fffd}'),
            c if crate::print::is_hidden(c) => safe.push_str(&crate::print::clean(&c.to_string())),
            c => safe.push(c),
        }
    }
    safe
}

/// A self-contained page around a body; the title is HTML already.
pub fn shell(title: &str, body: &str) -> String {
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>muprime: {title}</title>\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><style>{STYLE}</style></head>\
         <body><main>\n{body}</main></body></html>\n"
    )
}

const STYLE: &str = include_str!("style.css");

/// The style of a page for a part of another page, the one that this selector names.
pub fn scoped_style(selector: &str) -> String {
    // What a page is as a whole is that part, and its media rules stay within it.
    let nested = STYLE.replace(":root{", "&{").replace("body{", "&{");
    format!("{selector}{{{nested}}}")
}

/// A paragraph below a figure or a table.
pub fn note(text: &str) -> String {
    format!("<p class=\"note\">{text}</p>\n")
}

/// What stands at the top of a page: pairs of a name and a value, both plain text.
pub fn head(pairs: &[(&str, String)]) -> String {
    let item =
        |(name, value): &(&str, String)| format!("<dt>{}</dt><dd>{}</dd>", escape(name), escape(value));
    format!("<dl class=\"head\">{}</dl>\n", pairs.iter().map(item).collect::<String>())
}

/// A list of plain texts, or the text for none.
pub fn list(items: impl IntoIterator<Item = impl Display>, none: &str) -> String {
    let items: String =
        items.into_iter().map(|item| format!("<li>{}</li>", escape(&item.to_string()))).collect();
    if items.is_empty() { format!("<p>{}</p>", escape(none)) } else { format!("<ul>{items}</ul>") }
}

/// The head of a column, HTML already. One that begins with `#` is over numbers; an empty one is no head.
pub fn column(title: &str) -> String {
    match (title.strip_prefix('#'), title) {
        (Some(title), _) => format!("<th scope=\"col\" class=\"n\">{title}</th>"),
        (None, "") => "<td></td>".into(),
        (None, title) => format!("<th scope=\"col\">{title}</th>"),
    }
}

/// The heads of columns, with `|` between them.
pub fn columns(titles: &str) -> String {
    titles.split('|').map(column).collect()
}

/// A cell of a table, HTML already.
pub(crate) fn cell(text: impl Display) -> String {
    format!("<td>{text}</td>")
}

/// A cell with a number.
pub(crate) fn numeric(text: impl Display) -> String {
    format!("<td class=\"n\">{text}</td>")
}

/// A row of a table: its head and its cells, HTML already.
pub(crate) fn row(head: impl Display, cells: impl IntoIterator<Item = String>) -> String {
    format!("<tr><th scope=\"row\">{head}</th>{}</tr>", cells.into_iter().collect::<String>())
}

/// A table that scrolls by itself where the page is narrower, also by the keyboard. Head and rows are HTML already.
pub fn table(label: &str, head: &str, rows: impl IntoIterator<Item = String>) -> String {
    let rows: String = rows.into_iter().collect();
    format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\"><table><thead><tr>{head}</tr></thead>\
         <tbody>{rows}</tbody></table></div>\n",
        escape(label)
    )
}

/// A bar of so many pixels; the number stands beside it, so it says nothing to who cannot see it.
pub fn bar(pixels: f64) -> String {
    format!("<span class=\"bar\" aria-hidden=\"true\" style=\"width:{pixels:.0}px\"></span>")
}

/// The field's words that the pages use.
const WORDS: [(&str, &str); 11] = [
    ("amplitude w", "Vibration of the plate out of plane, peak to peak."),
    (
        "relative friction \u{3bc}'",
        "Mean lateral force with vibration over the force without, at the same load: 1 is no reduction, 0 is no friction.",
    ),
    (
        "\u{3a8}",
        "U / (w f \u{3bc}0 (1+\u{3bd})), Eq. 17 of the paper: how far the finger slides in a cycle, against how far its skin gives before it slips.",
    ),
    (
        "recalibrated baseline",
        "The spring-slider with stiffnesses and \u{3bc}0 fitted within their stated uncertainties, no further effect.",
    ),
    (
        "verdict's model",
        "That baseline with the effects that the verdict names, and a smooth departure from their form; where none is named, the average of the likeliest models.",
    ),
    ("gap", "What the baseline leaves of the measurement beyond its repeatability."),
    ("repeatability", "Scatter of passes at one condition."),
    ("held-out passes", "Passes that the model did not see when it was fitted."),
    (
        "95 % interval",
        "The range that holds the true value in 95 of 100 such tables, if the model's form is right.",
    ),
    (
        "nat",
        "Unit of evidence: one nat makes one hypothesis e = 2.7 times as probable against the other, 4.6 nats a hundred times.",
    ),
    (
        "suspect pass",
        "A pass that lies farther from every model than its scatter explains; it weighs little.",
    ),
];

/// The glossary.
pub fn glossary() -> String {
    let items: String =
        WORDS.iter().map(|(word, means)| format!("<dt>{word}</dt><dd>{means}</dd>")).collect();
    format!("<h2>Words</h2><dl class=\"words\">{items}</dl>\n")
}

#[cfg(test)]
mod tests {
    #[test]
    fn markup_and_terminal_escapes_in_names_are_harmless() {
        let bad = "<script>alert('x')</script>\u{1b}[31m\"&";
        let safe = super::escape(bad);
        assert!(
            !safe.contains('<') && !safe.contains('\u{1b}') && !safe.contains('"') && !safe.contains('\'')
        );
    }
}

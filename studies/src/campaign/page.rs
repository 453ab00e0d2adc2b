//! The page of a campaign: each statement with its answer, each factor with its figure.

use super::claims::{Claim, Trend, claims};
use super::measured::{Driven, FACTORS, Measured, groups, mean};
use models::psi::PsiEq17;
use models::{Condition, Covariate, FrictionModel, SpringSlider, Surrogate};
use runs::campaign::{CampaignFile, sessions};
use runs::format::number;
use runs::report::html::{escape, head, list, note, shell, table};
use runs::report::plots::campaign::{Series, against, against_psi};
use runs::report::plots::{ends, mark_name};
use std::fmt::Write;

/// Points of a model's curve.
const CURVE: u32 = 40;

/// The page of a campaign as HTML, and the answers on it.
pub fn page(file: &CampaignFile, made: &[Measured]) -> miette::Result<(String, Vec<Claim>)> {
    let claims = claims(made, file.margin);
    let planned = sessions(file).len();
    let title = escape(&file.name);
    let mut html = String::new();
    let w = &mut html;
    let cell_words = |cell: &runs::campaign::Cell| {
        let more = cell.tip.iter().chain(Some(&cell.condition).filter(|text| !text.is_empty()));
        format!("{} ({}{})", cell.name, cell.setup, more.map(|text| format!(", {text}")).collect::<String>())
    };
    let facts = [
        ("plan", file.plan.clone()),
        ("cells", file.cell.iter().map(cell_words).collect::<Vec<_>>().join("; ")),
        ("sessions", format!("{} of {planned} complete, in {} blocks", made.len(), file.blocks)),
        ("margin", format!("a change of \u{3bc}' up to {} does not matter", number(file.margin))),
    ];
    let _ = write!(w, "<h1>{title}</h1><p>{}</p>{}", escape(&file.about), head(&facts));
    if made.len() < planned {
        let _ = write!(w, "<p class=\"verdict\">The campaign is not complete: answers may change.</p>");
    }
    let _ = write!(w, "<h2>What the paper states, and what this campaign found</h2>{}", answers(&claims));
    w.push_str(&note(
        "The change of \u{3bc}' with its 95 % interval over sessions, or over cells where cells differ in it (mu_0, modulus, kind \
         of tip). It falls or rises where the whole interval lies beyond the margin, it does not matter where the whole interval \
         lies within, and else it is undecided: then a change beyond the last column would have been decided. Statements are \
         those of Vezzoli et al., in words of this page.",
    ));
    w.push_str("<h2>Relative friction by factor</h2>\n<div class=\"panels\">");
    for factor in FACTORS {
        w.push_str(&figure(file, made, factor)?);
    }
    w.push_str(&across_mu0(file, made)?);
    w.push_str("</div>");
    let names = file.cell.iter().enumerate().map(|(i, c)| format!("{}: {}", mark_name(i), c.name));
    w.push_str(&note(&escape(&format!(
        "{}. A mark is the mean over sessions, its bar their standard deviation. Lines with bands: the spring-slider with twice its \
         standard uncertainty. Dashed: the finite element ridge, within its table.",
        names.collect::<Vec<_>>().join("; ")
    ))));
    let _ = write!(w, "<h2>Eq. 20</h2>{}", collapse(file, made)?);
    w.push_str(&note(
        "All passes with vibration. Grey: Eq. 20 with the paper's &Psi;* = 2.38 &plusmn; 0.21, where w is the whole stroke and where \
         it is the sine's amplitude.",
    ));
    let _ = write!(w, "<h2>Sessions</h2>{}", session_table(file, made));
    let _ = write!(w, "<h2>For the methods section of a paper</h2><p>{}</p>", escape(&methods(file, made)));
    let next = [
        "muprime diagnose sessions/NAME tells of one session whether an unmodelled effect (recovery of the skin, damping, air) \
                 causes what is left",
    ];
    let _ = write!(w, "<h2>Next</h2>{}", list(next, ""));
    Ok((shell(&title, &html), claims))
}

/// What was done, in sentences for a paper; nothing that the sessions do not hold.
fn methods(file: &CampaignFile, made: &[Measured]) -> String {
    let all: Vec<Driven> = made.iter().flat_map(|s| s.driven.iter().copied()).collect();
    let range = |factor: &&'static Covariate| {
        let values: Vec<f64> = all.iter().filter_map(|d| factor.of(&d.condition)).collect();
        let [low, high] = ends(&values).map(|v| number(v * factor.shown.0));
        (!values.is_empty() && low != high)
            .then(|| format!("{} {low} to {high} {}", factor.words, factor.shown.1))
    };
    let ranges: Vec<String> = FACTORS.iter().filter_map(range).collect();
    let mu0: Vec<f64> = made.iter().filter_map(|s| s.mu0).collect();
    let [low, high] = ends(&mu0).map(number);
    if mu0.is_empty() {
        return "No session is complete yet.".into();
    }
    format!(
        "{} tips and conditions were measured in {} sessions of {} blocks, in random order within a block (seed {}), with {} passes \
         under vibration ({}). The Coulomb friction coefficient of a session is that of its passes without vibration ({low} to {high}). \
         Effects are differences of relative friction between the ends of a factor's range at equal settings of all other factors, \
         with Student's 95 % intervals over sessions, or over tips and conditions where these differ in it. A statement counts as \
         supported or contradicted where the whole interval lies on one side of a margin of {}. Software: muprime {}.",
        file.cell.len(),
        made.len(),
        file.blocks,
        file.seed,
        all.len(),
        ranges.join("; "),
        number(file.margin),
        env!("CARGO_PKG_VERSION")
    )
}

fn answers(claims: &[Claim]) -> String {
    let row = |claim: &Claim| {
        let (change, visible) = match (claim.effect, claim.visible) {
            (Some(e), Some(visible)) => {
                (format!("{:+.3} [{:+.3}, {:+.3}]", e.change, e.ci95[0], e.ci95[1]), number(visible))
            }
            _ => ("none".to_string(), String::new()),
        };
        let expected = match claim.expected {
            Trend::Falls => "falls",
            Trend::Rises => "rises",
            Trend::Same => "no change",
        };
        format!(
            "<tr><td>{} <span class=\"note\">({})</span></td><td>{expected}</td><td>{}</td><td class=\"n\">{change}</td>\
             <td><strong>{}</strong></td><td class=\"n\">{visible}</td></tr>\n",
            escape(claim.statement),
            escape(claim.source),
            escape(&claim.of),
            claim.words()
        )
    };
    let rows: String = claims.iter().map(row).collect();
    let head = "<th>statement</th><th>expected</th><th>measured over</th><th>change of \u{3bc}'</th><th>answer</th><th>decided beyond</th>";
    table("Statements of the paper with their answers", head, [rows])
}

fn of_cell(made: &[Measured], cell: usize) -> impl Iterator<Item = &Measured> {
    made.iter().filter(move |s| s.session.cell == cell)
}

/// Relative friction against a factor at the settings that have most levels of it; nothing where no session
/// varies it.
fn figure(file: &CampaignFile, made: &[Measured], factor: &'static Covariate) -> miette::Result<String> {
    let all: Vec<Driven> = made.iter().flat_map(|s| s.driven.iter().copied()).collect();
    let found = groups(factor, &all);
    let most = found.iter().max_by_key(|(_, levels)| levels.len()).filter(|(_, levels)| levels.len() > 1);
    let Some((_, levels)) = most else { return Ok(String::new()) };
    let (scale, unit) = factor.shown;
    let values: Vec<f64> =
        levels.values().filter_map(|l| mean(l.iter().filter_map(|d| factor.of(&d.condition)))).collect();
    let [low, high] = ends(&values);
    let ridge = Surrogate::shipped().ok();
    let series = |cell: usize| {
        let mut series = Series::default();
        // Levels are those of the whole campaign; each session's mean counts once.
        for (value, level) in values.iter().zip(levels.values()) {
            let own: Vec<f64> = of_cell(made, cell).filter_map(|s| mean_near(s, level)).collect();
            if let Some(m) = mean(own.iter().copied()) {
                let square = own.iter().map(|v| (v - m).powi(2)).sum::<f64>();
                let sd = if own.len() > 1 { (square / (own.len() - 1) as f64).sqrt() } else { 0.0 };
                series.points.push((scale * value, m, sd));
            }
        }
        let Some(first) = of_cell(made, cell).next() else { return series };
        let base = levels.values().flatten().next().map(|d| d.condition);
        let mu0 = mean(of_cell(made, cell).filter_map(|s| s.mu0));
        let (Some(base), Some(mu0), Ok(slider)) = (base, mu0, SpringSlider::new(first.finger)) else {
            return series;
        };
        let ridge = ridge.clone().map(|r| r.for_finger(&first.finger));
        for k in 0..=CURVE {
            let mut at = Condition { mu0, ..base };
            let value = low * (high / low).powf(f64::from(k) / f64::from(CURVE));
            factor.put(&mut at, value);
            if let Ok(p) = slider.predict(&at) {
                series.slider.push((scale * value, p.mu_relative, p.mu_relative_sd));
            }
            let inside = ridge.as_ref().and_then(|r| r.predict(&at).ok());
            if let Some(p) = inside.filter(|p| p.validity == models::prediction::Validity::Inside) {
                series.ridge.push((scale * value, p.mu_relative));
            }
        }
        series
    };
    let all: Vec<Series> = (0..file.cell.len()).map(series).collect();
    let svg = against(&format!("{}, {unit}", factor.words), low > 0.0, &all)?;
    Ok(format!("<figure>{svg}</figure>"))
}

/// Mean relative friction of a session's passes at the conditions of a level.
fn mean_near(session: &Measured, level: &[Driven]) -> Option<f64> {
    let near = |a: &Condition, b: &Condition| {
        FACTORS.iter().all(|f| match (f.of(a), f.of(b)) {
            (Some(a), Some(b)) => (a / b).ln().abs() < 0.08,
            (a, b) => a.is_none() == b.is_none(),
        })
    };
    let model = level.first()?;
    mean(session.driven.iter().filter(|d| near(&d.condition, &model.condition)).map(|d| d.mu))
}

/// Mean relative friction of each session against its `mu_0`.
fn across_mu0(file: &CampaignFile, made: &[Measured]) -> miette::Result<String> {
    let series = |cell: usize| Series {
        points: of_cell(made, cell).filter_map(|s| Some((s.mu0?, s.mean_mu()?, 0.0))).collect(),
        ..Series::default()
    };
    let all: Vec<Series> = (0..file.cell.len()).map(series).collect();
    if all.iter().all(|s| s.points.is_empty()) {
        return Ok(String::new());
    }
    let svg = against("Coulomb friction coefficient of the session", false, &all)?;
    Ok(format!(
        "<figure>{svg}<figcaption>Mean of all passes with vibration of a session.</figcaption></figure>"
    ))
}

fn collapse(file: &CampaignFile, made: &[Measured]) -> miette::Result<String> {
    let of = |cell: usize| -> Vec<(f64, f64)> {
        let passes = of_cell(made, cell).flat_map(|s| s.driven.iter().map(|d| (d, s.finger.poisson_ratio)));
        passes.map(|(d, nu)| (PsiEq17::at(&d.condition, nu).0, d.mu)).collect()
    };
    let all: Vec<_> = (0..file.cell.len()).map(|i| (file.cell[i].name.clone(), of(i))).collect();
    if all.iter().all(|(_, points)| points.is_empty()) {
        return Ok("<p>No pass with vibration yet.</p>".into());
    }
    Ok(format!("<figure>{}</figure>", against_psi(&all)?))
}

fn session_table(file: &CampaignFile, made: &[Measured]) -> String {
    let row = |session: runs::campaign::CampaignRun| {
        let done = made.iter().find(|s| s.session.number == session.number);
        let (folder, cell) = (escape(&session.folder.display().to_string()), &file.cell[session.cell]);
        let (state, mu0, passes, link) = match done {
            None => ("to be made", String::new(), String::new(), folder),
            Some(s) => {
                let link = format!("<a href=\"{folder}/report.html\">{folder}</a>");
                ("complete", s.mu0.map_or("unknown".into(), number), s.driven.len().to_string(), link)
            }
        };
        format!(
            "<tr><td class=\"n\">{}</td><td class=\"n\">{}</td><td>{}</td><td>{}</td><td>{link}</td><td>{state}</td>\
             <td class=\"n\">{mu0}</td><td class=\"n\">{passes}</td></tr>\n",
            session.number,
            session.block,
            escape(&cell.name),
            escape(&cell.condition)
        )
    };
    let rows: String = sessions(file).into_iter().map(row).collect();
    let head = "<th>session</th><th>block</th><th>cell</th><th>condition</th><th>folder</th><th>state</th>\
                <th>\u{3bc}<sub>0</sub></th><th>passes with vibration</th>";
    table("Sessions in the order of measurement", head, [rows])
}

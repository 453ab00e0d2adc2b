//! Files of another shape than that of their kind.

use super::nearest::nearest;
use super::*;
use crate::schemas::schema::Kind;

fn problems_of(kind: Kind, text: &str) -> String {
    let mut problems = Problems::of("file", text);
    toml(&kind.schema(), text, &mut problems);
    problems.end().err().map(|e| format!("{e}")).unwrap_or_default()
}

#[test]
fn all_that_is_misshapen_is_reported_at_once() {
    let plan = runs::bundled::text(runs::plan::BUNDLED, "first-sweep").unwrap();
    assert_eq!(problems_of(Kind::Plan, plan), "");
    let wrong = plan
        .replacen("seed", "sead", 1)
        .replacen("speed_m_s = 0.02", "speed_m_s = \"fast\"", 1)
        .replacen("normal_force_n", "normal_force", 1);
    let message = problems_of(Kind::Plan, &wrong);
    for part in ["sead is not known", "speed_m_s is text", "normal_force_n is missing"] {
        assert!(message.contains(part), "{part}: {message}");
    }
}

#[test]
fn no_bundled_file_is_misshapen() {
    for bundled in crate::schemas::bundled::all() {
        let kind = Kind::all().find(|k| k.name() == bundled.kind).unwrap();
        assert_eq!(problems_of(kind, bundled.text), "", "{}", bundled.name);
    }
}

#[test]
fn a_value_in_another_unit_is_not_judged_as_if_it_were_in_this_one() {
    let setup = runs::bundled::text(runs::setup::BUNDLED, "virtual-ideal").unwrap();
    let wrong = setup.replacen("[limits]", "[limits]\nspeed_max_mm_s = 250", 1);
    let meant = as_meant(&Kind::Setup.schema(), &wrong).unwrap();
    assert!(!meant.contains("250"), "{meant}");
    assert_eq!(
        nearest("speed_max_mm_s", &["speed_max_m_s"]).unwrap(),
        "did you mean `speed_max_m_s`? It is in m/s, or a text with its unit"
    );
}

#[test]
fn texts_in_place_of_numbers_have_a_remedy() {
    let plan = runs::bundled::text(runs::plan::BUNDLED, "first-sweep").unwrap();
    let helps = |from: &str, to: &str| {
        let text = plan.replacen(from, to, 1);
        assert_ne!(text, plan);
        let mut problems = Problems::of("file", &text);
        toml(&Kind::Plan.schema(), &text, &mut problems);
        let why = problems.end().unwrap_err();
        format!("{why}: {}", why.help().unwrap())
    };
    let help = helps("normal_force_n = 0.25", "normal_force_n = \"0,9 N\"");
    assert!(
        help.ends_with("a number, or a text with its unit, is needed: a number has a decimal point: 0.9 N"),
        "{help}"
    );
    let help = helps("normal_force_n = 0.25", "normal_force_n = \"0.9\"");
    assert!(help.ends_with("write it without quotation marks: 0.9"), "{help}");
}

#[test]
fn misspelt_names_find_theirs() {
    assert_eq!(
        nearest("amplitud_pp_m", &["amplitude_pp_m", "speed_m_s"]).unwrap(),
        "did you mean `amplitude_pp_m`?"
    );
    assert_eq!(nearest("colour", &["amplitude_pp_m"]), None);
}

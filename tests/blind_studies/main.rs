//! Studies of the diagnosis on sealed sets, beside the score of `muprime blind`. Their figures are in
//! docs/diagnosis/figures.md and docs/diagnosis/sensitivity.md. Without numbers: 20 sets from seed 1.
//!
//! `cargo run --release -p muprime-tests --example blind_studies -- same-form [SETS [SEED]]`: how often the
//! intervals of sizes cover. `... -- further [SETS [SEED]]`: designed next experiments against random ones.
//! `... -- sensitivity [SETS [SEED [WHICH]]]`: each constant halved and doubled; WHICH is `fit`, `decision`
//! or the name of a constant.

mod further;
mod same_form;
mod sensitivity;

/// A set on standard error as it ends: one JSON document a line.
fn line(set: &impl serde::Serialize) {
    eprintln!("{}", serde_json::to_string(set).expect("numbers and names"));
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number =
        |at: usize, default: u64| arguments.get(at).map_or(default, |n| n.parse().expect("a number"));
    let (sets, seed) = (number(1, 20), number(2, 1));
    match arguments.first().map(String::as_str) {
        Some("same-form") => same_form::run(seed, sets),
        Some("further") => further::run(seed, sets),
        Some("sensitivity") => sensitivity::run(seed, sets as usize, arguments.get(3).map_or("all", |s| s)),
        _ => panic!("same-form, further or sensitivity is needed: the head of tests/blind_studies/main.rs"),
    }
}
